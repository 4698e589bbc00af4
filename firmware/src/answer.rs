//! What is read off the factor on the device: outside the sample path, a few times a second.

use heapless::Vec;
use rigident_shared::factor::InformationFactor;
use rigident_shared::wire::{FACTOR_CHUNK, FactorChunk};

use crate::sample_path::BodyFactor;

/// Numbers of the largest factor.
const MAX_ENTRIES: usize = InformationFactor::<f32, 16>::ENTRIES;

/// A solution of either model.
pub(crate) struct Solved {
    pub(crate) estimate: Vec<f32, 16>,
    pub(crate) standard_deviation: Vec<f32, 16>,
    pub(crate) determined: Vec<bool, 16>,
    pub(crate) condition_number: f32,
}

pub(crate) fn solve(factor: &BodyFactor) -> Solved {
    fn of<const N: usize>(factor: &InformationFactor<f32, N>) -> Solved {
        let solution = factor.solve();
        Solved {
            estimate: Vec::from_slice(&solution.estimate).unwrap_or_default(),
            standard_deviation: Vec::from_slice(&solution.standard_deviation).unwrap_or_default(),
            determined: Vec::from_slice(&solution.determined).unwrap_or_default(),
            condition_number: solution.condition_number,
        }
    }
    match factor {
        BodyFactor::Ten(factor) => of(factor),
        BodyFactor::Sixteen(factor) => of(factor),
    }
}

/// A factor as numbers, kept while the host fetches them chunk by chunk.
pub(crate) struct FactorSnapshot {
    parameters: u8,
    rows: u32,
    entries: Vec<f32, MAX_ENTRIES>,
}

impl FactorSnapshot {
    pub(crate) fn new(factor: &BodyFactor) -> Self {
        fn of<const N: usize>(factor: &InformationFactor<f32, N>) -> FactorSnapshot {
            let entries = factor.entries().take(MAX_ENTRIES).collect();
            FactorSnapshot { parameters: N as u8, rows: factor.rows(), entries }
        }
        match factor {
            BodyFactor::Ten(factor) => of(factor),
            BodyFactor::Sixteen(factor) => of(factor),
        }
    }

    pub(crate) fn total(&self) -> u16 {
        self.entries.len() as u16
    }

    pub(crate) fn chunk(&self, offset: u16) -> Option<FactorChunk> {
        let rest = self.entries.get(usize::from(offset)..).filter(|rest| !rest.is_empty())?;
        let part = rest.get(..FACTOR_CHUNK).unwrap_or(rest);
        Some(FactorChunk {
            parameters: self.parameters,
            rows: self.rows,
            total: self.total(),
            offset,
            entries: Vec::from_slice(part).ok()?,
        })
    }
}

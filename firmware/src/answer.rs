//! What is read off the factor on the device: outside the sample path, a few times a second.

use heapless::Vec;
use rigident_shared::consistency::{ITERATIONS, Nearest, nearest};
use rigident_shared::factor::InformationFactor;
use rigident_shared::wire::{Consistency, FACTOR_CHUNK, FactorChunk, MAX_PARAMETERS};

use crate::sample_path::{ModelFactor, of_factor};

/// Numbers of the largest factor.
const MAX_ENTRIES: usize = InformationFactor::<f32, MAX_PARAMETERS>::ENTRIES;

/// A solution of any model.
pub(crate) struct Solved {
    pub(crate) estimate: Vec<f32, MAX_PARAMETERS>,
    pub(crate) standard_deviation: Vec<f32, MAX_PARAMETERS>,
    pub(crate) determined: Vec<bool, MAX_PARAMETERS>,
    pub(crate) condition_number: f32,
}

pub(crate) fn solve(factor: &ModelFactor) -> Solved {
    fn of<const N: usize>(factor: &InformationFactor<f32, N>) -> Solved {
        let solution = factor.solve();
        Solved {
            estimate: Vec::from_slice(&solution.estimate).unwrap_or_default(),
            standard_deviation: Vec::from_slice(&solution.standard_deviation).unwrap_or_default(),
            determined: Vec::from_slice(&solution.determined).unwrap_or_default(),
            condition_number: solution.condition_number,
        }
    }
    of_factor!(factor, factor => of(factor))
}

/// The body that is nearest to the free answer.
pub(crate) struct Body {
    /// The free answer where the rows do not determine it.
    pub(crate) estimate: Vec<f32, MAX_PARAMETERS>,
    pub(crate) consistency: Consistency,
    pub(crate) distance_sd: f32,
}

/// At most [`ITERATIONS`] Newton steps, so that the time it takes is bounded. `solved` is the factor's.
pub(crate) fn body(factor: &ModelFactor, solved: &Solved) -> Body {
    fn of<const N: usize>(factor: &InformationFactor<f32, N>, free: &[f32]) -> Option<Body> {
        let free = free.first_chunk::<N>()?;
        let nearest = nearest(factor, free, ITERATIONS);
        let estimate = nearest.parameters(free)?;
        Some(Body {
            estimate: Vec::from_slice(&estimate).ok()?,
            consistency: match nearest {
                Nearest::Free => Consistency::Free,
                Nearest::Projected(_) => Consistency::Projected,
                Nearest::NotConverged(_) => Consistency::NotConverged,
                Nearest::NotDetermined => Consistency::NotDetermined,
            },
            distance_sd: nearest.distance_sd()?,
        })
    }
    let found = match factor {
        ModelFactor::Ten(factor) => of(factor, &solved.estimate),
        ModelFactor::Sixteen(factor) => of(factor, &solved.estimate),
        // Base parameters of several links may be those of bodies in many ways.
        ModelFactor::Nineteen(_) | ModelFactor::TwentyFive(_) => None,
    };
    found.unwrap_or_else(|| Body {
        estimate: solved.estimate.clone(),
        consistency: Consistency::NotDetermined,
        distance_sd: 0.0,
    })
}

/// A factor as numbers, kept while the host fetches them chunk by chunk.
pub(crate) struct FactorSnapshot {
    parameters: u8,
    rows: u32,
    entries: Vec<f32, MAX_ENTRIES>,
}

impl FactorSnapshot {
    pub(crate) fn new(factor: &ModelFactor) -> Self {
        fn of<const N: usize>(factor: &InformationFactor<f32, N>) -> FactorSnapshot {
            let entries = factor.entries().take(MAX_ENTRIES).collect();
            FactorSnapshot { parameters: N as u8, rows: factor.rows(), entries }
        }
        of_factor!(factor, factor => of(factor))
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

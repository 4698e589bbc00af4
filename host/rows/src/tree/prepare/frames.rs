//! From the columns of links and joints to frames.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use rigident_shared::tree::BaseMotion;

use super::{JointColumns, Preparation};
use crate::tree::contact::Ground;
use crate::tree::joints::{Resolved, Seen, attitude, resolve};
use crate::tree::{Frame, TreePrepareError};

/// The columns that say how links move, by the links' indices in the model.
#[derive(Default)]
pub(super) struct LinkColumns<'a> {
    /// The index in the model of every numbered link.
    pub(super) numbering: Vec<Option<usize>>,
    pub(super) joints: BTreeMap<usize, JointColumns>,
    /// Attitudes relative to S, unit quaternions w, x, y, z.
    pub(super) attitudes: BTreeMap<usize, &'a Vec<[f64; 4]>>,
    /// Angular rates in the links' frames, rad/s.
    pub(super) gyros: BTreeMap<usize, Vec<Vector3<f64>>>,
}

impl LinkColumns<'_> {
    /// Returns the number by which the recording's columns name link `i`.
    pub(super) fn number(&self, i: usize) -> Option<usize> {
        self.numbering.iter().position(|n| *n == Some(i))
    }
}

/// Positions and rates of joints with columns, and which samples have them.
pub(super) struct Coordinates {
    pub(super) series: BTreeMap<usize, Vec<(f64, f64)>>,
    pub(super) is_valid: Vec<bool>,
}

/// The forces that were measured, sample by sample.
pub(super) struct Forces {
    /// On the base link, N and N m.
    pub(super) wrench: Option<Vec<[f64; 6]>>,
    /// By freedoms, N or N m; empty where none were measured.
    pub(super) efforts: Vec<Vec<f64>>,
    /// The contacts of feet; empty where there are none.
    pub(super) ground: Vec<Ground>,
}

impl Preparation<'_> {
    /// Makes the frames of all samples that can be used.
    pub(super) fn frames(
        &mut self,
        columns: &LinkColumns<'_>,
        coordinates: &Coordinates,
        base: &dyn Fn(usize) -> BaseMotion<f64>,
        forces: &Forces,
    ) -> Result<Vec<Frame>, TreePrepareError> {
        let recording = self.recording;
        let mut misfits = vec![0.0_f64; self.model.links.len()];
        let mut frames = Vec::new();
        let mut unusable = 0;
        for row in 0..recording.rows() {
            if !coordinates.is_valid.get(row).copied().unwrap_or(true) {
                continue;
            }
            if self.saturated(row) {
                unusable += 1;
                continue;
            }
            let motion = base(row);
            let links = self.links(row, columns, coordinates, motion.rate, &mut misfits)?;
            frames.push(Frame {
                time_ns: recording.time_ns.get(row).copied().unwrap_or(row as u64 * 1_000_000_000),
                positions: links.iter().flat_map(|l| l.positions.iter().copied()).collect(),
                rates: links.iter().flat_map(|l| l.rates.iter().copied()).collect(),
                base: motion,
                wrench: forces.wrench.as_ref().map_or([0.0; 6], |w| w[row]),
                efforts: forces.efforts.iter().map(|c| c[row]).collect(),
                standing: Vec::new(),
                ground: forces.ground.get(row).cloned().unwrap_or_default(),
            });
        }
        if frames.is_empty() {
            return Err(self
                .missing("frames of motion are", "the recording is shorter than what rates are taken from"));
        }
        if unusable > 0 {
            self.notes.push(format!("{unusable} readings at the limit of a sensor's range were not used"));
        }
        self.judge_misfits(&misfits, frames.len(), columns)?;
        Ok(frames)
    }

    /// Resolves the joints of one sample, from the base outwards; the squares of what they cannot do go to
    /// `misfits`.
    fn links(
        &self,
        row: usize,
        columns: &LinkColumns<'_>,
        coordinates: &Coordinates,
        base_rate: Vector3<f64>,
        misfits: &mut [f64],
    ) -> Result<Vec<Resolved>, TreePrepareError> {
        let mut links = vec![Resolved {
            attitude: Matrix3::identity(),
            rate: base_rate,
            positions: Vec::new(),
            rates: Vec::new(),
            misfit: 0.0,
        }];
        for (i, link) in self.model.links.iter().enumerate().skip(1) {
            let own = match (coordinates.series.get(&i), columns.attitudes.get(&i)) {
                (Some(series), _) => Seen::Coordinate(series[row].0, series[row].1),
                (None, Some(rows)) => self.by_attitude(row, i, rows, columns)?,
                (None, None) => continue,
            };
            let parent = &links[link.link.parent];
            let resolved = resolve(&link.link, parent, &own)
                .ok_or_else(|| self.missing(self.missing_of(i).0, self.missing_of(i).1))?;
            misfits[i] += resolved.misfit * resolved.misfit;
            links.push(resolved);
        }
        Ok(links)
    }

    fn by_attitude(
        &self,
        row: usize,
        i: usize,
        rows: &[[f64; 4]],
        columns: &LinkColumns<'_>,
    ) -> Result<Seen, TreePrepareError> {
        let recording = self.recording;
        let j = columns.number(i).unwrap_or(i);
        let attitude = attitude(&rows[row]).ok_or_else(|| TreePrepareError::Cell {
            name: recording.file(),
            column: format!("q{j}_w … q{j}_z"),
            row: recording.place(row),
            reason: format!("{:?} is no unit quaternion w, x, y, z", rows[row]),
        })?;
        let rate = match columns.gyros.get(&i) {
            Some(rates) if !recording.is_static => rates[row],
            _ => Vector3::zeros(),
        };
        Ok(Seen::Link { attitude, rate })
    }
}

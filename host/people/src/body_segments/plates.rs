//! Errors of force plates that a person's motion tells of: how far a plate is from where the file has it, and
//! its scale.
//!
//! Of each trial the rows have columns beside the parameters: of plate p a shift `s × F_p` along x and y, its
//! scale `F_p, M_p`, its tilt about x and y, and the zero of a plate that was always loaded. A plate that
//! leans by half a degree has a load 8 mm beside that of a level one. They are estimated together with the
//! parameters and the table; centres of pressure under the feet are further rows of the shifts. A scale
//! that all plates share is one with the mass, so plates are compared.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use super::error::StudyError;
use super::ground::{PLACE_M, TILT, tilted};
use super::motion::{MOST_FRAMES, Motion};
use super::study::{Study, known};
use crate::person::noise::{RowSums, sigma};
use crate::person::track::UsedPlate;
use crate::person::{Footprint, Person, Tracked, footprints};
use rigident_fit::{Factor, Gaussian, OtherColumns, Silent, plain_factor};
use rigident_rows::tree::{TreeSource, UnknownZero, with_wrenches};

/// A shift of a plate beforehand, 1 σ, m: as good as nothing is known.
const SHIFT_M: f64 = 0.3;
/// A scale against the mean of all plates beforehand, 1 σ: as good as nothing is known, …
const SCALE: f64 = 0.3;
/// … but that the mean is one: that scale is one with the mass.
const MEAN_SCALE: f64 = 1e-3;
/// The channel of the vertical force.
const VERTICAL: usize = 2;
/// Columns of a plate: shift along x and y, scale.
const EACH: usize = 3;
/// A plate that carries a person in fewer frames tells nothing, …
const FEWEST: usize = 10;
/// … with less than this vertical force, N.
const CARRIES_N: f32 = 100.0;
/// A value less likely than this by chance is significant.
const SURPRISING: f64 = 1e-3;
/// A value farther from its mean than this is significant, standard deviations of either sign.
const SURPRISING_SD: f64 = 3.29;
/// Plates are calibrated to about 1 %: two that differ by less than this are not reported.
const LEAST_SCALE: f64 = 0.02;

/// The distance of a plate from where the file has it.
#[derive(Clone, Copy, Debug)]
pub struct Shift {
    /// The place in the file less the true one, along x and y, m.
    pub value_m: Vector2<f64>,
    /// The covariance of `value_m`, m².
    pub covariance: Matrix2<f64>,
}

impl Shift {
    /// Returns it if it is neither chance nor what intervals count for every plate: by χ² with two degrees of
    /// freedom, whose tail is `exp(−χ²/2)`.
    pub fn if_significant(self) -> Option<Self> {
        let counted = self.covariance + Matrix2::identity() * PLACE_M.powi(2);
        let chi2 = self.value_m.dot(&(counted.try_inverse()? * self.value_m));
        (chi2 > -2.0 * SURPRISING.ln()).then_some(self)
    }
}

/// The information of a trial about its plates.
#[derive(Clone, Debug)]
pub struct PlateErrors {
    /// The trial, by its number.
    pub trial: usize,
    /// The plates' names.
    pub plates: Vec<String>,
    /// Plates that carried the person, by their numbers.
    pub carrying: Vec<usize>,
    /// Shift along x and y, m, and scale error of each plate, plate by plate.
    pub values: Vec<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// True if different scales leave less of the vertical force than equal ones: that is where a scale is
    /// seen first, and in a second of standing moments alone are explained by anything.
    pub scales_explain: bool,
}

impl PlateErrors {
    /// Returns the pairs of plates that carried the person.
    pub fn pairs(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.carrying.iter().enumerate().flat_map(|(k, a)| self.carrying.iter().skip(k + 1).map(|b| (*a, *b)))
    }

    /// Returns the shift of a plate.
    pub fn shift(&self, plate: usize) -> Shift {
        let at = EACH * plate;
        Shift {
            value_m: Vector2::new(self.values[at], self.values[at + 1]),
            covariance: self.covariance.fixed_view::<2, 2>(at, at).into_owned(),
        }
    }

    /// Returns how many times what plate b reads plate a does, and 1 σ; `None` if that is one but for chance.
    pub fn ratio(&self, a: usize, b: usize) -> Option<[f64; 2]> {
        let [a, b] = [a, b].map(|plate| EACH * plate + 2);
        let variance = self.covariance[(a, a)] + self.covariance[(b, b)] - 2.0 * self.covariance[(a, b)];
        let (off, sigma) = (self.values[a] - self.values[b], variance.max(0.0).sqrt());
        let ratio = (1.0 + self.values[a]) / (1.0 + self.values[b]);
        (self.scales_explain && off.abs() > SURPRISING_SD * sigma && (ratio - 1.0).abs() > LEAST_SCALE)
            .then_some([ratio, sigma])
    }
}

/// Returns what each trial tells of its plates.
///
/// # Errors
/// [`StudyError`] if a trial has no rows.
pub fn plate_errors(study: &Study, person: &Person) -> Result<Vec<PlateErrors>, StudyError> {
    let mut trials: Vec<usize> = study.motions.iter().map(|motion| motion.trial).collect();
    trials.dedup();
    let of = |trial: usize| Some((trial, person.trials.get(trial)?));
    let found = trials.into_iter().filter_map(of);
    let found = found.map(|(trial, tracked)| of_trial(study, person, trial, tracked));
    found.filter_map(Result::transpose).collect()
}

fn of_trial(
    study: &Study,
    person: &Person,
    trial: usize,
    tracked: &Tracked,
) -> Result<Option<PlateErrors>, StudyError> {
    let n = study.parameters();
    let plates = EACH * tracked.plates.len();
    // This much of a long trial tells enough.
    let mut frames = 0;
    let is_looked_at = |motion: &&Motion| {
        frames += motion.frames.len();
        frames <= MOST_FRAMES
    };
    let motions = study.motions.iter().filter(|motion| motion.trial == trial).take_while(is_looked_at);
    let sources: Vec<(TreeSource, Range<usize>)> = motions
        .map(|motion| Ok((motion.source(person)?, motion.frames.clone())))
        .collect::<Result<_, StudyError>>()?;
    let wide: Vec<OtherColumns> =
        sources.iter().map(|(source, frames)| with_plates(source, tracked, frames.start)).collect();
    let of_scale = |scale: f64| beforehand(study.open(), tracked, scale);
    let (Some(before), Some(equal)) = (of_scale(SCALE), of_scale(MEAN_SCALE)) else { return Ok(None) };
    // The noise beside all that is estimated.
    let report = &tracked.report;
    let sums: Vec<RowSums> = wide
        .iter()
        .map(|wide| RowSums::of(wide, report.rate_hz, report.cut_off_hz))
        .collect::<Result<_, _>>()?;
    let Some(sigma) = sigma(&sums, &before) else { return Ok(None) };
    let mut rows = Factor::new(before.names().len());
    for (wide, sigma) in wide.iter().zip(&sigma) {
        rows.merge(&plain_factor(wide, sigma, &Silent)?);
    }
    add_footprints(&mut rows, n, &footprints(person, trial));
    let beside = |known: Factor| {
        let mut all = known;
        all.merge(&rows);
        all
    };
    let left = |known: Factor| -> f64 {
        let found = DVector::from_vec(beside(known).solve(f64::EPSILON * n as f64).estimate);
        sums.iter().map(|own| own.left(VERTICAL, &found)).sum()
    };
    let scales_explain = left(known(&before)) < left(known(&equal));
    let all = beside(known(&before));
    let kept: Vec<usize> = (n..n + plates).collect();
    let solved = all.eliminate_others(&kept).solve(f64::EPSILON * n as f64);
    let carries = |plate: &usize| {
        let own = &tracked.plates[*plate].wrench;
        own.iter().filter(|wrench| wrench[2] > CARRIES_N).count() >= FEWEST
    };
    Ok(Some(PlateErrors {
        trial,
        plates: tracked.plates.iter().map(|plate| plate.name.clone()).collect(),
        carrying: (0..tracked.plates.len()).filter(carries).collect(),
        values: solved.estimate,
        covariance: solved.covariance,
        scales_explain,
    }))
}

/// Returns what is known beforehand: the table, and next to nothing of plates but how far their scales
/// differ, 1 σ.
fn beforehand(table: &Gaussian, tracked: &Tracked, scale: f64) -> Option<Gaussian> {
    let (n, plates) = (table.names().len(), tracked.plates.len());
    let all = n + more_columns(tracked);
    let mut covariance = DMatrix::zeros(all, all);
    covariance.view_mut((0, 0), (n, n)).copy_from(table.covariance());
    for a in 0..plates {
        let at = n + EACH * a;
        (covariance[(at, at)], covariance[(at + 1, at + 1)]) = (SHIFT_M.powi(2), SHIFT_M.powi(2));
        for b in 0..plates {
            let same = f64::from(u8::from(a == b));
            covariance[(at + 2, n + EACH * b + 2)] =
                scale.powi(2) * (same - 1.0 / plates as f64) + MEAN_SCALE.powi(2);
        }
    }
    let tilts = std::iter::repeat_n(TILT, 2 * plates);
    let others = tilts.chain(tracked.unzeroed.iter().flat_map(UnknownZero::sigmas));
    for (at, sigma) in (n + EACH * plates..).zip(others) {
        covariance[(at, at)] = sigma.powi(2);
    }
    let more = (n..all).map(|k| format!("plate error {k}"));
    let names = table.names().iter().cloned().chain(more).collect();
    let mut mean = DVector::zeros(all);
    mean.rows_mut(0, n).copy_from(table.mean());
    Gaussian::new(names, mean, covariance)
}

/// Adds what feet say of the shifts, whose columns begin at `n`.
fn add_footprints(all: &mut Factor, n: usize, prints: &[Footprint]) {
    for print in prints {
        let axis = print.axis;
        let directions = [axis, Vector2::new(-axis.y, axis.x)];
        for ((direction, off), sigma) in directions.iter().zip(print.off_m).zip(Footprint::SIGMA_M) {
            let mut row = vec![0.0; all.parameters()];
            for k in 0..2 {
                row[n + EACH * print.plate + k] = direction[k] / sigma;
            }
            all.absorb([(row.as_slice(), off / sigma)]);
        }
    }
}

/// Returns the number of columns of a trial's errors.
fn more_columns(tracked: &Tracked) -> usize {
    (EACH + 2) * tracked.plates.len() + 6 * tracked.unzeroed.len()
}

/// Returns the rows of some frames of a trial, from one on, with the columns of its plates behind the
/// parameters.
fn with_plates<'a>(source: &'a TreeSource, tracked: &'a Tracked, first: usize) -> OtherColumns<'a> {
    with_wrenches(source, more_columns(tracked), move |sample| errors(tracked, first + sample))
}

/// Returns what errors of unit size add to the ground's wrench about the laboratory's origin in a frame, in
/// the order of the columns.
fn errors(tracked: &Tracked, frame: usize) -> Vec<[f64; 6]> {
    let mut all = Vec::new();
    let measured = |plate: &UsedPlate| plate.wrench.get(frame).map_or([0.0; 6], |w| w.map(f64::from));
    for plate in &tracked.plates {
        let own = measured(plate);
        let [x, y, z, ..] = own;
        // s × F
        all.extend([[0.0, 0.0, 0.0, 0.0, -z, y], [0.0, 0.0, 0.0, z, 0.0, -x], own]);
    }
    for plate in &tracked.plates {
        all.extend([0, 1].map(|axis| tilted(&measured(plate), plate.middle_m, axis)));
    }
    all.extend(tracked.unzeroed.iter().flat_map(UnknownZero::wrenches));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plate_is_accused_of_more_than_laboratories_are_off() {
        let of = |x: f64, y: f64| Shift {
            value_m: Vector2::new(x, y),
            covariance: Matrix2::identity() * 0.002_f64.powi(2),
        };
        // 5 mm along each, as found.
        assert!(of(0.005, 0.012).if_significant().is_none());
        assert!(of(0.0, 0.04).if_significant().is_some());
    }

    #[test]
    fn scales_that_leave_more_of_the_vertical_force_accuse_no_plate() {
        // One plate reads 1.4 times what the other does, by eight standard deviations.
        let with = |scales_explain: bool| PlateErrors {
            trial: 0,
            plates: vec![String::new(); 2],
            carrying: vec![0, 1],
            values: vec![0.02, 0.0, 0.167, 0.0, 0.0, -0.167],
            covariance: DMatrix::from_diagonal_element(6, 6, 0.03_f64.powi(2)),
            scales_explain,
        };
        let ratio = with(true).ratio(0, 1).unwrap()[0];
        assert!((ratio - 1.4).abs() < 0.01, "{ratio}");
        assert!(with(false).ratio(0, 1).is_none());
    }
}

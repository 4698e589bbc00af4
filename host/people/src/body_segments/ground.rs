//! The effect of unknown errors of force plates on the parameters: zeros, tilt, place and scale.
//!
//! Rows do not tell such an error: what people's soft parts and markers leave would be taken for it, and a
//! long trial would tell it surely and wrongly. The parameters are found as if plates were as the file has
//! them. An error moves a motion's own estimate by `X = (AᵀWA)⁺ AᵀW Z`, Z its wrench in the rows, and that of
//! several motions with factors R and the table's Σ by `J = (Σ⁻¹ + Σₖ RₖᵀRₖ)⁻¹ Σₖ RₖᵀRₖ Xₖ`; their covariance
//! grows by `J σ² Jᵀ`. A zero is a trial's own; tilt, place and scale of a plate are the same in all trials.

use nalgebra::{DMatrix, Vector3};

use super::error::StudyError;
use super::motion::Motion;
use crate::person::{Person, Tracked};
use rigident_fit::{Factor, RowSource as _, Silent, parallel, plain_factor};
use rigident_rows::tree::{UnknownZero, with_wrenches};

/// 1 σ of a plate's tilt against the cameras' vertical, about x and about y, rad: half a degree (assumed).
pub(super) const TILT: f64 = 0.5 * std::f64::consts::PI / 180.0;
/// 1 σ of a plate's place, along x and along y, m (assumed): that of its corners, and of its centres of
/// pressure.
pub(super) const PLACE_M: f64 = 0.007;
/// Of more motions than these some answer for their neighbours.
const LOOKED_AT: usize = 12;

/// The uncertainty of plates' scales, 1 σ, relative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlateScale {
    /// A scale that all plates share: of amplifiers, of the weights that they were calibrated with.
    pub common: f64,
    /// Each plate's own.
    pub own: f64,
}

impl Default for PlateScale {
    /// Returns plates of whose calibration nothing is known (assumed: makers state 0.5 to 1 % of the range,
    /// and scales of 1 to 4 % are found in laboratories).
    fn default() -> Self {
        Self { common: 0.01, own: 0.01 }
    }
}

/// Kinds of errors, by their names in the budget.
pub(super) const KINDS: [&str; 4] =
    ["zeros of plates", "tilt of plates", "places of plates", "scale of plates"];

/// Kinds of errors that change the level of everything that a plate measures.
pub(super) const LEVELS: [&str; 2] = [KINDS[0], KINDS[3]];

/// An error's column among all errors of the study, and its 1 σ.
#[derive(Clone, Copy)]
struct Place {
    column: usize,
    sigma: f64,
}

/// The effect of errors of the plates of all trials on estimates.
#[derive(Default)]
pub(super) struct GroundErrors {
    /// The kind of each error.
    kinds: Vec<usize>,
    /// `X σ` of each motion: the columns of its trial's errors among all, and one column for each of these.
    moved: Vec<(Vec<usize>, DMatrix<f64>)>,
}

impl GroundErrors {
    /// Returns the errors of a person's motions over `n` parameters.
    ///
    /// # Errors
    /// [`StudyError`] if a motion has no rows.
    pub(super) fn of(
        person: &Person,
        motions: &[Motion],
        n: usize,
        scale: PlateScale,
    ) -> Result<Self, StudyError> {
        let (kinds, trials) = places(person, scale);
        let none: Vec<Place> = Vec::new();
        let every = motions.len().div_ceil(LOOKED_AT).max(1);
        let looked_at: Vec<usize> =
            (0..motions.len()).filter(|k| answering(motions, *k, every) == *k).collect();
        let found = parallel::map(parallel::threads(), looked_at.len(), |k| {
            let motion = &motions[looked_at[k]];
            own_columns(person, motion, trials.get(motion.trial).unwrap_or(&none), n)
        });
        let found: Vec<DMatrix<f64>> = found.into_iter().collect::<Result<_, _>>()?;
        let of = |k: usize| {
            let own = trials.get(motions[k].trial).unwrap_or(&none);
            let answers = looked_at.iter().position(|own| *own == answering(motions, k, every)).unwrap_or(0);
            (own.iter().map(|place| place.column).collect(), found[answers].clone())
        };
        Ok(Self { kinds, moved: (0..motions.len()).map(of).collect() })
    }

    /// Returns `J σ` of some motions together with what is known of the parameters: one column an error.
    pub(super) fn moved(&self, motions: &[Motion], which: &[usize], known: &Factor) -> DMatrix<f64> {
        let n = known.parameters();
        if self.kinds.is_empty() {
            return DMatrix::zeros(n, 0);
        }
        let mut all = known.clone();
        let mut sum = DMatrix::zeros(n, self.kinds.len());
        for (motion, (columns, moved)) in
            which.iter().filter_map(|k| Some((motions.get(*k)?, self.moved.get(*k)?)))
        {
            let rows = motion.pooled.factor();
            let r = rows.r();
            all.merge(&rows);
            let own = r.transpose() * (&r * moved);
            for (column, own) in columns.iter().zip(own.column_iter()) {
                let mut to = sum.column_mut(*column);
                to += own;
            }
        }
        let r = all.r();
        let solved = r.tr_solve_upper_triangular(&sum).and_then(|half| r.solve_upper_triangular(&half));
        solved.unwrap_or(sum)
    }

    /// Returns `RᵀR X σ` of all motions, one column an error: what it adds to the right-hand side of the
    /// normal equations.
    pub(super) fn scores(&self, motions: &[Motion]) -> DMatrix<f64> {
        let n = motions.first().map_or(0, |motion| motion.pooled.factor().parameters());
        let mut sum = DMatrix::zeros(n, self.kinds.len());
        for (motion, (columns, moved)) in motions.iter().zip(&self.moved) {
            let r = motion.pooled.factor().r();
            let own = r.transpose() * (&r * moved);
            for (column, own) in columns.iter().zip(own.column_iter()) {
                let mut to = sum.column_mut(*column);
                to += own;
            }
        }
        sum
    }

    /// Returns the columns of one kind of errors.
    pub(super) fn of_kind(&self, kind: usize, moved: &DMatrix<f64>) -> DMatrix<f64> {
        let own: Vec<usize> = (0..moved.ncols()).filter(|k| self.kinds.get(*k) == Some(&kind)).collect();
        moved.select_columns(&own)
    }
}

/// Returns the motion that represents motion `k`: the first of each `every` successive motions of a trial.
fn answering(motions: &[Motion], k: usize, every: usize) -> usize {
    let first = motions.iter().position(|motion| motion.trial == motions[k].trial).unwrap_or(k);
    first + (k - first) / every * every
}

/// Returns the kind of each error, and the errors of every trial in the order of [`wrenches`].
fn places(person: &Person, scale: PlateScale) -> (Vec<usize>, Vec<Vec<Place>>) {
    let most = person.trials.iter().map(|tracked| tracked.plates.len()).max().unwrap_or(0);
    // Those of plates come first: two tilts, two shifts, a scale each; then the common scale; then zeros.
    let mut kinds: Vec<usize> = (0..most).flat_map(|_| [1, 1, 2, 2, 3]).chain([3]).collect();
    let trials = person.trials.iter().map(|tracked| {
        let mut own = Vec::new();
        for plate in 0..tracked.plates.len() {
            let sigmas = [TILT, TILT, PLACE_M, PLACE_M, scale.own];
            let of = |(k, sigma)| Place { column: 5 * plate + k, sigma };
            own.extend(sigmas.into_iter().enumerate().map(of));
        }
        own.push(Place { column: 5 * most, sigma: scale.common });
        for sigma in tracked.unzeroed.iter().flat_map(UnknownZero::sigmas) {
            own.push(Place { column: kinds.len(), sigma });
            kinds.push(0);
        }
        own
    });
    let trials = trials.collect();
    (kinds, trials)
}

/// Returns what errors of unit size add to the ground's wrench about the laboratory's origin in a frame that
/// rows are made of.
fn wrenches(tracked: &Tracked, frame: usize) -> Vec<[f64; 6]> {
    let mut all = Vec::new();
    let mut sum = [0.0; 6];
    for plate in &tracked.plates {
        let own = plate.wrench.get(frame).map_or([0.0; 6], |w| w.map(f64::from));
        let [x, y, z, ..] = own;
        all.extend([tilted(&own, plate.middle_m, 0), tilted(&own, plate.middle_m, 1)]);
        // s × F
        all.extend([[0.0, 0.0, 0.0, 0.0, -z, y], [0.0, 0.0, 0.0, z, 0.0, -x], own]);
        sum.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
    }
    all.push(sum);
    all.extend(tracked.unzeroed.iter().flat_map(UnknownZero::wrenches));
    all
}

/// Returns the change of a wrench about the origin, per radian, when the plate's axes are turned about x or y
/// through its middle.
pub(super) fn tilted([fx, fy, fz, mx, my, mz]: &[f64; 6], middle_m: [f64; 3], axis: usize) -> [f64; 6] {
    let (turn, at) = (Vector3::ith(axis, 1.0), Vector3::from(middle_m));
    let (force, moment) = (Vector3::new(*fx, *fy, *fz), Vector3::new(*mx, *my, *mz));
    let change = turn.cross(&force);
    let about = turn.cross(&(moment - at.cross(&force))) + at.cross(&change);
    [change.x, change.y, change.z, about.x, about.y, about.z]
}

/// Returns `X σ` of a motion.
fn own_columns(
    person: &Person,
    motion: &Motion,
    own: &[Place],
    n: usize,
) -> Result<DMatrix<f64>, StudyError> {
    let mut columns = DMatrix::zeros(n, own.len());
    let Some(tracked) = person.trials.get(motion.trial).filter(|_| !own.is_empty()) else {
        return Ok(columns);
    };
    let source = motion.source(person)?;
    let first = motion.frames.start;
    let wide = with_wrenches(&source, own.len(), |sample| wrenches(tracked, first + sample));
    let r = plain_factor(&wide, &motion.sigma, &Silent)?.r();
    let [rows, errors] =
        [0..n, n..n + own.len()].map(|columns| r.columns_range(columns).rows(0, n).into_owned());
    for ((mut to, error), place) in columns.column_iter_mut().zip(errors.column_iter()).zip(own) {
        let mut factor = Factor::new(n);
        factor.absorb_matrix(&rows, error.as_slice());
        to.copy_from_slice(&factor.solve(source.rounding()).estimate);
        to *= place.sigma;
    }
    Ok(columns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    #[test]
    fn a_tilted_plate_turns_its_force_and_moment_about_its_middle() {
        let (middle, turn) = ([0.4, -0.2, 0.0], 1e-4);
        // A push of 700 N at 0.1 m before the middle, and a free moment.
        let at = Vector3::new(0.5, -0.2, 0.0);
        let (force, free) = (Vector3::new(30.0, -20.0, 700.0), Vector3::new(0.0, 0.0, 5.0));
        let moment = at.cross(&force) + free;
        let wrench = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
        for axis in 0..2 {
            let turned = Rotation3::from_scaled_axis(Vector3::ith(axis, turn));
            let middle = Vector3::from(middle);
            let own = turned * force;
            let about = turned * (free + (at - middle).cross(&force)) + middle.cross(&own);
            let found = tilted(&wrench, middle.into(), axis);
            for k in 0..3 {
                assert!((found[k] - (own - force)[k] / turn).abs() < 0.1, "{axis} {k}");
                assert!((found[3 + k] - (about - moment)[k] / turn).abs() < 0.1, "{axis} {k}");
            }
        }
    }
}

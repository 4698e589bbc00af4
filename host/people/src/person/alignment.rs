//! The delay of the force plates against the cameras.
//!
//! The force that the table's bodies need for the motion of the markers, `M (c̈ + g)`, is compared with the
//! measured one, both smoothed alike: a delay τ of the plates leaves `−τ Ḟ`, and another mass a share of the
//! force.

use std::ops::Range;

use hexapod::STANDARD_GRAVITY_MPS2 as GRAVITY;
use nalgebra::{Matrix2, Vector2, Vector3};

use crate::inverse_kinematics::skeleton::Place;
use crate::inverse_kinematics::subject::Subject;
use rigident_fit::parallel;
use rigident_io::motion_capture::ground::GroundWrench;
use rigident_io::motion_capture::trial::Trial;
use rigident_rows::smoothing::{Smoother, smoothed_at};

/// A delay is searched for up to this, s.
pub const LONGEST_S: f64 = 0.15;
/// Rounds of linearisation.
const ROUNDS: usize = 8;
/// Fewest frames that tell a delay.
const FEWEST: usize = 20;

/// A delay of the plates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delay {
    /// The delay, s: positive if the plates are late.
    pub delay_s: f64,
    /// 1 σ, s.
    pub sigma_s: f64,
}

/// Returns the whole-body centre of mass of the table's bodies, m.
pub fn centre_of_mass(subject: &Subject, places: &[Place]) -> Vector3<f64> {
    let (mut sum, mut mass) = (Vector3::zeros(), 0.0);
    for (link, (turn, origin)) in subject.model.links.iter().zip(places) {
        let Some(phi) = link.nominal else { continue };
        sum += origin * phi[0] + turn * Vector3::new(phi[1], phi[2], phi[3]);
        mass += phi[0];
    }
    sum / mass.max(f64::MIN_POSITIVE)
}

/// Frames that follow one another, from which cut-off and delay are found.
pub(super) struct Looked {
    /// The numbers of the frames in the trial.
    pub range: Range<usize>,
    /// The table's centre of mass in each, m; NaN without a pose.
    pub centres: Vec<Vector3<f64>>,
    /// True for each frame in which the plates measured everything.
    pub used: Vec<bool>,
}

/// Returns the delay of the plates by some frames; `None` if too few of them are used, or the forces hardly
/// change.
pub(super) fn delay(subject: &Subject, trial: &Trial, frames: &Looked, smoother: &Smoother) -> Option<Delay> {
    let needed = needed(subject, &frames.centres, smoother);
    let mut delay_s = 0.0;
    let mut sigma_s = f64::INFINITY;
    for _ in 0..ROUNDS {
        let (step, sigma) = step(trial, frames, &needed, smoother, delay_s)?;
        delay_s += step;
        sigma_s = sigma;
        if delay_s.abs() > LONGEST_S {
            return None;
        }
        if step.abs() < 1e-5 {
            break;
        }
    }
    Some(Delay { delay_s, sigma_s })
}

/// Returns the force that the table's bodies need if their common centre of mass is at `centres`, N, smoothed
/// twice.
pub(super) fn needed(
    subject: &Subject,
    centres: &[Vector3<f64>],
    smoother: &Smoother,
) -> Vec<Option<Vector3<f64>>> {
    let velocity = along(centres, smoother, true);
    let acceleration = along(&velocity, smoother, true);
    let mass = subject.person.mass_kg;
    let force = |a: &Vector3<f64>| a.x.is_finite().then(|| (a + Vector3::z() * GRAVITY) * mass);
    acceleration.iter().map(force).collect()
}

/// Values or slopes of a series of vectors, smoothed; NaN near its ends.
pub(super) fn along(series: &[Vector3<f64>], smoother: &Smoother, slope: bool) -> Vec<Vector3<f64>> {
    let half = smoother.half();
    let at = |frame: usize| -> Vector3<f64> {
        let window = frame.checked_sub(half).and_then(|from| series.get(from..=frame + half));
        let Some(window) = window else { return Vector3::repeat(f64::NAN) };
        Vector3::from_fn(|axis, _| {
            let (value, change) = smoother.at(window.iter().map(|v| v[axis]));
            if slope { change } else { value }
        })
    };
    parallel::each(series.len(), at)
}

/// Returns the sum of the plates' forces at some frames, `delay_s` later, smoothed once, N.
pub(super) fn total(
    trial: &Trial,
    frames: &Range<usize>,
    smoother: &Smoother,
    delay_s: f64,
) -> Vec<Vector3<f64>> {
    let at = |frame: usize| {
        let time = trial.time_s(frame) + delay_s;
        let of = |plate: &GroundWrench| smoothed_at(plate, smoother.cut_off_hz, time);
        let sum = trial.ground.iter().try_fold(Vector3::zeros(), |sum, plate| {
            let w = of(plate)?;
            Some(sum + Vector3::new(w[0], w[1], w[2]))
        });
        sum.unwrap_or_else(|| Vector3::repeat(f64::NAN))
    };
    parallel::each(frames.len(), |k| at(frames.start + k))
}

/// Returns one step of the linearised search and 1 σ of the delay.
fn step(
    trial: &Trial,
    frames: &Looked,
    needed: &[Option<Vector3<f64>>],
    smoother: &Smoother,
    delay_s: f64,
) -> Option<(f64, f64)> {
    let once = total(trial, &frames.range, smoother, delay_s);
    let (force, change) = (along(&once, smoother, false), along(&once, smoother, true));
    let mut rows: Vec<(Vector3<f64>, Vector3<f64>, Vector3<f64>)> = Vec::new();
    for (frame, used) in frames.used.iter().enumerate() {
        let (true, Some(needed)) = (*used, needed.get(frame).copied().flatten()) else { continue };
        if force[frame].x.is_finite() && change[frame].x.is_finite() {
            rows.push((needed, change[frame], force[frame] - needed));
        }
    }
    if rows.len() < FEWEST {
        return None;
    }
    // left = share · needed − τ · change
    let (mut gram, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for (needed, change, left) in &rows {
        let columns = [*needed, -change];
        for a in 0..2 {
            right[a] += columns[a].dot(left);
            for b in 0..2 {
                gram[(a, b)] += columns[a].dot(&columns[b]);
            }
        }
    }
    let inverse = gram.try_inverse()?;
    let found = inverse * right;
    let squares: f64 = rows
        .iter()
        .map(|(n, c, left)| {
            let rest: Vector3<f64> = left - n * found[0] + c * found[1];
            rest.norm_squared()
        })
        .sum();
    // Neighbouring frames are smoothed into one another twice.
    let independent = (rows.len() as f64 / (2.0 * smoother.half() as f64).max(1.0)).max(1.0);
    let variance = squares / rows.len() as f64 * inverse[(1, 1)] * rows.len() as f64 / independent;
    Some((found[1], variance.sqrt()))
}

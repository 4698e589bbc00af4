//! A trajectory examined ten times as finely as the search does: what of the limits it uses, and what comes
//! nearest to each other.
//!
//! Positions, rates and accelerations are bounded at every instant: between two that are h apart a quantity
//! exceeds both by at most `h²/8` times the most of its second derivative. Efforts and distances are those
//! seen.

use super::collisions::{Collisions, Nearest};
use super::family::{INSTANTS, Series};
use super::information::Tree;
use super::limits::JointLimits;

/// Instants for each of the search's.
const FINER: usize = 10;
/// Rounding of a share.
const ROUNDING: f64 = 1e-9;

/// The part of its limits that a joint uses.
#[derive(Clone, Debug, PartialEq)]
pub struct JointUse {
    /// Least and largest position at any instant, rad or m.
    pub positions: [f64; 2],
    /// Largest rate at any instant, rad/s or m/s.
    pub rate: f64,
    /// Largest acceleration at any instant, rad/s² or m/s².
    pub acceleration: f64,
    /// Largest effort of the nominal model, dry friction included, N m or N.
    pub effort: f64,
    /// Share of half the range of positions, of the largest rate and of the largest effort.
    pub shares: [f64; 3],
}

/// The observations.
#[derive(Clone, Debug, PartialEq)]
pub struct Resampled {
    /// Every joint.
    pub joints: Vec<JointUse>,
    /// The two that come nearest to each other, and when, s.
    pub nearest: Option<(Nearest, f64)>,
    /// Time between instants, s.
    pub step_s: f64,
    /// Every limit is met.
    pub is_kept: bool,
}

/// Checks a trajectory of the given number of harmonics. `None` if numbers do not fit the tree.
pub fn resampled(
    tree: &Tree,
    limits: &[JointLimits],
    collisions: &Collisions,
    series: &Series,
    harmonics: usize,
) -> Option<Resampled> {
    let instants = FINER * INSTANTS * harmonics;
    let step_s = series.duration_s / instants as f64;
    let mut moving = tree.moving();
    let mut seen: Vec<([f64; 2], [f64; 3])> =
        vec![([f64::INFINITY, f64::NEG_INFINITY], [0.0; 3]); limits.len()];
    let mut nearest: Option<(Nearest, f64)> = None;
    for k in 0..=instants {
        let t = k as f64 * step_s;
        let motion = series.at(t);
        let efforts = tree.efforts(&mut moving, &motion)?;
        for (j, (range, most)) in seen.iter_mut().enumerate() {
            let q = motion.positions[j];
            *range = [range[0].min(q), range[1].max(q)];
            let own = [motion.rates[j], motion.accelerations[j], efforts[j]];
            most.iter_mut().zip(own).for_each(|(most, v)| *most = most.max(v.abs()));
        }
        let own = collisions.nearest(moving.states());
        if let Some(own) =
            own.filter(|own| nearest.as_ref().is_none_or(|(n, _)| own.distance_m < n.distance_m))
        {
            nearest = Some((own, t));
        }
    }
    let between = step_s * step_s / 8.0;
    let mut is_kept =
        nearest.as_ref().is_none_or(|(nearest, _)| nearest.distance_m >= collisions.apart().clearance_m);
    let joints = seen.into_iter().zip(limits).enumerate().map(
        |(j, ((range, [rate, acceleration, effort]), limits))| {
            let more = between * series.most(j, 2);
            let positions = [range[0] - more, range[1] + more];
            let rate = rate + between * series.most(j, 3);
            let acceleration = acceleration + between * series.most(j, 4);
            let effort = effort + limits.dry;
            let [low, high] = limits.range;
            let half = 0.5 * (high - low);
            let of_range = (positions[1] - (low + half)).max(low + half - positions[0]) / half;
            let shares = [of_range, rate / limits.speed, effort / limits.effort];
            let allowed = [limits.shares.range, limits.shares.speed, limits.shares.effort];
            is_kept &= limits
                .acceleration
                .is_none_or(|most| acceleration <= limits.shares.speed * most * (1.0 + ROUNDING));
            is_kept &= shares.iter().zip(allowed).all(|(share, allowed)| *share <= allowed + ROUNDING);
            JointUse { positions, rate, acceleration, effort, shares }
        },
    );
    let joints = joints.collect();
    Some(Resampled { joints, nearest, step_s, is_kept })
}

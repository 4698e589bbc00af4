//! Axes that were commanded to move and did not.
//!
//! The information of a segment is compared with that which it would have brought had this axis or that one
//! been at rest. The columns of the moments and products of inertia see nothing but rotation, so standing
//! still in between does not disturb them.

use hexapod::MotionProgram;

use super::information::{Information, RigModel};

/// An explanation must leave less than this share of the discrepancy, and the discrepancy must be larger than
/// [`LEAST`].
const SHARE: f64 = 0.5;
/// Sum over the six columns of |ln(observed / expected)|: together twice as much, or a sixth of one column.
const LEAST: f64 = 1.8;

/// Returns the coordinates that were at rest: the smallest set, of those that should have moved, that
/// explains the information.
pub fn stood_still(
    rig: &RigModel,
    program: &MotionProgram,
    moves: &[bool; 6],
    observed: &Information,
) -> [bool; 6] {
    let none = [false; 6];
    let Ok(whole) = rig.information(program, &none) else { return none };
    let floor = 0.01 * (4..10).map(|j| whole[(j, j)]).fold(0.0, f64::max);
    if floor <= 0.0 {
        return none;
    }
    let distance = |lost: &[bool; 6]| {
        rig.information(program, lost)
            .map_or(f64::INFINITY, |expected| discrepancy(&expected, observed, floor))
    };
    let as_observed = distance(&none);
    if as_observed < LEAST {
        return none;
    }
    let mut best = (SHARE * as_observed, none);
    // Fewer axes first.
    let mut sets: Vec<u8> = (1..8).collect();
    sets.sort_by_key(|set| set.count_ones());
    for set in sets {
        let lost: [bool; 6] = std::array::from_fn(|k| k >= 3 && set >> (k - 3) & 1 == 1);
        if (0..6).any(|k| lost[k] && !moves[k]) {
            continue;
        }
        let left = distance(&lost);
        if left < best.0 - 0.1 {
            best = (left, lost);
        }
    }
    best.1
}

/// Returns the discrepancy of observed and expected information on rotation; `floor` counts as nothing.
fn discrepancy(expected: &Information, observed: &Information, floor: f64) -> f64 {
    (4..10).map(|j| ((observed[(j, j)].max(0.0) + floor) / (expected[(j, j)] + floor)).ln().abs()).sum()
}

/// Returns which share of the expected information on rotation arrived; at most 1.
pub fn share(expected: &Information, observed: &Information) -> f64 {
    let sum = |m: &Information| (4..10).map(|j| m[(j, j)].max(0.0)).sum::<f64>();
    let whole = sum(expected);
    if whole > 0.0 { (sum(observed) / whole).min(1.0) } else { 1.0 }
}

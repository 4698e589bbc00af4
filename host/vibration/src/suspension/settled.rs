//! Springs that are not what they were between two recordings: rest that moved by other than the weight
//! explains, and masses that differ.
//!
//! Between postures the platform is levelled anew, and rests as before, or it is left alone, and rests where
//! the weight's moments turn it to. Any other rest is a spring that has settled, or cameras that moved.

use nalgebra::{DMatrix, DVector, Matrix6, Vector3, Vector6};

use super::recorded_postures::RecordedPosture;
use super::springs::turn;
use super::support::Support;
use rigident_fit::COVERAGE_95;
use rigident_io::rig::SuspensionTable;

/// A difference of less than this many standard deviations is chance.
const CHANCE: f64 = 4.0;
/// Cameras and joints hold no better, m and rad.
const HELD: [f64; 2] = [2e-5, 5e-5];
/// Rest that turns by more changes what springs are along the platform's axes by more than their tolerance,
/// rad.
const TILTED: f64 = 2e-3;
/// A spring explains what is left if no more than this share of its square stays.
const EXPLAINED: f64 = 0.2;
/// Masses that differ by more than this many times both uncertainties contradict each other.
const CONTRADICTORY: f64 = 1.5;

/// Returns what is to be said of springs that changed between postures, in words.
pub fn settled(table: &SuspensionTable, support: &Support, postures: &[RecordedPosture]) -> Vec<String> {
    let mut said = Vec::new();
    let Some((first, others)) = postures.split_first() else { return said };
    for other in others {
        said.extend(moved(table, support, first, other));
        if let (Some(a), Some(b)) = (first.mass_kg(), other.mass_kg()) {
            let u95 = COVERAGE_95 * a.1.hypot(b.1);
            if (a.0 - b.0).abs() > CONTRADICTORY * u95 {
                said.push(format!(
                    "the mass is {:.3} kg by {} and {:.3} kg by {}, {:.1} times their uncertainty apart: a \
                     spring is softer than it was, or something was added or lost between them",
                    a.0,
                    first.name,
                    b.0,
                    other.name,
                    (a.0 - b.0).abs() / u95
                ));
            }
        }
    }
    said
}

/// Returns what rest of one posture tells against that of another.
fn moved(
    table: &SuspensionTable,
    support: &Support,
    first: &RecordedPosture,
    other: &RecordedPosture,
) -> Option<String> {
    let ((p, r), (q, s)) = (first.rest?, other.rest?);
    let (shift, turned) = (r.tr_mul(&(q - p)), turn(&(r.transpose() * s)));
    let measured = Vector6::new(shift.x, shift.y, shift.z, turned.x, turned.y, turned.z);
    let ((a, covariance_a), (b, covariance_b)) = (first.about_o(support), other.about_o(support));
    let stiffness = with_weight(support, &std::array::from_fn(|k| b[k]))?;
    // The weight's moments: −g ms_y about x, g ms_x about y.
    let mut by_moments = DMatrix::zeros(6, 10);
    (by_moments[(3, 2)], by_moments[(4, 1)]) = (-support.gravity_mps2, support.gravity_mps2);
    let compliance = stiffness.try_inverse()?;
    let wide = DMatrix::from_fn(6, 6, |i, j| compliance[(i, j)]) * by_moments;
    let expected = &wide * DVector::from_column_slice((b - a).as_slice());
    let uncertain = &wide * (covariance_a + covariance_b) * wide.transpose();
    let sd = |k: usize| {
        let held = HELD[usize::from(k > 2)];
        (uncertain[(k, k)] + first.rest_sd[k].powi(2) + other.rest_sd[k].powi(2) + held * held).sqrt()
    };
    let white = |v: &Vector6<f64>| Vector6::from_fn(|k, _| v[k] / sd(k));
    let left = [0.0, 1.0].map(|levelled| {
        let mut left = Vector6::zeros();
        for k in &support.free {
            left[*k] = measured[*k] - levelled * expected[*k];
        }
        left
    });
    let left = if white(&left[0]).amax() < white(&left[1]).amax() { left[0] } else { left[1] };
    if white(&left).amax() < CHANCE {
        let tilt = measured[3].hypot(measured[4]);
        return (tilt > TILTED).then(|| {
            format!(
                "between {} and {} the platform's rest turned by {:.2}°, as the weight explains: springs are \
                 taken along the axes of rest of each posture, so level the platform anew after each change \
                 of posture",
                first.name,
                other.name,
                tilt.to_degrees()
            )
        });
    }
    let spring = shorter(table, &compliance, &left, &white).map_or_else(String::new, |(n, by_m)| {
        format!(
            "; it is as if spring {} were {:.2} mm {}",
            n + 1,
            1e3 * by_m.abs(),
            if by_m > 0.0 { "shorter" } else { "longer" }
        )
    });
    Some(format!(
        "between {} and {} the rest of the platform moved by ({:.2}, {:.2}, {:.2}) mm and ({:.3}, {:.3}, \
         {:.3})° other than the weight explains{spring}: a spring has settled, or the cameras were moved; \
         have the springs calibrated again (`vibration_stiffness()`)",
        first.name,
        other.name,
        1e3 * left[0],
        1e3 * left[1],
        1e3 * left[2],
        left[3].to_degrees(),
        left[4].to_degrees(),
        left[5].to_degrees()
    ))
}

/// Stiffness with what the weight adds to it; locked coordinates do not yield.
fn with_weight(support: &Support, ten: &[f64; 10]) -> Option<Matrix6<f64>> {
    let mut stiffness = support.springs.stiffness() + support.preload.stiffness(ten);
    let largest = stiffness.amax();
    for k in (0..6).filter(|k| !support.free.contains(k)) {
        stiffness.row_mut(k).fill(0.0);
        stiffness.column_mut(k).fill(0.0);
        stiffness[(k, k)] = 1e6 * largest;
    }
    stiffness.iter().all(|v| v.is_finite()).then_some(stiffness)
}

/// Returns the spring that explains what is left best, and the length by which it is shorter, m; `None` if
/// none does.
fn shorter(
    table: &SuspensionTable,
    compliance: &Matrix6<f64>,
    left: &Vector6<f64>,
    white: &dyn Fn(&Vector6<f64>) -> Vector6<f64>,
) -> Option<(usize, f64)> {
    let all = white(left);
    let of = |(n, spring): (usize, &rigident_io::rig::SpringTable)| {
        let along = Vector3::from(spring.axis).try_normalize(1e-9)?;
        let arm = Vector3::from(spring.at_m) - Vector3::from(table.at_m);
        let (force, moment) = (-along * spring.axial_npm, -arm.cross(&along) * spring.axial_npm);
        let by = white(&(compliance * Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)));
        let amount = by.dot(&all) / by.norm_squared();
        Some((n, amount, (all - by * amount).norm_squared()))
    };
    let best = table.spring.iter().enumerate().filter_map(of).min_by(|a, b| a.2.total_cmp(&b.2))?;
    (best.2 < EXPLAINED * all.norm_squared()).then_some((best.0, best.1))
}

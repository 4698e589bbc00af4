//! Markers and forces of a trial that come in two files and point upwards along different axes.
//!
//! People are taller than wide, so that markers tell which axis is vertical; the ground tells it by its push.
//! The turn of one to the other about the vertical is recognised by the centre of pressure, which is under a
//! foot.

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

use super::ground::GroundWrench;
use super::markers::Markers;

/// The vertical extent of a person's markers over any other.
const TALLER: f64 = 1.35;
/// Fewest markers that have an extent, and the least, m.
const FEWEST: usize = 6;
const SHORTEST_M: f64 = 0.5;
/// Frames that are examined.
const LOOKED_AT: usize = 200;
/// A foot is loaded by more than this, N.
const LOADED_N: f64 = 100.0;
/// Markers this high above the lowest are those of feet, m.
const FEET_M: f64 = 0.25;
/// A centre of pressure is nearer than this to a marker of a foot, m, and farther by this factor for another
/// turn.
const NEAR_M: f64 = 0.2;
const CLEARLY: f64 = 1.5;

/// Markers and forces of one trial.
pub(super) struct Both<'a> {
    pub(super) markers: &'a Markers,
    /// The number of markers in a frame.
    pub(super) labels: usize,
    /// Frames a second, and the time of the first, s.
    pub(super) rate_hz: f64,
    pub(super) first_s: f64,
    pub(super) ground: &'a [GroundWrench],
    /// The mean force of the ground, N.
    pub(super) push: Vector3<f64>,
}

/// Returns the turn that brings the markers into the axes of the forces; `None` where both have the same
/// vertical, or one of them does not tell.
///
/// # Errors
/// Says which axes they have, where no turn brings the feet over the centres of pressure.
pub(super) fn turn_of_markers(both: &Both<'_>) -> Result<Option<Matrix3<f64>>, String> {
    let (Some(own), Some(pushed)) = (vertical(both), push_axis(both)) else { return Ok(None) };
    if own == pushed {
        return Ok(None);
    }
    let unit = |k: usize| Vector3::<f64>::ith(k, 1.0);
    let about = Unit::new_normalize(unit(own).cross(&unit(pushed)));
    let upright = Rotation3::from_axis_angle(&about, std::f64::consts::FRAC_PI_2);
    let mut found: Vec<(f64, Matrix3<f64>)> = (0..4)
        .filter_map(|k| {
            let yaw = Rotation3::from_axis_angle(
                &Unit::new_normalize(unit(pushed)),
                f64::from(k) * std::f64::consts::FRAC_PI_2,
            );
            let turn = (yaw * upright).into_inner().map(f64::round);
            Some((distance_m(both, &turn, pushed)?, turn))
        })
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Somebody who lies down is longer than high.
    let as_given = distance_m(both, &Matrix3::identity(), pushed).unwrap_or(f64::INFINITY);
    let best = found.first().map_or(f64::INFINITY, |(best, _)| *best);
    if as_given < NEAR_M && as_given < CLEARLY * best.max(0.02) {
        return Ok(None);
    }
    let axis = |k: usize| ["x", "y", "z"][k];
    match found.as_slice() {
        [(best, turn), (second, _), ..] if *best < NEAR_M && *second > CLEARLY * best.max(0.02) => {
            Ok(Some(*turn))
        }
        _ => Err(format!(
            "its markers stand along {}, and the ground pushes along {}: the two files have different axes, \
             and no turn brings the feet over the centres of pressure",
            axis(own),
            axis(pushed)
        )),
    }
}

/// Returns the axis along which the markers of a person extend most.
fn vertical(both: &Both<'_>) -> Option<usize> {
    let step = both.markers.frames().div_ceil(LOOKED_AT).max(1);
    let (mut sums, mut count) = (Vector3::zeros(), 0.0);
    for frame in (0..both.markers.frames()).step_by(step) {
        let points: Vec<Vector3<f64>> =
            (0..both.labels).filter_map(|label| both.markers.point(frame, label)).collect();
        if points.len() >= FEWEST {
            let low = points.iter().fold(Vector3::repeat(f64::INFINITY), |low, p| low.inf(p));
            let high = points.iter().fold(Vector3::repeat(f64::NEG_INFINITY), |high, p| high.sup(p));
            sums += high - low;
            count += 1.0;
        }
    }
    let extent = sums / f64::max(count, 1.0);
    let axis = extent.iamax();
    let others = (0..3).filter(|k| *k != axis).map(|k| extent[k]).fold(0.0, f64::max);
    (extent[axis] > SHORTEST_M && extent[axis] > TALLER * others).then_some(axis)
}

fn push_axis(both: &Both<'_>) -> Option<usize> {
    let push = both.push;
    let axis = push.iamax();
    (push.norm() > 0.2 * LOADED_N && push[axis].abs() > 0.8 * push.norm()).then_some(axis)
}

/// Returns the median distance of centres of pressure from the nearest marker of a foot, along the ground, m.
fn distance_m(both: &Both<'_>, turn: &Matrix3<f64>, up: usize) -> Option<f64> {
    let mut all = Vec::new();
    for plate in both.ground {
        let step = plate.wrench.len().div_ceil(LOOKED_AT).max(1);
        for (k, wrench) in plate.wrench.iter().enumerate().step_by(step) {
            let [fx, fy, fz, mx, my, mz] = wrench.map(f64::from);
            let (force, moment) = (Vector3::new(fx, fy, fz), Vector3::new(mx, my, mz));
            let at = (plate.first_s + k as f64 / plate.rate_hz - both.first_s) * both.rate_hz;
            if !force.norm().is_finite() || force[up] < LOADED_N || at < 0.0 {
                continue;
            }
            let pressure = Vector3::<f64>::ith(up, 1.0).cross(&moment) / force[up];
            let points: Vec<Vector3<f64>> = (0..both.labels)
                .filter_map(|label| Some(turn * both.markers.point(at.round() as usize, label)?))
                .collect();
            let lowest = points.iter().map(|p| p[up]).fold(f64::INFINITY, f64::min);
            let feet = points.iter().filter(|p| p[up] < lowest + FEET_M);
            let flat = |p: &Vector3<f64>| {
                let mut apart = p - pressure;
                apart[up] = 0.0;
                apart.norm()
            };
            all.extend(feet.map(flat).min_by(f64::total_cmp));
        }
    }
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion_capture::trial::Trial;

    /// Somebody who walks along x with y up, as OpenSim has it, on one belt; her markers by another program,
    /// z up.
    fn trial(back: &Matrix3<f64>, pressure_off_m: f64) -> Trial {
        let (mut points, mut wrench) = (Vec::new(), Vec::new());
        for frame in 0..100 {
            let (x, z) = (0.4 + 0.012 * f64::from(frame), -0.3);
            for (height, side, ahead) in [
                (0.05, 0.1, 0.1),
                (0.06, 0.12, -0.1),
                (0.5, 0.1, 0.0),
                (0.9, 0.12, 0.05),
                (0.9, -0.12, 0.05),
                (1.4, 0.2, 0.0),
                (1.4, -0.2, 0.0),
                (1.7, 0.0, 0.1),
            ] {
                let own = back * Vector3::new(x + ahead, height, z + side);
                points.push([own.x as f32, own.y as f32, own.z as f32]);
            }
            let force = Vector3::new(20.0, 700.0, -10.0);
            let at = Vector3::new(x + 0.02 + pressure_off_m, 0.0, z + 0.1);
            let moment = at.cross(&force);
            wrench.push([force.x, force.y, force.z, moment.x, moment.y, moment.z].map(|v| v as f32));
        }
        let plate = GroundWrench {
            name: "belt".to_owned(),
            corners_m: None,
            rate_hz: 100.0,
            first_s: 0.0,
            mean_s: 0.01,
            wrench,
        };
        Trial {
            name: "walk".to_owned(),
            rate_hz: 100.0,
            first_s: 0.0,
            labels: (0..8).map(|k| format!("m{k}")).collect(),
            markers: Markers::new(8, points),
            ground: vec![plate],
            notes: Vec::new(),
        }
    }

    fn turn(trial: &Trial) -> Result<Option<Matrix3<f64>>, String> {
        turn_of_markers(&Both {
            markers: &trial.markers,
            labels: trial.labels.len(),
            rate_hz: trial.rate_hz,
            first_s: trial.first_s,
            ground: &trial.ground,
            push: Vector3::new(20.0, 700.0, -10.0),
        })
    }

    #[test]
    fn markers_are_turned_to_the_axes_of_the_forces_whichever_way_they_walk() {
        let upright = Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0);
        let quarter = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        for back in [upright, quarter * upright, quarter * quarter * upright] {
            let found = turn(&trial(&back, 0.0)).unwrap().unwrap();
            assert!((found * back - Matrix3::identity()).norm() < 1e-12, "{found} {back}");
        }
        assert_eq!(turn(&trial(&Matrix3::identity(), 0.0)), Ok(None));
        let said = turn(&trial(&upright, 1.5)).unwrap_err();
        assert!(said.contains("stand along z, and the ground pushes along y"), "{said}");
    }
}

//! The best position of the plate in one orientation, by descent.

use hexapod::{Geometry, Legs, Pose, Violation, rotation_from_rpy};
use nalgebra::{Matrix3, Matrix6, Vector3};

/// Powers of the sum that approximates the largest of the measures, and steps with each.
const POWERS: [(i32, usize); 3] = [(6, 6), (24, 8), (96, 8)];
/// Longest step, m.
const LONGEST_STEP_M: f64 = 0.05;

/// A position in an orientation, and how near the limits it is.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    /// The place of the plate's origin, A, m.
    pub position: Vector3<f64>,
    /// The largest of `|l − middle| / half the stroke`, joint angle over its limit, what the clearance lacks
    /// over its range and, with the guard, `cond(H)` over its limit. At most one where every limit is met.
    pub worst: f64,
}

impl Spot {
    /// Returns whether every limit is met.
    pub fn keeps(&self) -> bool {
        self.worst <= 1.0
    }
}

/// Up to 20 measures, each at most one where its limit is met, with gradients in the position, 1/m.
struct Measures {
    all: [(f64, Vector3<f64>); 20],
    count: usize,
}

impl Measures {
    fn push(&mut self, value: f64, gradient: Vector3<f64>) {
        if let Some(place) = self.all.get_mut(self.count) {
            *place = (value, gradient);
            self.count += 1;
        }
    }

    fn iter(&self) -> impl Iterator<Item = &(f64, Vector3<f64>)> {
        self.all.iter().take(self.count)
    }

    /// Returns the worst measure; infinite for a value that is not a number.
    fn worst(&self) -> f64 {
        self.iter().fold(0.0, |m, (v, _)| if v.is_nan() { f64::INFINITY } else { m.max(*v) })
    }
}

/// Positions in one orientation.
pub(super) struct Orientation<'a> {
    geometry: &'a Geometry,
    rotation: Matrix3<f64>,
    /// `det H` has this sign on home's side of every singular pose. Without the guard absent.
    side: Option<f64>,
}

impl<'a> Orientation<'a> {
    /// Makes the search of an orientation. `side` is the sign of `det H` at home if the guard is to be met.
    pub(super) fn new(geometry: &'a Geometry, rotation: Matrix3<f64>, side: Option<f64>) -> Self {
        Self { geometry, rotation, side }
    }

    /// Returns whether every limit is met there: the cheap question.
    pub(super) fn keeps(&self, position: &Vector3<f64>) -> bool {
        if !self.geometry.reaches(position, &self.rotation) {
            return false;
        }
        let legs = self.geometry.legs_at(position, &self.rotation);
        let limits = &self.geometry.limits;
        let above = legs.directions.iter().all(|n| n.z > 0.0);
        let cones = self.geometry.has_lengths_alone() || self.measures(&legs, false).worst() <= 1.0;
        above
            && cones
            && self.side.is_none_or(|side| {
                legs.force_transmission().determinant() * side > 0.0
                    && legs.is_conditioned_within(limits.cond_max, self.geometry.moment_length_m())
            })
    }

    /// Descends from `start` until a position keeps every limit or no step helps; with `fully`, to the
    /// position that is furthest inside all of them.
    pub(super) fn settle(&self, start: Vector3<f64>, fully: bool) -> Spot {
        let mut position = start;
        let mut now = self.look(&position);
        let mut best = Spot { position, worst: now.as_ref().map_or(f64::INFINITY, Measures::worst) };
        for (power, steps) in POWERS {
            for _ in 0..steps {
                let Some(measures) = &now else { return best };
                if best.keeps() && !fully {
                    return best;
                }
                let Some(step) = descent(measures, power) else { break };
                let before = mean(measures, power);
                let mut share = 1.0;
                now = loop {
                    let next = self.look(&(position + step * share));
                    match next {
                        Some(m) if mean(&m, power) < before => break Some(m),
                        _ if share < 1e-3 => break None,
                        _ => share *= 0.4,
                    }
                };
                let Some(measures) = &now else {
                    now = self.look(&position);
                    break;
                };
                position += step * share;
                if measures.worst() < best.worst {
                    best = Spot { position, worst: measures.worst() };
                }
                if (step * share).norm() < 1e-7 {
                    break;
                }
            }
        }
        best
    }

    /// Returns the measures at a position. `None` beyond a singular pose, or with a plate joint below its
    /// base joint.
    fn look(&self, position: &Vector3<f64>) -> Option<Measures> {
        let legs = self.geometry.legs_at(position, &self.rotation);
        let above = legs.directions.iter().all(|n| n.z > 0.0);
        let side = self.side.is_none_or(|side| legs.force_transmission().determinant() * side > 0.0);
        (above && side).then(|| self.measures(&legs, self.side.is_some()))
    }

    fn measures(&self, legs: &Legs, with_guard: bool) -> Measures {
        let mut measures = Measures { all: [(0.0, Vector3::zeros()); 20], count: 0 };
        let [lo, hi] = self.geometry.leg_length_m;
        let (middle, half) = (0.5 * (lo + hi), 0.5 * (hi - lo));
        for (n, l) in legs.directions.iter().zip(legs.lengths) {
            measures.push((l - middle).abs() / half, n * ((l - middle).signum() / half));
        }
        let limits = &self.geometry.limits;
        for (cones, turn) in
            [(&limits.base_joints, Matrix3::identity()), (&limits.plate_joints, self.rotation)]
        {
            let Some(cones) = cones else { continue };
            for ((n, l), axis) in legs.directions.iter().zip(legs.lengths).zip(&cones.axes) {
                // cos θ = n·u and dn = (1 − n nᵀ) dx / l.
                let u = (turn * Vector3::from(*axis)).normalize();
                let sine = u.cross(n).norm();
                let angle = sine.atan2(u.dot(n));
                let slope = (n * n.dot(&u) - u) / (l * sine.max(1e-9));
                measures.push(angle / cones.half_angle_rad, slope / cones.half_angle_rad);
            }
        }
        if let (Some(bulk), Some(nearest)) = (&limits.bulk, self.geometry.nearest(legs)) {
            let lacking = 1.0 - (nearest.distance_m - bulk.clearance_m) / bulk.range_m();
            // What is far away is none of its business.
            if lacking > 0.0 {
                measures.push(lacking, -nearest.slope / bulk.range_m());
            }
        }
        if with_guard {
            let (condition, gradient) = condition(legs, self.geometry.moment_length_m());
            measures.push(condition / limits.cond_max, gradient / limits.cond_max);
        }
        measures
    }
}

/// Returns `cond(H)`, moments over `length_m`, and its gradient in the position. Column `i` of H changes by
/// `[dn ; R b × dn / length]`, `dn = (1 − n nᵀ) dx / l`, and a singular value by `uᵀ dH v`.
fn condition(legs: &Legs, length_m: f64) -> (f64, Vector3<f64>) {
    let h: Matrix6<f64> = legs.force_transmission_over(length_m);
    let svd = h.svd(true, true);
    let (Some(u), Some(v)) = (svd.u, svd.v_t) else { return (f64::INFINITY, Vector3::zeros()) };
    let (largest, smallest) = (svd.singular_values.imax(), svd.singular_values.imin());
    let (max, min) = (svd.singular_values[largest], svd.singular_values[smallest]);
    let slope = |k: usize| -> Vector3<f64> {
        let (force, moment) = (u.fixed_view::<3, 1>(0, k), u.fixed_view::<3, 1>(3, k) / length_m);
        let mut sum = Vector3::zeros();
        for i in 0..6 {
            let (n, arm) = (&legs.directions[i], &legs.arms[i]);
            let w = force + moment.cross(arm);
            sum += (w - n * n.dot(&w)) * (v[(k, i)] / legs.lengths[i]);
        }
        sum
    };
    let ratio = max / min;
    (ratio, (slope(largest) / max - slope(smallest) / min) * ratio)
}

/// Returns `(Σ v^p)^(1/p)`.
fn mean(measures: &Measures, power: i32) -> f64 {
    let worst = measures.worst();
    let sum: f64 = measures.iter().map(|(v, _)| (v / worst).powi(power)).sum();
    worst * sum.powf(1.0 / f64::from(power))
}

/// Returns Newton's step for `Σ v^p` with the measures taken as linear, `None` if there is none.
fn descent(measures: &Measures, power: i32) -> Option<Vector3<f64>> {
    let worst = measures.worst();
    if !(worst.is_finite() && worst > 0.0) {
        return None;
    }
    let (mut gradient, mut hessian) = (Vector3::zeros(), Matrix3::zeros());
    for (v, slope) in measures.iter() {
        let share = (v / worst).powi(power - 2);
        gradient += slope * (share * v);
        hessian += slope * slope.transpose() * (share * f64::from(power - 1));
    }
    let damping = 1e-3 * hessian.trace();
    let step = -((hessian + Matrix3::identity() * damping).cholesky()?.solve(&gradient));
    let length = step.norm();
    Some(if length > LONGEST_STEP_M { step * (LONGEST_STEP_M / length) } else { step })
}

/// Returns the level pose that is furthest inside all limits.
///
/// # Errors
/// The best level pose, and what is in the way there.
pub fn level(geometry: &Geometry) -> Result<Pose, (Pose, Violation)> {
    settled(geometry, geometry.home(), true)
}

/// Returns the pose of the same orientation at the nearest position that keeps every limit, or, with `fully`,
/// at that which is furthest inside all of them; nothing singular is crossed on the way.
///
/// # Errors
/// The best position found, and what is in the way there.
pub fn settled(geometry: &Geometry, from: Pose, fully: bool) -> Result<Pose, (Pose, Violation)> {
    let start = Vector3::from(from.position_m);
    let side = side_at_home(geometry);
    let spot = Orientation::new(geometry, rotation_from_rpy(from.rpy_rad), Some(side)).settle(start, fully);
    let pose = Pose { position_m: spot.position.into(), ..from };
    geometry.check_pose(&pose).map(|()| pose).map_err(|violation| (pose, violation))
}

/// Returns the sign of `det H` at home.
pub(super) fn side_at_home(geometry: &Geometry) -> f64 {
    geometry.legs(&geometry.home()).force_transmission().determinant().signum()
}

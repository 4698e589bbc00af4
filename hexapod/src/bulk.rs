//! The distances between legs, plate and base. Everything is made of capsules: segments with a radius.

use nalgebra::Vector3;

use super::geometry::Geometry;
use super::legs::Legs;
use super::limits::{Bulk, Part};

/// Joints that are closer than this are one, m.
const SAME_M: f64 = 1e-9;

/// Two parts that are nearest to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Distance between the surfaces, m; negative where they overlap.
    pub distance_m: f64,
    /// The parts.
    pub between: [Part; 2],
    /// Change of the distance with the plate's position, 1.
    pub slope: Vector3<f64>,
}

/// A capsule's axis: from one point to the other.
#[derive(Clone, Copy)]
struct Bar {
    part: Part,
    radius: f64,
    from: Vector3<f64>,
    to: Vector3<f64>,
}

impl Bulk {
    /// Returns the two parts that are nearest to each other.
    pub(super) fn nearest(&self, geometry: &Geometry, legs: &Legs) -> Nearest {
        let base = geometry.base_joints_m.map(Vector3::from);
        let bars = self.legs(&base, legs);
        let mut nearest = Nearest {
            distance_m: f64::INFINITY,
            between: [Part::Plate, Part::Base],
            slope: Vector3::zeros(),
        };
        let mut meet = |a: &Bar, b: &Bar| {
            let radii = a.radius + b.radius;
            if apart(a, b) - radii >= nearest.distance_m {
                return;
            }
            let [s, t] = closest(a, b);
            let line = (a.from + s * (a.to - a.from)) - (b.from + t * (b.to - b.from));
            let distance_m = line.norm() - radii;
            // What is not a number is no distance to rely on.
            if distance_m < nearest.distance_m || distance_m.is_nan() {
                let along = line.try_normalize(f64::MIN_POSITIVE).unwrap_or_default();
                let slope = self.slope(legs, a.part, s, &along) - self.slope(legs, b.part, t, &along);
                let distance_m = if distance_m.is_nan() { f64::NEG_INFINITY } else { distance_m };
                nearest = Nearest { distance_m, between: [a.part, b.part], slope };
            }
        };
        for (k, a) in bars.iter().enumerate() {
            bars.iter().skip(k + 1).for_each(|b| meet(a, b));
        }
        let plate: [Vector3<f64>; 6] =
            std::array::from_fn(|i| base[i] + legs.lengths[i] * legs.directions[i]);
        let of = |joints: [Vector3<f64>; 6], radius: Option<f64>, part| {
            radius.into_iter().flat_map(move |radius| chords(joints, radius, part))
        };
        for bar in of(plate, self.plate_radius_m, Part::Plate) {
            bars.iter().for_each(|leg| meet(leg, &bar));
            of(base, self.base_radius_m, Part::Base).for_each(|below| meet(&bar, &below));
        }
        for bar in of(base, self.base_radius_m, Part::Base) {
            bars.iter().for_each(|leg| meet(leg, &bar));
        }
        nearest
    }

    /// Returns the legs without their joints.
    fn legs(&self, base: &[Vector3<f64>; 6], legs: &Legs) -> [Bar; 6] {
        std::array::from_fn(|i| {
            let (n, length) = (legs.directions[i], legs.lengths[i]);
            let joint = self.joint_length_m.min(0.5 * length);
            let (from, to) = (base[i] + joint * n, base[i] + (length - joint) * n);
            Bar { part: Part::Leg(i as u8 + 1), radius: self.leg_radius_m, from, to }
        })
    }

    /// Returns the change along the unit vector `e` of the place at `share` of a bar with the plate's
    /// position: that of a leg's upper end is `dx − j dn`, of its lower `j dn`, `dn = (1 − n nᵀ) dx / l`.
    fn slope(&self, legs: &Legs, part: Part, share: f64, e: &Vector3<f64>) -> Vector3<f64> {
        match part {
            Part::Leg(leg) => {
                let (n, length) =
                    (&legs.directions[usize::from(leg) - 1], legs.lengths[usize::from(leg) - 1]);
                let turned = (e - n * n.dot(e)) / length;
                share * e + (1.0 - 2.0 * share) * self.joint_length_m * turned
            }
            Part::Plate => *e,
            Part::Base => Vector3::zeros(),
        }
    }

    /// Returns a bound of the rate at which any distance changes, m/s, where plate joint `i` moves at most at
    /// `speeds[i]` and leg `i` is no shorter than `lengths[i]`: ends of legs are no faster than
    /// `u (1 + j/l)`.
    pub(super) fn rate(&self, speeds: &[f64; 6], lengths: &[f64; 6]) -> f64 {
        let ends = speeds.iter().zip(lengths).map(|(u, l)| u * (1.0 + self.joint_length_m / l));
        2.0 * ends.fold(0.0, f64::max)
    }
}

/// Returns the bars between any two different joints.
fn chords(joints: [Vector3<f64>; 6], radius: f64, part: Part) -> impl Iterator<Item = Bar> {
    let first = move |i: usize| (0..i).all(|k| (joints[k] - joints[i]).norm() > SAME_M);
    (0..6).filter(move |i| first(*i)).flat_map(move |i| {
        (i + 1..6).filter(move |k| first(*k)).map(move |k| Bar {
            part,
            radius,
            from: joints[i],
            to: joints[k],
        })
    })
}

/// Returns a lower bound of the distance of two axes: of the boxes about them.
fn apart(a: &Bar, b: &Bar) -> f64 {
    (0..3).fold(0.0_f64, |most, i| {
        let gap = (a.from[i].min(a.to[i]) - b.from[i].max(b.to[i]))
            .max(b.from[i].min(b.to[i]) - a.from[i].max(a.to[i]));
        most.max(gap)
    })
}

/// Returns where on two segments, as shares of their lengths, they are nearest to each other (Ericson,
/// Real-Time Collision Detection, 5.1.9): the lines' nearest points, brought into one segment, then the
/// other.
fn closest(a: &Bar, b: &Bar) -> [f64; 2] {
    let (d1, d2, r) = (a.to - a.from, b.to - b.from, a.from - b.from);
    let (aa, ee, f) = (d1.dot(&d1), d2.dot(&d2), d2.dot(&r));
    let into = |share: f64| share.clamp(0.0, 1.0);
    if aa <= f64::MIN_POSITIVE && ee <= f64::MIN_POSITIVE {
        return [0.0, 0.0];
    }
    if aa <= f64::MIN_POSITIVE {
        return [0.0, into(f / ee)];
    }
    let c = d1.dot(&r);
    if ee <= f64::MIN_POSITIVE {
        return [into(-c / aa), 0.0];
    }
    let bb = d1.dot(&d2);
    let determinant = aa * ee - bb * bb;
    // Parallel lines: any point will do.
    let s = if determinant > 0.0 { into((bb * f - c * ee) / determinant) } else { 0.0 };
    let t = (bb * s + f) / ee;
    if t < 0.0 {
        [into(-c / aa), 0.0]
    } else if t > 1.0 {
        [into((bb - c) / aa), 1.0]
    } else {
        [s, t]
    }
}

#[cfg(test)]
#[path = "bulk_tests.rs"]
mod tests;

//! The travel of the axes.

use hexapod::gcs::GcsPosition;
use hexapod::{Geometry, Pose};

/// Returns the travel of each axis by itself from the reference pose, lowest and highest, mm and degrees: as
/// far as the legs reach.
pub fn limits(geometry: &Geometry) -> [[f64; 2]; 6] {
    let home = geometry.home();
    let reaches = |axis: usize, value: f64| {
        let mut at = GcsPosition::default();
        at.0[axis] = value;
        is_reached(geometry, &at.pose(&home))
    };
    std::array::from_fn(|axis| {
        let most = if axis < 3 { 1000.0 } else { 60.0 };
        [-1.0, 1.0].map(|sign| {
            // The first value that is out of reach, in steps, then by halving.
            let steps = 600;
            let first = (1..=steps)
                .map(|k| most * f64::from(k) / f64::from(steps))
                .find(|v| !reaches(axis, sign * v));
            let Some(mut out) = first else { return sign * most };
            let mut inside = out - most / f64::from(steps);
            for _ in 0..30 {
                let middle = 0.5 * (inside + out);
                if reaches(axis, sign * middle) { inside = middle } else { out = middle }
            }
            sign * inside
        })
    })
}

/// Returns whether every leg is as long as a pose needs it.
pub fn is_reached(geometry: &Geometry, pose: &Pose) -> bool {
    let [lo, hi] = geometry.leg_length_m;
    geometry.leg_lengths(pose).iter().all(|l| (lo..=hi).contains(l))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_travel_ends_where_a_leg_ends() {
        let geometry = Geometry::thesis();
        let all = limits(&geometry);
        // Straight up a leg is as long as it can be: the height follows from Pythagoras.
        let [lo, hi] = geometry.leg_length_m;
        // The plate's joints are 0.123 m below its origin; leg² = height² + (a constant distance in the
        // plane)².
        let height = geometry.home().position_m[2] - 0.123;
        let plane = (0.5 * (lo + hi)).powi(2) - height * height;
        for (limit, l) in all[2].iter().zip([lo, hi]) {
            let expected = 1e3 * ((l * l - plane).sqrt() - height);
            assert!((limit - expected).abs() < 1e-3, "{limit} {expected}");
        }
        assert!(all.iter().all(|[low, high]| *low < 0.0 && *high > 0.0));
    }

    /// The travel that is published of a machine, each axis by itself, is compared with one whose legs are
    /// known: shares that add up to one are reached, most of the poses that use each at will are not.
    #[test]
    fn poses_whose_shares_of_the_travel_add_up_to_one_are_reached_by_the_legs() {
        let geometry = Geometry::thesis();
        let most = limits(&geometry).map(|[low, high]| high.min(-low));
        let home = geometry.home();
        let mut state = 88_172_645_463_325_252_u64;
        let mut unit = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let reached = |shares: [f64; 6]| {
            let at = GcsPosition(std::array::from_fn(|k| shares[k] * most[k]));
            is_reached(&geometry, &at.pose(&home))
        };
        let (mut apart, mut together) = (0, 0);
        const DRAWN: usize = 10_000;
        for _ in 0..DRAWN {
            let shares: [f64; 6] = std::array::from_fn(|_| 2.0 * unit() - 1.0);
            let sum: f64 = shares.iter().map(|v| v.abs()).sum();
            apart += usize::from(reached(shares.map(|v| v / sum)));
            together += usize::from(reached(shares));
        }
        assert_eq!(apart, DRAWN);
        assert!(together < DRAWN / 10, "{together}");
    }
}

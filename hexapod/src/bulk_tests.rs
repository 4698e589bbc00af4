//! Comparison with dense sampling, a numerical minimiser and finite differences.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::super::{Limit, Pose};
use super::*;

struct Uniform(ChaCha8Rng);

impl Uniform {
    fn within(&mut self, most: f64) -> f64 {
        ((self.0.next_u64() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0) * most
    }

    fn point(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.within(1.0))
    }
}

fn bar(from: Vector3<f64>, to: Vector3<f64>) -> Bar {
    Bar { part: Part::Plate, radius: 0.0, from, to }
}

fn between(a: &Bar, b: &Bar, [s, t]: [f64; 2]) -> f64 {
    ((a.from + s * (a.to - a.from)) - (b.from + t * (b.to - b.from))).norm()
}

/// Minimises the distance by alternate projection onto either segment: a convex problem, so it ends at the
/// minimum.
fn minimised(a: &Bar, b: &Bar) -> f64 {
    let foot = |bar: &Bar, p: Vector3<f64>| {
        let d = bar.to - bar.from;
        bar.from + d * ((p - bar.from).dot(&d) / d.norm_squared().max(1e-300)).clamp(0.0, 1.0)
    };
    let mut p = a.from;
    for _ in 0..200_000 {
        let q = foot(b, p);
        let next = foot(a, q);
        if (next - p).norm() < 1e-15 {
            break;
        }
        p = next;
    }
    (p - foot(b, p)).norm()
}

#[test]
fn the_nearest_points_of_two_segments_are_those_of_sampling_and_of_a_minimiser() {
    let mut random = Uniform(ChaCha8Rng::seed_from_u64(3));
    for k in 0..300 {
        let (a, mut b) = (bar(random.point(), random.point()), bar(random.point(), random.point()));
        match k % 6 {
            // Parallel, of no length, crossing, at one end together.
            0 => b.to = b.from + (a.to - a.from) * random.within(2.0),
            1 => b.to = b.from,
            2 => b.from = a.from + 0.3 * (a.to - a.from),
            3 => b.from = a.to,
            _ => {}
        }
        let got = closest(&a, &b);
        assert!(got.iter().all(|share| (0.0..=1.0).contains(share)), "{got:?}");
        let distance = between(&a, &b, got);
        assert!(apart(&a, &b) <= distance + 1e-15);
        assert!((between(&b, &a, closest(&b, &a)) - distance).abs() < 1e-12);
        let fine = minimised(&a, &b);
        assert!((distance - fine).abs() < 1e-7, "{k}: {distance} {fine}");
        let mut sampled = f64::INFINITY;
        for i in 0..=200 {
            for j in 0..=200 {
                sampled = sampled.min(between(&a, &b, [f64::from(i) / 200.0, f64::from(j) / 200.0]));
            }
        }
        // Half a step along either, each at most 3.5 m long.
        assert!(distance <= sampled + 1e-12 && sampled < distance + 0.018, "{k}: {distance} {sampled}");
    }
}

fn machine() -> Geometry {
    let mut g = Geometry::thesis();
    g.limits.bulk = Some(Bulk {
        leg_radius_m: 0.025,
        joint_length_m: 0.08,
        plate_radius_m: Some(0.02),
        base_radius_m: Some(0.02),
        clearance_m: 0.0,
    });
    g
}

/// Points all over every surface, thousands of pairs, never come nearer than what is said, and some come as
/// near.
#[test]
fn the_nearest_parts_are_those_of_points_on_all_of_them() {
    let g = machine();
    let mut random = Uniform(ChaCha8Rng::seed_from_u64(8));
    let home = g.home();
    for _ in 0..40 {
        let pose = Pose {
            position_m: home.position_m.map(|v| v + random.within(0.08)),
            rpy_rad: [0.0; 3].map(|_: f64| random.within(0.5)),
        };
        let legs = g.legs(&pose);
        let nearest = g.nearest(&legs).unwrap();
        let along = |from: Vector3<f64>, to: Vector3<f64>| -> Vec<Vector3<f64>> {
            (0..=60).map(|k| from + (to - from) * (f64::from(k) / 60.0)).collect()
        };
        let base = g.base_joints_m.map(Vector3::from);
        let position = Vector3::from(pose.position_m);
        let plate = legs.arms.map(|arm| position + arm);
        let mut parts: Vec<(Part, f64, Vec<Vector3<f64>>)> = (0..6)
            .map(|i| {
                let n = (plate[i] - base[i]).normalize();
                (Part::Leg(i as u8 + 1), 0.025, along(base[i] + 0.08 * n, plate[i] - 0.08 * n))
            })
            .collect();
        for (part, joints) in [(Part::Plate, plate), (Part::Base, base)] {
            let pairs = (0..6).flat_map(|i| (i..6).map(move |k| (i, k)));
            parts.push((part, 0.02, pairs.flat_map(|(i, k)| along(joints[i], joints[k])).collect()));
        }
        let mut sampled = (f64::INFINITY, [Part::Plate; 2]);
        for (k, (a, ra, first)) in parts.iter().enumerate() {
            for (b, rb, second) in &parts[k + 1..] {
                for p in first {
                    for q in second {
                        let distance = (p - q).norm() - ra - rb;
                        if distance < sampled.0 {
                            sampled = (distance, [*a, *b]);
                        }
                    }
                }
            }
        }
        let said = nearest.distance_m;
        // Steps of at most 1.5 cm on either: a hundredth less far apart where they are 2 cm or more.
        assert!(said <= sampled.0 + 1e-12 && sampled.0 < said + 0.008, "{said} {sampled:?}");
        if sampled.0 - said < 1e-4 {
            assert_eq!(nearest.between, sampled.1);
        }
        for k in 0..3 {
            let h = 1e-6;
            let at = |by: f64| {
                let mut moved = pose;
                moved.position_m[k] += by;
                g.nearest(&g.legs(&moved)).unwrap()
            };
            let (before, after) = (at(-h), at(h));
            if before.between == after.between {
                let slope = (after.distance_m - before.distance_m) / (2.0 * h);
                assert!((slope - nearest.slope[k]).abs() < 1e-3, "{slope} {}", nearest.slope);
            }
        }
    }
}

#[test]
fn a_collision_is_named_with_both_parts_and_the_distance() {
    let mut g = machine();
    let pose = Pose { rpy_rad: [0.2, 0.1, 0.0], ..g.home() };
    let nearest = g.nearest(&g.legs(&pose)).unwrap();
    assert!(nearest.distance_m > 0.0, "{nearest:?}");
    g.check_pose(&pose).unwrap();
    let Some(bulk) = &mut g.limits.bulk else { panic!() };
    bulk.clearance_m = nearest.distance_m + 0.004;
    let violation = g.check_pose(&pose).unwrap_err();
    assert_eq!(violation.limit, Limit::Clearance);
    let words = violation.to_string();
    assert!(words.contains(" mm of each other, ") && words.contains("leg"), "{words}");
    assert_eq!(violation.between, Some(nearest.between));
    assert!(words.contains(&format!("{:.1} mm", 1e3 * nearest.distance_m)), "{words}");
}

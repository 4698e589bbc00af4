//! Frames of trees in motion, made joint by joint; a batch QR of the same rows is the oracle.

extern crate std;
use std::boxed::Box;
use std::vec::Vec;

use nalgebra::{DMatrix, DVector, Matrix3};

use super::*;
use crate::random::Random;
use crate::tree::joint::turn;
use crate::tree::{BaseMotion, Joint, JointMotion, Link, motion};

/// Returns ten spherical joints and four hinges: parents and axes of the 34-DOF human's shape.
fn human() -> Vec<FrameLink<f64>> {
    let parents = [0, 0, 1, 2, 2, 4, 5, 2, 7, 8, 0, 10, 11, 0, 13];
    let hinges = [(5, 1), (8, 1), (11, 1), (14, 2)];
    let mut random = Random(2);
    parents
        .into_iter()
        .enumerate()
        .map(|(i, parent)| FrameLink {
            parent,
            joint: hinges
                .iter()
                .find(|(link, _)| *link == i)
                .map_or(TurningJoint::Spherical, |(_, axis)| TurningJoint::Revolute(*axis)),
            position: core::array::from_fn(|_| 0.6 * random.uniform() - 0.3),
        })
        .collect()
}

fn config() -> FramesConfig<f64> {
    FramesConfig {
        channel_sigma: [2.0, 2.0, 3.0, 0.5, 0.5, 0.5],
        known_offset: [1.0, 2.0, 3.0, 0.1, 0.2, 0.3],
        range: [1e6; 6],
        still_after: 3,
        filter: None,
        suspension: None,
    }
}

/// Holds what a frame holds.
#[derive(Clone)]
struct Owned {
    wrench: [f64; 6],
    base: BaseMotion<f64>,
    links: Vec<LinkMotion<f64>>,
}

impl Owned {
    /// Returns the frame rounded to single precision, which is exact in both.
    fn rounded(self) -> Self {
        let r = |v: [f64; 3]| v.map(|x| f64::from(x as f32));
        Self {
            wrench: self.wrench.map(|x| f64::from(x as f32)),
            base: BaseMotion {
                specific_force: r(self.base.specific_force.into()).into(),
                rate: r(self.base.rate.into()).into(),
                angular_acceleration: r(self.base.angular_acceleration.into()).into(),
            },
            links: self
                .links
                .iter()
                .map(|l| LinkMotion {
                    attitude: l.attitude.map(|x| f64::from(x as f32)),
                    rate: r(l.rate),
                    angular_acceleration: r(l.angular_acceleration),
                })
                .collect(),
        }
    }

    fn narrow(&self) -> ([f32; 6], [[f32; 3]; 3], Vec<LinkMotion<f32>>) {
        let r = |v: [f64; 3]| v.map(|x| x as f32);
        let b = &self.base;
        (
            self.wrench.map(|x| x as f32),
            [r(b.specific_force.into()), r(b.rate.into()), r(b.angular_acceleration.into())],
            self.links
                .iter()
                .map(|l| LinkMotion {
                    attitude: l.attitude.map(|x| x as f32),
                    rate: r(l.rate),
                    angular_acceleration: r(l.angular_acceleration),
                })
                .collect(),
        )
    }

    fn frame(&self) -> Frame<'_, f64> {
        Frame {
            wrench: self.wrench,
            specific_force: self.base.specific_force.into(),
            rate: self.base.rate.into(),
            angular_acceleration: self.base.angular_acceleration.into(),
            links: &self.links,
        }
    }
}

/// Returns a tree at a random instant; the wrench is that of all standard parameters and noise.
fn instant(tree: &[FrameLink<f64>], phi: &[f64], noise: f64, random: &mut Random) -> Owned {
    let links: Vec<Link<f64>> = tree
        .iter()
        .map(|l| Link {
            parent: usize::from(l.parent),
            joint: match l.joint {
                TurningJoint::Revolute(axis) => Joint::Revolute(Vector3::ith(usize::from(axis), 1.0)),
                TurningJoint::Fixed => Joint::Fixed,
                TurningJoint::Spherical => Joint::Spherical,
            },
            rotation: Matrix3::identity(),
            position: Vector3::from(l.position),
        })
        .collect();
    let mut v = |s: f64| -> [f64; 3] { core::array::from_fn(|_| s * random.normal()) };
    let joints: Vec<JointMotion<f64>> = links
        .iter()
        .map(|l| match l.joint {
            Joint::Revolute(axis) => {
                let [angle, rate, change] = v(1.0);
                JointMotion::revolute(l, &axis, angle.sin_cos(), 2.0 * rate, 8.0 * change)
            }
            Joint::Fixed => JointMotion::rest(l),
            _ => {
                let axis = Vector3::from(v(1.0)).normalize();
                let angle = v(0.8)[0];
                JointMotion::spherical(l, &turn(&axis, angle.sin(), angle.cos()), v(2.0), v(8.0))
            }
        })
        .collect();
    let g = Vector3::from(v(1.0)).normalize() * 9.8;
    let base = BaseMotion {
        specific_force: g + Vector3::from(v(2.0)),
        rate: v(1.0).into(),
        angular_acceleration: v(4.0).into(),
    };
    let mut states = std::vec![LinkState::zero(); links.len()];
    motion::states(&links, &joints, &base, &mut states).unwrap();
    let n = 10 * links.len();
    let mut y = std::vec![0.0; 6 * n];
    rows::base_rows(&states, &mut y).unwrap();
    let config = config();
    let wrench = core::array::from_fn(|i| {
        let exact: f64 = y[i * n..(i + 1) * n].iter().zip(phi).map(|(y, p)| y * p).sum();
        exact + config.known_offset[i] + noise * config.channel_sigma[i] * random.normal()
    });
    let links = states
        .iter()
        .skip(1)
        .map(|s| {
            let turned = nalgebra::Rotation3::from_matrix_unchecked(s.rotation);
            let q = nalgebra::UnitQuaternion::from_rotation_matrix(&turned);
            LinkMotion {
                attitude: [q.w, q.i, q.j, q.k],
                rate: (s.rotation.transpose() * s.rate).into(),
                angular_acceleration: (s.rotation.transpose() * s.angular_acceleration).into(),
            }
        })
        .collect();
    Owned { wrench, base, links }
}

fn standard(links: usize, random: &mut Random) -> Vec<f64> {
    (0..10 * links)
        .map(|k| match k % 10 {
            0 => 3.0 + random.normal(),
            1..=3 => 0.3 * random.normal(),
            _ => 0.05 * random.normal(),
        })
        .collect()
}

fn made(tree: &[FrameLink<f64>]) -> Box<FrameEstimator<f64>> {
    let mut estimator = Box::new(FrameEstimator::UNUSED);
    estimator.set_up(tree, &config()).unwrap();
    estimator
}

/// Returns R and z.
fn dense<T: Scalar>(factor: &TreeFactor<T>, widen: impl Fn(T) -> f64) -> (DMatrix<f64>, DVector<f64>) {
    let n = factor.parameters();
    let mut r = DMatrix::zeros(n, n);
    let mut z = DVector::zeros(n);
    for i in 0..n {
        let row: Vec<f64> = factor.row(i).map(&widen).collect();
        for (k, value) in row[..n - i].iter().enumerate() {
            r[(i, i + k)] = *value;
        }
        z[i] = row[n - i];
    }
    (r, z)
}

#[test]
fn the_columns_that_stay_explain_every_wrench_and_none_of_them_can_go() {
    let mut random = Random(1);
    let pair = [human()[0], FrameLink { joint: TurningJoint::Spherical, ..human()[1] }];
    let hinge = |axis| [human()[0], FrameLink { joint: TurningJoint::Revolute(axis), ..human()[1] }];
    let trees = [
        human(),
        pair.to_vec(),
        hinge(0).to_vec(),
        hinge(1).to_vec(),
        hinge(2).to_vec(),
        human()[..1].to_vec(),
    ];
    for (tree, count) in trees.iter().zip([128, 19, 17, 17, 17, 10]) {
        let mut estimator = made(tree);
        assert_eq!(estimator.parameters(), count);
        let phi = standard(tree.len(), &mut random);
        let mut power = 0.0;
        for _ in 0..2 * count {
            let owned = instant(tree, &phi, 0.0, &mut random);
            power += owned.wrench.iter().map(|w| w * w).sum::<f64>();
            estimator.absorb(&owned.frame()).unwrap();
        }
        let left = estimator.factor().residual_sum_of_squares();
        assert!(left < 1e-24 * power, "{count}: {left:.1e} of {power:.1e}");
        let (r, _) = dense(estimator.factor(), |v| v);
        let columns: Vec<f64> = (0..count).map(|j| r.column(j).norm()).collect();
        let scaled = DMatrix::from_fn(count, count, |i, j| r[(i, j)] / columns[j]);
        let singular = scaled.singular_values();
        assert!(singular.min() > 1e-3, "{count}: {}", singular.min());
    }
}

#[test]
fn single_precision_handed_over_row_by_row_is_a_batch_qr_of_the_same_rows() {
    let mut random = Random(4);
    let tree = human();
    let phi = standard(tree.len(), &mut random);
    let narrow: Vec<FrameLink<f32>> = tree
        .iter()
        .map(|l| FrameLink { parent: l.parent, joint: l.joint, position: l.position.map(|v| v as f32) })
        .collect();
    let c = config();
    let single_config = FramesConfig {
        channel_sigma: c.channel_sigma.map(|v| v as f32),
        known_offset: c.known_offset.map(|v| v as f32),
        range: c.range.map(|v| v as f32),
        still_after: 3,
        filter: None,
        suspension: None,
    };
    let rounded: Vec<FrameLink<f64>> = narrow
        .iter()
        .map(|l| FrameLink { parent: l.parent, joint: l.joint, position: l.position.map(f64::from) })
        .collect();
    let mut wide = Box::new(FrameEstimator::UNUSED);
    let wide_config = FramesConfig { known_offset: single_config.known_offset.map(f64::from), ..config() };
    wide.set_up(&rounded, &wide_config).unwrap();
    let mut single = Box::new(FrameEstimator::<f32>::UNUSED);
    single.set_up(&narrow, &single_config).unwrap();
    let mut merged = Box::new(TreeFactor::<f64>::EMPTY);
    merged.clear(128);
    let frames = 3001;
    for n in 0..frames {
        let owned = instant(&tree, &phi, 1.0, &mut random).rounded();
        wide.absorb(&owned.frame()).unwrap();
        let (wrench, [specific_force, rate, angular_acceleration], links) = owned.narrow();
        single.absorb(&Frame { wrench, specific_force, rate, angular_acceleration, links: &links }).unwrap();
        // A row every now and then, twice around; then all that is left.
        let last = n + 1 == frames;
        if last {
            single.begin_hand_over();
        }
        for i in (0..128).filter(|i| last || n % 1500 == 10 * i) {
            let row: Vec<f64> = single.factor().row(i).map(f64::from).collect();
            merged.merge_row(i, &row);
            single.factor_mut().forget_row(i);
        }
    }
    let (rss, rows) = single.factor_mut().take_residual();
    merged.merge_residual(f64::from(rss), rows);
    assert!(single.factor().row(0).all(|v| v == 0.0) && single.factor().rows() == 0);
    wide.begin_hand_over();
    assert_eq!((merged.rows(), wide.factor().rows()), (6 * frames as u32, 6 * frames as u32));
    let solve = |factor: &TreeFactor<f64>| {
        let (r, z) = dense(factor, |v| v);
        let inverse = r.clone().try_inverse().unwrap();
        let sd: Vec<f64> = (0..128).map(|j| inverse.row(j).norm()).collect();
        let norms: Vec<f64> = (0..128).map(|j| r.column(j).norm()).collect();
        let singular = DMatrix::from_fn(128, 128, |i, j| r[(i, j)] / norms[j]).singular_values();
        (&inverse * z, sd, singular.max() / singular.min())
    };
    let (exact, sd, condition) = solve(wide.factor());
    let (found, ..) = solve(&merged);
    let size = exact.norm();
    assert!(size > 10.0 && condition < 100.0, "{size} {condition}");
    let limit = 20.0 * 1.19e-7 * condition * size;
    for j in 0..128 {
        let error = (found[j] - exact[j]).abs();
        assert!(error <= limit.max(0.05 * sd[j]), "{j}: {error} {} {limit}", sd[j]);
    }
    let (a, b) = (merged.residual_sum_of_squares(), wide.factor().residual_sum_of_squares());
    assert!((a / b - 1.0).abs() < 1e-4, "{a} {b}");
}

#[test]
fn frames_that_are_none_are_counted_by_reason_and_absorb_nothing() {
    let mut random = Random(6);
    let tree = human();
    let phi = standard(tree.len(), &mut random);
    let mut estimator = made(&tree);
    for _ in 0..4 {
        estimator.absorb(&instant(&tree, &phi, 1.0, &mut random).frame()).unwrap();
    }
    let before = *estimator.factor();
    let good = instant(&tree, &phi, 1.0, &mut random);
    let nan = f64::NAN;
    let mut bad = good.clone();
    bad.links[6].rate[1] = nan;
    assert_eq!(estimator.absorb(&bad.frame()), Err(FrameRejection::NotFinite(7)));
    let mut bad = good.clone();
    bad.links[2].attitude = [0.0; 4];
    assert_eq!(estimator.absorb(&bad.frame()), Err(FrameRejection::NoAttitude(3)));
    let mut bad = good.clone();
    bad.links.pop();
    assert_eq!(estimator.absorb(&bad.frame()), Err(FrameRejection::Links(14)));
    let mut bad = good.clone();
    bad.wrench[4] = f64::INFINITY;
    assert_eq!(estimator.absorb(&bad.frame()), Err(FrameRejection::Wrench(Rejection::NotFinite(4))));
    bad.wrench[4] = 2e6;
    assert_eq!(estimator.absorb(&bad.frame()), Err(FrameRejection::Wrench(Rejection::Saturated(4))));
    let counters = *estimator.counters();
    assert_eq!((counters.frames, counters.absorbed, counters.last_link), (9, 4, 14));
    assert_eq!((counters.not_finite, counters.no_attitude, counters.wrong_links), (2, 1, 1));
    assert_eq!(counters.saturated, 1);
    assert_eq!(*estimator.factor(), before);
    // The same motion again and again under a wrench that changes: the third repeat is too many.
    let mut outcomes = Vec::new();
    for n in 0..6 {
        let mut held = good.clone();
        held.wrench[0] += f64::from(n);
        outcomes.push(estimator.absorb(&held.frame()).is_ok());
    }
    assert_eq!(outcomes, [true, true, true, false, false, false]);
    assert_eq!(estimator.counters().without_motion, 3);
    // A body at rest, whose wrench is at rest too, is none of that.
    estimator.reset();
    assert!((0..9).all(|_| estimator.absorb(&good.frame()).is_ok()));
}

#[test]
fn trees_that_cannot_be_are_named() {
    let tree = human();
    let check = |links: &[FrameLink<f64>]| FrameEstimator::check(links, &config());
    assert_eq!(check(&[]), Err(FramesError::Links(0)));
    let long: Vec<_> = (0..17).map(|_| tree[1]).collect();
    assert_eq!(check(&long), Err(FramesError::Links(17)));
    let spherical: Vec<_> = tree.iter().map(|l| FrameLink { joint: TurningJoint::Spherical, ..*l }).collect();
    assert_eq!(check(&spherical), Err(FramesError::Parameters(136)));
    let mut out_of_order = tree.clone();
    out_of_order[3].parent = 3;
    assert_eq!(check(&out_of_order), Err(FramesError::Link(3)));
    let mut no_axis = tree.clone();
    no_axis[5].joint = TurningJoint::Revolute(3);
    assert_eq!(check(&no_axis), Err(FramesError::Link(5)));
    let bad = FramesConfig { channel_sigma: [1.0, 1.0, 0.0, 1.0, 1.0, 1.0], ..config() };
    assert_eq!(FrameEstimator::check(&tree, &bad), Err(FramesError::Sigma(2)));
}

#[test]
fn a_level_that_is_not_handed_over_takes_nothing_more() {
    let tree = human()[..1].to_vec();
    let mut random = Random(8);
    let phi = standard(1, &mut random);
    let mut estimator = made(&tree);
    let frames: Vec<_> = (0..64).map(|_| instant(&tree, &phi, 1.0, &mut random)).collect();
    for n in 0..LEVEL_FRAMES {
        estimator.absorb(&frames[(n % 64) as usize].frame()).unwrap();
    }
    assert!(estimator.is_full());
    assert_eq!(estimator.absorb(&frames[0].frame()), Err(FrameRejection::Full));
    estimator.begin_hand_over();
    assert_eq!(estimator.absorb(&frames[0].frame()), Ok(()));
    assert_eq!(estimator.counters().full, 1);
}

#[test]
fn the_stop_rule_is_met_when_every_deviation_of_the_level_is_small_enough() {
    let tree = human();
    let mut random = Random(31);
    let phi = standard(tree.len(), &mut random);
    let frames: Vec<Owned> = (0..120).map(|_| instant(&tree, &phi, 1.0, &mut random)).collect();
    let whole = |count: usize| {
        let mut estimator = made(&tree);
        frames[..count].iter().for_each(|f| estimator.absorb(&f.frame()).unwrap());
        let (r, _) = dense(estimator.factor(), |v| v);
        let inverse = r.try_inverse().unwrap();
        let expected: Vec<f64> = inverse.row_iter().map(|row| row.norm()).collect();
        for (j, sd) in expected.iter().enumerate() {
            assert!((estimator.factor().standard_deviation(j) / sd - 1.0).abs() < 1e-6, "{j}");
        }
        expected
    };
    assert_eq!(made(&tree).factor().standard_deviation(3), f64::INFINITY);
    let sd = whole(80);
    let mut estimator = made(&tree);
    let mut limits = [f64::INFINITY; PARAMETERS];
    // Two of the parameters, as well known as after eighty frames.
    for j in [3, 97] {
        limits[j] = 1.000_001 * sd[j];
    }
    estimator.set_stop(Some(&FrameStop { standard_deviation: limits, minimum_frames: 2 }));
    let met = frames.iter().position(|f| {
        estimator.absorb(&f.frame()).unwrap();
        estimator.look()
    });
    // Each is examined with every second frame, one after the other.
    assert!((79..84).contains(&met.unwrap()), "{met:?}");
    // What was handed over is not examined any more.
    estimator.begin_hand_over();
    (0..128).for_each(|row| estimator.factor_mut().forget_row(row));
    assert!(!estimator.look());
    estimator.set_stop(None);
    assert!(!estimator.look());
}

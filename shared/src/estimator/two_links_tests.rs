//! Readings made from the rows with accelerations, the algebra that the estimator avoids.

extern crate std;
use std::vec::Vec;

use nalgebra::{Matrix3, Vector3};

use super::*;
use crate::estimator::{Outcome, TwoLinkEstimator};
use crate::random::Random;
use crate::screening::Limits;
use crate::spatial::Position;
use crate::tree::{Joint, JointMotion, Link, motion::states, rows};

const TAPS: usize = 32;
const GRAVITY: f64 = 9.80665;

/// Three angles about x, y, z in turn.
#[derive(Clone, Copy)]
struct Swing {
    amplitude: [f64; 3],
    frequency_hz: [f64; 3],
    phase: [f64; 3],
}

impl Swing {
    fn rotation(&self, t: f64) -> Matrix3<f64> {
        (0..3).fold(Matrix3::identity(), |r, k| {
            let axis = Vector3::ith(k, 1.0);
            let angle =
                self.amplitude[k] * (core::f64::consts::TAU * self.frequency_hz[k] * t + self.phase[k]).sin();
            r * crate::tree::joint::turn(&axis, angle.sin(), angle.cos())
        })
    }

    /// Returns the rate in the turning axes, Ṙ = R [ω]×, by a central difference of sixth order.
    fn rate(&self, t: f64) -> Vector3<f64> {
        let s = self.rotation(t).transpose() * difference(|t| self.rotation(t), t);
        Vector3::new(s.m32 - s.m23, s.m13 - s.m31, s.m21 - s.m12) * 0.5
    }

    fn change(&self, t: f64) -> Vector3<f64> {
        difference(|t| self.rate(t), t)
    }
}

fn difference<V>(f: impl Fn(f64) -> V, t: f64) -> V
where
    V: core::ops::Sub<Output = V> + core::ops::Add<Output = V> + core::ops::Mul<f64, Output = V>,
{
    let h = 2e-3;
    let d = |k: f64| f(t + k * h) - f(t - k * h);
    (d(1.0) * 45.0 + d(2.0) * -9.0 + d(3.0)) * (1.0 / (60.0 * h))
}

struct Case {
    base: Swing,
    joint: Swing,
    first: ImuMounting<f64>,
    second: ImuMounting<f64>,
    at: [f64; 3],
    phi: [f64; 20],
    offset: [f64; 6],
}

fn swing(random: &mut Random, amplitude: f64) -> Swing {
    Swing {
        amplitude: core::array::from_fn(|_| amplitude * (0.6 + 0.4 * random.uniform())),
        frequency_hz: core::array::from_fn(|k| 0.45 + 0.17 * k as f64 + 0.1 * random.uniform()),
        phase: core::array::from_fn(|_| 6.0 * random.uniform()),
    }
}

fn mounting(random: &mut Random) -> ImuMounting<f64> {
    let mut v = || random.uniform() - 0.5;
    ImuMounting {
        rotation: Rotation::from_quaternion([0.8, v(), v(), v()]).unwrap(),
        position: Position::new(0.2 * v(), 0.2 * v(), 0.2 * v()),
        accel_scale: [1.01, 0.99, 1.02],
        accel_bias: SpecificForce::new(0.1, -0.2, 0.05),
        gyro_bias: AngularRate::new(0.01, -0.02, 0.03),
    }
}

fn case(random: &mut Random) -> Case {
    let base = swing(random, 0.5);
    let joint = swing(random, 0.7);
    let (first, second) = (mounting(random), mounting(random));
    let mut v = |s: f64| s * (random.uniform() - 0.5);
    // Whatever numbers: the equation is linear in them.
    let phi = core::array::from_fn(|k| match k % 10 {
        0 => 3.0 + v(1.0),
        1..=3 => v(0.6),
        4..=6 => 0.3 + v(0.1),
        _ => v(0.1),
    });
    Case {
        base,
        joint,
        first,
        second,
        at: [0.1, -0.05, 0.2],
        phi,
        offset: core::array::from_fn(|k| v(if k < 3 { 10.0 } else { 1.0 })),
    }
}

impl Case {
    fn links(&self) -> [Link<f64>; 2] {
        let base =
            Link { parent: 0, joint: Joint::Free, rotation: Matrix3::identity(), position: Vector3::zeros() };
        [base, Link { joint: Joint::Spherical, position: Vector3::from(self.at), ..base }]
    }

    fn reading(&self, time_ns: u64) -> TwoLinkReading<f64> {
        let t = time_ns as f64 * 1e-9;
        let attitude = self.base.rotation(t);
        // S is carried around a little, too.
        let carried = |w: f64, p: f64| -0.05 * w * w * (w * t + p).sin();
        let a = Vector3::new(carried(4.0, 0.0), carried(3.1, 1.0), carried(3.7, 2.0) + GRAVITY);
        let motion = BaseMotion {
            specific_force: attitude.transpose() * a,
            rate: self.base.rate(t),
            angular_acceleration: self.base.change(t),
        };
        let links = self.links();
        let relative = self.joint.rotation(t);
        let (w, c) = (self.joint.rate(t), self.joint.change(t));
        let joints = [
            JointMotion::rest(&links[0]),
            JointMotion::spherical(&links[1], &relative, [w.x, w.y, w.z], [c.x, c.y, c.z]),
        ];
        let mut both = [LinkState::zero(); 2];
        states(&links, &joints, &motion, &mut both).unwrap();
        let mut y = [0.0; 120];
        rows::base_rows(&both, &mut y).unwrap();
        let wrench = core::array::from_fn(|i| {
            self.offset[i] + (0..20).map(|k| y[20 * i + k] * self.phi[k]).sum::<f64>()
        });
        let imu = |mounting: &ImuMounting<f64>, state: &LinkState<f64>| {
            let p = state.rotation * mounting.position.vector();
            let (w, c) = (&state.rate, &state.angular_acceleration);
            let a = state.specific_force + c.cross(&p) + w.cross(&w.cross(&p));
            let to_imu = (state.rotation * mounting.rotation.matrix()).transpose();
            let (a, w) = (to_imu * a, to_imu * w);
            let bias = mounting.accel_bias.array();
            let read: [f64; 3] = core::array::from_fn(|k| (a[k] + bias[k]) / mounting.accel_scale[k]);
            (SpecificForce::from_array(read), AngularRate::from_array(w.into()) + mounting.gyro_bias)
        };
        let (specific_force, angular_rate) = imu(&self.first, &both[0]);
        let (second_force, second_rate) = imu(&self.second, &both[1]);
        TwoLinkReading {
            base: Reading { time_ns, wrench: Wrench::from_array(wrench), specific_force, angular_rate },
            specific_force: second_force,
            angular_rate: second_rate,
            attitude: quaternion(&relative),
        }
    }

    /// Returns what can be determined: the second link's mass sits in the joint as a part of the base.
    fn base_parameters(&self) -> [f64; 19] {
        let (m, p) = (self.phi[10], Vector3::from(self.at));
        let mut out = [0.0; 19];
        out[..10].copy_from_slice(&self.phi[..10]);
        out[10..].copy_from_slice(&self.phi[11..]);
        out[0] += m;
        for k in 0..3 {
            out[1 + k] += m * p[k];
        }
        let s = (Matrix3::identity() * p.dot(&p) - p * p.transpose()) * m;
        for (k, (i, j)) in [(0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1)].into_iter().enumerate() {
            out[4 + k] += s[(i, j)];
        }
        out
    }

    fn config(&self, known: bool) -> EstimatorConfig<f64> {
        EstimatorConfig {
            rate_hz: 1000.0,
            filter_width_s: 0.1,
            row_every: 10,
            channel_sigma: [1.0, 1.0, 1.0, 0.1, 0.1, 0.1],
            known_offset: if known { self.offset } else { [0.0; 6] },
            mounting: self.first,
            limits: Limits::none(),
        }
    }

    fn model(&self, attitude: JointAttitude<f64>) -> TwoLinks<f64> {
        TwoLinks::new(self.second, [1e6; 2], self.at, attitude).unwrap()
    }
}

/// Returns the quaternion of a rotation by less than half a turn.
fn quaternion(r: &Matrix3<f64>) -> [f64; 4] {
    let w = 0.5 * (1.0 + r.trace()).sqrt();
    let s = 0.25 / w;
    [w, s * (r.m32 - r.m23), s * (r.m13 - r.m31), s * (r.m21 - r.m12)]
}

fn estimated<const N: usize>(
    case: &Case,
    attitude: JointAttitude<f64>,
    seconds: u64,
) -> std::boxed::Box<TwoLinkEstimator<f64, N, TAPS>> {
    let mut estimator = std::boxed::Box::new(TwoLinkEstimator::<f64, N, TAPS>::UNUSED);
    estimator.set_up(&case.config(N == 19), &case.model(attitude)).unwrap();
    for n in 0..1000 * seconds {
        estimator.absorb(&case.reading(n * 1_000_000));
    }
    estimator
}

fn error<const N: usize>(case: &Case, estimator: &TwoLinkEstimator<f64, N, TAPS>) -> f64 {
    let solution = estimator.factor().solve();
    assert!(solution.determined.iter().all(|d| *d), "{:?}", solution.determined);
    let truth = case.base_parameters().into_iter().chain(case.offset);
    solution.estimate.iter().zip(truth).fold(0.0, |m, (e, t)| f64::max(m, (e - t).abs()))
}

#[test]
fn two_links_give_their_base_parameters_whatever_the_motion() {
    let mut random = Random(3);
    for _ in 0..2 {
        let case = case(&mut random);
        // The filter's aliasing is below 2e-9 of the rates' derivatives, the differences of this test about
        // as much.
        let known = estimated::<19>(&case, JointAttitude::Streamed, 20);
        assert!(error(&case, &known) < 1e-6, "{}", error(&case, &known));
        let free = estimated::<25>(&case, JointAttitude::Streamed, 20);
        assert!(error(&case, &free) < 1e-6, "{}", error(&case, &free));
        assert_eq!(free.counters().blocks, (20_000 - 95) / 10 + 1);
    }
}

#[test]
fn both_imus_find_the_joint_s_attitude_and_with_it_the_parameters() {
    let case = case(&mut Random(5));
    let start = quaternion(&case.joint.rotation(0.0));
    let from = |initial, time_constant_s| JointAttitude::FromImus { initial, time_constant_s };
    // The gyros alone: trapezoids of 1 ms leave h²/12 of the rates' third derivative and the coning of one
    // step.
    let gyros = estimated::<25>(&case, from(start, 0.0), 20);
    let last = case.joint.rotation(19.999);
    let off = |e: &TwoLinkEstimator<f64, 25, TAPS>| {
        let found = matrix(e.model().attitude()).unwrap();
        (found.transpose() * last - Matrix3::identity()).norm() / 2.0_f64.sqrt()
    };
    assert!(off(&gyros) < 3e-5, "{}", off(&gyros));
    assert!(error(&case, &gyros) < 1e-4, "{}", error(&case, &gyros));
    // Tilted at the start by 0.1 rad about what is level there: the accelerometers bring it back before the
    // first row.
    let level = case.base.rotation(0.0).transpose() * Vector3::x();
    let tilted = quaternion(
        &(crate::tree::joint::turn(&level, 0.1_f64.sin(), 0.1_f64.cos()) * case.joint.rotation(0.0)),
    );
    let corrected = estimated::<25>(&case, from(tilted, 5.0), 20);
    let blind = estimated::<25>(&case, from(tilted, 0.0), 20);
    assert!(off(&blind) > 0.09, "{}", off(&blind));
    assert!(off(&corrected) < 0.1 * off(&blind), "{} {}", off(&corrected), off(&blind));
    let exact = estimated::<25>(&case, from(start, 5.0), 20);
    assert!(off(&exact) < 1e-4, "{}", off(&exact));
    assert!(error(&case, &exact) < 1e-3, "{}", error(&case, &exact));
    assert_eq!(exact.counters().blocks + u32::from(SETTLING) - 1, gyros.counters().blocks);
}

#[test]
fn readings_that_are_none_are_named_and_absorb_nothing() {
    let case = case(&mut Random(7));
    let mut estimator = estimated::<19>(&case, JointAttitude::Streamed, 1);
    let blocks = estimator.counters().blocks;
    let factor = estimator.factor();
    let good = case.reading(1_000_000_000);
    let nan = f64::NAN;
    let spoilt: [(TwoLinkReading<f64>, u8); 4] = [
        (TwoLinkReading { specific_force: SpecificForce::new(0.0, nan, 9.8), ..good }, 13),
        (TwoLinkReading { angular_rate: AngularRate::new(0.0, 0.0, f64::INFINITY), ..good }, 17),
        (TwoLinkReading { attitude: [0.0; 4], ..good }, ATTITUDE_CHANNEL),
        (TwoLinkReading { attitude: [nan; 4], ..good }, ATTITUDE_CHANNEL),
    ];
    for (reading, channel) in spoilt {
        let outcome = estimator.absorb(&reading);
        assert_eq!(outcome, Outcome::Rejected(Rejection::NotFinite(channel)));
    }
    let names: Vec<_> = [13, 17, 18].map(|c| crate::screening::CHANNEL_NAMES[c]).into();
    assert_eq!(names, ["imu1_ay_mps2", "imu1_gz_radps", "q1_w"]);
    assert_eq!((estimator.counters().rejected, estimator.counters().blocks), (4, blocks));
    assert_eq!(estimator.factor(), factor);
    assert!(TwoLinks::<f64>::new(case.second, [1.0; 2], [nan, 0.0, 0.0], JointAttitude::Streamed).is_none());
    let zero = JointAttitude::FromImus { initial: [0.0; 4], time_constant_s: 1.0 };
    assert!(TwoLinks::<f64>::new(case.second, [1.0; 2], [0.0; 3], zero).is_none());
}

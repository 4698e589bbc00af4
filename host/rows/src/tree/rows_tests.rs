//! Rows without accelerations, filtered, are the filtered rows with them.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use rigident_shared::screening::Rejection;
use rigident_shared::tree::{BaseMotion, Joint, Link};

use rigident_fit::{Channel, Kind, Owner, Parameter, RowSource, SampleRows, Silent, Timing};
use rigident_model::base::Rows;
use rigident_model::rows::Moving;

const RATE_HZ: f64 = 1000.0;

/// Returns angle, rate and acceleration of a swing about a mean.
fn swing(t: f64, hz: f64, phase: f64) -> [f64; 3] {
    let w = std::f64::consts::TAU * hz;
    let a = w * t + phase;
    [0.8 * a.sin() + phase, 0.8 * w * a.cos(), -0.8 * w * w * a.sin()]
}

/// The standard parameters' rows of a tree in motion: as momentum, and with accelerations.
struct Standard {
    parameters: Vec<Parameter>,
    channels: Vec<Channel>,
    momentum: Vec<SampleRows>,
    with: Vec<Vec<f64>>,
}

impl Standard {
    fn new() -> Self {
        let link = |parent, joint, p: [f64; 3]| Link {
            parent,
            joint,
            rotation: Matrix3::identity(),
            position: Vector3::from(p),
        };
        let skew = Vector3::new(1.0, -2.0, 0.5).normalize();
        let links = vec![
            link(0, Joint::Free, [0.0; 3]),
            link(0, Joint::Revolute(skew), [0.1, 0.2, 0.3]),
            link(1, Joint::Spherical, [0.0, 0.1, 0.4]),
            link(1, Joint::Prismatic(skew), [-0.2, 0.0, 0.1]),
            link(0, Joint::Universal(Vector3::x(), Vector3::y()), [0.2, -0.3, 0.0]),
        ];
        let mut moving = Moving::new(links).unwrap();
        let (mut momentum, mut with) = (Vec::new(), Vec::new());
        for n in 0..400 {
            let t = f64::from(n) / RATE_HZ;
            let s: Vec<[f64; 3]> =
                (0..6).map(|k| swing(t, 0.6 + 0.08 * f64::from(k), f64::from(k))).collect();
            let ball = UnitQuaternion::from_axis_angle(&nalgebra::Unit::new_normalize(skew), s[1][0]);
            let b = ball.quaternion();
            let q = [s[0][0], b.w, b.i, b.j, b.k, s[2][0], s[3][0], s[4][0]];
            let rates = |k: usize| {
                let w = skew * s[1][k];
                [s[0][k], w.x, w.y, w.z, s[2][k], s[3][k], s[4][k]]
            };
            let base = BaseMotion {
                specific_force: Vector3::new(s[2][0], 3.0 * s[3][0], 9.8),
                rate: Vector3::x() * s[5][1] + Vector3::y() * s[4][1],
                angular_acceleration: Vector3::x() * s[5][2] + Vector3::y() * s[4][2],
            };
            moving.set(&q, &rates(1), &rates(2), &base).unwrap();
            with.push(moving.all_rows().unwrap().to_vec());
            // Accelerations left out: not a number.
            let blind = BaseMotion { angular_acceleration: Vector3::repeat(f64::NAN), ..base };
            moving.set(&q, &rates(1), &[f64::NAN; 7], &blind).unwrap();
            let rows = moving.momentum_rows(Rows::Both).unwrap();
            let measured = vec![swing(t, 1.0, 0.0)[0]; 13];
            momentum.push(SampleRows {
                missing: Vec::new(),
                smoothed: rows.smoothed,
                differentiated: rows.differentiated,
                measured,
            });
        }
        let parameter =
            |k: usize| Parameter::new(k.to_string(), Owner::Other("tree".into()), Kind::Inertia, "");
        let channel = |k: usize| Channel {
            name: k.to_string(),
            unit: String::new(),
            sigma: None,
            offset: None,
            group: 0,
        };
        Self {
            parameters: (0..50).map(parameter).collect(),
            channels: (0..13).map(channel).collect(),
            momentum,
            with,
        }
    }
}

impl RowSource for Standard {
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn timing(&self) -> Timing {
        Timing::Uniform { rate_hz: RATE_HZ }
    }

    fn samples(&self) -> usize {
        self.momentum.len()
    }

    fn time_ns(&self, sample: usize) -> u64 {
        sample as u64 * 1_000_000
    }

    fn rows(&self, sample: usize, rows: &mut SampleRows) -> Result<(), Rejection> {
        *rows = self.momentum[sample].clone();
        Ok(())
    }
}

#[test]
fn filtered_rows_without_accelerations_are_the_filtered_rows_with_them() {
    let source = Standard::new();
    let blocks = source.condition(&Silent).unwrap();
    let kernel = &blocks.filter().response;
    let (mut rows, mut measured) = (vec![0.0; 13 * 50], vec![0.0; 13]);
    for block in 0..blocks.len() {
        blocks.write(block, &mut rows, &mut measured);
        let last = (blocks.time_s(block) * RATE_HZ).round() as usize;
        let first = last + 1 - kernel.len();
        let with = |i: usize| &source.with[first + i];
        let scale = with(0).iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        for (k, got) in rows.iter().enumerate() {
            let wanted: f64 = kernel.iter().enumerate().map(|(i, h)| h * with(i)[k]).sum();
            // The kernel's aliasing: 2e-9 at 200 Hz and less at 1 kHz, of momenta with harmonics below 5 Hz.
            assert!((got - wanted).abs() < 2e-9 * scale, "{got} {wanted} {scale}");
        }
    }
    assert!(blocks.len() > 10);
}

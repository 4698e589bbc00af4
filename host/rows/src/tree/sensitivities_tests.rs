use nalgebra::{DVector, Rotation3, UnitQuaternion};
use rigident_shared::tree::{BaseMotion, Link};

use super::*;
use crate::tree::contact::{Contact, ContactState, Foot};
use crate::tree::drive::{Drive, Term};
use crate::tree::joints::{Resolved, Seen, resolve};
use crate::tree::{BaseSensor, Input, NoisySignal, TreeSource};
use rigident_model::base::{Rows, Situation};
use rigident_model::{Model, ModelLink};

struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn three(&mut self) -> Three {
        Vector3::from_fn(|_, _| self.next())
    }
}

fn model(joints: &[(usize, Joint<f64>)], random: &mut Random) -> Model {
    let mut links = vec![(0, Joint::Free)];
    links.extend_from_slice(joints);
    let links = links.into_iter().enumerate().map(|(i, (parent, joint))| {
        let rotation = if i == 0 { Matrix3::identity() } else { Rotation3::new(random.three()).into_inner() };
        let position = if i == 0 { Vector3::zeros() } else { random.three() * 0.3 };
        let own = Link { parent, joint, rotation, position };
        ModelLink::new(format!("l{i}"), format!("j{i}"), own, None)
    });
    Model { name: "tree".to_owned(), links: links.collect(), findings: Vec::new(), gravity_mps2: None }
}

fn frames(model: &Model, count: usize, is_floating: bool, random: &mut Random) -> Vec<Frame> {
    let of_frame = |k: usize, random: &mut Random| {
        let mut positions = Vec::new();
        let mut freedoms = 0;
        for link in model.links.iter().skip(1) {
            if link.link.joint == Joint::Spherical {
                let q = UnitQuaternion::new(random.three());
                positions.extend([q.w, q.i, q.j, q.k]);
            } else {
                positions.extend((0..link.link.joint.coordinates()).map(|_| random.next()));
            }
            freedoms += link.link.joint.freedoms();
        }
        let base = if is_floating {
            BaseMotion {
                specific_force: random.three() * 10.0,
                rate: random.three(),
                angular_acceleration: Vector3::zeros(),
            }
        } else {
            BaseMotion::still([0.0, 0.0, -9.8])
        };
        Frame {
            time_ns: k as u64 * 10_000_000,
            positions,
            rates: (0..freedoms).map(|_| random.next()).collect(),
            base,
            wrench: [1.0; 6],
            efforts: vec![1.0; freedoms],
            standing: Vec::new(),
            ground: Default::default(),
        }
    };
    (0..count).map(|k| of_frame(k, random)).collect()
}

/// Returns the frames that prepared readings would make if they had been corrected for an error of this size.
fn corrected(input: &Input, error: &SignalError, x: f64) -> Input {
    let unit = |axis: usize| Matrix3::<f64>::identity().column(axis).into_owned();
    let mut moving = Moving::new(input.model.tree()).unwrap();
    let mut out = input.clone();
    if let (SignalError::LeverArm(axis), BaseSensor::Imu(place)) = (error, &mut out.base) {
        place[*axis] += x;
    }
    for frame in &mut out.frames {
        let zeros = vec![0.0; frame.rates.len()];
        moving.set(&frame.positions, &frame.rates, &zeros, &frame.base).unwrap();
        let (mut a, mut w) = (frame.base.specific_force, frame.base.rate);
        match error {
            SignalError::AccelBias(axis) => a -= axis * x,
            SignalError::AccelGain { to, from } => a -= to * (x * from.dot(&a)),
            SignalError::BaseTilt(axis) => a = Rotation3::new(unit(*axis) * x) * a,
            SignalError::GyroBias { link: 0, axis } => w -= axis * x,
            SignalError::GyroGain { link: 0, axis } => w -= axis * (x * axis.dot(&w)),
            SignalError::GyroRotation { link: 0, axis } => w = Rotation3::new(axis * x) * w,
            SignalError::BaseRotation(axis) => {
                let turn = Rotation3::new(unit(*axis) * x);
                (a, w) = (turn * a, turn * w);
            }
            _ => {}
        }
        let root = Resolved {
            attitude: Matrix3::identity(),
            rate: w,
            positions: Vec::new(),
            rates: Vec::new(),
            misfit: 0.0,
        };
        let mut links = vec![root];
        let (mut q, mut v) = (frame.positions.as_slice(), frame.rates.as_slice());
        for (i, link) in input.model.links.iter().enumerate().skip(1) {
            let (own_q, rest_q) = q.split_at(link.link.joint.coordinates());
            let (own_v, rest_v) = v.split_at(link.link.joint.freedoms());
            (q, v) = (rest_q, rest_v);
            let is_seen = input.signals.iter().any(|s| s.kind == SignalKind::Attitude && s.link == i);
            let seen = if is_seen {
                let (mut attitude, mut rate) = moving.turning(i).unwrap();
                match error {
                    SignalError::BaseRotation(axis) => {
                        attitude = Rotation3::new(unit(*axis) * x).into_inner() * attitude;
                    }
                    SignalError::LinkRotation { link, axis } if *link == i => {
                        let turn = Rotation3::new(unit(*axis) * x).into_inner();
                        (attitude, rate) = (attitude * turn.transpose(), turn * rate);
                    }
                    SignalError::GyroBias { link, axis } if *link == i => rate -= axis * x,
                    SignalError::GyroRotation { link, axis } if *link == i => {
                        rate = Rotation3::new(axis * x) * rate;
                    }
                    SignalError::GyroGain { link, axis } if *link == i => {
                        rate -= axis * (x * axis.dot(&rate))
                    }
                    _ => {}
                }
                Seen::Link { attitude, rate }
            } else {
                let zero = if *error == SignalError::JointZero(i) { x } else { 0.0 };
                Seen::Coordinate(own_q[0] - zero, own_v[0])
            };
            links.push(resolve(&link.link, &links[link.link.parent], &seen).unwrap());
        }
        frame.positions = links.iter().flat_map(|l| l.positions.iter().copied()).collect();
        frame.rates = links.iter().flat_map(|l| l.rates.iter().copied()).collect();
        (frame.base.specific_force, frame.base.rate) = (a, w);
        match error {
            SignalError::EffortGain(channel) => frame.efforts[channel - 6] *= 1.0 - x,
            SignalError::FootZero { foot, component } => frame.ground.wrenches[*foot][*component] -= x,
            SignalError::FootGain { foot, component } => frame.ground.wrenches[*foot][*component] *= 1.0 - x,
            _ => {}
        }
    }
    out
}

/// Returns what parameters predict of every frame: smoothed and differentiated parts, channel by channel.
fn predicted(source: &TreeSource, phi: &[f64]) -> Vec<f64> {
    let (channels, n) = (source.channels().len(), phi.len());
    let mut all = Vec::new();
    for sample in 0..source.samples() {
        let mut rows = SampleRows::default();
        rows.clear(channels, n);
        source.rows(sample, &mut rows).unwrap();
        for part in [&rows.smoothed, &rows.differentiated] {
            all.extend(part.chunks_exact(n).map(|row| row.iter().zip(phi).map(|(a, b)| a * b).sum::<f64>()));
        }
    }
    all
}

/// Returns the predicted parts less the measured ones: errors of joint zeros move the measured contribution
/// of feet, too.
fn left_over(source: &TreeSource, phi: &[f64]) -> Vec<f64> {
    let (channels, mut all) = (source.channels().len(), predicted(source, phi));
    for sample in 0..source.samples() {
        let mut rows = SampleRows::default();
        rows.clear(channels, phi.len());
        source.rows(sample, &mut rows).unwrap();
        let own = all.iter_mut().skip(2 * channels * sample);
        own.zip(&rows.measured).for_each(|(to, measured)| *to -= measured);
    }
    all
}

/// Compares the columns of all errors with differences of the predictions of corrected readings.
fn compare(input: Input, random: &mut Random) {
    let source = TreeSource::new(input).unwrap();
    // Rotors that cannot be distinguished from moments of inertia are gone.
    let input = source.input().clone();
    let phi: Vec<f64> = source.parameters().iter().map(|_| random.next()).collect();
    let columns = source.error_columns(&phi).unwrap();
    let (channels, count) = (source.channels().len(), input.errors.len());
    let mut own = vec![Vec::new(); count];
    for sample in 0..source.samples() {
        let mut rows = SampleRows::default();
        rows.clear(channels, count);
        columns.rows(sample, &mut rows).unwrap();
        for part in [&rows.smoothed, &rows.differentiated] {
            for row in part.chunks_exact(count) {
                own.iter_mut().zip(row).for_each(|(column, value)| column.push(*value));
            }
        }
    }
    for (error, own) in input.errors.iter().zip(&own) {
        let step = 1e-4;
        let at = |x: f64| {
            let moved = TreeSource::with_base(corrected(&input, error, x), source.base().clone()).unwrap();
            left_over(&moved, &phi)
        };
        let (more, less) = (at(step), at(-step));
        let scale = own.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        assert!(scale > 1e-3, "{error:?}");
        for ((a, b), own) in more.iter().zip(&less).zip(own) {
            let difference = (a - b) / (2.0 * step);
            // Central differences are off by the third derivative, some 1e-8, and by rounding.
            assert!((difference - own).abs() < 1e-6 * scale, "{error:?}: {own} for {difference}");
        }
    }
}

fn input(model: Model, frames: Vec<Frame>, situation: Situation, seen: &[usize]) -> Input {
    let signal = |kind, link| NoisySignal { kind, link, stated: None, found: 0.0 };
    let mut signals = Vec::new();
    for link in 1..model.links.len() {
        let is_seen = seen.contains(&link);
        signals.push(signal(if is_seen { SignalKind::Attitude } else { SignalKind::Position }, link));
    }
    Input {
        frames,
        is_static: false,
        rate_hz: 100.0,
        base: BaseSensor::Imu(if situation.floating { [0.1, -0.2, 0.05] } else { [0.0; 3] }),
        situation,
        channel_sigma: None,
        known_offset: None,
        nuisances: Vec::new(),
        errors: Vec::new(),
        drives: Vec::new(),
        as_stated: Vec::new(),
        signals,
        rate_sigma: 0.0,
        contact: None,
        model,
    }
}

/// Balls, universal joints, hinges and slides, seen by IMUs or by columns of their own, on a base that moves.
#[test]
fn columns_of_a_moving_tree_are_those_of_corrected_readings() {
    let mut random = Random(1);
    let axis = |random: &mut Random| random.three().normalize();
    let joints = [
        (0, Joint::Spherical),
        (1, Joint::Universal(axis(&mut random), axis(&mut random))),
        (2, Joint::Revolute(axis(&mut random))),
        (3, Joint::Prismatic(axis(&mut random))),
        (4, Joint::Spherical),
        (0, Joint::Revolute(axis(&mut random))),
        (6, Joint::Spherical),
        (6, Joint::Revolute(axis(&mut random))),
    ];
    let model = model(&joints, &mut random);
    let frames = frames(&model, 5, true, &mut random);
    let seen = [1, 2, 3, 5, 7];
    let mut input = input(model, frames, Situation { floating: true, rows: Rows::Base, mimic: false }, &seen);
    for axis in 0..3 {
        let u = random.three();
        input.errors.extend([
            SignalError::LeverArm(axis),
            SignalError::BaseRotation(axis),
            SignalError::GyroBias { link: 0, axis: u },
            SignalError::GyroGain { link: 0, axis: u },
            SignalError::GyroRotation { link: 0, axis: u },
            SignalError::AccelBias(u),
            SignalError::AccelGain { to: u, from: random.three() },
        ]);
        for link in seen {
            input.errors.extend([
                SignalError::LinkRotation { link, axis },
                SignalError::GyroBias { link, axis: u },
                SignalError::GyroGain { link, axis: u },
                SignalError::GyroRotation { link, axis: u },
            ]);
        }
    }
    input.errors.extend([4, 6, 8].map(SignalError::JointZero));
    compare(input, &mut random);
}

/// Hinges and slides with efforts, two chains, with the wrench on a base that moves, and on one that is held
/// still.
#[test]
fn columns_of_an_arm_are_those_of_corrected_readings() {
    let mut random = Random(2);
    for (floating, rows) in [(true, Rows::Both), (false, Rows::Joint), (false, Rows::Both)] {
        let axis = |random: &mut Random| random.three().normalize();
        let joints = [
            (0, Joint::Revolute(axis(&mut random))),
            (1, Joint::Revolute(axis(&mut random))),
            (2, Joint::Prismatic(axis(&mut random))),
            (3, Joint::Revolute(axis(&mut random))),
            (4, Joint::Revolute(axis(&mut random))),
            (2, Joint::Revolute(axis(&mut random))),
            (6, Joint::Prismatic(axis(&mut random))),
        ];
        let model = model(&joints, &mut random);
        let frames = frames(&model, 5, floating, &mut random);
        let mut input = input(model, frames, Situation { floating, rows, mimic: false }, &[]);
        input.drives = Drive::of_joints(
            &input.freedom_names(),
            &input.model.tree(),
            &vec![Term::Viscous, Term::Coulomb(None), Term::Rotor].into(),
        );
        let zeros = (1..=7).map(SignalError::JointZero);
        input
            .errors
            .extend(zeros.filter(|k| floating || rows == Rows::Both || *k != SignalError::JointZero(0)));
        for axis in 0..2 {
            input.errors.push(SignalError::BaseTilt(axis));
        }
        for axis in (0..3).filter(|_| floating) {
            input.errors.extend([
                SignalError::LeverArm(axis),
                SignalError::BaseRotation(axis),
                SignalError::GyroBias { link: 0, axis: random.three() },
                SignalError::AccelBias(random.three()),
            ]);
        }
        compare(input, &mut random);
    }
}

/// A joint about the vertical carries a first moment c that no torque shows, but that a tilt ε of the base
/// does: `c × a` about z with `a = R(ε) (0, 0, g)`.
#[test]
fn a_tilted_base_shows_the_moment_that_a_vertical_joint_hides() {
    let mut random = Random(9);
    let mut model = model(&[(0, Joint::Revolute(Vector3::z()))], &mut random);
    model.links[1].link.rotation = Matrix3::identity();
    model.links[1].nominal = Some([2.0, 0.3, -0.1, 0.05, 0.1, 0.1, 0.1, 0.0, 0.0, 0.0]);
    let frames = frames(&model, 5, false, &mut random);
    let mut input = input(model, frames, Situation { floating: false, rows: Rows::Joint, mimic: false }, &[]);
    input.errors = vec![SignalError::BaseTilt(0), SignalError::BaseTilt(1)];
    let source = TreeSource::new(input).unwrap();
    let phi = (source.base().map()
        * DVector::from_vec(vec![2.0, 0.3, -0.1, 0.05, 0.1, 0.1, 0.1, 0.0, 0.0, 0.0]))
    .as_slice()
    .to_vec();
    let columns = source.error_columns(&phi).unwrap();
    for (sample, frame) in source.input().frames.iter().enumerate() {
        let mut rows = SampleRows::default();
        rows.clear(source.channels().len(), 2);
        columns.rows(sample, &mut rows).unwrap();
        let (sine, cosine) = frame.positions[0].sin_cos();
        let moment = [0.3 * cosine + 0.1 * sine, 0.3 * sine - 0.1 * cosine];
        for (own, moment) in rows.smoothed.iter().zip(moment) {
            assert!((own + frame.base.specific_force.z * moment).abs() < 1e-9, "{own} {moment}");
        }
    }
}

/// Feet whose sensors have no noise: the rows are those of the channels, and what the feet push is on the
/// measured side.
#[test]
fn columns_of_a_robot_on_its_feet_are_those_of_corrected_readings() {
    let mut random = Random(4);
    let axis = |random: &mut Random| random.three().normalize();
    let joints = [
        (0, Joint::Revolute(axis(&mut random))),
        (1, Joint::Revolute(axis(&mut random))),
        (2, Joint::Prismatic(axis(&mut random))),
        (0, Joint::Revolute(axis(&mut random))),
        (4, Joint::Revolute(axis(&mut random))),
        (4, Joint::Revolute(axis(&mut random))),
    ];
    let model = model(&joints, &mut random);
    let mut frames = frames(&model, 5, true, &mut random);
    for frame in &mut frames {
        frame.wrench = [0.0; 6];
        frame.ground.touching = vec![true, true];
        frame.ground.wrenches = (0..2).map(|_| std::array::from_fn(|_| 5.0 * random.next())).collect();
    }
    let mut input = input(model, frames, Situation { floating: true, rows: Rows::Both, mimic: false }, &[]);
    let foot = |link: usize, random: &mut Random| Foot {
        name: format!("foot{link}"),
        link,
        position: random.three(),
        rotation: Rotation3::new(random.three()).into_inner(),
        known: [true; 6],
        measured: [true; 6],
        sigma: [0.0; 6],
    };
    let feet = vec![foot(3, &mut random), foot(5, &mut random)];
    let state = ContactState { touching: vec![true; 2], unknown_efforts: vec![], pivots: vec![] };
    let contact = Contact { feet, unmeasured: vec![], sigma: vec![1.0; 12], states: vec![state] };
    (input.contact, input.known_offset) = (Some(contact), Some([0.0; 6]));
    input.errors.extend((1..=6).map(SignalError::JointZero));
    input.errors.extend([6, 9].map(SignalError::EffortGain));
    for component in 0..6 {
        input.errors.push(SignalError::FootZero { foot: component % 2, component });
        input.errors.push(SignalError::FootGain { foot: component % 2, component });
    }
    for axis in 0..3 {
        input.errors.extend([SignalError::LeverArm(axis), SignalError::BaseRotation(axis)]);
    }
    compare(input, &mut random);
}

/// Skew moves by the slope of what is predicted, friction and rotors included.
#[test]
fn predictions_agree_with_the_rows() {
    let mut random = Random(3);
    let axis = |random: &mut Random| random.three().normalize();
    let joints = [
        (0, Joint::Revolute(axis(&mut random))),
        (1, Joint::Prismatic(axis(&mut random))),
        (2, Joint::Revolute(axis(&mut random))),
    ];
    let model = model(&joints, &mut random);
    let frames = frames(&model, 5, true, &mut random);
    let mut input = input(model, frames, Situation { floating: true, rows: Rows::Both, mimic: false }, &[]);
    let terms = vec![Term::Viscous, Term::Coulomb(None), Term::Rotor, Term::Offset].into();
    input.drives = Drive::of_joints(&input.freedom_names(), &input.model.tree(), &terms);
    input.known_offset = Some([0.0; 6]);
    input.errors = vec![SignalError::Skew];
    let source = TreeSource::new(input).unwrap();
    let phi: Vec<f64> = source.parameters().iter().map(|_| random.next()).collect();
    let wanted = predicted(&source, &phi);
    let columns = source.error_columns(&phi).unwrap();
    let channels = source.channels().len();
    for sample in 0..5 {
        let (before, after) = (usize::saturating_sub(sample, 1), usize::min(sample + 1, 4));
        let mut rows = SampleRows::default();
        rows.clear(channels, 1);
        columns.rows(sample, &mut rows).unwrap();
        for (c, own) in rows.smoothed.iter().chain(&rows.differentiated).enumerate() {
            let at = |k: usize| wanted[2 * channels * k + c];
            let slope = (at(after) - at(before)) / (0.01 * (after - before) as f64);
            assert!((own - slope).abs() < 1e-9 * (1.0 + slope.abs()), "{sample}, {c}: {own} for {slope}");
        }
    }
}

//! Rows of a base that cameras track, against a person whose wrench comes from Newton's and Euler's equations
//! of every segment.

use nalgebra::{UnitQuaternion, Vector3};
use rigident_shared::tree::{BaseMotion, Joint};
use rigident_sim::links::{Tree, quaternion};

use super::{BaseSensor, Frame, Input, TreeSource};
use rigident_fit::{FitOptions, RowSource, Silent, fit};
use rigident_laboratory::person;
use rigident_model::Model;
use rigident_model::base::{Rows, Situation};
use rigident_model::human::Person;

const RATE_HZ: f64 = 200.0;

/// Returns the frames of a person in motion, her laboratory's origin `away`, m.
fn input(model: &Model, tree: &Tree, away: &Vector3<f64>, count: usize) -> Input {
    let frame = |k: usize| {
        let t = k as f64 / RATE_HZ;
        let now = tree.at(t);
        let base = now.motions[0];
        let turn = base.rotation;
        let (velocity, rate) = (turn.tr_mul(&base.velocity), turn.tr_mul(&base.angular_rate));
        let mut positions: Vec<f64> = (base.position + away).iter().copied().collect();
        positions.extend(quaternion(&turn));
        let mut rates: Vec<f64> = velocity.iter().chain(rate.iter()).copied().collect();
        for (link, own) in model.links.iter().zip(&tree.links).skip(1) {
            let joint = own.swing.at(t);
            match link.link.joint {
                Joint::Revolute(axis) => {
                    let q = quaternion(&joint.rotation);
                    let turned = UnitQuaternion::from_quaternion(nalgebra::Quaternion::from_vector(
                        nalgebra::Vector4::new(q[1], q[2], q[3], q[0]),
                    ));
                    positions.push(turned.scaled_axis().dot(&axis));
                    rates.push(joint.rate.dot(&axis));
                }
                _ => {
                    positions.extend(quaternion(&joint.rotation));
                    rates.extend(joint.rate.iter());
                }
            }
        }
        let [fx, fy, fz, mx, my, mz] = now.wrench;
        let (f, m) = (turn * Vector3::new(fx, fy, fz), turn * Vector3::new(mx, my, mz));
        Frame {
            time_ns: (t * 1e9).round() as u64,
            positions,
            rates,
            base: BaseMotion::still([f64::NAN; 3]),
            wrench: [f.x, f.y, f.z, m.x, m.y, m.z],
            efforts: Vec::new(),
            standing: Vec::new(),
            ground: Default::default(),
        }
    };
    Input::tracked(model.clone(), (0..count).map(frame).collect(), RATE_HZ)
}

#[test]
fn a_tracked_person_s_parameters_come_out_of_positions_and_rates_alone() {
    for model in [Person::default().human34().unwrap(), Person::default().human58().unwrap()] {
        let truth = person::somebody(&model, 5);
        let tree = person::tree(&model, &truth);
        for away in [Vector3::zeros(), Vector3::new(40.0, -25.0, 3.0)] {
            let source = TreeSource::new(input(&model, &tree, &away, 4000)).unwrap();
            let wanted = source.base().map() * nalgebra::DVector::from_column_slice(&truth);
            let found = fit(&source, &FitOptions::default(), &Silent).unwrap();
            assert_eq!(found.estimate.rank(), wanted.len());
            assert_eq!(wanted.len(), if model.links.len() == 15 { 128 } else { 200 });
            // The kernel's aliasing at 200 Hz is below 2e-9 of a 1 Hz rate's derivative, and grows with the
            // frequency: swings and their products reach 4 Hz here.
            for (parameter, (got, wanted)) in
                source.parameters().iter().zip(found.estimate.unjudged().values.iter().zip(&wanted))
            {
                assert!((got - wanted).abs() < 1e-5, "{away}{}: {got} {wanted}", parameter.name);
            }
        }
    }
}

#[test]
fn impossible_options_of_a_tracked_base_are_refused_and_its_factors_are_of_their_own() {
    let model = Person::default().human34().unwrap();
    let tree = person::tree(&model, &model.nominal());
    let tracked = input(&model, &tree, &Vector3::zeros(), 20);
    let with_efforts = Input {
        situation: Situation { rows: Rows::Both, ..tracked.situation },
        ..tracked.with_frames(tracked.frames.clone())
    };
    assert!(TreeSource::new(with_efforts).is_err());
    let frames = tracked.frames.iter().map(|f| Frame {
        positions: f.positions[7..].to_vec(),
        rates: f.rates[6..].to_vec(),
        base: BaseMotion::still([0.0, 0.0, -9.8]),
        ..f.clone()
    });
    let with_imu = Input { base: BaseSensor::Imu([0.0; 3]), ..tracked.with_frames(frames.collect()) };
    let prints = [tracked, with_imu].map(|i| TreeSource::new(i).unwrap().model_fingerprint());
    assert_ne!(prints[0], prints[1]);
}

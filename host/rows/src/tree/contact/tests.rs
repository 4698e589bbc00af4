//! Rows of a robot on two feet against recursive Newton and Euler, and feet's generalised forces against
//! virtual work.

use nalgebra::{Rotation3, Vector6};
use rigident_shared::tree::{BaseMotion, Joint, Link};

use super::*;
use crate::tree::{BaseSensor, Frame, Input, TreeSource};
use rigident_fit::{RowSource, SampleRows};
use rigident_model::base::{Rows, Situation};
use rigident_model::dynamics::inverse_dynamics;
use rigident_model::rows::Moving;
use rigident_model::{Model, ModelLink};

const STEP: f64 = 1e-5;
const IMU: [f64; 3] = [0.05, -0.02, 0.1];

fn wave(k: usize, t: f64, derivative: u32) -> f64 {
    let (rate, phase) = (1.0 + 0.37 * k as f64 % 3.0, 0.7 * k as f64);
    let argument = rate * t + phase + f64::from(derivative) * std::f64::consts::FRAC_PI_2;
    0.6 * rate.powi(derivative as i32) * argument.sin()
}

fn waves(first: usize, t: f64, derivative: u32) -> Vector3<f64> {
    Vector3::from_fn(|k, _| wave(first + k, t, derivative))
}

/// Makes a robot with two legs of three hinges and an arm of a slide and a hinge.
fn robot() -> Model {
    let parents = [0, 0, 1, 2, 0, 4, 5, 0, 7];
    let links = parents.into_iter().enumerate().map(|(i, parent)| {
        let number = |k: usize| (1.3 * i as f64 + 0.9 * k as f64 + 0.4).sin();
        let three = |k: usize| Vector3::new(number(k), number(k + 1), number(k + 2));
        let axis = three(5).normalize();
        let joint = match i {
            0 => Joint::Free,
            7 => Joint::Prismatic(axis),
            _ => Joint::Revolute(axis),
        };
        let rotation = if i == 0 { Matrix3::identity() } else { Rotation3::new(three(9)).into_inner() };
        let position = if i == 0 { Vector3::zeros() } else { three(13) * 0.3 };
        let nominal = Some([2.0, 0.1, -0.06, 0.08, 0.3, 0.25, 0.2, 0.01, -0.02, 0.03]);
        let link = Link { parent, joint, rotation, position };
        ModelLink::new(format!("l{i}"), format!("j{i}"), link, nominal)
    });
    Model { name: "robot".to_owned(), links: links.collect(), findings: Vec::new(), gravity_mps2: None }
}

fn foot(name: &str, link: usize, known: [bool; 6]) -> Foot {
    Foot {
        name: name.to_owned(),
        link,
        position: Vector3::new(0.02, 0.03, -0.1),
        rotation: Rotation3::new(Vector3::new(0.3, -0.2, 0.5)).into_inner(),
        known,
        measured: known,
        sigma: known.map(|known| if known { 0.3 } else { 0.0 }),
    }
}

/// Returns the attitude and place of a foot's sensor in the base's frame.
fn pose(model: &Model, foot: &Foot, q: &[f64]) -> (Matrix3<f64>, Vector3<f64>) {
    let mut moving = Moving::new(model.tree()).unwrap();
    let zeros = vec![0.0; q.len()];
    moving.set(q, &zeros, &zeros, &BaseMotion::still([0.0; 3])).unwrap();
    let (rotation, place) = moving.place(foot.link).unwrap();
    (rotation * foot.rotation, Vector3::from(place) + rotation * foot.position)
}

/// Returns the force and moment about the base's origin, base axes, of a wrench in a foot's axes.
fn on_base(model: &Model, foot: &Foot, q: &[f64], wrench: &Vector6<f64>) -> Vector6<f64> {
    let (axes, place) = pose(model, foot, q);
    let force = axes * wrench.fixed_rows::<3>(0);
    let moment = axes * wrench.fixed_rows::<3>(3) + place.cross(&force);
    Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
}

/// Returns what a foot's wrench does at the freedoms, by virtual work.
fn work(model: &Model, foot: &Foot, q: &[f64], wrench: &Vector6<f64>) -> Vec<f64> {
    let (axes, _) = pose(model, foot, q);
    let (force, moment) = (axes * wrench.fixed_rows::<3>(0), axes * wrench.fixed_rows::<3>(3));
    (0..q.len())
        .map(|k| {
            let at = |step: f64| {
                let mut moved = q.to_vec();
                moved[k] += step;
                pose(model, foot, &moved)
            };
            let ((r1, p1), (r0, p0)) = (at(STEP), at(-STEP));
            let turned = r1 * r0.transpose();
            let turn = Vector3::new(
                turned[(2, 1)] - turned[(1, 2)],
                turned[(0, 2)] - turned[(2, 0)],
                turned[(1, 0)] - turned[(0, 1)],
            ) * 0.5;
            (force.dot(&(p1 - p0)) + moment.dot(&turn)) / (2.0 * STEP)
        })
        .collect()
}

/// Returns the robot at a time; the second foot bears what the first does not.
fn frame(model: &Model, feet: &[Foot], t: f64) -> Frame {
    let count = model.links.len() - 1;
    let all = |derivative: u32| -> Vec<f64> { (0..count).map(|k| wave(k, t, derivative)).collect() };
    let (q, v, a) = (all(0), all(1), all(2));
    let (rate, change) = (waves(20, t, 0), waves(20, t, 1));
    let specific_force = waves(30, t, 0) * 3.0 + Vector3::new(0.0, 0.0, 9.8);
    let base = BaseMotion { specific_force, rate, angular_acceleration: change };
    let forces = inverse_dynamics(model, &base, &q, &v, &a).unwrap();
    let first = Vector6::from_fn(|k, _| 40.0 * wave(40 + k, t, 0));
    let left = Vector6::from_row_slice(&forces[..6]) - on_base(model, &feet[0], &q, &first);
    // [F; M] of the second foot about its sensor, its axes.
    let (axes, place) = pose(model, &feet[1], &q);
    let force: Vector3<f64> = left.fixed_rows::<3>(0).into();
    let moment = left.fixed_rows::<3>(3) - place.cross(&force);
    let (force, moment) = (axes.tr_mul(&force), axes.tr_mul(&moment));
    let second = Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z);
    let pushed = feet.iter().zip([first, second]).map(|(foot, w)| work(model, foot, &q, &w));
    let pushed: Vec<Vec<f64>> = pushed.collect();
    let efforts = (0..count).map(|k| forces[6 + k] - pushed.iter().map(|p| p[k]).sum::<f64>()).collect();
    let arm = Vector3::from(IMU);
    let at_imu = specific_force + change.cross(&arm) + rate.cross(&rate.cross(&arm));
    let wrench =
        |foot: &Foot, w: Vector6<f64>| std::array::from_fn(|k| if foot.known[k] { w[k] } else { 0.0 });
    Frame {
        time_ns: (t * 1e9) as u64,
        positions: q,
        rates: v,
        base: BaseMotion { specific_force: at_imu, rate, angular_acceleration: Vector3::zeros() },
        wrench: [0.0; 6],
        efforts,
        standing: Vec::new(),
        ground: Ground {
            wrenches: vec![wrench(&feet[0], first), wrench(&feet[1], second)],
            touching: vec![true; 2],
            state: 0,
        },
    }
}

fn input(model: &Model, feet: Vec<Foot>, unmeasured: Vec<usize>, frames: Vec<Frame>) -> Input {
    let sigma = [0.3, 0.3, 0.3, 0.05, 0.05, 0.05].into_iter().chain((0..8).map(|k| 0.1 + 0.02 * k as f64));
    let mut input = Input {
        base: BaseSensor::Imu(IMU),
        situation: Situation { floating: true, rows: Rows::Both, mimic: false },
        contact: Some(Contact { feet, unmeasured, sigma: sigma.collect(), states: Vec::new() }),
        ..Input::tracked(model.clone(), frames, 1.0 / STEP)
    };
    input.choose_rows().unwrap();
    input
}

/// Returns the cases: every component known, some of both feet unknown, a foot and a torque unknown.
fn cases() -> [([bool; 6], [bool; 6], Vec<usize>); 4] {
    let (all, none) = ([true; 6], [false; 6]);
    let vertical = [false, false, true, true, true, false];
    [(all, all, vec![]), (vertical, vertical, vec![7]), (none, all, vec![1]), (none, none, vec![])]
}

#[test]
fn rows_without_unmeasured_wrenches_hold_in_motion() {
    let model = robot();
    for (first, second, unmeasured) in cases() {
        let unknown = first.iter().chain(&second).filter(|known| !**known).count() + unmeasured.len();
        for t in [0.3, 1.9] {
            let feet = vec![foot("left", 3, first), foot("right", 6, second)];
            let frames = [-STEP, 0.0, STEP].map(|step| frame(&model, &feet, t + step)).to_vec();
            let mut frames = frames;
            frames.iter_mut().for_each(|f| unmeasured.iter().for_each(|k| f.efforts[*k] = 1e3));
            let source = TreeSource::new(input(&model, feet, unmeasured.clone(), frames)).unwrap();
            let phi = source.base().map() * nalgebra::DVector::from_vec(model.nominal());
            let (channels, n) = (source.channels().len(), phi.len());
            let rows: Vec<SampleRows> = (0..3)
                .map(|sample| {
                    let mut rows = SampleRows::default();
                    rows.clear(channels, n);
                    source.rows(sample, &mut rows).unwrap();
                    rows
                })
                .collect();
            let times = |all: &[f64], c: usize| -> f64 {
                all[c * n..(c + 1) * n].iter().zip(phi.iter()).map(|(a, b)| a * b).sum()
            };
            let present: Vec<usize> = (0..channels).filter(|c| !rows[1].missing[*c]).collect();
            assert_eq!(present.len(), channels - unknown);
            let size = rows[1].measured.iter().fold(0.0_f64, |most, m| most.max(m.abs()));
            for c in present {
                let slope =
                    (times(&rows[2].differentiated, c) - times(&rows[0].differentiated, c)) / (2.0 * STEP);
                let predicted = times(&rows[1].smoothed, c) + slope;
                let measured = rows[1].measured[c];
                assert!((predicted - measured).abs() < 1e-6 * size, "{first:?} {c}: {predicted} {measured}");
            }
        }
    }
}

/// W N-rows have the noise of their channel each, and none in common.
#[test]
fn noise_of_the_rows_is_white_and_as_stated() {
    let model = robot();
    for (first, second, unmeasured) in cases() {
        let feet = vec![foot("left", 3, first), foot("right", 6, second)];
        let here = frame(&model, &feet, 0.7);
        let source = TreeSource::new(input(&model, feet.clone(), unmeasured, vec![here])).unwrap();
        let contact = source.input().contact.clone().unwrap();
        let frame = source.input().frames[0].clone();
        let mut rows = SampleRows::default();
        let clear = |rows: &mut SampleRows| rows.clear(source.channels().len(), source.parameters().len());
        clear(&mut rows);
        source.rows(0, &mut rows).unwrap();
        // What each reading does to the rows: one of them more by its σ.
        let mut covariance = nalgebra::DMatrix::<f64>::zeros(14, 14);
        let mut add = |changed: Frame, sigma: f64| {
            let input = Input { frames: vec![changed], ..source.input().clone() };
            let other = source.of_same_model(input).unwrap();
            let mut moved = SampleRows::default();
            clear(&mut moved);
            other.rows(0, &mut moved).unwrap();
            let column =
                nalgebra::DVector::from_fn(14, |c, _| (moved.measured[c] - rows.measured[c]) * sigma);
            covariance += &column * column.transpose();
        };
        for k in 0..14 {
            let mut changed = frame.clone();
            let to = if k < 6 { &mut changed.wrench[k] } else { &mut changed.efforts[k - 6] };
            *to += 1.0;
            add(changed, contact.sigma[k]);
        }
        for (i, foot) in feet.iter().enumerate() {
            for k in (0..6).filter(|k| foot.known[*k]) {
                let mut changed = frame.clone();
                changed.ground.wrenches[i][k] += 1.0;
                add(changed, foot.sigma[k]);
            }
        }
        for i in 0..14 {
            for j in 0..14 {
                let wanted = if i == j && !rows.missing[i] { contact.sigma[i].powi(2) } else { 0.0 };
                assert!((covariance[(i, j)] - wanted).abs() < 1e-7, "{i} {j}: {}", covariance[(i, j)]);
            }
        }
    }
}

/// With other rows to eliminate by, the row space is the same.
#[test]
fn rows_span_the_null_space_of_the_unknown() {
    let model = robot();
    let vertical = [false, false, true, true, true, false];
    let feet = vec![foot("left", 3, vertical), foot("right", 6, vertical)];
    let here = frame(&model, &feet, 0.7);
    let input = input(&model, feet.clone(), vec![], vec![here]);
    let contact = input.contact.clone().unwrap();
    let mut moving = crate::tree::rows::RowMaker::about_imu(&input).unwrap();
    let frame = &input.frames[0];
    let zeros = vec![0.0; 8];
    moving.set(&frame.positions, &frame.rates, &zeros, &frame.base).unwrap();
    let columns = forces::columns(&mut moving, &feet.iter().collect::<Vec<_>>()).unwrap();
    let unknown = availability::unknown(&contact.states[0], &feet.iter().collect::<Vec<_>>(), &columns, 14).0;
    // An orthonormal basis of the null space, as the paper has it.
    let eigen = (&unknown * unknown.transpose()).symmetric_eigen();
    let mut order: Vec<usize> = (0..14).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    let basis = eigen.eigenvectors.select_columns(&order[..8]);
    let unit = nalgebra::DMatrix::<f64>::identity(14, 14);
    let available = contact.availability(&mut moving, frame).unwrap();
    let (mut smoothed, mut none) = (unit.as_slice().to_vec(), vec![0.0; 14 * 14]);
    available.combine(&mut smoothed, &mut none, 14);
    let weights = nalgebra::DMatrix::from_row_slice(14, 14, &smoothed);
    let outside = &weights - &weights * &basis * basis.transpose();
    assert!(outside.amax() < 1e-10 * weights.amax() && weights.rank(1e-9) == 8, "{}", outside.amax());
}

//! Machines of several bodies: two links on a load cell, by Newton and Euler.

use nalgebra::{DMatrix, Matrix3, Rotation3, Vector3};
use rigident::fit::pool::PooledFactor;
use rigident::fit::{Fit, FitOptions, Silent};
use rigident::model::{Model, ModelLink};
use rigident::problem::{Problem, ProblemOptions};
use rigident::recording::{ImuColumns, Recording};
use rigident::rig::{RigFile, TreeClass, TreeTable};
use rigident_shared::calibration::Reading;
use rigident_shared::tree::{Joint, Link};

use super::runs::bound::{deviations, information_of};
use super::runs::laboratory::{RATE_HZ, Rig, There, rig_file, wrench};
use super::runs::{Body, Conditions, Errors};

/// The joint in the base link's frame, m; it turns about y.
const JOINT: [f64; 3] = [0.05, 0.02, 0.11];
const AXIS: [f64; 3] = [0.0, 1.0, 0.0];
/// Names of the links.
const LINKS: [&str; 2] = ["base", "arm"];
/// Names of a link's parameters.
pub const TEN: [&str; 10] = ["m", "mcx", "mcy", "mcz", "Ixx", "Iyy", "Izz", "Iyz", "Izx", "Ixy"];
const MASSES_KG: [f64; 2] = [3.2, 1.6];

/// Returns a recording of readings.
pub fn recording(file: &RigFile, name: &str, readings: Vec<Reading<f64>>) -> Recording {
    Recording {
        name: name.to_owned(),
        rig: file.clone(),
        rate_hz: Some(RATE_HZ),
        time_ns: readings.iter().map(|reading| reading.time_ns).collect(),
        wrench: Some(readings.iter().map(|reading| reading.wrench.array()).collect()),
        imus: vec![ImuColumns {
            accel: Some(readings.iter().map(|reading| reading.specific_force.array()).collect()),
            gyro: Some(readings.iter().map(|reading| reading.angular_rate.array()).collect()),
        }],
        ..Recording::default()
    }
}

/// Returns what a recording says.
pub fn fitted(recording: &Recording, model: Option<&Model>) -> Fit {
    let problem = Problem::from_recording(recording, model, &ProblemOptions::default());
    problem.expect("frames").fit(&FitOptions::default(), &Silent).expect("rows")
}

/// Returns a link of a model that nothing is known of.
pub fn link(name: &str, parent: usize, joint: Joint<f64>, position: [f64; 3]) -> ModelLink {
    let joint_name = if parent == 0 && name == LINKS[0] { String::new() } else { format!("{name}_joint") };
    let link = Link { parent, joint, rotation: Matrix3::identity(), position: position.into() };
    ModelLink::new(name, joint_name, link, None)
}

/// Returns a model of links.
pub fn model(links: Vec<ModelLink>) -> Model {
    Model { name: "machine".to_owned(), links, findings: Vec::new(), gravity_mps2: None }
}

/// Returns how far the parameters of a fit, sums of those of its links, are off, in U95, and this; `truth`
/// has ten of each link.
pub fn off(fit: &Fit, names: &[String], truth: &[f64]) -> Errors {
    let of = |(j, weights): (usize, Vec<f64>)| {
        let measured = fit.estimate.measured(j)?;
        let wanted: f64 = weights.iter().zip(truth).map(|(weight, own)| weight * own).sum();
        Some(((measured.value - wanted) / measured.u95, measured.u95))
    };
    sums(fit, names).into_iter().enumerate().filter_map(of).collect()
}

/// Returns the weights of the links' parameters in each inertial parameter of a fit.
fn sums(fit: &Fit, names: &[String]) -> Vec<Vec<f64>> {
    let weight = |terms: &[(String, f64)], name: &String| -> f64 {
        terms.iter().filter(|(own, _)| own == name).map(|(_, weight)| weight).sum()
    };
    let of = |terms: &[(String, f64)]| names.iter().map(|name| weight(terms, name)).collect();
    fit.parameters.iter().filter(|p| p.kind.is_inertial()).map(|p| of(&p.made_of)).collect()
}

/// Returns the names of the parameters of links.
pub fn names(links: &[&str]) -> Vec<String> {
    links.iter().flat_map(|link| TEN.iter().map(move |name| format!("{link}.{name}"))).collect()
}

/// Returns the angle of the joint at a time, its rate and its slope: by the seed of the recording.
fn angle(seed: u64, t: f64) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (k, hz) in [0.31, 0.83, 1.27].into_iter().enumerate() {
        let w = std::f64::consts::TAU * hz;
        let (sin, cos) = (w * t + (seed % 97) as f64 + k as f64).sin_cos();
        let size = 0.4 / (1.0 + k as f64);
        sum = [sum[0] + size * sin, sum[1] + size * w * cos, sum[2] - size * w * w * sin];
    }
    sum
}

/// Returns the wrench of both links about the load cell's origin.
fn of_links(parameters: &[f64], there: &There, [q, rate, gained]: [f64; 3]) -> [f64; 6] {
    let ten = |link: usize| std::array::from_fn(|k| parameters[10 * link + k]);
    let (place, axis) = (Vector3::from(JOINT), Vector3::from(AXIS));
    let turn = Rotation3::new(axis * q);
    let back = turn.inverse();
    let at_joint = there.specific + there.gained.cross(&place) + there.rate.cross(&there.rate.cross(&place));
    let carried = back * there.rate;
    let arm = There {
        rate: carried + axis * rate,
        gained: back * there.gained + axis * gained + carried.cross(&(axis * rate)),
        specific: back * at_joint,
    };
    let [base, own] = [wrench(&ten(0), there), wrench(&ten(1), &arm)];
    let push = turn * Vector3::new(own[0], own[1], own[2]);
    let moment = turn * Vector3::new(own[3], own[4], own[5]) + place.cross(&push);
    std::array::from_fn(|c| base[c] + if c < 3 { push[c] } else { moment[c - 3] })
}

fn truth() -> Vec<f64> {
    MASSES_KG.into_iter().flat_map(|mass| Body::of_mass(mass).parameters()).collect()
}

/// Returns what recordings of a rig say of two links, merged.
pub fn two_links(number: usize, runs: u64) -> (Fit, Errors) {
    let rig = Rig::new(number as u64, &Conditions::STATED);
    let mut file = rig_file(&format!("rig {number}"), &Conditions::STATED);
    file.tree = TreeTable { class: Some(TreeClass::Exact), ..TreeTable::default() };
    let hinge = Joint::Revolute(AXIS.into());
    let model = model(vec![link(LINKS[0], 0, Joint::Free, [0.0; 3]), link(LINKS[1], 0, hinge, JOINT)]);
    let truth = truth();
    let one = |k: u64| {
        let (name, seed) = (format!("{number} {k}"), seed(number) + k);
        let exact = |t: f64, there: &There| of_links(&truth, there, angle(seed, t));
        let mut all = recording(&file, &name, rig.record_of(exact, seed, &Conditions::STATED));
        for (order, unit) in ["rad", "radps"].into_iter().enumerate() {
            let of_row = |time_ns: &u64| format!("{:e}", angle(seed, *time_ns as f64 * 1e-9)[order]);
            all.extra.push((format!("arm_joint_{unit}"), all.time_ns.iter().map(of_row).collect()));
        }
        PooledFactor::of(&fitted(&all, Some(&model)), &name)
    };
    let pooled = PooledFactor::merged((0..runs).map(one).collect(), false).expect("one machine");
    let fit = pooled.fit();
    let errors = off(&fit, &names(&LINKS), &truth);
    (fit, errors)
}

fn seed(number: usize) -> u64 {
    20_000_000 + 100 * number as u64
}

/// Returns the standard deviations of the best estimate of the sums of parameters of a fit.
pub fn best_of_two_links(fit: &Fit, number: usize, runs: u64) -> Vec<f64> {
    let rows = sums(fit, &names(&LINKS));
    let map = DMatrix::from_fn(rows.len(), 20, |i, j| rows[i][j]);
    // Any links that make the sums what they are move alike.
    let links = map.clone().pseudo_inverse(1e-9).expect("sums");
    let sums = &map * nalgebra::DVector::from_vec(truth());
    let of = |k: u64| {
        let seed = seed(number) + k;
        let exact = |sums: &[f64], t: f64, there: &There| {
            let all = &links * nalgebra::DVector::from_row_slice(sums);
            of_links(all.as_slice(), there, angle(seed, t))
        };
        information_of(sums.as_slice(), &exact, seed, &Conditions::STATED)
    };
    deviations(&[(0..runs).map(of).collect()])
}

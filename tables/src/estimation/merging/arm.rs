//! An arm of seven axes that carries a load, by Newton and Euler from link to link.

use nalgebra::{DMatrix, Rotation3, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rigident::fit::payload::Carrier;
use rigident::fit::pool::PooledFactor;
use rigident::fit::tare::Tare;
use rigident::model::{Model, ModelLink};
use rigident::recording::Recording;
use rigident::rig::{JointTable, RigFile, TreeClass, TreeTable};
use rigident_shared::tree::Joint;

use super::machines::{TEN, fitted, link, model};
use super::runs::bound::{inverse, marginal, roots};
use super::runs::laboratory::{There, wrench};
use super::runs::{Body, Errors};

const AXES: usize = 7;
/// Joints alternate between these axes; their places in the frame of the link before, m.
const ABOUT: [[f64; 3]; 2] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]];
const PLACES: [[f64; 3]; AXES] = [
    [0.0, 0.0, 0.33],
    [0.01, 0.0, 0.0],
    [0.02, 0.0, 0.32],
    [0.0, 0.0, 0.08],
    [0.01, 0.0, 0.38],
    [0.02, 0.0, 0.02],
    [0.0, 0.0, 0.09],
];
const LOAD_KG: f64 = 2.0;
/// 1 σ of the gain of each torque, of the zero of each joint, rad, and of a reading of a torque, N m.
const GAIN: f64 = 0.02;
const ZERO: f64 = 5e-4;
const NOISE: f64 = 0.1;
const RATE_HZ: f64 = 100.0;
const SECONDS: f64 = 10.0;
/// Readings taken together in the best estimate.
const TOGETHER: usize = 5;
const G: f64 = 9.80665;
/// The errors of a machine: gains, then zeros.
const OF_MACHINE: usize = 2 * AXES;
/// Links' parameters, the load's, the machine's errors.
const ALL: usize = 10 * AXES + 10 + OF_MACHINE;

/// Returns angle, rate and slope of a joint at a time, by the seed of a recording.
fn swing(seed: u64, joint: usize, t: f64) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for n in 0..4 {
        let w = std::f64::consts::TAU * (0.13 + 0.24 * f64::from(n) + 0.017 * joint as f64);
        let (sin, cos) = (w * t + ((seed % 89) as f64 + 5.0 * joint as f64 + f64::from(n)) * 1.7).sin_cos();
        let size = 0.5 / (1.0 + 0.5 * f64::from(n));
        sum = [sum[0] + size * sin, sum[1] + size * w * cos, sum[2] - size * w * w * sin];
    }
    sum
}

/// Returns the torques of all joints, whose motion is given, of links of ten parameters each.
fn torques(links: &[f64], joints: &[[f64; 3]; AXES]) -> [f64; AXES] {
    let rest = Vector3::zeros();
    let mut there = There { rate: rest, gained: rest, specific: Vector3::new(0.0, 0.0, G) };
    let mut on = Vec::new();
    for (k, [q, rate, gained]) in joints.iter().enumerate() {
        let (axis, place) = (Vector3::from(ABOUT[k % 2]), Vector3::from(PLACES[k]));
        let back = Rotation3::new(axis * *q).inverse();
        let specific =
            there.specific + there.gained.cross(&place) + there.rate.cross(&there.rate.cross(&place));
        let carried = back * there.rate;
        there = There {
            rate: carried + axis * *rate,
            gained: back * there.gained + axis * *gained + carried.cross(&(axis * *rate)),
            specific: back * specific,
        };
        on.push((there, axis, place, back.inverse()));
    }
    let mut torques = [0.0; AXES];
    let (mut push, mut moment) = (rest, rest);
    for (k, (there, axis, place, turn)) in on.iter().enumerate().rev() {
        let own = wrench(&std::array::from_fn(|j| links[10 * k + j]), there);
        push += Vector3::new(own[0], own[1], own[2]);
        moment += Vector3::new(own[3], own[4], own[5]);
        torques[k] = axis.dot(&moment);
        (push, moment) = (turn * push, turn * moment);
        moment += place.cross(&push);
    }
    torques
}

/// Returns the links' parameters.
fn links() -> Vec<f64> {
    (0..AXES).flat_map(|k| Body::of_mass(4.0 / (1.0 + 0.6 * k as f64)).parameters()).collect()
}

/// Returns the load: a box beside the flange's axis.
fn load() -> Body {
    Body { com: Vector3::new(0.03, -0.02, 0.09), ..Body::of_mass(LOAD_KG) }
}

fn loaded(links: &[f64], load: &[f64]) -> Vec<f64> {
    let last = 10 * (AXES - 1);
    links.iter().enumerate().map(|(k, own)| own + if k < last { 0.0 } else { load[k - last] }).collect()
}

/// Returns the torques that a machine reads, whose errors are in their standard deviations, of what its
/// positions say.
fn read(links: &[f64], errors: &[f64], seed: u64, t: f64) -> [f64; AXES] {
    let at = |k: usize| {
        let [q, rate, gained] = swing(seed, k, t);
        [q - ZERO * errors[AXES + k], rate, gained]
    };
    let exact = torques(links, &std::array::from_fn(at));
    std::array::from_fn(|k| exact[k] * (1.0 + GAIN * errors[k]))
}

fn rig_file(number: usize) -> RigFile {
    let joint = |k: usize| JointTable {
        name: format!("l{k}_joint"),
        position: None,
        rate: None,
        effort: None,
        position_noise: None,
        rate_noise: None,
        effort_noise: Some(NOISE),
        zero_std: None,
        effort_gain_std: None,
        effort_lowpass_hz: None,
    };
    let tree = TreeTable {
        class: Some(TreeClass::Exact),
        joint_zero_std_rad: Some(ZERO),
        effort_gain_std: Some(GAIN),
        ..TreeTable::default()
    };
    let mut file = RigFile { joint: (1..=AXES).map(joint).collect(), tree, ..RigFile::default() };
    file.recording.labels.insert("rig".to_owned(), number.to_string());
    file
}

fn record(number: usize, links: &[f64], errors: &[f64], seed: u64) -> Recording {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut columns: Vec<Vec<String>> = vec![Vec::new(); 3 * AXES];
    let mut recording = Recording {
        name: format!("{number} {seed}"),
        rig: rig_file(number),
        rate_hz: Some(RATE_HZ),
        ..Recording::default()
    };
    for n in 0..(SECONDS * RATE_HZ) as u64 {
        let t = n as f64 / RATE_HZ;
        let torques = read(links, errors, seed, t);
        for (k, torque) in torques.iter().enumerate() {
            let [q, rate, _] = swing(seed, k, t);
            let noise: f64 = StandardNormal.sample(&mut random);
            for (order, value) in [q, rate, torque + NOISE * noise].into_iter().enumerate() {
                columns[AXES * order + k].push(format!("{value:e}"));
            }
        }
        recording.time_ns.push(n * 10_000_000);
    }
    let names = ["rad", "radps", "nm"]
        .into_iter()
        .flat_map(|unit| (1..=AXES).map(move |k| format!("l{k}_joint_{unit}")));
    recording.extra = names.zip(columns).collect();
    recording
}

fn arm() -> Model {
    let mut links: Vec<ModelLink> = vec![link("base", 0, Joint::Free, [0.0; 3])];
    for k in 0..AXES {
        let joint = Joint::Revolute(ABOUT[k % 2].into());
        links.push(link(&format!("l{}", k + 1), k, joint, PLACES[k]));
    }
    model(links)
}

fn seed(number: usize) -> u64 {
    40_000_000 + 10 * number as u64
}

/// Returns how far the load is off that an arm carries in one of two recordings, in U95, and this.
pub fn payload(number: usize) -> Errors {
    let mut random = ChaCha8Rng::seed_from_u64(number as u64);
    let errors: Vec<f64> = (0..OF_MACHINE).map(|_| StandardNormal.sample(&mut random)).collect();
    let (links, load, arm) = (links(), load().parameters(), arm());
    let of_both = record(number, &loaded(&links, &load), &errors, seed(number));
    let with = fitted(&of_both, Some(&arm));
    let of_bare = record(number, &links, &errors, seed(number) + 1);
    let without = fitted(&of_bare, Some(&arm));
    let tare = Tare::of_run(&without, PooledFactor::of(&without, &of_bare.name)).expect("links");
    let carrier =
        Carrier { link: format!("l{AXES}"), to_link: DMatrix::identity(10, 10), frame: "flange".to_owned() };
    let found = tare.payload(&with, &carrier).expect("a load");
    let of = |k: usize| {
        let at = found.parameters.iter().position(|p| p.name == TEN[k]).expect("ten parameters");
        let measured = found.estimate.measured(at).expect("a load that is determined");
        ((measured.value - load[k]) / measured.u95, measured.u95)
    };
    (0..10).map(of).collect()
}

/// Returns the standard deviations of the best estimate of the load.
pub fn best(number: usize) -> Vec<f64> {
    let (links, load) = (links(), load().parameters());
    let truth: Vec<f64> = links.iter().chain(&load).chain(&[0.0; OF_MACHINE]).copied().collect();
    let mut information = DMatrix::zeros(ALL, ALL);
    for (run, carries) in [(0, true), (1, false)] {
        let at = |all: &[f64], t: f64| {
            let (links, rest) = all.split_at(10 * AXES);
            let (load, errors) = rest.split_at(10);
            let links = if carries { loaded(links, load) } else { links.to_vec() };
            DMatrix::from_column_slice(AXES, 1, &read(&links, errors, seed(number) + run, t))
        };
        for row in 0..(SECONDS * RATE_HZ) as usize / TOGETHER {
            let t = (row as f64 + 0.5) * TOGETHER as f64 / RATE_HZ;
            let mut slopes = DMatrix::zeros(AXES, ALL);
            for column in 0..ALL {
                let by = |step: f64| {
                    let mut all = truth.clone();
                    all[column] += step;
                    at(&all, t)
                };
                slopes.set_column(column, &(by(0.5) - by(-0.5)).column(0));
            }
            information += slopes.tr_mul(&slopes) * (TOGETHER as f64 / (NOISE * NOISE));
        }
    }
    (0..OF_MACHINE).for_each(|k| information[(ALL - 1 - k, ALL - 1 - k)] += 1.0);
    // Sums alone of the links' parameters are determined: next to nothing is known of each.
    (0..10 * AXES).for_each(|k| information[(k, k)] += 1e-6 + 1e-9 * information[(k, k)]);
    let order: Vec<usize> =
        (10 * AXES..10 * AXES + 10).chain(0..10 * AXES).chain(10 * AXES + 10..ALL).collect();
    roots(&inverse(&marginal(&information.select_rows(&order).select_columns(&order), 10)))
}

//! A real arm, Stäubli TX40: one part of its recording predicts the other.
//!
//! Plain least squares, for comparison, as it is usually done: positions and torques through a zero-phase
//! Butterworth filter of 40 Hz, rates and accelerations by central differences, every 25th sample, no
//! weights.

use std::path::{Path, PathBuf};

use nalgebra::{DMatrix, DVector};
use rigident::answer::Links;
use rigident::answer::states::states;
use rigident::fit::{Fit, FitOptions, Prediction, Silent, fit};
use rigident::model::Model;
use rigident::model::base::BaseParameters;
use rigident::model::human::Person;
use rigident::model::rows::Moving;
use rigident::recording::Recording;
use rigident::rows::tree::ProblemOptions;
use rigident::rows::tree::TreeSource;
use rigident::rows::tree::drive::{Drive, DriveState, Term};
use rigident::rows::tree::prepare::{PreparedTree, prepare};
use rigident_shared::tree::BaseMotion;

const RATE_HZ: f64 = 5000.0;
const CUT_HZ: f64 = 40.0;
const EVERY: usize = 25;

pub(super) fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/robot_staubli_tx40")
}

fn columns(file: &str) -> [Vec<f64>; 6] {
    let path = data().join(file);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut out: [Vec<f64>; 6] = Default::default();
    for line in text.lines().skip(1) {
        for (column, cell) in out.iter_mut().zip(line.split(',')) {
            column.push(cell.trim().parse().expect("a number"));
        }
    }
    out
}

/// Converts motor angles and motor torques to joint angles and torques: the wrist's last motor turns with two
/// joints.
fn joints() -> ([Vec<f64>; 6], [Vec<f64>; 6]) {
    let ratio = [32.0, 32.0, 45.0, -48.0, 45.0, 32.0];
    let (motor, current) = (columns("pos_read_data_rows0_29999.csv"), columns("curr_data_rows0_29999.csv"));
    let mut q: [Vec<f64>; 6] = std::array::from_fn(|k| motor[k].iter().map(|v| v / ratio[k]).collect());
    let mut tau: [Vec<f64>; 6] = std::array::from_fn(|k| current[k].iter().map(|v| v * ratio[k]).collect());
    for row in 0..q[0].len() {
        q[5][row] -= q[4][row];
        q[1][row] -= std::f64::consts::FRAC_PI_2;
        q[2][row] += std::f64::consts::FRAC_PI_2;
        tau[4][row] += 32.0 * current[5][row];
    }
    (q, tau)
}

pub(super) fn model() -> Model {
    let path = data().join("tx40_mdh_modified.urdf");
    rigident::rows::named_model::open(path.to_str().expect("a path"), &Person::default())
        .expect("the arm's file")
        .0
}

/// Returns both halves of the recording.
pub(super) fn halves() -> [Recording; 2] {
    let (q, tau) = joints();
    let half = q[0].len() / 2;
    [recording(&q, &tau, 0..half), recording(&q, &tau, half..q[0].len())]
}

/// Returns a part of the recording.
fn recording(q: &[Vec<f64>; 6], tau: &[Vec<f64>; 6], rows: std::ops::Range<usize>) -> Recording {
    let mut recording = Recording { name: "tx40".to_owned(), rate_hz: Some(RATE_HZ), ..Recording::default() };
    recording.time_ns = rows.clone().map(|row| row as u64 * 200_000).collect();
    for (unit, values) in [("rad", q), ("nm", tau)] {
        for (k, column) in values.iter().enumerate() {
            let cells = column[rows.clone()].iter().map(|v| format!("{v:e}")).collect();
            recording.extra.push((format!("joint_{}_{unit}", k + 1), cells));
        }
    }
    recording
}

/// Returns the rows of a part of the recording.
fn part(model: &Model, q: &[Vec<f64>; 6], tau: &[Vec<f64>; 6], rows: std::ops::Range<usize>) -> TreeSource {
    let recording = recording(q, tau, rows);
    let terms = vec![Term::Viscous, Term::Coulomb(None), Term::Offset, Term::Rotor];
    let options = ProblemOptions {
        friction: terms.into(),
        drives: vec!["m6=joint_5+joint_6".to_owned()],
        ..ProblemOptions::default()
    };
    let PreparedTree { mut input, .. } = prepare(&recording, model, &options).expect("frames");
    // A rotor on the first axis is nothing but inertia of the first link about it, and one on the second,
    // which crosses the first at a right angle, nothing but inertia of the second.
    for drive in input.drives.iter_mut().filter(|d| d.name == "joint_1" || d.name == "joint_2") {
        drive.terms.retain(|t| *t != Term::Rotor);
    }
    TreeSource::new(input).expect("a tree")
}

/// Filters by a second-order Butterworth low-pass, forward and backward, from rest at the first value.
fn zero_phase(values: &[f64]) -> Vec<f64> {
    let w = (std::f64::consts::PI * CUT_HZ / RATE_HZ).tan();
    let norm = 1.0 + std::f64::consts::SQRT_2 * w + w * w;
    let (b, a1, a2) =
        (w * w / norm, 2.0 * (w * w - 1.0) / norm, (1.0 - std::f64::consts::SQRT_2 * w + w * w) / norm);
    let pass = |values: &[f64]| -> Vec<f64> {
        let first = values[0];
        let (mut x, mut y) = ([first; 2], [first; 2]);
        values
            .iter()
            .map(|v| {
                let out = b * (v + 2.0 * x[0] + x[1]) - a1 * y[0] - a2 * y[1];
                (x, y) = ([*v, x[0]], [out, y[0]]);
                out
            })
            .collect()
    };
    let mut back = pass(values);
    back.reverse();
    let mut out = pass(&back);
    out.reverse();
    out
}

/// Rows of the usual way: coefficients, measurements, joint by joint.
struct Usual {
    rows: DMatrix<f64>,
    measured: DVector<f64>,
}

fn usual(
    model: &Model,
    base: &BaseParameters,
    drives: &[Drive],
    q: &[Vec<f64>; 6],
    tau: &[Vec<f64>; 6],
    range: std::ops::Range<usize>,
) -> Usual {
    let cut = |all: &[Vec<f64>; 6]| -> [Vec<f64>; 6] {
        std::array::from_fn(|k| zero_phase(&all[k][range.clone()]))
    };
    let (q, tau) = (cut(q), cut(tau));
    let links = model.welded();
    let mut moving = Moving::new(links.tree()).expect("a tree");
    let stride = moving.columns();
    let skip = stride - base.standard.len();
    let leads: Vec<usize> = base.parameters.iter().map(|p| p.terms[0].0 + skip).collect();
    let extra: usize = drives.iter().map(|d| d.terms.len()).sum();
    let samples: Vec<usize> = (200..q[0].len() - 200).step_by(EVERY).collect();
    let mut rows = DMatrix::zeros(6 * samples.len(), leads.len() + extra);
    let mut measured = DVector::zeros(6 * samples.len());
    for (n, row) in samples.into_iter().enumerate() {
        let at = |k: usize, i: usize| q[k][i];
        let angle: Vec<f64> = (0..6).map(|k| at(k, row)).collect();
        let rate: Vec<f64> = (0..6).map(|k| (at(k, row + 1) - at(k, row - 1)) * RATE_HZ / 2.0).collect();
        let change: Vec<f64> = (0..6)
            .map(|k| (at(k, row + 1) - 2.0 * at(k, row) + at(k, row - 1)) * RATE_HZ * RATE_HZ)
            .collect();
        moving.set(&angle, &rate, &change, &BaseMotion::still([0.0, 0.0, -9.80665])).expect("six joints");
        let all = moving.joint_rows().expect("rows");
        for k in 0..6 {
            for (place, lead) in leads.iter().enumerate() {
                rows[(6 * n + k, place)] = all[k * stride + lead];
            }
            let mut place = leads.len();
            for drive in drives {
                let factor = drive.rates.iter().find(|(j, _)| *j == k).map_or(0.0, |r| r.1);
                for term in &drive.terms {
                    rows[(6 * n + k, place)] = factor
                        * match term {
                            Term::Rotor => drive.rate(&change),
                            other => {
                                let motion = DriveState { rate: drive.rate(&rate), ..DriveState::default() };
                                other.column(&motion, drive.slides, true)
                            }
                        };
                    place += 1;
                }
            }
            measured[6 * n + k] = tau[k][row];
        }
    }
    Usual { rows, measured }
}

/// Returns the residual over the measurement's standard deviation, joint by joint.
fn shares(residual: &[f64], measured: &[f64]) -> Vec<f64> {
    (0..6)
        .map(|k| {
            let own = |v: &[f64]| v.iter().skip(k).step_by(6).copied().collect::<Vec<f64>>();
            let (r, m) = (own(residual), own(measured));
            let mean = m.iter().sum::<f64>() / m.len() as f64;
            let variance = m.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
            (r.iter().map(|v| v * v).sum::<f64>() / variance).sqrt()
        })
        .collect()
}

fn cells(shares: &[f64]) -> String {
    shares.iter().map(|s| format!("{:.1}", 100.0 * s)).collect::<Vec<_>>().join(" | ")
}

fn fitted(source: &TreeSource) -> Fit {
    fit(source, &FitOptions::default(), &Silent).expect("a fit")
}

/// Returns the residual over the measurement's standard deviation on the rows of `identify`, joint by joint.
fn of_prediction(made: &Prediction) -> Vec<f64> {
    made.residual_rms.iter().zip(&made.measured_sd).map(|(r, m)| r / m).collect()
}

pub fn table() -> String {
    let model = model();
    let (q, tau) = joints();
    let half = q[0].len() / 2;
    let ranges = [0..half, half..q[0].len()];
    let mut out = "| fitted to | predicts | by | joint 1 | 2 | 3 | 4 | 5 | 6 \
                   |\n|---|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    let names = ["first half", "second half"];
    let mut counts = String::new();
    let (mut halves, mut inflated) = (Vec::new(), Vec::new());
    for (from, to) in [(0, 1), (1, 0)] {
        let source = part(&model, &q, &tau, ranges[from].clone());
        let other = part(&model, &q, &tau, ranges[to].clone());
        let found = fitted(&source);
        let (input, base) = (source.input(), source.base());
        let links = Links {
            model: &input.model,
            base,
            situation: input.situation,
            drives: source.drive_motions(),
            as_stated: &[],
            idle: Vec::new(),
            beyond: Vec::new(),
            standard: None,
        };
        let states = states(&found, Some(&links), false);
        let identified = states.iter().filter(|s| s.measured().is_some()).count();
        counts += &format!(
            "{}: {identified} of {} parameters identified ({} base parameters, {} of drives), condition \
             number {:.0}. ",
            names[from],
            states.len(),
            base.parameters.len(),
            states.len() - base.parameters.len(),
            found.estimate.condition_number
        );
        halves.push(states);
        inflated.push(found.largest_inflation().unwrap_or(1.0));
        let ours = of_prediction(&found.predict(&other).expect("a prediction"));
        // The usual way, judged on the same rows and on its own.
        let own = usual(&model, base, &input.drives, &q, &tau, ranges[from].clone());
        let plain = own.rows.clone().svd(true, true).solve(&own.measured, 1e-12).expect("a solution");
        let on_ours = Prediction::of(&other, plain.as_slice(), &[]).expect("a prediction");
        let on_ours = of_prediction(&on_ours);
        let theirs = usual(&model, base, &input.drives, &q, &tau, ranges[to].clone());
        let plain_residual = &theirs.measured - &theirs.rows * &plain;
        let on_theirs = shares(plain_residual.as_slice(), theirs.measured.as_slice());
        let values = (0..found.parameters.len()).map(|j| found.estimate.measured(j).map_or(0.0, |m| m.value));
        let residual =
            &theirs.measured - &theirs.rows * DVector::from_iterator(found.parameters.len(), values);
        let ours_on_theirs = shares(residual.as_slice(), theirs.measured.as_slice());
        for (by, shares) in [
            ("`identify`, on its rows", &ours),
            ("plain least squares, on the same rows", &on_ours),
            ("`identify`, on rows at 40 Hz with accelerations", &ours_on_theirs),
            ("plain least squares, on the same rows", &on_theirs),
        ] {
            out += &format!("| {} | {} | {by} | {} |\n", names[from], names[to], cells(shares));
        }
    }
    let both = halves[0].iter().zip(&halves[1]).filter_map(|(a, b)| Some((a.measured()?, b.measured()?)));
    let apart: Vec<f64> = both.map(|(a, b)| (a.value - b.value).abs() / a.u95.hypot(b.u95)).collect();
    let all = fitted(&part(&model, &q, &tau, 0..q[0].len()));
    counts += &format!(
        "Of {} parameters identified by both halves {} agree within their joint U95. Autocorrelation \
         inflated intervals by up to {:.1} and {:.1}, of all six seconds {:.1}.",
        apart.len(),
        apart.iter().filter(|d| **d <= 1.0).count(),
        inflated[0],
        inflated[1],
        all.largest_inflation().unwrap_or(1.0)
    );
    out + "\n" + counts.trim()
}

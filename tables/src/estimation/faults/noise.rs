//! Honest recordings of one body with noise as sensors have it: filtered, decimated, held, stepped, 1/f, with
//! a line; with and without a rest, in which noise is all that an accelerometer tells of a mass.
//!
//! Spectra as data sheets and recordings at rest have them. Nothing of the estimator makes them.

use std::f64::consts::{PI, TAU};

use rigident::answer::Status;
use rigident::diagnosis::Case;
use rigident::fit::parallel;
use rigident::rows::tree::ProblemOptions;

use super::super::problem::Normal;
use super::super::rig_errors::{Errors, Flicker, Motion, Noise, Rig, rig_file};
use super::body::{each, truth};
use super::verdict;

/// Length of the rests, s.
const RESTS_S: [f64; 4] = [0.0, 1.0, 3.0, 10.0];
/// Rigs of each kind of noise and rest.
const SEEDS: u64 = 3;
/// The motion without its rest, s.
const MOVES_S: f64 = 20.0;
/// 1 σ of a sample of accelerometer and gyro, and of the load cell over that of the good one.
const ACCEL_MPS2: f64 = 0.04;
const GYRO_RADPS: f64 = 0.002;
const CELL: f64 = 0.5;
/// Samples at which filtered noise is made for one that is retained.
const FASTER: usize = 4;
/// Samples until a filter has settled.
const SETTLES: usize = 2000;

/// A spectrum of noise.
#[derive(Clone, Copy)]
pub(super) enum Spectrum {
    White,
    /// Butterworth of an order at a share of the Nyquist frequency.
    Filtered(usize, f64),
    /// Mean of four samples.
    Mean,
    /// Three samples of ten repeat the one before.
    Held,
    /// Noise in steps of this size, σ.
    Stepped(f64),
    /// White, and as strong at this frequency, Hz, as 1/f.
    Flicker(f64),
    /// White, and a line of this frequency, Hz, with half of the variance.
    Line(f64),
    /// One sample correlates with the next by 0.94.
    Structural,
}

const SPECTRA: [(&str, Spectrum); 14] = [
    ("white", Spectrum::White),
    ("one pole at 0.5 of Nyquist", Spectrum::Filtered(1, 0.5)),
    ("one pole at 0.1", Spectrum::Filtered(1, 0.1)),
    ("two poles at 0.5", Spectrum::Filtered(2, 0.5)),
    ("two poles at 0.3", Spectrum::Filtered(2, 0.3)),
    ("two poles at 0.1", Spectrum::Filtered(2, 0.1)),
    ("four poles at 0.2", Spectrum::Filtered(4, 0.2)),
    ("mean of four, decimated", Spectrum::Mean),
    ("30 % of samples repeat", Spectrum::Held),
    ("steps of 3 σ", Spectrum::Stepped(3.0)),
    ("1/f below 0.3 Hz", Spectrum::Flicker(0.3)),
    ("1/f below 1 Hz", Spectrum::Flicker(1.0)),
    ("line at 50 Hz", Spectrum::Line(50.0)),
    ("servo, lag 1: 0.94", Spectrum::Structural),
];

/// Applies a section `(1 + z⁻¹)ᵏ` over its poles, of unit gain at rest.
fn section(values: &mut [f64], a: [f64; 2], k: i32) {
    let gain = (1.0 + a[0] + a[1]) / 2.0_f64.powi(k);
    let (mut x1, mut x2, mut y1, mut y2) = (0.0, 0.0, 0.0, 0.0);
    for value in values {
        let x = *value;
        let sum = if k == 1 { x + x1 } else { x + 2.0 * x1 + x2 };
        let y = gain * sum - a[0] * y1 - a[1] * y2;
        (x2, x1, y2, y1) = (x1, x, y1, y);
        *value = y;
    }
}

/// Filters by a Butterworth of an order at a share of the Nyquist frequency, by the bilinear transform.
fn butterworth(values: &mut [f64], order: usize, share: f64) {
    let w = (0.5 * PI * share).tan();
    if order == 1 {
        return section(values, [(w - 1.0) / (w + 1.0), 0.0], 1);
    }
    for k in 0..order / 2 {
        let damping = (PI * (2 * k + 1) as f64 / (2 * order) as f64).sin();
        let scale = 1.0 + 2.0 * damping * w + w * w;
        section(values, [2.0 * (w * w - 1.0) / scale, (1.0 - 2.0 * damping * w + w * w) / scale], 2);
    }
}

impl Spectrum {
    /// Returns a series of unit variance; of 1/f that of its white part.
    pub(super) fn series(self, count: usize, rate_hz: f64, normal: &mut Normal) -> Vec<f64> {
        let mut white = |count: usize| (0..count).map(|_| normal.draw()).collect::<Vec<f64>>();
        let unit = |mut values: Vec<f64>| {
            let size = (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt();
            values.iter_mut().for_each(|v| *v /= size);
            values
        };
        match self {
            Self::White => white(count),
            Self::Filtered(order, share) => {
                let mut fast = white(FASTER * count + SETTLES);
                butterworth(&mut fast, order, share / FASTER as f64);
                unit(fast.into_iter().skip(SETTLES).step_by(FASTER).take(count).collect())
            }
            Self::Mean => unit(white(FASTER * count).chunks(FASTER).map(|four| four.iter().sum()).collect()),
            Self::Held => {
                let (mut own, at) = (white(count), white(count));
                (1..count).filter(|k| at[*k] < -0.524).for_each(|k| own[k] = own[k - 1]);
                own
            }
            Self::Stepped(step) => white(count).into_iter().map(|v| step * (v / step).round()).collect(),
            Self::Flicker(hz) => {
                let own = white(count);
                let mut flicker = Flicker::new(1.0, hz, rate_hz, normal);
                own.into_iter().map(|v| v + flicker.next(normal)).collect()
            }
            Self::Line(hz) => {
                let (own, phase) = (white(count), TAU * white(1)[0]);
                let line = |k: usize| (TAU * hz * k as f64 / rate_hz + phase).sin();
                own.iter().enumerate().map(|(k, v)| (v + 2.0_f64.sqrt() * line(k)) / 2.0_f64.sqrt()).collect()
            }
            Self::Structural => {
                let mut value = 0.0;
                let one = |draw| {
                    value = 0.94 * value + (1.0_f64 - 0.94 * 0.94).sqrt() * draw;
                    value
                };
                white(count).into_iter().map(one).collect()
            }
        }
    }
}

/// Returns an honest recording whose IMU has noise of a spectrum, or, of every third and of a servo, its load
/// cell, with a rest at the beginning, the middle or the end.
pub(super) fn honest_case(spectrum: Spectrum, rest_s: f64, seed: u64) -> Case {
    let known = Errors::default_classes();
    let nominal = Rig::lab();
    let mut file = rig_file(&known, &nominal.noise);
    (file.load_cell.noise_n_nm, file.imu[0].accel_noise_mps2, file.imu[0].gyro_noise_radps) =
        (None, None, None);
    let mut normal = Normal::new(3_000_000 + seed);
    let errors = known.draw(0.5, &mut normal);
    let noise = Noise { cell: [0.0; 6], accel: 0.0, gyro: 0.0 };
    let rig = Rig { errors, noise, duration_s: MOVES_S + rest_s, ..nominal };
    let from_s = [0.0, 0.5 * MOVES_S, MOVES_S][seed as usize % 3];
    let lab = if seed.is_multiple_of(2) { Motion::lab() } else { Motion::brisk() };
    let motion = if rest_s > 0.0 { lab.with_rest(from_s, from_s + rest_s) } else { lab };
    let recording = rig.record(&motion, &file, seed);
    let (count, rate_hz) = (recording.rows(), rig.rate_hz);
    // A servo moves what is on the cell.
    let of_cell = seed % 3 == 2 || matches!(spectrum, Spectrum::Structural);
    let mut series = |own: bool, size: f64| -> Vec<f64> {
        let spectrum = if own { spectrum } else { Spectrum::White };
        spectrum.series(count, rate_hz, &mut normal).into_iter().map(|v| size * v).collect()
    };
    let wrench: Vec<Vec<f64>> = nominal.noise.cell.iter().map(|s| series(of_cell, CELL * s)).collect();
    let accel: Vec<Vec<f64>> = (0..3).map(|_| series(!of_cell, ACCEL_MPS2)).collect();
    let gyro: Vec<Vec<f64>> = (0..3).map(|_| series(!of_cell, GYRO_RADPS)).collect();
    let mut case = Case { recording, model: None, options: ProblemOptions::default() };
    each(&mut case, |k, (w, a, g)| {
        w.iter_mut().zip(&wrench).for_each(|(to, own)| *to += own[k]);
        a.iter_mut().zip(&accel).for_each(|(to, own)| *to += own[k]);
        g.iter_mut().zip(&gyro).for_each(|(to, own)| *to += own[k]);
    });
    case
}

/// Returns the table of honest recordings by noise and rest.
pub fn table() -> String {
    let count = SPECTRA.len() * RESTS_S.len() * SEEDS as usize;
    let verdicts = parallel::map(parallel::threads(), count, |k| {
        let (kind, rest, seed) =
            (k / SEEDS as usize / RESTS_S.len(), k / SEEDS as usize % RESTS_S.len(), k % SEEDS as usize);
        let own = verdict(
            &mut honest_case(SPECTRA[kind].1, RESTS_S[rest], 100 * kind as u64 + seed as u64),
            &truth,
        );
        let refused = matches!(own.status, Status::Implausible | Status::Failed);
        if refused || own.worst > 1.5 {
            eprintln!(
                "  {}, rest {} s, {seed}: {:?}, worst {:.1}: {}",
                SPECTRA[kind].0, RESTS_S[rest], own.status, own.worst, own.said
            );
        }
        (refused, own.worst)
    });
    let mut text = "| noise | rest 0 s | 1 s | 3 s | 10 s | recordings | worst error / U95 \
                    |\n|---|---|---|---|---|---|---|\n"
        .to_owned();
    let per_kind = RESTS_S.len() * SEEDS as usize;
    let mut sums = [0; RESTS_S.len()];
    let mut all_worst: f64 = 0.0;
    for ((name, _), own) in SPECTRA.iter().zip(verdicts.chunks(per_kind)) {
        let refused: Vec<usize> =
            own.chunks(SEEDS as usize).map(|rest| rest.iter().filter(|v| v.0).count()).collect();
        sums.iter_mut().zip(&refused).for_each(|(sum, own)| *sum += own);
        let worst = own.iter().filter(|v| !v.0).map(|v| v.1).fold(0.0, f64::max);
        all_worst = all_worst.max(worst);
        let cells: Vec<String> = refused.iter().map(usize::to_string).collect();
        text += &format!("| {name} | {} | {per_kind} | {worst:.2} |\n", cells.join(" | "));
    }
    let cells = sums.map(|sum| sum.to_string()).join(" | ");
    text + &format!("| **refused of all** | {cells} | {count} | {all_worst:.2} |\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A recording that begins with a long rest, for each spectrum that differences of samples do not show.
    #[test]
    fn an_honest_recording_with_a_rest_is_not_refused() {
        let hidden = [2, 4, 5, 6, 8, 11];
        let verdicts = parallel::map(parallel::threads(), hidden.len(), |k| {
            verdict(&mut honest_case(SPECTRA[hidden[k]].1, 10.0, 3 * k as u64), &truth)
        });
        for (k, own) in hidden.iter().zip(verdicts) {
            let refused = matches!(own.status, Status::Implausible | Status::Failed);
            assert!(!refused && own.worst < 2.0, "{}: {:?}, {}", SPECTRA[*k].0, own.status, own.said);
        }
    }
}

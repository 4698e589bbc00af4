//! `demo --explain`: ten steps from readings to the answer, with the numbers of this run.
//!
//! The steps are done once more here, plainly, by the functions that the firmware calls: no outliers, no
//! noise of the IMU, no errors of the rig. The answer that follows has all of these in it.

use std::fmt::Write as _;

use rigident::application::Loaded;
use rigident::fit::figures::{fixed, significant};
use rigident::problem::Subject;
use rigident::rows::body::Input;
use rigident_fit::Fit;
use rigident_shared::conditioning::Conditioner;
use rigident_shared::factor::InformationFactor;
use rigident_shared::inertia::PARAMETER_NAMES;
use rigident_shared::regressor::{self, RegressorBlock, SIGNALS, SMOOTHED};

use crate::Failure;

/// Width of the filter, s, and the readings from one row block to the next.
const WIDTH_S: f64 = 0.1;
const ROW_EVERY: u16 = 10;
/// Room for the filter at 1000 readings a second.
const TAPS: usize = 128;
/// Ten parameters and six offsets.
const N: usize = 16;

/// The pieces of the ten steps.
struct Worked {
    /// The block whose numbers are shown, and its time, s.
    block: RegressorBlock<f64>,
    at_s: f64,
    /// Filtered noise of a channel over that of a reading.
    gain: f64,
    /// Row blocks in all.
    blocks: usize,
    /// Time and standard deviation of the mass where the factor has just determined it, and later.
    mass: Vec<(f64, f64)>,
    factor: InformationFactor<f64, N>,
}

/// The steps that were written, numbered.
#[derive(Default)]
struct Steps {
    text: String,
    count: usize,
}

impl Steps {
    fn add(&mut self, title: &str, words: &str) {
        self.count += 1;
        let _ = writeln!(self.text, "{:2}. {title}\n    {}", self.count, words.replace('\n', "\n    "));
    }
}

/// Returns the ten steps as text.
///
/// # Errors
/// Bad input: the readings are none of one body, or too few.
pub(crate) fn text(loaded: &Loaded, fit: &Fit) -> Result<String, Failure> {
    let Subject::Body { source, .. } = &loaded.problem.subject else {
        return Err(Failure::input("--explain: of one body"));
    };
    let input = source.input();
    let sigma: Vec<f64> = fit.channels.iter().map(|channel| channel.sigma).collect();
    let sigma = sigma.first_chunk::<6>().copied().ok_or_else(|| Failure::input("--explain: six channels"))?;
    let worked = Worked::of(&input.readings, &input.mounting, input.rate_hz, &sigma)
        .ok_or_else(|| Failure::input("--explain: the run is too short"))?;
    let mut steps = Steps::default();
    explain_readings(input, &mut steps);
    explain_rows(input, &worked, &sigma, &mut steps);
    explain_answer(&worked, &mut steps);
    Ok(steps.text)
}

fn list(values: &[f64], digits: i32) -> String {
    values.iter().map(|v| fixed(*v, digits)).collect::<Vec<_>>().join(", ")
}

/// Returns the time of a reading, s from the first.
fn seconds(input: &Input, time_ns: u64) -> f64 {
    time_ns as f64 * 1e-9 - input.readings[0].time_ns as f64 * 1e-9
}

/// Steps 1 to 4: the equations, and the readings.
fn explain_readings(input: &Input, steps: &mut Steps) {
    let (readings, rate_hz) = (&input.readings, input.rate_hz);
    let reading = &readings[readings.len() / 2];
    steps.add(
        "The question",
        &format!(
            "Newton and Euler about the origin of the load cell's frame S are linear in ten numbers \
             φ:\n{}.\nF = m a + …, M = … : each instant gives six equations A φ = w, whatever the motion.",
            PARAMETER_NAMES[..10].join(", ")
        ),
    );
    steps.add(
        "The motion",
        &format!(
            "The platform moved the body for {:.0} s. Without turning about several axes some of the ten \
             never show in w.",
            readings.last().map_or(0.0, |last| seconds(input, last.time_ns))
        ),
    );
    steps.add(
        "A reading",
        &format!(
            "{} of them, {rate_hz} a second. That at {:.3} s:\nwrench w = [{}] N, N m\nspecific force a = \
             [{}] m/s² (gravity is in it: at rest it points up)\nrate ω = [{}] rad/s",
            readings.len(),
            seconds(input, reading.time_ns),
            list(&reading.wrench.array(), 3),
            list(&reading.specific_force.array(), 3),
            list(&reading.angular_rate.array(), 4)
        ),
    );
    steps.add(
        "One place, one clock",
        &format!(
            "The IMU sits at p = [{}] m, turned against S: a at the origin of S is a − ω̇×p − ω×(ω×p),\nand \
             the IMU's samples are brought to the load cell's times.",
            list(&input.mounting.position.array(), 3)
        ),
    );
}

/// Steps 5 to 8: the filter, and rows in the factor.
fn explain_rows(input: &Input, worked: &Worked, sigma: &[f64; 6], steps: &mut Steps) {
    let first_s = input.readings[0].time_ns as f64 * 1e-9;
    steps.add(
        "The filter",
        &format!(
            "ω̇ is not measured. The products of ω, a and w go through one filter of {WIDTH_S} s; ω through \
             its derivative.\nBoth sides of A φ = w get the same filter, so it stays true. Noise of a \
             channel becomes {} of a reading's.",
            significant(worked.gain, 2)
        ),
    );
    steps.add(
        "Rows",
        &format!(
            "Every {ROW_EVERY} readings six rows: {} blocks. The column of the mass at {:.2} s is [{}] \
             m/s²:\nwhat the load cell would feel of 1 kg at its origin.",
            worked.blocks,
            worked.at_s - first_s,
            list(&worked.block.columns[0], 3)
        ),
    );
    steps.add(
        "Weights",
        &format!(
            "Each row is divided by its standard deviation, so that a newton and a newton metre count as \
             they are known:\nσ of a reading = [{}] N, N m",
            sigma.map(|s| significant(s, 2)).join(", ")
        ),
    );
    let grows: Vec<String> = worked
        .mass
        .iter()
        .map(|(at_s, sd)| format!("{} kg after {:.1} s", significant(1.96 * sd, 2), at_s - first_s))
        .collect();
    steps.add(
        "The factor",
        &format!(
            "Reflections turn the rows into a triangle R of {N} columns (ten, and six offsets of w) and \
             forget them:\n{} numbers, however long the run. RᵀR is the information; 1.96 σ of the mass \
             is\n{}.",
            N * (N + 3) / 2,
            grows.join(", ")
        ),
    );
}

/// Steps 9 and 10: the solution, and the rest of the residuals.
fn explain_answer(worked: &Worked, steps: &mut Steps) {
    let solution = worked.factor.solve();
    let block = &worked.block;
    let predicted: [f64; 6] = std::array::from_fn(|row| {
        let of_body: f64 = (0..10).map(|j| block.columns[j][row] * solution.estimate[j]).sum();
        of_body + solution.estimate[10 + row]
    });
    steps.add(
        "The answer",
        &format!(
            "Solve R φ = z. (RᵀR)⁻¹ is the covariance: m = {} ± {} kg.\nWith it A φ explains the block of \
             step 6: measured [{}], explained [{}].",
            fixed(solution.estimate[0], 4),
            significant(1.96 * solution.standard_deviation[0], 2),
            list(&block.wrench, 2),
            list(&predicted, 2)
        ),
    );
    let squares = worked.factor.residual_sum_of_squares();
    // What white noise leaves after the filter, in rows that are weighed as those of the pipeline.
    let expected = f64::from(ROW_EVERY) * worked.gain * worked.gain;
    let free = expected * (f64::from(worked.factor.rows()) - N as f64).max(1.0);
    steps.add(
        "The checks",
        &format!(
            "What no φ explains is {} σ on average: 1 where the model and the stated noise are right.\nThe \
             answer below counts more: noise of the IMU, outliers, rows that hang together, errors of the \
             rig; it says whether a body can have\nthese ten numbers, and gives none that the motion does \
             not determine.",
            significant((squares / free).sqrt(), 2)
        ),
    );
}

impl Worked {
    /// Does steps 4 to 8; `None` of too few readings.
    fn of(
        readings: &[rigident_shared::calibration::Reading<f64>],
        mounting: &rigident_shared::calibration::ImuMounting<f64>,
        rate_hz: f64,
        sigma: &[f64; 6],
    ) -> Option<Self> {
        type Filter = Conditioner<f64, SIGNALS, { SIGNALS - SMOOTHED }, TAPS>;
        let mut filter = Filter::new(rate_hz, WIDTH_S, ROW_EVERY).ok()?;
        let gain = filter.kernel().noise_gain().sqrt();
        let mut factor = InformationFactor::<f64, N>::EMPTY;
        let (mut blocks, mut shown, mut mass) = (0, None, Vec::new());
        let mut next_s = 0.0;
        for (at, reading) in readings.iter().enumerate() {
            let Some(filtered) = filter.push(&mounting.signals(reading)) else { continue };
            let block = regressor::block(&mounting.mounted(&filtered), &mounting.position);
            let time_s = reading.time_ns as f64 * 1e-9;
            // White noise through the filter: rows that overlap hang together, which a fit of its own takes
            // into account.
            let weight = sigma.map(|s| (f64::from(ROW_EVERY)).sqrt() / s);
            let columns: [[f64; 6]; N] = std::array::from_fn(|j| {
                std::array::from_fn(|row| match j.checked_sub(10) {
                    None => weight[row] * block.columns[j][row],
                    Some(channel) => weight[row] * f64::from(u8::from(channel == row)),
                })
            });
            factor.absorb(&columns, &std::array::from_fn(|row| weight[row] * block.wrench[row]));
            blocks += 1;
            if at >= readings.len() / 2 && shown.is_none() {
                shown = Some((block, time_s));
            }
            if time_s >= next_s {
                let solution = factor.solve();
                if solution.determined[0] {
                    mass.push((time_s, solution.standard_deviation[0]));
                    next_s = if mass.len() == 1 { time_s + 5.0 } else { time_s + 20.0 };
                }
            }
        }
        let (block, at_s) = shown?;
        Some(Self { block, at_s, gain, blocks, mass, factor })
    }
}

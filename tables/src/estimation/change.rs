//! Changes, drift and bodies that are not rigid: what is reported of them, and how often an honest recording
//! is accused.
//!
//! A body of 3.2 kg on a load cell of 0.05 N and 2 mN m, turned by ±0.5 rad about all axes for 20 s at 200
//! Hz; every run has its own frequencies and phases, noise, time and place.

mod simulated;

use rigident::fit::lack_of_fit::{Changed, Motion};
use rigident::fit::{Fit, FitOptions, Silent, fit};
use rigident::rig::ImuTable;
use rigident::rows::body::{BodySource, Input};
use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::screening::Limits;

use self::simulated::{Recording, recording};
use super::report::{Job, in_parallel, short};

const RATE_HZ: f64 = 200.0;
const DURATION_S: f64 = 20.0;
/// 1 σ a sample, N and N m.
const LOAD_CELL: [f64; 6] = [0.05, 0.05, 0.08, 0.002, 0.002, 0.0015];
/// 1 σ a sample, m/s² and rad/s.
const IMU: [f64; 2] = [0.01, 5e-4];
const ORDINARY_IMU: [f64; 2] = [0.03, 2e-3];
const CONSUMER_IMU: [f64; 2] = [0.3, 0.02];

/// The events in a recording.
#[derive(Clone, Copy, PartialEq)]
enum Case {
    /// White noise alone.
    White,
    /// White noise alone, with an ordinary IMU.
    OrdinaryImu,
    /// σ not stated.
    NotStated,
    /// A recording that begins with this many seconds of rest, with an IMU of these σ, m/s² and rad/s.
    Rest(f64, [f64; 2]),
    /// A recording that is turned slowly, with an IMU of these σ.
    Slow([f64; 2]),
    /// 1/f noise of the load cell, as large as its white noise at 1 Hz.
    Flicker,
    /// The load cell warms up: an exponential of 1 N and 20 mN m with 8 s.
    WarmUp,
    /// A walk of the load cell, 0.05 N and 2 mN m in 1 s.
    Walk,
    /// A walk of the gyro's bias, 2 mrad/s in 1 s.
    GyroWalk,
    /// Two knocks of 20 N for 0.1 s.
    Knocks,
    /// Mass lost, kg.
    Lost(f64),
    /// 0.2 kg that moves by 5 mm.
    Moved,
    /// The load cell jumps by 0.2 N and 5 mN m.
    Jump,
    /// A cable, N/m.
    Cable(f64),
    /// 0.3 kg on a spring of this frequency, Hz, and damping.
    Mode(f64, f64),
    /// A bolt that rattles where the force on it changes its sign.
    Bolt,
}

impl Case {
    fn words(self) -> String {
        match self {
            Self::White => "white noise".to_owned(),
            Self::OrdinaryImu => "IMU of 0.03 m/s², 2 mrad/s".to_owned(),
            Self::NotStated => "white noise, σ not stated".to_owned(),
            Self::Rest(rest_s, [accel, gyro]) => {
                format!("{rest_s} s of rest first, IMU of {accel} m/s², {} mrad/s", 1e3 * gyro)
            }
            Self::Slow([accel, gyro]) => {
                format!("0.03 to 0.14 Hz for 40 s, IMU of {accel} m/s², {} mrad/s", 1e3 * gyro)
            }
            Self::Flicker => "1/f noise of the load cell above white below 1 Hz".to_owned(),
            Self::WarmUp => "load cell warms up: 1 N, exponential of 8 s".to_owned(),
            Self::Walk => "walk of the load cell, 0.05 N/√s".to_owned(),
            Self::GyroWalk => "walk of the gyro, 2 mrad/s/√s".to_owned(),
            Self::Knocks => "two knocks of 20 N".to_owned(),
            Self::Lost(mass) => format!("{:.0} g lost", 1e3 * mass),
            Self::Moved => "200 g moved by 5 mm".to_owned(),
            Self::Jump => "load cell jumps by 0.2 N".to_owned(),
            Self::Cable(stiffness) => format!("cable of {stiffness} N/m"),
            Self::Mode(frequency, damping) => format!("0.3 kg on a spring, {frequency} Hz, ζ {damping}"),
            Self::Bolt => "loose bolt".to_owned(),
        }
    }

    /// Returns σ of the IMU, m/s² and rad/s.
    fn imu(self) -> [f64; 2] {
        match self {
            Self::OrdinaryImu => ORDINARY_IMU,
            Self::Rest(_, imu) | Self::Slow(imu) => imu,
            _ => IMU,
        }
    }

    /// Returns seconds of rest, seconds of motion, and what frequencies are multiplied by.
    fn timing(self) -> (f64, f64, f64) {
        match self {
            Self::Rest(rest_s, _) => (rest_s, DURATION_S, 1.0),
            Self::Slow(_) => (0.0, 2.0 * DURATION_S, 0.1),
            _ => (0.0, DURATION_S, 1.0),
        }
    }
}

fn fitted(case: Case, readings: Vec<Reading<f64>>) -> Fit {
    let stated = case != Case::NotStated;
    let [accel, gyro] = case.imu();
    let imu = ImuTable {
        accel_noise_mps2: Some(accel).filter(|_| stated),
        gyro_noise_radps: Some(gyro).filter(|_| stated),
        ..ImuTable::default()
    };
    let input = Input {
        readings,
        is_static: false,
        rate_hz: RATE_HZ,
        mounting: ImuMounting::default(),
        channel_sigma: Some(LOAD_CELL).filter(|_| stated),
        gyro_sigma: Some(gyro).filter(|_| stated),
        known_offset: None,
        nuisances: Vec::new(),
        rests: Vec::new(),
        beforehand: None,
        limits: Limits::none(),
    };
    fit(&BodySource::new(input, Some(&imu)), &FitOptions::default(), &Silent).expect("there are rows")
}

/// The reports about the recordings of a case.
#[derive(Default)]
struct Reports {
    runs: usize,
    body: usize,
    offset: usize,
    either: usize,
    resonance: usize,
    spring: usize,
    bursts: usize,
    frequencies: Vec<f64>,
    in_time: usize,
    in_interval: usize,
    time_errors: Vec<f64>,
    mass_error: f64,
    mass_sd: f64,
}

fn one(case: Case, seed: u64) -> Reports {
    let Recording { readings, changed_at_s } = recording(case, seed);
    let fit = fitted(case, readings);
    let mut reports = Reports { runs: 1, ..Reports::default() };
    if let Some(change) = &fit.lack_of_fit.change {
        match change.changed {
            Changed::Body => reports.body = 1,
            Changed::Offset => reports.offset = 1,
            Changed::Either => reports.either = 1,
        }
        let error = (change.time_s - changed_at_s).abs();
        reports.in_time = usize::from(error <= 0.2);
        reports.in_interval = usize::from(error <= change.time_u95_s);
        reports.time_errors.push(error);
        if let (Case::Lost(mass), Some(step)) = (case, change.steps.iter().find(|s| s.column == 0)) {
            reports.mass_error = (step.value + mass).powi(2);
            reports.mass_sd = step.deviation.powi(2);
        }
    }
    match fit.lack_of_fit.not_rigid.map(|found| found.motion) {
        Some(Motion::Resonance { frequency_hz }) => {
            reports.resonance = 1;
            reports.frequencies.push((frequency_hz[0] * frequency_hz[1]).sqrt());
        }
        Some(Motion::Spring) => reports.spring = 1,
        Some(Motion::Bursts { .. }) => reports.bursts = 1,
        None => {}
    }
    reports
}

/// Returns the middle one of some numbers.
fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied()
}

impl Reports {
    fn row(&self, case: Case) -> String {
        let count = |n: usize| if n == 0 { String::new() } else { n.to_string() };
        let changed = self.body + self.offset + self.either;
        let named = changed + self.resonance + self.spring + self.bursts;
        let is_change = matches!(case, Case::Lost(_) | Case::Moved | Case::Jump);
        let of_change = |text: String| if is_change { text } else { String::new() };
        let resonance = median(&self.frequencies)
            .map_or_else(String::new, |hz| format!("{} ({})", self.resonance, short(hz)));
        let mass = match case {
            Case::Lost(_) => {
                let root = |sum: f64| short(1e3 * (sum / self.body.max(1) as f64).sqrt());
                format!("{} ({})", root(self.mass_error), root(self.mass_sd))
            }
            _ => String::new(),
        };
        format!(
            "| {} | {} | {} | {} | {} | {resonance} | {} | {} | {} | {} | {} | {} | {mass} |\n",
            case.words(),
            self.runs,
            count(self.body),
            count(self.offset),
            count(self.either),
            count(self.spring),
            count(self.bursts),
            count(self.runs - named),
            of_change(self.in_time.to_string()),
            of_change(self.in_interval.to_string()),
            of_change(median(&self.time_errors).map_or_else(String::new, short)),
        )
    }
}

fn line(case: Case, runs: usize, seed: u64) -> Reports {
    let jobs = (0..runs).map(|k| -> Job<'_, Reports> { Box::new(move || one(case, seed + k as u64)) });
    let mut all = Reports::default();
    for reports in in_parallel(jobs.collect()) {
        all.runs += reports.runs;
        all.body += reports.body;
        all.offset += reports.offset;
        all.either += reports.either;
        all.resonance += reports.resonance;
        all.spring += reports.spring;
        all.bursts += reports.bursts;
        all.frequencies.extend(reports.frequencies);
        all.in_time += reports.in_time;
        all.in_interval += reports.in_interval;
        all.time_errors.extend(reports.time_errors);
        all.mass_error += reports.mass_error;
        all.mass_sd += reports.mass_sd;
    }
    all
}

/// Returns the table of honest recordings and of changes.
pub fn table() -> String {
    let cases = [
        (Case::White, 1000),
        (Case::NotStated, 200),
        (Case::OrdinaryImu, 200),
        (Case::Rest(5.0, IMU), 200),
        (Case::Rest(10.0, ORDINARY_IMU), 200),
        (Case::Rest(5.0, CONSUMER_IMU), 200),
        (Case::Slow(ORDINARY_IMU), 100),
        (Case::Slow(CONSUMER_IMU), 100),
        (Case::Flicker, 200),
        (Case::WarmUp, 100),
        (Case::Walk, 100),
        (Case::GyroWalk, 100),
        (Case::Knocks, 100),
        (Case::Lost(0.01), 200),
        (Case::Lost(0.002), 100),
        (Case::Moved, 100),
        (Case::Jump, 100),
    ];
    table_of(&cases, 1)
}

/// Returns the table of what is not rigid.
pub fn not_rigid_table() -> String {
    let cases = [
        (Case::Cable(5.0), 50),
        (Case::Cable(30.0), 50),
        (Case::Mode(1.2, 0.03), 50),
        (Case::Mode(5.0, 0.03), 50),
        (Case::Mode(10.0, 0.03), 50),
        (Case::Bolt, 50),
    ];
    table_of(&cases, 13)
}

fn table_of(cases: &[(Case, usize)], first: u64) -> String {
    let mut text = String::from(
        "| recording | runs | body changed | offset jumped | either | resonance (median, Hz) | spring | \
         bursts | nothing | time within 0.2 s | within its U95 | median error of time, s | rms error of mass \
         (stated 1 σ), g |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for (k, (case, runs)) in cases.iter().enumerate() {
        text += &line(*case, *runs, 100_000 * (k as u64 + first)).row(*case);
    }
    text
}

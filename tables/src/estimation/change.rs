//! Changes, drift and bodies that are not rigid: what is reported of them, and how often an honest recording
//! is accused.
//!
//! A body of 3.2 kg on a load cell of 0.05 N and 2 mN m, turned by ±0.5 rad about all axes for 20 s at 200
//! Hz; every run has its own frequencies and phases, noise, time and place.

use hexapod::{Axis, BodyParameters, FrameMotion, Geometry, MotionProgram, Segment, SineTerm};
use nalgebra::Vector3;
use rigident::fit::lack_of_fit::{Changed, Motion};
use rigident::fit::{Fit, FitOptions, Silent, fit};
use rigident::rig::ImuTable;
use rigident::rows::body::{BodySource, Input};
use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};

use super::problem::Normal;
use super::report::{Job, in_parallel, short};

const RATE_HZ: f64 = 200.0;
const DURATION_S: f64 = 20.0;
const GRAVITY: f64 = 9.80665;
/// 1 σ a sample, N and N m.
const LOAD_CELL: [f64; 6] = [0.05, 0.05, 0.08, 0.002, 0.002, 0.0015];
/// 1 σ a sample, m/s² and rad/s.
const IMU: [f64; 2] = [0.01, 5e-4];
const ORDINARY_IMU: [f64; 2] = [0.03, 2e-3];
const CONSUMER_IMU: [f64; 2] = [0.3, 0.02];
/// 1/f noise begins where it is as large as the white noise, Hz.
const CORNER_HZ: f64 = 1.0;

/// The events in a recording.
#[derive(Clone, Copy, PartialEq)]
enum Case {
    /// White noise alone.
    White,
    /// The same with an ordinary IMU.
    OrdinaryImu,
    /// σ not stated.
    NotStated,
    /// It begins with this many seconds of rest, with an IMU of these σ, m/s² and rad/s.
    Rest(f64, [f64; 2]),
    /// It is turned slowly, with an IMU of these σ.
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

fn body() -> BodyParameters {
    BodyParameters {
        mass_kg: 3.2,
        com_m: [0.03, -0.02, 0.08],
        inertia_com_kgm2: [0.02, 0.025, 0.015, 0.0015, -0.001, 0.002],
    }
}

/// Returns the sum of two bodies, the second a point.
fn with_point(body: &BodyParameters, mass_kg: f64, at: Vector3<f64>) -> BodyParameters {
    let whole = body.mass_kg + mass_kg;
    let own = Vector3::from(body.com_m);
    let com = (own * body.mass_kg + at * mass_kg) / whole;
    let mut inertia = body.inertia_com_kgm2;
    for (mass, place) in [(body.mass_kg, own), (mass_kg, at)] {
        let d = place - com;
        let add = [
            d.y * d.y + d.z * d.z,
            d.z * d.z + d.x * d.x,
            d.x * d.x + d.y * d.y,
            -d.y * d.z,
            -d.z * d.x,
            -d.x * d.y,
        ];
        inertia.iter_mut().zip(add).for_each(|(i, a)| *i += mass * a);
    }
    BodyParameters { mass_kg: whole, com_m: com.into(), inertia_com_kgm2: inertia }
}

/// A uniform number from −1 to 1.
fn uniform(normal: &mut Normal) -> f64 {
    // The phase of two normal deviates.
    normal.draw().atan2(normal.draw()) / std::f64::consts::PI
}

fn motion(normal: &mut Normal, (rest_s, moving_s, faster): (f64, f64, f64)) -> MotionProgram {
    let mut terms = Vec::new();
    for axis in [Axis::Roll, Axis::Pitch, Axis::Yaw] {
        for (amplitude, frequency_hz) in [(0.25, 0.3), (0.15, 0.8), (0.1, 1.4)] {
            terms.push(SineTerm {
                axis,
                amplitude,
                frequency_hz: faster * frequency_hz * (1.0 + 0.25 * uniform(normal)),
                phase_rad: std::f64::consts::PI * uniform(normal),
            });
        }
    }
    let rest = (rest_s > 0.0).then_some(Segment::Hold { duration_s: rest_s });
    let moving = Segment::Multisine { duration_s: moving_s, ramp_s: 2.0, terms };
    MotionProgram { start: Geometry::thesis().home(), segments: rest.into_iter().chain([moving]).collect() }
}

/// 1/f noise whose density is that of white noise of unit variance per sample at [`CORNER_HZ`]: exponentially
/// correlated noise of time constants an octave apart.
struct Flicker {
    states: Vec<(f64, f64)>,
}

impl Flicker {
    const OCTAVES: i32 = 12;

    fn new(normal: &mut Normal) -> Self {
        let times = (0..Self::OCTAVES).map(|k| 2f64.powi(k - 6));
        let states = times.map(|time_s| (f64::exp(-1.0 / (RATE_HZ * time_s)), normal.draw()));
        Self { states: states.collect() }
    }

    fn next(&mut self, normal: &mut Normal) -> f64 {
        // Sum of Lorentzians 4 τ/(1 + (ωτ)²) per octave: (2/ln 2)/f; white noise has 2/rate.
        let variance = CORNER_HZ * std::f64::consts::LN_2 / RATE_HZ;
        for (rho, state) in &mut self.states {
            *state = *rho * *state + (1.0 - *rho * *rho).sqrt() * normal.draw();
        }
        variance.sqrt() * self.states.iter().map(|s| s.1).sum::<f64>()
    }
}

/// A recording and what is true of it.
struct Recording {
    readings: Vec<Reading<f64>>,
    changed_at_s: f64,
}

fn recording(case: Case, seed: u64) -> Recording {
    let mut normal = Normal::new(seed);
    let trajectory = motion(&mut normal, case.timing()).trajectory().expect("a fixed kind of motion");
    let changed_at_s = DURATION_S * (0.5 + 0.25 * uniform(&mut normal));
    let place = Vector3::from_fn(|_, _| 0.06 * uniform(&mut normal)) + Vector3::from(body().com_m);
    let direction = Vector3::from_fn(|_, _| normal.draw()).normalize();
    let rest = body();
    let (before, after) = match case {
        Case::Lost(mass) => (rest, with_point(&rest, -mass, place)),
        Case::Moved => {
            let without = with_point(&rest, -0.2, place);
            (rest, with_point(&without, 0.2, place + 0.005 * direction))
        }
        _ => (rest, rest),
    };
    let [accel, gyro] = case.imu();
    let gravity = Vector3::new(0.0, 0.0, -GRAVITY);
    let mut flicker: Vec<Flicker> = (0..6).map(|_| Flicker::new(&mut normal)).collect();
    let (mut walk, mut gyro_walk) = ([0.0; 6], Vector3::zeros());
    let mut there_before = Vector3::zeros();
    let (mut swing, mut swing_rate) = (Vector3::zeros(), Vector3::<f64>::zeros());
    let (mut sign, mut rattles) = (0.0, 0);
    let knocks: Vec<f64> = (0..2).map(|_| DURATION_S * (0.5 + 0.45 * uniform(&mut normal))).collect();
    let jump: [f64; 6] = std::array::from_fn(|c| direction[c % 3] * if c < 3 { 0.2 } else { 0.005 });
    let start = trajectory.state(0.0);
    let root_step = RATE_HZ.sqrt().recip();
    let (rest_s, moving_s, _) = case.timing();
    let count = ((rest_s + moving_s) * RATE_HZ) as usize;
    let readings = (0..count).map(|k| {
        let time_s = k as f64 / RATE_HZ;
        let state = trajectory.state(time_s);
        let motion = FrameMotion::of_plate(&state);
        let own = if time_s < changed_at_s { &before } else { &after };
        let mut wrench = own.wrench(&motion, &gravity);
        let to_s = motion.rotation.transpose();
        let specific = motion.specific_force(&gravity);
        let (rate, turning) = (to_s * motion.angular_rate, to_s * motion.angular_acceleration);
        let mut add = |force: Vector3<f64>, at: Vector3<f64>| {
            let moment = at.cross(&force);
            wrench.iter_mut().zip(force.iter().chain(moment.iter())).for_each(|(w, v)| *w += v);
        };
        match case {
            Case::Cable(stiffness) => {
                let moved =
                    motion.position + motion.rotation * place - (start.position + start.rotation * place);
                add(to_s * moved * stiffness, place);
            }
            Case::Mode(frequency, damping) => {
                const MASS: f64 = 0.3;
                let omega = std::f64::consts::TAU * frequency;
                let there = specific + turning.cross(&place) + rate.cross(&rate.cross(&place));
                if k == 0 {
                    (swing, there_before) = (-there / (omega * omega), there);
                }
                let of = |u: Vector3<f64>, swing: Vector3<f64>, swing_rate: Vector3<f64>| {
                    -u - swing * (omega * omega) - swing_rate * (2.0 * damping * omega)
                };
                const STEPS: u32 = 20;
                for step in 0..STEPS {
                    let share = (f64::from(step) + 0.5) / f64::from(STEPS);
                    let u = there_before * (1.0 - share) + there * share;
                    swing_rate += of(u, swing, swing_rate) / (RATE_HZ * f64::from(STEPS));
                    swing += swing_rate / (RATE_HZ * f64::from(STEPS));
                }
                there_before = there;
                add(of(there, swing, swing_rate) * MASS, place);
                let moment = swing.cross(&(there * MASS));
                wrench.iter_mut().skip(3).zip(moment.iter()).for_each(|(w, v)| *w += v);
            }
            Case::Bolt => {
                let force = specific.x + turning.cross(&place).x;
                if force.signum() != sign {
                    (sign, rattles) = (force.signum(), 20);
                }
                if rattles > 0 {
                    rattles -= 1;
                    add(Vector3::from_fn(|_, _| normal.draw()), place);
                }
            }
            Case::Knocks => {
                for knock in &knocks {
                    let phase = (time_s - knock) / 0.1;
                    if (0.0..1.0).contains(&phase) {
                        add(direction * 20.0 * (std::f64::consts::PI * phase).sin(), place);
                    }
                }
            }
            _ => {}
        }
        for c in 0..6 {
            wrench[c] += LOAD_CELL[c] * normal.draw();
            wrench[c] += match case {
                Case::Flicker => LOAD_CELL[c] * flicker[c].next(&mut normal),
                Case::WarmUp => direction[c % 3] * if c < 3 { 1.0 } else { 0.02 } * f64::exp(-time_s / 8.0),
                Case::Walk => {
                    walk[c] += if c < 3 { 0.05 } else { 0.002 } * root_step * normal.draw();
                    walk[c]
                }
                Case::Jump if time_s >= changed_at_s => jump[c],
                _ => 0.0,
            };
        }
        if case == Case::GyroWalk {
            gyro_walk += Vector3::from_fn(|_, _| 2e-3 * root_step * normal.draw());
        }
        let noisy = |v: Vector3<f64>, sigma: f64, normal: &mut Normal| -> [f64; 3] {
            std::array::from_fn(|i| v[i] + sigma * normal.draw())
        };
        Reading {
            time_ns: (time_s * 1e9).round() as u64,
            wrench: Wrench::from_array(wrench),
            specific_force: SpecificForce::from_array(noisy(specific, accel, &mut normal)),
            angular_rate: AngularRate::from_array(noisy(rate + gyro_walk, gyro, &mut normal)),
        }
    });
    Recording { readings: readings.collect(), changed_at_s }
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

/// The table of honest recordings and of changes.
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

/// The table of what is not rigid.
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

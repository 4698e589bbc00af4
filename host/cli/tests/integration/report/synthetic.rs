//! A made-up experiment that fills every part of a report; shared by the tests and the example.

use rigident::answer::result::{
    BodyFrame, Channel, DriftChange, Measured, Parameter, ParameterState, PrincipalMoment, Truth,
};
use rigident::answer::{Answer, Drift, Source, Status};
use rigident::present::{Along, Convergence, Residual, Series, Stage, TimePlot, plain, report};

/// An answer with its plots.
#[derive(Default)]
pub struct Experiment {
    pub answer: Answer,
    pub series: Series,
}

impl Experiment {
    pub fn page(&self) -> String {
        report(&self.answer, &self.series)
    }

    pub fn text(&self) -> String {
        plain::text(&self.answer)
    }
}

/// Reproducible noise: sums of twelve uniform numbers, variance one.
pub struct Noise(u64);

impl Noise {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

pub const PARAMETERS: [(&str, &str, f64, f64); 10] = [
    ("m", "kg", 20.0, 0.021),
    ("mcx", "kg m", 0.0, 0.0012),
    ("mcy", "kg m", 0.0, 0.0011),
    ("mcz", "kg m", 1.06, 0.0016),
    ("Ixx", "kg m2", 0.43748, 0.00031),
    ("Iyy", "kg m2", 0.07468, 0.00028),
    ("Izz", "kg m2", 0.3791, 0.00045),
    ("Iyz", "kg m2", 0.0, 0.00021),
    ("Izx", "kg m2", 0.0, 0.00025),
    ("Ixy", "kg m2", 0.0, 0.00019),
];

const OFFSETS: [(&str, &str, f64, f64); 6] = [
    ("offset_fx", "N", 1.4, 0.11),
    ("offset_fy", "N", -0.6, 0.10),
    ("offset_fz", "N", 3.1, 0.22),
    ("offset_mx", "N m", 0.12, 0.008),
    ("offset_my", "N m", -0.05, 0.009),
    ("offset_mz", "N m", 0.01, 0.007),
];

fn parameter(name: &str, unit: &str, truth: f64, u95: f64, noise: &mut Noise) -> Parameter {
    let value = truth + u95 / 1.96 * noise.normal();
    Parameter {
        name: name.to_owned(),
        owner: name.strip_prefix("offset_").unwrap_or_default().to_owned(),
        unit: unit.to_owned(),
        state: ParameterState::Identified(Measured { value, u95 }),
        truth: Some(truth),
        ..Parameter::default()
    }
}

/// Values and uncertainties about true ones.
fn measured<const K: usize>(list: [(f64, f64); K], noise: &mut Noise) -> ([f64; K], [f64; K]) {
    (list.map(|(truth, u95)| truth + u95 / 1.96 * noise.normal()), list.map(|(_, u95)| u95))
}

fn convergence(parameter: &Parameter, from_s: f64, times: &[f64], noise: &mut Noise) -> Convergence {
    let Measured { value, u95 } = parameter.state.measured().unwrap();
    let end = times.last().copied().unwrap();
    let mut history = Convergence { name: parameter.name.clone(), ..Convergence::default() };
    let mut wander = 0.0;
    for t in times {
        let u = if *t > from_s { u95 * ((end - from_s) / (t - from_s)).sqrt() } else { f64::INFINITY };
        wander = 0.97 * wander + 0.24 * noise.normal();
        history.time_s.push(*t);
        history.u95.push(u);
        let left = (1.0 - (t - from_s) / (end - from_s)).max(0.0).sqrt();
        history.estimate.push(if u.is_finite() { value + 0.4 * u * wander * left } else { 0.0 });
    }
    history
}

/// Five still poses of four seconds, then 40 s of motion, at `rate_hz`.
pub fn experiment(rate_hz: f64) -> Experiment {
    let mut noise = Noise::new(7);
    let rows = (60.0 * rate_hz) as usize;
    let time_s: Vec<f64> = (0..rows).map(|i| i as f64 / rate_hz).collect();
    let seldom: Vec<f64> = (1..=1200).map(|i| f64::from(i) * 0.05).collect();
    let parameters: Vec<Parameter> =
        PARAMETERS.iter().chain(&OFFSETS).map(|(n, u, t, s)| parameter(n, u, *t, *s, &mut noise)).collect();
    let convergence = parameters
        .iter()
        .take(10)
        .enumerate()
        .map(|(j, p)| convergence(p, if j < 4 { 4.0 } else { 20.0 }, &seldom, &mut noise))
        .collect();
    let residuals = residuals(&time_s, &mut noise);
    let channel =
        |r: &Residual| Channel { name: r.channel.clone(), unit: r.unit.clone(), ..Channel::default() };
    let channels = residuals.iter().map(channel).collect();
    let answer = Answer {
        status: Status::Identified,
        source: Source {
            recording: "demo-2026-11-21.mcap".to_owned(),
            recorded: None,
            mcu: "inproc".to_owned(),
            rate_hz: Some(rate_hz),
            rows: rows as u64,
            duration_s: Some(60.0),
        },
        parameters,
        channels,
        condition_number: Some(12.34),
        physically_consistent: Some(true),
        drift: Some(drift(&mut noise)),
        ..body(&mut noise)
    };
    let series = Series {
        along: Along::Time,
        stages: stages(),
        convergence,
        residuals,
        motion: motion(&time_s, &mut noise),
        rejected: vec![("saturated".to_owned(), 12), ("frozen".to_owned(), 0), ("gap".to_owned(), 3)],
        provenance: vec![
            ("firmware".to_owned(), "rigident 0.1.0, CRC-32 8f3a11c4, protocol 1".to_owned()),
            ("load cell".to_owned(), "serial 4711, calibrated 2026-03-02".to_owned()),
            ("IMU".to_owned(), "serial 0815, calibrated 2026-05-19".to_owned()),
        ],
        ..Series::default()
    };
    Experiment { answer, series }
}

/// Returns what follows from the ten parameters.
fn body(noise: &mut Noise) -> Answer {
    let (com_m, com_u95_m) = measured([(0.0, 0.000_06), (0.0, 0.000_055), (0.053, 0.000_09)], noise);
    let sigma = [0.000_32, 0.000_29, 0.000_45, 0.000_21, 0.000_25, 0.000_19];
    let about_com = [0.3813, 0.0185, 0.3791, 0.0, 0.0, 0.0];
    let there = [0.403_08, 0.040_28, 0.3791, 0.0, 0.0, 0.0];
    let with_sigma = |list: [f64; 6]| std::array::from_fn(|k| (list[k], sigma[k]));
    let (inertia, inertia_u95): ([f64; 6], [f64; 6]) = measured(with_sigma(about_com), noise);
    let (frame_com_m, frame_com_u95_m) =
        measured([(0.0, 0.000_06), (0.0, 0.000_055), (0.033, 0.000_09)], noise);
    let (frame_inertia, frame_u95): ([f64; 6], [f64; 6]) = measured(with_sigma(there), noise);
    let (moments, moments_u95) =
        measured([(0.3813, 0.000_32), (0.3791, 0.000_45), (0.0185, 0.000_29)], noise);
    let axes = [[1.0, 0.0004, -0.0131], [0.0131, -0.0002, 0.9999], [0.0004, -1.0, 0.0002]];
    let principal = |k: usize| PrincipalMoment {
        moment_kgm2: moments[k],
        u95_kgm2: moments_u95[k],
        axis: Some(axes[k]),
        axis_u95_rad: Some([0.19, 0.19, 0.0012][k]),
    };
    Answer {
        mass_kg: Some(20.0),
        com_m: Some(com_m),
        com_u95_m: Some(com_u95_m),
        inertia_com_kgm2: Some(inertia),
        inertia_com_u95_kgm2: Some(inertia_u95),
        principal: (0..3).map(principal).collect(),
        body_frame: Some(BodyFrame {
            name: "bracket 17".to_owned(),
            com_m: frame_com_m,
            com_u95_m: frame_com_u95_m,
            inertia_origin_kgm2: Some(frame_inertia),
            inertia_origin_u95_kgm2: Some(frame_u95),
        }),
        truth: Some(Truth {
            mass_kg: 20.0,
            com_m: [0.0, 0.0, 0.053],
            inertia_com_kgm2: about_com,
            moments_kgm2: [0.3813, 0.3791, 0.0185],
            body_frame_com_m: Some([0.0, 0.0, 0.033]),
            body_frame_inertia_origin_kgm2: Some(there),
        }),
        ..Answer::default()
    }
}

fn drift(noise: &mut Noise) -> Drift {
    let changes = [("fx", 0.31), ("fy", 0.29), ("fz", 0.61), ("mx", 0.023), ("my", 0.027), ("mz", 0.026)];
    let change = |(channel, u95): (&str, f64)| DriftChange {
        channel: channel.to_owned(),
        unit: if channel.starts_with('f') { "N" } else { "N m" }.to_owned(),
        change: Some(Measured { value: u95 / 1.96 * noise.normal(), u95 }),
    };
    Drift { elapsed_s: 56.0, changes: changes.map(change).into() }
}

fn residuals(time_s: &[f64], noise: &mut Noise) -> Vec<Residual> {
    let sigmas = [5.05, 5.05, 10.1, 0.383, 0.459, 0.459];
    let channels = ["fx", "fy", "fz", "mx", "my", "mz"].iter().zip(sigmas);
    channels
        .map(|(channel, sigma)| Residual {
            channel: (*channel).to_owned(),
            unit: if channel.starts_with('f') { "N" } else { "N m" }.to_owned(),
            time_s: time_s.to_vec(),
            values: time_s.iter().map(|_| sigma * noise.normal()).collect(),
            sigma,
        })
        .collect()
}

fn stages() -> Vec<Stage> {
    let mut stages: Vec<Stage> =
        (0..5).map(|i| Stage { start_s: 4.0 * f64::from(i), name: format!("pose {}", i + 1) }).collect();
    stages.push(Stage { start_s: 20.0, name: "motion".to_owned() });
    stages.push(Stage { start_s: 57.0, name: "pose 1 again".to_owned() });
    stages
}

fn motion(time_s: &[f64], noise: &mut Noise) -> Vec<TimePlot> {
    let tilt: [(f64, f64); 5] = [(0.5, -0.27), (-0.05, 0.54), (0.48, -0.28), (-0.33, -0.43), (0.51, 0.27)];
    let moving = |t: f64| t > 20.0 && t < 57.0;
    let wave = |t: f64, k: usize| -> f64 {
        if !moving(t) {
            return 0.0;
        }
        let f = [[0.7, 1.9], [0.9, 2.3], [1.1, 1.7]][k];
        let fade = ((t - 20.0).min(57.0 - t) / 2.0).min(1.0);
        fade * f.map(|f| (std::f64::consts::TAU * f * t).sin()).iter().sum::<f64>()
    };
    let mut series = |f: &dyn Fn(f64) -> f64, sigma: f64| -> Vec<f64> {
        time_s.iter().map(|t| f(*t) + sigma * noise.normal()).collect()
    };
    let pose = |t: f64| if t < 20.0 { tilt[((t / 4.0) as usize).min(4)] } else { (0.0, 0.0) };
    let g = 9.80665;
    let with = |plot: TimePlot, (label, values): (&str, Vec<f64>)| {
        plot.with(label, values.len(), |k| (time_s[k], values[k]))
    };
    let rates = ["ω x", "ω y", "ω z"].into_iter().enumerate();
    let rates: Vec<_> = rates.map(|(k, label)| (label, series(&|t| 0.6 * wave(t, k), 4.3e-4))).collect();
    let forces = [
        ("a x", series(&|t| -g * pose(t).1.sin() + wave(t, 0), 0.02)),
        ("a y", series(&|t| g * pose(t).1.cos() * pose(t).0.sin() + wave(t, 1), 0.02)),
        ("a z", series(&|t| g * pose(t).1.cos() * pose(t).0.cos() + wave(t, 2), 0.02)),
    ];
    vec![
        rates.into_iter().fold(TimePlot::new("Angular rate at the IMU", "rad/s"), with),
        forces.into_iter().fold(TimePlot::new("Specific force at the IMU", "m/s2"), with),
    ]
}

/// Returns an experiment of still poses only: no tensor, no drift check.
pub fn still_poses() -> Experiment {
    let Experiment { mut answer, series } = experiment(50.0);
    for parameter in answer.parameters.iter_mut().take(10).skip(4) {
        parameter.state = ParameterState::NotIdentified;
    }
    (answer.inertia_com_kgm2, answer.inertia_com_u95_kgm2) = (None, None);
    if let Some(frame) = &mut answer.body_frame {
        frame.name = "Tool <flange> & \"adapter\"".to_owned();
        (frame.inertia_origin_kgm2, frame.inertia_origin_u95_kgm2) = (None, None);
    }
    answer.status = Status::PartlyIdentified;
    answer.principal.clear();
    answer.physically_consistent = None;
    answer.warnings = vec!["accelerometer gain and bias were calibrated against |g|".to_owned()];
    answer.advice = vec![
        "no rotation to and fro about S.x that is fast enough: turn the body about S.x, with two or \
              three well-separated frequencies"
            .to_owned(),
    ];
    answer.drift = None;
    Experiment { answer, series }
}

//! The closed loop against a simulated rig that may not be what the planner believes: an axis that does not
//! follow or is refused, tighter limits, other noise.

use std::time::Instant;

use hexapod::{BodySet, Limits, Load, MotionProgram, Pose, Segment};
use rigident_shared::estimator::{Estimator, EstimatorConfig};
use rigident_shared::screening;
use rigident_sim::rig::{Readings, RigConfig, RigError};

use super::foreseen::{Forecast, Foreseen};
use super::goal::{Asked, largest_principal};
use super::information::RigModel;
use super::observed::Observed;
use super::planner::{Next, Planner};
use crate::carried::{CarriedError, LoadBound, Weighing};
use crate::equipment::Equipment;
use crate::machine;
use rigident_fit::{ESTIMATOR_TAPS, Factor, filter_width_s, row_every};
use rigident_io::rig::RigFile;
use rigident_laboratory::{mounting, reading};

/// The factor is examined this often, s.
const LOOK_S: f64 = 0.25;
/// The time that a motion made between segments takes, s: twice what was measured on two cores.
const MAKING_S: f64 = 0.75;
/// The load cell is read this long before anything moves, s.
const WEIGHED_S: f64 = 2.0;
/// Steps in which what was driven is compared with the limits, s.
const HELD_S: f64 = 0.005;
/// An owner's statement about the largest body.
const BOUND: LoadBound = LoadBound { mass_kg: 40.0, within_m: 0.5 };
/// The number of equal readings of a frozen sensor, readings.
const FROZEN_AFTER: u16 = 50;

/// A rig and what is wrong with it.
#[derive(Clone, Debug)]
pub struct Rehearsal {
    /// The rig as it is.
    pub config: RigConfig,
    /// The rig as it is believed to be; the body is weighed.
    pub believed: RigModel,
    /// The mass and size that a body may have.
    pub bound: LoadBound,
    /// Coordinates that are commanded to move and do not.
    pub stuck: [bool; 6],
    /// Coordinates whose motion the platform refuses.
    pub refused: [bool; 6],
}

/// The course of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Rig time until everything asked for was reached, s; `None` if it was not.
    pub seconds: Option<f64>,
    /// Rig time in all, s.
    pub spent_s: f64,
    /// Uncertainty over what is asked for, of the worst parameter, at the end.
    pub worst: f64,
    /// Largest error of a tensor element over the largest principal moment.
    pub error: f64,
    /// Coordinates that counted as lost at the end.
    pub lost: [bool; 6],
    /// The segments done: name, and worst ratio expected and got.
    pub segments: Vec<(String, f64, f64)>,
    /// The largest share of a limit that was taken at any instant, by the body as it is: of the machine, of
    /// the load cell's range, of the gyro's and of the accelerometer's.
    pub taken: f64,
    /// The prediction of what could be reached in the time there is.
    pub promised: Option<Foreseen>,
    /// The result, less that, as a share of it.
    pub off: Option<f64>,
    /// The reason why it ended before, in words.
    pub ended: Option<String>,
    /// The longest that a decision took on this machine, s.
    pub decided_s: f64,
}

/// Rows taken in so far.
struct Device {
    estimator: Box<Estimator<f64, 16, ESTIMATOR_TAPS>>,
    absorbed: usize,
}

impl Device {
    fn new(rehearsal: &Rehearsal) -> Self {
        let rate_hz = rehearsal.believed.rate_hz;
        let config = EstimatorConfig {
            rate_hz,
            filter_width_s: filter_width_s(rate_hz),
            row_every: row_every(rate_hz),
            channel_sigma: rehearsal.believed.channel_sigma,
            known_offset: [0.0; 6],
            mounting: mounting(&rehearsal.config),
            limits: screening::Limits {
                frozen_after: FROZEN_AFTER,
                ..Equipment::from(&rehearsal.config).limits()
            },
        };
        let estimator = Estimator::new(&config).expect("a simulated rig's settings are possible");
        Self { estimator: Box::new(estimator), absorbed: 0 }
    }

    fn observed(&self, model: &RigModel) -> Observed {
        model.observed(&Factor::from(&self.estimator.factor()))
    }
}

impl RigModel {
    /// Makes the model of a simulated rig, its body unknown; `None` if its load cell's axes are no rotation.
    pub fn of_simulated(config: &RigConfig, rate_hz: f64) -> Option<Self> {
        let sensors = &config.sensors;
        Some(Self {
            geometry: config.geometry.clone(),
            load_cell_m: config.load_cell.position_m.into(),
            load_cell_rotation: config.load_cell.rotation()?,
            channel_sigma: sensors.load_cell.noise_n_nm,
            rate_hz,
            rate_range_radps: sensors.imu.gyro_range_radps,
            felt_range_mps2: sensors.imu.accel_range_mps2,
            wrench_range_n_nm: sensors.load_cell.range_n_nm,
            body: None,
            parts: Vec::new(),
            gyro_noise_radps: sensors.imu.gyro_noise_radps.into_iter().fold(0.0, f64::max),
            offset_known: false,
        })
    }
}

impl Rehearsal {
    /// Makes a rig that is as it is believed to be; `None` if its load cell's axes are no rotation.
    pub fn as_believed(config: RigConfig, rate_hz: f64) -> Option<Self> {
        let believed = RigModel::of_simulated(&config, rate_hz)?;
        Some(Self { config, believed, bound: BOUND, stuck: [false; 6], refused: [false; 6] })
    }

    /// Returns what becomes of a program: the moves that do not happen left out.
    fn as_followed(&self, program: &MotionProgram) -> MotionProgram {
        let held = |to: &Pose| {
            let mut to = *to;
            for k in 0..3 {
                if self.stuck[k] {
                    to.position_m[k] = program.start.position_m[k];
                }
                if self.stuck[k + 3] {
                    to.rpy_rad[k] = program.start.rpy_rad[k];
                }
            }
            to
        };
        let segments = program
            .segments
            .iter()
            .map(|segment| match segment {
                Segment::Hold { .. } | Segment::Sphere(_) => segment.clone(),
                Segment::Move { to, duration_s } => Segment::Move { to: held(to), duration_s: *duration_s },
                Segment::Path { via, to, duration_s } => Segment::Path {
                    via: via.iter().map(held).collect(),
                    to: held(to),
                    duration_s: *duration_s,
                },
                Segment::Multisine { duration_s, ramp_s, terms } => Segment::Multisine {
                    duration_s: *duration_s,
                    ramp_s: *ramp_s,
                    terms: terms.iter().filter(|t| !self.stuck[t.axis as usize]).copied().collect(),
                },
            })
            .collect();
        MotionProgram { start: program.start, segments }
    }

    /// Returns whether the platform takes a program.
    fn takes(&self, program: &MotionProgram) -> bool {
        let barred = program.segments.iter().any(|segment| match segment {
            Segment::Multisine { terms, .. } => terms.iter().any(|t| self.refused[t.axis as usize]),
            _ => false,
        });
        !barred && program.trajectory().is_ok_and(|t| self.config.geometry.check(&t).is_ok())
    }

    /// Takes in what `program` adds to what was taken in; the time at which the goal was reached, if it was.
    fn absorb(
        &self,
        device: &mut Device,
        program: &MotionProgram,
        asked: &Asked,
        seed: u64,
    ) -> Result<Option<f64>, RigError> {
        let rate_hz = self.believed.rate_hz;
        let mut config = self.config.clone();
        if self.stuck.contains(&true) {
            // The legs go where the controller that sees nothing wrong takes them: what is asked for was
            // checked.
            config.geometry.leg_length_m = [0.0, f64::INFINITY];
            config.geometry.leg_rate_mps = f64::INFINITY;
            config.geometry.limits = Limits { cond_max: f64::INFINITY, ..Limits::default() };
        }
        let readings = Readings::new(&config, &self.as_followed(program), rate_hz)?;
        let every = ((LOOK_S * rate_hz) as usize).max(1);
        for (k, row) in readings.measured(seed).enumerate().skip(device.absorbed) {
            device.estimator.absorb(&reading(&row));
            device.absorbed = k + 1;
            if k % every == 0 && k > every {
                let observed = device.observed(&self.believed);
                if observed.worst(asked, &self.believed) <= 1.0 {
                    return Ok(Some(k as f64 / rate_hz));
                }
            }
        }
        Ok(None)
    }

    fn outcome(
        &self,
        device: &Device,
        asked: &Asked,
        seconds: Option<f64>,
        segments: Vec<(String, f64, f64)>,
    ) -> Outcome {
        let observed = device.observed(&self.believed);
        let truth = self.config.body.parameters();
        let principal = largest_principal(&truth).unwrap_or(1.0);
        let error = observed.estimate.map_or(f64::INFINITY, |phi| {
            (4..10).map(|j| (phi[j] - truth[j]).abs() / principal).fold(0.0, f64::max)
        });
        Outcome {
            seconds,
            spent_s: device.absorbed as f64 / self.believed.rate_hz,
            worst: observed.worst(asked, &self.believed),
            error,
            lost: [false; 6],
            segments,
            taken: 0.0,
            promised: None,
            off: None,
            ended: None,
            decided_s: 0.0,
        }
    }

    /// Weighs the body, the plate level.
    fn weighed(&self, seed: u64) -> Result<Result<BodySet, CarriedError>, RigError> {
        let home = self.config.geometry.home();
        let still = MotionProgram { start: home, segments: vec![Segment::Hold { duration_s: WEIGHED_S }] };
        let rate_hz = self.believed.rate_hz;
        let readings = Readings::new(&self.config, &still, rate_hz)?;
        let rows: Vec<[f64; 6]> = readings.measured(seed).map(|row| reading(&row).wrench.array()).collect();
        let n = rows.len() as f64;
        let mean: [f64; 6] = std::array::from_fn(|c| rows.iter().map(|w| w[c]).sum::<f64>() / n);
        let square = |c: usize| rows.iter().map(|w| (w[c] - mean[c]).powi(2)).sum::<f64>() / (n - 1.0);
        let up = self.believed.load_cell_rotation.tr_mul(&nalgebra::Vector3::z()).into();
        let weighing = Weighing {
            wrench: mean,
            sigma: std::array::from_fn(|c| square(c).sqrt()),
            readings: rows.len(),
            up,
        };
        let mut file = RigFile::default();
        file.load_cell.range_n_nm = Some(self.believed.wrench_range_n_nm);
        file.recording.gravity_mps2 = self.config.gravity_mps2;
        Ok(weighing.set(&file, &self.bound))
    }

    /// Returns the largest share of any limit that a program takes with the body as it is.
    fn taken(&self, program: &MotionProgram) -> f64 {
        let (Ok(trajectory), Ok(sensors)) = (program.trajectory(), self.config.payload().sensors()) else {
            return f64::INFINITY;
        };
        let cell = &self.believed;
        let body = machine::on_plate(&self.config.body, &cell.load_cell_m, &cell.load_cell_rotation);
        let load = Load::body(body);
        let (ranges, imu) = (&self.config.sensors.load_cell.range_n_nm, &self.config.sensors.imu);
        let steps = (trajectory.duration_s() / HELD_S).ceil() as usize;
        (0..=steps).fold(0.0_f64, |most, k| {
            let state = trajectory.state(k as f64 * HELD_S);
            let machine = 1.0 - self.config.geometry.margins(&state, Some(&load)).tightest().relative;
            let (felt, rate) = sensors.imu(&state);
            let wrench = sensors.wrench(&state).into_iter().zip(ranges).map(|(w, range)| w.abs() / range);
            let felt = felt.into_iter().map(|f| f.abs() / imu.accel_range_mps2);
            let rate = rate.into_iter().map(|r| r.abs() / imu.gyro_range_radps);
            wrench.chain(felt).chain(rate).fold(most.max(machine), f64::max)
        })
    }

    /// Runs a program that was made beforehand, until the goal is reached. `None` if the platform refuses it.
    pub fn fixed(&self, program: &MotionProgram, asked: &Asked, seed: u64) -> Option<Outcome> {
        if !self.takes(program) {
            return None;
        }
        let mut device = Device::new(self);
        let seconds = self.absorb(&mut device, program, asked, seed).ok()?;
        Some(self.outcome(&device, asked, seconds, Vec::new()))
    }

    /// Runs an experiment decided segment by segment, at most for the given time: from zero, as a rig is
    /// started.
    ///
    /// # Errors
    /// The simulated rig cannot be built.
    pub fn adaptive(&self, asked: &Asked, seed: u64, longest_s: f64) -> Result<Outcome, RigError> {
        let mut device = Device::new(self);
        let body = match self.weighed(seed)? {
            Ok(body) => body,
            Err(error) => {
                let outcome = self.outcome(&device, asked, None, Vec::new());
                return Ok(Outcome { ended: Some(error.to_string()), ..outcome });
            }
        };
        let mut planner = Planner::new(RigModel { body: Some(body), ..self.believed.clone() }, *asked);
        let mut whole = MotionProgram { start: self.believed.geometry.home(), segments: Vec::new() };
        let (mut segments, mut taken, mut decided_s) = (Vec::new(), 0.0_f64, 0.0_f64);
        let mut forecast = Forecast::default();
        let (reached, ended) = loop {
            if planner.choices() == 0 {
                break (None, Some("no motion about home keeps the limits".to_owned()));
            }
            let before = device.observed(&self.believed);
            let known = before.known();
            let began = Instant::now();
            let next = planner.next(&known);
            decided_s = decided_s.max(began.elapsed().as_secs_f64());
            // The plate waits for what is made anew.
            let waited_s = MAKING_S * planner.motions_made() as f64;
            if waited_s > 0.0 {
                whole.segments.push(Segment::Hold { duration_s: waited_s });
            }
            let decision = match next {
                Next::Segment(decision) => decision,
                Next::Question(program) => {
                    planner.answered(self.takes(&program));
                    continue;
                }
                Next::Reached => break (None, None),
                Next::Unsafe => {
                    let said = "no motion is known to keep the limits with what may be on the load cell";
                    break (None, Some(said.to_owned()));
                }
                Next::Hopeless(parameter) => {
                    break (None, Some(format!("{parameter} cannot become as certain")));
                }
            };
            if !self.takes(&decision.program) {
                planner.refused(&decision);
                continue;
            }
            let left_s = longest_s - whole.duration_s();
            // As it was said last while a quarter of the time was left.
            if left_s > 0.25 * longest_s && decision.expected_s > left_s {
                let then = decision.information_after(left_s, &known);
                if let Some(foreseen) = asked.foreseen(&planner.goal(&known), &known, &then) {
                    forecast.take(foreseen);
                }
            }
            taken = taken.max(self.taken(&self.as_followed(&decision.program)));
            whole.segments.extend(decision.program.segments.iter().cloned());
            let reached = self.absorb(&mut device, &whole, asked, seed)?;
            let after = device.observed(&self.believed);
            let goal = planner.goal(&after.known());
            let expected = goal.worst(&(before.information + decision.information()), after.variance_scale);
            segments.push((decision.name.clone(), expected, after.worst(asked, &self.believed)));
            if reached.is_some() || whole.duration_s() > longest_s {
                let over = || format!("not reached within {longest_s} s");
                break (reached, reached.is_none().then(over));
            }
            planner.carried_out(&decision, &(after.information - before.information));
        };
        let outcome = self.outcome(&device, asked, reached, segments);
        let observed = device.observed(&self.believed);
        let known = observed.known();
        let promised = forecast.said();
        let off = promised
            .and_then(|said| Some(asked.came_of(said, &planner.goal(&known), &known)? / said.value() - 1.0));
        Ok(Outcome { lost: planner.lost(), taken, promised, off, ended, decided_s, ..outcome })
    }
}

//! The closed loop against a simulated rig that may not be what the planner believes: an axis that does not follow or is
//! refused, tighter limits, other noise.

use hexapod::{Limits, MotionProgram, Pose, Segment};
use rigident_shared::estimator::{Estimator, EstimatorConfig};
use rigident_shared::screening;
use rigident_sim::rig::{Readings, RigConfig, RigError};

use super::goal::{Asked, largest_principal};
use super::information::{Information, RigModel};
use super::planner::{Known, Next, Planner};
use crate::fit::{ESTIMATOR_TAPS, Factor, RowSet, filter_width_s, judge, row_every};
use crate::simulated::{mounting, reading};

/// The factor is looked at this often, s.
const LOOK_S: f64 = 0.25;
/// What a motion that is made between segments takes, s: twice what was measured on two cores.
const MAKING_S: f64 = 0.75;

/// A rig and what is wrong with it.
#[derive(Clone, Debug)]
pub struct Rehearsal {
    /// As it is.
    pub config: RigConfig,
    /// As it is believed to be.
    pub believed: RigModel,
    /// Coordinates that are told to move and do not.
    pub stuck: [bool; 6],
    /// Coordinates whose motion the platform refuses.
    pub refused: [bool; 6],
}

/// How an experiment went.
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
    /// What was done: name, and worst ratio expected and got.
    pub segments: Vec<(String, f64, f64)>,
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
            limits: screening::Limits::none(),
        };
        let estimator = Estimator::new(&config).expect("a simulated rig's settings are possible");
        Self { estimator: Box::new(estimator), absorbed: 0 }
    }

    fn known(&self, model: &RigModel) -> (Information, Option<[f64; 16]>, f64) {
        let factor = self.estimator.factor();
        let solution = factor.solve();
        let determined = solution.determined.iter().filter(|d| **d).count();
        let rows = RowSet {
            rows: u64::from(factor.rows()),
            channels: 6,
            noise_gain: self.estimator.noise_gain(),
            sigma_given: true,
        };
        let scale = judge(&[rows], factor.residual_sum_of_squares(), determined as f64).variance_scale;
        let information = model.of_factor(&Factor::from(&factor));
        (information, (determined == 16).then_some(solution.estimate), scale)
    }
}

impl RigModel {
    /// Of a simulated rig, its body unknown; `None` if its load cell's axes are no rotation.
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
            offset_known: false,
        })
    }
}

impl Rehearsal {
    /// A rig that is what it is believed to be; `None` if its load cell's axes are no rotation.
    pub fn as_believed(config: RigConfig, rate_hz: f64) -> Option<Self> {
        let believed = RigModel::of_simulated(&config, rate_hz)?;
        Some(Self { config, believed, stuck: [false; 6], refused: [false; 6] })
    }

    /// What becomes of a program: the moves that do not happen left out.
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
                Segment::Multisine { duration_s, ramp_s, terms } => Segment::Multisine {
                    duration_s: *duration_s,
                    ramp_s: *ramp_s,
                    terms: terms.iter().filter(|t| !self.stuck[t.axis as usize]).copied().collect(),
                },
            })
            .collect();
        MotionProgram { start: program.start, segments }
    }

    /// Whether the platform takes a program.
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
            // The legs go where the controller that sees nothing wrong takes them: what is asked for was checked.
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
                let (information, estimate, scale) = device.known(&self.believed);
                let goal = asked.goal(estimate.as_ref().map(<[f64; 16]>::as_slice));
                if estimate.is_some() && goal.worst(&information, scale) <= 1.0 {
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
        let (information, estimate, scale) = device.known(&self.believed);
        let truth = self.config.body.parameters();
        let principal = largest_principal(&truth).unwrap_or(1.0);
        let error = estimate.map_or(f64::INFINITY, |phi| {
            (4..10).map(|j| (phi[j] - truth[j]).abs() / principal).fold(0.0, f64::max)
        });
        let goal = asked.goal(estimate.as_ref().map(<[f64; 16]>::as_slice));
        Outcome {
            seconds,
            spent_s: device.absorbed as f64 / self.believed.rate_hz,
            worst: goal.worst(&information, scale),
            error,
            lost: [false; 6],
            segments,
        }
    }

    /// A program that was made beforehand, until the goal is reached. `None` if the platform refuses it.
    pub fn fixed(&self, program: &MotionProgram, asked: &Asked, seed: u64) -> Option<Outcome> {
        if !self.takes(program) {
            return None;
        }
        let mut device = Device::new(self);
        let seconds = self.absorb(&mut device, program, asked, seed).ok()?;
        Some(self.outcome(&device, asked, seconds, Vec::new()))
    }

    /// Decided segment by segment, at most for so long.
    ///
    /// # Errors
    /// The simulated rig cannot be built.
    pub fn adaptive(&self, asked: &Asked, seed: u64, longest_s: f64) -> Result<Outcome, RigError> {
        let mut planner = Planner::new(self.believed.clone(), *asked);
        let mut device = Device::new(self);
        let mut whole = MotionProgram { start: self.believed.geometry.home(), segments: Vec::new() };
        let mut segments = Vec::new();
        loop {
            let (before, estimate, variance_scale) = device.known(&self.believed);
            let estimate = estimate.as_ref().map(<[f64; 16]>::as_slice);
            let known = Known { information: &before, estimate, variance_scale };
            let next = planner.next(&known);
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
                Next::Reached | Next::Hopeless(_) => {
                    let outcome = self.outcome(&device, asked, None, segments);
                    return Ok(Outcome { lost: planner.lost(), ..outcome });
                }
            };
            if !self.takes(&decision.program) {
                planner.refused(&decision);
                continue;
            }
            whole.segments.extend(decision.program.segments.iter().cloned());
            let reached = self.absorb(&mut device, &whole, asked, seed)?;
            let (after, estimate, scale) = device.known(&self.believed);
            let goal = asked.goal(estimate.as_ref().map(<[f64; 16]>::as_slice));
            let expected = goal.worst(&(before + decision.tells()), scale);
            segments.push((decision.name.clone(), expected, goal.worst(&after, scale)));
            if reached.is_some() || whole.duration_s() > longest_s {
                let outcome = self.outcome(&device, asked, reached, segments);
                return Ok(Outcome { lost: planner.lost(), ..outcome });
            }
            planner.carried_out(&decision, &(after - before));
        }
    }
}

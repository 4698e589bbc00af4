//! The quality of the intervals: the same experiment many times over, each with its own noise.
//!
//! Lives here: the experiments and what they are judged by, the bound ([`bound`]). May not live here: the
//! estimator (that is [`rigident_fit`], used as it ships), printing. Before this: `rigident_sim`; after
//! it: the crate `rigident_cli`.

mod banded;
mod bound;
pub mod motions;
mod repeat;
mod tree;
mod tree_bound;
mod tree_experiment;
pub mod two_step;

use std::sync::atomic::AtomicBool;

use hexapod::MotionProgram;
use hexapod::experiment::thesis_program;
use rigident_shared::calibration::Reading;
use rigident_shared::estimator::{self, Estimator, EstimatorConfig};
use rigident_shared::forgetting::ImuNoise;
use rigident_sim::rig::{ReadingRow, Readings, RigConfig, RigError, Truth};
use rigident_sim::sensors::{LoadCellModel, PerExperiment, SensorModels};

use self::repeat::repeat;
pub use bound::{PARAMETERS, bound};
use rigident_fit::{
    Estimate, Factor, FitError, FitOptions, Noise, RowSource, SignalNoise, Silent, filter_width_s, fit,
    outliers, row_every,
};
use rigident_identify::answer::derived::{centre_of_mass, inertia_com};
use rigident_identify::problem::ProblemError;
use rigident_io::rig::{ImuTable, LoadCellClass, LoadCellTable};
use rigident_laboratory::{limits, mounting, reading};
use rigident_rows::body::{BodySource, Input, errors};
pub use tree::{TreeCampaign, TreeJudgement, TreeVerdict};
pub use tree_experiment::TreeExperiment;

/// Largest filter of the firmware's estimator on this side: 0.1 s at 2.5 kHz.
const FIRMWARE_TAPS: usize = 256;
/// Row blocks between two checks of its factor by the firmware.
const LOOK_EVERY_BLOCKS: u16 = 50;
/// Of the firmware's readings.
const FIRMWARE_FASTEST_HZ: f64 = 2500.0;
/// Readings of one experiment: some GB with the motion's physics and a copy on every core.
const MOST_READINGS: f64 = 1e6;
/// 1 σ of a 95 % figure.
pub const K95: f64 = 1.96;

/// The maker of the factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solver {
    /// The batch pipeline in double precision.
    Host,
    /// The firmware's estimator in single precision, and its own conclusions.
    Firmware,
}

/// The experiment that is repeated.
#[derive(Clone, Debug)]
pub struct Campaign {
    /// The rig; what its sensors draw is stated to the estimator as σ.
    pub config: RigConfig,
    /// The motion of the platform; the default experiment of `duration_s`, if none is given.
    pub program: Option<MotionProgram>,
    /// Length of the default experiment, s.
    pub duration_s: f64,
    /// Rate of the readings, 1/s.
    pub rate_hz: f64,
    /// The estimator.
    pub solver: Solver,
    /// True if the estimator is given the gain errors; false only to show the cost of leaving them out.
    pub state_gain_errors: bool,
    /// States the white noise of load cell and IMU to the estimator; else it finds it in the readings.
    pub state_noise: bool,
}

/// Returns Table 1's 95 % figures of the load cell as gain errors: 1 σ, as a share of the range, of errors
/// that are constant over an experiment and drawn for each anew.
fn table_1_as_gain_error() -> PerExperiment<6> {
    let thesis = SensorModels::thesis().load_cell;
    let figure = thesis.noise_n_nm.map(|sigma| sigma * K95);
    PerExperiment::spread(std::array::from_fn(|c| figure[c] / thesis.range_n_nm[c] / K95))
}

/// Returns the load cell of the thesis with Table 1's figure as a gain error; its resolution/√12 is the white
/// noise. The IMU is perfect: at so little noise its own would be the larger part of every residual, and the
/// question is the effect of gains.
pub fn gain_error_sensors() -> SensorModels {
    let thesis = SensorModels::thesis().load_cell;
    let mut sensors = SensorModels::ideal();
    sensors.load_cell = LoadCellModel {
        noise_n_nm: thesis.resolution_n_nm.map(|step| step / 12_f64.sqrt()),
        gain_error: table_1_as_gain_error(),
        resolution_n_nm: [0.0; 6],
        ..thesis
    };
    sensors
}

/// Returns the thesis' sensors, IMU and all, with Table 1's figure as white noise and once more as a gain
/// error.
pub fn noise_and_gain_error_sensors() -> SensorModels {
    let mut sensors = SensorModels::thesis();
    sensors.load_cell.gain_error = table_1_as_gain_error();
    sensors
}

/// Why there is nothing to judge.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// The rig cannot make the experiment.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// An experiment could not be identified.
    #[error("the experiment of seed {seed}: {error}")]
    Identification {
        /// The experiment.
        seed: u64,
        /// Why.
        error: FitError,
    },
    /// The firmware's filter does not have this many taps.
    #[error(
        "{0} Hz: the firmware's filter has room for {FIRMWARE_FASTEST_HZ} Hz; take a lower rate, or the host"
    )]
    TooFast(f64),
    /// More readings than fit into memory.
    #[error(
        "{rate_hz} Hz for {duration_s} s: an experiment of a campaign has {MOST_READINGS} readings at most; \
         take a lower rate or a shorter time"
    )]
    TooMany {
        /// Rate of the readings, 1/s.
        rate_hz: f64,
        /// Length of the experiment, s.
        duration_s: f64,
    },
    /// The motion leaves a parameter undetermined.
    #[error("the motion determines not all of the parameters: there is no bound to compare with")]
    Undetermined,
    /// A joint that the simulated motion does not know.
    #[error("joint {0}: the simulated motion moves revolute and spherical joints only; `lock` it")]
    Joint(String),
    /// A link without a body of its own in the model file.
    #[error("link {0} has no mass and inertia in the model: there is nothing to simulate")]
    NoBody(String),
    /// A recording of a tree that poses no problem.
    #[error("the experiment of seed {seed}: {error}")]
    Tree {
        /// The experiment.
        seed: u64,
        /// Why.
        error: Box<ProblemError>,
    },
    /// Fewer than two experiments.
    #[error("{0} experiments are done: a spread needs two")]
    TooFew(u64),
}

/// One parameter over all experiments, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judgement {
    /// True value; of an offset, which each experiment draws, zero.
    pub truth: f64,
    /// Mean of estimate less truth.
    pub bias: f64,
    /// Standard deviation of estimate less truth.
    pub std: f64,
    /// Cramér–Rao bound of the standard deviation.
    pub crb_std: f64,
    /// The value by the estimates themselves: root mean square.
    pub predicted_std: f64,
    /// Share of the 95 % intervals that hold the truth.
    pub coverage95: f64,
}

/// One estimate of one parameter.
#[derive(Clone, Copy, Debug)]
struct One {
    error: f64,
    sd: f64,
    coverage_factor: f64,
}

impl Judgement {
    /// Returns the judgement of two estimates or more.
    fn of(truth: f64, crb_std: f64, estimates: impl Iterator<Item = One>) -> Self {
        let all: Vec<One> = estimates.collect();
        let n = all.len() as f64;
        let mean = |f: &dyn Fn(&One) -> f64| all.iter().map(f).sum::<f64>() / n;
        let bias = mean(&|o| o.error);
        let variance = mean(&|o| (o.error - bias).powi(2)) * n / (n - 1.0);
        Self {
            truth,
            bias,
            std: variance.sqrt(),
            crb_std,
            predicted_std: mean(&|o| o.sd * o.sd).sqrt(),
            coverage95: mean(&|o| f64::from(u8::from(o.error.abs() <= o.coverage_factor * o.sd))),
        }
    }

    /// Returns bound over spread: 1 is as good as any unbiased estimator can be.
    pub fn efficiency(&self) -> f64 {
        self.crb_std / self.std
    }
}

/// The limits that an estimator must meet over `runs` experiments to be called calibrated and efficient.
///
/// The figures asked for are those of 2 000 experiments; there a calibrated interval misses 93–97 % once in
/// 20 000 times. With fewer the chance of the draw is allowed for, by as many standard errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits95 {
    /// Least efficiency.
    pub efficiency: f64,
    /// Least and largest coverage.
    pub coverage: (f64, f64),
}

impl Limits95 {
    /// With this many experiments and more the limits are as promised; with fewer they are wider, by the
    /// standard errors.
    pub const ASKED: u64 = 2000;

    /// Returns the limits for this many experiments.
    pub fn of(runs: u64) -> Self {
        const ASKED: f64 = Limits95::ASKED as f64;
        let shortage = (ASKED / (runs as f64).clamp(1.0, ASKED)).sqrt();
        let errors = 0.02 / (0.95 * 0.05 / ASKED).sqrt();
        let margin = errors / (2.0 * ASKED).sqrt() * (shortage - 1.0);
        Self {
            efficiency: 0.9 - margin,
            coverage: (0.95 - 0.02 * shortage, (0.95 + 0.02 * shortage).min(1.0)),
        }
    }

    /// Returns whether a parameter keeps to them.
    pub fn kept_by(&self, judgement: &Judgement) -> bool {
        let (least, largest) = self.coverage;
        judgement.efficiency() >= self.efficiency && (least..=largest).contains(&judgement.coverage95)
    }
}

/// The verdict of the experiments.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Experiments done.
    pub runs: u64,
    /// In the order of the parameters, offsets last.
    pub parameters: [Judgement; PARAMETERS],
    /// Centre of mass in S, m, and inertia tensor about it, `[Ixx, Iyy, Izz, Iyz, Izx, Ixy]`, kg m².
    pub derived: [Judgement; DERIVED],
}

/// Coordinates of the centre of mass, elements of the tensor about it.
pub const DERIVED: usize = 9;

/// Returns what is derived, to first order, and its standard deviations.
fn derived(estimate: &Estimate) -> ([f64; DERIVED], [f64; DERIVED]) {
    let (com, inertia) = (centre_of_mass(estimate), inertia_com(estimate));
    let joined = |com: [f64; 3], inertia: [f64; 6]| {
        let [x, y, z] = com;
        let [xx, yy, zz, yz, zx, xy] = inertia;
        [x, y, z, xx, yy, zz, yz, zx, xy]
    };
    (joined(com.value, inertia.value), joined(com.sd, inertia.sd))
}

/// Parameters, then what is derived from them.
const QUANTITIES: usize = PARAMETERS + DERIVED;

fn joined(parameters: impl IntoIterator<Item = f64>, derived: [f64; DERIVED]) -> [f64; QUANTITIES] {
    let mut all = [0.0; QUANTITIES];
    all.iter_mut().zip(parameters.into_iter().chain(derived)).for_each(|(to, value)| *to = value);
    all
}

/// Error of each quantity, and the standard deviation that the estimate gave it.
#[derive(Clone, Copy, Debug)]
struct Outcome {
    error: [f64; QUANTITIES],
    sd: [f64; QUANTITIES],
    coverage_factor: f64,
}

/// A campaign ready to run: the motion's physics is computed once.
#[derive(Clone, Debug)]
pub struct Prepared {
    campaign: Campaign,
    readings: Readings,
    crb_std: [f64; QUANTITIES],
}

impl Campaign {
    /// Returns the default experiment on this rig, 20 s at 200 Hz, by the host's pipeline.
    pub fn new(config: RigConfig) -> Self {
        Self {
            config,
            program: None,
            duration_s: 20.0,
            rate_hz: 200.0,
            solver: Solver::Host,
            state_gain_errors: true,
            state_noise: true,
        }
    }

    /// Computes motion, wrenches and bound.
    ///
    /// # Errors
    /// An experiment that the rig cannot make, or that leaves a parameter undetermined.
    pub fn prepare(self) -> Result<Prepared, CampaignError> {
        if self.solver == Solver::Firmware && self.rate_hz > FIRMWARE_FASTEST_HZ {
            return Err(CampaignError::TooFast(self.rate_hz));
        }
        let rate_hz = self.rate_hz;
        let duration_s = self.program.as_ref().map_or(self.duration_s, MotionProgram::duration_s);
        if rate_hz * duration_s > MOST_READINGS {
            return Err(CampaignError::TooMany { rate_hz, duration_s });
        }
        let default = || thesis_program(&self.config.geometry, self.duration_s);
        let program = self.program.clone().unwrap_or_else(default);
        let readings = Readings::new(&self.config, &program, self.rate_hz)?;
        let bound = bound(&self.config, &program, self.rate_hz)?.ok_or(CampaignError::Undetermined)?;
        let own: [f64; PARAMETERS] = std::array::from_fn(|j| bound[(j, j)].sqrt());
        let body = self.config.body.parameters().into_iter().chain([0.0; 6]).collect();
        let (_, of_derived) = derived(&Estimate::of_bound(body, bound));
        Ok(Prepared { campaign: self, readings, crb_std: joined(own, of_derived) })
    }
}

impl Prepared {
    /// Returns the Cramér–Rao bound, 1 σ.
    pub fn crb_std(&self) -> [f64; PARAMETERS] {
        std::array::from_fn(|j| self.crb_std[j])
    }

    /// Runs `runs` experiments on every core. Their seeds follow from `seed` alone, and so do the figures,
    /// whatever the number of cores. `done` receives how many are done; `stop` ends early with what there is.
    ///
    /// # Errors
    /// An experiment that cannot be identified, or fewer than two of them.
    pub fn run(
        &self,
        runs: u64,
        seed: u64,
        stop: &AtomicBool,
        mut done: impl FnMut(u64),
    ) -> Result<Verdict, CampaignError> {
        let outcomes = repeat(runs, seed, stop, &mut done, |seed| self.experiment(seed))
            .map_err(|(seed, error)| CampaignError::Identification { seed, error })?;
        self.judge(&outcomes)
    }

    fn judge(&self, outcomes: &[Outcome]) -> Result<Verdict, CampaignError> {
        let runs = outcomes.len() as u64;
        if runs < 2 {
            return Err(CampaignError::TooFew(runs));
        }
        let truth =
            joined(self.campaign.config.body.parameters().into_iter().chain([0.0; 6]), self.true_derived());
        let judgement = |j: usize| {
            let of = |o: &Outcome| One { error: o.error[j], sd: o.sd[j], coverage_factor: o.coverage_factor };
            Judgement::of(truth[j], self.crb_std[j], outcomes.iter().map(of))
        };
        Ok(Verdict {
            runs,
            parameters: std::array::from_fn(judgement),
            derived: std::array::from_fn(|j| judgement(PARAMETERS + j)),
        })
    }

    /// Returns the recording of a seed, and what its ten parameters and six offsets are.
    pub fn recording(&self, seed: u64) -> (BodySource, [f64; PARAMETERS]) {
        let readings = self.readings.measured(seed).map(|row| reading(&row)).collect();
        (self.source(readings), true_parameters(&self.readings.truth(seed)))
    }

    fn experiment(&self, seed: u64) -> Result<Outcome, FitError> {
        let rows: Vec<ReadingRow> = self.readings.measured(seed).collect();
        let source = self.source(rows.iter().map(reading).collect());
        let estimate = match self.campaign.solver {
            Solver::Firmware if !self.has_gain_errors() => self.by_firmware(&rows, &source)?,
            // Gain errors are no parameters of the device's: a run with them is concluded by the host's fit.
            Solver::Host | Solver::Firmware => fit(&source, &FitOptions::default(), &Silent)?.estimate,
        };
        let truth = true_parameters(&self.readings.truth(seed));
        let (values, of_derived) = derived(&estimate);
        let (values, truth) =
            (joined(estimate.unjudged().values.iter().copied(), values), joined(truth, self.true_derived()));
        let own: [f64; PARAMETERS] =
            std::array::from_fn(|j| estimate.unjudged().covariance[(j, j)].max(0.0).sqrt());
        Ok(Outcome {
            error: std::array::from_fn(|j| values[j] - truth[j]),
            sd: joined(own, of_derived),
            coverage_factor: estimate.coverage_factor(),
        })
    }

    fn true_derived(&self) -> [f64; DERIVED] {
        let body = &self.campaign.config.body;
        let [x, y, z] = body.com_m;
        let [xx, yy, zz, yz, zx, xy] = body.inertia_com_kgm2;
        [x, y, z, xx, yy, zz, yz, zx, xy]
    }

    fn has_gain_errors(&self) -> bool {
        let gains = &self.campaign.config.sensors.load_cell.gain_error.spread;
        self.campaign.state_gain_errors && gains.iter().any(|spread| *spread > 0.0)
    }

    /// Returns the device's own estimate, with checks of the factor and the noise of the IMU as on the
    /// device.
    fn by_firmware(&self, rows: &[ReadingRow], source: &BodySource) -> Result<Estimate, FitError> {
        let campaign = &self.campaign;
        let settings = EstimatorConfig {
            rate_hz: campaign.rate_hz as f32,
            filter_width_s: filter_width_s(campaign.rate_hz) as f32,
            row_every: row_every(campaign.rate_hz),
            channel_sigma: campaign.config.sensors.load_cell.noise_n_nm.map(|s| s as f32),
            known_offset: [0.0; 6],
            mounting: mounting(&campaign.config),
            limits: limits(&campaign.config),
        };
        let made = Estimator::<f32, PARAMETERS, FIRMWARE_TAPS>::new(&settings);
        let mut estimator = Box::new(made.map_err(|error| source.refuse(error))?);
        let noise: Vec<f64> = source.signal_noise().iter().map(SignalNoise::size).collect();
        if let [accel, gyro] = noise[..] {
            let noise = ImuNoise { accel: accel as f32, gyro: gyro as f32 };
            estimator.set_imu_noise(&noise).map_err(|error| source.refuse(error))?;
        }
        let mut until_look = LOOK_EVERY_BLOCKS;
        for row in rows {
            match estimator.absorb(&reading(row)) {
                estimator::Outcome::Absorbed => until_look = until_look.saturating_sub(1),
                estimator::Outcome::Pending if until_look == 0 => {
                    if estimator.look(outliers::LIMIT_SD as f32).is_some() {
                        until_look = LOOK_EVERY_BLOCKS;
                    }
                }
                estimator::Outcome::Pending | estimator::Outcome::Rejected(_) => {}
            }
        }
        estimator.take_snapshot();
        while !estimator.fold() {}
        while !estimator.compensate() {}
        let factor = Factor::from(&estimator.folded().cast(f64::from));
        Ok(Estimate::new(&factor, f64::from(f32::EPSILON) * PARAMETERS as f64, 1.0, Noise::Given))
    }

    /// Returns the source of readings, settings and noise as a rig file of this rig would state them.
    fn source(&self, readings: Vec<Reading<f64>>) -> BodySource {
        let config = &self.campaign.config;
        let (cell, imu) = (&config.sensors.load_cell, &config.sensors.imu);
        let largest = |sigma: [f64; 3]| sigma.iter().copied().fold(0.0, f64::max);
        let is_stated = self.campaign.state_noise;
        let stated = |sigma: [f64; 3]| Some(largest(sigma)).filter(|_| is_stated);
        let table = ImuTable {
            accel_noise_mps2: stated(imu.accel_noise_mps2),
            gyro_noise_radps: stated(imu.gyro_noise_radps),
            ..ImuTable::default()
        };
        let cell_table = LoadCellTable {
            class: Some(LoadCellClass::Exact),
            gain_uncertainty: Some(cell.gain_error.spread).filter(|_| self.campaign.state_gain_errors),
            ..LoadCellTable::default()
        };
        let input = Input {
            is_static: false,
            rate_hz: self.campaign.rate_hz,
            mounting: mounting(config),
            channel_sigma: Some(cell.noise_n_nm).filter(|_| is_stated),
            gyro_sigma: stated(imu.gyro_noise_radps),
            known_offset: None,
            nuisances: errors::of_cell(&cell_table, readings.iter().map(|reading| reading.wrench.array())),
            rests: Vec::new(),
            beforehand: None,
            readings,
            limits: limits(config),
        };
        BodySource::new(input, Some(&table))
    }
}

/// Returns the body in S, and the offsets that an estimator finds which believes the accelerometer's zero:
/// the wrench that its bias adds is read with the load cell's gain.
fn true_parameters(truth: &Truth) -> [f64; PARAMETERS] {
    let phi = truth.body.parameters();
    let (offset, apparent) = (truth.experiment.load_cell_offset_n_nm, truth.apparent_offset_n_nm);
    let gain = truth.experiment.load_cell_gain_error;
    std::array::from_fn(|j| match j {
        0..10 => phi[j],
        _ => offset[j - 10] + (1.0 + gain[j - 10]) * (apparent[j - 10] - offset[j - 10]),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(seed: u64) -> Verdict {
        let prepared = Campaign::new(RigConfig::thesis_horizontal()).prepare().unwrap();
        prepared.run(6, seed, &AtomicBool::new(false), |_| ()).unwrap()
    }

    /// Workers finish in another order each time; the sums may not notice.
    #[test]
    fn the_same_seed_gives_the_same_bits_and_another_seed_others() {
        assert_eq!(run(3), run(3));
        assert_ne!(run(3), run(4));
    }

    #[test]
    fn a_campaign_that_is_stopped_at_once_says_so() {
        let prepared = Campaign::new(RigConfig::thesis_horizontal()).prepare().unwrap();
        let stopped = prepared.run(6, 1, &AtomicBool::new(true), |_| ());
        assert!(matches!(stopped, Err(CampaignError::TooFew(0))), "{stopped:?}");
    }

    #[test]
    fn limits_are_those_asked_for_at_two_thousand_runs_and_allow_for_chance_below() {
        let asked = Limits95::of(2000);
        assert_eq!((asked.efficiency, asked.coverage), (0.9, (0.95 - 0.02, 0.95 + 0.02)));
        assert_eq!(Limits95::of(100_000), asked);
        let few = Limits95::of(125);
        // A quarter of the standard errors' denominator: four times the width.
        assert!((few.coverage.0 - 0.87).abs() < 1e-12 && few.coverage.1 == 1.0);
        assert!(few.efficiency < 0.8 && few.efficiency > 0.6, "{few:?}");
    }

    #[test]
    fn table_1_as_gain_errors_is_a_per_cent_and_a_half_or_less() {
        let cell = gain_error_sensors().load_cell;
        let want = [0.015, 0.015, 0.010, 0.0125, 0.015, 0.015].map(|share| share / K95);
        for (got, want) in cell.gain_error.spread.iter().zip(want) {
            assert!((got - want).abs() < 1e-12, "{got} {want}");
        }
    }
}

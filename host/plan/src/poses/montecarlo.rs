//! The thesis' section 6.3: the static experiment many times over, with the simulator's own physics and
//! sensors.
//!
//! Each run draws the load cell's bias once and its noise for every reading; both can be tried by themselves.
//! The platform's attitude is exact, one reading is taken in each pose. The estimators of
//! [`super::estimators`] see the same readings; those that need a reference get one more, in the level pose.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use hexapod::Coordinates;
use hexapod::{BodyParameters, FrameMotion};
use nalgebra::{Matrix3, Vector3};
use rigident_sim::sensors::{LoadCellChain, PerExperiment, SensorModels};

use super::estimators::{
    StillReading, centre_of_mass, measured_forces_covariance, modelled, modelled_covariance,
    relative_covariance, relative_to, with_measured_forces,
};
use super::measure::roll_pitch;

/// 1 σ of the mass where it is weighed, kg.
pub const WEIGHED_TO_KG: f64 = 0.005;
/// m/s².
const GRAVITY_MPS2: f64 = 9.80665;

/// The mounting of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mounting {
    /// Standing: centre of mass at 247 mm.
    Vertical,
    /// Lying: centre of mass at 53 mm.
    Horizontal,
}

impl Mounting {
    /// Both, in the thesis' order.
    pub const ALL: [Self; 2] = [Self::Vertical, Self::Horizontal];

    /// Returns the mounting's name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Vertical => "vertical",
            Self::Horizontal => "horizontal",
        }
    }

    /// Returns the thesis' test body with its plates.
    pub fn body(self) -> BodyParameters {
        match self {
            Self::Vertical => BodyParameters::thesis_vertical(),
            Self::Horizontal => BodyParameters::thesis_horizontal(),
        }
    }
}

/// The errors of the load cell that act.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Errors {
    /// Noise, another for each reading.
    Precision,
    /// An offset, the same for all readings of an experiment.
    Bias,
    /// Both.
    Both,
}

impl Errors {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Precision, Self::Bias, Self::Both];

    /// Returns the errors' name in the JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Precision => "precision",
            Self::Bias => "bias",
            Self::Both => "both",
        }
    }

    /// Returns the thesis' sensors with these errors alone. Precision is Table 1's figure / 1.96; the spread
    /// of the offsets is not printed, and assumed to be as large.
    pub fn sensors(self) -> SensorModels {
        let mut sensors = SensorModels::thesis();
        let cell = &mut sensors.load_cell;
        match self {
            Self::Precision => cell.offset_n_nm = PerExperiment::ZERO,
            Self::Bias => cell.noise_n_nm = [0.0; 6],
            Self::Both => {}
        }
        sensors
    }
}

/// The estimator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Estimator {
    /// Measured forces in the regressor: the thesis.
    MeasuredForces,
    /// Relative to the level pose: the thesis' remedy for offsets.
    Relative,
    /// Modelled forces, offsets as parameters.
    Modelled,
    /// Modelled forces, offsets as parameters, with the mass weighed beforehand.
    ModelledWeighed,
}

impl Estimator {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::MeasuredForces, Self::Relative, Self::Modelled, Self::ModelledWeighed];

    /// Returns the estimator's name in the JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::MeasuredForces => "measured_forces",
            Self::Relative => "relative",
            Self::Modelled => "modelled",
            Self::ModelledWeighed => "modelled_weighed",
        }
    }
}

/// One static experiment that can be repeated.
#[derive(Clone, Debug)]
pub struct Experiment {
    body: BodyParameters,
    sensors: SensorModels,
    /// The statements about the load cell to estimators that ask.
    sigma: [f64; 6],
    /// The level pose first.
    truth: Vec<StillReading>,
}

/// Error of the estimated centre of mass over all runs, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Mean.
    pub bias: Vector3<f64>,
    /// Standard deviation.
    pub sd: Vector3<f64>,
    /// The value of it by a first-order calculation.
    pub predicted_sd: Vector3<f64>,
}

impl Experiment {
    /// Makes an experiment of still poses with "up" there in the plate's axes, which are the load cell's.
    pub fn new(mounting: Mounting, errors: Errors, ups: &[Vector3<f64>]) -> Self {
        let body = mounting.body();
        let gravity = Vector3::new(0.0, 0.0, -GRAVITY_MPS2);
        let reading = |up: &Vector3<f64>| {
            let [roll, pitch] = roll_pitch(up);
            let value = [0.0, 0.0, 0.0, roll, pitch, 0.0];
            let motion =
                FrameMotion::of_plate(&Coordinates { value, ..Coordinates::default() }.plate_state());
            let [fx, fy, fz, mx, my, mz] = body.wrench(&motion, &gravity);
            StillReading {
                specific_force: motion.specific_force(&gravity),
                force: Vector3::new(fx, fy, fz),
                moment: Vector3::new(mx, my, mz),
            }
        };
        let truth = std::iter::once(&Vector3::z()).chain(ups).map(reading).collect();
        Self { body, sensors: errors.sensors(), sigma: SensorModels::thesis().load_cell.noise_n_nm, truth }
    }

    /// Returns the errors of the centre of mass by each estimator, m; `None` where the poses leave it open.
    pub fn run(&self, seed: u64) -> [Option<Vector3<f64>>; 4] {
        let mut chain = LoadCellChain::new(&self.sensors, &self.sensors.draw(seed), seed);
        let readings: Vec<StillReading> = self
            .truth
            .iter()
            .enumerate()
            .map(|(k, truth)| {
                let (f, m) = (truth.force, truth.moment);
                let wrench = chain.read(k as f64, [f.x, f.y, f.z, m.x, m.y, m.z]);
                let [fx, fy, fz, mx, my, mz] = self.sensors.load_cell.digitise(wrench);
                StillReading { force: Vector3::new(fx, fy, fz), moment: Vector3::new(mx, my, mz), ..*truth }
            })
            .collect();
        let Some((level, others)) = readings.split_first() else { return [None; 4] };
        let truth = Vector3::from(self.body.com_m);
        Estimator::ALL.map(|estimator| {
            let found = match estimator {
                Estimator::MeasuredForces => with_measured_forces(others),
                Estimator::Relative => relative_to(level, others),
                Estimator::Modelled => centre_of_mass(&modelled(&readings, &self.sigma, None)),
                Estimator::ModelledWeighed => {
                    centre_of_mass(&modelled(&readings, &self.sigma, self.weighed()))
                }
            };
            found.map(|c| c - truth)
        })
    }

    fn weighed(&self) -> Option<(f64, f64)> {
        Some((self.body.mass_kg, WEIGHED_TO_KG))
    }

    /// Returns the first-order covariance of an estimator, m².
    pub fn predicted(&self, estimator: Estimator) -> Option<Matrix3<f64>> {
        let (level, others) = self.truth.split_first()?;
        let forces: Vec<_> = others.iter().map(|t| t.force).collect();
        let r = Vector3::from(self.body.com_m);
        let cell = &self.sensors.load_cell;
        let noise = &cell.noise_n_nm;
        let modelled = |weighed| {
            let covariance =
                modelled_covariance(&modelled(&self.truth, &self.sigma, weighed), self.body.mass_kg, &r)?;
            // Without noise the offsets are found exactly.
            Some(if noise.iter().all(|s| *s == 0.0) { Matrix3::zeros() } else { covariance })
        };
        match estimator {
            Estimator::MeasuredForces => {
                measured_forces_covariance(&forces, &r, noise, &cell.offset_n_nm.spread)
            }
            Estimator::Relative => relative_covariance(&forces, &level.force, &r, noise),
            Estimator::Modelled => modelled(None),
            Estimator::ModelledWeighed => modelled(self.weighed()),
        }
    }

    /// Returns the errors of one estimator in all runs, m.
    pub fn errors(&self, estimator: Estimator, runs: u64, seed: u64) -> Vec<Vector3<f64>> {
        let which = Estimator::ALL.iter().position(|e| *e == estimator).unwrap_or(0);
        (0..runs).filter_map(|run| self.run(run_seed(seed, run)).get(which).copied().flatten()).collect()
    }

    /// Returns the mean and spread of all estimators.
    pub fn spreads(&self, runs: u64, seed: u64) -> [Option<Spread>; 4] {
        let mut sums = [(0.0, Vector3::zeros(), Vector3::zeros()); 4];
        for run in 0..runs {
            for (sum, error) in sums.iter_mut().zip(self.run(run_seed(seed, run))) {
                let Some(error) = error else { continue };
                sum.0 += 1.0;
                sum.1 += error;
                sum.2 += error.component_mul(&error);
            }
        }
        std::array::from_fn(|k| {
            let (count, sum, squares) = sums[k];
            let predicted = self.predicted(Estimator::ALL[k])?;
            let bias = sum / count;
            let variance = (squares / count - bias.component_mul(&bias)) * (count / (count - 1.0));
            (count >= 2.0).then(|| Spread {
                bias,
                sd: variance.map(|v| v.max(0.0).sqrt()),
                predicted_sd: predicted.diagonal().map(f64::sqrt),
            })
        })
    }
}

/// Campaigns of different seeds share no run below 2³² of them.
fn run_seed(seed: u64, run: u64) -> u64 {
    (seed << 32).wrapping_add(run)
}

/// One cell of the section's figures.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Number of orientations, the level pose not counted.
    pub n: usize,
    /// The mounting.
    pub mounting: Mounting,
    /// The errors.
    pub errors: Errors,
    /// The spreads in the order of [`Estimator::ALL`].
    pub spreads: [Option<Spread>; 4],
}

/// Runs the whole section: every set of orientations in both mountings with each kind of errors, on all
/// cores. The figures follow from `seed` alone. `done` receives the number of cells that are done, and of
/// all; `stop` ends early with what there is, in order.
pub fn section_6_3(
    sets: &[Vec<Vector3<f64>>],
    runs: u64,
    seed: u64,
    stop: &AtomicBool,
    done: impl Fn(usize, usize) + Sync,
) -> Vec<Row> {
    let cells: Vec<(usize, Mounting, Errors)> = (0..sets.len())
        .flat_map(|set| Mounting::ALL.map(|mounting| (set, mounting)))
        .flat_map(|(set, mounting)| Errors::ALL.map(|errors| (set, mounting, errors)))
        .collect();
    let next = Mutex::new(cells.iter().enumerate());
    let rows = Mutex::new(Vec::with_capacity(cells.len()));
    // A thread that panicked holding a lock leaves complete data behind.
    let unpoisoned = std::sync::PoisonError::into_inner;
    let work = || {
        while !stop.load(Ordering::Relaxed) {
            let cell = next.lock().unwrap_or_else(|e| e.into_inner()).next();
            let Some((place, (set, mounting, errors))) = cell else { return };
            let Some(ups) = sets.get(*set) else { return };
            let spreads = Experiment::new(*mounting, *errors, ups).spreads(runs, seed);
            let mut rows = rows.lock().unwrap_or_else(|e| e.into_inner());
            rows.push((place, Row { n: ups.len(), mounting: *mounting, errors: *errors, spreads }));
            done(rows.len(), cells.len());
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(work);
        }
    });
    let mut rows = rows.into_inner().unwrap_or_else(unpoisoned);
    rows.sort_by_key(|(place, _)| *place);
    rows.into_iter().map(|(_, row)| row).collect()
}

/// Returns the share by which the largest of the three uncertainties is smaller lying than standing, of 1.
pub fn reduction(vertical: &Spread, horizontal: &Spread) -> f64 {
    1.0 - horizontal.sd.max() / vertical.sd.max()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::poses::region::Region;
    use crate::poses::{Objective, Search};

    const RUNS: u64 = 2500;

    fn cone(n: usize, tilt_deg: f64) -> Vec<Vector3<f64>> {
        let tilt = tilt_deg.to_radians();
        (0..n)
            .map(|k| {
                let (s, c) = (std::f64::consts::TAU * k as f64 / n as f64).sin_cos();
                Vector3::new(tilt.sin() * c, tilt.sin() * s, tilt.cos())
            })
            .collect()
    }

    /// The spread of 2 500 runs has a standard error of 1.4 %; four of them. What the first order leaves out
    /// is of the order of (5 N / 196 N)², and the steps of the resolution add 0.02 % to the noise.
    #[test]
    fn the_spread_is_that_of_the_first_order_prediction() {
        for mounting in Mounting::ALL {
            for errors in [Errors::Precision, Errors::Both] {
                for n in [3, 5] {
                    let spreads = Experiment::new(mounting, errors, &cone(n, 54.7)).spreads(RUNS, 3);
                    for (estimator, spread) in Estimator::ALL.into_iter().zip(spreads) {
                        let Spread { sd, predicted_sd, bias } = spread.unwrap();
                        for axis in 0..3 {
                            let ratio = sd[axis] / predicted_sd[axis];
                            assert!(
                                (ratio - 1.0).abs() < 0.06,
                                "{mounting:?} {errors:?} {n} {estimator:?}: {ratio}"
                            );
                        }
                        if estimator == Estimator::ModelledWeighed {
                            // Linear and unbiased.
                            assert!((bias.component_div(&sd)).amax() < 4.5 / (RUNS as f64).sqrt());
                        }
                    }
                }
            }
        }
    }

    /// Figures computed independently for orientations on a cone of 54.7° (3 σ, mm, 1 200 runs: standard
    /// error 2 %, printed to 0.1 mm).
    #[test]
    fn the_thesis_estimator_spreads_as_computed_independently() {
        let published: [(Mounting, usize, [f64; 3]); 4] = [
            (Mounting::Vertical, 3, [10.7, 10.5, 13.6]),
            (Mounting::Vertical, 5, [8.3, 8.0, 10.9]),
            (Mounting::Horizontal, 3, [5.4, 5.1, 5.4]),
            (Mounting::Horizontal, 5, [4.3, 3.9, 4.0]),
        ];
        for (mounting, n, want) in published {
            let spreads = Experiment::new(mounting, Errors::Precision, &cone(n, 54.7)).spreads(RUNS, 5);
            let got = spreads[0].unwrap().sd * 3e3;
            for axis in 0..3 {
                // Four standard errors of the difference of two Monte Carlos, and the last digit.
                let margin = 4.0 * 0.025 * want[axis] + 0.05;
                assert!((got[axis] - want[axis]).abs() < margin, "{mounting:?} {n}: {got:?} {want:?}");
            }
        }
    }

    /// `σ² ∝ σ_M² + r² σ_F²` with 54.7° and Table 1 gives a reduction near 62 %, and 1 − 53/247 without noise
    /// of the moments.
    #[test]
    fn the_reduction_is_that_of_the_levers_and_not_73_per_cent() {
        let ups = cone(5, 54.7);
        let of = |mounting| Experiment::new(mounting, Errors::Precision, &ups).spreads(RUNS, 7)[0].unwrap();
        let (vertical, horizontal) = (of(Mounting::Vertical), of(Mounting::Horizontal));
        let got = reduction(&vertical, &horizontal);
        assert!((0.58..0.66).contains(&got), "{got}");
        let spread = |r: f64, moment: f64| {
            let forces: Vec<_> = ups.iter().map(|u| u * 20.0 * 9.80665).collect();
            let [fx, fy, fz, mx, my, mz] = SensorModels::thesis().load_cell.noise_n_nm;
            let noise = [fx, fy, fz, moment * mx, moment * my, moment * mz];
            let c =
                measured_forces_covariance(&forces, &Vector3::new(0.0, 0.0, r), &noise, &[0.0; 6]).unwrap();
            c.diagonal().max().sqrt()
        };
        assert!((1.0 - spread(0.053, 1.0) / spread(0.247, 1.0) - got).abs() < 0.03);
        assert!((1.0 - spread(0.053, 0.0) / spread(0.247, 0.0) - (1.0 - 53.0 / 247.0)).abs() < 1e-9);
    }

    #[test]
    fn uncertainty_falls_with_the_number_of_orientations_and_the_seed_gives_the_bits() {
        let region = Region::cone(55_f64.to_radians());
        let sets: Vec<_> = [3, 5, 8]
            .into_iter()
            .map(|n| {
                let search = Search { region: &region, n, objective: Objective::Condition };
                search.run(&AtomicBool::new(false), |_| ()).unwrap().ups
            })
            .collect();
        let run = |seed| section_6_3(&sets, 500, seed, &AtomicBool::new(false), |_, _| ());
        let rows = run(1);
        assert_eq!(rows, run(1));
        assert_ne!(rows, run(2));
        assert_eq!(rows.len(), 3 * 2 * 3);
        for mounting in Mounting::ALL {
            let worst: Vec<f64> = rows
                .iter()
                .filter(|r| r.mounting == mounting && r.errors == Errors::Precision)
                .map(|r| r.spreads[0].unwrap().predicted_sd.max())
                .collect();
            assert!(worst.windows(2).all(|pair| pair[1] < pair[0]), "{worst:?}");
        }
    }

    #[test]
    fn an_offset_leaves_relative_and_modelled_estimators_untouched() {
        let mut experiment = Experiment::new(Mounting::Vertical, Errors::Bias, &cone(4, 50.0));
        experiment.sensors.load_cell.resolution_n_nm = [0.0; 6];
        let [measured, relative, modelled, weighed] = experiment.run(1).map(|e| e.unwrap().norm());
        assert!(measured > 1e-4, "{measured}");
        // A small multiple of rounding.
        assert!(relative < 1e-12 && modelled < 1e-12 && weighed < 1e-12, "{relative} {modelled} {weighed}");
    }
}

//! The shipped f32 recursion against least squares in f64 on the very same f32 rows.

use hexapod::Mounting;
use hexapod::Segment;
use hexapod::experiment::thesis_program;
use rigident::fit::FILTER_WIDTH_S;
use rigident::laboratory::mounting;
use rigident_shared::calibration::Reading;
use rigident_shared::estimator::{Estimator, EstimatorConfig, Outcome};
use rigident_shared::factor::{Cascade, InformationFactor};
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};
use rigident_sim::rig::{ReadingRow, Readings, RigConfig};
use rigident_sim::sensors::SensorModels;

use super::problem::{Block, Mixed, Normal};
use super::reference::{BlockQr, Reference, largest};
use super::report::{Job, in_parallel, short};

/// Condition numbers of the random rows.
pub const CONDITIONS: [f64; 4] = [1e1, 1e2, 1e3, 1e4];
/// 1 σ of the noise of random rows, whose entries and parameters are of order one.
const NOISE: f64 = 0.01;
const EPSILON: f64 = f32::EPSILON as f64;

/// One line of the table.
pub struct Line {
    pub rows: &'static str,
    pub parameters: usize,
    pub samples: u64,
    /// Condition number of the column-scaled rows.
    pub condition: f64,
    /// Largest deviation, in standard deviations.
    pub deviation_sd: f64,
    /// Largest deviation over `max(0.05 sd, 20 ε cond ‖φ‖)`.
    pub of_allowed: f64,
    /// Largest deviation over the allowed one, as `of_allowed`, for a factor of one level.
    pub of_allowed_one_level: Option<f64>,
}

fn of_allowed(reference: &Reference, x: &[f64]) -> f64 {
    let floor = 20.0 * EPSILON * reference.condition * reference.estimate.norm();
    let pairs = x.iter().zip(&reference.estimate).zip(&reference.sd);
    largest(pairs.map(|((x, e), sd)| (x - e).abs() / (0.05 * sd).max(floor)))
}

fn estimate<const N: usize>(factor: &InformationFactor<f32, N>) -> Vec<f64> {
    factor.solve().estimate.iter().map(|v| f64::from(*v)).collect()
}

/// Runs random rows, six a sample, through the cascade; a line at each of `checkpoints` (ascending numbers of
/// samples).
pub fn random<const N: usize>(condition: f64, checkpoints: &[u64], seed: u64) -> Vec<Line> {
    let mut rows = Mixed::<N>::new(condition, NOISE, 1.0, seed);
    let mut cascade = Box::new(Cascade::<f32, N, 4>::new());
    let mut one_level = Box::new(InformationFactor::<f32, N>::new());
    let mut exact = BlockQr::<N>::new();
    let mut samples = 0;
    let mut lines = Vec::new();
    for checkpoint in checkpoints {
        while samples < *checkpoint {
            let block = rows.block();
            exact.absorb(&block);
            let (columns, rhs) = block;
            cascade.absorb(&columns, &rhs);
            one_level.absorb(&columns, &rhs);
            samples += 1;
        }
        let reference = exact.solve();
        let x = estimate(&cascade.factor());
        lines.push(Line {
            rows: "random",
            parameters: N,
            samples,
            condition: reference.condition,
            deviation_sd: reference.deviation_sd(x.iter().copied()),
            of_allowed: of_allowed(&reference, &x),
            of_allowed_one_level: Some(of_allowed(&reference, &estimate(&one_level))),
        });
    }
    lines
}

/// Runs random rows of 128 parameters: pieces of this many samples on target, merged on the host in f64.
pub fn pieces(condition: f64, count: usize, samples: u64, seed: u64) -> Line {
    let mut rows = Mixed::<128>::new(condition, NOISE, 1.0, seed);
    let mut exact = BlockQr::<128>::new();
    let mut merged: Option<Box<InformationFactor<f64, 128>>> = None;
    for _ in 0..count {
        let mut cascade = Box::new(Cascade::<f32, 128, 4>::new());
        for _ in 0..samples {
            let block = rows.block();
            exact.absorb(&block);
            let (columns, rhs) = block;
            cascade.absorb(&columns, &rhs);
        }
        let piece = cascade.factor().cast(f64::from);
        match &mut merged {
            Some(merged) => merged.merge(&piece),
            None => merged = Some(Box::new(piece)),
        }
    }
    let reference = exact.solve();
    let x = merged.expect("there is a piece").solve().estimate;
    Line {
        rows: "random, merged pieces",
        parameters: 128,
        samples: samples * count as u64,
        condition: reference.condition,
        deviation_sd: reference.deviation_sd(x),
        of_allowed: of_allowed(&reference, &x),
        of_allowed_one_level: None,
    }
}

/// Returns twenty seconds of the experiment's multisine, its common period, at 100 Hz.
fn one_period(config: &RigConfig) -> Vec<ReadingRow> {
    let mut program = thesis_program(&config.geometry, 60.0);
    program.segments.retain(|s| matches!(s, Segment::Multisine { .. }));
    let readings = Readings::new(config, &program, 100.0).expect("the program is a fixed one");
    readings.ideal().iter().skip(200).take(2000).copied().collect()
}

/// Runs a body on the experiment's multisine, again and again, at 100 Hz with Table 1 noise, through the
/// whole estimator. The reference absorbs the rows that the estimator made.
pub fn body<const N: usize>(checkpoints: &[u64], seed: u64) -> Vec<Line> {
    let sensors = SensorModels::thesis();
    let sigma = sensors.load_cell.noise_n_nm;
    let config = RigConfig {
        imu: Mounting { rotation_wxyz: [1.0, 0.0, 0.0, 0.0], ..RigConfig::thesis_horizontal().imu },
        ..RigConfig::thesis_horizontal().with_sensors(SensorModels::ideal())
    };
    let period = one_period(&config);
    let settings = EstimatorConfig::<f32> {
        rate_hz: 100.0,
        filter_width_s: FILTER_WIDTH_S as f32,
        row_every: 1,
        channel_sigma: sigma.map(|s| s as f32),
        known_offset: [0.0; 6],
        mounting: mounting(&config),
        limits: Limits::none(),
    };
    let mut estimator =
        Box::new(Estimator::<f32, N, 16>::new(&settings).expect("the settings are fixed ones"));
    let weights = settings.channel_sigma.map(|s| 1.0 / s);
    let offset = if N == 16 { sigma } else { [0.0; 6] };
    let mut normal = Normal::new(seed);
    let mut exact = BlockQr::<N>::new();
    let mut samples = 0;
    let mut lines = Vec::new();
    for checkpoint in checkpoints {
        while samples < *checkpoint {
            let row = &period[samples as usize % period.len()];
            let mut noisy = |value: f64, sigma: f64| (value + sigma * normal.draw()) as f32;
            let reading = Reading {
                time_ns: samples * 10_000_000,
                wrench: Wrench::from_array(std::array::from_fn(|i| {
                    noisy(row.wrench[i] + offset[i], sigma[i])
                })),
                specific_force: SpecificForce::from_array(std::array::from_fn(|i| {
                    noisy(row.specific_force[i], sensors.imu.accel_noise_mps2[i])
                })),
                angular_rate: AngularRate::from_array(std::array::from_fn(|i| {
                    noisy(row.angular_rate[i], sensors.imu.gyro_noise_radps[i])
                })),
            };
            if estimator.absorb(&reading) == Outcome::Absorbed
                && let Some(block) = estimator.last_block()
            {
                let mut whitened: Block<N> = ([[0.0; 6]; N], block.wrench);
                for (j, column) in whitened.0.iter_mut().enumerate() {
                    for (i, entry) in column.iter_mut().enumerate() {
                        let value = block.columns.get(j).map_or(f32::from(u8::from(j == 10 + i)), |c| c[i]);
                        *entry = value * weights[i];
                    }
                }
                whitened.1.iter_mut().zip(weights).for_each(|(y, w)| *y *= w);
                exact.absorb(&whitened);
            }
            samples += 1;
        }
        let reference = exact.solve();
        let x = estimate(&estimator.factor());
        lines.push(Line {
            rows: "a body, whole estimator",
            parameters: N,
            samples,
            condition: reference.condition,
            deviation_sd: reference.deviation_sd(x.iter().copied()),
            of_allowed: of_allowed(&reference, &x),
            of_allowed_one_level: None,
        });
    }
    lines
}

fn markdown(lines: &[Line]) -> String {
    let mut text = "| rows | N | samples | cond, columns scaled | deviation, sd | deviation / allowed | one \
                    level / allowed |\n\
                    |---|---|---|---|---|---|---|\n"
        .to_owned();
    for line in lines {
        let one_level = line.of_allowed_one_level.map_or_else(String::new, short);
        text += &format!(
            "| {} | {} | {} | {} | {} | {} | {one_level} |\n",
            line.rows,
            line.parameters,
            short(line.samples as f64),
            short(line.condition),
            short(line.deviation_sd),
            short(line.of_allowed),
        );
    }
    text
}

fn lines(checkpoints: &'static [u64]) -> Vec<Job<'static, Vec<Line>>> {
    let mut jobs: Vec<Job<'static, Vec<Line>>> = Vec::new();
    for (k, condition) in CONDITIONS.into_iter().enumerate() {
        jobs.push(Box::new(move || random::<10>(condition, checkpoints, 100 + k as u64)));
    }
    jobs.push(Box::new(|| body::<10>(checkpoints, 110)));
    for (k, condition) in CONDITIONS.into_iter().enumerate() {
        jobs.push(Box::new(move || random::<16>(condition, checkpoints, 200 + k as u64)));
    }
    jobs.push(Box::new(|| body::<16>(checkpoints, 210)));
    jobs
}

/// Returns the table of 1e2 and 1e5 samples.
pub fn table() -> String {
    markdown(&in_parallel(lines(&[100, 100_000])).into_iter().flatten().collect::<Vec<_>>())
}

/// Returns the table of 1e7 samples, and of 128 parameters.
pub fn long_table() -> String {
    let mut jobs = lines(&[10_000_000]);
    for (k, condition) in CONDITIONS.into_iter().enumerate() {
        jobs.push(Box::new(move || vec![pieces(condition, 3, 100_000, 300 + k as u64)]));
    }
    markdown(&in_parallel(jobs).into_iter().flatten().collect::<Vec<_>>())
}

#[cfg(test)]
mod tests;

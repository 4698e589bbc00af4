//! The covariance that ships against the exact sandwich, batch means, the spread of many runs, and what
//! scaling by the filtered residuals would say; on the default experiment, 20 s.

use hexapod::experiment::thesis_program;
use nalgebra::DMatrix;
use rigident::answer::result::ParameterState;
use rigident::fit::{FILTER_WIDTH_S, Fit, FitOptions, Silent, fit, row_every};
use rigident::laboratory::{mounting, reading};
use rigident::rows::body::{BodySource, Input};
use rigident_shared::calibration::Reading;
use rigident_shared::estimator::{Estimator, EstimatorConfig, Outcome};
use rigident_shared::inertia::PARAMETER_NAMES;
use rigident_shared::screening::Limits;
use rigident_sim::rig::{Readings, RigConfig};

use super::filter_response::{impulse_response, white_autocovariance};
use super::report::{Job, in_parallel, short};

const TAPS: usize = 1024;
pub const N: usize = 16;

/// One rate of the default experiment.
pub struct Study {
    readings: Readings,
    input: Input,
    settings: EstimatorConfig<f64>,
    shipped: [f64; N],
    sandwich: [f64; N],
    noise_gain: f64,
    /// G⁻¹
    inverse: DMatrix<f64>,
}

/// Whitened rows of one block, the right-hand side last.
type Rows = [[f64; N + 1]; 6];

/// Runs the pipeline; hands every whitened block on.
pub fn run(
    settings: &EstimatorConfig<f64>,
    readings: impl Iterator<Item = Reading<f64>>,
    mut each: impl FnMut(&Rows),
) -> Box<Estimator<f64, N, TAPS>> {
    let mut estimator =
        Box::new(Estimator::<f64, N, TAPS>::new(settings).expect("the settings are fixed ones"));
    let root = f64::from(settings.row_every).sqrt();
    for reading in readings {
        if estimator.absorb(&reading) == Outcome::Absorbed
            && let Some(block) = estimator.last_block()
        {
            each(&std::array::from_fn(|i| {
                let weight = root / settings.channel_sigma[i];
                std::array::from_fn(|j| match j {
                    0..10 => weight * block.columns[j][i],
                    N => weight * block.wrench[i],
                    _ => {
                        if j == 10 + i {
                            weight
                        } else {
                            0.0
                        }
                    }
                })
            }));
        }
    }
    estimator
}

/// Returns the fit of readings of an IMU of whose noise nothing is stated.
pub fn fit_body(input: &Input, options: &FitOptions) -> Fit {
    fit(&BodySource::new(input.clone(), None), options, &Silent).expect("the experiment has rows")
}

/// Returns the state of every parameter.
pub fn states(fit: &Fit) -> Vec<ParameterState> {
    rigident::answer::states::states(fit, None, false)
}

/// Returns the square roots of the diagonal of `G⁻¹ B G⁻¹`.
fn sandwich(inverse: &DMatrix<f64>, meat: &DMatrix<f64>) -> [f64; N] {
    let covariance = inverse * meat * inverse;
    std::array::from_fn(|j| covariance[(j, j)].sqrt())
}

impl Study {
    /// Makes the shipped formula, from the fit, and the exact sandwich `G⁻¹ (Ãᵀ T Ã) G⁻¹`: T is the
    /// covariance that white noise has after the filter, row by row.
    pub fn new(rate_hz: f64) -> Self {
        let config = RigConfig::thesis_horizontal();
        let program = thesis_program(&config.geometry, 20.0);
        let readings = Readings::new(&config, &program, rate_hz).expect("the program is a fixed one");
        let mounting = mounting(&config);
        let sigma = config.sensors.load_cell.noise_n_nm;
        let input = Input {
            readings: readings.ideal().iter().map(reading).collect(),
            is_static: false,
            rate_hz,
            mounting,
            channel_sigma: Some(sigma),
            gyro_sigma: None,
            known_offset: None,
            nuisances: Vec::new(),
            rests: Vec::new(),
            beforehand: None,
            limits: Limits::none(),
        };
        let identified = fit_body(&input, &FitOptions::default());
        let settings = EstimatorConfig {
            rate_hz,
            filter_width_s: FILTER_WIDTH_S,
            row_every: row_every(rate_hz),
            channel_sigma: sigma,
            known_offset: [0.0; 6],
            mounting,
            limits: Limits::none(),
        };
        let mut blocks: Vec<Rows> = Vec::new();
        run(&settings, readings.ideal().iter().map(reading), |rows| blocks.push(*rows));
        let white = white_autocovariance(&impulse_response(&settings), settings.row_every);
        // The rows are weighted by √row_every / σ, and so is their noise.
        let mut meat = DMatrix::zeros(N, N);
        let weight = f64::from(settings.row_every);
        for (i, left) in blocks.iter().enumerate() {
            for (lag, gamma) in white.iter().enumerate() {
                let Some(right) = blocks.get(i + lag) else { break };
                let both = if lag == 0 { 0.5 } else { 1.0 };
                for (l, r) in left.iter().zip(right) {
                    for a in 0..N {
                        for b in 0..N {
                            let term = both * weight * gamma * l[a] * r[b];
                            meat[(a, b)] += term;
                            meat[(b, a)] += term;
                        }
                    }
                }
            }
        }
        let inverse = gram(&blocks).try_inverse().expect("the experiment determines everything");
        Self {
            readings,
            input,
            settings,
            shipped: std::array::from_fn(|j| {
                identified.estimate.covariance(j, j).expect("the experiment determines everything").sqrt()
            }),
            sandwich: sandwich(&inverse, &meat),
            noise_gain: weight * white[0],
            inverse,
        }
    }

    pub fn settings(&self) -> &EstimatorConfig<f64> {
        &self.settings
    }

    /// Returns the question for perfect sensors.
    pub fn input(&self) -> &Input {
        &self.input
    }

    /// Returns what perfect sensors read.
    pub fn ideal(&self) -> impl Iterator<Item = Reading<f64>> + '_ {
        self.input.readings.iter().copied()
    }

    /// Returns what is to be found in them; they have no offset.
    pub fn ideal_parameters(&self) -> [f64; N] {
        let body = RigConfig::thesis_horizontal().body.parameters();
        std::array::from_fn(|j| body.get(j).copied().unwrap_or(0.0))
    }

    /// Returns shipped over exact, parameter by parameter.
    pub fn shipped_over_sandwich(&self) -> [f64; N] {
        std::array::from_fn(|j| self.shipped[j] / self.sandwich[j])
    }
}

/// Returns the sandwich with the rows of perfect sensors outside and this inside.
pub fn sandwich_of(study: &Study, meat: &DMatrix<f64>) -> [f64; N] {
    sandwich(&study.inverse, meat)
}

fn gram(blocks: &[Rows]) -> DMatrix<f64> {
    let mut gram = DMatrix::zeros(N, N);
    for row in blocks.iter().flatten() {
        for a in 0..N {
            for b in 0..N {
                gram[(a, b)] += row[a] * row[b];
            }
        }
    }
    gram
}

/// Sums over runs.
#[derive(Clone)]
struct Sums {
    runs: f64,
    squares: [f64; N],
    held: [f64; N],
    held_plain: [f64; N],
    plain: [f64; N],
    batch: DMatrix<f64>,
}

impl Sums {
    fn new() -> Self {
        let zero = [0.0; N];
        Self {
            runs: 0.0,
            squares: zero,
            held: zero,
            held_plain: zero,
            plain: zero,
            batch: DMatrix::zeros(N, N),
        }
    }

    fn add(&mut self, other: &Self) {
        self.runs += other.runs;
        self.batch += &other.batch;
        for (own, other) in [
            (&mut self.squares, other.squares),
            (&mut self.held, other.held),
            (&mut self.held_plain, other.held_plain),
            (&mut self.plain, other.plain),
        ] {
            own.iter_mut().zip(other).for_each(|(a, b)| *a += b);
        }
    }
}

/// Returns the rows that a batch has: a second's, ten widths of the filter.
fn batch_rows(settings: &EstimatorConfig<f64>) -> usize {
    (settings.rate_hz / f64::from(settings.row_every)).round() as usize
}

/// Returns the sum of the squares of the scores of batches, of a second each, and the estimator at the end.
/// Batches are of the true errors, which only a simulation knows: with sixteen parameters fitted to twenty
/// batches, those of the residuals would be far too small.
pub fn batch_meat(
    settings: &EstimatorConfig<f64>,
    readings: impl Iterator<Item = Reading<f64>>,
    phi: &[f64; N],
) -> (DMatrix<f64>, Box<Estimator<f64, N, TAPS>>) {
    let length = batch_rows(settings);
    let mut meat = DMatrix::zeros(N, N);
    let mut score = [0.0; N];
    let mut blocks = 0;
    let add = |meat: &mut DMatrix<f64>, s: [f64; N]| {
        *meat += DMatrix::from_fn(N, N, |a, b| s[a] * s[b]);
    };
    let estimator = run(settings, readings, |rows| {
        for row in rows {
            let error = row[N] - row.iter().zip(phi).map(|(a, x)| a * x).sum::<f64>();
            score.iter_mut().zip(row).for_each(|(s, a)| *s += a * error);
        }
        blocks += 1;
        if blocks % length == 0 {
            add(&mut meat, std::mem::replace(&mut score, [0.0; N]));
        }
    });
    add(&mut meat, score);
    (meat, estimator)
}

/// Measures runs of these seeds.
fn monte_carlo(study: &Study, seeds: std::ops::Range<u64>) -> Sums {
    let mut sums = Sums::new();
    for seed in seeds {
        let truth = study.readings.truth(seed);
        let body = truth.body.parameters();
        let phi = std::array::from_fn(|j| match j {
            0..10 => body[j],
            _ => truth.apparent_offset_n_nm[j - 10],
        });
        let readings = study.readings.measured(seed).map(|r| reading(&r));
        let (meat, estimator) = batch_meat(&study.settings, readings, &phi);
        sums.batch += meat;
        let factor = estimator.factor();
        let solution = factor.solve();
        let freedom = f64::from(factor.rows()) - N as f64;
        let scale = (factor.residual_sum_of_squares() / freedom).sqrt();
        sums.runs += 1.0;
        for j in 0..N {
            let (error, sd) = ((solution.estimate[j] - phi[j]).abs(), solution.standard_deviation[j]);
            sums.squares[j] += error * error;
            sums.held[j] += f64::from(u8::from(error <= 1.96 * sd));
            sums.held_plain[j] += f64::from(u8::from(error <= 1.96 * scale * sd));
            sums.plain[j] += scale * sd;
        }
    }
    sums
}

const PART: u64 = 50;

fn all_runs(study: &'static Study, runs: u64) -> Sums {
    let jobs = (0..runs / PART).map(|part| -> Job<'_, Sums> {
        Box::new(move || monte_carlo(study, 1 + part * PART..1 + (part + 1) * PART))
    });
    let mut sums = Sums::new();
    in_parallel(jobs.collect()).iter().for_each(|part| sums.add(part));
    sums
}

/// Writes least and largest, as "0.98–1.02".
fn range(values: impl Iterator<Item = f64>, digits: usize) -> String {
    let (least, most) = values.fold((f64::INFINITY, 0.0_f64), |(l, m), v| (l.min(v), m.max(v)));
    format!("{least:.digits$}–{most:.digits$}")
}

fn percent(shares: [f64; N], runs: f64) -> String {
    format!("{} %", range(shares.into_iter().map(|s| 100.0 * s / runs), 1))
}

/// Returns the table: a line for each rate, then one for each parameter at 1 kHz.
pub fn table() -> String {
    let mut text = "| rate, Hz | a row every | σ² after/before | runs | shipped | batch means | spread of \
                    runs | residual scaling | coverage, shipped | coverage, residual scaling \
                    |\n|---|---|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    let mut details = String::new();
    for (rate_hz, runs) in [(100.0, 500), (200.0, 2000), (250.0, 500), (500.0, 500), (1000.0, 2000)] {
        let study: &'static Study = Box::leak(Box::new(Study::new(rate_hz)));
        let sums = all_runs(study, runs);
        let batch = sandwich_of(study, &(&sums.batch / sums.runs));
        let spread: [f64; N] = std::array::from_fn(|j| (sums.squares[j] / sums.runs).sqrt());
        let plain = sums.plain.map(|p| p / sums.runs);
        let over = |sd: [f64; N]| range((0..N).map(move |j| sd[j] / study.sandwich[j]), 3);
        text += &format!(
            "| {rate_hz} | {} | {} | {runs} | {} | {} | {} | {} | {} | {} |\n",
            study.settings.row_every,
            short(study.noise_gain),
            range(study.shipped_over_sandwich().into_iter(), 3),
            over(batch),
            over(spread),
            over(plain),
            percent(sums.held, sums.runs),
            percent(sums.held_plain, sums.runs),
        );
        if rate_hz == 1000.0 {
            for j in 0..N {
                details += &format!(
                    "| {} | {:.3e} | {:.3} | {:.3} | {:.3} | {:.3} | {:.1} % | {:.1} % |\n",
                    PARAMETER_NAMES[j],
                    study.sandwich[j],
                    study.shipped[j] / study.sandwich[j],
                    batch[j] / study.sandwich[j],
                    spread[j] / study.sandwich[j],
                    plain[j] / study.sandwich[j],
                    100.0 * sums.held[j] / sums.runs,
                    100.0 * sums.held_plain[j] / sums.runs,
                );
            }
        }
    }
    text += "\n| 1 kHz | sandwich, SI | shipped | batch means | spread of runs | residual scaling | \
             coverage, shipped | coverage, residual scaling |\n|---|---|---|---|---|---|---|---|\n";
    text + &details
}

#[cfg(test)]
mod tests;

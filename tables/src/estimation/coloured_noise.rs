//! The change of the intervals when the load cell's noise is not white, and whether the answer says so.

use rigident::fit::{Fit, FitOptions};
use rigident::rows::body::Input;
use rigident_shared::calibration::Reading;
use rigident_shared::spatial::Wrench;

use super::honest_covariance::{N, Study, batch_meat, fit_body, sandwich_of, states};
use super::problem::Normal;
use super::report::{Job, in_parallel, short};

pub const RATE_HZ: f64 = 200.0;
const RUNS: u64 = 200;
/// Correlation times, s; zero is white.
const TIMES_S: [f64; 7] = [0.0, 0.002, 0.01, 0.02, 0.05, 0.2, 1.0];

/// One way of knowing σ.
#[derive(Clone, Copy, Default)]
pub struct Stated {
    /// Runs times the share of the intervals that hold the truth: as they are, and had they not counted
    /// colour.
    pub held: f64,
    pub held_as_white: f64,
    /// Sum of the shipped standard deviations of the mass, the first, and of all over the exact ones.
    sd: [f64; N],
    warned: f64,
    factor: f64,
}

impl Stated {
    fn add(&mut self, said: &Fit, phi: &[f64; N]) {
        let states = states(said);
        for j in 0..N {
            self.sd[j] +=
                said.estimate.covariance(j, j).expect("the experiment determines everything").sqrt();
            let m = states[j].measured().expect("the experiment identifies everything");
            let widening = said.inflation.get(j).copied().unwrap_or(1.0);
            let error = (m.value - phi[j]).abs();
            self.held += f64::from(u8::from(error <= m.u95)) / N as f64;
            self.held_as_white += f64::from(u8::from(error <= m.u95 / widening)) / N as f64;
        }
        let factors = said.channels.iter().filter_map(|c| Some(c.autocorrelation?.factor));
        if let Some(largest) = factors.reduce(f64::max) {
            self.warned += 1.0;
            self.factor += largest;
        }
    }
}

/// Sums over the runs.
pub struct Line {
    squares: [f64; N],
    batch: [f64; N],
    pub given: Stated,
    estimated: Stated,
}

/// Returns the experiment with noise of the channels' standard deviation and of this correlation time.
pub fn readings(study: &Study, time_s: f64, normal: &mut Normal) -> Vec<Reading<f64>> {
    let sigma = study.settings().channel_sigma;
    let rho = if time_s > 0.0 { f64::exp(-1.0 / (RATE_HZ * time_s)) } else { 0.0 };
    let mut noise: [f64; 6] = std::array::from_fn(|_| normal.draw());
    let noisy = study.ideal().map(|r| {
        noise = noise.map(|n| rho * n + (1.0 - rho * rho).sqrt() * normal.draw());
        let exact = r.wrench.array();
        Reading { wrench: Wrench::from_array(std::array::from_fn(|c| exact[c] + sigma[c] * noise[c])), ..r }
    });
    noisy.collect()
}

/// Experiments with such noise.
pub fn line(study: &Study, time_s: f64, seed: u64, runs: u64) -> Line {
    let mut normal = Normal::new(seed);
    let phi = study.ideal_parameters();
    let mut line =
        Line { squares: [0.0; N], batch: [0.0; N], given: Stated::default(), estimated: Stated::default() };
    let mut meat = nalgebra::DMatrix::zeros(N, N);
    for _ in 0..runs {
        let readings = readings(study, time_s, &mut normal);
        meat += batch_meat(study.settings(), readings.iter().copied(), &phi).0;
        let input = Input { readings, ..study.input().clone() };
        let given = fit_body(&input, &FitOptions::default());
        let states = states(&given);
        for j in 0..N {
            let m = states[j].measured().expect("the experiment identifies everything");
            line.squares[j] += (m.value - phi[j]).powi(2) / runs as f64;
        }
        line.given.add(&given, &phi);
        let estimated = fit_body(&Input { channel_sigma: None, ..input }, &FitOptions::default());
        line.estimated.add(&estimated, &phi);
    }
    line.batch = sandwich_of(study, &(meat / runs as f64));
    line
}

/// Returns the table.
pub fn table() -> String {
    let study: &'static Study = Box::leak(Box::new(Study::new(RATE_HZ)));
    let jobs = TIMES_S
        .into_iter()
        .zip(1..)
        .map(|(time_s, seed)| -> Job<'_, Line> { Box::new(move || line(study, time_s, 1000 * seed, RUNS)) });
    let mut text = "| correlation time, s | σ | batch means / spread | shipped / spread | coverage | \
                    autocorrelation not counted | warned | largest factor reported, mean |\n\
                    |---|---|---|---|---|---|---|---|\n"
        .to_owned();
    let runs = RUNS as f64;
    for (time_s, line) in TIMES_S.into_iter().zip(in_parallel(jobs.collect())) {
        // Geometric mean over the parameters.
        let mean =
            |ratio: &dyn Fn(usize) -> f64| ((0..N).map(|j| ratio(j).ln()).sum::<f64>() / N as f64).exp();
        let spread = line.squares.map(f64::sqrt);
        let batch = mean(&|j| line.batch[j] / spread[j]);
        for (sums, name) in [(line.given, "given"), (line.estimated, "from the data")] {
            let shipped = mean(&|j| sums.sd[j] / runs / spread[j]);
            let factor = if sums.warned > 0.0 { short(sums.factor / sums.warned) } else { "–".to_owned() };
            text += &format!(
                "| {} | {name} | {batch:.2} | {} | {:.1} % | {:.1} % | {:.0} % | {factor} |\n",
                if time_s > 0.0 { time_s.to_string() } else { "0 (white)".to_owned() },
                short(shipped),
                100.0 * sums.held / runs,
                100.0 * sums.held_as_white / runs,
                100.0 * sums.warned / runs,
            );
        }
    }
    text
}

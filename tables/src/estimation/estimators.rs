//! Ways to estimate from coefficients that are noisy, on the same recordings: the weighted least squares of
//! the channels, instrumental variables, total least squares, and the compensated least squares that ship.
//!
//! Instrumental variables: `ẑ = (Zᵀ A)⁻¹ Zᵀ y` with whitened rows Z whose noise has nothing to do with that
//! of A, here those of the recording itself before and after, further away than the filter reaches, or those
//! of the same motion without noise, as a platform's command would give them at best. Total least squares:
//! the least λ for which `[A y]ᵀ[A y] − λ K` is singular, K being the expectation of the noise's products (S.
//! Van Huffel, J. Vandewalle, The Total Least Squares Problem, SIAM 1991, chapter 10); its null vector has
//! the estimate. Each needs only sums of products, and could run in fixed size.

use nalgebra::{Cholesky, DMatrix, DVector};
use rigident::fit::{Channel, FitOptions, RowBlocks, RowSource, SignalNoise, Silent, fit};
use rigident::rows::body::BodySource;
use rigident::study::{Campaign, Prepared};

use super::report::{Job, in_parallel};
use super::signal_noise::{BODY, IMU, motion, rig};

const RUNS: u64 = 300;
/// Parameters with offsets.
const N: usize = 16;
const CHANNELS: usize = 6;
/// Patterns of noise that its products are averaged over.
const PATTERNS: u64 = 8;

/// Rows `[A y]` of all blocks.
type Rows = DMatrix<f64>;

/// The whitening and the knowledge of the noise.
struct Known {
    /// Multiplies a block of six rows.
    whitening: DMatrix<f64>,
    /// Multiplies a block of six rows where only the load cell's noise counts.
    channels: DMatrix<f64>,
    /// Products of the noise in whitened rows `[A y]`.
    products: DMatrix<f64>,
    /// Rows without noise.
    exact: Rows,
}

fn rows_of(source: &dyn RowSource) -> (Rows, Box<dyn RowBlocks>) {
    let blocks = source.condition(&Silent).expect("a filter that fits");
    let mut all = DMatrix::zeros(blocks.len() * CHANNELS, N + 1);
    let (mut rows, mut measured) = (vec![0.0; CHANNELS * N], vec![0.0; CHANNELS]);
    for block in 0..blocks.len() {
        blocks.write(block, &mut rows, &mut measured);
        for (c, y) in measured.iter().enumerate() {
            let at = block * CHANNELS + c;
            rows[c * N..(c + 1) * N].iter().enumerate().for_each(|(j, a)| all[(at, j)] = *a);
            all[(at, N)] = *y;
        }
    }
    (all, blocks)
}

fn whitened(rows: &Rows, by: &DMatrix<f64>) -> Rows {
    let mut out = rows.clone();
    for block in 0..rows.nrows() / CHANNELS {
        let own = by * rows.rows(block * CHANNELS, CHANNELS);
        out.rows_mut(block * CHANNELS, CHANNELS).copy_from(&own);
    }
    out
}

impl Known {
    /// Returns what follows from the noise's size and the true parameters, about a recording without noise.
    fn new(exact: &BodySource, noisy: &BodySource, truth: &[f64; N]) -> Self {
        let (rows, blocks) = rows_of(exact);
        let sigma: Vec<f64> = noisy.signal_noise().iter().map(SignalNoise::size).collect();
        let of_cell: Vec<f64> = noisy.channels().iter().map(|c: &Channel| c.sigma.expect("stated")).collect();
        let gain = blocks.filter().row_noise_gain() / f64::from(blocks.filter().every);
        let cell =
            DMatrix::from_fn(CHANNELS, CHANNELS, |i, j| if i == j { of_cell[i].powi(2) * gain } else { 0.0 });
        let phi = DVector::from_column_slice(truth);
        let mut differences = Vec::new();
        for seed in 0..PATTERNS {
            let with = exact.with_signal_noise(0..exact.samples(), &sigma, seed).expect("noise is known");
            differences.push(rows_of(&*with).0 - &rows);
        }
        let mut covariance = cell.clone();
        let count = (rows.nrows() / CHANNELS) as f64 * PATTERNS as f64;
        for difference in &differences {
            let moved = difference.columns(0, N) * &phi;
            for block in 0..rows.nrows() / CHANNELS {
                let own = moved.rows(block * CHANNELS, CHANNELS);
                covariance += own * own.transpose() / count;
            }
        }
        let inverse = |covariance: DMatrix<f64>| {
            let lower = Cholesky::new(covariance).expect("positive").unpack();
            lower.try_inverse().expect("a triangle")
        };
        let whitening = inverse(covariance);
        let mut products = DMatrix::zeros(N + 1, N + 1);
        for difference in &differences {
            let white = whitened(difference, &whitening);
            products += white.tr_mul(&white) / PATTERNS as f64;
        }
        products[(N, N)] +=
            (&whitening * &cell * whitening.transpose()).trace() * (rows.nrows() / CHANNELS) as f64;
        let exact = whitened(&rows, &whitening);
        Self { whitening, channels: inverse(cell), products, exact }
    }
}

fn least_squares(rows: &Rows) -> Option<DVector<f64>> {
    with_instruments(rows, rows)
}

fn with_instruments(rows: &Rows, instruments: &Rows) -> Option<DVector<f64>> {
    let z = instruments.columns(0, N);
    // Columns of unit length: units differ by orders of magnitude.
    let scale = DVector::from_fn(N, |j, _| z.column(j).norm().recip());
    let left =
        DMatrix::from_diagonal(&scale) * z.tr_mul(&rows.columns(0, N)) * DMatrix::from_diagonal(&scale);
    let right = scale.component_mul(&z.tr_mul(&rows.column(N)));
    Some(left.lu().solve(&right)?.component_mul(&scale))
}

fn total_least_squares(rows: &Rows, products: &DMatrix<f64>) -> Option<DVector<f64>> {
    let gram = rows.tr_mul(rows);
    let scale = gram.diagonal().map(|d| d.sqrt().recip());
    let scaled = |m: &DMatrix<f64>| DMatrix::from_fn(N + 1, N + 1, |i, j| m[(i, j)] * scale[i] * scale[j]);
    let lower = Cholesky::new(scaled(&gram))?.unpack();
    let half = lower.solve_lower_triangular(&scaled(products))?;
    let both = lower.solve_lower_triangular(&half.transpose())?;
    let eigen = (0.5 * (&both + both.transpose())).symmetric_eigen();
    let largest = eigen.eigenvalues.imax();
    let null = lower.tr_solve_lower_triangular(&eigen.eigenvectors.column(largest))?.component_mul(&scale);
    Some(null.rows(0, N) / -null[N])
}

/// Returns the sum of the rows before and after by more than the filter reaches.
fn neighbours(rows: &Rows, filter_blocks: usize) -> (Rows, Rows) {
    let (lag, count) = (CHANNELS * (filter_blocks + 1), rows.nrows());
    let inner = count - 2 * lag;
    (rows.rows(lag, inner).into_owned(), rows.rows(0, inner) + rows.rows(2 * lag, inner))
}

const NAMES: [&str; 5] = [
    "channel weights",
    "instruments: rows before and after",
    "instruments: the motion without noise",
    "total least squares",
    "compensated, as shipped",
];

fn estimates(prepared: &Prepared, known: &Known, seed: u64) -> [[f64; BODY]; NAMES.len()] {
    let (source, truth) = prepared.recording(seed);
    let (raw, blocks) = rows_of(&source);
    let filter = blocks.filter();
    let rows = whitened(&raw, &known.whitening);
    let (inner, beside) = neighbours(&rows, (filter.width_s / filter.row_period_s()).ceil() as usize);
    let shipped = fit(&source, &FitOptions::default(), &Silent).expect("rows of all parameters").estimate;
    let found = [
        least_squares(&whitened(&raw, &known.channels)),
        with_instruments(&inner, &beside),
        with_instruments(&rows, &known.exact),
        total_least_squares(&rows, &known.products),
        Some(DVector::from_fn(N, |j, _| shipped.measured(j).expect("determined").value)),
    ];
    found.map(|found| {
        let found = found.expect("rows of all parameters");
        std::array::from_fn(|j| found[j] - truth[j])
    })
}

/// Returns the table.
pub fn table() -> String {
    let mut text =
        "| motion | accelerometer, m/s² | gyro, rad/s | estimator | efficiency | largest bias, sd |\n\
                    |---|---|---|---|---|---|\n"
            .to_owned();
    for (slow, imu) in [false, true].into_iter().flat_map(|slow| IMU.map(|imu| (slow, imu))) {
        // What is left of the slow motion with the worst gyros is noise.
        if slow && imu[1] > 0.002 {
            continue;
        }
        let prepare = |[accel, gyro]: [f64; 2]| {
            let config = rig([accel, gyro]);
            let program = Some(motion(&config, 20.0, slow));
            Campaign { program, ..Campaign::new(config) }.prepare().expect("a motion that the legs reach")
        };
        let prepared = prepare(imu);
        let silent = {
            let mut config = rig([0.0; 2]);
            config.sensors.load_cell.noise_n_nm = [1e-9; 6];
            let program = Some(motion(&config, 20.0, slow));
            Campaign { program, state_noise: true, ..Campaign::new(config) }
                .prepare()
                .expect("a motion that the legs reach")
        };
        let (noisy, truth) = prepared.recording(0);
        let known = Known::new(&silent.recording(0).0, &noisy, &truth);
        let job = |seed| -> Job<'_, _> {
            let (prepared, known) = (&prepared, &known);
            Box::new(move || estimates(prepared, known, seed))
        };
        let errors: Vec<_> = in_parallel((1..=RUNS).map(job).collect());
        let bound = prepared.crb_std();
        for (k, name) in NAMES.iter().enumerate() {
            let of = |j: usize| {
                let all = errors.iter().map(|run| run[k][j]);
                let mean = all.clone().sum::<f64>() / RUNS as f64;
                let square = all.map(|e| e * e).sum::<f64>() / RUNS as f64;
                (bound[j] / square.sqrt(), (mean / (square - mean * mean).sqrt()).abs())
            };
            let all: Vec<(f64, f64)> = (0..BODY).map(of).collect();
            let least = all.iter().map(|e| e.0).fold(f64::INFINITY, f64::min);
            let most = all.iter().map(|e| e.0).fold(0.0, f64::max);
            let bias = all.iter().map(|e| e.1).fold(0.0, f64::max);
            text += &format!(
                "| {} | {} | {} | {name} | {least:.2}–{most:.2} | {bias:.2} |\n",
                if slow { "0.05–0.15 Hz" } else { "0.2–1.6 Hz" },
                imu[0],
                imu[1],
            );
        }
    }
    text
}

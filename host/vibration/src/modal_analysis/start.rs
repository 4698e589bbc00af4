//! First poles: eigensystem realisation (J.-N. Juang, R. Pappa 1985) over many orders, and those poles that
//! orders agree on.
//!
//! Of a sum of exponentials, the Hankel matrix `H₀[(i, c), j] = y_c(i + j) = O Z` has as many dimensions as
//! exponentials, and that of the next samples is `H₁ = O A Z` with the same poles in A. With `H₀ ≈ U Σ Vᵀ`,
//! the poles of order m are the eigenvalues of `Σ_m⁻¹ U_mᵀ H₁ V_m`. Poles of vibrations stay where they are
//! as m grows, poles of noise do not.

use nalgebra::{Complex, DMatrix, DVector, Schur};

use super::triangle::{Pole, Samples};

/// Largest number of rows and columns of lags.
const MOST_LAGS: usize = 320;
/// Orders that are tried, even ones: up to four for each mode, so that noise has room, and some more; but no
/// more than this.
const MOST_ORDER: usize = 44;
const BEYOND: usize = 12;
/// Orders in which a pole must be found again.
const STABLE: usize = 3;
/// Largest relative change of frequency, and of damping ratio, from order to order.
const SAME: (f64, f64) = (0.01, 0.05);
/// Least likeness of shapes (modal assurance criterion).
const ALIKE: f64 = 0.9;

/// A pole in one order.
#[derive(Clone)]
struct Found {
    pole: Pole,
    shape: DVector<Complex<f64>>,
    /// Orders before this one that it was followed through.
    stable: usize,
    /// The pole's place in the order before.
    before: Option<usize>,
}

/// Returns poles that stay the same over orders, those longest stable first. Channels are divided by their
/// noise first.
pub(super) fn stable_poles(samples: &Samples, noise: &[f64], most: usize) -> Vec<Pole> {
    let mut scaled = samples.y.clone();
    for (mut column, (noise, size)) in scaled.column_iter_mut().zip(noise.iter().zip(samples.sizes())) {
        column /= noise.max(1e-9 * size).max(1e-150);
    }
    let Some((sigma, between, observed)) = realisation(&scaled, (4 * most + BEYOND).min(MOST_ORDER)) else {
        return Vec::new();
    };
    let mut orders: Vec<Vec<Found>> = Vec::new();
    // Without noise, poles are there from the rank on, and have to be found again in a few orders beyond it.
    let rank = sigma.iter().filter(|s| **s > 1e-12 * sigma[0]).count();
    for order in (2..=sigma.len().min(rank + 2 * STABLE + 4)).step_by(2) {
        let rows = DMatrix::from_fn(order, order, |i, j| between[(i, j)] / sigma[i].max(1e-15 * sigma[0]));
        let mut found = poles(&rows, &observed.columns(0, order).into_owned(), samples);
        if let Some(last) = orders.last() {
            follow(&mut found, last, samples.duration_s());
        }
        orders.push(found);
    }
    collect(&orders)
}

/// Returns `Σ`, `Uᵀ H₁ V` and the rows of `U Σ` of the first lag, for as many dimensions as may be of use.
fn realisation(y: &DMatrix<f64>, most_order: usize) -> Option<(Vec<f64>, DMatrix<f64>, DMatrix<f64>)> {
    let (samples, channels) = y.shape();
    let lags = (samples - 1) / 2;
    let stride = lags.div_ceil(MOST_LAGS).max(1);
    let (rows, columns) = (lags / stride, (samples - lags - 1) / stride);
    if rows < 4 || columns < 4 {
        return None;
    }
    let hankel = |shift: usize| {
        DMatrix::from_fn(rows * channels, columns, |k, j| {
            y[((k / channels) * stride + j * stride + shift, k % channels)]
        })
    };
    let now = hankel(0);
    let width = most_order.min(columns).min(rows * channels);
    // Subspace iteration from columns without order; three rounds separate dimensions that differ by little.
    let mut state = 1_u64;
    let mut basis = DMatrix::from_fn(columns, width, |_, _| pseudo_random(&mut state));
    for _ in 0..3 {
        let image = (&now * &basis).qr().q();
        basis = now.tr_mul(&image).qr().q();
    }
    let image = (&now * &basis).try_svd(true, true, 1e-14, 1000)?;
    let (u, v) = (image.u?, &basis * image.v_t?.transpose());
    let sigma: Vec<f64> = image.singular_values.iter().copied().collect();
    let between = u.tr_mul(&(hankel(1) * v));
    let observed = DMatrix::from_fn(channels, sigma.len(), |c, j| u[(c, j)] * sigma[j]);
    Some((sigma, between, observed))
}

fn pseudo_random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) as f64 / f64::from(1_u32 << 30) - 1.0
}

/// Poles of one order that may be vibrations, with their shapes.
fn poles(a: &DMatrix<f64>, observed: &DMatrix<f64>, samples: &Samples) -> Vec<Found> {
    let duration = samples.duration_s();
    let Some(schur) = Schur::try_new(a.clone(), f64::EPSILON, 200 * a.nrows()) else { return Vec::new() };
    let to_pole = |z: &Complex<f64>| {
        let rate = z.ln() * samples.rate_hz;
        Pole { decay: -rate.re, angular: rate.im }
    };
    let is_possible =
        |pole: &Pole| pole.angular * duration > 2.0 && pole.damping() < 0.4 && pole.decay * duration > -2.0;
    let values = schur.complex_eigenvalues();
    let kept = values.iter().filter(|z| z.im > 0.0 && is_possible(&to_pole(z)));
    kept.filter_map(|z| {
        let shape = observed.map(|v| Complex::new(v, 0.0)) * eigenvector(a, *z)?;
        Some(Found { pole: to_pole(z), shape, stable: 0, before: None })
    })
    .collect()
}

/// Returns the eigenvector of a known eigenvalue by two steps of inverse iteration.
fn eigenvector(a: &DMatrix<f64>, value: Complex<f64>) -> Option<DVector<Complex<f64>>> {
    let n = a.nrows();
    let near = value * Complex::new(1.0 + 1e-10, 1e-10);
    let shifted = DMatrix::from_fn(n, n, |i, j| {
        Complex::new(a[(i, j)], 0.0) - if i == j { near } else { Complex::new(0.0, 0.0) }
    });
    let solver = shifted.lu();
    let mut vector = DVector::from_element(n, Complex::new(1.0, 0.3));
    for _ in 0..2 {
        vector = solver.solve(&vector)?;
        let size = vector.norm();
        if !(size.is_finite() && size > 0.0) {
            return None;
        }
        vector /= Complex::new(size, 0.0);
    }
    Some(vector)
}

/// Counts the orders for which each pole has been the same.
fn follow(found: &mut [Found], last: &[Found], duration: f64) {
    for one in found.iter_mut() {
        let near = last.iter().enumerate().filter(|(_, other)| is_same(one, other, duration));
        let best = near.min_by(|(_, a), (_, b)| distance(one, a).total_cmp(&distance(one, b)));
        if let Some((k, other)) = best {
            one.stable = other.stable + 1;
            one.before = Some(k);
        }
    }
}

fn distance(a: &Found, b: &Found) -> f64 {
    (a.pole.angular - b.pole.angular).hypot(a.pole.decay - b.pole.decay)
}

fn is_same(a: &Found, b: &Found, duration: f64) -> bool {
    let change = (a.pole.natural() - b.pole.natural()).abs();
    let likeness = a.shape.dotc(&b.shape).norm_sqr()
        / (a.shape.norm_squared() * b.shape.norm_squared()).max(f64::MIN_POSITIVE);
    change < SAME.0 * a.pole.natural().min(20.0 / duration)
        && (a.pole.damping() - b.pole.damping()).abs() < SAME.1
        && likeness > ALIKE
}

/// Follows each pole back from the highest order it was found in; returns one of each line, from its middle
/// order.
fn collect(orders: &[Vec<Found>]) -> Vec<Pole> {
    let mut taken: Vec<Vec<bool>> = orders.iter().map(|found| vec![false; found.len()]).collect();
    let mut lines: Vec<(usize, Pole)> = Vec::new();
    for top in (0..orders.len()).rev() {
        for start in 0..orders[top].len() {
            if taken[top][start] || orders[top][start].stable < STABLE {
                continue;
            }
            let mut line = Vec::new();
            let (mut order, mut place) = (top, start);
            loop {
                if taken[order][place] {
                    break;
                }
                taken[order][place] = true;
                line.push(orders[order][place].pole);
                match orders[order][place].before {
                    Some(before) if order > 0 => (order, place) = (order - 1, before),
                    _ => break,
                }
            }
            if line.len() > STABLE {
                lines.push((line.len(), line[line.len() / 2]));
            }
        }
    }
    lines.sort_by_key(|(length, _)| std::cmp::Reverse(*length));
    lines.into_iter().map(|(_, pole)| pole).collect()
}

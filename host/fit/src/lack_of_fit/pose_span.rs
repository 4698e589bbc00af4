//! The space of all linear models of still poses: what any channel's rows contain, in any other channel.
//!
//! Gains, cross-talk, tilt and a wrong axis or sign move the residuals of a channel within it; noise alone is
//! what is left of a measurement outside of it, whatever the model is.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::metric::drift;
use super::noise::{ROUNDING, basis};

/// The noise of an honest channel is larger than its bound once in this many.
const FALSE_ALARM: f64 = 1e-3;
/// No noise is below this share of what is measured: that is rounding, and what models leave out.
const NOISE_FREE: f64 = 1e-4;

/// Returns an orthonormal basis of the columns of all channels, and of a drift.
fn space(rows: &[DMatrix<f64>], poses: usize) -> DMatrix<f64> {
    let drift = drift(poses);
    let all = rows.iter().flat_map(|own| own.column_iter()).chain(drift.column_iter());
    basis(&DMatrix::from_columns(&all.collect::<Vec<_>>()), ROUNDING)
}

/// Returns the largest variance that the noise of each channel may have by the scatter of its measurements
/// about every linear model with a drift; infinite where too few poses are left to tell. Channels of one
/// `unit` are also bounded together: none has more than the sum of all.
pub fn largest_variance(rows: &[DMatrix<f64>], measured: &[DVector<f64>], units: &[&str]) -> Vec<f64> {
    let poses = measured.first().map_or(0, DVector::len);
    let space = space(rows, poses);
    let freedom = poses.saturating_sub(space.ncols()) as f64;
    let left = |own: &DVector<f64>| (own - &space * (space.transpose() * own)).norm_squared();
    let squares: Vec<f64> = measured.iter().map(left).collect();
    let bound = |square: f64, freedom: f64| {
        let least = ChiSquared::new(freedom).map_or(0.0, |chi2| chi2.inverse_cdf(FALSE_ALARM));
        if least > 0.0 { square / least } else { f64::INFINITY }
    };
    let of = |(c, own): (usize, &DVector<f64>)| {
        let alike = || (0..measured.len()).filter(move |other| units.get(*other) == units.get(c));
        let count = alike().count() as f64;
        let all: f64 = alike().filter_map(|other| squares.get(other)).sum();
        let floor = NOISE_FREE * NOISE_FREE * own.norm_squared() / poses.max(1) as f64;
        let together = count * bound(all, count * freedom);
        bound(squares.get(c).copied().unwrap_or(0.0), freedom).min(together).max(floor)
    };
    measured.iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// Twelve poses of three forces, each of them any linear function of gravity with a drift: bounds hold
    /// the variance of the noise, of which one channel has three times the σ, and are no further than
    /// twenty times from it, whatever signs and scales the channels have. Five poses tell nothing.
    #[test]
    fn bounds_hold_the_noise_whatever_the_model_is() {
        let sigma = [0.03, 0.01, 0.01];
        let mut below = 0;
        for seed in 0..300 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let mut draw = || -> f64 { StandardNormal.sample(&mut random) };
            let mixed = DMatrix::from_fn(4, 3, |_, _| 9.8 * draw());
            let gravity = DMatrix::from_fn(12, 4, |_, k| if k == 3 { 1.0 } else { draw() });
            let exact = &gravity * mixed;
            let measured: Vec<_> = (0..3)
                .map(|c| DVector::from_fn(12, |k, _| exact[(k, c)] + 0.1 * k as f64 + sigma[c] * draw()))
                .collect();
            let found = largest_variance(std::slice::from_ref(&gravity), &measured, &["N"; 3]);
            below += found.iter().zip(sigma).filter(|(found, sigma)| **found < sigma * sigma).count();
            assert!(found[0].sqrt() < 20.0 * sigma[0], "{found:?}");
            let few: Vec<_> = measured.iter().map(|own| own.rows(0, 5).into_owned()).collect();
            let few = largest_variance(&[gravity.rows(0, 5).into_owned()], &few, &["N"; 3]);
            assert!(few.iter().all(|bound| bound.is_infinite()));
        }
        assert!(below <= 5, "{below}");
    }
}

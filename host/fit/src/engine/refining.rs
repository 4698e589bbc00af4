//! Weights and columns that the estimate is part of, until it stays where it is.

use nalgebra::DMatrix;

use super::{Engine, Pass, Solved};
use crate::compensation::is_filled;
use crate::signal_noise::RowNoise;
use crate::weighing::Weighing;
use crate::{Estimate, FitError, SignalNoise};

/// Rounds of weights and columns that the estimate is part of.
const ROUNDS: usize = 5;
/// Done when no parameter moves by more than this many standard deviations.
const SETTLED_SD: f64 = 0.1;
/// Noise of the signals does not count if it is at most this share of every channel's variance,
const NEGLIGIBLE_SHARE: f64 = 0.01;
/// and moves no parameter by more than this many standard deviations.
const NEGLIGIBLE_SD: f64 = 0.02;

impl Engine<'_> {
    /// Weighs the rows by the covariance of all noise, takes off what noise in the coefficients adds, and
    /// linearises the columns of nuisance parameters, until the estimate stays where it is.
    pub(super) fn refine<'e>(&'e self, pass: Pass<'e>, sigma_given: bool) -> Result<Pass<'e>, FitError> {
        let noise = self.noise.as_ref().filter(|_| self.source.signal_noise_is_known());
        if noise.is_none() && self.columns.is_empty() {
            return Ok(pass);
        }
        let mut pass = pass;
        let mut before: Option<Estimate> = None;
        for _ in 0..ROUNDS {
            let solved = self.solve(&pass, 1.0);
            let estimate = &solved.own;
            if before.as_ref().is_some_and(|before| estimate.largest_step(before) < SETTLED_SD) {
                break;
            }
            let is_negligible = noise.is_none_or(|noise| self.is_negligible(noise, &pass, estimate));
            if is_negligible && self.columns.is_empty() {
                break;
            }
            let weighing = match noise.filter(|_| !is_negligible) {
                Some(noise) => match self.weigh(noise, &pass, &solved, sigma_given) {
                    Some(weighing) => weighing,
                    None => return Ok(pass),
                },
                None if sigma_given => pass.weighing.clone(),
                None => self.diagonal(self.sigma_from_residuals(&pass)),
            };
            let linearised = self.linearise(&self.significant(&pass, estimate))?;
            pass = self.absorb(weighing, pass.weights, linearised)?;
            before = Some(solved.own);
        }
        Ok(pass)
    }

    /// Returns the weighing by all noise about an estimate; `None` if there is no such covariance.
    pub(super) fn weigh(
        &self,
        noise: &RowNoise,
        pass: &Pass,
        solved: &Solved,
        sigma_given: bool,
    ) -> Option<Weighing> {
        let filter = self.blocks.filter();
        let phi = self.significant(pass, &solved.own);
        let spectra = noise.spectra(&phi, &pass.weighing, filter);
        let all_stated = sigma_given && noise.groups().all(|group| group.stated.is_some());
        let residuals = (!all_stated).then(|| {
            let residuals = self.residuals(self.rows_of(pass), &solved.about.values, &pass.weights);
            Weighing::covariance_of(&residuals, &solved.least_squares, filter)
        });
        let residuals = residuals.as_ref().map(|left| noise.restored(left, self.rows_of(pass)));
        let groups: Vec<&SignalNoise> = noise.groups().collect();
        let by = |signals_given: bool| {
            let residuals = residuals.as_deref();
            pass.weighing.with_signals(&groups, &spectra, residuals, (sigma_given, signals_given), filter)
        };
        if all_stated {
            return by(true);
        }
        // Residuals of an estimate that noise has drawn to zero say nothing of it, nor those of directions
        // that it fills.
        let as_shown = by(true)?;
        if !pass.weighing.is_compensated() {
            return Some(as_shown);
        }
        let gram = noise.gram(&Weighing { signals: as_shown.signals.clone(), ..pass.weighing.clone() });
        let rows = pass.factor.substitute(&DMatrix::identity(pass.factor.parameters(), self.parameters));
        let bounded = by(false)?;
        let is_filled = is_filled(&rows, &self.noise_gram(&gram, 1.0, 0.0), self.source.rounding());
        Some(if is_filled { as_shown.or(&bounded) } else { bounded.or(&as_shown) })
    }

    /// Returns the values that count in the covariance of the noise.
    pub(super) fn significant(&self, pass: &Pass, estimate: &Estimate) -> Vec<f64> {
        let first = !pass.weighing.is_compensated();
        if first {
            let spurious = self.spurious_information(&pass.weighing.sigma);
            Weighing::significant(&self.without_spurious(estimate, spurious), false)
        } else {
            Weighing::significant(estimate, false)
        }
    }

    /// Returns true if noise of the signals is a small part of that in the residuals, and moves no parameter
    /// by much of its standard deviation: the channels' own weights are then as good, and cost less.
    pub(super) fn is_negligible(&self, noise: &RowNoise, pass: &Pass, estimate: &Estimate) -> bool {
        if pass.weighing.is_compensated() {
            return false;
        }
        let phi = self.significant(pass, estimate);
        let spectra = noise.spectra(&phi, &pass.weighing, self.blocks.filter());
        if noise.share(&spectra, &pass.weighing, self.blocks.filter()) > NEGLIGIBLE_SHARE {
            return false;
        }
        let moved = &estimate.covariance * noise.pull(&pass.weighing, &phi);
        (0..estimate.len())
            .filter(|j| estimate.is_determined(*j))
            .all(|j| moved[j].abs() <= NEGLIGIBLE_SD * estimate.covariance[(j, j)].max(0.0).sqrt())
    }
}

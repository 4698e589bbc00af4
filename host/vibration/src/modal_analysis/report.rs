//! Findings of a fit, from what its components are and what it leaves.

use nalgebra::{Complex, DMatrix};

use super::amplitudes::{Amplitudes, Noise, amplitudes};
use super::decay_fit::Fit;
use super::findings::Finding;
use super::harmonics::{Harmonic, SHIFT_LIMIT, Shift, combinations, harmonics, shifts};
use super::input::{FreeDecay, ModalError, Options};
use super::roles::{APART, LEAST_CYCLES, Role, distance, resolution_hz, roles};
use super::search::{left, quantile, strongest_line};
use super::shape::Mode;
use super::spectrum::{Levels, Periodogram};
use super::triangle::{Pole, Samples, residuals};

/// Steps of the fit to all samples; it begins where the fit to fewer ended.
const LAST_STEPS: usize = 8;
/// Cycles below which a mode is warned of.
const FEW_CYCLES: f64 = 5.0;
/// Power of noise around a mode, by its mean, that is said.
const COLOURED: f64 = 2.5;
/// Lines of the residual that are said at most.
const MOST_LINES: usize = 5;

/// The evidence that findings are made from.
pub(super) struct Evidence<'a> {
    decay: &'a FreeDecay<'a>,
    pub(super) options: &'a Options,
    /// Samples at the rate of the search, and the fit to them; the same components as the final fit.
    searched: (&'a Samples, Fit),
    /// All samples, and the final fit.
    samples: &'a Samples,
    pub(super) fit: Fit,
    pub(super) amplitudes: Amplitudes,
    pub(super) roles: Vec<Role>,
    /// Energy of each component by the variance of the noise near it.
    pub(super) strengths: Vec<f64>,
    pub(super) noise: Noise,
    /// Changes of frequency beyond noise.
    shifts: Vec<Shift>,
    /// Residuals, their spectrum and its levels.
    columns: DMatrix<f64>,
    spectrum: Periodogram,
    levels: Levels,
}

impl<'a> Evidence<'a> {
    /// Fits poles to all samples, and to those at the lower rate of the search; says what each of them is.
    ///
    /// # Errors
    /// [`ModalError`] if poles are not distinguished, or nothing comes round often enough.
    pub(super) fn new(
        decay: &'a FreeDecay<'a>,
        options: &'a Options,
        (samples, searched): (&'a Samples, &'a Samples),
        poles: Vec<Pole>,
    ) -> Result<Self, ModalError> {
        let modes = poles.len();
        let failed = |reason: &str| ModalError::Fit { modes, reason: reason.to_owned() };
        let searched_fit = Fit::at(searched, poles.clone())
            .ok_or_else(|| failed("the modes are not distinguished at the lower rate"))?;
        let fit = Fit::refined(samples, poles, LAST_STEPS)
            .ok_or_else(|| failed("the modes are not distinguished at the full rate"))?;
        let columns = residuals(samples, &fit.poles, &fit.amplitudes);
        let (spectrum, levels) = left(samples, Some(&fit));
        let noise = Noise::new(&fit, &columns, &spectrum);
        let mut amplitudes =
            amplitudes(&fit, &noise).ok_or_else(|| failed("two of them coincide; ask for fewer"))?;
        let strengths: Vec<f64> =
            (0..modes).map(|r| fit.strength(r, &coloured_levels(&fit, &noise, r))).collect();
        let roles = roles(&fit.poles, &amplitudes, &strengths, decay.duration_s(), options);
        check_length(decay, &fit, &roles)?;
        let shifts =
            if fit.is_exact() { Vec::new() } else { changes((searched, &searched_fit), &roles, &noise) };
        count_shifts(&mut amplitudes, &shifts);
        Ok(Self {
            decay,
            options,
            searched: (searched, searched_fit),
            samples,
            fit,
            amplitudes,
            roles,
            strengths,
            noise,
            shifts,
            columns,
            spectrum,
            levels,
        })
    }

    /// Returns all findings, errors first.
    pub(super) fn findings(&self, modes: &[Mode]) -> Vec<Finding> {
        let mut found = self.of_components();
        found.extend(self.close());
        found.extend(self.missing());
        found.extend(self.nonlinear());
        if !self.fit.is_exact() {
            found.extend(self.lines());
            found.extend(self.noise());
            let amplitudes = self.amplitudes.selected(&self.with(Role::Mode));
            found.extend(complex(&amplitudes, modes, |c| self.scale(c)));
        }
        found.sort_by_key(|finding| std::cmp::Reverse(finding.severity()));
        found
    }

    fn with(&self, role: Role) -> Vec<usize> {
        (0..self.roles.len()).filter(|r| self.roles[*r] == role).collect()
    }

    fn strongest_channel(&self, component: usize) -> String {
        let size = |c: &usize| {
            let x = self.fit.amplitudes.view((1 + 2 * component, *c), (2, 1)).norm();
            x / self.fit.sigma[*c]
        };
        let channel = (0..self.fit.sigma.len()).max_by(|a, b| size(a).total_cmp(&size(b)));
        self.decay.name(channel.unwrap_or(0))
    }

    fn of_components(&self) -> Vec<Finding> {
        let duration = self.decay.duration_s();
        let mut found = Vec::new();
        for (r, role) in self.roles.iter().enumerate() {
            let hz = self.fit.poles[r].hz();
            let cycles = hz * duration;
            let (damping, sd) = (self.amplitudes.damping[r], self.amplitudes.deviations(r).1);
            match role {
                Role::TooShort | Role::Mode if cycles < FEW_CYCLES => {
                    let is_refused = cycles < LEAST_CYCLES;
                    found.push(Finding::FewCycles { hz, cycles, needed_s: FEW_CYCLES / hz, is_refused });
                }
                Role::Mode if damping < 2.0 * sd => found.push(Finding::NoDecay { hz, damping, sd }),
                Role::Disturbance => {
                    let channel = self.strongest_channel(r);
                    found.push(Finding::Disturbance { hz, damping, sd, channel });
                }
                Role::Other if cycles >= LEAST_CYCLES => {
                    let ratio = self.strengths[r].sqrt();
                    found.push(Finding::OtherLine { hz, ratio, channel: self.strongest_channel(r) });
                }
                _ => {}
            }
        }
        found
    }

    fn scale(&self, channel: usize) -> f64 {
        self.options.scales.get(channel).copied().unwrap_or(1.0)
    }

    /// Returns real and imaginary parts of components' scaled amplitudes, brought to unit length for each
    /// component.
    fn directions(&self, components: &[usize]) -> DMatrix<f64> {
        let channels = self.fit.sigma.len();
        let mut all = DMatrix::zeros(channels, 2 * components.len());
        for (k, r) in components.iter().enumerate() {
            let z = self.amplitudes.complex.column(*r);
            let sum: Complex<f64> = (0..channels).map(|c| (z[c] / self.scale(c)).powi(2)).sum();
            let turn = Complex::from_polar(1.0, -0.5 * sum.arg());
            for c in 0..channels {
                let turned = z[c] / self.scale(c) * turn;
                all[(c, 2 * k)] = turned.re;
                all[(c, 2 * k + 1)] = turned.im;
            }
            let size = all.columns(2 * k, 2).norm().max(f64::MIN_POSITIVE);
            all.columns_mut(2 * k, 2).unscale_mut(size);
        }
        all
    }

    fn close(&self) -> Vec<Finding> {
        let mut found = Vec::new();
        for (i, role) in self.roles.iter().enumerate() {
            let Role::TooClose(j) = role else { continue };
            if *j < i && self.roles[*j] == Role::TooClose(i) {
                continue;
            }
            let j = *j;
            let u = self.directions(&[i, j]).svd(true, false).u;
            let axis = |k: usize| {
                let take = |u: &DMatrix<f64>| u.column(k.min(u.ncols() - 1)).iter().copied().collect();
                u.as_ref().map_or_else(Vec::new, take)
            };
            found.push(Finding::TooClose {
                hz: [self.fit.poles[i].hz(), self.fit.poles[j].hz()],
                distance: distance(&self.amplitudes, i, j),
                least: APART,
                resolution_hz: resolution_hz(&self.fit.poles, i, j, self.decay.duration_s()),
                plane: [axis(0), axis(1)],
            });
        }
        found
    }

    /// Returns the direction that found shapes reach least: the last left singular vector of them.
    fn missing(&self) -> Option<Finding> {
        let wanted = self.options.modes?;
        let is_found = |r: &usize| matches!(self.roles[*r], Role::Mode | Role::TooClose(_) | Role::TooShort);
        let found: Vec<usize> = (0..self.roles.len()).filter(is_found).collect();
        if found.len() >= wanted {
            return None;
        }
        let channels = self.fit.sigma.len();
        let real = DMatrix::from_fn(channels, found.len(), |c, k| self.directions(&[found[k]])[(c, 0)]);
        let eigen = (&real * real.transpose()).symmetric_eigen();
        let vector: Vec<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imin()).iter().copied().collect();
        let mut order: Vec<usize> = (0..channels).collect();
        order.sort_by(|a, b| vector[*b].abs().total_cmp(&vector[*a].abs()));
        let sign = vector[order[0]].signum();
        let vector: Vec<f64> = vector.iter().map(|v| v * sign).collect();
        let is_large = |c: &&usize| vector[**c].abs() > 0.2;
        let words: Vec<String> = order
            .iter()
            .filter(is_large)
            .map(|c| format!("{:+.2} {}", vector[*c], self.decay.name(*c)))
            .collect();
        Some(Finding::MissingModes {
            wanted,
            found: found.len(),
            direction: words.join(" "),
            channel: self.decay.name(order[0]),
            vector,
        })
    }

    fn nonlinear(&self) -> Vec<Finding> {
        let modes = self.with(Role::Mode);
        let exact = self.fit.is_exact();
        let combinations = combinations(&self.searched.1.poles, &modes, &self.strengths);
        let mut lines = if exact {
            Vec::new()
        } else {
            harmonics(self.samples, &self.fit, &self.columns, &self.spectrum, combinations)
        };
        lines.extend(self.fitted_harmonics(&modes));
        let mut found = self.beside(|parent| self.shifts.iter().any(|s| s.component == parent));
        let mut said = vec![false; lines.len()];
        for shift in &self.shifts {
            let of = lines.iter().position(|line| line.combination.parent == shift.component);
            found.push(self.shift_finding(shift, of.map(|k| &lines[k])));
            for (said, line) in said.iter_mut().zip(&lines) {
                *said |= line.combination.parent == shift.component;
            }
        }
        let rest = lines.into_iter().zip(said).filter(|(_, said)| !said).take(MOST_LINES);
        found.extend(rest.map(|(line, _)| Finding::Harmonic {
            line_hz: line.combination.pole.hz(),
            combination: line.combination.words,
            ratio: line.ratio,
            limit: line.limit,
        }));
        found
    }

    /// Returns findings of weak components beside modes that no change of the mode's frequency explains.
    fn beside(&self, explained: impl Fn(usize) -> bool) -> Vec<Finding> {
        let of = |(r, role): (usize, &Role)| match role {
            Role::Beside(parent) if !explained(*parent) => {
                let (hz, ratio) = (self.fit.poles[r].hz(), self.strengths[r].sqrt());
                Some(Finding::OtherLine { hz, ratio, channel: self.strongest_channel(r) })
            }
            _ => None,
        };
        self.roles.iter().enumerate().filter_map(of).collect()
    }

    fn shift_finding(&self, shift: &Shift, line: Option<&Harmonic>) -> Finding {
        let r = shift.component;
        let hz = self.fit.poles[r].hz();
        let own = self.amplitudes.deviations(r).0 / self.amplitudes.angular[r];
        let own = (own * own - 2.0 * shift.relative.powi(2)).max(0.0).sqrt();
        // The shift grows with the square of the amplitude.
        let smaller_by = (shift.relative.abs() / own.max(1e-12)).sqrt().max(1.0);
        let (relative, shift_sd, limit) = (shift.relative, shift.sd, SHIFT_LIMIT * shift.sd);
        match line {
            Some(line) => Finding::LargeAmplitude {
                hz,
                shift: relative,
                shift_sd,
                limit,
                combination: line.combination.words.clone(),
                line_hz: line.combination.pole.hz(),
                ratio: line.ratio,
                smaller_by,
            },
            None => Finding::FrequencyShift { hz, shift: relative, shift_sd, limit, smaller_by },
        }
    }

    /// Combinations that were strong enough to be fitted as components.
    fn fitted_harmonics(&self, modes: &[usize]) -> Vec<Harmonic> {
        let limit = quantile(2.0 * self.fit.sigma.len() as f64, 1e-4);
        let nearest = |r: usize| {
            let off = |pole: f64| (pole - self.fit.poles[r].angular).abs();
            combinations(&self.fit.poles, modes, &self.strengths)
                .into_iter()
                .min_by(|a, b| off(a.pole.angular).total_cmp(&off(b.pole.angular)))
        };
        let to_harmonic = |r: usize| {
            let combination = nearest(r)?;
            let by = self.strengths[combination.parent].max(f64::MIN_POSITIVE);
            let (ratio, limit) = ((self.strengths[r] / by).sqrt(), (limit / by).sqrt());
            Some(Harmonic { combination, ratio, limit })
        };
        self.with(Role::Harmonic).into_iter().filter_map(to_harmonic).collect()
    }

    /// Returns findings of lines that the final residual still has.
    fn lines(&self) -> Vec<Finding> {
        let channels = self.fit.sigma.len();
        let duration = self.decay.duration_s();
        let modes = self.with(Role::Mode);
        let known: Vec<f64> =
            combinations(&self.fit.poles, &modes, &self.strengths).iter().map(|c| c.pole.hz()).collect();
        let mut avoid = Vec::new();
        let mut found = Vec::new();
        while found.len() < MOST_LINES && avoid.len() < 40 {
            let Some(line) = strongest_line(&self.spectrum, &self.levels, channels, &avoid) else { break };
            avoid.push(line.hz);
            let row = (line.hz / self.spectrum.hz(1)).round() as usize;
            let levels = self.levels.at(line.hz);
            let by_noise = |c: &usize| self.spectrum.at(row)[*c] / levels[*c].max(f64::MIN_POSITIVE);
            let channel = (0..channels).max_by(|a, b| by_noise(a).total_cmp(&by_noise(b))).unwrap_or(0);
            let is_drift = line.hz * duration < LEAST_CYCLES;
            if is_drift || known.iter().any(|hz| (hz - line.hz).abs() < 1.5 / duration) {
                continue;
            }
            let ratio = by_noise(&channel).sqrt();
            found.push(Finding::OtherLine { hz: line.hz, ratio, channel: self.decay.name(channel) });
        }
        found
    }

    fn noise(&self) -> Vec<Finding> {
        let of = |r: usize| {
            let ratios = &self.noise.coloured[r];
            let worst = (0..ratios.len()).max_by(|a, b| ratios[*a].total_cmp(&ratios[*b]))?;
            let (hz, ratio) = (self.fit.poles[r].hz(), ratios[worst]);
            let channel = self.decay.name(worst);
            (ratio > COLOURED).then_some(Finding::ColouredNoise { hz, channel, ratio })
        };
        self.with(Role::Mode).into_iter().filter_map(of).collect()
    }
}

/// Returns the modes whose imaginary part is beyond noise and a tenth of the whole, from their amplitudes in
/// channels of these scales.
pub fn complex(amplitudes: &Amplitudes, modes: &[Mode], scale: impl Fn(usize) -> f64) -> Vec<Finding> {
    let (channels, stride) = (amplitudes.complex.nrows(), amplitudes.stride());
    let of = |r: usize| {
        let mode = modes.iter().find(|mode| mode.angular == amplitudes.angular[r])?;
        let (mut noise, mut size) = (0.0, 0.0);
        for c in 0..channels {
            let k = r * stride + 2 + c;
            let both = amplitudes.covariance[(k, k)] + amplitudes.covariance[(k + channels, k + channels)];
            noise += 0.5 * both / scale(c).powi(2);
            size += amplitudes.complex[(c, r)].norm_sqr() / scale(c).powi(2);
        }
        let (noise, share) = ((noise / size.max(f64::MIN_POSITIVE)).sqrt(), mode.imaginary_share);
        let is_beyond = share > 0.1 && share > 4.0 * noise;
        is_beyond.then(|| Finding::Complex { hz: mode.hz(), share, noise })
    };
    (0..amplitudes.complex.ncols()).filter_map(of).collect()
}

/// Returns the modes' changes of frequency that are beyond noise.
fn changes((samples, fit): (&Samples, &Fit), roles: &[Role], noise: &Noise) -> Vec<Shift> {
    let mean = |ratios: &Vec<f64>| (ratios.iter().sum::<f64>() / ratios.len().max(1) as f64).sqrt();
    let wider: Vec<f64> = noise.coloured.iter().map(mean).collect();
    let near: Vec<usize> = (0..roles.len())
        .filter(|r| !matches!(roles[*r], Role::Beside(_) | Role::TooShort | Role::Harmonic))
        .collect();
    let is_reported =
        |s: &Shift| roles[s.component] == Role::Mode && s.relative.abs() > (SHIFT_LIMIT * s.sd).max(1e-9);
    shifts(samples, fit, &near, &wider).into_iter().filter(is_reported).collect()
}

/// Counts changes of frequency as variance of the frequencies: once as one effect that all share, the
/// amplitude's, and once as many.
fn count_shifts(amplitudes: &mut Amplitudes, shifts: &[Shift]) {
    let stride = amplitudes.stride();
    let place = |s: &Shift| (s.component * stride, s.relative * amplitudes.angular[s.component]);
    let all: Vec<(usize, f64)> = shifts.iter().map(place).collect();
    for (i, a) in &all {
        for (j, b) in &all {
            amplitudes.covariance[(*i, *j)] += a * b * if i == j { 2.0 } else { 1.0 };
        }
    }
}

/// Returns the variance of white noise that has the effect of the channels' noise near a component.
fn coloured_levels(fit: &Fit, noise: &Noise, component: usize) -> Vec<f64> {
    let levels: Vec<f64> = fit
        .sigma
        .iter()
        .zip(&noise.coloured[component])
        .map(|(sigma, ratio)| sigma * sigma * ratio)
        .collect();
    fit.above_rounding(&levels)
}

/// Refuses a recording in which nothing comes round often enough.
fn check_length(decay: &FreeDecay<'_>, fit: &Fit, roles: &[Role]) -> Result<(), ModalError> {
    if !roles.iter().all(|role| *role == Role::TooShort) {
        return Ok(());
    }
    let hz = fit.poles.iter().map(|pole| pole.hz()).fold(f64::MIN_POSITIVE, f64::max);
    let duration_s = decay.duration_s();
    let (cycles, needed_s) = (hz * duration_s, 5.0 / hz);
    Err(ModalError::TooShort { duration_s, hz, cycles, least: LEAST_CYCLES, needed_s })
}

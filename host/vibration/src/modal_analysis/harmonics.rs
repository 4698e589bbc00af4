//! Signs of springs that are not linear: multiples and sums of frequencies, and frequencies that change with
//! the amplitude.

use nalgebra::{Complex, DMatrix};

use super::decay_fit::Fit;
use super::search::quantile;
use super::spectrum::Periodogram;
use super::triangle::{Pole, Samples};

/// Chance that noise alone gives a harmonic in a recording.
const FALSE_ALARM: f64 = 1e-4;
/// Standard deviations at which a change of frequency is said.
pub(super) const SHIFT_LIMIT: f64 = 4.5;
/// Strength that a mode must have in both parts for its frequencies to be compared.
const LEAST_STRENGTH: f64 = 200.0;

/// A multiple or a sum of frequencies.
#[derive(Clone, Debug)]
pub(super) struct Combination {
    /// The component it is of, the stronger one if there are two.
    pub(super) parent: usize,
    pub(super) pole: Pole,
    /// The combination in words, with frequencies in Hz.
    pub(super) words: String,
}

/// A combination that stands out of the noise.
#[derive(Clone, Debug)]
pub(super) struct Harmonic {
    pub(super) combination: Combination,
    /// Size by that of the parent, both weighted by noise.
    pub(super) ratio: f64,
    /// The ratio at which it is said.
    pub(super) limit: f64,
}

/// Frequency of a component early and late.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shift {
    pub(super) component: usize,
    /// Relative fall of the frequency.
    pub(super) relative: f64,
    pub(super) sd: f64,
}

/// Returns twice, three times, sums and differences of frequencies. A product of decays decays by the sum of
/// their rates.
pub(super) fn combinations(poles: &[Pole], of: &[usize], strengths: &[f64]) -> Vec<Combination> {
    let mut found = Vec::new();
    for (place, i) in of.iter().enumerate() {
        let a = poles[*i];
        for times in [2.0, 3.0] {
            let pole = Pole { decay: times * a.decay, angular: times * a.angular };
            found.push(Combination { parent: *i, pole, words: format!("{times} × {:.3} Hz", a.hz()) });
        }
        for j in &of[place + 1..] {
            let b = poles[*j];
            let parent = if strengths[*i] >= strengths[*j] { *i } else { *j };
            for (m, n) in [(1.0, 1.0), (1.0, -1.0), (2.0, 1.0), (1.0, 2.0), (2.0, -1.0), (1.0, -2.0)] {
                let angular: f64 = m * a.angular + n * b.angular;
                let decay = m * a.decay + n.abs() * b.decay;
                let sign = if n > 0.0 { '+' } else { '−' };
                let words = format!("{m} × {:.3} {sign} {} × {:.3} Hz", a.hz(), n.abs(), b.hz());
                found.push(Combination { parent, pole: Pole { decay, angular: angular.abs() }, words });
            }
        }
    }
    found
}

/// Searches for combinations in residuals, by the correlation with `e^{−αt − iνt}`: `|Σ r e|² / (σ² Σ e²)` is
/// χ² / 2 of two degrees of freedom for each channel.
pub(super) fn harmonics(
    samples: &Samples,
    fit: &Fit,
    columns: &DMatrix<f64>,
    spectrum: &Periodogram,
    combinations: Vec<Combination>,
) -> Vec<Harmonic> {
    let resolution = std::f64::consts::TAU / samples.duration_s();
    let is_free = |c: &Combination| {
        let apart = |pole: &Pole| {
            (pole.angular - c.pole.angular).abs() > 3.0 * resolution + 2.0 * (pole.decay + c.pole.decay).abs()
        };
        c.pole.hz() < 0.45 * samples.rate_hz
            && c.pole.angular > 2.0 * resolution
            && fit.poles.iter().all(apart)
    };
    let free: Vec<Combination> = combinations.into_iter().filter(is_free).collect();
    let channels: Vec<usize> = (0..fit.sigma.len()).filter(|c| !fit.is_rounding(*c)).collect();
    let limit = 1.15 * quantile(2.0 * channels.len().max(1) as f64, FALSE_ALARM / free.len().max(1) as f64);
    let mut away: Vec<f64> = fit.poles.iter().map(|pole| pole.hz()).collect();
    away.extend(free.iter().map(|c| c.pole.hz()));
    let test = |combination: Combination| {
        let near = spectrum.mean_near(combination.pole.hz(), 16, &away);
        let (energy, sums) = correlation(samples.rate_hz, columns, &combination.pole);
        let (mut statistic, mut size) = (0.0, 0.0);
        for c in &channels {
            let level = near[*c].max(fit.sigma[*c].powi(2));
            statistic += 2.0 * sums[*c].norm_sqr() / (level * energy);
            let amplitude = |k: usize| fit.amplitudes[(2 * combination.parent + k, *c)];
            size += (amplitude(1).powi(2) + amplitude(2).powi(2)) / level;
        }
        // Amplitudes are 2 Σ r e / Σ e².
        let to_ratio = |statistic: f64| (2.0 * statistic / (energy * size.max(f64::MIN_POSITIVE))).sqrt();
        (statistic > limit && energy > 0.0).then(|| Harmonic {
            combination,
            ratio: to_ratio(statistic),
            limit: to_ratio(limit),
        })
    };
    let mut found: Vec<Harmonic> = free.into_iter().filter_map(test).collect();
    found.sort_by(|a, b| b.ratio.total_cmp(&a.ratio));
    found
}

/// Returns `Σ e²` and `Σ r_c e` for `e = e^{−αt − iνt}`.
fn correlation(rate_hz: f64, columns: &DMatrix<f64>, pole: &Pole) -> (f64, Vec<Complex<f64>>) {
    let mut energy = 0.0;
    let mut sums = vec![Complex::new(0.0, 0.0); columns.ncols()];
    for row in 0..columns.nrows() {
        let t = row as f64 / rate_hz;
        let value = Complex::from_polar((-pole.decay * t).exp(), -pole.angular * t);
        energy += value.norm_sqr();
        for (sum, r) in sums.iter_mut().zip(columns.row(row).iter()) {
            *sum += value * *r;
        }
    }
    (energy, sums)
}

/// Fits the early and the late part of a decay by themselves, and compares the frequencies of components. The
/// recording is cut in its middle, or where the component has decayed to 1/e if that is earlier.
pub(super) fn shifts(samples: &Samples, fit: &Fit, components: &[usize], wider: &[f64]) -> Vec<Shift> {
    let middle = samples.y.nrows() / 2;
    let mut cuts: Vec<(usize, Vec<usize>)> = Vec::new();
    for r in components {
        let rate = fit.poles[*r].decay.max(1e-12);
        let cut = ((samples.rate_hz / rate) as usize).min(middle);
        match cuts.iter_mut().find(|(other, _)| cut.abs_diff(*other) * 4 < cut) {
            Some((_, group)) => group.push(*r),
            None => cuts.push((cut, vec![*r])),
        }
    }
    let mut found = Vec::new();
    for (cut, group) in cuts {
        let early = part(samples, fit, components, 0, cut);
        let late = part(samples, fit, components, cut, samples.y.nrows() - cut);
        let (Some(early), Some(late)) = (early, late) else { continue };
        let of = |part: &Part, r: usize, rows: usize| {
            frequency(part, r, &fit.poles[r], rows as f64 / samples.rate_hz)
        };
        for r in group {
            let both = (of(&early, r, cut), of(&late, r, samples.y.nrows() - cut));
            if let (Some(a), Some(b)) = both {
                let angular = fit.poles[r].angular;
                let sd = wider[r] * a.1.hypot(b.1) / angular;
                found.push(Shift { component: r, relative: (a.0 - b.0) / angular, sd });
            }
        }
    }
    found
}

/// A part's fit, with the components it is of.
type Part = (Fit, Vec<usize>);

fn part(samples: &Samples, fit: &Fit, components: &[usize], first: usize, rows: usize) -> Option<Part> {
    let (begin, length) = (first as f64 / samples.rate_hz, rows as f64 / samples.rate_hz);
    let strength = |r: &usize| {
        let pole = fit.poles[*r];
        let steps = 64;
        let step = length / f64::from(steps);
        let times = (0..steps).map(|k| begin + (f64::from(k) + 0.5) * step);
        let energy: f64 = times.map(|t| (-2.0 * pole.decay * t).exp()).sum::<f64>() * step * samples.rate_hz;
        let of = |c: usize| {
            let x = fit.amplitudes.view((1 + 2 * *r, c), (2, 1)).norm_squared();
            0.5 * x * energy / fit.sigma[c].powi(2)
        };
        (0..fit.sigma.len()).map(of).sum::<f64>()
    };
    let kept: Vec<usize> =
        components.iter().copied().filter(|r| strength(r) > 0.1 * LEAST_STRENGTH).collect();
    let poles: Vec<Pole> = kept.iter().map(|r| fit.poles[*r]).collect();
    let own = samples.part(first, rows);
    // A part may be too short to hold what the whole holds.
    let fit = Fit::refined(&own, poles.clone(), 20);
    Some((fit.or_else(|| Fit::refined(&own.holding(Vec::new()), poles, 20))?, kept))
}

/// Returns the angular frequency of a component in a part, with its standard deviation; nothing where it is
/// too weak or has run away.
fn frequency(part: &Part, component: usize, whole: &Pole, duration_s: f64) -> Option<(f64, f64)> {
    let (fit, kept) = part;
    let place = kept.iter().position(|r| *r == component)?;
    let level: Vec<f64> = fit.sigma.iter().map(|s| s * s).collect();
    if fit.strength(place, &level) < LEAST_STRENGTH {
        return None;
    }
    let covariance = fit.pole_covariance()?;
    let k = 2 * place + 1;
    let (pole, sd) = (fit.poles[place], covariance[(k, k)].max(0.0).sqrt());
    let reach = std::f64::consts::TAU / duration_s + whole.decay.abs() + pole.decay.abs();
    ((pole.angular - whole.angular).abs() < reach).then_some((pole.angular, sd))
}

//! The number of components of a decay: first those that are stable over orders, without those that noise
//! explains as well; then, one after the other, what still stands out of the residual's spectrum, as long as
//! the likelihood gains by it.

use nalgebra::DMatrix;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::decay_fit::Fit;
use super::spectrum::{Levels, Periodogram};
use super::start::stable_poles;
use super::triangle::{Pole, Samples, residuals};

/// Chance that noise alone adds a component.
const FALSE_ALARM: f64 = 1e-5;
/// Power around a pole by the mean, in a channel, at which a second pole is tried there; over this many
/// frequencies on each side.
const COLOURED: f64 = 2.5;
const NARROW: usize = 8;
/// Room for levels of noise that are themselves measured, by some tens of frequencies.
const MARGIN: f64 = 1.4;
/// Components beside the modes: disturbances, harmonics.
pub(super) const BESIDE: usize = 6;
/// Samples for each cycle of the fastest line, in the samples that are searched.
const SAMPLES_A_CYCLE: f64 = 12.0;
/// Samples for each cycle of the fastest line where the first poles are searched.
const FIRST_SAMPLES_A_CYCLE: f64 = 5.0;
/// Parts of a recording from its beginning that are searched on their own where modes are missing, and their
/// least samples.
const EARLY: [usize; 3] = [2, 4, 8];
const LEAST_EARLY: usize = 64;
/// Samples that are always left.
const LEAST_SAMPLES: f64 = 160.0;

/// The components found, and the samples at a lower rate that they were found in.
pub(super) struct Searched {
    pub(super) fit: Option<Fit>,
    pub(super) samples: Samples,
    /// The strongest line, Hz, and its power by that of the noise around it.
    pub(super) strongest: (f64, f64),
}

/// A line of a spectrum, by the noise around it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    pub(super) hz: f64,
    /// Sum over channels of power by noise.
    pub(super) ratio: f64,
}

/// Returns the χ² value that noise exceeds with the probability.
pub(super) fn quantile(freedom: f64, probability: f64) -> f64 {
    ChiSquared::new(freedom).map_or(f64::INFINITY, |law| law.inverse_cdf(1.0 - probability.clamp(1e-13, 1.0)))
}

/// Searches for at most the given number of modes: in samples at a lower rate, which is raised where all
/// samples have a line beyond it that is left, as a fast mode of strong damping has no peak of its own beside
/// slow ones.
pub(super) fn search(samples: &Samples, most: usize) -> Searched {
    let (mut fastest, strongest) = fastest_line(samples);
    loop {
        let averaged = |cycle: f64| {
            let room = samples.y.nrows() as f64 / LEAST_SAMPLES;
            let factor = (samples.rate_hz / (cycle * fastest)).min(room).floor().max(1.0);
            samples.averaged(factor as usize)
        };
        let (first, searched) = (averaged(FIRST_SAMPLES_A_CYCLE), averaged(SAMPLES_A_CYCLE));
        let mut candidates = stable_poles(&first, &noise(&first), most);
        candidates.truncate(most + BESIDE);
        let fit = chosen(&searched, candidates, most + BESIDE);
        let fit = fit.map(|fit| with_early(&first, &searched, fit, most));
        let is_all = searched.y.nrows() == samples.y.nrows() || fit.as_ref().is_some_and(Fit::is_exact);
        let whole =
            (!is_all).then(|| fit.as_ref().and_then(|fit| Fit::at(samples, fit.poles.clone()))).flatten();
        let beyond = whole
            .and_then(|whole| strongest_decay(samples, Some(&whole), samples.y.ncols(), &[]))
            .filter(|line| line.hz > fastest);
        match beyond {
            Some(line) => fastest = 1.3 * line.hz,
            None => return Searched { fit, samples: searched, strongest },
        }
    }
}

/// Returns what the likelihood gains by a pole that fits noise best, at any of the frequencies.
fn chance_limit(samples: &Samples) -> f64 {
    quantile(2.0 * samples.y.ncols() as f64 + 2.0, FALSE_ALARM / samples.y.nrows() as f64)
}

/// Returns the noise of the channels, as standard deviation of the samples, from the middle level of their
/// spectra.
fn noise(samples: &Samples) -> Vec<f64> {
    let spectrum = Periodogram::new(&samples.y, samples.rate_hz, 1, true);
    spectrum.level().iter().map(|level| level.sqrt()).collect()
}

/// Returns the frequency of the fastest line that stands out of its surroundings, and the strongest one, by
/// their power.
fn fastest_line(samples: &Samples) -> (f64, (f64, f64)) {
    let spectrum = Periodogram::new(&samples.y, samples.rate_hz, 1, true);
    let levels = spectrum.levels();
    let channels = samples.y.ncols() as f64;
    let limit = (quantile(2.0 * channels, 1e-4 / spectrum.rows() as f64) / (2.0 * channels)).max(8.0);
    let mut fastest = 8.0 / samples.duration_s();
    let mut strongest = (0.0, 0.0);
    for row in 1..spectrum.rows() {
        let ratio = spectrum.sum(row, &levels.at(spectrum.hz(row))) / channels;
        if ratio > strongest.1 {
            strongest = (spectrum.hz(row), ratio);
        }
        if ratio > limit {
            fastest = fastest.max(spectrum.hz(row));
        }
    }
    (fastest, strongest)
}

/// Returns spectrum and levels of a fit's residuals.
pub(super) fn left(samples: &Samples, fit: Option<&Fit>) -> (Periodogram, Levels) {
    let columns =
        fit.map_or_else(|| samples.y.clone(), |fit| residuals(samples, &fit.poles, &fit.amplitudes));
    let spectrum = Periodogram::new(&columns, samples.rate_hz, 2, false);
    let levels = spectrum.levels();
    (spectrum, levels)
}

/// Returns the strongest line of a residual that noise does not explain, nearer than nothing to zero
/// frequency.
pub(super) fn strongest_line(
    spectrum: &Periodogram,
    levels: &Levels,
    channels: usize,
    avoid: &[f64],
) -> Option<Line> {
    let bins = 2.0 * spectrum.independent() as f64;
    let limit = 0.5 * MARGIN * quantile(2.0 * channels as f64, FALSE_ALARM / bins);
    let lines = (2..spectrum.rows()).map(|row| {
        let hz = spectrum.hz(row);
        Line { hz, ratio: spectrum.sum(row, &levels.at(hz)) }
    });
    let width = 2.0 * spectrum.hz(1);
    lines
        .filter(|line| line.ratio > limit && avoid.iter().all(|hz| (hz - line.hz).abs() > width))
        .max_by(|a, b| a.ratio.total_cmp(&b.ratio))
}

/// Returns the strongest line of the residual under windows `e^{−αt}` over 3/α, of which one is near the
/// decay of what is left there.
fn strongest_decay(samples: &Samples, fit: Option<&Fit>, channels: usize, refused: &[f64]) -> Option<Line> {
    let columns =
        fit.map_or_else(|| samples.y.clone(), |fit| residuals(samples, &fit.poles, &fit.amplitudes));
    let duration = samples.duration_s();
    let lines = [0.0, 3.0, 10.0, 30.0].into_iter().filter_map(|decays| {
        let decay = decays / duration;
        let rows = (columns.nrows() as f64 * 3.0 / f64::max(decays, 3.0)) as usize;
        let size = |row: usize| (-decay * row as f64 / samples.rate_hz).exp();
        let part = DMatrix::from_fn(rows, columns.ncols(), |row, c| columns[(row, c)] * size(row));
        let spectrum = (rows >= 48).then(|| Periodogram::new(&part, samples.rate_hz, 2, false))?;
        strongest_line(&spectrum, &spectrum.levels(), channels, refused)
    });
    lines.max_by(|a, b| a.ratio.total_cmp(&b.ratio))
}

/// Prunes and adds until nothing changes.
pub(super) fn chosen(samples: &Samples, candidates: Vec<Pole>, most: usize) -> Option<Fit> {
    let channels = samples.y.ncols();
    let mut fit = begun(samples, candidates);
    let mut refused: Vec<f64> = Vec::new();
    for _ in 0..3 * most {
        let poles = fit.as_ref().map_or_else(Vec::new, |fit| fit.poles.clone());
        if poles.len() >= most || fit.as_ref().is_some_and(Fit::is_exact) {
            break;
        }
        let Some(line) = strongest_decay(samples, fit.as_ref(), channels, &refused) else {
            match fit.as_ref().and_then(|fit| split(samples, fit)) {
                Some(better) => {
                    fit = pruned(samples, better);
                    if fit.as_ref().map_or(0, |fit| fit.poles.len()) > poles.len() {
                        continue;
                    }
                    break;
                }
                None => break,
            }
        };
        match extended(samples, fit.as_ref(), &poles, line) {
            Some(better) => {
                fit = pruned(samples, better);
                if fit.as_ref().map_or(0, |fit| fit.poles.len()) <= poles.len() {
                    refused.push(line.hz);
                }
            }
            None => refused.push(line.hz),
        }
    }
    fit
}

/// Adds poles that parts from the beginning show, as long as modes are missing and the likelihood gains by
/// them: where damping is strong most of a recording is noise, in which orders agree on nothing.
fn with_early(first: &Samples, samples: &Samples, mut fit: Fit, most: usize) -> Fit {
    for parts in EARLY {
        let rows = first.y.nrows() / parts;
        if rows < LEAST_EARLY || fit.is_exact() || fit.poles.len() >= most {
            break;
        }
        let part = first.part(0, rows);
        for pole in stable_poles(&part, &noise(&part), most) {
            if fit.poles.len() >= most {
                return fit;
            }
            let mut poles = fit.poles.clone();
            poles.push(pole);
            let Some(more) = Fit::refined(samples, poles, 25) else { continue };
            if fit.objective - more.objective < gain_limit(samples, &more, pole.hz()) {
                continue;
            }
            fit = pruned(samples, more).filter(|kept| kept.poles.len() > fit.poles.len()).unwrap_or(fit);
        }
    }
    fit
}

/// Returns the candidates that hold together, without those that noise explains.
fn begun(samples: &Samples, candidates: Vec<Pole>) -> Option<Fit> {
    let mut poles = candidates;
    while !poles.is_empty() {
        if let Some(fit) = Fit::at(samples, poles.clone()) {
            let fit = pruned(samples, fit)?;
            let fit = Fit::refined(samples, fit.poles, 25)?;
            return pruned(samples, fit);
        }
        poles.pop();
    }
    None
}

/// Returns what the likelihood must gain by a pole where noise is stronger than its mean.
fn gain_limit(samples: &Samples, fit: &Fit, hz: f64) -> f64 {
    let (_, levels) = left(samples, Some(fit));
    let levels = fit.above_rounding(&levels.at(hz));
    let ratios = levels.iter().zip(&fit.sigma).map(|(level, sigma)| level / (sigma * sigma));
    chance_limit(samples) * (ratios.sum::<f64>() / levels.len().max(1) as f64).max(1.0)
}

/// Leaves out one of two poles that are closer than what length and decay resolve, where the likelihood
/// hardly loses by it: their amplitudes are large against each other, so that each for itself seems strong.
fn parted(samples: &Samples, fit: Fit) -> Fit {
    let mut fit = fit;
    for _ in 0..fit.poles.len() {
        let reach = |a: &Pole, b: &Pole| {
            std::f64::consts::TAU / samples.duration_s() + a.decay.abs().max(b.decay.abs())
        };
        let close = (0..fit.poles.len()).flat_map(|i| (0..i).map(move |j| (i, j))).filter(|(i, j)| {
            let (a, b) = (&fit.poles[*i], &fit.poles[*j]);
            (a.angular - b.angular).abs() < 2.0 * reach(a, b)
        });
        let without = close.flat_map(|(i, j)| [i, j]).find_map(|r| {
            let mut poles = fit.poles.clone();
            let gone = poles.remove(r);
            let fewer = Fit::refined(samples, poles, 25)?;
            let loss = fewer.objective - fit.objective;
            (loss < gain_limit(samples, &fit, gone.hz())).then_some(fewer)
        });
        match without {
            Some(fewer) => fit = fewer,
            None => break,
        }
    }
    fit
}

/// Leaves out poles whose amplitudes noise explains, the weakest first.
fn pruned(samples: &Samples, fit: Fit) -> Option<Fit> {
    let limit = MARGIN * chance_limit(samples);
    let mut fit = fit;
    loop {
        let (_, levels) = left(samples, Some(&fit));
        let strengths: Vec<f64> = fit
            .poles
            .iter()
            .enumerate()
            .map(|(r, pole)| fit.strength(r, &fit.above_rounding(&levels.at(pole.hz()))))
            .collect();
        let weakest = strengths.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1));
        match weakest {
            Some((r, strength)) if *strength < limit => {
                let mut poles = fit.poles.clone();
                poles.remove(r);
                if poles.is_empty() {
                    return None;
                }
                fit = Fit::refined(samples, poles, 25)?;
            }
            Some(_) => return Some(parted(samples, fit)),
            None => return None,
        }
    }
}

/// Returns the fit with one more pole beside one that has more than noise around it: two broad modes over
/// each other leave no line.
fn split(samples: &Samples, fit: &Fit) -> Option<Fit> {
    let (spectrum, _) = left(samples, Some(fit));
    let away: Vec<f64> = fit.poles.iter().map(Pole::hz).collect();
    let is_coloured = |pole: &&Pole| {
        let near = spectrum.mean_near(pole.hz(), NARROW, &away);
        near.iter().zip(&fit.sigma).any(|(near, sigma)| near / (sigma * sigma) > COLOURED)
    };
    fit.poles.iter().filter(is_coloured).find_map(|pole| {
        let reach = pole.decay.abs() + std::f64::consts::TAU / samples.duration_s();
        let tried = [-1.0, 1.0].into_iter().flat_map(|side| [0.5, 2.0].map(|times| (side, times)));
        let best = tried
            .filter_map(|(side, times)| {
                let mut poles = fit.poles.clone();
                poles.push(Pole { decay: times * pole.decay.abs(), angular: pole.angular + side * reach });
                Fit::at(samples, poles)
            })
            .min_by(|a, b| a.objective.total_cmp(&b.objective))?;
        let refined = Fit::refined(samples, best.poles, 40)?;
        let gain = fit.objective - refined.objective;
        (gain > gain_limit(samples, &refined, pole.hz())).then_some(refined)
    })
}

/// Returns the fit with one more pole near a line, if the likelihood gains more than noise gives.
fn extended(samples: &Samples, fit: Option<&Fit>, poles: &[Pole], line: Line) -> Option<Fit> {
    let duration = samples.duration_s();
    let angular = line.hz * std::f64::consts::TAU;
    let tried = [0.1, 1.0, 4.0, 15.0].into_iter().filter_map(|decays| {
        let decay = decays / duration;
        let mut poles = poles.to_vec();
        poles.push(Pole { decay, angular });
        (decay < 0.5 * angular).then(|| Fit::at(samples, poles)).flatten()
    });
    let best = tried.min_by(|a, b| a.objective.total_cmp(&b.objective))?;
    let refined = Fit::refined(samples, best.poles, 25)?;
    let before = fit
        .map_or_else(|| Fit::at(samples, Vec::new()).map(|none| none.objective), |fit| Some(fit.objective))?;
    (before - refined.objective > gain_limit(samples, &refined, line.hz)).then_some(refined)
}

//! An answer from what a memory keeps of a recording: the firmware's forgetting and windows, in f64.
//!
//! Lives here: one pass in the order of time, as the device does it, and what is different about the conclusions:
//! residuals count as far as the memory reaches. May not live here: the memory itself
//! ([`rigident_shared::forgetting`]).

use rigident_shared::estimator::{Counters, Estimator, Outcome};
use rigident_shared::factor::InformationFactor;
use rigident_shared::forgetting::{MemoryConfig, Span};

use super::course::end_at;
use super::pooled::Judgement;
use super::residuals::{raw_sigma, residuals, rms};
use super::{
    Absorbed, BlockResidual, Factor, Identification, IdentificationError, Input, NOMINAL_SIGMA, Progression,
    TAPS, colour, conclude, config, knocks, shares,
};
use crate::answer::result::MemoryResult;
use crate::answer::{Estimate, NORMAL_COVERAGE, Noise};

/// Identifies the body in S as the memory has it at the end, with about `points` estimates on the way.
///
/// # Errors
/// [`IdentificationError`] if no row could be absorbed or the memory does not fit the rows.
pub fn identify_remembered(
    input: &Input,
    memory: &MemoryConfig<f64>,
    points: usize,
) -> Result<(Identification, Vec<Progression>), IdentificationError> {
    if input.known_offset.is_some() {
        run::<10>(input, memory, points, |f| Factor::Ten(Box::new(f)))
    } else {
        run::<16>(input, memory, points, |f| Factor::Sixteen(Box::new(f)))
    }
}

/// The same conclusions for a factor that the firmware's memory holds after these readings, whitened by
/// `input.channel_sigma`, of which `knocks` rows of each channel counted less.
///
/// # Errors
/// [`IdentificationError`] if there is no row, or no σ that it was whitened by.
pub fn conclude_remembered(
    input: &Input,
    memory: &MemoryConfig<f64>,
    factor: Factor,
    knocks: [u16; 6],
    sigma_given: bool,
) -> Result<Identification, IdentificationError> {
    let sigma = input.channel_sigma.unwrap_or(NOMINAL_SIGMA);
    match factor {
        Factor::Ten(f) => {
            let absorbed =
                Absorbed::<10> { factor: *f, ..super::absorb(input, &shares(input, sigma)?, sigma)? };
            let counters = Counters { knocks, ..absorbed.counters };
            conclusion(input, memory, &Absorbed { counters, ..absorbed }, sigma_given, |f| {
                Factor::Ten(Box::new(f))
            })
        }
        Factor::Sixteen(f) => {
            let absorbed =
                Absorbed::<16> { factor: *f, ..super::absorb(input, &shares(input, sigma)?, sigma)? };
            let counters = Counters { knocks, ..absorbed.counters };
            conclusion(input, memory, &Absorbed { counters, ..absorbed }, sigma_given, |f| {
                Factor::Sixteen(Box::new(f))
            })
        }
    }
}

/// What the answer is a memory of. `rate_hz` and rows as in `input`.
pub fn result(input: &Input, memory: &MemoryConfig<f64>, factor: &Factor) -> MemoryResult {
    let (kind, span_s) = match memory.span {
        Span::TimeConstant(s) => ("forgetting", s),
        Span::Window(s) => ("window", s),
    };
    let block_s = f64::from(super::row_every(input.rate_hz)) / input.rate_hz;
    MemoryResult { kind, span_s, effective_s: f64::from(factor.rows()) / 6.0 * block_s }
}

fn run<const N: usize>(
    input: &Input,
    memory: &MemoryConfig<f64>,
    points: usize,
    wrap: impl Fn(InformationFactor<f64, N>) -> Factor,
) -> Result<(Identification, Vec<Progression>), IdentificationError> {
    let mut sigma = input.channel_sigma.unwrap_or(NOMINAL_SIGMA);
    let (mut absorbed, mut course) = remember::<N>(input, memory, sigma, points)?;
    if input.channel_sigma.is_none() {
        // As in a batch: weights from the residuals of the unweighted fit, then once more.
        for _ in 0..2 {
            sigma = sigma_of_the_remembered(input, memory, &absorbed)?;
            (absorbed, course) = remember::<N>(input, memory, sigma, points)?;
        }
    }
    let identification = conclusion(input, memory, &absorbed, input.channel_sigma.is_some(), wrap)?;
    // Intervals as wide as the answer's, which is known only now.
    let Judgement { variance_scale, .. } = identification.judgement();
    let wider = variance_scale.sqrt() * identification.estimate.coverage_factor / NORMAL_COVERAGE;
    for measured in course.iter_mut().flat_map(|point| point.parameters.iter_mut().flatten()) {
        measured.u95 *= wider;
    }
    end_at(&mut course, &identification);
    Ok((identification, course))
}

/// One pass, as the firmware does it.
fn remember<const N: usize>(
    input: &Input,
    memory: &MemoryConfig<f64>,
    sigma: [f64; 6],
    points: usize,
) -> Result<(Absorbed<N>, Vec<Progression>), IdentificationError> {
    let config = config(input, sigma);
    let mut estimator =
        Box::new(Estimator::<f64, N, TAPS>::new(&config).map_err(IdentificationError::Config)?);
    let settings = estimator.clone();
    estimator.set_memory(memory).map_err(IdentificationError::Config)?;
    let limit = knocks::limit(input);
    let every = (input.readings.len() / usize::from(config.row_every) / points.max(1)).max(1) as u32;
    let mut course = Vec::new();
    for reading in &input.readings {
        if estimator.absorb(reading) != Outcome::Absorbed {
            continue;
        }
        estimator.remember(limit);
        if estimator.counters().blocks.is_multiple_of(every) {
            let estimate = Estimate::new(&estimator.factor(), 1.0, Noise::Given);
            let parameters = (0..N).map(|j| estimate.measured(j)).collect();
            course.push(Progression { time_s: reading.time_ns as f64 * 1e-9, parameters });
        }
    }
    let counters = *estimator.counters();
    if counters.blocks == 0 {
        return Err(IdentificationError::NoRows {
            readings: counters.readings,
            rejected: counters.rejected,
            width_s: config.filter_width_s,
        });
    }
    Ok((Absorbed { factor: estimator.factor(), counters, channels: None, settings }, course))
}

fn conclusion<const N: usize>(
    input: &Input,
    memory: &MemoryConfig<f64>,
    absorbed: &Absorbed<N>,
    sigma_given: bool,
    wrap: impl Fn(InformationFactor<f64, N>) -> Factor,
) -> Result<Identification, IdentificationError> {
    let sigma = absorbed.settings.config().channel_sigma;
    let shares = shares(input, sigma)?;
    let mut identification = conclude(sigma_given, input, &shares, &absorbed.factor, absorbed, wrap);
    // All of these were concluded from the whole recording.
    identification.counters.knocks = absorbed.counters.knocks;
    let blocks = f64::from(absorbed.counters.blocks.max(1));
    identification.regressor_noise.tensor_information *= f64::from(absorbed.factor.rows()) / 6.0 / blocks;
    let recent = reached(&identification.residuals, memory);
    identification.residual_rms = rms(recent);
    let scale = identification.judgement().variance_scale;
    identification.colour = colour(input, absorbed.settings.config(), recent, scale);
    Ok(identification)
}

/// Residuals of the last seconds, as many as the memory's span.
fn reached<'a>(residuals: &'a [BlockResidual], memory: &MemoryConfig<f64>) -> &'a [BlockResidual] {
    let (Span::TimeConstant(span_s) | Span::Window(span_s)) = memory.span;
    let end_s = residuals.last().map_or(0.0, |r| r.time_s);
    let first = residuals.partition_point(|r| r.time_s < end_s - span_s);
    residuals.get(first..).unwrap_or(residuals)
}

fn sigma_of_the_remembered<const N: usize>(
    input: &Input,
    memory: &MemoryConfig<f64>,
    absorbed: &Absorbed<N>,
) -> Result<[f64; 6], IdentificationError> {
    let settings = &*absorbed.settings;
    let sigma = settings.config().channel_sigma;
    let estimate = Estimate::new(&absorbed.factor, 1.0, Noise::Given);
    let watching = shares(input, sigma)?.watching(knocks::reference(input, &estimate, 1.0));
    let (residuals, _) = residuals::<N>(&watching, sigma, &estimate, &[0.0; 6]);
    let recent = reached(&residuals, memory);
    Ok(raw_sigma(settings, &estimate, recent, recent.len() as u32))
}

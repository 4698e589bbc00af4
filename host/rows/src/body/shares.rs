//! Readings shared out over the cores.
//!
//! Lives here: where a recording is cut, and how every part yields exactly the row blocks that one pass over
//! the whole would have given. May not live here: what is made of the blocks ([`super`]).
//!
//! Factors merge, so parts of a recording may be absorbed at the same time. What a reading does depends on
//! those before it in two ways. Screening reads back as far as a channel must repeat itself to be frozen; the
//! filter reads back over its width, and opens its windows at multiples of `row_every` from the last
//! rejection or gap, however long ago. So the parts are first *scouted*, each with as much history as
//! screening needs, which gives the rejections, the gaps and thereby the phase of the windows; then every
//! part is absorbed from the first window on that is still open at its beginning.

use rigident_shared::calibration::Reading;
use rigident_shared::estimator::{ConfigError, Counters, Estimator, EstimatorConfig, Outcome, Reference};
use rigident_shared::factor::InformationFactor;
use rigident_shared::screening::{Limits, Rejection};
use rigident_shared::spatial::Wrench;

use rigident_fit::{ESTIMATOR_TAPS as TAPS, parallel};

/// A part has at least this many readings: what is read twice and set up anew is small against it.
const LEAST_SHARE: usize = 20_000;
/// Most parts: enough for the cores there are.
const MOST_PARTS: usize = 64;

/// Readings cut into parts.
#[derive(Clone, Debug)]
pub struct Shares<'a> {
    readings: &'a [Reading<f64>],
    config: EstimatorConfig<f64>,
    parts: Vec<Part>,
    threads: usize,
    counters: Counters,
    /// The reference of the rows, if any.
    reference: Option<Reference<f64, 16>>,
}

/// The part that one thread takes at a time.
#[derive(Clone, Debug)]
struct Part {
    /// First reading that the filter sees: the opening of a window. No window from here on is complete before
    /// the part begins.
    from: usize,
    /// One past its last reading.
    end: usize,
    /// Readings in it that are frozen, ascending.
    frozen: Vec<usize>,
}

/// The result of the readings of all parts.
#[derive(Clone, Debug)]
pub struct Absorbed<const N: usize, A> {
    /// The factor of all rows.
    pub factor: InformationFactor<f64, N>,
    /// The events, as one pass would have counted it.
    pub counters: Counters,
    /// The factors of the parts, in order.
    pub factors: Vec<InformationFactor<f64, N>>,
    /// The content of each part's accumulator, in order.
    pub parts: Vec<A>,
}

/// The findings of scouting about a part.
struct Scouted {
    counters: Counters,
    frozen: Vec<usize>,
    /// The place where the filter last started anew, if it did: the first reading after it.
    fresh: Option<usize>,
}

/// The distribution of the readings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Split {
    /// Parts that they are cut into. The answer depends on it in its last digits.
    pub parts: usize,
    /// Threads that take the parts in turn. The answer does not depend on it.
    pub threads: usize,
}

impl Split {
    /// Parts by the number of readings alone, so that every machine gives the same bits; threads as there are
    /// cores.
    pub fn of(readings: usize) -> Self {
        Self { parts: (readings / LEAST_SHARE).clamp(1, MOST_PARTS), threads: parallel::threads() }
    }
}

impl<'a> Shares<'a> {
    /// Cuts the readings into parts of equal length. With one part there is nothing to scout.
    ///
    /// # Errors
    /// The estimator cannot be set up like this.
    pub fn new(
        readings: &'a [Reading<f64>],
        config: &EstimatorConfig<f64>,
        split: Split,
    ) -> Result<Self, ConfigError> {
        let estimator = Box::new(Estimator::<f64, 10, TAPS>::new(config)?);
        let (taps, row_every) = (estimator.span(), usize::from(config.row_every));
        // Windows further apart than their width leave readings between them in which the phase is not seen.
        let parts = if row_every > taps { 1 } else { split.parts.clamp(1, readings.len().max(1)) };
        let mut shares = Self {
            readings,
            config: *config,
            parts: Vec::new(),
            threads: split.threads,
            counters: Counters::default(),
            reference: None,
        };
        if parts == 1 {
            shares.parts.push(Part { from: 0, end: readings.len(), frozen: Vec::new() });
            return Ok(shares);
        }
        shares.config.limits.frozen_after = 0;
        let borders: Vec<usize> = (0..=parts).map(|k| k * readings.len() / parts).collect();
        let scouted =
            parallel::map(split.threads, parts, |k| scout(readings, config, borders[k]..borders[k + 1]))
                .into_iter()
                .collect::<Result<Vec<_>, _>>()?;
        let mut fresh = 0;
        for (border, scouted) in borders.windows(2).zip(scouted) {
            // The last windows that are complete only inside the part; the oldest opened `taps − 1` before
            // it.
            let oldest = (border[0] + 1).saturating_sub(taps).max(fresh);
            let from = fresh + (oldest - fresh).div_ceil(row_every) * row_every;
            shares.parts.push(Part { from, end: border[1], frozen: scouted.frozen });
            fresh = scouted.fresh.unwrap_or(fresh);
            add(&mut shares.counters, &scouted.counters);
        }
        Ok(shares)
    }

    /// Returns how many.
    pub fn parts(&self) -> usize {
        self.parts.len()
    }

    /// Returns the shares with every row compared with a reference; see [`Reference`].
    #[must_use]
    pub fn watching(&self, reference: Reference<f64, 16>) -> Self {
        Self { reference: Some(reference), ..self.clone() }
    }

    /// Takes every part through the pipeline, whitened by `channel_sigma`. `each` is called on the part's
    /// thread after every row block, with the reading that completed it; blocks are in order within a part.
    ///
    /// # Errors
    /// A σ is impossible.
    pub fn absorb<const N: usize, A: Send>(
        &self,
        channel_sigma: [f64; 6],
        start: impl Fn() -> A + Sync,
        each: impl Fn(&mut A, &Reading<f64>, &Estimator<f64, N, TAPS>) + Sync,
    ) -> Result<Absorbed<N, A>, ConfigError> {
        let config = EstimatorConfig { channel_sigma, ..self.config };
        let done = parallel::map(self.threads, self.parts.len(), |k| {
            let part = &self.parts[k];
            let mut estimator = Box::new(Estimator::<f64, N, TAPS>::new(&config)?);
            if let Some(reference) = self.reference.and_then(first) {
                estimator.set_reference(reference);
            }
            let mut accumulator = start();
            let mut frozen = part.frozen.iter().copied().peekable();
            for (row, reading) in self.readings.iter().enumerate().take(part.end).skip(part.from) {
                let outcome = if frozen.next_if_eq(&row).is_some() {
                    // Scouting rejected it; to the filter all rejections are one.
                    estimator.absorb(&Reading { wrench: Wrench::from_array([f64::NAN; 6]), ..*reading })
                } else {
                    estimator.absorb(reading)
                };
                if outcome == Outcome::Absorbed {
                    each(&mut accumulator, reading, &estimator);
                }
            }
            Ok((estimator.factor(), *estimator.counters(), accumulator))
        })
        .into_iter()
        .collect::<Result<Vec<_>, _>>()?;
        let mut absorbed = Absorbed {
            factor: InformationFactor::new(),
            counters: self.counters,
            factors: Vec::new(),
            parts: Vec::new(),
        };
        if let [(_, counters, _)] = done.as_slice() {
            absorbed.counters = Counters { blocks: 0, knocks: [0; 6], ..*counters };
        }
        for (factor, counters, accumulator) in done {
            absorbed.factor.merge(&factor);
            absorbed.counters.blocks = absorbed.counters.blocks.saturating_add(counters.blocks);
            for (sum, part) in absorbed.counters.knocks.iter_mut().zip(counters.knocks) {
                *sum = sum.saturating_add(part);
            }
            absorbed.factors.push(factor);
            absorbed.parts.push(accumulator);
        }
        Ok(absorbed)
    }
}

/// Returns the reference's first parameters, as many as are estimated.
fn first<const N: usize>(reference: Reference<f64, 16>) -> Option<Reference<f64, N>> {
    Some(Reference {
        parameters: *reference.parameters.first_chunk()?,
        standard_deviation: *reference.standard_deviation.first_chunk()?,
        noise_scale: reference.noise_scale,
        knock_limit: reference.knock_limit,
    })
}

/// Finds the screening and the gaps of a part by the estimator itself, with a filter of one tap that hardly
/// ever gives a row.
fn scout(
    readings: &[Reading<f64>],
    config: &EstimatorConfig<f64>,
    part: std::ops::Range<usize>,
) -> Result<Scouted, ConfigError> {
    // Any positive width keeps the watch over time; zero is that of still poses, which have none.
    let filter_width_s = if config.filter_width_s > 0.0 { f64::MIN_POSITIVE } else { 0.0 };
    let config = EstimatorConfig { filter_width_s, row_every: u16::MAX, ..*config };
    let mut estimator = Estimator::<f64, 10, 1>::new(&config)?;
    let mut row = history(readings, part.start, &config.limits);
    while row < part.start {
        estimator.absorb(&readings[row]);
        row += 1;
    }
    let before = *estimator.counters();
    let mut gaps = before.gaps;
    let mut scouted = Scouted { counters: Counters::default(), frozen: Vec::new(), fresh: None };
    for row in part {
        match estimator.absorb(&readings[row]) {
            Outcome::Rejected(rejection) => {
                scouted.fresh = Some(row + 1);
                if let Rejection::Frozen(_) = rejection {
                    scouted.frozen.push(row);
                }
                scouted.counters.last_rejection = Some(rejection);
            }
            Outcome::Pending | Outcome::Absorbed => {
                if estimator.counters().gaps != gaps {
                    gaps = estimator.counters().gaps;
                    scouted.fresh = Some(row);
                }
            }
        }
    }
    let after = estimator.counters();
    scouted.counters.readings = after.readings - before.readings;
    scouted.counters.rejected = after.rejected - before.rejected;
    scouted.counters.gaps = after.gaps - before.gaps;
    for ((count, after), before) in scouted
        .counters
        .rejected_by_channel
        .iter_mut()
        .zip(after.rejected_by_channel)
        .zip(before.rejected_by_channel)
    {
        // Beyond the last number of its type a count stays what it is.
        *count = if after == u16::MAX { after } else { after - before };
    }
    Ok(scouted)
}

/// Returns where screening must begin to be in the same state at `row`: a channel is frozen after a number of
/// repetitions, and a reading that is not finite leaves no trace in the count of them.
fn history(readings: &[Reading<f64>], row: usize, limits: &Limits<f64>) -> usize {
    let mut wanted = usize::from(limits.frozen_after) + 2;
    let mut from = row;
    while from > 0 && wanted > 0 {
        from -= 1;
        wanted -= usize::from(is_finite(&readings[from]));
    }
    from
}

fn is_finite(reading: &Reading<f64>) -> bool {
    let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
    finite(&reading.wrench.array())
        && finite(&reading.specific_force.array())
        && finite(&reading.angular_rate.array())
}

fn add(sum: &mut Counters, part: &Counters) {
    sum.readings = sum.readings.saturating_add(part.readings);
    sum.rejected = sum.rejected.saturating_add(part.rejected);
    sum.gaps = sum.gaps.saturating_add(part.gaps);
    for (sum, part) in sum.rejected_by_channel.iter_mut().zip(part.rejected_by_channel) {
        *sum = sum.saturating_add(part);
    }
    sum.last_rejection = part.last_rejection.or(sum.last_rejection);
}

#[cfg(test)]
#[path = "shares_tests.rs"]
mod tests;

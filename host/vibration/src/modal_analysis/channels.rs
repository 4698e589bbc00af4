//! The faults in the numbers of a channel by themselves: missing, clipped, frozen, repeated.

use super::input::{FreeDecay, ModalError, Options};

/// Equal values in a row that are a limit's, if the signal turns back too sharply.
const CLIPPED: usize = 3;
/// Equal values in a row that are a stop, if the signal then jumps.
const FROZEN: usize = 12;
/// Samples for each number that a mode has in a channel.
const LEAST: usize = 32;

/// A stretch of equal values.
struct Run {
    first: usize,
    length: usize,
    value: f64,
}

/// Checks rate, names, scales, band and each channel's numbers.
///
/// # Errors
/// [`ModalError`] names the channel, the time, and what to do.
pub(super) fn check(decay: &FreeDecay<'_>, options: &Options) -> Result<(), ModalError> {
    let (samples, channels) = decay.samples.shape();
    let complain = |text: String| Err(ModalError::Input(text));
    if !(decay.rate_hz.is_finite() && decay.rate_hz > 0.0) {
        return complain(format!("a rate of {} Hz: give the samples per second", decay.rate_hz));
    }
    if channels == 0 || decay.names.len() != channels {
        return complain(format!(
            "{channels} channels and {} names: give one name for each",
            decay.names.len()
        ));
    }
    if !options.scales.is_empty()
        && (options.scales.len() != channels || !options.scales.iter().all(|s| s.is_finite() && *s > 0.0))
    {
        return complain(format!("give a positive scale for each of {channels} channels, or none"));
    }
    if options.modes == Some(0) || (options.modes.is_none() && options.most == 0) {
        return complain("no modes are asked for: give a number of at least one".to_owned());
    }
    if let Some([low, high]) = options.band_hz
        && !(0.0 <= low && low < high && high < 0.5 * decay.rate_hz)
    {
        let half = 0.5 * decay.rate_hz;
        return complain(format!("a band of {low} to {high} Hz: it must rise and end below {half} Hz"));
    }
    if samples < LEAST {
        return Err(ModalError::TooFew { samples, channels, least: LEAST });
    }
    for channel in 0..channels {
        check_channel(decay, channel)?;
    }
    Ok(())
}

fn check_channel(decay: &FreeDecay<'_>, channel: usize) -> Result<(), ModalError> {
    let values: Vec<f64> = decay.samples.column(channel).iter().copied().collect();
    let name = || decay.name(channel);
    let time_s = |sample: usize| sample as f64 / decay.rate_hz;
    if let Some(first) = values.iter().position(|v| !v.is_finite()) {
        return Err(ModalError::NotFinite { channel: name(), time_s: time_s(first) });
    }
    let runs = runs(&values);
    if let [run] = runs.as_slice() {
        let duration_s = time_s(run.length);
        return Err(ModalError::Frozen { channel: name(), value: run.value, time_s: 0.0, duration_s });
    }
    let quantum = quantum(&values);
    if let Some(times) = repetition(&runs, quantum) {
        return Err(ModalError::Repeated { channel: name(), times, rate_hz: decay.rate_hz / times as f64 });
    }
    if let Some((limit, first, count)) = clipped(&values, &runs, quantum) {
        return Err(ModalError::Clipped { channel: name(), limit, time_s: time_s(first), count });
    }
    let is_stop = |run: &&Run| run.length >= FROZEN && jump(&values, run, 1) > 4.5 * quantum;
    if let Some(run) = runs.iter().find(is_stop) {
        let (time_s, duration_s) = (time_s(run.first), time_s(run.length));
        return Err(ModalError::Frozen { channel: name(), value: run.value, time_s, duration_s });
    }
    Ok(())
}

fn runs(values: &[f64]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for (k, value) in values.iter().enumerate() {
        match runs.last_mut() {
            Some(run) if run.value == *value => run.length += 1,
            _ => runs.push(Run { first: k, length: 1, value: *value }),
        }
    }
    runs
}

/// Returns the step of the converter, or of the arithmetic: the least difference of values that is not
/// rounding.
fn quantum(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let range = sorted.last().zip(sorted.first()).map_or(0.0, |(most, least)| most - least);
    let steps = sorted.windows(2).map(|w| w[1] - w[0]).filter(|step| *step > 1e-12 * range);
    steps.fold(f64::INFINITY, f64::min).min(range)
}

/// Returns how far the signal is from a run's value this many samples before it and after, the larger of
/// both.
fn jump(values: &[f64], run: &Run, away: usize) -> f64 {
    let before = run.first.checked_sub(away).and_then(|k| values.get(k));
    let after = values.get(run.first + run.length - 1 + away);
    [before, after].into_iter().flatten().map(|v| (v - run.value).abs()).fold(0.0, f64::max)
}

/// Returns the length of runs of the same length that end in jumps, over most of the recording: a slower
/// sensor.
fn repetition(runs: &[Run], quantum: f64) -> Option<usize> {
    let inner = runs.get(1..runs.len() - 1).filter(|inner| inner.len() >= 8)?;
    let mut lengths: Vec<usize> = inner.iter().map(|run| run.length).collect();
    lengths.sort_unstable();
    let middle = lengths[lengths.len() / 2];
    let alike = lengths.iter().filter(|length| **length == middle).count();
    let steps = inner.windows(2).filter(|w| (w[1].value - w[0].value).abs() > 1.5 * quantum).count();
    (middle >= 2 && alike * 10 >= lengths.len() * 8 && steps * 2 > inner.len()).then_some(middle)
}

/// Runs at the largest or least value from which the signal falls off faster than a round top can: within
/// `h = length / 2` a top `−c t²` stays in one step q of the converter, so that `c h² ≤ q`, and falls off by
/// at most `q ((h+2)/h)²` two samples later. Returns the value, the first sample and the number of samples.
fn clipped(values: &[f64], runs: &[Run], quantum: f64) -> Option<(f64, usize, usize)> {
    let ends =
        [values.iter().copied().fold(f64::MIN, f64::max), values.iter().copied().fold(f64::MAX, f64::min)];
    ends.into_iter().find_map(|end| {
        let is_flat = |run: &&Run| {
            let half = 0.5 * run.length as f64;
            let round = quantum * (1.0 + ((half + 2.0) / half).powi(2));
            run.value == end && run.length >= CLIPPED && jump(values, run, 2) > 1.5 * round
        };
        let flat: Vec<&Run> = runs.iter().filter(is_flat).collect();
        flat.first().map(|first| (end, first.first, flat.iter().map(|run| run.length).sum()))
    })
}

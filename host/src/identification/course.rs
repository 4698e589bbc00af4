//! The estimate as rows come in, on the way to the one that a batch ends at.

use rigident_shared::calibration::Reading;
use rigident_shared::estimator::{Counters, Estimator};
use rigident_shared::factor::InformationFactor;

use super::gains::ChannelFactors;
use super::pooled::Judgement;
use super::{Absorbed, Identification, Input, TAPS, channels, config, merge_channels, shares, take_channels};
use crate::answer::Estimate;
use crate::answer::result::Measured;

/// The estimate as rows come in.
#[derive(Clone, Debug, PartialEq)]
pub struct Progression {
    /// Time of the reading that completed the rows, s.
    pub time_s: f64,
    /// Each parameter; `None` while the rows do not determine it.
    pub parameters: Vec<Option<Measured>>,
}

/// About `points` estimates on the way to the one that a batch ends at: rows weighted and intervals widened as they
/// are there.
pub fn progression(input: &Input, end: &Identification, points: usize) -> Vec<Progression> {
    let mut course = if input.known_offset.is_some() {
        progression_of::<10>(input, end, points)
    } else {
        progression_of::<16>(input, end, points)
    };
    end_at(&mut course, end);
    course
}

/// The last point is the answer itself.
pub(super) fn end_at(course: &mut Vec<Progression>, end: &Identification) {
    let (Some(last), Some(point)) = (end.residuals.last(), course.last()) else { return };
    let time_s = last.time_s.max(point.time_s);
    if point.time_s >= last.time_s {
        course.pop();
    }
    let parameters = (0..end.estimate.values.len()).map(|j| end.estimate.measured(j)).collect();
    course.push(Progression { time_s, parameters });
}

fn progression_of<const N: usize>(input: &Input, end: &Identification, points: usize) -> Vec<Progression> {
    /// What a part has absorbed so far, and had at some of its blocks, s.
    #[derive(Clone)]
    struct Course<const N: usize> {
        channels: Option<ChannelFactors>,
        blocks: usize,
        points: Vec<(f64, InformationFactor<f64, N>, Option<ChannelFactors>)>,
    }
    let sigma = end.channel_sigma;
    let config = config(input, sigma);
    let Judgement { noise, variance_scale: scale, .. } = end.judgement();
    let every = (input.readings.len() / usize::from(config.row_every) / points.max(1)).max(1);
    let start = || Course::<N> { channels: channels(input), blocks: 0, points: Vec::new() };
    let take = |course: &mut Course<N>, reading: &Reading<f64>, estimator: &Estimator<f64, N, TAPS>| {
        take_channels(&mut course.channels, reading, estimator);
        course.blocks += 1;
        if course.blocks.is_multiple_of(every) {
            let time_s = reading.time_ns as f64 * 1e-9;
            course.points.push((time_s, estimator.factor(), course.channels.clone()));
        }
    };
    let (Ok(shares), Ok(settings)) = (shares(input, sigma), Estimator::new(&config)) else {
        return Vec::new();
    };
    let shares = match end.counters.knocks {
        [0, 0, 0, 0, 0, 0] => shares,
        _ => shares.watching(end.reference(input)),
    };
    let Ok(done) = shares.absorb(sigma, start, take) else { return Vec::new() };
    let mut before = Absorbed::<N> {
        factor: InformationFactor::new(),
        counters: Counters::default(),
        channels: channels(input),
        settings: Box::new(settings),
    };
    let mut progression = Vec::new();
    for (part, whole) in done.parts.into_iter().zip(&done.factors) {
        for (time_s, factor, channels) in part.points {
            let (kept, kept_channels) = (before.factor, before.channels.clone());
            before.factor.merge(&factor);
            before.channels = merge_channels(before.channels, channels);
            // As in the conclusion: the prior of the gains is not the noise's to scale.
            let estimate = match before.fit_gains(&input.gain_sigma, scale) {
                Some(fit) => Estimate::new(&fit.factor, 1.0, noise),
                None => Estimate::new(&before.factor, scale, noise),
            };
            let widened = |j: usize, m: Measured| Measured {
                u95: m.u95 * end.widening.get(j).copied().unwrap_or(1.0),
                ..m
            };
            let parameters = (0..N).map(|j| estimate.measured(j).map(|m| widened(j, m))).collect();
            progression.push(Progression { time_s, parameters });
            (before.factor, before.channels) = (kept, kept_channels);
        }
        before.factor.merge(whole);
        before.channels = merge_channels(before.channels, part.channels);
    }
    progression
}

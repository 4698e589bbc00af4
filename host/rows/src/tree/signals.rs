//! Signals that frames are made of, their white noise, and frames with more of it.
//!
//! Noise belongs to what was measured and takes the way of the measurement: that of a link's gyro or attitude
//! enters the rates of the joints on either side of it with opposite signs, and rates that are slopes of
//! positions have noise of the positions, coloured by the polynomials.

use std::ops::Range;

use nalgebra::{Matrix3, Rotation3, Vector3};
use rigident_shared::tree::{Joint, TreeError};

use super::joints::{Resolved, Seen, resolve};
use super::polynomial::Polynomial;
use super::{Frame, Input, NoisySignal, SignalKind};
use crate::white_noise::Signs;
use rigident_fit::SignalNoise;
use rigident_model::rows::Moving;

/// Signals of one kind, whose noise is stated or is not: their sizes have known ratios.
struct Group {
    noise: SignalNoise,
    /// Each signal by its number, and its size in units of the group's.
    members: Vec<(usize, f64)>,
}

fn groups(input: &Input) -> Vec<Group> {
    let slides = |signal: &NoisySignal| {
        let joint = input.model.links.get(signal.link).map(|link| &link.link.joint);
        signal.axes() == 1 && matches!(joint, Some(Joint::Prismatic(_)))
    };
    let named = |signal: &NoisySignal| match (signal.kind, slides(signal)) {
        (SignalKind::Accelerometer, _) => ("accelerometer", "m/s2"),
        (SignalKind::Gyro, _) => ("gyros", "rad/s"),
        (SignalKind::Attitude, _) => ("attitudes", "rad"),
        (SignalKind::Rate, false) => ("joint rates", "rad/s"),
        (SignalKind::Rate, true) => ("joint rates", "m/s"),
        (_, false) => ("joint positions", "rad"),
        (_, true) => ("joint positions", "m"),
    };
    let key = |signal: &NoisySignal| (named(signal), signal.stated.is_some());
    let mut keys: Vec<((&str, &str), bool)> = Vec::new();
    for signal in &input.signals {
        if !keys.contains(&key(signal)) {
            keys.push(key(signal));
        }
    }
    let group = |own: ((&'static str, &'static str), bool)| {
        let members = input.signals.iter().enumerate().filter(|(_, signal)| key(signal) == own);
        let members: Vec<(usize, &NoisySignal)> = members.collect();
        let rms = |of: &dyn Fn(&NoisySignal) -> f64| {
            let squares: f64 = members.iter().map(|(_, signal)| of(signal).powi(2)).sum();
            (squares / members.len().max(1) as f64).sqrt()
        };
        let size = rms(&NoisySignal::size);
        let ((name, unit), is_stated) = own;
        let noise = SignalNoise {
            name: name.to_owned(),
            unit: unit.to_owned(),
            stated: is_stated.then_some(size),
            found: rms(&|signal| signal.found),
        };
        let relative = |signal: &NoisySignal| if size > 0.0 { signal.size() / size } else { 0.0 };
        Group { noise, members: members.iter().map(|(k, signal)| (*k, relative(signal))).collect() }
    };
    keys.into_iter().map(group).collect()
}

/// Returns the noise of the signals of a recording, by groups.
pub(super) fn signal_noise(input: &Input) -> Vec<SignalNoise> {
    groups(input).into_iter().map(|group| group.noise).collect()
}

/// Returns some of the frames as they were, had the signals had more noise: of the standard deviations
/// `sigma`, one a group, each value of either sign.
///
/// # Errors
/// [`TreeError`] if the frames do not fit the model.
pub(super) fn with_noise(
    input: &Input,
    frames: Range<usize>,
    sigma: &[f64],
    seed: u64,
) -> Result<Vec<Frame>, TreeError> {
    let frames = input.frames.get(frames).unwrap_or_default();
    let slope = Polynomial::new(input.rate_hz);
    let mut signs = Signs::new(seed);
    let mut noise: Vec<Option<Vec<f64>>> = vec![None; input.signals.len()];
    for (group, sigma) in groups(input).iter().zip(sigma).filter(|(_, sigma)| **sigma != 0.0) {
        for (k, relative) in &group.members {
            let Some((signal, own)) = input.signals.get(*k).zip(noise.get_mut(*k)) else { continue };
            let beside = if signal.kind == SignalKind::PositionWithSlope { 2 * slope.half() } else { 0 };
            let count = (frames.len() + beside) * signal.axes();
            *own = Some((0..count).map(|_| sigma * relative * signs.draw()).collect());
        }
    }
    let mut noisier = Noisier { input, slope, noise, moving: Moving::new(input.model.tree())? };
    frames.iter().enumerate().map(|(k, frame)| noisier.frame(k, frame)).collect()
}

/// Noise on its way to the frames.
struct Noisier<'a> {
    input: &'a Input,
    slope: Polynomial,
    /// By signals, in the order of the frames; `None`: there is none.
    noise: Vec<Option<Vec<f64>>>,
    moving: Moving,
}

impl Noisier<'_> {
    /// Returns the noise of frame `k`'s signals of a link.
    fn of(&self, kind: SignalKind, link: usize) -> Option<&[f64]> {
        let signals = self.input.signals.iter().zip(&self.noise);
        let mut own = signals.filter(|(signal, _)| signal.kind == kind && signal.link == link);
        own.find_map(|(_, noise)| noise.as_deref())
    }

    fn three(&self, kind: SignalKind, link: usize, k: usize) -> Vector3<f64> {
        let own = self.of(kind, link).and_then(|noise| noise.get(3 * k..3 * k + 3));
        own.map_or_else(Vector3::zeros, Vector3::from_column_slice)
    }

    fn one(&self, kind: SignalKind, link: usize, k: usize) -> f64 {
        self.of(kind, link).and_then(|noise| noise.get(k)).copied().unwrap_or(0.0)
    }

    fn frame(&mut self, k: usize, frame: &Frame) -> Result<Frame, TreeError> {
        let mut noisy = frame.clone();
        noisy.base.specific_force += self.three(SignalKind::Accelerometer, 0, k);
        noisy.base.rate += self.three(SignalKind::Gyro, 0, k);
        let zeros = vec![0.0; frame.rates.len()];
        self.moving.set(&frame.positions, &frame.rates, &zeros, &frame.base)?;
        let one = Matrix3::identity();
        let none = Vec::new;
        let root =
            Resolved { attitude: one, rate: noisy.base.rate, positions: none(), rates: none(), misfit: 0.0 };
        let mut links = vec![root];
        let (mut q, mut v) = (frame.positions.as_slice(), frame.rates.as_slice());
        for (i, link) in self.input.model.links.iter().enumerate().skip(1) {
            let joint = &link.link.joint;
            let (own_q, rest_q) = q.split_at_checked(joint.coordinates()).ok_or(TreeError::Lengths)?;
            let (own_v, rest_v) = v.split_at_checked(joint.freedoms()).ok_or(TreeError::Lengths)?;
            (q, v) = (rest_q, rest_v);
            let is_seen = |signal: &NoisySignal| signal.kind == SignalKind::Attitude && signal.link == i;
            let seen = if self.input.signals.iter().any(is_seen) {
                let (attitude, rate) = self.moving.turning(i).ok_or(TreeError::Lengths)?;
                let turned = Rotation3::new(self.three(SignalKind::Attitude, i, k)).into_inner();
                Seen::Link { attitude: attitude * turned, rate: rate + self.three(SignalKind::Gyro, i, k) }
            } else if let ([q], [v]) = (own_q, own_v) {
                let window = self.of(SignalKind::PositionWithSlope, i);
                let window = window.and_then(|noise| noise.get(k..=k + 2 * self.slope.half()));
                let (of_q, of_v) = window.map_or((0.0, 0.0), |noise| self.slope.at(noise));
                Seen::Coordinate(
                    q + of_q + self.one(SignalKind::Position, i, k),
                    v + of_v + self.one(SignalKind::Rate, i, k),
                )
            } else {
                return Err(TreeError::Lengths);
            };
            let parent = links.get(link.link.parent).ok_or(TreeError::Lengths)?;
            links.push(resolve(&link.link, parent, &seen).ok_or(TreeError::Lengths)?);
        }
        noisy.positions = links.iter().flat_map(|l| l.positions.iter().copied()).collect();
        noisy.rates = links.iter().flat_map(|l| l.rates.iter().copied()).collect();
        Ok(noisy)
    }
}

#[cfg(test)]
#[path = "signals_tests.rs"]
mod tests;

//! Instants of neighbouring frames: each frame of a run is brought about once, for its own columns and for
//! the slopes of what is predicted about it.

use rigident_shared::tree::TreeError;

use super::drive::{Drive, FrictionPart, Term};
use super::instant::Instant;
use super::rows::effort_of_drives;
use super::{Frame, Input, SignalError};

/// Frames whose predictions are stored: one and its neighbours.
const KEPT: usize = 3;

/// The instant of a frame, that of another one, and what is predicted of the last few.
pub(super) struct Neighbours {
    instants: [(Option<usize>, Instant); 2],
    /// Predictions, smoothed and differentiated, by frames.
    predicted: [(Option<usize>, Vec<f64>); KEPT],
}

/// The parameters that predictions are made with.
pub(super) struct Predictor {
    drives: Vec<(Drive, usize)>,
    phi: Vec<f64>,
}

impl Predictor {
    /// Returns that of drives, each with the place of its first parameter, and all parameters.
    pub(super) fn new(drives: &[(Drive, usize)], phi: &[f64]) -> Self {
        Self { drives: drives.to_vec(), phi: phi.to_vec() }
    }

    /// Returns the freedom that the load of a drive is that of.
    pub(super) fn loaded_freedom(&self, drive: usize) -> Option<usize> {
        self.drives.get(drive).and_then(|(drive, _)| drive.rates.last()).map(|(freedom, _)| *freedom)
    }

    /// Writes what an error of a drive's friction moves its efforts by, which carries `load`; nothing of
    /// other errors.
    pub(super) fn friction_moves(
        &self,
        error: &SignalError,
        load: f64,
        (input, frame): (&Input, &Frame),
        out: &mut [f64],
    ) {
        let (SignalError::FrictionSpeed(number)
        | SignalError::FrictionShape(number)
        | SignalError::FrictionDrift { drive: number, .. }
        | SignalError::FrictionLoad(number)) = error
        else {
            return;
        };
        let Some((drive, at)) = self.drives.get(*number).filter(|(drive, _)| !drive.stands) else { return };
        let rate = drive.rate(&frame.rates);
        let sum = |of: &dyn Fn(Term) -> f64| -> f64 {
            drive.terms.iter().zip(self.phi.iter().skip(*at)).map(|(term, phi)| phi * of(*term)).sum()
        };
        let moved = match error {
            SignalError::FrictionSpeed(_) => sum(&|term| term.slope_by_speed(rate)),
            SignalError::FrictionShape(_) => sum(&|term| term.slower(rate)),
            SignalError::FrictionDrift { part, degree, .. } => {
                input.drift(frame, *degree) * sum(&|term| part.column(term, rate))
            }
            _ => {
                let direction = drive.terms.iter().map(|term| FrictionPart::Dry.column(*term, rate));
                direction.sum::<f64>() * load.abs()
            }
        };
        for (freedom, factor) in &drive.rates {
            out.iter_mut().skip(input.first_effort() + freedom).take(1).for_each(|v| *v = factor * moved);
        }
    }

    /// Writes the predictions of a frame, offsets of the wrench left out.
    fn predict(&self, instant: &Instant, input: &Input, sample: usize, out: &mut [f64]) {
        instant.predict(out);
        let Some(frame) = input.frames.get(sample).filter(|_| input.has_efforts()) else { return };
        let channels = out.len() / 2;
        let first = input.first_effort();
        for (c, smoothed) in (first..channels).flat_map(|c| [(c, true), (c, false)]) {
            let effort = effort_of_drives(&self.drives, c - first, frame, smoothed, &self.phi);
            out[c + if smoothed { 0 } else { channels }] += effort;
        }
    }
}

impl Neighbours {
    /// Returns instants of no frames yet; predictions are `width` numbers.
    pub(super) fn new(still: &Instant, width: usize) -> Self {
        Self {
            instants: [(None, still.clone()), (None, still.clone())],
            predicted: std::array::from_fn(|_| (None, vec![0.0; width])),
        }
    }

    /// Returns true if a frame is at hand.
    pub(super) fn has(&self, sample: usize) -> bool {
        self.instants.iter().any(|(own, _)| *own == Some(sample))
    }

    /// Returns the instant of the frame that was brought last.
    pub(super) fn instant(&self) -> &Instant {
        &self.instants[0].1
    }

    /// Brings a frame.
    ///
    /// # Errors
    /// [`TreeError`] if it does not fit the tree.
    pub(super) fn bring(&mut self, sample: usize, input: &Input) -> Result<(), TreeError> {
        if self.instants[0].0 == Some(sample) {
            return Ok(());
        }
        self.instants.swap(0, 1);
        let (own, instant) = &mut self.instants[0];
        if *own != Some(sample) {
            *own = None;
            instant.set(input.frames.get(sample).ok_or(TreeError::Lengths)?, input.contact.as_ref())?;
            *own = Some(sample);
        }
        Ok(())
    }

    /// Returns the predictions of the given frames, made where they are not at hand. The frame that was
    /// brought last stays the same.
    ///
    /// # Errors
    /// Fails as [`Neighbours::bring`] does.
    pub(super) fn predict(
        &mut self,
        samples: [usize; KEPT],
        predictor: &Predictor,
        input: &Input,
    ) -> Result<[&[f64]; KEPT], TreeError> {
        let before = self.instants[0].0;
        for sample in samples {
            if self.predicted.iter().any(|(own, _)| *own == Some(sample)) {
                continue;
            }
            self.bring(sample, input)?;
            let is_free = |(own, _): &(Option<usize>, _)| own.is_none_or(|own| !samples.contains(&own));
            let Some(place) = self.predicted.iter().position(is_free) else { continue };
            let (own, values) = &mut self.predicted[place];
            predictor.predict(&self.instants[0].1, input, sample, values);
            *own = Some(sample);
        }
        if let Some(before) = before {
            self.bring(before, input)?;
        }
        let of = |sample: usize| {
            let own = self.predicted.iter().find(|(own, _)| *own == Some(sample));
            own.map_or(&[][..], |(_, values)| values.as_slice())
        };
        Ok(samples.map(of))
    }
}

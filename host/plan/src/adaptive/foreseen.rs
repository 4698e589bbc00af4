//! The goals that an experiment can still reach.

use std::mem::discriminant;

use super::goal::{Asked, Goal};
use super::information::Information;
use super::planner::Known;

/// The goals that can be reached in the time that an experiment has, where what is asked for cannot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Foreseen {
    /// Worst uncertainty over what is asked for.
    Share(f64),
    /// 95 % uncertainty of the worst element of the tensors, kg m²: the moment of which a share is asked for
    /// is not known well enough.
    Moment(f64),
}

impl Foreseen {
    /// Returns the number alone.
    pub fn value(&self) -> f64 {
        match self {
            Self::Share(value) | Self::Moment(value) => *value,
        }
    }

    fn is_finite(&self) -> bool {
        self.value().is_finite()
    }
}

/// The change of the prediction from which on it is reported again.
const CHANGED: f64 = 0.03;
/// Two consecutive predictions must agree this well to be said at all.
const AGREE: f64 = 0.05;

/// The predictions so far, and those reported.
#[derive(Clone, Copy, Debug, Default)]
pub struct Forecast {
    last: Option<Foreseen>,
    said: Option<Foreseen>,
}

impl Forecast {
    /// Returns what was said last.
    pub fn said(&self) -> Option<Foreseen> {
        self.said
    }

    /// Takes in the present prediction; returns it if it is to be reported.
    pub fn take(&mut self, foreseen: Foreseen) -> Option<Foreseen> {
        let off = |before: Option<Foreseen>| {
            let alike = before.filter(|before| discriminant(before) == discriminant(&foreseen));
            alike.map_or(f64::INFINITY, |before| (foreseen.value() / before.value() - 1.0).abs())
        };
        let is_new = off(self.last.replace(foreseen)) <= AGREE && off(self.said) > CHANGED;
        if is_new {
            self.said = Some(foreseen);
        }
        Some(foreseen).filter(|_| is_new)
    }
}

impl Asked {
    /// Returns what the information that an experiment should end with, `then`, means for what is asked for.
    pub fn foreseen(&self, goal: &Goal, known: &Known, then: &Information) -> Option<Foreseen> {
        let phi = known.estimate?;
        if self.is_known(known.estimate)
            && self.can_foresee(goal.worst(known.information, known.variance_scale))
        {
            return Some(Foreseen::Share(goal.worst(then, known.variance_scale))).filter(Foreseen::is_finite);
        }
        let moments = matches!(self, Self::Tensor(_)).then(|| Goal::of_moments(phi))??;
        Some(Foreseen::Moment(moments.worst(then, known.variance_scale))).filter(Foreseen::is_finite)
    }

    /// Returns the result of what was predicted, in the same unit; `None` if a body is not identified.
    pub fn came_of(&self, foreseen: Foreseen, goal: &Goal, known: &Known) -> Option<f64> {
        let phi = known.estimate?;
        let reached = |goal: &Goal| goal.worst(known.information, known.variance_scale);
        match foreseen {
            Foreseen::Share(_) => self.is_known(known.estimate).then(|| reached(goal)),
            Foreseen::Moment(_) => Goal::of_moments(phi).map(|goal| reached(&goal)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_forecast_that_agrees_twice_is_said_once_until_it_changes() {
        let mut forecast = Forecast::default();
        let mut said = |values: &[Foreseen]| -> Vec<bool> {
            values.iter().map(|value| forecast.take(*value).is_some()).collect()
        };
        let (share, moment) = (Foreseen::Share, Foreseen::Moment);
        assert_eq!(said(&[moment(0.02), moment(0.015), moment(0.0152)]), [false, false, true]);
        // Nearly the same is not said again, and another unit only when it agrees with itself.
        assert_eq!(
            said(&[moment(0.0153), share(2.0), share(2.05), share(2.06)]),
            [false, false, true, false]
        );
        assert_eq!(said(&[share(2.2), share(2.15)]), [false, true]);
        assert_eq!(forecast.said(), Some(share(2.15)));
    }
}

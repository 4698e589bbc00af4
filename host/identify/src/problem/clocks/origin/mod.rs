//! Clocks that share no origin: a stream's clock is set by what both it and the wrench see of the motion.
//!
//! A rigid body's wrench is linear in the specific force, the angular acceleration and the products of the
//! rates, whatever the body and however the sensors are mounted. Where the streams fit as they are stamped
//! nothing is done. Otherwise all offsets and rates are searched at a coarse step ([`coarse`]), the best few
//! are refined over the whole recording ([`refine`]), and the best of these is taken if it explains the
//! wrench and no other does nearly as well.
//!
//! Lives here: when a clock is sought, what is taken, and the words. May not live here: the small delays that
//! remain ([`super::skew`]).

mod coarse;
mod refine;
mod signals;

use self::refine::Refined;
use self::signals::Signals;
use super::{StreamError, StreamSet};
use rigident_fit::figures::significant;

/// A stream whose wrench is explained by as much of the best of all offsets is left as it is stamped.
const AS_STAMPED: f64 = 0.95;
/// At least this much of it is explained then; less may be a rate that is off.
const AS_STAMPED_LEAST: f64 = 0.3;
/// Errors of a rate that matter less than this at the ends of a recording are none, s.
const ENDS_S: f64 = 2e-3;
/// Delays up to this are found as skews, s.
const NEAR_S: f64 = 0.4;
/// The share of the wrench's variance that the right clock explains at least.
const EXPLAINED: f64 = 0.5;
/// The residuals by the right clock are less than this share of those by any other.
const CLEARLY_LESS: f64 = 0.9;
/// Motion is this many times larger than noise.
const LIVELY: f64 = 25.0;

/// The clock of a stream against that of the wrench: time there is `offset_s + rate t` where it says `t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Clock {
    pub(super) offset_s: f64,
    pub(super) rate: f64,
}

/// A clock that was found, with 95 % uncertainties.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Time of the wrench's clock, from its first reading, where the stream says zero, s.
    pub offset_s: f64,
    /// Seconds of the wrench's clock for one of the stream's.
    pub rate: f64,
    /// Uncertainty of a time in the middle of what they have in common, s.
    pub time_u95_s: f64,
    /// Uncertainty of the rate.
    pub rate_u95: f64,
    /// Share of the wrench's variance that is explained.
    pub explained: f64,
}

/// Sets the clocks of the streams that do not fit the wrench as they are stamped; those of a tree only where
/// they have no time in common with it. Returns what is to be said first.
///
/// # Errors
/// [`StreamError::NoClock`] if a stream has no time in common with the wrench and nothing that both see
/// aligns them.
pub(super) fn settle(set: &mut StreamSet, is_body: bool) -> Result<Vec<String>, StreamError> {
    let mut said = Vec::new();
    for k in (0..set.streams.len()).filter(|k| *k != set.reference) {
        let Some(signals) = Signals::of(set, k) else { continue };
        let overlap_s = signals.overlap_s();
        // What moves on a tree's links is in its wrench, and not in its base's IMU.
        if !is_body && overlap_s > 0.0 {
            continue;
        }
        let file = set.streams[k].file.clone();
        match found(&signals) {
            Verdict::Fits => {}
            Verdict::Clock(found) => {
                let stream = &mut set.streams[k];
                let own =
                    |ns: &i64| (1e9 * (found.offset_s + found.rate * (*ns as f64 * 1e-9))).round() as i64;
                stream.time_ns = stream.time_ns.iter().map(own).collect();
                stream.rate_hz /= found.rate;
                said.push(found.words(&file));
            }
            Verdict::None(why) if overlap_s <= 0.0 => {
                let reference = set.streams[set.reference].file.clone();
                return Err(StreamError::NoClock { first: reference, second: file, why });
            }
            Verdict::None(why) => said.push(format!(
                "the clock of {file} fits the wrench neither as it is stamped nor otherwise: {why}; do not \
                 trust the answer before it is found"
            )),
            Verdict::Unclear => {}
        }
    }
    Ok(said)
}

/// The result for a stream's clock.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Verdict {
    /// It is right as it is stamped, or nearly.
    Fits,
    /// It is another one.
    Clock(Found),
    /// Nothing fits, and why.
    None(String),
    /// There is too little motion to tell.
    Unclear,
}

/// Judges a stream's clock.
pub(super) fn found(signals: &Signals) -> Verdict {
    if signals.liveliness() < LIVELY {
        return if signals.overlap_s() > 0.0 {
            Verdict::Unclear
        } else {
            Verdict::None("there is too little motion to align them by".to_owned())
        };
    }
    let search = coarse::Search::new(signals);
    let (near, best) = search.at_rate(NEAR_S);
    if near >= AS_STAMPED * best && near > AS_STAMPED_LEAST {
        return Verdict::Fits;
    }
    // As stamped a skew may still be found, and the motion may be one that tells little.
    let may_be_stamped = near > 0.5 * best && signals.overlap_s() > 0.0;
    let nothing = |why: String| if may_be_stamped { Verdict::Unclear } else { Verdict::None(why) };
    let candidates = search.candidates();
    let mut refined: Vec<Refined> =
        candidates.iter().filter_map(|clock| refine::refine(signals, *clock)).collect();
    refined.sort_by(|a, b| a.left.total_cmp(&b.left));
    let Some(first) = refined.first() else {
        return nothing("they have too little in common at any offset".to_owned());
    };
    let middle = |refined: &Refined| refined.found.offset_s + refined.found.rate * signals.middle_s();
    let second = refined.iter().skip(1).find(|other| (middle(other) - middle(first)).abs() > 0.02);
    if 1.0 - first.left < EXPLAINED {
        return nothing(format!(
            "what it sees explains {:.0} % of the wrench's variance at best: is it of another body, or \
             another run?",
            100.0 * (1.0 - first.left)
        ));
    }
    if let Some(second) = second.filter(|second| first.left > CLEARLY_LESS * second.left) {
        return nothing(format!(
            "offsets of {} s and {} s fit alike: a motion that repeats itself does not show them; move \
             irregularly once",
            significant(first.found.offset_s, 5),
            significant(second.found.offset_s, 5)
        ));
    }
    if first.found.is_as_stamped(signals) { Verdict::Fits } else { Verdict::Clock(first.found) }
}

impl Found {
    /// Returns true where the clock is that of the wrench but for a skew.
    fn is_as_stamped(&self, signals: &Signals) -> bool {
        let (from, to) = signals.own_ends_s();
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let late = self.offset_s + (self.rate - 1.0) * middle;
        let ends = (self.rate - 1.0).abs() * half;
        late.abs() <= NEAR_S && ends <= ENDS_S.max(3.0 * self.rate_u95 * half)
    }

    /// Says what was found, and how to write it down.
    fn words(&self, file: &str) -> String {
        format!(
            "the clock of {file} is not that of the wrench; by the motion that both saw its t_s = 0 is at \
             {:.4} s from the first wrench and a second of it lasts {:.7} ± {} s, so that times in the \
             middle of the recording are known to ± {} ms (95 %); it explains {:.0} % of the wrench's \
             variance",
            self.offset_s,
            self.rate,
            significant(self.rate_u95, 2),
            significant(1e3 * self.time_u95_s, 2),
            100.0 * self.explained
        )
    }
}

#[cfg(test)]
mod tests;

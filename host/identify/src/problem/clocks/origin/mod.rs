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
use super::{Stream, StreamError, StreamSet};
use rigident_fit::figures::significant;

/// A stream whose wrench is explained by as much of the best of all offsets is left as it is stamped.
const AS_STAMPED: f64 = 0.95;
/// At least this much of it is explained then; less may be a rate that is off.
const AS_STAMPED_LEAST: f64 = 0.3;
/// Errors of a rate that matter less than this at the ends of a recording are none, s.
const ENDS_S: f64 = 2e-3;
/// Delays up to this are found as skews, s.
const NEAR_S: f64 = 0.4;
/// The right clock leaves at most this share of the wrench's variance, however much of it is noise.
const MOST_LEFT: f64 = 0.5;
/// It leaves at most this share, corrected for the number of unknowns, or this many times the noise.
const LEFT: f64 = 0.1;
const OVER_NOISE: f64 = 4.0;
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
                said.push(found.words(stream));
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
    let noise = signals.noise();
    // What they have in common as they are stamped comes first.
    let stamped = refine::refine(signals, &noise, Clock { offset_s: 0.0, rate: 1.0 });
    if stamped.is_some_and(|stamped| stamped.is_explained() && stamped.found.is_as_stamped(signals)) {
        return Verdict::Fits;
    }
    let search = coarse::Search::new(signals);
    let (near, best) = search.at_rate(NEAR_S);
    if near >= AS_STAMPED * best && near > AS_STAMPED_LEAST {
        return Verdict::Fits;
    }
    // As stamped a skew may still be found, and the motion may be one that tells little.
    let overlap_s = signals.overlap_s();
    let may_be_stamped =
        overlap_s > 0.0 && (near > 0.5 * best || (near == 0.0 && overlap_s < coarse::SHORTEST_S));
    let nothing = |why: String| if may_be_stamped { Verdict::Unclear } else { Verdict::None(why) };
    let candidates = search.candidates();
    let mut refined: Vec<Refined> = candidates
        .iter()
        .filter_map(|clock| refine::refine(signals, &noise, *clock))
        .chain(stamped)
        .collect();
    refined.sort_by(|a, b| a.left.total_cmp(&b.left));
    let right: Vec<&Refined> = refined.iter().filter(|refined| refined.is_explained()).collect();
    let Some(first) = right.first() else {
        let least = refined.first().map_or(1.0, |first| first.left.min(1.0));
        return nothing(format!(
            "no common motion is found at any offset: at best {:.0} % of the wrench's variance is left, more \
             than noise makes; is it of another body, or another run, or shorter than {} s in common?",
            100.0 * least,
            coarse::SHORTEST_S
        ));
    };
    let middle = |refined: &Refined| refined.found.offset_s + refined.found.rate * signals.middle_s();
    let second = right.iter().skip(1).find(|other| (middle(other) - middle(first)).abs() > 0.02);
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

impl Refined {
    /// Returns true where noise or little else is left.
    fn is_explained(&self) -> bool {
        self.left <= MOST_LEFT && (self.corrected <= LEFT || self.over_noise <= OVER_NOISE)
    }
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
    fn words(&self, stream: &Stream) -> String {
        let stamped = &stream.stamped;
        let zero_s = stamped.begin_s + self.offset_s + self.rate * (stamped.offset_s - stamped.begin_s);
        format!(
            "the clock of {} is not that of the wrench; by the motion that both saw, its t_s = 0 is at \
             {zero_s:.4} s of the wrench's clock and a second of it lasts {:.7} ± {} s, so that times in \
             the middle of the recording are known to ± {} ms (95 %); it explains {:.0} % of the wrench's \
             variance; clock_offset_s = {zero_s:.4} and clock_rate = {} in its [[stream]] say the same",
            stream.file,
            self.rate * stamped.rate,
            significant(self.rate_u95 * stamped.rate, 2),
            significant(1e3 * self.time_u95_s, 2),
            100.0 * self.explained,
            self.rate * stamped.rate
        )
    }
}

#[cfg(test)]
mod tests;

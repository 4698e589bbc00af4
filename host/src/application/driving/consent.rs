//! The statements about a motion before anybody agrees to it.

use std::fmt;

use hexapod::{COND_MAX, Pose};

use super::checks::Attitude;
use rigident_device::platform::check::{self, Summary};
use rigident_device::session::Session;
use rigident_io::rig::RigFile;
use rigident_plan::machine;
use rigident_plan::ranges::CellStopped;

/// Less of the stroke than this in reserve at either end is worth a word: plans leave somewhat more.
const RESERVE: f64 = 0.49 * machine::RESERVE;

/// The parts about to move, the guards, and what is only assumed.
pub struct Consent<'a> {
    /// The checks against all limits.
    pub summary: &'a Summary,
    /// The platform's address.
    pub address: &'a str,
    /// The rig file.
    pub rig: &'a RigFile,
    /// Share of the program's own speed.
    pub slow: Option<f64>,
    /// The platform's statements about itself.
    pub found: Vec<String>,
    /// Load guard and motion guard, on or not; `None` before they are set.
    pub guards: Option<[bool; 2]>,
    /// The load cell in each stop that is shown.
    pub cell: Vec<(f64, CellStopped)>,
    /// The plate's pose before the warm-up, where it is another since.
    pub moved: Option<[Pose; 2]>,
    /// Gravity was compared with the plate's pose; `None` before that.
    pub attitude: Option<Attitude>,
}

/// Returns whether load guard and motion guard are on.
pub(super) fn guards(session: &Session) -> [bool; 2] {
    [session.load_guard.is_some(), session.motion_guard.is_some()]
}

impl Consent<'_> {
    fn guard_words([load, motion]: [bool; 2]) -> [&'static str; 2] {
        [
            if load {
                "load guard ON: ends the motion at 97 % of the load cell's range"
            } else {
                "load guard OFF: [load_cell] has no range_n_nm, nothing ends the motion before the load cell \
                 is overloaded"
            },
            if motion {
                "motion guard ON: ends the motion when the IMU does not show it"
            } else {
                "motion guard OFF: the rig file does not say where the IMU is, and a plate that goes astray \
                 is not seen"
            },
        ]
    }

    /// Returns what is taken for true and checked by nobody.
    fn assumed(&self) -> Vec<&'static str> {
        let platform = self.rig.platform.as_ref();
        let mut assumed = vec![
            "nobody is in the machine's reach; guards, and a stop of the machine's own in somebody's hand, \
             are there: this program is no safety function",
        ];
        if self.summary.travel.is_none() {
            assumed.push(
                "the legs' own weight and friction are not counted; how long a stop by the controller itself \
                 takes is not known",
            );
        }
        if platform.is_none_or(|platform| platform.part.is_empty()) {
            assumed.push("the plate itself weighs nothing: the rig file has no [[platform.part]]");
        }
        assumed.push(match self.attitude {
            Some(Attitude::Unknown(why)) => why,
            _ => "the base is level: gravity is along -z of A",
        });
        if self.summary.from.is_some() {
            assumed.push("the plate is at home: nothing measures where it is");
        }
        assumed.push("what is fastened is fast; cables, fixtures and obstacles near it are not looked at");
        assumed
    }
}

impl fmt::Display for Consent<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.address, self.summary)?;
        if let Some(share) = self.slow {
            writeln!(f, "  slow      at {share} of the program's speed")?;
        }
        if let Some(reserve) = self.summary.stroke_reserve().filter(|reserve| *reserve < RESERVE) {
            writeln!(
                f,
                "  NOTE      {:.1} % of the stroke are in reserve: an error of the joints' places, or an \
                 overshoot, may meet the legs' ends",
                100.0 * reserve
            )?;
        }
        for stop in self.summary.stops.iter().flatten() {
            for (violation, time_s) in [stop.overloads, stop.too_quick].into_iter().flatten() {
                writeln!(f, "  NOTE      in a stop of {} s from t = {time_s:.2} s {violation}", stop.stop_s)?;
            }
        }
        for (stop_s, cell) in &self.cell {
            let CellStopped { channel, unit, range, value, at_worst, time_s } = cell;
            if at_worst > range {
                let whom = if value > range { "" } else { " with the worst body that may be on it" };
                writeln!(
                    f,
                    "  NOTE      in a stop of {stop_s} s from t = {time_s:.2} s {channel} of the load cell \
                     would come to {:.1} {unit}{whom}, its range is {range:.1} {unit}",
                    if value > range { value } else { at_worst }
                )?;
            } else {
                writeln!(
                    f,
                    "  load cell {channel} up to {at_worst:.1} of {range:.1} {unit} in a stop of {stop_s} s"
                )?;
            }
        }
        if let Some([before, now]) = &self.moved {
            writeln!(
                f,
                "  NOTE      the plate was at {} before the warm-up and is at {}: the way to the start \
                 is another one",
                check::words(before),
                check::words(now)
            )?;
        }
        if let Some([_, limit]) = self.summary.condition.filter(|[_, limit]| *limit > COND_MAX) {
            writeln!(
                f,
                "  NOTE      cond_max is {limit}, and {COND_MAX} by default: poses near singular ones are \
                 allowed"
            )?;
        }
        self.found.iter().try_for_each(|found| writeln!(f, "  platform  {found}"))?;
        if let Some(guards) = self.guards {
            Self::guard_words(guards).iter().try_for_each(|words| writeln!(f, "  {words}"))?;
            self.assumed().iter().try_for_each(|words| writeln!(f, "  assumed   {words}"))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn guards_that_are_off_and_assumptions_are_reported() {
        let summary =
            Summary { leg_length_m: [0.551, 0.8], leg_limits_m: [0.55, 0.85], ..Summary::default() };
        let rig = RigFile::default();
        let said = |guards| {
            let consent = Consent {
                summary: &summary,
                address: "gcs://h:1",
                rig: &rig,
                slow: Some(0.1),
                found: vec![],
                guards,
                cell: Vec::new(),
                moved: None,
                attitude: None,
            };
            consent.to_string()
        };
        let off = said(Some([false, false]));
        for words in [
            "load guard OFF: [load_cell] has no range_n_nm",
            "motion guard OFF",
            "legs' own weight and friction are not counted",
            "no [[platform.part]]",
            "is no safety function",
            "at 0.1 of the program's speed",
            "0.3 % of the stroke are in reserve",
        ] {
            assert!(off.contains(words), "{words}\n{off}");
        }
        assert!(said(Some([true, true])).contains("load guard ON") && !said(None).contains("guard"));
    }
}

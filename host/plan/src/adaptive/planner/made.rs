//! Motions that are made for what is asked for, for the machine as it now is.

use std::sync::atomic::AtomicBool;

use hexapod::Pose;

use super::{DESIGNED_S, Kind, Known, Planner, RAMP_S};
use crate::adaptive::design::{Design, design};
use crate::adaptive::goal::Goal;
use crate::adaptive::information::{HIGHEST_RATE_RADPS, Information};
use crate::adaptive::library::Candidate;

/// Shorter where the machine can do less, so that one way of turning follows another soon.
const DESIGNED_WITHOUT_S: f64 = 3.0;
/// Length of a short test before the body is known, whose wrench cannot be predicted then, s; its share of
/// the rates, and the most such tests.
const LOOK_S: f64 = 1.5;
const LOOK_SHARE: f64 = 0.5;
/// Tilts about which motions are made where an axis is lost, degrees: about a tilted axis the others make up
/// for it.
const TILTS_DEG: [f64; 2] = [25.0, 35.0];

impl Planner {
    /// Makes motions for what is asked for, for the machine as it now is. They are believed to be needed this
    /// many times.
    pub(super) fn design(&mut self, known: &Known, times: f64) {
        self.designs = Some(known.estimate.is_some());
        self.entries.retain(|entry| entry.kind == Kind::Stock);
        let goal = self.goal(known);
        let beforehand = *known.information / times.max(1.0);
        let home = self.rig.geometry.home();
        let here = self.places.get(self.at).copied().unwrap_or(home);
        let mut centres = vec![(home, String::from("home"))];
        let whole = self.lost == [false; 6];
        if !whole {
            for (k, name) in [(0, "roll"), (1, "pitch")].into_iter().filter(|(k, _)| !self.lost[k + 3]) {
                for tilt_deg in TILTS_DEG {
                    let mut centre = home;
                    centre.rpy_rad[k] = tilt_deg.to_radians();
                    if self.rig.geometry.check_pose(&centre).is_ok() {
                        centres.push((centre, format!("a {name} of {tilt_deg:.0}°")));
                    }
                }
            }
        }
        // A coordinate in which the plate has stopped somewhere stays there.
        for (centre, _) in &mut centres {
            for k in (0..3).filter(|k| self.lost[k + 3]) {
                centre.rpy_rad[k] = here.rpy_rad[k];
            }
            for k in (0..3).filter(|k| self.lost[*k]) {
                centre.position_m[k] = here.position_m[k];
            }
        }
        let stop = AtomicBool::new(false);
        for (centre, place) in centres {
            let task = Design {
                rig: &self.rig,
                centre: &centre,
                duration_s: if whole { DESIGNED_S } else { DESIGNED_WITHOUT_S },
                ramp_s: RAMP_S,
                still: self.lost,
                goal: &goal,
                beforehand: &beforehand,
            };
            self.made += 1;
            if let Some(segment) = design(&task, &stop) {
                self.add(
                    Candidate { name: format!("made for it, about {place}"), centre, segment },
                    Kind::Made,
                );
            }
        }
        if self.looks > 0 && !self.identified {
            self.design_look(&goal, &beforehand, here);
        }
        self.find_ways();
    }

    fn design_look(&mut self, goal: &Goal, beforehand: &Information, centre: Pose) {
        let mut careful = self.rig.clone();
        careful.geometry.leg_rate_mps *= LOOK_SHARE;
        if let Some(speed_mps) = careful.geometry.travel.as_mut().and_then(|travel| travel.speed_mps.as_mut())
        {
            *speed_mps *= LOOK_SHARE;
        }
        careful.rate_range_radps = LOOK_SHARE * self.rig.rate_range_radps.min(HIGHEST_RATE_RADPS);
        let task = Design {
            rig: &careful,
            centre: &centre,
            duration_s: LOOK_S,
            ramp_s: RAMP_S,
            still: self.lost,
            goal,
            beforehand,
        };
        self.made += 1;
        if let Some(segment) = design(&task, &AtomicBool::new(false)) {
            self.add(Candidate { name: "a first look".to_owned(), centre, segment }, Kind::Look);
        }
    }
}

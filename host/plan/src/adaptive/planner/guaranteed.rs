//! Motions made as small, and ways as slow, as every limit needs at every instant.

use hexapod::MotionProgram;

use super::super::choice::Choice;
use super::{Kind, Planner, SLOWER, SLOWEST, Way};

/// The share of its size that is too small to be worth a try, and while nothing is known of the body.
const SMALLEST: f64 = 0.2;
const SMALLEST_LOOK: f64 = 0.02;
/// Tries after which a motion is made smaller by twice as much, and again.
const PATIENT_TRIES: u32 = 6;

impl Planner {
    /// Returns whether what would be done now keeps every limit at every instant; if not, it is changed and
    /// the choice is another one.
    pub(super) fn guarantee(&mut self, choice: &Choice) -> bool {
        let Some(index) = choice.sequence.first().copied() else { return false };
        // What comes after it need only be as large as it is believed to be.
        for later in choice.sequence.iter().rev() {
            let open = self.entries.get(*later).is_some_and(|entry| !entry.guaranteed);
            if open && !self.fit(*later) {
                return false;
            }
        }
        let Some(entry) = self.entries.get(index) else { return false };
        let (place, centre) = (entry.place, entry.candidate.centre);
        let Some(from) = self.places.get(self.at).copied() else { return false };
        let Some(Some(way)) = self.ways.get(self.at).and_then(|row| row.get(place)) else { return false };
        if way.guaranteed {
            return true;
        }
        let mut slower = self.slower;
        let mut found = None;
        let mut tried = Some(way.clone());
        while let Some(way) = tried.take() {
            self.checks = self.checks.saturating_sub(1);
            let alone = MotionProgram { start: from, segments: way.segment.clone().into_iter().collect() };
            if self.rig.overstepped(&alone) <= 1.0 {
                found = Some(Way { guaranteed: true, ..way });
            } else if slower < SLOWEST * self.slower {
                slower *= SLOWER;
                tried = self.way(&from, &centre, slower);
            }
        }
        let same = found.is_some() && slower == self.slower;
        if let Some(slot) = self.ways.get_mut(self.at).and_then(|row| row.get_mut(place)) {
            *slot = found;
        }
        same
    }

    /// Makes a motion as small as every limit needs at every instant, or leaves it out. Returns true if it
    /// needed nothing.
    fn fit(&mut self, index: usize) -> bool {
        let Some(centre) = self.entries.get(index).map(|entry| entry.candidate.centre) else { return false };
        // However small it were: nothing about this pose is.
        if self.rig.share_at_rest(&centre) > 1.0 {
            self.entries.retain(|entry| entry.candidate.centre != centre);
            self.shrunk = true;
            return false;
        }
        let mut tries = 0;
        while self.checks > 0 {
            self.checks -= 1;
            let Some(entry) = self.entries.get_mut(index) else { return false };
            let segment = entry.candidate.segment.clone();
            let over = self.rig.overstepped(&MotionProgram { start: centre, segments: vec![segment] });
            if over <= 1.0 {
                entry.guaranteed = true;
                return tries == 0;
            }
            // The bounds are a per cent above what is seen; forces grow with the square of the rates and
            // less.
            let by =
                if over.is_finite() { 0.999 - (over - 1.0).min(0.2).max(1.0 - over.powf(-0.7)) } else { 0.8 };
            tries += 1;
            let left = self.entries.len();
            // By more where little did not help.
            self.shrink(index, by.powi(1 << (tries / PATIENT_TRIES).min(4)));
            if self.entries.len() < left {
                break;
            }
        }
        false
    }

    /// Makes a motion smaller, or leaves it out.
    pub(super) fn shrink(&mut self, index: usize, by: f64) {
        let Some(entry) = self.entries.get_mut(index) else { return };
        entry.scale *= by;
        self.shrunk |= entry.kind != Kind::Look;
        let smallest = if self.identified { SMALLEST } else { SMALLEST_LOOK };
        let smaller = if entry.scale < smallest { None } else { entry.candidate.smaller(by) };
        let smaller =
            smaller.and_then(|candidate| self.information_of(&candidate).map(|brings| (candidate, brings)));
        match (smaller, self.entries.get_mut(index)) {
            (Some((candidate, brings)), Some(entry)) => {
                (entry.candidate, entry.brings, entry.guaranteed) = (candidate, brings, false);
            }
            _ => drop(self.entries.remove(index)),
        }
    }
}

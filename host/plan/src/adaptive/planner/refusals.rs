//! A platform that does not take a segment is asked what it would take, without being moved.

use hexapod::{Axis, Limit, MotionProgram, Segment, SineTerm, Travel};

use super::{DESIGNED_S, Decision, Planner, RAMP_S, SLOWER, SLOWEST, moved};

/// The factor by which a motion is stretched in time to see whether it is too fast or too large for the
/// platform; the halvings in which its largest size is then found; and the number of times that limits are
/// found to be tighter.
const STRETCH: f64 = 4.0;
const HALVINGS: u32 = 6;
const MOST_TIGHTENED: u32 = 4;
/// The distance that a platform is asked to move an axis that it may have lost, rad or ten times this in m,
/// and the frequency.
const ASKED_RAD: f64 = 0.01;
const ASKED_HZ: f64 = 0.5;
/// The factor by which a motion that the platform refuses becomes smaller.
const SMALLER: f64 = 0.85;

/// The questions that a platform can be asked without moving.
pub(super) enum Question {
    /// A small motion of one coordinate.
    Coordinate(usize),
    /// A refused motion, slower.
    Slower(Segment),
    /// A refused motion, smaller: its largest size lies between these.
    Smaller { motion: Segment, limit: Limit, taken: f64, refused: f64, left: u32 },
}

impl Planner {
    /// Receives that the platform refuses a decision. It is asked which coordinate it does not move, then
    /// whether the motion is too fast or too large for it and by how much: that limit is the tighter one from
    /// then on. Where that does not help, the motion is made smaller and the way to it slower.
    pub fn refused(&mut self, decision: &Decision) {
        let moves = moved(&decision.program);
        let unknown = (0..6).filter(|k| moves[*k] && !self.taken[*k]).map(Question::Coordinate);
        self.questions = unknown.collect();
        if !self.questions.is_empty() {
            return;
        }
        let still = decision.moves == [false; 6];
        let on_the_way = decision.program.segments.len() > 1;
        if let ([motion], false) = (decision.program.segments.as_slice(), still)
            && self.tightened < MOST_TIGHTENED
        {
            self.tightened += 1;
            self.questions = vec![Question::Slower(motion.clone())];
            return;
        }
        if on_the_way && self.slower < SLOWEST {
            self.slower *= SLOWER;
            self.find_ways();
        } else if still {
            self.entries.remove(decision.index);
        }
        if !still {
            self.shrink(decision.index, SMALLER);
        }
    }

    /// Returns the last of the questions, from where the plate is.
    pub(super) fn question(&self) -> Option<MotionProgram> {
        const AXES: [Axis; 6] = [Axis::X, Axis::Y, Axis::Z, Axis::Roll, Axis::Pitch, Axis::Yaw];
        let segment = match self.questions.last()? {
            Question::Coordinate(k) => {
                let amplitude = if *k < 3 { 0.1 * ASKED_RAD } else { ASKED_RAD };
                let term = SineTerm { axis: AXES[*k], amplitude, frequency_hz: ASKED_HZ, phase_rad: 0.0 };
                Segment::Multisine { duration_s: DESIGNED_S, ramp_s: RAMP_S, terms: vec![term] }
            }
            Question::Slower(motion) => stretched(motion),
            Question::Smaller { motion, taken, refused, .. } => sized(motion, 0.5 * (taken + refused)),
        };
        Some(MotionProgram { start: *self.places.get(self.at)?, segments: vec![segment] })
    }

    /// Returns what the platform says to a question. Coordinates that count as lost now.
    pub fn answered(&mut self, yes: bool) -> [bool; 6] {
        let mut newly = [false; 6];
        match self.questions.pop() {
            Some(Question::Coordinate(k)) if yes => self.taken[k] = true,
            Some(Question::Coordinate(k)) => {
                newly[k] = true;
                self.lose(&newly);
            }
            Some(Question::Slower(motion)) => {
                let limit = match (yes, self.rig.geometry.has_joints()) {
                    (true, true) => Limit::LegRate,
                    (true, false) => Limit::PlateRate,
                    (false, true) => Limit::LegLength,
                    (false, false) => Limit::Travel,
                };
                self.questions.push(Question::Smaller {
                    motion,
                    limit,
                    taken: 0.0,
                    refused: 1.0,
                    left: HALVINGS,
                });
            }
            Some(Question::Smaller { motion, limit, taken, refused, left }) => {
                let size = 0.5 * (taken + refused);
                let (taken, refused) = if yes { (size, refused) } else { (taken, size) };
                if left > 1 {
                    let left = left - 1;
                    self.questions.push(Question::Smaller { motion, limit, taken, refused, left });
                } else {
                    self.tighten(limit, &sized(&motion, taken));
                }
            }
            None => {}
        }
        newly
    }

    /// Tightens a limit to the largest motion that the platform takes.
    fn tighten(&mut self, limit: Limit, motion: &Segment) {
        let Some(at) = self.places.get(self.at).copied() else { return };
        let program = MotionProgram { start: at, segments: vec![motion.clone()] };
        let Ok(trajectory) = program.trajectory() else { return };
        let geometry = &mut self.rig.geometry;
        let guarantee = geometry.guarantee(&trajectory, None, f64::INFINITY);
        let Some(peak) = guarantee.peaks.iter().find(|p| p.limit == Some(limit)) else { return };
        match limit {
            Limit::LegLength => {
                let [low, high] = geometry.leg_length_m;
                let middle = 0.5 * (low + high);
                geometry.leg_length_m = [middle - peak.seen, middle + peak.seen];
            }
            Limit::Travel => {
                geometry.travel = geometry.travel.as_ref().map(|travel| travel.reaching(peak.seen));
            }
            Limit::PlateRate => {
                let slower = |travel: &Travel| Travel { rate_radps: Some(peak.seen), ..travel.clone() };
                geometry.travel = geometry.travel.as_ref().map(slower);
            }
            _ => geometry.leg_rate_mps = peak.seen,
        }
        self.take_stock(at);
    }

    pub(super) fn lose(&mut self, newly: &[bool; 6]) {
        for (lost, newly) in self.lost.iter_mut().zip(newly) {
            *lost |= newly;
        }
        if let Some(at) = self.places.get(self.at).copied() {
            self.take_stock(at);
        }
    }
}

/// Returns the motion with the same path in more time.
fn stretched(motion: &Segment) -> Segment {
    let Segment::Multisine { duration_s, ramp_s, terms } = motion else { return motion.clone() };
    let terms = terms.iter().map(|t| SineTerm { frequency_hz: t.frequency_hz / STRETCH, ..*t }).collect();
    Segment::Multisine { duration_s: STRETCH * duration_s, ramp_s: STRETCH * ramp_s, terms }
}

/// Returns the motion with its amplitudes times `size`.
fn sized(motion: &Segment, size: f64) -> Segment {
    let Segment::Multisine { duration_s, ramp_s, terms } = motion else { return motion.clone() };
    let terms = terms.iter().map(|t| SineTerm { amplitude: size * t.amplitude, ..*t }).collect();
    Segment::Multisine { duration_s: *duration_s, ramp_s: *ramp_s, terms }
}

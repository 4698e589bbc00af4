//! The planner: what is known of rig and machine from one segment to the next.

use rigident_sim::platform::{MotionProgram, Pose, Segment};

use super::axes::{share, stood_still};
use super::choice::{Choice, Step, choose};
use super::goal::{Asked, Goal};
use super::information::{Information, RigModel};
use super::library::{Candidate, library, way};

/// By which a motion that the platform refuses becomes smaller, and what is too small to be worth a try.
const SMALLER: f64 = 0.75;
const SMALLEST: f64 = 0.25;
/// By which moves become slower where they may be what is refused, and how much at most.
const SLOWER: f64 = 1.6;
const SLOWEST: f64 = 4.0;
/// Share of the expected information below which a segment's worth is corrected.
const AS_EXPECTED: f64 = 0.85;

/// A segment that has been decided on.
#[derive(Clone, Debug)]
pub struct Decision {
    index: usize,
    moves: [bool; 6],
    tells: Information,
    /// For people.
    pub name: String,
    /// From where the plate is.
    pub program: MotionProgram,
    /// When everything asked for should be reached, s from now.
    pub expected_s: f64,
}

impl Decision {
    /// What it should tell.
    pub fn tells(&self) -> &Information {
        &self.tells
    }
}

/// What to do next.
#[derive(Clone, Debug)]
pub enum Next {
    /// This.
    Segment(Box<Decision>),
    /// Everything asked for is reached.
    Reached,
    /// Nothing that the machine does leads there. The parameter that stays furthest off.
    Hopeless(&'static str),
}

/// What is known so far.
#[derive(Clone, Copy, Debug)]
pub struct Known<'a> {
    /// What the device's factor says.
    pub information: &'a Information,
    /// The ten parameters, once they are determined.
    pub estimate: Option<&'a [f64]>,
    /// The noise's variance relative to what was assumed.
    pub variance_scale: f64,
}

struct Entry {
    candidate: Candidate,
    /// Index of its centre.
    place: usize,
    tells: Information,
    scale: f64,
    /// What came of what was expected.
    worth: f64,
}

/// Decides between segments.
pub struct Planner {
    rig: RigModel,
    asked: Asked,
    entries: Vec<Entry>,
    places: Vec<Pose>,
    /// Ways between places: from, to.
    ways: Vec<Vec<Option<Step>>>,
    at: usize,
    lost: [bool; 6],
    driven: [bool; 6],
    /// Sets of coordinates whose motion was refused at any size.
    barred: Vec<[bool; 6]>,
    /// By which moves between places take longer than thought right.
    slower: f64,
}

impl Planner {
    /// Looks what the machine can do. The plate is at home.
    pub fn new(rig: RigModel, asked: Asked) -> Self {
        let mut planner = Self {
            rig,
            asked,
            entries: Vec::new(),
            places: Vec::new(),
            ways: Vec::new(),
            at: 0,
            lost: [false; 6],
            driven: [false; 6],
            barred: Vec::new(),
            slower: 1.0,
        };
        let home = planner.rig.geometry.home();
        planner.take_stock(home);
        planner
    }

    /// The coordinates that do not follow.
    pub fn lost(&self) -> [bool; 6] {
        self.lost
    }

    /// How many segments there are to choose from.
    pub fn choices(&self) -> usize {
        self.entries.len()
    }

    /// All of them, one after the other.
    pub fn everything(&self) -> MotionProgram {
        let start = self.rig.geometry.home();
        let (mut at, mut segments) = (start, Vec::new());
        for entry in &self.entries {
            if let Some(program) = entry.candidate.program(&at, self.slower, &self.rig.geometry) {
                segments.extend(program.segments);
                at = entry.candidate.centre;
            }
        }
        MotionProgram { start, segments }
    }

    /// What is asked for, by what is known.
    pub fn goal(&self, known: &Known) -> Goal {
        self.asked.goal(known.estimate)
    }

    fn take_stock(&mut self, at: Pose) {
        self.places = vec![at];
        let candidates = library(&self.rig, &self.lost);
        self.entries = Vec::with_capacity(candidates.len());
        for candidate in candidates {
            let place = self.places.iter().position(|p| *p == candidate.centre).unwrap_or_else(|| {
                self.places.push(candidate.centre);
                self.places.len() - 1
            });
            if let Some(tells) = self.tells(&candidate) {
                let moves = candidate.moves();
                let barred = |set: &[bool; 6]| (0..6).all(|k| moves[k] || !set[k]);
                if self.barred.iter().any(barred) {
                    continue;
                }
                self.entries.push(Entry { candidate, place, tells, scale: 1.0, worth: 1.0 });
            }
        }
        self.at = 0;
        self.ways = self.places.iter().map(|from| self.ways_from(from)).collect();
    }

    fn tells(&self, candidate: &Candidate) -> Option<Information> {
        let alone = MotionProgram { start: candidate.centre, segments: vec![candidate.segment.clone()] };
        self.rig.information(&alone, &[false; 6]).ok()
    }

    fn ways_from(&self, from: &Pose) -> Vec<Option<Step>> {
        self.places
            .iter()
            .map(|to| {
                if from == to {
                    return Some(Step { seconds: 0.0, tells: Information::zeros() });
                }
                let way = self.way(from, to)?;
                let seconds = way.duration_s();
                let program = MotionProgram { start: *from, segments: vec![way] };
                Some(Step { seconds, tells: self.rig.information(&program, &[false; 6]).ok()? })
            })
            .collect()
    }

    fn way(&self, from: &Pose, to: &Pose) -> Option<Segment> {
        way(from, to, self.slower, &self.rig.geometry)
    }

    fn step(&self, from: usize, to: usize) -> Option<Step> {
        let entry = self.entries.get(to)?;
        let way = self.ways.get(from)?.get(entry.place)?.as_ref()?;
        Some(Step {
            seconds: way.seconds + entry.candidate.segment.duration_s(),
            tells: way.tells + entry.tells * entry.worth,
        })
    }

    /// What to do now.
    pub fn next(&self, known: &Known) -> Next {
        let goal = self.goal(known);
        if goal.worst(known.information, known.variance_scale) <= 1.0 && known.estimate.is_some() {
            return Next::Reached;
        }
        let step = |from: Option<usize>, to: usize| {
            let from = from.map_or(Some(self.at), |c| self.entries.get(c).map(|e| e.place))?;
            self.step(from, to)
        };
        let choice = choose(self.entries.len(), &step, &goal, known.information, known.variance_scale);
        choice
            .and_then(|choice| self.decide(&choice))
            .map_or_else(|| Next::Hopeless(self.furthest(&goal, known)), |d| Next::Segment(Box::new(d)))
    }

    fn decide(&self, choice: &Choice) -> Option<Decision> {
        let index = *choice.sequence.first()?;
        let entry = self.entries.get(index)?;
        let program = entry.candidate.program(self.places.get(self.at)?, self.slower, &self.rig.geometry)?;
        let tells = self.step(self.at, index)?.tells;
        Some(Decision {
            index,
            moves: entry.candidate.moves(),
            tells,
            name: entry.candidate.name.clone(),
            program,
            expected_s: choice.seconds,
        })
    }

    /// Of everything at once, what is furthest off.
    fn furthest(&self, goal: &Goal, known: &Known) -> &'static str {
        let all = self.entries.iter().fold(*known.information, |sum, e| sum + e.tells);
        goal.furthest(&all)
    }

    /// The platform refuses a decision: it is made smaller, or left out where that does not help. What was concluded
    /// from it, if anything: coordinates that count as lost.
    pub fn refused(&mut self, decision: &Decision) -> [bool; 6] {
        let none = [false; 6];
        let moved_there = decision.program.segments.len() > 1;
        if moved_there && self.slower < SLOWEST {
            self.slower *= SLOWER;
            self.ways = self.places.iter().map(|from| self.ways_from(from)).collect();
            return none;
        }
        let Some(entry) = self.entries.get_mut(decision.index) else { return none };
        entry.scale *= SMALLER;
        let smaller = if entry.scale < SMALLEST { None } else { entry.candidate.smaller(SMALLER) };
        if let Some(candidate) = smaller
            && let Some(tells) = self.tells(&candidate)
            && let Some(entry) = self.entries.get_mut(decision.index)
        {
            (entry.candidate, entry.tells) = (candidate, tells);
            return none;
        }
        // Where there was a move before it, that may be what is refused.
        if decision.moves == none || moved_there {
            self.entries.remove(decision.index);
            return none;
        }
        // What moves these and more is not taken either.
        self.barred.push(decision.moves);
        let barred = |moves: [bool; 6]| (0..6).all(|k| moves[k] || !decision.moves[k]);
        self.entries.retain(|entry| !barred(entry.candidate.moves()));
        self.suspect()
    }

    /// An axis is lost if it alone, of those that were refused together, was never driven.
    fn suspect(&mut self) -> [bool; 6] {
        let mut newly = [false; 6];
        for set in &self.barred {
            let mut undriven = (0..6).filter(|k| set[*k] && !self.driven[*k] && !self.lost[*k]);
            if let (Some(axis), None) = (undriven.next(), undriven.next()) {
                newly[axis] = true;
            }
        }
        if newly.contains(&true) {
            // What was barred for its sake is there again without it.
            self.barred.retain(|set| !(0..6).any(|k| set[k] && newly[k]));
            self.lose(&newly);
        }
        newly
    }

    fn lose(&mut self, newly: &[bool; 6]) {
        for (lost, newly) in self.lost.iter_mut().zip(newly) {
            *lost |= newly;
        }
        if let Some(at) = self.places.get(self.at).copied() {
            self.take_stock(at);
        }
    }

    /// The decision was carried out to its end and told this. Coordinates that turn out not to follow.
    pub fn carried_out(&mut self, decision: &Decision, told: &Information) -> [bool; 6] {
        if let Some(entry) = self.entries.get(decision.index) {
            self.at = entry.place;
        }
        let newly = stood_still(&self.rig, &decision.program, &decision.moves, told);
        for k in 0..6 {
            self.driven[k] |= decision.moves[k] && !newly[k];
        }
        if newly.contains(&true) {
            self.lose(&newly);
            return newly;
        }
        let suspected = self.suspect();
        if suspected.contains(&true) {
            return suspected;
        }
        let came = share(&decision.tells, told);
        if came < AS_EXPECTED
            && let Some(entry) = self.entries.get_mut(decision.index)
            && matches!(entry.candidate.segment, Segment::Multisine { .. })
        {
            entry.worth *= came;
        }
        newly
    }
}

//! The planner: what is known of rig and machine from one segment to the next.
//!
//! Lives here: the segments with their results, the ways between them, what is next. In `guaranteed`:
//! what keeps every limit. In `made`: motions for what is asked for. In `refusals`: what a platform that does
//! not take a segment is asked.

mod guaranteed;
mod made;
mod refusals;

use hexapod::{BodyParameters, BodySet, MotionProgram, Pose, Segment};

use self::refusals::Question;
use super::axes::{share, stood_still};
use super::choice::{Choice, Step, Turns, choose};
use super::goal::{Asked, Goal};
use super::information::{Information, InverseRoot, RigModel};
use super::library::{Candidate, keeps, library, way};

/// The factor by which moves become slower where they are refused, and its largest value.
const SLOWER: f64 = 1.4;
const SLOWEST: f64 = 4.0;
/// Share of the expected information below which a segment's worth is corrected.
const AS_EXPECTED: f64 = 0.85;
/// Length of the motions that are made for what is asked for, and of their ramps, s.
const DESIGNED_S: f64 = 4.0;
const RAMP_S: f64 = 0.5;
/// Tests of a body that is not known, at most.
const MOST_LOOKS: u32 = 3;
/// Limits are met for every body within this many standard deviations of an identified estimate.
const DEVIATIONS: f64 = 3.0;
/// Segments and ways that are examined for one decision, at most: it is made within seconds.
const MOST_CHECKS: u32 = 60;
/// If less than this is left to do, no new motion is worth its planning, s.
const WORTH_DESIGNING_S: f64 = 4.0;

/// A segment that has been decided on.
#[derive(Clone, Debug)]
pub struct Decision {
    index: usize,
    moves: [bool; 6],
    brings: Information,
    /// The name for people.
    pub name: String,
    /// The program from where the plate is.
    pub program: MotionProgram,
    /// The time when everything asked for should be reached, s from now.
    pub expected_s: f64,
    /// The information of the sequence of segments that begins with it, and the seconds that it takes.
    sequence: Step,
    /// The members of that sequence.
    members: Vec<usize>,
}

impl Decision {
    /// Returns the information that it should bring.
    pub fn information(&self) -> &Information {
        &self.brings
    }

    /// Returns what should be known the given number of seconds later.
    pub fn information_after(&self, seconds: f64, known: &Known) -> Information {
        known.information + self.sequence.brings * (seconds / self.sequence.seconds)
    }
}

/// The next action.
#[derive(Clone, Debug)]
pub enum Next {
    /// A segment to drive.
    Segment(Box<Decision>),
    /// Ask the platform whether it would take this, without driving it, and tell by [`Planner::answered`].
    Question(MotionProgram),
    /// Everything asked for is reached.
    Reached,
    /// No motion is known to keep every limit whatever of what is allowed is on the load cell.
    Unsafe,
    /// Nothing that the machine does leads there. The parameter that stays furthest off.
    Hopeless(&'static str),
}

/// The knowledge so far.
#[derive(Clone, Copy, Debug)]
pub struct Known<'a> {
    /// The information of the device's factor.
    pub information: &'a Information,
    /// The ten parameters, once they are identified.
    pub estimate: Option<&'a [f64]>,
    /// Mass and first moment, once these are identified.
    pub first: Option<[f64; 4]>,
    /// The noise's variance relative to what was assumed.
    pub variance_scale: f64,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// A motion of the library.
    Stock,
    /// A motion made for what is asked for.
    Made,
    /// A small motion made for what is asked for, to see what the body is like.
    Look,
}

struct Entry {
    candidate: Candidate,
    /// Index of its centre.
    place: usize,
    brings: Information,
    scale: f64,
    /// The result of what was expected.
    worth: f64,
    kind: Kind,
    /// Every limit is guaranteed at every instant.
    guaranteed: bool,
}

/// A way between places.
#[derive(Clone)]
struct Way {
    /// `None` from a place to itself.
    segment: Option<Segment>,
    step: Step,
    guaranteed: bool,
}

/// Decides between segments.
pub struct Planner {
    rig: RigModel,
    asked: Asked,
    entries: Vec<Entry>,
    places: Vec<Pose>,
    /// From, to.
    ways: Vec<Vec<Option<Way>>>,
    at: usize,
    lost: [bool; 6],
    /// Coordinates of which the platform has taken some motion.
    taken: [bool; 6],
    /// The questions to the platform, the last first.
    questions: Vec<Question>,
    /// The number of times that a limit was found to be tighter than believed.
    tightened: u32,
    /// The number of further tests allowed while the body is not known.
    looks: u32,
    /// The bodies that a scale and bounds leave.
    weighed: Option<BodySet>,
    /// The body is the estimate's.
    identified: bool,
    /// An estimate that is identified contradicts them.
    contradicted: bool,
    /// Motions were made smaller for want of knowledge of the body.
    shrunk: bool,
    /// The number of checks left for this decision.
    checks: u32,
    /// Motions made for what is asked for are those of the present machine, and whether with an estimate.
    designs: Option<bool>,
    /// The number made since the last test of it.
    made: usize,
    /// The factor by which moves between places take longer than thought right.
    slower: f64,
    /// The sequence that was chosen last, and what has been driven since it is that one.
    turns: Turns,
}

impl Planner {
    /// Checks what the machine can do. The plate is at home.
    pub fn new(rig: RigModel, asked: Asked) -> Self {
        let rig_needs_look = rig.limits_forces().is_some();
        let mut planner = Self {
            weighed: rig.body.clone(),
            identified: false,
            contradicted: false,
            shrunk: false,
            checks: MOST_CHECKS,
            rig,
            asked,
            entries: Vec::new(),
            places: Vec::new(),
            ways: Vec::new(),
            at: 0,
            lost: [false; 6],
            taken: [false; 6],
            questions: Vec::new(),
            tightened: 0,
            looks: if rig_needs_look { MOST_LOOKS } else { 0 },
            designs: None,
            made: 0,
            slower: 1.0,
            turns: Turns::default(),
        };
        let home = planner.rig.geometry.home();
        planner.take_stock(home);
        let prior = planner.rig.prior();
        planner.design(&Known { information: &prior, estimate: None, first: None, variance_scale: 1.0 }, 1.0);
        planner.made = 0;
        planner
    }

    /// Returns the coordinates that do not follow.
    pub fn lost(&self) -> [bool; 6] {
        self.lost
    }

    /// Returns how many segments there are to choose from.
    pub fn choices(&self) -> usize {
        self.entries.len()
    }

    /// Returns how many motions have been made since this was asked last: each takes about half a second, the
    /// plate at rest.
    pub fn motions_made(&mut self) -> usize {
        std::mem::take(&mut self.made)
    }

    /// Returns true if an identified estimate is none of the bodies that bounds and a scale allow: it is not
    /// used.
    pub fn contradicted(&self) -> bool {
        self.contradicted
    }

    /// Returns the program of all candidates, one after the other.
    pub fn everything(&self) -> MotionProgram {
        let start = self.rig.geometry.home();
        let (mut at, mut segments) = (start, Vec::new());
        for entry in &self.entries {
            // What is too large as it is is made smaller before it is decided on.
            let program = entry.candidate.program(&at, self.slower, &self.rig.geometry);
            if let Some(program) = program.filter(|program| keeps(program, &self.rig.geometry)) {
                segments.extend(program.segments);
                at = entry.candidate.centre;
            }
        }
        MotionProgram { start, segments }
    }

    /// Returns what is asked for, by what is known.
    pub fn goal(&self, known: &Known) -> Goal {
        self.asked.goal(known.estimate, &self.rig.compact())
    }

    fn take_stock(&mut self, at: Pose) {
        self.places = vec![at];
        self.entries = Vec::new();
        self.designs = None;
        self.at = 0;
        for candidate in library(&self.rig, &self.lost) {
            self.add(candidate, Kind::Stock);
        }
        self.find_ways();
    }

    fn add(&mut self, candidate: Candidate, kind: Kind) {
        let Some(brings) = self.information_of(&candidate) else { return };
        let place = self.places.iter().position(|p| *p == candidate.centre).unwrap_or_else(|| {
            self.places.push(candidate.centre);
            self.places.len() - 1
        });
        self.entries.push(Entry {
            candidate,
            place,
            brings,
            scale: 1.0,
            worth: 1.0,
            kind,
            guaranteed: false,
        });
    }

    fn information_of(&self, candidate: &Candidate) -> Option<Information> {
        let alone = MotionProgram { start: candidate.centre, segments: vec![candidate.segment.clone()] };
        self.rig.information(&alone, &[false; 6]).ok()
    }

    fn find_ways(&mut self) {
        self.ways = self
            .places
            .iter()
            .map(|from| self.places.iter().map(|to| self.way(from, to, self.slower)).collect())
            .collect();
    }

    fn way(&self, from: &Pose, to: &Pose, slower: f64) -> Option<Way> {
        if from == to {
            let step = Step { seconds: 0.0, brings: Information::zeros() };
            return Some(Way { segment: None, step, guaranteed: true });
        }
        let segment = way(from, to, slower, &self.rig.geometry)?;
        let seconds = segment.duration_s();
        let program = MotionProgram { start: *from, segments: vec![segment.clone()] };
        let brings = self.rig.information(&program, &[false; 6]).ok()?;
        Some(Way { segment: Some(segment), step: Step { seconds, brings }, guaranteed: false })
    }

    fn step(&self, from: usize, to: usize) -> Option<Step> {
        let entry = self.entries.get(to).filter(|entry| entry.kind != Kind::Look)?;
        let way = &self.ways.get(from)?.get(entry.place)?.as_ref()?.step;
        Some(Step {
            seconds: way.seconds + entry.candidate.segment.duration_s(),
            brings: way.brings + entry.brings * entry.worth,
        })
    }

    /// Returns what to do now.
    pub fn next(&mut self, known: &Known) -> Next {
        let goal = self.goal(known);
        self.checks = MOST_CHECKS;
        if self.asked.is_known(known.estimate) && goal.worst(known.information, known.variance_scale) <= 1.0 {
            return Next::Reached;
        }
        if let Some(question) = self.question() {
            return Next::Question(question);
        }
        self.learn(known);
        if self.designs.is_none() {
            self.design(known, 1.0);
        }
        if let Some(decision) = self.look() {
            return Next::Segment(Box::new(decision));
        }
        let mut choice = self.guaranteed_choice(&goal, known);
        let seconds = choice.as_ref().map_or(f64::INFINITY, |c| c.seconds);
        if seconds > WORTH_DESIGNING_S && self.designs == Some(false) && known.estimate.is_some() {
            self.design(known, if seconds.is_finite() { seconds / DESIGNED_S } else { 1.0 });
            choice = self.guaranteed_choice(&goal, known);
        }
        choice
            .and_then(|chosen| self.decide(&chosen))
            .map_or_else(|| self.nothing(&goal, known), |decision| Next::Segment(Box::new(decision)))
    }

    /// Returns why nothing is left to do.
    fn nothing(&self, goal: &Goal, known: &Known) -> Next {
        let moves = |entry: &Entry| matches!(entry.candidate.segment, Segment::Multisine { .. });
        if !self.identified && !self.entries.iter().any(moves) {
            return Next::Unsafe;
        }
        Next::Hopeless(self.furthest(goal, known))
    }

    /// Returns a careful motion while the body is not known.
    fn look(&mut self) -> Option<Decision> {
        if self.identified || self.looks == 0 {
            return None;
        }
        while let Some(index) = self.entries.iter().position(|entry| entry.kind == Kind::Look) {
            let choice = Choice::alone(index);
            if self.guarantee(&choice) {
                return self.decide(&choice);
            }
        }
        None
    }

    fn guaranteed_choice(&mut self, goal: &Goal, known: &Known) -> Option<Choice> {
        loop {
            match self.choose(goal, known) {
                Some(choice) if self.guarantee(&choice) => return Some(choice),
                Some(_) => {}
                // What has not been examined is no reason to give up.
                None if self.checks == 0 => self.checks = MOST_CHECKS,
                None => return None,
            }
        }
    }

    fn choose(&self, goal: &Goal, known: &Known) -> Option<Choice> {
        // Where time is up, what is known to keep the limits.
        let open = |to: usize| self.checks > 0 || self.entries.get(to).is_some_and(|e| e.guaranteed);
        let step = |from: Option<usize>, to: usize| {
            if !open(to) {
                return None;
            }
            let from = from.map_or(Some(self.at), |c| self.entries.get(c).map(|e| e.place))?;
            self.step(from, to)
        };
        let choice = choose(self.entries.len(), &step, goal, known.information, known.variance_scale)?;
        let can_begin = |first: usize| self.step(self.at, first).is_some() && open(first);
        let once_s = self.along(&choice.sequence).seconds;
        Some(self.turns.in_turn(choice, once_s, can_begin))
    }

    /// Returns the step of a whole sequence, from where the plate is.
    fn along(&self, sequence: &[usize]) -> Step {
        let (mut from, mut whole) = (self.at, Step { seconds: 0.0, brings: Information::zeros() });
        for to in sequence {
            let Some(step) = self.step(from, *to) else { continue };
            whole = Step { seconds: whole.seconds + step.seconds, brings: whole.brings + step.brings };
            from = self.entries.get(*to).map_or(from, |entry| entry.place);
        }
        whole
    }

    /// Learns what the legs and the load cell carry, as it becomes known.
    fn learn(&mut self, known: &Known) {
        let Some(root) = InverseRoot::of(known.information) else { return };
        let deviations = DEVIATIONS * known.variance_scale.sqrt();
        let body = known.estimate.and_then(|phi| Some((*phi.first_chunk::<10>()?, body_of(phi)?)));
        match (body, known.first, &self.weighed) {
            (Some((phi, body)), ..) => {
                self.contradicted = self.weighed.as_ref().is_some_and(|weighed| !weighed.may_hold(&body));
                if self.contradicted {
                    return;
                }
                let estimated = BodySet::estimated(phi, &root.half_axes(), deviations);
                self.rig.body = Some(match &self.weighed {
                    Some(weighed) => estimated.and(weighed.clone()),
                    None => estimated,
                });
                let first = !std::mem::replace(&mut self.identified, true);
                if first && self.shrunk {
                    // They need not be so small any more.
                    if let Some(at) = self.places.get(self.at).copied() {
                        self.take_stock(at);
                    }
                }
            }
            // The tensor is any that the bound leaves.
            (None, Some(first), Some(weighed)) if !self.identified => {
                self.rig.body = Some(weighed.with_first_moments(first, &root.half_axes(), deviations));
            }
            _ => return,
        }
        if self.rig.limits_forces().is_some() {
            self.entries.iter_mut().for_each(|entry| entry.guaranteed = false);
            self.ways.iter_mut().flatten().flatten().for_each(|way| way.guaranteed = way.segment.is_none());
        }
    }

    fn decide(&self, choice: &Choice) -> Option<Decision> {
        let index = *choice.sequence.first()?;
        let entry = self.entries.get(index)?;
        let way = self.ways.get(self.at)?.get(entry.place)?.as_ref()?;
        let segments = way.segment.iter().chain([&entry.candidate.segment]).cloned().collect();
        Some(Decision {
            sequence: self.along(&choice.sequence),
            members: choice.sequence.clone(),
            index,
            moves: entry.candidate.moves(),
            brings: way.step.brings + entry.brings * entry.worth,
            name: entry.candidate.name.clone(),
            program: MotionProgram { start: *self.places.get(self.at)?, segments },
            expected_s: choice.seconds,
        })
    }

    /// Returns the parameter that is furthest off, of everything at once.
    fn furthest(&self, goal: &Goal, known: &Known) -> &'static str {
        let all = self.entries.iter().fold(*known.information, |sum, e| sum + e.brings);
        goal.furthest(&all)
    }

    /// Receives that the decision was carried out to its end with this result. Returns coordinates that turn
    /// out not to follow.
    pub fn carried_out(&mut self, decision: &Decision, observed: &Information) -> [bool; 6] {
        self.turns.driven(&decision.members, decision.index);
        if let Some(entry) = self.entries.get(decision.index) {
            self.at = entry.place;
            if entry.kind == Kind::Look {
                self.looks = self.looks.saturating_sub(1);
            }
        }
        for (taken, moved) in self.taken.iter_mut().zip(moved(&decision.program)) {
            *taken |= moved;
        }
        let newly = stood_still(&self.rig, &decision.program, &decision.moves, observed);
        if newly.contains(&true) {
            self.lose(&newly);
            return newly;
        }
        let came = share(&decision.brings, observed);
        if came < AS_EXPECTED
            && let Some(entry) = self.entries.get_mut(decision.index)
            && matches!(entry.candidate.segment, Segment::Multisine { .. })
        {
            entry.worth *= came;
        }
        newly
    }
}

/// Marks the coordinates in which two poses differ.
fn mark_moved(at: &Pose, to: &Pose, moved: &mut [bool; 6]) {
    for k in 0..3 {
        moved[k] |= to.position_m[k] != at.position_m[k];
        moved[k + 3] |= to.rpy_rad[k] != at.rpy_rad[k];
    }
}

/// Returns the coordinates that a program moves, ways included.
fn moved(program: &MotionProgram) -> [bool; 6] {
    let mut moved = [false; 6];
    let mut at = program.start;
    for segment in &program.segments {
        match segment {
            Segment::Move { to, .. } => {
                mark_moved(&at, to, &mut moved);
                at = *to;
            }
            Segment::Path { via, to, .. } => {
                via.iter().chain([to]).for_each(|pose| mark_moved(&at, pose, &mut moved));
                at = *to;
            }
            Segment::Multisine { terms, .. } => {
                terms.iter().filter(|t| t.amplitude != 0.0).for_each(|t| moved[t.axis as usize] = true);
            }
            Segment::Hold { .. } | Segment::Sphere(_) => {}
        }
    }
    moved
}

/// Makes the body of `[m, mc, I about S]`; `None` where no body is like that.
fn body_of(phi: &[f64]) -> Option<BodyParameters> {
    let [m, x, y, z, xx, yy, zz, yz, zx, xy] = *phi.first_chunk::<10>()?;
    super::goal::largest_principal(phi)?;
    let [x, y, z] = [x / m, y / m, z / m];
    let about_com = [
        xx - m * (y * y + z * z),
        yy - m * (z * z + x * x),
        zz - m * (x * x + y * y),
        yz + m * y * z,
        zx + m * z * x,
        xy + m * x * y,
    ];
    Some(BodyParameters { mass_kg: m, com_m: [x, y, z], inertia_com_kgm2: about_com })
}

//! Why a recording cannot be true: the usual faults are undone one by one, and the one that makes it true is
//! named.
//!
//! A recording that the answer refuses is changed as if it had one fault, of a unit, a sign, an axis, a
//! swapped pair, a delay, a key of the rig file, and is fitted again. First quickly: what least squares leave
//! of each channel ([`mod@rigident_fit::explained`]), a likelihood that does not depend on units. Then the
//! best are fitted in full, and judged as any recording is. Lives here: the list of faults ([`sensors`],
//! [`joints`], those with settings that the recording tells, `gains`), and the choice. May not live here:
//! whether a recording can be true ([`crate::answer`]).

mod attitude;
mod clock;
mod gains;
mod gyro_scale;
pub mod joints;
pub mod sensors;
mod still_poses;
mod tuned;

use crate::answer::result::{Cause, Status};
use crate::answer::{
    Answer, Context, Links, StandardRequest, lacks_something_of_drives, leaves_little_of_poses, scaled,
};
use crate::problem::{Problem, ProblemOptions, Subject};
use rigident_fit::explained::{BLOCKS, explained};
use rigident_fit::{Fit, FitOptions, Progress, RowSource, Silent, parallel};
use rigident_io::recording::Recording;
use rigident_model::Model;
use rigident_rows::body::{BodySource, prepare};
use rigident_rows::tree::drive::Friction;
use std::cell::LazyCell;
use std::ops::Range;

/// Rows that faults are tried on at first, from the middle of the recording; at least this many seconds.
const QUICK_ROWS: usize = 2000;
const QUICK_S: f64 = 10.0;
/// Seconds that the best are fitted to.
const FULL_S: f64 = 20.0;
/// Rows a second that faults of one body are tried on at first, at least: means of as many rows as that
/// takes.
const THINNED_HZ: f64 = 200.0;
/// Blocks that every fault is tried on, before those that may be among the best are tried on more; these are
/// the best kinds, and what leaves nearly as little as the best of its kind.
const FIRST_BLOCKS: usize = 150;
const FIRST_KINDS: usize = 16;
const FIRST_ALIKE: f64 = 0.15;
/// Faults that are fitted in full.
const FULL: usize = 8;
/// A fault explains as much as another one if its mean logarithm of what is left differs by less than this.
const ALIKE: f64 = 0.05;
/// No fault is confirmed, or one of several, where another one leaves less by more than this: it is not down
/// to the noise.
const NOISE: f64 = 0.3;
/// Without its fault a recording leaves at most this share of what it left before, if there is more than the
/// fault that is left.
const EXPLAINS: f64 = 0.7;
/// The same where the recording could be true with a model that lacks something.
const ACCUSES: f64 = 0.5;
/// Says what to do where several faults explain a recording alike,
const WHICH: &str = "it does not tell which: weigh the body, or look at the sensors' settings";
/// and where what is left without a fault is no recording that can be true: its remedy alone would not do.
const PARTLY: &str = "look for what else is wrong before anything is changed";
/// Causes that are named beside one another.
const NAMED: usize = 3;

/// A recording as it is fitted.
#[derive(Clone)]
pub struct Case {
    /// The readings with their rig file; of a long recording those that faults are tried on do
    /// ([`looked_at`]).
    pub recording: Recording,
    /// The tree; `None` of one body.
    pub model: Option<Model>,
    /// The parameters identified beside the links.
    pub options: ProblemOptions,
}

/// Makes of a recording what it is without a fault; false if it cannot have that fault.
type Undo = Box<dyn Fn(&mut Case) -> bool + Send + Sync>;

/// A fault that a recording may have.
pub struct Fault {
    /// Faults of one kind of one sensor: only the best of them counts.
    pub kind: String,
    /// The fault in words.
    pub what: String,
    /// The remedy.
    pub remedy: String,
    undo: Undo,
}

impl Fault {
    fn new(
        kind: impl Into<String>,
        what: impl Into<String>,
        remedy: impl Into<String>,
        undo: impl Fn(&mut Case) -> bool + Send + Sync + 'static,
    ) -> Self {
        Self { kind: kind.into(), what: what.into(), remedy: remedy.into(), undo: Box::new(undo) }
    }

    /// Returns the case without the fault; `None` if it cannot have it.
    pub fn undone(&self, case: &Case) -> Option<Case> {
        let mut case = case.clone();
        (self.undo)(&mut case).then_some(case)
    }
}

/// Returns every fault that a recording may have, the simplest of a kind first.
pub fn faults(case: &Case) -> Vec<Fault> {
    let mut all = sensors::faults(case);
    all.extend(clock::faults(case));
    all.extend(still_poses::faults(case));
    if let Some(model) = &case.model {
        // Before units, which leave as much of each joint by itself.
        all.extend(gains::fault(case, model));
        all.extend(joints::faults(case, model));
    }
    all
}

/// A fault that was tried.
struct Tried<'a> {
    fault: &'a Fault,
    /// Mean logarithm of what is left.
    left: f64,
}

/// Looks for a fault where the recording of an answer cannot be true, or where its model lacks something of
/// the drives: in either case a fault that explains it makes the answer one that cannot be used. Returns the
/// fault, to be explained.
pub fn judge(
    case: &Case,
    (fit, links): (&Fit, Option<&Links<'_>>),
    answer: &mut Answer,
    progress: &dyn Progress,
) -> Option<Cause> {
    let lacking = lacks_something_of_drives(fit);
    if !lacking && answer.status != Status::Implausible {
        return None;
    }
    let residuals = lacking || answer.change.is_some() || answer.not_rigid.is_some();
    // Efforts of another size than any robot's speak against the recording whatever is left of them.
    let lacks_fit = residuals && links.is_none_or(|links| scaled(fit, links).is_none());
    let most = match answer.status {
        Status::Implausible => lacks_fit.then_some(EXPLAINS),
        _ => Some(ACCUSES),
    };
    let cause = diagnose(case, most, progress)?;
    answer.withhold();
    Some(cause)
}

/// Returns the fault that best explains why a recording cannot be true, and what explains it as well; `None`
/// if none does. Where residuals alone speak against the recording, only a fault without which they are at
/// most this share of what they are (`most`, the product over all channels) explains that.
pub fn diagnose(case: &Case, most: Option<f64>, progress: &dyn Progress) -> Option<Cause> {
    let (quick, full) = rows(case.recording.rate_hz);
    let mut quick = thinned(&shortened(case, quick));
    if let Some(problem) = case.model.as_ref().and_then(|_| posed(&quick)) {
        quick.options.friction = with_speeds(&quick.options.friction, &problem);
    }
    // Where no row is left nothing is explained.
    let (before, channels) = rows_of(&quick).and_then(|rows| left_by(&*rows, BLOCKS)).unwrap_or((0.0, 1));
    // A delay of efforts that they may have is estimated with the body: no fault has to explain it.
    let known: Vec<Fault> = case.model.iter().flat_map(|model| joints::known_delays(&quick, model)).collect();
    let tried = try_each(&quick, &known.iter().collect::<Vec<_>>(), BLOCKS, progress);
    let before = tried.iter().map(|tried| tried.left).fold(before, f64::min);
    let most = before + most.map_or(ALIKE, |share| share.ln() / channels as f64);
    let full = shortened(case, full);
    let explaining = before + EXPLAINS.ln() / channels as f64;
    let faults: Vec<Fault> = faults(&quick).into_iter().chain(attitude::faults(&quick)).collect();
    let best = best_of_each_kind(try_all(&quick, &faults, progress), most);
    // If a part of the recording can be true as it is, only what explains its residuals is a cause. That part
    // is fitted only if it matters.
    let is_true = LazyCell::new(|| most >= before && is_plausible(&full));
    let is_cause = |tried: &Tried| tried.left < explaining || !*is_true;
    let mut plausible = plausible_among(&best, &full, is_cause, progress);
    let least = best.iter().map(|tried| tried.left).fold(f64::INFINITY, f64::min);
    // What leaves much more than another fault is not all, though the recording could be true without it.
    plausible.retain(|tried| tried.left < least + NOISE);
    // The recording cannot decide among faults that explain it alike: none of them is confirmed.
    let (confirmed, ambiguous) = (plausible.len() == 1, plausible.len() > 1);
    if plausible.is_empty() {
        let enough = |tried: &Tried| tried.left < least + ALIKE && tried.left < before + EXPLAINS.ln();
        plausible = best.into_iter().filter(enough).take(NAMED).collect();
    }
    let first = plausible.first()?;
    Some(Cause {
        what: first.fault.what.clone(),
        remedy: match (confirmed, ambiguous) {
            (true, _) => first.fault.remedy.clone(),
            (false, true) => WHICH.to_owned(),
            (false, false) => PARTLY.to_owned(),
        },
        confirmed,
        ambiguous,
        residuals_left: (first.left - before).exp(),
        alternatives: plausible.iter().skip(1).map(|tried| tried.fault.what.clone()).collect(),
    })
}

/// Undoes each fault on its own: on few rows first, then what may be among the best on all.
fn try_all<'a>(quick: &Case, faults: &'a [Fault], progress: &dyn Progress) -> Vec<Tried<'a>> {
    let all: Vec<&Fault> = faults.iter().collect();
    let first = try_each(quick, &all, FIRST_BLOCKS, progress);
    let mut kinds: Vec<(&str, f64)> = Vec::new();
    for tried in &first {
        match kinds.iter_mut().find(|(kind, _)| *kind == tried.fault.kind) {
            Some((_, left)) => *left = left.min(tried.left),
            None => kinds.push((&tried.fault.kind, tried.left)),
        }
    }
    kinds.sort_by(|a, b| a.1.total_cmp(&b.1));
    kinds.truncate(FIRST_KINDS);
    let is_near = |tried: &&Tried| {
        kinds.iter().any(|(kind, left)| *kind == tried.fault.kind && tried.left < left + FIRST_ALIKE)
    };
    let best: Vec<&Fault> = first.iter().filter(is_near).map(|tried| tried.fault).collect();
    try_each(quick, &best, BLOCKS, progress)
}

/// Undoes each fault on its own, in turns, so that progress is shown.
fn try_each<'a>(
    quick: &Case,
    faults: &[&'a Fault],
    blocks: usize,
    progress: &dyn Progress,
) -> Vec<Tried<'a>> {
    let mut tried = Vec::new();
    for (turn, chunk) in faults.chunks(CHUNK).enumerate() {
        progress.stage("looking for the cause", (turn * CHUNK) as f64 / faults.len() as f64);
        let found = parallel::map(parallel::threads(), chunk.len(), |k| {
            let fault = *chunk.get(k)?;
            Some(Tried { fault, left: left_by(&*rows_of(&fault.undone(quick)?)?, blocks)?.0 })
        });
        tried.extend(found.into_iter().flatten());
    }
    tried
}

/// Returns those of the best faults that may be causes and explain as much as the first one without which
/// the recording can be true.
fn plausible_among<'a>(
    best: &[Tried<'a>],
    full: &Case,
    is_cause: impl Fn(&Tried) -> bool,
    progress: &dyn Progress,
) -> Vec<Tried<'a>> {
    let mut plausible: Vec<Tried> = Vec::new();
    let mut fitted = 0;
    for tried in best {
        progress.stage("trying the likeliest causes", 0.0);
        let found = plausible.first().map_or(f64::INFINITY, |first| first.left);
        if tried.left > found + ALIKE || plausible.len() >= NAMED || fitted >= FULL {
            break;
        }
        if !is_cause(tried) {
            continue;
        }
        fitted += 1;
        if tried.fault.undone(full).as_ref().is_some_and(is_plausible) {
            plausible.push(Tried { fault: tried.fault, left: tried.left });
        }
    }
    plausible
}

/// Two faults of one kind leave the same if they differ by a common sign.
const REVERSE: f64 = 1e-6;

/// Faults between two reports of progress.
const CHUNK: usize = 16;

/// Returns the best of each kind that leave less than `most`: those that leave as little as the one that
/// leaves least, in the order of the list, then the others, what leaves less first.
fn best_of_each_kind(tried: Vec<Tried<'_>>, most: f64) -> Vec<Tried<'_>> {
    let mut best: Vec<Tried> = Vec::new();
    for tried in tried {
        match best.iter_mut().find(|other| other.fault.kind == tried.fault.kind) {
            // The reverse of what explains all explains as much: which of the two is judged by the body.
            Some(other) if (tried.left - other.left).abs() < REVERSE => best.push(tried),
            Some(other) if tried.left < other.left => *other = tried,
            Some(_) => {}
            None => best.push(tried),
        }
    }
    best.retain(|tried| tried.left < most);
    sort(&mut best);
    best
}

/// Sorts by what is left; faults that leave as little as the one that leaves least keep their order.
fn sort(best: &mut [Tried]) {
    let least = best.iter().map(|tried| tried.left).fold(f64::INFINITY, f64::min);
    best.sort_by(|a, b| a.left.max(least + ALIKE).total_cmp(&b.left.max(least + ALIKE)));
}

/// Returns the problem that a case poses; `None` if it poses none.
fn posed(case: &Case) -> Option<Problem> {
    Problem::from_recording(&case.recording, case.model.as_ref(), &case.options).ok()
}

/// Returns the rows of a case, for a quick look at what they explain; `None` if it has none.
fn rows_of(case: &Case) -> Option<Box<dyn RowSource>> {
    let recording = &case.recording;
    if case.model.is_none() && !recording.is_static && recording.rig.suspension.is_none() {
        let input = prepare::rows_alone(recording.clone()).ok()?;
        return Some(Box::new(BodySource::of_rows(input)));
    }
    Some(posed(case)?.into_source())
}

/// Returns the friction columns with the speeds that a problem found for them, so that they are not looked
/// for with each fault.
fn with_speeds(friction: &Friction, problem: &Problem) -> Friction {
    let Subject::Tree { source, .. } = &problem.subject else { return friction.clone() };
    let drives = source.input().drives.iter();
    let by_drive = drives.map(|drive| (drive.name.clone(), drive.terms.clone())).collect();
    Friction { by_drive, ..friction.clone() }
}

/// Returns the mean logarithm of what least squares leave of at most this many blocks, and of how many
/// channels; `None` if there are no rows.
fn left_by(rows: &dyn RowSource, blocks: usize) -> Option<(f64, usize)> {
    let found = explained(rows, blocks).ok()?;
    Some((found.unexplained(), found.shares.len().max(1))).filter(|(left, _)| left.is_finite())
}

/// Returns true if the recording can be true, tells something, and is of a body that there may be.
fn is_plausible(case: &Case) -> bool {
    let options = FitOptions { convergence_points: 0, verdict_alone: true, ..FitOptions::default() };
    let answer = || {
        let problem = posed(case)?;
        let fit = problem.fit(&options, &Silent).ok()?;
        let standard = case.model.as_ref().map(StandardRequest::of);
        let context = Context { links: problem.links(standard), ..Context::default() };
        Answer::new(&fit, context).ok().filter(|_| leaves_little_of_poses(&fit))
    };
    answer().is_some_and(|answer| matches!(answer.status, Status::Identified | Status::PartlyIdentified))
}

/// Returns the rows that faults are tried on at first, and those that the best are fitted to.
fn rows(rate_hz: Option<f64>) -> (usize, usize) {
    let rate = rate_hz.unwrap_or(1.0);
    (QUICK_ROWS.max((QUICK_S * rate) as usize), (FULL_S * rate) as usize)
}

/// Returns the case with the given number of rows of the middle of its recording.
fn shortened(case: &Case, rows: usize) -> Case {
    let recording = middle(&case.recording, rows);
    Case { recording, model: case.model.clone(), options: case.options.clone() }
}

/// Returns the case of one body with means of its rows, such that some [`THINNED_HZ`] a second are left.
fn thinned(case: &Case) -> Case {
    let rate_hz = case.recording.rate_hz.unwrap_or(1.0);
    let by = (rate_hz / THINNED_HZ) as usize;
    if case.model.is_some() || case.recording.is_static || by < 2 {
        return case.clone();
    }
    Case { recording: case.recording.thinned(by), model: None, options: case.options.clone() }
}

/// Returns as many rows of the middle of a recording.
fn middle(recording: &Recording, rows: usize) -> Recording {
    if recording.is_static || recording.rows() <= rows {
        return recording.clone();
    }
    recording.section(middle_of(recording.rows(), rows))
}

/// Returns the middle of as many rows, at most `rows` of them.
fn middle_of(all: usize, rows: usize) -> Range<usize> {
    let start = all.saturating_sub(rows) / 2;
    start..(start + rows).min(all)
}

/// Returns the rows that [`diagnose`] examines of as many rows of a moving body at a rate, Hz.
pub fn rows_looked_at(all: usize, rate_hz: Option<f64>) -> Range<usize> {
    let (quick, full) = rows(rate_hz);
    let most = quick.max(full);
    // As many rows more or fewer on either side: the middle of the middle is that of the whole.
    middle_of(all, most + all.saturating_sub(most) % 2)
}

/// Returns the part of a recording that [`diagnose`] examines.
pub fn looked_at(recording: &Recording) -> Recording {
    if recording.is_static {
        return recording.clone();
    }
    recording.section(rows_looked_at(recording.rows(), recording.rate_hz))
}

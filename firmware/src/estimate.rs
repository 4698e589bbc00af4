//! The estimate for the host, in slices between samples: the factor, its solution, the nearest body.
//!
//! A snapshot of what has been absorbed is put together to one factor, solved, and the nearest body searched
//! for, a bounded step at a time. The operations and their order are those of doing it in one go, so are the
//! bits.

use heapless::Vec;
use rigident_shared::consistency::{ITERATIONS, Nearest, Search};
use rigident_shared::factor::{Solution, Solver};
use rigident_shared::wire::{Consistency, EstimateReport, MAX_PARAMETERS, ReadingMessage};

use crate::sample_path::SamplePath;

/// A pair of columns of n numbers takes about 40 n instructions to rotate; with one body's columns this many
/// slices stay below 9000.
const BODY_SLICE: usize = 8_000 / 40;
/// Of two links a slice may take as long as a step of the stop check.
const LINKS_SLICE: usize = 32_000 / 40;

/// Tells what is done next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// There is nothing to be done.
    Idle,
    /// Levels are merged.
    Fold,
    /// The part that noise of the signals adds is taken off.
    Compensate,
    /// Columns are scaled.
    Scale,
    /// Columns are rotated.
    Rotate,
    /// The solution is read off.
    Solve,
    /// The solution is judged, which begins the search.
    Judge,
    /// The nearest body is searched for.
    Search,
    /// It can be reported.
    Ready,
}

/// An estimate that is being made.
pub(crate) struct Estimation {
    phase: Phase,
    parameters: usize,
    /// Tells what is known at the snapshot already.
    report: EstimateReport,
    solver: Solver<f32, MAX_PARAMETERS>,
    search: Search<f32>,
}

impl Estimation {
    pub(crate) const IDLE: Self = Self {
        phase: Phase::Idle,
        parameters: 0,
        report: EstimateReport::EMPTY,
        solver: Solver::UNUSED,
        search: Search::UNUSED,
    };

    /// Returns whether an estimate is being made.
    pub(crate) fn is_busy(&self) -> bool {
        self.phase != Phase::Idle
    }

    /// Returns whether it still needs the path's snapshot.
    pub(crate) fn needs_snapshot(&self) -> bool {
        matches!(self.phase, Phase::Fold | Phase::Compensate)
    }

    /// Makes none.
    pub(crate) fn stop(&mut self) {
        self.phase = Phase::Idle;
    }

    /// Begins with what has been absorbed so far. `last` is the reading absorbed last.
    #[inline(never)]
    pub(crate) fn begin(&mut self, path: &mut SamplePath, last: ReadingMessage) {
        path.take_snapshot();
        let counters = path.counters();
        let report = &mut self.report;
        (report.readings, report.blocks, report.time_ns) = (counters.readings, counters.blocks, last.time_ns);
        report.innovation_rms = path.statistics().rms().unwrap_or_default();
        report.last = last;
        self.phase = Phase::Fold;
    }

    /// Does one slice. The report once it is ready.
    #[inline(never)]
    pub(crate) fn step(&mut self, path: &mut SamplePath) -> Option<&EstimateReport> {
        self.phase = match self.phase {
            Phase::Idle => Phase::Idle,
            Phase::Fold if !path.fold() => Phase::Fold,
            Phase::Fold => Phase::Compensate,
            Phase::Compensate if !path.compensate() => Phase::Compensate,
            Phase::Compensate => Phase::Scale,
            Phase::Scale => {
                self.parameters = path.begin_solution(&mut self.solver, &mut self.search);
                Phase::Rotate
            }
            Phase::Rotate => {
                let n = self.parameters;
                let slice = if path.has_two_links() { LINKS_SLICE } else { BODY_SLICE };
                if self.solver.rotate(slice / n.max(1)) { Phase::Solve } else { Phase::Rotate }
            }
            Phase::Solve => self.solve(path.has_two_links()),
            Phase::Judge => {
                self.search.begin(&self.report.estimate, ITERATIONS);
                Phase::Search
            }
            Phase::Search if !self.search.step() => Phase::Search,
            Phase::Search => {
                self.take_nearest();
                Phase::Ready
            }
            Phase::Ready => {
                self.phase = Phase::Idle;
                return Some(&self.report);
            }
        };
        None
    }

    fn solve(&mut self, two_links: bool) -> Phase {
        let solution: Solution<f32, MAX_PARAMETERS> = self.solver.finish();
        let n = self.parameters;
        let report = &mut self.report;
        fill(&mut report.estimate, &solution.estimate, n);
        fill(&mut report.standard_deviation, &solution.standard_deviation, n);
        let determined = solution.determined.iter().take(n).enumerate();
        report.determined = determined.fold(0, |bits, (j, d)| bits | u32::from(*d) << j);
        report.condition_number = solution.condition_number;
        // Base parameters of several links may be those of bodies in many ways.
        (report.consistency, report.distance_sd) = (Consistency::NotDetermined, 0.0);
        if two_links { Phase::Ready } else { Phase::Judge }
    }

    /// Tells the nearest body in place of the free answer, if there is one.
    fn take_nearest(&mut self) {
        let nearest: Nearest<f32, 16> = self.search.nearest();
        let report = &mut self.report;
        report.consistency = match &nearest {
            Nearest::Free => Consistency::Free,
            Nearest::Projected(_) => Consistency::Projected,
            Nearest::NotConverged(_) => Consistency::NotConverged,
            Nearest::NotDetermined => Consistency::NotDetermined,
        };
        report.distance_sd = nearest.distance_sd().unwrap_or(0.0);
        if let Nearest::Projected(body) | Nearest::NotConverged(body) = &nearest {
            fill(&mut report.estimate, &body.parameters, self.parameters);
        }
    }
}

/// Fills in the first `n` of these numbers.
fn fill(target: &mut Vec<f32, MAX_PARAMETERS>, values: &[f32], n: usize) {
    target.clear();
    for value in values.iter().take(n) {
        // There is room for all of them.
        let _ = target.push(*value);
    }
}

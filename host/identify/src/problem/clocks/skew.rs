//! The delay of the stamps of each stream, with its uncertainty.
//!
//! Lives here: Gauss-Newton on the skews together with everything else the signals depend on. May not live
//! here: what the body is; its parameters are a by-product that the identification makes anew.
//!
//! Two equations hold between the streams once they are on one time base, row by row, filtered as the
//! estimator filters them (`a` and `ω, ω̇` at the stamp plus the skew of their stream):
//! ```text
//! wrench    w = A(a, ω, ω̇) φ + b + m δ×a | mc×(δ×a)
//! attitude  R_SA (−g) = a + ([ω̇]× + [ω]×[ω]×) d + b' + δ'×a
//! ```
//! The first is exact, and asked alone where it tells enough. The second says that the accelerometer feels
//! gravity where the attitude has it, but for the acceleration of a turn about a point fixed in S at d; any
//! other acceleration is a residual. It sets the clock of attitudes by a turn too slow to show in the wrench.
//! Small errors of mounting δ, δ' and biases b, b' are estimated along: during a steady turn a lag and a tilt
//! are the same thing, and only its beginning and end tell them apart.
//!
//! These are one body's; a tree of links is asked by its own rows (`source_skew`).
//!
//! Residuals are coloured (vibration, the kernel), so that the covariance is the sandwich with Bartlett's
//! weights over a fixed fraction of the recording, and the interval's factor the one that belongs to that
//! fraction: Kiefer and Vogelsang, Econometric Theory 21 (2005), Table 1. It is never less than what noise
//! gives that was white before the estimator's filter: in 120 simulated experiments of 20 s the sandwich
//! alone held the attitude's skew in 89 %.

use nalgebra::{DMatrix, DVector, Vector3};
use rigident_shared::calibration::Reading;
use rigident_shared::estimator::{Estimator, EstimatorConfig, Outcome};
use rigident_shared::regressor::RegressorBlock;
use rigident_shared::screening::Limits;
use rigident_shared::spatial::Wrench;

use super::grid::Resampled;
use super::least_squares::Fit;
use super::{Grid, Pose, StreamError, StreamSet, source_skew};
use crate::answer::result::{Measured, ParameterState};
use rigident_fit::{ESTIMATOR_TAPS, filter_width_s, row_every};
use rigident_io::recording::columns::Group;
use rigident_rows::body::Input;
use rigident_rows::body::prepare::prepare;

/// Half the step of the numerical derivatives, ns.
pub(super) const STEP_NS: i64 = 500_000;
/// Longest step of an iteration and greatest skew, s.
const LONGEST_STEP_S: f64 = 0.03;
const GREATEST_S: f64 = 0.5;
/// Steps below this end the iteration, s, or below this share of their standard deviation.
const CONVERGED_S: f64 = 1e-6;
const CONVERGED_SD: f64 = 0.02;
const MOST_ITERATIONS: usize = 20;
/// The attitude's equation is asked where the wrench alone leaves more than this of half the kernel's width.
/// More would do harm: rates that are mostly noise pull a skew towards zero.
const LOOSE: f64 = 0.03;
/// Wrench and attitude rows of an instant.
const ROWS: usize = 9;
/// Parameters beside the skews: φ, b, δ; d, b', δ'.
const BODY: usize = 19;
const TIE: usize = 9;

/// The finding.
#[derive(Clone, Debug)]
pub struct Skews {
    /// The delay of the stamps of each stream, ns; zero where it is not identified.
    pub late_ns: Vec<i64>,
    /// 95 % uncertainty, s; of a stream that is not identified what it would have been, or infinity.
    pub u95_s: Vec<f64>,
    /// The streams whose skew is identified.
    pub identified: Vec<usize>,
    /// Their covariance, s², for intervals of 1.96 σ.
    pub covariance: DMatrix<f64>,
}

impl Skews {
    /// Returns what became of each stream's skew; none for the stream that sets the clock.
    pub fn states(&self, reference: usize) -> Vec<Option<ParameterState>> {
        let state = |k: usize| {
            let measured = || Measured {
                value: self.late_ns.get(k).map_or(0.0, |late| *late as f64 * 1e-9),
                u95: self.u95_s.get(k).copied().unwrap_or(f64::INFINITY),
            };
            match self.identified.contains(&k) {
                _ if k == reference => None,
                true => Some(ParameterState::Identified(measured())),
                false => Some(ParameterState::NotIdentified),
            }
        };
        (0..self.late_ns.len()).map(state).collect()
    }
}

/// Estimates the skew of every stream against that of the wrench. One that is uncertain by more than half the
/// kernel's width is not identified. `pose` makes the rows of a tree; without it they are those of one body.
///
/// # Errors
/// [`StreamError`] if the streams have too little in common, or are no recording of what is identified.
pub fn estimate(set: &StreamSet, grid: &Grid, pose: Option<&Pose<'_>>) -> Result<Skews, StreamError> {
    let count = set.streams.len();
    let mut skews = Skews {
        late_ns: vec![0; count],
        u95_s: vec![f64::INFINITY; count],
        identified: (0..count).filter(|k| *k != set.reference).collect(),
        covariance: DMatrix::zeros(0, 0),
    };
    let limit_s = grid.half_ns as f64 * 1e-9;
    let mut tied = false;
    while !skews.identified.is_empty() {
        let start = skews.late_ns.clone();
        let found = iterate(set, grid, &mut skews, tied, pose)?;
        let u95 = |i: usize| 1.96 * found.covariance[(i, i)].max(0.0).sqrt();
        let judged: Vec<f64> =
            (0..skews.identified.len()).map(|i| if found.lost[i] { f64::INFINITY } else { u95(i) }).collect();
        let worst = (0..judged.len()).max_by(|a, b| judged[*a].total_cmp(&judged[*b])).unwrap_or(0);
        for (k, u95) in skews.identified.iter().zip(&judged) {
            skews.u95_s[*k] = *u95;
        }
        let loose = |k: &usize| !found.converged || skews.u95_s[*k] > LOOSE * limit_s;
        if pose.is_none() && !tied && skews.identified.iter().any(|k| attitude_of(set)(k) && loose(k)) {
            tied = true;
            // The wrench has set the others' clocks.
            let undetermined = |k: usize| !found.converged || set.streams[k].attitude.is_some();
            for (k, late) in skews.late_ns.iter_mut().enumerate().filter(|(k, _)| undetermined(*k)) {
                *late = start[k];
            }
            continue;
        }
        if found.converged && judged.get(worst).is_some_and(|u| *u <= limit_s) {
            skews.covariance = found.covariance;
            return Ok(skews);
        }
        // Attitudes are tied to the accelerometer's clock: without that one theirs means nothing, and what
        // does not converge is theirs.
        let stream = match skews.identified.iter().copied().find(attitude_of(set)) {
            Some(attitude) if tied && !found.converged => attitude,
            _ => skews.identified[worst],
        };
        let accelerometer = set.streams[stream].groups.iter().any(|(g, _)| matches!(g, Group::Accel(0)));
        let goes = |k: &usize| *k == stream || (tied && accelerometer && set.streams[*k].attitude.is_some());
        for k in skews.identified.iter().copied().filter(|k| goes(k)) {
            skews.late_ns[k] = 0;
            if !found.converged {
                // Of an iteration that went astray the width means nothing.
                skews.u95_s[k] = f64::INFINITY;
            }
        }
        skews.identified.retain(|k| !goes(k));
        tied &= skews.identified.iter().any(attitude_of(set));
    }
    Ok(skews)
}

/// Returns whether a stream carries the attitude.
fn attitude_of(set: &StreamSet) -> impl Fn(&usize) -> bool {
    |k| set.streams.get(*k).is_some_and(|stream| stream.attitude.is_some())
}

/// One run to convergence, or not.
struct Found {
    converged: bool,
    covariance: DMatrix<f64>,
    /// Skews that the rows do not determine.
    lost: Vec<bool>,
}

/// Rows of one instant.
#[derive(Clone, Copy)]
pub(super) struct Instant {
    block: RegressorBlock<f64>,
    /// Filtered −g in S by the attitude.
    pub(super) up: Option<Vector3<f64>>,
}

impl Instant {
    /// Specific force in S, filtered.
    pub(super) fn force(&self) -> Vector3<f64> {
        column(&self.block.columns[0], 0)
    }

    /// Returns what turning adds to it at d of S.
    pub(super) fn turning(&self, d: &Vector3<f64>) -> Vector3<f64> {
        (0..3).map(|k| column(&self.block.columns[1 + k], 0) * d[k]).sum()
    }

    /// Residuals of both equations but for the constants, which do not depend on the skews.
    fn residual(&self, state: &State) -> [f64; ROWS] {
        let mut e = [0.0; ROWS];
        e[..6].copy_from_slice(&self.block.wrench);
        for (column, phi) in self.block.columns.iter().zip(&state.phi) {
            for (e, a) in e.iter_mut().zip(column) {
                *e -= a * phi;
            }
        }
        if let Some(up) = self.up {
            e[6..].copy_from_slice((up - self.force() - self.turning(&state.d)).as_slice());
        }
        e
    }
}

fn column(wrench: &[f64; 6], from: usize) -> Vector3<f64> {
    Vector3::new(wrench[from], wrench[from + 1], wrench[from + 2])
}

/// The point of the linearisation.
#[derive(Clone, Copy, Default)]
struct State {
    phi: [f64; 10],
    d: Vector3<f64>,
}

/// The rows at given skews.
struct Pipeline<'a> {
    set: &'a StreamSet,
    grid: &'a Grid,
    config: EstimatorConfig<f64>,
    instants: Vec<i64>,
    tied: bool,
}

impl Pipeline<'_> {
    fn rows(&self, streams: &[&Resampled]) -> Result<Vec<Instant>, StreamError> {
        let recording = self.grid.recording(self.set, &self.instants, streams.iter().copied());
        let readings = prepare(&recording)?.input.readings;
        let blocks = self.blocks(readings.iter().copied());
        let ups = streams.iter().filter(|_| self.tied).find_map(|stream| stream.up()).map(|ups| {
            let tied = readings.iter().zip(ups).map(|(reading, [x, y, z])| Reading {
                wrench: Wrench::from_array([x, y, z, 0.0, 0.0, 0.0]),
                ..*reading
            });
            self.blocks(tied)
        });
        let up = |k: usize| ups.as_ref()?.get(k).map(|block| column(&block.wrench, 0));
        Ok(blocks.into_iter().enumerate().map(|(k, block)| Instant { block, up: up(k) }).collect())
    }

    /// Variance of noise after the filter, per row, that was white before it.
    fn noise_gain(&self) -> f64 {
        Estimator::<f64, 10, ESTIMATOR_TAPS>::new(&self.config).map_or(1.0, |e| e.noise_gain().min(1.0))
    }

    fn blocks(&self, readings: impl Iterator<Item = Reading<f64>>) -> Vec<RegressorBlock<f64>> {
        // The configuration has been accepted when it was made.
        let Ok(estimator) = Estimator::<f64, 10, ESTIMATOR_TAPS>::new(&self.config) else {
            return Vec::new();
        };
        let mut estimator = Box::new(estimator);
        readings
            .filter_map(|reading| {
                (estimator.absorb(&reading) == Outcome::Absorbed).then(|| estimator.last_block()).flatten()
            })
            .collect()
    }
}

/// Both equations' rows at the skews that were taken.
///
/// # Errors
/// As [`super::align`].
pub(super) fn rows(set: &StreamSet, grid: &Grid, late_ns: &[i64]) -> Result<Vec<Instant>, StreamError> {
    let instants = grid.instants(set, late_ns, 0)?;
    let streams = grid.all(set, &instants, late_ns);
    let input = prepare(&grid.recording(set, &instants, &streams))?.input;
    let pipeline = Pipeline { set, grid, config: configuration(&input), instants, tied: true };
    pipeline.rows(&streams.iter().collect::<Vec<_>>())
}

fn iterate(
    set: &StreamSet,
    grid: &Grid,
    skews: &mut Skews,
    tied: bool,
    pose: Option<&Pose<'_>>,
) -> Result<Found, StreamError> {
    let free = skews.identified.clone();
    let (mut state, mut phi) = (State::default(), None);
    for iteration in 0..MOST_ITERATIONS {
        let (fit, noise_gain) = match pose {
            Some(pose) => source_skew::step(set, grid, &free, &skews.late_ns, pose, &mut phi)?,
            None => step(set, grid, skews, tied, (iteration == 0, &mut state))?,
        };
        let steps: Vec<f64> = (0..free.len())
            .map(|i| if fit.lost[i] { 0.0 } else { fit.solution[i].clamp(-LONGEST_STEP_S, LONGEST_STEP_S) })
            .collect();
        for (k, step) in free.iter().zip(&steps) {
            skews.late_ns[*k] += (1e9 * step).round() as i64;
        }
        let small = |sd: f64| CONVERGED_S.max(CONVERGED_SD * sd);
        let converged =
            steps.iter().zip(&fit.independent).all(|(step, variance)| step.abs() < small(variance.sqrt()));
        let escaped = skews.late_ns.iter().any(|late| late.abs() as f64 * 1e-9 > GREATEST_S);
        if converged || escaped || iteration + 1 == MOST_ITERATIONS {
            return Ok(Found {
                converged,
                covariance: fit.covariance(free.len(), noise_gain),
                lost: fit.lost,
            });
        }
    }
    Ok(Found {
        converged: false,
        covariance: DMatrix::zeros(free.len(), free.len()),
        lost: vec![true; free.len()],
    })
}

/// Returns one step of a body's skews, and the noise gain of the filter; the state is what its rows are
/// linearised about.
fn step(
    set: &StreamSet,
    grid: &Grid,
    skews: &Skews,
    tied: bool,
    (is_first, about): (bool, &mut State),
) -> Result<(Fit, f64), StreamError> {
    let free = &skews.identified;
    let instants = grid.instants(set, &skews.late_ns, STEP_NS)?;
    let streams = grid.all(set, &instants, &skews.late_ns);
    let input = prepare(&grid.recording(set, &instants, &streams))?.input;
    let pipeline = Pipeline { set, grid, config: configuration(&input), instants, tied };
    let rows = pipeline.rows(&streams.iter().collect::<Vec<_>>())?;
    let moved = free
        .iter()
        .map(|k| {
            let at = |step: i64| {
                let (Some(stream), Some(late)) = (set.streams.get(*k), skews.late_ns.get(*k)) else {
                    return Ok(Vec::new());
                };
                let moved = grid.resample(set, stream, &pipeline.instants, late + step);
                let all = streams.iter().enumerate().map(|(i, s)| if i == *k { &moved } else { s });
                pipeline.rows(&all.collect::<Vec<_>>())
            };
            Ok((at(-STEP_NS)?, at(STEP_NS)?))
        })
        .collect::<Result<Vec<_>, StreamError>>()?;
    if is_first {
        *about = state(&Fit::new(&design(&rows, &[], &[], about), 0).solution, 0);
    }
    // A turn too slow to show in the wrench leaves there a slope of noise, which would pass for information.
    let mute: Vec<bool> = free.iter().map(|k| tied && attitude_of(set)(k)).collect();
    let fit = Fit::new(&design(&rows, &moved, &mute, about), free.len());
    *about = state(&fit.solution, free.len());
    Ok((fit, pipeline.noise_gain()))
}

/// The identification's filter, the rows not yet weighted.
fn configuration(input: &Input) -> EstimatorConfig<f64> {
    EstimatorConfig {
        rate_hz: input.rate_hz,
        filter_width_s: filter_width_s(input.rate_hz),
        row_every: row_every(input.rate_hz),
        channel_sigma: [1.0; 6],
        known_offset: [0.0; 6],
        mounting: input.mounting,
        limits: Limits::none(),
    }
}

/// Returns the rows of a body, linearised; a `mute` stream's skew is asked of the attitude's equation alone.
fn design(
    rows: &[Instant],
    moved: &[(Vec<Instant>, Vec<Instant>)],
    mute: &[bool],
    state: &State,
) -> Vec<(DMatrix<f64>, DVector<f64>)> {
    let skews = moved.len();
    let tied = rows.first().is_some_and(|r| r.up.is_some());
    let (parameters, channels) = if tied { (skews + BODY + TIE, ROWS) } else { (skews + BODY, 6) };
    rows.iter()
        .enumerate()
        .map(|(t, row)| {
            let mut a = DMatrix::zeros(channels, parameters);
            for (i, (before, after)) in moved.iter().enumerate() {
                let (Some(before), Some(after)) = (before.get(t), after.get(t)) else { continue };
                let (before, after) = (before.residual(state), after.residual(state));
                let first = if mute.get(i) == Some(&true) { 6 } else { 0 };
                for c in first..channels {
                    a[(c, i)] = (before[c] - after[c]) / (2e-9 * STEP_NS as f64);
                }
            }
            // The attitude's equation knows the difference of two clocks, and of each derivative only the
            // quiet one.
            if let Some(attitude) = mute.iter().position(|m| *m) {
                for (i, c) in
                    (0..skews).filter(|i| *i != attitude).flat_map(|i| (6..channels).map(move |c| (i, c)))
                {
                    if a[(c, i)] != 0.0 {
                        a[(c, i)] = -a[(c, attitude)];
                    }
                }
            }
            (fill(a, row, state, skews, tied), target(row, channels))
        })
        .collect()
}

/// Returns what to linearise about next.
fn state(solution: &DVector<f64>, skews: usize) -> State {
    let at = |k: usize| solution.get(skews + k).copied().unwrap_or(0.0);
    State { phi: std::array::from_fn(at), d: Vector3::new(at(BODY), at(BODY + 1), at(BODY + 2)) }
}

fn target(row: &Instant, channels: usize) -> DVector<f64> {
    let tie = row.up.map_or(Vector3::zeros(), |up| up - row.force());
    DVector::from_iterator(
        channels,
        row.block.wrench.iter().copied().chain(tie.iter().copied()).take(channels),
    )
}

/// Columns of everything but the skews.
fn fill(mut a: DMatrix<f64>, row: &Instant, state: &State, skews: usize, tied: bool) -> DMatrix<f64> {
    let force = row.force();
    let first_moment = Vector3::new(state.phi[1], state.phi[2], state.phi[3]);
    for (j, column) in row.block.columns.iter().enumerate() {
        for (c, value) in column.iter().enumerate() {
            a[(c, skews + j)] = *value;
        }
    }
    for c in 0..6 {
        a[(c, skews + 10 + c)] = 1.0;
    }
    for k in 0..3 {
        let turned = Vector3::ith(k, 1.0).cross(&force);
        let moment = first_moment.cross(&turned);
        for c in 0..3 {
            a[(c, skews + 16 + k)] = state.phi[0] * turned[c];
            a[(3 + c, skews + 16 + k)] = moment[c];
            if tied {
                a[(6 + c, skews + BODY + k)] = row.block.columns[1 + k][c];
                a[(6 + c, skews + BODY + 6 + k)] = turned[c];
            }
        }
        if tied {
            a[(6 + k, skews + BODY + 3 + k)] = 1.0;
        }
    }
    a
}

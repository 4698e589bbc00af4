//! Several files, each with a clock and a rate of its own, as one recording.
//!
//! Lives here: reading the files that a rig file lists ([`files`]), streams while they grow ([`growing`]),
//! the one local polynomial that every stream goes through ([`kernel`]), the common time base ([`grid`]),
//! clocks without a common origin (`origin`), how late the stamps of each stream are ([`skew`]), by how much
//! that uncertainty moves the estimate ([`shifts`]) and whether attitudes and accelerometer agree on gravity.
//! May not live here: the fit, which sees an ordinary recording.
//!
//! Every stream is brought to a uniform grid by the local cubic of one width in seconds, that of the slowest
//! stream, so that all see the same low-pass: the equation of motion is linear in the signals and stays
//! exact, where streams that were interpolated each at its own rate would be filtered each in its own way.
//! Rates of turn come from attitudes as the slope of the same cubic through the logarithm of the rotation.

pub mod files;
mod gravity;
pub mod grid;
pub mod growing;
pub mod kernel;
mod least_squares;
mod origin;
pub mod shifts;
pub mod skew;
mod source_skew;
mod stamped;

use crate::answer::result::{ParameterState, StreamResult, TimeBase};
use rigident_fit::RowSource;
use rigident_fit::figures::{counted, significant};
use rigident_io::recording::{Recording, RecordingError};
use rigident_io::rig::RigFileError;
use rigident_rows::body::prepare::PrepareError;
use rigident_rows::tree::TreePrepareError;

pub use files::{Stream, StreamSet};
pub use grid::Grid;
pub use growing::Growing;
pub use stamped::Stamped;

/// Why several files are no recording.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StreamError {
    /// The rig file.
    #[error(transparent)]
    Rig(#[from] RigFileError),
    /// One of the files.
    #[error(transparent)]
    File(#[from] RecordingError),
    /// The rig file lists none.
    #[error("{0} lists no [[stream]]: give the recording itself, and the rig file by `rig`")]
    None(String),
    /// A listed file is not there.
    #[error("stream {file} of {rig} cannot be read: {reason}; files are looked for in {folder}")]
    Missing {
        /// The rig file.
        rig: String,
        /// The file as listed.
        file: String,
        /// The folder where it was searched for.
        folder: String,
        /// The message of the system.
        reason: String,
    },
    /// Two files have the same quantity.
    #[error(
        "{what} is in {first} and in {second}: each quantity comes from one stream; take it out of one of \
         them"
    )]
    Twice {
        /// The columns.
        what: String,
        /// A stream.
        first: String,
        /// Another one.
        second: String,
    },
    /// Nothing to measure the others' clocks by.
    #[error(
        "no stream holds the wrench fx_n … mz_nm or the gauges g1_v … g6_v, by whose clock the others are set"
    )]
    NoWrench,
    /// Still poses have no time.
    #[error("[recording] static = true and [[stream]] exclude each other: still poses have no clocks")]
    Static,
    /// Too short for the kernel.
    #[error("{file} has {}: a local cubic needs at least {needed}", counted(*.samples, "sample", "samples"))]
    TooFew {
        /// The stream.
        file: String,
        /// Its samples.
        samples: usize,
        /// Samples needed.
        needed: usize,
    },
    /// The streams have no time in common.
    #[error(
        "the clocks of {first} ({first_s}) and {second} ({second_s}) do not overlap: check the scale of t_s \
         of both, and that they count from the same origin"
    )]
    NoOverlap {
        /// The stream with the wrench.
        first: String,
        /// Its times, in words.
        first_s: String,
        /// The other one.
        second: String,
        /// Its times.
        second_s: String,
    },
    /// The streams have no time in common, and nothing that both see tells the offset of their clocks.
    #[error(
        "the clocks of {first} and {second} do not overlap, and what both see of the motion does not align \
         them: {why}; check the scale of t_s of both, and that they are of one run, or write clock_offset_s \
         in [[stream]]"
    )]
    NoClock {
        /// The stream with the wrench.
        first: String,
        /// The other one.
        second: String,
        /// Why not.
        why: String,
    },
    /// An overlap without a usable instant.
    #[error(
        "the streams have only {overlap_s:.3} s in common without gaps, less than the {needed_s:.3} s that \
         one row takes"
    )]
    TooShort {
        /// Time in common, s.
        overlap_s: f64,
        /// Time needed, s.
        needed_s: f64,
    },
    /// A column of the rotation matrix is missing.
    #[error(
        "{file}: rotation_matrix names column {column:?}, and there is none; the other columns are {there}"
    )]
    NoColumn {
        /// The stream.
        file: String,
        /// The column.
        column: String,
        /// Columns there are.
        there: String,
    },
    /// A cell of the rotation matrix is no number.
    #[error("{file}, row {row}, column {column}: {cell:?} is not a finite number")]
    NotANumber {
        /// The stream.
        file: String,
        /// Row after the header, from 1.
        row: usize,
        /// The column.
        column: String,
        /// The text there.
        cell: String,
    },
    /// An attitude that is none.
    #[error("{file}, row {row}: the attitude is no rotation: {what}")]
    NotARotation {
        /// The stream.
        file: String,
        /// Row after the header, from 1.
        row: usize,
        /// By how much.
        what: String,
    },
    /// The recording on the common time base cannot be identified.
    #[error(transparent)]
    Prepare(#[from] PrepareError),
    /// The recording on the common time base does not fit the tree.
    #[error(transparent)]
    Tree(#[from] TreePrepareError),
    /// There are no rows, for the reason given.
    #[error("{0}")]
    Rows(String),
}

/// Makes the source of rows of a recording.
pub type Pose<'a> = dyn Fn(&Recording) -> Result<Box<dyn RowSource>, StreamError> + 'a;

/// Streams on one time base.
#[derive(Clone, Debug)]
pub struct Aligned {
    /// The recording on the grid.
    pub recording: Recording,
    /// The way it was made.
    pub time_base: TimeBase,
    /// The skews, for [`shifts`].
    pub skews: skew::Skews,
    /// The notes.
    pub warnings: Vec<String>,
}

/// Returns the streams on one time base as their clocks have it, no skew taken off.
///
/// # Errors
/// [`StreamError`] if they have nothing in common.
pub fn as_stamped(set: &StreamSet) -> Result<Recording, StreamError> {
    let (grid, late_ns) = (Grid::of(set)?, vec![0; set.streams.len()]);
    let instants = grid.instants(set, &late_ns, 0)?;
    Ok(grid.recording(set, &instants, &grid.all(set, &instants, &late_ns)))
}

/// Brings the streams onto one time base, the skews estimated and taken off: by the rows that `pose` makes,
/// or those of one body.
///
/// # Errors
/// [`StreamError`] if they have nothing in common, or cannot be identified.
pub fn align(set: &StreamSet, pose: Option<&Pose<'_>>) -> Result<Aligned, StreamError> {
    let grid = Grid::of(set)?;
    let skews = skew::estimate(set, &grid, pose)?;
    let instants = grid.instants(set, &skews.late_ns, 0)?;
    let recording = grid.recording(set, &instants, &grid.all(set, &instants, &skews.late_ns));
    let mut warnings = set.warnings.clone();
    let states = skews.states(set.reference);
    for (stream, (state, u95)) in set.streams.iter().zip(states.iter().zip(&skews.u95_s)) {
        if *state == Some(ParameterState::NotIdentified) {
            let by = if u95.is_finite() {
                format!(" (95 %: ± {} ms)", significant(1e3 * u95, 2))
            } else {
                String::new()
            };
            warnings.push(format!(
                "how late the stamps of {} are is not identified from this motion{by}: taken as zero; a \
                 livelier turn with rests before and after it would tell",
                stream.file
            ));
        }
    }
    let attitude = set.streams.iter().find(|s| s.attitude.is_some());
    if let Some(attitude) = attitude.filter(|_| pose.is_none()) {
        let found = gravity::Disagreement::of(&skew::rows(set, &grid, &skews.late_ns)?);
        warnings.extend(found.and_then(|found| found.warning(&attitude.file)));
    }
    let streams = set
        .streams
        .iter()
        .zip(states)
        .map(|(stream, skew_s)| StreamResult {
            file: stream.file.clone(),
            carries: stream.carries(),
            rate_hz: stream.rate_hz,
            rows: stream.time_ns.len() + stream.discarded,
            discarded: stream.discarded,
            skew_s,
        })
        .collect();
    let time_base = TimeBase { rate_hz: grid.rate_hz, kernel_width_s: 2e-9 * grid.half_ns as f64, streams };
    Ok(Aligned { recording, time_base, skews, warnings })
}

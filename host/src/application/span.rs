//! The time for which rows are retained.

use rigident_shared::forgetting::Span;

use super::Error;
use rigident_fit::{RowSource, Timing, filter_width_s, row_every};
use rigident_rows::body::Input;

/// Row blocks of which a window holds one at least in each of its parts.
const LEAST_BLOCKS: f64 = 5.0;

/// The subject whose rows are retained.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowsOf {
    /// Samples per second.
    pub rate_hz: f64,
    /// True of still poses, which have no time.
    pub is_static: bool,
}

impl RowsOf {
    /// Returns what is retained of one body's readings.
    pub fn input(input: &Input) -> Self {
        Self { rate_hz: input.rate_hz, is_static: input.is_static }
    }

    /// Returns what is retained of a source.
    pub fn source(source: &dyn RowSource) -> Self {
        let (rate_hz, is_static) = match source.timing() {
            Timing::Static => (1.0, true),
            Timing::Uniform { rate_hz } => (rate_hz, false),
        };
        Self { rate_hz, is_static }
    }

    /// Returns what is retained of a rig that moves.
    pub fn moving(rate_hz: f64) -> Self {
        Self { rate_hz, is_static: false }
    }
}

/// Returns the span to keep; `None`: everything is retained, which an infinite one asks for too.
///
/// # Errors
/// [`Error::Span`] if rows cannot be forgotten by it.
pub fn checked(span: Option<Span<f64>>, rows: &RowsOf) -> Result<Option<Span<f64>>, Error> {
    let Some(span) = span else { return Ok(None) };
    let refuse = |why: &str| Err(Error::Span { span, why: why.to_owned() });
    let (Span::TimeConstant(seconds) | Span::Window(seconds)) = span;
    if seconds.is_nan() || seconds <= 0.0 {
        return refuse("a positive number of seconds is wanted");
    }
    if rows.is_static {
        return refuse("still poses have no time that could be forgotten by; leave it out");
    }
    let block_s = f64::from(row_every(rows.rate_hz)) / rows.rate_hz;
    let width_s = filter_width_s(rows.rate_hz);
    let least_s = match span {
        Span::TimeConstant(_) => width_s,
        Span::Window(_) => width_s.max(LEAST_BLOCKS * block_s),
    };
    if seconds < least_s {
        return refuse(&format!("shorter than the filter and its rows; at least {least_s} s are wanted"));
    }
    // Beyond the f32 of the wire nothing is forgotten either.
    Ok((seconds < f64::from(f32::MAX)).then_some(span))
}

//! Answers as the package gets them.

use pyo3::prelude::*;
use rigident::answer::{Answer, Status};
use rigident::application::{Covariance, Identified};
use rigident::fit::{BlockResidual, Fit};

use crate::errors::Refused;

/// The factor of an answer: its bytes, and its name.
pub type Kept = (Vec<u8>, String);

/// An answer with all that a program may want beside it.
#[derive(IntoPyObject)]
pub struct Answered {
    /// The object, JSON.
    pub json: String,
    /// The exit status of the command line.
    pub exit_status: i32,
    /// Lines that were said beside it.
    pub messages: Vec<String>,
    /// The report, HTML.
    pub page: String,
    /// The factor to keep.
    pub factor: Option<Kept>,
    /// Covariance of the parameters with numbers.
    pub covariance: Option<CovarianceOf>,
    /// Residuals, where they are asked for.
    pub residuals: Option<Residuals>,
}

/// A covariance: names, and rows.
#[derive(IntoPyObject)]
pub struct CovarianceOf {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl From<Covariance> for CovarianceOf {
    fn from(Covariance { names, matrix }: Covariance) -> Self {
        let rows = matrix.row_iter().map(|row| row.iter().copied().collect()).collect();
        Self { names, rows }
    }
}

/// Filtered residuals: times and values as little-endian doubles, block after block.
#[derive(IntoPyObject)]
pub struct Residuals {
    channels: Vec<String>,
    units: Vec<String>,
    time_s: Vec<u8>,
    values: Vec<u8>,
}

impl Residuals {
    /// Takes those of a fit; what a block says nothing of is no number.
    pub fn of(fit: &Fit) -> Self {
        let count = fit.channels.len();
        let bytes = |values: &mut dyn Iterator<Item = f64>| values.flat_map(f64::to_le_bytes).collect();
        let value = |block: &BlockResidual, k| {
            block.values.get(k).copied().filter(|_| block.measures(k)).unwrap_or(f64::NAN)
        };
        Self {
            channels: fit.channels.iter().map(|own| own.channel.name.clone()).collect(),
            units: fit.channels.iter().map(|own| own.channel.unit.clone()).collect(),
            time_s: bytes(&mut fit.residuals.iter().map(|block| block.time_s)),
            values: bytes(&mut fit.residuals.iter().flat_map(|b| (0..count).map(move |k| value(b, k)))),
        }
    }
}

/// Returns the text that an object was put into.
pub fn text(put: serde_json::Result<String>) -> Result<String, Refused> {
    put.map_err(|error| Refused::usage(format!("the result cannot be put into JSON: {error}")))
}

/// Puts an answer together; `is_written` says whether all was written that was to be.
pub fn answered(found: &Identified, is_written: bool, messages: Vec<String>) -> Result<Answered, Refused> {
    let kept = found.factor.as_ref().map(|factor| (factor.to_bytes(), found.answer.source.recording.clone()));
    Ok(Answered {
        json: text(serde_json::to_string_pretty(&found.answer))?,
        exit_status: i32::from(!(is_written && found.is_whole())),
        messages,
        page: found.page(),
        factor: kept,
        covariance: Some(found.covariance().into()),
        residuals: None,
    })
}

/// Puts an answer together whose page shows more than it, and whose factors are elsewhere.
pub fn beside(answer: &Answer, page: &str, covariance: Option<Covariance>) -> Result<Answered, Refused> {
    Ok(Answered {
        json: text(serde_json::to_string_pretty(answer))?,
        exit_status: i32::from(answer.status != Status::Identified),
        messages: Vec::new(),
        page: page.to_owned(),
        factor: None,
        covariance: covariance.map(Into::into),
        residuals: None,
    })
}

//! The rows that masses are found from: factors of recordings, or of the parts of one.

use std::path::PathBuf;

use super::super::calibrate_error::CalibrateError;
use super::super::{Caller, Error, Loaded};
use super::mass_options::{ExternalWrench, MassOptions};
use rigident_fit::figures::significant;
use rigident_fit::{Factor, Progress, RowSource, Silent, plain_factor};
use rigident_identify::mass_properties::efforts::suspects;
use rigident_identify::mass_properties::external::{External, with_unknown_wrench};
use rigident_identify::mass_properties::weights::channel_sigma;
use rigident_identify::problem::ProblemError;
use rigident_rows::tree::{ProblemOptions, TreeSource};

/// The data read.
#[derive(Default)]
pub(super) struct Read {
    pub(super) loaded: Vec<Loaded>,
    pub(super) factors: Vec<Factor>,
    pub(super) notes: Vec<String>,
    pub(super) warnings: Vec<String>,
    /// A torque contradicts the model.
    pub(super) has_suspects: bool,
    /// A constant wrench on the base that nothing measures.
    pub(super) external: Option<External>,
}

/// Reads the recordings, fits each and makes the factors of their parts.
pub(super) fn read(
    recordings: &[PathBuf],
    options: &MassOptions,
    caller: &Caller<'_>,
) -> Result<Read, Error> {
    let problem = ProblemOptions { friction: options.friction.clone(), ..ProblemOptions::default() };
    let mut read = Read::default();
    for path in recordings {
        caller.stage(&format!("reading {}", path.display()), 0.0);
        let loaded = Loaded::read(path, options.rig.as_deref(), None, &options.tree, &problem, caller)?;
        read.loaded.push(loaded);
    }
    let (mut sigma, mut with): (Option<Vec<f64>>, Vec<Factor>) = (None, Vec::new());
    let several = recordings.len() > 1;
    for (loaded, path) in read.loaded.iter().zip(recordings) {
        let name = path.display().to_string();
        let Some((source, (model, _))) = loaded.problem.tree().zip(loaded.nominal()) else {
            return Err(CalibrateError::NoTree(Some(name)).into());
        };
        let of = |text: &String| if several { format!("{name}: {text}") } else { text.clone() };
        read.notes.extend(loaded.notes.iter().map(of));
        read.warnings.extend(loaded.warnings.iter().map(of));
        for suspect in suspects(source, model)? {
            read.has_suspects = true;
            read.warnings.push(of(&suspect.text()));
        }
        let sigma = match &sigma {
            Some(sigma) => sigma,
            None => &*sigma.insert(channel_sigma(source, caller)?),
        };
        if sigma.len() != source.channels().len() {
            let first = recordings.first().map_or_else(String::new, |first| first.display().to_string());
            return Err(CalibrateError::OtherChannels { name, first }.into());
        }
        let parts = if several { 1 } else { options.parts };
        read.factors.extend(parts_of(source, sigma, parts)?);
        match with_unknown_wrench(source).map_err(ProblemError::from)? {
            Some(own) if options.external_wrench != ExternalWrench::None => {
                with.extend(parts_of(&own, sigma, parts)?);
            }
            _ => {}
        }
    }
    take_wrench(options, &mut read, with);
    Ok(read)
}

/// Takes the rows with a constant wrench on the base where there is one, and says so.
fn take_wrench(options: &MassOptions, read: &mut Read, with: Vec<Factor>) {
    let source = read.loaded.first().and_then(|first| first.problem.tree());
    let Some(source) = source.filter(|_| !with.is_empty()) else { return };
    let count = source.base().parameters.len();
    read.external = External::found(&Factor::merged(&read.factors), &Factor::merged(&with), count);
    if read.external.is_none() && options.external_wrench != ExternalWrench::Unknown {
        return;
    }
    read.factors = with;
    let base = source.input().model.links.first().map_or("the base", |link| link.name.as_str()).to_owned();
    let Some(found) = read.external else {
        read.notes.push(format!("a constant wrench on {base} is eliminated; none is seen"));
        return;
    };
    let [x, y, z] = found.force_n.map(|force| significant(force, 3));
    read.warnings.push(format!(
        "something beside the ground pulls at {base}: a constant force of {x}, {y}, {z} N in its axes (a \
         hose, a cable, a rope, a hand, or \
         zeros of the feet's sensors). It is eliminated, and with it most of what the weight says of \
         masses; take it away and record \
         anew, or say `external_wrench` none if there is nothing"
    ));
}

/// Returns the factors of a source's parts of equal length.
fn parts_of(source: &TreeSource, sigma: &[f64], parts: usize) -> Result<Vec<Factor>, Error> {
    let frames = &source.input().frames;
    let length = frames.len().div_ceil(parts.max(1)).max(1);
    let mut factors = Vec::new();
    for part in frames.chunks(length) {
        let own = source.of_same_model(source.input().with_frames(part.to_vec()));
        let factor = plain_factor(&own.map_err(ProblemError::from)?, sigma, &Silent)?;
        if factor.rows() > 0 {
            factors.push(factor);
        }
    }
    Ok(factors)
}

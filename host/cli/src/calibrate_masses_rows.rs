//! The rows of `rigident calibrate masses`: factors of recordings, or of the parts of one.

use super::calibration_arguments::{CalibrateMasses, ExternalWrench};
use super::{Failure, Stages};
use rigident::application::{Loaded, Tree};
use rigident::fit::figures::significant;
use rigident::mass_properties::efforts::suspects;
use rigident::mass_properties::external::{External, with_unknown_wrench};
use rigident::mass_properties::weights::channel_sigma;
use rigident::rows::tree::ProblemOptions;
use rigident::rows::tree::TreeSource;
use rigident::rows::tree::drive::Friction;
use rigident_fit::{Factor, plain_factor};

/// The data read.
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
pub(super) fn read(arguments: &CalibrateMasses, stages: &Stages) -> Result<Read, Failure> {
    let tree = Tree { model: Some(arguments.model.clone()), changes: arguments.changes.typed()? };
    let friction = Friction::parse(&arguments.friction).map_err(Failure::input)?;
    let options = ProblemOptions { friction, ..ProblemOptions::default() };
    let mut read = Read {
        loaded: Vec::new(),
        factors: Vec::new(),
        notes: Vec::new(),
        warnings: Vec::new(),
        has_suspects: false,
        external: None,
    };
    for path in &arguments.recordings {
        stages.at(&format!("reading {}", path.display()), 0.0);
        read.loaded.push(Loaded::read(
            path,
            arguments.rig.as_deref(),
            None,
            &tree,
            &options,
            &stages.caller(),
        )?);
    }
    let (mut sigma, mut with): (Option<Vec<f64>>, Vec<Factor>) = (None, Vec::new());
    for (loaded, path) in read.loaded.iter().zip(&arguments.recordings) {
        let Some((source, (model, _))) = loaded.problem.tree().zip(loaded.nominal()) else {
            return Err(Failure::input(format!("{}: no recording of a tree of links", path.display())));
        };
        let several = arguments.recordings.len() > 1;
        let of = |text: &String| if several { format!("{}: {text}", path.display()) } else { text.clone() };
        read.notes.extend(loaded.notes.iter().map(of));
        read.warnings.extend(loaded.warnings.iter().map(of));
        for suspect in suspects(source, model).map_err(Failure::input)? {
            read.has_suspects = true;
            read.warnings.push(of(&suspect.text()));
        }
        if sigma.is_none() {
            let progress = |stage: &str, share: f64| stages.at(stage, share);
            sigma = Some(channel_sigma(source, &progress).map_err(Failure::input)?);
        }
        let parts = if several { 1 } else { usize::from(arguments.parts) };
        let sigma = sigma.as_deref().unwrap_or_default();
        if sigma.len() != rigident_fit::RowSource::channels(source).len() {
            return Err(Failure::input(format!(
                "{}: has other channels than {}: give recordings of the same sensors",
                path.display(),
                arguments.recordings.first().map_or_else(String::new, |first| first.display().to_string())
            )));
        }
        read.factors.extend(parts_of(source, sigma, parts)?);
        match with_unknown_wrench(source).map_err(Failure::input)? {
            Some(own) if arguments.external_wrench != ExternalWrench::None => {
                with.extend(parts_of(&own, sigma, parts)?);
            }
            _ => {}
        }
    }
    take_wrench(arguments, &mut read, with);
    Ok(read)
}

/// Takes the rows with a constant wrench on the base where there is one, and says so.
fn take_wrench(arguments: &CalibrateMasses, read: &mut Read, with: Vec<Factor>) {
    let source = read.loaded.first().and_then(|first| first.problem.tree());
    let Some(source) = source.filter(|_| !with.is_empty()) else { return };
    let count = source.base().parameters.len();
    read.external = External::found(&Factor::merged(&read.factors), &Factor::merged(&with), count);
    if read.external.is_none() && arguments.external_wrench != ExternalWrench::Unknown {
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
        "something beside the ground pulls at {base}: a constant force of {x}, {y}, {z} N in its axes (a hose, a cable, a rope, a hand, or \
         zeros of the feet's sensors). It is eliminated, and with it most of what the weight tells of masses; take it away and record \
         anew, or say --external-wrench none if there is nothing"
    ));
}

/// Returns the factors of a source's parts of equal length.
fn parts_of(source: &TreeSource, sigma: &[f64], parts: usize) -> Result<Vec<Factor>, Failure> {
    let frames = &source.input().frames;
    let length = frames.len().div_ceil(parts.max(1)).max(1);
    let mut factors = Vec::new();
    for part in frames.chunks(length) {
        let own = source.of_same_model(source.input().with_frames(part.to_vec())).map_err(Failure::input)?;
        let factor = plain_factor(&own, sigma, &rigident_fit::Silent).map_err(Failure::input)?;
        if factor.rows() > 0 {
            factors.push(factor);
        }
    }
    Ok(factors)
}

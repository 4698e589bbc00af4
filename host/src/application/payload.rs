//! The load of a link, and the files that say it to a controller.

use std::path::PathBuf;

use nalgebra::{DMatrix, Rotation3, UnitQuaternion};

use super::{Caller, Error, Loaded, Notice};
use rigident_files::new_file;
use rigident_fit::Fit;
use rigident_fit::payload::{Carrier, disagreement_in_words};
use rigident_fit::tare::Tare;
use rigident_identify::answer::payload::{ControllerLoad, PayloadResult};
use rigident_identify::answer::{Answer, Context, Status};
use rigident_io::recording::new_file::write_new_text;
use rigident_model::inertial::map_to_parent;
use rigident_model::load::{Language, LoadError};

/// The name that errors use for the place of a payload.
const PAYLOAD: &str = "`payload`";

/// The fit of a payload.
pub(super) struct Found {
    pub(super) fit: Fit,
    pub(super) result: PayloadResult,
    pub(super) warnings: Vec<String>,
}

/// Returns the link that carries the payload as rows and answer name it; `words` are `LINK` or
/// `LINK@x,y,z,roll,pitch,yaw`.
///
/// # Errors
/// [`Error::PayloadOfBody`] of no tree, [`Error::PayloadPlace`] if there is no such link.
pub(super) fn carrier(loaded: &Loaded, words: &str) -> Result<(Carrier, PayloadResult), Error> {
    let Some((model, _)) = loaded.nominal() else { return Err(Error::PayloadOfBody) };
    let place = model.place(PAYLOAD, words).map_err(Error::PayloadPlace)?;
    let moving = model.moving_place(&place);
    let name = |link: usize| model.links.get(link).map(|l| l.name.clone()).unwrap_or_default();
    let link = name(place.link);
    let frame = if words.contains('@') { format!("{link}'s payload") } else { link.clone() };
    let map = map_to_parent(&moving.rotation, &moving.position);
    let to_link = DMatrix::from_fn(10, 10, |i, j| map[(i, j)]);
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(place.rotation));
    let result = PayloadResult {
        link,
        position_m: place.position.into(),
        rotation_wxyz: [turn.w, turn.i, turn.j, turn.k],
        ..PayloadResult::default()
    };
    Ok((Carrier { link: name(moving.link), to_link, frame }, result))
}

/// Returns the fit of the payload of a run of an arm; `None` if the run cannot be true: the answer about the
/// arm says why.
///
/// # Errors
/// Runs of different trees, or rows that see nothing of the link.
pub(super) fn fit(words: &str, loaded: &Loaded, arm: &Fit, tare: &Tare) -> Result<Option<Found>, Error> {
    let (carrier, result) = carrier(loaded, words)?;
    let context = Context { links: loaded.problem.links(None), ..Context::default() };
    let judged = Answer::new(arm, context)?;
    if judged.status == Status::Implausible {
        return Ok(None);
    }
    let fit = tare.payload(arm, &carrier)?;
    let warnings = fit.noise.disagreement.map(|ratio| disagreement_in_words(&result.link, ratio));
    let result = PayloadResult { without: tare.recordings(), ..result };
    Ok(Some(Found { fit, result, warnings: warnings.into_iter().collect() }))
}

/// Refuses files of loads that cannot be written, before anything is read.
///
/// # Errors
/// [`Error::LoadFile`] with the file's name.
pub fn check_files(files: &[PathBuf]) -> Result<(), Error> {
    for path in files {
        let refuse = |why: String| Error::LoadFile { path: path.clone(), why };
        if Language::of_path(path).is_none() {
            return Err(refuse(LoadError::Ending.to_string()));
        }
        if new_file::check_new(path).is_err() {
            return Err(refuse("the file is there already, and nothing is overwritten".to_owned()));
        }
        if path.parent().is_some_and(|folder| !folder.as_os_str().is_empty() && !folder.is_dir()) {
            return Err(refuse("its folder is not there: make it first".to_owned()));
        }
    }
    Ok(())
}

/// The file of a load.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Load {
    /// The file.
    pub path: PathBuf,
    /// Why it was not written, if it was not.
    pub refused: Option<String>,
}

/// Writes the load of an answer into files of controllers; of an answer that is not about a payload none.
///
/// # Errors
/// [`Error::Recording`] if a file cannot be written.
pub fn write_loads(answer: &Answer, files: &[PathBuf], caller: &Caller<'_>) -> Result<Vec<Load>, Error> {
    let Some(found) = &answer.payload else { return Ok(Vec::new()) };
    let mut loads = Vec::new();
    for path in files {
        let Some(language) = Language::of_path(path) else { continue };
        let text = match (&found.load, &found.refused) {
            (Some(load), _) => language
                .write(&load.load(), &found.link, &remarks(answer, found, load, caller))
                .map_err(|e| e.to_string()),
            (None, why) => Err(why.clone().unwrap_or_default()),
        };
        let refused = match text {
            Ok(text) => {
                write_new_text(path, &text)?;
                None
            }
            Err(why) => Some(why),
        };
        loads.push(Load { path: path.clone(), refused });
    }
    Ok(loads)
}

/// Returns the comment in a file: frame, origin of the numbers, uncertainty.
fn remarks(
    answer: &Answer,
    found: &PayloadResult,
    load: &ControllerLoad,
    caller: &Caller<'_>,
) -> Vec<String> {
    let place = found.position_m.map(|v| v.to_string()).join(", ");
    let turned = match found.rotation_wxyz {
        [1.0, 0.0, 0.0, 0.0] => String::new(),
        _ => format!(", {}", caller.words(&Notice::LoadTurned)),
    };
    let frame = match found.position_m {
        [0.0, 0.0, 0.0] => format!("frame: {}{turned}", found.link),
        _ => format!("frame: {} at [{place}] m{turned}", found.link),
    };
    let mass = answer.parameters.first().and_then(|p| p.state.measured());
    let certain = mass.map(|m| format!("mass {:.4} kg +- {:.4} kg (95 %)", m.value, m.u95));
    let (with, without) = (answer.source.recording.clone(), found.without.clone());
    let origin = caller.words(&Notice::LoadOrigin { with, without });
    [Some(origin), Some(frame), certain, Some(load.basis.in_words().to_owned())]
        .into_iter()
        .flatten()
        .collect()
}

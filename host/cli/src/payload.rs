//! `rigident identify --payload`: what a link carries, and the files that tell its controller.

use nalgebra::{DMatrix, Rotation3, UnitQuaternion};

use super::Failure;
use super::loaded::Loaded;
use super::options::payload::PayloadOptions;
use rigident::answer::payload::{ControllerLoad, PayloadResult};
use rigident::answer::{Answer, Context, Status};
use rigident_fit::Fit;
use rigident_fit::payload::{Carrier, disagreement_in_words};
use rigident_fit::tare::Tare;
use rigident_io::recording::new_file::write_new_text;
use rigident_model::inertial::map_to_parent;
use rigident_model::load::Language;

/// A payload as the answer tells it.
pub(super) struct Payload<'a> {
    pub(super) options: &'a PayloadOptions,
    pub(super) result: PayloadResult,
}

/// The fit of a payload.
pub(super) struct Found<'a> {
    pub(super) fit: Fit,
    pub(super) payload: Payload<'a>,
    pub(super) warnings: Vec<String>,
}

/// Returns the link that carries the payload as rows and answer name it.
///
/// # Errors
/// Bad input: no tree, or no such link.
pub(super) fn carrier(loaded: &Loaded, words: &str) -> Result<(Carrier, PayloadResult), Failure> {
    let Some((model, _)) = loaded.nominal() else {
        return Err(Failure::input("--payload: this is one body, and --tare alone takes its fixture off"));
    };
    let place = model.place("--payload", words).map_err(Failure::input)?;
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

/// Returns the fit of the payload of a run of an arm; `None` if the run cannot be true: the answer about the arm says why.
///
/// # Errors
/// Bad input: runs of different trees, or rows that see nothing of the link.
pub(super) fn fit<'a>(
    options: &'a PayloadOptions,
    words: &str,
    loaded: &Loaded,
    arm: &Fit,
    tare: &Tare,
) -> Result<Option<Found<'a>>, Failure> {
    let (carrier, result) = carrier(loaded, words)?;
    let context = Context { links: loaded.problem.links(None), ..Context::default() };
    let judged = Answer::new(arm, context).map_err(Failure::input)?;
    if judged.status == Status::Implausible {
        return Ok(None);
    }
    let fit = tare.payload(arm, &carrier).map_err(Failure::input)?;
    let warnings = fit.noise.disagreement.map(|ratio| disagreement_in_words(&result.link, ratio));
    let result = PayloadResult { without: tare.recordings(), ..result };
    Ok(Some(Found { fit, payload: Payload { options, result }, warnings: warnings.into_iter().collect() }))
}

impl Payload<'_> {
    /// Writes the load of an answer into the files that were asked for; returns what to say of it, and whether all was written.
    ///
    /// # Errors
    /// A file cannot be written.
    pub(super) fn write(&self, answer: &Answer) -> Result<(String, bool), Failure> {
        let Some(found) = &answer.payload else { return Ok((String::new(), true)) };
        let mut written = Vec::new();
        let mut whole = true;
        for path in &self.options.write_load {
            let Some(language) = Language::of_path(path) else { continue };
            let text = match (&found.load, &found.refused) {
                (Some(load), _) => language
                    .write(&load.load(), &found.link, &remarks(answer, found, load))
                    .map_err(|e| e.to_string()),
                (None, why) => Err(why.clone().unwrap_or_default()),
            };
            match text {
                Ok(text) => {
                    write_new_text(path, &text).map_err(Failure::input)?;
                    written.push(path.display().to_string());
                }
                Err(why) => {
                    whole = false;
                    tell!("rigident: --write-load {}: not written: {why}", path.display());
                }
            }
        }
        let said =
            if written.is_empty() { String::new() } else { format!("; the load is {}", written.join(", ")) };
        Ok((said, whole))
    }
}

/// Returns the comment in a file: frame, origin of the numbers, uncertainty.
fn remarks(answer: &Answer, found: &PayloadResult, load: &ControllerLoad) -> Vec<String> {
    let place = found.position_m.map(|v| v.to_string()).join(", ");
    let turned = if found.rotation_wxyz == [1.0, 0.0, 0.0, 0.0] { "" } else { ", turned as --payload says" };
    let frame = match found.position_m {
        [0.0, 0.0, 0.0] => format!("frame: {}{turned}", found.link),
        _ => format!("frame: {} at [{place}] m{turned}", found.link),
    };
    let mass = answer.parameters.first().and_then(|p| p.state.measured());
    let certain = mass.map(|m| format!("mass {:.4} kg +- {:.4} kg (95 %)", m.value, m.u95));
    let what = format!("rigident identify --payload, {} less {}", answer.source.recording, found.without);
    [Some(what), Some(frame), certain, Some(load.basis.in_words().to_owned())].into_iter().flatten().collect()
}

/// Returns what to say where the run cannot be true and the answer is about the arm.
pub(super) fn not_to_be_used(words: &str) -> String {
    format!(
        "--payload {words}: nothing is said of it, because the recording with it cannot be true; this is the answer about the arm"
    )
}

/// Returns the note of what the answer is about.
pub(super) fn note(result: &PayloadResult) -> String {
    format!(
        "payload: what {} carries beyond {}; friction and offsets are each run's own. Controllers that want all beyond the \
         flange need a run with the bare flange as --tare",
        result.link, result.without
    )
}

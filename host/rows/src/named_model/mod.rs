//! The model of a name: one of the built-in people, or a file.

pub mod rig_links;

use std::path::Path;

use rigident_model::human::Person;
use rigident_model::{Model, ModelError};

/// Returns the model of a name, `human34`, `human58`, a rig file (`.toml`), a URDF, MJCF or SDF, and whether
/// it is one of the people, who have no fixed base.
///
/// # Errors
/// [`ModelError`] if there is none, or it cannot be used.
pub fn open(name: &str, person: &Person) -> Result<(Model, bool), ModelError> {
    let is_person = matches!(name, "human34" | "human58");
    Ok((read(name, person)?.0, is_person))
}

/// Returns the model of a name, as [`open`] takes it, and the text of its URDF, MJCF or SDF.
///
/// # Errors
/// Fails as [`open`] does.
pub fn read(name: &str, person: &Person) -> Result<(Model, Option<String>), ModelError> {
    match name {
        "human34" => return Ok((person.human34()?, None)),
        "human58" => return Ok((person.human58()?, None)),
        _ => {}
    }
    let path = Path::new(name);
    if !path.exists() {
        return Err(ModelError::Unknown(name.to_owned()));
    }
    if path.extension().is_some_and(|e| e == "toml") {
        return Ok((rig_links::read(path)?, None));
    }
    rigident_model::read_file(path).map(|(model, text)| (model, Some(text)))
}

//! A link of a URDF on a fixed joint: mass in kg, centre of mass in m and the tensor about it in kg m², axes
//! of the flange.

use nalgebra::{Matrix3, Vector3};
use rigident_shared::tree::{Joint, Link};

use super::{Load, LoadError};
use crate::tree::{Model, ModelLink};
use crate::write::generated;
use crate::xml::Language;

/// Returns the URDF of a flange called `link` and the load on it.
///
/// # Errors
/// [`LoadError::NeedsTensor`] if the tensor is not known.
pub fn write(load: &Load, link: &str) -> Result<String, LoadError> {
    if load.is_point() {
        return Err(LoadError::NeedsTensor);
    }
    let (rotation, position) = (Matrix3::identity(), Vector3::zeros());
    let fixed = |name: String, nominal| {
        let place = Link { parent: 0, joint: Joint::Fixed, rotation, position };
        ModelLink::new(name.clone(), format!("{name}_joint"), place, nominal)
    };
    let flange = fixed(link.to_owned(), Some([0.0; 10]));
    let payload = fixed(format!("{link}_payload"), Some(load.parameters()));
    let model = Model {
        name: "payload".to_owned(),
        links: vec![flange, payload],
        findings: Vec::new(),
        gravity_mps2: None,
    };
    generated(&model, Language::Urdf).map_err(|error| LoadError::Read(error.to_string()))
}

/// Returns the load of the last link that has a mass.
///
/// # Errors
/// [`LoadError::Read`] if it is no URDF, or no link has a mass.
pub fn read(text: &str) -> Result<Load, LoadError> {
    let model = crate::urdf::parse(text, "the load").map_err(|error| LoadError::Read(error.to_string()))?;
    let masses = model.links.iter().rev().filter_map(|link| link.nominal);
    let found = masses.into_iter().find(|phi| phi[0] > 0.0);
    found.map(Load::of_parameters).ok_or_else(|| LoadError::Read("no link of it has a mass".to_owned()))
}

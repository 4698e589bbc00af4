//! Places of joints written into a URDF that is retained.

use std::mem::discriminant;

use roxmltree::{Document, Node};

use super::finding::ModelError;
use super::tree::{Model, ModelLink};
use super::urdf;
use super::xml::{Edit, child, replace_child, rpy, vector};

/// Places differ by no more after they were written and read again: rounding of angles and their sines.
const ROUNDING: f64 = 1e-12;

/// Returns joints of the same kind in both whose places differ by more than rounding.
fn moved<'a>(model: &'a Model, file: &Model, by: f64) -> Vec<&'a ModelLink> {
    let differs = |own: &&ModelLink| {
        let Some(other) = file.joint(&own.joint_name).map(|i| &file.links[i].link) else { return false };
        let same_kind = discriminant(&own.link.joint) == discriminant(&other.joint);
        let turned = (own.link.rotation - other.rotation).amax();
        same_kind && turned.max((own.link.position - other.position).amax()) > by
    };
    model.links.iter().skip(1).filter(differs).collect()
}

/// Returns the edits that put the joints of a URDF where the model has them; all else of them stays. `file`
/// is what the text says.
pub(super) fn edits(model: &Model, file: &Model, text: &str, document: &Document) -> Vec<Edit> {
    let place = |own: &ModelLink| {
        let is_it = |node: &Node| {
            node.has_tag_name("joint")
                && node.attribute("name") == Some(own.joint_name.as_str())
                && child(node, "child").is_some()
        };
        let joint = document.descendants().find(is_it)?;
        let origin =
            format!("<origin xyz=\"{}\" rpy=\"{}\"/>", vector(&own.link.position), rpy(&own.link.rotation));
        Some(replace_child(text, &joint, "origin", origin))
    };
    moved(model, file, 0.0).into_iter().filter_map(place).collect()
}

/// Reads again what is to be written of the joints' places.
///
/// # Errors
/// [`ModelError::Structure`] if a joint is not where it was meant to be.
pub(super) fn check(model: &Model, text: &str, what: &str) -> Result<(), ModelError> {
    let again = urdf::parse(text, what)?;
    match moved(model, &again, ROUNDING).first() {
        None => Ok(()),
        Some(own) => Err(ModelError::Structure {
            what: what.to_owned(),
            problem: format!(
                "joint {} does not come out where it was put; nothing was written",
                own.joint_name
            ),
        }),
    }
}

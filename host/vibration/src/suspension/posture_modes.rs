//! Locked postures by the modes of their free vibration: rows of the base parameters of the tree.

use super::SuspensionError;
use super::modal::{ModalSource, Swing};
use super::postures::{base_columns, composite};
use super::support::Support;
use crate::modal_analysis::Shapes;
use rigident_fit::RowSource as _;
use rigident_model::Model;
use rigident_model::rows::Moving;
use rigident_rows::tree::{Input, TreeSource};

/// A posture with its modes.
#[derive(Clone, Debug)]
pub struct PostureModes {
    /// The posture's name.
    pub name: String,
    /// Coordinates of the joints, in the order of the links: m, rad, quaternions w, x, y, z.
    pub positions: Vec<f64>,
    /// The modes over the free coordinates.
    pub shapes: Shapes,
}

/// Returns the rows of all postures of a tree, which share the errors of the springs, over its base
/// parameters.
///
/// # Errors
/// [`SuspensionError`] if the joints are not as the tree has them, or no mode is given.
pub fn posture_rows(
    model: &Model,
    support: &Support,
    postures: &[PostureModes],
) -> Result<ModalSource, SuspensionError> {
    let tree = TreeSource::new(Input::tracked(model.clone(), Vec::new(), 1.0))?;
    let refuse = |file: &str, why: String| SuspensionError::Posture { file: file.to_owned(), why };
    let mut moving = Moving::new(model.tree()).map_err(|e| refuse(&model.name, format!("{e:?}")))?;
    let mut swings = Vec::new();
    for posture in postures {
        let whole = composite(&mut moving, &posture.positions)
            .map_err(|e| refuse(&posture.name, format!("{e:?}")))?;
        let map = base_columns(tree.base(), &whole);
        swings.push(Swing { shapes: posture.shapes.clone(), map, rests: Vec::new() });
    }
    ModalSource::new(&swings, support, tree.parameters().to_vec(), tree.model_fingerprint())
        .ok_or_else(|| refuse(&model.name, "no posture has a mode, or their covariance is none".to_owned()))
}

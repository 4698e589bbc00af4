//! Models of trees of links: where they come from, and what of them can be identified.
//!
//! Lives here: the model itself ([`tree`], what joints do by themselves in [`passive`]) and its findings,
//! readers ([`urdf`], [`mjcf`], [`sdf`]) and the writer ([`mod@write`], [`remarks`]), loads for controllers
//! ([`load`]), what is strange in other people's files ([`check`]), the built-in people ([`human`]), changes
//! by option ([`edit`]), what a motion leaves out ([`idle`]), the base parameters ([`base`]) the rows of a
//! model in motion ([`rows`]) and how fast they come ([`speed`]). May not live here: the formulas of the
//! rows, which firmware and host share (`rigident_shared::tree`), and recordings. Next: [`tree`], then
//! [`base`].

pub mod base;
pub mod check;
pub mod dynamics;
pub mod edit;
mod element;
pub mod finding;
pub mod human;
mod human_segments;
pub mod idle;
pub mod inertial;
mod joint_edits;
pub mod limits;
pub mod load;
mod loose_xml;
pub mod mjcf;
pub mod passive;
mod passive_edits;
mod passive_table;
#[cfg(test)]
mod passive_tests;
pub mod possible;
pub mod remarks;
pub mod rows;
pub mod sdf;
pub mod sites;
pub mod speed;
pub mod symmetry;
#[cfg(test)]
mod tests;
mod transmission;
pub mod tree;
pub mod urdf;
mod urdf_fault;
pub mod write;
#[cfg(test)]
mod write_tests;
pub mod xml;

use std::path::Path;

pub use finding::{Finding, ModelError};
pub use tree::{Mimic, Model, ModelLink};

/// Returns the model of a URDF, MJCF or SDF file, and the file's text.
///
/// # Errors
/// [`ModelError`] if it cannot be read, or makes no tree.
pub fn read_file(path: &Path) -> Result<(Model, String), ModelError> {
    let text = urdf::text_of(path)?;
    Ok((write::parse_in(&text, &path.display().to_string(), path.parent())?.model, text))
}

//! Options of the estimation of links' masses.

use std::path::PathBuf;

use super::super::Tree;
use rigident_identify::mass_properties::comparison::{Way, WayName};
use rigident_identify::mass_properties::unknowns::ParameterSet;
use rigident_rows::tree::drive::Friction;

/// Options of the estimation of links' masses.
#[derive(Clone, Debug)]
pub struct MassOptions {
    /// Rig file of all recordings. Default: `NAME.rig.toml` beside each.
    pub rig: Option<PathBuf>,
    /// The robot with its nominal masses.
    pub tree: Tree,
    /// Friction columns of the joints.
    pub friction: Friction,
    /// Parts of a single recording, each left out once; of several recordings each is one.
    pub parts: usize,
    /// The parameters of every link that are unknown.
    pub set: ParameterSet,
    /// Right links mirror left ones in what they change by.
    pub symmetric_sides: bool,
    /// No mass goes below this share of the nominal one, from 0 to less than 1.
    pub least_mass: f64,
    /// The way whose parameters are taken; `None`: the one that predicts best what it has not seen.
    pub way: Option<WayName>,
    /// Ways with their settings; those of the others are chosen by what is left out.
    pub fixed: Vec<Way>,
    /// The treatment of a wrench on the base that nothing measures.
    pub external_wrench: ExternalWrench,
    /// The file of the model with what was found: `.urdf`, `.xml` (MJCF) or `.sdf`; must not exist.
    pub write_model: Option<PathBuf>,
}

impl Default for MassOptions {
    fn default() -> Self {
        Self {
            rig: None,
            tree: Tree::default(),
            friction: Friction::default(),
            parts: 4,
            set: ParameterSet::default(),
            symmetric_sides: false,
            least_mass: 0.1,
            way: None,
            fixed: Vec::new(),
            external_wrench: ExternalWrench::default(),
            write_model: None,
        }
    }
}

/// The treatment of a wrench on the base that nothing measures, as by a hose, a cable or a rope.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExternalWrench {
    /// It is looked for, and eliminated where it is found.
    #[default]
    Auto,
    /// It is eliminated.
    Unknown,
    /// There is none.
    None,
}

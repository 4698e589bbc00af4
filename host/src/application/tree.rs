//! The tree that a recording is of, and the changes to it.

use std::path::{Path, PathBuf};

use super::locked_joints;
use super::recorded::is_rig_file;
use super::{Caller, Error, Notice, TreeOption};
use rigident_io::recording::{Recording, extension, rig_path};
use rigident_io::rig::RigFile;
use rigident_model::Model;
use rigident_model::human::Person;
use rigident_rows::named_model;

/// The tree that a recording is of.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tree {
    /// human34, human58, or the path of a URDF, MJCF, SDF or rig file; `None`: the `[[link]]` tables of the
    /// recording's rig file, if there are several, else one body.
    pub model: Option<String>,
    /// The changes to it.
    pub changes: Changes,
}

/// The changes to a model, and whose body a person's is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Changes {
    /// Joints that do not move, `JOINT` or `JOINT=VALUE` in rad or m.
    pub lock: Vec<String>,
    /// Three revolute joints in a row each, nearest to the base first, that are one spherical joint.
    pub spherical: Vec<[String; 3]>,
    /// Bodies held rigidly by a link, `LINK@x,y,z,roll,pitch,yaw` in m and degrees.
    pub tool: Vec<String>,
    /// The person whose body human34 and human58 are.
    pub person: Person,
}

impl Tree {
    /// Returns what is asked of a tree, if anything is: the first of it.
    pub fn asked(&self) -> Option<TreeOption> {
        let changes = &self.changes;
        let given = [
            (TreeOption::Lock, !changes.lock.is_empty()),
            (TreeOption::Spherical, !changes.spherical.is_empty()),
            (TreeOption::Tool, !changes.tool.is_empty()),
            (TreeOption::Person, changes.describe_a_person()),
        ];
        given.into_iter().find(|(_, is_given)| *is_given).map(|(option, _)| option)
    }
}

impl Changes {
    /// Returns true if anything that only people have is other than the default.
    pub fn describe_a_person(&self) -> bool {
        self.person != Person::default()
    }
}

/// Returns the model of a name, changed, and whether it is a person's.
///
/// # Errors
/// Fails as [`read`] and [`change`] do.
pub fn open(name: &str, changes: &Changes) -> Result<(Model, bool), Error> {
    let (mut model, is_person) = read(name, changes)?;
    change(&mut model, changes)?;
    Ok((model, is_person))
}

/// Returns the model of a name, nothing changed yet, and whether it is a person's.
///
/// # Errors
/// [`Error::Model`] if it cannot be read as a tree, [`Error::NoPerson`] if a person is described and it is
/// none.
pub fn read(name: &str, changes: &Changes) -> Result<(Model, bool), Error> {
    let (model, is_person) = named_model::open(name, &changes.person)?;
    if !is_person && changes.describe_a_person() {
        return Err(Error::NoPerson);
    }
    Ok((model, is_person))
}

/// Changes a model.
///
/// # Errors
/// [`Error::Model`] if there is no such joint or link.
pub fn change(model: &mut Model, changes: &Changes) -> Result<(), Error> {
    model.lock(&changes.lock)?;
    for joints in &changes.spherical {
        model.declare_spherical(joints)?;
    }
    for words in &changes.tool {
        model.hold_tool(words)?;
    }
    Ok(())
}

/// Returns the tree that a recording is of, as its source has it, and the robot description that it was read
/// from: by the model that is named, or the `[[link]]` tables of its rig file if there are several; `None` if
/// it is of a single body.
///
/// # Errors
/// The tree is none.
pub fn tree_of(
    recording: &Path,
    rig: Option<&Path>,
    tree: &Tree,
) -> Result<Option<(Model, Option<PathBuf>)>, Error> {
    let of_file = if tree.model.is_some() { None } else { rig_of(recording, rig) };
    tree_in(recording, of_file, tree)
}

/// Returns the same where the rig file has been read.
///
/// # Errors
/// The tree is none.
pub fn tree_in(
    recording: &Path,
    rig: Option<RigFile>,
    tree: &Tree,
) -> Result<Option<(Model, Option<PathBuf>)>, Error> {
    if let Some(name) = &tree.model {
        let (model, is_person) = read(name, &tree.changes)?;
        return Ok(Some((model, (!is_person).then(|| Path::new(name).to_owned()))));
    }
    let Some(rig) = rig.filter(|rig| rig.link.len() > 1) else { return Ok(None) };
    if tree.changes.describe_a_person() {
        return Err(Error::NoPerson);
    }
    let name = recording.display().to_string();
    let mut model = named_model::rig_links::from_tables(&rig.link, &name)?;
    let stem = recording.file_stem().map_or(name, |stem| stem.to_string_lossy().into_owned());
    model.name = stem.strip_suffix(".rig").unwrap_or(&stem).to_owned();
    Ok(Some((model, None)))
}

/// Returns true if the rig file of a recording says that springs carry the platform.
pub fn is_on_springs(recording: &Path, rig: Option<&Path>) -> bool {
    rig_of(recording, rig).is_some_and(|rig| rig.suspension.is_some())
}

/// Changes a tree, joints being locked where the recording has them; returns what to know of it.
///
/// # Errors
/// There is no such joint or link, or a joint to be locked moves.
pub fn change_as_recorded(
    model: &mut Model,
    changes: &Changes,
    recording: &Recording,
    caller: &Caller<'_>,
) -> Result<Vec<String>, Error> {
    let mut notes = locked_joints::lock(model, &changes.lock, recording, caller)?;
    locked_joints::meet(model, &changes.spherical, recording)?;
    for words in &changes.tool {
        model.hold_tool(words)?;
        let link = words.split('@').next().unwrap_or(words).to_owned();
        notes.push(caller.words(&Notice::Tool { words: words.clone(), link }));
    }
    Ok(notes)
}

/// Returns the rig file that the recording has; one that cannot be read is another's to complain of.
fn rig_of(path: &Path, rig: Option<&Path>) -> Option<RigFile> {
    let rig = match rig {
        Some(rig) => rig.to_owned(),
        None if is_rig_file(path) => path.to_owned(),
        None => rig_path(path),
    };
    let beside = RigFile::load(&rig).ok();
    if beside.is_some() || path.is_dir() {
        return beside;
    }
    // A recording may carry its rig file.
    let is_mcap = extension(path) == "mcap";
    is_mcap.then(|| Recording::load(path, None).ok().map(|r| r.rig)).flatten()
}

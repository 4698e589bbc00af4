//! Models with new inertias written into URDF, MJCF and SDF.
//!
//! A file of the same language is left as it is but for its inertias, friction and rotors; otherwise a new
//! one is made of the tree: links, joints, inertias, nothing else. What was written is read again and
//! compared before it is a file.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use rigident_files::new_file::{self, write_new_text};
use rigident_shared::tree::Joint;

use super::finding::ModelError;
use super::inertial::{Parameters, in_parent};
use super::loose_xml::tidied;
use super::mjcf::names::Names;
use super::passive::Passive;
use super::passive_edits;
use super::passive_table;
use super::transmission;
use super::tree::{Mimic, Model, ModelLink, Parsed};
use super::xml::{self, Language, escaped, inertial, rpy, vector};
use super::{joint_edits, mjcf, sdf, urdf};

/// Standard gravity (CGPM 1901): that of recordings where no other is stated.
const STANDARD_GRAVITY_MPS2: f64 = 9.80665;

/// The bound on the difference of what was written, relative, when it is read again: rounding of sums and
/// rotations.
const ROUNDING: f64 = 1e-12;

/// Returns a model with other parameters for some of its links, by name.
#[must_use]
pub fn with_parameters<'a>(model: &Model, new: impl Iterator<Item = (&'a str, Parameters)>) -> Model {
    let mut out = model.clone();
    for (name, parameters) in new {
        if let Some(i) = out.link(name) {
            out.links[i].nominal = Some(parameters);
        }
    }
    out
}

/// Returns a model in which the joints of these names do other things by themselves: friction, rotor, spring
/// of their (first) axis. Joints that it does not have, and fixed ones, are left out.
#[must_use]
pub fn with_passive<'a>(model: &Model, new: impl Iterator<Item = (&'a str, Passive)>) -> Model {
    let mut out = model.clone();
    for (name, passive) in new {
        if let Some(i) = out.joint(name).filter(|i| out.links[*i].link.joint != Joint::Fixed) {
            out.links[i].passive[0] = passive;
        }
    }
    out
}

/// Returns whether a file can be written there.
///
/// # Errors
/// [`ModelError::Option`] if it, or the table of joints beside it, exists, its folder does not, or its ending
/// is not known.
pub fn check_target(path: &Path) -> Result<Language, ModelError> {
    let ending = "its name must end in .urdf, .xml, .mjcf or .sdf";
    let language = Language::of_path(path).ok_or_else(|| refused(path, ending))?;
    check_new(path)?;
    if language != Language::Mjcf {
        // One that is left over would be taken for this model's.
        check_new(&passive_table::path_beside(path))?;
    }
    Ok(language)
}

/// Checks whether a new file can be there.
///
/// # Errors
/// [`ModelError::Option`] if it exists, or its folder does not.
pub fn check_new(path: &Path) -> Result<(), ModelError> {
    if new_file::check_new(path).is_err() {
        return Err(refused(path, "the file is there already, and nothing is overwritten"));
    }
    if path.parent().is_some_and(|folder| !folder.as_os_str().is_empty() && !folder.is_dir()) {
        return Err(refused(path, "its folder is not there: make it first"));
    }
    Ok(())
}

fn refused(path: &Path, why: &str) -> ModelError {
    ModelError::Option(format!("`write_model` {}: {why}", path.display()))
}

/// Reads a text of any of the languages.
///
/// # Errors
/// [`ModelError`].
pub fn parse(text: &str, what: &str) -> Result<Parsed, ModelError> {
    parse_in(text, what, None)
}

/// Reads a text of any of the languages; files that it includes are searched for in `folder`.
///
/// # Errors
/// [`ModelError`].
pub fn parse_in(text: &str, what: &str, folder: Option<&Path>) -> Result<Parsed, ModelError> {
    match Language::of_text(text) {
        Some(Language::Mjcf) => mjcf::parse_in(text, what, folder),
        Some(Language::Sdf) => sdf::parse_in(text, what, folder),
        _ => Ok(Parsed { model: urdf::parse(text, what)?, anchors: BTreeMap::new() }),
    }
}

/// Writes a model to a new file; `source` is the file it was read from.
///
/// # Errors
/// [`ModelError`] if the file cannot be written, or what was written is not read as it was meant.
pub fn write(model: &Model, source: Option<&Path>, path: &Path) -> Result<(), ModelError> {
    let language = check_target(path)?;
    let text = source.and_then(|source| rigident_files::read_text(source).ok());
    let text = text.filter(|text| Language::of_text(text) == Some(language));
    // Files that it includes become part of the new one.
    let text = match (text, source) {
        (Some(text), Some(source)) => {
            let (what, folder) = (source.display().to_string(), source.parent());
            Some(match language {
                Language::Mjcf => mjcf::written_out(&text, &what, folder)?.into_owned(),
                Language::Sdf => sdf::written_out(&text, &what, folder)?.into_owned(),
                Language::Urdf => text,
            })
        }
        (text, _) => text,
    };
    let kept = text.is_some();
    let table = passive_table::of(model, language, path);
    let (text, said) = match text {
        Some(text) => (edited(model, &text, &path.display().to_string())?, model.clone()),
        None => (generated(model, language)?, said_by(model, language)?),
    };
    check(&said, &text, path)?;
    check_passive(&said, &text, language, kept, path)?;
    if kept && language == Language::Urdf {
        joint_edits::check(model, &text, &path.display().to_string())?;
    }
    if let Some((path, text)) = table {
        write_new_text(&path, &text)?;
    }
    Ok(write_new_text(path, &text)?)
}

/// Reads again what is to be written.
fn check(model: &Model, text: &str, path: &Path) -> Result<(), ModelError> {
    let again = parse(text, &path.display().to_string())?.model;
    for link in &model.links {
        let Some(wanted) = link.nominal.filter(|_| link.is_body()) else { continue };
        let got = again.link(&link.name).and_then(|i| again.links[i].nominal);
        let scale = |k: usize| match k {
            0 => wanted[0].abs(),
            1..4 => wanted[1..4].iter().map(|v| v.abs()).fold(wanted[0].abs() * 1e-3, f64::max),
            _ => wanted[4..].iter().map(|v| v.abs()).fold(0.0, f64::max),
        };
        let same = got.is_some_and(|got| (0..10).all(|k| (got[k] - wanted[k]).abs() <= ROUNDING * scale(k)));
        if !same {
            return Err(ModelError::Structure {
                what: path.display().to_string(),
                problem: format!(
                    "link {} does not come out as it was written: is it in the file under another name, or \
                     made by a macro? nothing was written; give the file with everything expanded",
                    link.name
                ),
            });
        }
    }
    Ok(())
}

/// Returns what the joints do by themselves as far as a language says it, in the order of the numbers.
fn passive_said_in(model: &Model, language: Language) -> Vec<[f64; 5]> {
    let own = |(link, passive): (&ModelLink, &Passive)| passive.said_in(language, &link.link.joint);
    let each = model.links.iter().flat_map(|link| link.passive.iter().map(move |passive| (link, passive)));
    let said = each.map(own).filter(|passive| *passive != Passive::default());
    let mut numbers: Vec<[f64; 5]> = said.map(|passive| passive.named().map(|(_, value)| value)).collect();
    numbers.sort_by(|a, b| {
        let unequal = a.iter().zip(b).map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne());
        unequal.unwrap_or(std::cmp::Ordering::Equal)
    });
    numbers
}

/// Reads again what is to be written of rotors, friction and springs.
fn check_passive(
    model: &Model,
    text: &str,
    language: Language,
    kept: bool,
    path: &Path,
) -> Result<(), ModelError> {
    let again = parse(text, &path.display().to_string())?.model;
    let same = if kept {
        passive_edits::changed(model, &again, language).is_empty()
    } else {
        passive_said_in(&again, language) == passive_said_in(model, language)
    };
    if same {
        return Ok(());
    }
    Err(ModelError::Structure {
        what: path.display().to_string(),
        problem: "rotors, friction and springs of its joints do not come out as they were written; nothing \
                  was written"
            .to_owned(),
    })
}

/// Returns the text of a file with new inertias, friction and rotors.
///
/// # Errors
/// [`ModelError`] if it cannot be read.
pub fn edited(model: &Model, text: &str, what: &str) -> Result<String, ModelError> {
    let language = Language::of_text(text).unwrap_or(Language::Urdf);
    let own = parse(text, what)?;
    // Elements are in it where they do in the text.
    let tidy = tidied(text);
    let document = xml::document(&tidy, what)?;
    let names = Names::of(&document);
    let tag = if language == Language::Mjcf { "body" } else { "link" };
    let mut changes = passive_edits::edits(model, &own.model, text, (&document, &names), language);
    if language == Language::Urdf {
        changes.extend(joint_edits::edits(model, &own.model, text, &document));
    }
    for node in document.descendants().filter(|n| n.has_tag_name(tag)) {
        let Some(name) = names.name(&node).or(node.attribute("name")) else { continue };
        let Some(link) = model.link(name).map(|i| &model.links[i]).filter(|link| link.is_body()) else {
            continue;
        };
        let Some(phi) = link.nominal else { continue };
        let anchor = own.anchors.get(name).copied().unwrap_or_else(Vector3::zeros);
        let phi = in_parent(&phi, &Matrix3::identity(), &anchor);
        changes.push(xml::replace_child(text, &node, "inertial", inertial(&phi, language)));
    }
    Ok(xml::edit(text, changes))
}

/// Returns the file of a model in a language.
///
/// # Errors
/// [`ModelError::Structure`] if the language has no word for a joint.
pub fn generated(model: &Model, language: Language) -> Result<String, ModelError> {
    match language {
        Language::Urdf => Ok(as_urdf(model)),
        Language::Mjcf => Ok(as_mjcf(model)),
        Language::Sdf => sdf::generated::Said::of(model)?.text(),
    }
}

/// Returns the links of a file that is made of a model: SDF has none without mass.
fn said_by(model: &Model, language: Language) -> Result<Model, ModelError> {
    match language {
        Language::Sdf => Ok(sdf::generated::Said::of(model)?.model),
        Language::Urdf | Language::Mjcf => Ok(model.clone()),
    }
}

fn as_urdf(model: &Model) -> String {
    let mut transmissions = String::new();
    let mut out = String::new();
    let link = |out: &mut String, name: &str, phi: Option<&Parameters>| {
        let inside =
            phi.map_or_else(String::new, |phi| format!("\n    {}\n  ", inertial(phi, Language::Urdf)));
        let _ = writeln!(out, "  <link name=\"{}\">{inside}</link>", escaped(name));
    };
    for (i, own) in model.links.iter().enumerate() {
        link(&mut out, &own.name, own.nominal.as_ref().filter(|_| own.is_body()));
        if i == 0 {
            continue;
        }
        let parent = &model.links[own.link.parent].name;
        let place =
            format!("<origin xyz=\"{}\" rpy=\"{}\"/>", vector(&own.link.position), rpy(&own.link.rotation));
        let mut joint = |out: &mut String,
                         name: &str,
                         kind: &str,
                         place: &str,
                         ends: (&str, &str),
                         axis: Option<&Vector3<f64>>,
                         passive: &Passive| {
            let mut axis = axis.map_or_else(String::new, |a| format!("<axis xyz=\"{}\"/>", vector(a)));
            if let Some(Mimic { leader, multiplier, offset }) = &own.mimic {
                let leader = escaped(leader);
                axis +=
                    &format!("<mimic joint=\"{leader}\" multiplier=\"{multiplier}\" offset=\"{offset}\"/>");
            }
            axis += &passive.written(Language::Urdf, &own.link.joint);
            let armature = passive.said_in(Language::Urdf, &own.link.joint).armature;
            if armature != 0.0 {
                let _ = writeln!(transmissions, "  {}", transmission::written(name, armature));
            }
            let limit = if kind == "prismatic" {
                "<limit lower=\"-1e9\" upper=\"1e9\" effort=\"1e9\" velocity=\"1e9\"/>"
            } else {
                ""
            };
            let _ = writeln!(
                out,
                "  <joint name=\"{}\" type=\"{kind}\">{place}<parent link=\"{}\"/><child \
                 link=\"{}\"/>{axis}{limit}</joint>",
                escaped(name),
                escaped(ends.0),
                escaped(ends.1)
            );
        };
        let ends = (parent.as_str(), own.name.as_str());
        let [passive, second] = &own.passive;
        match &own.link.joint {
            Joint::Fixed => joint(&mut out, &own.joint_name, "fixed", &place, ends, None, passive),
            Joint::Revolute(a) => {
                joint(&mut out, &own.joint_name, "continuous", &place, ends, Some(a), passive)
            }
            Joint::Prismatic(a) => {
                joint(&mut out, &own.joint_name, "prismatic", &place, ends, Some(a), passive)
            }
            Joint::Spherical => joint(&mut out, &own.joint_name, "spherical", &place, ends, None, passive),
            Joint::Free => joint(&mut out, &own.joint_name, "floating", &place, ends, None, passive),
            Joint::Universal(a, b) => {
                // Two joints with a link between them that has no mass.
                let between = format!("{}_cross", own.name);
                link(&mut out, &between, None);
                let first = format!("{}_first", own.joint_name);
                joint(&mut out, &first, "continuous", &place, (parent, &between), Some(a), passive);
                joint(&mut out, &own.joint_name, "continuous", "", (&between, &own.name), Some(b), second);
            }
        }
    }
    let declared = if transmissions.is_empty() { "" } else { transmission::DECLARED };
    let name = escaped(&model.name);
    format!("<?xml version=\"1.0\"?>\n<robot name=\"{name}\"{declared}>\n{out}{transmissions}</robot>\n")
}

fn as_mjcf(model: &Model) -> String {
    // MuJoCo's own is 9.81 m/s².
    let [x, y, z] = model.gravity_mps2.unwrap_or([0.0, 0.0, -STANDARD_GRAVITY_MPS2]);
    let mut out = format!(
        "<mujoco model=\"{}\">\n  <compiler angle=\"radian\" inertiafromgeom=\"false\"/>\n  \
         <option gravity=\"{x} {y} {z}\"/>\n  <worldbody>\n",
        escaped(&model.name)
    );
    // The world's own body is the base, where a file had it so.
    if model.links.first().is_some_and(|base| base.name == mjcf::WORLD && base.nominal.is_none()) {
        bodies_below(model, 0, 2, &mut out);
    } else {
        mjcf_body(model, 0, 2, &mut out);
    }
    out + "  </worldbody>\n</mujoco>\n"
}

/// Writes a body with those that hang on it.
fn mjcf_body(model: &Model, i: usize, depth: usize, out: &mut String) {
    let own = &model.links[i];
    let pad = "  ".repeat(depth);
    let chain = joints_of_body(model, i);
    let mut place = String::new();
    if i > 0 {
        let (mut rotation, mut position) = (Matrix3::identity(), Vector3::zeros());
        for k in &chain {
            let link = &model.links[*k].link;
            position += rotation * link.position;
            rotation *= link.rotation;
        }
        let q = UnitQuaternion::from_matrix(&rotation);
        place = format!(" pos=\"{}\" quat=\"{} {} {} {}\"", vector(&position), q.w, q.i, q.j, q.k);
    }
    let _ = writeln!(out, "{pad}<body name=\"{}\"{place}>", escaped(&own.name));
    if i > 0 {
        mjcf_joints(model, &chain, &pad, out);
    }
    if let Some(phi) = &own.nominal {
        let _ = writeln!(out, "{pad}  {}", inertial(phi, Language::Mjcf));
    } else if i == 0 || own.link.joint == Joint::Fixed {
        // Some readers want one of every body; MuJoCo has nothing against none where nothing moves.
        let _ = writeln!(out, "{pad}  <inertial pos=\"0 0 0\" mass=\"0\" diaginertia=\"0 0 0\"/>");
    }
    bodies_below(model, i, depth + 1, out);
    let _ = writeln!(out, "{pad}</body>");
}

/// Returns the links whose joints are a body's own, nearest to the base first: links before it that are no
/// bodies, and itself.
fn joints_of_body(model: &Model, i: usize) -> Vec<usize> {
    let mut chain = vec![i];
    while let Some(before) = chain.last().map(|k| model.links[*k].link.parent)
        && !model.links[before].is_body()
        && before != 0
    {
        chain.push(before);
    }
    chain.reverse();
    chain
}

/// Writes the joints of a body, in its own axes.
fn mjcf_joints(model: &Model, chain: &[usize], pad: &str, out: &mut String) {
    // Place and turn of each of the chain's links in the body.
    let (mut turn, mut point) = (Matrix3::identity(), Vector3::zeros());
    let mut at = Vec::new();
    for k in chain.iter().rev() {
        at.push((*k, turn, point));
        let link = &model.links[*k].link;
        turn *= link.rotation.transpose();
        point -= turn * link.position;
    }
    for (k, turn, point) in at.into_iter().rev() {
        let link = &model.links[k];
        let [passive, second] = &link.passive;
        let mut joint = |name: &str, kind: &str, axis: Option<&Vector3<f64>>, passive: &Passive| {
            let passive = passive.written(Language::Mjcf, &link.link.joint);
            let axis = axis.map_or_else(String::new, |a| format!(" axis=\"{}\"", vector(&(turn * a))));
            let is_at_origin = point == Vector3::zeros();
            let pos = if is_at_origin { String::new() } else { format!(" pos=\"{}\"", vector(&point)) };
            let name = escaped(name);
            let _ = writeln!(out, "{pad}  <joint name=\"{name}\" type=\"{kind}\"{axis}{pos}{passive}/>");
        };
        match &link.link.joint {
            Joint::Fixed => {}
            Joint::Revolute(a) => joint(&link.joint_name, "hinge", Some(a), passive),
            Joint::Prismatic(a) => joint(&link.joint_name, "slide", Some(a), passive),
            Joint::Spherical => joint(&link.joint_name, "ball", None, passive),
            Joint::Free => joint(&link.joint_name, "free", None, passive),
            Joint::Universal(a, b) => {
                joint(&format!("{}_first", link.joint_name), "hinge", Some(a), passive);
                joint(&link.joint_name, "hinge", Some(b), second);
            }
        }
    }
}

/// Writes the bodies that hang on a link, or on links of it that are none.
fn bodies_below(model: &Model, i: usize, depth: usize, out: &mut String) {
    for (k, link) in model.links.iter().enumerate().skip(1).filter(|(_, l)| l.link.parent == i) {
        if link.is_body() { mjcf_body(model, k, depth, out) } else { bodies_below(model, k, depth, out) }
    }
}

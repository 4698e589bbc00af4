//! The statements of a model that a file written of it does not make as the model does.

use std::path::Path;

use rigident_shared::tree::Joint;

use super::passive_table;
use super::sdf::generated::Said;
use super::tree::{Model, ModelLink};
use super::xml::Language;

/// Returns what whoever reads a file of a model should know: what it does not say as the model does, or only
/// some readers read. `locked` are the joints, `JOINT` or `JOINT=VALUE`, that were locked in it.
pub fn remarks(model: &Model, source: Option<&Path>, path: &Path, locked: &[String]) -> Vec<String> {
    let language = Language::of_path(path);
    let mut said = Vec::new();
    let mut say = |text: String| said.push(format!("{}: {text}", path.display()));
    let text = source.and_then(|source| rigident_files::read_text(source).ok());
    let is_kept = text.is_some_and(|text| Language::of_text(&text) == language);
    // Two hinges of a body are one universal joint in a file that is made.
    let universal = (language == Some(Language::Sdf) && !is_kept).then(|| model.with_universals());
    let model = universal.as_ref().unwrap_or(model);
    let joints = |is: &dyn Fn(&ModelLink) -> bool| -> Option<String> {
        let names: Vec<&str> =
            model.links.iter().skip(1).filter(|l| is(l)).map(|l| l.joint_name.as_str()).collect();
        (!names.is_empty()).then(|| names.join(", "))
    };
    if let Some(language) = language {
        let loses = |l: &ModelLink| {
            l.passive
                .iter()
                .any(|p| p.said_in(language, &l.link.joint) != p.said_in(Language::Mjcf, &l.link.joint))
        };
        if let Some(names) = joints(&loses) {
            say(format!(
                "this language has no words for all rotors, springs and friction of {names}; write .xml \
                 (MJCF), which has"
            ));
        }
        let rotors =
            |l: &ModelLink| l.passive.iter().any(|p| p.said_in(language, &l.link.joint).armature != 0.0);
        if let Some(names) = joints(&rotors).filter(|_| language != Language::Mjcf) {
            say(format!(
                "rotors of {names} are in <drake:rotor_inertia>, which Drake and this program read; Gazebo, \
                 Pinocchio, Isaac and MuJoCo's reader of URDF pass it over, and these joints then turn too \
                 easily: give them `armature` of {}, or write .xml (MJCF)",
                passive_table::path_beside(path).display()
            ));
        } else if !passive_table::passed_over(model, language).is_empty() {
            say(format!("the table beside it, {}, has them", passive_table::path_beside(path).display()));
        }
    }
    if is_kept {
        // The rest of it is left as it is.
        return said;
    }
    say("holds links, joints, inertias and what its language says of friction; shapes, limits and whatever \
         else the model's file may have are left out"
        .to_owned());
    if !locked.is_empty() {
        say(format!("joints that were locked are fixed in it: {}", locked.join(", ")));
    }
    if language == Some(Language::Urdf) {
        if let Some(names) = joints(&|l| l.link.joint == Joint::Spherical) {
            say(format!(
                "type=\"spherical\" of {names} is an extension of URDF that urdfdom, and with it ROS, \
                 refuses; write .xml (MJCF) or .sdf, which have such joints"
            ));
        }
        if let Some(names) = joints(&|l| matches!(l.link.joint, Joint::Universal(..))) {
            say(format!(
                "URDF has no universal joint: {names} became two joints each, with a link without mass \
                 between"
            ));
        }
    } else if let Some(names) = joints(&|l| l.mimic.is_some()) {
        say(format!("that {names} follow other joints is left out"));
    }
    if let (Some(Language::Sdf), Ok(own)) = (language, Said::of(model)) {
        if let Some(base) = own.fixed_to_world() {
            say(format!("{base}, a base without mass, is fixed to the world in it"));
        }
        let frames: Vec<&str> = own.frames.iter().map(|frame| frame.name.as_str()).collect();
        if !frames.is_empty() {
            say(format!(
                "SDF gives a kilogram to a link without inertia: {} became frames of the links that they are \
                 fixed to",
                frames.join(", ")
            ));
        }
    }
    if language == Some(Language::Sdf) {
        let renamed = model.separate_joint_names();
        let pairs = model.links.iter().zip(&renamed).skip(1).filter(|(l, name)| l.joint_name != **name);
        let pairs: Vec<String> = pairs.map(|(l, name)| format!("{} is {name}", l.joint_name)).collect();
        if !pairs.is_empty() {
            say(format!("no joint can have the name of a link there: {}", pairs.join(", ")));
        }
    }
    said
}

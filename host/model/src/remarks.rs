//! What a file that was written of a model does not say as the model does.

use std::collections::BTreeSet;
use std::path::Path;

use rigident_shared::tree::Joint;

use super::tree::{Model, ModelLink};
use super::xml::Language;

/// What whoever reads a file of a model should know: what it does not say as the model does, or only some readers read.
/// `locked` are the joints, `JOINT` or `JOINT=VALUE`, that were locked in it.
pub fn remarks(model: &Model, source: Option<&Path>, path: &Path, locked: &[String]) -> Vec<String> {
    let language = Language::of_path(path);
    let mut said = Vec::new();
    let mut say = |text: String| said.push(format!("{}: {text}", path.display()));
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
                "this language has no words for all rotors, springs and friction of {names}; write .xml (MJCF), which has"
            ));
        }
    }
    let text = source.and_then(|source| rigident_files::read_text(source).ok());
    if text.is_some_and(|text| Language::of_text(&text) == language) {
        // The rest of it is kept.
        return said;
    }
    say("holds links, joints, inertias and what its language says of friction; shapes, limits and whatever else the model's file may have are left out".to_owned());
    if !locked.is_empty() {
        say(format!("joints that were locked are fixed in it: {}", locked.join(", ")));
    }
    if language == Some(Language::Urdf) {
        if let Some(names) = joints(&|l| l.link.joint == Joint::Spherical) {
            say(format!(
                "type=\"spherical\" of {names} is an extension of URDF that urdfdom, and with it ROS, refuses; write .xml (MJCF) or \
                 .sdf, which have such joints"
            ));
        }
        if let Some(names) = joints(&|l| matches!(l.link.joint, Joint::Universal(..))) {
            say(format!(
                "URDF has no universal joint: {names} became two joints each, with a link without mass between"
            ));
        }
    } else if let Some(names) = joints(&|l| l.mimic.is_some()) {
        say(format!("that {names} follow other joints is left out"));
    }
    if language == Some(Language::Sdf) {
        let renamed = joint_names(model);
        let pairs = model.links.iter().zip(&renamed).skip(1).filter(|(l, name)| l.joint_name != **name);
        let pairs: Vec<String> = pairs.map(|(l, name)| format!("{} is {name}", l.joint_name)).collect();
        if !pairs.is_empty() {
            say(format!("no joint can have the name of a link there: {}", pairs.join(", ")));
        }
    }
    said
}

/// Names of the joints where no two elements may have one: joints that are named as a link have `_joint` after it.
pub(super) fn joint_names(model: &Model) -> Vec<String> {
    let mut taken: BTreeSet<String> = model.links.iter().map(|link| link.name.clone()).collect();
    let free = |link: &ModelLink| {
        let mut name = link.joint_name.clone();
        while !taken.insert(name.clone()) {
            name += "_joint";
        }
        name
    };
    model.links.iter().map(free).collect()
}

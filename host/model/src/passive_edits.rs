//! Friction, rotors and springs of joints written into a file that is retained.

use std::mem::discriminant;

use roxmltree::{Document, Node};

use super::mjcf::names::Names;
use super::passive::Passive;
use super::transmission;
use super::tree::Model;
use super::xml::{Edit, Language, before_end, child, replace_child, set_attribute};

/// A joint's axis of which a model says something else than a file.
pub(super) struct Changed<'a> {
    /// The joint's name.
    joint: &'a str,
    /// 0, or 1 for the second axis of a universal joint.
    axis: usize,
    /// The model's.
    new: Passive,
    /// The file's.
    old: Passive,
}

/// Returns the axes of which a model says something else than `file`, what a file says of it. Joints that are
/// of another kind there, as those that were locked, are left out: of them the file is left as it is.
pub(super) fn changed<'a>(model: &'a Model, file: &Model, language: Language) -> Vec<Changed<'a>> {
    let mut found = Vec::new();
    for link in model.links.iter().skip(1) {
        let Some(own) = file.joint(&link.joint_name).map(|i| &file.links[i]) else { continue };
        if discriminant(&own.link.joint) != discriminant(&link.link.joint) {
            continue;
        }
        for (axis, (new, old)) in link.passive.iter().zip(&own.passive).enumerate() {
            let [new, old] = [new, old].map(|passive| passive.said_in(language, &link.link.joint));
            if !new.is_same_as(&old) {
                found.push(Changed { joint: &link.joint_name, axis, new, old });
            }
        }
    }
    found
}

/// Returns the edits that make a file say what the model does of its joints; all else of them stays. `file`
/// is what the text says.
pub(super) fn edits(
    model: &Model,
    file: &Model,
    text: &str,
    (document, names): (&Document, &Names),
    language: Language,
) -> Vec<Edit> {
    let mut out = Vec::new();
    let all = changed(model, file, language);
    let turned = || all.iter().filter(|change| change.new.armature != change.old.armature);
    match language {
        Language::Urdf => {
            let rotors: Vec<(&str, f64)> =
                turned().map(|change| (change.joint, change.new.armature)).collect();
            out.extend(transmission::edits(&rotors, text, document));
        }
        Language::Sdf if turned().next().is_some() => out.extend(transmission::declaration(text, document)),
        Language::Sdf | Language::Mjcf => {}
    }
    for change in all {
        let Some(joint) = joint(document, names, change.joint, language) else { continue };
        match language {
            Language::Urdf => dynamics_of_urdf(&change, text, &joint, &mut out),
            Language::Mjcf => {
                let named = change.new.named().into_iter().zip(change.old.named());
                // The place of a spring may be in degrees there.
                let differing = named.filter(|((name, new), (_, old))| new != old && *name != "springref");
                out.extend(differing.map(|((name, new), _)| set_attribute(text, &joint, name, new)));
            }
            Language::Sdf => {
                let axis = child(&joint, if change.axis == 0 { "axis" } else { "axis2" });
                if let Some(axis) = axis {
                    dynamics_of_sdf(&change, text, &axis, &mut out);
                }
                rotor_of_sdf(&change, text, &joint, &mut out);
            }
        }
    }
    out
}

/// Finds a joint's element by the name that it has in the model.
fn joint<'a, 'i>(
    document: &'a Document<'i>,
    names: &Names,
    name: &str,
    language: Language,
) -> Option<Node<'a, 'i>> {
    let is_it = |node: &Node| {
        node.has_tag_name("joint")
            && match language {
                Language::Mjcf => names.name(node) == Some(name),
                _ => node.attribute("name") == Some(name) && child(node, "child").is_some(),
            }
    };
    document.descendants().find(is_it)
}

fn dynamics_of_urdf(change: &Changed, text: &str, joint: &Node, out: &mut Vec<Edit>) {
    let Passive { damping, friction, .. } = change.new;
    if [damping, friction] == [change.old.damping, change.old.friction] {
        return;
    }
    match child(joint, "dynamics") {
        Some(dynamics) => {
            let both =
                [("damping", damping, change.old.damping), ("friction", friction, change.old.friction)];
            let differing = both.into_iter().filter(|(_, new, old)| new != old);
            out.extend(differing.map(|(name, new, _)| set_attribute(text, &dynamics, name, new)));
        }
        None => {
            let new = format!("<dynamics damping=\"{damping}\" friction=\"{friction}\"/>");
            out.push(replace_child(text, joint, "dynamics", new));
        }
    }
}

fn dynamics_of_sdf(change: &Changed, text: &str, axis: &Node, out: &mut Vec<Edit>) {
    let names = ["damping", "friction", "spring_reference", "spring_stiffness"];
    let numbers = |p: &Passive| [p.damping, p.friction, p.spring_reference, p.stiffness];
    if numbers(&change.new) == numbers(&change.old) {
        return;
    }
    let stated = names
        .iter()
        .zip(numbers(&change.new))
        .map(|(name, value)| (*name, format!("<{name}>{value}</{name}>")));
    match child(axis, "dynamics") {
        Some(dynamics) => {
            let differing = stated
                .zip(numbers(&change.new))
                .zip(numbers(&change.old))
                .filter(|((_, new), old)| new != old);
            let parts: Vec<(&str, String)> = differing.map(|((part, _), _)| part).collect();
            // Those that are not there yet go in as one.
            let (there, missing): (Vec<_>, Vec<_>) =
                parts.into_iter().partition(|(name, _)| child(&dynamics, name).is_some());
            out.extend(there.into_iter().map(|(name, new)| replace_child(text, &dynamics, name, new)));
            let missing: String = missing.into_iter().map(|(_, new)| new).collect();
            if !missing.is_empty() {
                out.push(replace_child(text, &dynamics, "", missing));
            }
        }
        None => {
            let all: String = stated.map(|(_, new)| new).collect();
            out.push(replace_child(text, axis, "dynamics", format!("<dynamics>{all}</dynamics>")));
        }
    }
}

fn rotor_of_sdf(change: &Changed, text: &str, joint: &Node, out: &mut Vec<Edit>) {
    if change.new.armature == change.old.armature {
        return;
    }
    let new = transmission::rotor_at_joint(joint, change.new.armature);
    out.push(match child(joint, "rotor_inertia") {
        Some(_) => replace_child(text, joint, "rotor_inertia", new),
        None => before_end(text, joint, new),
    });
}

//! Rotor inertia in URDF and SDF, in the words of Drake, which neither language has of its own.
//!
//! A joint feels `gear_ratio² · rotor_inertia`: in URDF of the actuator of its `<transmission>`, in SDF of
//! the `<joint>` itself (Drake, "Drake extensions to SDFormat and URDF", tags `drake:rotor_inertia` and
//! `drake:gear_ratio`).

use std::collections::BTreeMap;

use roxmltree::{Document, Node};

use super::xml::{
    Edit, before_end, child, describe, escaped, exactly, insert_attribute, parse, replace_child,
    set_attribute,
};

/// The namespace of these words.
const NAMESPACE: &str = "http://drake.mit.edu";
/// The text that declares it in a first tag.
pub(super) const DECLARED: &str = " xmlns:drake=\"http://drake.mit.edu\"";

/// Returns the actuator and the joint's name of every transmission of one joint and one actuator.
fn simple<'a, 'i>(robot: &Node<'a, 'i>) -> impl Iterator<Item = (&'a str, Node<'a, 'i>)> {
    let transmissions = robot.children().filter(|n| n.has_tag_name("transmission"));
    transmissions.filter_map(|transmission| {
        let only = |tag: &str| {
            let mut all = transmission.children().filter(|n| n.has_tag_name(tag));
            all.next().filter(|_| all.next().is_none())
        };
        Some((only("joint")?.attribute("name")?, only("actuator")?))
    })
}

/// Returns a number of an actuator, `<drake:NAME value="…"/>`.
fn number(actuator: &Node, name: &str) -> Option<f64> {
    child(actuator, name)?.attribute("value")?.trim().parse().ok().filter(|v: &f64| v.is_finite())
}

fn gear_ratio(actuator: &Node) -> f64 {
    number(actuator, "gear_ratio").filter(|ratio| *ratio != 0.0).unwrap_or(1.0)
}

/// Returns the rotor inertia that joints feel, kg m² or kg, by their names, as transmissions of a URDF state
/// it.
pub(super) fn rotors<'a>(robot: &Node<'a, '_>) -> BTreeMap<&'a str, f64> {
    let own = |(joint, actuator): (&'a str, Node)| {
        Some((joint, number(&actuator, "rotor_inertia")? * gear_ratio(&actuator).powi(2)))
    };
    simple(robot).filter_map(own).collect()
}

/// Returns the transmission of a joint that feels a rotor.
pub(super) fn written(joint: &str, armature: f64) -> String {
    let joint = escaped(joint);
    format!(
        "<transmission \
         name=\"{joint}_transmission\"><type>transmission_interface/SimpleTransmission</type><joint \
         name=\"{joint}\"/><actuator name=\"{joint}_actuator\"><drake:gear_ratio \
         value=\"1\"/><drake:rotor_inertia value=\"{armature}\"/></actuator></transmission>"
    )
}

/// Returns what a joint of an SDF says of its rotor; empty where there is none.
pub(super) fn of_joint(armature: f64) -> String {
    if armature == 0.0 {
        return String::new();
    }
    format!("<drake:gear_ratio>1</drake:gear_ratio><drake:rotor_inertia>{armature}</drake:rotor_inertia>")
}

/// Returns a number of a joint of an SDF, `<drake:NAME>…</drake:NAME>`.
fn number_of_joint(joint: &Node, name: &str) -> Result<Option<f64>, String> {
    let Some(text) = child(joint, name).and_then(|n| n.text()) else { return Ok(None) };
    let what = format!("<{name}> of {}", describe(joint));
    Ok(Some(exactly::<1>(parse(text, &what)?, &what)?[0]))
}

/// Returns the rotor inertia that a joint of an SDF feels, kg m² or kg; zero where none is stated.
///
/// # Errors
/// The text that is no number.
pub(super) fn rotor_of_joint(joint: &Node) -> Result<f64, String> {
    let ratio = number_of_joint(joint, "gear_ratio")?.filter(|ratio| *ratio != 0.0).unwrap_or(1.0);
    Ok(number_of_joint(joint, "rotor_inertia")?.unwrap_or(0.0) * ratio.powi(2))
}

/// Returns the element of a joint that keeps its gear ratio, so that the joint feels this rotor.
pub(super) fn rotor_at_joint(joint: &Node, armature: f64) -> String {
    let ratio = number_of_joint(joint, "gear_ratio").ok().flatten().filter(|ratio| *ratio != 0.0);
    format!("<drake:rotor_inertia>{}</drake:rotor_inertia>", armature / ratio.unwrap_or(1.0).powi(2))
}

/// Returns the edits that make a URDF say these rotors of its joints; a transmission that is there keeps its
/// gear ratio.
pub(super) fn edits(rotors: &[(&str, f64)], text: &str, document: &Document) -> Vec<Edit> {
    let robot = document.root_element();
    let mut out = Vec::new();
    let mut new = String::new();
    for (joint, armature) in rotors {
        let Some((_, actuator)) = simple(&robot).find(|(name, _)| name == joint) else {
            new += &format!("  {}\n", written(joint, *armature));
            continue;
        };
        let inertia = armature / gear_ratio(&actuator).powi(2);
        out.push(match child(&actuator, "rotor_inertia") {
            Some(element) => set_attribute(text, &element, "value", inertia),
            None => replace_child(text, &actuator, "", format!("<drake:rotor_inertia value=\"{inertia}\"/>")),
        });
    }
    if !new.is_empty() {
        out.push(before_end(text, &robot, new));
    }
    if !out.is_empty() {
        out.extend(declaration(text, document));
    }
    out
}

/// Returns the edit that declares the namespace in the first tag, where it is not declared.
pub(super) fn declaration(text: &str, document: &Document) -> Option<Edit> {
    let root = document.root_element();
    let is_declared = root.lookup_namespace_uri(Some("drake")).is_some();
    (!is_declared).then(|| insert_attribute(text, &root, "xmlns:drake", NAMESPACE))
}

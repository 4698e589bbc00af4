//! The statements of an MJCF that change forces and are not followed here: each is named.

use roxmltree::Node;

use super::masses::shortened;
use super::names::Names;
use crate::finding::Finding;
use crate::finding::NOT_USED;
use crate::xml::line;

/// The passive forces of tendons.
const OF_TENDONS: [&str; 4] = ["stiffness", "damping", "frictionloss", "armature"];

/// The elements of actuators that default classes may have.
const ACTUATORS: [&str; 9] =
    ["general", "motor", "position", "velocity", "intvelocity", "damper", "cylinder", "muscle", "adhesion"];

fn finding(place: &str, text: String) -> Finding {
    Finding { place: place.to_owned(), text }
}

/// Returns whether a text holds a number that is not zero.
fn is_some(text: &str) -> bool {
    text.split_whitespace().any(|word| word.parse().is_ok_and(|value: f64| value != 0.0))
}

/// Returns what is not followed of a file.
pub(super) fn unused(root: &Node, names: &Names) -> Vec<Finding> {
    let mut found = of_options(root);
    found.extend(of_equalities(root));
    found.extend(of_tendons(root));
    found.extend(of_actuators(root));
    found.extend(of_free_joints(root, names));
    found.extend(of_bodies(root, names));
    found
}

fn of_options(root: &Node) -> Vec<Finding> {
    let mut found = Vec::new();
    for option in root.children().filter(|n| n.has_tag_name("option")) {
        for name in ["density", "viscosity"] {
            if option.attribute(name).is_some_and(is_some) {
                let text = format!("{NOT_USED}{name}: forces of the medium on the bodies are not counted");
                found.push(finding("option", text));
            }
        }
        for flag in option.children().filter(|n| n.has_tag_name("flag")) {
            for name in ["passive", "spring", "damper", "frictionloss"] {
                if flag.attribute(name) == Some("disable") {
                    let text = format!(
                        "{NOT_USED}{name} = \"disable\": springs, damping and friction of joints count as \
                         stated"
                    );
                    found.push(finding("option", text));
                }
            }
        }
    }
    found
}

fn of_equalities(root: &Node) -> Vec<Finding> {
    let mut found = Vec::new();
    let equalities = root.children().filter(|n| n.has_tag_name("equality")).flat_map(|n| n.children());
    for own in equalities.filter(Node::is_element) {
        let tag = own.tag_name().name();
        let ends = ["body1", "body2", "site1", "site2", "joint1", "joint2", "tendon1", "tendon2"];
        let ends: Vec<&str> = ends.iter().filter_map(|end| own.attribute(*end)).collect();
        let text = match tag {
            "connect" | "weld" => format!(
                "closes a loop ({tag} in line {}), which is not followed: the tree without it is taken, and \
                 forces through it are taken for the tree's",
                line(&own)
            ),
            _ => format!(
                "couples what it names ({tag} in line {}), which is not followed: each moves by itself, and \
                 forces through it are taken for the tree's",
                line(&own)
            ),
        };
        found.push(finding(&format!("equality of {}", ends.join(" and ")), text));
    }
    found
}

fn of_tendons(root: &Node) -> Vec<Finding> {
    let mut found = Vec::new();
    let of_class = root.descendants().filter(|n| n.has_tag_name("tendon"));
    let tendons = of_class.clone().flat_map(|n| n.children()).chain(of_class).filter(Node::is_element);
    for tendon in tendons {
        let stated: Vec<&str> =
            OF_TENDONS.into_iter().filter(|name| tendon.attribute(*name).is_some_and(is_some)).collect();
        if !stated.is_empty() {
            let place = format!("tendon {}", tendon.attribute("name").unwrap_or_default());
            let text = format!("{NOT_USED}{}: tendons are not followed", stated.join(", "));
            found.push(finding(place.trim_end(), text));
        }
    }
    found
}

/// Returns the rotors and dampers that actuators, or their classes, add to what they drive.
fn of_actuators(root: &Node) -> Vec<Finding> {
    let all = root.descendants().filter(|n| n.has_tag_name("actuator")).flat_map(|n| n.children());
    let of_classes = root.descendants().filter(|n| n.has_tag_name("default")).flat_map(|n| n.children());
    let of_classes = of_classes.filter(|n| ACTUATORS.iter().any(|tag| n.has_tag_name(*tag)));
    let mut found = Vec::new();
    for own in all.filter(Node::is_element).chain(of_classes) {
        let is_stated = |name: &&str| own.attribute(*name).is_some_and(is_some);
        let stated: Vec<&str> = ["armature", "damping"].into_iter().filter(is_stated).collect();
        if !stated.is_empty() {
            let name = own.attribute("name").or(own.attribute("joint")).unwrap_or_default();
            let place = format!("actuator {name}");
            let text = format!(
                "{NOT_USED}{} (line {}): write it to the joint that it drives",
                stated.join(", "),
                line(&own)
            );
            found.push(finding(place.trim_end(), text));
        }
    }
    found
}

/// Returns the bodies whose frame MuJoCo moves to their centre of mass.
fn of_free_joints(root: &Node, names: &Names) -> Vec<Finding> {
    let compilers = root.children().filter(|n| n.has_tag_name("compiler"));
    let all = compilers.filter_map(|n| n.attribute("alignfree")).next_back() == Some("true");
    let mut found = Vec::new();
    for joint in root.descendants().filter(|n| n.has_tag_name("freejoint")) {
        let is_moved = joint.attribute("align").map_or(all, |word| word == "true" || (word == "auto" && all));
        let body = joint.ancestors().find(|n| n.has_tag_name("body"));
        let Some(body) = body.filter(|body| is_moved && !body.children().any(|n| n.has_tag_name("body")))
        else {
            continue;
        };
        let text = "MuJoCo moves its frame to its centre of mass and turns it to its principal axes (align); \
                    here it is where the file has it";
        found.push(finding(&format!("body {}", names.name(&body).unwrap_or_default()), text.to_owned()));
    }
    found
}

fn of_bodies(root: &Node, names: &Names) -> Vec<Finding> {
    let mut found = Vec::new();
    let mut lifted = Vec::new();
    for world in root.children().filter(|n| n.has_tag_name("worldbody")) {
        for node in world.descendants() {
            let name = || names.name(&node).unwrap_or_default().to_owned();
            if node.has_tag_name("body") && node.attribute("gravcomp").is_some_and(is_some) {
                lifted.push(format!(
                    "{} ({})",
                    name(),
                    node.attribute("gravcomp").unwrap_or_default().trim()
                ));
            }
            if ["composite", "flexcomp"].iter().any(|tag| node.has_tag_name(*tag)) {
                let text = format!(
                    "<{}> in line {} is left out: the bodies that it makes are not followed",
                    node.tag_name().name(),
                    line(&node)
                );
                found.push(finding("worldbody", text));
            }
        }
    }
    if !lifted.is_empty() {
        let text = format!(
            "{NOT_USED}gravcomp: MuJoCo carries that share of the weight of {}, and efforts predicted from \
             this model hold all of it",
            shortened(&lifted)
        );
        found.push(finding("gravcomp", text));
    }
    found
}

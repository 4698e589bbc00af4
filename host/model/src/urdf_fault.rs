//! The parts that a URDF must have before it is read, and where it has not.

use roxmltree::Node;

use super::xml::{child, line, parsed};

const TYPES: [&str; 7] = ["revolute", "continuous", "prismatic", "fixed", "floating", "planar", "spherical"];

/// Finds the first fault of a `<robot>`, with its line and what it belongs to.
///
/// Elements that no one reads, such as textures and materials, may be as they like.
pub(super) fn fault(robot: &Node) -> Option<String> {
    let named = robot.children().filter(|n| n.has_tag_name("link") || n.has_tag_name("joint"));
    for owner in named {
        let tag = owner.tag_name().name();
        let Some(name) = owner.attribute("name") else {
            return Some(format!(
                "line {}: {} has no name; every one needs one of its own",
                line(&owner),
                whose(&owner)
            ));
        };
        let found = if tag == "joint" { joint(&owner) } else { None };
        let placed = |node: &Node| {
            let above = node.parent_element().map(|above| above.tag_name().name());
            tag == "joint" || above == Some("inertial")
        };
        let found =
            found.or_else(|| owner.descendants().filter(|n| n.is_element() && placed(n)).find_map(element));
        if let Some((at, why)) = found {
            return Some(format!("line {}, {tag} {name}: {why}", line(&at)));
        }
    }
    None
}

/// Returns whether a text that can be read as a URDF still holds elements of xacro.
pub(super) fn has_macro_elements(text: &str) -> bool {
    let of_xacro = |n: Node| n.tag_name().namespace().is_some_and(|name| name.contains("xacro"));
    text.contains("<xacro:") && parsed(text).map_or(true, |document| document.descendants().any(of_xacro))
}

/// Describes a nameless link or joint by its other attributes.
fn whose(owner: &Node) -> String {
    let tag = owner.tag_name().name();
    match child(owner, "child").and_then(|c| c.attribute("link")) {
        Some(link) => format!("the {tag} that holds link {link}"),
        None => format!("a {tag}"),
    }
}

type Fault<'a, 'i> = (Node<'a, 'i>, String);

fn joint<'a, 'i>(joint: &Node<'a, 'i>) -> Option<Fault<'a, 'i>> {
    match joint.attribute("type") {
        None => return Some((*joint, "it has no type".to_owned())),
        Some(kind) if !TYPES.contains(&kind) => {
            return Some((*joint, format!("its type is {kind:?}; there are {}", TYPES.join(", "))));
        }
        Some(_) => {}
    }
    ["parent", "child"].iter().find_map(|tag| match child(joint, tag) {
        None => Some((*joint, format!("it has no <{tag} link=…/>"))),
        Some(end) => end.attribute("link").is_none().then(|| (end, format!("<{tag}> has no link"))),
    })
}

/// Attributes of an element that are numbers each, or three of them. Shapes, materials and inertias may be as
/// they like: of what no one reads nothing is wrong, and of an inertia the reader tells.
fn element<'a, 'i>(node: Node<'a, 'i>) -> Option<Fault<'a, 'i>> {
    let (needed, optional, count): (&[&str], &[&str], usize) = match node.tag_name().name() {
        "limit" => (&[], &["lower", "upper", "effort", "velocity"], 1),
        "mimic" => (&[], &["multiplier", "offset"], 1),
        "dynamics" => (&[], &["damping", "friction"], 1),
        "origin" => (&[], &["xyz", "rpy"], 3),
        "axis" => (&["xyz"], &[], 3),
        _ => return None,
    };
    let all = needed.iter().map(|a| (a, true)).chain(optional.iter().map(|a| (a, false)));
    all.filter_map(|(attribute, must)| numbers(&node, attribute, must, count)).next().map(|why| (node, why))
}

/// Returns the line and the reason if an `<inertial>` is not complete: then a link has the mass that is
/// there, and zero for each number that is not.
pub(super) fn incomplete(inertial: &Node) -> Option<(u32, String)> {
    let found = |tag: &str, attributes: &[&str]| {
        let Some(node) = child(inertial, tag) else {
            return Some((*inertial, format!("<inertial> has no <{tag}>")));
        };
        attributes.iter().find_map(|attribute| numbers(&node, attribute, true, 1)).map(|why| (node, why))
    };
    let fault =
        found("mass", &["value"]).or_else(|| found("inertia", &["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]));
    fault.map(|(node, why)| (line(&node), why))
}

fn numbers(node: &Node, attribute: &str, must: bool, count: usize) -> Option<String> {
    let tag = node.tag_name().name();
    let Some(text) = node.attribute(attribute) else {
        return must.then(|| format!("<{tag}> has no {attribute}"));
    };
    let words: Vec<&str> = text.split_whitespace().collect();
    let are = words.iter().all(|word| word.parse::<f64>().is_ok());
    let what = if count == 1 { "a number" } else { "three numbers with blanks between them" };
    (!are || words.len() != count).then(|| format!("{attribute} of <{tag}> is {text:?} and not {what}"))
}

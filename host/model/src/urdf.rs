//! Models from URDF.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use rigident_files::MOST_OF_TEXT;
use rigident_shared::inertia::InertialParameters;
use rigident_shared::printable;
use rigident_shared::spatial::{Body, Position};
use rigident_shared::tree::{Joint, Link};
use roxmltree::Node;

use super::finding::{Finding, ModelError};
use super::inertial::{Parameters, in_parent};
use super::limits::Limits;
use super::loose_xml::{spaced, tidied};
use super::passive::Passive;
use super::transmission;
use super::tree::{Mimic, Model, ModelLink, NO_BODY, RawLink};
use super::urdf_fault::{fault, has_macro_elements, incomplete};
use super::xml::{self, Language, child, of_rpy};

/// Reads a file.
///
/// # Errors
/// [`ModelError`] that says what is wrong and where.
pub fn read(path: &Path) -> Result<Model, ModelError> {
    parse(&text_of(path)?, &path.display().to_string())
}

/// Returns the text of a file; one that is not UTF-8 is taken for Latin-1.
pub(super) fn text_of(path: &Path) -> Result<String, ModelError> {
    let bytes = rigident_files::read(path, MOST_OF_TEXT)
        .map_err(|source| ModelError::Read { path: path.to_owned(), source })?;
    let text = String::from_utf8(bytes)
        .unwrap_or_else(|other| other.into_bytes().into_iter().map(char::from).collect());
    Ok(spaced(text))
}

/// Returns the advice for a file with macros.
fn expand(what: &str) -> String {
    format!("it holds macros, which are not followed: expand them first (`xacro {what} > robot.urdf`)")
}

/// Reads the text of a URDF; `what` names it in complaints.
///
/// # Errors
/// [`ModelError`] that says what is wrong and where.
pub fn parse(text: &str, what: &str) -> Result<Model, ModelError> {
    let refuse = |problem: String| ModelError::Structure { what: what.to_owned(), problem };
    let syntax = |reason: String| ModelError::Syntax { what: what.to_owned(), reason };
    if has_macro_elements(text) {
        return Err(refuse(expand(what)));
    }
    let tidy = tidied(text);
    let document = xml::parsed(&tidy).map_err(|error| {
        let hint = if text.contains("<robot") { "" } else { "; it has no <robot> element" };
        syntax(format!("{error}{hint}"))
    })?;
    xml::check_depth(&document).map_err(syntax)?;
    let robot = document.root_element();
    if !robot.has_tag_name("robot") {
        return Err(syntax("it has no <robot> element".to_owned()));
    }
    if let Some(fault) = fault(&robot) {
        return Err(syntax(if text.contains("${") { expand(what) } else { fault }));
    }
    let links: Vec<Node> = robot.children().filter(|n| n.has_tag_name("link")).collect();
    if links.is_empty() {
        return Err(refuse("there is no link in it".to_owned()));
    }
    let is_incomplete = |link: &Node| child(link, "inertial").is_some_and(|i| incomplete(&i).is_some());
    if text.contains("${") && links.iter().any(is_incomplete) {
        return Err(refuse(expand(what)));
    }
    let mut findings = Vec::new();
    let held = joints(&robot, &links, &mut findings).map_err(&refuse)?;
    let leaders: BTreeSet<&str> = held.values().map(|joint| name(joint)).collect();
    let rotors = transmission::rotors(&robot);
    let mut raw = Vec::new();
    for link in &links {
        raw.extend(raw_links(link, held.get(name(link)), &leaders, &rotors, &mut findings));
    }
    let mut model = Model::assemble(what, raw, findings)?;
    if !name(&robot).is_empty() {
        model.name = printable::name(name(&robot)).to_string();
    }
    Ok(model)
}

/// Returns the joints by the links that they hold; each link is there and held by one joint at most.
fn joints<'a, 'i>(
    robot: &Node<'a, 'i>,
    links: &[Node],
    findings: &mut Vec<Finding>,
) -> Result<BTreeMap<&'a str, Node<'a, 'i>>, String> {
    let names: BTreeSet<&str> = links.iter().map(name).collect();
    let mut held: BTreeMap<&str, Node> = BTreeMap::new();
    for joint in robot.children().filter(|n| n.has_tag_name("joint")) {
        let link = end(&joint, "child");
        if let Some(other) = held.insert(link, joint) {
            return Err(format!(
                "joints {} and {} both hold link {link}: the model has a loop; only trees can be identified, \
                 cut it at one of them",
                name(&other),
                name(&joint),
            ));
        }
        if !names.contains(link) {
            return Err(format!("joint {} holds link {link}, which is not there", name(&joint)));
        }
        let moves_to_limits = matches!(joint.attribute("type"), Some("revolute" | "prismatic"));
        let Some(limit) = child(&joint, "limit").filter(|_| moves_to_limits) else { continue };
        let [lower, upper, effort, velocity] = ["lower", "upper", "effort", "velocity"]
            .map(|attribute| number(&limit, attribute).unwrap_or(0.0));
        // A <limit> of zeros alone limits nothing.
        if lower == upper && [lower, effort, velocity] != [0.0; 3] {
            findings.push(Finding {
                place: format!("joint {}", name(&joint)),
                text: format!(
                    "never moves by its limits ({lower} to {lower}): counted as a joint that does; if it \
                     does not, say `lock` {}",
                    name(&joint)
                ),
            });
        }
    }
    Ok(held)
}

/// Reads a link and the joint that holds it, if one does; before it are the links that are no bodies, if its
/// joint becomes several.
fn raw_links(
    link: &Node,
    joint: Option<&Node>,
    leaders: &BTreeSet<&str>,
    rotors: &BTreeMap<&str, f64>,
    findings: &mut Vec<Finding>,
) -> Vec<RawLink> {
    let free =
        Link { parent: 0, joint: Joint::Free, rotation: Matrix3::identity(), position: Vector3::zeros() };
    let base = ModelLink::new(name(link).to_owned(), String::new(), free, nominal(link, findings));
    let Some(joint) = joint else { return vec![RawLink { link: base, parent: None }] };
    let (rotation, position) = place(joint);
    let axis = child(joint, "axis").and_then(|axis| three(&axis, "xyz")).map_or(Vector3::x(), Vector3::from);
    let parent = end(joint, "parent");
    let (mut before, mut at) = (Vec::new(), Link { parent: 0, joint: Joint::Free, rotation, position });
    let mut holder = parent.to_owned();
    at.joint = match joint.attribute("type") {
        Some("revolute" | "continuous") => Joint::Revolute(axis),
        Some("prismatic") => Joint::Prismatic(axis),
        Some("fixed") => Joint::Fixed,
        Some("spherical") => Joint::Spherical,
        Some("planar") => {
            let slides = [slide_in_plane(&axis), axis.cross(&slide_in_plane(&axis))];
            for (k, slide) in slides.into_iter().enumerate() {
                let [own, joint] = [name(link), name(joint)].map(|name| format!("{name}#{}", k + 1));
                let place = Link { joint: Joint::Prismatic(slide), ..at };
                let between = ModelLink::new(own.clone(), joint, place, Some(NO_BODY));
                before.push(RawLink { link: between, parent: Some(std::mem::replace(&mut holder, own)) });
                (at.rotation, at.position) = (Matrix3::identity(), Vector3::zeros());
            }
            findings.push(Finding {
                place: format!("joint {}", name(joint)),
                text: format!(
                    "is planar: taken as two slides, {0}#1 and {0}#2, across its axis and {0}, a hinge about \
                     it",
                    name(joint)
                ),
            });
            Joint::Revolute(axis)
        }
        _ => Joint::Free,
    };
    let link = ModelLink {
        joint_name: name(joint).to_owned(),
        link: at,
        mimic: mimic(joint, &at.joint, leaders, findings),
        passive: [passive(joint, &at.joint, rotors), Passive::default()],
        limits: limits(joint),
        ..base
    };
    before.push(RawLink { link, parent: Some(holder) });
    before
}

/// Returns the first direction in which a planar joint slides: x, or y if the axis is x.
fn slide_in_plane(axis: &Vector3<f64>) -> Vector3<f64> {
    let [x, y] = [Vector3::x(), Vector3::y()];
    let across = x - axis * (axis.dot(&x) / axis.norm_squared());
    if across.norm() > 0.5 {
        across.normalize()
    } else {
        (y - axis * (axis.dot(&y) / axis.norm_squared())).normalize()
    }
}

/// Returns the joint that a joint follows. What does not move follows nothing.
fn mimic(
    joint: &Node,
    kind: &Joint<f64>,
    leaders: &BTreeSet<&str>,
    findings: &mut Vec<Finding>,
) -> Option<Mimic> {
    let mimic = child(joint, "mimic").filter(|_| *kind != Joint::Fixed)?;
    let leader = mimic.attribute("joint").unwrap_or_default();
    if !leaders.contains(leader) {
        findings.push(Finding {
            place: format!("joint {}", name(joint)),
            text: format!("mimics {leader}, which is not there: counted as a joint that moves by itself"),
        });
        return None;
    }
    Some(Mimic {
        leader: leader.to_owned(),
        multiplier: number(&mimic, "multiplier").unwrap_or(1.0),
        offset: number(&mimic, "offset").unwrap_or(0.0),
    })
}

/// Returns the limits of a joint; a continuous one has none of position.
fn limits(joint: &Node) -> Limits {
    let Some(limit) = child(joint, "limit") else { return Limits::default() };
    let [lower, upper, velocity, effort] =
        ["lower", "upper", "velocity", "effort"].map(|attribute| number(&limit, attribute).unwrap_or(0.0));
    let moves_to_limits = matches!(joint.attribute("type"), Some("revolute" | "prismatic"));
    let (lower, upper) = if moves_to_limits { (lower, upper) } else { (0.0, 0.0) };
    Limits::of(lower, upper, velocity, effort)
}

/// Returns the friction and the rotor of a joint that has any.
fn passive(joint: &Node, kind: &Joint<f64>, rotors: &BTreeMap<&str, f64>) -> Passive {
    if matches!(kind, Joint::Fixed | Joint::Free) {
        return Passive::default();
    }
    let dynamics = child(joint, "dynamics");
    let [damping, friction] = ["damping", "friction"]
        .map(|attribute| dynamics.and_then(|dynamics| number(&dynamics, attribute)).unwrap_or(0.0));
    let armature = rotors.get(name(joint)).copied().unwrap_or(0.0);
    Passive { armature, damping, friction, ..Passive::default() }.said_in(Language::Urdf, kind)
}

fn name<'a>(node: &Node<'a, '_>) -> &'a str {
    node.attribute("name").unwrap_or_default()
}

/// Returns the link at one end of a joint.
fn end<'a>(joint: &Node<'a, '_>, tag: &str) -> &'a str {
    child(joint, tag).and_then(|end| end.attribute("link")).unwrap_or_default()
}

/// Returns a number, if it is one.
fn number(node: &Node, attribute: &str) -> Option<f64> {
    node.attribute(attribute)?.trim().parse().ok()
}

/// Returns three numbers that [`fault`] has checked.
pub(super) fn three(node: &Node, attribute: &str) -> Option<[f64; 3]> {
    let words = node.attribute(attribute)?.split_whitespace();
    words.map(|word| word.parse().ok()).collect::<Option<Vec<f64>>>()?.try_into().ok()
}

/// Returns the rotation and the position, m, of an element's `<origin>`.
pub(super) fn place(node: &Node) -> (Matrix3<f64>, Vector3<f64>) {
    let Some(origin) = child(node, "origin") else { return (Matrix3::identity(), Vector3::zeros()) };
    let [rpy, xyz] = ["rpy", "xyz"].map(|attribute| three(&origin, attribute).unwrap_or_default());
    // Fixed axes: Rz(yaw) Ry(pitch) Rx(roll).
    (of_rpy(rpy), Vector3::from(xyz))
}

/// Returns a link's parameters about its origin in its axes; `None` if there is no mass and no inertia.
fn nominal(link: &Node, findings: &mut Vec<Finding>) -> Option<Parameters> {
    let inertial = child(link, "inertial")?;
    if let Some((line, why)) = incomplete(&inertial) {
        let rest = if child(&inertial, "mass").and_then(|mass| number(&mass, "value")).is_some() {
            "what is missing of its inertia counts as zero"
        } else {
            "counted as a link without mass"
        };
        let place = format!("link {}", name(link));
        findings.push(Finding { place, text: format!("line {line}: {why}; {rest}") });
    }
    let mass = number(&child(&inertial, "mass")?, "value")?;
    let inertia = child(&inertial, "inertia");
    let [xx, xy, xz, yy, yz, zz] = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]
        .map(|attribute| inertia.and_then(|inertia| number(&inertia, attribute)).unwrap_or(0.0));
    let tensor = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    if mass == 0.0 && tensor.iter().all(|v| *v == 0.0) {
        return None;
    }
    let (rotation, position) = place(&inertial);
    let about_com =
        InertialParameters::<Body, f64>::from_centre_of_mass(mass, Position::zero(), tensor).to_vector();
    Some(in_parent(&about_com, &rotation, &position))
}

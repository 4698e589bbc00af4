//! Models from SDF, the language of Gazebo: one model's links, joints and inertias, those of models within it
//! ([`nested`]) included.

pub(super) mod generated;
mod nested;
#[cfg(test)]
mod tests;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::{Body, Position};
use rigident_shared::tree::{Joint, Link};
use roxmltree::Node;

use super::finding::{Finding, ModelError};
use super::inertial::{Parameters, in_parent};
use super::loose_xml::tidied;
use super::mjcf::WORLD;
use super::passive::Passive;
use super::transmission;
use super::tree::{Model, ModelLink, NO_BODY, Parsed, RawLink};
use super::xml::{self, Language, describe, exactly, of_quaternion, of_rpy};

type Pose = (Matrix3<f64>, Vector3<f64>);

/// Neither turned nor moved.
const STILL: Pose = (Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), Vector3::new(0.0, 0.0, 0.0));

fn inverse(a: &Pose) -> Pose {
    (a.0.transpose(), -(a.0.transpose() * a.1))
}

fn then(a: &Pose, b: &Pose) -> Pose {
    (a.0 * b.0, a.1 + a.0 * b.1)
}

/// Reads the text of an SDF; `what` names it in complaints. Files that it includes are refused: [`parse_in`]
/// reads them.
///
/// # Errors
/// [`ModelError`] that says what is wrong and where.
pub fn parse(text: &str, what: &str) -> Result<Parsed, ModelError> {
    parse_in(text, what, None)
}

/// Returns the text of an SDF with the models that are in others, or in files that it includes, taken into
/// one; as it is if there are none.
///
/// # Errors
/// [`ModelError`] that says which of them cannot be followed.
pub(super) fn written_out<'a>(
    text: &'a str,
    what: &str,
    folder: Option<&Path>,
) -> Result<Cow<'a, str>, ModelError> {
    let refuse = |problem: String| ModelError::Structure { what: what.to_owned(), problem };
    let flat = |text: &str| -> Result<Option<String>, ModelError> {
        nested::flat(&xml::document(text, what)?, folder).map_err(refuse)
    };
    Ok(match tidied(text) {
        Cow::Borrowed(text) => flat(text)?.map_or(Cow::Borrowed(text), Cow::Owned),
        Cow::Owned(tidy) => Cow::Owned(flat(&tidy)?.unwrap_or(tidy)),
    })
}

/// Reads the text of an SDF; `what` names it in complaints, and files that it includes are searched for in
/// `folder`.
///
/// # Errors
/// [`ModelError`] that says what is wrong and where.
pub fn parse_in(text: &str, what: &str, folder: Option<&Path>) -> Result<Parsed, ModelError> {
    let refuse = |problem: String| ModelError::Structure { what: what.to_owned(), problem };
    let whole = written_out(text, what, folder)?;
    let document = xml::document(&whole, what)?;
    let root = document.root_element();
    let worlds = root.children().filter(|n| n.has_tag_name("world"));
    let of = |n: Node<'_, '_>| n.has_tag_name("model");
    let models: Vec<Node> =
        std::iter::once(root).chain(worlds).flat_map(|n| n.children()).filter(|n| of(*n)).collect();
    let (model, left_out) = robot(&models).map_err(refuse)?;
    let mut parsed = read(&model, &root, what).map_err(|problem| match problem {
        Problem::Text(problem) => refuse(problem),
        Problem::Model(error) => error,
    })?;
    if !left_out.is_empty() {
        let text = format!("{} left out: nothing moves in them", left_out.join(", "));
        parsed.model.findings.push(Finding { place: "models beside the robot".to_owned(), text });
    }
    Ok(parsed)
}

/// Returns the model that is the robot, and the names of those beside it, in which nothing moves.
fn robot<'a, 'i>(models: &[Node<'a, 'i>]) -> Result<(Node<'a, 'i>, Vec<String>), String> {
    if let [one] = models {
        return Ok((*one, Vec::new()));
    }
    let moves = |model: &Node| {
        let mut joints = model.children().filter(|n| n.has_tag_name("joint"));
        joints.any(|joint| joint.attribute("type") != Some("fixed"))
    };
    let name = |model: &Node| model.attribute("name").unwrap_or_default().to_owned();
    let (moving, still): (Vec<Node>, Vec<Node>) = models.iter().copied().partition(moves);
    match moving.as_slice() {
        _ if models.is_empty() => Err("there is no <model> in it".to_owned()),
        [one] => Ok((*one, still.iter().map(name).collect())),
        several => Err(format!(
            "there are {} models with joints in it side by side ({}): give one of them alone",
            several.len(),
            several.iter().map(name).collect::<Vec<_>>().join(", ")
        )),
    }
}

enum Problem {
    Text(String),
    Model(ModelError),
}

impl From<String> for Problem {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

fn text_of<'a>(node: &Node<'a, '_>, name: &str) -> Option<&'a str> {
    xml::child(node, name)?.text().map(str::trim)
}

fn required<'a>(node: &Node<'a, '_>, name: &str) -> Result<&'a str, String> {
    text_of(node, name).filter(|t| !t.is_empty()).ok_or_else(|| format!("{} has no <{name}>", describe(node)))
}

/// Returns a pose element's own numbers.
fn pose(node: &Node) -> Result<Pose, String> {
    let Some(element) = xml::child(node, "pose") else { return Ok(STILL) };
    let what = format!("<pose> of {}", describe(node));
    let values = xml::parse(element.text().unwrap_or_default(), &what)?;
    if values.is_empty() {
        return Ok(STILL);
    }
    if element.attribute("rotation_format") == Some("quat_xyzw") {
        let [px, py, pz, x, y, z, w] = exactly::<7>(values, &what)?;
        return Ok((of_quaternion([w, x, y, z]), Vector3::new(px, py, pz)));
    }
    let [px, py, pz, r, p, y] = exactly::<6>(values, &what)?;
    let scale = if element.attribute("degrees") == Some("true") { 1.0_f64.to_radians() } else { 1.0 };
    Ok((of_rpy([r * scale, p * scale, y * scale]), Vector3::new(px, py, pz)))
}

/// Poses of all named things in the model's frame.
struct Frames<'a, 'i> {
    nodes: BTreeMap<&'a str, Node<'a, 'i>>,
    /// The model's own in the world.
    placed: Pose,
}

impl<'a, 'i> Frames<'a, 'i> {
    fn of(model: &Node<'a, 'i>) -> Result<Self, String> {
        let mut nodes = BTreeMap::new();
        for node in model.children().filter(|n| ["link", "joint", "frame"].iter().any(|t| n.has_tag_name(*t)))
        {
            let name = node.attribute("name").filter(|n| !n.trim().is_empty()).ok_or_else(|| {
                let held =
                    text_of(&node, "child").map_or_else(String::new, |link| format!(", which holds {link},"));
                format!("{}{held} has no name; every one needs one of its own", describe(&node))
            })?;
            if let Some(other) = nodes.insert(name, node) {
                return Err(format!(
                    "a {} and a {} are both named {name} (lines {} and {}): in SDF every link, joint and \
                     frame needs a name of its own",
                    other.tag_name().name(),
                    node.tag_name().name(),
                    xml::line(&other),
                    xml::line(&node)
                ));
            }
        }
        let mut frames = Self { nodes, placed: STILL };
        frames.placed = frames.of_model(model)?;
        Ok(frames)
    }

    /// Returns the pose of the model in the world.
    fn of_model(&self, model: &Node) -> Result<Pose, String> {
        let stated = pose(model)?;
        let relative = xml::child(model, "pose").and_then(|p| p.attribute("relative_to")).unwrap_or_default();
        if !["", WORLD, "__model__"].contains(&relative) {
            return Err(format!(
                "the pose of {} is relative to {relative}, a frame of the world, which is not followed here: \
                 state it in the world",
                describe(model)
            ));
        }
        let frame = model.attribute("placement_frame").unwrap_or_default();
        Ok(then(&stated, &inverse(&self.pose(frame, 0)?)))
    }

    fn pose(&self, name: &str, depth: usize) -> Result<Pose, String> {
        if name == "__model__" || name.is_empty() {
            return Ok(STILL);
        }
        if name == WORLD {
            return Ok(inverse(&self.placed));
        }
        if depth > self.nodes.len() {
            return Err(format!("the pose of {name} is relative to itself in the end"));
        }
        let node = self
            .nodes
            .get(name)
            .ok_or_else(|| format!("a pose is relative to {name}, which is not there"))?;
        let stated =
            xml::child(node, "pose").and_then(|p| p.attribute("relative_to")).filter(|n| !n.is_empty());
        let otherwise = match node.tag_name().name() {
            "joint" => text_of(node, "child").unwrap_or("__model__"),
            "frame" => node.attribute("attached_to").unwrap_or("__model__"),
            _ => "__model__",
        };
        let before = self.pose(stated.unwrap_or(otherwise), depth + 1)?;
        Ok(then(&before, &pose(node)?))
    }

    /// Returns the link that a link or frame of this name is fixed to, by way of other frames; `world` is its
    /// own.
    fn link(&self, name: &'a str, canonical: Option<&'a str>) -> Result<&'a str, String> {
        let mut at = name;
        for _ in 0..=self.nodes.len() {
            if at == "__model__" || at.is_empty() {
                at = canonical.unwrap_or_default();
            }
            if at == WORLD {
                return Ok(at);
            }
            let Some(node) = self.nodes.get(at) else {
                let by =
                    if at == name { String::new() } else { format!(", which frame {name} is attached to,") };
                return Err(format!("{at}{by} is not there"));
            };
            at = match node.tag_name().name() {
                "frame" => node.attribute("attached_to").unwrap_or("__model__"),
                "joint" => text_of(node, "child").unwrap_or("__model__"),
                _ => return Ok(at),
            };
        }
        Err(format!("frame {name} is attached to itself in the end"))
    }
}

/// Returns the gravity that the world of a file states, m/s².
fn gravity(root: &Node) -> Result<Option<[f64; 3]>, String> {
    let world = xml::child(root, "world");
    let Some(text) = world.and_then(|world| text_of(&world, "gravity")) else { return Ok(None) };
    Ok(Some(exactly::<3>(xml::parse(text, "<gravity>")?, "<gravity>")?))
}

/// Returns whether axes of joints are in the model's frame where the file does not say: before version 1.5 of
/// the language.
fn has_model_axes(root: &Node) -> bool {
    let numbers =
        root.attribute("version").unwrap_or_default().split('.').map(|word| word.trim().parse::<u32>());
    let numbers: Vec<u32> = numbers.map_while(Result::ok).collect();
    matches!(numbers.as_slice(), [1, minor, ..] if *minor < 5) || matches!(numbers.first(), Some(0))
}

fn read(model: &Node, root: &Node, what: &str) -> Result<Parsed, Problem> {
    let frames = Frames::of(model)?;
    let links: Vec<Node> = model.children().filter(|n| n.has_tag_name("link")).collect();
    if links.is_empty() {
        return Err(Problem::Text("there is no link in it".to_owned()));
    }
    let canonical = model.attribute("canonical_link").or(links.first().and_then(|l| l.attribute("name")));
    let model_axes = has_model_axes(root);
    let mut findings = Vec::new();
    // Joint that holds each link.
    let mut held: BTreeMap<&str, Node> = BTreeMap::new();
    let mut on_world = false;
    for joint in model.children().filter(|n| n.has_tag_name("joint")) {
        let child = frames
            .link(required(&joint, "child")?, canonical)
            .map_err(|why| format!("{} holds link {why}", describe(&joint)))?;
        on_world |= parent_of(&joint, &frames, canonical)? == WORLD;
        if let Some(other) = held.insert(child, joint) {
            return Err(Problem::Text(format!(
                "{} and {} both hold link {child}: the model has a loop; only trees can be identified, cut \
                 it at one of them",
                describe(&other),
                describe(&joint)
            )));
        }
    }
    // Where a link's frame has its origin: at its joint.
    let joint_pose = |name: &str| -> Result<Pose, String> {
        match held.get(name).and_then(|j| j.attribute("name")) {
            Some(joint) => frames.pose(joint, 0),
            None => frames.pose(name, 0),
        }
    };
    let mut anchors = BTreeMap::new();
    let mut raw = Vec::new();
    // Before version 1.8 a link may be named so: it is the one that joints hold on to.
    let is_world = |link: &Node| link.attribute("name") == Some(WORLD) && xml::child(link, "pose").is_none();
    if on_world && !links.iter().any(is_world) {
        raw.push(RawLink { link: bare(WORLD, "", Joint::Free, STILL), parent: None });
    }
    for link in &links {
        let name = link.attribute("name").unwrap_or_default();
        let own = frames.pose(name, 0)?;
        let at = joint_pose(name)?;
        let anchor = own.0.transpose() * (at.1 - own.1);
        let (parent, kind, joint_name, place) = match held.get(name) {
            None => (None, Joint::Free, "", STILL),
            Some(joint) => {
                let parent = parent_of(joint, &frames, canonical)?;
                let world = frames.pose(WORLD, 0)?;
                let (turned, origin) =
                    if parent == WORLD { world } else { (frames.pose(parent, 0)?.0, joint_pose(parent)?.1) };
                let place = (turned.transpose() * own.0, turned.transpose() * (at.1 - origin));
                let kind = kind(joint, &frames, &at, &own, model_axes)?;
                (Some(parent), kind, joint.attribute("name").unwrap_or_default(), place)
            }
        };
        let anchor = if parent.is_none() { Vector3::zeros() } else { anchor };
        if anchor.norm() > 0.0 {
            anchors.insert(name.to_owned(), anchor);
        }
        let mut new = bare(name, joint_name, kind, place);
        if let Some(joint) = held.get(name) {
            new.passive = [passive(joint, "axis", &kind)?, passive(joint, "axis2", &kind)?];
        }
        new.nominal = inertial(link, &mut findings)?
            .filter(|phi| *phi != NO_BODY)
            .map(|phi| in_parent(&phi, &Matrix3::identity(), &-anchor));
        raw.push(RawLink { link: new, parent: parent.map(str::to_owned) });
    }
    findings.extend(tilted_base(&raw, &frames)?);
    let mut out = Model::assemble(what, raw, findings).map_err(Problem::Model)?;
    out.gravity_mps2 = gravity(root)?;
    if let Some(name) = model.attribute("name") {
        name.clone_into(&mut out.name);
    }
    Ok(Parsed { model: out, anchors })
}

/// Names a base that stands tilted in the world and that nothing holds there: its axes need not stay so.
fn tilted_base(raw: &[RawLink], frames: &Frames) -> Result<Option<Finding>, String> {
    let Some(base) = raw.iter().find(|link| link.parent.is_none()) else { return Ok(None) };
    let name = &base.link.name;
    let up = (frames.placed.0 * frames.pose(name, 0)?.0).transpose() * Vector3::z();
    let angle = (up - Vector3::z()).norm();
    Ok((name != WORLD && angle > 1e-6).then(|| Finding {
        place: format!("link {name}"),
        text:
            "it is the base, it stands tilted in the world, and no joint holds it there: without an IMU on \
               it gravity is taken along its own z axis, not the world's; if it is mounted so, state a fixed \
               joint to the world"
                .to_owned(),
    }))
}

fn bare(name: &str, joint_name: &str, joint: Joint<f64>, (rotation, position): Pose) -> ModelLink {
    ModelLink::new(name, joint_name, Link { parent: 0, joint, rotation, position }, None)
}

/// Returns the link that a joint hangs on.
fn parent_of<'a>(
    joint: &Node<'a, '_>,
    frames: &Frames<'a, '_>,
    canonical: Option<&'a str>,
) -> Result<&'a str, String> {
    let parent = frames.link(required(joint, "parent")?, canonical);
    parent.map_err(|why| format!("{} hangs on {why}", describe(joint)))
}

fn kind(
    joint: &Node,
    frames: &Frames,
    at: &Pose,
    own: &Pose,
    model_axes: bool,
) -> Result<Joint<f64>, String> {
    let axis = |element: &str| -> Result<Vector3<f64>, String> {
        let node =
            xml::child(joint, element).ok_or_else(|| format!("{} has no <{element}>", describe(joint)))?;
        let xyz = xml::child(&node, "xyz");
        let what = format!("<xyz> of {}", describe(joint));
        let text = xyz.and_then(|n| n.text()).unwrap_or("0 0 1");
        let values = Vector3::from(exactly::<3>(xml::parse(text, &what)?, &what)?);
        let old = text_of(&node, "use_parent_model_frame").map_or(model_axes, |t| t == "true" || t == "1");
        let from = match xyz.and_then(|n| n.attribute("expressed_in")).filter(|n| !n.is_empty()) {
            Some(frame) => frames.pose(frame, 0)?.0,
            None if old => Matrix3::identity(),
            None => at.0,
        };
        Ok(own.0.transpose() * (from * values))
    };
    Ok(match joint.attribute("type").unwrap_or_default() {
        "fixed" => Joint::Fixed,
        "revolute" | "continuous" => Joint::Revolute(axis("axis")?),
        "prismatic" => Joint::Prismatic(axis("axis")?),
        "ball" => Joint::Spherical,
        "universal" => Joint::Universal(axis("axis")?, axis("axis2")?),
        other => {
            return Err(format!(
                "{} is of type {other:?}, which is not known here: fixed, revolute, continuous, prismatic, \
                 ball and universal are",
                describe(joint)
            ));
        }
    })
}

/// Reads what a joint does by itself about one of its axes.
fn passive(joint: &Node, element: &str, kind: &Joint<f64>) -> Result<Passive, String> {
    let has_axis = match kind {
        Joint::Revolute(_) | Joint::Prismatic(_) => element == "axis",
        Joint::Universal(..) => true,
        _ => false,
    };
    let Some(axis) = xml::child(joint, element).filter(|_| has_axis) else { return Ok(Passive::default()) };
    let dynamics = xml::child(&axis, "dynamics");
    let one = |name: &str| -> Result<f64, String> {
        let what = format!("<{name}> of {}", describe(joint));
        let Some(text) = dynamics.and_then(|node| text_of(&node, name)) else { return Ok(0.0) };
        Ok(exactly::<1>(xml::parse(text, &what)?, &what)?[0])
    };
    let stated = Passive {
        armature: if element == "axis" { transmission::rotor_of_joint(joint)? } else { 0.0 },
        damping: one("damping")?,
        friction: one("friction")?,
        stiffness: one("spring_stiffness")?,
        spring_reference: one("spring_reference")?,
    };
    Ok(stated.said_in(Language::Sdf, kind))
}

/// Returns the inertia about the link's own origin. Without the element SDF has a kilogram of unit moments;
/// here that is unknown.
fn inertial(link: &Node, findings: &mut Vec<Finding>) -> Result<Option<Parameters>, String> {
    let Some(node) = xml::child(link, "inertial") else { return Ok(None) };
    if node.attribute("auto").is_some_and(|word| word == "true" || word == "1") {
        findings.push(Finding {
            place: format!("link {}", link.attribute("name").unwrap_or_default()),
            text:
                "its inertia is to be made of its collisions (auto = \"true\"), which is not done here: it \
                   counts as unknown; state <mass> and <inertia> (`gz sdf -p FILE` prints them by its option \
                   expand-auto-inertials)"
                    .to_owned(),
        });
        return Ok(None);
    }
    let what = format!("<inertial> of {}", describe(link));
    let one = |parent: &Node, name: &str, otherwise: f64| -> Result<f64, String> {
        match text_of(parent, name) {
            None => Ok(otherwise),
            Some(text) => Ok(exactly::<1>(xml::parse(text, &format!("<{name}> of {what}"))?, &what)?[0]),
        }
    };
    let mass = one(&node, "mass", 1.0)?;
    let tensor = match xml::child(&node, "inertia") {
        None => Matrix3::identity(),
        Some(i) => {
            let (xx, yy, zz) = (one(&i, "ixx", 1.0)?, one(&i, "iyy", 1.0)?, one(&i, "izz", 1.0)?);
            let (xy, xz, yz) = (one(&i, "ixy", 0.0)?, one(&i, "ixz", 0.0)?, one(&i, "iyz", 0.0)?);
            Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
        }
    };
    if mass == 0.0 && tensor == Matrix3::zeros() {
        return Ok(None);
    }
    let (rotation, position) = pose(&node)?;
    let body = InertialParameters::<Body, f64>::from_centre_of_mass(mass, Position::zero(), tensor);
    Ok(Some(in_parent(&body.to_vector(), &rotation, &position)))
}

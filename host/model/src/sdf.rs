//! Models from SDF, the language of Gazebo: one model's links, joints and inertias.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::{Body, Position};
use rigident_shared::tree::{Joint, Link};
use roxmltree::Node;

use super::finding::ModelError;
use super::inertial::{Parameters, in_parent};
use super::mjcf::WORLD;
use super::passive::Passive;
use super::tree::{Model, ModelLink, NO_BODY, Parsed, RawLink};
use super::xml::{self, describe, exactly, of_quaternion, of_rpy};

type Pose = (Matrix3<f64>, Vector3<f64>);

fn then(a: &Pose, b: &Pose) -> Pose {
    (a.0 * b.0, a.1 + a.0 * b.1)
}

/// Reads the text of an SDF; `what` names it in complaints.
///
/// # Errors
/// [`ModelError`] that says what is wrong and where.
pub fn parse(text: &str, what: &str) -> Result<Parsed, ModelError> {
    let document = xml::document(text, what)?;
    let refuse = |problem: String| ModelError::Structure { what: what.to_owned(), problem };
    let models: Vec<Node> = document.descendants().filter(|n| n.has_tag_name("model")).collect();
    let model = match models.as_slice() {
        [one] => *one,
        [] => return Err(refuse("there is no <model> in it".to_owned())),
        several => {
            return Err(refuse(format!(
                "there are {} models in it, one in another or side by side: give one model without others",
                several.len()
            )));
        }
    };
    if model.children().any(|n| n.has_tag_name("include")) {
        return Err(refuse("<include> is not followed: give one file with everything in it".to_owned()));
    }
    read(&model, what).map_err(|problem| match problem {
        Problem::Text(problem) => refuse(problem),
        Problem::Model(error) => error,
    })
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

/// A pose element's own numbers.
fn pose(node: &Node) -> Result<Pose, String> {
    let Some(element) = xml::child(node, "pose") else { return Ok((Matrix3::identity(), Vector3::zeros())) };
    let what = format!("<pose> of {}", describe(node));
    let values = xml::parse(element.text().unwrap_or_default(), &what)?;
    if values.is_empty() {
        return Ok((Matrix3::identity(), Vector3::zeros()));
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
                    "a {} and a {} are both named {name} (lines {} and {}): in SDF every link, joint and frame needs a name of \
                     its own",
                    other.tag_name().name(),
                    node.tag_name().name(),
                    xml::line(&other),
                    xml::line(&node)
                ));
            }
        }
        Ok(Self { nodes })
    }

    fn pose(&self, name: &str, depth: usize) -> Result<Pose, String> {
        if name == "__model__" || name == WORLD || name.is_empty() {
            return Ok((Matrix3::identity(), Vector3::zeros()));
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
}

fn read(model: &Node, what: &str) -> Result<Parsed, Problem> {
    let frames = Frames::of(model)?;
    let links: Vec<Node> = model.children().filter(|n| n.has_tag_name("link")).collect();
    if links.is_empty() {
        return Err(Problem::Text("there is no link in it".to_owned()));
    }
    // Joint that holds each link.
    let mut held: BTreeMap<&str, Node> = BTreeMap::new();
    let mut on_world = false;
    for joint in model.children().filter(|n| n.has_tag_name("joint")) {
        let child = required(&joint, "child")?;
        on_world |= required(&joint, "parent")? == WORLD;
        if !links.iter().any(|l| l.attribute("name") == Some(child)) {
            return Err(Problem::Text(format!(
                "{} holds link {child}, which is not there",
                describe(&joint)
            )));
        }
        if let Some(other) = held.insert(child, joint) {
            return Err(Problem::Text(format!(
                "{} and {} both hold link {child}: the model has a loop; only trees can be identified, cut it at one of them",
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
    let still = (Matrix3::identity(), Vector3::zeros());
    if on_world {
        raw.push(RawLink { link: bare(WORLD, "", Joint::Free, still), parent: None });
    }
    for link in &links {
        let name = link.attribute("name").unwrap_or_default();
        let own = frames.pose(name, 0)?;
        let at = joint_pose(name)?;
        let anchor = own.0.transpose() * (at.1 - own.1);
        let (parent, kind, joint_name, place) = match held.get(name) {
            None => (None, Joint::Free, "", still),
            Some(joint) => {
                let parent = required(joint, "parent")?;
                let (turned, origin) =
                    if parent == WORLD { still } else { (frames.pose(parent, 0)?.0, joint_pose(parent)?.1) };
                let place = (turned.transpose() * own.0, turned.transpose() * (at.1 - origin));
                let kind = kind(joint, &frames, &at, &own)?;
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
        new.nominal = inertial(link)?
            .filter(|phi| *phi != NO_BODY)
            .map(|phi| in_parent(&phi, &Matrix3::identity(), &-anchor));
        raw.push(RawLink { link: new, parent: parent.map(str::to_owned) });
    }
    let mut out = Model::assemble(what, raw, Vec::new()).map_err(Problem::Model)?;
    if let Some(name) = model.attribute("name") {
        name.clone_into(&mut out.name);
    }
    Ok(Parsed { model: out, anchors })
}

fn bare(name: &str, joint_name: &str, joint: Joint<f64>, (rotation, position): Pose) -> ModelLink {
    ModelLink::new(name, joint_name, Link { parent: 0, joint, rotation, position }, None)
}

fn kind(joint: &Node, frames: &Frames, at: &Pose, own: &Pose) -> Result<Joint<f64>, String> {
    let axis = |element: &str| -> Result<Vector3<f64>, String> {
        let node =
            xml::child(joint, element).ok_or_else(|| format!("{} has no <{element}>", describe(joint)))?;
        let xyz = xml::child(&node, "xyz");
        let what = format!("<xyz> of {}", describe(joint));
        let text = xyz.and_then(|n| n.text()).unwrap_or("0 0 1");
        let values = Vector3::from(exactly::<3>(xml::parse(text, &what)?, &what)?);
        let old = text_of(&node, "use_parent_model_frame").is_some_and(|t| t == "true" || t == "1");
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
                "{} is of type {other:?}, which is not known here: fixed, revolute, continuous, prismatic, ball and universal \
                 are",
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
    let Some(node) =
        xml::child(joint, element).filter(|_| has_axis).and_then(|axis| xml::child(&axis, "dynamics"))
    else {
        return Ok(Passive::default());
    };
    let one = |name: &str| -> Result<f64, String> {
        let what = format!("<{name}> of {}", describe(joint));
        text_of(&node, name).map_or(Ok(0.0), |text| Ok(exactly::<1>(xml::parse(text, &what)?, &what)?[0]))
    };
    Ok(Passive {
        armature: 0.0,
        damping: one("damping")?,
        friction: one("friction")?,
        stiffness: one("spring_stiffness")?,
        spring_reference: one("spring_reference")?,
    })
}

/// About the link's own origin. Without the element SDF has a kilogram of unit moments; here that is unknown.
fn inertial(link: &Node) -> Result<Option<Parameters>, String> {
    let Some(node) = xml::child(link, "inertial") else { return Ok(None) };
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

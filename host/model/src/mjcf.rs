//! Models from MJCF, the language of MuJoCo: bodies, joints and inertias; whatever else a file has is left alone.
//!
//! A body of several joints becomes a chain of links, `BODY#1`, `BODY#2`, …, `BODY`, of which only the last is a body.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::printable;
use rigident_shared::spatial::{Body, Position};
use rigident_shared::tree::{Joint, Link};
use roxmltree::Node;

use super::finding::{Finding, ModelError};
use super::inertial::{Parameters, in_parent};
use super::limits::Limits;
use super::passive::Passive;
use super::tree::{Model, ModelLink, NO_BODY, Parsed, RawLink};
use super::xml::{self, Language, describe, exactly, numbers, of_quaternion};

/// Name of the base where bodies hang on the world.
pub(super) const WORLD: &str = "world";

/// Begins what is told of attributes that are read and written, and say nothing of links.
pub(super) const NOT_USED: &str = "the answer does not use what the file states of its ";

struct Reader<'a> {
    degrees: bool,
    order: String,
    /// Joint attributes of the default classes, those of the classes they are in included.
    classes: BTreeMap<&'a str, BTreeMap<&'a str, &'a str>>,
    raw: Vec<RawLink>,
    anchors: BTreeMap<String, Vector3<f64>>,
    findings: Vec<Finding>,
}

/// Reads the text of an MJCF; `what` names it in complaints.
///
/// # Errors
/// [`ModelError`] that says what is wrong and where.
pub fn parse(text: &str, what: &str) -> Result<Parsed, ModelError> {
    let document = xml::document(text, what)?;
    let root = document.root_element();
    let refuse = |problem: String| ModelError::Structure { what: what.to_owned(), problem };
    if let Some(include) = root.descendants().find(|n| {
        ["include", "attach", "replicate", "frame", "composite", "flexcomp"]
            .iter()
            .any(|t| n.has_tag_name(*t))
    }) {
        return Err(refuse(format!(
            "{} is not followed: have MuJoCo write the compiled model (mj_saveLastXML) and give that",
            describe(&include)
        )));
    }
    let compilers: Vec<Node> = root.children().filter(|n| n.has_tag_name("compiler")).collect();
    let setting = |name: &str| compilers.iter().rev().find_map(|c| c.attribute(name));
    let mut reader = Reader {
        degrees: setting("angle") != Some("radian"),
        order: setting("eulerseq").unwrap_or("xyz").to_owned(),
        classes: BTreeMap::new(),
        raw: Vec::new(),
        anchors: BTreeMap::new(),
        findings: Vec::new(),
    };
    if setting("coordinate") == Some("global") {
        return Err(refuse(
            "coordinate = \"global\" is of an old MuJoCo: have it write the compiled model".to_owned(),
        ));
    }
    if setting("inertiafromgeom") == Some("true") {
        reader.find(
            "compiler",
            "inertiafromgeom = \"true\": MuJoCo takes inertias from geoms and not from <inertial>",
        );
    }
    for defaults in root.children().filter(|n| n.has_tag_name("default")) {
        reader.defaults(defaults, &BTreeMap::new());
    }
    let equalities = root.children().filter(|n| n.has_tag_name("equality")).flat_map(|n| n.children());
    for loops in equalities.filter(|n| n.has_tag_name("connect") || n.has_tag_name("weld")) {
        let ends = ["body1", "body2", "site1", "site2"].iter().filter_map(|end| loops.attribute(*end));
        let ends: Vec<&str> = ends.collect();
        let text = format!(
            "closes a loop ({} in line {}), which is not followed: the tree without it is taken, and forces through it are \
             taken for the tree's",
            loops.tag_name().name(),
            xml::line(&loops)
        );
        reader.find(&format!("equality of {}", ends.join(" and ")), &text);
    }
    let world =
        xml::child(&root, "worldbody").ok_or_else(|| refuse("there is no <worldbody> in it".to_owned()))?;
    let bodies: Vec<Node> = world.children().filter(|n| n.has_tag_name("body")).collect();
    let floats = |body: &Node| {
        body.children().any(|n| {
            n.has_tag_name("freejoint")
                || (n.has_tag_name("joint") && reader.joint_word(&n, "type", &[]) == Some("free"))
        })
    };
    let own_base = matches!(bodies.as_slice(), [one] if floats(one));
    if !own_base {
        reader.raw.push(raw(WORLD, "", None, Joint::Free, Matrix3::identity(), Vector3::zeros()));
    }
    for body in bodies {
        reader.body(body, (!own_base).then_some(WORLD), Vector3::zeros(), &[]).map_err(refuse)?;
    }
    let mut model = Model::assemble(what, reader.raw, reader.findings)?;
    if let Some(name) = root.attribute("model") {
        model.name = printable::name(name).to_string();
    }
    Ok(Parsed { model, anchors: reader.anchors })
}

fn raw(
    name: &str,
    joint_name: &str,
    parent: Option<&str>,
    joint: Joint<f64>,
    rotation: Matrix3<f64>,
    position: Vector3<f64>,
) -> RawLink {
    RawLink {
        link: ModelLink::new(name, joint_name, Link { parent: 0, joint, rotation, position }, None),
        parent: parent.map(str::to_owned),
    }
}

/// Returns the name of a body's joint: its own, or one made of the body's.
pub(super) fn joint_name(joint: &Node) -> Option<String> {
    if let Some(name) = joint.attribute("name") {
        return Some(name.to_owned());
    }
    let body = joint.parent_element()?;
    let name = body.attribute("name")?;
    let joints: Vec<Node> = body.children().filter(|n| n.has_tag_name("joint")).collect();
    let k = joints.iter().position(|other| other == joint)?;
    Some(if joints.len() == 1 { format!("{name}_joint") } else { format!("{name}_joint{}", k + 1) })
}

impl<'a> Reader<'a> {
    fn find(&mut self, place: &str, text: &str) {
        self.findings.push(Finding { place: place.to_owned(), text: text.to_owned() });
    }

    fn defaults(&mut self, node: Node<'a, '_>, outer: &BTreeMap<&'a str, &'a str>) {
        let mut own = outer.clone();
        if let Some(joint) = xml::child(&node, "joint") {
            own.extend(joint.attributes().map(|a| (a.name(), a.value())));
        }
        self.classes.insert(node.attribute("class").unwrap_or("main"), own.clone());
        for inner in node.children().filter(|n| n.has_tag_name("default")) {
            self.defaults(inner, &own);
        }
    }

    /// An attribute of a joint: its own, or of its class, the innermost `childclass`, or the main default.
    fn joint_word<'b>(&'b self, joint: &Node<'b, '_>, name: &str, classes: &[&str]) -> Option<&'b str> {
        let class = joint.attribute("class").or(classes.last().copied()).unwrap_or("main");
        joint.attribute(name).or_else(|| self.classes.get(class)?.get(name).copied())
    }

    fn rotation(&self, node: &Node) -> Result<Matrix3<f64>, String> {
        let what = describe(node);
        let angle = |v: f64| if self.degrees { v.to_radians() } else { v };
        if let Some(q) = numbers(node, "quat")? {
            let q = exactly::<4>(q, &format!("quat of {what}"))?;
            if q.iter().all(|v| *v == 0.0) {
                return Err(format!("quat of {what} is zero"));
            }
            return Ok(of_quaternion(q));
        }
        if let Some(v) = numbers(node, "euler")? {
            let v = exactly::<3>(v, &format!("euler of {what}"))?;
            let mut out = Matrix3::identity();
            for (letter, value) in self.order.chars().zip(v) {
                let axis = match letter.to_ascii_lowercase() {
                    'x' => Vector3::x_axis(),
                    'y' => Vector3::y_axis(),
                    _ => Vector3::z_axis(),
                };
                let turn = Rotation3::from_axis_angle(&axis, angle(value)).into_inner();
                // Small letters turn with the body, capitals about fixed axes.
                out = if letter.is_ascii_lowercase() { out * turn } else { turn * out };
            }
            return Ok(out);
        }
        if let Some(v) = numbers(node, "axisangle")? {
            let [x, y, z, a] = exactly::<4>(v, &format!("axisangle of {what}"))?;
            let axis = Vector3::new(x, y, z);
            return Ok(Rotation3::from_axis_angle(&Unit::new_normalize(axis), angle(a)).into_inner());
        }
        if let Some(v) = numbers(node, "xyaxes")? {
            let v = exactly::<6>(v, &format!("xyaxes of {what}"))?;
            let x = Vector3::new(v[0], v[1], v[2]).normalize();
            let y = Vector3::new(v[3], v[4], v[5]);
            let y = (y - x * x.dot(&y)).normalize();
            return Ok(Matrix3::from_columns(&[x, y, x.cross(&y)]));
        }
        if let Some(v) = numbers(node, "zaxis")? {
            let z = Vector3::from(exactly::<3>(v, &format!("zaxis of {what}"))?);
            let turn = Rotation3::rotation_between(&Vector3::z(), &z);
            return Ok(turn.map_or_else(
                || Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI).into_inner(),
                Rotation3::into_inner,
            ));
        }
        Ok(Matrix3::identity())
    }

    fn vector(node: &Node, attribute: &str) -> Result<Option<Vector3<f64>>, String> {
        let values = numbers(node, attribute)?;
        let what = format!("{attribute} of {}", describe(node));
        values.map(|v| exactly::<3>(v, &what).map(Vector3::from)).transpose()
    }

    /// A body and those in it. `shift`: where the parent's link frame has its origin in the parent body's.
    fn body(
        &mut self,
        node: Node<'a, '_>,
        parent: Option<&str>,
        shift: Vector3<f64>,
        classes: &[&'a str],
    ) -> Result<(), String> {
        let name = node.attribute("name").ok_or_else(|| {
            let on = parent.map_or_else(String::new, |parent| format!(" (on {parent})"));
            format!("{}{on} has no name; every body needs one of its own", describe(&node))
        })?;
        let mut classes = classes.to_vec();
        classes.extend(node.attribute("childclass"));
        let place = Self::vector(&node, "pos")?.unwrap_or_else(Vector3::zeros) - shift;
        let rotation = self.rotation(&node)?;
        let joints: Vec<Node> = node.children().filter(|n| n.has_tag_name("joint")).collect();
        let free = node.children().any(|n| n.has_tag_name("freejoint"));
        let mut links = Vec::new();
        for joint in &joints {
            let own = |attribute: &str| self.joint_word(joint, attribute, &classes);
            let triple = |attribute: &str, otherwise: Vector3<f64>| -> Result<Vector3<f64>, String> {
                let what = format!("{attribute} of {}", describe(joint));
                match own(attribute) {
                    None => Ok(otherwise),
                    Some(text) => Ok(Vector3::from(exactly::<3>(xml::parse(text, &what)?, &what)?)),
                }
            };
            let axis = triple("axis", Vector3::z())?;
            let anchor = triple("pos", Vector3::zeros())?;
            let kind = match own("type").unwrap_or("hinge") {
                "hinge" => Joint::Revolute(axis),
                "slide" => Joint::Prismatic(axis),
                "ball" => Joint::Spherical,
                "free" => Joint::Free,
                other => return Err(format!("joint type {other:?} of {} is not known", describe(joint))),
            };
            let joint_name = joint_name(joint).unwrap_or_default();
            let (passive, unread) = self.passive(joint, &classes, &kind)?;
            self.tell_passive(&joint_name, &passive, &unread);
            let own = |attribute: &str| self.joint_word(joint, attribute, &classes);
            if own("ref").is_some_and(|text| text.trim().parse() != Ok(0.0)) {
                self.findings.push(Finding {
                    place: format!("joint {joint_name}"),
                    text: "its ref is not zero, which is not followed: positions here count from the model's zero".to_owned(),
                });
            }
            let limits = self.limits(joint, &classes, &kind);
            links.push((joint_name, kind, anchor, passive, limits));
        }
        if free || (links.is_empty() && parent.is_none()) {
            links.push((
                format!("{name}_joint"),
                if free { Joint::Free } else { Joint::Fixed },
                Vector3::zeros(),
                Passive::default(),
                Limits::default(),
            ));
        } else if links.is_empty() {
            let (passive, limits) = (Passive::default(), Limits::default());
            links.push((format!("{name}_fixed"), Joint::Fixed, Vector3::zeros(), passive, limits));
        }
        let (mut at, mut before) = (parent.map(str::to_owned), place);
        let mut turned = rotation;
        let mut anchor = Vector3::zeros();
        let last = links.len() - 1;
        for (k, (joint_name, kind, own_anchor, passive, limits)) in links.into_iter().enumerate() {
            let link_name = if k == last { name.to_owned() } else { format!("{name}#{}", k + 1) };
            let position = before + turned * own_anchor;
            let joint_name = if at.is_none() { "" } else { joint_name.as_str() };
            let mut link = raw(&link_name, joint_name, at.as_deref(), kind, turned, position);
            link.link.nominal = (k != last).then_some(NO_BODY);
            if at.is_some() {
                link.link.passive[0] = passive;
                link.link.limits = limits;
            }
            self.raw.push(link);
            (at, before, turned, anchor) = (Some(link_name), -own_anchor, Matrix3::identity(), own_anchor);
        }
        if at.is_some() && parent.is_none() {
            // A base's own frame is its body's.
            anchor = Vector3::zeros();
        }
        if anchor != Vector3::zeros() {
            self.anchors.insert(name.to_owned(), anchor);
        }
        let nominal = self.inertial(&node, name)?;
        if let (Some(link), Some(phi)) = (self.raw.last_mut(), nominal) {
            link.link.nominal = Some(in_parent(&phi, &Matrix3::identity(), &-anchor));
        }
        for inner in node.children().filter(|n| n.has_tag_name("body")) {
            self.body(inner, Some(name), anchor, &classes)?;
        }
        Ok(())
    }

    /// Reads the limits of a joint of one freedom: its range, where it is not said to be without limit, and the force of its actuators. MJCF
    /// states no rate.
    fn limits(&self, joint: &Node, classes: &[&str], kind: &Joint<f64>) -> Limits {
        if !matches!(kind, Joint::Revolute(_) | Joint::Prismatic(_)) {
            return Limits::default();
        }
        let two = |name: &str, switch: &str| {
            let is_off = self.joint_word(joint, switch, classes).is_some_and(|word| word.trim() == "false");
            let text = self.joint_word(joint, name, classes).filter(|_| !is_off)?;
            exactly::<2>(xml::parse(text, name).ok()?, name).ok()
        };
        let turns = self.degrees && matches!(kind, Joint::Revolute(_));
        let [lower, upper] =
            two("range", "limited").unwrap_or_default().map(|v| if turns { v.to_radians() } else { v });
        let [least, most] = two("actuatorfrcrange", "actuatorfrclimited").unwrap_or_default();
        Limits::of(lower, upper, 0.0, most.min(-least))
    }

    /// Reads what a joint does by itself, and names what of that is not read.
    fn passive(
        &self,
        joint: &Node,
        classes: &[&str],
        kind: &Joint<f64>,
    ) -> Result<(Passive, Vec<&'static str>), String> {
        let mut unread = Vec::new();
        let mut first = |name: &'static str| -> Result<f64, String> {
            let Some(text) = self.joint_word(joint, name, classes) else { return Ok(0.0) };
            let what = format!("{name} of {}", describe(joint));
            let values = xml::parse(text, &what)?;
            // Further numbers of a damping or a stiffness are of higher powers.
            if values.iter().skip(1).any(|value| *value != 0.0) {
                unread.push(name);
            }
            values.first().copied().ok_or_else(|| format!("{what} is empty"))
        };
        let angle =
            |v: f64| if self.degrees && matches!(kind, Joint::Revolute(_)) { v.to_radians() } else { v };
        let passive = Passive {
            armature: first("armature")?,
            damping: first("damping")?,
            friction: first("frictionloss")?,
            stiffness: first("stiffness")?,
            // Positions count from the model's zero, where MuJoCo's are ref.
            spring_reference: angle(first("springref")? - first("ref")?),
        };
        if self.joint_word(joint, "springdamper", classes).is_some_and(|text| {
            text.split_whitespace().all(|word| word.parse::<f64>().is_ok_and(|value| value > 0.0))
        }) {
            unread.push("springdamper");
        }
        // What hangs on nothing in between has no rotor and no spring.
        if *kind == Joint::Free {
            return Ok((Passive::default(), unread));
        }
        Ok((passive.said_in(Language::Mjcf, kind), unread))
    }

    /// Tells what is stated of a joint and not used, and what of it is not read.
    fn tell_passive(&mut self, joint: &str, passive: &Passive, unread: &[&str]) {
        let place = format!("joint {joint}");
        let stated =
            passive.named().into_iter().filter(|(name, value)| *value != 0.0 && *name != "springref");
        let stated: Vec<&str> = stated.map(|(name, _)| name).collect();
        if !stated.is_empty() {
            let spring = if passive.stiffness == 0.0 { "" } else { "; there is no column for a spring" };
            let text = format!(
                "{NOT_USED}{}: rotors and friction are identified with --friction{spring}",
                stated.join(", ")
            );
            self.find(&place, &text);
        }
        if !unread.is_empty() {
            self.find(
                &place,
                &format!("not read of its attributes beyond the first number: {}", unread.join(", ")),
            );
        }
    }

    /// About the body's origin.
    fn inertial(&mut self, body: &Node, name: &str) -> Result<Option<Parameters>, String> {
        let Some(node) = xml::child(body, "inertial") else {
            if body.children().any(|n| n.has_tag_name("geom")) {
                self.find(
                    &format!("link {name}"),
                    "has no <inertial>: MuJoCo takes its inertia from its geoms, which is not done here; have it write the compiled \
                     model (mj_saveLastXML) with saveinertial = \"true\" in <compiler>",
                );
            }
            return Ok(None);
        };
        let what = format!("<inertial> of body {name}");
        let one = |attribute: &str| -> Result<f64, String> {
            let values = numbers(&node, attribute)?.ok_or_else(|| format!("{what} has no {attribute}"))?;
            Ok(exactly::<1>(values, &format!("{attribute} of {what}"))?[0])
        };
        let mass = one("mass")?;
        let com = Self::vector(&node, "pos")?.ok_or_else(|| format!("{what} has no pos"))?;
        let tensor = if let Some(v) = numbers(&node, "fullinertia")? {
            let [xx, yy, zz, xy, xz, yz] = exactly::<6>(v, &format!("fullinertia of {what}"))?;
            Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
        } else if let Some(v) = numbers(&node, "diaginertia")? {
            Matrix3::from_diagonal(&Vector3::from(exactly::<3>(v, &format!("diaginertia of {what}"))?))
        } else {
            return Err(format!("{what} has neither diaginertia nor fullinertia"));
        };
        if mass == 0.0 && tensor == Matrix3::zeros() {
            return Ok(None);
        }
        let rotation = self.rotation(&node)?;
        let body = InertialParameters::<Body, f64>::from_centre_of_mass(mass, Position::zero(), tensor);
        Ok(Some(in_parent(&body.to_vector(), &rotation, &com)).filter(|phi| *phi != NO_BODY))
    }
}

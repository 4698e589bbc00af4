//! Models from MJCF, the language of MuJoCo: bodies, joints and inertias. What else changes forces is named.
//!
//! A body of several joints becomes a chain of links, `BODY#1`, `BODY#2`, …, `BODY`, of which only the last
//! is a body. Lives here: the reader; what represents other elements ([`elements`]), inertias of geoms
//! ([`geoms`]) and meshes ([`meshes`]), orientations ([`angles`]), names ([`names`]), what MuJoCo's compiler
//! makes of masses ([`masses`]), which bodies are the robot ([`robot`]), and what is not followed
//! ([`unused`]).

mod angles;
mod elements;
#[cfg(test)]
mod foreign_tests;
mod geoms;
mod masses;
mod meshes;
#[cfg(test)]
mod meshes_tests;
pub(crate) mod names;
mod robot;
#[cfg(test)]
mod tests;
mod unused;

use crate::finding::NOT_USED;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::printable;
use rigident_shared::spatial::{Body, Position};
use rigident_shared::tree::{Joint, Link};
use roxmltree::Node;

use self::angles::Angles;
use self::masses::Masses;
use self::meshes::Meshes;
use self::names::Names;
use self::robot::Inside;
use super::finding::{Finding, ModelError};
use super::inertial::{Parameters, in_parent};
use super::limits::Limits;
use super::loose_xml::tidied;
use super::passive::Passive;
use super::tree::{Model, ModelLink, NO_BODY, Parsed, RawLink};
use super::xml::{self, Language, describe, exactly, numbers};

/// Name of the base where bodies hang on the world.
pub(super) const WORLD: &str = "world";

/// Attributes of a default class, by tag and name.
type Class<'a> = BTreeMap<(&'static str, &'a str), &'a str>;

struct Reader<'a> {
    angles: Angles,
    masses: Masses,
    meshes: Meshes,
    names: &'a Names,
    /// Attributes of the default classes, those of the classes they are in included.
    classes: BTreeMap<&'a str, Class<'a>>,
    /// True if geoms make inertias even where `<inertial>` states them, false if they never do; `None` if
    /// they do where there is no `<inertial>`.
    from_geoms: Option<bool>,
    /// The least and the largest group of the geoms that have mass.
    groups: [f64; 2],
    raw: Vec<RawLink>,
    anchors: BTreeMap<String, Vector3<f64>>,
    findings: Vec<Finding>,
    /// Bodies whose masses are those of their geoms.
    unknown: Vec<String>,
}

/// Reads the text of an MJCF; `what` names it in complaints. Files that it names are refused: [`parse_in`]
/// reads them.
///
/// # Errors
/// [`ModelError`] that says what is wrong and where.
pub fn parse(text: &str, what: &str) -> Result<Parsed, ModelError> {
    parse_in(text, what, None)
}

/// Returns the text of an MJCF with the files that it includes, its replicas and attached models in their
/// places; as it is if there are none.
///
/// # Errors
/// [`ModelError`] that says which of them cannot be followed.
pub(super) fn written_out<'a>(
    text: &'a str,
    what: &str,
    folder: Option<&Path>,
) -> Result<Cow<'a, str>, ModelError> {
    Ok(match tidied(text) {
        Cow::Borrowed(text) => elements::expanded(text, what, folder)?,
        Cow::Owned(tidy) => Cow::Owned(elements::expanded(&tidy, what, folder)?.into_owned()),
    })
}

/// Reads the text of an MJCF; `what` names it in complaints, and files that it names are searched for in
/// `folder`.
///
/// # Errors
/// [`ModelError`] that says what is wrong and where.
pub fn parse_in(text: &str, what: &str, folder: Option<&Path>) -> Result<Parsed, ModelError> {
    let text = written_out(text, what, folder)?;
    let document = xml::document(&text, what)?;
    let root = document.root_element();
    let refuse = |problem: String| ModelError::Structure { what: what.to_owned(), problem };
    let compilers: Vec<Node> = root.children().filter(|n| n.has_tag_name("compiler")).collect();
    let setting = |name: &str| compilers.iter().rev().find_map(|c| c.attribute(name));
    if setting("coordinate") == Some("global") {
        return Err(refuse(
            "coordinate = \"global\" is of an old MuJoCo: have it write the compiled model".to_owned(),
        ));
    }
    let names = Names::of(&document);
    let mut reader = Reader {
        angles: Angles::of(setting("angle"), setting("eulerseq")),
        masses: Masses::of(&compilers).map_err(refuse)?,
        meshes: Meshes::of(&compilers, folder),
        names: &names,
        classes: BTreeMap::new(),
        from_geoms: match setting("inertiafromgeom") {
            Some("true") => Some(true),
            Some("false") => Some(false),
            _ => None,
        },
        groups: groups(&compilers).map_err(refuse)?,
        raw: Vec::new(),
        anchors: BTreeMap::new(),
        findings: unused::unused(&root, &names),
        unknown: Vec::new(),
    };
    for defaults in root.children().filter(|n| n.has_tag_name("default")) {
        let before = reader.classes.get(defaults.attribute("class").unwrap_or("main")).cloned();
        reader.defaults(defaults, &before.unwrap_or_default());
    }
    reader.meshes(&root).map_err(refuse)?;
    let mut bodies = Vec::new();
    for world in root.children().filter(|n| n.has_tag_name("worldbody")) {
        let all = reader.inside(&world, &[]).map_err(refuse)?;
        bodies.extend(all.into_iter().filter(|own| own.node.has_tag_name("body")));
    }
    if bodies.is_empty() && root.children().all(|n| !n.has_tag_name("worldbody")) {
        return Err(refuse("there is no <worldbody> in it".to_owned()));
    }
    reader.world(&bodies).map_err(refuse)?;
    let gravity = gravity(&root).map_err(refuse)?;
    let mut model = Model::assemble(what, reader.raw, reader.findings)?;
    model.gravity_mps2 = gravity;
    if let Some(name) = root.attribute("model") {
        model.name = printable::name(name).to_string();
    }
    Ok(Parsed { model, anchors: reader.anchors })
}

/// Returns the groups of the geoms that have mass.
fn groups(compilers: &[Node]) -> Result<[f64; 2], String> {
    let stated = compilers.iter().rev().find(|c| c.attribute("inertiagrouprange").is_some());
    let Some(node) = stated else { return Ok([f64::NEG_INFINITY, f64::INFINITY]) };
    exactly::<2>(numbers(node, "inertiagrouprange")?.unwrap_or_default(), "inertiagrouprange of <compiler>")
}

/// Returns the gravity that a file states, m/s², world axes; MuJoCo's own is not stated.
fn gravity(root: &Node) -> Result<Option<[f64; 3]>, String> {
    let mut stated = None;
    for option in root.children().filter(|n| n.has_tag_name("option")) {
        if let Some(values) = numbers(&option, "gravity")? {
            stated = Some(exactly::<3>(values, "gravity of <option>")?);
        }
        let flags = option.children().filter(|n| n.has_tag_name("flag"));
        if flags.filter_map(|flag| flag.attribute("gravity")).any(|word| word == "disable") {
            return Ok(Some([0.0; 3]));
        }
    }
    Ok(stated)
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

impl<'a> Reader<'a> {
    fn find(&mut self, place: &str, text: &str) {
        self.findings.push(Finding { place: place.to_owned(), text: text.to_owned() });
    }

    fn defaults(&mut self, node: Node<'a, '_>, outer: &Class<'a>) {
        let mut own = outer.clone();
        for tag in ["joint", "geom", "mesh"] {
            if let Some(stated) = xml::child(&node, tag) {
                own.extend(stated.attributes().map(|a| ((tag, a.name()), a.value())));
            }
        }
        self.classes.insert(node.attribute("class").unwrap_or("main"), own.clone());
        for inner in node.children().filter(|n| n.has_tag_name("default")) {
            self.defaults(inner, &own);
        }
    }

    /// Returns an attribute of a joint: its own, or of its class, the innermost `childclass`, or the main
    /// default.
    fn joint_word<'b>(&'b self, joint: &Node<'b, '_>, name: &str, classes: &[&str]) -> Option<&'b str> {
        self.word("joint", joint, name, classes)
    }

    /// Returns an attribute of an element of any tag that classes have: its own, or of its class, the
    /// innermost `childclass`, or the main default.
    fn word<'b>(
        &'b self,
        tag: &'static str,
        node: &Node<'b, '_>,
        name: &str,
        classes: &[&str],
    ) -> Option<&'b str> {
        let class = node.attribute("class").or(classes.last().copied()).unwrap_or("main");
        node.attribute(name).or_else(|| self.classes.get(class)?.get(&(tag, name)).copied())
    }

    fn vector(node: &Node, attribute: &str) -> Result<Option<Vector3<f64>>, String> {
        let values = numbers(node, attribute)?;
        let what = format!("{attribute} of {}", describe(node));
        values.map(|v| exactly::<3>(v, &what).map(Vector3::from)).transpose()
    }

    /// Returns what is in a body or in the world, that in its frames included.
    fn inside<'n>(&self, node: &Node<'n, 'n>, classes: &[&'n str]) -> Result<Vec<Inside<'n>>, String> {
        let mut out = Vec::new();
        self.collect(node, &Inside::new(*node, classes), &mut out)?;
        Ok(out)
    }

    fn collect<'n>(
        &self,
        node: &Node<'n, 'n>,
        at: &Inside<'n>,
        out: &mut Vec<Inside<'n>>,
    ) -> Result<(), String> {
        for child in node.children().filter(Node::is_element) {
            let mut own = Inside { node: child, ..at.clone() };
            if child.has_tag_name("frame") {
                own.position += own.rotation * Self::vector(&child, "pos")?.unwrap_or_else(Vector3::zeros);
                own.rotation *= self.angles.rotation(&child)?;
                own.classes.extend(child.attribute("childclass"));
                self.collect(&child, &own, out)?;
            } else {
                out.push(own);
            }
        }
        Ok(())
    }

    /// Reads a body and those in it. `shift`: where the parent's link frame has its origin in the parent
    /// body's.
    fn body(&mut self, own: &Inside<'a>, parent: Option<&str>, shift: Vector3<f64>) -> Result<(), String> {
        let node = own.node;
        let name = self.names.name(&node).unwrap_or_default().to_owned();
        let mut classes = own.classes.clone();
        classes.extend(node.attribute("childclass"));
        let place =
            own.position + own.rotation * Self::vector(&node, "pos")?.unwrap_or_else(Vector3::zeros) - shift;
        let rotation = own.rotation * self.angles.rotation(&node)?;
        let inside = self.inside(&node, &classes)?;
        let mut links = Vec::new();
        for joint in inside.iter().filter(|n| n.node.has_tag_name("joint")) {
            links.push(self.joint(joint)?);
        }
        let free = inside.iter().any(|n| n.node.has_tag_name("freejoint"));
        if free || links.is_empty() {
            let (end, kind) = if free { ("joint", Joint::Free) } else { ("fixed", Joint::Fixed) };
            links.push(Held { name: format!("{name}_{end}"), ..Held::by(kind) });
        }
        let (mut at, mut before) = (parent.map(str::to_owned), place);
        let mut turned = rotation;
        let mut anchor = Vector3::zeros();
        let last = links.len() - 1;
        for (k, held) in links.into_iter().enumerate() {
            let link_name = if k == last { name.clone() } else { format!("{name}#{}", k + 1) };
            let (turn, slide) = held.at_reference();
            let position = before + turned * (held.anchor + slide);
            let joint_name = if at.is_none() { "" } else { held.name.as_str() };
            let mut link = raw(&link_name, joint_name, at.as_deref(), held.kind, turned * turn, position);
            link.link.nominal = (k != last).then_some(NO_BODY);
            if at.is_some() {
                link.link.passive[0] = held.passive;
                link.link.limits = held.limits;
            }
            self.raw.push(link);
            (at, before, turned, anchor) = (Some(link_name), -held.anchor, Matrix3::identity(), held.anchor);
        }
        if at.is_some() && parent.is_none() {
            // A base's own frame is its body's.
            anchor = Vector3::zeros();
        }
        if anchor != Vector3::zeros() {
            self.anchors.insert(name.clone(), anchor);
        }
        let nominal = self.inertial(&inside, &name, place + shift)?;
        if let (Some(link), Some(phi)) = (self.raw.last_mut(), nominal) {
            link.link.nominal = Some(in_parent(&phi, &Matrix3::identity(), &-anchor));
        }
        for inner in inside.iter().filter(|n| n.node.has_tag_name("body")) {
            self.body(inner, Some(&name), anchor)?;
        }
        Ok(())
    }

    /// Reads a joint of a body.
    fn joint(&mut self, at: &Inside<'a>) -> Result<Held, String> {
        let (joint, classes) = (&at.node, at.classes.as_slice());
        let own = |attribute: &str| self.joint_word(joint, attribute, classes);
        let triple = |attribute: &str, otherwise: Vector3<f64>| -> Result<Vector3<f64>, String> {
            let what = format!("{attribute} of {}", describe(joint));
            match own(attribute) {
                None => Ok(otherwise),
                Some(text) => Ok(Vector3::from(exactly::<3>(xml::parse(text, &what)?, &what)?)),
            }
        };
        let axis = at.rotation * triple("axis", Vector3::z())?;
        let anchor = at.position + at.rotation * triple("pos", Vector3::zeros())?;
        let kind = match own("type").unwrap_or("hinge") {
            "hinge" => Joint::Revolute(axis),
            "slide" => Joint::Prismatic(axis),
            "ball" => Joint::Spherical,
            "free" => Joint::Free,
            other => return Err(format!("joint type {other:?} of {} is not known", describe(joint))),
        };
        let name = self.names.name(joint).unwrap_or_default().to_owned();
        let reference = match own("ref") {
            Some(text) => {
                let what = format!("ref of {}", describe(joint));
                self.angle(exactly::<1>(xml::parse(text, &what)?, &what)?[0], &kind)
            }
            None => 0.0,
        };
        let (passive, unread) = self.passive(joint, classes, &kind)?;
        self.tell_passive(&name, &kind, &passive, &unread);
        let passive = if kind == Joint::Free { Passive::default() } else { passive };
        let limits = self.limits(joint, classes, &kind);
        Ok(Held { name, kind, anchor, reference, passive, limits })
    }

    /// Returns an angle of a joint that turns in rad, a length as it is.
    fn angle(&self, value: f64, kind: &Joint<f64>) -> f64 {
        if self.angles.degrees && matches!(kind, Joint::Revolute(_)) { value.to_radians() } else { value }
    }

    /// Reads the limits of a joint of one freedom: its range, where it is not said to be without limit, and
    /// the force of its actuators. MJCF states no rate.
    fn limits(&self, joint: &Node, classes: &[&str], kind: &Joint<f64>) -> Limits {
        if !matches!(kind, Joint::Revolute(_) | Joint::Prismatic(_)) {
            return Limits::default();
        }
        let two = |name: &str, switch: &str| {
            let is_off = self.joint_word(joint, switch, classes).is_some_and(|word| word.trim() == "false");
            let text = self.joint_word(joint, name, classes).filter(|_| !is_off)?;
            exactly::<2>(xml::parse(text, name).ok()?, name).ok()
        };
        let [lower, upper] = two("range", "limited").unwrap_or_default().map(|v| self.angle(v, kind));
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
        let passive = Passive {
            armature: first("armature")?,
            damping: first("damping")?,
            friction: first("frictionloss")?,
            stiffness: first("stiffness")?,
            spring_reference: self.angle(first("springref")?, kind),
        };
        if self.joint_word(joint, "springdamper", classes).is_some_and(|text| {
            text.split_whitespace().all(|word| word.parse::<f64>().is_ok_and(|value| value > 0.0))
        }) {
            unread.push("springdamper");
        }
        if *kind == Joint::Free {
            return Ok((passive, unread));
        }
        Ok((passive.said_in(Language::Mjcf, kind), unread))
    }

    /// Tells what is stated of a joint and not used, and what of it is not read.
    fn tell_passive(&mut self, joint: &str, kind: &Joint<f64>, passive: &Passive, unread: &[&str]) {
        let place = format!("joint {joint}");
        let stated =
            passive.named().into_iter().filter(|(name, value)| *value != 0.0 && *name != "springref");
        let stated: Vec<&str> = stated.map(|(name, _)| name).collect();
        // Joints of one freedom have columns of them.
        let how = match kind {
            Joint::Free => Some("nothing holds a base that moves freely"),
            Joint::Spherical => Some("there are no columns of a ball's drive"),
            _ => None,
        };
        if let Some(how) = how.filter(|_| !stated.is_empty()) {
            self.find(&place, &format!("{NOT_USED}{}: {how}", stated.join(", ")));
        }
        if !unread.is_empty() {
            self.find(
                &place,
                &format!("not read of its attributes beyond the first number: {}", unread.join(", ")),
            );
        }
    }

    /// Returns the inertia of a body about its origin; `place` is the place of the body in its parent.
    fn inertial(
        &mut self,
        inside: &[Inside<'a>],
        name: &str,
        place: Vector3<f64>,
    ) -> Result<Option<Parameters>, String> {
        let stated = inside.iter().find(|n| n.node.has_tag_name("inertial")).map(|n| n.node);
        let Some(node) = stated.filter(|_| self.from_geoms != Some(true)) else {
            let has_geoms = inside.iter().any(|n| n.node.has_tag_name("geom"));
            return self.inertial_of_geoms(if has_geoms { inside } else { &[] }, name, place);
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
        } else if mass == 0.0 {
            Matrix3::zeros()
        } else {
            return Err(format!("{what} has neither diaginertia nor fullinertia"));
        };
        let body = self.body_of(mass, tensor);
        if body == NO_BODY {
            return Ok(None);
        }
        let rotation = self.angles.rotation(&node)?;
        Ok(Some(in_parent(&body, &rotation, &com)))
    }

    /// Returns the parameters of a body that its geoms make; `None` if they are not known, which is said, or
    /// if there is none.
    fn inertial_of_geoms(
        &mut self,
        inside: &[Inside<'a>],
        name: &str,
        place: Vector3<f64>,
    ) -> Result<Option<Parameters>, String> {
        let (sum, other) = match self.from_geoms {
            Some(false) => (NO_BODY, None),
            _ => self.of_geoms(inside)?,
        };
        if let Some(kind) = other {
            let text = format!(
                "has no <inertial>: MuJoCo makes its inertia of its geoms, which is not done here of a \
                 {kind}; have it write the compiled model (mj_saveLastXML) with saveinertial = \"true\" in \
                 <compiler>"
            );
            self.find(&format!("link {name}"), &text);
            self.unknown.push(name.to_owned());
            return Ok(None);
        }
        let body = InertialParameters::<Body, f64>::from_vector(sum);
        let (centre, tensor) = if body.mass > 0.0 {
            (body.centre_of_mass().vector(), body.inertia_com())
        } else {
            // MuJoCo puts the least mass of a body that has none where the body is in its parent, but in its
            // own axes.
            (place, Matrix3::zeros())
        };
        let phi = in_parent(&self.body_of(body.mass, tensor), &Matrix3::identity(), &centre);
        Ok(Some(phi).filter(|phi| *phi != NO_BODY))
    }

    /// Returns the parameters, about the centre of mass, of a stated mass and tensor as the compiler leaves
    /// them.
    fn body_of(&self, mass: f64, tensor: Matrix3<f64>) -> Parameters {
        let (mass, tensor) = self.masses.bounded(mass, tensor);
        InertialParameters::<Body, f64>::from_centre_of_mass(mass, Position::zero(), tensor).to_vector()
    }
}

/// A joint of a body.
struct Held {
    name: String,
    kind: Joint<f64>,
    /// The place of it in the body's frame, m.
    anchor: Vector3<f64>,
    /// The position that the file's pose is of, rad or m.
    reference: f64,
    passive: Passive,
    limits: Limits,
}

impl Held {
    fn by(kind: Joint<f64>) -> Self {
        let (passive, limits) = (Passive::default(), Limits::default());
        Self { name: String::new(), kind, anchor: Vector3::zeros(), reference: 0.0, passive, limits }
    }

    /// Returns the turn and the shift from the file's pose to that of position zero.
    fn at_reference(&self) -> (Matrix3<f64>, Vector3<f64>) {
        match self.kind {
            Joint::Revolute(axis) if self.reference != 0.0 && axis.norm() > 0.0 => {
                let turn = Rotation3::from_axis_angle(&Unit::new_normalize(axis), -self.reference);
                (turn.into_inner(), Vector3::zeros())
            }
            Joint::Prismatic(axis) if self.reference != 0.0 && axis.norm() > 0.0 => {
                (Matrix3::identity(), -axis.normalize() * self.reference)
            }
            _ => (Matrix3::identity(), Vector3::zeros()),
        }
    }
}

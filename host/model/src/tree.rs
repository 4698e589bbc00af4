//! A tree of links, base first, parents before children.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix3, Vector3};
use rigident_shared::printable;
use rigident_shared::tree::{Joint, Link};

use super::finding::{Finding, ModelError};
use super::inertial::{Parameters, in_parent};
use super::limits::Limits;
use super::passive::Passive;

/// The most links of a model: a matrix of all their parameters takes some hundred megabytes.
pub const MOST_LINKS: usize = 512;

/// A joint that follows another: `q = multiplier · q_leader + offset`.
#[derive(Clone, Debug, PartialEq)]
pub struct Mimic {
    /// Name of the leading joint.
    pub leader: String,
    /// Factor.
    pub multiplier: f64,
    /// Offset, rad or m.
    pub offset: f64,
}

/// A link and the joint it hangs on.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelLink {
    /// The name of the link.
    pub name: String,
    /// Name of its joint; empty for the base.
    pub joint_name: String,
    /// Parent and joint. The first link is the base; its own joint is not examined.
    pub link: Link<f64>,
    /// The model's statement of its inertia, link axes, about the link's origin. `None` if it has no mass
    /// there and may have one; [`NO_BODY`] if it is nothing but the place where two joints of one body meet.
    pub nominal: Option<Parameters>,
    /// Names of links that are rigidly one with it.
    pub welded: Vec<String>,
    /// The joint it follows.
    pub mimic: Option<Mimic>,
    /// The passive parameters of its joint, by axis; only a universal joint has a second one.
    pub passive: [Passive; 2],
    /// Limits of its joint, of one freedom.
    pub limits: Limits,
}

/// Parameters of a link that is no body: joints meet there, and nothing else is.
pub const NO_BODY: Parameters = [0.0; 10];

impl ModelLink {
    /// Returns a link by itself that follows no other joint.
    pub fn new(
        name: impl Into<String>,
        joint_name: impl Into<String>,
        link: Link<f64>,
        nominal: Option<Parameters>,
    ) -> Self {
        let (name, joint_name) = (name.into(), joint_name.into());
        let (passive, limits) = ([Passive::default(); 2], Limits::default());
        Self { name, joint_name, link, nominal, welded: Vec::new(), mimic: None, passive, limits }
    }

    /// Returns whether there can be mass: it is more than a place where two joints of one body meet.
    pub fn is_body(&self) -> bool {
        self.nominal != Some(NO_BODY)
    }
}

/// A model.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// The name of the model.
    pub name: String,
    /// The links, base first.
    pub links: Vec<ModelLink>,
    /// The suspicious findings about it.
    pub findings: Vec<Finding>,
    /// Gravity that its file states, m/s², axes of the world; `None` where it states none.
    pub gravity_mps2: Option<[f64; 3]>,
}

/// A model as a file has it, and where the joint that holds a body sits in the body's own frame: a link's
/// frame here has its origin at its joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Parsed {
    /// The tree.
    pub model: Model,
    /// Joints' places in their bodies' frames, m; those at the origin are left out.
    pub anchors: BTreeMap<String, Vector3<f64>>,
}

/// A link as a file gives it, its parent by name.
#[derive(Clone, Debug)]
pub struct RawLink {
    /// The link; its parent's index is still meaningless.
    pub link: ModelLink,
    /// The parent's name; `None` where no joint holds it.
    pub parent: Option<String>,
}

impl Model {
    /// Brings links into order.
    ///
    /// # Errors
    /// [`ModelError::Structure`] where they make no tree: no base or several, a loop, a parent that is not
    /// there, a name given twice, an axis without direction.
    pub fn assemble(name: &str, raw: Vec<RawLink>, findings: Vec<Finding>) -> Result<Self, ModelError> {
        let refuse = |problem: String| ModelError::Structure { what: name.to_owned(), problem };
        let names = names(&raw).map_err(refuse)?;
        let (root, children) = hung(&raw, &names).map_err(refuse)?;
        let links = in_order(&raw, root, &children);
        if links.len() < raw.len() {
            return Err(refuse(in_a_loop(&raw)));
        }
        let mut model = Self { name: name.to_owned(), links, findings, gravity_mps2: None };
        model.normalise_axes()?;
        model.look_at_mimics();
        model.look_at_passive()?;
        model.look_at_inertias();
        Ok(model)
    }

    fn refuse(&self, problem: String) -> ModelError {
        ModelError::Structure { what: self.name.clone(), problem }
    }

    fn normalise_axes(&mut self) -> Result<(), ModelError> {
        for i in 1..self.links.len() {
            let link = &self.links[i];
            let finite = link.link.position.iter().chain(link.link.rotation.iter()).all(|v| v.is_finite());
            if !finite {
                return Err(self.refuse(format!(
                    "joint {}: its place holds a number that is not finite",
                    link.joint_name
                )));
            }
            let unit = |axis: Vector3<f64>| {
                let norm = axis.norm();
                if norm.is_finite() && norm > 0.0 {
                    Ok(axis / norm)
                } else {
                    Err(self.refuse(format!(
                        "joint {}: its axis {:?} has no direction",
                        link.joint_name,
                        axis.as_slice()
                    )))
                }
            };
            let joint = match link.link.joint {
                Joint::Revolute(a) => Joint::Revolute(unit(a)?),
                Joint::Prismatic(a) => Joint::Prismatic(unit(a)?),
                Joint::Universal(a, b) => {
                    let (a, b) = (unit(a)?, unit(b)?);
                    if a.cross(&b).norm() < f64::EPSILON.sqrt() {
                        return Err(self.refuse(format!(
                            "joint {}: the two axes of a universal joint must not be parallel",
                            link.joint_name
                        )));
                    }
                    Joint::Universal(a, b)
                }
                other => other,
            };
            self.links[i].link.joint = joint;
        }
        Ok(())
    }

    /// Checks what joints do by themselves.
    ///
    /// # Errors
    /// [`ModelError::Structure`] if a number is not finite.
    fn look_at_passive(&mut self) -> Result<(), ModelError> {
        let mut found = Vec::new();
        for link in &self.links {
            for (name, value) in link.passive.iter().flat_map(Passive::named) {
                if !value.is_finite() {
                    return Err(ModelError::Structure {
                        what: self.name.clone(),
                        problem: format!(
                            "joint {}: its {name} is {value}, which is not finite",
                            link.joint_name
                        ),
                    });
                }
                if value < 0.0 && name != "springref" {
                    found.push(Finding {
                        place: format!("joint {}", link.joint_name),
                        text: format!("its {name} is negative, {value}: the joint would drive itself"),
                    });
                }
            }
        }
        self.findings.extend(found);
        Ok(())
    }

    /// Has joints that can follow no other move by themselves, with a word.
    fn look_at_mimics(&mut self) {
        for i in 1..self.links.len() {
            let Some(why) = self.links[i].mimic.as_ref().and_then(|mimic| self.no_leader(i, mimic)) else {
                continue;
            };
            let text = format!("{why}: counted as a joint that moves by itself");
            self.findings.push(Finding { place: format!("joint {}", self.links[i].joint_name), text });
            self.links[i].mimic = None;
        }
    }

    /// Returns why a joint cannot follow as it is said to.
    fn no_leader(&self, follower: usize, mimic: &Mimic) -> Option<String> {
        let name = &mimic.leader;
        let Some(leader) = self.joint(name) else {
            return Some(format!("mimics {name}, which is not there"));
        };
        if !mimic.multiplier.is_finite() || !mimic.offset.is_finite() {
            return Some(format!(
                "mimics {name} by {} times its position and {}, and both numbers must be finite",
                mimic.multiplier, mimic.offset
            ));
        }
        let leads = |i: usize| self.links[i].link.joint.freedoms() == 1;
        if !leads(follower) || !leads(leader) {
            return Some(format!("mimics {name}, and both must be revolute, continuous or prismatic"));
        }
        // Followers of followers end at a leader, or run in a circle.
        let (mut at, mut steps) = (leader, 0);
        while let Some(next) = self.links[at].mimic.as_ref().and_then(|m| self.joint(&m.leader)) {
            (at, steps) = (next, steps + 1);
            if steps > self.links.len() {
                return Some(format!("mimics {name} and itself in the end"));
            }
        }
        None
    }

    fn look_at_inertias(&mut self) {
        let moving = self.welded();
        let bodies = moving.links.iter().enumerate();
        let mut found: Vec<Finding> = bodies
            .clone()
            .filter(|(i, body)| *i > 0 && body.nominal.is_none())
            .map(|(_, body)| Finding {
                place: format!("link {}", body.name),
                text: "has no mass (no <inertial>, or a mass of zero) though it moves on its own: its \
                       parameters are taken as unknown, not as zero"
                    .to_owned(),
            })
            .collect();
        let (_, impossible) = self.possible();
        found.extend(
            impossible
                .into_iter()
                .map(|(i, text)| Finding { place: format!("link {}", self.links[i].name), text }),
        );
        self.findings.extend(found);
    }

    /// Returns the index of the link of this name.
    pub fn link(&self, name: &str) -> Option<usize> {
        self.links.iter().position(|l| l.name == name)
    }

    /// Returns the index of the link that hangs on the joint of this name.
    pub fn joint(&self, name: &str) -> Option<usize> {
        self.links.iter().position(|l| !l.joint_name.is_empty() && l.joint_name == name)
    }

    /// Returns names of the joints where no two elements may have one: joints that are named as a link have
    /// `_joint` after it.
    pub(crate) fn separate_joint_names(&self) -> Vec<String> {
        let mut taken: BTreeSet<String> = self.links.iter().map(|link| link.name.clone()).collect();
        let free = |link: &ModelLink| {
            let mut name = link.joint_name.clone();
            while !taken.insert(name.clone()) {
                name += "_joint";
            }
            name
        };
        self.links.iter().map(free).collect()
    }

    /// Returns a model of the same motion with fewer links: those on fixed joints are joined with the links
    /// that they hang on.
    #[must_use]
    pub fn welded(&self) -> Self {
        let mut links: Vec<ModelLink> = Vec::new();
        // For every link of ours: its body there, and its place in that body's frame.
        let mut places: Vec<(usize, Matrix3<f64>, Vector3<f64>)> = Vec::new();
        for (i, own) in self.links.iter().enumerate() {
            if i == 0 {
                places.push((0, Matrix3::identity(), Vector3::zeros()));
                links.push(own.clone());
                continue;
            }
            let (body, r, p) = places[own.link.parent];
            let rotation = r * own.link.rotation;
            let position = p + r * own.link.position;
            if own.link.joint == Joint::Fixed {
                let target = &mut links[body];
                target.welded.push(own.name.clone());
                target.welded.extend(own.welded.iter().cloned());
                match &own.nominal {
                    Some(phi) => {
                        let there = in_parent(phi, &rotation, &position);
                        let sum = target.nominal.get_or_insert(NO_BODY);
                        for (a, b) in sum.iter_mut().zip(there) {
                            *a += b;
                        }
                    }
                    // Something unknown where there was nothing.
                    None if !target.is_body() => target.nominal = None,
                    None => {}
                }
                places.push((body, rotation, position));
            } else {
                places.push((links.len(), Matrix3::identity(), Vector3::zeros()));
                let link = Link { parent: body, rotation, position, ..own.link };
                links.push(ModelLink { link, ..own.clone() });
            }
        }
        let (name, findings) = (self.name.clone(), self.findings.clone());
        Self { name, links, findings, gravity_mps2: self.gravity_mps2 }
    }

    /// Degrees of freedom of the joints.
    pub fn freedoms(&self) -> usize {
        self.links.iter().skip(1).map(|l| l.link.joint.freedoms()).sum()
    }

    /// Links and joints without names.
    pub fn tree(&self) -> Vec<Link<f64>> {
        self.links.iter().map(|l| l.link).collect()
    }

    /// Returns the nominal parameters of all links, zero where there are none.
    pub fn nominal(&self) -> Vec<f64> {
        self.links.iter().flat_map(|l| l.nominal.unwrap_or([0.0; 10])).collect()
    }

    /// Returns how many joints move, of each kind.
    pub fn kinds(&self) -> Vec<(&'static str, usize)> {
        let mut kinds = Vec::new();
        let kind = |j: &Joint<f64>| match j {
            Joint::Fixed => "fixed",
            Joint::Revolute(_) => "revolute",
            Joint::Prismatic(_) => "prismatic",
            Joint::Universal(..) => "universal",
            Joint::Spherical => "spherical",
            Joint::Free => "free",
        };
        for name in ["revolute", "prismatic", "universal", "spherical", "free"] {
            let count = self.links.iter().skip(1).filter(|l| kind(&l.link.joint) == name).count();
            if count > 0 {
                kinds.push((name, count));
            }
        }
        kinds
    }
}

/// Returns the names of all links.
///
/// # Errors
/// Says which link or joint has no name of its own, or that there are too many.
fn names(raw: &[RawLink]) -> Result<BTreeSet<&str>, String> {
    for name in raw.iter().flat_map(|r| [&r.link.name, &r.link.joint_name]) {
        if !printable::is_name(name) {
            return Err(format!(
                "the name {:?} has control characters, or is longer than {} bytes: give another one",
                printable::name(name).to_string(),
                printable::LONGEST_NAME
            ));
        }
    }
    if raw.len() > MOST_LINKS {
        return Err(format!("it has {} links, and models are read up to {MOST_LINKS}", raw.len()));
    }
    let (mut names, mut joints) = (BTreeSet::new(), BTreeSet::new());
    for (n, r) in raw.iter().enumerate() {
        if r.link.name.trim().is_empty() {
            let held = match r.link.joint_name.as_str() {
                "" => String::new(),
                joint => format!(", which joint {joint} holds,"),
            };
            return Err(format!(
                "link {} of the file{held} has no name; every link needs one of its own",
                n + 1
            ));
        }
        if !names.insert(r.link.name.as_str()) {
            return Err(format!("two links are named {}", r.link.name));
        }
        if r.parent.is_some() && r.link.joint_name.trim().is_empty() {
            return Err(format!(
                "the joint that holds link {} has no name; every joint needs one of its own",
                r.link.name
            ));
        }
        if r.parent.is_some() && !joints.insert(r.link.joint_name.as_str()) {
            return Err(format!("two joints are named {}", r.link.joint_name));
        }
    }
    Ok(names)
}

/// Returns the base, and by the name of each link those that hang on it.
///
/// # Errors
/// Says which link hangs on one that is not there, or that there is no base or several.
fn hung<'a>(
    raw: &'a [RawLink],
    names: &BTreeSet<&str>,
) -> Result<(usize, BTreeMap<&'a str, Vec<usize>>), String> {
    let mut children: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    let mut roots = Vec::new();
    for (i, r) in raw.iter().enumerate() {
        match r.parent.as_deref() {
            None => roots.push(i),
            Some(parent) if names.contains(parent) => children.entry(parent).or_default().push(i),
            Some(parent) => {
                return Err(format!(
                    "joint {} hangs link {} on {parent}, which is not there",
                    r.link.joint_name, r.link.name
                ));
            }
        }
    }
    match roots.as_slice() {
        [root] => Ok((*root, children)),
        [] => Err(format!("{}: there is no base", in_a_loop(raw))),
        several => {
            let all: Vec<&str> = several.iter().map(|i| raw[*i].link.name.as_str()).collect();
            Err(format!(
                "{} links hang on nothing: {}; a model has one base, join the others to it (a fixed joint \
                 will do)",
                all.len(),
                all.join(", ")
            ))
        }
    }
}

/// Returns the links below a base and itself, parents before children: depth first, in the file's order.
fn in_order(raw: &[RawLink], root: usize, children: &BTreeMap<&str, Vec<usize>>) -> Vec<ModelLink> {
    let mut stack = vec![(root, 0)];
    let mut links: Vec<ModelLink> = Vec::with_capacity(raw.len());
    while let Some((i, parent)) = stack.pop() {
        let mut link = raw[i].link.clone();
        link.link.parent = parent;
        let at = links.len();
        let below = children.get(link.name.as_str()).map_or(&[][..], Vec::as_slice);
        stack.extend(below.iter().rev().map(|child| (*child, at)));
        links.push(link);
    }
    links
}

/// Names the links of a loop.
fn in_a_loop(raw: &[RawLink]) -> String {
    let parents: BTreeMap<&str, &str> =
        raw.iter().filter_map(|r| Some((r.link.name.as_str(), r.parent.as_deref()?))).collect();
    for start in parents.keys() {
        let mut path = vec![*start];
        while let Some(next) = path.last().and_then(|last| parents.get(last)) {
            if next == start {
                path.push(next);
                path.reverse();
                return format!(
                    "links {} make a loop; only trees can be identified, cut it at one joint",
                    path.join(" → ")
                );
            }
            if path.contains(next) {
                break;
            }
            path.push(next);
        }
    }
    "its links hang on nothing".to_owned()
}

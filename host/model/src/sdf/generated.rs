//! A file in SDF that is made of a model.
//!
//! Gazebo gives a link without `<inertial>` a kilogram of unit moments. What is fixed and has no mass is a
//! `<frame>` of what it hangs on therefore, a base without mass takes that of a link that is fixed to it, and
//! a base that has none at all is fixed to the world, where it weighs nothing.

use std::fmt::Write as _;

use nalgebra::{Matrix3, Vector3};
use rigident_shared::tree::Joint;

use super::super::finding::ModelError;
use super::super::inertial::in_parent;
use super::super::mjcf::WORLD;
use super::super::passive::Passive;
use super::super::transmission;
use super::super::tree::{Model, ModelLink};
use super::super::xml::{Language, escaped, inertial, rpy, vector};

/// A link that became a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// The name of the frame.
    pub name: String,
    /// The link that it is fixed to.
    pub holder: String,
    rotation: Matrix3<f64>,
    position: Vector3<f64>,
}

/// A model as SDF can say it.
#[derive(Clone, Debug, PartialEq)]
pub struct Said {
    /// Every link has mass, but for a base that is fixed to the world, and what is fixed there.
    pub model: Model,
    /// Links that became frames.
    pub frames: Vec<Frame>,
    /// Names of the joints of the model's links.
    joints: Vec<String>,
}

/// Returns true for the world's own body, where a file had it so.
fn is_world(model: &Model, i: usize) -> bool {
    i == 0 && model.links.first().is_some_and(|base| base.name == WORLD && base.nominal.is_none())
}

impl Said {
    /// Returns what can be said of a model.
    ///
    /// # Errors
    /// [`ModelError::Structure`] if a link that moves has no mass.
    pub fn of(model: &Model) -> Result<Self, ModelError> {
        let whole = model.with_universals();
        let mut joints = whole.separate_joint_names();
        let mut own = Self { model: whole, frames: Vec::new(), joints: Vec::new() };
        let free = |link: &ModelLink| link.link.joint != Joint::Fixed;
        let links = own.model.links.iter().skip(1).filter(|link| link.is_body() && link.nominal.is_none());
        if let Some(link) = links.into_iter().find(|link| free(link)) {
            return Err(own.refused(format!(
                "link {} moves and has no inertia, and SDF gives a kilogram to a link without; give it one, \
                 or write a URDF or MJCF",
                link.name
            )));
        }
        // From the leaves: nothing hangs on a link but what has mass, or could not be taken away.
        for i in (1..own.model.links.len()).rev() {
            let link = &own.model.links[i];
            let holder = link.link.parent;
            let is_light = link.link.joint == Joint::Fixed && link.nominal.is_none();
            if is_light && !is_world(&own.model, holder) {
                own.make_frame(i);
                joints.remove(i);
            }
        }
        if own.model.links.first().is_some_and(|base| base.nominal.is_none() && base.name != WORLD) {
            let at_base = |link: &ModelLink| link.link.parent == 0 && !free(link);
            if let Some(i) = (1..own.model.links.len()).find(|i| at_base(&own.model.links[*i])) {
                let ModelLink { link, nominal, .. } = &own.model.links[i];
                own.model.links[0].nominal =
                    nominal.map(|phi| in_parent(&phi, &link.rotation, &link.position));
                own.make_frame(i);
                joints.remove(i);
            }
        }
        own.joints = joints;
        Ok(own)
    }

    /// Makes a frame of a link on a fixed joint; what hangs on it hangs on its holder then.
    fn make_frame(&mut self, i: usize) {
        let ModelLink { name, link, .. } = self.model.links.remove(i);
        for other in &mut self.model.links[i..] {
            let own = &mut other.link;
            if own.parent == i {
                own.position = link.position + link.rotation * own.position;
                own.rotation = link.rotation * own.rotation;
                own.parent = link.parent;
            } else if own.parent > i {
                own.parent -= 1;
            }
        }
        let holder = self.model.links[link.parent].name.clone();
        for frame in self.frames.iter_mut().filter(|frame| frame.holder == name) {
            frame.position = link.position + link.rotation * frame.position;
            frame.rotation = link.rotation * frame.rotation;
            frame.holder.clone_from(&holder);
        }
        self.frames.push(Frame { name, holder, rotation: link.rotation, position: link.position });
    }

    /// Returns the name of the base if it has no mass at all: it is fixed to the world then.
    pub fn fixed_to_world(&self) -> Option<&str> {
        let base = self.model.links.first()?;
        (base.nominal.is_none() && base.name != WORLD).then_some(base.name.as_str())
    }

    fn refused(&self, problem: String) -> ModelError {
        ModelError::Structure { what: self.model.name.clone(), problem }
    }

    /// Returns the file.
    ///
    /// # Errors
    /// [`ModelError::Structure`] if SDF has no word for a joint.
    pub fn text(&self) -> Result<String, ModelError> {
        let mut out = String::new();
        for i in 0..self.model.links.len() {
            self.add_link(i, &mut out)?;
        }
        for frame in &self.frames {
            let _ = writeln!(
                out,
                "    <frame name=\"{}\" attached_to=\"{}\"><pose>{} {}</pose></frame>",
                escaped(&frame.name),
                escaped(&frame.holder),
                vector(&frame.position),
                rpy(&frame.rotation)
            );
        }
        if let Some(base) = self.fixed_to_world() {
            let mut name = format!("{base}_to_world");
            while self.joints.contains(&name) || self.model.link(&name).is_some() {
                name += "_joint";
            }
            let _ = writeln!(
                out,
                "    <joint name=\"{}\" type=\"fixed\"><parent>{WORLD}</parent><child>{}</child></joint>",
                escaped(&name),
                escaped(base)
            );
        }
        let declared = if out.contains("<drake:") { transmission::DECLARED } else { "" };
        Ok(format!(
            "<?xml version=\"1.0\"?>\n<sdf version=\"1.9\"{declared}>\n  <model name=\"{}\">\n{out}  \
             </model>\n</sdf>\n",
            escaped(&self.model.name)
        ))
    }

    /// Adds a link and the joint that holds it.
    fn add_link(&self, i: usize, out: &mut String) -> Result<(), ModelError> {
        let (model, own) = (&self.model, &self.model.links[i]);
        if is_world(model, i) {
            return Ok(());
        }
        if !own.is_body() {
            return Err(self.refused(format!(
                "SDF has no body with several joints, as {} is between two of one, and gives a kilogram to a \
                 link without inertia; write a URDF or MJCF, or declare three hinges to be one ball \
                 (`spherical`)",
                own.name
            )));
        }
        let parent = &model.links[own.link.parent];
        let relative = if i == 0 || is_world(model, own.link.parent) {
            String::new()
        } else {
            format!(" relative_to=\"{}\"", escaped(&parent.name))
        };
        let place = if i == 0 {
            "0 0 0 0 0 0".to_owned()
        } else {
            format!("{} {}", vector(&own.link.position), rpy(&own.link.rotation))
        };
        let inside = own
            .nominal
            .as_ref()
            .map_or_else(String::new, |phi| format!("\n      {}", inertial(phi, Language::Sdf)));
        let _ = writeln!(
            out,
            "    <link name=\"{}\">\n      <pose{relative}>{place}</pose>{inside}\n    </link>",
            escaped(&own.name)
        );
        if i == 0 {
            return Ok(());
        }
        let axis = |element: &str, a: &Vector3<f64>, passive: &Passive| {
            let passive = passive.written(Language::Sdf, &own.link.joint);
            format!("<{element}><xyz>{}</xyz>{passive}</{element}>", vector(a))
        };
        let [passive, second] = &own.passive;
        let rotor = transmission::of_joint(passive.armature);
        let (kind, axes) = match &own.link.joint {
            Joint::Fixed => ("fixed", String::new()),
            Joint::Revolute(a) => ("continuous", axis("axis", a, passive) + &rotor),
            Joint::Prismatic(a) => ("prismatic", axis("axis", a, passive) + &rotor),
            Joint::Spherical => ("ball", String::new()),
            Joint::Universal(a, b) => ("universal", axis("axis", a, passive) + &axis("axis2", b, second)),
            Joint::Free => {
                let name = &own.joint_name;
                return Err(
                    self.refused(format!("SDF has no free joint as {name} is one; write a URDF or MJCF"))
                );
            }
        };
        let _ = writeln!(
            out,
            "    <joint name=\"{}\" type=\"{kind}\"><parent>{}</parent><child>{}</child>{axes}</joint>",
            escaped(&self.joints[i]),
            escaped(&parent.name),
            escaped(&own.name)
        );
        Ok(())
    }
}

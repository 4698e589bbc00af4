//! The statements of a model that a file written of it does not make as the model does.

use std::path::Path;

use rigident_shared::tree::Joint;

use super::passive_table;
use super::sdf::generated::Said;
use super::tree::{Model, ModelLink};
use super::xml::Language;

/// Returns what whoever reads a file of a model should know: what it does not say as the model does, or only
/// some readers read. `locked` are the joints, `JOINT` or `JOINT=VALUE`, that were locked in it.
pub fn remarks(model: &Model, source: Option<&Path>, path: &Path, locked: &[String]) -> Vec<String> {
    let language = Language::of_path(path);
    let text = source.and_then(|source| rigident_files::read_text(source).ok());
    let is_kept = text.is_some_and(|text| Language::of_text(&text) == language);
    // Two hinges of a body are one universal joint in a file that is made.
    let universal = (language == Some(Language::Sdf) && !is_kept).then(|| model.with_universals());
    let mut remarks = Remarks { model: universal.as_ref().unwrap_or(model), path, said: Vec::new() };
    if let Some(language) = language {
        remarks.of_passive_parameters(language);
    }
    if is_kept {
        // The rest of it is left as it is.
        return remarks.said;
    }
    remarks.say(
        "holds links, joints, inertias and what its language says of friction; shapes, limits and whatever \
         else the model's file may have are left out",
    );
    if !locked.is_empty() {
        remarks.say(&format!("joints that were locked are fixed in it: {}", locked.join(", ")));
    }
    if language == Some(Language::Urdf) {
        remarks.of_joints_of_urdf();
    } else if let Some(names) = remarks.joints(&|l| l.mimic.is_some()) {
        remarks.say(&format!("that {names} follow other joints is left out"));
    }
    if language == Some(Language::Sdf) {
        remarks.of_frames_of_sdf();
        remarks.of_joint_names_of_sdf();
    }
    remarks.said
}

/// The remarks of a model on its way into the file of a path.
struct Remarks<'a> {
    model: &'a Model,
    path: &'a Path,
    said: Vec<String>,
}

impl Remarks<'_> {
    fn say(&mut self, text: &str) {
        self.said.push(format!("{}: {text}", self.path.display()));
    }

    /// Names the joints of some links; `None` if there are none.
    fn joints(&self, is: &dyn Fn(&ModelLink) -> bool) -> Option<String> {
        let links = self.model.links.iter().skip(1);
        let names: Vec<&str> = links.filter(|l| is(l)).map(|l| l.joint_name.as_str()).collect();
        (!names.is_empty()).then(|| names.join(", "))
    }

    /// Tells where rotors, springs and friction of joints are.
    fn of_passive_parameters(&mut self, language: Language) {
        let loses = |l: &ModelLink| {
            l.passive
                .iter()
                .any(|p| p.said_in(language, &l.link.joint) != p.said_in(Language::Mjcf, &l.link.joint))
        };
        if let Some(names) = self.joints(&loses) {
            self.say(&format!(
                "this language has no words for all rotors, springs and friction of {names}; write .xml \
                 (MJCF), which has"
            ));
        }
        let rotors =
            |l: &ModelLink| l.passive.iter().any(|p| p.said_in(language, &l.link.joint).armature != 0.0);
        if let Some(names) = self.joints(&rotors).filter(|_| language != Language::Mjcf) {
            self.say(&format!(
                "rotors of {names} are in <drake:rotor_inertia>, which Drake and this program read; Gazebo, \
                 Pinocchio, Isaac and MuJoCo's reader of URDF pass it over, and these joints then turn too \
                 easily: give them `armature` of {}, or write .xml (MJCF)",
                passive_table::path_beside(self.path).display()
            ));
        } else if !passive_table::passed_over(self.model, language).is_empty() {
            let table = passive_table::path_beside(self.path);
            self.say(&format!("the table beside it, {}, has them", table.display()));
        }
    }

    /// Tells of joints that URDF does not know.
    fn of_joints_of_urdf(&mut self) {
        if let Some(names) = self.joints(&|l| l.link.joint == Joint::Spherical) {
            self.say(&format!(
                "type=\"spherical\" of {names} is an extension of URDF that urdfdom, and with it ROS, \
                 refuses; write .xml (MJCF) or .sdf, which have such joints"
            ));
        }
        if let Some(names) = self.joints(&|l| matches!(l.link.joint, Joint::Universal(..))) {
            self.say(&format!(
                "URDF has no universal joint: {names} became two joints each, with a link without mass \
                 between"
            ));
        }
    }

    /// Tells of links without inertia, which SDF does not know.
    fn of_frames_of_sdf(&mut self) {
        let Ok(own) = Said::of(self.model) else { return };
        if let Some(base) = own.fixed_to_world() {
            self.say(&format!("{base}, a base without mass, is fixed to the world in it"));
        }
        let frames: Vec<&str> = own.frames.iter().map(|frame| frame.name.as_str()).collect();
        if !frames.is_empty() {
            self.say(&format!(
                "SDF gives a kilogram to a link without inertia: {} became frames of the links that they are \
                 fixed to",
                frames.join(", ")
            ));
        }
    }

    /// Tells of joints that have another name in SDF.
    fn of_joint_names_of_sdf(&mut self) {
        let renamed = self.model.separate_joint_names();
        let pairs = self.model.links.iter().zip(&renamed).skip(1).filter(|(l, name)| l.joint_name != **name);
        let pairs: Vec<String> = pairs.map(|(l, name)| format!("{} is {name}", l.joint_name)).collect();
        if !pairs.is_empty() {
            self.say(&format!("no joint can have the name of a link there: {}", pairs.join(", ")));
        }
    }
}

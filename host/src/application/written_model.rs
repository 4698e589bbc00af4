//! The model that is written of an answer: links, friction, rotors and springs as it has them.

use std::path::{Path, PathBuf};

use super::Error;
use super::loaded::{Loaded, StandardOptions};
use rigident_fit::Fit;
use rigident_identify::answer::Answer;
use rigident_identify::answer::result::{Complete, CompleteDrive, CompleteTerm};
use rigident_identify::answer::standard_parameters::nearest_with_rotors;
use rigident_model::passive::Passive;
use rigident_model::xml::Language;
use rigident_model::{Model, remarks, write};
use rigident_shared::tree::Joint;

/// A model that is to be written.
#[derive(Clone, Debug)]
pub struct WrittenModel {
    model: Model,
    source: Option<PathBuf>,
    path: PathBuf,
    /// The remarks that a user should know.
    pub remarks: Vec<String>,
}

impl WrittenModel {
    /// Returns the model of an answer; `None` where it has no standard parameters.
    pub(super) fn of(
        loaded: &Loaded,
        standard: &StandardOptions<'_>,
        fit: &Fit,
        answer: &Answer,
        path: &Path,
    ) -> Option<Self> {
        let ((nominal, source), found) = (loaded.nominal()?, answer.standard_parameters.as_ref()?);
        let links = found.links.iter().map(|link| (link.name.as_str(), link.parameters));
        let mut model = write::with_parameters(nominal, links);
        let mut said = Vec::new();
        let has_efforts = loaded.problem.tree().is_some_and(|source| source.input().has_efforts());
        if let Some(complete) = answer.complete.as_ref().filter(|_| has_efforts) {
            let mut drives = Drives { complete, inside: Vec::new(), said: Vec::new() };
            drives.choose_inside(path);
            let whole = (!drives.inside.is_empty())
                .then(|| nearest_with_rotors(fit, &loaded.links(standard)?, &complete.links))
                .flatten();
            match &whole {
                Some(full) => {
                    let links = full.links.iter().map(|link| (link.name.as_str(), link.parameters));
                    model = write::with_parameters(&model, links);
                    drives.say_inside();
                }
                None => drives.inside.clear(),
            }
            let passive = drives.passive(&model);
            model = write::with_passive(&model, passive.iter().map(|(name, own)| (name.as_str(), *own)));
            drives.say_lost();
            said = drives.said;
        }
        let mut remarks = remarks::remarks(&model, source, path, standard.locked);
        remarks.extend(said.into_iter().map(|text| format!("{}: {text}", path.display())));
        Some(Self { model, source: source.map(Path::to_owned), path: path.to_owned(), remarks })
    }

    /// Writes it and returns its path.
    ///
    /// # Errors
    /// [`Error::Model`] if the file cannot be written.
    pub fn write(&self) -> Result<&Path, Error> {
        write::write(&self.model, self.source.as_deref(), &self.path)?;
        Ok(&self.path)
    }
}

/// The values of drives in an answer, on the way into a model.
struct Drives<'a> {
    complete: &'a Complete,
    /// Names of the drives whose rotors go into links.
    inside: Vec<&'a str>,
    /// The values that a model does not hold.
    said: Vec<String>,
}

fn is_own(drive: &CompleteDrive) -> bool {
    drive.turns_with == drive.name
}

impl<'a> Drives<'a> {
    /// Chooses the rotors that no motion tells from links to be parts of these: where readers of the language
    /// pass over rotors, and where the nominal link has more inertia than link and rotor together.
    fn choose_inside(&mut self, path: &Path) {
        let is_passed_over = Language::of_path(path) != Some(Language::Mjcf);
        let rotor = |drive: &'a CompleteDrive| {
            let term = drive.terms.iter().find(|term| !term.together_with.is_empty())?;
            Some((drive.name.as_str(), term.value?))
        };
        let rotors: Vec<(&str, f64)> =
            self.complete.drives.iter().filter(|drive| is_own(drive)).filter_map(rotor).collect();
        if is_passed_over || rotors.iter().any(|(_, value)| *value < 0.0) {
            self.inside = rotors.into_iter().map(|(name, _)| name).collect();
        }
    }

    fn say_inside(&mut self) {
        self.said.push(format!(
            "rotors of {}, which no motion tells from the inertia of links, are in that of the links: right \
             as long as the base stands still",
            self.inside.join(", ")
        ));
    }

    /// Returns what the joints of a model do by themselves, all of which the answer has: what it has no term
    /// of is zero.
    fn passive(&mut self, model: &Model) -> Vec<(String, Passive)> {
        let one = |joint: &Joint<f64>| matches!(joint, Joint::Revolute(_) | Joint::Prismatic(_));
        let links = model.links.iter().skip(1).filter(|link| one(&link.link.joint));
        let mut all = Vec::new();
        for name in links.map(|link| link.joint_name.as_str()) {
            let drive = self.complete.drives.iter().find(|drive| is_own(drive) && drive.name == name);
            let terms = drive.map_or(&[][..], |drive| &drive.terms);
            all.push((name.to_owned(), self.of_terms(name, terms)));
        }
        all
    }

    fn of_terms(&mut self, name: &str, terms: &[CompleteTerm]) -> Passive {
        let value = |word: &str| terms.iter().find(|term| term.name() == word).and_then(|term| term.value);
        let (mut passive, mut negative) = (Passive::default(), Vec::new());
        let mut set = |word: &'static str, to: &mut f64| match value(word) {
            Some(value) if value >= 0.0 => *to = value,
            Some(_) => negative.push(word),
            None => {}
        };
        set("viscous", &mut passive.damping);
        set("coulomb", &mut passive.friction);
        set("spring", &mut passive.stiffness);
        if !self.inside.contains(&name) {
            set("rotor", &mut passive.armature);
        }
        // The constant beside a spring says where it is slack.
        if let Some(offset) = value("offset").filter(|_| passive.stiffness > 0.0) {
            passive.spring_reference = -offset / passive.stiffness;
        }
        if !negative.is_empty() {
            self.said.push(format!(
                "{} of {name} came out below zero, which no description can say: zero in it",
                negative.join(" and ")
            ));
        }
        passive
    }

    /// Says what descriptions have no words for.
    fn say_lost(&mut self) {
        for drive in &self.complete.drives {
            let has_spring = drive.terms.iter().any(|term| term.name() == "spring");
            let is_lost = |term: &&CompleteTerm| match term.name() {
                "stribeck" | "load" => true,
                "offset" => !has_spring,
                _ => !is_own(drive),
            };
            let lost: Vec<&str> = drive.terms.iter().filter(is_lost).map(CompleteTerm::name).collect();
            if !lost.is_empty() {
                self.said.push(format!(
                    "{} of {}{} are in result.json alone",
                    lost.join(", "),
                    drive.name,
                    if is_own(drive) { String::new() } else { format!(" = {}", drive.turns_with) }
                ));
            }
        }
    }
}

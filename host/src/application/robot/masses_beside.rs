//! What acts beside the model, in words and as objects.

use serde::Serialize;

use super::masses_rows::Read;
use rigident_fit::figures::significant;
use rigident_identify::mass_properties::beside::Found;
use rigident_rows::tree::Input;
use rigident_rows::tree::contact::COMPONENTS;
use rigident_rows::tree::unmodelled::Unmodelled;

/// A scale that is off by less is not worth a word.
const SLIGHT: f64 = 0.02;

/// Something that acts beside the model; masses are found without it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Eliminated {
    /// `wrench`, `force`, `unmeasured_wrench`, `effort_scale`, `effort_offset`, `friction`, `rotor`,
    /// `foot_scale`.
    pub kind: &'static str,
    /// The link, the joint, or the foot with the component of its wrench.
    pub of: String,
    /// Force, N, and moment, N m, of `wrench` in the base's axes; force, N, of `force` in axes that do not
    /// turn, z up, x where the base's is at the start; reading over value; offset, N m or N; rotor, kg m² or
    /// kg. Empty for `friction` and `unmeasured_wrench`, which have no one number.
    pub values: Vec<f64>,
}

impl Eliminated {
    /// Returns all that was found.
    pub(super) fn of(read: &Read) -> Vec<Self> {
        let source = read.loaded.first().and_then(|first| first.problem.tree());
        let Some(input) = source.map(|source| source.input()) else { return Vec::new() };
        let unmeasured = read.beside.unmeasured.map(|link| Self {
            kind: "unmeasured_wrench",
            of: link_name(input, link),
            values: Vec::new(),
        });
        unmeasured.into_iter().chain(read.beside.found.iter().map(|found| object(input, found))).collect()
    }
}

impl Eliminated {
    /// Returns it in words: kind, joint, link or foot, and its numbers.
    pub(super) fn in_words(&self) -> String {
        let (kind, unit) = match self.kind {
            "wrench" => ("a wrench on", " N and N m"),
            "force" => ("a force at", " N"),
            "unmeasured_wrench" => ("a wrench that is not measured at", ""),
            "effort_scale" => ("the scale of the effort of", ""),
            "effort_offset" => ("an offset of the effort of", " N m or N"),
            "friction" => ("friction of", ""),
            "rotor" => ("a rotor at", " kg m² or kg"),
            _ => ("the scale of", ""),
        };
        let values: Vec<String> = self.values.iter().map(|value| significant(*value, 3)).collect();
        if values.is_empty() {
            return format!("{kind} {}", self.of);
        }
        format!("{kind} {}: {}{unit}", self.of, values.join(", "))
    }

    /// Returns true if it is worth a word: a scale that is off by noise of the motion is not.
    fn counts(&self) -> bool {
        let is_scale = matches!(self.kind, "effort_scale" | "foot_scale");
        !is_scale || self.values.iter().any(|scale| (scale - 1.0).abs() > SLIGHT)
    }
}

fn link_name(input: &Input, link: usize) -> String {
    input.model.links.get(link).map_or_else(String::new, |link| link.name.clone())
}

fn object(input: &Input, found: &Found) -> Eliminated {
    let joints = input.freedom_names();
    let joint = |k: usize| joints.get(k).cloned().unwrap_or_default();
    let scale = || found.values.iter().map(|share| 1.0 / (1.0 - share)).collect();
    let as_they_are = || found.values.clone();
    let (kind, of, values) = match found.what {
        Unmodelled::BaseWrench => ("wrench", link_name(input, 0), as_they_are()),
        Unmodelled::Force(link) => ("force", link_name(input, link), as_they_are()),
        Unmodelled::Gain(k) => ("effort_scale", joint(k), scale()),
        Unmodelled::Offset(k) => ("effort_offset", joint(k), as_they_are()),
        Unmodelled::Rotor(k) => ("rotor", joint(k), as_they_are()),
        Unmodelled::Friction { freedom, .. } => ("friction", joint(freedom), Vec::new()),
        Unmodelled::FootScale { foot, component } => {
            let feet = input.contact.iter().flat_map(|contact| &contact.feet);
            let name = feet.map(|foot| foot.name.as_str()).nth(foot).unwrap_or("");
            let component = COMPONENTS.get(component).copied().unwrap_or("");
            ("foot_scale", format!("{name} {component}"), scale())
        }
    };
    Eliminated { kind, of, values }
}

/// Returns warnings of all that was found.
pub(super) fn warnings(all: &[Eliminated]) -> Vec<String> {
    let mut said = Vec::new();
    for own in all.iter().filter(|own| matches!(own.kind, "wrench" | "force")) {
        let force: Vec<String> = own.values.iter().take(3).map(|v| significant(*v, 3)).collect();
        let axes = if own.kind == "wrench" { "its axes" } else { "axes that do not turn, z up" };
        said.push(format!(
            "something beside the ground pulls at {}: a constant force of {} N in {axes} (a hose, a cable, a \
             rope, a hand, or zeros of the feet's sensors). It is eliminated, and with it most of what the \
             weight says of masses; take it away and record anew, or say `external_wrench` none if there is \
             nothing",
            own.of,
            force.join(", ")
        ));
    }
    for own in all.iter().filter(|own| own.kind == "unmeasured_wrench") {
        said.push(format!(
            "something pushes at {} all the time or at times that no sensor measures, as the ground does on a \
             foot whose sensor is missing or wrong: its wrench is eliminated; name its sensor in a [[foot]] \
             table, or what it does not measure",
            own.of
        ));
    }
    for (kind, words) in [
        ("effort_scale", "torques read a multiple of their value; gains of drives are wrong"),
        ("friction", "there is friction in joints that the columns of `friction` do not have"),
        ("rotor", "rotors behind gears act in joints; the columns of `friction` do not have them"),
        ("effort_offset", "torques have another zero"),
        ("foot_scale", "feet read a multiple of what acts on them"),
    ] {
        let each = all.iter().filter(|own| own.kind == kind && own.counts()).map(|own| {
            match own.values.as_slice() {
                [value] => format!("{} {}", own.of, significant(*value, 3)),
                _ => own.of.clone(),
            }
        });
        let each: Vec<String> = each.collect();
        if !each.is_empty() {
            said.push(format!("{words}: {}. It is eliminated", each.join(", ")));
        }
    }
    said
}

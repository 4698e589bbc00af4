//! A table of what joints do by themselves, beside a model in a language whose readers pass over some of it.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use rigident_shared::tree::Joint;

use super::passive::Passive;
use super::tree::Model;
use super::xml::Language;

/// The first lines of a table.
const HEAD: [&str; 4] = [
    "# What joints do by themselves: effort = armature * acceleration + damping * rate + friction * \
     sign(rate)",
    "# + stiffness * (position - spring_reference), in kg m2, N m s/rad, N m, N m/rad and rad, of joints \
     that slide in",
    "# kg, N s/m, N, N/m and m. MuJoCo's joints have the same words, but for frictionloss and springref; \
     Isaac Lab's",
    "# actuators and Pinocchio's model have armature, damping and friction, too.",
];

/// Returns the path of the table beside a model: `arm.urdf.joints.yaml` of `arm.urdf`, as `arm.sdf` has its
/// own.
pub fn path_beside(path: &Path) -> PathBuf {
    path.with_added_extension("joints.yaml")
}

/// Returns the names of the joints with a rotor or a spring, which readers of URDF or SDF may pass over.
pub(super) fn passed_over(model: &Model, language: Language) -> Vec<&str> {
    if language == Language::Mjcf {
        return Vec::new();
    }
    let has = |passive: &Passive| passive.armature != 0.0 || passive.stiffness != 0.0;
    let links = model.links.iter().skip(1).filter(|link| link.link.joint != Joint::Free);
    links.filter(|link| link.passive.iter().any(has)).map(|link| link.joint_name.as_str()).collect()
}

/// Returns the table of a model in a language, with its path; `None` where every reader of the model has all
/// of it.
pub(super) fn of(model: &Model, language: Language, path: &Path) -> Option<(PathBuf, String)> {
    if passed_over(model, language).is_empty() {
        return None;
    }
    let mut text = HEAD.join("\n") + "\n";
    type Of = fn(&Passive) -> f64;
    let terms: [(&str, Of); 5] = [
        ("armature", |p| p.armature),
        ("damping", |p| p.damping),
        ("friction", |p| p.friction),
        ("stiffness", |p| p.stiffness),
        ("spring_reference", |p| p.spring_reference),
    ];
    for (word, term) in terms {
        let mut rows = String::new();
        for link in model.links.iter().skip(1) {
            let own = link.passive.map(|passive| term(&passive));
            // A string of JSON is one of YAML.
            let name = serde_json::Value::from(link.joint_name.as_str());
            let _ = match link.link.joint {
                Joint::Fixed | Joint::Free => Ok(()),
                Joint::Universal(..) if own != [0.0; 2] => {
                    writeln!(rows, "  {name}: [{}, {}]", own[0], own[1])
                }
                _ if own[0] != 0.0 => writeln!(rows, "  {name}: {}", own[0]),
                _ => Ok(()),
            };
        }
        if !rows.is_empty() {
            let _ = write!(text, "{word}:\n{rows}");
        }
    }
    Some((path_beside(path), text))
}

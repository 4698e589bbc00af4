//! The arm that a rig file describes: its model's way from the base to the flange.

use std::path::Path;

use hexapod::{Arm, Hinge, Mounting};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use rigident_io::rig::{ArmTable, OfJoints};
use rigident_model::{Model, ModelLink, read_file};
use rigident_shared::tree::Joint;

/// Returns the arm of a table.
///
/// # Errors
/// In words: a model that cannot be read, or whose way to the flange is not six hinges with limits.
pub fn arm(table: &ArmTable) -> Result<Arm, String> {
    let path = &table.model;
    let (model, _) = read_file(Path::new(path)).map_err(|e| e.to_string())?;
    let (hinges, flange) = way(&model, &table.flange).map_err(|why| format!("{path}: {why}"))?;
    let rates = table.rate_radps.as_ref().map(OfJoints::each);
    let accelerations = table.acceleration_radps2.each();
    let hinge = |(i, (link, place)): (usize, &(&ModelLink, Mounting))| {
        let Joint::Revolute(axis) = link.link.joint else {
            return Err(format!("{path}: joint {} is no hinge", link.joint_name));
        };
        let name = link.joint_name.clone();
        let [low, high] = link.limits.position.filter(|[low, high]| low < high).ok_or(format!(
            "{path}: joint {name} has no range of positions: add <limit lower=\"…\" upper=\"…\"/> to it"
        ))?;
        let given = rates.map(|rates| rates[i]);
        let rate_radps = match (link.limits.velocity, given) {
            (Some(own), Some(given)) => own.min(given),
            (Some(rate), None) | (None, Some(rate)) => rate,
            (None, None) => {
                return Err(format!(
                    "{path}: joint {name} has no limit of velocity: give [platform.arm] rate_radps in the \
                     rig file"
                ));
            }
        };
        let home = table.home_rad[i];
        if !(low..=high).contains(&home) {
            return Err(format!(
                "home_rad: joint {name} goes from {low} to {high} rad, and home is {home} rad"
            ));
        }
        Ok(Hinge {
            name,
            place: *place,
            axis: axis.into(),
            range_rad: [low, high],
            rate_radps,
            acceleration_radps2: accelerations[i],
        })
    };
    let hinges = hinges.iter().enumerate().map(hinge).collect::<Result<Vec<_>, _>>()?;
    let number = hinges.len();
    let hinges = <[Hinge; 6]>::try_from(hinges).map_err(|_| {
        format!("{path}: {number} joints lead to the link {}, and an arm has six", table.flange)
    })?;
    Ok(Arm { hinges, flange, home_rad: table.home_rad, payload_kg: table.payload_kg })
}

/// Joints with their places in the frame of the joint before, and the flange in that of the last.
type Way<'a> = (Vec<(&'a ModelLink, Mounting)>, Mounting);

/// Returns the way from the base to a link.
fn way<'a>(model: &'a Model, flange: &str) -> Result<Way<'a>, String> {
    let known = |name: &str| model.links.iter().position(|link| link.name == name);
    let mut at = known(flange).ok_or_else(|| {
        let names: Vec<&str> = model.links.iter().map(|link| link.name.as_str()).collect();
        format!("there is no link {flange}: there are {}", names.join(", "))
    })?;
    let mut links = Vec::new();
    while at != 0 {
        links.push(&model.links[at]);
        at = model.links[at].link.parent;
    }
    let (mut position, mut rotation) = (Vector3::zeros(), Matrix3::identity());
    let mut hinges = Vec::new();
    for link in links.into_iter().rev() {
        position += rotation * link.link.position;
        rotation *= link.link.rotation;
        if link.mimic.is_some() {
            return Err(format!(
                "joint {} follows another one: an arm's joints are its own",
                link.joint_name
            ));
        }
        if link.link.joint != Joint::Fixed {
            hinges.push((link, mounting(&position, &rotation)));
            (position, rotation) = (Vector3::zeros(), Matrix3::identity());
        }
    }
    Ok((hinges, mounting(&position, &rotation)))
}

fn mounting(position: &Vector3<f64>, rotation: &Matrix3<f64>) -> Mounting {
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*rotation));
    Mounting { position_m: (*position).into(), rotation_wxyz: [turn.w, turn.i, turn.j, turn.k] }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: &str = "<limit lower=\"-3\" upper=\"3\" velocity=\"2\" effort=\"50\"/>";

    fn urdf(limit: &str) -> String {
        let mut text = "<robot name=\"a\"><link name=\"base\"/>".to_owned();
        let mut parent = "base".to_owned();
        for i in 1..=6 {
            let axis = if i % 2 == 0 { "0 1 0" } else { "0 0 1" };
            text += &format!(
                "<link name=\"l{i}\"/><joint name=\"j{i}\" type=\"revolute\"><parent \
                 link=\"{parent}\"/><child link=\"l{i}\"/><origin xyz=\"0 0 0.1\" rpy=\"0.1 0 0\"/><axis \
                 xyz=\"{axis}\"/>{limit}</joint>"
            );
            parent = format!("l{i}");
        }
        text + "<link name=\"tool\"/><joint name=\"fixed\" type=\"fixed\"><parent link=\"l6\"/><child \
                link=\"tool\"/><origin xyz=\"0 0 0.05\" rpy=\"0 0 0\"/></joint></robot>"
    }

    fn read(text: &str, change: impl Fn(&mut ArmTable)) -> Result<Arm, String> {
        let folder = tempfile::tempdir().unwrap();
        let model = folder.path().join("arm.urdf");
        std::fs::write(&model, text).unwrap();
        let mut table = ArmTable {
            model: model.display().to_string(),
            flange: "tool".to_owned(),
            home_rad: [0.1; 6],
            acceleration_radps2: OfJoints::Every(5.0),
            rate_radps: None,
            payload_kg: Some(3.0),
        };
        change(&mut table);
        arm(&table)
    }

    #[test]
    fn the_way_to_the_flange_is_six_hinges_with_the_models_limits() {
        let found = read(&urdf(LIMITS), |table| {
            table.rate_radps = Some(OfJoints::Each([1.0, 9.0, 1.0, 1.0, 1.0, 1.0]));
        })
        .unwrap();
        assert_eq!(found.hinges[1].name, "j2");
        assert_eq!(found.hinges[1].axis, [0.0, 1.0, 0.0]);
        // The lesser of the two.
        assert_eq!(found.hinges.each_ref().map(|h| h.rate_radps), [1.0, 2.0, 1.0, 1.0, 1.0, 1.0]);
        assert_eq!(found.hinges[5].range_rad, [-3.0, 3.0]);
        assert_eq!(found.flange.position_m, [0.0, 0.0, 0.05]);
        let [w, x, ..] = found.hinges[3].place.rotation_wxyz;
        assert!((w - 0.05_f64.cos()).abs() < 1e-12 && (x - 0.05_f64.sin()).abs() < 1e-12);
    }

    #[test]
    fn faults_of_the_model_and_of_the_table_are_named() {
        let good = urdf(LIMITS);
        let without = urdf("");
        for (text, change, words) in [
            (
                &good,
                (&|t: &mut ArmTable| t.flange = "hand".to_owned()) as &dyn Fn(&mut ArmTable),
                "no link hand",
            ),
            (&good, &|t| t.flange = "l5".to_owned(), "5 joints lead to the link l5, and an arm has six"),
            (&good, &|t| t.home_rad[2] = 3.5, "joint j3 goes from -3 to 3 rad, and home is 3.5 rad"),
            (&without, &|_| (), "range of positions"),
        ] {
            let error = read(text, change).unwrap_err();
            assert!(error.contains(words), "{error}");
        }
    }
}

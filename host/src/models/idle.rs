//! Motions that cannot tell what is asked of them: joints that never move, a base that does not.

use nalgebra::Vector3;

use super::finding::Finding;
use super::model::Model;

/// Joints of the model whose coordinates are the same in every frame, and a base without turning. Frames hold the
/// coordinates of all joints as [`super::rows::Moving::set`] takes them, and the base's angular rate, rad/s.
///
/// Exactly the same: what noise looks like is for the residuals to say, not for a limit here.
pub fn idle(model: &Model, frames: &[(Vec<f64>, Vector3<f64>)]) -> Vec<Finding> {
    let finding = |place: String, text: &str| Finding { place, text: text.to_owned() };
    let Some((first, _)) = frames.first() else {
        return vec![finding("recording".to_owned(), "has no frames: nothing can be identified from it")];
    };
    let mut found = Vec::new();
    let mut at = 0;
    for link in model.links.iter().skip(1) {
        let range = at..at + link.link.joint.coordinates();
        at = range.end;
        let moves = frames.iter().any(|(q, _)| q.get(range.clone()) != first.get(range.clone()));
        if !range.is_empty() && !moves {
            found.push(finding(
                format!("joint {}", link.joint_name),
                "never moves in these frames: what is beyond it is identified only as one body with what it hangs on; \
                 move it, or say --lock",
            ));
        }
    }
    if frames.iter().all(|(_, rate)| *rate == Vector3::zeros()) {
        found.push(finding(
            format!("link {}", model.links.first().map_or("base", |l| l.name.as_str())),
            "the base never turns in these frames: its own inertia is not identified, and of what hangs on it only what \
             joints and gravity show",
        ));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::human::Person;

    #[test]
    fn joints_that_never_move_and_bases_that_never_turn_are_named() {
        let model = Person::default().human34().unwrap();
        let coordinates: usize = model.links.iter().skip(1).map(|l| l.link.joint.coordinates()).sum();
        let knee = model.link("l_shank").unwrap();
        let at: usize = model.links[1..knee].iter().map(|l| l.link.joint.coordinates()).sum();
        let frame = |n: usize, turning: f64| {
            let mut q: Vec<f64> = (0..coordinates).map(|k| (k + n) as f64).collect();
            q[at] = 0.3;
            (q, Vector3::z() * turning)
        };
        let said: Vec<String> =
            idle(&model, &[frame(0, 0.1), frame(1, 0.2)]).iter().map(ToString::to_string).collect();
        assert_eq!(said.len(), 1, "{said:?}");
        assert!(said[0].starts_with("joint l_shank_joint: never moves"), "{said:?}");
        let said: Vec<String> =
            idle(&model, &[frame(0, 0.0), frame(1, 0.0)]).iter().map(ToString::to_string).collect();
        assert!(said[1].starts_with("link pelvis: the base never turns"), "{said:?}");
        assert!(idle(&model, &[])[0].text.contains("no frames"));
    }
}

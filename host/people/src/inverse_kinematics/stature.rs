//! The stature by the markers, of a frame in which somebody is upright, else by the length of the legs.

use super::skeleton::{Pose, Skeleton};
use rigident_model::Model;
use rigident_model::human::Person;

/// Nobody is upright whose knee or hip bends by more than this on either side, rad.
const UPRIGHT: f64 = 0.6;
/// The distance from hip to ankle over the stature (assumed): 0.491 by R. Drillis and R. Contini (1966),
/// 0.462 and 0.492 of women and men by P. de Leva (1996).
const LEGS: f64 = 0.485;
/// A stature that is given is doubtful if it differs by more than this from that of an upright frame, and by
/// the length of legs, relative; …
const DOUBTFUL: [f64; 2] = [0.1, 0.15];
/// … and another person's, or in another unit, if it differs by this many times as much.
const IMPOSSIBLE: f64 = 2.0;

/// A stature by the markers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stature {
    /// The stature, m.
    pub height_m: f64,
    /// True if somebody is upright in the frame that it comes from, false if it comes from the legs.
    pub upright: bool,
}

impl Stature {
    /// Returns true if a stature that is given contradicts it.
    pub fn contradicts(&self, given_m: f64) -> bool {
        self.off(given_m) > self.doubtful()
    }

    /// Returns true if a stature that is given cannot be that of the person with the markers.
    pub(super) fn rules_out(&self, given_m: f64) -> bool {
        self.off(given_m) > IMPOSSIBLE * self.doubtful()
    }

    fn off(&self, given_m: f64) -> f64 {
        (given_m / self.height_m - 1.0).abs()
    }

    fn doubtful(&self) -> f64 {
        DOUBTFUL[usize::from(!self.upright)]
    }
}

/// Returns the frame in which the person stands straightest, by its number; `None` if she is upright in none.
/// The first frame is preferred: it is a standing trial's if there is one.
pub(super) fn upright_frame(model: &Model, skeleton: &Skeleton, poses: &[Pose]) -> Option<usize> {
    let bends: Vec<f64> = poses.iter().map(|pose| bend(model, skeleton, pose)).collect();
    let is_upright = |frame: &usize| bends.get(*frame).is_some_and(|bend| *bend < UPRIGHT);
    let straightest = (0..bends.len()).min_by(|a, b| bends[*a].total_cmp(&bends[*b]));
    Some(0).filter(is_upright).or(straightest.filter(is_upright))
}

/// Returns the stature by the length of the legs.
pub(super) fn by_legs(person: &Person) -> Option<Stature> {
    let legs_m = person.length("thigh")? + person.length("shank")?;
    Some(Stature { height_m: legs_m / LEGS, upright: false })
}

/// Returns how much knee and hip bend, the more of both, of the straighter side, rad: who steps is upright.
fn bend(model: &Model, skeleton: &Skeleton, pose: &Pose) -> f64 {
    let places = skeleton.places(pose);
    let axis = |name: &str| {
        let (turn, _) = places.get(model.link(name)?)?;
        Some(turn.column(2).into_owned())
    };
    let between = |a: &str, b: &str| Some(axis(a)?.dot(&axis(b)?).clamp(-1.0, 1.0).acos());
    let trunk = if model.link("torso").is_some() { "torso" } else { "chest" };
    let of = |side: &str| {
        let (thigh, shank) = (format!("{side}_thigh"), format!("{side}_shank"));
        Some(between(trunk, &thigh)?.max(between(&thigh, &shank)?))
    };
    ["l", "r"].into_iter().filter_map(of).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse_kinematics::skeleton::Turn;
    use nalgebra::{UnitQuaternion, Vector3};

    #[test]
    fn who_sits_or_squats_is_not_upright_and_who_steps_is() {
        let model = Person::default().human34().unwrap();
        let skeleton = Skeleton::new(&model).unwrap();
        let bent = |sides: &[&str], angle: f64| {
            let mut pose = skeleton.zero();
            for side in sides {
                let forward = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -angle);
                pose.turns[model.link(&format!("{side}_thigh")).unwrap()] = Turn::Ball(forward);
                pose.turns[model.link(&format!("{side}_shank")).unwrap()] = Turn::Hinge(angle);
            }
            pose
        };
        let [sits, steps, squats] = [bent(&["l", "r"], 1.5), bent(&["r"], 1.0), bent(&["l", "r"], 0.8)];
        let of = |poses: &[Pose]| upright_frame(&model, &skeleton, poses);
        assert_eq!(of(&[sits.clone(), squats.clone()]), None);
        assert_eq!(of(&[sits.clone(), squats, skeleton.zero()]), Some(2));
        assert_eq!(of(&[sits, steps.clone()]), Some(1));
        assert_eq!(of(&[steps, skeleton.zero()]), Some(0));
    }

    #[test]
    fn a_stature_that_is_given_is_compared_with_that_of_the_markers() {
        let found = Stature { height_m: 1.6, upright: true };
        assert!(!found.contradicts(1.7) && found.contradicts(1.8));
        assert!(!found.rules_out(1.85) && found.rules_out(1.2));
        // Legs tell less.
        assert!(!Stature { upright: false, ..found }.contradicts(1.8));
    }
}

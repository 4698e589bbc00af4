//! Soft tissue: markers slide over the bones with the angles of the joints on either side of a segment.
//!
//! What all markers of a segment do together, a shift and a turn, is the larger part of it, and nothing in
//! the markers' own distances tells of it (R. Dumas, V. Camomilla, T. Bonci, L. Cheze, A. Cappozzo,
//! "Generalized mathematical representation of the soft tissue artefact", J. Biomechanics 47 (2), 2014). It
//! is the same whenever a pose comes back, so that no repetition averages it. The sizes are of the order
//! that A. Leardini, L. Chiari, U. Della Croce and A. Cappozzo review (Gait & Posture 21 (2), 2005): 10 to
//! 30 mm on the thigh, less than 15 mm on the shank; a trunk bends along its spine, and shoulders glide
//! with the arms.

use nalgebra::{Matrix3, Vector3};
use rigident_shared::tree::Joint;

use super::markers::{Attached, Seen};
use super::skeleton::{Pose, Skeleton, Turn};
use super::subject::Subject;

/// 1 σ along each axis while a joint turns by a right angle about one: of the common shift of a segment's
/// markers (m), of their common turn (rad), of each marker by itself (m) [assumed].
type Sizes = [f64; 3];

fn sizes(link: &str) -> Sizes {
    match link.split_once('_').map_or(link, |(_, core)| core) {
        "torso" | "lumbar" | "chest" | "thigh" | "upper_arm" | "clavicle" | "scapula" => [0.010, 0.05, 0.006],
        "pelvis" => [0.006, 0.03, 0.004],
        "shank" | "forearm" | "ulna" | "radius" | "hand" => [0.005, 0.03, 0.003],
        _ => [0.002, 0.01, 0.001],
    }
}

/// The way markers slide.
pub struct Soft {
    /// Of each marker, in the order of the subject's: for joints beside its segment, by the link beyond, the
    /// slide in the segment's axes of unit sines of its turns, m.
    slides: Vec<Vec<(usize, Matrix3<f64>)>>,
    /// The mean sine vector of every joint: what is constant is where markers were found.
    means: Vec<Vector3<f64>>,
}

impl Soft {
    /// Returns a way that markers may slide, about the mean of some poses, with independent numbers of
    /// variance 1 from `unit`.
    pub fn drawn(subject: &Subject, poses: &[Pose], mut unit: impl FnMut() -> f64) -> Self {
        let links = subject.skeleton.links();
        let mut matrix = |size: f64| Matrix3::from_fn(|_, _| size * unit());
        let mut common: Vec<Vec<(usize, [Matrix3<f64>; 2])>> = Vec::new();
        for (k, link) in subject.model.links.iter().enumerate() {
            let [shift, turn, _] = sizes(&link.name);
            let beside = (1..links.len()).filter(|j| *j == k || links[*j].parent == k);
            common.push(beside.map(|j| (j, [matrix(shift), matrix(turn)])).collect());
        }
        let middles = middles(&subject.markers, links.len());
        let slides = subject.markers.iter().map(|marker| {
            let [.., own] = sizes(&subject.model.links[marker.link].name);
            let arm = (marker.position_m - middles[marker.link]).cross_matrix();
            let each = common[marker.link].iter();
            // ρ × a = −[a]× ρ
            each.map(|(j, [shift, turn])| (*j, shift - arm * turn + matrix(own))).collect()
        });
        let slides = slides.collect();
        let sum = |j: usize| poses.iter().map(|pose| sine(&subject.skeleton, pose, j)).sum::<Vector3<f64>>();
        let means = (0..links.len()).map(|j| sum(j) / poses.len().max(1) as f64).collect();
        Self { slides, means }
    }

    /// Takes the slides of a pose from where markers were seen.
    pub fn take_from(&self, subject: &Subject, pose: &Pose, seen: &mut Seen) {
        let skeleton = &subject.skeleton;
        let places = skeleton.places(pose);
        let turns: Vec<Vector3<f64>> =
            self.means.iter().enumerate().map(|(j, mean)| sine(skeleton, pose, j) - mean).collect();
        for ((marker, slides), seen) in subject.markers.iter().zip(&self.slides).zip(seen) {
            let slide: Vector3<f64> = slides.iter().map(|(j, each)| each * turns[*j]).sum();
            if let Some(seen) = seen {
                *seen -= places[marker.link].0 * slide;
            }
        }
    }
}

/// Returns the middle of the markers of each link, in its axes, m.
fn middles(markers: &[Attached], links: usize) -> Vec<Vector3<f64>> {
    let of = |link: usize| {
        let own = markers.iter().filter(|marker| marker.link == link);
        let (sum, count) = own.fold((Vector3::zeros(), 0), |(sum, n), m| (sum + m.position_m, n + 1));
        sum / f64::from(count.max(1))
    };
    (0..links).map(of).collect()
}

/// Returns the axis of a joint's turn times the sine of its angle: the same of either quaternion, and without
/// a jump.
fn sine(skeleton: &Skeleton, pose: &Pose, joint: usize) -> Vector3<f64> {
    match (pose.turns.get(joint), skeleton.links().get(joint).map(|link| link.joint)) {
        (Some(Turn::Hinge(angle)), Some(Joint::Revolute(axis))) => axis * angle.sin(),
        (Some(Turn::Ball(turn)), _) if joint > 0 => turn.imag() * (2.0 * turn.w),
        _ => Vector3::zeros(),
    }
}

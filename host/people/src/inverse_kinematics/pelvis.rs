//! The pelvis by its four spines: hips, and the spine's lowest joint.

use nalgebra::Vector3;

use super::known::{ANATOMICAL_M, Known};
use super::markers::Attached;
use super::skeleton::Skeleton;

use rigident_model::Model;
use rigident_model::human::{Person, SPINE_BEHIND};

/// The height of the lowest joint of the spine above midway between the hips over the stature, axes of the
/// pelvis' four spines: 150 mm at 1.80 m, as in scaled models of gait (S. Delp et al. 1990: 148 mm).
const SPINE_ABOVE: f64 = 0.0833;
/// The distance that it may be from there, 1 σ, m (assumed).
pub(super) const LOWEST_JOINT_SIGMA_M: [f64; 3] = [0.012, 0.004, 0.012];

/// Sets hips and the pelvis' markers to the regression of Harrington et al. (2007) on the width and depth of
/// the pelvis, where its four spines were seen.
///
/// Returns true if they were. From the middle of the front spines, forward, outward and up, m:
/// `−0.24 d − 0.0099`, `0.33 w + 0.0073`, `−0.30 w − 0.0109`.
pub(super) fn pelvis(
    skeleton: &mut Skeleton,
    markers: &mut [Attached],
    frames: &[Vec<Option<Vector3<f64>>>],
    (model, person, known): (&Model, &Person, &Known),
) -> bool {
    let front = spines(markers, true);
    let rear = spines(markers, false);
    let ([Some(l), Some(r)], false) = (front, rear == [None, None]) else { return false };
    let sizes = frames.iter().filter_map(|frame| {
        let of = |k: usize| frame.get(markers[k].label).copied().flatten();
        let (l, r) = (of(l)?, of(r)?);
        let behind: Vec<Vector3<f64>> = rear.iter().flatten().filter_map(|k| of(*k)).collect();
        let middle = behind.iter().sum::<Vector3<f64>>() / behind.len() as f64;
        (!behind.is_empty()).then(|| ((l - r).norm(), ((l + r) / 2.0 - middle).norm()))
    });
    let (mut widths, mut depths): (Vec<f64>, Vec<f64>) = sizes.unzip();
    if widths.is_empty() {
        return false;
    }
    let median = |v: &mut Vec<f64>| {
        v.sort_by(f64::total_cmp);
        v[v.len() / 2]
    };
    let (width, depth) = (median(&mut widths), median(&mut depths));
    let (forward, up) = (0.24 * depth + 0.0099, 0.30 * width + 0.0109);
    for (k, side) in [(l, 1.0), (r, -1.0)] {
        markers[k].position_m = Vector3::new(forward, side * width / 2.0, up);
    }
    for k in rear.into_iter().flatten() {
        let side = markers[k].position_m.y;
        markers[k].position_m = Vector3::new(forward - depth, side, up);
    }
    for (name, side) in [("l_thigh", 1.0), ("r_thigh", -1.0)] {
        if let Some(link) = model.link(name) {
            let to = side * known.length("hip_width").map_or(0.33 * width + 0.0073, |apart| apart / 2.0);
            let to = Vector3::new(0.0, to, 0.0);
            let by = to - skeleton.links()[link].position;
            skeleton.shift(link, &by);
        }
    }
    if let Some(link) = trunk(model) {
        let to = Vector3::new(-SPINE_BEHIND, 0.0, SPINE_ABOVE) * person.height_m;
        let by = to - skeleton.links()[link].position;
        skeleton.shift(link, &by);
    }
    true
}

/// Returns the link whose joint is the lowest of the spine.
pub(super) fn trunk(model: &Model) -> Option<usize> {
    model.link("torso").or_else(|| model.link("lumbar"))
}

/// Returns the markers on the left and right, front or rear, spines of the pelvis; one on the sacrum counts
/// as both rear ones.
fn spines(markers: &[Attached], front: bool) -> [Option<usize>; 2] {
    let find = |left: bool| {
        markers.iter().position(|m| {
            let at = m.position_m;
            let side = if left { at.y > 0.02 } else { at.y < -0.02 };
            m.link == 0
                && m.position_sigma_m < ANATOMICAL_M
                && (at.x > 0.0) == front
                && (side || (!front && at.y.abs() < 0.02))
        })
    };
    [find(true), find(false)]
}

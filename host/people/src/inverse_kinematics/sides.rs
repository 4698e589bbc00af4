//! Markers whose names have left and right exchanged.

use nalgebra::Vector3;

use super::landmarks::Naming;
use super::markers::{Attached, Seen};
use super::skeleton::{Pose, Skeleton};

/// A marker is at a wrong place from this distance on, m, …
const WRONG_M: f64 = 0.1;
/// … and belongs to the other side if it is nearer to that by this factor.
const NEARER: f64 = 0.5;
/// A whole set is exchanged if it fits this much better the other way round.
const BETTER: f64 = 0.7;

/// Returns the numbers of markers that are the same on either side, left first.
fn pairs(markers: &[Attached]) -> Vec<(usize, usize)> {
    let names: Vec<String> = markers.iter().map(|m| m.name.clone()).collect();
    let naming = Naming::of(&names);
    let sides: Vec<Option<(String, f64)>> = names.iter().map(|name| naming.sided(name)).collect();
    let left = sides.iter().enumerate().filter(|(_, side)| side.as_ref().is_some_and(|(_, s)| *s > 0.0));
    let pair = |(l, side): (usize, &Option<(String, f64)>)| {
        let (core, _) = side.as_ref()?;
        let is_right =
            |other: &Option<(String, f64)>| other.as_ref().is_some_and(|(c, s)| c == core && *s < 0.0);
        Some((l, sides.iter().position(is_right)?))
    };
    left.filter_map(pair).collect()
}

/// Returns frames with left and right exchanged.
pub(super) fn exchanged(markers: &[Attached], seen: &Seen) -> Seen {
    let mut out = seen.clone();
    for (l, r) in pairs(markers) {
        out.swap(l, r);
    }
    out
}

/// Returns true if markers fit much better with left and right exchanged, by what a fit of either leaves, m.
pub(super) fn is_exchanged(as_named: f64, exchanged: f64) -> bool {
    exchanged < BETTER * as_named
}

/// Returns the pair of markers that are exchanged in poses that the others tell, if there is one.
pub(super) fn exchanged_pair(
    skeleton: &Skeleton,
    markers: &[Attached],
    seen: &[Seen],
    poses: &[Pose],
) -> Option<(String, String)> {
    let pairs = pairs(markers);
    let mut sums = vec![(0.0, 0.0, 0.0); pairs.len()];
    for (frame, pose) in seen.iter().zip(poses) {
        let places = skeleton.places(pose);
        let at = |k: usize| -> Vector3<f64> {
            let (turn, origin) = &places[markers[k].link];
            origin + turn * markers[k].position_m
        };
        for ((l, r), sum) in pairs.iter().zip(&mut sums) {
            let (Some(a), Some(b)) = (frame[*l], frame[*r]) else { continue };
            sum.0 += (a - at(*l)).norm() + (b - at(*r)).norm();
            sum.1 += (a - at(*r)).norm() + (b - at(*l)).norm();
            sum.2 += 2.0;
        }
    }
    let found = pairs
        .iter()
        .zip(&sums)
        .find(|(_, (own, other, count))| *count > 0.0 && own / count > WRONG_M && *other < NEARER * own);
    found.map(|((l, r), _)| (markers[*l].name.clone(), markers[*r].name.clone()))
}

//! Checks whether force plates have measured everything that a person touches.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::inverse_kinematics::skeleton::Place;
use crate::inverse_kinematics::subject::Subject;
use rigident_fit::parallel;
use rigident_io::motion_capture::ground::GroundWrench;

/// A point of the sole is on the floor if it is no higher above it, m, …
pub(super) const LOW_M: f64 = 0.02;
/// … and no faster, m/s.
const SLOW_MPS: f64 = 0.5;
/// A plate is loaded from this vertical force on, N.
pub(super) const LOADED_N: f64 = 25.0;
/// Both feet press a plate with more than this, N: of a light load the centre of pressure is anywhere.
const BOTH_N: f64 = 150.0;
/// A centre of pressure is under a foot if it is no further from its sole, m.
const BESIDE_M: f64 = 0.12;
/// A plate's moments are off by this, N m: a small load's centre of pressure is known the less.
const MOMENT_NM: f64 = 4.0;
/// A foot stands for at least this long, s: one that lands or leaves is low and slow for less.
const STANDS_S: f64 = 0.08;
/// Frames beside one that is dropped are dropped, too, s: when a foot lands is not known better.
const BESIDE_S: f64 = 0.04;

/// Smoothing plates takes at most this long at either end, s.
const EDGE_S: f64 = 0.2;

/// Why a frame is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Dropped {
    /// No pose was found: markers are missing, and the others leave a joint open.
    Markers,
    /// A foot is on the floor beside the plates.
    FootOff,
    /// A foot is partly beside the plates.
    FootHalfOff,
    /// A plate is loaded where no foot is.
    LoadElsewhere,
    /// Something that no plate measures pushes.
    Unmeasured,
    /// The recording of the plates is not there.
    NoForce,
    /// The recording of the plates begins or ends within the width of their smoothing.
    Edge,
}

impl Dropped {
    /// Returns the reason in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Markers => "markers are missing, and the others give no pose",
            Self::FootOff => "a foot is on the floor beside the plates",
            Self::FootHalfOff => "a foot is partly beside a plate",
            Self::LoadElsewhere => "a plate is loaded where no foot is",
            Self::Unmeasured => "something that no plate measures pushes",
            Self::NoForce => "the plates recorded nothing",
            Self::Edge => "so near to the beginning or the end that forces cannot be smoothed",
        }
    }
}

/// The places of soles in a frame, m, laboratory axes: heel and ball, inner and outer. Toes bend, and are
/// left out.
pub(super) type Soles = [[Vector3<f64>; 4]; 2];
/// The places of soles in a frame in single precision, as they are stored for every frame, m, laboratory
/// axes.
pub type KeptSoles = [[[f32; 3]; 4]; 2];

pub(super) fn expanded(soles: &KeptSoles) -> Soles {
    soles.map(|sole| sole.map(|p| point(&p)))
}

fn point([x, y, z]: &[f32; 3]) -> Vector3<f64> {
    Vector3::new(f64::from(*x), f64::from(*y), f64::from(*z))
}

/// The information of plates and feet for every frame.
pub struct Contact {
    /// Reasons why frames are not used.
    pub dropped: Vec<Option<Dropped>>,
    /// Distances of centres of pressure from the nearest sole, where a plate is loaded, m.
    pub beside_m: Vec<f32>,
    /// Frames in which one plate alone is loaded and one foot is clearly lower: those with the load nearer to
    /// that foot, and nearer to the one in the air.
    pub single: [usize; 2],
}

/// The wrenches of all plates in a frame; `None` where one is not known.
pub type Loads<'a> = &'a (dyn Fn(usize) -> Option<Vec<[f64; 6]>> + Sync);

/// Judges every frame: `soles` are where feet are.
pub fn contact(rate_hz: f64, soles: &[Option<KeptSoles>], plates: &[GroundWrench], loads: Loads) -> Contact {
    let floor = sunken(soles);
    let belt = belt(soles, rate_hz, plates, loads);
    let mut found = Contact { dropped: vec![None; soles.len()], beside_m: Vec::new(), single: [0; 2] };
    parallel::in_order(soles.len(), loads, |frame, loads| {
        let Some(own) = &soles[frame].as_ref().map(expanded) else {
            found.dropped[frame] = Some(Dropped::Markers);
            return;
        };
        let Some(loads) = loads else {
            found.dropped[frame] = Some(Dropped::Edge);
            return;
        };
        let height = own.iter().flatten().map(|p| p.z).fold(f64::INFINITY, f64::min);
        for (load, plate) in loads.iter().zip(plates).filter(|(load, _)| load[2] > LOADED_N) {
            let pressed = pressure(load, level(plate, height));
            let mut away = own.iter().map(|sole| beyond(sole, &pressed)).fold(f64::INFINITY, f64::min);
            // Both feet on one plate press between them.
            if load[2] > BOTH_N && (0..2).all(|foot| is_flat(own, &floor, foot) && carries(plate, &own[foot]))
            {
                away = away.min(between(own, &pressed));
            }
            found.beside_m.push(away as f32);
            if away > BESIDE_M + MOMENT_NM / load[2] {
                found.dropped[frame] = Some(Dropped::LoadElsewhere);
            }
        }
        if let Some(nearer) = under_the_lower(own, &floor, plates, &loads) {
            found.single[usize::from(!nearer)] += 1;
        }
        let speed = |foot: usize, k: usize| (velocity(soles, frame, foot, k) * rate_hz - belt).norm();
        if let Some(reason) = feet(own, &floor, &speed, plates, &loads) {
            found.dropped[frame] = Some(reason);
        }
    });
    name_long_ends(&mut found.dropped, (EDGE_S * rate_hz).ceil() as usize);
    forgive_passing(&mut found.dropped, (STANDS_S * rate_hz).floor() as usize);
    widen(&mut found.dropped, (BESIDE_S * rate_hz).ceil() as usize);
    found
}

/// Returns whether the one load that there is is nearer to the lower foot; `None` unless one plate alone is
/// loaded and one foot clearly lower.
fn under_the_lower(
    own: &Soles,
    floor: &[[f64; 4]; 2],
    plates: &[GroundWrench],
    loads: &[[f64; 6]],
) -> Option<bool> {
    let mut loaded = loads.iter().zip(plates).filter(|(load, _)| load[2] > LOADED_N);
    let (load, plate) = loaded.next().filter(|_| loaded.next().is_none())?;
    let clear = |foot: usize| (0..4).map(|k| own[foot][k].z - floor[foot][k]).fold(f64::INFINITY, f64::min);
    let (left, right) = (clear(0), clear(1));
    let lower = usize::from(right < left);
    if (left - right).abs() < LOW_M {
        return None;
    }
    let height = own.iter().flatten().map(|p| p.z).fold(f64::INFINITY, f64::min);
    let pressed = pressure(load, level(plate, height));
    Some(distance(&own[lower], &pressed) <= distance(&own[1 - lower], &pressed))
}

/// Returns the height of a plate's surface. For a plate without corners it is that of the lower sole, or the
/// laboratory's zero.
fn level(plate: &GroundWrench, lowest: f64) -> f64 {
    plate.corners_m.map_or(lowest.min(0.0), |corners| corners[0][2])
}

/// Returns the motion of a point of a sole from frame to frame, m; zero where it is not known.
fn velocity(soles: &[Option<KeptSoles>], frame: usize, foot: usize, k: usize) -> Vector3<f64> {
    let at = |frame: Option<usize>| frame.and_then(|f| soles.get(f)?.as_ref()).map(|s| point(&s[foot][k]));
    let (before, now, after) = (at(frame.checked_sub(1)), at(Some(frame)), at(Some(frame + 1)));
    match (before, now, after) {
        (Some(a), _, Some(b)) => (b - a) / 2.0,
        (Some(a), Some(b), None) | (None, Some(a), Some(b)) => b - a,
        _ => Vector3::zeros(),
    }
}

/// Returns the velocity of the ground, m/s: the median over the soles that the ground presses on. A
/// treadmill's belt moves.
fn belt(soles: &[Option<KeptSoles>], rate_hz: f64, plates: &[GroundWrench], loads: Loads) -> Vector3<f64> {
    let mut all: [Vec<f32>; 2] = [Vec::new(), Vec::new()];
    parallel::in_order(soles.len(), loads, |frame, loads| {
        let (Some(own), Some(loads)) = (&soles[frame].as_ref().map(expanded), loads) else { return };
        for (load, plate) in loads.iter().zip(plates).filter(|(load, _)| load[2] > 4.0 * LOADED_N) {
            let height = own.iter().flatten().map(|p| p.z).fold(f64::INFINITY, f64::min);
            let pressed = pressure(load, level(plate, height));
            let foot = if distance(&own[0], &pressed) < distance(&own[1], &pressed) { 0 } else { 1 };
            let points = (0..own[foot].len())
                .min_by(|a, b| (own[foot][*a] - pressed).norm().total_cmp(&(own[foot][*b] - pressed).norm()));
            let moved = velocity(soles, frame, foot, points.unwrap_or(0)) * rate_hz;
            all[0].push(moved.x as f32);
            all[1].push(moved.y as f32);
        }
    });
    let [x, y] = all.map(|mut values| {
        values.sort_by(f32::total_cmp);
        f64::from(values.get(values.len() / 2).copied().unwrap_or(0.0))
    });
    Vector3::new(x, y, 0.0)
}

/// Returns whether feet that stand do so on plates: on surfaces whose corners are known, else above a load.
fn feet(
    soles: &Soles,
    floor: &[[f64; 4]; 2],
    speed: &dyn Fn(usize, usize) -> f64,
    plates: &[GroundWrench],
    loads: &[[f64; 6]],
) -> Option<Dropped> {
    for (foot, points) in soles.iter().enumerate() {
        let stands = |k: &usize| points[*k].z < floor[foot][*k] + LOW_M && speed(foot, *k) < SLOW_MPS;
        let standing: Vec<usize> = (0..points.len()).filter(stands).collect();
        if standing.is_empty() {
            continue;
        }
        if plates.iter().any(|plate| plate.corners_m.is_none()) {
            let both = (0..2).all(|foot| is_flat(soles, floor, foot));
            let carries = |(load, plate): (&[f64; 6], &GroundWrench)| {
                let pressed = pressure(load, level(plate, points[standing[0]].z));
                let away = |sole: &[Vector3<f64>; 4]| distance(sole, &pressed);
                // A load under neither foot, and between them, is that of both.
                let between = || {
                    both && load[2] > BOTH_N
                        && soles.iter().all(|own| away(own) > BESIDE_M)
                        && between(soles, &pressed) == 0.0
                };
                load[2] > LOADED_N && (away(points) < BESIDE_M || between())
            };
            if !loads.iter().zip(plates).any(carries) {
                return Some(Dropped::FootOff);
            }
            continue;
        }
        let mut corners = plates.iter().filter_map(|p| p.corners_m.as_ref());
        let on: Vec<bool> =
            standing.iter().map(|k| corners.clone().any(|c| is_inside(c, &points[*k]))).collect();
        if corners.next().is_none() || on.iter().any(|on| !on) {
            let some = on.iter().any(|on| *on);
            return Some(if some { Dropped::FootHalfOff } else { Dropped::FootOff });
        }
    }
    None
}

/// Returns soles by the model: the heel a quarter of the foot behind the ankle, the ball half of it before.
pub fn soles(subject: &Subject, places: &[Place]) -> Option<KeptSoles> {
    let model = &subject.model;
    let length = |name: &str| subject.person.length(name);
    let (foot, height) = (length("foot")?, length("ankle_height")?);
    let local = [
        Vector3::new(-0.25 * foot, 0.025, -height),
        Vector3::new(-0.25 * foot, -0.025, -height),
        Vector3::new(0.5 * foot, 0.04, -height),
        Vector3::new(0.5 * foot, -0.04, -height),
    ];
    let of = |name: &str| {
        let (turn, origin) = places.get(model.link(name)?)?;
        Some(local.map(|p| (origin + turn * p).map(|v| v as f32).into()))
    };
    Some([of("l_foot")?, of("r_foot")?])
}

/// Returns how much the model's soles are below or above the floor where feet stand, by points: what a fifth
/// of all frames have beneath them.
pub(super) fn sunken(soles: &[Option<KeptSoles>]) -> [[f64; 4]; 2] {
    std::array::from_fn(|foot| {
        std::array::from_fn(|k| {
            let mut heights: Vec<f32> = soles.iter().flatten().map(|s| s[foot][k][2]).collect();
            heights.sort_by(f32::total_cmp);
            f64::from(heights.get(heights.len() / 5).copied().unwrap_or(0.0))
        })
    })
}

/// Returns the centre of pressure at a height: where the horizontal moments of a wrench about the origin
/// vanish, m; not finite without a vertical force.
pub fn pressure([fx, fy, fz, mx, my, _]: &[f64; 6], z: f64) -> Vector3<f64> {
    // M = p × F, so m_x = y f_z − z f_y and m_y = z f_x − x f_z
    Vector3::new((z * fx - my) / fz, (mx + z * fy) / fz, z)
}

/// Returns the horizontal distance of a point from the line from heel to ball, m.
pub(super) fn distance(sole: &[Vector3<f64>; 4], to: &Vector3<f64>) -> f64 {
    let (a, b) = ((sole[0] + sole[1]) / 2.0, (sole[2] + sole[3]) / 2.0);
    let (line, away) = ((b - a).xy(), (to - a).xy());
    let along = (away.dot(&line) / line.norm_squared().max(1e-9)).clamp(0.0, 1.0);
    (away - line * along).norm()
}

/// Returns the horizontal distance of a point from the line from heel to toe, m. From the ball on it is a
/// third as long as before, and horizontal: toes lie flat when the heel is in the air.
fn beyond(sole: &[Vector3<f64>; 4], to: &Vector3<f64>) -> f64 {
    let (heel, ball) = ((sole[0] + sole[1]) / 2.0, (sole[2] + sole[3]) / 2.0);
    let toes = (ball - heel).norm() / 3.0;
    let way = (ball - heel).xy().try_normalize(1e-6).unwrap_or_default();
    let along = way.dot(&(to - ball).xy()).clamp(0.0, toes);
    distance(sole, to).min(((to - ball).xy() - way * along).norm())
}

/// Returns whether all of a sole is so low that it may be on the floor.
fn is_flat(soles: &Soles, floor: &[[f64; 4]; 2], foot: usize) -> bool {
    (0..4).all(|k| soles[foot][k].z < floor[foot][k] + LOW_M)
}

/// Returns whether a foot may be on a plate; one without corners may be anywhere.
fn carries(plate: &GroundWrench, sole: &[Vector3<f64>; 4]) -> bool {
    plate.corners_m.as_ref().is_none_or(|corners| sole.iter().any(|point| is_inside(corners, point)))
}

/// Returns the horizontal distance of a point from the area that both feet enclose, from heels to balls, m.
fn between(soles: &Soles, to: &Vector3<f64>) -> f64 {
    let ends = |sole: &[Vector3<f64>; 4]| [(sole[0] + sole[1]) / 2.0, (sole[2] + sole[3]) / 2.0];
    let ([a, b], [c, d]) = (ends(&soles[0]), ends(&soles[1]));
    let corners = [a, b, d, c].map(|point| [point.x, point.y, 0.0]);
    if is_inside(&corners, to) {
        return 0.0;
    }
    let apart = |from: &Vector3<f64>, end: &Vector3<f64>| {
        let (line, away) = ((end - from).xy(), (to - from).xy());
        let along = (away.dot(&line) / line.norm_squared().max(1e-9)).clamp(0.0, 1.0);
        (away - line * along).norm()
    };
    apart(&a, &c).min(apart(&b, &d))
}

/// Returns whether a point is above a convex surface, whichever way its corners go round.
pub(super) fn is_inside(corners: &[[f64; 3]; 4], point: &Vector3<f64>) -> bool {
    let side = |k: usize| {
        let (a, b) = (corners[k], corners[(k + 1) % 4]);
        (b[0] - a[0]) * (point.y - a[1]) - (b[1] - a[1]) * (point.x - a[0])
    };
    let sides = [side(0), side(1), side(2), side(3)];
    sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0)
}

/// Tells where plates recorded nothing for longer than their smoothing takes, of frames without smoothed
/// forces.
fn name_long_ends(dropped: &mut [Option<Dropped>], most: usize) {
    let runs = dropped.chunk_by_mut(|a, b| a == b);
    let long = runs.filter(|run| run[0] == Some(Dropped::Edge) && run.len() > most);
    long.for_each(|run| run.fill(Some(Dropped::NoForce)));
}

/// Keeps frames in which a foot only lands or leaves beside a plate: it is low and slow there for no more
/// than this many of them.
fn forgive_passing(dropped: &mut [Option<Dropped>], most: usize) {
    let stands = |reason: &Option<Dropped>| matches!(reason, Some(Dropped::FootOff | Dropped::FootHalfOff));
    let runs = dropped.chunk_by_mut(|a, b| stands(a) == stands(b));
    runs.filter(|run| stands(&run[0]) && run.len() <= most).for_each(|run| run.fill(None));
}

/// Drops frames beside dropped ones for the same reason.
fn widen(dropped: &mut [Option<Dropped>], by: usize) {
    let before = dropped.to_vec();
    for (frame, reason) in before.iter().enumerate() {
        let Some(reason) = reason.filter(|r| *r != Dropped::Markers) else { continue };
        let near = dropped.iter_mut().take(frame + by + 1).skip(frame.saturating_sub(by));
        near.filter(|d| d.is_none()).for_each(|d| *d = Some(reason));
    }
}

/// Returns how many frames were dropped for each reason.
pub fn counts(dropped: &[Option<Dropped>]) -> BTreeMap<Dropped, usize> {
    let mut counts = BTreeMap::new();
    for reason in dropped.iter().flatten() {
        *counts.entry(*reason).or_default() += 1;
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_at_the_ends_are_not_called_frames_without_forces() {
        // 100 frames a second: 12 frames at either end, and a second without a recording.
        let edge = Some(Dropped::Edge);
        let mut dropped = [vec![edge; 12], vec![None; 50], vec![edge; 100]].concat();
        name_long_ends(&mut dropped, 20);
        let counts = counts(&dropped);
        assert_eq!((counts[&Dropped::Edge], counts[&Dropped::NoForce]), (12, 100));
        assert_eq!(dropped[0], edge);
    }

    #[test]
    fn feet_apart_on_one_plate_press_between_them() {
        let sole = |y: f64| {
            let at = |x: f64, y: f64| [x as f32, y as f32, 0.0];
            [at(-0.06, y + 0.02), at(-0.06, y - 0.02), at(0.12, y + 0.04), at(0.12, y - 0.04)]
        };
        let soles = vec![Some([sole(0.2), sole(-0.2)]); 30];
        let corners = [[0.6, 0.6, 0.0], [-0.6, 0.6, 0.0], [-0.6, -0.6, 0.0], [0.6, -0.6, 0.0]];
        let plate = GroundWrench {
            name: String::new(),
            corners_m: Some(corners),
            rate_hz: 100.0,
            first_s: 0.0,
            mean_s: 0.01,
            wrench: Vec::new(),
        };
        let used = |x: f64| {
            let load = [0.0, 0.0, 700.0, 0.0, -700.0 * x, 0.0];
            let found = contact(100.0, &soles, std::slice::from_ref(&plate), &|_| Some(vec![load]));
            found.dropped.iter().filter(|reason| reason.is_none()).count()
        };
        assert_eq!((used(0.03), used(0.4)), (30, 0));
    }

    #[test]
    fn a_point_beside_a_plate_is_not_above_it() {
        let corners = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.5, 0.6, 0.0], [0.0, 0.6, 0.0]];
        let other_way = [corners[3], corners[2], corners[1], corners[0]];
        for corners in [corners, other_way] {
            assert!(is_inside(&corners, &Vector3::new(0.1, 0.5, 0.08)));
            assert!(!is_inside(&corners, &Vector3::new(0.51, 0.3, 0.08)));
            assert!(!is_inside(&corners, &Vector3::new(0.1, -0.02, 0.0)));
        }
    }
}

//! Whether force plates have measured all that a person touches.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::inverse_kinematics::skeleton::Place;
use crate::inverse_kinematics::subject::Subject;
use crate::motion_capture::ground::GroundWrench;

/// A point of the sole is on the floor if it is no higher above it, m, …
const LOW_M: f64 = 0.02;
/// … and no faster, m/s.
const SLOW_MPS: f64 = 0.5;
/// A plate is loaded from this vertical force on, N.
const LOADED_N: f64 = 25.0;
/// A centre of pressure is under a foot if it is no further from its sole, m.
const BESIDE_M: f64 = 0.12;
/// Frames beside one that is dropped are dropped, too, s: when a foot lands is not known better.
const BESIDE_S: f64 = 0.04;

/// Why a frame is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Dropped {
    /// Too few markers were seen.
    Markers,
    /// A foot is on the floor beside the plates.
    FootOff,
    /// A foot is partly beside the plates.
    FootHalfOff,
    /// A plate is loaded where no foot is.
    LoadElsewhere,
    /// No plate is loaded and a foot is on it, or the recording of the plates is at its end.
    NoForce,
}

impl Dropped {
    /// Returns the reason in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Markers => "too few markers were seen",
            Self::FootOff => "a foot is on the floor beside the plates",
            Self::FootHalfOff => "a foot is partly beside a plate",
            Self::LoadElsewhere => "a plate is loaded where no foot is",
            Self::NoForce => "the plates recorded nothing",
        }
    }
}

/// Where soles are in a frame, m, laboratory axes: heel and ball, inner and outer. Toes bend, and are left out.
type Soles = [[Vector3<f64>; 4]; 2];

/// What plates and feet say of every frame.
pub struct Contact {
    /// Reasons why frames are not used.
    pub dropped: Vec<Option<Dropped>>,
    /// Distances of centres of pressure from the nearest sole, where a plate is loaded, m.
    pub beside_m: Vec<f64>,
}

/// Judges every frame: `places` are those of the links, `wrenches` of every plate, `None` where they are not known.
pub fn contact(
    subject: &Subject,
    rate_hz: f64,
    places: &[Option<Vec<Place>>],
    plates: &[GroundWrench],
    wrenches: &[Vec<Option<[f64; 6]>>],
) -> Contact {
    let soles: Vec<Option<Soles>> = places.iter().map(|p| soles(subject, p.as_ref()?)).collect();
    let floor = sunken(&soles);
    let mut found = Contact { dropped: vec![None; places.len()], beside_m: Vec::new() };
    for frame in 0..places.len() {
        let Some(own) = &soles[frame] else {
            found.dropped[frame] = Some(Dropped::Markers);
            continue;
        };
        let loads: Option<Vec<[f64; 6]>> = wrenches.iter().map(|of| of.get(frame).copied().flatten()).collect();
        let Some(loads) = loads else {
            found.dropped[frame] = Some(Dropped::NoForce);
            continue;
        };
        let height = own.iter().flatten().map(|p| p.z).fold(f64::INFINITY, f64::min);
        for (load, plate) in loads.iter().zip(plates).filter(|(load, _)| load[2] > LOADED_N) {
            let level = plate.corners_m.map_or(height.min(0.0), |c| c[0][2]);
            let pressed = pressure(load, level);
            let away = own.iter().map(|sole| distance(sole, &pressed)).fold(f64::INFINITY, f64::min);
            found.beside_m.push(away);
            if away > BESIDE_M {
                found.dropped[frame] = Some(Dropped::LoadElsewhere);
            }
        }
        let before = frame.checked_sub(1).and_then(|k| soles[k].as_ref());
        let after = soles.get(frame + 1).and_then(Option::as_ref);
        let velocity = |foot: usize, k: usize| match (before, after) {
            (Some(a), Some(b)) => (b[foot][k] - a[foot][k]).norm() * rate_hz / 2.0,
            (Some(a), None) => (own[foot][k] - a[foot][k]).norm() * rate_hz,
            (None, Some(b)) => (b[foot][k] - own[foot][k]).norm() * rate_hz,
            (None, None) => 0.0,
        };
        if let Some(reason) = feet(own, &floor, &velocity, plates) {
            found.dropped[frame] = Some(reason);
        }
    }
    widen(&mut found.dropped, (BESIDE_S * rate_hz).ceil() as usize);
    found
}

/// Whether feet that stand do so on plates whose corners are known.
fn feet(
    soles: &Soles,
    floor: &[[f64; 4]; 2],
    velocity: &dyn Fn(usize, usize) -> f64,
    plates: &[GroundWrench],
) -> Option<Dropped> {
    let corners: Vec<&[[f64; 3]; 4]> = plates.iter().filter_map(|p| p.corners_m.as_ref()).collect();
    if corners.len() < plates.len() {
        return None;
    }
    for (foot, points) in soles.iter().enumerate() {
        let standing = (0..points.len())
            .filter(|k| points[*k].z < floor[foot][*k] + LOW_M && velocity(foot, *k) < SLOW_MPS);
        let on: Vec<bool> = standing.map(|k| corners.iter().any(|c| is_inside(c, &points[k]))).collect();
        if on.iter().any(|on| !on) {
            let some = on.iter().any(|on| *on);
            return Some(if some { Dropped::FootHalfOff } else { Dropped::FootOff });
        }
    }
    None
}

/// Soles by the model: the heel a quarter of the foot behind the ankle, the ball half of it before.
fn soles(subject: &Subject, places: &[Place]) -> Option<Soles> {
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
        Some(local.map(|p| origin + turn * p))
    };
    Some([of("l_foot")?, of("r_foot")?])
}

/// How much the model's soles are below or above the floor where feet stand, by points: what a fifth of all frames have beneath them.
fn sunken(soles: &[Option<Soles>]) -> [[f64; 4]; 2] {
    std::array::from_fn(|foot| {
        std::array::from_fn(|k| {
            let mut heights: Vec<f64> = soles.iter().flatten().map(|s| s[foot][k].z).collect();
            heights.sort_by(f64::total_cmp);
            heights.get(heights.len() / 5).copied().unwrap_or(0.0)
        })
    })
}

/// The centre of pressure at a height: where the horizontal moments of a wrench about the origin vanish.
fn pressure([fx, fy, fz, mx, my, _]: &[f64; 6], z: f64) -> Vector3<f64> {
    // M = p × F, so m_x = y f_z − z f_y and m_y = z f_x − x f_z
    Vector3::new((z * fx - my) / fz, (mx + z * fy) / fz, z)
}

/// Horizontal distance from the line from heel to ball, m.
fn distance(sole: &[Vector3<f64>; 4], to: &Vector3<f64>) -> f64 {
    let (a, b) = ((sole[0] + sole[1]) / 2.0, (sole[2] + sole[3]) / 2.0);
    let (line, away) = ((b - a).xy(), (to - a).xy());
    let along = (away.dot(&line) / line.norm_squared().max(1e-9)).clamp(0.0, 1.0);
    (away - line * along).norm()
}

/// Whether a point is above a convex surface.
fn is_inside(corners: &[[f64; 3]; 4], point: &Vector3<f64>) -> bool {
    let side = |k: usize| {
        let (a, b) = (corners[k], corners[(k + 1) % 4]);
        (b[0] - a[0]) * (point.y - a[1]) - (b[1] - a[1]) * (point.x - a[0])
    };
    let sides = [side(0), side(1), side(2), side(3)];
    sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0)
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

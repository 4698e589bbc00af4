//! The map: every orientation of a grid, and how far the plate leans in every direction.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};

use hexapod::{Geometry, rotation_from_rpy};
use nalgebra::{Matrix3, Vector3};

use super::settle::{Orientation, side_at_home};
use super::shells;

/// The orientations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Roll and pitch from minus this to this, degrees.
    pub most_deg: f64,
    /// The step between neighbours, degrees.
    pub step_deg: f64,
    /// The yaw of all orientations, degrees.
    pub yaw_deg: f64,
}

impl Default for Span {
    fn default() -> Self {
        Self { most_deg: 90.0, step_deg: 1.0, yaw_deg: 0.0 }
    }
}

/// The reason why there is no map.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MapError {
    /// A grid that makes no sense.
    #[error(
        "a map from -{most_deg}° to {most_deg}° in steps of {step_deg}° at a yaw of {yaw_deg}°: the step \
         must be between 0.1° and the range, the range at most 90°, the yaw within ±180°"
    )]
    Span {
        /// The range given, degrees.
        most_deg: f64,
        /// The step given, degrees.
        step_deg: f64,
        /// The yaw given, degrees.
        yaw_deg: f64,
    },
    /// Ctrl-C.
    #[error("interrupted, there is no map")]
    Interrupted,
}

/// Rows are rolls, columns pitches.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// The roll of the rows, degrees.
    pub roll_deg: Vec<f64>,
    /// The pitch of the columns, degrees.
    pub pitch_deg: Vec<f64>,
    /// Some position keeps the legs' lengths and the joints' angles.
    pub reachable: Vec<Vec<bool>>,
    /// Some such position keeps `cond(H)` below the guard too, on home's side of every singular pose.
    pub singularity_free: Vec<Vec<bool>>,
    /// A position of the plate's origin (A, m) that shows it: one that keeps the guard where there is one,
    /// else one that keeps lengths and angles.
    pub position_m: Vec<Vec<Option<[f64; 3]>>>,
}

/// The angle by which the plate leans in one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// Direction in which the plate leans, from x of A, degrees.
    pub azimuth_deg: f64,
    /// Largest tilt up to which every smaller one is reachable, degrees.
    pub reachable_deg: f64,
    /// Largest tilt up to which every smaller one is reachable and keeps the guard, degrees.
    pub singularity_free_deg: f64,
}

/// Checks of single orientations.
struct Searcher<'a> {
    geometry: &'a Geometry,
    side: f64,
}

impl<'a> Searcher<'a> {
    fn new(geometry: &'a Geometry) -> Self {
        Self { geometry, side: side_at_home(geometry) }
    }

    fn orientation(&self, rotation: &Matrix3<f64>, guarded: bool) -> Orientation<'a> {
        Orientation::new(self.geometry, *rotation, guarded.then_some(self.side))
    }

    /// Returns a position that keeps lengths and joint angles, if there is one; `near` is tried first. Exact
    /// for the lengths; with limited joint angles or clearances by descent from every candidate of the exact
    /// answer.
    fn reachable(&self, rotation: &Matrix3<f64>, near: Option<Vector3<f64>>) -> Option<Vector3<f64>> {
        let orientation = self.orientation(rotation, false);
        if let Some(near) = near.filter(|p| orientation.keeps(p)) {
            return Some(near);
        }
        let lengths_alone = self.geometry.has_lengths_alone();
        let mut held = None;
        shells::any_extreme(&shells::centres(self.geometry, rotation), self.geometry.leg_length_m, |p| {
            let legs = self.geometry.legs_at(p, rotation);
            if legs.directions.iter().any(|n| n.z <= 0.0) {
                return false;
            }
            if lengths_alone || orientation.keeps(p) {
                held = Some(*p);
            } else {
                let spot = orientation.settle(*p, false);
                held = spot.keeps().then_some(spot.position);
            }
            held.is_some()
        });
        held
    }

    /// Returns a position that keeps the guard too, found by descent from `near`.
    fn free_near(&self, rotation: &Matrix3<f64>, near: &Vector3<f64>) -> Option<Vector3<f64>> {
        let orientation = self.orientation(rotation, true);
        if orientation.keeps(near) {
            return Some(*near);
        }
        let spot = orientation.settle(*near, false);
        (spot.keeps() && orientation.keeps(&spot.position)).then_some(spot.position)
    }

    /// Returns a position that keeps the guard, without one nearby: found from the candidate of the exact
    /// answer that is furthest from singular, and from the middle of all of them.
    fn free_anywhere(&self, rotation: &Matrix3<f64>) -> Option<Vector3<f64>> {
        let orientation = self.orientation(rotation, true);
        let (mut sum, mut count) = (Vector3::zeros(), 0_u32);
        let mut best: Option<(f64, Vector3<f64>)> = None;
        let mut held = None;
        shells::any_extreme(&shells::centres(self.geometry, rotation), self.geometry.leg_length_m, |p| {
            let legs = self.geometry.legs_at(p, rotation);
            if legs.directions.iter().any(|n| n.z <= 0.0) {
                return false;
            }
            sum += p;
            count += 1;
            if orientation.keeps(p) {
                held = Some(*p);
                return true;
            }
            let away = legs.force_transmission().determinant() * self.side;
            if away > best.map_or(0.0, |b| b.0) {
                best = Some((away, *p));
            }
            false
        });
        if held.is_some() || count == 0 {
            return held;
        }
        let middle = sum / f64::from(count);
        best.and_then(|(_, p)| self.free_near(rotation, &p)).or_else(|| self.free_near(rotation, &middle))
    }
}

impl Map {
    /// Checks every orientation of `span`. `progress` receives the share done.
    ///
    /// # Errors
    /// A grid that makes no sense, or `stop` was set.
    pub fn make(
        geometry: &Geometry,
        span: &Span,
        stop: &AtomicBool,
        mut progress: impl FnMut(f64),
    ) -> Result<Self, MapError> {
        let Span { most_deg, step_deg, yaw_deg } = *span;
        if !(step_deg >= 0.1 && step_deg <= most_deg && most_deg <= 90.0 && yaw_deg.abs() <= 180.0) {
            return Err(MapError::Span { most_deg, step_deg, yaw_deg });
        }
        let half = (most_deg / step_deg + 1e-9).floor() as i32;
        let degrees: Vec<f64> = (-half..=half).map(|k| f64::from(k) * step_deg).collect();
        let n = degrees.len();
        let searcher = Searcher::new(geometry);
        let rotation = |cell: usize| {
            rotation_from_rpy([degrees[cell / n], degrees[cell % n], yaw_deg].map(f64::to_radians))
        };
        // Lengths and angles: outwards from the middle row, each cell beginning with its neighbour's
        // position.
        let mut held: Vec<Option<Vector3<f64>>> = vec![None; n * n];
        let mut near = None;
        for row in 0..n {
            if stop.load(Ordering::Relaxed) {
                return Err(MapError::Interrupted);
            }
            progress(0.5 * row as f64 / n as f64);
            for column in 0..n {
                let cell = row * n + column;
                held[cell] = searcher.reachable(&rotation(cell), near);
                near = held[cell].or(near);
            }
        }
        let reachable: Vec<bool> = held.iter().map(Option::is_some).collect();
        // The guard: spreads from cells that keep it to their neighbours; what that leaves is examined by
        // itself.
        let mut free: Vec<Option<Vector3<f64>>> = vec![None; n * n];
        let middle = (n / 2) * n + n / 2;
        let order = std::iter::once(middle).chain(0..n * n);
        let (mut queue, mut tries) = (VecDeque::new(), vec![0_u8; n * n]);
        for (done, seed) in order.enumerate() {
            if done % n == 0 {
                if stop.load(Ordering::Relaxed) {
                    return Err(MapError::Interrupted);
                }
                progress(0.5 + 0.5 * done as f64 / (n * n) as f64);
            }
            if !reachable[seed] || free[seed].is_some() {
                continue;
            }
            free[seed] = searcher.free_anywhere(&rotation(seed));
            if free[seed].is_some() {
                queue.push_back(seed);
            }
            while let Some(cell) = queue.pop_front() {
                let Some(position) = free[cell] else { continue };
                for neighbour in neighbours(cell, n) {
                    if reachable[neighbour] && free[neighbour].is_none() && tries[neighbour] < 3 {
                        tries[neighbour] += 1;
                        free[neighbour] = searcher.free_near(&rotation(neighbour), &position);
                        if free[neighbour].is_some() {
                            queue.push_back(neighbour);
                        }
                    }
                }
            }
        }
        let rows = |cells: Vec<bool>| cells.chunks(n).map(<[bool]>::to_vec).collect();
        let shown: Vec<_> = free.iter().zip(&held).map(|(f, h)| f.or(*h).map(Into::into)).collect();
        Ok(Self {
            roll_deg: degrees.clone(),
            pitch_deg: degrees,
            reachable: rows(reachable),
            singularity_free: rows(free.iter().map(Option::is_some).collect()),
            position_m: shown.chunks(n).map(<[_]>::to_vec).collect(),
        })
    }
}

/// Returns the four cells beside one of an n × n grid.
fn neighbours(cell: usize, n: usize) -> impl Iterator<Item = usize> {
    let (row, column) = (cell / n, cell % n);
    [
        (row > 0).then(|| cell - n),
        (row + 1 < n).then_some(cell + n),
        (column > 0).then(|| cell - 1),
        (column + 1 < n).then_some(cell + 1),
    ]
    .into_iter()
    .flatten()
}

impl Reach {
    /// Returns the reach along `count` directions, equally spaced from x of A. Tilts in steps of 0.5°, the
    /// last one halved down to 0.01°.
    pub fn around(geometry: &Geometry, yaw_deg: f64, count: usize) -> Vec<Self> {
        let searcher = Searcher::new(geometry);
        (0..count)
            .map(|k| {
                let azimuth_deg = 360.0 * k as f64 / count as f64;
                let rotation = |tilt_deg: f64| leaning(azimuth_deg, tilt_deg, yaw_deg);
                let reachable_deg = furthest(|tilt, near| searcher.reachable(&rotation(tilt), near));
                let singularity_free_deg = furthest(|tilt, near| {
                    let rotation = rotation(tilt);
                    near.and_then(|p| searcher.free_near(&rotation, &p))
                        .or_else(|| searcher.free_anywhere(&rotation))
                });
                Self { azimuth_deg, reachable_deg, singularity_free_deg }
            })
            .collect()
    }
}

/// Returns the plate's axes with its normal at `tilt_deg` from z of A towards `azimuth_deg`, in roll, pitch
/// and the given yaw.
fn leaning(azimuth_deg: f64, tilt_deg: f64, yaw_deg: f64) -> Matrix3<f64> {
    // n = Rz(yaw) Ry(pitch) Rx(roll) z: before the yaw it is (sin p cos r, −sin r, cos p cos r).
    let (sin, cos) = tilt_deg.to_radians().sin_cos();
    let (y, x) = (azimuth_deg - yaw_deg).to_radians().sin_cos();
    let roll = -(sin * y).asin();
    let pitch = (sin * x).atan2(cos);
    rotation_from_rpy([roll, pitch, yaw_deg.to_radians()])
}

/// Returns the largest tilt, degrees, up to which `held` gives a position at every step; 0 if not even level.
fn furthest(mut held: impl FnMut(f64, Option<Vector3<f64>>) -> Option<Vector3<f64>>) -> f64 {
    const STEP_DEG: f64 = 0.5;
    let (mut at, mut near) = (0.0, None);
    while at < 90.0 {
        match held(at, near) {
            Some(position) => near = Some(position),
            None if at == 0.0 => return 0.0,
            None => {
                let (mut low, mut high) = (at - STEP_DEG, at);
                while high - low > 0.01 {
                    let middle = 0.5 * (low + high);
                    match held(middle, near) {
                        Some(position) => (low, near) = (middle, Some(position)),
                        None => high = middle,
                    }
                }
                return low;
            }
        }
        at += STEP_DEG;
    }
    90.0
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;

//! Poses of a platform, and places of the joints on it, as smoothed coordinates about the platform's rest.
//!
//! Rest is the mean pose: free vibration goes both ways. Coordinates are those of the point O of the platform
//! in its own axes at rest, so that it does not matter where the cameras are. One symmetric kernel smooths
//! all of them, and gives their slopes.

use std::ops::Range;

use nalgebra::{Matrix4, Quaternion, SymmetricEigen, UnitQuaternion, Vector3, Vector4};

use super::SuspensionError;
use super::cut_off::{Lines, cut_off_hz};
use rigident_fit::parallel;
use rigident_rows::moved::{Moved, Part, moved};
use rigident_rows::smoothing::Smoother;

/// A step longer than this many periods is a gap.
pub(super) const GAP: f64 = 1.5;

/// Coordinates of every row of a recording.
pub(super) struct Track {
    parts: Vec<Part>,
    /// One row of numbers after another.
    numbers: Vec<f64>,
    width: usize,
    time_ns: Vec<u64>,
    rate_hz: f64,
}

/// A pose of the platform: position of O and attitude, in the frame of the recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pose {
    pub(super) position: Vector3<f64>,
    pub(super) attitude: UnitQuaternion<f64>,
}

/// Reads positions (x, y, z, qw, qx, qy, qz) as position of a point of P and attitude.
pub(super) fn poses(
    rows: &[[f64; 7]],
    at: &Vector3<f64>,
    place: impl Fn(usize) -> String,
) -> Result<Vec<Pose>, SuspensionError> {
    let of = |(row, v): (usize, &[f64; 7])| {
        let q = Quaternion::new(v[3], v[4], v[5], v[6]);
        let norm = q.norm();
        if (norm - 1.0).abs() > 0.01 || v.iter().any(|v| !v.is_finite()) {
            return Err(SuspensionError::Pose { place: place(row), pose: *v });
        }
        let attitude = UnitQuaternion::from_quaternion(q);
        Ok(Pose { position: Vector3::new(v[0], v[1], v[2]) + attitude * at, attitude })
    };
    rows.iter().enumerate().map(of).collect()
}

/// Returns the mean pose: of attitudes the one whose squared distances from all are least (F. L. Markley et
/// al. 2007).
pub(super) fn rest(poses: &[Pose]) -> Pose {
    let n = poses.len().max(1) as f64;
    let position = poses.iter().map(|p| p.position).sum::<Vector3<f64>>() / n;
    let vector = |q: &UnitQuaternion<f64>| Vector4::new(q.w, q.i, q.j, q.k);
    let sum: Matrix4<f64> = poses.iter().map(|p| vector(&p.attitude) * vector(&p.attitude).transpose()).sum();
    let eigen = SymmetricEigen::new(sum);
    let v = eigen.eigenvectors.column(eigen.eigenvalues.imax());
    Pose { position, attitude: UnitQuaternion::from_quaternion(Quaternion::new(v[0], v[1], v[2], v[3])) }
}

impl Track {
    /// Returns the track of poses about rest, with the numbers of the joints of every row.
    pub(super) fn new(
        poses: &[Pose],
        rest: &Pose,
        (joints, parts): (&[Vec<f64>], &[Part]),
        time_ns: Vec<u64>,
        rate_hz: f64,
    ) -> Self {
        let mut all = vec![Part::Place, Part::Ball];
        all.extend(parts);
        let width = all.iter().map(|part| part.numbers()).sum();
        let mut numbers = Vec::with_capacity(width * poses.len());
        for (Pose { position, attitude }, joints) in poses.iter().zip(joints) {
            let place = rest.attitude.inverse_transform_vector(&(position - rest.position));
            let turn = rest.attitude.inverse() * attitude;
            numbers.extend(place.iter());
            numbers.extend([turn.w, turn.i, turn.j, turn.k]);
            numbers.extend(joints);
        }
        let mut track = Self { parts: all, numbers, width, time_ns, rate_hz };
        track.join();
        track
    }

    /// Gives quaternions the sign of those before: q and −q are one attitude.
    fn join(&mut self) {
        let mut at = 0;
        for part in self.parts.clone() {
            if part == Part::Ball {
                let mut last = Vector4::new(1.0, 0.0, 0.0, 0.0);
                for row in self.numbers.chunks_exact_mut(self.width) {
                    let own = &mut row[at..at + 4];
                    if last.iter().zip(own.iter()).map(|(a, b)| a * b).sum::<f64>() < 0.0 {
                        own.iter_mut().for_each(|v| *v = -*v);
                    }
                    last.copy_from_slice(own);
                }
            }
            at += part.numbers();
        }
    }

    /// Returns the number of rows.
    pub(super) fn len(&self) -> usize {
        self.time_ns.len()
    }

    /// Returns the number of rows per second.
    pub(super) fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Returns what the numbers of a row are.
    pub(super) fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// Returns some of the rows.
    pub(super) fn part(&self, rows: Range<usize>) -> Self {
        let rows = rows.start.min(self.len())..rows.end.min(self.len());
        Self {
            parts: self.parts.clone(),
            numbers: self.numbers[rows.start * self.width..rows.end * self.width].to_vec(),
            time_ns: self.time_ns[rows].to_vec(),
            ..*self
        }
    }

    /// Returns the time of a row, ns.
    pub(super) fn time_ns(&self, row: usize) -> u64 {
        self.time_ns.get(row).copied().unwrap_or(0)
    }

    /// Returns the numbers of a row.
    pub(super) fn row(&self, row: usize) -> Option<&[f64]> {
        self.numbers.get(row * self.width..(row + 1) * self.width)
    }

    /// Returns the numbers of every row, to be changed.
    pub(super) fn rows_mut(&mut self) -> impl Iterator<Item = &mut [f64]> {
        self.numbers.chunks_exact_mut(self.width)
    }

    /// Returns the cut-off, Hz, that the coordinates ask for.
    pub(super) fn cut_off_hz(&self) -> f64 {
        let of = |k: usize| {
            let own: Vec<f64> = self.numbers.iter().skip(k).step_by(self.width).copied().collect();
            Lines::of(&own, self.rate_hz)
        };
        cut_off_hz(&parallel::map(parallel::threads(), self.width, of))
    }

    /// Returns coordinates and rates of a row; `None` near either end and near a gap.
    pub(super) fn at(&self, smoother: &Smoother, row: usize) -> Option<Moved> {
        let half = smoother.half();
        let (from, to) = (row.checked_sub(half)?, row + half);
        let span_ns = self.time_ns.get(to)?.saturating_sub(*self.time_ns.get(from)?);
        if span_ns as f64 * 1e-9 * self.rate_hz > (to - from) as f64 + GAP - 1.0 {
            return None;
        }
        let (mut values, mut slopes) = (vec![0.0; self.width], vec![0.0; self.width]);
        for (k, (smooth, slope)) in smoother.weights().enumerate() {
            for ((value, change), own) in values.iter_mut().zip(&mut slopes).zip(self.row(from + k)?) {
                *value += smooth * own;
                *change += slope * own;
            }
        }
        Some(moved(&self.parts, &values, &slopes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rigident_rows::smoothing::width_s;

    #[test]
    fn a_swinging_platform_is_tracked_from_wherever_cameras_stand() {
        let rate = 200.0;
        let pose = |t: f64| {
            let turn = Vector3::new(0.02, -0.03, 0.01) * (5.0 * t).sin();
            (Vector3::new(0.01, 0.02, -0.005) * (7.0 * t).cos(), UnitQuaternion::from_scaled_axis(turn))
        };
        let camera = (Vector3::new(1.0, -2.0, 0.5), UnitQuaternion::from_euler_angles(0.3, -0.2, 2.0));
        let at = Vector3::new(0.1, 0.0, -0.2);
        // Whole periods of both, so that the mean is rest.
        let rows: Vec<[f64; 7]> = (0..(std::f64::consts::TAU * rate) as usize)
            .map(|k| {
                let (p, q) = pose(k as f64 / rate);
                let (p, q) = (camera.0 + camera.1 * (p - q * at), camera.1 * q);
                [p.x, p.y, p.z, q.w, q.i, q.j, q.k]
            })
            .collect();
        let poses = poses(&rows, &at, |row| row.to_string()).unwrap();
        let rest = rest(&poses);
        assert!((rest.position - camera.0).norm() < 2e-4 && rest.attitude.angle_to(&camera.1) < 2e-4);
        let exact = Pose { position: camera.0, attitude: camera.1 };
        let times: Vec<u64> = (0..rows.len() as u64).map(|k| k * 5_000_000).collect();
        let joints = vec![Vec::new(); rows.len()];
        let track = Track::new(&poses, &exact, (&joints, &[]), times, rate);
        let smoother = Smoother::new(40.0, rate).unwrap();
        let own = track.at(&smoother, 300).unwrap();
        let (p, q) = pose(1.5);
        // The kernel's second moment, (width/2)²/19, takes ω² times half of it off an amplitude; twice that
        // has room for the rest.
        let taken = |angular: f64| angular.powi(2) * (0.5 * width_s(40.0)).powi(2) / 19.0;
        assert!((Vector3::from_column_slice(&own.positions[..3]) - p).norm() < taken(7.0) * 0.0222);
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(
            own.positions[3],
            own.positions[4],
            own.positions[5],
            own.positions[6],
        ));
        assert!(turn.angle_to(&q) < taken(5.0) * 0.0375);
        let velocity = Vector3::new(0.01, 0.02, -0.005) * (-7.0 * (7.0_f64 * 1.5).sin());
        assert!(
            (q * Vector3::from_column_slice(&own.rates[..3]) - velocity).norm() < taken(7.0) * 7.0 * 0.0222
        );
    }
}

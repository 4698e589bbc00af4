//! Coordinates of a person's joints over time, smoothed, with their rates.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::inverse_kinematics::skeleton::{Pose, Skeleton, Turn};
use rigident_rows::moved::{Moved, Part, moved};
use rigident_rows::smoothing::Smoother;

/// Frames whose numbers are stored together.
pub const STRETCH: usize = 1000;

/// Coordinates of every frame; frames without a pose are NaN. Single precision: 1e-6 m is a hundredth of what
/// cameras tell.
pub struct Coordinates {
    parts: Vec<Part>,
    width: usize,
    frames: usize,
    /// The numbers of [`STRETCH`] frames each, one frame after another.
    stretches: Vec<Vec<f32>>,
}

impl Coordinates {
    /// Returns the coordinates of the numbers of frames ([`numbers`]), those of [`STRETCH`] frames in each of
    /// `stretches`.
    pub fn new(skeleton: &Skeleton, stretches: Vec<Vec<f32>>) -> Self {
        let mut parts = vec![Part::Place, Part::Ball];
        parts.extend(skeleton.zero().turns.iter().skip(1).filter_map(|turn| match turn {
            Turn::Hinge(_) => Some(Part::Hinge),
            Turn::Ball(_) => Some(Part::Ball),
            Turn::None => None,
        }));
        let width: usize = parts.iter().map(|p| p.numbers()).sum();
        let frames = stretches.iter().map(|own| own.len() / width).sum();
        Self { parts, width, frames, stretches }
    }

    /// Returns the coordinates of poses that follow one another.
    pub fn of(skeleton: &Skeleton, poses: &[Option<Pose>]) -> Self {
        let width = numbers(&skeleton.zero()).count();
        let of_pose = |pose: &Option<Pose>| -> Vec<f32> {
            pose.as_ref().map_or_else(|| vec![f32::NAN; width], |pose| numbers(pose).collect())
        };
        let stretches = poses.chunks(STRETCH).map(|own| own.iter().flat_map(of_pose).collect());
        let mut all = Self::new(skeleton, stretches.collect());
        all.join();
        all
    }

    /// Returns the number of frames.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Returns how many numbers a frame has.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns a number over all frames.
    pub fn series(&self, number: usize) -> Vec<f32> {
        let own =
            |stretch: &Vec<f32>| stretch.iter().skip(number).step_by(self.width).copied().collect::<Vec<_>>();
        self.stretches.iter().flat_map(own).collect()
    }

    /// Writes a frame's numbers.
    pub fn set(&mut self, frame: usize, numbers: impl IntoIterator<Item = f32>) {
        if let Some(row) = self.row_mut(frame) {
            row.iter_mut().zip(numbers).for_each(|(to, value)| *to = value);
        }
    }

    fn row(&self, frame: usize) -> Option<&[f32]> {
        let first = frame % STRETCH * self.width;
        self.stretches.get(frame / STRETCH)?.get(first..first + self.width)
    }

    fn row_mut(&mut self, frame: usize) -> Option<&mut [f32]> {
        let first = frame % STRETCH * self.width;
        self.stretches.get_mut(frame / STRETCH)?.get_mut(first..first + self.width)
    }

    /// Gives quaternions the sign of those before: q and −q are one attitude.
    pub fn join(&mut self) {
        let mut balls = Vec::new();
        let mut at = 0;
        for part in &self.parts {
            if matches!(part, Part::Ball) {
                balls.push(at..at + part.numbers());
            }
            at += part.numbers();
        }
        let mut last = vec![[0.0_f32; 4]; balls.len()];
        for frame in 0..self.frames {
            let Some(row) = self.row_mut(frame).filter(|row| !row[0].is_nan()) else { continue };
            for (range, last) in balls.iter().zip(&mut last) {
                let now = &mut row[range.clone()];
                if last.iter().zip(now.iter()).map(|(a, b)| a * b).sum::<f32>() < 0.0 {
                    now.iter_mut().for_each(|v| *v = -*v);
                }
                last.copy_from_slice(now);
            }
        }
    }

    /// Returns the pose of a frame.
    pub fn pose(&self, skeleton: &Skeleton, frame: usize) -> Option<Pose> {
        let mut numbers = self.row(frame)?.iter().copied().map(f64::from);
        let mut next = || numbers.next().unwrap_or(f64::NAN);
        let position_m = Vector3::from_fn(|_, _| next());
        if position_m.x.is_nan() {
            return None;
        }
        let ball = |next: &mut dyn FnMut() -> f64| {
            UnitQuaternion::from_quaternion(Quaternion::new(next(), next(), next(), next()))
        };
        let mut pose = Pose { position_m, attitude: ball(&mut next), ..skeleton.zero() };
        for turn in pose.turns.iter_mut().skip(1) {
            match turn {
                Turn::Hinge(angle) => *angle = next(),
                Turn::Ball(q) => *q = ball(&mut next),
                Turn::None => {}
            }
        }
        Some(pose)
    }

    /// Returns coordinates and rates of a frame; `None` near either end, or where a frame under the kernel
    /// has no pose.
    pub fn at(&self, smoother: &Smoother, frame: usize) -> Option<Moved> {
        let from = frame.checked_sub(smoother.half())?;
        let middle = self.row(frame)?;
        let mut values = vec![0.0; self.width];
        let mut slopes = vec![0.0; self.width];
        for (k, (smooth, slope)) in smoother.weights().enumerate() {
            let row = self.row(from + k)?;
            for (((value, change), own), middle) in values.iter_mut().zip(&mut slopes).zip(row).zip(middle) {
                // About the middle, so that a place far from the origin costs no digits.
                let away = f64::from(own - middle);
                *value += smooth * away;
                *change += slope * away;
            }
        }
        values.iter_mut().zip(middle).for_each(|(value, middle)| *value += f64::from(*middle));
        if values.iter().chain(&slopes).any(|v| !v.is_finite()) {
            return None;
        }
        Some(moved(&self.parts, &values, &slopes))
    }
}

/// Returns a pose's position and attitude, then its joints' turns.
pub fn numbers(pose: &Pose) -> impl Iterator<Item = f32> + '_ {
    let four = |q: &UnitQuaternion<f64>| [q.w, q.i, q.j, q.k].map(|v| v as f32);
    let turns = pose.turns.iter().skip(1).flat_map(move |turn| {
        let (own, count) = match turn {
            Turn::Hinge(angle) => ([*angle as f32, 0.0, 0.0, 0.0], 1),
            Turn::Ball(q) => (four(q), 4),
            Turn::None => ([0.0; 4], 0),
        };
        own.into_iter().take(count)
    });
    pose.position_m.iter().map(|v| *v as f32).chain(four(&pose.attitude)).chain(turns)
}

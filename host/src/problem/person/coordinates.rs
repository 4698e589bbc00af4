//! Coordinates of a person's joints over time, smoothed, with their rates.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::smoothing::Smoother;
use crate::inverse_kinematics::skeleton::{Pose, Skeleton, Turn};

/// Coordinates of a frame and their rates: first the base's position and quaternion (w, x, y, z) in laboratory axes, then the
/// joints', as [`crate::model::rows::Moving::set`] takes them.
#[derive(Clone, Debug, PartialEq)]
pub struct Moved {
    /// Positions, m and rad, and quaternions.
    pub positions: Vec<f64>,
    /// Rates: the base's velocity and angular rate in its own axes, m/s and rad/s, then the joints', rad/s.
    pub rates: Vec<f64>,
}

/// What a stretch of the coordinates is.
#[derive(Clone, Copy, Debug)]
enum Part {
    Place,
    Ball,
    Hinge,
}

/// Frames whose numbers are kept together.
pub const STRETCH: usize = 1000;

/// Coordinates of every frame; frames without a pose are NaN. Single precision: 1e-6 m is a hundredth of what cameras tell.
pub struct Coordinates {
    parts: Vec<Part>,
    width: usize,
    frames: usize,
    /// The numbers of [`STRETCH`] frames each, one frame after another.
    stretches: Vec<Vec<f32>>,
}

impl Coordinates {
    /// Returns the coordinates of the numbers of frames ([`numbers`]), those of [`STRETCH`] frames in each of `stretches`.
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

    /// Returns coordinates and rates of a frame; `None` near either end, or where a frame under the kernel has no pose.
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
        Some(self.moved(&values, &slopes))
    }

    fn moved(&self, values: &[f64], slopes: &[f64]) -> Moved {
        let mut moved = Moved { positions: Vec::with_capacity(values.len()), rates: Vec::new() };
        let mut at = 0;
        let mut velocity = Vector3::zeros();
        for (k, part) in self.parts.iter().enumerate() {
            let own = (&values[at..at + part.numbers()], &slopes[at..at + part.numbers()]);
            at += part.numbers();
            match part {
                Part::Place => {
                    moved.positions.extend(own.0);
                    velocity = Vector3::from_column_slice(own.1);
                }
                Part::Hinge => {
                    moved.positions.extend(own.0);
                    moved.rates.extend(own.1);
                }
                Part::Ball => {
                    let q = Quaternion::new(own.0[0], own.0[1], own.0[2], own.0[3]);
                    let slope = Quaternion::new(own.1[0], own.1[1], own.1[2], own.1[3]);
                    // ω = 2 vec(q* q̇)/|q|², in the link's axes, whatever the length of q
                    let rate = (q.conjugate() * slope).vector() * (2.0 / q.norm_squared());
                    let unit = UnitQuaternion::from_quaternion(q);
                    if k == 1 {
                        moved.rates.extend(unit.inverse_transform_vector(&velocity).iter());
                    }
                    moved.positions.extend([unit.w, unit.i, unit.j, unit.k]);
                    moved.rates.extend(rate.iter());
                }
            }
        }
        moved
    }
}

impl Part {
    fn numbers(self) -> usize {
        match self {
            Self::Place => 3,
            Self::Ball => 4,
            Self::Hinge => 1,
        }
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

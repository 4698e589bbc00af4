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

/// Coordinates of every frame; frames without a pose are NaN.
pub struct Coordinates {
    parts: Vec<Part>,
    /// One series a number, all as long.
    pub series: Vec<Vec<f64>>,
}

impl Coordinates {
    /// Returns the coordinates of poses that follow one another.
    pub fn new(skeleton: &Skeleton, poses: &[Option<Pose>]) -> Self {
        let mut parts = vec![Part::Place, Part::Ball];
        parts.extend(skeleton.zero().turns.iter().skip(1).filter_map(|turn| match turn {
            Turn::Hinge(_) => Some(Part::Hinge),
            Turn::Ball(_) => Some(Part::Ball),
            Turn::None => None,
        }));
        let width: usize = parts.iter().map(|p| p.numbers()).sum();
        let mut series = vec![vec![f64::NAN; poses.len()]; width];
        let mut last: Vec<f64> = Vec::new();
        for (frame, pose) in poses.iter().enumerate() {
            let Some(pose) = pose else { continue };
            let mut now = numbers(pose);
            one_cover(&parts, &last, &mut now);
            for (series, value) in series.iter_mut().zip(&now) {
                series[frame] = *value;
            }
            last = now;
        }
        Self { parts, series }
    }

    /// Returns coordinates and rates of a frame; `None` near either end, or where a frame under the kernel has no pose.
    pub fn at(&self, smoother: &Smoother, frame: usize) -> Option<Moved> {
        let from = frame.checked_sub(smoother.half())?;
        let to = frame + smoother.half();
        let mut values = Vec::with_capacity(self.series.len());
        let mut slopes = Vec::with_capacity(self.series.len());
        for series in &self.series {
            let own = series.get(from..=to)?;
            // About the middle, so that a place far from the origin costs no digits.
            let middle = series[frame];
            let (value, slope) = smoother.at(own.iter().map(|v| v - middle));
            values.push(value + middle);
            slopes.push(slope);
        }
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

fn numbers(pose: &Pose) -> Vec<f64> {
    let q = pose.attitude;
    let mut all: Vec<f64> = pose.position_m.iter().copied().collect();
    all.extend([q.w, q.i, q.j, q.k]);
    for turn in pose.turns.iter().skip(1) {
        match turn {
            Turn::Hinge(angle) => all.push(*angle),
            Turn::Ball(q) => all.extend([q.w, q.i, q.j, q.k]),
            Turn::None => {}
        }
    }
    all
}

/// Gives quaternions the sign of those before: q and −q are one attitude.
fn one_cover(parts: &[Part], last: &[f64], now: &mut [f64]) {
    let mut at = 0;
    for part in parts {
        let range = at..at + part.numbers();
        at = range.end;
        if !matches!(part, Part::Ball) {
            continue;
        }
        let (Some(last), Some(now)) = (last.get(range.clone()), now.get_mut(range)) else { continue };
        if last.iter().zip(now.iter()).map(|(a, b)| a * b).sum::<f64>() < 0.0 {
            now.iter_mut().for_each(|v| *v = -*v);
        }
    }
}

//! The pose of a frame, from its markers.

use nalgebra::{DMatrix, DVector};

use super::markers::{Attached, Seen};
use super::normal::{Normal, fill};
use super::skeleton::{Pose, Skeleton};

/// Steps of a frame are at most this many.
const STEPS: usize = 60;
/// A step shorter than this, rad and m, ends the search.
const SHORT: f64 = 1e-7;
/// Fewest markers that tell a pose.
const FEWEST: usize = 3;

/// A pose with what its markers leave.
#[derive(Clone, Debug)]
pub struct Solved {
    /// The pose.
    pub pose: Pose,
    /// Distance of every marker from where its link has it, m; `None` where it was not seen.
    pub distances_m: Vec<Option<f64>>,
    /// 1 σ of every freedom by the markers that were seen, rad and m.
    pub deviations: Vec<f64>,
}

/// Finds poses, with room for the equations.
pub struct Solver<'a> {
    skeleton: &'a Skeleton,
    markers: &'a [Attached],
    normal: Normal,
    trial: Normal,
}

impl<'a> Solver<'a> {
    /// Returns a solver for markers on a skeleton.
    pub fn new(skeleton: &'a Skeleton, markers: &'a [Attached]) -> Self {
        let room = || Normal::new(skeleton.freedoms(), 0);
        Self { skeleton, markers, normal: room(), trial: room() }
    }

    /// Returns the pose of a frame, sought from a pose near it; `None` if fewer than three markers were seen,
    /// or the search fails.
    ///
    /// Damped Gauss–Newton steps (Levenberg, Marquardt) on distances weighted by σ, those beyond 3 σ less
    /// (Huber).
    pub fn solve(&mut self, seen: &Seen, start: &Pose) -> Option<Solved> {
        if seen.iter().flatten().count() < FEWEST {
            return None;
        }
        let mut pose = start.clone();
        fill(self.skeleton, &pose, self.markers, seen, false, &mut self.normal);
        let mut damping = 1e-6;
        for _ in 0..STEPS {
            let step = self.step(damping)?;
            let next = self.skeleton.step(&pose, step.as_slice());
            fill(self.skeleton, &next, self.markers, seen, false, &mut self.trial);
            let better = self.trial.cost <= self.normal.cost;
            let short = step.amax() < SHORT;
            if better {
                // Nearly a Newton step when the cost hardly falls any more.
                let done = self.normal.cost - self.trial.cost <= 1e-6 * self.normal.cost;
                pose = next;
                std::mem::swap(&mut self.normal, &mut self.trial);
                damping = (damping * 0.1_f64).max(1e-9);
                if done || short {
                    break;
                }
            } else {
                damping *= 10.0;
                if short || damping > 1e6 {
                    break;
                }
            }
        }
        let places = self.skeleton.places(&pose);
        let distance = |(marker, seen): (&Attached, &Option<_>)| {
            let seen: &nalgebra::Vector3<f64> = seen.as_ref()?;
            let (turn, origin) = &places[marker.link];
            Some((origin + turn * marker.position_m - seen).norm())
        };
        let distances_m = self.markers.iter().zip(seen).map(distance).collect();
        let deviations = deviations(&self.normal.own.clone().cholesky()?.unpack());
        Some(Solved { pose, distances_m, deviations })
    }

    fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let mut own = self.normal.own.clone();
        for k in 0..own.nrows() {
            own[(k, k)] *= 1.0 + damping;
        }
        Some(own.cholesky()?.solve(&self.normal.own_right))
    }
}

/// Roots of the diagonal of `(L Lᵀ)⁻¹`: norms of the columns of `L⁻¹`, which is triangular.
fn deviations(l: &DMatrix<f64>) -> Vec<f64> {
    let n = l.nrows();
    let mut column = vec![0.0; n];
    (0..n)
        .map(|j| {
            column[j..].fill(0.0);
            column[j] = 1.0;
            let mut sum = 0.0;
            for i in j..n {
                let x = column[i] / l[(i, i)];
                sum += x * x;
                for (rest, own) in column[i + 1..].iter_mut().zip(&l.as_slice()[i * n + i + 1..(i + 1) * n]) {
                    *rest -= own * x;
                }
            }
            sum.sqrt()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_are_those_of_the_inverse() {
        let a = DMatrix::from_fn(7, 7, |i, j| ((3 * i + 5 * j) % 11) as f64 - 4.0);
        let normal = &a * a.transpose() + DMatrix::identity(7, 7);
        let wanted = normal.clone().try_inverse().unwrap();
        let found = deviations(&normal.cholesky().unwrap().unpack());
        for (k, own) in found.iter().enumerate() {
            assert!((own / wanted[(k, k)].sqrt() - 1.0).abs() < 1e-12);
        }
    }
}

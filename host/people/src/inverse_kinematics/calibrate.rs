//! Joint centres and marker places of a person, from frames of a standing or moving trial.
//!
//! All frames share where joints are in their parents and where markers are on their links. Each frame's pose
//! is eliminated from the normal equations (Schur complement), and what is shared has a prior: the table's
//! places, each with how far it may be off. A standing trial alone leaves most of the prior in place; motion
//! moves joint centres to where segments turn about (functional calibration).

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Vector3};

use super::markers::{Attached, Seen};
use super::normal::{Normal, fill, shared_columns};
use super::skeleton::{Pose, Skeleton};

/// Steps of the search at most.
const STEPS: usize = 30;
/// The search ends when the cost falls by less, relative.
const ENOUGH: f64 = 1e-5;

/// The result.
#[derive(Clone, Debug)]
pub struct Calibrated {
    /// The skeleton with its joints where they were found.
    pub skeleton: Skeleton,
    /// The markers with their places.
    pub markers: Vec<Attached>,
    /// The poses of the frames.
    pub poses: Vec<Pose>,
    /// Root mean square of the distances of markers from their links, m.
    pub rms_m: f64,
    /// The information of frames and prior on what all frames share, inverse covariance: three numbers for
    /// every joint's place in its parent, then three for every marker's place on its link, 1/m².
    pub information: DMatrix<f64>,
}

/// Frames of one person count as no more than this many independent ones (assumed): skin moves over bone with
/// the pose.
const INDEPENDENT: f64 = 6.0;

struct Frame {
    pose: Pose,
    normal: Normal,
}

/// A frame's own equations, solved, and what its pose follows of what is shared.
struct Back {
    own: Cholesky<f64, Dyn>,
    back: DMatrix<f64>,
}

struct Bundle<'a> {
    seen: &'a [Seen],
    sigma_joint: &'a [[f64; 3]],
    start: (Skeleton, Vec<Attached>),
    skeleton: Skeleton,
    markers: Vec<Attached>,
    frames: Vec<Frame>,
    cost: f64,
}

/// Finds joint centres and marker places. `sigma_joint_m` are 1 σ of every link's joint in its parent, axes
/// of the parent, the base's left out; `poses` one near that of each frame.
///
/// Returns `None` if the equations cannot be solved: too few markers were seen.
pub fn calibrate(
    skeleton: &Skeleton,
    markers: &[Attached],
    sigma_joint_m: &[[f64; 3]],
    seen: &[Seen],
    poses: &[Pose],
) -> Option<Calibrated> {
    let shared = shared_columns(skeleton, markers.len());
    // Skin is off in one frame as in the next: all together count as a few.
    let wider = (poses.len() as f64 / INDEPENDENT).sqrt().max(1.0);
    let mut own = markers.to_vec();
    own.iter_mut().for_each(|marker| marker.sigma_m *= wider);
    let frames = poses
        .iter()
        .map(|pose| Frame { pose: pose.clone(), normal: Normal::new(skeleton.freedoms(), shared) });
    let mut bundle = Bundle {
        seen,
        sigma_joint: sigma_joint_m,
        start: (skeleton.clone(), own.clone()),
        skeleton: skeleton.clone(),
        markers: own,
        frames: frames.collect(),
        cost: f64::INFINITY,
    };
    bundle.fill();
    let mut damping = 1e-4;
    for _ in 0..STEPS {
        let kept = (bundle.skeleton.clone(), bundle.markers.clone(), bundle.poses(), bundle.cost);
        bundle.step(damping)?;
        bundle.fill();
        if bundle.cost <= kept.3 {
            damping = (damping * 0.1_f64).max(1e-9);
            if kept.3 - bundle.cost <= ENOUGH * kept.3 {
                break;
            }
        } else {
            (bundle.skeleton, bundle.markers) = (kept.0, kept.1);
            for (frame, pose) in bundle.frames.iter_mut().zip(kept.2) {
                frame.pose = pose;
            }
            bundle.fill();
            damping *= 10.0;
            if damping > 1e4 {
                break;
            }
        }
    }
    let rms_m = bundle.rms();
    let (information, ..) = bundle.reduced(0.0)?;
    let poses = bundle.poses();
    let mut found = bundle.markers;
    found.iter_mut().for_each(|marker| marker.sigma_m /= wider);
    Some(Calibrated { skeleton: bundle.skeleton, markers: found, poses, rms_m, information })
}

impl Bundle<'_> {
    fn poses(&self) -> Vec<Pose> {
        self.frames.iter().map(|frame| frame.pose.clone()).collect()
    }

    /// Returns the prior of the shared numbers: the distance of each from its start, and 1/σ².
    fn prior(&self) -> Vec<(f64, f64)> {
        let joints = self.skeleton.links().iter().zip(self.start.0.links()).skip(1).zip(self.sigma_joint);
        let joints = joints.flat_map(|((now, then), sigma)| {
            (0..3).map(move |k| (now.position[k] - then.position[k], sigma[k].powi(-2)))
        });
        let markers = self.markers.iter().zip(&self.start.1).flat_map(|(now, then)| {
            let moved = now.position_m - then.position_m;
            (0..3).map(move |k| (moved[k], then.position_sigma_m.powi(-2)))
        });
        joints.chain(markers).collect()
    }

    fn fill(&mut self) {
        self.cost = self.prior().iter().map(|(moved, weight)| weight * moved * moved).sum();
        for (frame, seen) in self.frames.iter_mut().zip(self.seen) {
            fill(&self.skeleton, &frame.pose, &self.markers, seen, true, &mut frame.normal);
            self.cost += frame.normal.cost;
        }
    }

    /// Returns the equations of the shared numbers with the poses eliminated, and how each frame's pose
    /// follows.
    fn reduced(&self, damping: f64) -> Option<(DMatrix<f64>, DVector<f64>, Vec<Back>)> {
        let prior = self.prior();
        let n = prior.len();
        let (mut all, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let mut solved = Vec::with_capacity(self.frames.len());
        for frame in &self.frames {
            let mut own = frame.normal.own.clone();
            for k in 0..own.nrows() {
                own[(k, k)] *= 1.0 + damping;
            }
            let own = own.cholesky()?;
            // H_ss − H_sq H_qq⁻¹ H_qs and its right side
            let back = own.solve(&frame.normal.coupling);
            all += &frame.normal.shared - frame.normal.coupling.tr_mul(&back);
            right += &frame.normal.shared_right - back.tr_mul(&frame.normal.own_right);
            solved.push(Back { own, back });
        }
        for (k, (moved, weight)) in prior.iter().enumerate() {
            right[k] -= weight * moved;
            all[(k, k)] += weight + damping * (weight + all[(k, k)]);
        }
        Some((all, right, solved))
    }

    /// Makes one damped step of all numbers.
    fn step(&mut self, damping: f64) -> Option<()> {
        let (all, right, solved) = self.reduced(damping)?;
        let shared = all.cholesky()?.solve(&right);
        for (frame, Back { own, back }) in self.frames.iter_mut().zip(&solved) {
            let step = own.solve(&frame.normal.own_right) - back * &shared;
            frame.pose = self.skeleton.step(&frame.pose, step.as_slice());
        }
        let three = |at: usize| Vector3::from_fn(|k, _| shared[at + k]);
        let links = self.skeleton.links().len();
        for link in 1..links {
            self.skeleton.shift(link, &three(3 * (link - 1)));
        }
        for (m, marker) in self.markers.iter_mut().enumerate() {
            marker.position_m += three(3 * (links - 1) + 3 * m);
        }
        Some(())
    }

    fn rms(&self) -> f64 {
        let (mut sum, mut count) = (0.0, 0_usize);
        for (frame, seen) in self.frames.iter().zip(self.seen) {
            let places = self.skeleton.places(&frame.pose);
            for (marker, seen) in self.markers.iter().zip(seen) {
                let Some(seen) = seen else { continue };
                let (turn, origin) = &places[marker.link];
                sum += (origin + turn * marker.position_m - seen).norm_squared();
                count += 1;
            }
        }
        (sum / count.max(1) as f64).sqrt()
    }
}

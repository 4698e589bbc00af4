//! The search for the offsets, by either method: poses that chance cannot explain are left out and named.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::pose::Observed;
use super::shared::Shared;
use super::solve::{Found, ROUNDS, State, gauss_newton};
use super::{Pose, Setup, gradient};

/// Probability that one of all good poses is left out.
const CHANCE: f64 = 0.01;

/// The method of the search for the offsets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Steps of Gauss and Newton, the base of each pose eliminated.
    #[default]
    GaussNewton,
    /// Nonlinear conjugate gradient, as in the paper.
    ConjugateGradient,
}

/// Finds the offsets.
///
/// # Errors
/// Says which pose cannot be used, or that none can.
pub fn find(setup: &Setup, poses: &[Pose], method: Method) -> Result<Found, String> {
    let mut left_out = vec![false; poses.len()];
    let mut found = searched(setup, poses, beginning(setup, poses), &left_out, method)?;
    for _ in 0..ROUNDS {
        let now = too_far(&found, &left_out);
        if now == left_out {
            break;
        }
        left_out = now;
        let again = searched(setup, poses, found.state, &left_out, method)?;
        found = Found { steps: found.steps + again.steps, ..again };
    }
    Ok(found)
}

/// Returns where the search begins: no offset, and each base by its attitude and its contacts.
pub fn beginning(setup: &Setup, poses: &[Pose]) -> State {
    let mut shared = Shared::zero(setup);
    let mut known = vec![false; setup.contacts.held.len()];
    let bases = poses.iter().map(|pose| setup.first_held(pose, &mut shared, &mut known)).collect();
    State { shared, bases }
}

/// Finds the offsets from all poses, none of which is left out.
pub(super) fn fitted(setup: &Setup, poses: &[Pose]) -> Result<Found, String> {
    gauss_newton(setup, poses, beginning(setup, poses), &vec![false; poses.len()])
}

/// Returns which poses are farther off than chance allows.
fn too_far(found: &Found, before: &[bool]) -> Vec<bool> {
    let chance = CHANCE / found.observed.len().max(1) as f64;
    let far = |observed: &Observed| {
        let limit = ChiSquared::new(observed.degrees_of_freedom)
            .map_or(f64::INFINITY, |chi2| chi2.inverse_cdf(1.0 - chance));
        observed.squares > found.scale * limit
    };
    let now: Vec<bool> = found.observed.iter().map(far).collect();
    // What is left must be most of them, or nothing says which are the bad ones.
    if now.iter().filter(|far| **far).count() * 2 < now.len() { now } else { before.to_vec() }
}

fn searched(
    setup: &Setup,
    poses: &[Pose],
    state: State,
    left_out: &[bool],
    method: Method,
) -> Result<Found, String> {
    match method {
        Method::GaussNewton => gauss_newton(setup, poses, state, left_out),
        Method::ConjugateGradient => gradient::in_rounds(setup, poses, state, left_out),
    }
}

//! Forward kinematics: from leg lengths to the pose of the plate.

use nalgebra::{Matrix3, Rotation3, Vector3, Vector6};

use super::geometry::Geometry;
use super::legs::Legs;
use super::pose::Pose;
use super::rotation::{rotation_from_rpy, rpy_from_rotation};

/// The reason why no pose was found for six leg lengths.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ForwardError {
    /// A length is not a positive number, or beyond the leg's reach.
    #[error("leg {leg} is said to be {length_m} m long, it reaches from {min_m:.4} m to {max_m:.4} m")]
    Length {
        /// 1 to 6.
        leg: usize,
        /// The length given, m.
        length_m: f64,
        /// Shortest possible, m.
        min_m: f64,
        /// Longest possible, m.
        max_m: f64,
    },
    /// The plate cannot be assembled with these lengths without passing a singular pose.
    #[error(
        "no pose of the plate has these leg lengths on this side of every singular pose; leg {leg} is left \
         with an error of {error_m:.2e} m: check the lengths and their order"
    )]
    NoPose {
        /// 1 to 6: the leg that fits worst.
        leg: usize,
        /// The length error of that leg, m.
        error_m: f64,
    },
}

/// A pose under iteration.
#[derive(Clone, Copy)]
struct Iterate {
    position: Vector3<f64>,
    rotation: Matrix3<f64>,
    legs: Legs,
}

impl Iterate {
    fn new(geometry: &Geometry, position: Vector3<f64>, rotation: Matrix3<f64>) -> Self {
        Self { position, rotation, legs: geometry.legs_at(&position, &rotation) }
    }

    fn of(geometry: &Geometry, pose: &Pose) -> Self {
        Self::new(geometry, Vector3::from(pose.position_m), rotation_from_rpy(pose.rpy_rad))
    }

    fn moved(&self, geometry: &Geometry, step: &Vector6<f64>) -> Self {
        let turn = Rotation3::new(step.fixed_rows::<3>(3).into_owned());
        Self::new(geometry, self.position + step.fixed_rows::<3>(0), turn.matrix() * self.rotation)
    }

    fn error(&self, lengths: &[f64; 6]) -> Vector6<f64> {
        Vector6::from(*lengths) - Vector6::from(self.legs.lengths)
    }

    fn determinant(&self) -> f64 {
        self.legs.force_transmission().determinant()
    }
}

/// Length errors below this are rounding, m.
const TOLERANCE_M: f64 = 1e-13;
/// Newton steps before a pose is given up.
const NEWTON_STEPS: usize = 40;

impl Geometry {
    /// Returns the pose at which the legs have these lengths, from a guess: damped Newton on the leg
    /// Jacobian, from `start`, and where that ends elsewhere, along a path of leg lengths from
    /// [`Geometry::home`]. Of the poses that share six lengths it is one that is not beyond a singular pose:
    /// `det H` has the sign it has at home, the legs point to the plate's side of the base. To about 1e-12 m
    /// and rad away from singular poses.
    ///
    /// # Errors
    /// A leg beyond its reach, or lengths that belong to no such pose.
    pub fn forward(&self, lengths_m: &[f64; 6], start: &Pose) -> Result<Pose, ForwardError> {
        let [min_m, max_m] = self.leg_length_m;
        // A measured length may be at its end stop to within the rounding of whoever wrote it down.
        let slack = 1e-9 * max_m;
        for (i, &length_m) in lengths_m.iter().enumerate() {
            if !(min_m - slack..=max_m + slack).contains(&length_m) {
                return Err(ForwardError::Length { leg: i + 1, length_m, min_m, max_m });
            }
        }
        let home = Iterate::of(self, &self.home());
        let side = self.home_determinant();
        let mut best = f64::INFINITY;
        let mut worst_leg = 0;
        let mut note = |at: &Iterate| {
            let error = at.error(lengths_m);
            if error.amax() < best {
                best = error.amax();
                worst_leg = error.icamax();
            }
        };
        let start = Iterate::of(self, start);
        for attempt in [
            &(|| self.newton(start, lengths_m)) as &dyn Fn() -> (Iterate, bool),
            &|| self.newton(home, lengths_m),
            &|| self.along_lengths(home, lengths_m),
            &|| self.along_lengths(start, lengths_m),
        ] {
            let (at, converged) = attempt();
            if !converged {
                note(&at);
            } else if self.is_home_side(&at, &home, side) {
                return Ok(Pose { position_m: at.position.into(), rpy_rad: rpy_from_rotation(&at.rotation) });
            }
        }
        Err(ForwardError::NoPose { leg: worst_leg + 1, error_m: best })
    }

    /// Returns true if a pose is neither the mirror image below the base, nor beyond a singular one.
    fn is_home_side(&self, at: &Iterate, home: &Iterate, side: f64) -> bool {
        at.determinant() * side > 0.0
            && at.rotation.column(2).dot(&home.rotation.column(2)) > 0.0
            && at.legs.directions.iter().zip(&home.legs.directions).all(|(n, up)| n.dot(up) > 0.0)
    }

    /// Does Newton's steps, halved until the error shrinks. Returns the last iterate, and whether it is a
    /// solution.
    fn newton(&self, mut at: Iterate, lengths: &[f64; 6]) -> (Iterate, bool) {
        let mut error = at.error(lengths);
        for _ in 0..NEWTON_STEPS {
            if error.amax() < TOLERANCE_M {
                return (at, true);
            }
            let Some(mut step) = at.legs.jacobian().lu().solve(&error) else { return (at, false) };
            // No more than half a radian at once.
            let turn = step.fixed_rows::<3>(3).norm();
            if turn > 0.5 {
                step *= 0.5 / turn;
            }
            let mut next = at.moved(self, &step);
            let mut next_error = next.error(lengths);
            let mut halvings = 0;
            while next_error.norm().total_cmp(&error.norm()).is_ge() && halvings < 12 {
                step *= 0.5;
                next = at.moved(self, &step);
                next_error = next.error(lengths);
                halvings += 1;
            }
            if halvings == 12 {
                // Rounding of the lengths, times a few, is as near as it gets.
                return (at, error.amax() < 64.0 * TOLERANCE_M);
            }
            (at, error) = (next, next_error);
        }
        (at, false)
    }

    /// Follows the straight line of leg lengths from where the plate is to `lengths`, in steps that Newton
    /// takes easily, which keeps it on its side of the singular poses.
    fn along_lengths(&self, mut at: Iterate, lengths: &[f64; 6]) -> (Iterate, bool) {
        let (mut done, mut step) = (0.0_f64, 0.25_f64);
        let from = at.legs.lengths;
        while done < 1.0 {
            let share = (done + step).min(1.0);
            let goal: [f64; 6] = std::array::from_fn(|i| from[i] + share * (lengths[i] - from[i]));
            match self.newton(at, &goal) {
                (next, true) if next.determinant() * at.determinant() > 0.0 => {
                    (at, done, step) = (next, share, step * 2.0);
                }
                _ => step *= 0.5,
            }
            if step < 1e-4 {
                return (at, false);
            }
        }
        (at, true)
    }
}

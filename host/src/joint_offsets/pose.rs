//! What one pose says: rows of its attitudes and of its corners' heights.
//!
//! With the base's attitude R and height h, and corner x of a link at `y = p + R_i x` in the base's frame, a standing corner says
//! `0 = z·R y + h`; h is free in every pose, so that only the variance of the heights counts. A measured attitude M of link i says
//! `log(M (R R_i E)ᵀ) = 0`, E being the error of the IMU's mounting. Errors of encoders act through the columns of the joints: rows of a
//! pose have the covariance `D + σ² J Jᵀ`, by which they are whitened.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::kinematics::Place;
use super::{Pose, Setup};
use crate::fit::Factor;

/// Columns of a pose's base: three of its attitude, one of its height.
pub const BASE_COLUMNS: usize = 4;
/// Angles below this, rad, have the coefficient of their logarithm by its series.
const SMALL_ANGLE: f64 = 1e-4;

/// The base of a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Base {
    /// World axes ← base axes.
    pub rotation: Rotation3<f64>,
    /// Height of its origin over the floor, m.
    pub height_m: f64,
}

impl Default for Base {
    fn default() -> Self {
        Self { rotation: Rotation3::identity(), height_m: 0.0 }
    }
}

impl Base {
    /// Returns the base moved by a turn about world axes, rad, and a rise, m.
    #[must_use]
    pub fn moved(&self, step: &[f64]) -> Self {
        let entry = |k: usize| step.get(k).copied().unwrap_or(0.0);
        let turn = Rotation3::new(Vector3::new(entry(0), entry(1), entry(2)));
        let mut rotation = turn * self.rotation;
        rotation.renormalize();
        Self { rotation, height_m: self.height_m + entry(3) }
    }
}

/// What all poses share.
#[derive(Clone, Debug, PartialEq)]
pub struct Shared {
    /// Offsets of the joints that are asked for, rad or m: true less measured position.
    pub offsets: Vec<f64>,
    /// Errors of the IMUs' mountings: link axes ← those that the attitude is of.
    pub mountings: Vec<Rotation3<f64>>,
}

impl Shared {
    /// Returns the beginning of the search: no offset, no error.
    pub fn zero(setup: &Setup) -> Self {
        Self {
            offsets: vec![0.0; setup.asked.len()],
            mountings: vec![Rotation3::identity(); setup.measured_links.len()],
        }
    }

    /// Returns the same after a step of the shared columns.
    #[must_use]
    pub fn moved(&self, step: &[f64]) -> Self {
        let (offsets, turns) = step.split_at(self.offsets.len().min(step.len()));
        let offsets = self.offsets.iter().zip(offsets).map(|(value, step)| value + step).collect();
        let mut mountings = self.mountings.clone();
        for (mounting, turn) in mountings.iter_mut().zip(turns.chunks_exact(3)) {
            *mounting = Rotation3::new(Vector3::from_column_slice(turn)) * *mounting;
            mounting.renormalize();
        }
        Self { offsets, mountings }
    }
}

/// The rows of a pose before they are whitened: measured less expected values, and how the expected ones change.
pub struct Rows {
    /// Columns of the base, then those that all poses share.
    pub columns: DMatrix<f64>,
    /// Columns of the errors of all encoders.
    pub encoders: DMatrix<f64>,
    /// Measured less expected: rad, then m.
    pub residual: DVector<f64>,
    /// 1 σ of each row by itself.
    sigma: Vec<f64>,
}

/// What a pose says of what is shared, its base eliminated, and how its base follows.
#[derive(Clone, Debug, Default)]
pub struct Told {
    /// Whitened rows of the shared columns; `None` if they cannot be made.
    pub factor: Option<Factor>,
    /// Rows of the triangle that hold the base's columns: `[R_bb R_bs z_b]`.
    base: DMatrix<f64>,
    /// Sum of the whitened squares that the best base leaves with the shared values as they are.
    pub squares: f64,
    /// Rows less columns of the base.
    pub degrees_of_freedom: f64,
}

impl Told {
    /// Returns the step of the base that goes with a step of the shared columns.
    pub fn base_step(&self, shared: &[f64]) -> [f64; BASE_COLUMNS] {
        let mut step = [0.0; BASE_COLUMNS];
        let last = self.base.ncols().saturating_sub(1);
        for i in (0..BASE_COLUMNS.min(self.base.nrows())).rev() {
            let mut rest = self.base[(i, last)];
            for (j, value) in step.iter().enumerate().skip(i + 1) {
                rest -= self.base[(i, j)] * value;
            }
            for (j, value) in shared.iter().enumerate() {
                rest -= self.base[(i, BASE_COLUMNS + j)] * value;
            }
            let pivot = self.base[(i, i)];
            // A direction of the base of which the pose says nothing stays where it is.
            let norm = self.base.column(i).norm();
            step[i] = if pivot.abs() > norm * 1e-12 { rest / pivot } else { 0.0 };
        }
        step
    }
}

/// Returns the turn of a rotation, rad; by a quaternion, which loses no digits near none.
pub(super) fn turn_of(rotation: &Rotation3<f64>) -> Vector3<f64> {
    UnitQuaternion::from_rotation_matrix(rotation).scaled_axis()
}

/// `J⁻¹` of `log(exp(ρ) exp(−φ)) ≈ ρ − J⁻¹ φ`.
fn log_slope(rho: &Vector3<f64>) -> Matrix3<f64> {
    let angle = rho.norm();
    let cross = rho.cross_matrix();
    let by = if angle < SMALL_ANGLE {
        1.0 / 12.0
    } else {
        (1.0 - 0.5 * angle * (0.5 * angle).cos() / (0.5 * angle).sin()) / (angle * angle)
    };
    Matrix3::identity() + 0.5 * cross + by * cross * cross
}

impl Setup {
    /// Returns the positions of all links' joints with the offsets added.
    fn positions(&self, pose: &Pose, shared: &Shared) -> Vec<f64> {
        let mut all = vec![0.0; self.joints.iter().max().map_or(0, |last| last + 1)];
        for (link, measured) in self.joints.iter().zip(&pose.positions) {
            if let Some(to) = all.get_mut(*link) {
                *to = *measured;
            }
        }
        for (k, offset) in self.asked.iter().zip(&shared.offsets) {
            if let Some(to) = self.joints.get(*k).and_then(|link| all.get_mut(*link)) {
                *to += offset;
            }
        }
        all
    }

    /// Returns the base by the first measured attitude, at the mean height of the corners that stand.
    pub fn first_base(&self, pose: &Pose, shared: &Shared) -> Base {
        let places = self.tree.places(&self.positions(pose, shared));
        let first =
            self.measured_links.first().and_then(|link| places.get(*link)).zip(pose.attitudes.first());
        let rotation = first.map_or_else(Rotation3::identity, |(place, attitude)| {
            attitude.to_rotation_matrix() * Rotation3::from_matrix_unchecked(place.rotation.transpose())
        });
        let heights: Vec<f64> = self.standing(pose, &places).map(|(_, y)| (rotation * y).z).collect();
        let height_m = -heights.iter().sum::<f64>() / heights.len().max(1) as f64;
        Base { rotation, height_m }
    }

    /// Returns the corners that stand: their link, and where they are in the base's frame, m.
    fn standing<'a>(
        &'a self,
        pose: &'a Pose,
        places: &'a [Place],
    ) -> impl Iterator<Item = (usize, Vector3<f64>)> + 'a {
        let soles = self.soles.iter().zip(&pose.stands).filter(|(_, stands)| **stands);
        soles.flat_map(move |(sole, _)| {
            let place = places.get(sole.link);
            sole.corners_m.iter().filter_map(move |own| Some((sole.link, place?.point(own))))
        })
    }

    /// Returns the number of rows of a pose.
    pub fn rows_of(&self, pose: &Pose) -> usize {
        let corners: usize = self
            .soles
            .iter()
            .zip(&pose.stands)
            .filter(|(_, s)| **s)
            .map(|(sole, _)| sole.corners_m.len())
            .sum();
        3 * self.measured_links.len() + corners
    }

    /// Returns the rows of a pose about its base and what is shared.
    pub fn rows(&self, pose: &Pose, base: &Base, shared: &Shared) -> Rows {
        let places = self.tree.places(&self.positions(pose, shared));
        let count = self.rows_of(pose);
        let mut rows = Rows {
            columns: DMatrix::zeros(count, BASE_COLUMNS + self.shared_columns()),
            encoders: DMatrix::zeros(count, self.joints.len()),
            residual: DVector::zeros(count),
            sigma: Vec::with_capacity(count),
        };
        self.attitude_rows(pose, base, shared, &places, &mut rows);
        self.height_rows(pose, base, &places, &mut rows);
        for (k, place) in self.asked.iter().enumerate() {
            let column = rows.encoders.column(*place).into_owned();
            rows.columns.set_column(BASE_COLUMNS + k, &column);
        }
        rows
    }

    fn attitude_rows(&self, pose: &Pose, base: &Base, shared: &Shared, places: &[Place], rows: &mut Rows) {
        let world = base.rotation.matrix();
        for (n, (link, attitude)) in self.measured_links.iter().zip(&pose.attitudes).enumerate() {
            let (Some(place), Some(mounting)) = (places.get(*link), shared.mountings.get(n)) else {
                continue;
            };
            let own = world * place.rotation;
            let expected = own * mounting.matrix();
            let off = attitude.to_rotation_matrix() * Rotation3::from_matrix_unchecked(expected.transpose());
            let rho = turn_of(&off);
            let slope = log_slope(&rho);
            rows.residual.fixed_rows_mut::<3>(3 * n).copy_from(&rho);
            rows.columns.fixed_view_mut::<3, 3>(3 * n, 0).copy_from(&slope);
            for (k, moves) in self.movers(*link, places) {
                let column = slope * (world * moves.angular());
                rows.encoders.fixed_view_mut::<3, 1>(3 * n, k).copy_from(&column);
            }
            if self.mounting_columns() > 0 {
                let first = BASE_COLUMNS + self.asked.len() + 3 * n;
                rows.columns.fixed_view_mut::<3, 3>(3 * n, first).copy_from(&(slope * own));
            }
            rows.sigma.extend([self.noise.attitude_rad; 3]);
        }
    }

    fn height_rows(&self, pose: &Pose, base: &Base, places: &[Place], rows: &mut Rows) {
        let up = base.rotation.matrix().row(2).transpose();
        let first = 3 * self.measured_links.len();
        for (n, (link, y)) in self.standing(pose, places).enumerate() {
            let row = first + n;
            let at = base.rotation * y;
            rows.residual[row] = -(at.z + base.height_m);
            // z·(ξ × Ry) = ξ·(Ry × z)
            let turned = at.cross(&Vector3::z());
            for k in 0..3 {
                rows.columns[(row, k)] = turned[k];
            }
            rows.columns[(row, 3)] = 1.0;
            for (k, moves) in self.movers(link, places) {
                rows.encoders[(row, k)] = up.dot(&moves.of_point(&y));
            }
            rows.sigma.push(self.noise.height_m);
        }
    }

    /// Returns the joints that move a link: their places among those that count, and how they do.
    fn movers(&self, link: usize, places: &[Place]) -> Vec<(usize, super::kinematics::Moves)> {
        let way = self.tree.way(link);
        let of = |i: &usize| Some((self.joints.iter().position(|j| j == i)?, self.tree.moves(*i, places)?));
        way.iter().filter_map(of).collect()
    }

    /// Returns the Cholesky factor of the covariance of a pose's rows; `None` if it has none.
    pub fn whitener(&self, rows: &Rows) -> Option<Cholesky<f64, Dyn>> {
        let encoder = self.noise.encoder_rad;
        let mut covariance = encoder * encoder * &rows.encoders * rows.encoders.transpose();
        for (k, sigma) in rows.sigma.iter().enumerate() {
            covariance[(k, k)] += sigma * sigma;
        }
        covariance.cholesky()
    }
}

impl Rows {
    /// Returns what the rows say, whitened, with the base eliminated.
    pub fn told(&self, whitener: &Cholesky<f64, Dyn>) -> Told {
        let (count, columns) = self.columns.shape();
        let mut all = DMatrix::zeros(count, columns + 1);
        all.view_mut((0, 0), (count, columns)).copy_from(&self.columns);
        all.set_column(columns, &self.residual);
        let solved = whitener.l_dirty().solve_lower_triangular_mut(&mut all);
        if !solved || !all.iter().all(|v| v.is_finite()) {
            return Told::default();
        }
        let values: Vec<f64> = all.column(columns).iter().copied().collect();
        let mut whole = Factor::new(columns);
        whole.absorb_matrix(&all.columns(0, columns).into_owned(), &values);
        let mut base = DMatrix::zeros(BASE_COLUMNS, columns + 1);
        base.view_mut((0, 0), (BASE_COLUMNS, columns)).copy_from(&whole.r().rows(0, BASE_COLUMNS));
        for (i, z) in whole.z().iter().take(BASE_COLUMNS).enumerate() {
            base[(i, columns)] = *z;
        }
        let shared: Vec<usize> = (BASE_COLUMNS..columns).collect();
        let factor = whole.eliminate_others(&shared);
        let squares = factor.residual_sum_of_squares() + factor.z().iter().map(|z| z * z).sum::<f64>();
        Told {
            factor: Some(factor),
            base,
            squares,
            degrees_of_freedom: (count - BASE_COLUMNS.min(count)) as f64,
        }
    }
}

//! The information of one pose: rows of its attitudes and of its contacts.
//!
//! With the base's attitude R and place p, and corner x of a link at `y = p_i + R_i x` in the base's frame, a
//! corner that touches a plane of normal n and distance d says `0 = n·(R y + p) − d`. Of the floor d is zero,
//! and the height of p is free in every pose, so that only the variance of the heights counts. A measured
//! attitude M of link i says `log(M (R R_i E)ᵀ) = 0`, E being the error of the IMU's mounting. A point y that
//! is held at c says `0 = R y + p − c`, and if it does not turn `log(C (R R_i)ᵀ) = 0`. Errors of encoders act
//! through the columns of the joints: rows of a pose have the covariance `D + J Σ Jᵀ`, by which they are
//! whitened.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix3, Rotation3, Vector3};

use super::kinematics::{Moves, Place};
use super::shared::{HeldAt, Shared};
use super::turns::{heading, log_slope, turn_of};
use super::{Pose, Setup};
use rigident_fit::Factor;

/// 1 σ of the base's place where no contact tells it, m.
const ANYWHERE_M: f64 = 100.0;
/// 1 σ of a heading that says nothing, rad.
const ANY_HEADING: f64 = 100.0;
/// Directions of the base below this share of the best known are not determined by a pose.
const DETERMINED: f64 = 1e-6;

/// The base of a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Base {
    /// World axes ← base axes.
    pub rotation: Rotation3<f64>,
    /// Its origin in the world, m; z is its height over the floor.
    pub position: Vector3<f64>,
}

impl Default for Base {
    fn default() -> Self {
        Self { rotation: Rotation3::identity(), position: Vector3::zeros() }
    }
}

impl Base {
    /// Returns the base moved by a turn about world axes, rad, a rise, m, and a shift along x and y, m.
    #[must_use]
    pub fn moved(&self, step: &[f64]) -> Self {
        let entry = |k: usize| step.get(k).copied().unwrap_or(0.0);
        let turn = Rotation3::new(Vector3::new(entry(0), entry(1), entry(2)));
        let mut rotation = turn * self.rotation;
        rotation.renormalize();
        Self { rotation, position: self.position + Vector3::new(entry(4), entry(5), entry(3)) }
    }
}

/// The subject of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RowOf {
    /// The attitude of a measured link, by its place in [`Setup::measured_links`].
    Attitude(usize),
    /// A corner of a contact, or the point of a held link, by the contact's place.
    Contact(usize),
    /// The attitude of a held link, by the contact's place.
    Turn(usize),
    /// Nothing that is measured: it keeps what no contact tells where it is.
    Kept,
}

/// The rows of a pose before they are whitened: measured less expected values, and how the expected ones
/// change.
pub struct Rows {
    /// The subject of each row.
    pub of: Vec<RowOf>,
    /// Columns of the base, then those that all poses share.
    pub columns: DMatrix<f64>,
    /// Columns of the errors of all encoders.
    pub encoders: DMatrix<f64>,
    /// Measured less expected: rad or m.
    pub residual: DVector<f64>,
    /// 1 σ of each row by itself.
    sigma: Vec<f64>,
    base_columns: usize,
}

/// The information of a pose on what is shared, its base eliminated, and how its base follows.
#[derive(Clone, Debug, Default)]
pub struct Observed {
    /// Whitened rows of the shared columns; `None` if they cannot be made.
    pub factor: Option<Factor>,
    /// Rows of the triangle that hold the base's columns: `[R_bb R_bs z_b]`.
    base: DMatrix<f64>,
    /// Sum of the whitened squares that the best base leaves with the shared values as they are.
    pub squares: f64,
    /// Measured rows less what of the base they tell.
    pub degrees_of_freedom: f64,
}

impl Observed {
    /// Returns the step of the base that goes with a step of the shared columns.
    pub fn base_step(&self, shared: &[f64]) -> Vec<f64> {
        let count = self.base.nrows();
        let mut step = vec![0.0; count];
        let last = self.base.ncols().saturating_sub(1);
        for i in (0..count).rev() {
            let mut rest = self.base[(i, last)];
            for (j, value) in step.iter().enumerate().skip(i + 1) {
                rest -= self.base[(i, j)] * value;
            }
            for (j, value) in shared.iter().enumerate() {
                rest -= self.base[(i, count + j)] * value;
            }
            let pivot = self.base[(i, i)];
            // A direction of the base of which the pose says nothing stays where it is.
            let norm = self.base.column(i).norm();
            step[i] = if pivot.abs() > norm * 1e-12 { rest / pivot } else { 0.0 };
        }
        step
    }
}

/// A point in the world and what moves it: its link's joints.
struct Point {
    /// From the base's origin, world axes.
    arm: Vector3<f64>,
    /// Joints' places among those that count, and the velocity of the point for a unit rate, world axes.
    rates: Vec<(usize, Vector3<f64>)>,
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

    /// Returns where all links are in the base's frame.
    pub(super) fn places(&self, pose: &Pose, shared: &Shared) -> Vec<Place> {
        self.tree.places(&self.positions(pose, shared))
    }

    /// Returns the base by the first measured attitude, at the mean height of the corners that stand on the
    /// floor, or where a held link puts it.
    pub fn first_base(&self, pose: &Pose, shared: &Shared) -> Base {
        let places = self.places(pose, shared);
        let first =
            self.measured_links.first().and_then(|link| places.get(*link)).zip(pose.attitudes.first());
        let rotation = first.map_or_else(Rotation3::identity, |(place, attitude)| {
            attitude.to_rotation_matrix() * Rotation3::from_matrix_unchecked(place.rotation.transpose())
        });
        let mut base = Base { rotation, position: Vector3::zeros() };
        let on_floor = self.contacts.soles.iter().zip(&pose.stands).filter(|(s, on)| **on && s.plane == 0);
        let corners = on_floor.flat_map(|(sole, _)| sole.corners_m.iter().map(move |own| (sole.link, own)));
        let heights: Vec<f64> =
            corners.filter_map(|(link, own)| Some((rotation * places.get(link)?.point(own)).z)).collect();
        if !heights.is_empty() {
            base.position.z = -heights.iter().sum::<f64>() / heights.len() as f64;
        }
        base
    }

    /// Returns the first place of a base that holds links where other poses put them, and puts there those
    /// that are held for the first time.
    pub(super) fn first_held(&self, pose: &Pose, shared: &mut Shared, known: &mut [bool]) -> Base {
        let mut base = self.first_base(pose, shared);
        let places = self.places(pose, shared);
        let on_floor = self.contacts.soles.iter().zip(&pose.stands).any(|(s, on)| *on && s.plane == 0);
        let made: Vec<usize> = (0..self.contacts.held.len())
            .filter(|n| pose.stands.get(self.contacts.soles.len() + n) == Some(&true))
            .collect();
        let at = |base: &Base, n: usize| -> Option<HeldAt> {
            let held = self.contacts.held.get(n)?;
            let place = places.get(held.link)?;
            let rotation = base.rotation * Rotation3::from_matrix_unchecked(place.rotation);
            Some(HeldAt { position: base.rotation * place.point(&held.point_m) + base.position, rotation })
        };
        if let Some(n) = made.iter().copied().find(|n| known.get(*n) == Some(&true))
            && let Some((own, there)) = at(&base, n).zip(shared.held.get(n).copied())
        {
            if self.heading_is_free() && self.contacts.held.get(n).is_some_and(|held| !held.turns) {
                base.rotation = heading(&(there.rotation * own.rotation.inverse())) * base.rotation;
            }
            let off = at(&base, n).map_or_else(Vector3::zeros, |own| there.position - own.position);
            base.position += if on_floor { Vector3::new(off.x, off.y, 0.0) } else { off };
        }
        for n in made {
            if let (Some(known), Some(to), Some(own)) =
                (known.get_mut(n), shared.held.get_mut(n), at(&base, n))
                && !*known
            {
                (*known, *to) = (true, own);
            }
        }
        base
    }

    /// Returns the number of measured rows of a pose.
    pub fn rows_of(&self, pose: &Pose) -> usize {
        let soles = self.contacts.soles.iter().map(|sole| sole.corners_m.len());
        let held = self.contacts.held.iter().map(|held| if held.turns { 3 } else { 6 });
        let made = soles.chain(held).zip(&pose.stands).filter(|(_, made)| **made);
        3 * self.measured_links.len() + made.map(|(rows, _)| rows).sum::<usize>()
    }

    /// Returns the rows of a pose about its base and what is shared.
    pub fn rows(&self, pose: &Pose, base: &Base, shared: &Shared) -> Rows {
        let places = self.places(pose, shared);
        let base_columns = self.base_columns();
        let count = self.rows_of(pose) + if base_columns > 4 { 3 } else { 0 };
        let mut rows = Rows {
            of: Vec::with_capacity(count),
            columns: DMatrix::zeros(count, base_columns + self.shared_columns()),
            encoders: DMatrix::zeros(count, self.joints.len()),
            residual: DVector::zeros(count),
            sigma: Vec::with_capacity(count),
            base_columns,
        };
        self.attitude_rows(pose, base, shared, &places, &mut rows);
        self.plane_rows(pose, base, shared, &places, &mut rows);
        self.held_rows(pose, base, shared, &places, &mut rows);
        if base_columns > 4 {
            for (column, value) in [(4, base.position.x), (5, base.position.y), (3, base.position.z)] {
                let row = rows.begun(RowOf::Kept, -value, ANYWHERE_M);
                rows.columns[(row, column)] = 1.0;
            }
        }
        for (k, place) in self.asked.iter().enumerate() {
            let column = rows.encoders.column(*place).into_owned();
            rows.columns.set_column(base_columns + k, &column);
        }
        rows
    }

    fn attitude_rows(&self, pose: &Pose, base: &Base, shared: &Shared, places: &[Place], rows: &mut Rows) {
        let world = base.rotation.matrix();
        let free = self.heading_is_free();
        for (n, (link, attitude)) in self.measured_links.iter().zip(&pose.attitudes).enumerate() {
            let (Some(place), Some(mounting)) = (places.get(*link), shared.mountings.get(n)) else {
                continue;
            };
            let own = world * place.rotation;
            let expected = own * mounting.matrix();
            let mut off =
                attitude.to_rotation_matrix() * Rotation3::from_matrix_unchecked(expected.transpose());
            if free {
                off = heading(&off).inverse() * off;
            }
            let rho = turn_of(&off);
            let slope = log_slope(&rho);
            let first = rows.of.len();
            for k in 0..3 {
                let (of, sigma) = match (k, free) {
                    (2, true) => (RowOf::Kept, ANY_HEADING),
                    (2, false) => (RowOf::Attitude(n), self.noise.yaw_rad),
                    _ => (RowOf::Attitude(n), self.noise.attitude_rad),
                };
                rows.begun(of, rho[k], sigma);
            }
            rows.columns.fixed_view_mut::<3, 3>(first, 0).copy_from(&slope);
            for (k, moves) in self.movers(*link, places) {
                let column = slope * (world * moves.angular());
                rows.encoders.fixed_view_mut::<3, 1>(first, k).copy_from(&column);
            }
            if let Some(column) = self.mounting_column(n) {
                let column = rows.base_columns + column;
                rows.columns.fixed_view_mut::<3, 3>(first, column).copy_from(&(slope * own));
            }
        }
    }

    /// Returns a point of a link in the world.
    fn point(&self, link: usize, own: &[f64; 3], base: &Base, places: &[Place]) -> Option<Point> {
        let y = places.get(link)?.point(own);
        let rates = self.movers(link, places).into_iter();
        let rates = rates.map(|(k, moves)| (k, base.rotation * moves.of_point(&y))).collect();
        Some(Point { arm: base.rotation * y, rates })
    }

    fn plane_rows(&self, pose: &Pose, base: &Base, shared: &Shared, places: &[Place], rows: &mut Rows) {
        let standing = self.contacts.soles.iter().zip(&pose.stands).enumerate().filter(|(_, (_, on))| **on);
        for (contact, (sole, _)) in standing {
            let Some(at) = shared.planes.get(sole.plane) else { continue };
            let (normal, columns) = (self.normal(sole.plane, at), self.plane_columns(sole.plane));
            let axes = self.tilt_axes(sole.plane);
            for own in &sole.corners_m {
                let Some(point) = self.point(sole.link, own, base, places) else { continue };
                let there = point.arm + base.position;
                let row = rows.begun(
                    RowOf::Contact(contact),
                    at.distance_m - normal.dot(&there),
                    self.noise.height_m,
                );
                rows.moved_along(row, &point, &normal);
                let first = rows.base_columns;
                if let Some(tilt) = columns.tilt {
                    // n·there with n turned by τ: τ·(n × there)
                    let turned = normal.cross(&there);
                    for (k, axis) in axes.iter().enumerate() {
                        rows.columns[(row, first + tilt + k)] = axis.dot(&turned);
                    }
                }
                if let Some(distance) = columns.distance {
                    rows.columns[(row, first + distance)] = -1.0;
                }
            }
        }
    }

    fn held_rows(&self, pose: &Pose, base: &Base, shared: &Shared, places: &[Place], rows: &mut Rows) {
        for (n, (held, at)) in self.contacts.held.iter().zip(&shared.held).enumerate() {
            let contact = self.contacts.soles.len() + n;
            if pose.stands.get(contact) != Some(&true) {
                continue;
            }
            let Some(point) = self.point(held.link, &held.point_m, base, places) else { continue };
            let columns = self.held_columns(n);
            let first = rows.base_columns + columns.start;
            let off = at.position - point.arm - base.position;
            for k in 0..3 {
                let row = rows.begun(RowOf::Contact(contact), off[k], self.noise.height_m);
                rows.moved_along(row, &point, &Vector3::ith(k, 1.0));
                rows.columns[(row, first + k)] = -1.0;
            }
            let Some(place) = places.get(held.link).filter(|_| !held.turns) else { continue };
            let own = base.rotation.matrix() * place.rotation;
            let rho = turn_of(&(at.rotation * Rotation3::from_matrix_unchecked(own.transpose())));
            let slope = log_slope(&rho);
            let row = rows.of.len();
            (0..3).for_each(|k| {
                rows.begun(RowOf::Turn(contact), rho[k], self.noise.attitude_rad);
            });
            rows.columns.fixed_view_mut::<3, 3>(row, 0).copy_from(&slope);
            for (k, moves) in self.movers(held.link, places) {
                let column = slope * (base.rotation * moves.angular());
                rows.encoders.fixed_view_mut::<3, 1>(row, k).copy_from(&column);
            }
            // log(exp(γ) exp(ρ)) ≈ ρ + J_l⁻¹ γ, and J_l⁻¹ = J_r⁻ᵀ
            let back: Matrix3<f64> = -slope.transpose();
            rows.columns.fixed_view_mut::<3, 3>(row, first + 3).copy_from(&back);
        }
    }

    /// Returns the joints that move a link: their places among those that count, and how they do.
    fn movers(&self, link: usize, places: &[Place]) -> Vec<(usize, Moves)> {
        let way = self.tree.way(link);
        let of = |i: &usize| Some((self.joints.iter().position(|j| j == i)?, self.tree.moves(*i, places)?));
        way.iter().filter_map(of).collect()
    }

    /// Returns the Cholesky factor of the covariance of a pose's rows; `None` if it has none.
    pub fn whitener(&self, rows: &Rows) -> Option<Cholesky<f64, Dyn>> {
        let mut scaled = rows.encoders.clone();
        for (mut column, link) in scaled.column_iter_mut().zip(&self.joints) {
            column *= if self.tree.slides(*link) { self.noise.slide_m } else { self.noise.encoder_rad };
        }
        let mut covariance = &scaled * scaled.transpose();
        for (k, sigma) in rows.sigma.iter().enumerate() {
            covariance[(k, k)] += sigma * sigma;
        }
        covariance.cholesky()
    }
}

impl Rows {
    /// Begins a row and returns its number.
    fn begun(&mut self, of: RowOf, residual: f64, sigma: f64) -> usize {
        let row = self.of.len();
        self.of.push(of);
        self.sigma.push(sigma);
        self.residual[row] = residual;
        row
    }

    /// Sets how a point moves along a direction with the base and the joints.
    fn moved_along(&mut self, row: usize, point: &Point, along: &Vector3<f64>) {
        // n·(ξ × a) = ξ·(a × n)
        let turned = point.arm.cross(along);
        for k in 0..3 {
            self.columns[(row, k)] = turned[k];
        }
        self.columns[(row, 3)] = along.z;
        if self.base_columns > 4 {
            (self.columns[(row, 4)], self.columns[(row, 5)]) = (along.x, along.y);
        }
        for (k, rate) in &point.rates {
            self.encoders[(row, *k)] = along.dot(rate);
        }
    }

    /// Returns the number of measured rows less the directions of the base that they tell.
    fn degrees_of_freedom(&self) -> f64 {
        let measured: Vec<usize> =
            (0..self.of.len()).filter(|k| self.of.get(*k) != Some(&RowOf::Kept)).collect();
        let base = self.columns.columns(0, self.base_columns).select_rows(&measured);
        let values = base.singular_values();
        let determined = values.iter().filter(|value| **value > DETERMINED * values.max()).count();
        measured.len() as f64 - determined as f64
    }

    /// Returns what the rows say, whitened, with the base eliminated.
    pub fn observed(&self, whitener: &Cholesky<f64, Dyn>) -> Observed {
        let (count, columns) = self.columns.shape();
        let mut all = DMatrix::zeros(count, columns + 1);
        all.view_mut((0, 0), (count, columns)).copy_from(&self.columns);
        all.set_column(columns, &self.residual);
        let solved = whitener.l_dirty().solve_lower_triangular_mut(&mut all);
        if !solved || !all.iter().all(|v| v.is_finite()) {
            return Observed::default();
        }
        let values: Vec<f64> = all.column(columns).iter().copied().collect();
        let mut whole = Factor::new(columns);
        whole.absorb_matrix(&all.columns(0, columns).into_owned(), &values);
        let of_base = self.base_columns;
        let mut base = DMatrix::zeros(of_base, columns + 1);
        base.view_mut((0, 0), (of_base, columns)).copy_from(&whole.r().rows(0, of_base));
        for (i, z) in whole.z().iter().take(of_base).enumerate() {
            base[(i, columns)] = *z;
        }
        let shared: Vec<usize> = (of_base..columns).collect();
        let factor = whole.eliminate_others(&shared);
        let squares = factor.residual_sum_of_squares() + factor.z().iter().map(|z| z * z).sum::<f64>();
        Observed { factor: Some(factor), base, squares, degrees_of_freedom: self.degrees_of_freedom() }
    }
}

//! The effect of springs on a platform: the wrench of a displacement, and what errors of their stiffness
//! change in it.
//!
//! Axes are those of the platform at rest, z up, moments about the point O of the platform where it is now.
//! With the shift d of O, the turn R and its vector θ
//! ```text
//! matrix:          [F; M] = −K [d; θ]
//! springs at a:    δ = d + (R − 1) a,   F = −Σ K_s δ,   M = −Σ R a × K_s δ,   K_s = k_n n nᵀ + k_t (1 − n nᵀ)
//! ```
//! The springs' law is exact at any angle, the matrix' to first order. A clamped spring of length L pushes
//! across at half of it, where its moment is zero, and resists turning by `k_b (1 − n nᵀ) θ`. What they carry
//! at rest is not among it: see [`super::preload`].

use nalgebra::{Matrix3, Matrix6, Rotation3, UnitQuaternion, Vector3, Vector6};

use rigident_fit::{Basis, Effect, Nuisance, Scope};
use rigident_io::rig::{Coordinate, SuspensionTable};

/// Names of the coordinates of a platform.
pub const COORDINATES: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];
/// 1 σ of stiffnesses, relative, where none is given: springs of a catalogue, 5 % either way.
const STIFFNESS_STD: f64 = 0.05 / 1.732_050_807_568_877_2;
/// Stiffness of a clamped coil against turning by its axial stiffness and the square of its diameter: `E I /
/// L` of round wire by `G d⁴ / (8 n D³)`, with Poisson's ratio 0.3 (A. M. Wahl, Mechanical Springs, 1963):
/// `(2 + 2ν) / (4 (2 + ν))`.
const BENDING: f64 = 0.28;
/// 1 σ of that, relative.
const BENDING_STD: f64 = 0.2;
/// Change of the stiffness of steel springs by temperature, relative, 1/K (modulus of shear; A. M. Wahl,
/// 1963).
const BY_TEMPERATURE: f64 = -3e-4;
/// 1 σ of the damping ratio that is searched for, where none is given.
const DAMPING_RATIO_STD: f64 = 0.05;
/// Frequency at which a damping ratio is understood, rad/s: platforms swing at about 1 Hz.
const DAMPED_AT: f64 = std::f64::consts::TAU;

/// The position of a platform, relative to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Displacement {
    /// Shift of O, m.
    pub shift: Vector3<f64>,
    /// Velocity of O, m/s.
    pub velocity: Vector3<f64>,
    /// Axes at rest ← axes of the platform.
    pub rotation: Matrix3<f64>,
    /// Angular rate, axes at rest, rad/s.
    pub rate: Vector3<f64>,
    /// The vector of the rotation, axes at rest, rad.
    turn: Vector3<f64>,
}

impl Displacement {
    /// Returns the position with these shift of O (m), velocity (m/s), rotation and angular rate (rad/s).
    pub fn new(
        shift: Vector3<f64>,
        velocity: Vector3<f64>,
        rotation: Matrix3<f64>,
        rate: Vector3<f64>,
    ) -> Self {
        Self { shift, velocity, rotation, rate, turn: turn(&rotation) }
    }

    /// Returns shift and vector of the turn.
    pub fn coordinates(&self) -> Vector6<f64> {
        let (shift, turn) = (&self.shift, &self.turn);
        Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
    }

    /// Returns the vector of the turn, axes at rest, rad.
    pub fn turn(&self) -> Vector3<f64> {
        self.turn
    }

    /// Returns velocity of O and angular rate, axes at rest, m/s and rad/s.
    pub fn rates(&self) -> Vector6<f64> {
        let (v, w) = (self.velocity, self.rate);
        Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z)
    }
}

/// A spring that acts on a point.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Spring {
    /// The point against O, axes of the platform, m.
    arm: Vector3<f64>,
    /// The direction of the spring.
    axis: Vector3<f64>,
    axial: f64,
    lateral: f64,
    /// Moment across the axis by a turn, N m.
    bending: f64,
}

/// The possible errors of springs, each by a factor or an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SpringError {
    /// An element of the stiffness and its mirror image.
    Stiffness(usize, usize),
    /// A spring's stiffness along its axis, relative.
    Axial(usize),
    /// A spring's stiffness across its axis, relative.
    Lateral(usize),
    /// A spring's stiffness against turning of its seat, relative.
    Bending(usize),
    /// The stiffness of all springs alike.
    Common,
    /// An element of the damping and its mirror image.
    Damping(usize, usize),
}

impl SpringError {
    fn is_of_stiffness(self) -> bool {
        !matches!(self, Self::Damping(..))
    }
}

/// Springs, with what is not known of them.
#[derive(Clone, Debug)]
pub struct Springs {
    matrix: Option<Matrix6<f64>>,
    each: Vec<Spring>,
    errors: Vec<SpringError>,
    nuisances: Vec<Nuisance>,
}

impl Springs {
    /// Returns the springs of a rig file.
    pub fn new(table: &SuspensionTable) -> Self {
        let at = Vector3::from(table.at_m);
        let warmer = 1.0 + BY_TEMPERATURE * table.temperature_change_k;
        let spring = |own: &rigident_io::rig::SpringTable| {
            let axis = Vector3::from(own.axis).normalize();
            let half = if own.clamped { 0.5 * own.length_m.unwrap_or(0.0) } else { 0.0 };
            let diameter = own.diameter_m.filter(|_| own.clamped).unwrap_or(0.0);
            Spring {
                arm: Vector3::from(own.at_m) - at - axis * half,
                axis,
                axial: own.axial_npm * warmer,
                lateral: own.lateral_npm * warmer,
                bending: BENDING * own.axial_npm * warmer * diameter * diameter,
            }
        };
        let matrix = table.stiffness.map(|rows| {
            let k = Matrix6::from_fn(|i, j| rows[i][j]);
            (k + k.transpose()) * (0.5 * warmer)
        });
        let mut springs = Self {
            matrix,
            each: table.spring.iter().map(spring).collect(),
            errors: Vec::new(),
            nuisances: Vec::new(),
        };
        springs.add_errors(table);
        springs
    }

    fn add_errors(&mut self, table: &SuspensionTable) {
        let free: Vec<usize> = free(&table.locked);
        let k = self.stiffness();
        let scale = |i: usize, j: usize| (k[(i, i)] * k[(j, j)]).abs().sqrt();
        let relative = table.stiffness_std.unwrap_or(STIFFNESS_STD);
        let basis = |given: bool, key: &str| match given {
            true => Basis::Stated(format!("[suspension] {key}")),
            false => Basis::Class("springs of a catalogue".to_owned()),
        };
        let pairs: Vec<(usize, usize)> =
            free.iter().flat_map(|i| free.iter().filter(move |j| **j >= *i).map(move |j| (*i, *j))).collect();
        let damping = table.damping_ratio_std.unwrap_or(DAMPING_RATIO_STD);
        for (i, j) in pairs.iter().copied() {
            let name = format!("damping_{}_{}", COORDINATES[i], COORDINATES[j]);
            // c = 2 ζ k / ω
            let sigma = 2.0 * damping * scale(i, j) / DAMPED_AT;
            let unit = format!("{} s", unit(i, j));
            let basis = basis(table.damping_ratio_std.is_some(), "damping_ratio_std");
            self.add(SpringError::Damping(i, j), name, "damping", unit, sigma, basis);
        }
        if self.matrix.is_some() {
            for (i, j) in pairs.iter().copied() {
                let stated = table.stiffness_element_std.map(|std| 0.5 * (std[i][j] + std[j][i]));
                let key = if stated.is_some() { "stiffness_element_std" } else { "stiffness_std" };
                let given = stated.is_some() || table.stiffness_std.is_some();
                let name = format!("stiffness_{}_{}", COORDINATES[i], COORDINATES[j]);
                let sigma = stated.unwrap_or(relative * scale(i, j));
                self.add(
                    SpringError::Stiffness(i, j),
                    name,
                    "stiffness",
                    unit(i, j),
                    sigma,
                    basis(given, key),
                );
            }
        }
        let parted = if self.matrix.is_some() { &[] } else { table.spring.as_slice() };
        for (n, own) in parted.iter().enumerate() {
            let group = format!("spring {}", n + 1);
            let (sigma, given) =
                (own.std.unwrap_or(relative), own.std.is_some() || table.stiffness_std.is_some());
            for (error, name, stiffness) in [
                (SpringError::Axial(n), "axial", own.axial_npm),
                (SpringError::Lateral(n), "lateral", own.lateral_npm),
            ] {
                if stiffness > 0.0 {
                    let name = format!("spring{}_{name}", n + 1);
                    self.add(error, name, &group, String::new(), sigma, basis(given, "std"));
                }
            }
            if self.each[n].bending > 0.0 && sigma > 0.0 {
                let (name, basis) = (format!("spring{}_bending", n + 1), basis(false, "std"));
                self.add(SpringError::Bending(n), name, &group, String::new(), BENDING_STD, basis);
            }
        }
        let (common, given) = common_std(table);
        let common = common.hypot(BY_TEMPERATURE * table.temperature_std_k);
        let name = "springs_common".to_owned();
        let basis = basis(given, "stiffness_common_std");
        self.add(SpringError::Common, name, "all springs", String::new(), common, basis);
    }

    fn add(&mut self, error: SpringError, name: String, group: &str, unit: String, sigma: f64, basis: Basis) {
        if sigma > 0.0 {
            let effect = Effect::Signal(self.errors.len());
            let group = group.to_owned();
            self.nuisances.push(Nuisance { name, group, unit, sigma, basis, scope: Scope::Rig, effect });
            self.errors.push(error);
        }
    }

    /// Returns how many of the errors are of the damping: they come first.
    pub fn dampings(&self) -> usize {
        self.errors.iter().filter(|error| !error.is_of_stiffness()).count()
    }

    /// Returns the stiffness about O: six forces and moments against six displacements.
    pub fn stiffness(&self) -> Matrix6<f64> {
        self.matrix.unwrap_or_else(|| self.each.iter().map(|s| s.about_o(&s.matrix()) + s.bends()).sum())
    }

    /// Returns what is not known of them.
    pub fn nuisances(&self) -> &[Nuisance] {
        &self.nuisances
    }

    /// Returns what is not known of their stiffness alone, numbered anew.
    pub fn stiffness_nuisances(&self) -> Vec<Nuisance> {
        let own = self.nuisances.iter().zip(&self.errors).filter(|(_, error)| error.is_of_stiffness());
        own.enumerate().map(|(k, (n, _))| Nuisance { effect: Effect::Signal(k), ..n.clone() }).collect()
    }

    /// Returns what a unit of each of these changes in the stiffness about O.
    pub fn error_stiffnesses(&self) -> Vec<Matrix6<f64>> {
        let of = |error: &SpringError| match *error {
            SpringError::Stiffness(i, j) => {
                let mut out = Matrix6::zeros();
                (out[(i, j)], out[(j, i)]) = (1.0, 1.0);
                Some(out)
            }
            SpringError::Axial(n) => Some(self.each[n].about_o(&self.each[n].along())),
            SpringError::Lateral(n) => {
                Some(self.each[n].about_o(&(self.each[n].matrix() - self.each[n].along())))
            }
            SpringError::Bending(n) => Some(self.each[n].bends()),
            SpringError::Common => Some(self.stiffness()),
            SpringError::Damping(..) => None,
        };
        self.errors.iter().filter_map(of).collect()
    }

    /// Returns the wrench on the platform about O, N and N m.
    pub fn wrench(&self, at: &Displacement) -> Vector6<f64> {
        match &self.matrix {
            Some(k) => -k * at.coordinates(),
            None => self.each.iter().map(|spring| spring.whole_wrench(at)).sum(),
        }
    }

    /// Returns the numbers of the springs that are not those of `other`; none where a matrix says what they
    /// do.
    pub(super) fn unlike(&self, other: &Self) -> Vec<usize> {
        let both = self.each.iter().zip(&other.each).enumerate();
        both.filter(|(_, (a, b))| self.matrix.is_none() && a != b).map(|(n, _)| n).collect()
    }

    /// Returns the wrench of some springs alone, by their numbers.
    pub(super) fn wrench_of(&self, numbers: &[usize], at: &Displacement) -> Vector6<f64> {
        numbers.iter().filter_map(|n| self.each.get(*n)).map(|spring| spring.whole_wrench(at)).sum()
    }

    /// Returns what a unit of each error adds to the wrench, in the order of the numbers in
    /// [`Springs::nuisances`].
    pub fn error_wrenches(&self, at: &Displacement) -> Vec<Vector6<f64>> {
        let (q, rates) = (at.coordinates(), at.rates());
        let symmetric = |i: usize, j: usize, by: &Vector6<f64>| {
            let mut out = Vector6::zeros();
            out[i] -= by[j];
            if i != j {
                out[j] -= by[i];
            }
            out
        };
        let of = |error: &SpringError| match *error {
            SpringError::Stiffness(i, j) => symmetric(i, j, &q),
            SpringError::Damping(i, j) => symmetric(i, j, &rates),
            SpringError::Axial(n) => self.each[n].wrench(at, &self.each[n].along()),
            SpringError::Lateral(n) => {
                self.each[n].wrench(at, &(self.each[n].matrix() - self.each[n].along()))
            }
            SpringError::Bending(n) => -self.each[n].bends() * q,
            SpringError::Common => self.wrench(at),
        };
        self.errors.iter().map(of).collect()
    }
}

impl Spring {
    fn along(&self) -> Matrix3<f64> {
        self.axis * self.axis.transpose() * self.axial
    }

    fn matrix(&self) -> Matrix3<f64> {
        self.along() + (Matrix3::identity() - self.axis * self.axis.transpose()) * self.lateral
    }

    /// Returns what its seat does against turns.
    fn bends(&self) -> Matrix6<f64> {
        let mut all = Matrix6::zeros();
        let across = Matrix3::identity() - self.axis * self.axis.transpose();
        all.fixed_view_mut::<3, 3>(3, 3).copy_from(&(across * self.bending));
        all
    }

    /// Returns what a stiffness of the point gives about O.
    fn about_o(&self, stiffness: &Matrix3<f64>) -> Matrix6<f64> {
        let mut arms = nalgebra::Matrix3x6::zeros();
        arms.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        arms.fixed_view_mut::<3, 3>(0, 3).copy_from(&-self.arm.cross_matrix());
        arms.transpose() * stiffness * arms
    }

    /// Returns its force on the point, and what its seat does against turns, about O.
    fn whole_wrench(&self, at: &Displacement) -> Vector6<f64> {
        let of_point = self.wrench(at, &self.matrix());
        if self.bending == 0.0 { of_point } else { of_point - self.bends() * at.coordinates() }
    }

    fn wrench(&self, at: &Displacement, stiffness: &Matrix3<f64>) -> Vector6<f64> {
        let arm = at.rotation * self.arm;
        let force = -stiffness * (at.shift + arm - self.arm);
        let moment = arm.cross(&force);
        Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
    }
}

/// Returns 1 σ of the factor that all springs share, and whether it is stated: springs of one batch, weighed
/// by one load cell, are off alike.
fn common_std(table: &SuspensionTable) -> (f64, bool) {
    if let Some(stated) = table.stiffness_common_std {
        return (stated, true);
    }
    if table.stiffness.is_some() && table.stiffness_element_std.is_some() {
        return (0.0, false);
    }
    let own = table.stiffness_std.unwrap_or(STIFFNESS_STD);
    let each = |spring: &rigident_io::rig::SpringTable| spring.std.unwrap_or(own);
    let least = table.spring.iter().map(each).min_by(f64::total_cmp);
    (if table.stiffness.is_some() { own } else { least.unwrap_or(own) }, false)
}

/// Returns the coordinates that are not locked.
pub fn free(locked: &[Coordinate]) -> Vec<usize> {
    (0..6).filter(|i| !locked.iter().any(|c| c.index() == *i)).collect()
}

fn unit(i: usize, j: usize) -> String {
    match (i < 3, j < 3) {
        (true, true) => "N/m",
        (false, false) => "N m",
        _ => "N",
    }
    .to_owned()
}

/// Returns an attitude as a vector of its turn, rad. Small angles keep their digits in a quaternion, not in
/// the trace of a matrix.
pub(super) fn turn(attitude: &Matrix3<f64>) -> Vector3<f64> {
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*attitude)).scaled_axis()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rigident_io::rig::RigFile;

    const FOUR: &str = "[suspension]\nat_m = [0.0, 0.0, 0.1]\n\
        spring = [{ at_m = [0.4, 0.3, 0.1], axial_npm = 9e3, lateral_npm = 1.1e3 }, \
        { at_m = [-0.4, 0.3, 0.1], axial_npm = 8.8e3, lateral_npm = 1.0e3 }, \
        { at_m = [-0.4, -0.3, 0.15], axial_npm = 9.1e3, lateral_npm = 1.0e3 }, \
        { at_m = [0.4, -0.3, 0.1], axis = [0.1, 0.0, 1.0], axial_npm = 9e3, lateral_npm = 1.2e3 }]\n";

    fn springs(text: &str) -> Springs {
        Springs::new(RigFile::parse(text).unwrap().suspension.as_ref().unwrap())
    }

    fn displaced(by: f64) -> Displacement {
        Displacement::new(
            Vector3::new(0.3, -0.2, 0.1) * by,
            Vector3::new(1.0, 2.0, -0.5),
            Rotation3::from_scaled_axis(Vector3::new(0.2, 0.5, -0.4) * by).into_inner(),
            Vector3::new(-0.3, 0.7, 0.2),
        )
    }

    #[test]
    fn springs_have_the_stiffness_that_their_wrench_has_at_rest() {
        let springs = springs(FOUR);
        let (h, k) = (1e-6, springs.stiffness());
        let wanted = -k * displaced(h).coordinates();
        let got = springs.wrench(&displaced(h));
        assert!((got - wanted).norm() < 1e-5 * wanted.norm());
        assert!((k - k.transpose()).norm() < 1e-9 * k.norm());
    }

    #[test]
    fn springs_store_energy() {
        // The work along a closed path is zero: the wrench is a gradient at any angle.
        let springs = springs(FOUR);
        let pose = |s: f64| {
            let (a, b) = s.sin_cos();
            (
                Vector3::new(0.05 * a, 0.04 * b, 0.03 * a * b),
                Rotation3::from_scaled_axis(Vector3::new(0.5 * b, 0.4 * a, 0.6 * a)),
            )
        };
        let (mut work, mut moved, steps) = (0.0, 0.0, 4000);
        for k in 0..steps {
            let at = |offset: f64| pose(std::f64::consts::TAU * (f64::from(k) + offset) / f64::from(steps));
            let ((p, r), (p0, r0), (p1, r1)) = (at(0.0), at(-0.5), at(0.5));
            let middle = Displacement::new(p, p, r.into_inner(), p);
            let turn = (r1 * r0.inverse()).scaled_axis();
            let step = Vector6::from_iterator((p1 - p0).iter().chain(turn.iter()).copied());
            let part = springs.wrench(&middle).dot(&step);
            work += part;
            moved += part.abs();
        }
        assert!(work.abs() < 1e-6 * moved, "{work} {moved}");
    }

    #[test]
    fn errors_are_the_changes_by_other_springs() {
        let at = displaced(0.1);
        let own = springs(FOUR);
        let other = springs(&FOUR.replace("axial_npm = 8.8e3", "axial_npm = 9.68e3"));
        let k = own.nuisances().iter().position(|n| n.name == "spring2_axial").unwrap();
        let change = own.error_wrenches(&at)[k] * 0.1;
        assert!((other.wrench(&at) - own.wrench(&at) - change).norm() < 1e-9);
        let matrix = |x_pitch: f64| {
            let mut rows = Matrix6::from_diagonal(&Vector6::new(4e3, 4e3, 3e4, 2e3, 3e3, 1e3));
            (rows[(0, 4)], rows[(4, 0)]) = (x_pitch, x_pitch);
            let rows: Vec<String> =
                rows.row_iter().map(|r| format!("{:?}", r.iter().collect::<Vec<_>>())).collect();
            springs(&format!("[suspension]\nanchor_height_m = 0.0\nstiffness = [{}]\n", rows.join(", ")))
        };
        let (own, other) = (matrix(100.0), matrix(130.0));
        let k = own.nuisances().iter().position(|n| n.name == "stiffness_x_pitch").unwrap();
        let change = own.error_wrenches(&at)[k] * 30.0;
        assert!((other.wrench(&at) - own.wrench(&at) - change).norm() < 1e-9);
    }
}

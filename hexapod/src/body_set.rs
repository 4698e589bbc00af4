//! Bodies that are known only within bounds, and the extremes of what they do.
//!
//! A wrench, a leg's force and a load cell's channel are linear in the ten parameters `φ = [m, mc, I]` about
//! a frame's origin: `aᵀ φ`. A set of bodies is `φ = φ₀ + Σ t_k g_k + Σ s_k l_k + J`, `|t_k| ≤ 1`,
//! `Σ s_k² ≤ 1`, and `J` the second moment `∫ d dᵀ dm` of masses whose trace is at most ρ. The extremes of
//! `aᵀ φ` over it are `aᵀ φ₀ ± (Σ |aᵀ g_k| + √Σ (aᵀ l_k)²)` and, with `aᵀ J = tr(S J)`, ρ times the extreme
//! eigenvalues of S or zero.

use nalgebra::{Matrix3, Vector3};

use super::body::BodyParameters;
use super::kinematics::PlateState;

/// Ten parameters about a frame's origin, `[m, mcx, mcy, mcz, Ixx, Iyy, Izz, Iyz, Izx, Ixy]`, SI.
type Ten = [f64; 10];

/// A set of bodies: a middle, spreads about it, and masses anywhere within a distance. Everything in one
/// frame.
#[derive(Clone, Debug, PartialEq)]
pub struct BodySet {
    /// The middle of the set.
    pub middle: Ten,
    /// Half-axes of a box: each is taken between −1 and 1 times, on its own.
    pub half_axes: Vec<Ten>,
    /// Half-axes of an ellipsoid: the squares of their shares sum to at most one.
    pub ellipsoid: Vec<Ten>,
    /// Largest trace of the second moment that is in none of these, kg m².
    pub second_moment_kgm2: f64,
    /// Another set that has them, too.
    pub and: Option<Box<BodySet>>,
}

/// Returns the second moment `∫ r rᵀ dm` of a tensor: `½ tr(I) 1 − I`.
fn second_moment(phi: &Ten) -> Matrix3<f64> {
    let [.., xx, yy, zz, yz, zx, xy] = *phi;
    Matrix3::identity() * (0.5 * (xx + yy + zz)) - Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz)
}

fn of_moments(mass: f64, first: &Vector3<f64>, second: &Matrix3<f64>) -> Ten {
    let i = Matrix3::identity() * second.trace() - second;
    [mass, first.x, first.y, first.z, i[(0, 0)], i[(1, 1)], i[(2, 2)], i[(1, 2)], i[(2, 0)], i[(0, 1)]]
}

/// Returns the ten parameters in another frame: this one's origin is at `offset` there, its axes the columns
/// of `rotation`.
fn in_frame(phi: &Ten, offset: &Vector3<f64>, rotation: &Matrix3<f64>) -> Ten {
    let (mass, first) = (phi[0], rotation * Vector3::new(phi[1], phi[2], phi[3]));
    let second = rotation * second_moment(phi) * rotation.transpose()
        + first * offset.transpose()
        + offset * first.transpose()
        + offset * offset.transpose() * mass;
    of_moments(mass, &(first + offset * mass), &second)
}

fn dot(a: &Ten, b: &Ten) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl BodySet {
    /// Returns the set of one body, which is known.
    pub fn known(body: &BodyParameters) -> Self {
        Self {
            middle: body.parameters(),
            half_axes: Vec::new(),
            ellipsoid: Vec::new(),
            second_moment_kgm2: 0.0,
            and: None,
        }
    }

    /// Returns every body of at most `mass_kg` within `radius_m` of `centre_m`. Bodies that are none are in
    /// it, too.
    pub fn bounded(mass_kg: f64, centre_m: [f64; 3], radius_m: f64) -> Self {
        let half = of_moments(0.5 * mass_kg, &Vector3::zeros(), &Matrix3::zeros());
        let axis = |k: usize| {
            let mut first = Vector3::zeros();
            first[k] = mass_kg * radius_m;
            of_moments(0.0, &first, &Matrix3::zeros())
        };
        let about_centre = Self {
            middle: half,
            half_axes: vec![half],
            ellipsoid: vec![axis(0), axis(1), axis(2)],
            second_moment_kgm2: mass_kg * radius_m * radius_m,
            and: None,
        };
        about_centre.in_frame(&Vector3::from(centre_m), &Matrix3::identity())
    }

    /// Returns every body that a scale has weighed: its mass and first moment about the origin across `up`
    /// are within `mass_spread_kg` and `moment_spread_kgm` of `mass_kg` and `across_kgm`, all of it lies
    /// within `radius_m` of the origin. The height of its centre of mass, along `up`, is not known to a
    /// scale.
    pub fn weighed(
        mass_kg: f64,
        mass_spread_kg: f64,
        across_kgm: [f64; 3],
        moment_spread_kgm: f64,
        up: [f64; 3],
        radius_m: f64,
    ) -> Self {
        let none = Matrix3::zeros();
        let up = Vector3::from(up).normalize();
        let across = Vector3::from(across_kgm);
        let across = across - up * up.dot(&across);
        // Any two axes across the vertical.
        let one = up.cross(&Vector3::ith(up.iamin(), 1.0)).normalize();
        let two = up.cross(&one);
        let most_kg = mass_kg + mass_spread_kg;
        let height = (most_kg * radius_m).powi(2) - (across.norm() - moment_spread_kgm).max(0.0).powi(2);
        let first = |v: Vector3<f64>| of_moments(0.0, &v, &none);
        Self {
            middle: of_moments(mass_kg, &across, &none),
            half_axes: vec![
                of_moments(mass_spread_kg, &Vector3::zeros(), &none),
                first(up * height.max(0.0).sqrt()),
            ],
            ellipsoid: vec![first(one * moment_spread_kgm), first(two * moment_spread_kgm)],
            second_moment_kgm2: most_kg * radius_m * radius_m,
            and: None,
        }
    }

    /// Returns every body within `deviations` standard deviations of an estimate, whose covariance is `L Lᵀ`,
    /// by columns of L, SI.
    pub fn estimated(estimate: Ten, root: &[Ten], deviations: f64) -> Self {
        Self {
            middle: estimate,
            half_axes: Vec::new(),
            ellipsoid: root.iter().map(|l| l.map(|v| deviations * v)).collect(),
            second_moment_kgm2: 0.0,
            and: None,
        }
    }

    /// Returns the bodies of an estimated mass and first moment about the origin, within `deviations`
    /// standard deviations of their covariance, whose columns of L are in `root` with the tensor's; their
    /// second moment is what it is in this set.
    #[must_use]
    pub fn with_first_moments(&self, first: [f64; 4], root: &[Ten], deviations: f64) -> Self {
        let four = |phi: &Ten, by: f64| std::array::from_fn(|j| if j < 4 { by * phi[j] } else { 0.0 });
        let [m, x, y, z] = first;
        Self {
            middle: [m, x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            half_axes: Vec::new(),
            ellipsoid: root.iter().map(|l| four(l, deviations)).collect(),
            second_moment_kgm2: self.moments()[2],
            and: None,
        }
    }

    /// Returns the same bodies in another frame: this one's origin is at `offset_m` there, its axes the
    /// columns of `rotation`. A second moment is about its own point and has no mass.
    pub fn in_frame(&self, offset_m: &Vector3<f64>, rotation: &Matrix3<f64>) -> Self {
        let moved = |phi: &Ten| in_frame(phi, offset_m, rotation);
        Self {
            middle: moved(&self.middle),
            half_axes: self.half_axes.iter().map(moved).collect(),
            ellipsoid: self.ellipsoid.iter().map(moved).collect(),
            second_moment_kgm2: self.second_moment_kgm2,
            and: self.and.as_ref().map(|other| Box::new(other.in_frame(offset_m, rotation))),
        }
    }

    /// Returns the bodies of this set that are in another one, too.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self { and: Some(Box::new(other)), ..self }
    }

    /// Returns the least and the greatest mass in the set, kg, somewhat wider than needed.
    pub fn masses_kg(&self) -> [f64; 2] {
        let mut mass = [0.0; 10];
        mass[0] = 1.0;
        self.range(&mass)
    }

    /// Returns the least and the greatest `aᵀ φ` over the set, somewhat wider than needed.
    pub fn range(&self, a: &Ten) -> [f64; 2] {
        let [low, high] = self.range_alone(a);
        match self.and.as_ref().map(|other| other.range(a)) {
            // Sets that have nothing in common bound nothing.
            Some([least, most]) if low <= most && least <= high => [low.max(least), high.min(most)],
            Some([least, most]) => [low.min(least), high.max(most)],
            None => [low, high],
        }
    }

    fn range_alone(&self, a: &Ten) -> [f64; 2] {
        let middle = dot(a, &self.middle);
        let spread = self.half_axes.iter().map(|g| dot(a, g).abs()).sum::<f64>()
            + self.ellipsoid.iter().map(|l| dot(a, l).powi(2)).sum::<f64>().sqrt();
        let mut range = [middle - spread, middle + spread];
        if self.second_moment_kgm2 > 0.0 {
            // I = tr(J) 1 − J.
            let [.., xx, yy, zz, yz, zx, xy] = *a;
            let s = Matrix3::new(
                yy + zz,
                -0.5 * xy,
                -0.5 * zx,
                -0.5 * xy,
                zz + xx,
                -0.5 * yz,
                -0.5 * zx,
                -0.5 * yz,
                xx + yy,
            );
            let eigen = s.symmetric_eigenvalues();
            range[0] += self.second_moment_kgm2 * eigen.min().min(0.0);
            range[1] += self.second_moment_kgm2 * eigen.max().max(0.0);
        }
        range
    }

    /// Returns bounds of the mass (kg), of the first (kg m) and of the second moment (kg m²) of distances
    /// from the origin.
    pub fn moments(&self) -> [f64; 3] {
        let unit = |at: &[usize], value: f64| {
            let mut a = [0.0; 10];
            at.iter().for_each(|k| a[*k] = value);
            self.range(&a)[1].max(0.0)
        };
        let (mass, second) = (unit(&[0], 1.0), unit(&[4, 5, 6], 0.5));
        // Cauchy and Schwarz.
        [mass, (mass * second).sqrt(), second]
    }

    /// Returns true if a body is in the set, as far as the extremes of single parameters tell; its second
    /// moment counts as the set's where that has one.
    pub fn may_hold(&self, body: &BodyParameters) -> bool {
        let phi = body.parameters();
        (0..10).all(|j| {
            let mut a = [0.0; 10];
            a[j] = 1.0;
            let [low, high] = self.range(&a);
            (low..=high).contains(&phi[j])
        })
    }
}

/// Returns, for each of the ten parameters in P, its part in a wrench `(u, v)` against the motion of the
/// plate: the force and moment about P's origin that the parameter needs, times u and v (P).
pub(super) fn linear_form(
    state: &PlateState,
    gravity: &Vector3<f64>,
    u: &Vector3<f64>,
    v: &Vector3<f64>,
) -> Ten {
    // f = m s + Ω mc and M = mc × s + I ω̇ + ω × I ω, with s the specific force and Ω = [ω̇]× + [ω]×[ω]×.
    let (w, dw) = (state.angular_rate, state.angular_acceleration);
    let s = state.rotation.transpose() * (state.acceleration - gravity);
    let spin = dw.cross_matrix() + w.cross_matrix() * w.cross_matrix();
    let first = spin.transpose() * u + s.cross(v);
    let t = v.cross(&w);
    let pair = |i: usize, j: usize| v[i] * dw[j] + v[j] * dw[i] + t[i] * w[j] + t[j] * w[i];
    [
        u.dot(&s),
        first.x,
        first.y,
        first.z,
        0.5 * pair(0, 0),
        0.5 * pair(1, 1),
        0.5 * pair(2, 2),
        pair(1, 2),
        pair(2, 0),
        pair(0, 1),
    ]
}

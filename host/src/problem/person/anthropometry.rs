//! What tables of people know of one person: a normal distribution of her base parameters.
//!
//! Each segment's mass, centre and tensor about it differ from the table's independently, by relative sizes that are stated; and all
//! segments together are lighter or heavier. Linear about the table: `δ(m c) = c δm + m δc`,
//! `δI = δI_c + S(c) δm + m (S(c, δc) + S(δc, c))`, with `S(a, b) = (a·b) 1 − b aᵀ`.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use rigident_fit::Gaussian;
use rigident_model::Model;
use rigident_model::base::BaseParameters;
use rigident_model::inertial::Parameters;

/// How far one person's segments are from the table's: 1 σ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Of a segment's mass, relative.
    pub mass: f64,
    /// Of its centre of mass along each axis, over its radius of gyration.
    pub centre: f64,
    /// Of its tensor about that, over a third of its trace.
    pub inertia: f64,
    /// Of everybody's mass, relative to what the table was scaled to.
    pub whole: f64,
}

impl Default for Spread {
    /// Returns sizes as regressions on scanned and dissected people leave them (assumed).
    fn default() -> Self {
        Self { mass: 0.2, centre: 0.2, inertia: 0.3, whole: 0.1 }
    }
}

impl Spread {
    /// Returns all sizes but that of the whole mass so many times as large.
    #[must_use]
    pub fn times(self, by: f64) -> Self {
        Self { mass: self.mass * by, centre: self.centre * by, inertia: self.inertia * by, ..self }
    }
}

/// Returns the distribution of base parameters; `None` if a segment has no nominal body.
pub fn distribution(model: &Model, base: &BaseParameters, spread: &Spread) -> Option<Gaussian> {
    let map = base.map() * bodies(model);
    let nominal = DVector::from_vec(model.nominal());
    let covariance = standard(model, spread)?;
    let names = base.parameters.iter().map(|p| p.name.clone()).collect();
    Gaussian::new(names, &map * nominal, &map * covariance * map.transpose())
}

/// Returns the covariance of the standard parameters of all links, ten each; `None` if a segment has no nominal body.
pub fn standard(model: &Model, spread: &Spread) -> Option<DMatrix<f64>> {
    let segments: Vec<Parameters> = model.links.iter().map(|l| l.nominal).collect::<Option<_>>()?;
    let nominal = DVector::from_vec(model.nominal());
    let mut covariance = DMatrix::zeros(nominal.len(), nominal.len());
    for (k, segment) in segments.iter().enumerate() {
        let root = root(segment, spread)?;
        covariance.view_mut((10 * k, 10 * k), (10, 10)).copy_from(&(&root * root.transpose()));
    }
    covariance += &nominal * nominal.transpose() * spread.whole.powi(2);
    Some(covariance)
}

/// Returns the map from the links' parameters, ten each, to those of the bodies, where some links are fixed to others.
pub fn bodies(model: &Model) -> DMatrix<f64> {
    let rows = 10 * model.welded().links.len();
    let mut map = DMatrix::zeros(rows, 10 * model.links.len());
    let mut unit = model.clone();
    unit.links.iter_mut().for_each(|l| l.nominal = Some([0.0; 10]));
    for column in 0..map.ncols() {
        let (link, k) = (column / 10, column % 10);
        let mut own = [0.0; 10];
        own[k] = 1.0;
        unit.links[link].nominal = Some(own);
        map.column_mut(column).copy_from_slice(&unit.welded().nominal());
        unit.links[link].nominal = Some([0.0; 10]);
    }
    map
}

/// A root of the covariance of a segment's ten parameters: one column for each independent deviation.
fn root(phi: &Parameters, spread: &Spread) -> Option<DMatrix<f64>> {
    let mass = phi[0];
    let centre = Vector3::new(phi[1], phi[2], phi[3]) / mass;
    let square = |a: &Vector3<f64>, b: &Vector3<f64>| Matrix3::identity() * a.dot(b) - b * a.transpose();
    let about = Matrix3::new(phi[4], phi[9], phi[8], phi[9], phi[5], phi[7], phi[8], phi[7], phi[6])
        - square(&centre, &centre) * mass;
    let third = about.trace() / 3.0;
    if !(mass > 0.0 && third > 0.0) {
        return None;
    }
    let mut root = DMatrix::zeros(10, 10);
    let mut put = |column: usize, mass: f64, moment: Vector3<f64>, inertia: Matrix3<f64>| {
        let six = [
            inertia[(0, 0)],
            inertia[(1, 1)],
            inertia[(2, 2)],
            inertia[(1, 2)],
            inertia[(2, 0)],
            inertia[(0, 1)],
        ];
        let all = std::iter::once(mass).chain(moment.iter().copied()).chain(six);
        all.enumerate().for_each(|(row, value)| root[(row, column)] = value);
    };
    // A heavier segment of the same shape.
    let heavier = spread.mass * mass;
    put(0, heavier, centre * heavier, (square(&centre, &centre) + about / mass) * heavier);
    let gyration = (1.5 * third / mass).sqrt();
    for axis in 0..3 {
        let by = Vector3::ith(axis, spread.centre * gyration);
        put(1 + axis, 0.0, by * mass, (square(&centre, &by) + square(&by, &centre)) * mass);
    }
    let elements = [(0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1)];
    for (k, (i, j)) in elements.into_iter().enumerate() {
        let mut change = Matrix3::zeros();
        change[(i, j)] = spread.inertia * third;
        change[(j, i)] = change[(i, j)];
        put(4 + k, 0.0, Vector3::zeros(), change);
    }
    Some(root)
}

//! Rows of known values, judged and absorbed.

use nalgebra::DMatrix;
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

use super::subject::{ELEMENT, Subject, trace};
use super::{Known, KnownError, REFUSED_PROBABILITY};
use crate::{Factor, Noise};

/// The linearisation is renewed this often; the change is quadratic, and of second order in σ/m to begin
/// with.
const ROUNDS: usize = 4;

/// A row `a φ = y ± σ` rounds the others by about `ε |a φ| / σ` of their standard deviations, as all share
/// one triangle: σ is at least this many times `ε |a| (|φ| + sd)`, which leaves 1e-4 of a standard deviation.
const LEAST_SIGMA_OVER_ROUNDING: f64 = 1e4;

/// `a φ = y ± σ`; a by the parameters that it is not zero for.
struct Row {
    a: Vec<(usize, f64)>,
    y: f64,
    sigma: f64,
}

/// The information of a factor on φ.
struct Point {
    phi: Vec<f64>,
    determined: Vec<bool>,
    covariance: DMatrix<f64>,
}

impl Point {
    fn of(factor: &Factor, rounding: f64) -> Self {
        let solution = factor.solve(rounding);
        Self { phi: solution.estimate, determined: solution.determined, covariance: solution.covariance }
    }

    /// Value and standard deviation of parameter `j`, if it is determined.
    fn of_parameter(&self, j: usize) -> Option<[f64; 2]> {
        let value = self.phi.get(j).filter(|_| self.determined.get(j) == Some(&true))?;
        Some([*value, self.covariance[(j, j)].max(0.0).sqrt()])
    }

    /// Returns what is rounded where the row is absorbed: `Σ |a_j| (|φ_j| + sd_j)` over what is determined,
    /// or y if that is larger.
    fn size(&self, row: &Row) -> f64 {
        let parts = row.a.iter().filter_map(|(j, a)| {
            let [value, sd] = self.of_parameter(*j)?;
            Some(a.abs() * (value.abs() + sd))
        });
        parts.sum::<f64>().max(row.y.abs())
    }

    /// `aᵀφ` and its standard deviation; `None` if it depends on what is not determined.
    fn along(&self, a: &[(usize, f64)]) -> Option<(f64, f64)> {
        let (mut value, mut variance) = (0.0, 0.0);
        for (i, weight) in a.iter().filter(|(_, weight)| *weight != 0.0) {
            value += weight * self.of_parameter(*i)?[0];
            for (j, other) in a.iter().filter(|(_, other)| *other != 0.0) {
                variance += weight * other * self.covariance[(*i, *j)];
            }
        }
        Some((value, variance.max(0.0).sqrt()))
    }
}

impl Known {
    /// Its rows `(a, y, σ)` at φ; fewer where a plane of symmetry has no scale yet.
    fn rows(&self, at: &Point) -> Result<Vec<Row>, KnownError> {
        let (value, sigma) = (self.value, self.sigma);
        let needs = |needs| KnownError::Needs { name: self.name.clone(), needs };
        let mass = |j: usize| {
            at.of_parameter(j).map(|[m, _]| m).filter(|m| *m > 0.0).ok_or_else(|| needs("the mass"))
        };
        match &self.subject {
            Subject::Parameter(j) => Ok(vec![Row { a: vec![(*j, 1.0)], y: value, sigma }]),
            Subject::Centre { mass: m, moment } => {
                Ok(vec![Row { a: vec![(*m, -value), (*moment, 1.0)], y: 0.0, sigma: sigma * mass(*m)? }])
            }
            Subject::Central { element, mass: at_mass, moments, inertia } => {
                let m = mass(*at_mass)?;
                let mut mc = [0.0; 3];
                for (v, j) in mc.iter_mut().zip(moments) {
                    *v = at.of_parameter(*j).ok_or_else(|| needs("the centre of mass"))?[0];
                }
                let [i, j] = ELEMENT[*element];
                let diagonal = f64::from(u8::from(i == j));
                let square = diagonal * mc.iter().map(|v| v * v).sum::<f64>() - mc[i] * mc[j];
                let mut a = vec![(*inertia, 1.0), (*at_mass, square / (m * m))];
                for (n, (v, place)) in mc.iter().zip(moments).enumerate() {
                    let mut slope = 2.0 * diagonal * v;
                    slope -= if n == i { mc[j] } else { 0.0 };
                    slope -= if n == j { mc[i] } else { 0.0 };
                    a.push((*place, -slope / m));
                }
                // f is homogeneous of degree one in φ, so J φ = f(φ) and the row needs no constant.
                Ok(vec![Row { a, y: value, sigma }])
            }
            Subject::Symmetry { mass: m, moment, products, moments } => {
                let m = mass(*m)?;
                let mut rows = vec![Row { a: vec![(*moment, 1.0)], y: 0.0, sigma: sigma * m }];
                // Without a tensor there is no size, and a product of inertia no scale of its uncertainty.
                if let Some(trace) = trace(moments.map(|j| at.of_parameter(j))) {
                    let gyration = (trace / (2.0 * m)).sqrt();
                    rows.extend(products.map(|j| Row {
                        a: vec![(j, 1.0)],
                        y: 0.0,
                        sigma: sigma * m * gyration,
                    }));
                }
                Ok(rows)
            }
        }
    }

    /// Those on parameters come first, then centres of mass and planes, then central tensors.
    fn turn(&self) -> u8 {
        match self.subject {
            Subject::Parameter(_) => 0,
            Subject::Centre { .. } => 1,
            Subject::Symmetry { .. } => 2,
            Subject::Central { .. } => 3,
        }
    }
}

/// Returns the probability of the given number of σ or more on either side.
pub(super) fn two_sided(deviation: f64, noise: Noise) -> f64 {
    if !deviation.is_finite() {
        return 0.0;
    }
    let normal = || Normal::standard().sf(deviation);
    2.0 * match noise {
        Noise::Given => normal(),
        Noise::Estimated { degrees_of_freedom } => StudentsT::new(0.0, 1.0, degrees_of_freedom.max(1.0))
            .map_or_else(|_| normal(), |t| t.sf(deviation)),
    }
}

/// Absorbs known values into a factor whose rows are whitened by their true σ.
///
/// The order of statements does not matter to the answer: those on parameters come first, then centres of
/// mass and planes, then central tensors; each is judged against the data, beside their noise, and those
/// before it, where rows are about values near to the estimate.
///
/// # Errors
/// [`KnownError`]; the factor is then as it was.
pub(super) fn absorb(
    factor: &mut Factor,
    known: &[Known],
    noise: Option<Noise>,
    rounding: f64,
) -> Result<(), KnownError> {
    let mut ordered: Vec<&Known> = known.iter().collect();
    ordered.sort_by_key(|k| k.turn());
    // Rows about single parameters are the same wherever they are linearised.
    let rounds = if ordered.iter().all(|k| k.turn() == 0) { 1 } else { ROUNDS };
    let least_sigma = (LEAST_SIGMA_OVER_ROUNDING * f64::EPSILON).max(10.0 * rounding);
    let mut joint = factor.clone();
    let mut at: Option<Point> = None;
    for _ in 0..rounds {
        joint = factor.clone();
        for statement in &ordered {
            let so_far = Point::of(&joint, rounding);
            for row in statement.rows(at.as_ref().unwrap_or(&so_far))? {
                judge(statement, &row, &so_far, least_sigma, noise)?;
                let mut columns = vec![0.0; joint.parameters()];
                for (j, a) in &row.a {
                    if let Some(column) = columns.get_mut(*j) {
                        *column = a / row.sigma;
                    }
                }
                joint.absorb([(columns.as_slice(), row.y / row.sigma)]);
            }
        }
        at = Some(Point::of(&joint, rounding));
    }
    *factor = joint;
    Ok(())
}

/// Refuses a row that is too tight to be held, or contradicts what is known so far.
fn judge(
    statement: &Known,
    row: &Row,
    so_far: &Point,
    least_sigma: f64,
    noise: Option<Noise>,
) -> Result<(), KnownError> {
    let least = least_sigma * so_far.size(row);
    if row.sigma < least {
        // One digit more than is stated, rounded up.
        let least = 1.05 * least * statement.sigma / row.sigma;
        return Err(KnownError::TooTight { name: statement.name.clone(), sigma: statement.sigma, least });
    }
    let Some(((found, found_sigma), noise)) = so_far.along(&row.a).zip(noise) else { return Ok(()) };
    let deviation = (row.y - found).abs() / row.sigma.hypot(found_sigma);
    if two_sided(deviation, noise) >= REFUSED_PROBABILITY {
        return Ok(());
    }
    // In the statement's own unit: `mcx − cx m` is stated as a centre of mass.
    let scale = statement.sigma / row.sigma;
    Err(KnownError::Contradiction {
        name: statement.name.clone(),
        value: statement.value,
        sigma: statement.sigma,
        found: statement.value + (found - row.y) * scale,
        found_sigma: found_sigma * scale,
        deviation,
    })
}

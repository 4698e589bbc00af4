//! Rows of known quantities, judged and absorbed.

use rigident_shared::factor::InformationFactor;
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

use super::{ELEMENT, Known, KnownError, REFUSED_PROBABILITY, Subject};
use crate::answer::Noise;
use crate::identification::Factor;

/// The linearisation is renewed so often; the change is quadratic, and of second order in σ/m to begin with.
const ROUNDS: usize = 4;

/// A row `a φ = y ± σ` rounds the others by about `ε |a φ| / σ` of their standard deviations, as all share one
/// triangle: σ is at least so many times `ε |a| (|φ| + sd)`, which leaves 1e-4 of a standard deviation.
const LEAST_SIGMA_OVER_ROUNDING: f64 = 1e4;

/// `a φ = y ± σ`.
struct Row<const N: usize> {
    a: [f64; N],
    y: f64,
    sigma: f64,
}

/// What a factor says of φ.
struct Point<const N: usize> {
    phi: [f64; N],
    determined: [bool; N],
    covariance: [[f64; N]; N],
}

impl<const N: usize> Point<N> {
    fn of(factor: &InformationFactor<f64, N>) -> Self {
        let solution = factor.solve();
        Self { phi: solution.estimate, determined: solution.determined, covariance: factor.covariance() }
    }

    /// What is rounded where the row is absorbed: `Σ |a_j| (|φ_j| + sd_j)` over what is determined, or y if that is
    /// larger.
    fn size(&self, row: &Row<N>) -> f64 {
        let mut size = 0.0;
        for (j, a) in row.a.iter().enumerate().filter(|(j, _)| self.determined[*j]) {
            size += a.abs() * (self.phi[j].abs() + self.covariance[j][j].max(0.0).sqrt());
        }
        size.max(row.y.abs())
    }

    /// `aᵀφ` and its standard deviation; `None` if it depends on what is not determined.
    fn along(&self, a: &[f64; N]) -> Option<(f64, f64)> {
        if a.iter().zip(&self.determined).any(|(a, determined)| *a != 0.0 && !determined) {
            return None;
        }
        let (mut value, mut variance) = (0.0, 0.0);
        for i in 0..N {
            value += a[i] * self.phi[i];
            for j in 0..N {
                variance += a[i] * a[j] * self.covariance[i][j];
            }
        }
        Some((value, variance.max(0.0).sqrt()))
    }
}

impl Known {
    /// Its rows `(a, y, σ)` at φ; fewer where a plane of symmetry has no scale yet.
    fn rows<const N: usize>(&self, at: &Point<N>) -> Result<Vec<Row<N>>, KnownError> {
        let Self { subject, value, sigma } = *self;
        let needs = |needs| KnownError::Needs { name: self.name(), needs };
        let unit = |j: usize, y: f64, sigma: f64| {
            let mut a = [0.0; N];
            if let Some(entry) = a.get_mut(j) {
                *entry = 1.0;
            }
            Row { a, y, sigma }
        };
        let mass =
            || if at.determined[0] && at.phi[0] > 0.0 { Ok(at.phi[0]) } else { Err(needs("the mass")) };
        match subject {
            Subject::Parameter(j) if j >= N => Err(KnownError::NoOffset { name: self.name() }),
            Subject::Parameter(j) => Ok(vec![unit(j, value, sigma)]),
            Subject::Centre(k) => {
                let mut row = unit(1 + k, 0.0, sigma * mass()?);
                row.a[0] = -value;
                Ok(vec![row])
            }
            Subject::Central(k) => {
                let m = mass()?;
                if !(1..4).all(|j| at.determined[j]) {
                    return Err(needs("the centre of mass"));
                }
                let mc = [at.phi[1], at.phi[2], at.phi[3]];
                let [i, j] = ELEMENT[k];
                let diagonal = f64::from(u8::from(i == j));
                let square = diagonal * mc.iter().map(|v| v * v).sum::<f64>() - mc[i] * mc[j];
                let mut row = unit(4 + k, 0.0, sigma);
                row.a[0] = square / (m * m);
                for (n, v) in mc.iter().enumerate() {
                    let mut slope = 2.0 * diagonal * v;
                    slope -= if n == i { mc[j] } else { 0.0 };
                    slope -= if n == j { mc[i] } else { 0.0 };
                    row.a[1 + n] = -slope / m;
                }
                // f is homogeneous of degree one in φ, so J φ = f(φ) and the row needs no constant.
                row.y = value;
                Ok(vec![row])
            }
            Subject::Symmetry(k) => {
                let m = mass()?;
                let mut rows = vec![unit(1 + k, 0.0, sigma * m)];
                // Without a tensor there is no size, and a product of inertia no scale of its uncertainty.
                let moment =
                    |j: usize| at.determined[j].then(|| [at.phi[j], at.covariance[j][j].max(0.0).sqrt()]);
                if let Some(trace) = trace([4, 5, 6].map(moment)) {
                    let gyration = (trace / (2.0 * m)).sqrt();
                    for (e, [i, j]) in ELEMENT.iter().enumerate().skip(3) {
                        if *i == k || *j == k {
                            rows.push(unit(4 + e, 0.0, sigma * m * gyration));
                        }
                    }
                }
                Ok(rows)
            }
        }
    }
}

/// Sum of the three moments, each with its σ; `None` if it may be anything down to nothing.
pub(super) fn trace(moments: [Option<[f64; 2]>; 3]) -> Option<f64> {
    let (mut sum, mut sigma) = (0.0, 0.0);
    for moment in moments {
        let [value, sd] = moment?;
        sum += value;
        sigma += sd;
    }
    (sum > 2.0 * sigma).then_some(sum)
}

/// Probability of so many σ or more on either side.
pub(super) fn two_sided(deviation: f64, noise: Noise) -> f64 {
    let normal = || Normal::standard().sf(deviation);
    2.0 * match noise {
        Noise::Given => normal(),
        Noise::Estimated { degrees_of_freedom } => StudentsT::new(0.0, 1.0, degrees_of_freedom.max(1.0))
            .map_or_else(|_| normal(), |t| t.sf(deviation)),
    }
}

/// Absorbs known quantities into a factor whose rows are whitened by their true σ.
///
/// The order of statements does not matter to the answer: those on parameters come first, then centres of
/// mass and planes, then central tensors; each is judged against the data and those before it.
///
/// # Errors
/// [`KnownError`]; the factor is then as it was.
pub fn absorb<const N: usize>(
    factor: &mut InformationFactor<f64, N>,
    known: &[Known],
    noise: Noise,
) -> Result<(), KnownError> {
    let mut ordered: Vec<&Known> = known.iter().collect();
    ordered.sort_by_key(|k| match k.subject {
        Subject::Parameter(_) => 0,
        Subject::Centre(_) => 1,
        Subject::Symmetry(_) => 2,
        Subject::Central(_) => 3,
    });
    let mut joint = *factor;
    let mut at: Option<Point<N>> = None;
    for _ in 0..ROUNDS {
        joint = *factor;
        for statement in &ordered {
            let so_far = Point::of(&joint);
            for row in statement.rows(at.as_ref().unwrap_or(&so_far))? {
                let least = LEAST_SIGMA_OVER_ROUNDING * f64::EPSILON * so_far.size(&row);
                if row.sigma < least {
                    // One digit more than is told, rounded up.
                    let least = 1.05 * least * statement.sigma / row.sigma;
                    return Err(KnownError::TooTight {
                        name: statement.name(),
                        sigma: statement.sigma,
                        least,
                    });
                }
                if let Some((found, found_sigma)) = so_far.along(&row.a) {
                    let deviation = (row.y - found).abs() / row.sigma.hypot(found_sigma);
                    if two_sided(deviation, noise) < REFUSED_PROBABILITY {
                        return Err(contradiction(statement, &row, found, found_sigma, deviation));
                    }
                }
                let columns = row.a.map(|a| [a / row.sigma]);
                joint.absorb::<1>(&columns, &[row.y / row.sigma]);
            }
        }
        at = Some(Point::of(&joint));
    }
    *factor = joint;
    Ok(())
}

/// In the statement's own unit: `mcx − cx m` is told as a centre of mass.
fn contradiction<const N: usize>(
    known: &Known,
    row: &Row<N>,
    found: f64,
    found_sigma: f64,
    deviation: f64,
) -> KnownError {
    let scale = known.sigma / row.sigma;
    KnownError::Contradiction {
        name: known.name(),
        value: known.value,
        sigma: known.sigma,
        found: known.value + (found - row.y) * scale,
        found_sigma: found_sigma * scale,
        deviation,
    }
}

/// [`absorb`] for either model.
///
/// # Errors
/// [`KnownError`]; the factor is then as it was.
pub fn absorb_into(factor: &mut Factor, known: &[Known], noise: Noise) -> Result<(), KnownError> {
    match factor {
        Factor::Ten(f) => absorb(f, known, noise),
        Factor::Sixteen(f) => absorb(f, known, noise),
    }
}

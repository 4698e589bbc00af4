//! The body nearest to an answer that no body has.

use nalgebra::DMatrix;
use rigident_shared::consistency::{Nearest, nearest};
use rigident_shared::factor::InformationFactor;
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::Sensor;

use super::derived::ten;
use super::physical_consistency::{SURPRISING, probability};
use rigident_fit::Estimate;

/// Newton steps; in f64 some 15 are usual.
const MAX_ITERATIONS: u8 = 100;

/// The physically consistent parameters nearest to an answer in the metric of its covariance.
#[derive(Clone, Debug, PartialEq)]
pub struct NearestBody {
    /// About S's origin, in S.
    pub body: InertialParameters<Sensor, f64>,
    /// Distance of the answer from it, standard deviations.
    pub distance_sd: f64,
    /// The probability that noise makes it larger, at least: that of χ² with ten degrees of freedom.
    pub probability: f64,
}

/// Returns the nearest body; `None` if the ten parameters are not all determined, or the answer is that body
/// already.
///
/// The metric is the covariance of the ten with everything else estimated, so it holds what the intervals
/// hold.
pub fn nearest_body(estimate: &Estimate) -> Option<NearestBody> {
    if estimate.unjudged().values.len() < 10 || !estimate.unjudged().determined.iter().take(10).all(|d| *d) {
        return None;
    }
    let phi = ten(estimate);
    let factor = factor(estimate)?;
    match nearest(&factor, &phi, MAX_ITERATIONS) {
        Nearest::Projected(found) | Nearest::NotConverged(found) => Some(NearestBody {
            body: InertialParameters::from_vector(found.parameters),
            distance_sd: found.distance_sd,
            probability: probability(found.distance_sd.powi(2), 10.0, estimate.noise).unwrap_or(1.0),
        }),
        Nearest::Free | Nearest::NotDetermined => None,
    }
}

/// `RᵀR = C⁻¹` of the ten, in units of their standard deviations until the last step.
fn factor(estimate: &Estimate) -> Option<InformationFactor<f64, 10>> {
    let sd: [f64; 10] = std::array::from_fn(|j| estimate.unjudged().covariance[(j, j)].sqrt());
    let correlation =
        DMatrix::from_fn(10, 10, |i, j| estimate.unjudged().covariance[(i, j)] / (sd[i] * sd[j]));
    let lower = correlation.cholesky()?.inverse().cholesky()?.l();
    let r = |i: usize, j: usize| lower[(j, i)] / sd[j];
    let phi = ten(estimate);
    let triangle = (0..10).flat_map(|i| (i..10).map(move |j| (i, j))).map(|(i, j)| r(i, j));
    let z = (0..10).map(|i| (i..10).map(|j| r(i, j) * phi[j]).sum());
    InformationFactor::from_entries(triangle.chain(z).chain(std::iter::once(0.0)), 10)
}

/// Returns the warning about an answer that no body has.
pub fn warning(nearest: Option<&NearestBody>) -> String {
    let no_body =
        "the tensor belongs to no body (a principal moment is negative or breaks the triangle inequality)";
    let Some(NearestBody { distance_sd, probability, .. }) = nearest else {
        return format!(
            "{no_body}: the uncertainty allows it, or the rig file is wrong about a sign, a frame or a scale"
        );
    };
    if *probability < SURPRISING {
        format!(
            "{no_body}; the nearest body is {distance_sd:.1} standard deviations away, which noise does not \
             explain: look for a wrong sign, frame, delay or scale in the rig file, or a body that is not \
             rigid"
        )
    } else {
        format!(
            "{no_body}; the nearest body is {distance_sd:.2} standard deviations away, which noise explains: \
             use the nearest body, or excite all rotations more"
        )
    }
}

#[cfg(test)]
mod tests {
    use rigident_shared::inertia::tensor_from_elements;
    use rigident_shared::spatial::Position;

    use super::*;
    use rigident_fit::{Factor, Noise};

    /// 16 parameters; a rod along x, whose smallest second moment the noise made negative by `low` kg m².
    fn rod(low: f64) -> Estimate {
        let mut factor = InformationFactor::<f64, 16>::new();
        let tensor = tensor_from_elements([0.004, 0.2, 0.2 - low, 1e-4, 0.0, 2e-4]);
        let com = Position::new(0.05, 0.0, -0.1);
        let phi = InertialParameters::<Sensor, f64>::from_centre_of_mass(2.0, com, tensor).to_vector();
        for k in 0..64_usize {
            let row: [f64; 16] = std::array::from_fn(|j| {
                let wave = ((k * (2 * j + 3)) as f64 * 0.37).sin() + if k % 16 == j { 1.0 } else { 0.0 };
                wave * if (4..10).contains(&j) { 100.0 } else { 10.0 }
            });
            let y = row.iter().zip(phi).map(|(a, p)| a * p).sum();
            factor.absorb::<1>(&row.map(|a| [a]), &[y]);
        }
        let factor = Factor::from(&factor);
        Estimate::new(&factor, factor.rounding(), 1.0, Noise::Given)
    }

    #[test]
    fn the_distance_is_that_of_the_covariance_and_the_body_is_one() {
        let estimate = rod(0.05);
        let found = nearest_body(&estimate).unwrap();
        assert!(found.body.is_physically_consistent());
        let phi = found.body.to_vector();
        let change = nalgebra::DVector::from_fn(10, |j, _| phi[j] - estimate.unjudged().values[j]);
        let covariance = estimate.unjudged().covariance.view((0, 0), (10, 10)).into_owned();
        let mahalanobis = (covariance.try_inverse().unwrap() * &change).dot(&change).sqrt();
        assert!((found.distance_sd / mahalanobis - 1.0).abs() < 1e-6);
        // Any other body is further: the true rod among them.
        let other = rod(0.0).unjudged().values.to_vec();
        let other = nalgebra::DVector::from_fn(10, |j, _| other[j] - estimate.unjudged().values[j]);
        let further =
            (estimate.unjudged().covariance.view((0, 0), (10, 10)).into_owned().try_inverse().unwrap()
                * &other)
                .dot(&other)
                .sqrt();
        assert!(further > found.distance_sd);
    }

    #[test]
    fn a_body_has_no_nearest_one_nor_has_an_undetermined_one() {
        assert_eq!(nearest_body(&rod(0.0)), None);
        assert_eq!(nearest_body(&rod(0.05).without(7)), None);
    }

    #[test]
    fn the_warning_tells_noise_from_a_mistake() {
        let near = |distance_sd: f64| NearestBody {
            body: nearest_body(&rod(0.05)).unwrap().body,
            distance_sd,
            probability: probability(distance_sd.powi(2), 10.0, Noise::Given).unwrap(),
        };
        assert!(warning(Some(&near(1.5))).contains("1.50 standard deviations away, which noise explains"));
        assert!(
            warning(Some(&near(55.0)))
                .contains("55.0 standard deviations away, which noise does not explain")
        );
        assert!(warning(None).contains("sign"));
    }
}

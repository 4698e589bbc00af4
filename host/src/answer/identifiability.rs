//! Which parameters the data identify. What motion the others lack is told by [`super::weakest`].
//!
//! *Identified* means that the data alone determine a parameter at the noise level: its column is independent
//! of the others, its 95 % uncertainty is small against the body's own scale, never against its own value,
//! and its information does not come from the noise of the gyro.

use rigident_shared::inertia::PARAMETER_NAMES;

use super::Estimate;
use super::states::BodyScale;
pub(crate) use super::states::{LARGEST_SHARE, LEAST_EXCITATION};
use crate::answer::result::{Measured, ParameterState};
use crate::identification::known::Known;
use crate::present::text::significant;

/// Information that the noise of the regressor alone would bring to the tensor's columns, in units of
/// whitened rows: 1/(kg m²)².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RegressorNoise {
    /// Information on a tensor element from the noise of ω̇.
    pub tensor_information: f64,
}

/// Whether the data alone determine a mass, and it is negative: a sign or an axis is wrong, and no motion would help.
pub fn is_reversed(estimate: &Estimate) -> bool {
    let data = estimate.of_data_alone();
    let [mass, ..] = data.body();
    mass < 0.0 && data.u95(0) <= LARGEST_SHARE * -mass
}

/// What became of each parameter. Nothing is identified if the mass comes out negative.
///
/// A parameter is *identified* if the data alone, without what is known beforehand, resolve it; *prior-dominated*
/// if they do so only together with it; else *not identified*. The body's scale, against which that is judged,
/// is always that of all that is known: a known mass sets the scale of the first moments, it does not measure them.
pub fn states(estimate: &Estimate, noise: RegressorNoise) -> Vec<ParameterState> {
    let scale = BodyScale::of(estimate, noise.tensor_information).filter(|_| !is_reversed(estimate));
    let data = estimate.of_data_alone();
    (0..estimate.values.len())
        .map(|j| {
            let measured = Measured { value: estimate.values[j], u95: estimate.u95(j) };
            match &scale {
                Some(scale) if scale.resolves(data, noise.tensor_information, j) => {
                    ParameterState::Identified(measured)
                }
                Some(scale) if scale.resolves(estimate, noise.tensor_information, j) => {
                    ParameterState::PriorDominated(measured)
                }
                _ => ParameterState::NotIdentified,
            }
        })
        .collect()
}

/// Known quantities, in words, whose parameter is not identified with them either because their σ is too large. Planes
/// of symmetry speak for themselves ([`Known::warning`](crate::identification::known::Known::warning)).
pub(super) fn too_loose(estimate: &Estimate, noise: RegressorNoise) -> Vec<String> {
    let states = states(estimate, noise);
    let scale = BodyScale::of(estimate, noise.tensor_information);
    let loose = |known: &Known| {
        let j = known.parameter();
        let (state, u95) = (states.get(j)?, estimate.u95(j));
        if known.is_symmetry() || *state != ParameterState::NotIdentified || !u95.is_finite() {
            return None;
        }
        let (name, unit) = (PARAMETER_NAMES.get(j).copied().unwrap_or("the offset"), unit_of(j));
        let Some(scale) = &scale else {
            return Some(format!(
                "{known} is in the answer, but {name} is not identified: the mass, against which that is judged, is not \
                 known to {} %; state mass_kg with --known",
                100.0 * LARGEST_SHARE
            ));
        };
        let mut least = LARGEST_SHARE * scale.of_parameter(j);
        if (4..10).contains(&j) && noise.tensor_information > 0.0 {
            let informed = (LEAST_EXCITATION * noise.tensor_information).sqrt().recip();
            least = least.min(estimate.coverage_factor * informed);
        }
        Some(format!(
            "{known} is too loose to identify {name}: with it the U95 is {}, and at most {} {unit} would do; state it with a \
             smaller σ if it is known that well",
            significant(u95, 2),
            significant(least, 2),
        ))
    };
    estimate.known().iter().filter_map(loose).collect()
}

fn unit_of(j: usize) -> &'static str {
    match j {
        0 => "kg",
        1..4 => "kg m",
        4..10 => "kg m²",
        10..13 => "N",
        _ => "N m",
    }
}

/// Whether each parameter of the estimate is identified by the data alone.
pub fn identified(estimate: &Estimate, noise: RegressorNoise) -> Vec<bool> {
    states(estimate, noise).iter().map(|s| matches!(s, ParameterState::Identified { .. })).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;
    use rigident_shared::inertia::{InertialParameters, tensor_from_elements};
    use rigident_shared::spatial::{Position, Sensor};

    use super::*;

    fn estimate(u95: [f64; 10]) -> Estimate {
        let body = InertialParameters::<Sensor, f64>::from_centre_of_mass(
            20.0,
            Position::new(0.0, 0.0, 0.053),
            tensor_from_elements([0.38, 0.02, 0.38, 0.0, 0.0, 0.0]),
        );
        Estimate::from_parts(
            body.to_vector().to_vec(),
            DMatrix::from_diagonal(&nalgebra::DVector::from_fn(10, |j, _| (u95[j] / 1.96).powi(2))),
            u95.iter().map(|u| u.is_finite()).collect(),
        )
    }

    #[test]
    fn a_true_zero_is_identified_when_its_interval_is_small_against_the_body() {
        let e = estimate([0.03, 5e-3, 5e-3, 5e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3]);
        assert_eq!(identified(&e, RegressorNoise::default()), vec![true; 10]);
    }

    #[test]
    fn an_element_within_its_own_interval_of_nothing_is_not() {
        let mut u95 = [0.03, 5e-3, 5e-3, 5e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3];
        u95[6] = 0.2;
        let states = identified(&estimate(u95), RegressorNoise::default());
        assert!(!states[6] && states[5]);
    }

    #[test]
    fn information_that_the_gyro_noise_explains_identifies_nothing() {
        let e = estimate([0.03, 5e-3, 5e-3, 5e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3]);
        let own = (1.96 / 8e-3_f64).powi(2);
        let states = identified(&e, RegressorNoise { tensor_information: own });
        assert_eq!(states, [vec![true; 4], vec![false; 6]].concat());
    }

    #[test]
    fn a_negative_mass_is_reversed_only_if_the_data_determine_it() {
        let mut e = estimate([0.03, 5e-3, 5e-3, 5e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3]);
        assert!(!is_reversed(&e));
        e.values[0] = -20.0;
        assert!(is_reversed(&e));
        assert_eq!(identified(&e, RegressorNoise::default()), vec![false; 10]);
        // Within half of its own size of nothing it may be the noise.
        e.values[0] = -0.06;
        assert!(!is_reversed(&e));
        e.determined[0] = false;
        e.values[0] = -20.0;
        assert!(!is_reversed(&e));
    }

    #[test]
    fn without_mass_there_is_no_scale() {
        let e = estimate([f64::INFINITY, 5e-3, 5e-3, 5e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3]);
        assert_eq!(identified(&e, RegressorNoise::default()), vec![false; 10]);
    }
}

//! The bare fixture taken off, with its uncertainty.
//!
//! Lives here: subtraction in factor form. May not live here: merging ([`super::pooled`]), files.
//!
//! Inertial parameters about one origin add: a run with the fixture and the body sees `φ_total = φ_fixture +
//! φ_body`, a run with the bare fixture sees φ_fixture. Both are rows over `[φ_fixture; φ_body; offset]`, and
//! the trailing triangle of the merged factor is what is known of the body when the fixture is known as well
//! as its runs tell, and no better. The order of the runs is free.

use rigident_shared::factor::InformationFactor;

use super::pooled::{Judgement, PoolError, PooledFactor};
use super::{Factor, Identification, Progression};
use crate::answer::result::Measured;
use crate::answer::{Estimate, Noise};

/// Parameters of a body.
const BODY: usize = 10;

/// The factor of `[φ_body; …]` from that of `[φ_fixture + φ_body; …]` and that of φ_fixture. `M = N + 10`.
///
/// What neither tells of φ_body is zero in the answer, not the rounding of the elimination: rounding alone has
/// a direction of its own, and a column of it would look like one that depends on another.
fn subtract<const N: usize, const M: usize>(
    total: &InformationFactor<f64, N>,
    fixture: &InformationFactor<f64, BODY>,
) -> InformationFactor<f64, N> {
    const { assert!(M == N + BODY, "the body's parameters, and the fixture's before them") }
    let total_of: [[f64; M]; N] = std::array::from_fn(|i| {
        std::array::from_fn(|j| f64::from(u8::from(j == i + BODY || (i < BODY && j == i))))
    });
    let fixture_of: [[f64; M]; BODY] =
        std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(j == i))));
    let mut joint: InformationFactor<f64, M> = total.substitute(&total_of);
    joint.merge(&fixture.substitute(&fixture_of));
    let body = joint.trailing::<N>();
    let norm = |r: &[[f64; N]; N], j: usize| r.iter().map(|row| row[j] * row[j]).sum::<f64>().sqrt();
    let rounding = 4.0 * M as f64 * f64::EPSILON;
    let lost: [bool; N] = std::array::from_fn(|j| norm(&body.r(), j) <= rounding * norm(&total.r(), j));
    if !lost.contains(&true) {
        return body;
    }
    let entries = body.entries().collect::<Vec<_>>();
    let places = (0..N).flat_map(|i| i..N).map(|j| lost[j]).chain(std::iter::repeat(false));
    let entries = entries.into_iter().zip(places).map(|(v, lost)| if lost { 0.0 } else { v });
    InformationFactor::from_entries(entries, body.rows()).unwrap_or_default()
}

/// The same information with another variance of its rows.
fn rescaled<const N: usize>(
    factor: &InformationFactor<f64, N>,
    variance_scale: f64,
) -> InformationFactor<f64, N> {
    factor.cast(|v| v / variance_scale.sqrt())
}

/// The runs of a bare fixture.
#[derive(Clone, Debug)]
pub struct Tare {
    pooled: PooledFactor,
    factor: InformationFactor<f64, BODY>,
    estimate: Estimate,
    judgement: Judgement,
    tensor_information: f64,
}

impl Tare {
    /// From the merged runs of the bare fixture, on the same sensor frame. Their offsets are their own.
    pub fn new(pooled: PooledFactor) -> Self {
        let pooled = pooled.without_offset();
        let identification = pooled.identification();
        let factor = match &pooled.factor {
            Factor::Ten(f) => **f,
            Factor::Sixteen(f) => super::pooled::without_offset(f),
        };
        let judgement = pooled.judgement(pooled.factor.determined());
        Self {
            factor: rescaled(&factor, judgement.variance_scale),
            estimate: identification.estimate,
            judgement,
            tensor_information: identification.regressor_noise.tensor_information,
            pooled,
        }
    }

    /// The recordings it was made of.
    pub fn recordings(&self) -> String {
        self.pooled.recordings()
    }

    /// What the fixture alone is.
    pub fn estimate(&self) -> &Estimate {
        &self.estimate
    }

    /// What the residuals of its runs say, in words.
    pub fn warning(&self) -> Option<String> {
        self.judgement.disagreement.map(|ratio| disagreement_in_words("the tare's runs", ratio))
    }

    /// Takes the fixture off the answer of a run; its factor stays that of fixture and body together. The
    /// offsets are those of the run: a free φ_body lets the fixture's runs say nothing of them.
    ///
    /// # Errors
    /// [`PoolError::Repeated`] if the run is one of the fixture's.
    pub fn take_off(
        &self,
        run: &PooledFactor,
        identification: &mut Identification,
        progression: &mut [Progression],
    ) -> Result<(), PoolError> {
        for source in &run.sources {
            if self.pooled.sources.iter().any(|s| s.fingerprint == source.fingerprint) {
                return Err(PoolError::Repeated {
                    recording: source.recording.clone(),
                    first: run.name.clone(),
                    second: format!("the tare {}", self.pooled.name),
                });
            }
        }
        let judgement = run.judgement(run.factor.determined());
        let noise = fewer(judgement.noise, self.judgement.noise);
        let scale = judgement.variance_scale;
        identification.estimate = match &identification.factor {
            Factor::Ten(f) => {
                Estimate::new(&subtract::<10, 20>(&rescaled(f, scale), &self.factor), 1.0, noise)
            }
            Factor::Sixteen(f) => {
                Estimate::new(&subtract::<16, 26>(&rescaled(f, scale), &self.factor), 1.0, noise)
            }
        };
        // A body's element has no more information than either run's, so this asks it of both.
        identification.regressor_noise.tensor_information += self.tensor_information;
        for point in progression {
            for (j, both) in point.parameters.iter_mut().take(BODY).enumerate() {
                *both = both.zip(self.estimate.measured(j)).map(|(both, fixture)| Measured {
                    value: both.value - fixture.value,
                    u95: both.u95.hypot(fixture.u95),
                });
            }
        }
        Ok(())
    }
}

/// Of two ways in which the noise is known the one that tells less of it.
fn fewer(a: Noise, b: Noise) -> Noise {
    match (a, b) {
        (Noise::Given, other) | (other, Noise::Given) => other,
        (Noise::Estimated { degrees_of_freedom: a }, Noise::Estimated { degrees_of_freedom: b }) => {
            Noise::Estimated { degrees_of_freedom: a.min(b) }
        }
    }
}

/// A warning for runs that disagree; `ratio` is χ² per degree of freedom.
pub fn disagreement_in_words(what: &str, ratio: f64) -> String {
    format!(
        "{what} disagree {:.1} times as much as their noise explains, and the intervals were widened: was the body \
         mounted differently, or does a sensor drift?",
        ratio.sqrt()
    )
}

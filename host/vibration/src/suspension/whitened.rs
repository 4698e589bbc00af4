//! Factors of rows that are whitened already: nothing of them is filtered or weighed.

use rigident_fit::factor_file::{FactorSource, SourceChannel};
use rigident_fit::pool::PooledFactor;
use rigident_fit::{Checks, Factor, Fingerprint, Parameter, RigRows};

/// Returns the factor as that of a run called `name`, made of these numbers.
pub(super) fn pooled(
    name: &str,
    parameters: Vec<Parameter>,
    factor: Factor,
    numbers: impl IntoIterator<Item = f64>,
    sigma_given: bool,
) -> PooledFactor {
    let mut hash = Fingerprint::default();
    numbers.into_iter().for_each(|v| hash.add(v.to_bits()));
    let source = FactorSource {
        recording: name.to_owned(),
        recorded_unix_s: None,
        fingerprint: hash.finish(),
        samples: 1,
        rejected: 0,
        rows: factor.rows(),
        noise_gain: 1.0,
        variance_scale: 1.0,
        fitted: None,
        sigma_given,
        spurious_information: 0.0,
        channels: vec![SourceChannel {
            name: "posture".to_owned(),
            unit: String::new(),
            sigma: 1.0,
            gain_sigma: 0.0,
            measured_rms: 0.0,
        }],
        checks: Some(Checks::default()),
        labels: std::collections::BTreeMap::new(),
        readings: Vec::new(),
        folded: None,
    };
    PooledFactor {
        name: name.to_owned(),
        rounding: f64::EPSILON * parameters.len() as f64,
        parameters,
        model_fingerprint: 0,
        rigs: vec![RigRows::plain(factor)],
        errors_inside: false,
        differing: Vec::new(),
        overlapping: Vec::new(),
        sources: vec![source],
        eliminated: 0,
        disagreement: 0.0,
        comparisons: 0,
    }
}

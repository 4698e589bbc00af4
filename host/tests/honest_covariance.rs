//! The covariance that ships against the exact one of white noise after the filter, `G⁻¹ (Ãᵀ T Ã) G⁻¹`.
#![cfg(feature = "simulator")]

#[allow(dead_code, reason = "the tables use the rest")]
#[path = "../examples/estimation_tables/honest_covariance.rs"]
mod honest_covariance;
#[allow(dead_code, reason = "the tables use the rest")]
#[path = "../examples/estimation_tables/report.rs"]
mod report;

use honest_covariance::Study;

/// Within 5 % for every one of the sixteen parameters, at the rates that ship, and not by being the same computation.
#[test]
fn shipped_standard_deviations_are_those_of_the_sandwich() {
    for rate_hz in [200.0, 1000.0] {
        let ratios = Study::new(rate_hz).shipped_over_sandwich();
        assert!(ratios.iter().all(|r| (0.95..=1.05).contains(r)), "{rate_hz} Hz: {ratios:?}");
        assert!(ratios.iter().any(|r| (r - 1.0).abs() > 1e-3), "{rate_hz} Hz: {ratios:?}");
    }
}

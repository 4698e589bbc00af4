//! Scales and signs that no recording of this kind shows: the answer rests on them, and says so once.
//!
//! A gain that all channels of the load cell share multiplies mass and tensor and moves no residual, one
//! that its moments share centre of mass and tensor; a scale of the accelerometer divides them; reversed
//! moments of still poses mirror the centre of mass. Each has the size that is counted in the intervals, or
//! none where nothing of it is counted.

use super::result::Reliance;
use rigident_fit::figures::significant;
use rigident_fit::{Basis, Effect, Fit, NuisanceFit};

/// Returns what the answer of one body rests on.
pub(super) fn of_body(fit: &Fit) -> Vec<Reliance> {
    let is_static = fit.filter.width_s == 0.0;
    let times = |factor: f64, what: &str, effect: &str, errors: &dyn Fn(&NuisanceFit) -> bool| {
        let own: Vec<&NuisanceFit> = fit.nuisances.iter().filter(|found| errors(found)).collect();
        let sd = own.iter().map(|found| found.sd).fold(0.0, f64::max);
        Reliance {
            what: what.to_owned(),
            effect: effect.to_owned(),
            u95_percent: Some(100.0 * factor * fit.estimate.coverage_factor() * sd)
                .filter(|u95| *u95 > 0.0 && u95.is_finite()),
            basis: own.first().map(|found| match &found.nuisance.basis {
                Basis::Stated(basis) | Basis::Class(basis) | Basis::Calibration(basis) => basis.clone(),
            }),
        }
    };
    let of =
        |what: &str, effect: &str, errors: &dyn Fn(&NuisanceFit) -> bool| times(1.0, what, effect, errors);
    let gain = |found: &NuisanceFit| matches!(found.nuisance.effect, Effect::Gain { .. });
    let scale = |found: &NuisanceFit| found.nuisance.group == "accelerometer scale";
    // Both have a gain.
    let ratio = times(2f64.sqrt(), "scale of the moments against the forces", "centre of mass, I ∝", &gain);
    let mut all = vec![of("load-cell gain", "m, I ∝", &gain), ratio];
    if !is_static || fit.nuisances.iter().any(scale) {
        all.push(of("accelerometer scale", "m, I ∝ 1/", &scale));
    }
    if is_static {
        all.push(of("sign of all moments", "centre of mass mirrored", &|_| false));
        all.push(of("unit of the wrench as a whole", "m ∝", &|_| false));
    }
    all
}

/// Returns them in a few words.
pub(super) fn in_words(all: &[Reliance]) -> Option<String> {
    let one = |reliance: &Reliance| {
        let Reliance { what, effect, u95_percent, basis } = reliance;
        let counted = match (u95_percent, basis) {
            (Some(u95), Some(basis)) => format!("± {} % by {basis}", significant(*u95, 2)),
            _ => "not counted".to_owned(),
        };
        format!("{what} ({effect}, {counted})")
    };
    let said: Vec<String> = all.iter().map(one).collect();
    (!said.is_empty()).then(|| format!("rests on {}: the recording does not show these", said.join(", ")))
}

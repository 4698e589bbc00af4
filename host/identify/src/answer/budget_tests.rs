use super::*;
use crate::answer::samples::{input, readings};
use crate::answer::{Answer, Context};
use rigident_fit::{Basis, Effect, FitOptions, Nuisance, RowSource, Scope, Silent, fit};
use rigident_rows::body::{BodySource, Input};

/// A body in motion with two errors of known size.
fn with_errors(sigma: [f64; 2]) -> Fit {
    let of = |name: &str, sigma, channel| Nuisance {
        name: name.to_owned(),
        group: name.to_owned(),
        unit: "1".to_owned(),
        sigma,
        basis: Basis::Stated("test".to_owned()),
        scope: Scope::Rig,
        effect: Effect::Gain { channel },
    };
    let nuisances = vec![of("gain of fz", sigma[0], 2), of("gain of mx", sigma[1], 3)];
    let input = input(readings(4000, 200.0, 0.4, 0.5), false, Some(0.5));
    let source = BodySource::new(Input { nuisances, ..input }, None);
    fit(&source as &dyn RowSource, &FitOptions::default(), &Silent).unwrap()
}

/// Shares sum to one; the share of a source is what the variance loses if that source were known, as far as
/// nothing else takes its place.
#[test]
fn shares_are_the_parts_of_the_variance() {
    let fit = with_errors([0.01, 0.02]);
    let all = budget(&fit, true, |_| true);
    assert_eq!(all.len(), 10);
    for own in &all {
        let sum: f64 = own.contributions.iter().map(|c| c.share).sum();
        assert!((sum - 1.0).abs() < 1e-9, "{}: {sum}", own.quantity);
        assert!(own.contributions.is_sorted_by(|a, b| a.sd >= b.sd));
    }
    // The mass is determined by fz where gravity is, and by fx and fy where the body is tilted or pushed.
    let m = &all[0];
    assert_eq!(m.quantity, "m");
    assert!((m.sd - fit.estimate.covariance(0, 0).unwrap().sqrt()).abs() < 1e-12);
    // A tenth of the error brings a hundredth of the variance where it is small beside the rest.
    let (small, tiny) = (with_errors([1e-5, 0.0]), with_errors([1e-6, 0.0]));
    let of = |fit: &Fit| {
        let all = budget(fit, true, |_| true);
        all[0].contributions.iter().find(|c| c.source == "gain of fz").map_or(0.0, |c| c.share)
    };
    let ratio = of(&small) / of(&tiny);
    assert!((90.0..110.0).contains(&ratio), "{ratio}");
}

#[test]
fn the_source_with_the_largest_share_on_average_is_to_be_improved() {
    let of = |quantity: &str, noise: f64, arm: f64| Budget {
        quantity: quantity.to_owned(),
        contributions: [("noise", noise), ("lever arm", arm)]
            .map(|(source, share)| Contribution { source: source.to_owned(), sd: share.sqrt(), share })
            .to_vec(),
        ..Budget::default()
    };
    let text = improvement(&[of("m", 0.9, 0.1), of("com_x", 0.2, 0.8), of("com_y", 0.1, 0.9)]).unwrap();
    assert!(text.starts_with("60 %") && text.contains("lever arm"), "{text}");
    // Without errors there is nothing to split.
    let plain = with_errors([0.0, 0.0]);
    let answer = Answer::new(&plain, Context::default()).unwrap();
    assert!(answer.budget.is_empty() && answer.improvement.is_none());
}

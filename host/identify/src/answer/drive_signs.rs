//! Signs of the drives' parameters: friction and rotors that would push contradict a recording, but for a
//! rotor that is negative alone.

use rigident_fit::figures::with_u95;
use rigident_fit::{Fit, Kind, Owner, Parameter};

/// A parameter that cannot be negative is so by this many standard deviations: by chance in one of a hundred
/// thousand, two-sided.
const CERTAIN_SD: f64 = 4.42;

/// Tells of friction and rotors that would push, but for those of [`rotors_without_a_cause`].
pub(super) fn negative(fit: &Fit) -> Option<String> {
    let all = pushing(fit);
    let lacking = without_a_cause(fit, &all);
    let wrong: Vec<String> =
        all.into_iter().filter(|j| !lacking.contains(j)).filter_map(|j| in_words(fit, j)).collect();
    (!wrong.is_empty()).then(|| {
        format!(
            "friction and rotors take energy and mass, and these would give them: {}; a sign of that joint's \
             position, rate or effort is wrong, or friction is of another kind than its columns",
            wrong.join(", ")
        )
    })
}

/// Returns the numbers of rotors that come out negative though the friction of their drive has its sign. A
/// wrong sign of position, rate or effort would turn friction, too, so the recording can be true: something
/// that the model lacks, as an elastic gear or an effort that is late in this joint alone, acts as they
/// would.
pub(super) fn rotors_without_a_cause(fit: &Fit) -> Vec<usize> {
    without_a_cause(fit, &pushing(fit))
}

/// Returns the rotors of [`rotors_without_a_cause`] among what is negative.
fn without_a_cause(fit: &Fit, pushing: &[usize]) -> Vec<usize> {
    let data = fit.data_alone();
    let owner = |j: usize| fit.parameters.get(j).map(|p| &p.owner);
    let is_rotor = |j: &usize| fit.parameters.get(*j).is_some_and(|p| p.kind == Kind::Rotor);
    let takes_energy = |rotor: usize| {
        fit.parameters.iter().enumerate().any(|(j, p)| {
            let value = data.unjudged().values.get(j).copied().unwrap_or_default();
            owner(rotor) == Some(&p.owner)
                && matches!(p.kind, Kind::Viscous | Kind::Coulomb)
                && data.is_determined(j)
                && data.covariance(j, j).is_some_and(|variance| value > CERTAIN_SD * variance.sqrt())
        })
    };
    let alone = |rotor: usize| pushing.iter().all(|j| *j == rotor || owner(*j) != owner(rotor));
    pushing.iter().copied().filter(is_rotor).filter(|j| alone(*j) && takes_energy(*j)).collect()
}

/// Returns the numbers of friction and rotors that are not identified for their sign: those of
/// [`rotors_without_a_cause`], and those whose interval is below zero, though not for certain. No motion of
/// this recording tells them, whatever the interval says.
pub(super) fn of_impossible_sign(fit: &Fit) -> Vec<usize> {
    let mut all = rotors_without_a_cause(fit);
    all.extend(doubtful(fit));
    all
}

/// Returns those that are negative by more than their U95, and not for certain.
fn doubtful(fit: &Fit) -> Vec<usize> {
    let certain = pushing(fit);
    let coverage = fit.data_alone().coverage_factor();
    below_zero(fit, coverage.min(CERTAIN_SD)).into_iter().filter(|j| !certain.contains(j)).collect()
}

/// Returns words for friction and rotors whose interval is below zero, though not for certain.
pub(super) fn doubtful_in_words(fit: &Fit) -> Option<String> {
    let all: Vec<String> = doubtful(fit).into_iter().filter_map(|j| in_words(fit, j)).collect();
    (!all.is_empty()).then(|| {
        format!(
            "friction and rotors are not negative, and these intervals are below zero, which chance may do: \
             {}; they are not identified",
            all.join(", ")
        )
    })
}

/// Returns words for rotors that are not identified because the model lacks something that acts as they do.
pub(super) fn without_a_cause_in_words(fit: &Fit) -> Option<String> {
    let rotors: Vec<String> =
        rotors_without_a_cause(fit).into_iter().filter_map(|j| in_words(fit, j)).collect();
    (!rotors.is_empty()).then(|| {
        format!(
            "no rotor is negative, and this would be: {}; the model lacks something of that drive which \
             follows its acceleration, an elastic gear or a late effort. The rotor is not identified",
            rotors.join(", ")
        )
    })
}

/// Returns a parameter's name and value, in words.
fn in_words(fit: &Fit, j: usize) -> Option<String> {
    let data = fit.data_alone();
    let parameter = fit.parameters.get(j)?;
    let value = *data.unjudged().values.get(j)?;
    Some(format!("{} {}", parameter.name, with_u95(value, data.u95(j), &parameter.unit)))
}

/// Returns the numbers of the drives' friction and rotors that are negative for certain.
fn pushing(fit: &Fit) -> Vec<usize> {
    below_zero(fit, CERTAIN_SD)
}

/// Returns the numbers of the drives' friction and rotors that are negative by more than this number of
/// standard deviations.
fn below_zero(fit: &Fit, limit_sd: f64) -> Vec<usize> {
    let data = fit.data_alone();
    let is_negative = |j: usize, p: &Parameter| {
        // At rest Stribeck's curve begins at Coulomb friction, and falls or rises from their sum to that
        // alone.
        let beside = p.name.strip_suffix(".stribeck").map(|drive| format!("{drive}.coulomb"));
        let beside = beside.and_then(|name| fit.parameters.iter().position(|other| other.name == name));
        let terms: Vec<usize> = beside.into_iter().chain([j]).collect();
        let mut variance = 0.0;
        for (i, k) in terms.iter().flat_map(|i| terms.iter().map(move |k| (*i, *k))) {
            variance += data.covariance(i, k)?;
        }
        let sum = terms.iter().map(|k| data.unjudged().values.get(*k)).sum::<Option<f64>>()?;
        Some(terms.iter().all(|k| data.is_determined(*k)) && sum < -limit_sd * variance.sqrt())
    };
    let all = fit.parameters.iter().enumerate();
    let of_drives = all.filter(|(_, p)| {
        matches!(p.kind, Kind::Viscous | Kind::Coulomb | Kind::Rotor) && matches!(p.owner, Owner::Drive(_))
    });
    of_drives.filter(|(j, p)| is_negative(*j, p) == Some(true)).map(|(j, _)| j).collect()
}

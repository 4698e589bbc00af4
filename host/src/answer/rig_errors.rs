//! Errors of the rig that contradict what is stated of them, and defaults that the answer rests on.

use crate::fit::{Basis, Fit, Nuisance, NuisanceFit};
use crate::present::text::{significant, unit_symbol, with_u95};

/// An error further from zero than so many of the standard deviations that it was drawn with is not as stated: one of a
/// hundred thousand is.
const CONTRADICTED: f64 = 4.42;
/// All errors together agree less well than in one of so many recordings.
const DISAGREEMENT: f64 = 1e-5;
/// Contradictions that are named.
const NAMED: usize = 3;

/// Returns the unit of an error; nothing of a pure number.
fn unit(nuisance: &Nuisance) -> &str {
    if nuisance.unit == "1" { "" } else { &nuisance.unit }
}

/// Returns the same with a space before it.
fn symbol(nuisance: &Nuisance) -> String {
    match unit(nuisance) {
        "" => String::new(),
        unit => format!(" {}", unit_symbol(unit)),
    }
}

/// Returns true if the recording contradicts what is stated of an error, or of all together.
pub(super) fn is_contradicted(fit: &Fit) -> bool {
    !contradicted(fit).is_empty() || disagrees(fit)
}

fn disagrees(fit: &Fit) -> bool {
    fit.agreement.is_some_and(|agreement| agreement.probability() < DISAGREEMENT)
}

/// Returns the errors that contradict what is stated, the furthest first.
fn contradicted(fit: &Fit) -> Vec<&NuisanceFit> {
    let mut all: Vec<&NuisanceFit> = fit.nuisances.iter().filter(|k| k.pull().abs() > CONTRADICTED).collect();
    all.sort_by(|a, b| b.pull().abs().total_cmp(&a.pull().abs()));
    all
}

/// Returns in words what of the errors of the rig contradicts what is known of them beforehand; empty if nothing does.
pub fn contradictions(fit: &Fit) -> Vec<String> {
    let k = fit.estimate.coverage_factor();
    let named = contradicted(fit);
    let mut all: Vec<String> = named
        .iter()
        .take(NAMED)
        .map(|found| {
            let nuisance = &found.nuisance;
            let known = match &nuisance.basis {
                Basis::Stated(key) => format!("{key} of the rig file states"),
                Basis::Class(class) => format!("the class {class} lets expect"),
                Basis::Calibration(of) => format!("the calibration {of} states"),
            };
            let mend = match &nuisance.basis {
                Basis::Calibration(_) => "calibrate the rig again",
                Basis::Stated(_) | Basis::Class(_) => "correct the rig file",
            };
            let about = if found.expected == 0.0 {
                String::new()
            } else {
                format!("{} ± ", significant(found.expected, 3))
            };
            format!(
                "{}: {} is {}, {:.1} standard deviations from what {known}, {about}{}{}; the intervals do not count that: {mend}, \
                 or look for another cause that looks the same",
                nuisance.group,
                nuisance.name,
                with_u95(found.value, k * found.sd, unit(nuisance)),
                found.pull().abs(),
                significant(nuisance.sigma, 2),
                symbol(nuisance),
            )
        })
        .collect();
    if let (true, Some(agreement)) = (named.is_empty() && disagrees(fit), fit.agreement) {
        all.push(format!(
            "the errors of the rig are larger than stated: χ² {:.0} for {:.0} degrees of freedom; the standard deviations in the \
             rig file, or those of its classes, are too small, or something else is wrong with the recording",
            agreement.chi2, agreement.degrees_of_freedom
        ));
    }
    all
}

/// Returns the calibration of the rig that the intervals rest on.
pub(super) fn calibration(fit: &Fit) -> Option<String> {
    let (mut name, mut groups) = (None, Vec::new());
    for found in &fit.nuisances {
        let Basis::Calibration(of) = &found.nuisance.basis else { continue };
        name = Some(of);
        if !groups.contains(&found.nuisance.group.as_str()) {
            groups.push(&found.nuisance.group);
        }
    }
    let (name, groups) = (name?, groups.join(", "));
    Some(format!("{groups}: the intervals rest on the calibration {name} of this rig, correlations included"))
}

/// Returns the defaults that the intervals rest on.
pub(super) fn defaults(fit: &Fit) -> Option<String> {
    let mut classes: Vec<(&str, Vec<String>)> = Vec::new();
    for found in &fit.nuisances {
        let Basis::Class(class) = &found.nuisance.basis else { continue };
        let place = match classes.iter().position(|(name, _)| name == class) {
            Some(place) => place,
            None => {
                classes.push((class, Vec::new()));
                classes.len() - 1
            }
        };
        let Some((_, groups)) = classes.get_mut(place) else { continue };
        if !groups.iter().any(|g| g.starts_with(&found.nuisance.group)) {
            groups.push(format!(
                "{} {}{}",
                found.nuisance.group,
                significant(found.nuisance.sigma, 2),
                symbol(&found.nuisance)
            ));
        }
    }
    let named: Vec<String> =
        classes.into_iter().map(|(class, groups)| format!("{class} ({})", groups.join(", "))).collect();
    (!named.is_empty()).then(|| {
        format!(
            "the rig file does not state the errors of sensors and mounting; the intervals rest on the defaults of the classes {}, \
             one standard deviation each",
            named.join(" and ")
        )
    })
}

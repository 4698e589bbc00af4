//! Calibrations and defaults of a rig's errors that the answer rests on.

use super::contradictions::symbol;
use rigident_fit::figures::significant;
use rigident_fit::{Basis, Fit};

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
            "the rig file does not state the errors of sensors and mounting; the intervals rest on the \
             defaults of the classes {}, one standard deviation each",
            named.join(" and ")
        )
    })
}

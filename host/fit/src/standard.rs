//! Standard parameters of links: which of a fit's parameters are what of which link.

use rigident_shared::inertia::PARAMETER_NAMES;

use super::Parameter;

/// Names that a tree's base parameters have in the order of the ten.
const REGROUPED: [&str; 10] = ["M", "MSx", "MSy", "MSz", "Jxx", "Jyy", "Jzz", "Jyz", "Jzx", "Jxy"];

/// Returns the place among a link's ten parameters of what is called `quantity`: `mcx`, `MSx`; not those with
/// a prime, which are in other axes.
fn place(quantity: &str) -> Option<usize> {
    let among = |names: &[&str]| names.iter().position(|name| *name == quantity);
    among(&PARAMETER_NAMES[..10]).or_else(|| among(&REGROUPED))
}

/// Returns link and place of a standard parameter called `arm.mcx`; a single body's link has an empty name.
fn link_and_place(name: &str) -> Option<(&str, usize)> {
    let (link, quantity) = name.rsplit_once('.').unwrap_or(("", name));
    Some((link, place(quantity)?))
}

/// Returns the weights of the ten standard parameters of `link` in a parameter; all zero if it has none of
/// them.
pub(super) fn weights(parameter: &Parameter, link: &str) -> [f64; 10] {
    let mut weights = [0.0; 10];
    if !parameter.kind.is_inertial() {
        return weights;
    }
    let mut add = |name: &str, weight: f64| {
        if let Some((_, k)) = link_and_place(name).filter(|(of, _)| *of == link) {
            weights[k] += weight;
        }
    };
    if parameter.made_of.is_empty() {
        add(&parameter.name, 1.0);
    } else {
        parameter.made_of.iter().for_each(|(name, weight)| add(name, *weight));
    }
    weights
}

/// Returns the name of a standard parameter: `arm.mcx`, or `mcx` of a single body.
pub(super) fn name(link: &str, place: usize) -> String {
    let quantity = PARAMETER_NAMES.get(place).copied().unwrap_or_default();
    if link.is_empty() { quantity.to_owned() } else { format!("{link}.{quantity}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Kind, Owner};

    #[test]
    fn sums_are_distinguished_from_single_parameters() {
        let owner = Owner::Link("arm".into());
        let mut parameter = Parameter::new("arm.MSx", owner.clone(), Kind::FirstMoment, "kg m");
        assert_eq!(weights(&parameter, "arm")[1], 1.0);
        assert_eq!(weights(&parameter, "hand"), [0.0; 10]);
        parameter.made_of = vec![("arm.mcx".into(), 1.0), ("hand.m".into(), 0.3)];
        assert_eq!((weights(&parameter, "arm")[1], weights(&parameter, "hand")[0]), (1.0, 0.3));
        let primed = Parameter::new("arm.MSx'", owner, Kind::FirstMoment, "kg m");
        assert_eq!(weights(&primed, "arm"), [0.0; 10]);
        let friction = Parameter::new("elbow.M", Owner::Drive("elbow".into()), Kind::Viscous, "N m s");
        assert_eq!(weights(&friction, "elbow"), [0.0; 10]);
        let body = Parameter::new("Ixy", Owner::Link(String::new()), Kind::Inertia, "kg m2");
        assert_eq!((weights(&body, "")[9], name("", 9), name("arm", 0)), (1.0, "Ixy".into(), "arm.m".into()));
    }
}

//! The values of an answer, or a model, for every column of a source: values to predict with.
//!
//! An answer of a tree has a value for every column; of others what is identified counts, and the rest is
//! zero and named.

use std::collections::HashMap;

use rigident_shared::inertia::PARAMETER_NAMES;

use super::result::Answer;
use rigident_fit::Parameter;
use rigident_model::Model;

/// Ends the name of a base parameter that rotors are a part of.
const ROTOR: &str = "+rotor";

/// Values by name: of standard parameters of links, of drives, of one body, of offsets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Predictor {
    values: HashMap<String, f64>,
    /// Errors of the sensors that it was identified with, by name.
    errors: Vec<(String, f64)>,
}

impl Predictor {
    /// Returns what a model's nominal parameters say, with friction, rotors and springs of its joints.
    pub fn of_model(model: &Model) -> Self {
        let mut own = Self::default();
        own.add_links(model);
        own
    }

    /// Returns what an answer says.
    pub fn of_answer(answer: &Answer) -> Self {
        let mut own = Self::default();
        match &answer.complete {
            Some(found) => {
                own.values.extend(found.links.iter().map(|p| (p.name.clone(), p.value)));
                for drive in &found.drives {
                    let known = drive.terms.iter().filter_map(|term| Some((term, term.value?)));
                    own.values.extend(
                        known.map(|(term, value)| (format!("{}.{}", drive.name, term.name()), value)),
                    );
                }
            }
            None => {
                let known = answer
                    .parameters
                    .iter()
                    .filter_map(|p| Some((p.name.clone(), p.state.measured()?.value)));
                own.values.extend(known);
            }
        }
        own.errors = answer.errors.iter().map(|error| (error.name.clone(), error.value)).collect();
        own
    }

    fn add_links(&mut self, model: &Model) {
        for link in &model.welded().links {
            let names = PARAMETER_NAMES[..10].iter().map(|name| format!("{}.{name}", link.name));
            // A link without a stated mass has one that nobody knows.
            self.values.extend(names.zip(link.nominal.into_iter().flatten()));
            let joint = |term: &str| format!("{}.{term}", link.joint_name);
            self.values.extend(link.passive[0].terms().map(|(term, value)| (joint(term), value)));
        }
    }

    /// Returns the values of these parameters, and the names of those that nothing is known of, which are
    /// zero.
    pub fn values(&self, parameters: &[Parameter]) -> (Vec<f64>, Vec<String>) {
        let mut without = Vec::new();
        let values = parameters.iter().map(|parameter| {
            let by_name = self.values.get(&parameter.name).copied();
            let terms = parameter.made_of.iter();
            let sum = || {
                let mut known = None;
                let mut unknown = Vec::new();
                for (name, weight) in terms {
                    match self.values.get(name) {
                        Some(value) => *known.get_or_insert(0.0) += weight * value,
                        None => unknown.push(name.clone()),
                    }
                }
                if known.is_some() {
                    without.extend(unknown);
                }
                known
            };
            let value = by_name.or_else(|| self.with_or_without_rotor(parameter)).or_else(sum);
            value.unwrap_or_else(|| {
                without.push(parameter.name.clone());
                0.0
            })
        });
        (values.collect(), without)
    }

    /// Returns the value of a base parameter that the answer has with a rotor in it, or without one, where
    /// the rows have the other: with the rotor that it knows by itself, if it does. What an answer calls
    /// `Jzz` without a column of the rotor holds it already.
    fn with_or_without_rotor(&self, parameter: &Parameter) -> Option<f64> {
        let Some(bare) = parameter.name.strip_suffix(ROTOR) else {
            return self.values.get(&format!("{}{ROTOR}", parameter.name)).copied();
        };
        let rotor = |(name, weight): &(String, f64)| {
            let own = name.ends_with(".rotor").then(|| self.values.get(name)).flatten();
            own.map_or(0.0, |value| weight * value)
        };
        let rotors: f64 = parameter.made_of.iter().map(rotor).sum();
        self.values.get(bare).map(|value| value + rotors)
    }

    /// Returns the errors of the sensors that the answer found, by name.
    pub fn errors(&self) -> &[(String, f64)] {
        &self.errors
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rigident_fit::{Kind, Owner};

    /// One answer has the rotor of a first axis in the moment of inertia about it, the other has no column of
    /// rotors: either predicts the rows of the other.
    #[test]
    fn moments_are_found_with_and_without_their_rotors() {
        let parameter = |name: &str, made_of: &[(&str, f64)]| Parameter {
            made_of: made_of.iter().map(|(name, weight)| ((*name).to_owned(), *weight)).collect(),
            ..Parameter::new(name, Owner::Link("l".to_owned()), Kind::Inertia, "kg m2")
        };
        let known = |values: &[(&str, f64)]| Predictor {
            values: values.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect(),
            errors: Vec::new(),
        };
        let with = parameter("l.Jzz+rotor", &[("l.Izz", 1.0), ("l.Iyy", 0.5), ("j.rotor", 1.0)]);
        let without = parameter("l.Jzz", &[("l.Izz", 1.0), ("l.Iyy", 0.5)]);
        let one = |own: &Predictor, parameter: &Parameter| own.values(std::slice::from_ref(parameter));
        let together = known(&[("l.Jzz+rotor", 3.0), ("j.rotor", 2.0)]);
        assert_eq!(one(&together, &with), (vec![3.0], Vec::new()));
        assert_eq!(one(&together, &without), (vec![3.0], Vec::new()));
        assert_eq!(one(&known(&[("l.Jzz", 3.0)]), &with), (vec![3.0], Vec::new()));
        // Two answers beside each other: the rotor of a column is added to what is without it.
        assert_eq!(one(&known(&[("l.Jzz", 1.0), ("j.rotor", 2.0)]), &with), (vec![3.0], Vec::new()));
        // A model has the links and the rotor by themselves.
        let model = known(&[("l.Izz", 0.5), ("l.Iyy", 1.0), ("j.rotor", 2.0)]);
        assert_eq!(one(&model, &with), (vec![3.0], Vec::new()));
        assert_eq!(one(&known(&[]), &with), (vec![0.0], vec!["l.Jzz+rotor".to_owned()]));
    }
}

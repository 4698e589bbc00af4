//! What an answer, or a model, says of every column of a source: values to predict with.
//!
//! An answer of a tree has a value for every column; of others what is identified counts, and the rest is zero and named.

use std::collections::HashMap;

use rigident_shared::inertia::PARAMETER_NAMES;

use super::result::Answer;
use rigident_fit::Parameter;
use rigident_model::Model;

/// Values by name: of standard parameters of links, of drives, of one body, of offsets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Predictor {
    values: HashMap<String, f64>,
    /// Errors of the sensors that it was identified with, by name.
    errors: Vec<(String, f64)>,
}

impl Predictor {
    /// Returns what a model's nominal parameters say, with viscous and Coulomb friction and rotors of its joints.
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
                    let name =
                        |term: &str| format!("{}.{}", drive.name, term.split(':').next().unwrap_or(term));
                    own.values
                        .extend(drive.terms.iter().filter_map(|term| Some((name(&term.term), term.value?))));
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
            let own = link.nominal.unwrap_or_default();
            let names = PARAMETER_NAMES[..10].iter().map(|name| format!("{}.{name}", link.name));
            self.values.extend(names.zip(own));
            let passive = link.passive.first().copied().unwrap_or_default();
            let joint = |word: &str| format!("{}.{word}", link.joint_name);
            let of_joint =
                [("viscous", passive.damping), ("coulomb", passive.friction), ("rotor", passive.armature)];
            self.values.extend(of_joint.map(|(word, value)| (joint(word), value)));
        }
    }

    /// Returns the values of these parameters, and the names of those that nothing is known of, which are zero.
    pub fn values(&self, parameters: &[Parameter]) -> (Vec<f64>, Vec<String>) {
        let mut without = Vec::new();
        let values = parameters.iter().map(|parameter| {
            let by_name = self.values.get(&parameter.name).copied();
            let terms = parameter.made_of.iter();
            let sum = || {
                let known: Vec<f64> =
                    terms.filter_map(|(name, weight)| Some(weight * self.values.get(name)?)).collect();
                (!known.is_empty()).then(|| known.iter().sum())
            };
            by_name.or_else(sum).unwrap_or_else(|| {
                without.push(parameter.name.clone());
                0.0
            })
        });
        (values.collect(), without)
    }

    /// Returns the errors of the sensors that the answer found, by name.
    pub fn errors(&self) -> &[(String, f64)] {
        &self.errors
    }
}

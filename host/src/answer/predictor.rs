//! What an answer, or a model, says of every column of a source: values to predict with.
//!
//! An answer of a tree has a value for every column; of others what is identified counts, and the rest is zero and named.

use std::collections::HashMap;

use rigident_shared::inertia::PARAMETER_NAMES;

use super::result::Answer;
use rigident_fit::Parameter;
use rigident_model::Model;
use rigident_model::passive::Passive;

/// Values by name: of standard parameters of links, of drives, of one body, of offsets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Predictor {
    values: HashMap<String, f64>,
    /// Errors of the sensors that it was identified with, by name.
    errors: Vec<(String, f64)>,
}

/// Returns the columns of a drive, by their words, that a joint's own friction, rotor and spring are values of.
///
/// A spring that is slack at q₀ adds `stiffness · q` and the constant `−stiffness · q₀`.
pub fn terms(passive: &Passive) -> [(&'static str, f64); 5] {
    [
        ("viscous", passive.damping),
        ("coulomb", passive.friction),
        ("rotor", passive.armature),
        ("spring", passive.stiffness),
        ("offset", -passive.stiffness * passive.spring_reference),
    ]
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
            let passive = link.passive.first().copied().unwrap_or_default();
            let joint = |word: &str| format!("{}.{word}", link.joint_name);
            self.values.extend(terms(&passive).map(|(word, value)| (joint(word), value)));
        }
    }

    /// Returns the values of these parameters, and the names of those that nothing is known of, which are zero.
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
            let value = by_name.or_else(sum);
            value.unwrap_or_else(|| {
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

//! What an answer, or a model, says of every column of a source: values to predict with.
//!
//! An answer's standard parameters and drives are complete and belong together; where there are none, what is identified counts,
//! and the rest is zero and named.

use std::collections::HashMap;

use rigident_shared::inertia::PARAMETER_NAMES;

use super::result::Answer;
use crate::fit::Parameter;
use crate::model::{Model, write};

/// Values by name: of standard parameters of links, of drives, of one body, of offsets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Predictor {
    values: HashMap<String, f64>,
    /// Relative gain errors of channels by name: what is measured is so much larger.
    gains: HashMap<String, f64>,
}

impl Predictor {
    /// Returns what a model's nominal parameters say; drives without friction and rotors.
    pub fn of_model(model: &Model) -> Self {
        let mut own = Self::default();
        own.add_links(model);
        own
    }

    /// Returns what an answer says; `model` is the one that it was identified with, as its file has it.
    pub fn of_answer(answer: &Answer, model: Option<&Model>) -> Self {
        let mut own = Self::default();
        let standard = answer.standard_parameters.as_ref().zip(model);
        for parameter in &answer.parameters {
            // Base parameters follow from the standard ones.
            if standard.is_none() || parameter.terms.is_empty() {
                own.values.extend(parameter.state.measured().map(|m| (parameter.name.clone(), m.value)));
            }
        }
        if let Some((found, model)) = standard {
            let links = found.links.iter().map(|link| (link.name.as_str(), link.parameters));
            own.add_links(&write::with_parameters(model, links));
            for drive in &found.drives {
                let name = |term: &str| format!("{}.{}", drive.name, term.split(':').next().unwrap_or(term));
                own.values.extend(drive.terms.iter().map(|term| (name(&term.term), term.value)));
            }
        }
        own.gains = answer.channels.iter().filter_map(|c| Some((c.name.clone(), c.gain?))).collect();
        own
    }

    fn add_links(&mut self, model: &Model) {
        for link in &model.welded().links {
            let own = link.nominal.unwrap_or_default();
            let names = PARAMETER_NAMES[..10].iter().map(|name| format!("{}.{name}", link.name));
            self.values.extend(names.zip(own));
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

    /// Returns the relative gain error of a channel.
    pub fn gain(&self, channel: &str) -> f64 {
        self.gains.get(channel).copied().unwrap_or(0.0)
    }
}

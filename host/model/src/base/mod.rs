//! Base parameters: the least set of combinations of standard parameters that the rows can tell apart.
//!
//! Lives here: the question ([`Situation`]) and its answer ([`BaseParameters`]), found twice: by rules from
//! leaf to root ([`recursive`]), exact for a base that moves freely, and from random motions by a
//! rank-revealing QR ([`numerical`]), for every situation. Both must agree. Links that are no bodies leave
//! the rules with fewer columns (`absent`). May not live here: estimation. Next: [`recursive`], then
//! [`numerical`].

mod absent;
pub mod names;
pub mod numerical;
mod qr;
pub mod recursive;
#[cfg(test)]
mod tests;

use nalgebra::DMatrix;
use rigident_shared::inertia::PARAMETER_NAMES;

use super::finding::ModelError;
pub use super::rows::Rows;
use super::tree::Model;
pub use numerical::Gap;
use numerical::{Reduction, Sampled};
use recursive::Rule;

/// Smallest singular value, relative to the largest, of what is distinguished in columns of unit length.
/// Robot descriptions round angles to some 1e-11 (π/2 as 1.57079632679), and by that alone columns that are
/// one seem to be two.
pub const ROUNDED: f64 = 1e-10;

/// The measured quantities and the kind of base.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Situation {
    /// The base moves; otherwise it is held still, gravity as the model states it, else along −z of its
    /// frame.
    pub floating: bool,
    /// The rows.
    pub rows: Rows,
    /// Mimic joints follow their leaders; otherwise each is a joint of its own.
    pub mimic: bool,
}

impl Situation {
    /// Returns what one should know of it, in a sentence.
    pub fn sentence(&self) -> &'static str {
        match (self.floating, self.rows) {
            (true, Rows::Base) => "the base moves; six rows, the wrench on the base link",
            (true, Rows::Both) => "the base moves; wrench on the base link and joint torques",
            (true, Rows::Joint) => {
                "the base moves; joint torques alone, which do not see all that the base's wrench would"
            }
            (false, Rows::Joint) => "the base is held still; joint torques",
            (false, Rows::Both) => "the base is held still; wrench on the base link and joint torques",
            (false, Rows::Base) => {
                "the base is held still; six rows, the wrench on the base link, which then do not identify \
                 what they would if it moved"
            }
        }
    }
}

/// One base parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseParameter {
    /// The name of the parameter, by the link and the regrouped quantity: `forearm.MSx`.
    pub name: String,
    /// Standard parameters (index of the column) and their constant weights. The first is the one that
    /// represents it.
    pub terms: Vec<(usize, f64)>,
    /// Rotors, by their parameters' names, whose inertia has the same column, with their weights.
    pub rotors: Vec<(String, f64)>,
}

/// The answer.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseParameters {
    /// Names of the standard parameters, `link.param`.
    pub standard: Vec<String>,
    /// The base parameters.
    pub parameters: Vec<BaseParameter>,
    /// The gap where the rank was cut.
    pub gap: Gap,
    /// Largest relative difference between the two ways.
    pub disagreement: f64,
    /// The number of the standard parameters that are zero, as those of links that are no bodies.
    pub absent: usize,
}

impl BaseParameters {
    /// Returns how many standard parameters there are.
    pub fn standard_count(&self) -> usize {
        self.standard.len() - self.absent
    }

    /// Returns the names of the rotors whose inertia occurs only together with that of links.
    pub fn rotors(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for (name, _) in self.parameters.iter().flat_map(|parameter| &parameter.rotors) {
            if !names.contains(&name.as_str()) {
                names.push(name);
            }
        }
        names
    }

    /// Returns the map B_r of these rotors: `φ_B = B φ + B_r r`.
    pub fn rotor_map(&self) -> DMatrix<f64> {
        let names = self.rotors();
        let weight = |i: usize, k: usize| -> f64 {
            let own = self.parameters.get(i).map_or(&[][..], |parameter| &parameter.rotors);
            own.iter()
                .filter(|(name, _)| Some(&name.as_str()) == names.get(k))
                .map(|(_, weight)| weight)
                .sum()
        };
        DMatrix::from_fn(self.parameters.len(), names.len(), weight)
    }

    /// Returns the standard columns that represent the base parameters, and what makes the base parameters'
    /// own columns of them, n × n; `None` where these are the same.
    pub fn columns(&self) -> (Vec<usize>, Option<DMatrix<f64>>) {
        let leads: Vec<usize> = self.parameters.iter().filter_map(|p| Some(p.terms.first()?.0)).collect();
        let map = self.map();
        let square = DMatrix::from_fn(leads.len(), leads.len(), |i, j| map[(i, leads[j])]);
        // Y = Y_B B on all columns, so Y_B = Y_leads B_leads⁻¹.
        let is_one = square == DMatrix::identity(leads.len(), leads.len());
        (leads, if is_one { None } else { square.try_inverse() })
    }

    /// Returns the regrouping map B: `φ_B = B φ`.
    pub fn map(&self) -> DMatrix<f64> {
        let mut map = DMatrix::zeros(self.parameters.len(), self.standard.len());
        for (row, parameter) in self.parameters.iter().enumerate() {
            for (column, weight) in &parameter.terms {
                map[(row, *column)] = *weight;
            }
        }
        map
    }
}

/// Returns the base parameters of a model.
///
/// # Errors
/// [`ModelError::Structure`] if the links make no tree, or the two ways disagree.
pub fn base_parameters(model: &Model, situation: &Situation) -> Result<BaseParameters, ModelError> {
    let model = model.welded();
    let refuse = |problem: String| ModelError::Structure { what: model.name.clone(), problem };
    // A base held still takes no part in the joints' rows.
    let skip = if situation.rows == Rows::Joint && !situation.floating { 10 } else { 0 };
    if 10 * model.links.len() <= skip {
        return Err(refuse(
            "no joint moves: there are no joint rows; say `floating` for a moving base".to_owned(),
        ));
    }
    let sampled = numerical::sample(&model, situation).map_err(|error| refuse(format!("{error:?}")))?;
    let present = |column: &usize| model.links[column / 10].is_body();
    let all: Vec<usize> = (skip..sampled.columns()).filter(present).collect();
    let absent = sampled.columns() - skip - all.len();
    let mut rules = recursive::rules(&model);
    if absent > 0 {
        let present: Vec<usize> = (0..sampled.columns()).filter(present).collect();
        rules = absent::without(&rules, &present, sampled.reach());
    }
    rules.retain(|rule| rule.column >= skip);
    let free = Reduction::of(&sampled, &all);
    let Regrouped { map, stand_for } = Regrouped::of(&rules, &sampled, free.rank()).map_err(refuse)?;
    if free.rank() != map.nrows() {
        return Err(refuse(format!(
            "random motions tell {} parameters apart, the rules {}: the model is at the edge of being \
             degenerate (the gap is {:.1e} to {:.1e})",
            free.rank(),
            map.nrows(),
            free.gap.kept,
            free.gap.dropped
        )));
    }
    let disagreement = disagreement(&map, &free);
    // Half the digits: rounding has far more to go by, a wrong weight far less.
    if disagreement > f64::EPSILON.sqrt() {
        return Err(refuse(format!(
            "rules and random motions disagree by {disagreement:.1e}: the model is at the edge of being \
             degenerate"
        )));
    }
    // The rules' weights are products of a frame's numbers; those of the QR carry its condition.
    let by_rules = stand_for.len() == rules.len() && absent == 0;
    let noise = 4.0 * f64::EPSILON * if by_rules { 1.0 } else { 1e2 / free.gap.kept };
    let parameter = |(row, rule): (usize, &usize)| {
        let rule = &rules[*rule];
        let mut terms: Vec<(usize, f64)> = (skip..map.ncols())
            .filter_map(|c| Some((c - skip, map[(row, c)])).filter(|t| t.1.abs() > noise))
            .collect();
        terms.sort_by_key(|t| (t.0 + skip != rule.column, t.0));
        BaseParameter { name: rule.name.clone(), terms, rotors: Vec::new() }
    };
    let standard = model.links[skip / 10..]
        .iter()
        .flat_map(|l| PARAMETER_NAMES[..10].iter().map(move |p| format!("{}.{p}", l.name)))
        .collect();
    let parameters = stand_for.iter().enumerate().map(parameter).collect();
    Ok(BaseParameters { standard, parameters, gap: free.gap, disagreement, absent })
}

/// The rules' combinations, regrouped as far as a situation needs it.
struct Regrouped {
    /// The weights of the standard parameters in each.
    map: DMatrix<f64>,
    /// The rule that each stands for.
    stand_for: Vec<usize>,
}

impl Regrouped {
    /// Regroups the combinations of rules to those that random motions tell apart, `rank` in number.
    fn of(rules: &[Rule], sampled: &Sampled, rank: usize) -> Result<Self, String> {
        let mut map = DMatrix::zeros(rules.len(), sampled.columns());
        for (row, rule) in rules.iter().enumerate() {
            for (column, weight) in &rule.terms {
                map[(row, *column)] = *weight;
            }
        }
        if rank >= rules.len() {
            return Ok(Self { map, stand_for: (0..rules.len()).collect() });
        }
        // The rules hold for every motion; this situation allows fewer, and so more is regrouped.
        let columns: Vec<usize> = rules.iter().map(|rule| rule.column).collect();
        let rest = if rules.iter().any(|rule| rule.primed) {
            Reduction::of_combinations(sampled, &map, &columns)
                .ok_or_else(|| "the rules' combinations are not independent".to_owned())?
        } else {
            Reduction::of(sampled, &columns)
        };
        let mut stand_for = rest.independent.clone();
        stand_for.sort_unstable();
        let order: Vec<usize> =
            stand_for.iter().filter_map(|i| rest.independent.iter().position(|k| k == i)).collect();
        map = DMatrix::from_fn(order.len(), rules.len(), |row, column| rest.map[(order[row], column)]) * map;
        Ok(Self { map, stand_for })
    }
}

/// Returns the disagreement of the two ways, relative to the largest element. With Y = Y_i N = Y_j B both row
/// spaces are one: B = B_i N, B_i the columns of B that the other way keeps.
fn disagreement(map: &DMatrix<f64>, free: &Reduction) -> f64 {
    let mut restored = DMatrix::zeros(map.nrows(), map.ncols());
    let kept =
        DMatrix::from_fn(map.nrows(), free.rank(), |row, k| map[(row, free.columns[free.independent[k]])]);
    let product = kept * &free.map;
    for (k, column) in free.columns.iter().enumerate() {
        restored.set_column(*column, &product.column(k));
    }
    (restored - map).abs().max() / map.abs().max()
}

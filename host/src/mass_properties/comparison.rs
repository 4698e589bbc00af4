//! Ways to solve side by side: what each leaves of the rows that it was found from, and of rows that it has not seen.

use nalgebra::DVector;

use super::methods::Method;
use super::unknowns::{BaseRows, ParameterSet, Unknowns, of_body};
use crate::answer::standard_parameters::{BaseEstimate, nearest};
use rigident_fit::{Factor, Noise};
use rigident_model::base::{BaseParameters, ROUNDED};
use rigident_model::inertial::impossibility;
use rigident_model::tree::NO_BODY;
use rigident_model::{Model, ModelError};

/// Condition numbers that truncation chooses from.
const CONDITIONS: [f64; 11] = [3.0, 10.0, 30.0, 1e2, 3e2, 1e3, 3e3, 1e4, 3e4, 1e5, 1e6];
/// Steps that the gradient method chooses from.
const STEPS: [usize; 8] = [5, 10, 20, 50, 100, 200, 500, 1000];
/// Weights of the nominal model that ridge chooses from.
const WEIGHTS: [f64; 9] = [0.01, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 1000.0];
/// Relative 1 σ of the nominal model that the consistent bodies choose from.
const TRUSTS: [f64; 4] = [0.03, 0.1, 0.3, 1.0];

/// A way to standard parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Way {
    /// Unknowns relative to the nominal model.
    Relative(Method),
    /// Bodies that can be, nearest to the nominal model, all ten parameters free ([`nearest`]).
    Consistent {
        /// Relative 1 σ that the nominal model is trusted with.
        trust: f64,
    },
}

impl Way {
    /// Returns what it is called.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Relative(Method::Truncated { .. }) => "truncated",
            Self::Relative(Method::Gradient { .. }) => "gradient",
            Self::Relative(Method::Bounded) => "bounded",
            Self::Relative(Method::Ridge { .. }) => "ridge",
            Self::Consistent { .. } => "consistent",
        }
    }

    /// Returns its setting in words.
    pub fn setting(&self) -> String {
        match self {
            Self::Relative(Method::Truncated { condition }) => format!("condition ≤ {condition:.0e}"),
            Self::Relative(Method::Gradient { steps }) => format!("{steps} steps"),
            Self::Relative(Method::Bounded) => "to the end".to_owned(),
            Self::Relative(Method::Ridge { weight }) => format!("weight {weight}"),
            Self::Consistent { trust } => format!("nominal ± {} %", trust * 100.0),
        }
    }

    /// Returns the same way with every setting that is chosen from.
    fn settings(&self) -> Vec<Self> {
        match self {
            Self::Relative(Method::Truncated { .. }) => {
                CONDITIONS.map(|condition| Self::Relative(Method::Truncated { condition })).to_vec()
            }
            Self::Relative(Method::Gradient { .. }) => {
                STEPS.map(|steps| Self::Relative(Method::Gradient { steps })).to_vec()
            }
            Self::Relative(Method::Bounded) => vec![*self],
            Self::Relative(Method::Ridge { .. }) => {
                WEIGHTS.map(|weight| Self::Relative(Method::Ridge { weight })).to_vec()
            }
            Self::Consistent { .. } => TRUSTS.map(|trust| Self::Consistent { trust }).to_vec(),
        }
    }

    /// Returns every way, with no setting that means anything.
    pub fn all() -> [Self; 5] {
        [
            Self::Relative(Method::Truncated { condition: 1e6 }),
            Self::Relative(Method::Gradient { steps: 100 }),
            Self::Relative(Method::Bounded),
            Self::Relative(Method::Ridge { weight: 1.0 }),
            Self::Consistent { trust: 0.3 },
        ]
    }
}

/// Rows of a robot in parts, with its nominal model.
pub struct Study<'a> {
    /// The nominal model as its file has it.
    pub model: &'a Model,
    /// The base parameters, the first columns of the parts.
    pub base: &'a BaseParameters,
    /// Factors of the parts, in standard deviations: each is left out once.
    pub parts: &'a [Factor],
    /// What of every link is unknown.
    pub set: ParameterSet,
    /// Right links are mirror images of left ones in what they change by.
    pub symmetric: bool,
    /// No mass goes below this share of the nominal one.
    pub least: f64,
}

/// What a way gave.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The way and its setting.
    pub way: Way,
    /// True if the setting was chosen by what was left out.
    pub is_chosen: bool,
    /// Sum of squares that it leaves of all rows, in standard deviations.
    pub direct: f64,
    /// Sum of squares of each part by what the others gave, together; `None` of one part.
    pub left_out: Option<f64>,
    /// Bodies whose mass is not positive.
    pub negative: usize,
    /// Bodies that cannot be, those among them.
    pub impossible: usize,
    /// The model with the parameters found.
    pub model: Model,
}

/// Ways side by side.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// Number of unknowns.
    pub unknowns: usize,
    /// Number of singular values of their rows that are more than rounding: directions that rows tell of.
    pub rank: usize,
    /// Ratio of the largest of these to the smallest.
    pub condition: f64,
    /// Number of rows of the factors.
    pub rows: u64,
    /// What the nominal model leaves.
    pub nominal: f64,
    /// The outcomes.
    pub outcomes: Vec<Outcome>,
}

impl Study<'_> {
    /// Returns each way with the setting that predicts best what it has not seen, and `fixed` ways as they are.
    ///
    /// # Errors
    /// [`ModelError`] if the nominal model cannot be one, or there are no pairs of links to be symmetric.
    pub fn compare(
        &self,
        ways: &[Way],
        fixed: &[Way],
        progress: &dyn Fn(f64),
    ) -> Result<Comparison, ModelError> {
        let unknowns =
            Unknowns::of(self.model, self.base.standard.len() / 10, self.set, self.symmetric, self.least)?;
        let all = self.merged(None);
        let rows = BaseRows::of(&all, self.base, unknowns.bodies.len());
        let sizes = rows.relative(&unknowns).rows.singular_values();
        let told: Vec<f64> = sizes.iter().copied().filter(|size| *size > ROUNDED * sizes.max()).collect();
        let held_out = self.held_out(unknowns.bodies.len());
        let mut outcomes = Vec::new();
        let total = (ways.len() + fixed.len()).max(1) as f64;
        for (i, way) in ways.iter().enumerate() {
            progress(i as f64 / total);
            let mut best: Option<(Way, f64)> = None;
            for setting in way.settings() {
                let Some(left) = self.left_out(&unknowns, &held_out, &setting)? else { break };
                if best.is_none_or(|(_, least)| left < least) {
                    best = Some((setting, left));
                }
            }
            let (setting, left) = best.map_or((*way, None), |(setting, left)| (setting, Some(left)));
            let is_chosen = left.is_some() && setting != Way::Relative(Method::Bounded);
            outcomes.push(self.outcome(&unknowns, &rows, &all, setting, left, is_chosen)?);
        }
        for (i, way) in fixed.iter().enumerate() {
            progress((ways.len() + i) as f64 / total);
            let left = self.left_out(&unknowns, &held_out, way)?;
            outcomes.push(self.outcome(&unknowns, &rows, &all, *way, left, false)?);
        }
        Ok(Comparison {
            unknowns: unknowns.names.len(),
            rank: told.len(),
            condition: sizes.max() / told.iter().copied().fold(f64::INFINITY, f64::min),
            rows: rows.count(),
            nominal: rows.cost(&unknowns.nominal),
            outcomes,
        })
    }

    fn outcome(
        &self,
        unknowns: &Unknowns,
        rows: &BaseRows,
        all: &Factor,
        way: Way,
        left_out: Option<f64>,
        is_chosen: bool,
    ) -> Result<Outcome, ModelError> {
        let model = self.solve(unknowns, all, way)?;
        let found = parameters(&model);
        let bodies = (0..unknowns.bodies.len()).map(|i| of_body(&found, i));
        let present: Vec<_> = bodies.filter(|phi| *phi != NO_BODY).collect();
        Ok(Outcome {
            way,
            is_chosen,
            direct: rows.cost(&found),
            left_out,
            negative: present.iter().filter(|phi| phi[0] <= 0.0).count(),
            impossible: present.iter().filter(|phi| impossibility(phi).is_some()).count(),
            model,
        })
    }

    /// The parts but one.
    fn merged(&self, without: Option<usize>) -> Factor {
        let count = self.parts.first().map_or(0, Factor::parameters);
        let mut all = Factor::new(count);
        self.parts
            .iter()
            .enumerate()
            .filter(|(i, _)| Some(*i) != without)
            .for_each(|(_, part)| all.merge(part));
        all
    }

    /// The rows of each part with the factor of the others; none of a single part.
    fn held_out(&self, bodies: usize) -> Vec<(BaseRows, Factor)> {
        let parts = self.parts.iter().enumerate().filter(|_| self.parts.len() > 1);
        parts.map(|(i, part)| (BaseRows::of(part, self.base, bodies), self.merged(Some(i)))).collect()
    }

    /// What a way leaves of each part by the others, together.
    fn left_out(
        &self,
        unknowns: &Unknowns,
        held_out: &[(BaseRows, Factor)],
        way: &Way,
    ) -> Result<Option<f64>, ModelError> {
        let mut sum = None;
        for (rows, others) in held_out {
            let model = self.solve(unknowns, others, *way)?;
            *sum.get_or_insert(0.0) += rows.cost(&parameters(&model));
        }
        Ok(sum)
    }

    /// The model with what a way finds of the rows of a factor.
    fn solve(&self, unknowns: &Unknowns, factor: &Factor, way: Way) -> Result<Model, ModelError> {
        let mut model = self.model.clone();
        match way {
            Way::Relative(method) => {
                let equations = BaseRows::of(factor, self.base, unknowns.bodies.len()).relative(unknowns);
                let changes = &unknowns.map * method.solve(&equations, unknowns);
                // A body's change is that of the link that moves it; links on fixed joints stay as they are.
                for (i, name) in unknowns.bodies.iter().enumerate() {
                    let change = of_body(&changes, i);
                    let own = model.link(name).and_then(|k| model.links.get_mut(k));
                    if let Some(link) = own.filter(|_| change.iter().any(|v| *v != 0.0)) {
                        let nominal = link.nominal.get_or_insert(NO_BODY);
                        nominal.iter_mut().zip(change).for_each(|(to, v)| *to += v);
                    }
                }
            }
            Way::Consistent { trust } => {
                let found = BaseEstimate::of_factor(factor, self.base, 1.0, Noise::Given);
                for own in nearest(self.model, &found, trust, self.symmetric)?.links {
                    let link = model.link(&own.name).and_then(|k| model.links.get_mut(k));
                    if let Some(link) = link {
                        link.nominal = Some(own.parameters);
                    }
                }
            }
        }
        Ok(model)
    }
}

/// Ten parameters of every body of a model.
fn parameters(model: &Model) -> DVector<f64> {
    let bodies = model.welded();
    DVector::from_iterator(
        10 * bodies.links.len(),
        bodies.links.iter().flat_map(|link| link.nominal.unwrap_or(NO_BODY)),
    )
}

impl Comparison {
    /// Returns the outcome that predicts best what it has not seen, of those whose bodies all can be; of one part the consistent one.
    pub fn best(&self) -> Option<&Outcome> {
        let possible = self.outcomes.iter().filter(|outcome| outcome.impossible == 0);
        let measured = possible.clone().filter_map(|outcome| Some((outcome, outcome.left_out?)));
        let best = measured.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(outcome, _)| outcome);
        best.or_else(|| possible.clone().find(|outcome| matches!(outcome.way, Way::Consistent { .. })))
    }
}

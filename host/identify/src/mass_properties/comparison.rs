//! Ways to solve side by side: what each leaves of the rows that it was found from, and of rows that it has
//! not seen.

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
const WEIGHTS: [f64; 9] = [1000.0, 100.0, 30.0, 10.0, 3.0, 1.0, 0.3, 0.1, 0.01];
/// Something predicts better if it does so by more than this many standard errors of the difference.
const SCATTER: f64 = 2.0;
/// Relative 1 σ of the nominal model that the consistent bodies choose from.
const TRUSTS: [f64; 6] = [0.02, 0.05, 0.1, 0.2, 0.5, 1.0];

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

/// A way without its setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WayName {
    /// Singular values above a share of the largest.
    Truncated,
    /// Conjugate gradients with masses above their bound, stopped early.
    Gradient,
    /// Least squares with masses above their bound.
    Bounded,
    /// Least squares beside the nominal model.
    Ridge,
    /// Bodies that can be, nearest to the nominal model.
    Consistent,
}

impl WayName {
    /// Returns what it is called.
    pub fn text(self) -> &'static str {
        match self {
            Self::Truncated => "truncated",
            Self::Gradient => "gradient",
            Self::Bounded => "bounded",
            Self::Ridge => "ridge",
            Self::Consistent => "consistent",
        }
    }
}

impl Way {
    /// Returns which way it is.
    pub fn name(&self) -> WayName {
        match self {
            Self::Relative(Method::Truncated { .. }) => WayName::Truncated,
            Self::Relative(Method::Gradient { .. }) => WayName::Gradient,
            Self::Relative(Method::Bounded) => WayName::Bounded,
            Self::Relative(Method::Ridge { .. }) => WayName::Ridge,
            Self::Consistent { .. } => WayName::Consistent,
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

    /// Returns the same way with every setting that is chosen from, the one that stays nearest to the nominal
    /// model first.
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
    /// The parameters of every link that are unknown.
    pub set: ParameterSet,
    /// Right links are mirror images of left ones in what they change by.
    pub symmetric: bool,
    /// No mass goes below this share of the nominal one.
    pub least: f64,
}

/// The result of a way.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The way and its setting.
    pub way: Way,
    /// True if the setting was chosen by what was left out.
    pub is_chosen: bool,
    /// Sum of squares that it leaves of all rows, in standard deviations.
    pub direct: f64,
    /// The residuals of each part by the results of the others, together; `None` of one part.
    pub left_out: Option<Left>,
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
    /// The residuals of the nominal model.
    pub nominal: f64,
    /// The residuals of the nominal model by parts, with their rows.
    nominal_parts: Vec<(f64, f64)>,
    /// Two ways predict equally well if what they leave of what was left out differs by no more.
    pub equal: f64,
    /// The outcomes.
    pub outcomes: Vec<Outcome>,
}

impl Study<'_> {
    /// Returns each way with the setting that predicts best what it has not seen, of equally good ones the
    /// one nearest to the nominal model, and `fixed` ways as they are.
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
        let nonzero: Vec<f64> = sizes.iter().copied().filter(|size| *size > ROUNDED * sizes.max()).collect();
        let held_out = self.held_out(unknowns.bodies.len());
        let mut outcomes = Vec::new();
        let total = (ways.len() + fixed.len()).max(1) as f64;
        for (i, way) in ways.iter().enumerate() {
            progress(i as f64 / total);
            let mut tried = Vec::new();
            for setting in way.settings() {
                let Some(left) = self.left_out(&unknowns, &held_out, &setting)? else { break };
                tried.push((setting, left));
            }
            let least = tried.iter().map(|(_, left)| left).min_by(|a, b| a.squares.total_cmp(&b.squares));
            let most = least.map_or(0.0, |least: &Left| least.squares + least.equal(nonzero.len()));
            // What rows hardly tell is noise: of equally good settings the strongest trust has the least of
            // it.
            let best = tried.into_iter().find(|(_, left)| left.squares <= most);
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
            rank: nonzero.len(),
            condition: sizes.max() / nonzero.iter().copied().fold(f64::INFINITY, f64::min),
            rows: rows.count(),
            nominal: rows.cost(&unknowns.nominal),
            nominal_parts: held_out
                .iter()
                .map(|(rows, _)| (rows.cost(&unknowns.nominal), rows.count() as f64))
                .collect(),
            equal: {
                let left = outcomes.iter().filter_map(|outcome| outcome.left_out.as_ref());
                left.min_by(|a, b| a.squares.total_cmp(&b.squares))
                    .map_or(0.0, |least| least.equal(nonzero.len()))
            },
            outcomes,
        })
    }

    fn outcome(
        &self,
        unknowns: &Unknowns,
        rows: &BaseRows,
        all: &Factor,
        way: Way,
        left_out: Option<Left>,
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
        let kept = self.parts.iter().enumerate().filter(|(i, _)| Some(*i) != without);
        Factor::merged(kept.map(|(_, part)| part))
    }

    /// The rows of each part with the factor of the others; none of a single part.
    fn held_out(&self, bodies: usize) -> Vec<(BaseRows, Factor)> {
        let parts = self.parts.iter().enumerate().filter(|_| self.parts.len() > 1);
        parts.map(|(i, part)| (BaseRows::of(part, self.base, bodies), self.merged(Some(i)))).collect()
    }

    /// Returns what a way leaves of each part by the others, together.
    fn left_out(
        &self,
        unknowns: &Unknowns,
        held_out: &[(BaseRows, Factor)],
        way: &Way,
    ) -> Result<Option<Left>, ModelError> {
        let mut parts = Vec::new();
        for (rows, others) in held_out {
            let model = self.solve(unknowns, others, *way)?;
            parts.push((rows.cost(&parameters(&model)), rows.count() as f64));
        }
        Ok(Left::of(&parts))
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

/// The residuals of a way for parts that it has not seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Left {
    /// Sum of squares, in standard deviations.
    pub squares: f64,
    /// Standard error of that by the scatter of the parts.
    error: f64,
    rows: f64,
    /// Sum of squares and rows of each part.
    parts: Vec<(f64, f64)>,
}

impl Left {
    /// Returns it of squares and rows of each part; `None` without parts.
    fn of(parts: &[(f64, f64)]) -> Option<Self> {
        let (squares, rows) = parts.iter().fold((0.0, 0.0), |(s, n), (own, count)| (s + own, n + count));
        let (mean, n) = (squares / rows, parts.len() as f64);
        let scatter = parts.iter().map(|(own, count)| (own / count - mean).powi(2)).sum::<f64>();
        let error = rows * (scatter / ((n - 1.0) * n).max(1.0)).sqrt();
        (rows > 0.0).then(|| Self { squares, error, rows, parts: parts.to_vec() })
    }

    /// Returns how much more another way may leave to be as good: the standard error of what is left by the
    /// scatter of the parts (L. Breiman and others, *Classification and Regression Trees*, 1984, section
    /// 3.4.3), and at least as much as chance.
    fn equal(&self, directions: usize) -> f64 {
        self.error.max(self.by_chance(directions))
    }

    /// Returns twice the standard deviation `√(2 k)` of χ² of as many directions as rows tell.
    fn by_chance(&self, directions: usize) -> f64 {
        let of_a_row = (self.squares / self.rows).max(1.0);
        2.0 * (2.0 * directions as f64).sqrt() * of_a_row
    }

    /// Returns true if it is less than what `others` leave of the same parts, by more than chance and than
    /// the differences scatter between the parts.
    fn is_better_than(&self, others: &[(f64, f64)], directions: usize) -> bool {
        let gains = others.iter().zip(&self.parts).map(|(other, own)| (other.0 - own.0, own.1));
        let gain = Self::of(&gains.collect::<Vec<_>>());
        gain.is_some_and(|gain| gain.squares > (SCATTER * gain.error).max(self.by_chance(directions)))
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
    /// Returns the outcome that predicts best what it has not seen, of those whose bodies all can be: the
    /// consistent one where it does as well as any, and of one part.
    pub fn best(&self) -> Option<&Outcome> {
        let possible = self.outcomes.iter().filter(|outcome| outcome.impossible == 0);
        let left = |outcome: &Outcome| outcome.left_out.as_ref().map_or(f64::INFINITY, |left| left.squares);
        let best = possible.clone().min_by(|a, b| left(a).total_cmp(&left(b)))?;
        let consistent = possible.clone().find(|outcome| matches!(outcome.way, Way::Consistent { .. }));
        match consistent {
            Some(own) if best.left_out.is_none() || left(own) <= left(best) + self.equal => Some(own),
            _ => best.left_out.is_some().then_some(best),
        }
    }

    /// Returns true if an outcome predicts what it has not seen better than the nominal model does; `None` of
    /// one part.
    pub fn is_better_than_nominal(&self, outcome: &Outcome) -> Option<bool> {
        let left = outcome.left_out.as_ref()?;
        Some(left.is_better_than(&self.nominal_parts, self.rank))
    }
}

#[cfg(test)]
mod tests {
    use super::Left;

    /// Parts of unequal length whose rows leave the same differ by chance alone; parts that differ are as
    /// good as they scatter.
    #[test]
    fn residuals_are_as_good_as_the_parts_scatter() {
        let even = Left::of(&[(1000.0, 1000.0), (500.0, 500.0)]).unwrap();
        assert_eq!((even.squares, even.equal(8)), (1500.0, 8.0));
        // One part that is better by far, among others that are not, says nothing.
        assert!(even.is_better_than(&[(1100.0, 1000.0), (550.0, 500.0)], 8));
        assert!(!even.is_better_than(&[(2000.0, 1000.0), (490.0, 500.0)], 8));
        let uneven = Left::of(&[(1000.0, 1000.0), (3000.0, 1000.0), (2000.0, 1000.0)]).unwrap();
        // By hand: 1, 3 and 2 a row, standard deviation 1, of the mean 1/√3.
        assert!((uneven.equal(8) - 3000.0 / 3.0_f64.sqrt()).abs() < 1e-9);
        assert_eq!(Left::of(&[]), None);
    }
}

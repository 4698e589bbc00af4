//! The unknown parameters of the links, and their rows.

use nalgebra::{DMatrix, DVector};
use rigident_shared::inertia::PARAMETER_NAMES;

use crate::answer::standard_parameters::BaseEstimate;
use rigident_fit::{Factor, Noise};
use rigident_model::base::BaseParameters;
use rigident_model::inertial::Parameters;
use rigident_model::symmetry::{self, pairs};
use rigident_model::tree::NO_BODY;
use rigident_model::{Model, ModelError};

/// Parameters of a link.
const TEN: usize = 10;
/// Mass and first moment are first.
const FOUR: usize = 4;
/// A link's size where its nominal tensor says nothing, m.
const SIZE_M: f64 = 0.1;

/// The parameters of every link that are unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ParameterSet {
    /// Mass and first moment; tensors about the links' origins stay the nominal ones.
    #[default]
    MassAndMoment,
    /// All ten.
    All,
}

/// The unknowns ψ: `φ = φ⁰ + T ψ` of the ten parameters of every body.
#[derive(Clone, Debug, PartialEq)]
pub struct Unknowns {
    /// Names of the bodies, in the model's order.
    pub bodies: Vec<String>,
    /// Names of the unknowns, `link.mass`.
    pub names: Vec<String>,
    /// φ⁰, ten a body.
    pub nominal: DVector<f64>,
    /// T.
    pub map: DMatrix<f64>,
    /// The least value of each unknown; −∞ where there is none.
    pub lower: Vec<f64>,
    /// A usual size of each unknown: that of the nominal model.
    pub scale: Vec<f64>,
}

impl Unknowns {
    /// Returns the unknowns of the bodies of a model: links on fixed joints are one with what they hang on,
    /// and what is no body has none.
    ///
    /// Rows see the last `seen` bodies: a base that is held still is not among them. With `symmetric` a right
    /// link changes as the mirror image of the left one. No mass goes below `least`, a share of the nominal
    /// one.
    ///
    /// # Errors
    /// [`ModelError`] if a body has no nominal mass, or there are no pairs.
    pub fn of(
        model: &Model,
        seen: usize,
        set: ParameterSet,
        symmetric: bool,
        least: f64,
    ) -> Result<Self, ModelError> {
        let welded = model.welded();
        let refuse = |problem: String| ModelError::Structure { what: model.name.clone(), problem };
        let mut nominal = Vec::new();
        let first = welded.links.len().saturating_sub(seen);
        for (i, link) in welded.links.iter().enumerate() {
            let own = link.nominal.or((i < first).then_some(NO_BODY)).ok_or_else(|| {
                refuse(format!(
                    "link {} has no nominal mass: what rows leave open is taken from the model, which needs \
                     one of every link",
                    link.name
                ))
            })?;
            nominal.extend_from_slice(&own);
        }
        let pairs = if symmetric { pairs(&welded)? } else { Vec::new() };
        let mirrored = symmetry::substitution(welded.links.len(), &pairs);
        let free: Vec<usize> =
            (0..welded.links.len()).filter(|i| pairs.iter().all(|pair| pair.right != *i)).collect();
        let each = if set == ParameterSet::All { TEN } else { FOUR };
        let (mut columns, mut names, mut scale) = (Vec::new(), Vec::new(), Vec::new());
        for (place, i) in free.iter().enumerate() {
            let Some(link) = welded.links.get(*i).filter(|link| link.is_body() && *i >= first) else {
                continue;
            };
            let own = &nominal[TEN * i..TEN * (i + 1)];
            for (k, name) in PARAMETER_NAMES.iter().enumerate().take(each) {
                columns.push(TEN * place + k);
                names.push(format!("{}.{name}", link.name));
                scale.push(size(own, k));
            }
        }
        let map = mirrored.select_columns(&columns);
        let lower = map.column_iter().map(|column| {
            let masses = column.iter().enumerate().filter(|(row, v)| row % TEN == 0 && **v != 0.0);
            let each = masses.map(|(row, v)| (least - 1.0) * nominal[row] / v);
            each.fold(f64::NEG_INFINITY, f64::max)
        });
        Ok(Self {
            bodies: welded.links.iter().map(|link| link.name.clone()).collect(),
            names,
            lower: lower.collect(),
            scale,
            nominal: DVector::from_vec(nominal),
            map,
        })
    }

    /// Returns the parameters of all bodies for values of the unknowns.
    pub fn parameters(&self, psi: &DVector<f64>) -> DVector<f64> {
        &self.nominal + &self.map * psi
    }
}

/// A usual size of parameter k of a body: its mass, its mass times its radius of gyration, its tensor.
fn size(nominal: &[f64], k: usize) -> f64 {
    let (mass, trace) = (nominal[0].max(f64::MIN_POSITIVE), nominal[4] + nominal[5] + nominal[6]);
    let radius = if trace > 0.0 { (trace / mass).sqrt() } else { SIZE_M };
    match k {
        0 => mass,
        1..4 => mass * radius,
        _ => mass * radius * radius,
    }
}

/// Rows of the unknowns: `A ψ = d`, in standard deviations.
#[derive(Clone, Debug, PartialEq)]
pub struct Equations {
    /// A.
    pub rows: DMatrix<f64>,
    /// d.
    pub values: DVector<f64>,
    /// The square of what no parameters explain.
    pub left: f64,
}

/// Rows of the base parameters, friction and whatever else eliminated: `R φ_B = z`, in standard deviations.
#[derive(Clone, Debug)]
pub struct BaseRows {
    r: DMatrix<f64>,
    z: DVector<f64>,
    left: f64,
    count: u64,
    /// `φ_B = B φ` of the bodies' ten parameters each.
    map: DMatrix<f64>,
}

impl BaseRows {
    /// Returns the rows of a factor whose first parameters are the base parameters of a model of the given
    /// number of bodies.
    pub fn of(factor: &Factor, base: &BaseParameters, bodies: usize) -> Self {
        let own = BaseEstimate::of_factor(factor, base, 1.0, Noise::Given);
        let mut map = DMatrix::zeros(own.r.ncols(), TEN * bodies);
        let of_base = base.map();
        let skip = (TEN * bodies).saturating_sub(of_base.ncols());
        map.columns_mut(skip, of_base.ncols()).copy_from(&of_base);
        Self { r: own.r, z: own.z, left: factor.residual_sum_of_squares(), count: factor.rows(), map }
    }

    /// Returns the rows of unknowns relative to the nominal model.
    pub fn relative(&self, unknowns: &Unknowns) -> Equations {
        let rows = &self.r * &self.map;
        Equations { values: &self.z - &rows * &unknowns.nominal, rows: rows * &unknowns.map, left: self.left }
    }

    /// Returns the sum of squares that parameters of all bodies leave, in standard deviations.
    pub fn cost(&self, parameters: &DVector<f64>) -> f64 {
        (&self.r * (&self.map * parameters) - &self.z).norm_squared() + self.left
    }

    /// Returns the number of rows.
    pub fn count(&self) -> u64 {
        self.count
    }
}

/// Returns the ten parameters of body i.
pub fn of_body(parameters: &DVector<f64>, i: usize) -> Parameters {
    std::array::from_fn(|k| parameters.get(TEN * i + k).copied().unwrap_or(0.0))
}

//! The 6 × 6 matrix of a load cell from known weights at known places.
//!
//! Each bridge answers to the wrench: `g = g₀ + B w`. Rows for `B` come from loadings ([`table`], [`rows`]);
//! the fit is the house's own, with the errors of weights, places and level as errors that it estimates
//! beside. The matrix of the rig file is `K = B⁻¹`, and its error acts on a wrench as `ΔK B` ([`matrix`]).
//! One loading that contradicts the others is named ([`contradiction`]). Next: [`table`].

pub mod contradiction;
pub mod matrix;
pub mod rows;
pub mod table;
#[cfg(test)]
mod tests;

use rigident_fit::{FitOptions, NuisanceFit, Silent, fit};

use contradiction::Contradiction;
use matrix::Matrix;
use rows::Loadings;
use table::Loading;

/// Names of the components of a wrench.
pub const COMPONENTS: [&str; 6] = ["fx", "fy", "fz", "mx", "my", "mz"];
/// Directions of loads with less than this share of the largest are none.
const LEAST_SHARE: f64 = 1e-3;
/// U95 at full scale of every component, relative, above which a matrix is too coarse to be used.
pub const COARSEST: f64 = 0.1;

/// The uncertainty of loadings: 1 σ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uncertainty {
    /// Of each weight, relative.
    pub mass: f64,
    /// Of each place where a weight hangs, along each axis, m.
    pub place_m: f64,
    /// Of the direction of gravity in the cell's axes, each time that the cell is turned, rad.
    pub level_rad: f64,
    /// Of the mean reading of a bridge, V; `None`: it is found from what the loadings leave.
    pub reading_v: Option<f64>,
}

impl Default for Uncertainty {
    /// Weights of class M3 or kitchen scales, holes drilled by hand, a spirit level.
    fn default() -> Self {
        Self { mass: 5e-4, place_m: 3e-4, level_rad: 0.2_f64.to_radians(), reading_v: None }
    }
}

/// Why loadings make no matrix.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LoadCellError {
    /// The table cannot be read.
    #[error("{0}")]
    Table(String),
    /// There are too few.
    #[error(
        "{given} loadings are too few: a zero and six loads in different directions are the least, 15 to 30 \
         are good"
    )]
    TooFew {
        /// Loadings.
        given: usize,
    },
    /// No loading differs from the others by this component.
    #[error("no loading tells {component} apart from the others: {}", remedy(component))]
    Lacks {
        /// The component, `mz`.
        component: &'static str,
    },
    /// A loading contradicts the others.
    #[error("{0}")]
    Contradicts(Contradiction),
    /// The fit failed.
    #[error("{0}")]
    Fit(#[from] rigident_fit::FitError),
}

fn remedy(component: &str) -> &'static str {
    match component {
        "fx" | "fy" => {
            "turn the cell on its side, so that weights pull along this axis (columns down_x, down_y, \
             down_z), or pull by a cord over a pulley"
        }
        "fz" => "hang or lay weights so that they act along z, and give the zero (mass_kg 0) too",
        "mz" => "turn the cell on its side and hang a weight beside its axis, on both sides",
        _ => "hang the same weight at places to both sides of the axis",
    }
}

/// Finds the matrix.
///
/// # Errors
/// [`LoadCellError`] if loadings are too few, leave a component open, or contradict each other.
///
/// ```
/// use rigident_identify::load_cell::{Uncertainty, calibrate, table};
///
/// // A cell whose bridges each see one component, 10 µV/N and 100 µV/(N m).
/// let mut text = String::from("mass_kg,x_m,y_m,z_m,down_x,down_y,down_z,g1_v,g2_v,g3_v,g4_v,g5_v,g6_v\n");
/// let g = 9.80665;
/// for (down, places) in [
///     ([0.0, 0.0, -1.0], [[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, -0.1, 0.0]]),
///     ([1.0, 0.0, 0.0], [[0.0, 0.1, 0.0], [0.0, -0.1, 0.0], [0.0, 0.0, 0.1], [0.0, 0.0, 0.0]]),
///     ([0.0, 1.0, 0.0], [[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0], [0.0, 0.0, 0.1], [0.0, 0.0, 0.0]]),
/// ] {
///     for [x, y, z] in places {
///         for mass in [0.0, 1.0, 2.0] {
///             let f: [f64; 3] = down.map(|d: f64| -mass * g * d);
///             let m = [y * f[2] - z * f[1], z * f[0] - x * f[2], x * f[1] - y * f[0]];
///             let v = [f[0], f[1], f[2], 10.0 * m[0], 10.0 * m[1], 10.0 * m[2]].map(|w| format!("{}", 1e-5 * w));
///             let [a, b, c] = down;
///             text += &format!("{mass},{x},{y},{z},{a},{b},{c},{}\n", v.join(","));
///         }
///     }
/// }
/// let loadings = table::parse(&text, "weights.csv", g, None).unwrap();
/// let uncertainty = Uncertainty { reading_v: Some(1e-7), ..Uncertainty::default() };
/// let matrix = calibrate(&loadings, &uncertainty).unwrap();
/// assert!((matrix.matrix[2][2] - 1e5).abs() < matrix.matrix_u95[2][2]);
/// ```
pub fn calibrate(loadings: &[Loading], uncertainty: &Uncertainty) -> Result<Matrix, LoadCellError> {
    let rows = Loadings::new(loadings, uncertainty);
    let unknowns = rows.runs() + 6;
    if loadings.len() <= unknowns {
        return Err(LoadCellError::TooFew { given: loadings.len() });
    }
    if let Some(component) = rows.lacks(LEAST_SHARE) {
        return Err(LoadCellError::Lacks { component });
    }
    let found = fit(&rows, &FitOptions::default(), &Silent)?;
    let answers = matrix::answers(&rows, &found);
    let reading_v = found.channels.first().map_or(0.0, |channel| channel.sigma).max(f64::MIN_POSITIVE);
    if let Some(found) = contradiction::find(&rows, &answers, reading_v) {
        return Err(LoadCellError::Contradicts(found));
    }
    // One error that is off pulls others after it: the one that is off most is named.
    let pull = |error: &&NuisanceFit| error.pull().abs();
    let worst = found.nuisances.iter().max_by(|a, b| pull(a).total_cmp(&pull(b)));
    if let Some(error) = worst.filter(|error| error.is_contradicted()) {
        return Err(LoadCellError::Contradicts(Contradiction::Error {
            name: error.nuisance.name.clone(),
            value: error.value,
            sigma: error.nuisance.sigma,
            unit: error.nuisance.unit.clone(),
        }));
    }
    Matrix::new(&rows, &found, &answers).ok_or(LoadCellError::Lacks { component: rows.weakest() })
}

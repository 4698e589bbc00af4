//! The information that a trajectory will bring: the factor that the pipeline makes of its readings, and its
//! uncertainties.

use super::family::{Motion, Series};
use super::information::Tree;
use rigident_fit::{
    Estimate, Factor, FitError, Kind, Noise, Owner, Parameter, RowSource, Silent, plain_factor,
};
use rigident_identify::answer::Links;
use rigident_identify::answer::states::{LARGEST_SHARE, link_scales};
use rigident_rows::tree::{Frame, TreeSource, TreeSourceError};

/// The knowledge of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Predicted {
    /// The parameter's name, as `identify` has it.
    pub name: String,
    /// The parameter's unit.
    pub unit: String,
    /// The parameter's 95 % expanded uncertainty; `None` if it is not identified.
    pub u95: Option<f64>,
}

/// The information that a trajectory will bring.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// Every parameter.
    pub parameters: Vec<Predicted>,
    /// 2-norm condition number of the factor with its columns of unit length, over what is determined.
    pub condition_number: f64,
    /// `ln det` of the information, SI; minus infinity where something is open.
    pub log_determinant: f64,
}

/// The reason why nothing can be predicted.
#[derive(Debug, thiserror::Error)]
pub enum PredictError {
    /// The rows do not fit the model.
    #[error(transparent)]
    Source(#[from] TreeSourceError),
    /// The filter does not fit the rate.
    #[error(transparent)]
    Fit(#[from] FitError),
}

/// Returns what readings of a trajectory tell, at the given rate, positions and rates exact.
///
/// # Errors
/// [`PredictError`] if there are no rows at this rate.
pub fn predict(tree: &Tree, series: &Series, rate_hz: f64) -> Result<Prediction, PredictError> {
    let mut moving = tree.moving();
    let readings = (series.duration_s * rate_hz * (1.0 + 1e-12)).floor() as u64;
    let frame = |k: u64| {
        let t = k as f64 / rate_hz;
        let motion = series.at(t);
        let efforts = tree.efforts(&mut moving, &motion).unwrap_or_default();
        let wrench = moving.base_rows().map_or([0.0; 6], |rows| wrench(rows, tree));
        let Motion { positions, rates, .. } = motion;
        let base = tree.base();
        Frame {
            time_ns: (t * 1e9).round() as u64,
            positions,
            rates,
            base,
            wrench,
            efforts,
            standing: Vec::new(),
            ground: Default::default(),
        }
    };
    let frames = (0..=readings).map(frame).collect();
    let empty = tree.source();
    let source = empty.of_same_model(empty.input().with_frames(frames))?;
    let sigma: Vec<f64> = source.channels().iter().map(|c| c.sigma.unwrap_or(1.0)).collect();
    let factor = plain_factor(&source, &sigma, &Silent)?;
    Ok(of_factor(&factor, &source))
}

/// Returns the wrench of the nominal model.
fn wrench(rows: &[f64], tree: &Tree) -> [f64; 6] {
    let nominal = tree.source().input().model.nominal();
    std::array::from_fn(|axis| {
        rows.iter().skip(axis * nominal.len()).zip(&nominal).map(|(a, phi)| a * phi).sum()
    })
}

fn of_factor(factor: &Factor, source: &TreeSource) -> Prediction {
    let estimate = Estimate::new(factor, source.rounding(), 1.0, Noise::Given);
    let scales = scales(source, &estimate);
    let parameters = source.parameters().iter().zip(scales).enumerate().map(|(j, (parameter, scale))| {
        let u95 = Some(estimate.u95(j)).filter(|u95| {
            estimate.is_determined(j)
                && u95.is_finite()
                && scale.is_none_or(|scale| *u95 <= LARGEST_SHARE * scale)
        });
        Predicted { name: parameter.name.clone(), unit: parameter.unit.clone(), u95 }
    });
    Prediction {
        parameters: parameters.collect(),
        condition_number: estimate.condition_number,
        log_determinant: factor.log_determinant(),
    }
}

/// Returns what the uncertainty of each parameter is judged against, as `identify` does; `None` of what it
/// judges by readings.
fn scales(source: &TreeSource, estimate: &Estimate) -> Vec<Option<f64>> {
    let links = Links {
        model: &source.input().model,
        base: source.base(),
        situation: source.input().situation,
        drives: source.drive_motions(),
        as_stated: &[],
        idle: Vec::new(),
        beyond: Vec::new(),
        standard: None,
    };
    let of_links = link_scales(source.parameters(), estimate, Some(&links));
    let names = source.input().freedom_names();
    let frames = &source.input().frames;
    let mean_square = |value: &dyn Fn(&Frame) -> f64| {
        frames.iter().map(|frame| value(frame).powi(2)).sum::<f64>() / frames.len().max(1) as f64
    };
    let of_drive = |name: &str, kind: Kind| {
        let k = names.iter().position(|own| own == name)?;
        let effort = mean_square(&|frame| frame.efforts.get(k).copied().unwrap_or(0.0)).sqrt();
        let rate = mean_square(&|frame| frame.rates.get(k).copied().unwrap_or(0.0)).sqrt();
        match kind {
            Kind::Viscous => Some(effort / rate.max(f64::MIN_POSITIVE)),
            Kind::Load => Some(1.0),
            Kind::Rotor => {
                of_links.iter().filter(|(key, _)| key.1 == Kind::Inertia).map(|(_, v)| *v).reduce(f64::max)
            }
            _ => Some(effort),
        }
    };
    let scale = |parameter: &Parameter| match &parameter.owner {
        Owner::Link(link) => of_links.get(&(link.clone(), parameter.kind)).copied(),
        Owner::Drive(name) => of_drive(name, parameter.kind),
        _ => None,
    };
    source.parameters().iter().map(scale).collect()
}

impl Prediction {
    /// Returns the names of the parameters that are not identified.
    pub fn open(&self) -> Vec<&str> {
        self.parameters.iter().filter(|p| p.u95.is_none()).map(|p| p.name.as_str()).collect()
    }

    /// Returns the geometric mean of the uncertainties over those of another trajectory, of the parameters
    /// that both identify; `None` if there are none.
    pub fn over(&self, other: &Self) -> Option<f64> {
        let both = self.parameters.iter().zip(&other.parameters);
        let logs: Vec<f64> = both.filter_map(|(a, b)| Some((a.u95? / b.u95?).ln())).collect();
        (!logs.is_empty()).then(|| (logs.iter().sum::<f64>() / logs.len() as f64).exp())
    }
}

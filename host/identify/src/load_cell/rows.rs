//! Rows of loadings: each bridge reads `g₀ + B w`.

use nalgebra::{DMatrix, Vector3};
use rigident_shared::screening::Rejection;

use rigident_fit::{
    Basis, Channel, Effect, Kind, Nuisance, Owner, Parameter, RowSource, SampleRows, Scope, Timing,
};

use super::table::{Load, Loading};
use super::{COMPONENTS, Uncertainty};

/// Loadings with the errors that several of them share.
#[derive(Clone, Debug)]
pub struct Loadings {
    loadings: Vec<Loading>,
    uncertainty: Uncertainty,
    /// The zero of each loading, by its number.
    run_of: Vec<usize>,
    runs: usize,
    errors: Vec<Error>,
    parameters: Vec<Parameter>,
    channels: Vec<Channel>,
}

/// An error of loads, and whose it is.
#[derive(Clone, Debug, PartialEq)]
enum Error {
    /// Of a weight, relative.
    Mass(String),
    /// Of a place along an axis, m.
    Place([f64; 3], usize),
    /// Of the direction of gravity in a run, turned about an axis, rad.
    Level(String, [f64; 3], usize),
}

impl Loadings {
    /// Takes loadings, and how well they are known.
    pub fn new(loadings: &[Loading], uncertainty: &Uncertainty) -> Self {
        let mut runs: Vec<&str> = Vec::new();
        let mut errors = Vec::new();
        let mut run_of = Vec::new();
        for loading in loadings {
            if !runs.contains(&loading.run.as_str()) {
                runs.push(&loading.run);
            }
            run_of.push(runs.iter().position(|run| *run == loading.run).unwrap_or(0));
            for error in Self::errors_of(loading) {
                if !errors.contains(&error) {
                    errors.push(error);
                }
            }
        }
        let runs = runs.len();
        Self {
            parameters: parameters(runs),
            channels: channels(uncertainty.reading_v),
            loadings: loadings.to_vec(),
            uncertainty: *uncertainty,
            run_of,
            runs,
            errors,
        }
    }

    fn errors_of(loading: &Loading) -> Vec<Error> {
        match &loading.load {
            Load::Wrench(_) => vec![Error::Mass(loading.weight.clone())],
            Load::Weight { mass_kg, .. } if *mass_kg == 0.0 => Vec::new(),
            Load::Weight { place_m, down, .. } => {
                let place = (0..3).map(|axis| Error::Place(*place_m, axis));
                // About gravity itself nothing turns.
                let level = (0..3).filter(|axis| down[*axis].abs() < 0.99);
                let level = level.map(|axis| Error::Level(loading.run.clone(), *down, axis));
                std::iter::once(Error::Mass(loading.weight.clone())).chain(place).chain(level).collect()
            }
        }
    }

    /// Returns the loadings.
    pub fn loadings(&self) -> &[Loading] {
        &self.loadings
    }

    /// Returns the number of each loading's zero.
    pub(super) fn run_of(&self) -> &[usize] {
        &self.run_of
    }

    /// Returns the number of zeros.
    pub fn runs(&self) -> usize {
        self.runs
    }

    /// Returns the largest force and the largest moment of all loadings, N and N m.
    pub fn full_scale(&self) -> [f64; 2] {
        let largest = |from: usize| {
            self.loadings
                .iter()
                .flat_map(|l| l.wrench()[from..from + 3].to_vec())
                .fold(0.0, |a: f64, w| a.max(w.abs()))
        };
        [largest(0), largest(3)]
    }

    /// Returns the coefficients that all six bridges have: zeros of runs, then the wrench at full scale.
    pub(super) fn design(&self) -> DMatrix<f64> {
        let scale = self.full_scale();
        DMatrix::from_fn(self.loadings.len(), self.runs + 6, |i, j| {
            if j < self.runs {
                f64::from(u8::from(self.run_of[i] == j))
            } else {
                let k = j - self.runs;
                self.loadings[i].wrench()[k] / scale[k / 3].max(f64::MIN_POSITIVE)
            }
        })
    }

    /// The direction of wrenches at full scale that loadings tell least of, and its share of the largest,
    /// zeros apart.
    fn weakest_direction(&self) -> ([f64; 6], f64) {
        let design = self.design();
        let (zeros, loads) = (design.columns(0, self.runs), design.columns(self.runs, 6));
        // A run's zero is its mean.
        let count = zeros.row_sum();
        let mean = DMatrix::from_fn(self.runs, 6, |run, k| {
            (zeros.column(run).transpose() * loads.column(k))[0] / count[run]
        });
        let svd = (loads - zeros * mean).svd(false, true);
        let largest = svd.singular_values.max();
        let (at, least) = svd.singular_values.argmin();
        let direction = svd.v_t.map_or([0.0; 6], |v| std::array::from_fn(|k| v[(at, k)]));
        (direction, if largest > 0.0 { least / largest } else { 0.0 })
    }

    /// Returns the component that loadings tell least of.
    pub fn weakest(&self) -> &'static str {
        let (direction, _) = self.weakest_direction();
        let largest = |a: usize, b: usize| if direction[b].abs() > direction[a].abs() { b } else { a };
        COMPONENTS[(0..6).fold(0, largest)]
    }

    /// Returns the component that no loading tells apart: its share is below `least` of the largest.
    pub fn lacks(&self, least: f64) -> Option<&'static str> {
        (self.weakest_direction().1 < least).then(|| self.weakest())
    }

    fn sigma(&self, error: &Error) -> f64 {
        match error {
            Error::Mass(_) => self.uncertainty.mass,
            Error::Place(..) => self.uncertainty.place_m,
            Error::Level(..) => self.uncertainty.level_rad,
        }
    }

    /// A loading without one of its errors.
    fn corrected(loading: &mut Loading, error: &Error, by: f64) {
        match (&mut loading.load, error) {
            (Load::Wrench(wrench), Error::Mass(name)) if *name == loading.weight => {
                wrench.iter_mut().for_each(|w| *w *= 1.0 - by);
            }
            (Load::Weight { mass_kg, .. }, Error::Mass(name)) if *name == loading.weight => {
                *mass_kg *= 1.0 - by;
            }
            (Load::Weight { place_m, .. }, Error::Place(place, axis)) if place_m == place => {
                place_m[*axis] -= by;
            }
            (Load::Weight { down, .. }, Error::Level(run, direction, axis))
                if *run == loading.run && down == direction =>
            {
                let mut turn = Vector3::zeros();
                turn[*axis] = by;
                *down = (Vector3::from(*down) - turn.cross(&Vector3::from(*direction))).into();
            }
            _ => {}
        }
    }

    /// Returns by how much each error at one standard deviation moves the wrench of each loading, N and N m.
    pub(super) fn changes(&self) -> Vec<Vec<[f64; 6]>> {
        let of = |error: &Error| {
            let change = |loading: &Loading| {
                let mut other = loading.clone();
                Self::corrected(&mut other, error, self.sigma(error));
                let (with, without) = (loading.wrench(), other.wrench());
                std::array::from_fn(|k| with[k] - without[k])
            };
            self.loadings.iter().map(change).collect()
        };
        self.errors.iter().filter(|error| self.sigma(error) > 0.0).map(of).collect()
    }

    fn name(error: &Error) -> String {
        const AXES: [&str; 3] = ["x", "y", "z"];
        let three = |v: &[f64; 3]| format!("{}, {}, {}", v[0], v[1], v[2]);
        match error {
            Error::Mass(name) => format!("weight {name}"),
            Error::Place(place, axis) => format!("place {} along {}", three(place), AXES[*axis]),
            Error::Level(run, down, axis) => {
                let run = if run.is_empty() { String::new() } else { format!(" in run {run}") };
                format!("direction {} about {}{run}", three(down), AXES[*axis])
            }
        }
    }
}

fn parameters(runs: usize) -> Vec<Parameter> {
    let mut all = Vec::with_capacity(6 * (runs + 6));
    for bridge in 1..=6 {
        let owner = || Owner::Channel(format!("g{bridge}_v"));
        for run in 0..runs {
            all.push(Parameter::new(format!("zero_{bridge}_{run}"), owner(), Kind::Other, "V"));
        }
        for (k, component) in COMPONENTS.iter().enumerate() {
            let unit = if k < 3 { "V/N" } else { "V/(N m)" };
            all.push(Parameter::new(format!("g{bridge}_of_{component}"), owner(), Kind::Other, unit));
        }
    }
    all
}

fn channels(sigma: Option<f64>) -> Vec<Channel> {
    let channel = |k: usize| Channel {
        name: format!("g{}_v", k + 1),
        unit: "V".to_owned(),
        sigma,
        offset: None,
        group: 0,
    };
    (0..6).map(channel).collect()
}

impl RowSource for Loadings {
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn timing(&self) -> Timing {
        Timing::Static
    }

    fn samples(&self) -> usize {
        self.loadings.len()
    }

    fn time_ns(&self, _sample: usize) -> u64 {
        0
    }

    fn rows(&self, sample: usize, rows: &mut SampleRows) -> Result<(), Rejection> {
        let Some(loading) = self.loadings.get(sample) else { return Err(Rejection::NotFinite(0)) };
        let (wrench, each, width) = (loading.wrench(), self.runs + 6, self.parameters.len());
        for (bridge, reading) in loading.gauges_v.into_iter().enumerate() {
            if !reading.is_finite() {
                return Err(Rejection::NotFinite(bridge as u8));
            }
            rows.measured[bridge] = reading;
            let row = &mut rows.smoothed[width * bridge + each * bridge..][..each];
            row[self.run_of[sample]] = 1.0;
            row[self.runs..].copy_from_slice(&wrench);
        }
        Ok(())
    }

    fn nominal_sigma(&self) -> Vec<f64> {
        vec![1.0; 6]
    }

    fn nuisances(&self) -> Vec<Nuisance> {
        let of = |(k, error): (usize, &Error)| {
            let (group, unit, key) = match error {
                Error::Mass(_) => ("weights", "1", "mass"),
                Error::Place(..) => ("places", "m", "place"),
                Error::Level(..) => ("level", "rad", "level"),
            };
            Nuisance {
                name: Self::name(error),
                group: group.to_owned(),
                unit: unit.to_owned(),
                sigma: self.sigma(error),
                basis: Basis::Stated(key.to_owned()),
                scope: Scope::Recording,
                effect: Effect::Signal(k),
            }
        };
        self.errors.iter().enumerate().filter(|(_, e)| self.sigma(e) > 0.0).map(of).collect()
    }

    fn with_errors(&self, errors: &[f64]) -> Option<Box<dyn RowSource + '_>> {
        let mut other = self.clone();
        for (error, by) in self.errors.iter().zip(errors).filter(|(_, by)| **by != 0.0) {
            for loading in &mut other.loadings {
                Self::corrected(loading, error, *by);
            }
        }
        Some(Box::new(other))
    }
}

//! Bodies on springs: frames of positions and rates, of which the firmware makes the springs' wrench.

use std::path::Path;

use nalgebra::DMatrix;
use rigident_shared::estimator::frames::TreeFactor;
use rigident_shared::wire::{EstimateReport, LinkReadingMessage, ReadingMessage, Settings};

use super::ReplayOptions;
use crate::application::bare_platform::of_platform;
use crate::application::device::check_asked;
use crate::application::device_error::DeviceError;
use crate::application::{Caller, Error, Loaded};
use rigident_device::accuracy::Accuracy;
use rigident_device::link::TakenFactor;
use rigident_device::session::precision::{self, largest_numbers};
use rigident_device::session::suspended::{beyond_matrix, frames, settings};
use rigident_device::session::{Observer, Take};
use rigident_fit::figures::with_u95;
use rigident_fit::tare::Tare;
use rigident_fit::{
    DeviceFactor, Estimate, Factor, Kind, Measured, Progress, RowSource, Silent, device_estimate,
    plain_factor, plain_noise_gram,
};
use rigident_identify::problem::Subject;
use rigident_rows::tree::ProblemOptions;
use rigident_vibration::suspension::SuspendedSource;

/// The springs' law differs from that of a matrix by more than this many standard deviations of a reading:
/// the device's answer may differ.
const BEYOND_MATRIX_SD: f64 = 0.5;

/// A recording of bodies on springs, made ready.
pub(super) struct OnSprings {
    loaded: Loaded,
    pub(super) frames: Vec<Vec<u8>>,
    pub(super) count: usize,
    /// Brings the device's parameters into the order of the source's.
    pub(super) map: DMatrix<f64>,
    /// The addition of the noise of the poses over the whole recording.
    gram: Option<DMatrix<f64>>,
    /// σ of the free channels, N and N m.
    sigma: Vec<f64>,
}

/// A recording on springs with all that a device needs for it.
pub(super) struct Ready {
    pub(super) of: OnSprings,
    pub(super) settings: Settings,
    pub(super) tare: Option<Tare>,
    pub(super) notes: Vec<String>,
    pub(super) warnings: Vec<String>,
}

impl Ready {
    /// Makes a recording on springs ready.
    pub(super) fn new(path: &Path, options: &ReplayOptions, caller: &Caller<'_>) -> Result<Self, Error> {
        caller.stage(&format!("reading {}", path.display()), 0.0);
        let rig = options.rig.as_deref();
        let loaded = Loaded::read(path, rig, None, &options.tree, &ProblemOptions::default(), caller)?;
        let source = suspended(&loaded).ok_or_else(|| DeviceError::NotOnSprings(path.to_owned()))?;
        let (mut notes, mut warnings) = (Vec::new(), Vec::new());
        let mut tare = options.fixture(None, &mut notes, &mut warnings, caller)?;
        let platform = loaded.problem.rig.suspension.as_ref().map(of_platform).transpose()?.flatten();
        if platform.is_some() {
            if tare.is_some() {
                return Err(DeviceError::PlatformTwice.into());
            }
            tare = platform;
        }
        check_asked(source.parameters(), &options.known, &options.asked)?;
        caller.stage("noise of the channels", 0.0);
        let six = noise(&loaded, source, &mut notes, caller)?;
        let (mut settings, map) = settings(source, six).map_err(DeviceError::from)?;
        settings.stop = options.stop.rule(source.parameters()).map_err(DeviceError::from)?;
        let sigma: Vec<f64> = source.free().iter().map(|k| six[*k]).collect();
        let gram = plain_noise_gram(source, &sigma, caller)?;
        warnings.extend(non_linear(source, &six));
        let frames = frames(source).map_err(DeviceError::from)?;
        let count = frames.len();
        let of = OnSprings { loaded, frames, count, map, gram, sigma };
        Ok(Self { of, settings, tare, notes, warnings })
    }
}

fn suspended(loaded: &Loaded) -> Option<&SuspendedSource> {
    match &loaded.problem.subject {
        Subject::Suspended { source, .. } => Some(&**source),
        _ => None,
    }
}

impl OnSprings {
    /// Returns frames a second.
    pub(super) fn rate_hz(&self) -> f64 {
        suspended(&self.loaded).map_or(1.0, |source| source.input().rate_hz)
    }

    /// Brings the device's factor into the order of the source's parameters, and compares it with the same
    /// rows in double precision.
    pub(super) fn taken(
        self,
        take: &mut Take,
        ends_itself: bool,
        notes: &mut Vec<String>,
        warnings: &mut Vec<String>,
    ) -> Result<Loaded, Error> {
        let is_whole = take.error_free();
        if let (Some(taken), Some(source)) = (&mut take.factor, suspended(&self.loaded)) {
            *taken = TakenFactor { factor: taken.factor.substitute(&self.map), gram: self.gram };
            // Of a run that ended early the rows are others.
            if is_whole && !ends_itself {
                let (note, warning) = beside(source, taken, &self.sigma)?;
                notes.push(note);
                warnings.extend(warning);
            }
        }
        Ok(self.loaded)
    }
}

/// Returns σ of the springs' six channels as their residuals have it, noise of the poses included; one of
/// those that are locked.
fn noise(
    loaded: &Loaded,
    source: &SuspendedSource,
    notes: &mut Vec<String>,
    caller: &Caller<'_>,
) -> Result<[f64; 6], Error> {
    let found = loaded.fit(None, 0, caller)?;
    let gain = found.filter.noise_gain.sqrt();
    let mut own: Vec<f64> = found.channels.iter().map(|c| c.residual_sigma / gain).collect();
    let raised = precision::raise(&mut own, &largest_numbers(source, caller)?);
    let mut six = [1.0; 6];
    source.free().iter().zip(&own).for_each(|(k, sigma)| six[*k] = *sigma);
    let places: Vec<usize> = raised.iter().filter_map(|c| source.free().get(*c).copied()).collect();
    notes.push(format!(
        "the device was given the noise of the springs' wrench, {} N, N m, from the residuals of a batch",
        six.map(|s| format!("{s:.2}")).join(", ")
    ));
    notes.extend(precision::raised_warning(&six, &places));
    Ok(six)
}

/// Returns the warning of springs whose law is not that of their matrix.
fn non_linear(source: &SuspendedSource, sigma: &[f64; 6]) -> Option<String> {
    let off = beyond_matrix(source);
    let share = |k: &usize| off[*k] / sigma[*k];
    let most = source.free().iter().copied().max_by(|a, b| share(a).total_cmp(&share(b)))?;
    (share(&most) > BEYOND_MATRIX_SD).then(|| {
        format!(
            "the device has the springs as a matrix, and the platform turns so far that their wrench \
             differs by up to {:.2} {}, {:.1} times the \
             noise: `identify()` takes the springs as they are",
            off[most],
            if most < 3 { "N" } else { "N m" },
            share(&most)
        )
    })
}

/// Returns the moment of inertia about y of the base, which only a motion tells; else the mass.
fn shown(source: &SuspendedSource) -> Option<usize> {
    let of = |wanted: Kind, end: &str| {
        source.parameters().iter().position(|p| p.kind == wanted && p.name.ends_with(end))
    };
    of(Kind::Inertia, "yy").or_else(|| of(Kind::Mass, ""))
}

/// Returns what a factor says of the parameters.
fn estimate(source: &SuspendedSource, factor: Factor, gram: Option<DMatrix<f64>>) -> Estimate {
    device_estimate(&DeviceFactor { factor, gram }, source.channels().len(), source.rounding())
}

/// Returns how the device's answer compares with that of the same rows in double precision: a note, and a
/// warning if it is off.
fn beside(
    source: &SuspendedSource,
    taken: &TakenFactor,
    sigma: &[f64],
) -> Result<(String, Option<String>), Error> {
    let rows = plain_factor(source, sigma, &Silent)?;
    let there = estimate(source, taken.factor.clone(), taken.gram.clone());
    let here = estimate(source, rows, taken.gram.clone());
    let accuracy = Accuracy::of(&there, &here);
    let name = |j: usize| source.parameters().get(j).map_or("", |p| p.name.as_str());
    let own = shown(source).and_then(|j| Some((j, there.measured(j)?, here.measured(j)?)));
    let own = own.map_or_else(String::new, |(j, there, here)| {
        let words = |own: Measured| with_u95(own.value, own.u95, "");
        format!("; there {} {}, here {}", name(j), words(there), words(here))
    });
    let note = format!(
        "the microcontroller's parameters are those of the same rows in double precision to {:.4} standard \
         deviations ({}){own}",
        accuracy.largest_difference_sd,
        name(accuracy.parameter)
    );
    Ok((note, accuracy.complaint(name(accuracy.parameter))))
}

/// Tells an observer what the device's levels come to.
pub(super) struct Levels<'a> {
    pub(super) of: &'a OnSprings,
    pub(super) observer: &'a mut dyn Observer,
}

impl Observer for Levels<'_> {
    fn reading(&mut self, reading: &ReadingMessage) -> Result<(), String> {
        self.observer.reading(reading)
    }

    fn link_reading(&mut self, reading: &LinkReadingMessage) -> Result<(), String> {
        self.observer.link_reading(reading)
    }

    fn estimate(&mut self, report: &EstimateReport) {
        self.observer.estimate(report);
    }

    fn level(&mut self, factor: &TreeFactor<f64>, frames: u32) {
        let Some(source) = suspended(&self.of.loaded) else { return };
        let factor = Factor::from(factor).substitute(&self.of.map);
        let share = f64::from(frames) / self.of.count.max(1) as f64;
        let gram = self.of.gram.as_ref().map(|gram| gram * share);
        let estimate = estimate(source, factor, gram);
        self.observer.known(shown(source).and_then(|j| {
            let parameter = source.parameters().get(j)?;
            let own = estimate.measured(j)?;
            Some(format!(", {} {}", parameter.name, with_u95(own.value, own.u95, &parameter.unit)))
        }));
    }

    fn progress(&mut self, readings: usize) {
        self.observer.progress(readings);
    }
}

//! `rigident replay` of bodies on springs: frames of positions and rates, of which the firmware makes the springs' wrench.

use std::process::ExitCode;
use std::time::Instant;

use nalgebra::DMatrix;
use rigident_shared::estimator::frames::TreeFactor;
use rigident_shared::wire::{EstimateReport, ReadingMessage};

use super::arguments::{Mcu, Replay};
use super::experiment::{Experiment, Watcher};
use super::link::configured;
use super::links_on_device::check_asked;
use super::options::calibration;
use super::refused::refuse_for_trees;
use super::{Failure, Folder, Stages, simulated};
use rigident::application::Loaded;
use rigident::application::bare_platform::of_platform;
use rigident::device::accuracy::Accuracy;
use rigident::device::link::{Client, TakenFactor};
use rigident::device::session::precision::{self, largest_numbers};
use rigident::device::session::suspended::{beyond_matrix, frames, settings};
use rigident::device::session::{Observer, Session};
use rigident::fit::figures::with_u95;
use rigident::problem::{ProblemOptions, Subject};
use rigident::vibration::suspension::SuspendedSource;
use rigident_fit::{
    DeviceFactor, Estimate, Factor, Kind, Measured, RowSource, Silent, device_estimate, plain_factor,
    plain_noise_gram,
};

/// The springs' law differs from that of a matrix by more than this many standard deviations of a reading:
/// the device's answer may differ.
const BEYOND_MATRIX_SD: f64 = 0.5;

/// Replays a recording on springs.
pub(super) fn run(arguments: &Replay, started: Instant) -> Result<ExitCode, Failure> {
    refuse_for_trees(&[&arguments.forgetting])?;
    calibration::refuse_for_trees(arguments.calibration.calibration.as_deref())?;
    let runner = match arguments.mcu.as_str() {
        "inproc" => Mcu::Inproc,
        "qemu" => Mcu::Qemu,
        port => {
            return Err(Failure::input(format!(
                "--mcu {port}: frames of bodies on springs come over the device's sensor bus, which is simulated here: say inproc or qemu"
            )));
        }
    };
    let known = arguments.known.parse()?;
    let (path, rig_path) = (&arguments.recording, arguments.rig.as_deref());
    let tree = arguments.tree.typed()?;
    let stages = Stages::new(&format!("reading {}", path.display()));
    let loaded = Loaded::read(path, rig_path, None, &tree, &ProblemOptions::default(), &stages.caller())?;
    let Subject::Suspended { source, .. } = &loaded.problem.subject else {
        return Err(Failure::input(format!("{}: no rows on springs come of it", path.display())));
    };
    let (mut notes, mut warnings) = (Vec::new(), Vec::new());
    let mut tare = super::factor::tare(&arguments.tare, rig_path, None, &tree, (&mut notes, &mut warnings))?;
    if let Some(platform) =
        loaded.problem.rig.suspension.as_ref().map(of_platform).transpose().map_err(Failure::input)?.flatten()
    {
        if tare.is_some() {
            return Err(Failure::input(
                "--tare: [suspension.platform] of the rig file is taken off already; leave one of them out",
            ));
        }
        tare = Some(platform);
    }
    check_asked(source.parameters(), &known, &arguments.output)?;
    stages.at("noise of the channels", 0.0);
    let sigma = noise(&loaded, source, &stages, &mut notes)?;
    let (mut told, map) = settings(source, sigma).map_err(Failure::input)?;
    arguments.stop.put_into(&mut told, source.parameters())?;
    let free: Vec<f64> = source.free().iter().map(|k| sigma[*k]).collect();
    let quiet = |stage: &str, share: f64| stages.at(stage, share);
    let gram = plain_noise_gram(&**source, &free, &quiet).map_err(Failure::input)?;
    warnings.extend(non_linear(source, &sigma));
    let sent = frames(source).map_err(Failure::input)?;
    let count = sent.len();
    let rate_hz = source.input().rate_hz;
    drop(stages);
    let (transport, gate) = simulated::frames(runner, sent, rate_hz)?;
    let mut session = Session::open(Client::new(transport)).map_err(Failure::link)?;
    configured(&mut session, &told)?;
    let folder = Folder::new(arguments.output.out.as_deref(), "replay")?;
    let mut live = Live { watcher: Watcher::new(count), map: &map, gram: gram.as_ref(), source, count };
    let mut take = session.follow_frames(&gate, map.nrows(), &mut live).map_err(Failure::link)?;
    live.watcher.finish()?;
    let whole = take.error_free();
    if let Some(taken) = &mut take.factor {
        *taken = TakenFactor { factor: taken.factor.substitute(&map), gram: gram.clone() };
        // Of a run that ended early the rows are others.
        if whole && told.stop.is_none() {
            let (note, warning) = beside(source, taken, &free)?;
            notes.push(note);
            warnings.extend(warning);
        }
    }
    let identity = session.identity().clone();
    Experiment {
        started,
        output: &arguments.output,
        stop: &arguments.stop,
        loaded,
        mcu: simulated::name(runner),
        identity: &identity,
        known: &known,
        tare,
        until: told.stop,
        span: None,
        parameter_truth: None,
        stages: Vec::new(),
        same_pose: None,
        tracking_error: None,
        decisions: Vec::new(),
        came: None,
        notes,
        warnings,
    }
    .conclude(take, &folder)
}

/// Noise of the springs' six channels as their residuals have it, noise of the poses included; one of those that are locked.
fn noise(
    loaded: &Loaded,
    source: &SuspendedSource,
    stages: &Stages,
    notes: &mut Vec<String>,
) -> Result<[f64; 6], Failure> {
    let found = loaded.fit(None, 0, &stages.caller())?;
    let gain = found.filter.noise_gain.sqrt();
    let mut own: Vec<f64> = found.channels.iter().map(|c| c.residual_sigma / gain).collect();
    let largest = largest_numbers(source, &|stage: &str, share| stages.at(stage, share));
    let raised = precision::raise(&mut own, &largest.map_err(Failure::input)?);
    let mut six = [1.0; 6];
    source.free().iter().zip(&own).for_each(|(k, sigma)| six[*k] = *sigma);
    let places: Vec<usize> = raised.iter().filter_map(|c| source.free().get(*c).copied()).collect();
    notes.push(format!(
        "the device was told the noise of the springs' wrench, {} N, N m, from the residuals of a batch",
        six.map(|s| format!("{s:.2}")).join(", ")
    ));
    notes.extend(precision::told(&six, &places));
    Ok(six)
}

/// Returns what is to be said of springs whose law is not that of their matrix.
fn non_linear(source: &SuspendedSource, sigma: &[f64; 6]) -> Option<String> {
    let off = beyond_matrix(source);
    let share = |k: &usize| off[*k] / sigma[*k];
    let most = source.free().iter().copied().max_by(|a, b| share(a).total_cmp(&share(b)))?;
    (share(&most) > BEYOND_MATRIX_SD).then(|| {
        format!(
            "the device has the springs as a matrix, and the platform turns so far that their wrench differs by up to {:.2} {}, {:.1} times the \
             noise: `rigident identify` takes the springs as they are",
            off[most],
            if most < 3 { "N" } else { "N m" },
            share(&most)
        )
    })
}

/// Shows what the device knows, level by level.
struct Live<'a> {
    watcher: Watcher,
    map: &'a DMatrix<f64>,
    /// The addition of the noise of the poses over the whole recording.
    gram: Option<&'a DMatrix<f64>>,
    source: &'a SuspendedSource,
    count: usize,
}

/// The moment of inertia about y of the base, which only a motion tells; else the mass.
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

/// The device's answer beside that of the same rows in double precision: what to note, and what to warn of.
fn beside(
    source: &SuspendedSource,
    taken: &TakenFactor,
    sigma: &[f64],
) -> Result<(String, Option<String>), Failure> {
    let rows = plain_factor(source, sigma, &Silent).map_err(Failure::input)?;
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
        "the microcontroller's parameters are those of the same rows in double precision to {:.4} standard deviations ({}){own}",
        accuracy.largest_difference_sd,
        name(accuracy.parameter)
    );
    Ok((note, accuracy.complaint(name(accuracy.parameter))))
}

impl Observer for Live<'_> {
    fn reading(&mut self, _: &ReadingMessage) -> Result<(), String> {
        Ok(())
    }

    fn estimate(&mut self, report: &EstimateReport) {
        self.watcher.estimate(report);
    }

    fn level(&mut self, factor: &TreeFactor<f64>, frames: u32) {
        let factor = Factor::from(factor).substitute(self.map);
        let share = f64::from(frames) / self.count.max(1) as f64;
        let gram = self.gram.map(|gram| gram * share);
        let estimate = estimate(self.source, factor, gram);
        self.watcher.state = shown(self.source).and_then(|j| {
            let parameter = self.source.parameters().get(j)?;
            let own = estimate.measured(j)?;
            Some(format!(", {} {}", parameter.name, with_u95(own.value, own.u95, &parameter.unit)))
        });
    }

    fn progress(&mut self, readings: usize) {
        self.watcher.progress(readings);
    }
}

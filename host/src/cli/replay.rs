use std::process::ExitCode;
use std::time::Instant;

use rigident_shared::forgetting::MemoryConfig;
use rigident_shared::wire::Source;

use super::arguments::Replay;
use super::experiment::{Experiment, Watcher};
use super::identify_tree::{refuse_without_tree, tree_of};
use super::link::configured;
use super::memory_arguments::{self, RowsOf};
use super::{Failure, Folder, replay_links, simulated};
use crate::answer::assemble::Asked;
use crate::device::link::{Client, SerialTransport, Transport};
use crate::device::session::{DeviceTiming, Session, narrow, settings, widen};
use crate::identification::remembered::{identify_remembered, imu_noise};
use crate::identification::{self, known, prepare::prepare};
use crate::recording::Recording;

/// `rigident replay`
pub(super) fn run(arguments: &Replay) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    super::recorded::refuse_streams(&arguments.recording, arguments.rig.as_deref(), "replay")?;
    let (path, rig) = (&arguments.recording, arguments.rig.as_deref());
    if let Some((model, _)) = tree_of(path, rig, &arguments.tree)? {
        return replay_links::run(arguments, model, started);
    }
    refuse_without_tree(&arguments.tree.changed())?;
    let asked = Asked::parse(&arguments.output.estimate).map_err(Failure::input)?;
    let known = arguments.known.parse()?;
    let mut recording =
        Recording::load(&arguments.recording, arguments.rig.as_deref()).map_err(Failure::input)?;
    recording.leave_out_spikes();
    let mut prepared = prepare(&recording).map_err(Failure::input)?;
    known::check_model(&known, prepared.input.known_offset.is_none()).map_err(Failure::input)?;
    let mut warnings: Vec<String> = recording.warnings.iter().chain(&prepared.notes).cloned().collect();
    let tare = super::factor::tare(&arguments.tare, arguments.rig.as_deref(), &mut warnings)?;
    let span = arguments.remember.span(&RowsOf::input(&prepared.input))?;
    let memory = span.map(|span| MemoryConfig {
        span,
        imu_noise: imu_noise(prepared.rig.imu.first(), &prepared.input.readings),
    });
    let sigma_given = prepared.rig.load_cell.noise_n_nm.is_some();
    if !sigma_given {
        // The device weighs rows by σ from the first one on.
        let sigma = match &memory {
            Some(memory) => identify_remembered(&prepared.input, memory, 1).map(|(found, _)| found),
            None => identification::identify(&prepared.input),
        }
        .map_err(Failure::input)?
        .channel_sigma;
        prepared.rig.load_cell.noise_n_nm = Some(sigma);
        warnings.push(told_noise(&sigma));
    }
    let (mcu, transport) = device(&arguments.mcu)?;
    let mut session = Session::open(Client::new(transport)).map_err(Failure::link)?;
    let rate_hz = prepared.input.rate_hz;
    let timing = DeviceTiming {
        rate_hz,
        is_static: recording.is_static,
        source: Source::Injected,
        host_timeout_ms: 0,
    };
    let mut settings = settings(&prepared.rig, &timing, None, None).map_err(Failure::input)?;
    arguments.course.put_into(&mut settings)?;
    memory_arguments::put_into(&mut settings, memory.as_ref());
    configured(&mut session, &settings)?;
    let folder = Folder::new(arguments.output.out.as_deref(), "replay")?;
    let mut watcher = Watcher::new(prepared.input.readings.len());
    session.go_on_after_stop = arguments.course.go_on;
    let mut take = session.inject(&prepared.input.readings, &mut watcher).map_err(Failure::link)?;
    watcher.finish()?;
    // What the device was given, not what the file holds beyond f32.
    take.readings = take.readings.iter().map(|r| widen(&narrow(r))).collect();
    Experiment {
        followed: None,
        decisions: Vec::new(),
        started,
        asked: &asked,
        rig: &prepared.rig,
        recording: recording.name.clone(),
        mcu,
        rate_hz,
        is_static: recording.is_static,
        gravity_columns: prepared.gravity_columns,
        sigma_given,
        stages: Vec::new(),
        same_pose: None,
        identity: session.identity(),
        known: &known,
        tare,
        memory,
        warnings,
    }
    .conclude(take, &folder, arguments.output.json)
}

/// What is to be said of σ that nobody gave.
pub(super) fn told_noise(sigma: &[f64]) -> String {
    format!(
        "noise_n_nm is not given: the device was told {} N, N m, from the residuals of a batch",
        sigma.iter().map(|s| format!("{s:.3}")).collect::<Vec<_>>().join(", ")
    )
}

/// A device that readings are sent to, and what it is called.
pub(super) fn device(mcu: &str) -> Result<(&'static str, Box<dyn Transport>), Failure> {
    if let Some(simulated) = simulated::named(mcu)? {
        return Ok(simulated);
    }
    Ok(("port", Box::new(SerialTransport::open(mcu).map_err(Failure::link)?)))
}

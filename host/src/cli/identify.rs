use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use rigident_shared::forgetting::MemoryConfig;

use super::arguments::Identify;
use super::memory_arguments::RowsOf;
use super::outcome::{Ending, provenance};
use super::{Failure, Folder};
use crate::answer::assemble::Asked;
use crate::formats::recording::Recording;
use crate::identification::pooled::PooledFactor;
use crate::identification::remembered::{self, identify_remembered, imu_noise};
use crate::identification::{self, known, prepare::prepare};
use crate::streams::{Aligned, StreamSet, align, widen::widen};

/// Points of a convergence plot.
pub(super) const PLOT_POINTS: usize = 200;

/// `rigident identify`
pub(super) fn run(arguments: &Identify) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    let asked = Asked::parse(&arguments.output.estimate).map_err(Failure::input)?;
    let known = arguments.known.parse()?;
    let streams = streams(&arguments.recording, arguments.rig.as_deref())?;
    let (recording, prepared) = match &streams {
        Some((_, aligned)) => (aligned.recording.clone(), aligned.prepared.clone()),
        None => {
            let recording =
                Recording::load(&arguments.recording, arguments.rig.as_deref()).map_err(Failure::input)?;
            let prepared = prepare(&recording).map_err(Failure::input)?;
            (recording, prepared)
        }
    };
    known::check_model(&known, prepared.input.known_offset.is_none()).map_err(Failure::input)?;
    let mut warnings: Vec<String> = recording.warnings.iter().chain(&prepared.notes).cloned().collect();
    warnings.extend(streams.iter().flat_map(|(_, aligned)| aligned.warnings.iter().cloned()));
    let tare = super::factor::tare(&arguments.tare, arguments.rig.as_deref(), &mut warnings)?;
    let input = &prepared.input;
    let span = arguments.remember.span(&RowsOf::input(input))?;
    if span.is_some() && streams.is_some() {
        return Err(Failure::input(
            "--forget and --window: not of several files with clocks of their own, as the uncertainty of their skews is \
             that of a whole run; give one recording",
        ));
    }
    let memory = span
        .map(|span| MemoryConfig { span, imu_noise: imu_noise(prepared.rig.imu.first(), &input.readings) });
    let (mut identification, mut progression) = match &memory {
        Some(memory) => identify_remembered(input, memory, PLOT_POINTS).map_err(Failure::input)?,
        None => {
            let mut identification = identification::identify(input).map_err(Failure::input)?;
            if let Some((set, aligned)) = &streams {
                widen(set, aligned, &mut identification).map_err(Failure::input)?;
            }
            let progression = identification::progression(input, identification.channel_sigma, PLOT_POINTS);
            (identification, progression)
        }
    };
    let factor = PooledFactor::of(&identification, &prepared.input, &recording.name);
    if let Some(tare) = tare {
        tare.take_off(&factor, &mut identification, &mut progression).map_err(Failure::input)?;
    }
    identification.estimate = identification.estimate.with_known(&known).map_err(Failure::input)?;
    let folder = Folder::new(arguments.output.out.as_deref(), "identify")?;
    Ending {
        followed: None,
        started,
        asked: &asked,
        rig: &prepared.rig,
        recording: recording.name.clone(),
        mcu: "host",
        input: &prepared.input,
        identification: &identification,
        factor,
        gravity_columns: prepared.gravity_columns,
        progression,
        memory: memory.map(|memory| remembered::result(input, &memory, &identification.factor)),
        stages: Vec::new(),
        drift: None,
        time_base: streams.map(|(_, aligned)| aligned.time_base),
        provenance: provenance(&prepared.rig),
        warnings,
        broken: None,
    }
    .conclude(&folder, arguments.output.json)
}

/// Several files on one time base, if it is a rig file that is given, or their folder with one.
fn streams(recording: &Path, rig: Option<&Path>) -> Result<Option<(StreamSet, Aligned)>, Failure> {
    let is_rig = recording.to_string_lossy().ends_with(".rig.toml");
    let set = match rig {
        None if is_rig => StreamSet::load(recording, None),
        Some(rig) if recording.is_dir() => StreamSet::load(rig, Some(recording)),
        None if recording.is_dir() => {
            return Err(Failure::input(format!(
                "{} is a folder: give the rig file that lists its [[stream]] files by --rig",
                recording.display()
            )));
        }
        _ => return Ok(None),
    };
    let set = set.map_err(Failure::input)?;
    let aligned = align(&set).map_err(Failure::input)?;
    Ok(Some((set, aligned)))
}

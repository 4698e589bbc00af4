use std::process::ExitCode;
use std::time::Instant;

use rigident_shared::forgetting::MemoryConfig;

use super::arguments::Identify;
use super::memory_arguments::RowsOf;
use super::outcome::{Ending, provenance};
use super::recorded::Recorded;
use super::{Failure, Folder, Stages, identify_tree};
use crate::answer::assemble::Asked;
use crate::identification::remembered::{self, identify_remembered, imu_noise};
use crate::identification::{self, known};

/// Points of a convergence plot.
pub(super) const PLOT_POINTS: usize = 200;

/// `rigident identify`
pub(super) fn run(arguments: &Identify) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    if let Some(ended) = identify_tree::run(arguments, started)? {
        return Ok(ended);
    }
    let asked = Asked::parse(&arguments.output.estimate).map_err(Failure::input)?;
    let known = arguments.known.parse()?;
    let stages = Stages::new(&format!("reading {}", arguments.recording.display()));
    let recorded = Recorded::load(&arguments.recording, arguments.rig.as_deref())?;
    let (recording, prepared) = (&recorded.recording, &recorded.prepared);
    known::check_model(&known, prepared.input.known_offset.is_none()).map_err(Failure::input)?;
    let mut warnings = recorded.warnings();
    let tare = super::factor::tare(&arguments.tare, arguments.rig.as_deref(), &mut warnings)?;
    let input = &prepared.input;
    let span = arguments.remember.span(&RowsOf::input(input))?;
    if span.is_some() && recorded.is_of_streams() {
        return Err(Failure::input(
            "--forget and --window: not of several files with clocks of their own, as the uncertainty of their skews is \
             that of a whole run; give one recording",
        ));
    }
    let memory = span
        .map(|span| MemoryConfig { span, imu_noise: imu_noise(prepared.rig.imu.first(), &input.readings) });
    stages.at(&format!("identifying from {} readings", input.readings.len()), 0.0);
    let (mut identification, mut progression) = match &memory {
        Some(memory) => identify_remembered(input, memory, PLOT_POINTS).map_err(Failure::input)?,
        None => {
            let identification = recorded.identify()?;
            let progression = identification::progression(input, &identification, PLOT_POINTS);
            (identification, progression)
        }
    };
    let factor = recorded.factor(&identification);
    if let Some(tare) = tare {
        tare.take_off(&factor, &mut identification, &mut progression).map_err(Failure::input)?;
    }
    identification.estimate = identification.estimate.with_known(&known).map_err(Failure::input)?;
    // The rest writes.
    drop(stages);
    let folder = Folder::new(arguments.output.out.as_deref(), "identify")?;
    Ending {
        followed: None,
        decisions: Vec::new(),
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
        time_base: recorded.time_base(),
        provenance: provenance(&prepared.rig),
        warnings,
        broken: None,
    }
    .conclude(&folder, arguments.output.json)
}

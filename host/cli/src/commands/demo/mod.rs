//! `rigident demo`: one body or two links on the simulated platform, or a person from frames.

#[cfg(feature = "simulator")]
pub(crate) mod explain;

use std::process::ExitCode;
use std::time::Instant;

use hexapod::{BodySet, Geometry, MotionProgram, Segment};
use rigident_shared::forgetting::{MemoryConfig, Span};
use rigident_shared::wire::{Settings, Source};
use rigident_sim::rig::{Rig, RigConfig, SharedRig};
use rigident_sim::runner::frames_of;
use rigident_sim::sensors::SensorModels;

use crate::commands::demo_arguments::{Demo, Demonstrated};
use crate::commands::run::at_terminal::AtTerminal;
use crate::commands::run::refused::refuse_for_trees;
use crate::device::experiment::{Watcher, conclude};
use crate::device::link::{configured, device_settings};
use crate::device::report::Outlet;
use crate::options::forgetting::RowsOf;
use crate::options::load::LoadOptions;
use crate::options::microcontroller::Mcu;
use crate::screen::outcome::say;
use crate::{Failure, Folder, Stages};
use rigident::application::device::check_asked;
use rigident::application::driving::{self, Directing, at_rest, guard, weigh};
use rigident::application::report::provenance;
use rigident::application::{DeviceError, Experiment, Loaded, Replay, ReplayOptions};
use rigident::device::microcontroller::{self, Image, Microcontroller};
use rigident::device::platform::{LocalPlatform, Platform as _};
use rigident::device::session::tree::{device_parameters, device_tree};
use rigident::device::session::{DeviceTiming, Session, Take, frames, state_memory, two_links};
use rigident::device::words::device_notes;
use rigident::laboratory::{person, rig_file, two_link_file};
use rigident::present::Stage;
use rigident::rows::body::imu_noise::imu_noise;
use rigident::rows::named_model::rig_links::from_tables;
use rigident_fit::Parameter;
use rigident_fit::prior::KnownValues;
use rigident_io::recording::new_file::{write_new, write_new_text};
use rigident_io::recording::{comment_in_words, rig_path};
use rigident_io::rig::{
    ImuClass, ImuTable, LoadCellClass, LoadCellTable, OffsetTable, OffsetWord, RecordingTable, RigFile,
};
use rigident_model::Model;
use rigident_model::human::Person;

/// Rate of the demonstration, 1/s.
pub(crate) const RATE_HZ: f64 = 1000.0;
/// σ that the converter's quantisation represents when the noise is switched off, N and N m.
const QUIET: [f64; 6] = [1e-3, 1e-3, 2e-3, 1e-4, 1e-4, 1e-4];
/// The mass and size that the owner of the simulated rig says that bodies may be: the largest that fit on the
/// thesis' plate.
const BOUND: [f64; 2] = [40.0, 0.5];
/// The time for which the body is weighed, s.
const WEIGHED_S: f64 = 0.5;
/// Frames of a person at the given rate.
const FRAMES_HZ: f64 = 100.0;
/// Of the force plates below the person: 1 σ per frame, N and N m.
const PLATES: [f64; 6] = [0.5, 0.5, 1.0, 0.1, 0.1, 0.1];
/// Shorter motions of a person tell little; longer ones nothing new. s
const FRAMES_S: std::ops::RangeInclusive<f64> = 2.0..=3600.0;

/// Nothing is asked: nothing moves but in the simulation.
const TERMINAL: AtTerminal = AtTerminal { yes: true, dry_run: false };

/// Runs `rigident demo`.
pub(crate) fn run(arguments: &Demo) -> Result<ExitCode, Failure> {
    if matches!(arguments.body, Demonstrated::TwoLinks | Demonstrated::Human34) {
        if arguments.own.is_given() || arguments.explain {
            return Err(Failure::input("--mass, --noise and --explain: of one body, not of several links"));
        }
        refuse_for_trees(&[&arguments.forgetting, &arguments.adaptive])?;
    }
    match arguments.body {
        Demonstrated::Human34 => person(arguments),
        _ => on_platform(arguments),
    }
}

/// Returns the settings of the firmware's simulated sensors, which has no host to wait for.
pub(crate) fn simulated_sensors() -> DeviceTiming {
    DeviceTiming { rate_hz: RATE_HZ, is_static: false, source: Source::Sensors, host_timeout_ms: 0 }
}

/// Opens the firmware in lock-step with a rig.
pub(crate) fn device(mcu: Mcu, rig: &SharedRig) -> Result<Session, Failure> {
    let line = Microcontroller::from(mcu).on_rig(Image::Standard, rig).map_err(DeviceError::from)?;
    microcontroller::session(line).map_err(|e| Failure::link(e).context("the simulated device"))
}

/// Returns the rig of the arguments, and the name of the body that it carries.
fn config(arguments: &Demo) -> Result<(RigConfig, String), Failure> {
    let (config, name) = match arguments.body {
        Demonstrated::Vertical => (RigConfig::thesis_vertical(), "test body with plates, vertical"),
        Demonstrated::TwoLinks => (RigConfig::two_links(), ""),
        _ => (RigConfig::thesis_horizontal(), "test body with plates, horizontal"),
    };
    let mut config = config.with_seed(arguments.seed).with_rates(RATE_HZ, RATE_HZ);
    if arguments.ideal {
        let range = config.sensors.imu.gyro_range_radps;
        config = config.with_sensors(SensorModels::ideal());
        if arguments.body == Demonstrated::TwoLinks {
            config.sensors.imu.gyro_range_radps = range;
        }
    }
    let (config, own_name) = arguments.own.put_into(config, BOUND)?;
    Ok((config, own_name.unwrap_or_else(|| name.to_owned())))
}

/// Two links on a platform.
struct Links {
    model: Model,
    estimated: Vec<Parameter>,
    truth: Vec<f64>,
}

impl Links {
    /// Returns those of a rig, if it has two, and its rig file.
    fn of(rig: &Rig, body_name: &str) -> Result<(Option<Self>, RigFile), Failure> {
        let Some(second) = rig.config().second else { return Ok((None, rig_file(rig, body_name))) };
        let file = two_link_file(rig, &second);
        let truth = rig.truth();
        let truth =
            second.base_parameters(&truth.body).into_iter().chain(truth.apparent_offset_n_nm).collect();
        let model = from_tables(&file.link, "two links").map_err(Failure::input)?;
        let (_, parameters) = device_tree(&model).map_err(Failure::input)?;
        let estimated = device_parameters(&model, &parameters, true);
        Ok((Some(Self { model, estimated, truth }), file))
    }
}

/// The simulated rig, and what is known of what it carries.
struct Carried {
    config: RigConfig,
    rig: Rig,
    links: Option<Links>,
    file: RigFile,
    /// The estimated parameters.
    parameters: Vec<Parameter>,
}

impl Carried {
    /// Returns those of the arguments.
    fn of(arguments: &Demo, known: &KnownValues) -> Result<Self, Failure> {
        let (config, body_name) = config(arguments)?;
        arguments.adaptive.check()?;
        let rig = Rig::new(config.clone()).map_err(Failure::input)?;
        let (links, mut file) = Links::of(&rig, &body_name)?;
        if arguments.ideal {
            file.load_cell.noise_n_nm = Some(QUIET);
            if links.is_some() {
                // Words without noise repeat themselves.
                file.recording.frozen_after = 0;
            }
        }
        let parameters = match &links {
            Some(Links { estimated, .. }) => {
                check_asked(estimated, known, &arguments.output.estimate)?;
                estimated.clone()
            }
            None => {
                let nothing = Loaded::of_readings("demo", &file, Vec::new(), Some(RATE_HZ), false);
                nothing.source().parameters().to_vec()
            }
        };
        Ok(Self { config, rig, links, file, parameters })
    }
}

/// The motion of the platform: a program, or what is decided from segment to segment.
struct Motion<'a> {
    directing: Option<Directing<'a>>,
    fixed: Option<MotionProgram>,
    stages: Vec<Stage>,
    same_pose: Option<[(f64, f64); 2]>,
}

impl<'a> Motion<'a> {
    /// Returns the motion of the arguments, and loads its program; a program has stages for one body only.
    fn of(
        arguments: &Demo,
        directing: Option<Directing<'a>>,
        geometry: &Geometry,
        is_of_one_body: bool,
        platform: &mut LocalPlatform,
    ) -> Result<Self, Failure> {
        let mut motion = Self { directing, fixed: None, stages: Vec::new(), same_pose: None };
        if motion.directing.is_none() {
            let program = arguments.programme.program(geometry)?;
            if is_of_one_body {
                (motion.stages, motion.same_pose) = driving::stages(&program);
            }
            platform.load(&program).map_err(Failure::link)?;
            motion.fixed = Some(program);
        }
        Ok(motion)
    }

    /// Moves the platform, and returns what the device sent meanwhile.
    fn follow(
        &mut self,
        session: &mut Session,
        platform: &mut LocalPlatform,
        watcher: &mut Watcher,
    ) -> Result<Take, Failure> {
        match (&mut self.directing, &self.fixed) {
            (Some(directing), _) => session.follow_decided_unchecked(platform, directing, watcher),
            (None, Some(program)) => session.follow_unchecked(platform, program, watcher),
            (None, None) => return Err(Failure::input("there is no motion program")),
        }
        .map_err(Failure::link)
    }
}

/// Configures the device; returns its settings, and how older rows are forgotten.
fn set_up(
    arguments: &Demo,
    session: &mut Session,
    file: &RigFile,
    parameters: &[Parameter],
) -> Result<(Settings, Option<Span<f64>>), Failure> {
    let span = arguments.forgetting.span(&RowsOf::moving(RATE_HZ))?;
    let memory = span.map(|span| MemoryConfig { span, imu_noise: imu_noise(file.imu.first(), &[]) });
    let mut settings = device_settings(file, &simulated_sensors(), None)?;
    arguments.stop.put_into(&mut settings, parameters)?;
    state_memory(&mut settings, memory.as_ref());
    configured(session, &settings)?;
    Ok((settings, span))
}

/// Takes the readings of a run out of what the device sent.
fn loaded(take: &mut Take, file: &RigFile, links: Option<&Links>) -> Result<Loaded, Failure> {
    match links {
        Some(links) => {
            let read = two_links::recording("demo", file, RATE_HZ, &take.links);
            Ok(Loaded::of_links(&read, &links.model)?)
        }
        None => {
            let readings = std::mem::take(&mut take.readings);
            Ok(Loaded::of_readings("demo", file, readings, Some(RATE_HZ), false))
        }
    }
}

/// Runs `rigident demo` of a body or links that a platform carries.
fn on_platform(arguments: &Demo) -> Result<ExitCode, Failure> {
    let outlet = Outlet { started: Instant::now(), output: &arguments.output };
    let known = arguments.known.parse()?;
    let Carried { config, rig, links, mut file, parameters } = Carried::of(arguments, &known)?;
    let (geometry, is_adaptive) = (config.geometry.clone(), arguments.adaptive.adaptive);
    let rig = rig.shared();
    let mut session = device(arguments.mcu, &rig)?;
    let (settings, span) = set_up(arguments, &mut session, &file, &parameters)?;
    let mut platform = LocalPlatform(rig);
    let body = if is_adaptive { weighed(arguments, &config, &settings, &mut file)? } else { None };
    let own = (&file, &geometry);
    let new = || Directing::new(&arguments.adaptive.typed(), own, &settings, body, &TERMINAL);
    let directing = is_adaptive.then(new).transpose()?;
    let mut motion = Motion::of(arguments, directing, &geometry, links.is_none(), &mut platform)?;

    let folder = Folder::new(arguments.output.out.as_deref(), "demo")?;
    let mut comments = device_notes(session.identity());
    comments.extend(provenance(&file));
    let expected = (motion.fixed.as_ref().map_or(0.0, MotionProgram::duration_s) * RATE_HZ) as usize;
    let mut watcher = Watcher::recording(folder.file("demo.mcap"), &file, &comments, expected)?;
    session.at_most_s = arguments.adaptive.at_most_s;
    guard(&mut session, &file, arguments.adaptive.axes())?;
    if motion.fixed.as_ref().is_some_and(|program| program.start != geometry.home()) {
        // The rig puts a way to the start before it: its times are not the program's.
        session.motion_guard = None;
    }
    let mut take = motion.follow(&mut session, &mut platform, &mut watcher)?;
    watcher.end(&mut take);
    let loaded = loaded(&mut take, &file, links.as_ref())?;
    if arguments.explain {
        let fit = loaded.fit(None, 0, &Stages::silent().caller())?;
        say(explain::text(&loaded, &fit)?);
    }
    let mut experiment = Experiment {
        asked: arguments.stop.asked(&arguments.output.estimate),
        // With --adaptive it is the planner that says.
        until: settings.stop.filter(|_| !is_adaptive),
        span,
        parameter_truth: links.map(|links| links.truth),
        stages: motion.stages,
        same_pose: motion.same_pose,
        ..Experiment::new(loaded, Microcontroller::from(arguments.mcu).name(), session.identity(), &known)
    };
    if let Some(directing) = motion.directing {
        let concluded = directing.concluded();
        (experiment.stages, experiment.decisions) = (concluded.stages, concluded.decisions);
        (experiment.warnings, experiment.course) = (concluded.warnings, Some(concluded.came));
    }
    conclude(experiment, take, outlet, &folder)
}

/// Weighs the body at rest, in a run of its own: in lock-step time passes only while a program runs.
fn weighed(
    arguments: &Demo,
    config: &RigConfig,
    settings: &Settings,
    file: &mut RigFile,
) -> Result<Option<BodySet>, Failure> {
    LoadOptions { load_max_kg: Some(BOUND[0]), load_within_m: Some(BOUND[1]) }.put_into(file)?;
    let rig = Rig::new(config.clone()).map_err(Failure::input)?.shared();
    let mut session = device(arguments.mcu, &rig)?;
    configured(&mut session, settings)?;
    let mut platform = LocalPlatform(rig);
    let rest = MotionProgram {
        start: config.geometry.home(),
        segments: vec![Segment::Hold { duration_s: WEIGHED_S }],
    };
    platform.load(&rest).map_err(Failure::link)?;
    let take = session.follow_unchecked(&mut platform, &rest, &mut Watcher::new(0)).map_err(Failure::link)?;
    let rest = at_rest(&take.readings, file.imu.first())?;
    Ok(weigh(&rest, file, &TERMINAL)?)
}

/// Runs `rigident demo --body human34`.
fn person(arguments: &Demo) -> Result<ExitCode, Failure> {
    let outlet = Outlet { started: Instant::now(), output: &arguments.output };
    let options = ReplayOptions {
        mcu: arguments.mcu.into(),
        stop: arguments.stop.typed(),
        known: arguments.known.parse()?,
        asked: arguments.output.estimate.clone(),
        ..ReplayOptions::default()
    };
    refuse_for_trees(&[&arguments.programme])?;
    let seconds = arguments.programme.duration_s;
    if !FRAMES_S.contains(&seconds) {
        return Err(Failure::input(format!(
            "--duration-s {seconds}: a person moves for {} to {} s",
            FRAMES_S.start(),
            FRAMES_S.end()
        )));
    }
    let model = Person::default().human34().map_err(Failure::input)?;
    let (_, parameters) = device_tree(&model).map_err(Failure::input)?;
    // Not the person that the tables guess.
    let somebody = person::somebody(&model, arguments.seed);
    let value =
        |terms: &[(usize, f64)]| terms.iter().map(|(column, weight)| weight * somebody[*column]).sum();
    let truth: Vec<f64> = parameters.iter().map(|p| value(&p.terms)).collect();
    let tree = person::tree(&model, &somebody);
    let (noise, sigma) = if arguments.ideal { ([0.0; 6], QUIET) } else { (PLATES, PLATES) };
    let sent = frames_of(&tree, (seconds * FRAMES_HZ) as usize, FRAMES_HZ, noise, arguments.seed);
    let file = RigFile {
        recording: RecordingTable { rate_hz: Some(FRAMES_HZ), ..RecordingTable::default() },
        load_cell: LoadCellTable {
            noise_n_nm: Some(sigma),
            offset_n_nm: OffsetTable::Word(OffsetWord::Zero),
            class: Some(LoadCellClass::Exact),
            ..LoadCellTable::default()
        },
        // Frames tell of the links' own origins and axes.
        imu: (0..model.links.len())
            .map(|link| ImuTable { link, class: Some(ImuClass::Exact), ..ImuTable::default() })
            .collect(),
        ..RigFile::default()
    };
    let mut recording = frames::recording("demo", &file, FRAMES_HZ, model.links.len(), &sent);
    let connected = Replay::of_frames(sent, recording.clone(), &file, model, &options)?.connect()?;
    let folder = Folder::new(arguments.output.out.as_deref(), "demo")?;
    let comments = device_notes(connected.identity());
    recording.comments = comments.iter().map(|(what, said)| comment_in_words(what, said)).collect();
    let path = folder.file("demo.csv");
    write_new(&path, |to| recording.write_csv(to)).map_err(Failure::input)?;
    write_new_text(&rig_path(&path), &file.to_toml()).map_err(Failure::input)?;
    let mut watcher = Watcher::new(connected.count());
    let (mut experiment, take) = connected.run(&mut watcher)?;
    watcher.finish()?;
    experiment.parameter_truth = Some(truth);
    conclude(experiment, take, outlet, &folder)
}

use std::process::ExitCode;
use std::time::Instant;

use hexapod::{BodySet, MotionProgram, Segment};
use rigident_shared::forgetting::MemoryConfig;
use rigident_shared::wire::{Settings, Source};
use rigident_sim::rig::{Rig, RigConfig};
use rigident_sim::sensors::SensorModels;

use super::arguments::{Demo, DemoBody, Demonstrated};
use super::experiment::{Experiment, Watcher, device_notes};
use super::link::configured;
use super::options::forgetting::{self, RowsOf};
use super::options::load::LoadOptions;
use super::outcome::say;
use super::{Failure, Folder, Stages, demo_links, explain, guards, programme, simulated, zeroing};
use rigident::application::Loaded;
use rigident::application::report::provenance;
use rigident::device::link::Client;
use rigident::device::platform::{LocalPlatform, Platform as _};
use rigident::device::session::{DeviceTiming, Session, settings};
use rigident::rows::body::imu_noise::imu_noise;
use rigident_io::rig::RigFile;

/// Rate of the demonstration, 1/s.
pub(super) const RATE_HZ: f64 = 1000.0;
/// σ that the converter's quantisation represents when the noise is switched off, N and N m.
pub(super) const QUIET: [f64; 6] = [1e-3, 1e-3, 2e-3, 1e-4, 1e-4, 1e-4];

/// `rigident demo`
pub(super) fn run(arguments: &Demo) -> Result<ExitCode, Failure> {
    match arguments.body {
        Demonstrated::Horizontal => one_body(arguments, DemoBody::Horizontal),
        Demonstrated::Vertical => one_body(arguments, DemoBody::Vertical),
        Demonstrated::TwoLinks | Demonstrated::Human34 if arguments.own.is_given() || arguments.explain => {
            Err(Failure::input("--mass, --noise and --explain: of one body, not of several links"))
        }
        Demonstrated::TwoLinks => demo_links::two_links(arguments),
        Demonstrated::Human34 => demo_links::human34(arguments),
    }
}

fn one_body(arguments: &Demo, body: DemoBody) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    let known = arguments.known.parse()?;
    let (config, body_name) = match body {
        DemoBody::Horizontal => (RigConfig::thesis_horizontal(), "test body with plates, horizontal"),
        DemoBody::Vertical => (RigConfig::thesis_vertical(), "test body with plates, vertical"),
    };
    let mut config = config.with_seed(arguments.seed).with_rates(RATE_HZ, RATE_HZ);
    if arguments.ideal {
        config = config.with_sensors(SensorModels::ideal());
    }
    let (config, own_name) = arguments.own.put_into(config, BOUND)?;
    let body_name = own_name.as_deref().unwrap_or(body_name);
    let geometry = config.geometry.clone();
    arguments.adaptive.check()?;
    let rig = Rig::new(config.clone()).map_err(Failure::input)?;
    let mut file = simulated::rig_file(&rig, body_name);
    if arguments.ideal {
        file.load_cell.noise_n_nm = Some(QUIET);
    }
    let rig = rig.shared();

    let mcu = simulated::name(arguments.mcu);
    let mut session = Session::open(Client::new(simulated::transport(arguments.mcu, &rig)?))
        .map_err(|e| Failure::link(e).context("the simulated device"))?;
    let timing =
        DeviceTiming { rate_hz: RATE_HZ, is_static: false, source: Source::Sensors, host_timeout_ms: 0 };
    let span = arguments.forgetting.span(&RowsOf::moving(RATE_HZ))?;
    let memory = span.map(|span| MemoryConfig { span, imu_noise: imu_noise(file.imu.first(), &[]) });
    let mut settings = settings(&file, &timing, None, None).map_err(Failure::input)?;
    let nothing = Loaded::of_readings("demo", &file, Vec::new(), Some(RATE_HZ), false);
    arguments.stop.put_into(&mut settings, nothing.source().parameters())?;
    forgetting::put_into(&mut settings, memory.as_ref());
    configured(&mut session, &settings)?;
    let mut platform = LocalPlatform(rig);
    let body =
        if arguments.adaptive.adaptive { weighed(arguments, &config, &settings, &mut file)? } else { None };
    let mut directing = arguments.adaptive.directing(&file, &geometry, &settings, body)?;
    let (mut stages, mut same_pose, mut fixed) = (Vec::new(), None, None);
    if directing.is_none() {
        let program = arguments.programme.program(&geometry)?;
        (stages, same_pose) = programme::stages(&program);
        platform.load(&program).map_err(Failure::link)?;
        fixed = Some(program);
    }

    let folder = Folder::new(arguments.output.out.as_deref(), "demo")?;
    let mut comments = device_notes(session.identity());
    comments.extend(provenance(&file));
    let expected = (fixed.as_ref().map_or(0.0, MotionProgram::duration_s) * RATE_HZ) as usize;
    let mut watcher = Watcher::recording(folder.file("demo.mcap"), &file, &comments, expected)?;
    session.at_most_s = arguments.adaptive.at_most_s;
    guards::watch(&mut session, &file, arguments.adaptive.axes())?;
    if fixed.as_ref().is_some_and(|program| program.start != geometry.home()) {
        // The rig puts a way to the start before it: its times are not the program's.
        session.motion_guard = None;
    }
    let mut take = match (&mut directing, &fixed) {
        (Some(directing), _) => session.follow_decided(&mut platform, directing, &mut watcher),
        (None, Some(program)) => session.follow(&mut platform, program, &mut watcher),
        (None, None) => return Err(Failure::input("there is no motion program")),
    }
    .map_err(Failure::link)?;
    watcher.end(&mut take);
    let (mut decisions, mut warnings, mut came) = (Vec::new(), Vec::new(), None);
    if let Some(directing) = directing {
        let concluded = directing.concluded();
        (stages, decisions, warnings) = (concluded.stages, concluded.decisions, concluded.warnings);
        came = Some(concluded.came);
    }
    let loaded = Loaded::of_readings("demo", &file, std::mem::take(&mut take.readings), Some(RATE_HZ), false);
    if arguments.explain {
        let fit = loaded.fit(None, 0, &Stages::silent().caller())?;
        say(explain::text(&loaded, &fit)?);
    }
    Experiment {
        started,
        output: &arguments.output,
        stop: &arguments.stop,
        loaded,
        mcu,
        identity: session.identity(),
        known: &known,
        tare: None,
        // With --adaptive it is the planner that says.
        until: settings.stop.filter(|_| !arguments.adaptive.adaptive),
        span,
        parameter_truth: None,
        stages,
        same_pose,
        tracking_error: None,
        decisions,
        came,
        notes: Vec::new(),
        warnings,
    }
    .conclude(take, &folder)
}

/// The mass and size that the owner of the simulated rig says that bodies may be: the largest that fit on the
/// thesis' plate.
const BOUND: [f64; 2] = [40.0, 0.5];
/// The time for which the body is weighed, s.
const WEIGHED_S: f64 = 0.5;

/// Weighs the body at rest, in a run of its own: in lock-step time passes only while a program runs.
fn weighed(
    arguments: &Demo,
    config: &RigConfig,
    settings: &Settings,
    file: &mut RigFile,
) -> Result<Option<BodySet>, Failure> {
    LoadOptions { load_max_kg: Some(BOUND[0]), load_within_m: Some(BOUND[1]) }.put_into(file)?;
    let rig = Rig::new(config.clone()).map_err(Failure::input)?.shared();
    let mut session = Session::open(Client::new(simulated::transport(arguments.mcu, &rig)?))
        .map_err(|e| Failure::link(e).context("the simulated device"))?;
    configured(&mut session, settings)?;
    let mut platform = LocalPlatform(rig);
    let rest = MotionProgram {
        start: config.geometry.home(),
        segments: vec![Segment::Hold { duration_s: WEIGHED_S }],
    };
    platform.load(&rest).map_err(Failure::link)?;
    let take = session.follow(&mut platform, &rest, &mut Watcher::new(0)).map_err(Failure::link)?;
    zeroing::weigh(&zeroing::at_rest(&take.readings, file.imu.first())?, file)
}

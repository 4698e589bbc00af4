use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use rigident_shared::calibration::Reading;
use rigident_shared::forgetting::{ImuNoise, MemoryConfig};
use rigident_shared::wire::Source;
use rigident_sim::platform::MotionProgram;

use super::adaptive::Directing;
use super::arguments::Run;
use super::confirm::confirm;
use super::experiment::{Experiment, Watcher, device_notes};
use super::followed::{Followed, MotionLog};
use super::link::{HOST_TIMEOUT_MS, open};
use super::memory_arguments::{self, RowsOf};
use super::outcome::provenance;
use super::{Failure, Folder, simulated};
use crate::answer::assemble::Asked;
use crate::formats::rig::{Calibrated, ImuTable, OffsetTable, OffsetWord, RigFile};
use crate::identification::known::check_model;
use crate::identification::prepare::mounting;
use crate::identification::remembered::imu_noise;
use crate::planning::machine;
use crate::platform::{self, Platform, PlatformError, check};
use crate::session::{DeviceTiming, INTERRUPTED, Session, settings};

/// Length of one look at the sensors at rest, s.
const WINDOW_S: f64 = 2.0;

/// `rigident run`
pub(super) fn run(arguments: &Run) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    let asked = Asked::parse(&arguments.output.estimate).map_err(Failure::input)?;
    let known = arguments.known.parse()?;
    let mut rig = RigFile::load(&arguments.rig).map_err(Failure::input)?;
    let offset_estimated = matches!(rig.load_cell.offset_n_nm, OffsetTable::Word(OffsetWord::Estimate));
    check_model(&known, offset_estimated).map_err(Failure::input)?;
    let rate_hz = rig.recording.rate_hz.unwrap_or(1000.0);
    let geometry = machine::geometry_or_thesis(&rig).map_err(Failure::input)?;
    let fixed =
        if arguments.adaptive.adaptive { None } else { Some(arguments.programme.program(&geometry)?) };
    arguments.adaptive.check()?;
    let mut platform = platform::connect(&arguments.platform, &geometry).map_err(unmoved)?;
    let mut session = open(&arguments.port)?;
    let timing =
        DeviceTiming { rate_hz, is_static: false, source: Source::Sensors, host_timeout_ms: HOST_TIMEOUT_MS };
    // Any noise does while nothing is absorbed.
    let mut standing = settings(&rig, &timing, Some([1.0; 6]), None).map_err(Failure::input)?;
    // What cannot be asked for is said before anything moves.
    arguments.course.put_into(&mut standing)?;
    let span = arguments.remember.span(&RowsOf::rig(&rig, rate_hz))?;
    session.configure(&standing).map_err(Failure::link)?;
    // Until the noise is known, to see whether anything can be done at all.
    let directing = arguments.adaptive.directing(&rig, &geometry, &standing)?;
    let everything = fixed.clone().or_else(|| directing.as_ref().map(Directing::everything));
    let summary = everything.as_ref().map(|program| check::check(program, &geometry)).transpose();
    let mut summary = summary.map_err(Failure::input)?.unwrap_or_default();
    if let Some(directing) = &directing {
        summary.duration_s = directing.at_most_s();
    }
    if let Some(program) = &fixed {
        platform.load(program).map_err(unmoved)?;
    }
    confirm(&summary, &arguments.platform, arguments.yes)?;

    let mut warnings = Vec::new();
    warm_up(&mut session, &rig, arguments.warm_up_s, &mut warnings)?;
    let rest = zero(&mut session, &mut rig, &mut warnings)?;
    let mut settings = settings(&rig, &timing, Some(rest.sigma), None).map_err(Failure::input)?;
    arguments.course.put_into(&mut settings)?;
    let memory = span.map(|span| MemoryConfig { span, imu_noise: rest.imu_noise });
    memory_arguments::put_into(&mut settings, memory.as_ref());
    session.configure(&settings).map_err(Failure::link)?;

    let mut directing = arguments.adaptive.directing(&rig, &geometry, &settings)?;
    let (mut stages, mut same_pose) = (Vec::new(), None);
    if let Some(program) = &fixed {
        (stages, same_pose) = simulated::stages(program);
        eprintln!("to the first pose");
        approach(platform.as_mut(), &mut session)?;
    }
    let longest_s = match (&directing, &fixed) {
        (Some(directing), _) => directing.at_most_s(),
        (None, program) => program
            .as_ref()
            .map_or(0.0, MotionProgram::duration_s)
            .min(arguments.adaptive.at_most_s.unwrap_or(f64::INFINITY)),
    };
    let folder = Folder::new(arguments.output.out.as_deref(), "run")?;
    let mut comments = device_notes(session.identity());
    comments.extend(provenance(&rig));
    comments.push(("zero, mean wrench at rest".to_owned(), format!("{:?} N, N m", rest.wrench)));
    comments.push(("zero, mean angular rate at rest".to_owned(), format!("{:?} rad/s", rest.angular_rate)));
    let mut watcher = Watcher::recording(
        folder.file("run.mcap"),
        &rig,
        &comments,
        if directing.is_some() { 0 } else { (longest_s * rate_hz) as usize },
    )?;
    watcher.motion = Some(MotionLog::create(folder.file("motion.csv"), &arguments.platform)?);
    eprintln!("the experiment takes {}{longest_s:.0} s", if directing.is_some() { "at most " } else { "" });
    session.go_on_after_stop = arguments.course.go_on;
    session.at_most_s = arguments.adaptive.at_most_s;
    let mut take = match &mut directing {
        Some(directing) => session.follow_decided(platform.as_mut(), directing, &mut watcher),
        None => session.follow(platform.as_mut(), &mut watcher),
    }
    .map_err(Failure::link)?;
    watcher.end(&mut take);
    let log = watcher.motion.take();
    let (mut decisions, mut commanded) = (Vec::new(), fixed);
    if let Some(directing) = directing {
        let concluded = directing.concluded();
        (stages, decisions, commanded) = (concluded.stages, concluded.decisions, concluded.program);
        warnings.extend(concluded.warnings);
    }
    let trajectory = commanded.map(|program| program.trajectory()).transpose().map_err(Failure::input)?;
    let followed = trajectory.zip(log).and_then(|(trajectory, log)| Followed::of(&trajectory, log.samples()));
    Experiment {
        started,
        asked: &asked,
        rig: &rig,
        recording: "run".to_owned(),
        mcu: "port",
        rate_hz,
        is_static: false,
        gravity_columns: false,
        sigma_given: true,
        stages,
        same_pose,
        identity: session.identity(),
        known: &known,
        tare: None,
        memory,
        followed,
        decisions,
        warnings,
    }
    .conclude(take, &folder, arguments.output.json)
}

/// Brings the plate to the first pose. The device is heard meanwhile: nobody may keep it waiting.
fn approach(platform: &mut dyn Platform, session: &mut Session) -> Result<(), Failure> {
    std::thread::scope(|scope| {
        let moving = scope.spawn(|| platform.approach(&|| !INTERRUPTED.load(Ordering::Relaxed)));
        while !moving.is_finished() {
            // What is wrong with the device is found out by the experiment itself.
            if session.watch(0.1, &mut Watcher::new(0)).is_err() || INTERRUPTED.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(20));
            }
        }
        match moving.join() {
            Ok(Ok(())) => Ok(()),
            Ok(Err(PlatformError::Interrupted)) => {
                Err(Failure::link("stopped on the way to the first pose; nothing was recorded"))
            }
            Ok(Err(other)) => Err(Failure::link(format!("{other}\nNothing was recorded."))),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}

/// A platform that was asked for nothing yet.
fn unmoved(error: PlatformError) -> Failure {
    let said = format!("{error}\nNothing was moved.");
    match error {
        PlatformError::Address { .. } | PlatformError::Motion(_) => Failure::input(said),
        _ => Failure::link(said),
    }
}

/// The sensors at rest.
struct Rest {
    wrench: [f64; 6],
    sigma: [f64; 6],
    angular_rate: [f64; 3],
    imu_noise: ImuNoise<f64>,
}

fn at_rest(readings: &[Reading<f64>], imu: Option<&ImuTable>) -> Option<Rest> {
    let n = readings.len() as f64;
    if readings.len() < 10 {
        return None;
    }
    let mean = |f: &dyn Fn(&Reading<f64>) -> f64| readings.iter().map(f).sum::<f64>() / n;
    let wrench: [f64; 6] = std::array::from_fn(|c| mean(&|r| r.wrench.array()[c]));
    Some(Rest {
        wrench,
        sigma: std::array::from_fn(|c| {
            (mean(&|r| (r.wrench.array()[c] - wrench[c]).powi(2)) * n / (n - 1.0)).sqrt()
        }),
        angular_rate: std::array::from_fn(|c| mean(&|r| r.angular_rate.array()[c])),
        imu_noise: imu_noise(imu, readings),
    })
}

fn look(session: &mut Session, rig: &RigFile) -> Result<Rest, Failure> {
    let readings = session.watch(WINDOW_S, &mut Watcher::new(0)).map_err(Failure::link)?;
    if INTERRUPTED.load(Ordering::Relaxed) {
        return Err(Failure::link("stopped before the experiment began; nothing was moved"));
    }
    at_rest(&readings, rig.imu.first()).ok_or_else(|| {
        Failure::link(
            "the sensors send nothing: check their supply and wiring (`rigident info` shows the counters)",
        )
    })
}

/// Waits until the mean wrench changes by less than σ from one look to the next, twice in a row.
fn warm_up(
    session: &mut Session,
    rig: &RigFile,
    longest_s: f64,
    warnings: &mut Vec<String>,
) -> Result<(), Failure> {
    let begun = Instant::now();
    let mut last: Option<Rest> = None;
    let mut settled = 0;
    while begun.elapsed().as_secs_f64() < longest_s {
        let now = look(session, rig)?;
        if let Some(last) = &last {
            let sigma = rig.load_cell.noise_n_nm.unwrap_or(now.sigma);
            let still = (0..6).all(|c| (now.wrench[c] - last.wrench[c]).abs() < sigma[c]);
            settled = if still { settled + 1 } else { 0 };
            if settled == 2 {
                return Ok(());
            }
        }
        last = Some(now);
        eprintln!(
            "warm-up: {:.0} s, the load cell is steady in {settled} of 2 looks",
            begun.elapsed().as_secs_f64()
        );
    }
    if longest_s > 0.0 {
        warnings.push(format!(
            "the load cell still drifted by more than its noise after {longest_s} s of warm-up"
        ));
    }
    Ok(())
}

/// The sensors at rest: bias of the gyro, and the noise where the rig file states none.
fn zero(session: &mut Session, rig: &mut RigFile, warnings: &mut Vec<String>) -> Result<Rest, Failure> {
    let rest = look(session, rig)?;
    eprintln!("zero: mean wrench {:.2?} N, N m", rest.wrench);
    if rig.imu.is_empty() {
        rig.imu.push(Default::default());
    }
    if let Some(imu) = rig.imu.first_mut() {
        let before = mounting(imu).gyro_bias.array();
        imu.gyro_bias_radps = Calibrated::Numbers(rest.angular_rate);
        let moved = (0..3).map(|k| (rest.angular_rate[k] - before[k]).abs()).fold(0.0, f64::max);
        if moved > 0.05 {
            warnings.push(format!("the gyro showed {moved:.3} rad/s at rest: was the platform moving?"));
        }
    }
    if rig.load_cell.noise_n_nm.is_none() {
        rig.load_cell.noise_n_nm = Some(rest.sigma);
        warnings.push(format!("noise_n_nm is not given: measured at rest, {:.3?} N, N m", rest.sigma));
    }
    Ok(rest)
}

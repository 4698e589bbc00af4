//! One experiment on the simulated rig with something wrong, judged as the program judges it.

use hexapod::experiment::thesis_program;
use rigident::answer::{Answer, Context, Status};
use rigident::device::link::Client;
use rigident::device::platform::{LocalPlatform, Platform};
use rigident::device::session::{DeviceTiming, Nobody, Session, settings};
use rigident::fit::{FitOptions, Silent};
use rigident::problem::{Problem, Subject};
use rigident::rig::{ImuTable, LoadCellTable, RecordingTable, RigFile};
use rigident::rows::body::{BodySource, prepare};
use rigident_shared::inertia::PARAMETER_NAMES;
use rigident_shared::wire::{Source, StateName};
use rigident_sim::flash::SharedFlash;
use rigident_sim::link::LinkFaults;
use rigident_sim::rig::{EXCITATION_V, Rig, RigConfig, SharedRig, WiringFault};
use rigident_sim::runner::{PacedRig, Pacing, WithFlash};

use super::Verdict;
use super::mcu::{Busy, Line, Place, boot};

/// Rates of both sensors, 1/s, and how long an experiment lasts, s.
const RATE_HZ: f64 = 500.0;
const SECONDS: f64 = 20.0;
/// Reads that bring something until a device restarts in the middle.
const RESTARTS_AFTER: usize = 900;

/// Returns what a user would have written into the rig file of this rig.
fn rig_file(config: &RigConfig) -> RigFile {
    let (cell, imu) = (&config.sensors.load_cell, &config.sensors.imu);
    let most = |sigmas: [f64; 3]| Some(sigmas.into_iter().fold(0.0, f64::max)).filter(|s| *s > 0.0);
    let norm = config.imu.rotation_wxyz.iter().map(|v| v * v).sum::<f64>().sqrt();
    RigFile {
        recording: RecordingTable {
            rate_hz: Some(config.adc_hz),
            gravity_mps2: config.gravity_mps2,
            ..RecordingTable::default()
        },
        imu: vec![ImuTable {
            position_m: config.imu.position_m,
            rotation_wxyz: config.imu.rotation_wxyz.map(|v| v / norm),
            group_delay_s: config.imu_group_delay_s(),
            rate_hz: Some(config.imu_hz),
            range_mps2: Some(imu.accel_range_mps2),
            range_radps: Some(imu.gyro_range_radps),
            accel_noise_mps2: most(imu.accel_noise_mps2),
            gyro_noise_radps: most(imu.gyro_noise_radps),
            ..ImuTable::default()
        }],
        load_cell: LoadCellTable {
            noise_n_nm: Some(cell.noise_n_nm),
            gain_uncertainty: Some(cell.gain_error.spread),
            calibration: Some(config.gauge_calibration),
            group_delay_s: config.load_cell_group_delay_s(),
            range_n_nm: Some(cell.range_n_nm),
            excitation_v: Some(EXCITATION_V),
            ..LoadCellTable::default()
        },
        ..RigFile::default()
    }
}

/// Returns the rig of the cases.
pub fn rig() -> RigConfig {
    RigConfig::thesis_horizontal().with_rates(RATE_HZ, RATE_HZ)
}

/// Runs an experiment with this rig, changed by `disturb` before it starts, over a line with these faults.
pub fn experiment(
    place: Place,
    config: RigConfig,
    line: LinkFaults,
    disturb: impl FnOnce(&mut Rig),
) -> Result<Verdict, String> {
    on_line(config, disturb, |rig| {
        let mcu = boot(place, Box::new(PacedRig::new(rig.clone(), Pacing::LockStep)))?;
        Ok(Line::new(mcu, line))
    })
}

/// Runs an experiment of which the device misses every third sample of the load cell.
pub fn overloaded(place: Place) -> Result<Verdict, String> {
    on_line(
        rig(),
        |_| {},
        |rig| {
            let bus = Busy::on(PacedRig::new(rig.clone(), Pacing::LockStep));
            Ok(Line::new(boot(place, Box::new(bus))?, LinkFaults::default()))
        },
    )
}

/// Runs an experiment on a board that was wired wrongly before it was switched on.
pub fn wired(place: Place, fault: WiringFault) -> Result<Verdict, String> {
    on_line(
        rig(),
        |_| {},
        |rig| {
            rig.lock().map_err(|_| "the rig is broken")?.wire(fault);
            Ok(Line::new(
                boot(place, Box::new(PacedRig::new(rig.clone(), Pacing::LockStep)))?,
                LinkFaults::default(),
            ))
        },
    )
}

/// Runs an experiment in whose middle the device restarts, its flash with it.
pub fn restarted(place: Place) -> Result<Verdict, String> {
    on_line(
        rig(),
        |_| {},
        |rig| {
            let (rig, flash) = (rig.clone(), SharedFlash::of_board());
            let boot_it = move || {
                let bus = PacedRig::new(rig.clone(), Pacing::LockStep);
                boot(place, Box::new(WithFlash::new(bus, flash.clone())))
            };
            let mcu = boot_it()?;
            Ok(Line::new(mcu, LinkFaults::default()).restarting(RESTARTS_AFTER, Box::new(boot_it)))
        },
    )
}

/// Runs an experiment over the line that is made of the rig.
fn on_line(
    config: RigConfig,
    disturb: impl FnOnce(&mut Rig),
    line: impl FnOnce(&SharedRig) -> Result<Line, String>,
) -> Result<Verdict, String> {
    let file = rig_file(&rig());
    let rig = Rig::new(config.clone()).map_err(|error| error.to_string())?;
    let truth = rig.truth();
    let rig = rig.shared();
    let client = Client::new(Box::new(line(&rig)?));
    let mut session = match Session::open(client) {
        Ok(session) => session,
        Err(error) => return Ok(refused(error.to_string())),
    };
    let timing =
        DeviceTiming { rate_hz: RATE_HZ, is_static: false, source: Source::Sensors, host_timeout_ms: 0 };
    let settings = settings(&file, &timing, None, None).map_err(|error| error.to_string())?;
    if let Err(error) = session.configure(&settings) {
        return Ok(refused(error.to_string()));
    }
    let program = thesis_program(&config.geometry, SECONDS);
    let mut platform = LocalPlatform(rig.clone());
    platform.load(&program).map_err(|error| error.to_string())?;
    disturb(&mut *rig.lock().map_err(|_| "the rig is broken")?);
    let take = match session.follow_unchecked(&mut platform, &program, &mut Nobody) {
        Ok(take) => take,
        Err(error) => return Ok(refused(error.to_string())),
    };
    let mut words = Vec::new();
    let fault = take.states.iter().find(|(state, _)| *state == StateName::Fault);
    words.extend(fault.map(|(_, reason)| format!("device in Fault: {reason:?}")));
    let counters = &take.counters;
    for (count, what) in [
        (counters.rejected, "readings rejected"),
        (counters.gaps, "gaps"),
        (counters.load_cell_crc_errors, "check sums of the converter wrong"),
        (counters.load_cell_errors, "frames of the converter without a sample"),
        (counters.load_cell_clipped, "samples clipped"),
        (counters.imu_errors, "errors of the IMU"),
        (counters.bad_frames, "commands damaged"),
        (counters.telemetry_dropped, "messages dropped for want of room"),
        (take.missing, "readings missing"),
        (counters.knocks.iter().copied().map(u32::from).sum(), "row blocks weighted down"),
    ] {
        if count > 0 {
            words.push(format!("{count} {what}"));
        }
    }
    if let Some(broken) = take.broken.as_deref().filter(|_| fault.is_none()) {
        // What is lost follows the first colon.
        words.push(broken.lines().next().unwrap_or_default().replace('|', "/"));
    }
    let input = prepare::input(&file, take.readings, false, RATE_HZ);
    let subject =
        Subject::Body { source: Box::new(BodySource::new(input, file.imu.first())), gravity_columns: false };
    let problem = Problem::new("faults", file, subject);
    let worst = match problem.fit(&FitOptions { convergence_points: 0, ..FitOptions::default() }, &Silent) {
        Err(error) => {
            words.push(first_words(&error.to_string()));
            None
        }
        Ok(fit) => {
            let context = Context { rate_sigma: problem.source().rate_sigma(), ..Context::default() };
            let answer = Answer::new(&fit, context).map_err(|error| error.to_string())?;
            if answer.status == Status::Implausible {
                words.push("implausible".to_owned());
            }
            words.extend(answer.warnings.first().map(|warning| first_words(warning)));
            let given = !matches!(answer.status, Status::Implausible | Status::Failed);
            given.then(|| worst(&answer, &truth.body)).flatten()
        }
    };
    let detected = !words.is_empty();
    if !detected {
        words.push("nothing".to_owned());
    }
    Ok(Verdict { detected, worst, words: words.join("; ") })
}

/// Returns the verdict that there was no result, for this reason.
pub fn refused(words: String) -> Verdict {
    Verdict { detected: true, worst: None, words: first_words(&words) }
}

/// Returns the first sentence of a message, without what would end a cell of a table.
fn first_words(words: &str) -> String {
    let line = words.lines().next().unwrap_or_default();
    let short = line.split_once(": ").map_or(line, |(first, _)| first);
    let short = short.split_once(" (").map_or(short, |(first, _)| first);
    short.replace('|', "/")
}

/// Returns the largest error of mass, centre of mass and tensor over its U95; `None` if none of them is
/// identified.
fn worst(answer: &Answer, body: &hexapod::BodyParameters) -> Option<f64> {
    let [x, y, z] = body.com_m;
    let m = body.mass_kg;
    let [xx, yy, zz, yz, xz, xy] = body.inertia_com_kgm2;
    let about = [
        m,
        m * x,
        m * y,
        m * z,
        xx + m * (y * y + z * z),
        yy + m * (x * x + z * z),
        zz + m * (x * x + y * y),
        yz - m * y * z,
        xz - m * x * z,
        xy - m * x * y,
    ];
    let errors = answer.parameters.iter().filter_map(|parameter| {
        let k = PARAMETER_NAMES.iter().position(|name| *name == parameter.name)?;
        let measured = parameter.state.measured()?;
        Some((measured.value - about.get(k)?).abs() / measured.u95)
    });
    errors.reduce(f64::max)
}

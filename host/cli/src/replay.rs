use std::process::ExitCode;
use std::time::Instant;

use rigident_shared::calibration::Reading;
use rigident_shared::forgetting::{MemoryConfig, Span};
use rigident_shared::wire::Source;

use super::arguments::Replay;
use super::experiment::{Experiment, Watcher};
use super::link::{NamedTransport, configured};
use super::options::calibration;
use super::options::forgetting::{self, RowsOf};
use super::options::microcontroller::Image;
use super::{Failure, Folder, Stages, replay_links, replay_springs, simulated};
use rigident::application::tree::{is_on_springs, tree_of};
use rigident::application::{Error, Loaded, calibrate};
use rigident::device::link::{Client, SerialTransport};
use rigident::device::session::precision::{self, largest_numbers};
use rigident::device::session::{DeviceTiming, Session, settings, state_imu_noise};
use rigident::rows::body::imu_noise::{imu_noise, white_imu_noise};
use rigident::rows::body::prepare::prepare;
use rigident_io::recording::Recording;
use rigident_io::rig::RigFile;

/// `rigident replay`
pub(super) fn run(arguments: &Replay) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    super::recorded::refuse_streams(&arguments.recording, arguments.rig.as_deref(), "replay")?;
    let (path, rig) = (&arguments.recording, arguments.rig.as_deref());
    let calibrated = arguments.calibration.calibration.as_deref();
    if is_on_springs(path, rig) {
        return replay_springs::run(arguments, started);
    }
    let tree = arguments.tree.typed()?;
    if let Some((model, _)) = tree_of(path, rig, &tree)? {
        calibration::refuse_for_trees(calibrated)?;
        return replay_links::run(arguments, &tree, model, started);
    }
    if let Some(option) = tree.asked() {
        return Err(Error::OnlyForTrees(option).into());
    }
    let known = arguments.known.parse()?;
    let mut recording =
        Recording::load(&arguments.recording, arguments.rig.as_deref()).map_err(Failure::input)?;
    recording.leave_out_spikes();
    calibrate(&mut recording.rig, calibrated)?;
    let prepared = prepare(&recording).map_err(Failure::input)?;
    let (mut notes, mut warnings) = (prepared.notes.clone(), recording.warnings.clone());
    let tare = super::factor::tare(&arguments.tare, rig, calibrated, &tree, (&mut notes, &mut warnings))?;
    let of_readings = |rig: &RigFile, readings: Vec<Reading<f64>>| {
        let rate_hz = (!recording.is_static).then_some(prepared.input.rate_hz);
        Loaded::of_readings(&recording.name, rig, readings, rate_hz, prepared.gravity_columns)
    };
    let span = arguments.forgetting.span(&RowsOf::input(&prepared.input))?;
    let memory = span.map(|span| MemoryConfig {
        span,
        imu_noise: imu_noise(prepared.rig.imu.first(), &prepared.input.readings),
    });
    let all = of_readings(&prepared.rig, prepared.input.readings.clone());
    let mut rig = prepared.rig.clone();
    rig.load_cell.noise_n_nm = Some(device_sigma(&all, span, &mut notes)?);
    let (mcu, transport) = device(&arguments.mcu, Image::Standard)?;
    let mut session = Session::open(Client::new(transport)).map_err(Failure::link)?;
    let timing = DeviceTiming {
        rate_hz: prepared.input.rate_hz,
        is_static: recording.is_static,
        source: Source::Injected,
        host_timeout_ms: 0,
    };
    let mut settings = settings(&rig, &timing, None, None).map_err(Failure::input)?;
    arguments.stop.put_into(&mut settings, all.source().parameters())?;
    drop(all);
    if !recording.is_static {
        let noise = white_imu_noise(prepared.rig.imu.first(), &prepared.input.readings);
        state_imu_noise(&mut settings, &noise);
    }
    forgetting::put_into(&mut settings, memory.as_ref());
    configured(&mut session, &settings)?;
    let folder = Folder::new(arguments.output.out.as_deref(), "replay")?;
    let mut watcher = Watcher::new(prepared.input.readings.len());
    let take = session.inject(&prepared.input.readings, &mut watcher).map_err(Failure::link)?;
    watcher.finish()?;
    // As the file has them, noise included: the device was given them in single precision, and this is the
    // recording that `identify` reads.
    let given = of_readings(&prepared.rig, take.readings.clone());
    Experiment {
        started,
        output: &arguments.output,
        stop: &arguments.stop,
        loaded: given,
        mcu,
        identity: session.identity(),
        known: &known,
        tare,
        until: settings.stop,
        span,
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

/// Returns σ of the load cell's channels to weigh rows by from the first one on: as stated, or from a fit here, and no less
/// than single precision bears. What was done goes to `notes`.
///
/// # Errors
/// Bad input: no usable rows.
pub(super) fn device_sigma(
    loaded: &Loaded,
    span: Option<Span<f64>>,
    notes: &mut Vec<String>,
) -> Result<[f64; 6], Failure> {
    let stages = Stages::new("noise of the channels");
    let (mut sigma, given) = match loaded.problem.rig.load_cell.noise_n_nm {
        Some(sigma) => (sigma, true),
        None => {
            let found = loaded.fit(span, 0, &stages.caller())?;
            let sigma: Vec<f64> = found.channels.iter().map(|c| c.sigma).collect();
            let six = sigma.first_chunk().copied();
            (six.ok_or_else(|| Failure::input("the rows are not those of a load cell"))?, false)
        }
    };
    let largest = largest_numbers(loaded.source(), &|stage: &str, share| stages.at(stage, share));
    let raised = precision::raise(&mut sigma, &largest.map_err(Failure::input)?);
    if !given {
        notes.push(format!(
            "noise_n_nm is not given: the device was told {} N, N m, from the residuals of a batch",
            sigma.map(|s| if s < 1e-3 { format!("{s:.1e}") } else { format!("{s:.3}") }).join(", ")
        ));
    }
    notes.extend(precision::told(&sigma, &raised));
    Ok(sigma)
}

/// Opens a device that readings are sent to; a simulated one runs this image.
///
/// # Errors
/// The port cannot be opened, or the simulated device cannot be made.
pub(super) fn device(mcu: &str, image: Image) -> Result<NamedTransport, Failure> {
    if let Some(simulated) = simulated::named(mcu, image)? {
        return Ok(simulated);
    }
    Ok(("port", Box::new(SerialTransport::open(mcu).map_err(Failure::link)?)))
}

//! A device that a job uses: the session with it, and the noise that it weighs rows by.

use rigident_shared::forgetting::Span;
use rigident_shared::wire::{Settings, Source};

use super::device_error::DeviceError;
use super::{Caller, Error, Loaded};
use rigident_device::link::Transport;
use rigident_device::microcontroller;
use rigident_device::session::precision::{self, largest_numbers};
use rigident_device::session::two_links::{attitude_source, two_link_settings};
use rigident_device::session::{DeviceTiming, Session, settings};
use rigident_fit::Parameter;
use rigident_fit::prior::KnownValues;
use rigident_identify::answer::AnswerError;
use rigident_identify::answer::selection;
use rigident_io::rig::RigFile;

/// Opens a session over a line, and configures the device.
///
/// # Errors
/// [`DeviceError`]: nobody answers, or the device does not take the settings.
pub fn configured_over(line: Box<dyn Transport>, settings: &Settings) -> Result<Session, DeviceError> {
    let mut session = microcontroller::session(line)?;
    configure(&mut session, settings)?;
    Ok(session)
}

/// Sends settings and reads them back.
///
/// # Errors
/// [`DeviceError`]: the device does not take one of them, or the link fails.
pub fn configure(session: &mut Session, settings: &Settings) -> Result<(), DeviceError> {
    session.configure(settings).map_err(|error| DeviceError::of_settings(error, settings))
}

/// The device says Holding after this long without us.
const HOST_TIMEOUT_MS: u32 = 2_000;

/// Returns the timing of a run by the device's own sensors, in motion, at this rate, 1/s.
pub fn of_sensors(rate_hz: f64) -> DeviceTiming {
    DeviceTiming { rate_hz, is_static: false, source: Source::Sensors, host_timeout_ms: HOST_TIMEOUT_MS }
}

/// Returns the device's settings for the content of a rig file, one body or two links, and σ where it has
/// none.
///
/// # Errors
/// What the rig file lacks, or more links than the device takes from sensors.
pub fn device_settings(
    rig: &RigFile,
    timing: &DeviceTiming,
    noise: Option<[f64; 6]>,
) -> Result<Settings, DeviceError> {
    if rig.link.len() > 1 {
        return Ok(two_link_settings(rig, timing, noise, attitude_source(rig))?);
    }
    Ok(settings(rig, timing, noise, None)?)
}

/// Refuses prior knowledge of parameters, and a request for some, that there are not, before anything is
/// done.
///
/// # Errors
/// [`Error::Known`] or [`Error::Answer`] with the word.
pub fn check_asked(parameters: &[Parameter], known: &KnownValues, asked: &[String]) -> Result<(), Error> {
    known.check(parameters)?;
    selection::select(parameters, asked).map(drop).map_err(|error| AnswerError::from(error).into())
}

/// Returns σ of the load cell's channels, N and N m, to weigh rows by from the first one on: as stated, or
/// from a fit here, and no less than single precision bears. What was done goes to the notes.
///
/// # Errors
/// There are no usable rows, or they are not those of a load cell.
pub fn channel_sigma(
    loaded: &Loaded,
    span: Option<Span<f64>>,
    notes: &mut Vec<String>,
    caller: &Caller<'_>,
) -> Result<[f64; 6], Error> {
    let (mut sigma, given) = match loaded.problem.rig.load_cell.noise_n_nm {
        Some(sigma) => (sigma, true),
        None => {
            let found = loaded.fit(span, 0, caller)?;
            let sigma: Vec<f64> = found.channels.iter().map(|c| c.sigma).collect();
            (sigma.first_chunk().copied().ok_or(DeviceError::NoLoadCell)?, false)
        }
    };
    let raised = precision::raise(&mut sigma, &largest_numbers(loaded.source(), caller)?);
    if !given {
        notes.push(format!(
            "noise_n_nm is not given: the device was given {} N, N m, from the residuals of a batch",
            sigma.map(|s| if s < 1e-3 { format!("{s:.1e}") } else { format!("{s:.3}") }).join(", ")
        ));
    }
    notes.extend(precision::raised_warning(&sigma, &raised));
    Ok(sigma)
}

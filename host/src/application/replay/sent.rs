//! The readings or frames of a recording: made, sent, and taken for what they were.

use std::path::Path;

use rigident_shared::calibration::Reading;
use rigident_shared::forgetting::MemoryConfig;
use rigident_shared::wire::{LinkReadingMessage, Source};

use super::on_springs::{Levels, OnSprings, Ready};
use super::{Replay, ReplayOptions};
use crate::application::device::{channel_sigma, check_asked};
use crate::application::device_error::DeviceError;
use crate::application::span::{self, RowsOf};
use crate::application::tree::change_as_recorded;
use crate::application::{Caller, Error, Loaded, calibrate};
use rigident_device::link::LinkError;
use rigident_device::microcontroller::Microcontroller;
use rigident_device::session::tree::{self, FrameSource, device_parameters, device_tree, tree_settings};
use rigident_device::session::two_links::{self, attitude_source, two_link_settings};
use rigident_device::session::{
    DeviceTiming, Observer, Session, Take, frames, settings, state_imu_noise, state_memory,
};
use rigident_identify::problem::ProblemError;
use rigident_io::recording::Recording;
use rigident_io::rig::{OffsetTable, OffsetWord, RigFile};
use rigident_model::Model;
use rigident_rows::body::imu_noise::{imu_noise, white_imu_noise};
use rigident_rows::body::prepare::{Prepared, prepare};

/// A recording in the form in which it is sent to a device.
pub(super) enum Sent {
    /// Readings of one body.
    Readings { name: String, prepared: Box<Prepared> },
    /// Readings of two links with an IMU each.
    LinkReadings { readings: Vec<LinkReadingMessage>, of: Links },
    /// Frames of a tree.
    Frames { frames: Vec<Vec<u8>>, count: usize, rate_hz: f64, parameters: usize, of: Links },
    /// Frames of bodies on springs.
    OnSprings(Box<OnSprings>),
}

/// A recording of a tree as it was read, and the tree.
pub(super) struct Links {
    recording: Recording,
    model: Model,
}

impl Links {
    /// Returns the part of the recording that the device took; as the file has it, noise included: the device
    /// was given it in single precision.
    fn taken(mut self, samples: usize) -> Result<Loaded, Error> {
        self.recording.keep_first(samples);
        Loaded::of_links(&self.recording, &self.model)
    }
}

impl Sent {
    pub(super) fn count(&self) -> usize {
        match self {
            Self::Readings { prepared, .. } => prepared.input.readings.len(),
            Self::LinkReadings { readings, .. } => readings.len(),
            Self::Frames { count, .. } => *count,
            Self::OnSprings(of) => of.count,
        }
    }

    /// Takes the frames out, if it is frames, with their rate, 1/s.
    pub(super) fn frames(&mut self) -> Option<(Vec<Vec<u8>>, f64)> {
        match self {
            Self::Readings { .. } | Self::LinkReadings { .. } => None,
            Self::Frames { frames, rate_hz, .. } => Some((std::mem::take(frames), *rate_hz)),
            Self::OnSprings(of) => Some((std::mem::take(&mut of.frames), of.rate_hz())),
        }
    }

    /// Sends everything.
    pub(super) fn follow(
        &self,
        session: &mut Session,
        gate: Option<&dyn FrameSource>,
        observer: &mut dyn Observer,
    ) -> Result<Take, DeviceError> {
        Ok(match (self, gate) {
            (Self::Frames { parameters, .. }, Some(gate)) => {
                session.follow_frames(gate, *parameters, observer)?
            }
            (Self::OnSprings(of), Some(gate)) => {
                session.follow_frames(gate, of.map.nrows(), &mut Levels { of, observer })?
            }
            (Self::LinkReadings { readings, .. }, _) => session.inject_links(readings, observer)?,
            (Self::Readings { prepared, .. }, _) => session.inject(&prepared.input.readings, observer)?,
            (Self::Frames { .. } | Self::OnSprings(_), None) => {
                return Err(LinkError::Silent("frames").into());
            }
        })
    }

    /// Returns what was taken as the application takes a recording.
    pub(super) fn taken(
        self,
        take: &mut Take,
        ends_itself: bool,
        notes: &mut Vec<String>,
        warnings: &mut Vec<String>,
    ) -> Result<Loaded, Error> {
        match self {
            // As the file has them, noise included: this is the recording that `identify` reads.
            Self::Readings { name, prepared } => {
                Ok(of_readings(&name, &prepared, &prepared.rig, take.readings.clone()))
            }
            Self::LinkReadings { of, .. } => of.taken(take.links.len()),
            Self::Frames { of, .. } => of.taken(tree::frames_taken(take)),
            Self::OnSprings(of) => of.taken(take, ends_itself, notes, warnings),
        }
    }
}

fn of_readings(name: &str, prepared: &Prepared, rig: &RigFile, readings: Vec<Reading<f64>>) -> Loaded {
    let rate_hz = (!prepared.input.is_static).then_some(prepared.input.rate_hz);
    Loaded::of_readings(name, rig, readings, rate_hz, prepared.gravity_columns)
}

impl<'a> Replay<'a> {
    /// Makes a recording of one body ready.
    pub(super) fn of_body(
        path: &Path,
        options: &'a ReplayOptions,
        caller: &Caller<'_>,
    ) -> Result<Self, Error> {
        let (rig, calibration) = (options.rig.as_deref(), options.calibration.as_deref());
        let mut recording = Recording::load(path, rig)?;
        recording.leave_out_bad_readings();
        calibrate(&mut recording.rig, calibration)?;
        let prepared = prepare(&recording).map_err(ProblemError::from)?;
        let (mut notes, mut warnings) = (prepared.notes.clone(), recording.warnings.clone());
        let tare = options.fixture(calibration, &mut notes, &mut warnings, caller)?;
        let input = &prepared.input;
        let span = span::checked(options.span, &RowsOf::input(input))?;
        let all = of_readings(&recording.name, &prepared, &prepared.rig, input.readings.clone());
        let mut rig = prepared.rig.clone();
        rig.load_cell.noise_n_nm = Some(channel_sigma(&all, span, &mut notes, caller)?);
        let timing = timing(input.rate_hz, input.is_static, Source::Injected);
        let mut settings = settings(&rig, &timing, None, None).map_err(DeviceError::from)?;
        settings.stop = options.stop.rule(all.source().parameters()).map_err(DeviceError::from)?;
        let imu = prepared.rig.imu.first();
        if !input.is_static {
            state_imu_noise(&mut settings, &white_imu_noise(imu, &input.readings));
        }
        let memory = span.map(|span| MemoryConfig { span, imu_noise: imu_noise(imu, &input.readings) });
        state_memory(&mut settings, memory.as_ref());
        let sent = Sent::Readings { name: recording.name, prepared: Box::new(prepared) };
        Ok(Self { options, sent, settings, tare, span, notes, warnings })
    }

    /// Makes a recording on springs ready.
    pub(super) fn on_springs(
        path: &Path,
        options: &'a ReplayOptions,
        caller: &Caller<'_>,
    ) -> Result<Self, Error> {
        options.refuse_port(true)?;
        let Ready { of, settings, tare, notes, warnings } = Ready::new(path, options, caller)?;
        Ok(Self { options, sent: Sent::OnSprings(Box::new(of)), settings, tare, span: None, notes, warnings })
    }

    /// Makes a recording of a tree ready: two links with an IMU each go the way of their readings, others of
    /// their frames.
    pub(super) fn of_tree(
        path: &Path,
        mut model: Model,
        options: &'a ReplayOptions,
        caller: &Caller<'_>,
    ) -> Result<Self, Error> {
        let mut recording = Recording::load(path, options.rig.as_deref())?;
        if recording.wrench.is_none() {
            return Err(DeviceError::NoWrench(path.to_owned()).into());
        }
        recording.leave_out_bad_readings();
        let mut warnings = recording.warnings.clone();
        let mut notes = change_as_recorded(&mut model, &options.tree.changes, &recording, caller)?;
        let tare = options.fixture(None, &mut notes, &mut warnings, caller)?;
        let (_, parameters) = device_tree(&model).map_err(DeviceError::from)?;
        let has_offset = recording.rig.load_cell.offset_n_nm == OffsetTable::Word(OffsetWord::Estimate);
        let as_read = recording.clone();
        let all = Loaded::of_links(&as_read, &model)?;
        recording.rig.load_cell.noise_n_nm = Some(channel_sigma(&all, None, &mut notes, caller)?);
        drop(all);
        let rig = &recording.rig;
        let is_two = rig.link.len() == 2 && rig.imu_on(1).is_some() && options.tree.model.is_none();
        let ready = if is_two {
            let estimated = device_parameters(&model, &parameters, has_offset);
            check_asked(&estimated, &options.known, &options.asked)?;
            let readings = two_links::readings(&recording).map_err(DeviceError::from)?;
            let timing = timing(rate_hz(&recording), recording.is_static, Source::Injected);
            let mut settings =
                two_link_settings(rig, &timing, None, attitude_source(rig)).map_err(DeviceError::from)?;
            settings.stop = options.stop.rule(&estimated).map_err(DeviceError::from)?;
            let sent = Sent::LinkReadings { readings, of: Links { recording: as_read, model } };
            Self { options, sent, settings, tare, span: None, notes, warnings }
        } else {
            options.refuse_port(false)?;
            let frames = frames::frames(&recording, &model).map_err(DeviceError::from)?;
            let ready = Self::of_frames(frames, as_read, &recording.rig, model, options)?;
            Self { tare, notes, warnings, ..ready }
        };
        Ok(ready)
    }

    /// Makes frames of a tree ready; `recording` has the same, and `rig` the noise to weigh them by.
    ///
    /// # Errors
    /// The tree is none for a device, or has not what is asked for.
    pub fn of_frames(
        frames: Vec<Vec<u8>>,
        recording: Recording,
        rig: &RigFile,
        model: Model,
        options: &'a ReplayOptions,
    ) -> Result<Self, Error> {
        let (tree, parameters) = device_tree(&model).map_err(DeviceError::from)?;
        let estimated = device_parameters(&model, &parameters, false);
        check_asked(&estimated, &options.known, &options.asked)?;
        let rate_hz = rate_hz(&recording);
        let timing = timing(rate_hz, recording.is_static, Source::Sensors);
        let mut settings = tree_settings(rig, &timing, tree).map_err(DeviceError::from)?;
        settings.stop = options.stop.rule(&estimated).map_err(DeviceError::from)?;
        let (count, parameters) = (frames.len(), parameters.len());
        let sent = Sent::Frames { frames, count, rate_hz, parameters, of: Links { recording, model } };
        Ok(Self { options, sent, settings, tare: None, span: None, notes: Vec::new(), warnings: Vec::new() })
    }
}

fn rate_hz(recording: &Recording) -> f64 {
    recording.rate_hz.unwrap_or(1.0)
}

impl ReplayOptions {
    /// Refuses a port where frames are sent.
    pub(super) fn refuse_port(&self, on_springs: bool) -> Result<(), DeviceError> {
        match &self.mcu {
            Microcontroller::Port(port) => {
                Err(DeviceError::FramesOverPort { port: port.clone(), on_springs })
            }
            _ => Ok(()),
        }
    }
}

fn timing(rate_hz: f64, is_static: bool, source: Source) -> DeviceTiming {
    DeviceTiming { rate_hz, is_static, source, host_timeout_ms: 0 }
}

//! From a recording through the firmware to an answer: its readings or frames are sent to a device, which
//! makes the factor.
//!
//! One body and two links with an IMU each go as readings, other trees and bodies on springs as frames. In
//! [`replay`](replay()) everything is done; whoever does something between the steps takes them one by one:
//! [`Replay::new`], [`Replay::connect`], [`Connected::run`], [`Experiment::conclude`].

mod on_springs;
mod sent;

use std::path::{Path, PathBuf};

use rigident_shared::forgetting::Span;
use rigident_shared::wire::{Identity, Settings};

use super::device::configured_over;
use super::device_error::DeviceError;
use super::experiment::{Concluded, Experiment};
use super::tare::{Fixture, ReadWith};
use super::tree::{is_on_springs, tree_of};
use super::{Caller, Error, Tree, calibration, recorded, tare};
use rigident_device::microcontroller::{Image, Microcontroller};
use rigident_device::session::tree::FrameSource;
use rigident_device::session::{Observer, Session, Take};
use rigident_device::stop_criterion::StopCriterion;
use rigident_fit::prior::KnownValues;
use rigident_fit::tare::Tare;
use sent::Sent;

/// The way a recording is replayed.
#[derive(Clone, Debug, Default)]
pub struct ReplayOptions {
    /// Rig file. Default: `NAME.rig.toml` beside the recording.
    pub rig: Option<PathBuf>,
    /// Calibration of the rig. Default: that of the rig file.
    pub calibration: Option<PathBuf>,
    /// The tree that the recording is of.
    pub tree: Tree,
    /// The microcontroller that runs the firmware. Default: this process.
    pub mcu: Microcontroller,
    /// The uncertainties at which the device ends.
    pub stop: StopCriterion,
    /// The time for which rows of one body are retained; `None`: all of them.
    pub span: Option<Span<f64>>,
    /// Runs with the bare fixture, which is taken off.
    pub tare: Vec<Fixture>,
    /// The prior knowledge.
    pub known: KnownValues,
    /// The parameters that must be identified: any of m, mc, I, offset, or single names; empty: those of the
    /// stop criterion, or all.
    pub asked: Vec<String>,
}

/// Has the firmware identify a recording. `observer` hears the device while it works.
///
/// # Errors
/// Something cannot be read, or does not fit; [`Error::Device`] if the device cannot be used; the caller
/// stops the job.
///
/// ```
/// use rigident::application::{Caller, ReplayOptions, replay};
/// use rigident::device::session::Nobody;
///
/// let bracket = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/examples/bracket.csv");
/// # if cfg!(feature = "simulator") {
/// let replayed = replay(bracket.as_ref(), &ReplayOptions::default(), &mut Nobody, &Caller::default())?;
/// assert_eq!(replayed.identified.answer.source.mcu, "inproc");
/// assert!((replayed.identified.answer.mass_kg.unwrap() - 3.2).abs() < 0.03);
/// # }
/// # Ok::<(), rigident::application::Error>(())
/// ```
pub fn replay(
    recording: &Path,
    options: &ReplayOptions,
    observer: &mut dyn Observer,
    caller: &Caller<'_>,
) -> Result<Concluded, Error> {
    caller.stoppable(|| {
        let connected = Replay::new(recording, options, caller)?.connect()?;
        let (experiment, take) = connected.run(observer)?;
        experiment.conclude(take, caller)
    })
}

/// A recording made ready for a device.
pub struct Replay<'a> {
    options: &'a ReplayOptions,
    sent: Sent,
    settings: Settings,
    tare: Option<Tare>,
    span: Option<Span<f64>>,
    notes: Vec<String>,
    warnings: Vec<String>,
}

impl<'a> Replay<'a> {
    /// Reads a recording, and makes it ready.
    ///
    /// # Errors
    /// It cannot be read, poses no problem for a device, or something asked for does not fit it.
    pub fn new(recording: &Path, options: &'a ReplayOptions, caller: &Caller<'_>) -> Result<Self, Error> {
        let recording = &recorded::named(recording.to_owned());
        let rig = options.rig.as_deref();
        recorded::refuse_several(recording, rig, "replay")?;
        if is_on_springs(recording, rig) {
            options.refuse_for_trees()?;
            return Self::on_springs(recording, options, caller);
        }
        match tree_of(recording, rig, &options.tree)? {
            Some((model, _)) => {
                options.refuse_for_trees()?;
                Self::of_tree(recording, model, options, caller)
            }
            None => match options.tree.asked() {
                Some(option) => Err(Error::OnlyForTrees(option)),
                None => Self::of_body(recording, options, caller),
            },
        }
    }

    /// Returns how many readings or frames are sent.
    pub fn count(&self) -> usize {
        self.sent.count()
    }

    /// Opens the device and configures it.
    ///
    /// # Errors
    /// [`Error::Device`]: there is none, it does not answer, or it does not take the settings.
    pub fn connect(mut self) -> Result<Connected<'a>, Error> {
        let mcu = &self.options.mcu;
        let (line, gate) = match self.sent.frames() {
            None => (mcu.open(Image::Standard).map_err(DeviceError::from)?, None),
            Some((frames, rate_hz)) => {
                let (line, gate) = mcu.frames(frames, rate_hz).map_err(DeviceError::from)?;
                (line, Some(gate))
            }
        };
        let session = configured_over(line, &self.settings)?;
        Ok(Connected { replay: self, session, gate })
    }
}

impl ReplayOptions {
    /// Refuses options of one body where a tree, or bodies on springs, are replayed.
    fn refuse_for_trees(&self) -> Result<(), Error> {
        if let Some(span) = self.span {
            return Err(Error::SpanOfTree(span));
        }
        calibration::refuse_for_trees(self.calibration.as_deref())
    }

    /// Returns the fixture; what is to be known of it goes to the notes and warnings.
    fn fixture(
        &self,
        calibration: Option<&Path>,
        notes: &mut Vec<String>,
        warnings: &mut Vec<String>,
        caller: &Caller<'_>,
    ) -> Result<Option<Tare>, Error> {
        let with = ReadWith { rig: self.rig.as_deref(), calibration, tree: &self.tree };
        tare::tare(&self.tare, with, (notes, warnings), caller)
    }
}

/// A recording beside a device that is ready for it.
pub struct Connected<'a> {
    replay: Replay<'a>,
    session: Session,
    gate: Option<Box<dyn FrameSource>>,
}

impl<'a> Connected<'a> {
    /// Returns what the device said of itself.
    pub fn identity(&self) -> &Identity {
        self.session.identity()
    }

    /// Returns how many readings or frames are sent.
    pub fn count(&self) -> usize {
        self.replay.count()
    }

    /// Sends everything, and takes the device's factor.
    ///
    /// # Errors
    /// [`Error::Device`]: the device does not start. Anything later is stated in [`Take::broken`].
    pub fn run(mut self, observer: &mut dyn Observer) -> Result<(Experiment<'a>, Take), Error> {
        let Replay { options, sent, settings, tare, span, mut notes, mut warnings } = self.replay;
        let mut take = sent.follow(&mut self.session, self.gate.as_deref(), observer)?;
        let loaded = sent.taken(&mut take, settings.stop.is_some(), &mut notes, &mut warnings)?;
        let experiment = Experiment {
            tare,
            asked: options.stop.asked(&options.asked),
            until: settings.stop,
            span,
            notes,
            warnings,
            ..Experiment::new(loaded, options.mcu.name(), self.session.identity(), &options.known)
        };
        Ok((experiment, take))
    }
}

//! Sensors that people own feed the firmware while they are recorded; the answer is of the recorded streams.
//!
//! The steps: [`Live::open`], [`Live::record`], [`Live::look`], [`Live::connect`], [`Live::feed`],
//! [`Live::close`], [`Live::answer`]. What is between them (folders, progress, a recording of what the device
//! is given) is the caller's.

mod streams;

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use rigident_shared::wire::{Settings, Source, StopRule};

use super::device::{channel_sigma, check_asked, configured_over};
use super::device_error::DeviceError;
use super::live_error::LiveError;
use super::loaded::PLOT_POINTS;
use super::report::provenance;
use super::{Caller, Error, Identified, Loaded, Report, Tree, calibrate};
use rigident_device::microcontroller::{Image, Microcontroller};
use rigident_device::session::{DeviceTiming, INTERRUPTED, Observer, Session, settings, state_imu_noise};
use rigident_device::stop_criterion::{StopCriterion, not_reached};
use rigident_device::words::device_notes;
use rigident_fit::Progress;
use rigident_fit::prior::KnownValues;
use rigident_identify::answer::now;
use rigident_io::recording::columns::Group;
use rigident_io::rig::RigFile;
use rigident_io::sources::feed::Feeds;
use rigident_io::sources::url::{Scheme, SourceUrl};
use rigident_io::sources::{self, Role, SourceError};
use rigident_rows::body::imu_noise::white_imu_noise;
use rigident_rows::body::prepare::Prepared;
use rigident_rows::tree::ProblemOptions;
use streams::{Asked, Came, Streams};

/// The first check, by which rates, clocks and noise are known, s.
const LOOK_S: f64 = 3.0;
/// Readings are sent this often.
const EVERY: Duration = Duration::from_millis(50);

/// Live sources, and what is done with them.
#[derive(Clone, Debug, Default)]
pub struct LiveOptions {
    /// Address of the wrench.
    pub wrench: String,
    /// Address of accelerometer and gyro; that of the wrench if they come together.
    pub imu: Option<String>,
    /// Address of the pose of what carries the load cell, in place of a gyro.
    pub pose: Option<String>,
    /// Rig file. Default: the IMU at the load cell's origin, parallel to it.
    pub rig: Option<PathBuf>,
    /// Calibration of the rig. Default: that of the rig file.
    pub calibration: Option<PathBuf>,
    /// The microcontroller that estimates while samples come. Default: this process.
    pub mcu: Microcontroller,
    /// The longest time that the device is fed, s; `None`: until it is interrupted, or the sources end.
    pub at_most_s: Option<f64>,
    /// The uncertainties at which the device ends.
    pub stop: StopCriterion,
    /// The prior knowledge.
    pub known: KnownValues,
    /// The parameters that must be identified; empty: those of the stop criterion, or all.
    pub asked: Vec<String>,
}

/// Live sources that are open.
///
/// ```
/// use rigident::application::{Error, Live, LiveError, LiveOptions};
///
/// let options = LiveOptions { wrench: "nowhere".to_owned(), ..LiveOptions::default() };
/// let refused = Live::open(&options).err().unwrap();
/// assert!(matches!(refused, Error::Live(why) if matches!(*why, LiveError::Address { .. })));
/// ```
pub struct Live<'a> {
    options: &'a LiveOptions,
    rig: RigFile,
    streams: Streams,
}

/// A device that is ready to be fed.
pub struct Feed {
    session: Session,
    settings: Settings,
    /// The rig file of the readings that the device is given, for their recording.
    pub recorded: RigFile,
    /// The rig file `recorded` with all results of the first look, the σ of the channels included.
    pub with_noise: RigFile,
    /// Device and sources, label and value, for the recording.
    pub comments: Vec<(String, String)>,
    /// Readings a second.
    pub rate_hz: f64,
    /// Readings that are expected; zero where that is not known.
    pub expected: usize,
}

/// The end of the device's part.
#[derive(Clone, Debug)]
pub struct Fed {
    /// Why it ended, if something broke.
    pub broken: Option<String>,
    until: Option<StopRule>,
    device: Vec<(String, String)>,
}

impl<'a> Live<'a> {
    /// Opens the sources. Nothing is recorded yet.
    ///
    /// # Errors
    /// [`Error::Live`]: an address is none, nobody answers, or the sources do not fit together; the rig file
    /// is not one of a body that moves; something asked for is not there.
    pub fn open(options: &'a LiveOptions) -> Result<Self, Error> {
        let rig = rig_of(options)?;
        let none_yet = Loaded::of_readings("live", &rig, Vec::new(), Some(1000.0), false);
        let parameters = none_yet.source().parameters();
        check_asked(parameters, &options.known, &options.asked)?;
        options.stop.rule(parameters).map_err(DeviceError::from)?;
        let asked = asked(options)?;
        let mut opened = Vec::new();
        for one in &asked {
            opened.push(sources::open(&one.url, &one.roles, &rig).map_err(LiveError::Source)?);
        }
        if !opened.iter().any(|source| source.groups().contains(&Group::Accel(0))) {
            return Err(LiveError::NoAccelerometer.into());
        }
        apart(&asked, &opened)?;
        let streams = Streams::new(asked, Feeds::new(opened), &rig);
        Ok(Self { options, rig, streams })
    }

    /// Records every sample from here on, a file a source in this folder.
    ///
    /// # Errors
    /// [`Error::Live`]: a file cannot be made.
    pub fn record(&mut self, folder: &Path) -> Result<(), Error> {
        Ok(self.streams.record(folder)?)
    }

    /// Takes in the first seconds, chooses the time base by them, and checks them as a recording is checked.
    ///
    /// # Errors
    /// [`Error::Live`]: a source fails, clocks go wrong, or there is too little in common; it is interrupted.
    pub fn look(&mut self, caller: &Caller<'_>) -> Result<Prepared, Error> {
        const STAGE: &str = "first look at the sources";
        let begun = Instant::now();
        while begun.elapsed().as_secs_f64() < LOOK_S {
            caller.stage(STAGE, begun.elapsed().as_secs_f64() / LOOK_S);
            let came = self.streams.take(EVERY).map_err(LiveError::Broken)?;
            if INTERRUPTED.load(Ordering::Relaxed) {
                return Err(LiveError::StoppedLooking.into());
            }
            if came == Came::End {
                break;
            }
        }
        self.streams.begin().map_err(LiveError::Clock)?;
        Ok(self.streams.growing().begin().map_err(LiveError::from)?)
    }

    /// Opens the device and configures it by what the first look found.
    ///
    /// # Errors
    /// [`Error::Device`]: there is none, or it does not take the settings.
    pub fn connect(&mut self, looked: &Prepared, caller: &Caller<'_>) -> Result<Feed, Error> {
        // Who joined too late for a rate was informed by the check.
        let rate_hz = self.streams.growing().rate_hz().unwrap_or(1.0);
        let timing = DeviceTiming { rate_hz, is_static: false, source: Source::Injected, host_timeout_ms: 0 };
        let readings = &looked.input.readings;
        let mut with_noise = looked.rig.clone();
        let first = Loaded::of_readings("live", &with_noise, readings.clone(), Some(rate_hz), false);
        caller.stage("noise of the channels", 0.0);
        // Single precision bears no less.
        with_noise.load_cell.noise_n_nm = Some(channel_sigma(&first, None, &mut Vec::new(), caller)?);
        let mut settings = settings(&with_noise, &timing, None, None).map_err(DeviceError::from)?;
        settings.stop = self.options.stop.rule(first.source().parameters()).map_err(DeviceError::from)?;
        state_imu_noise(&mut settings, &white_imu_noise(looked.rig.imu.first(), readings));
        let line = self.options.mcu.open(Image::Standard).map_err(DeviceError::from)?;
        let session = configured_over(line, &settings)?;
        let mut comments = device_notes(session.identity());
        comments.extend(provenance(&self.rig));
        comments.extend(self.streams.provenance());
        comments.push(("recorded".to_owned(), now()));
        let recorded = RigFile { recording: looked.rig.recording.clone(), ..self.rig.clone() };
        let expected = self.options.at_most_s.map_or(0, |s| ((LOOK_S + s) * rate_hz) as usize);
        Ok(Feed { session, settings, recorded, with_noise, comments, rate_hz, expected })
    }

    /// Feeds the device until something ends it: the sources, the device, the time, an interruption.
    ///
    /// # Errors
    /// [`Error::Device`]: the device does not start. Anything later is in [`Fed::broken`].
    pub fn feed(&mut self, feed: Feed, observer: &mut dyn Observer) -> Result<Fed, Error> {
        let Feed { mut session, settings, .. } = feed;
        let mut feeding = session.begin_feeding().map_err(DeviceError::from)?;
        let begun = Instant::now();
        let broken = loop {
            let came = self.streams.take(EVERY);
            let readings = match self.streams.growing().readings() {
                Ok(readings) => readings,
                Err(why) => break Some(why.to_string()),
            };
            if !session.feed(&mut feeding, &readings, observer) {
                break None;
            }
            match came {
                Ok(Came::Samples) => {}
                Ok(Came::End) => break None,
                Err(why) => break Some(why),
            }
            let over = self.options.at_most_s.is_some_and(|most_s| begun.elapsed().as_secs_f64() >= most_s);
            if over || INTERRUPTED.load(Ordering::Relaxed) {
                break None;
            }
        };
        let take = session.end_feeding(feeding, observer);
        let device = device_notes(session.identity());
        Ok(Fed { broken: broken.or(take.broken), until: settings.stop, device })
    }

    /// Ends the files. Returns the rig file that lists them, and what could not be written, if anything.
    pub fn close(&mut self) -> (RigFile, Option<String>) {
        let closed = self.streams.close().err();
        (self.streams.listing(&self.rig), closed)
    }

    /// Identifies the recorded streams, which this rig file lists.
    ///
    /// # Errors
    /// [`Error::Unanswered`]: they make no recording or no rows, or what is known contradicts them.
    pub fn answer(&self, listing: &Path, fed: Fed, caller: &Caller<'_>) -> Result<Identified, Error> {
        let unanswered =
            |error: Error| Error::Unanswered { broken: fed.broken.clone(), error: Box::new(error) };
        let (tree, problem) = (Tree::default(), ProblemOptions::default());
        let calibration = self.options.calibration.as_deref();
        let loaded = Loaded::read(listing, None, calibration, &tree, &problem, caller).map_err(unanswered)?;
        let mut found = loaded.fit(None, PLOT_POINTS, caller).map_err(unanswered)?;
        let factor = loaded.factor(&found);
        self.options.known.apply(&mut found).map_err(|e| unanswered(e.into()))?;
        let mut report = Report::of_recording(&loaded, "host");
        report.asked = self.options.stop.asked(&self.options.asked);
        report.factor = Some(factor);
        let sources = self.streams.provenance();
        report.provenance = fed.device.into_iter().chain(sources).chain(report.provenance).collect();
        report.warnings.extend(self.streams.warnings());
        let wider = |stop: &StopRule| {
            (0..found.parameters.len())
                .any(|j| stop.u95(j).is_some_and(|u95| found.estimate.u95(j) > f64::from(u95)))
        };
        report.warnings.extend(fed.until.filter(wider).map(|stop| not_reached(&stop, &found)));
        report.notes.push(
            "the answer is of the recorded streams, with the uncertainty of their clocks; what the device \
             estimated while it ran took the \
             clocks by the arrivals"
                .to_owned(),
        );
        report.error = fed.broken;
        caller.stage("answer", 0.0);
        report.conclude(found, caller)
    }
}

/// Reads the rig file, if there is one; it must be of one body in motion.
fn rig_of(options: &LiveOptions) -> Result<RigFile, Error> {
    let mut rig = options.rig.as_deref().map(RigFile::load).transpose()?.unwrap_or_default();
    let has = if rig.link.len() > 1 {
        Some("several [[link]]: live takes one body; record the streams and identify them")
    } else if rig.suspension.is_some() {
        Some("[suspension]: record the decay, and identify it by `vibration_identify()`")
    } else if rig.recording.is_static {
        Some("static = true: live takes a body that moves")
    } else if !rig.stream.is_empty() {
        Some("[[stream]]: the sources are given by `wrench`, `imu` and `pose`")
    } else {
        None
    };
    if let (Some(has), Some(path)) = (has, &options.rig) {
        return Err(LiveError::Rig { rig: path.clone(), has }.into());
    }
    calibrate(&mut rig, options.calibration.as_deref())?;
    match options.at_most_s.filter(|s| !(s.is_finite() && *s > 0.0)) {
        Some(seconds) => Err(LiveError::Duration(seconds).into()),
        None => Ok(rig),
    }
}

/// Returns the sources, one for each address.
fn asked(options: &LiveOptions) -> Result<Vec<Asked>, LiveError> {
    let given = [
        (Role::Wrench, Some(&options.wrench)),
        (Role::Imu, options.imu.as_ref()),
        (Role::Pose, options.pose.as_ref()),
    ];
    let mut asked: Vec<Asked> = Vec::new();
    for (role, text) in given.into_iter().filter_map(|(role, text)| Some((role, text?))) {
        let url: SourceUrl = text.parse().map_err(|error: SourceError| LiveError::Address { role, error })?;
        // A bridge takes any number of clients, each with a topic.
        let shares = |other: &&mut Asked| other.url.same_place(&url) && url.scheme != Scheme::WebSocket;
        match asked.iter_mut().find(shares) {
            Some(other) if other.url == url => other.roles.push(role),
            Some(other) => {
                return Err(LiveError::TwoSettings {
                    role: other.roles.first().copied().unwrap_or(role),
                    url: other.url.to_string(),
                    other_role: role,
                    other: url.to_string(),
                });
            }
            None => asked.push(Asked { url, roles: vec![role] }),
        }
    }
    Ok(asked)
}

/// Refuses two sources that bring the same.
fn apart(asked: &[Asked], opened: &[Box<dyn sources::Source>]) -> Result<(), LiveError> {
    for (k, source) in opened.iter().enumerate() {
        for (other, before) in opened.iter().enumerate().take(k) {
            let Some(both) = source.groups().iter().find(|group| before.groups().contains(group)) else {
                continue;
            };
            let place = |k: usize| asked.get(k).map(|asked| asked.url.to_string()).unwrap_or_default();
            let columns = both.names().join(", ");
            return Err(LiveError::Twice { first: place(other), second: place(k), columns });
        }
    }
    Ok(())
}

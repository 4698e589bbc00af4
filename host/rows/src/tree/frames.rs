//! Frames of a tree: what is measured at one instant, and how it is to be understood.

use rigident_shared::tree::{BaseMotion, TreeError};

use super::SignalError;
use super::contact::states::assign;
use super::contact::{Contact, Ground};
use super::drive::Drive;
use super::rows::RowMaker;
use rigident_fit::Nuisance;
use rigident_model::Model;
use rigident_model::base::{Rows, Situation};

/// One instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Time of the frame, ns.
    pub time_ns: u64,
    /// Coordinates of all joints, as [`rigident_model::rows::Moving::set`] takes them; of a tracked base its
    /// own come first: position and quaternion in laboratory axes.
    pub positions: Vec<f64>,
    /// Rates of all joints in the same order, rad/s and m/s; of a tracked base velocity and angular rate in
    /// its own axes.
    pub rates: Vec<f64>,
    /// Specific force at the base's IMU and the base's rate, axes of the base; angular acceleration is not
    /// examined. Not used of a tracked base.
    pub base: BaseMotion<f64>,
    /// Wrench on the base link about its origin, N and N m, in the base's axes, of a tracked base in the
    /// laboratory's; unused if it is not among the rows.
    pub wrench: [f64; 6],
    /// Force or torque of every freedom's drive, N or N m; empty if they are not among the rows.
    pub efforts: Vec<f64>,
    /// Freedoms whose drives are at rest, so that dry friction there is anything of its size (`standstill`).
    pub standing: Vec<usize>,
    /// The measurements of the feet; empty where there are none.
    pub ground: Ground,
}

/// The kind of a signal with noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignalKind {
    /// Specific force of the base.
    Accelerometer,
    /// Rate of a link, the base's among them.
    Gyro,
    /// Attitude of a link against the base.
    Attitude,
    /// Angle or length of a joint whose rate is measured, or is not examined.
    Position,
    /// Angle or length of a joint whose rate is its slope.
    PositionWithSlope,
    /// Rate of a joint.
    Rate,
}

/// A measured signal and its white noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoisySignal {
    /// The meaning.
    pub kind: SignalKind,
    /// The link, or the link beyond the joint, by its index in the model.
    pub link: usize,
    /// 1 σ per sample and axis as stated.
    pub stated: Option<f64>,
    /// 1 σ per sample and axis by sixth differences.
    pub found: f64,
}

impl NoisySignal {
    /// Returns 1 σ as stated; where nothing is, as differences show it.
    pub(super) fn size(&self) -> f64 {
        self.stated.unwrap_or(self.found)
    }

    /// Returns the number of its axes.
    pub(super) fn axes(&self) -> usize {
        match self.kind {
            SignalKind::Accelerometer | SignalKind::Gyro | SignalKind::Attitude => 3,
            SignalKind::Position | SignalKind::PositionWithSlope | SignalKind::Rate => 1,
        }
    }
}

/// The sensor of the motion of the base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BaseSensor {
    /// An IMU at this place in the base's frame, m; or the base is held still.
    Imu([f64; 3]),
    /// Cameras: position and attitude in the laboratory, whose z points up, with their rates.
    Tracked,
}

/// The frames of a recording with what is known of the tree and its sensors.
#[derive(Clone, Debug)]
pub struct Input {
    /// The tree, without fixed joints.
    pub model: Model,
    /// Instants in the order of their times.
    pub frames: Vec<Frame>,
    /// Each is a still pose of its own, without time.
    pub is_static: bool,
    /// Frames per second; not used for still poses.
    pub rate_hz: f64,
    /// The sensor of the motion of the base.
    pub base: BaseSensor,
    /// The quantities that are measured, and the kind of base.
    pub situation: Situation,
    /// 1 σ per reading: wrench, then efforts, as far as they are among the rows; `None`: from the residuals.
    pub channel_sigma: Option<Vec<f64>>,
    /// The wrench's offset if known; `None`: estimated.
    pub known_offset: Option<[f64; 6]>,
    /// Errors of sensors and mounting that do not average out. An [`rigident_fit::Effect::Signal`] is one of
    /// `errors`.
    pub nuisances: Vec<Nuisance>,
    /// Errors of the signals that frames are made of, by their numbers.
    pub errors: Vec<SignalError>,
    /// Drives that turn with the joints, with their friction.
    pub drives: Vec<Drive>,
    /// Parameters of drives that there are because the model states them, by name; nobody asked for them.
    pub as_stated: Vec<String>,
    /// Signals that the frames are made of, with their noise; empty: they are exact.
    pub signals: Vec<NoisySignal>,
    /// 1 σ of the rates of the links, rad/s: information that their noise alone would bring is none.
    pub rate_sigma: f64,
    /// Feet on the ground, whose wrenches the rows of base and joints contain; `None`: `wrench` is all that
    /// acts on the base.
    pub contact: Option<Contact>,
}

impl Input {
    /// Returns the frames of a tree whose base is tracked, `rate_hz` a second: six rows each, exact signals,
    /// and no wrench offset.
    pub fn tracked(model: Model, frames: Vec<Frame>, rate_hz: f64) -> Self {
        Self {
            model,
            frames,
            is_static: false,
            rate_hz,
            base: BaseSensor::Tracked,
            situation: Situation { floating: true, rows: Rows::Base, mimic: false },
            channel_sigma: None,
            known_offset: Some([0.0; 6]),
            nuisances: Vec::new(),
            errors: Vec::new(),
            drives: Vec::new(),
            as_stated: Vec::new(),
            signals: Vec::new(),
            rate_sigma: 0.0,
            contact: None,
        }
    }

    /// Returns these settings with other frames.
    pub fn with_frames(&self, frames: Vec<Frame>) -> Self {
        Self {
            frames,
            model: self.model.clone(),
            channel_sigma: self.channel_sigma.clone(),
            drives: self.drives.clone(),
            as_stated: self.as_stated.clone(),
            signals: self.signals.clone(),
            nuisances: self.nuisances.clone(),
            errors: self.errors.clone(),
            contact: self.contact.clone(),
            ..*self
        }
    }

    /// Chooses the rows that are free of what feet do not measure, by frames; returns how many frames were
    /// left out as the contact changes there.
    ///
    /// # Errors
    /// [`TreeError`] if frames and model do not fit.
    pub fn choose_rows(&mut self) -> Result<usize, TreeError> {
        let mut moving = RowMaker::about_imu(self)?;
        assign(self, &mut moving)
    }

    /// Returns true if the wrench is among the rows.
    pub fn has_wrench(&self) -> bool {
        self.situation.rows != Rows::Joint
    }

    /// Returns true if the joints' drives are among the rows.
    pub fn has_efforts(&self) -> bool {
        self.situation.rows != Rows::Base
    }

    /// Returns the number of the first channel that is an effort: those of the wrench, where there is one,
    /// are before.
    pub fn first_effort(&self) -> usize {
        if self.has_wrench() { 6 } else { 0 }
    }

    /// Returns a Legendre polynomial of the first or second degree at a frame, of the time that goes from −1
    /// to 1 over the frames.
    pub(super) fn drift(&self, frame: &Frame, degree: u8) -> f64 {
        let time = |frame: Option<&Frame>| frame.map_or(0.0, |frame| frame.time_ns as f64 * 1e-9);
        let (first, last) = (time(self.frames.first()), time(self.frames.last()));
        let x = (2.0 * time(Some(frame)) - first - last) / (last - first).max(f64::MIN_POSITIVE);
        if degree == 1 { x } else { 1.5 * x * x - 0.5 }
    }

    /// Returns the names of the channels: `fx` … `mz`, then the joints'.
    pub fn channels(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        if self.has_wrench() {
            names.extend(["fx", "fy", "fz", "mx", "my", "mz"].map(str::to_owned));
        }
        if self.has_efforts() {
            names.extend(self.freedom_names());
        }
        names
    }

    /// Returns a name for every freedom: the joint's, numbered where it has several.
    pub fn freedom_names(&self) -> Vec<String> {
        let links = self.model.links.iter().skip(1);
        links
            .flat_map(|l| {
                let several = l.link.joint.freedoms();
                (0..several).map(move |k| match several {
                    1 => l.joint_name.clone(),
                    _ => format!("{}[{k}]", l.joint_name),
                })
            })
            .collect()
    }
}

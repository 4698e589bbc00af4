//! A robot that the device watches while it works: what the device is given of it, and its frames.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use rigident_shared::inertia::{InertialParameters, tensor_elements};
use rigident_shared::spatial::Body;
use rigident_shared::tree::Joint;
use rigident_shared::wire::watch_frame::{MAX_WATCH_FRAME, WatchFrame};
use rigident_shared::wire::{
    FootSettings, MAX_WATCH_FEET, MAX_WATCHED_LINKS, ModelSettings, Settings, Source, WatchJoint,
    WatchLinkSettings, WatchSettings,
};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::tracked::settings_of;
use super::tree::DeviceTreeError;
use rigident_model::rows::Moving;
use rigident_rows::tree::{BaseSensor, Frame, Input, SignalKind};
use rigident_shared::estimator::watch::BINS;

/// Width of the filter, s, as everywhere.
const WIDTH_S: f64 = 0.1;
/// Rows a second: those of a bin are two.
const ROWS_PER_S: f64 = 20.0;
/// The prior knowledge is forgotten with this time constant, s.
const FORGET_S: f64 = 120.0;
/// A wrench in a recording has no noise less than this, N and N m.
const LEAST_SIGMA: f64 = 1e-3;

/// The ratio to its weight, or its inverse, beyond which no robot is pushed in the mean.
const UNLIKE: f64 = 2.5;

/// Says why a robot cannot be watched.
#[derive(Debug, thiserror::Error)]
pub enum WatchError {
    /// There are too many links.
    #[error(
        "the model has {0} links that move against each other, the device watches {MAX_WATCHED_LINKS}: weld \
         some of them"
    )]
    Links(usize),
    /// There are too many sensors of forces.
    #[error("the rig file has {0} feet, the device takes {MAX_WATCH_FEET}")]
    Feet(usize),
    /// A component of a foot's wrench is not measured.
    #[error(
        "{0} of foot {1} is not measured: to watch a link the device needs all that pushes the robot; add \
         what is missing, or a sensor"
    )]
    NotMeasured(&'static str, String),
    /// Nothing tells what pushes the robot.
    #[error(
        "the device watches by the wrenches on the robot: its feet ([[foot]] in the rig file) or its base \
         (fx_n … mz_nm), and there are none"
    )]
    NoWrench,
    /// The pushing force is far from the weight, N.
    #[error(
        "the wrenches push by {0:.0} N in the mean, and the model weighs {1:.0} N: are they in another unit \
         (a scale in columns of the rig file), does something push or hold the robot that is not measured, \
         or is it another model?"
    )]
    Weight(f64, f64),
    /// No link of that name.
    #[error("the model has no link {0}; its links are {1}")]
    NoLink(String, String),
    /// A link without parameters.
    #[error(
        "link {0} has no inertial parameters in the model: the device needs those of all links, identify \
         them first"
    )]
    NoParameters(String),
    /// A joint of several freedoms.
    #[error(
        "joint {0} has several freedoms: the device watches robots whose joints turn or slide about one axis \
         each"
    )]
    Joint(String),
    /// A base that cameras track, or still poses.
    #[error("the device watches a robot in motion whose base carries an IMU or is held still")]
    Base,
    /// Frames come too slowly or too fast.
    #[error("{0} frames a second: the device's filter of 0.1 s takes 60 to 640")]
    Rate(f64),
    /// The settings.
    #[error(transparent)]
    Settings(#[from] DeviceTreeError),
}

/// Tells how a robot is watched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WatchOptions {
    /// False alarms per hour at most, of noise alone.
    pub false_alarms_per_hour: f64,
    /// No change is reported before, s.
    pub settle_s: f64,
}

impl Default for WatchOptions {
    fn default() -> Self {
        Self { false_alarms_per_hour: 0.1, settle_s: 20.0 }
    }
}

impl WatchOptions {
    /// Returns what a change must explain: ten times the F of ten degrees of freedom that noise exceeds so
    /// seldom, at any of all borders that are asked, ten times a second. The sum of the probabilities is an
    /// upper bound (Bonferroni), as they go together. Of n successive differences of white noise two thirds
    /// are degrees of freedom (von Neumann).
    pub fn limit(&self, bins_per_s: f64) -> f64 {
        let asked = (BINS - 1) as f64 * bins_per_s * 3600.0;
        let probability = (self.false_alarms_per_hour / asked).clamp(1e-15, 0.1);
        let shown = (2.0 / 3.0 * self.settle_s * bins_per_s - 6.0).max(4.0);
        10.0 * FisherSnedecor::new(10.0, shown)
            .map_or(f64::INFINITY, |law| law.inverse_cdf(1.0 - probability))
    }
}

/// Holds what the device is given, and its frames.
#[derive(Clone, Debug)]
pub struct WatchedRobot {
    /// The settings of the run.
    pub settings: Settings,
    /// The robot's links, one by one.
    pub links: Vec<WatchLinkSettings>,
    /// The robot's frames, of one time base: their numbers show gaps.
    pub frames: Vec<NumberedFrame>,
}

/// Holds a frame as it is sent to the device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NumberedFrame {
    /// The frame's number: periods since the first one.
    pub number: u32,
    /// The frame's bytes ([`WatchFrame`]).
    pub payload: Vec<u8>,
}

impl WatchedRobot {
    /// Returns the number of its sensors of forces.
    pub fn feet(&self) -> usize {
        match &self.settings.model {
            ModelSettings::Watch(robot) => usize::from(robot.foot_count),
            _ => 0,
        }
    }

    /// Returns what the device is to be given so that it watches this link of a recording's model.
    ///
    /// # Errors
    /// [`WatchError`] says what does not fit onto the device.
    pub fn new(input: &Input, link: &str, options: &WatchOptions) -> Result<Self, WatchError> {
        let model = &input.model;
        let BaseSensor::Imu(place) = input.base else { return Err(WatchError::Base) };
        if input.is_static {
            return Err(WatchError::Base);
        }
        let count = model.links.len();
        if count > MAX_WATCHED_LINKS {
            return Err(WatchError::Links(count));
        }
        let watched = model.link(link).ok_or_else(|| {
            let names: Vec<&str> = model.links.iter().map(|l| l.name.as_str()).collect();
            WatchError::NoLink(link.to_owned(), names.join(", "))
        })?;
        let row_every = (input.rate_hz / ROWS_PER_S).round() as u16;
        let taps = input.rate_hz * WIDTH_S;
        if !(6.0..=64.0).contains(&taps) {
            return Err(WatchError::Rate(input.rate_hz));
        }
        let place = Vector3::from(place);
        let links = (0..count).map(|i| link_settings(input, i, &place)).collect::<Result<Vec<_>, _>>()?;
        let (feet, sigma) = feet(input, &place)?;
        let [pushed, weight] = weights(input);
        if !(weight / UNLIKE..=weight * UNLIKE).contains(&pushed) {
            return Err(WatchError::Weight(pushed, weight));
        }
        let bins_per_s = input.rate_hz / f64::from(2 * row_every);
        let robot = WatchSettings {
            links: count as u8,
            watched: watched as u8,
            feet: std::array::from_fn(|k| feet.get(k).copied().unwrap_or_default()),
            foot_count: feet.len() as u8,
            limit: options.limit(bins_per_s) as f32,
            settle_bins: (options.settle_s * bins_per_s).round().clamp(1.0, 6e4) as u16,
            forget_s: FORGET_S as f32,
        };
        let one = settings_of(ModelSettings::Watch(robot), input.rate_hz, sigma)?;
        let settings = Settings { filter_width_s: WIDTH_S as f32, row_every, source: Source::Sensors, ..one };
        Ok(Self { settings, links, frames: frames(input) })
    }
}

fn wxyz(rotation: &Matrix3<f64>) -> [f32; 4] {
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*rotation));
    [q.w, q.i, q.j, q.k].map(|v| v as f32)
}

/// Returns a link, the base's origin moved to the IMU.
fn link_settings(input: &Input, i: usize, place: &Vector3<f64>) -> Result<WatchLinkSettings, WatchError> {
    let link = &input.model.links[i];
    let phi = link.nominal.ok_or_else(|| WatchError::NoParameters(link.name.clone()))?;
    let own = InertialParameters::<Body, f64>::from_vector(phi);
    let (joint, axis) = match link.link.joint {
        _ if i == 0 => (WatchJoint::Fixed, Vector3::zeros()),
        Joint::Fixed => (WatchJoint::Fixed, Vector3::zeros()),
        Joint::Revolute(axis) => (WatchJoint::Revolute, axis),
        Joint::Prismatic(axis) => (WatchJoint::Prismatic, axis),
        _ => return Err(WatchError::Joint(link.joint_name.clone())),
    };
    let (position, parameters) = if i == 0 {
        (Vector3::zeros(), moved(&own, place))
    } else {
        let from = if link.link.parent == 0 { *place } else { Vector3::zeros() };
        (link.link.position - from, phi)
    };
    Ok(WatchLinkSettings {
        parent: link.link.parent as u8,
        joint,
        axis: axis.map(|v| v as f32).into(),
        rotation_wxyz: if i == 0 { [1.0, 0.0, 0.0, 0.0] } else { wxyz(&link.link.rotation) },
        position_m: position.map(|v| v as f32).into(),
        parameters: parameters.map(|v| v as f32),
    })
}

/// Returns the parameters about another origin in the same axes, a body without mass included: mc less m d,
/// and the tensor by Steiner, twice.
fn moved(own: &InertialParameters<Body, f64>, by: &Vector3<f64>) -> [f64; 10] {
    let (m, c, one) = (own.mass, own.first_moment, Matrix3::identity());
    // Σ m (|p − d|² 1 − (p − d)(p − d)ᵀ)
    let cross = one * (2.0 * c.dot(by)) - c * by.transpose() - by * c.transpose();
    let tensor = own.inertia - cross + (one * by.norm_squared() - by * by.transpose()) * m;
    let c = c - by * m;
    let [xx, yy, zz, yz, zx, xy] = tensor_elements(&tensor);
    [m, c.x, c.y, c.z, xx, yy, zz, yz, zx, xy]
}

/// Returns the sensors, and 1 σ of the wrench on the whole robot about the IMU in its axes: of a frame, by
/// sensors and by the IMU.
fn feet(input: &Input, place: &Vector3<f64>) -> Result<(Vec<FootSettings>, [f64; 6]), WatchError> {
    let one = Matrix3::identity();
    // Link, rotation and position there, 1 σ.
    type Sensor = (usize, Matrix3<f64>, Vector3<f64>, [f64; 6]);
    let sensors: Vec<Sensor> = if let Some(contact) = &input.contact {
        for foot in &contact.feet {
            if let Some(k) = foot.measured.iter().position(|measured| !measured) {
                let name = rigident_rows::tree::contact::COMPONENTS[k];
                return Err(WatchError::NotMeasured(name, foot.name.clone()));
            }
        }
        contact.feet.iter().map(|foot| (foot.link, foot.rotation, foot.position, foot.sigma)).collect()
    } else if input.has_wrench() {
        let own = input.channel_sigma.as_ref().and_then(|sigma| sigma.first_chunk::<6>().copied());
        vec![(0, one, Vector3::zeros(), own.unwrap_or_else(|| shown(input)))]
    } else {
        return Err(WatchError::NoWrench);
    };
    if sensors.len() > MAX_WATCH_FEET {
        return Err(WatchError::Feet(sensors.len()));
    }
    let (arms, mass, arm) = arms(input, place, &sensors.iter().map(|s| (s.0, s.2)).collect::<Vec<_>>());
    let accel = input.signals.iter().find(|s| s.kind == SignalKind::Accelerometer);
    let accel = accel.map_or(0.0, |s| s.stated.unwrap_or(s.found));
    let mean = |sigma: &[f64]| (sigma.iter().map(|s| s * s).sum::<f64>() / sigma.len() as f64).sqrt();
    let (mut force, mut moment) = ((mass * accel).powi(2), (mass * arm * accel).powi(2));
    for ((.., sigma), arm) in sensors.iter().zip(&arms) {
        let (f, m) = (mean(&sigma[..3]), mean(&sigma[3..]));
        force += f * f;
        moment += m * m + (f * arm).powi(2);
    }
    let [force, moment] = [force, moment].map(|square| square.sqrt().max(LEAST_SIGMA));
    let settings = sensors.iter().map(|(link, rotation, position, _)| {
        let from = if *link == 0 { *place } else { Vector3::zeros() };
        FootSettings {
            link: *link as u8,
            rotation_wxyz: wxyz(rotation),
            position_m: (position - from).map(|v| v as f32).into(),
        }
    });
    Ok((settings.collect(), [force, force, force, moment, moment, moment]))
}

/// Returns what noise sixth differences of the base's wrench show.
fn shown(input: &Input) -> [f64; 6] {
    std::array::from_fn(|c| {
        let values: Vec<f64> = input.frames.iter().map(|frame| frame.wrench[c]).collect();
        rigident_model::idle::white_noise(&values)
    })
}

/// Distances of sensors from the IMU in the first frame, the robot's mass, and the distance of its centre, m.
fn arms(input: &Input, place: &Vector3<f64>, sensors: &[(usize, Vector3<f64>)]) -> (Vec<f64>, f64, f64) {
    let nothing = (vec![1.0; sensors.len()], 0.0, 0.0);
    let (Ok(mut moving), Some(frame)) = (Moving::new(input.model.tree()), input.frames.first()) else {
        return nothing;
    };
    let still = vec![0.0; frame.rates.len()];
    if moving.set(&frame.positions, &frame.rates, &still, &frame.base).is_err() {
        return nothing;
    }
    let at = |link: usize, position: &Vector3<f64>| {
        moving.place(link).map_or(*position, |(turn, origin)| Vector3::from(origin) + turn * position)
    };
    let (mut mass, mut first) = (0.0, Vector3::zeros());
    for (i, phi) in input.model.links.iter().enumerate().filter_map(|(i, l)| Some((i, l.nominal?))) {
        mass += phi[0];
        if phi[0] > 0.0 {
            first += at(i, &(Vector3::new(phi[1], phi[2], phi[3]) / phi[0])) * phi[0];
        }
    }
    let arms = sensors.iter().map(|(link, position)| (at(*link, position) - place).norm()).collect();
    (arms, mass, if mass > 0.0 { (first / mass - place).norm() } else { 0.0 })
}

/// Returns the wrenches of a frame: of the feet, or of the base.
fn wrenches<'a>(input: &'a Input, frame: &'a Frame) -> &'a [[f64; 6]] {
    if input.contact.is_some() { &frame.ground.wrenches } else { std::slice::from_ref(&frame.wrench) }
}

/// Returns what pushes the robot in the mean, by the sum of its forces' sizes, and what the model weighs by
/// its IMU, N.
fn weights(input: &Input) -> [f64; 2] {
    let size = |[x, y, z, ..]: &[f64; 6]| x.hypot(*y).hypot(*z);
    let mass: f64 = input.model.links.iter().filter_map(|link| link.nominal).map(|phi| phi[0]).sum();
    let count = input.frames.len().max(1) as f64;
    let all = input.frames.iter().map(|frame| {
        [wrenches(input, frame).iter().map(size).sum::<f64>(), mass * frame.base.specific_force.norm()]
    });
    all.fold([0.0; 2], |sum, own| [sum[0] + own[0] / count, sum[1] + own[1] / count])
}

fn frames(input: &Input) -> Vec<NumberedFrame> {
    let mut all = Vec::new();
    for (k, frame) in input.frames.iter().enumerate() {
        let own: Vec<f32> =
            frame.base.specific_force.iter().chain(&frame.base.rate).map(|v| *v as f32).collect();
        let imu = std::array::from_fn(|i| own[i]);
        let feet: Vec<[f32; 6]> = wrenches(input, frame).iter().map(|w| w.map(|v| v as f32)).collect();
        let mut places = frame.positions.iter().zip(&frame.rates);
        let joints = input.model.links.iter().skip(1).map(|link| match link.link.joint.freedoms() {
            0 => [0.0; 2],
            _ => places.next().map_or([f32::NAN; 2], |(place, rate)| [*place as f32, *rate as f32]),
        });
        let joints: Vec<[f32; 2]> = joints.collect();
        let number = super::tracked::number(input, k);
        let mut payload = vec![0; MAX_WATCH_FRAME];
        // No more links and sensors than there may be: it has been examined.
        let length = WatchFrame::encode(number, &imu, &feet, &joints, &mut payload).unwrap_or(0);
        payload.truncate(length);
        all.push(NumberedFrame { number, payload });
    }
    all
}

#[cfg(test)]
#[path = "watched_tests.rs"]
mod tests;

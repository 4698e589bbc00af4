//! The view that cameras have of a motion: markers, with noise and gaps, in a frame of the cameras' own.

use nalgebra::{Matrix3, Vector3};
use rand_distr::{Distribution, StandardNormal, StandardUniform};

use hexapod::Mounting;

use super::{Motion, SuspensionError};
use crate::sensors::stream;

/// Streams of the seed: noise, and gaps.
const STREAMS: [u64; 2] = [20, 21];

/// The part that a marker is stuck to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Carrier {
    /// The platform.
    Platform,
    /// A link, 0 the base link.
    Link(usize),
}

/// A marker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Marker {
    /// The carrier.
    pub on: Carrier,
    /// The place, in the carrier's frame, m.
    pub at_m: [f64; 3],
}

/// A time for which a marker is hidden.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hidden {
    /// Index of the marker.
    pub marker: usize,
    /// The time from which on it is hidden, s.
    pub from_s: f64,
    /// The time until which it is hidden, s.
    pub to_s: f64,
}

/// Cameras and markers.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionCapture {
    /// The markers.
    pub markers: Vec<Marker>,
    /// Frames per second, Hz.
    pub rate_hz: f64,
    /// Standard deviation of the white noise along each axis, m.
    pub noise_m: f64,
    /// Chance that a marker is not seen in a frame.
    pub dropout: f64,
    /// Gaps.
    pub hidden: Vec<Hidden>,
    /// A's frame in the cameras': `v_C = R_CA v_A + p`.
    pub cameras: Mounting,
    /// Seed of noise and gaps.
    pub seed: u64,
}

/// The recording of the cameras.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    /// Frames per second, Hz.
    pub rate_hz: f64,
    /// Per frame and marker: where it was, cameras' frame, m; `None` if it was not seen.
    pub seen_m: Vec<Vec<Option<[f64; 3]>>>,
}

impl MotionCapture {
    /// Cameras at 120 Hz that see every marker to 0.1 mm along each axis, in A's own frame.
    pub fn of(markers: Vec<Marker>) -> Self {
        Self {
            markers,
            rate_hz: 120.0,
            noise_m: 1e-4,
            dropout: 0.0,
            hidden: Vec::new(),
            cameras: Mounting::IDENTITY,
            seed: 0,
        }
    }

    /// Returns four markers on the corners of a plate of 2 `half_m` about a carrier's origin, and one above
    /// it.
    pub fn cluster(on: Carrier, half_m: f64) -> Vec<Marker> {
        [[1.0, 1.0, 0.0], [-1.0, 1.0, 0.1], [-1.0, -1.0, 0.0], [1.0, -1.0, -0.1], [0.2, 0.0, 0.6]]
            .map(|at: [f64; 3]| Marker { on, at_m: at.map(|v| half_m * v) })
            .to_vec()
    }

    /// Films a motion, whose rate must be a whole multiple of the cameras'.
    pub fn film(&self, motion: &Motion) -> Result<Film, SuspensionError> {
        let every = motion.rate_hz / self.rate_hz;
        let whole = every.round();
        if !(every.is_finite() && whole >= 1.0 && (every - whole).abs() < 1e-6) {
            return Err(SuspensionError::CameraRate { camera_hz: self.rate_hz, motion_hz: motion.rate_hz });
        }
        let turn = self.checked(motion)?;
        let shift = Vector3::from(self.cameras.position_m);
        let [mut noise, mut gaps] = STREAMS.map(|s| stream(self.seed, s));
        let mut seen_m = Vec::with_capacity(motion.instants.len() / whole as usize + 1);
        for now in motion.instants.iter().step_by(whole as usize) {
            let mut frame = Vec::with_capacity(self.markers.len());
            for (k, marker) in self.markers.iter().enumerate() {
                let carrier = match marker.on {
                    Carrier::Platform => &now.platform,
                    Carrier::Link(link) => &now.links[link],
                };
                let at = carrier.position + carrier.rotation * Vector3::from(marker.at_m);
                // Drawn whether seen or not, so that a gap changes nothing else.
                let error = Vector3::from_fn(|_, _| {
                    let n: f64 = StandardNormal.sample(&mut noise);
                    self.noise_m * n
                });
                let chance: f64 = StandardUniform.sample(&mut gaps);
                let hidden = self
                    .hidden
                    .iter()
                    .any(|h| h.marker == k && h.from_s <= now.time_s && now.time_s < h.to_s);
                let seen: [f64; 3] = (turn * at + shift + error).into();
                frame.push((!hidden && chance >= self.dropout).then_some(seen));
            }
            seen_m.push(frame);
        }
        Ok(Film { rate_hz: self.rate_hz, seen_m })
    }

    /// Returns `R_CA`, if everything makes sense.
    fn checked(&self, motion: &Motion) -> Result<Matrix3<f64>, SuspensionError> {
        let figure = |what: &str| SuspensionError::Figure { what: what.to_string() };
        let links = motion.instants.first().map_or(0, |i| i.links.len());
        let carried = self.markers.iter().all(|m| match m.on {
            Carrier::Platform => true,
            Carrier::Link(link) => link < links,
        });
        if !carried {
            return Err(figure("a marker on a link that is not there"));
        }
        if !(self.noise_m.is_finite() && self.noise_m >= 0.0 && (0.0..=1.0).contains(&self.dropout)) {
            return Err(figure("noise or dropout of the cameras"));
        }
        self.cameras.rotation().ok_or_else(|| figure("the cameras' frame"))
    }
}

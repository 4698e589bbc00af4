//! Motions as Fourier series on all six coordinates, with a soft beginning and end.

use std::f64::consts::TAU;

use hexapod::{Axis, Coordinates, Pose, Segment, SineTerm};

/// The coordinates in their order.
pub const AXES: [Axis; 6] = [Axis::X, Axis::Y, Axis::Z, Axis::Roll, Axis::Pitch, Axis::Yaw];
/// Angular rate, rad/s, and acceleration, m/s², that a coefficient of one means: all of a like size then.
const RATE_RADPS: f64 = 0.3;
const ACCELERATION_MPS2: f64 = 0.5;

/// The sine and cosine of one frequency on the grid, the envelope in them: value and two derivatives.
type Wave = Vec<[f64; 3]>;

/// `q_i(t) = centre_i + e(t) Σ_k s_ik (z_2k sin ω_k t + z_2k+1 cos ω_k t)`; e swells and fades over the ramp.
#[derive(Clone, Debug)]
pub struct Family {
    centre: [f64; 6],
    /// Coordinates that keep their place.
    still: [bool; 6],
    duration_s: f64,
    ramp_s: f64,
    frequencies_hz: Vec<f64>,
    /// The waves by frequency, sine before cosine.
    waves: Vec<Wave>,
    /// The part between the ramps that is driven again.
    repeated: Option<Repeated>,
}

/// A common period of all frequencies, driven more often than it is examined.
#[derive(Clone, Copy, Debug)]
struct Repeated {
    period_s: f64,
    again: usize,
    /// Instants of the period that follows the first ramp.
    from: usize,
    to: usize,
}

impl Family {
    /// Makes the family about `centre`, examined every `step_s`.
    pub fn new(centre: &Pose, duration_s: f64, ramp_s: f64, frequencies_hz: &[f64], step_s: f64) -> Self {
        let count = (duration_s / step_s).floor() as usize + 1;
        let waves = frequencies_hz
            .iter()
            .flat_map(|f| [(*f, 0.0), (*f, 0.25 * TAU)])
            .map(|(frequency_hz, phase_rad)| {
                // The platform's own series, so that what is planned is what is driven.
                let term = SineTerm { axis: Axis::X, amplitude: 1.0, frequency_hz, phase_rad };
                let segments = vec![Segment::Multisine { duration_s, ramp_s, terms: vec![term] }];
                let program = hexapod::MotionProgram { start: Pose::default(), segments };
                let trajectory = program.trajectory();
                (0..count)
                    .map(|k| {
                        let c =
                            trajectory.as_ref().map(|t| t.coordinates(k as f64 * step_s)).unwrap_or_default();
                        [c.value[0], c.rate[0], c.acceleration[0]]
                    })
                    .collect()
            })
            .collect();
        let [x, y, z] = centre.position_m;
        let [roll, pitch, yaw] = centre.rpy_rad;
        Self {
            centre: [x, y, z, roll, pitch, yaw],
            still: [false; 6],
            duration_s,
            ramp_s,
            frequencies_hz: frequencies_hz.to_vec(),
            waves,
            repeated: None,
        }
    }

    /// Makes the common period of all frequencies repeat `again` times more. Its states are those of the
    /// period after the first ramp, which must be there.
    #[must_use]
    pub fn repeating(self, period_s: f64, again: usize, step_s: f64) -> Self {
        let from = (self.ramp_s / step_s).ceil() as usize;
        let to = from + (period_s / step_s).round() as usize;
        Self { repeated: Some(Repeated { period_s, again, from, to }), ..self }
    }

    /// Returns how often the motion passes through the state at the instant `k` of the grid.
    pub fn times(&self, k: usize) -> f64 {
        match self.repeated {
            Some(Repeated { again, from, to, .. }) if (from..to).contains(&k) => 1.0 + again as f64,
            _ => 1.0,
        }
    }

    /// Returns the family without these coordinates: their coefficients mean nothing.
    #[must_use]
    pub fn without(self, still: [bool; 6]) -> Self {
        Self { still, ..self }
    }

    fn moving(&self) -> impl Iterator<Item = usize> + '_ {
        (0..6).filter(|i| !self.still[*i])
    }

    /// Returns the number of coefficients.
    pub fn len(&self) -> usize {
        6 * self.waves.len()
    }

    /// Returns whether there is no frequency.
    pub fn is_empty(&self) -> bool {
        self.waves.is_empty()
    }

    /// Instants of the grid.
    pub fn instants(&self) -> usize {
        self.waves.first().map_or(0, Vec::len)
    }

    fn scale(&self, axis: usize, wave: usize) -> f64 {
        let w = TAU * self.frequencies_hz[wave / 2];
        if axis < 3 { ACCELERATION_MPS2 / (w * w) } else { RATE_RADPS / w }
    }

    /// Returns the coordinates at the instant `k` of the grid.
    pub fn coordinates(&self, coefficients: &[f64], k: usize) -> Coordinates {
        let mut c = Coordinates { value: self.centre, ..Coordinates::default() };
        for (j, wave) in self.waves.iter().enumerate() {
            let [w0, w1, w2] = wave[k];
            for i in self.moving() {
                let z = coefficients[i * self.waves.len() + j] * self.scale(i, j);
                c.value[i] += z * w0;
                c.rate[i] += z * w1;
                c.acceleration[i] += z * w2;
            }
        }
        c
    }

    /// Adds to `gradient` what a change of the coordinates at the instant `k` is worth.
    pub fn pull_back(&self, worth: &Coordinates, k: usize, gradient: &mut [f64]) {
        for (j, wave) in self.waves.iter().enumerate() {
            let [w0, w1, w2] = wave[k];
            for i in self.moving() {
                gradient[i * self.waves.len() + j] += self.scale(i, j)
                    * (worth.value[i] * w0 + worth.rate[i] * w1 + worth.acceleration[i] * w2);
            }
        }
    }

    /// Returns the motion for the platform; `size` makes it smaller.
    pub fn segment(&self, coefficients: &[f64], size: f64) -> Segment {
        let mut terms = Vec::new();
        for (i, axis) in AXES.into_iter().enumerate().filter(|(i, _)| !self.still[*i]) {
            for (f, frequency_hz) in self.frequencies_hz.iter().enumerate() {
                let at = i * self.waves.len() + 2 * f;
                let (a, b) = (coefficients[at], coefficients[at + 1]);
                terms.push(SineTerm {
                    axis,
                    amplitude: size * self.scale(i, 2 * f) * a.hypot(b),
                    frequency_hz: *frequency_hz,
                    phase_rad: b.atan2(a),
                });
            }
        }
        let more_s = self.repeated.map_or(0.0, |r| r.again as f64 * r.period_s);
        Segment::Multisine { duration_s: self.duration_s + more_s, ramp_s: self.ramp_s, terms }
    }
}

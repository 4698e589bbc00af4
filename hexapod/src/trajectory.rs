//! Exact kinematics of a motion program.

use super::envelope::{envelope, envelope_peaks, quintic};
use super::error::MotionError;
use super::kinematics::{Coordinates, PlateState};
use super::path::Curve;
use super::pose::Pose;
use super::program::{LONGEST_S, MotionProgram, Segment};

/// One segment at its place in time, begun from a known pose.
#[derive(Clone, Debug)]
struct Piece {
    begin_s: f64,
    from: [f64; 6],
    segment: Segment,
    /// The curve of a path.
    curve: Option<Curve>,
}

/// A program ready to be evaluated at any time. Before its beginning and after its end the plate stands
/// still.
#[derive(Clone, Debug)]
pub struct Trajectory {
    start: [f64; 6],
    end: [f64; 6],
    duration_s: f64,
    pieces: Vec<Piece>,
}

impl Trajectory {
    /// Places the segments of `program` in time.
    ///
    /// # Errors
    /// The first segment that makes no sense, or a program of more than [`LONGEST_S`].
    pub fn new(program: &MotionProgram) -> Result<Self, MotionError> {
        let start = program.start.coordinates();
        if !start.iter().all(|c| c.is_finite()) {
            let reason = "the start pose has a coordinate that is not a finite number";
            return Err(MotionError::BadSegment { segment: 0, reason });
        }
        let (mut at, mut begin_s) = (start, 0.0);
        let mut pieces = Vec::with_capacity(program.segments.len());
        for (i, segment) in program.segments.iter().enumerate() {
            segment.check().map_err(|reason| MotionError::BadSegment { segment: i + 1, reason })?;
            let curve = match segment {
                Segment::Path { via, to, duration_s } => Some(Curve::new(&at, via, to, *duration_s)),
                _ => None,
            };
            pieces.push(Piece { begin_s, from: at, segment: segment.clone(), curve });
            begin_s += segment.duration_s();
            if let Some(to) = segment.target() {
                at = to.coordinates();
            }
        }
        if begin_s > LONGEST_S {
            return Err(MotionError::TooLong { duration_s: begin_s });
        }
        Ok(Self { start, end: at, duration_s: begin_s, pieces })
    }

    /// Returns a plate that stands still.
    pub fn resting(pose: &Pose) -> Self {
        let at = pose.coordinates();
        Self { start: at, end: at, duration_s: 0.0, pieces: Vec::new() }
    }

    /// Returns how long it takes, s.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Returns where it starts.
    pub fn start_pose(&self) -> Pose {
        Pose::from_coordinates(self.start)
    }

    /// Returns where it ends.
    pub fn end_pose(&self) -> Pose {
        Pose::from_coordinates(self.end)
    }

    /// Returns the coordinates with exact derivatives at `time_s`.
    pub fn coordinates(&self, time_s: f64) -> Coordinates {
        let still = |value| Coordinates { value, ..Coordinates::default() };
        if time_s <= 0.0 {
            return still(self.start);
        }
        if time_s >= self.duration_s {
            return still(self.end);
        }
        let next = self.pieces.partition_point(|p| p.begin_s <= time_s);
        match next.checked_sub(1).and_then(|i| self.pieces.get(i)) {
            Some(piece) => piece.coordinates(time_s - piece.begin_s),
            None => still(self.start),
        }
    }

    /// Returns the times, s, between which every derivative is continuous: the beginning and the end of each
    /// segment and of its ramps, in order.
    pub fn seams_s(&self) -> Vec<f64> {
        let mut seams = vec![0.0];
        for piece in &self.pieces {
            let end_s = piece.begin_s + piece.segment.duration_s();
            if let Some(ramp_s) = piece.segment.ramp_s() {
                seams.extend([piece.begin_s + ramp_s, end_s - ramp_s]);
            }
            seams.push(end_s);
        }
        seams.dedup();
        seams
    }

    /// Bounds of `|x'''|`, m/s³, and of `|d²ω/dt²|`, rad/s³, both in A, between the two seams around
    /// `time_s`.
    pub(super) fn third_derivatives(&self, time_s: f64) -> [f64; 2] {
        let next = self.pieces.partition_point(|p| p.begin_s <= time_s);
        match next.checked_sub(1).and_then(|i| self.pieces.get(i)) {
            Some(piece) => piece.third_derivatives(time_s - piece.begin_s),
            None => [0.0; 2],
        }
    }

    /// Returns the plate's rigid motion at `time_s`.
    pub fn state(&self, time_s: f64) -> PlateState {
        self.coordinates(time_s).plate_state()
    }
}

impl MotionProgram {
    /// Returns the exact kinematics of the program. Whether a platform can follow is
    /// [`super::Geometry::check`]'s business.
    ///
    /// # Errors
    /// The first segment that makes no sense.
    pub fn trajectory(&self) -> Result<Trajectory, MotionError> {
        Trajectory::new(self)
    }
}

impl Piece {
    fn coordinates(&self, t: f64) -> Coordinates {
        if let Some(curve) = &self.curve {
            return curve.coordinates(t);
        }
        let mut c = Coordinates { value: self.from, ..Coordinates::default() };
        match &self.segment {
            Segment::Hold { .. } | Segment::Path { .. } => {}
            Segment::Move { to, duration_s } => {
                let [s0, s1, s2] = quintic(t / duration_s);
                let (d1, d2) = (s1 / duration_s, s2 / (duration_s * duration_s));
                for (i, goal) in to.coordinates().into_iter().enumerate() {
                    let step = goal - self.from[i];
                    c.value[i] += step * s0;
                    c.rate[i] = step * d1;
                    c.acceleration[i] = step * d2;
                }
            }
            Segment::Multisine { duration_s, ramp_s, terms } => {
                let [e0, e1, e2] = envelope(t, *duration_s, *ramp_s);
                let (mut sum, mut sum1, mut sum2) = ([0.0; 6], [0.0; 6], [0.0; 6]);
                for term in terms {
                    let w = std::f64::consts::TAU * term.frequency_hz;
                    let (sin, cos) = (w * t + term.phase_rad).sin_cos();
                    let i = term.axis as usize;
                    sum[i] += term.amplitude * sin;
                    sum1[i] += term.amplitude * w * cos;
                    sum2[i] -= term.amplitude * w * w * sin;
                }
                for i in 0..6 {
                    c.value[i] += e0 * sum[i];
                    c.rate[i] = e1 * sum[i] + e0 * sum1[i];
                    c.acceleration[i] = e2 * sum[i] + 2.0 * e1 * sum1[i] + e0 * sum2[i];
                }
            }
            Segment::Sphere(sphere) => c = sphere.coordinates(&self.from, t),
        }
        c
    }

    fn third_derivatives(&self, t: f64) -> [f64; 2] {
        let ramping = |ramp_s: f64| t < ramp_s || self.segment.duration_s() - t < ramp_s;
        let mut peaks = self.curve.as_ref().map_or([[0.0_f64; 3]; 6], Curve::peaks);
        match &self.segment {
            Segment::Hold { .. } | Segment::Path { .. } => {}
            Segment::Move { to, duration_s } => {
                for ((peaks, goal), from) in peaks.iter_mut().zip(to.coordinates()).zip(self.from) {
                    *peaks = envelope_peaks(*duration_s).map(|p| p * (goal - from).abs());
                }
            }
            Segment::Multisine { ramp_s, terms, .. } => {
                let [e1, e2, e3] = if ramping(*ramp_s) { envelope_peaks(*ramp_s) } else { [0.0; 3] };
                for term in terms {
                    let (a, w) = (term.amplitude.abs(), std::f64::consts::TAU * term.frequency_hz.abs());
                    let [d1, d2, d3] = &mut peaks[term.axis as usize];
                    *d1 += a * (e1 + w);
                    *d2 += a * (e2 + 2.0 * e1 * w + w * w);
                    *d3 += a * (e3 + 3.0 * e2 * w + 3.0 * e1 * w * w + w * w * w);
                }
            }
            Segment::Sphere(sphere) => return sphere.third_derivatives(ramping(sphere.ramp_s)),
        }
        let [x, y, z, roll, pitch, yaw] = peaks;
        let jerk = (x[2] * x[2] + y[2] * y[2] + z[2] * z[2]).sqrt();
        // In A, ω = roll' u + pitch' v + yaw' z with unit vectors u, turned by pitch and yaw, and v, turned
        // by yaw:
        // |u'| ≤ |pitch'| + |yaw'|, |u''| ≤ |pitch''| + |yaw''| + (|pitch'| + |yaw'|)², |v''| ≤ |yaw''| + yaw'².
        let u1 = pitch[0] + yaw[0];
        let u2 = pitch[1] + yaw[1] + u1 * u1;
        let (v1, v2) = (yaw[0], yaw[1] + yaw[0] * yaw[0]);
        let second = roll[2]
            + 2.0 * roll[1] * u1
            + roll[0] * u2
            + pitch[2]
            + 2.0 * pitch[1] * v1
            + pitch[0] * v2
            + yaw[2];
        [jerk, second]
    }
}

#[cfg(test)]
#[path = "trajectory_tests.rs"]
mod tests;

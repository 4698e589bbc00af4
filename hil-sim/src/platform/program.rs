//! What the platform is asked to do, and its exact kinematics.

use serde::{Deserialize, Serialize};

use super::kinematics::{Coordinates, PlateState};
use super::sphere::Sphere;
use super::{MotionError, Pose};

/// One of the six coordinates of the plate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// Along x of A, m.
    X,
    /// Along y of A, m.
    Y,
    /// Along z of A, m.
    Z,
    /// Roll, rad.
    Roll,
    /// Pitch, rad.
    Pitch,
    /// Yaw, rad.
    Yaw,
}

/// `amplitude · sin(2π frequency t + phase)` on one coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SineTerm {
    /// The coordinate that moves.
    pub axis: Axis,
    /// m or rad.
    pub amplitude: f64,
    /// Hz.
    pub frequency_hz: f64,
    /// rad.
    pub phase_rad: f64,
}

/// A piece of a motion. Every piece begins and ends at rest. In JSON `{"hold": {"duration_s": 1.0}}`: an inner tag
/// would go through serde's buffer, which cannot read numbers when `serde_json` keeps them in arbitrary precision.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Segment {
    /// Stand still.
    Hold {
        /// s.
        duration_s: f64,
    },
    /// To another pose, each coordinate on the quintic `10 s³ − 15 s⁴ + 6 s⁵`.
    Move {
        /// Where to.
        to: Pose,
        /// s.
        duration_s: f64,
    },
    /// A sum of sines about the current pose, swelling and fading over `ramp_s` with the same quintic.
    Multisine {
        /// s, both ramps included.
        duration_s: f64,
        /// s, at most half of the duration.
        ramp_s: f64,
        /// The sines.
        terms: Vec<SineTerm>,
    },
    /// Turns about every axis while one point stays still; returns to the pose it began at.
    Sphere(Sphere),
}

impl Segment {
    /// How long it takes, s.
    pub fn duration_s(&self) -> f64 {
        match self {
            Self::Hold { duration_s }
            | Self::Move { duration_s, .. }
            | Self::Multisine { duration_s, .. }
            | Self::Sphere(Sphere { duration_s, .. }) => *duration_s,
        }
    }

    fn check(&self) -> Result<(), &'static str> {
        let duration = self.duration_s();
        if !(duration.is_finite() && duration > 0.0) {
            return Err("its duration must be a positive number of seconds");
        }
        match self {
            Self::Hold { .. } => Ok(()),
            Self::Move { to, .. } if to.coordinates().iter().all(|c| c.is_finite()) => Ok(()),
            Self::Move { .. } => Err("its target has a coordinate that is not a finite number"),
            Self::Multisine { ramp_s, .. } if !(*ramp_s > 0.0 && 2.0 * ramp_s <= duration) => {
                Err("its ramp must be longer than zero and at most half of its duration")
            }
            Self::Multisine { terms, .. }
                if !terms.iter().all(|t| {
                    t.amplitude.is_finite() && t.frequency_hz.is_finite() && t.phase_rad.is_finite()
                }) =>
            {
                Err("a term has an amplitude, frequency or phase that is not a finite number")
            }
            Self::Multisine { .. } => Ok(()),
            Self::Sphere(sphere) => sphere.check(),
        }
    }

    /// Ramp at both ends, s.
    fn ramp_s(&self) -> Option<f64> {
        match self {
            Self::Hold { .. } | Self::Move { .. } => None,
            Self::Multisine { ramp_s, .. } | Self::Sphere(Sphere { ramp_s, .. }) => Some(*ramp_s),
        }
    }
}

/// Where to start and what to do. Travels as JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotionProgram {
    /// The pose at which the plate stands before the first segment.
    pub start: Pose,
    /// What happens, in order.
    pub segments: Vec<Segment>,
}

impl MotionProgram {
    /// The sum of the segments' durations, s.
    pub fn duration_s(&self) -> f64 {
        self.segments.iter().map(Segment::duration_s).sum()
    }

    /// The exact kinematics of the program. Whether a platform can follow is [`super::Geometry::check`]'s business.
    ///
    /// # Errors
    /// The first segment that makes no sense.
    pub fn trajectory(&self) -> Result<Trajectory, MotionError> {
        Trajectory::new(self)
    }
}

/// One segment at its place in time, begun from a known pose.
#[derive(Clone, Debug)]
struct Piece {
    begin_s: f64,
    from: [f64; 6],
    segment: Segment,
}

/// A program ready to be evaluated at any time. Before its beginning and after its end the plate stands still.
#[derive(Clone, Debug)]
pub struct Trajectory {
    start: [f64; 6],
    end: [f64; 6],
    duration_s: f64,
    pieces: Vec<Piece>,
}

/// The quintic from 0 to 1 with its first and second derivatives; its first two derivatives vanish at both ends.
fn quintic(s: f64) -> [f64; 3] {
    if s <= 0.0 {
        return [0.0; 3];
    }
    if s >= 1.0 {
        return [1.0, 0.0, 0.0];
    }
    let r = 1.0 - s;
    [s * s * s * (10.0 + s * (6.0 * s - 15.0)), 30.0 * s * s * r * r, 60.0 * s * r * (1.0 - 2.0 * s)]
}

/// The integral of the quintic from 0 to `s`, and the quintic itself with its derivatives.
pub(crate) fn quintic_integral(s: f64) -> (f64, [f64; 3]) {
    let c = s.clamp(0.0, 1.0);
    (c * c * c * c * (2.5 + c * (c - 3.0)) + (s - 1.0).max(0.0), quintic(s))
}

impl Trajectory {
    /// Places the segments of `program` in time.
    ///
    /// # Errors
    /// The first segment that makes no sense.
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
            pieces.push(Piece { begin_s, from: at, segment: segment.clone() });
            begin_s += segment.duration_s();
            if let Segment::Move { to, .. } = segment {
                at = to.coordinates();
            }
        }
        Ok(Self { start, end: at, duration_s: begin_s, pieces })
    }

    /// A plate that stands still.
    pub fn resting(pose: &Pose) -> Self {
        let at = pose.coordinates();
        Self { start: at, end: at, duration_s: 0.0, pieces: Vec::new() }
    }

    /// How long it takes, s.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Where it starts.
    pub fn start_pose(&self) -> Pose {
        Pose::from_coordinates(self.start)
    }

    /// Where it ends.
    pub fn end_pose(&self) -> Pose {
        Pose::from_coordinates(self.end)
    }

    /// Coordinates with exact derivatives at `time_s`.
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

    /// Times, s, between which every derivative is continuous: the beginning and the end of each segment and of its
    /// ramps, in order.
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

    /// Bounds of `|x'''|`, m/s³, and of `|d²ω/dt²|`, rad/s³, both in A, between the two seams around `time_s`.
    pub(super) fn third_derivatives(&self, time_s: f64) -> [f64; 2] {
        let next = self.pieces.partition_point(|p| p.begin_s <= time_s);
        match next.checked_sub(1).and_then(|i| self.pieces.get(i)) {
            Some(piece) => piece.third_derivatives(time_s - piece.begin_s),
            None => [0.0; 2],
        }
    }

    /// The plate's rigid motion at `time_s`.
    pub fn state(&self, time_s: f64) -> PlateState {
        self.coordinates(time_s).plate_state()
    }
}

impl Piece {
    fn coordinates(&self, t: f64) -> Coordinates {
        let mut c = Coordinates { value: self.from, ..Coordinates::default() };
        match &self.segment {
            Segment::Hold { .. } => {}
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
        let mut peaks = [[0.0_f64; 3]; 6];
        match &self.segment {
            Segment::Hold { .. } => {}
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
        // In A, ω = roll' u + pitch' v + yaw' z with unit vectors u, turned by pitch and yaw, and v, turned by yaw:
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

/// Largest first, second and third derivatives of the quintic over `ramp` seconds: `15/8`, `10/√3` and 60, by the powers of
/// the ramp.
pub(super) fn envelope_peaks(ramp: f64) -> [f64; 3] {
    [1.875 / ramp, 10.0 / (3.0_f64.sqrt() * ramp * ramp), 60.0 / (ramp * ramp * ramp)]
}

/// Up over `ramp`, one, down over `ramp`: value and derivatives in seconds.
pub(super) fn envelope(t: f64, duration: f64, ramp: f64) -> [f64; 3] {
    let down = duration - t;
    if t < ramp {
        let [a, b, c] = quintic(t / ramp);
        [a, b / ramp, c / (ramp * ramp)]
    } else if down < ramp {
        let [a, b, c] = quintic(down / ramp);
        [a, -b / ramp, c / (ramp * ramp)]
    } else {
        [1.0, 0.0, 0.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    fn program() -> MotionProgram {
        let tilted = Pose { position_m: [0.02, -0.03, 0.75], rpy_rad: [0.5, -0.4, 0.3] };
        let term =
            |axis, amplitude, frequency_hz, phase_rad| SineTerm { axis, amplitude, frequency_hz, phase_rad };
        MotionProgram {
            start: Pose { position_m: [0.0, 0.0, 0.734], rpy_rad: [0.0; 3] },
            segments: vec![
                Segment::Hold { duration_s: 0.3 },
                Segment::Move { to: tilted, duration_s: 1.7 },
                Segment::Multisine {
                    duration_s: 6.0,
                    ramp_s: 1.5,
                    terms: vec![
                        term(Axis::X, 0.02, 0.7, 0.1),
                        term(Axis::Z, 0.01, 1.3, 1.0),
                        term(Axis::Roll, 0.2, 0.41, 0.3),
                        term(Axis::Roll, 0.05, 1.1, 2.0),
                        term(Axis::Pitch, 0.15, 0.53, -1.0),
                        term(Axis::Yaw, 0.2, 0.67, 0.5),
                    ],
                },
                Segment::Sphere(Sphere {
                    duration_s: 5.0,
                    ramp_s: 1.2,
                    amplitude_rad: 0.45,
                    frequency_hz: 0.6,
                    turns: 1.5,
                    still_point_m: [0.02, -0.03, 0.2],
                }),
            ],
        }
    }

    /// `[v]×` read back from a skew matrix.
    fn unskew(m: Matrix3<f64>) -> Vector3<f64> {
        0.5 * Vector3::new(m[(2, 1)] - m[(1, 2)], m[(0, 2)] - m[(2, 0)], m[(1, 0)] - m[(0, 1)])
    }

    fn check(label: &str, t: f64, got: Vector3<f64>, want: Vector3<f64>, tolerance: f64) {
        let error = got - want;
        assert!(error.dot(&error).sqrt() < tolerance, "{label} at {t}: {got:?} against {want:?}");
    }

    #[test]
    fn rates_and_accelerations_are_finite_differences_of_position_and_rotation_matrix() {
        let trajectory = program().trajectory().unwrap();
        let h = 1e-4;
        // Times inside each segment and inside each ramp, none within h of a seam (the jerk jumps there).
        for t in [0.15, 0.5, 1.1, 1.9, 2.2, 3.1, 4.0, 5.7, 6.9, 7.8, 8.6, 9.9, 11.3, 12.7] {
            let (before, now, after) =
                (trajectory.state(t - h), trajectory.state(t), trajectory.state(t + h));
            check("v", t, (after.position - before.position) / (2.0 * h), now.velocity, 2e-6);
            check("a", t, (after.velocity - before.velocity) / (2.0 * h), now.acceleration, 2e-5);
            // [ω]× = Rᵀ Ṙ, in the plate's axes.
            let spin = now.rotation.transpose() * (after.rotation - before.rotation) / (2.0 * h);
            check("omega", t, unskew(spin), now.angular_rate, 2e-6);
            // ω̇ from the rotation matrix alone: the axial part of Rᵀ R̈, because [ω]×² is symmetric.
            let second = (after.rotation - 2.0 * now.rotation + before.rotation) / (h * h);
            check("omega dot", t, unskew(now.rotation.transpose() * second), now.angular_acceleration, 2e-5);
        }
    }

    #[test]
    fn rotation_is_orthonormal_and_follows_the_fixed_axes_convention() {
        let state = program().trajectory().unwrap().state(3.3);
        let gap = state.rotation.transpose() * state.rotation - Matrix3::identity();
        assert!(gap.iter().all(|e| e.abs() < 1e-15));
        // Roll 90° then yaw 90° about fixed axes carries y to z and leaves it there.
        let quarter = std::f64::consts::FRAC_PI_2;
        let r = super::super::kinematics::rotation_from_rpy([quarter, 0.0, quarter]);
        assert!((r * Vector3::y() - Vector3::z()).iter().all(|e| e.abs() < 1e-15));
    }

    #[test]
    fn position_rate_and_acceleration_are_continuous_across_every_seam() {
        let p = program();
        let trajectory = p.trajectory().unwrap();
        let mut seam = 0.0;
        let mut seams = vec![0.0];
        for s in &p.segments {
            seam += s.duration_s();
            seams.push(seam);
        }
        seams.extend([2.0 + 1.5, 8.0 - 1.5, 8.0 + 1.2, 13.0 - 1.2]);
        for t in seams {
            let (a, b) = (trajectory.coordinates(t - 1e-9), trajectory.coordinates(t + 1e-9));
            for i in 0..6 {
                assert!((a.value[i] - b.value[i]).abs() < 1e-8, "value {i} at {t}");
                assert!((a.rate[i] - b.rate[i]).abs() < 1e-7, "rate {i} at {t}");
                assert!((a.acceleration[i] - b.acceleration[i]).abs() < 1e-6, "acceleration {i} at {t}");
            }
        }
    }

    #[test]
    fn a_sphere_leaves_its_point_where_it_is_and_returns_to_its_pose() {
        let trajectory = program().trajectory().unwrap();
        let point = Vector3::new(0.02, -0.03, 0.2);
        let at = |t: f64| {
            let s = trajectory.state(t);
            s.position + s.rotation * point
        };
        for t in [8.4, 9.3, 10.0, 11.7, 12.9] {
            check("still point", t, at(t), at(8.0), 1e-14);
            assert!((trajectory.state(t).rotation - trajectory.state(8.0).rotation).norm() > 1e-4);
        }
    }

    /// Differences of exact second derivatives over 0.1 ms never exceed the bound, and the bound is not idle: within a factor
    /// of ten of the largest of them.
    #[test]
    fn third_derivatives_stay_below_their_bounds() {
        let trajectory = program().trajectory().unwrap();
        let seams = trajectory.seams_s();
        assert_eq!(seams.len(), 9);
        for pair in seams.windows(2) {
            let [jerk, second] = trajectory.third_derivatives(0.5 * (pair[0] + pair[1]));
            let (mut most, mut most_turning) = (0.0_f64, 0.0_f64);
            let (steps, h) = (400, 1e-4);
            for k in 0..steps {
                let t = pair[0] + (pair[1] - pair[0] - h) * f64::from(k) / f64::from(steps - 1);
                let (a, b) = (trajectory.state(t), trajectory.state(t + h));
                let turning = b.rotation * b.angular_acceleration - a.rotation * a.angular_acceleration;
                most = most.max((b.acceleration - a.acceleration).norm() / h);
                most_turning = most_turning.max(turning.norm() / h);
            }
            assert!(most <= jerk * (1.0 + 1e-9) + 1e-9, "{pair:?}: {most} {jerk}");
            assert!(most_turning <= second * (1.0 + 1e-9) + 1e-9, "{pair:?}: {most_turning} {second}");
            assert!(second < 10.0 * most_turning + 1e-6, "{pair:?}: {most_turning} {second}");
        }
    }

    #[test]
    fn a_multisine_returns_to_the_pose_it_began_at() {
        let trajectory = program().trajectory().unwrap();
        assert_eq!(
            trajectory.end_pose(),
            Pose { position_m: [0.02, -0.03, 0.75], rpy_rad: [0.5, -0.4, 0.3] }
        );
        assert_eq!(trajectory.coordinates(99.0).rate, [0.0; 6]);
    }

    #[test]
    fn nonsense_segments_are_refused_by_number() {
        let mut p = program();
        p.segments.push(Segment::Hold { duration_s: f64::NAN });
        assert!(matches!(p.trajectory(), Err(MotionError::BadSegment { segment: 5, .. })));
        p.segments[4] = Segment::Multisine { duration_s: 1.0, ramp_s: 0.6, terms: vec![] };
        assert!(matches!(p.trajectory(), Err(MotionError::BadSegment { segment: 5, .. })));
    }

    #[test]
    fn a_program_survives_json() {
        let text = serde_json::to_string(&program()).unwrap();
        assert!(text.contains("{\"multisine\":{") && text.contains("\"axis\":\"roll\""), "{text}");
        assert_eq!(serde_json::from_str::<MotionProgram>(&text).unwrap(), program());
    }
}

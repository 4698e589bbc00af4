//! A program held against the platform's limits before anything moves.

use std::fmt;

use rigident_sim::platform::{Geometry, MotionProgram, Pose};

use super::PlatformError;

/// Steps in which a program is looked at, s.
const STEP_S: f64 = 0.004;

/// How near a program comes to the limits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// How long it takes, s.
    pub duration_s: f64,
    /// Where the plate must stand before, where the platform goes by that.
    pub from: Option<Pose>,
    /// Nothing is said of the machine: the limits are the built-in platform's.
    pub assumed: bool,
    /// Shortest and longest leg on the way, m.
    pub leg_length_m: [f64; 2],
    /// The legs' limits, m.
    pub leg_limits_m: [f64; 2],
    /// Fastest leg, m/s.
    pub leg_rate_mps: f64,
    /// The legs' limit, m/s.
    pub leg_rate_limit_mps: f64,
    /// Greatest distance from home, m.
    pub travel_m: f64,
    /// Greatest tilt against the vertical, rad.
    pub tilt_rad: f64,
    /// Highest velocity, m/s, and angular rate, rad/s.
    pub velocity_mps: f64,
    /// Highest angular rate, rad/s.
    pub angular_rate_radps: f64,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [shortest, longest] = self.leg_length_m;
        let [least, most] = self.leg_limits_m;
        writeln!(f, "the platform is about to move for {:.0} s:", self.duration_s)?;
        if let Some(pose) = &self.from {
            writeln!(f, "  it begins at home: the plate must stand there now, {}", words(pose))?;
        }
        if self.assumed {
            writeln!(f, "  the rig file has no [platform]: the limits are the built-in platform's")?;
        }
        writeln!(f, "  legs      {shortest:.4} to {longest:.4} m of {least:.4} to {most:.4} m")?;
        write!(f, "  leg rate  up to {:.3} ", self.leg_rate_mps)?;
        if self.leg_rate_limit_mps.is_finite() {
            writeln!(f, "of {:.3} m/s", self.leg_rate_limit_mps)?;
        } else {
            writeln!(f, "m/s; the rig file gives no leg_rate_mps to hold it against")?;
        }
        writeln!(
            f,
            "  plate     up to {:.1} mm from home and {:.1} degrees of tilt, {:.3} m/s and {:.2} rad/s",
            1e3 * self.travel_m,
            self.tilt_rad.to_degrees(),
            self.velocity_mps,
            self.angular_rate_radps
        )
    }
}

/// A pose in words: mm in A, degrees.
pub fn words(pose: &Pose) -> String {
    // A negative zero is a zero.
    let [x, y, z] = pose.position_m.map(|v| (1e4 * v).round() / 10.0 + 0.0);
    let [roll, pitch, yaw] = pose.rpy_rad.map(|v| (10.0 * v.to_degrees()).round() / 10.0 + 0.0);
    format!("x {x:.1}, y {y:.1}, z {z:.1} mm, roll {roll:.1}, pitch {pitch:.1}, yaw {yaw:.1} degrees")
}

/// Holds a whole program against the legs' limits.
///
/// # Errors
/// A segment that makes no sense; the first leg that is too short, too long or too fast, with the time.
pub fn check(program: &MotionProgram, geometry: &Geometry) -> Result<Summary, PlatformError> {
    let trajectory = program.trajectory()?;
    geometry.check(&trajectory)?;
    let home = geometry.home();
    let mut summary = Summary {
        duration_s: trajectory.duration_s(),
        leg_length_m: [f64::INFINITY, 0.0],
        leg_limits_m: geometry.leg_length_m,
        leg_rate_limit_mps: geometry.leg_rate_mps,
        ..Summary::default()
    };
    let length = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
    for k in 0..=(trajectory.duration_s() / STEP_S).ceil() as usize {
        let state = trajectory.state((k as f64 * STEP_S).min(trajectory.duration_s()));
        let pose = state.pose();
        for leg in geometry.leg_lengths(&pose) {
            summary.leg_length_m = [summary.leg_length_m[0].min(leg), summary.leg_length_m[1].max(leg)];
        }
        let fastest = geometry.leg_rates(&state).into_iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let away = std::array::from_fn(|i| pose.position_m[i] - home.position_m[i]);
        summary.leg_rate_mps = summary.leg_rate_mps.max(fastest);
        summary.travel_m = summary.travel_m.max(length(away));
        summary.tilt_rad = summary.tilt_rad.max(pose.rotation()[2][2].clamp(-1.0, 1.0).acos());
        summary.velocity_mps = summary.velocity_mps.max(length(state.velocity.into()));
        summary.angular_rate_radps = summary.angular_rate_radps.max(length(state.angular_rate.into()));
    }
    Ok(summary)
}

//! A program compared with the platform's limits before anything moves.

use std::fmt;

use hexapod::{ArmPeak, Geometry, Limit, Load, MotionError, MotionProgram, PlateState, Pose, Travel};

use super::PlatformError;
use super::pace::SLOW_S;
use super::stops::{Stopped, stopped};

/// Steps in which what is shown of a program is examined, s, and how many they are at most. The limits
/// themselves are checked at every instant.
const STEP_S: f64 = 0.004;
const MOST_STEPS: f64 = 50_000.0;

/// The stops that are shown, s: that on the path, and one by the controller itself, of which nothing says how
/// long it takes.
pub const STOPS_S: [f64; 2] = [SLOW_S, 0.1];

/// The statements that cannot be made about a machine whose joints are not published.
pub const WITHOUT_JOINTS: &str = "NOT checked, as the rig file gives no joints: whether the legs reach every \
                                  pose inside the travel, their speeds, accelerations and forces, singular \
                                  poses, collisions";

/// The statements that cannot be made about an arm.
pub const OF_ARMS: &str = "NOT checked: torques of the arm's joints, collisions of the arm with itself, with \
                           the body and with its surroundings: the controller's own limits and safety planes \
                           guard these";

/// The further limits of the legs' forces: name, unit and key.
const FURTHER: [(&str, &str, &str); 3] = [
    ("leg push ", "N", "leg_push_n"),
    ("leg pull ", "N", "leg_pull_n"),
    ("buckling ", "N m2", "leg_buckling_nm2"),
];

/// The distance of a program to the limits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// The duration, s.
    pub duration_s: f64,
    /// The place where the plate must be before, where the platform goes by that.
    pub from: Option<Pose>,
    /// Nothing is said of the machine: the limits are the built-in platform's.
    pub assumed: bool,
    /// The use of the travel of a machine whose joints are not published; nothing is known of legs then.
    pub travel: Option<Used>,
    /// Shortest and longest leg on the way, m.
    pub leg_length_m: [f64; 2],
    /// The legs' limits, m.
    pub leg_limits_m: [f64; 2],
    /// Fastest leg, m/s.
    pub leg_rate_mps: f64,
    /// The legs' limit, m/s.
    pub leg_rate_limit_mps: f64,
    /// Greatest acceleration of a leg, m/s².
    pub leg_acceleration_mps2: f64,
    /// The legs' limit, m/s², if there is one.
    pub leg_acceleration_limit_mps2: Option<f64>,
    /// Greatest force of a leg, N, if it is known what they carry.
    pub leg_force_n: Option<f64>,
    /// The legs' limit, N, if there is one.
    pub leg_force_limit_n: Option<f64>,
    /// Bound of the legs' jerks, m/s³, and its limit, where there is one.
    pub leg_jerk_mps3: Option<[f64; 2]>,
    /// Greatest values of the further limits of forces, and these, where there are any.
    pub further_forces: [Option<[f64; 2]>; 3],
    /// The legs in each of [`STOPS_S`], if it is known what they carry.
    pub stops: Option<[Stopped; 2]>,
    /// Greatest `cond(H)`, and its limit; of a machine with joints.
    pub condition: Option<[f64; 2]>,
    /// Greatest distance from home, m.
    pub travel_m: f64,
    /// Greatest tilt against the vertical, rad.
    pub tilt_rad: f64,
    /// Highest velocity, m/s, and angular rate, rad/s.
    pub velocity_mps: f64,
    /// Highest angular rate, rad/s.
    pub angular_rate_radps: f64,
    /// Greatest acceleration of the plate's origin, m/s².
    pub acceleration_mps2: f64,
    /// Greatest angular acceleration, rad/s².
    pub angular_acceleration_radps2: f64,
    /// The duration of the way to the start, s; it is part of all the above.
    pub way_s: f64,
    /// The duration of the way home, s; likewise.
    pub home_s: f64,
}

/// The part of a plate's travel that a program uses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Used {
    /// Largest share: one is all of it.
    pub share: f64,
    /// The peaks of an arm's joints, if an arm carries the plate: position, rate, acceleration.
    pub arm: Option<[ArmPeak; 3]>,
    /// All of the travel may be used at once.
    pub together: bool,
    /// The limit of the plate's speed, m/s, if there is one.
    pub speed_limit_mps: Option<f64>,
    /// The limit of its angular rate, rad/s, if there is one.
    pub rate_limit_radps: Option<f64>,
}

impl Used {
    fn nothing_of(travel: &Travel) -> Self {
        Self {
            share: 0.0,
            arm: None,
            together: travel.together,
            speed_limit_mps: travel.speed_mps,
            rate_limit_radps: travel.rate_radps,
        }
    }

    fn fmt(&self, summary: &Summary, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let how = if self.together { "of the axis that uses most" } else { "of all axes together" };
        writeln!(f, "  travel    up to {:.0} % {how}", 100.0 * self.share)?;
        let speed = against(summary.velocity_mps, self.speed_limit_mps, 3, "m/s", "plate_speed_mps");
        writeln!(f, "  speed     up to {:.3} {speed}", summary.velocity_mps)?;
        let rate = against(summary.angular_rate_radps, self.rate_limit_radps, 3, "rad/s", "plate_rate_radps");
        writeln!(f, "  turning   up to {:.3} {rate}", summary.angular_rate_radps)?;
        let Some([position, rate, acceleration]) = &self.arm else {
            return writeln!(f, "  {WITHOUT_JOINTS}");
        };
        writeln!(
            f,
            "  joints    up to {:.0} % of their ranges (joint {})",
            100.0 * position.share(),
            position.joint
        )?;
        for (name, unit, peak) in
            [("joint rate", "rad/s", rate), ("joint acceleration", "rad/s2", acceleration)]
        {
            let reserve = 100.0 * (1.0 - peak.share());
            let (value, allowed, joint) = (peak.value, peak.allowed, peak.joint);
            writeln!(
                f,
                "  {name} up to {value:.3} of {allowed:.3} {unit}, {reserve:.0} % in reserve (joint {joint})"
            )?;
        }
        writeln!(f, "  {OF_ARMS}")
    }
}

/// Returns a peak against a limit that may not be given, and the reserve.
fn against(peak: f64, limit: Option<f64>, digits: usize, unit: &str, key: &str) -> String {
    match limit.filter(|limit| limit.is_finite()) {
        Some(limit) => {
            format!("of {limit:.digits$} {unit}, {:.0} % in reserve", 100.0 * (1.0 - peak / limit))
        }
        None => format!("{unit}; the rig file gives no {key} to compare it with"),
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the platform is about to move for {:.0} s", self.duration_s)?;
        if self.way_s > 0.0 {
            write!(f, ", {:.1} s of which are the way to the start", self.way_s)?;
        }
        if self.home_s > 0.0 {
            write!(f, ", {:.1} s the way home", self.home_s)?;
        }
        writeln!(f, ":")?;
        if let Some(pose) = &self.from {
            writeln!(f, "  it begins at home: the plate must be there now, {}", words(pose))?;
        }
        if self.assumed {
            writeln!(f, "  the rig file has no [platform]: the limits are the built-in platform's")?;
        }
        if let Some(used) = &self.travel {
            used.fmt(self, f)?;
            return self.plate(f);
        }
        self.legs(f)?;
        self.forces(f)?;
        if let Some([led, stopped]) = self.stops {
            writeln!(
                f,
                "  stops     leg force up to {:.1} N led to rest in {} s, {:.1} N if a stop takes {} s; leg \
                 acceleration up to {:.2} and {:.2} m/s2",
                led.leg_force_n,
                led.stop_s,
                stopped.leg_force_n,
                stopped.stop_s,
                led.leg_acceleration_mps2,
                stopped.leg_acceleration_mps2
            )?;
        }
        if let Some([condition, limit]) = self.condition {
            let words = against(condition, Some(limit), 1, "", "cond_max").replace("  ", " ");
            writeln!(
                f,
                "  condition up to {condition:.1} {words}; it is infinite where the pose is singular"
            )?;
        }
        self.plate(f)
    }
}

impl Summary {
    /// Writes lengths, speeds and accelerations of the legs.
    fn legs(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [shortest, longest] = self.leg_length_m;
        let [least, most] = self.leg_limits_m;
        write!(f, "  legs      {shortest:.4} to {longest:.4} m of {least:.4} to {most:.4} m")?;
        let reserve = self.stroke_reserve().unwrap_or_default();
        writeln!(
            f,
            ", {:.1} mm in reserve, {:.0} % of the stroke",
            1e3 * reserve * (most - least),
            100.0 * reserve
        )?;
        let rate = against(self.leg_rate_mps, Some(self.leg_rate_limit_mps), 3, "m/s", "leg_rate_mps");
        writeln!(f, "  leg rate  up to {:.3} {rate}", self.leg_rate_mps)?;
        let acceleration = against(
            self.leg_acceleration_mps2,
            self.leg_acceleration_limit_mps2,
            2,
            "m/s2",
            "leg_acceleration_mps2",
        );
        writeln!(f, "  leg acceleration up to {:.2} {acceleration}", self.leg_acceleration_mps2)
    }

    /// Writes forces and jerks of the legs.
    fn forces(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.leg_force_n, self.leg_force_limit_n) {
            (Some(most), limit) => {
                let force = against(most, limit, 1, "N", "leg_force_n");
                writeln!(
                    f,
                    "  leg force up to {most:.1} {force}, for any body that may be on the load cell"
                )?;
            }
            (None, Some(limit)) => {
                writeln!(
                    f,
                    "  leg force NOT checked against {limit:.1} N: nothing says what the legs carry"
                )?;
            }
            (None, None) => writeln!(f, "  leg force not known: nothing says what the legs carry")?,
        }
        for ((name, unit, key), values) in FURTHER.into_iter().zip(self.further_forces) {
            let Some([most, limit]) = values else { continue };
            writeln!(f, "  {name} up to {most:.1} {}", against(most, Some(limit), 1, unit, key))?;
        }
        if let Some([most, limit]) = self.leg_jerk_mps3 {
            let words = against(most, Some(limit), 1, "m/s3", "leg_jerk_mps3");
            writeln!(f, "  leg jerk  stays below {most:.1} {words}")?;
        }
        Ok(())
    }

    /// Returns how much of the legs' stroke is never used at the end that is come nearer to, as a share;
    /// `None` where nothing is known of legs, or nothing moves.
    pub fn stroke_reserve(&self) -> Option<f64> {
        let ([shortest, longest], [least, most]) = (self.leg_length_m, self.leg_limits_m);
        (self.travel.is_none() && longest > 0.0)
            .then(|| (shortest - least).min(most - longest) / (most - least))
    }

    fn plate(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "  plate     up to {:.1} mm from home and {:.1} degrees of tilt, {:.3} m/s and {:.2} rad/s, \
             {:.2} m/s2 and {:.2} rad/s2",
            1e3 * self.travel_m,
            self.tilt_rad.to_degrees(),
            self.velocity_mps,
            self.angular_rate_radps,
            self.acceleration_mps2,
            self.angular_acceleration_radps2
        )
    }
}

/// Returns a pose in words: mm in A, degrees.
pub fn words(pose: &Pose) -> String {
    // A negative zero is a zero.
    let [x, y, z] = pose.position_m.map(|v| (1e4 * v).round() / 10.0 + 0.0);
    let [roll, pitch, yaw] = pose.rpy_rad.map(|v| (10.0 * v.to_degrees()).round() / 10.0 + 0.0);
    format!("x {x:.1}, y {y:.1}, z {z:.1} mm, roll {roll:.1}, pitch {pitch:.1}, yaw {yaw:.1} degrees")
}

/// Holds a whole program against the legs' limits, at every instant; with what they carry, `load`, their
/// forces too.
///
/// # Errors
/// A segment that makes no sense; a leg that is too short, too long, too fast or too much loaded, with the
/// time.
pub fn check(
    program: &MotionProgram,
    geometry: &Geometry,
    load: Option<&Load>,
) -> Result<Summary, PlatformError> {
    let trajectory = program.trajectory()?;
    match load {
        Some(load) => geometry.check_loaded(&trajectory, load)?,
        None => geometry.check(&trajectory)?,
    }
    let step_s = (trajectory.duration_s() / MOST_STEPS).max(STEP_S);
    let force =
        |load| geometry.peak_leg_forces(&trajectory, step_s, load).map(|f| f.into_iter().fold(0.0, f64::max));
    let stops = |load| {
        let [led, halted] = STOPS_S.map(|stop_s| stopped(&trajectory, geometry, load, stop_s));
        Ok::<_, MotionError>([led?, halted?])
    };
    let mut summary = Summary { duration_s: trajectory.duration_s(), ..Summary::default() };
    match &geometry.travel {
        Some(travel) => {
            let arm = geometry.arm.as_ref().and_then(|arm| arm.peaks(&trajectory).ok());
            summary.travel = Some(Used { arm, ..Used::nothing_of(travel) });
        }
        None => {
            summary.leg_length_m = [f64::INFINITY, 0.0];
            summary.leg_limits_m = geometry.leg_length_m;
            summary.leg_rate_limit_mps = geometry.leg_rate_mps;
            summary.leg_acceleration_limit_mps2 = geometry.limits.leg_acceleration_mps2;
            summary.leg_force_n = load.map(force).transpose()?;
            summary.stops = load.map(stops).transpose()?;
            summary.leg_force_limit_n = geometry.limits.leg_force_n;
            summary.condition = Some([1.0, geometry.limits.cond_max]);
            summary.leg_jerk_mps3 =
                geometry.limits.leg_jerk_mps3.map(|limit| [geometry.jerk_share(&trajectory) * limit, limit]);
            let limits = &geometry.limits;
            let further = [limits.leg_push_n, limits.leg_pull_n, limits.leg_buckling_nm2];
            summary.further_forces =
                further.map(|limit| limit.filter(|_| load.is_some()).map(|limit| [0.0, limit]));
        }
    }
    for k in 0..=(trajectory.duration_s() / step_s).ceil() as usize {
        let state = trajectory.state((k as f64 * step_s).min(trajectory.duration_s()));
        summary.take(geometry, &state);
        if let Some(load) = load.filter(|_| summary.further_forces.iter().any(Option::is_some)) {
            summary.take_forces(geometry, &state, load);
        }
        // It changes slowly, and takes ten times as long as all the rest.
        if k % 10 == 0
            && let Some([most, _]) = &mut summary.condition
        {
            *most = most.max(geometry.condition_number(&state.pose()));
        }
    }
    Ok(summary)
}

impl Summary {
    /// Counts the forces of one state, where there are limits of pushing, pulling or buckling legs.
    fn take_forces(&mut self, geometry: &Geometry, state: &PlateState, load: &Load) {
        let margins = geometry.margins(state, Some(load));
        let kinds = [Limit::LegPush, Limit::LegPull, Limit::LegBuckling];
        for margin in margins.all() {
            let Some(k) = kinds.iter().position(|kind| *kind == margin.at.limit) else { continue };
            if let Some([most, _]) = &mut self.further_forces[k] {
                *most = most.max(margin.at.value);
            }
        }
    }

    /// Counts one state.
    fn take(&mut self, geometry: &Geometry, state: &PlateState) {
        let length = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
        let largest = |values: [f64; 6]| values.into_iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let pose = state.pose();
        if let (Some(used), Some(travel)) = (&mut self.travel, &geometry.travel) {
            used.share = used.share.max(travel.margins(state).share);
        } else {
            for leg in geometry.leg_lengths(&pose) {
                self.leg_length_m = [self.leg_length_m[0].min(leg), self.leg_length_m[1].max(leg)];
            }
            self.leg_rate_mps = self.leg_rate_mps.max(largest(geometry.leg_rates(state)));
            self.leg_acceleration_mps2 =
                self.leg_acceleration_mps2.max(largest(geometry.leg_accelerations(state)));
        }
        self.acceleration_mps2 = self.acceleration_mps2.max(length(state.acceleration.into()));
        self.angular_acceleration_radps2 =
            self.angular_acceleration_radps2.max(length(state.angular_acceleration.into()));
        let home = geometry.home();
        let away = std::array::from_fn(|i| pose.position_m[i] - home.position_m[i]);
        self.travel_m = self.travel_m.max(length(away));
        self.tilt_rad = self.tilt_rad.max(pose.rotation()[2][2].clamp(-1.0, 1.0).acos());
        self.velocity_mps = self.velocity_mps.max(length(state.velocity.into()));
        self.angular_rate_radps = self.angular_rate_radps.max(length(state.angular_rate.into()));
    }
}

#[cfg(test)]
mod tests {
    use hexapod::BodyParameters;
    use hexapod::Segment;

    use super::*;

    #[test]
    fn a_machine_without_joints_shows_its_travel_and_the_checks_left_out() {
        let travel = Travel {
            shift_m: [0.1; 3],
            turn_rad: [0.5; 3],
            together: false,
            speed_mps: Some(0.2),
            rate_radps: None,
        };
        let to = Pose { position_m: [0.05, 0.0, 0.0], rpy_rad: [0.0, 0.1, 0.0] };
        let segments = vec![Segment::Move { to, duration_s: 2.0 }];
        let program = MotionProgram { start: Pose::default(), segments };
        let load = Load::body(BodyParameters::thesis_horizontal());
        let said = check(&program, &Geometry::of_travel(travel), Some(&load)).unwrap().to_string();
        // The quintic's highest rate is 15/8 of its mean.
        for words in [
            "travel    up to 70 % of all axes together",
            "speed     up to 0.047 of 0.200 m/s",
            "turning   up to 0.094 rad/s; the rig file gives no plate_rate_radps",
            WITHOUT_JOINTS,
        ] {
            assert!(said.contains(words), "{words}\n{said}");
        }
        assert!(!said.contains("leg force") && !said.contains("leg rate"), "{said}");
    }

    #[test]
    fn a_limit_of_force_is_checked_or_said_not_to_be() {
        let mut geometry = Geometry::thesis();
        let program =
            MotionProgram { start: geometry.home(), segments: vec![Segment::Hold { duration_s: 2.0 }] };
        let load = Load::body(BodyParameters::thesis_horizontal());
        let said = |geometry: &Geometry, load: Option<&Load>| {
            check(&program, geometry, load).map(|s| s.to_string()).map_err(|e| e.to_string())
        };
        let unlimited = said(&geometry, Some(&load)).unwrap();
        assert!(
            unlimited.contains("leg force up to 37.6 N; the rig file gives no leg_force_n"),
            "{unlimited}"
        );
        assert!(said(&geometry, None).unwrap().contains("leg force not known"));
        geometry.limits.leg_force_n = Some(60.0);
        assert!(said(&geometry, None).unwrap().contains("leg force NOT checked against 60.0 N"));
        // 20 kg on six legs alike.
        assert!(said(&geometry, Some(&load)).unwrap().contains("leg force up to 37.6 of 60.0 N"));
        geometry.limits.leg_force_n = Some(30.0);
        let error = said(&geometry, Some(&load)).unwrap_err();
        assert!(error.contains("would carry 37.6 N, its limit is 30.0 N at t = 0.000 s"), "{error}");
    }
}

//! The platform that a rig file describes.

use std::fmt;

use hexapod::BodyParameters;
use hexapod::Mounting;
use hexapod::{Bodies, Bulk, COND_MAX, Geometry, JointCones, Limit, Limits, Load, Pose, Travel, Violation};
use nalgebra::{Matrix3, Vector3};

use super::workspace;
use rigident_io::rig::{PartTable, PlatformTable, RigFile};

/// Share of the legs' stroke, or of the plate's travel, that plans leave unused, half of it at either end.
pub const RESERVE: f64 = 0.05;

/// Errors and missing values of a `[platform]` table beyond single numbers.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MachineError {
    /// No table.
    #[error("there is no [platform] to plan for: add one, or leave `rig` out for the built-in platform")]
    NoPlatform,
    /// A key without which nothing can be said.
    #[error("[platform] has no {0}")]
    Missing(&'static str),
    /// A request that depends on joints to a machine without them.
    #[error(
        "[platform] gives no joints, and what its plate reaches at once depends on them: `plan_motion()` and \
         `run()` do with travel_m and travel_rad"
    )]
    NoJoints,
    /// Axes of joints that are not limited, or of length zero.
    #[error("[platform] {0}")]
    Axes(String),
    /// A rotation that is none.
    #[error("[platform.load_cell] rotation_wxyz is no rotation")]
    LoadCell,
    /// An arm that cannot be one.
    #[error("[platform.arm] {0}")]
    Arm(String),
    /// Limits that contradict each other: no level pose keeps them.
    #[error(
        "[platform]: the limits contradict each other, the plate cannot stand level anywhere; best is {at}, \
         where {violation}{advice}"
    )]
    NoLevelPose {
        /// The best level pose.
        at: Metres,
        /// The violation there.
        violation: Violation,
        /// The remedy.
        advice: &'static str,
    },
}

/// Returns the limits of a rig file's platform that are single numbers: all but the joints' cones and the
/// thickness of the parts.
pub fn limits(table: &PlatformTable) -> Limits {
    Limits {
        leg_acceleration_mps2: table.leg_acceleration_mps2,
        leg_jerk_mps3: table.leg_jerk_mps3,
        leg_force_n: table.leg_force_n,
        leg_push_n: table.leg_push_n,
        leg_pull_n: table.leg_pull_n,
        leg_buckling_nm2: table.leg_buckling_nm2,
        base_joints: None,
        plate_joints: None,
        cond_max: table.cond_max.unwrap_or(COND_MAX),
        bulk: None,
    }
}

/// Returns the platform of a rig file. Limits that the file does not give do not bind, but for `cond_max`,
/// which is 40 then.
///
/// # Errors
/// The entries that the table lacks, or limits that no level pose keeps.
pub fn geometry(rig: &RigFile) -> Result<Geometry, MachineError> {
    let table = rig.platform.as_ref().ok_or(MachineError::NoPlatform)?;
    let geometry = unchecked(table)?;
    if !geometry.has_joints() {
        return Ok(geometry);
    }
    let level = level(&geometry).map_err(no_level_pose(table.cond_max.is_some()))?;
    let parts = parts(Some(table));
    if !parts.is_empty() {
        let load =
            Load { bodies: Bodies::Known(parts), gravity_mps2: [0.0, 0.0, -rig.recording.gravity_mps2] };
        geometry
            .check_pose_loaded(&level, &load)
            .map_err(|violation| no_level_pose(table.cond_max.is_some())((level, violation)))?;
    }
    Ok(geometry)
}

/// Returns the platform of a rig file, whose joints must be known.
///
/// # Errors
/// See [`geometry`]; a machine without joints.
pub fn with_joints(rig: &RigFile) -> Result<Geometry, MachineError> {
    geometry(rig).and_then(|g| if g.has_joints() { Ok(g) } else { Err(MachineError::NoJoints) })
}

/// Returns the platform of a rig file, or the thesis' one if the file does not describe any.
///
/// # Errors
/// See [`geometry`], for a table that is there and says anything of joints or legs.
pub fn geometry_or_thesis(rig: &RigFile) -> Result<Geometry, MachineError> {
    if is_described(rig) { geometry(rig) } else { Ok(Geometry::thesis()) }
}

/// Returns whether the rig file says anything of joints or legs.
pub fn is_described(rig: &RigFile) -> bool {
    rig.platform.as_ref().is_some_and(|t| {
        *t != PlatformTable {
            load_cell: t.load_cell.clone(),
            load_max_kg: t.load_max_kg,
            load_within_m: t.load_within_m,
            part: t.part.clone(),
            ..PlatformTable::default()
        }
    })
}

/// Returns where the load cell is on the plate: its origin in P, m, and its axes to the plate's.
///
/// # Errors
/// A rotation that is none.
pub fn load_cell(rig: &RigFile) -> Result<(Vector3<f64>, Matrix3<f64>), MachineError> {
    match rig.platform.as_ref().and_then(|p| p.load_cell.as_ref()) {
        None => Ok((Vector3::zeros(), Matrix3::identity())),
        Some(place) => {
            let mounting = Mounting { position_m: place.position_m, rotation_wxyz: place.rotation_wxyz };
            let rotation = mounting.rotation().ok_or(MachineError::LoadCell)?;
            Ok((Vector3::from(place.position_m), rotation))
        }
    }
}

/// Returns plate, load cell and adapter, in P.
pub fn parts(platform: Option<&PlatformTable>) -> Vec<BodyParameters> {
    let parts = platform.map_or(&[][..], |platform| &platform.part);
    let of = |part: &PartTable| BodyParameters {
        mass_kg: part.mass_kg,
        com_m: part.com_m,
        inertia_com_kgm2: part.inertia_com_kgm2,
    };
    parts.iter().map(of).collect()
}

/// Converts a body of the load cell's frame to P: the cell's origin in P, m, and its axes to the plate's.
pub fn on_plate(body: &BodyParameters, at: &Vector3<f64>, rotation: &Matrix3<f64>) -> BodyParameters {
    let com = at + rotation * Vector3::from(body.com_m);
    let inertia = rotation * body.inertia_com() * rotation.transpose();
    BodyParameters {
        com_m: com.into(),
        inertia_com_kgm2: [(0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1)].map(|at| inertia[at]),
        ..*body
    }
}

/// Checks whether the limits leave a level pose.
///
/// # Errors
/// The violation at the best level pose.
pub fn check(geometry: &Geometry) -> Result<(), MachineError> {
    level(geometry).map(|_| ()).map_err(no_level_pose(true))
}

/// Returns the level pose; where nothing but a collision bars all of them, the error names that.
fn level(geometry: &Geometry) -> Result<Pose, (Pose, Violation)> {
    workspace::level(geometry).map_err(|best| {
        let mut thin = geometry.clone();
        thin.limits.bulk = None;
        let collides = |pose: Pose| geometry.check_pose(&pose).err().map(|violation| (pose, violation));
        workspace::level(&thin).ok().and_then(collides).unwrap_or(best)
    })
}

/// Returns a function that makes the error of a machine without a level pose. Its advice depends on the
/// limit, and on whether the file gives the guard.
fn no_level_pose(guard_is_given: bool) -> impl Fn((Pose, Violation)) -> MachineError {
    move |(pose, violation)| {
        let advice = match violation.limit {
            Limit::Conditioning if !guard_is_given => {
                "; no cond_max is given and 40 is taken: the joints of base and plate may be entered \
                 wrongly, or lie nearly alike"
            }
            limit if limit.is_of_force() => ": the legs are too weak for the weight of [[platform.part]]",
            Limit::Clearance => {
                ": look at leg_radius_m, joint_length_m, plate_radius_m, base_radius_m, clearance_m"
            }
            _ => "",
        };
        MachineError::NoLevelPose { at: Metres(pose.position_m), violation, advice }
    }
}

/// A place, to the tenth of a millimetre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Metres(pub [f64; 3]);

impl fmt::Display for Metres {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Rounding leaves no negative zero.
        let [x, y, z] = self.0.map(|v| (v * 1e4).round() / 1e4 + 0.0);
        write!(f, "x = {x:.4} m, y = {y:.4} m, z = {z:.4} m")
    }
}

fn unchecked(table: &PlatformTable) -> Result<Geometry, MachineError> {
    let travel = travel(table)?;
    if let Some(arm) = &table.arm {
        let travel = travel.ok_or(MachineError::Missing(
            "travel_m and travel_rad: how far the flange of [platform.arm] goes to either side of its place \
             at home_rad, m and rad",
        ))?;
        return Ok(Geometry::of_arm(super::arm::arm(arm).map_err(MachineError::Arm)?, travel));
    }
    if let Some(travel) = travel {
        return Ok(Geometry::of_travel(travel));
    }
    let mut geometry = Geometry {
        base_joints_m: table.base_joints_m.ok_or(MachineError::Missing("base_joints_m"))?,
        plate_joints_m: table.plate_joints_m.ok_or(MachineError::Missing("plate_joints_m"))?,
        leg_length_m: table.leg_length_m.ok_or(MachineError::Missing("leg_length_m"))?,
        leg_rate_mps: table.leg_rate_mps.unwrap_or(f64::INFINITY),
        limits: Limits { bulk: bulk(table)?, ..limits(table) },
        travel: None,
        arm: None,
    };
    let base = cones(&geometry, "base", table.base_joint_angle_rad, table.base_joint_axes)?;
    let plate = cones(&geometry, "plate", table.plate_joint_angle_rad, table.plate_joint_axes)?;
    geometry.limits.base_joints = base;
    geometry.limits.plate_joints = plate;
    Ok(geometry)
}

/// Returns what a table says of a plate whose joints it does not give.
fn travel(table: &PlatformTable) -> Result<Option<Travel>, MachineError> {
    let of_plate = [
        ("travel_m", table.travel_m.is_some()),
        ("travel_rad", table.travel_rad.is_some()),
        ("travel_together", table.travel_together),
        ("plate_speed_mps", table.plate_speed_mps.is_some()),
        ("plate_rate_radps", table.plate_rate_radps.is_some()),
    ];
    let of_legs = [
        ("base_joints_m", table.base_joints_m.is_some()),
        ("plate_joints_m", table.plate_joints_m.is_some()),
        ("leg_length_m", table.leg_length_m.is_some()),
        ("leg_rate_mps", table.leg_rate_mps.is_some()),
        ("leg_acceleration_mps2", table.leg_acceleration_mps2.is_some()),
        ("leg_jerk_mps3", table.leg_jerk_mps3.is_some()),
        ("leg_force_n", table.leg_force_n.is_some()),
        ("leg_push_n", table.leg_push_n.is_some()),
        ("leg_pull_n", table.leg_pull_n.is_some()),
        ("leg_buckling_nm2", table.leg_buckling_nm2.is_some()),
        ("base_joint_angle_rad", table.base_joint_angle_rad.is_some()),
        ("base_joint_axes", table.base_joint_axes.is_some()),
        ("plate_joint_angle_rad", table.plate_joint_angle_rad.is_some()),
        ("plate_joint_axes", table.plate_joint_axes.is_some()),
        ("leg_radius_m", table.leg_radius_m.is_some()),
        ("joint_length_m", table.joint_length_m.is_some()),
        ("plate_radius_m", table.plate_radius_m.is_some()),
        ("base_radius_m", table.base_radius_m.is_some()),
        ("clearance_m", table.clearance_m.is_some()),
        ("cond_max", table.cond_max.is_some()),
    ];
    let first = |keys: &[(&'static str, bool)]| keys.iter().find(|(_, given)| *given).map(|(key, _)| *key);
    let Some(of_plate) = first(&of_plate) else { return Ok(None) };
    if let Some(of_legs) = first(&of_legs) {
        return Err(MachineError::Axes(format!(
            "{of_plate} is for a machine whose joints are not published, and {of_legs} needs them: leave one \
             of them out"
        )));
    }
    let shift_m = table.travel_m.ok_or(MachineError::Missing(
        "travel_m: how far the plate goes along x, y, z to either side, m; it goes with travel_rad",
    ))?;
    let turn_rad = table.travel_rad.ok_or(MachineError::Missing(
        "travel_rad: how far the plate rolls, pitches and yaws to either side, rad; it goes with travel_m",
    ))?;
    Ok(Some(Travel {
        shift_m,
        turn_rad,
        together: table.travel_together,
        speed_mps: table.plate_speed_mps,
        rate_radps: table.plate_rate_radps,
    }))
}

/// Returns how thick legs, plate and base are; `None` where nothing is said of that.
fn bulk(table: &PlatformTable) -> Result<Option<Bulk>, MachineError> {
    let Some(leg_radius_m) = table.leg_radius_m else {
        let others = [
            ("joint_length_m", table.joint_length_m),
            ("plate_radius_m", table.plate_radius_m),
            ("base_radius_m", table.base_radius_m),
            ("clearance_m", table.clearance_m),
        ];
        return match others.into_iter().find(|(_, value)| value.is_some()) {
            Some((name, _)) => Err(MachineError::Axes(format!(
                "{name} is there to keep legs, plate and base apart, but leg_radius_m, how thick a leg is, \
                 is missing"
            ))),
            None => Ok(None),
        };
    };
    let joint_length_m = table.joint_length_m.ok_or(MachineError::Missing(
        "joint_length_m: what of a leg belongs to its joint at either end, where it touches others by \
         design; it goes with leg_radius_m",
    ))?;
    if table.leg_length_m.is_some_and(|[shortest, _]| 2.0 * joint_length_m >= shortest) {
        return Err(MachineError::Axes(format!(
            "joint_length_m = {joint_length_m} at either end leaves nothing of the shortest leg"
        )));
    }
    Ok(Some(Bulk {
        leg_radius_m,
        joint_length_m,
        plate_radius_m: table.plate_radius_m,
        base_radius_m: table.base_radius_m,
        clearance_m: table.clearance_m.unwrap_or(0.0),
    }))
}

/// Returns the joints' cones. Without axes they are the legs' directions at home.
fn cones(
    geometry: &Geometry,
    joint: &str,
    half_angle_rad: Option<f64>,
    axes: Option<[[f64; 3]; 6]>,
) -> Result<Option<JointCones>, MachineError> {
    match (half_angle_rad, axes) {
        (None, None) => Ok(None),
        (None, Some(_)) => Err(MachineError::Axes(format!(
            "{joint}_joint_axes says about which axes the joints turn, but {joint}_joint_angle_rad, how far, \
             is missing"
        ))),
        (Some(half_angle), None) => Ok(Some(geometry.cones_about_home(half_angle))),
        (Some(half_angle_rad), Some(axes)) => {
            match axes.iter().position(|a| Vector3::from(*a).norm() < 1e-9) {
                Some(i) => Err(MachineError::Axes(format!(
                    "{joint}_joint_axes: the axis of joint {} is zero",
                    i + 1
                ))),
                None => Ok(Some(JointCones { axes, half_angle_rad })),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the thesis' platform as a table, and what is added to it.
    fn file(more: &str) -> RigFile {
        let g = Geometry::thesis();
        let text = format!(
            "[platform]\nbase_joints_m = {:?}\nplate_joints_m = {:?}\n{more}",
            g.base_joints_m, g.plate_joints_m
        );
        RigFile::parse(&text).unwrap()
    }

    #[test]
    fn a_table_with_every_key_becomes_the_same_platform() {
        let mut want = Geometry::thesis();
        want.limits = Limits {
            leg_acceleration_mps2: Some(8.0),
            leg_jerk_mps3: Some(90.0),
            leg_force_n: Some(2000.0),
            leg_push_n: Some(1900.0),
            leg_pull_n: Some(500.0),
            leg_buckling_nm2: Some(1000.0),
            base_joints: Some(JointCones { axes: [[0.0, 0.0, 1.0]; 6], half_angle_rad: 0.9 }),
            plate_joints: Some(want.cones_about_home(0.8)),
            cond_max: 30.0,
            bulk: Some(Bulk {
                leg_radius_m: 0.025,
                joint_length_m: 0.08,
                plate_radius_m: Some(0.02),
                base_radius_m: None,
                clearance_m: 0.005,
            }),
        };
        let read = file(
            "leg_length_m = [0.55, 0.8548]\nleg_rate_mps = 0.8\nleg_acceleration_mps2 = 8\nleg_force_n = \
             2000\n\
             leg_jerk_mps3 = 90\nleg_push_n = 1900\nleg_pull_n = 500\nleg_buckling_nm2 = 1000\n\
             base_joint_angle_rad = 0.9\nbase_joint_axes = \
             [[0,0,1],[0,0,1],[0,0,1],[0,0,1],[0,0,1],[0,0,1]]\n\
             plate_joint_angle_rad = 0.8\ncond_max = 30\nleg_radius_m = 0.025\njoint_length_m = 0.08\n\
             plate_radius_m = 0.02\nclearance_m = 0.005",
        );
        assert_eq!(geometry(&read).unwrap(), want);
        assert_eq!(geometry_or_thesis(&read).unwrap(), want);
    }

    #[test]
    fn a_table_of_travel_is_a_machine_without_joints_and_contradictions_are_named() {
        let travel = "travel_m = [0.05, 0.05, 0.025]\ntravel_rad = [0.26, 0.26, 0.5]\n";
        let read = |more: &str| geometry(&RigFile::parse(&format!("[platform]\n{more}")).unwrap());
        let whole = read(&format!("{travel}plate_speed_mps = 0.05\nplate_rate_radps = 0.6")).unwrap();
        assert!(!whole.has_joints());
        let want = Travel {
            shift_m: [0.05, 0.05, 0.025],
            turn_rad: [0.26, 0.26, 0.5],
            together: false,
            speed_mps: Some(0.05),
            rate_radps: Some(0.6),
        };
        assert_eq!(whole.travel, Some(want));
        let rig = RigFile::parse(&format!("[platform]\n{travel}")).unwrap();
        assert_eq!(with_joints(&rig).unwrap_err(), MachineError::NoJoints);
        for (more, words) in [
            (format!("{travel}leg_force_n = 200"), &["travel_m", "leg_force_n", "leave one of them out"][..]),
            ("travel_m = [0.1, 0.1, 0.1]".to_owned(), &["has no travel_rad"]),
            ("plate_speed_mps = 0.1".to_owned(), &["has no travel_m"]),
        ] {
            let error = read(&more).unwrap_err().to_string();
            for word in words {
                assert!(error.contains(word), "{more}\n{word}\n{error}");
            }
        }
        for wrong in ["travel_m = [0.1, 0, 0.1]", "travel_rad = [0.1, 1.6, 0.1]", "plate_speed_mps = -1"] {
            let error = RigFile::parse(&format!("[platform]\n{wrong}")).unwrap_err().to_string();
            let key = wrong.split(' ').next().unwrap();
            assert!(error.contains(key), "{error}");
        }
    }

    #[test]
    fn limits_that_no_level_pose_keeps_name_the_leg_or_the_guard() {
        for (more, words) in [
            (
                "leg_length_m = [0.1, 0.2]",
                &["contradict", "leg ", "it reaches from 0.1000 m to 0.2000 m"][..],
            ),
            ("leg_length_m = [0.55, 0.8548]\ncond_max = 5", &["contradict", "cond(H)", "its limit is 5.000"]),
            (
                "leg_length_m = [0.55, 0.8548]\nbase_joint_angle_rad = 0.1\n\
                 base_joint_axes = [[1,0,0],[0,0,1],[0,0,1],[0,0,1],[0,0,1],[0,0,1]]",
                &["contradict", "leg 1 "],
            ),
        ] {
            let error = geometry(&file(more)).unwrap_err().to_string();
            for word in words {
                assert!(error.contains(word), "{more}\n{word}\n{error}");
            }
        }
    }

    #[test]
    fn a_weight_that_the_legs_cannot_carry_at_rest_is_a_contradiction() {
        let part = "[[platform.part]]\nname = \"plate\"\nmass_kg = 20\ncom_m = [0, 0, 0.05]\n";
        let with =
            |force: f64| file(&format!("leg_length_m = [0.55, 0.8548]\nleg_force_n = {force}\n{part}"));
        let error = geometry(&with(10.0)).unwrap_err().to_string();
        // 20 kg on six legs alike: m g / (6 n_z).
        let g = Geometry::thesis();
        let level = workspace::level(&g).unwrap();
        let want = 20.0 * 9.80665 / (6.0 * g.legs(&level).directions[0].z);
        for word in
            [&format!("would carry {want:.1} N")[..], "its limit is 10.0 N", "too weak for the weight"]
        {
            assert!(error.contains(word), "{word}: {error}");
        }
        geometry(&with(want * 1.05)).unwrap();
    }

    /// An enlargement has the same numbers as the machine, so that one guard suits all sizes.
    #[test]
    fn the_guard_means_the_same_on_a_machine_of_any_size() {
        let g = Geometry::thesis();
        for scale in [0.1, 4.0] {
            let scaled = |joints: [[f64; 3]; 6]| joints.map(|j| j.map(|v| v * scale));
            let text = format!(
                "[platform]\nbase_joints_m = {:?}\nplate_joints_m = {:?}\nleg_length_m = {:?}\n",
                scaled(g.base_joints_m),
                scaled(g.plate_joints_m),
                g.leg_length_m.map(|l| l * scale)
            );
            let other = geometry(&RigFile::parse(&text).unwrap()).unwrap();
            for yaw_deg in [0.0, 40.0, 80.0, 86.0] {
                let at = |g: &Geometry| {
                    let mut pose = g.home();
                    pose.rpy_rad = [0.1, -0.2, f64::to_radians(yaw_deg)];
                    g.condition_number(&pose)
                };
                assert!((at(&other) / at(&g) - 1.0).abs() < 1e-9, "{scale} {yaw_deg}");
            }
        }
    }

    #[test]
    fn parts_that_collide_in_every_level_pose_are_named_and_so_are_keys_without_their_fellows() {
        let legs = "leg_length_m = [0.55, 0.8548]\n";
        for (more, words) in [
            ("plate_radius_m = 0.02", &["plate_radius_m", "leg_radius_m"][..]),
            ("leg_radius_m = 0.02", &["has no joint_length_m"]),
            ("leg_radius_m = 0.02\njoint_length_m = 0.3", &["leaves nothing"]),
            ("leg_radius_m = 0.2\njoint_length_m = 0.08", &["contradict", "legs ", " mm of each other"]),
        ] {
            let error = geometry(&file(&format!("{legs}{more}"))).unwrap_err().to_string();
            for word in words {
                assert!(error.contains(word), "{more}\n{word}\n{error}");
            }
        }
    }

    #[test]
    fn missing_keys_are_named() {
        assert_eq!(geometry(&RigFile::default()).unwrap_err(), MachineError::NoPlatform);
        assert_eq!(geometry(&file("")).unwrap_err(), MachineError::Missing("leg_length_m"));
        let axes = "base_joint_axes = [[0,0,1],[0,0,1],[0,0,1],[0,0,1],[0,0,1],[0,0,1]]";
        let error = geometry(&file(&format!("leg_length_m = [0.55, 0.8548]\n{axes}"))).unwrap_err();
        assert!(error.to_string().contains("base_joint_angle_rad"), "{error}");
        let only_cell = "[platform]\nload_cell = { position_m = [0, 0, 0.1], rotation_wxyz = [1, 0, 0, 0] }";
        let rig = RigFile::parse(only_cell).unwrap();
        assert_eq!(geometry_or_thesis(&rig).unwrap(), Geometry::thesis());
        assert_eq!(load_cell(&rig).unwrap().0, Vector3::new(0.0, 0.0, 0.1));
    }
}

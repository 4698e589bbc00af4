//! Checks by the sensors at rest: the plate is as the platform says, the load is within its bounds, and
//! nobody touches it.

use hexapod::{BodyParameters, BodySet, Pose};
use nalgebra::Vector3;
use rigident_shared::spatial::{Imu, SpecificForce};

use super::rest::Rest;
use super::{Attendant, DrivingError};
use rigident_device::platform::check;
use rigident_io::rig::{ImuTable, RigFile, WRENCH_CHANNELS};
use rigident_plan::carried::{self, CarriedError, LoadBound, Weighing};
use rigident_plan::machine;
use rigident_rows::body::prepare::mounting;

/// More than this is worth a word, rad.
const DOUBTFUL_RAD: f64 = 0.035;
/// A mean that changed by more of the standard deviations of a reading was not changed by drift alone: after
/// the warm-up that is below one.
const TOUCHED_SD: f64 = 6.0;

/// The comparison of gravity with the plate's pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Attitude {
    /// It agrees.
    Compared,
    /// Nothing could be compared, and why.
    Unknown(&'static str),
}

const UNPLACED: &str = "the base is level, NOT compared with gravity: the rig file does not give the \
                        places of [[imu]] and [platform.load_cell]; on a wall or a ceiling all forces are \
                        others";
const UNKNOWN: &str = "the base is level, NOT compared with gravity: the platform does not know its \
                       plate's pose yet; on a wall or a ceiling all forces are others";

/// Checks whether the plate is tilted as the platform says that it is, as far as gravity shows it. Nothing is
/// known without the places of the IMU and the load cell, or where the platform does not know it.
///
/// # Errors
/// It is not: what is sent would begin with a jump, or forces be those of another attitude.
pub(super) fn check_attitude(
    rest: &Rest,
    rig: &RigFile,
    stands: Option<&Pose>,
    warnings: &mut Vec<String>,
) -> Result<Attitude, DrivingError> {
    let Some(stands) = stands else { return Ok(Attitude::Unknown(UNKNOWN)) };
    let (Some(imu), Some(_)) = (rig.imu.first(), rig.platform.as_ref().and_then(|p| p.load_cell.as_ref()))
    else {
        return Ok(Attitude::Unknown(UNPLACED));
    };
    let (_, cell) = machine::load_cell(rig)?;
    // At rest the accelerometer feels "up".
    let off = carried::off_level_rad(&(cell * felt(rest, imu)), stands);
    let against =
        format!("against the attitude by the platform ({}), as gravity shows it", check::words(stands));
    if off >= carried::LEVEL_RAD {
        return Err(DrivingError::Tilted { degrees: off.to_degrees(), against });
    }
    if off >= DOUBTFUL_RAD {
        warnings.push(format!(
            "the plate is tilted by {:.1} degrees {against}: forces were checked for a level base; look at \
             the base, and at the rotations of [[imu]] and [platform.load_cell]",
            off.to_degrees()
        ));
    }
    Ok(Attitude::Compared)
}

/// Checks whether the load cell still reads what it read when it was zeroed: minutes may pass before somebody
/// says yes.
///
/// # Errors
/// It does not: somebody has been at it.
pub(super) fn check_untouched(rest: &Rest, now: &Rest) -> Result<(), DrivingError> {
    let changed = |c: usize| now.wrench[c] - rest.wrench[c];
    let touched = || {
        let c = (0..6).find(|c| changed(*c).abs() > TOUCHED_SD * rest.sigma[*c])?;
        let (channel, unit) = WRENCH_CHANNELS[c];
        Some(format!("{channel} of the load cell changed by {:.2} {unit}", changed(c)))
    };
    match now.moving.clone().or_else(touched) {
        None => Ok(()),
        Some(shown) => Err(DrivingError::Touched(shown)),
    }
}

/// Returns the specific force in S, m/s².
fn felt(rest: &Rest, imu: &ImuTable) -> Vector3<f64> {
    let mounting = mounting(imu);
    let [bx, by, bz] = mounting.accel_bias.array();
    let [[fx, fy, fz], [sx, sy, sz]] = [rest.specific_force, mounting.accel_scale];
    let felt = SpecificForce::<Imu, f64>::new(sx * fx - bx, sy * fy - by, sz * fz - bz);
    Vector3::from((mounting.rotation * felt).array())
}

/// Returns what the load cell may carry, in S, by what it reads at rest; `None` where nothing bounds it and
/// no force has a limit.
///
/// # Errors
/// [`DrivingError::Carried`]: a force has a limit and nothing bounds the body, or what is read contradicts
/// the bound.
pub fn weigh(rest: &Rest, rig: &RigFile, at: &dyn Attendant) -> Result<Option<BodySet>, DrivingError> {
    let Some(bound) = bound(rig)? else { return Ok(None) };
    let up = match rig.imu.first().and_then(|imu| carried::up_of(felt(rest, imu))) {
        Some(up) => up,
        None => carried::up_when_level(rig)?,
    };
    let weighing = Weighing { wrench: rest.wrench, sigma: rest.sigma, readings: rest.readings, up };
    let set = weighing.set(rig, &bound)?;
    let [least, most] = set.masses_kg();
    at.hear(&format!(
        "the load cell carries {:.2} to {:.2} kg, within {} m of its origin",
        least.max(0.0),
        most,
        bound.within_m
    ));
    Ok(Some(set))
}

/// Compares the body that a plan was made for, in P, with the bounds and with what the load cell carries.
///
/// # Errors
/// [`DrivingError::OtherBody`]: it contradicts the bounds.
pub(super) fn check_carries(
    carries: &BodyParameters,
    rig: &RigFile,
    body: &BodySet,
    at: &dyn Attendant,
) -> Result<(), DrivingError> {
    let (place, rotation) = machine::load_cell(rig)?;
    let away = (rotation.transpose() * (Vector3::from(carries.com_m) - place)).norm();
    if let Some(bound) = bound(rig)?
        && (carries.mass_kg > bound.mass_kg || away > bound.within_m)
    {
        return Err(DrivingError::OtherBody {
            kg: carries.mass_kg,
            away_m: away,
            most_kg: bound.mass_kg,
            within_m: bound.within_m,
        });
    }
    let [least, most] = body.masses_kg();
    if !(least..=most).contains(&carries.mass_kg) {
        at.hear(&format!(
            "rigident: the plan was made for {:.2} kg, and the load cell carries {:.2} to {most:.2} kg: its \
             limits are checked for these, what it predicts is not for this body",
            carries.mass_kg,
            least.max(0.0)
        ));
    }
    Ok(())
}

/// Returns how heavy and how large the body may be; `None` where that is not said and no force has a limit.
///
/// # Errors
/// [`DrivingError::Carried`]: a force has a limit.
pub(super) fn bound(rig: &RigFile) -> Result<Option<LoadBound>, DrivingError> {
    let bound = LoadBound::of(rig);
    let limits = rig.platform.as_ref().map(machine::limits).unwrap_or_default();
    let limited = carried::limited(&limits, &rig.load_cell.range_n_nm.unwrap_or([f64::INFINITY; 6]));
    match (bound, limited) {
        (None, Some(limited)) => Err(CarriedError::NoBound { limited }.into()),
        (bound, _) => Ok(bound),
    }
}

#[cfg(test)]
mod tests {
    use hexapod::Geometry;

    use super::super::Nobody;
    use super::super::rest::at_rest;
    use super::super::rest::tests::readings;
    use super::*;

    #[test]
    fn a_plan_made_for_a_body_that_the_bounds_do_not_allow_is_refused() {
        let rig = RigFile::parse("[platform]\nload_max_kg = 30\nload_within_m = 0.4").unwrap();
        let made_for =
            |mass_kg: f64, com_m: [f64; 3]| BodyParameters { mass_kg, com_m, inertia_com_kgm2: [0.1; 6] };
        let weighed = BodySet::bounded(25.0, [0.0; 3], 0.4);
        check_carries(&made_for(20.0, [0.0, 0.0, 0.1]), &rig, &weighed, &Nobody).unwrap();
        for (mass_kg, z) in [(80.0, 0.1), (20.0, 3.0)] {
            let error = check_carries(&made_for(mass_kg, [0.0, 0.0, z]), &rig, &weighed, &Nobody);
            let said = error.unwrap_err().to_string();
            assert!(said.contains("Nothing was moved") && said.contains("30.00 kg within 0.4 m"), "{said}");
        }
    }

    #[test]
    fn a_plate_that_is_tilted_otherwise_does_not_stand_where_the_platform_says() {
        let home = Geometry::thesis().home();
        let text = "[[imu]]\nposition_m = [0, 0, 0]\nrotation_wxyz = [1, 0, 0, 0]\n[platform.load_cell]\n\
                    position_m = [0, 0, 0]\nrotation_wxyz = [0, 1, 0, 0]\n";
        // The load cell hangs: its x is the plate's, its z points down.
        let rig = RigFile::parse(text).unwrap();
        let seen = |angle: f64, rig: &RigFile, stands: Option<&Pose>| {
            let rest = at_rest(&readings(|_| angle), None).unwrap();
            let mut warnings = Vec::new();
            check_attitude(&rest, rig, stands, &mut warnings).map_err(|e| e.to_string()).map(|seen| {
                assert_eq!(seen == Attitude::Compared, stands.is_some() && rig.platform.is_some());
                warnings
            })
        };
        let check = |angle: f64, rig: &RigFile| seen(angle, rig, Some(&home));
        let pi = std::f64::consts::PI;
        assert_eq!(check(pi + 0.02, &rig), Ok(vec![]));
        let doubtful = check(pi + 0.05, &rig).unwrap();
        assert!(doubtful[0].contains("2.9 degrees") && doubtful[0].contains("level base"), "{doubtful:?}");
        let said = check(pi + 0.5, &rig).unwrap_err();
        assert!(said.contains("tilted by 29 degrees") && said.contains("Nothing was moved"), "{said}");
        // Where the load cell's place is not given, nothing is known.
        assert_eq!(check(0.5, &RigFile::default()), Ok(vec![]));
        assert_eq!(seen(pi + 0.5, &rig, None), Ok(vec![]));
        // The plate leans as the platform says: the load cell's x is the plate's, and so is the IMU's.
        let mut leaning = home;
        leaning.rpy_rad[0] = -0.5;
        let leans = [0.5, -0.5].map(|angle| seen(pi + angle, &rig, Some(&leaning)).is_ok());
        assert!(leans[0] != leans[1], "one of the two, by the sign of the IMU's axes: {leans:?}");
        // A base on a wall, and on a ceiling.
        for (angle, words) in [(0.5 * pi, "tilted by 90 degrees"), (0.0, "tilted by 180 degrees")] {
            let said = check(angle, &rig).unwrap_err();
            assert!(said.contains(words) && said.contains("wall or a ceiling is not driven"), "{said}");
        }
    }

    #[test]
    fn a_load_cell_that_somebody_touched_after_its_zero_is_noticed() {
        let rest = || at_rest(&readings(|_| 0.0), None).unwrap();
        let with = |newtons: f64| {
            let mut rest = rest();
            rest.sigma = [1.0; 6];
            rest.wrench[2] += newtons;
            rest
        };
        assert!(check_untouched(&with(0.0), &with(4.0)).is_ok());
        let said = check_untouched(&with(0.0), &with(-9.0)).unwrap_err().to_string();
        assert!(said.contains("Fz of the load cell changed by -9.00 N"), "{said}");
    }
}

//! Checks whether `[suspension]` is possible: every complaint names the key below it, the value that is
//! there, and the value that should be.

use nalgebra::{Matrix6, SymmetricEigen};

use super::{Coordinate, RestTable, SpringTable, SuspendedPlatformTable, SuspensionTable};

/// Key, value, advice.
type Complaint = (String, String, String);

/// No platform on springs is longer, m.
const LONGEST_M: f64 = 5.0;
/// No springs are warmer or colder by more, K.
const WARMEST_K: f64 = 200.0;
/// Elements of a stiffness that differ by less, relative to the largest, are equal to the digits that people
/// write.
const WRITTEN: f64 = 1e-3;

/// Checks a table.
///
/// # Errors
/// The first [`Complaint`].
pub(super) fn check(table: &SuspensionTable) -> Result<(), Complaint> {
    let sigma = |key: &str, value: Option<f64>| {
        of(key, value.as_slice(), |v| v.is_finite() && v >= 0.0, "1 σ must be finite and not negative")
    };
    length("at_m", &table.at_m)?;
    length("anchor_height_m", table.anchor_height_m.as_slice())?;
    length("base_position_m", &table.base_position_m)?;
    sigma("stiffness_std", table.stiffness_std)?;
    sigma("stiffness_common_std", table.stiffness_common_std)?;
    sigma("damping_ratio_std", table.damping_ratio_std)?;
    sigma("place_std_m", table.place_std_m)?;
    sigma("axis_std_rad", table.axis_std_rad)?;
    sigma("anchor_height_std_m", table.anchor_height_std_m)?;
    sigma("length_std_m", table.length_std_m)?;
    sigma("preload_std", table.preload_std)?;
    sigma("share_std", table.share_std)?;
    sigma("static_std", table.static_std)?;
    sigma("temperature_std_k", Some(table.temperature_std_k))?;
    let warm = |v: f64| v.is_finite() && v.abs() <= WARMEST_K;
    let advice = format!("must be finite, and no more than {WARMEST_K} K: a difference of temperatures");
    of("temperature_change_k", &[table.temperature_change_k], warm, &advice)?;
    let side = |v: f64| v.is_finite() && v > 0.0 && v <= LONGEST_M;
    let advice = format!("must be greater than zero and no more than {LONGEST_M} m");
    of("air_plate_m", table.air_plate_m.as_ref().map_or(&[], |sides| sides.as_slice()), side, &advice)?;
    table.rest.iter().enumerate().try_for_each(|(n, own)| rest(n, own, table))?;
    let positive = |v: f64| v.is_finite() && v > 0.0;
    of("cut_off_hz", table.cut_off_hz.as_slice(), positive, "must be finite and greater than zero")?;
    table.base_rotation_wxyz.map_or(Ok(()), |q| unit("base_rotation_wxyz", &q))?;
    match (&table.stiffness, table.spring.is_empty()) {
        (None, true) => Err((
            "stiffness".to_owned(),
            "nothing".to_owned(),
            "the springs are needed: the matrix `stiffness`, or a [[suspension.spring]] table for each"
                .to_owned(),
        )),
        (Some(rows), true) => matrix(rows, table).and_then(|()| height(table)),
        (Some(rows), false) => matrix(rows, table).and_then(|()| springs(table)),
        (None, false) => springs(table),
    }?;
    table.platform.as_ref().map_or(Ok(()), platform)
}

/// Refuses what is no unit quaternion.
fn unit(key: &str, q: &[f64; 4]) -> Result<(), Complaint> {
    let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    if norm.is_nan() || (norm - 1.0).abs() > 0.01 {
        let advice = format!("must be a unit quaternion w, x, y, z; its norm is {norm:.4}");
        return Err((key.to_owned(), format!("{q:?}"), advice));
    }
    Ok(())
}

/// Checks the pose of rest with another load.
fn rest(n: usize, own: &RestTable, table: &SuspensionTable) -> Result<(), Complaint> {
    let key = |name: &str| format!("rest[{n}].{name}");
    length(&key("added_at_m"), &own.added_at_m)?;
    of(&key("position_m"), &own.position_m, f64::is_finite, "every number must be finite")?;
    unit(&key("rotation_wxyz"), &own.rotation_wxyz)?;
    let mass = |v: f64| v.is_finite() && v >= 0.0;
    of(&key("added_kg"), &[own.added_kg], mass, "must be finite and not negative")?;
    let positive = |v: f64| v.is_finite() && v > 0.0;
    let advice = "1 σ must be finite and greater than zero";
    of(&key("position_std_m"), own.position_std_m.as_slice(), positive, advice)?;
    of(&key("rotation_std_rad"), own.rotation_std_rad.as_slice(), positive, advice)?;
    if !own.body && table.platform.is_none() {
        let advice = "without the body the weight is the platform's: state [suspension.platform]";
        return Err((key("body"), "false".to_owned(), advice.to_owned()));
    }
    if own.body && own.added_kg == 0.0 {
        let advice = "the load is that of the recording: state added_kg, or body = false";
        return Err((key("added_kg"), "0".to_owned(), advice.to_owned()));
    }
    Ok(())
}

/// Refuses what is no length of a platform in m.
fn length(key: &str, values: &[f64]) -> Result<(), Complaint> {
    let advice = format!("must be finite, and no more than {LONGEST_M} m: lengths are in m");
    of(key, values, |v| v.is_finite() && v.abs() <= LONGEST_M, &advice)
}

fn of(key: &str, values: &[f64], good: impl Fn(f64) -> bool, advice: &str) -> Result<(), Complaint> {
    match values.iter().find(|v| !good(**v)) {
        None => Ok(()),
        Some(bad) => Err((key.to_owned(), bad.to_string(), advice.to_owned())),
    }
}

fn matrix(rows: &[[f64; 6]; 6], table: &SuspensionTable) -> Result<(), Complaint> {
    let refuse = |value: String, advice: String| Err(("stiffness".to_owned(), value, advice));
    let k = Matrix6::from_fn(|i, j| rows[i][j]);
    if let Some(bad) = k.iter().find(|v| !v.is_finite()) {
        return refuse(bad.to_string(), "every number must be finite".to_owned());
    }
    let free: Vec<usize> = (0..6).filter(|i| !table.locked.iter().any(|c| c.index() == *i)).collect();
    if let Some(i) = free.iter().find(|i| k[(**i, **i)] <= 0.0) {
        return refuse(
            format!("{} in row {}, column {}", k[(*i, *i)], i + 1, i + 1),
            "a spring pushes back: the diagonal must be greater than zero; a coordinate that cannot move \
             belongs into `locked`"
                .to_owned(),
        );
    }
    for (i, j) in (0..6).flat_map(|i| (0..i).map(move |j| (i, j))) {
        let scale = (k[(i, i)] * k[(j, j)]).abs().sqrt();
        if (k[(i, j)] - k[(j, i)]).abs() > WRITTEN * scale {
            return refuse(
                format!(
                    "{} in row {}, column {}, and {} in row {}, column {}",
                    k[(j, i)],
                    j + 1,
                    i + 1,
                    k[(i, j)],
                    i + 1,
                    j + 1
                ),
                "a stiffness is symmetric (springs store energy): are forces and moments in N and N m, \
                 displacements in m and rad, and both about one point?"
                    .to_owned(),
            );
        }
    }
    let scaled = nalgebra::DMatrix::from_fn(free.len(), free.len(), |a, b| {
        let (i, j) = (free[a], free[b]);
        0.5 * (k[(i, j)] + k[(j, i)]) / (k[(i, i)] * k[(j, j)]).sqrt()
    });
    let least = SymmetricEigen::new(scaled).eigenvalues.min();
    if least <= 0.0 {
        return refuse(
            format!("its least eigenvalue is {least:.3e} in columns of unit stiffness"),
            "the matrix must be positive definite: in some direction this platform would be driven away from \
             rest".to_owned(),
        );
    }
    let std = table.stiffness_element_std.map_or(Vec::new(), |rows| rows.concat());
    of("stiffness_element_std", &std, |v| v.is_finite() && v >= 0.0, "1 σ must be finite and not negative")
}

/// Refuses a matrix of which nothing says where it carries the weight: half a metre of it is worth half the
/// tilting stiffness.
fn height(table: &SuspensionTable) -> Result<(), Complaint> {
    let is_locked = |coordinate| table.locked.contains(&coordinate);
    let needless = is_locked(Coordinate::Z) || is_locked(Coordinate::Roll) && is_locked(Coordinate::Pitch);
    if table.anchor_height_m.is_some() || needless {
        return Ok(());
    }
    Err((
        "anchor_height_m".to_owned(),
        "nothing".to_owned(),
        "a matrix does not say at which height above `at_m` the springs carry the weight: state it (0 if it \
         is at `at_m`), or          keep the [[suspension.spring]] tables beside the matrix"
            .to_owned(),
    ))
}

fn springs(table: &SuspensionTable) -> Result<(), Complaint> {
    if table.stiffness_element_std.is_some() && table.stiffness.is_none() {
        return Err((
            "stiffness_element_std".to_owned(),
            "elements".to_owned(),
            "is of the elements of `stiffness`; springs have `std`".to_owned(),
        ));
    }
    for (n, own) in table.spring.iter().enumerate() {
        let SpringTable { at_m, axis, axial_npm, lateral_npm, std, .. } = own;
        let key = |name: &str| format!("spring[{n}].{name}");
        length(&key("at_m"), at_m)?;
        of(&key("axis"), axis, f64::is_finite, "every number must be finite")?;
        if axis.iter().all(|v| *v == 0.0) {
            return Err((key("axis"), "0, 0, 0".to_owned(), "must have a direction".to_owned()));
        }
        let stiff = |v: f64| v.is_finite() && v >= 0.0;
        of(&key("axial_npm"), &[*axial_npm], stiff, "must be finite and not negative")?;
        of(&key("lateral_npm"), &[*lateral_npm], stiff, "must be finite and not negative")?;
        of(&key("std"), std.as_slice(), stiff, "1 σ must be finite and not negative")?;
        shape(own, key)?;
    }
    Ok(())
}

/// Checks what a spring is beside its stiffness.
fn shape(own: &SpringTable, key: impl Fn(&str) -> String) -> Result<(), Complaint> {
    let positive = |v: f64| v.is_finite() && v > 0.0 && v <= LONGEST_M;
    let advice = format!("must be greater than zero and no more than {LONGEST_M} m");
    of(&key("length_m"), own.length_m.as_slice(), positive, &advice)?;
    of(&key("diameter_m"), own.diameter_m.as_slice(), positive, &advice)?;
    let not_negative = |v: f64| v.is_finite() && v >= 0.0;
    of(&key("mass_kg"), &[own.mass_kg], not_negative, "must be finite and not negative")?;
    of(&key("preload_n"), &[own.preload_n], f64::is_finite, "must be finite")?;
    of(&key("pull_n"), own.pull_n.as_slice(), f64::is_finite, "must be finite")?;
    if let Some(pull) = own.pull_n.filter(|_| own.preload_n != 0.0) {
        let advice = "is the force at rest with the body on, preload_n that before: state one of them";
        return Err((key("pull_n"), pull.to_string(), advice.to_owned()));
    }
    let complain = |what: &str, advice: &str| Err((key(what), "nothing".to_owned(), advice.to_owned()));
    match (own.clamped, own.length_m, own.diameter_m) {
        (true, None, _) => {
            complain("length_m", "a clamped spring needs its length: it pushes across at half of it")
        }
        (true, _, None) => {
            complain("diameter_m", "a clamped coil needs its mean diameter: it resists turning by it")
        }
        (false, _, Some(d)) => Err((
            key("diameter_m"),
            d.to_string(),
            "is that of a clamped coil: say clamped = true, or leave it out".to_owned(),
        )),
        _ => Ok(()),
    }
}

fn platform(table: &SuspendedPlatformTable) -> Result<(), Complaint> {
    let SuspendedPlatformTable { mass_kg, com_m, inertia_com_kgm2, mass_std_kg, com_std_m, inertia_std_kgm2 } =
        table;
    let body =
        hexapod::BodyParameters { mass_kg: *mass_kg, com_m: *com_m, inertia_com_kgm2: *inertia_com_kgm2 };
    for (name, sigma) in
        [("mass_std_kg", mass_std_kg), ("com_std_m", com_std_m), ("inertia_std_kgm2", inertia_std_kgm2)]
    {
        let key = format!("platform.{name}");
        of(&key, &[*sigma], |v| v.is_finite() && v >= 0.0, "1 σ must be finite and not negative")?;
    }
    length("platform.com_m", com_m)?;
    if body.is_possible() {
        return Ok(());
    }
    let advice = "no distribution of mass has these mass and tensor: the mass and the principal moments must \
                  be greater than zero, and no moment larger than the sum of the other two";
    Err(("platform".to_owned(), format!("{mass_kg} kg, {inertia_com_kgm2:?} kg m²"), advice.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::RigFile;

    const MATRIX: &str = "stiffness = \
                          [[9.0,0,0,0,0,0],[0,9.0,0,0,0,0],[0,0,9.0,0,0,0],[0,0,0,1.0,0,0],[0,0,0,0,1.0,0],[0,0,0,0,0,1.0]]\n";

    /// Returns the key that is complained of; nothing if all is well.
    fn complaint(keys: &str) -> Option<String> {
        let table = toml::from_str::<SuspensionTable>(keys).unwrap();
        check(&table).err().map(|(key, ..)| key)
    }

    #[test]
    fn a_matrix_needs_the_height_at_which_it_carries_the_weight() {
        assert_eq!(complaint(MATRIX).as_deref(), Some("anchor_height_m"));
        assert_eq!(complaint(&format!("anchor_height_m = 0.0\n{MATRIX}")), None);
        assert_eq!(complaint(&format!("locked = [\"z\"]\n{MATRIX}")), None);
        // The places of springs beside it tell, and its elements keep their standard deviations.
        let spring = "[[spring]]\nat_m = [0.1, 0.1, 0.0]\naxial_npm = 1e3\n";
        let std = MATRIX.replace("stiffness", "stiffness_element_std");
        assert_eq!(complaint(&format!("{MATRIX}{std}{spring}")), None);
        assert_eq!(complaint(&format!("{std}{spring}")).as_deref(), Some("stiffness_element_std"));
    }

    #[test]
    fn rests_need_a_load_a_unit_quaternion_and_a_platform() {
        let spring = "[[spring]]\nat_m = [0.1, 0.1, 0.0]\naxial_npm = 1e3\n";
        let of = |rest: &str, more: &str| {
            let own = format!("[[rest]]\nposition_m = [0.0, 0.0, 1.0]\n{rest}\n");
            complaint(&format!("{spring}{more}{own}")).map(|key| key.replace("rest[0].", ""))
        };
        let level = "rotation_wxyz = [1.0, 0.0, 0.0, 0.0]";
        let plate = "[platform]\nmass_kg = 1.0\ncom_m = [0.0, 0.0, 0.0]\n\
                     inertia_com_kgm2 = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]\n";
        assert_eq!(of(&format!("{level}\nadded_kg = 2.0"), ""), None);
        assert_eq!(of(&format!("{level}\nbody = false"), plate), None);
        assert_eq!(of(&format!("{level}\nbody = false"), "").as_deref(), Some("body"));
        assert_eq!(of(level, "").as_deref(), Some("added_kg"));
        let turned = "rotation_wxyz = [1.0, 1.0, 0.0, 0.0]\nadded_kg = 2.0";
        assert_eq!(of(turned, "").as_deref(), Some("rotation_wxyz"));
        let exact = format!("{level}\nadded_kg = 2.0\nposition_std_m = 0.0");
        assert_eq!(of(&exact, "").as_deref(), Some("position_std_m"));
        let keys = [("air_plate_m = [1000.0, 700.0]", "air_plate_m"), ("place_std_m = -1.0", "place_std_m")];
        for (line, key) in keys {
            assert_eq!(complaint(&format!("{line}\n{spring}")).as_deref(), Some(key));
        }
    }

    #[test]
    fn impossible_springs_are_named() {
        let of = |more: &str| {
            let key = complaint(&format!("[[spring]]\nat_m = [0.1, 0.1, 0.0]\naxial_npm = 1e3\n{more}\n"));
            key.map(|key| key.replace("spring[0].", ""))
        };
        assert_eq!(of("length_m = 0.4\npreload_n = -20.0\nmass_kg = 0.3"), None);
        assert_eq!(of("clamped = true\nlength_m = 0.2\ndiameter_m = 0.05"), None);
        for (more, key) in [
            ("length_m = 0.0", "length_m"),
            ("length_m = 400.0", "length_m"),
            ("mass_kg = -1.0", "mass_kg"),
            ("preload_n = inf", "preload_n"),
            ("preload_n = 5.0\npull_n = 5.0", "pull_n"),
            ("clamped = true", "length_m"),
            ("clamped = true\nlength_m = 0.2", "diameter_m"),
            ("diameter_m = 0.05", "diameter_m"),
        ] {
            assert_eq!(of(more).as_deref(), Some(key), "{more}");
        }
        assert!(
            RigFile::parse(
                "[suspension]\nspring = [{ at_m = [0, 0, 0], axial_npm = 1.0, mass_kg = -1.0 }]\n"
            )
            .is_err()
        );
    }
}

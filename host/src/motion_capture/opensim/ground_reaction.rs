//! Wrenches of the ground as columns of a MOT file: force, centre of pressure and free moment of every plate or belt.

use nalgebra::Vector3;

use super::error::OpenSimError;
use super::storage::Storage;
use crate::motion_capture::ground::GroundWrench;

/// Below this force a centre of pressure means nothing, and the plate counts as not loaded, N.
const LOADED_N: f64 = 1.0;

/// Returns the wrenches about the laboratory's origin, in the file's axes.
///
/// Columns are `…vx, …vy, …vz` (N, on the person), `…px, …py, …pz` (m) and the free moment at that point, `…torque…x` or `…mx` (N m):
/// the names before `v` say which belong together. What is missing of the free moment is zero.
///
/// # Errors
/// There are no forces, or a force has no centre of pressure.
pub fn ground_wrenches(table: &Storage) -> Result<Vec<GroundWrench>, OpenSimError> {
    let stems: Vec<&str> = table.columns.iter().filter_map(|c| c.strip_suffix("vx")).collect();
    if stems.is_empty() {
        return Err(OpenSimError::Missing(
            "no column ends in vx: forces of the ground are named like ground_force_vx, _vy, _vz, _px, _py, _pz"
                .to_owned(),
        ));
    }
    let (first, last) = match (table.times_s.first(), table.times_s.last()) {
        (Some(first), Some(last)) if table.times_s.len() > 1 => (*first, *last),
        _ => return Err(OpenSimError::Missing("there are fewer than two rows".to_owned())),
    };
    let rate_hz = (table.times_s.len() - 1) as f64 / (last - first);
    stems.iter().map(|stem| of_stem(table, stem, rate_hz, first)).collect()
}

fn of_stem(table: &Storage, stem: &str, rate_hz: f64, first_s: f64) -> Result<GroundWrench, OpenSimError> {
    let three = |names: [String; 3]| -> Result<Vec<Vector3<f64>>, OpenSimError> {
        let missing = |name: &String| OpenSimError::Missing(format!("the column {name} is missing"));
        let [x, y, z] = &names;
        let (x, y, z) = (
            table.column(x).ok_or_else(|| missing(x))?,
            table.column(y).ok_or_else(|| missing(y))?,
            table.column(z).ok_or_else(|| missing(z))?,
        );
        Ok(x.zip(y).zip(z).map(|((x, y), z)| Vector3::new(x, y, z)).collect())
    };
    let axes = |word: &str| ["x", "y", "z"].map(|axis| format!("{stem}{word}{axis}"));
    let force = three(axes("v"))?;
    let point = three(axes("p"))?;
    // ground_force_r_v → ground_torque_r_ , 1_ground_force_v → 1_ground_torque_
    let torque = stem.replacen("force", "torque", 1);
    let moment = three(["x", "y", "z"].map(|axis| format!("{torque}{axis}")))
        .or_else(|_| three(axes("m")))
        .or_else(|_| {
            three(["x", "y", "z"].map(|axis| format!("{}moment_{axis}", stem.trim_end_matches("force_"))))
        });
    let none = vec![Vector3::zeros(); force.len()];
    let moment = moment.unwrap_or(none);
    let wrench = force.iter().zip(&point).zip(&moment).map(|((f, p), m)| {
        if f.norm() < LOADED_N {
            return [0.0; 6];
        }
        let m = m + p.cross(f);
        [f.x, f.y, f.z, m.x, m.y, m.z]
    });
    Ok(GroundWrench {
        name: stem.trim_end_matches('_').to_owned(),
        corners_m: None,
        rate_hz,
        first_s,
        wrench: wrench.collect(),
    })
}

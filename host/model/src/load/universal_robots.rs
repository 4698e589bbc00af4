//! `set_target_payload(m, cog, inertia)` of URScript, of Universal Robots.
//!
//! Mass in kg, centre of gravity from the tool mount in m, `[Ixx, Iyy, Izz, Ixy, Ixz, Iyz]` in kg m² about
//! the centre of gravity along the axes of the tool flange: elements of the *inertia matrix*, so that
//! products have the sign of ours. Without the third argument the matrix is zero (Script Manual, SW 10.6,
//! *set_target_payload*).

use super::numbers::{after, list, plain};
use super::{Load, LoadError};

const CALL: &str = "set_target_payload(";

/// Returns the call.
pub fn write(load: &Load) -> String {
    let [xx, yy, zz, yz, zx, xy] = load.inertia_com_kgm2;
    let tensor =
        if load.is_point() { String::new() } else { format!(", [{}]", list(&[xx, yy, zz, xy, zx, yz])) };
    format!("{CALL}{}, [{}]{tensor})\n", plain(load.mass_kg), list(&load.com_m))
}

/// Returns the load of a call.
///
/// # Errors
/// [`LoadError::Read`] if there is none.
pub fn read(text: &str) -> Result<Load, LoadError> {
    let whole = text.split(CALL).nth(1).and_then(|rest| rest.split(')').next());
    let call = format!("{CALL}{})", whole.unwrap_or_default());
    let numbers = after(&call, CALL, 10).or_else(|_| after(&call, CALL, 4))?;
    let tensor = match numbers.get(4..10) {
        Some(&[xx, yy, zz, xy, xz, yz]) => [xx, yy, zz, yz, xz, xy],
        _ => [0.0; 6],
    };
    match numbers.as_slice() {
        &[mass_kg, x, y, z, ..] => Ok(Load { mass_kg, com_m: [x, y, z], inertia_com_kgm2: tensor }),
        _ => Err(LoadError::Read("set_target_payload needs a mass and a centre".to_owned())),
    }
}

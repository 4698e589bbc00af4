//! The structure LOAD of KUKA's controllers, as `LOAD_DATA[n]` in `$config.dat`.
//!
//! `M` in kg; `CM` the frame of the principal axes in that of the flange: X, Y, Z its origin, the centre of
//! mass, in mm, and A, B, C in degrees, turned by A about Z, then by B about the new Y, then by C about the
//! new X; `J` the principal moments about X, Y, Z of that frame in kg m² (KR IONTEC assembly manual V4,
//! *Payloads*; Beckhoff TF5120, *KRC_WriteLoadData*).

use nalgebra::{Matrix3, Rotation3, SymmetricEigen, Vector3};
use rigident_shared::inertia::{tensor_elements, tensor_from_elements};

use super::numbers::{after, plain};
use super::{Load, LoadError};

const START: &str = "LOAD_DATA[1]=";

/// Returns the line of `$config.dat`.
pub fn write(load: &Load) -> String {
    let (moments, axes) = principal(&tensor_from_elements(load.inertia_com_kgm2));
    // R = Rz(A) Ry(B) Rx(C): nalgebra's roll, pitch, yaw.
    let (c, b, a) = axes.euler_angles();
    let named = |names: &str, values: &[f64]| {
        let pairs = names.chars().zip(values).map(|(name, value)| format!("{name} {}", plain(*value)));
        pairs.collect::<Vec<_>>().join(",")
    };
    let [x, y, z] = load.com_m.map(|v| 1e3 * v);
    let place = [x, y, z, a.to_degrees(), b.to_degrees(), c.to_degrees()];
    format!(
        "{START}{{M {},CM {{{}}},J {{{}}}}}\n",
        plain(load.mass_kg),
        named("XYZABC", &place),
        named("XYZ", moments.as_slice())
    )
}

/// Returns principal moments and axes that are turned as little as possible; of a point mass the flange's.
fn principal(tensor: &Matrix3<f64>) -> (Vector3<f64>, Rotation3<f64>) {
    let eigen = SymmetricEigen::new(*tensor);
    let mut best = (eigen.eigenvalues, Matrix3::identity(), f64::NEG_INFINITY);
    for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        let mut axes =
            Matrix3::from_columns(&order.map(|k: usize| eigen.eigenvectors.column(k).into_owned()));
        for k in 0..3 {
            if axes[(k, k)] < 0.0 {
                axes.column_mut(k).neg_mut();
            }
        }
        if axes.determinant() < 0.0 {
            // The axis that is least sure of its direction.
            let k = axes.diagonal().imin();
            axes.column_mut(k).neg_mut();
        }
        if axes.trace() > best.2 {
            best = (Vector3::from(order.map(|k| eigen.eigenvalues[k])), axes, axes.trace());
        }
    }
    (best.0, Rotation3::from_matrix_unchecked(best.1))
}

/// Returns the load of a structure.
///
/// # Errors
/// [`LoadError::Read`] if there is none.
pub fn read(text: &str) -> Result<Load, LoadError> {
    let start = text.find("{M ").ok_or_else(|| LoadError::Read("there is no {M … in it".to_owned()))?;
    let numbers = after(text.get(start..).unwrap_or_default(), "{M ", 10)?;
    let &[mass_kg, x, y, z, a, b, c, jx, jy, jz] = numbers.as_slice() else {
        return Err(LoadError::Read("LOAD needs ten numbers".to_owned()));
    };
    let turn = |axis: Vector3<f64>, degrees: f64| Rotation3::new(axis * degrees.to_radians()).into_inner();
    let axes = turn(Vector3::z(), a) * turn(Vector3::y(), b) * turn(Vector3::x(), c);
    let tensor = axes * Matrix3::from_diagonal(&Vector3::new(jx, jy, jz)) * axes.transpose();
    let inertia_com_kgm2 = if [jx, jy, jz] == [0.0; 3] { [0.0; 6] } else { tensor_elements(&tensor) };
    Ok(Load { mass_kg, com_m: [x, y, z].map(|v| 1e-3 * v), inertia_com_kgm2 })
}

//! Rest of the platform with another load than that of the recording: without the body, or with a known mass.
//!
//! With d the displacement of O from the rest of the recording to the other one, forces of springs balance
//! the weight there, too. What the body weighs, or what is added, is the difference:
//! ```text
//! (K + K_f(π) + K_w(π′)) d = W(π′) − W(π)      W(π) = g (0, 0, −m, −ms_y, ms_x, 0)
//! ```
//! with π of all that moves in the recording, π′ of all that is there then, K_f of the forces that carry π,
//! and K_w of the weight itself ([`super::preload`]). It is linear in π: rows beside those of the modes. They
//! tell the stiffness that is at rest, modes that of the motion; of both together the mass needs no spring to
//! be known, as `m g = k d` and `m ω² = k`.

use nalgebra::{DMatrix, Matrix3, Matrix6, SMatrix, Vector3, Vector6};
use rigident_shared::inertia::{InertialParameters, tensor_from_elements};
use rigident_shared::spatial::{Body, Position};

use super::bare::bare_parameters;
use super::preload::Preload;
use super::springs::turn;
use rigident_io::rig::{RestTable, SuspensionTable};
use rigident_rows::tree::joints::attitude;

/// Parameters of a body.
const TEN: usize = 10;
/// 1 σ of a pose at rest, m and rad, where none is stated: cameras of tenths of a millimetre over half a
/// metre.
const PLACE_STD_M: f64 = 1e-4;
const TURN_STD_RAD: f64 = 2e-4;

/// A rest that a rig file states.
#[derive(Clone, Debug, PartialEq)]
pub struct StatedRest {
    name: String,
    /// Position of P, in the frame of the recording.
    position: Vector3<f64>,
    attitude: Matrix3<f64>,
    sd: [f64; 2],
    load: Load,
}

/// A load beside that of the recording.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Load {
    /// The platform without the body: ten parameters about O, axes of P, and their covariance.
    Bare([f64; TEN], Box<SMatrix<f64, TEN, TEN>>),
    /// An added load with these ten parameters beside all.
    Added([f64; TEN]),
}

/// A rest against that of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Rest {
    /// The name of the rest.
    pub name: String,
    /// Shift of O and turn, axes at rest of the recording, m and rad.
    pub change: Vector6<f64>,
    /// 1 σ of them.
    pub sd: Vector6<f64>,
    pub(super) load: Load,
}

/// Returns the rests that a rig file states.
pub(super) fn stated(table: &SuspensionTable) -> Vec<StatedRest> {
    let of = |(n, own): (usize, &RestTable)| {
        let load = if own.body {
            Load::Added(about_o(own.added_kg, &own.added_at_m, table))
        } else {
            let (mean, covariance) = bare_about_o(table)?;
            let added = about_o(own.added_kg, &own.added_at_m, table);
            Load::Bare(std::array::from_fn(|k| mean[k] + added[k]), Box::new(covariance))
        };
        let words = match (own.body, own.added_kg > 0.0) {
            (false, false) => "without the body".to_owned(),
            (false, true) => format!("with {} kg in place of the body", own.added_kg),
            _ => format!("with {} kg added", own.added_kg),
        };
        Some(StatedRest {
            name: format!("rest {} ({words})", n + 1),
            position: Vector3::from(own.position_m),
            attitude: attitude(&own.rotation_wxyz)?,
            sd: [own.position_std_m.unwrap_or(PLACE_STD_M), own.rotation_std_rad.unwrap_or(TURN_STD_RAD)],
            load,
        })
    };
    table.rest.iter().enumerate().filter_map(of).collect()
}

/// Returns ten parameters about O of a mass at a point of P.
fn about_o(mass_kg: f64, at_m: &[f64; 3], table: &SuspensionTable) -> [f64; TEN] {
    let arm = Vector3::from(*at_m) - Vector3::from(table.at_m);
    InertialParameters::<Body, f64>::from_centre_of_mass(
        mass_kg,
        Position::from_array(arm.into()),
        tensor_from_elements([0.0; 6]),
    )
    .to_vector()
}

/// Returns ten parameters about O of the bare platform and the springs' moved share, and their covariance.
fn bare_about_o(table: &SuspensionTable) -> Option<([f64; TEN], SMatrix<f64, TEN, TEN>)> {
    let (mean, covariance) = bare_parameters(table)?;
    let map = super::mount::Mount::of(table).map();
    let own = map * mean;
    Some((std::array::from_fn(|k| own[k]), map * covariance * map.transpose()))
}

impl StatedRest {
    /// Returns it against the rest of a recording: position of O and attitude, and 1 σ of its coordinates.
    pub fn against(
        &self,
        (origin, axes): (Vector3<f64>, Matrix3<f64>),
        own_sd: &[f64; 6],
        at_m: &[f64; 3],
    ) -> Rest {
        let place = self.position + self.attitude * Vector3::from(*at_m);
        let (shift, turned) = (axes.tr_mul(&(place - origin)), turn(&axes.tr_mul(&self.attitude)));
        Rest {
            name: self.name.clone(),
            change: Vector6::new(shift.x, shift.y, shift.z, turned.x, turned.y, turned.z),
            sd: Vector6::from_fn(|k, _| self.sd[usize::from(k > 2)].hypot(own_sd[k])),
            load: self.load.clone(),
        }
    }
}

/// Returns `W` by the ten parameters, N and N m.
fn weight(gravity_mps2: f64) -> SMatrix<f64, 6, TEN> {
    let mut all = SMatrix::zeros();
    (all[(2, 0)], all[(3, 2)], all[(4, 1)]) = (-gravity_mps2, -gravity_mps2, gravity_mps2);
    all
}

impl Rest {
    /// Returns the equations `rows π = values` at a displacement, in the order of rows of modes, with the
    /// springs' stiffness and what a unit of each parameter's forces and weight add to it.
    pub(super) fn equations(
        &self,
        change: &Vector6<f64>,
        (gravity_mps2, preload): (f64, &Preload),
        (stiffness, by_weight): (&Matrix6<f64>, &[Matrix6<f64>; TEN]),
    ) -> (SMatrix<f64, 6, TEN>, Vector6<f64>) {
        let all = weight(gravity_mps2);
        let mut rows = SMatrix::<f64, 6, TEN>::zeros();
        for (k, own) in by_weight.iter().enumerate() {
            rows.set_column(k, &-(own * change));
        }
        let other = match &self.load {
            Load::Bare(other, _) => {
                // Weight that is not there has no stiffness, and its forces are missing.
                for k in 0..TEN {
                    let unit = std::array::from_fn(|j| f64::from(u8::from(j == k)));
                    let gone = preload.of_weight(&unit) * change - all.column(k);
                    let column = rows.column(k) + gone;
                    rows.set_column(k, &column);
                }
                other
            }
            Load::Added(other) => other,
        };
        let there = Vector6::from(all * SMatrix::<f64, TEN, 1>::from(*other));
        (rows, (stiffness + preload.of_weight(other)) * change - there)
    }

    /// Returns the covariance of the equations that the stated load has, N and N m.
    pub(super) fn of_load(&self, gravity_mps2: f64) -> DMatrix<f64> {
        let all = weight(gravity_mps2);
        let covariance = match &self.load {
            Load::Bare(_, covariance) => all * covariance.as_ref() * all.transpose(),
            Load::Added(_) => Matrix6::zeros(),
        };
        DMatrix::from_fn(6, 6, |i, j| covariance[(i, j)])
    }
}

//! The wrench of a foot in the equations of base and joints, and its changes.

use nalgebra::{DMatrix, Matrix6, SMatrix, Vector3, Vector6};
use rigident_shared::tree::TreeError;
use rigident_shared::tree::motion::Screw;

use super::super::rows::BASE;
use super::Foot;
use rigident_model::rows::Moving;

/// Columns of a foot's wrench and their derivative as components in base axes, rows of the base and then of
/// all freedoms.
pub(in super::super) struct Columns {
    pub(in super::super) values: DMatrix<f64>,
    pub(in super::super) slopes: DMatrix<f64>,
}

/// A unit wrench of a foot about the root's origin: force and moment with their derivatives.
struct Unit {
    force: Vector3<f64>,
    moment: Vector3<f64>,
    force_slope: Vector3<f64>,
    moment_slope: Vector3<f64>,
}

fn six(force: &Vector3<f64>, moment: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
}

/// Returns the columns of the wrenches of some feet in the tree about the IMU, brought to a position and a
/// rate before; base rows are about the base link's origin.
///
/// # Errors
/// [`TreeError`] if the links are in no order.
pub(in super::super) fn columns(moving: &mut Moving, feet: &[&Foot]) -> Result<Vec<Columns>, TreeError> {
    let screws = moving.screws()?.to_vec();
    feet.iter().map(|foot| of_foot(moving, &screws, foot)).collect()
}

fn of_foot(moving: &Moving, screws: &[Screw<f64>], foot: &Foot) -> Result<Columns, TreeError> {
    let link = foot.link + BASE;
    let states = moving.states();
    let (Some(root), Some(base), Some(state)) = (states.first(), states.get(BASE), states.get(link)) else {
        return Err(TreeError::Lengths);
    };
    let arm = state.rotation * foot.position;
    let place = state.position + arm;
    // As components in base axes.
    let motion = state.velocity + state.rate.cross(&arm) - root.rate.cross(&place);
    let turning = state.rate - root.rate;
    let axes = state.rotation * foot.rotation;
    let rows = 6 + screws.len();
    let mut out = Columns { values: DMatrix::zeros(rows, 6), slopes: DMatrix::zeros(rows, 6) };
    let above = moving.freedoms_above(link);
    for k in 0..6 {
        let axis: Vector3<f64> = axes.column(k % 3).into();
        let change = turning.cross(&axis);
        let zero = Vector3::zeros();
        let unit = if k < 3 {
            Unit {
                force: axis,
                moment: place.cross(&axis),
                force_slope: change,
                moment_slope: motion.cross(&axis) + place.cross(&change),
            }
        } else {
            Unit { force: zero, moment: axis, force_slope: zero, moment_slope: change }
        };
        let (value, slope) = (six(&unit.force, &unit.moment), six(&unit.force_slope, &unit.moment_slope));
        let to_base = |w: &Vector6<f64>| about(w, &base.position);
        out.values.view_mut((0, k), (6, 1)).copy_from(&to_base(&value));
        out.slopes.view_mut((0, k), (6, 1)).copy_from(&to_base(&slope));
        for j in &above {
            let Some(screw) = screws.get(*j) else { continue };
            let (weights, changes) = (Vector6::from(screw.weights), Vector6::from(screw.changes));
            out.values[(6 + j, k)] = weights.dot(&value);
            out.slopes[(6 + j, k)] = changes.dot(&value) + weights.dot(&slope);
        }
    }
    Ok(out)
}

/// Returns a wrench about a point that is `arm` from the point it was about.
fn about(wrench: &Vector6<f64>, arm: &Vector3<f64>) -> Vector6<f64> {
    let (force, moment) = (wrench.fixed_rows::<3>(0).into_owned(), wrench.fixed_rows::<3>(3).into_owned());
    six(&force, &(moment - arm.cross(&force)))
}

/// Returns what a turn or a shift of each freedom by one changes in the generalised forces `Σ G w` of the
/// feet.
///
/// A foot's wrench beyond the freedom moves with it: by the motion of its screw on what acts at the freedoms
/// above and at the base; what acts at freedoms beyond moves with them and stays the same.
///
/// # Errors
/// [`TreeError`] if the links are in no order.
pub(in super::super) fn moved(
    moving: &mut Moving,
    feet: &[(&Foot, [f64; 6])],
) -> Result<Vec<Vec<f64>>, TreeError> {
    let screws = moving.screws()?.to_vec();
    (0..screws.len()).map(|k| moved_by(moving, &screws, feet, k)).collect()
}

fn moved_by(
    moving: &Moving,
    screws: &[Screw<f64>],
    feet: &[(&Foot, [f64; 6])],
    k: usize,
) -> Result<Vec<f64>, TreeError> {
    let mut out = vec![0.0; 6 + screws.len()];
    let (Some(base), Some(screw)) = (moving.states().get(BASE), screws.get(k)) else {
        return Err(TreeError::Lengths);
    };
    // The freedom's turn n and the velocity v of what is at the root's origin: weights of M and of F.
    let [vx, vy, vz, nx, ny, nz] = screw.weights;
    let (v, n) = (Vector3::new(vx, vy, vz), Vector3::new(nx, ny, nz));
    let moves = spatial_move(&v, &n);
    for (foot, wrench) in feet {
        let link = foot.link + BASE;
        let above = moving.freedoms_above(link);
        let Some(place) = above.iter().position(|j| *j == k) else { continue };
        let Some(state) = moving.states().get(link) else { continue };
        let axes = state.rotation * foot.rotation;
        let [fx, fy, fz, mx, my, mz] = *wrench;
        let force = axes * Vector3::new(fx, fy, fz);
        let moment =
            axes * Vector3::new(mx, my, mz) + (state.position + state.rotation * foot.position).cross(&force);
        let change = moves * six(&force, &moment);
        out.iter_mut().zip(about(&change, &base.position).iter()).for_each(|(to, v)| *to += v);
        // Those above come after it on the way to the root.
        for j in above.iter().skip(place + 1) {
            if let Some(other) = screws.get(*j) {
                out[6 + j] += Vector6::from(other.weights).dot(&change);
            }
        }
    }
    Ok(out)
}

/// Returns the change of a wrench about the root's origin that is carried along by a motion: `F by n×F`,
/// `M by n×M + v×F`.
fn spatial_move(v: &Vector3<f64>, n: &Vector3<f64>) -> Matrix6<f64> {
    let mut out = SMatrix::<f64, 6, 6>::zeros();
    out.fixed_view_mut::<3, 3>(0, 0).copy_from(&n.cross_matrix());
    out.fixed_view_mut::<3, 3>(3, 3).copy_from(&n.cross_matrix());
    out.fixed_view_mut::<3, 3>(3, 0).copy_from(&v.cross_matrix());
    out
}

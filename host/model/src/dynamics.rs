//! Inverse dynamics of a model: recursive Newton and Euler, link by link about centres of mass (J. Luh, M.
//! Walker, R. Paul, 1980). Another way to forces than the rows, for simulating and for checking models
//! against each other.

use nalgebra::{Matrix3, Quaternion, Rotation3, Unit, UnitQuaternion, Vector3};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::Body;
use rigident_shared::tree::{BaseMotion, Joint, Link};

use super::inertial::Parameters;
use super::tree::{Model, NO_BODY};

/// Motion of a link, its own axes.
#[derive(Clone, Copy)]
struct State {
    /// Parent axes ← own axes, and origin in the parent.
    rotation: Matrix3<f64>,
    position: Vector3<f64>,
    rate: Vector3<f64>,
    change: Vector3<f64>,
    force: Vector3<f64>,
}

/// A joint's share: rotation, position, relative rate and its derivative (own axes), relative velocity and
/// acceleration (parent axes).
type Step = (Matrix3<f64>, Vector3<f64>, Vector3<f64>, Vector3<f64>, Vector3<f64>, Vector3<f64>);

/// A freedom: its link, whether it turns that, and its direction in the link's axes.
type Freedom = (usize, bool, Vector3<f64>);

fn about(axis: &Vector3<f64>, angle: f64) -> Matrix3<f64> {
    Rotation3::from_axis_angle(&Unit::new_unchecked(*axis), angle).into_inner()
}

/// Returns the wrench on the base link at its origin in its axes, N and N m, and then the efforts of all
/// freedoms, N m or N.
///
/// Takes numbers as [`super::rows::Moving::set`] does. `None` if they are too few, or a joint is free.
pub fn inverse_dynamics(
    model: &Model,
    base: &BaseMotion<f64>,
    positions: &[f64],
    rates: &[f64],
    accelerations: &[f64],
) -> Option<Vec<f64>> {
    inverse_dynamics_with(model, base, positions, rates, accelerations, &[])
}

/// Returns the same beside wrenches that act on links from outside, each with its link, about the link's
/// origin in its axes, N and N m: what base and joints have to add to them.
pub fn inverse_dynamics_with(
    model: &Model,
    base: &BaseMotion<f64>,
    positions: &[f64],
    rates: &[f64],
    accelerations: &[f64],
    outside: &[(usize, [f64; 6])],
) -> Option<Vec<f64>> {
    let nominal: Vec<Parameters> = model.links.iter().map(|link| link.nominal.unwrap_or(NO_BODY)).collect();
    inverse_dynamics_of(model, &nominal, base, (positions, rates, accelerations), outside)
}

/// Returns the rows of the parameters of all links, ten a link, column by column: what a change of one of
/// them by one changes in
/// [`inverse_dynamics`], tensors about the links' origins held (K. Yamane, Humanoids 2011, equations 24 to
/// 28). For a function that knows nothing of rows; [`super::rows::Moving::all_rows`] says the same at once.
pub fn regressor_by_unit_changes(
    model: &Model,
    base: &BaseMotion<f64>,
    positions: &[f64],
    rates: &[f64],
    accelerations: &[f64],
) -> Option<Vec<Vec<f64>>> {
    let mut phi: Vec<Parameters> = model.links.iter().map(|link| link.nominal.unwrap_or(NO_BODY)).collect();
    let motion = (positions, rates, accelerations);
    let before = inverse_dynamics_of(model, &phi, base, motion, &[])?;
    let mut columns = Vec::with_capacity(10 * phi.len());
    for link in 0..phi.len() {
        for k in 0..10 {
            let own = phi[link][k];
            phi[link][k] += 1.0;
            let after = inverse_dynamics_of(model, &phi, base, motion, &[])?;
            phi[link][k] = own;
            columns.push(after.iter().zip(&before).map(|(after, before)| after - before).collect());
        }
    }
    Some(columns)
}

/// Computes the inverse dynamics of links with these parameters.
fn inverse_dynamics_of(
    model: &Model,
    parameters: &[Parameters],
    base: &BaseMotion<f64>,
    (positions, rates, accelerations): (&[f64], &[f64], &[f64]),
    outside: &[(usize, [f64; 6])],
) -> Option<Vec<f64>> {
    let (states, freedoms) = motion(model, base, (positions, rates, accelerations))?;
    let wrenches = wrenches(model, parameters, &states, outside)?;
    let (force, moment) = wrenches.first()?;
    let mut out: Vec<f64> = force.iter().chain(moment.iter()).copied().collect();
    out.extend(freedoms.iter().map(|(i, turns, direction)| {
        let (f, n) = &wrenches[*i];
        direction.dot(if *turns { n } else { f })
    }));
    Some(out)
}

/// Returns the motion of every link, and all freedoms; `None` as [`inverse_dynamics`].
fn motion(
    model: &Model,
    base: &BaseMotion<f64>,
    (positions, rates, accelerations): (&[f64], &[f64], &[f64]),
) -> Option<(Vec<State>, Vec<Freedom>)> {
    let mut states = vec![State {
        rotation: Matrix3::identity(),
        position: Vector3::zeros(),
        rate: base.rate,
        change: base.angular_acceleration,
        force: base.specific_force,
    }];
    let (mut at_q, mut at_v) = (0, 0);
    let mut freedoms = Vec::new();
    for (i, link) in model.links.iter().enumerate().skip(1) {
        let joint = &link.link.joint;
        let q = positions.get(at_q..at_q + joint.coordinates())?;
        let v = rates.get(at_v..at_v + joint.freedoms())?;
        let a = accelerations.get(at_v..at_v + joint.freedoms())?;
        (at_q, at_v) = (at_q + joint.coordinates(), at_v + joint.freedoms());
        let (rotation, position, rate, change, velocity, acceleration) =
            step(i, &link.link, (q, v, a), &mut freedoms)?;
        let up = states.get(link.link.parent)?;
        let back = rotation.transpose();
        let carried = back * up.rate;
        let swing = up.change.cross(&position) + up.rate.cross(&(up.rate.cross(&position) + velocity * 2.0));
        states.push(State {
            rotation,
            position,
            rate: carried + rate,
            change: back * up.change + carried.cross(&rate) + change,
            force: back * (up.force + swing + acceleration),
        });
    }
    Some((states, freedoms))
}

/// Returns the share of link `i`'s joint with these positions, rates and accelerations, and adds its
/// freedoms; `None` of a free joint.
fn step(
    i: usize,
    link: &Link<f64>,
    (q, v, a): (&[f64], &[f64], &[f64]),
    freedoms: &mut Vec<Freedom>,
) -> Option<Step> {
    let zero = Vector3::zeros();
    let (r0, p0) = (link.rotation, link.position);
    Some(match &link.joint {
        Joint::Fixed => (r0, p0, zero, zero, zero, zero),
        Joint::Revolute(axis) => {
            freedoms.push((i, true, *axis));
            (r0 * about(axis, q[0]), p0, axis * v[0], axis * a[0], zero, zero)
        }
        Joint::Prismatic(axis) => {
            freedoms.push((i, false, *axis));
            let along = r0 * axis;
            (r0, p0 + along * q[0], zero, zero, along * v[0], along * a[0])
        }
        Joint::Universal(first, second) => {
            let inner = about(second, q[1]);
            let carried = inner.transpose() * first;
            freedoms.push((i, true, carried));
            freedoms.push((i, true, *second));
            let change = carried * a[0] + second * a[1] + carried.cross(second) * (v[0] * v[1]);
            (r0 * about(first, q[0]) * inner, p0, carried * v[0] + second * v[1], change, zero, zero)
        }
        Joint::Spherical => {
            let turned = UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]));
            freedoms.extend((0..3).map(|k| (i, true, Vector3::ith(k, 1.0))));
            let rotation = r0 * turned.to_rotation_matrix().matrix();
            (rotation, p0, Vector3::new(v[0], v[1], v[2]), Vector3::new(a[0], a[1], a[2]), zero, zero)
        }
        Joint::Free => return None,
    })
}

/// Returns force and moment that each link needs with all that hang on it, at its origin in its axes, N and
/// N m, beside the wrenches from outside; `None` if one of these is on no link.
fn wrenches(
    model: &Model,
    parameters: &[Parameters],
    states: &[State],
    outside: &[(usize, [f64; 6])],
) -> Option<Vec<(Vector3<f64>, Vector3<f64>)>> {
    let zero = Vector3::zeros();
    let mut wrenches = vec![(zero, zero); states.len()];
    for (i, [fx, fy, fz, mx, my, mz]) in outside {
        let (force, moment) = wrenches.get_mut(*i)?;
        *force -= Vector3::new(*fx, *fy, *fz);
        *moment -= Vector3::new(*mx, *my, *mz);
    }
    for (i, link) in model.links.iter().enumerate().rev() {
        let state = states[i];
        if let Some(phi) = parameters.get(i).filter(|phi| **phi != NO_BODY) {
            let body = InertialParameters::<Body, f64>::from_vector(*phi);
            // Moments without mass are about every point.
            let (c, tensor) = if body.mass > 0.0 {
                (body.first_moment / body.mass, body.inertia_com())
            } else {
                (zero, body.inertia)
            };
            let (w, dw) = (state.rate, state.change);
            let force = (state.force + dw.cross(&c) + w.cross(&w.cross(&c))) * body.mass;
            wrenches[i].0 += force;
            wrenches[i].1 += tensor * dw + w.cross(&(tensor * w)) + c.cross(&force);
        }
        if i > 0 {
            let (f, n) = (state.rotation * wrenches[i].0, state.rotation * wrenches[i].1);
            let parent = &mut wrenches[link.link.parent];
            parent.0 += f;
            parent.1 += n + state.position.cross(&f);
        }
    }
    Some(wrenches)
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::*;
    use crate::human::Person;
    use crate::rows::Moving;

    #[test]
    fn inverse_dynamics_of_a_person_are_the_rows_times_the_parameters() {
        let model = Person::default().human58().unwrap();
        let mut moving = Moving::new(model.tree()).unwrap();
        let number = |k: usize| ((k * k * 31 + k * 17 + 5) as f64).sin();
        let mut q: Vec<f64> = Vec::new();
        for link in model.links.iter().skip(1) {
            let own: Vec<f64> = (0..link.link.joint.coordinates()).map(|k| number(q.len() + k)).collect();
            let norm = own.iter().map(|v| v * v).sum::<f64>().sqrt();
            q.extend(own.iter().map(|v| if own.len() == 4 { v / norm } else { *v }));
        }
        let v: Vec<f64> = (0..moving.freedoms()).map(|k| number(k + 100)).collect();
        let a: Vec<f64> = (0..moving.freedoms()).map(|k| number(k + 200)).collect();
        let base = BaseMotion {
            specific_force: Vector3::new(1.0, -2.0, 9.0),
            rate: Vector3::new(0.3, 0.4, -0.5),
            angular_acceleration: Vector3::new(-1.0, 0.5, 2.0),
        };
        moving.set(&q, &v, &a, &base).unwrap();
        let columns = moving.columns();
        let phi = DVector::from_vec(model.nominal());
        let rows = nalgebra::DMatrix::from_row_slice(6 + v.len(), columns, moving.all_rows().unwrap());
        let got = DVector::from_vec(inverse_dynamics(&model, &base, &q, &v, &a).unwrap());
        let wanted = &rows * phi;
        assert!((&got - &wanted).abs().max() < 1e-12 * wanted.abs().max());
        // Column by column, whatever the others are.
        let columns = regressor_by_unit_changes(&model, &base, &q, &v, &a).unwrap();
        for (own, column) in rows.column_iter().zip(&columns) {
            let off = own.iter().zip(column).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off < 1e-10 * wanted.abs().max().max(1.0), "{off}");
        }
        assert_eq!(columns.len(), rows.ncols());
    }
}

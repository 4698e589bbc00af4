//! A robot whose inertial parameters are known, in motion: its momentum, and the columns of the link that is
//! watched.

use nalgebra::{Matrix3, Vector3};

use crate::Scalar;
use crate::inertia::tensor_from_elements;
use crate::spatial::{Imu, Rotation};
use crate::tree::momentum::{momentum, smoothed};
use crate::tree::{BaseMotion, Joint, JointMotion, Link, LinkState};

/// Links at most, the base included.
pub const WATCH_LINKS: usize = 32;
/// Sensors of forces at most.
pub const WATCH_FEET: usize = 4;
/// Angles are to be between plus and minus this many radians.
const LARGEST_ANGLE: f32 = 50.0;

/// Holds a link whose parameters are known. The first one is the base, in the axes of its IMU, about the
/// IMU's place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WatchLink<T: Scalar> {
    /// The place where it hangs. Its joint is fixed, revolute or prismatic.
    pub link: Link<T>,
    /// m (kg), m c (kg m), Ixx, Iyy, Izz, Iyz, Ixz, Ixy (kg m²) about the link's origin, in its axes.
    pub parameters: [T; 10],
}

/// Places a sensor of the wrench on a link: under a foot, or where a base is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WatchFoot<T: Scalar> {
    /// The link that it pushes.
    pub link: u8,
    /// Axes of the link ← axes of the sensor.
    pub rotation: Matrix3<T>,
    /// The sensor's origin in the link's frame, m.
    pub position: Vector3<T>,
}

/// Returns the rotation matrix of a quaternion w, x, y, z that has a length of one.
pub fn turned<T: Scalar>(wxyz: [T; 4]) -> Option<Matrix3<T>> {
    Rotation::<Imu, Imu, T>::from_quaternion(wxyz).map(|rotation| rotation.matrix())
}

/// The information of a robot in one frame on the wrench that the parameters leave:
/// `left = smoothed + d/dt differentiated`, and so for the columns of the watched link.
#[derive(Clone, Copy, Debug)]
pub(super) struct Share<T> {
    /// The wrench less what the known parameters make of it, N, N m, without derivatives; ten columns, the
    /// right-hand side last.
    pub(super) smoothed: [[T; 11]; 6],
    /// The part to be differentiated.
    pub(super) differentiated: [[T; 11]; 6],
}

/// The places of the links at an instant.
pub(super) struct Motion<T: Scalar> {
    states: [LinkState<T>; WATCH_LINKS],
    base: BaseMotion<T>,
}

/// Returns the state of every link; `None` if a number is none, an angle is far too large, or the links are
/// in no order.
#[inline(never)]
pub(super) fn motion<T: Scalar>(
    links: &[WatchLink<T>],
    joints: &[[T; 2]],
    specific_force: [T; 3],
    rate: [T; 3],
) -> Option<Motion<T>> {
    let base = BaseMotion {
        specific_force: specific_force.into(),
        rate: rate.into(),
        angular_acceleration: Vector3::zeros(),
    };
    let mut states = [LinkState::zero(); WATCH_LINKS];
    states.first_mut()?.rate = base.rate;
    for (i, (WatchLink { link, .. }, [place, speed])) in
        links.iter().skip(1).zip(joints).enumerate().map(|(k, both)| (1 + k, both))
    {
        let joint = match &link.joint {
            Joint::Revolute(axis) => JointMotion::revolute(link, axis, sine_cosine(*place)?, *speed, T::ZERO),
            Joint::Prismatic(axis) => JointMotion::prismatic(link, axis, *place, *speed, T::ZERO),
            _ => JointMotion::rest(link),
        };
        let (before, rest) = states.split_at_mut_checked(i)?;
        let (parent, state) = (before.get(link.parent)?, rest.first_mut()?);
        // As in a tree's states, without accelerations.
        let arm = parent.rotation * joint.position;
        state.rotation = parent.rotation * joint.rotation;
        state.position = parent.position + arm;
        state.velocity = parent.velocity + parent.rate.cross(&arm) + parent.rotation * joint.velocity;
        state.rate = parent.rate + state.rotation * joint.rate;
    }
    Some(Motion { states, base })
}

impl<T: Scalar> Motion<T> {
    /// Returns what is left of these wrenches by the known parameters, and the columns of the watched link.
    #[inline(never)]
    pub(super) fn share(
        &self,
        links: &[WatchLink<T>],
        watched: u8,
        feet: &[WatchFoot<T>],
        wrenches: &[[T; 6]],
    ) -> Option<Share<T>> {
        let (mut mass, mut first) = (T::ZERO, Vector3::zeros());
        let (mut p, mut h) = (Vector3::zeros(), Vector3::zeros());
        for (WatchLink { parameters, .. }, state) in links.iter().zip(&self.states) {
            let [m, cx, cy, cz, xx, yy, zz, yz, xz, xy] = *parameters;
            let centre = state.rotation * Vector3::new(cx, cy, cz);
            let own = state.rotation.tr_mul(&state.rate);
            let spin = state.rotation * (tensor_from_elements([xx, yy, zz, yz, xz, xy]) * own);
            let linear = state.velocity * m + state.rate.cross(&centre);
            mass += m;
            first += state.position * m + centre;
            p += linear;
            h += state.position.cross(&linear) + centre.cross(&state.velocity) + spin;
        }
        let (a, rate) = (&self.base.specific_force, &self.base.rate);
        let mut force = -(rate.cross(&p) + a * mass);
        let mut moment = -(rate.cross(&h) + first.cross(a));
        for (foot, [fx, fy, fz, mx, my, mz]) in feet.iter().zip(wrenches) {
            let state = self.states.get(usize::from(foot.link))?;
            let turn = state.rotation * foot.rotation;
            let pushed = turn * Vector3::new(*fx, *fy, *fz);
            let arm = state.position + state.rotation * foot.position;
            force += pushed;
            moment += arm.cross(&pushed) + turn * Vector3::new(*mx, *my, *mz);
        }
        let state = self.states.get(usize::from(watched))?;
        let moving = momentum(state);
        let rest = smoothed(state, &self.base, &moving);
        let left = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
        let less = [p.x, p.y, p.z, h.x, h.y, h.z];
        let with = |row: &[T; 10], last: T| {
            let [a, b, c, d, e, f, g, h, i, j] = *row;
            [a, b, c, d, e, f, g, h, i, j, last]
        };
        let mut share = Share { smoothed: [[T::ZERO; 11]; 6], differentiated: [[T::ZERO; 11]; 6] };
        for (slot, (row, last)) in share.smoothed.iter_mut().zip(rest.iter().zip(left)) {
            *slot = with(row, last);
        }
        for (slot, (row, last)) in share.differentiated.iter_mut().zip(moving.iter().zip(less)) {
            *slot = with(row, -last);
        }
        Some(share)
    }
}

/// Returns sine and cosine; `None` beyond [`LARGEST_ANGLE`] or of what is no number. Quarter turns are taken
/// off, and series take the rest.
pub(super) fn sine_cosine<T: Scalar>(angle: T) -> Option<(T, T)> {
    // NaN is refused, too.
    if angle.abs() > T::from_f32(LARGEST_ANGLE) || !angle.is_finite() {
        return None;
    }
    // π/2 in two parts, the first with zeros at its end.
    let (quarter, rest) =
        (T::from_f32(1.570_312_5), T::from_f64_const(core::f64::consts::FRAC_PI_2 - 1.570_312_5));
    let eighth = T::from_f32(core::f32::consts::FRAC_PI_4);
    let (mut left, mut turns) = (angle.abs(), 0_u8);
    while left > eighth {
        (left, turns) = (left - quarter, turns + 1);
    }
    // Rounds once: the first product and its difference are exact.
    let taken = T::from_u32(turns.into());
    let x = angle.abs() - taken * quarter - taken * rest;
    let xx = x * x;
    let (mut sine, mut cosine) = (T::ONE, T::ONE);
    for n in (1..=8).rev() {
        sine = T::ONE - xx * sine / T::from_u32(2 * n * (2 * n + 1));
        cosine = T::ONE - xx * cosine / T::from_u32(2 * n * (2 * n - 1));
    }
    sine *= x;
    let (sine, cosine) = match turns % 4 {
        0 => (sine, cosine),
        1 => (cosine, -sine),
        2 => (-sine, -cosine),
        _ => (-cosine, sine),
    };
    Some((if angle < T::ZERO { -sine } else { sine }, cosine))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_and_cosines_are_those_of_the_standard_library() {
        for k in -5000..=5000 {
            let angle = f64::from(k) * 0.0099;
            let (sine, cosine) = sine_cosine(angle).unwrap();
            assert!((sine - angle.sin()).abs() < 1e-14 && (cosine - angle.cos()).abs() < 1e-14, "{angle}");
            let single = angle as f32;
            let (sine, cosine) = sine_cosine(single).unwrap();
            let (s, c) = f64::from(single).sin_cos();
            let most = 2e-7;
            assert!((f64::from(sine) - s).abs() < most && (f64::from(cosine) - c).abs() < most, "{angle}");
        }
        assert_eq!(
            (sine_cosine(f32::NAN), sine_cosine(f32::INFINITY), sine_cosine(51.0_f64)),
            (None, None, None)
        );
    }
}

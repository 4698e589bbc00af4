//! Errors of the ground's wrench under a tree whose base is tracked: what each adds to the wrench about the base's origin.

use nalgebra::Vector3;

use super::Frame;

/// A force plate whose zero is not known.
#[derive(Clone, Debug, PartialEq)]
pub struct UnknownZero {
    /// The plate's name.
    pub plate: String,
    /// The point that its moments' zero is about, laboratory axes, m.
    pub at_m: [f64; 3],
    /// 1 σ of each force's and each moment's zero, N and N m.
    pub sigma: [f64; 2],
}

impl UnknownZero {
    /// Returns the wrenches of unit zeros about the laboratory's origin: 1 N along each axis, then 1 N m about each.
    pub fn wrenches(&self) -> [[f64; 6]; 6] {
        let at = Vector3::from(self.at_m);
        std::array::from_fn(|k| {
            let own = Vector3::ith(k % 3, 1.0);
            let (force, moment) = if k < 3 { (own, at.cross(&own)) } else { (Vector3::zeros(), own) };
            [force.x, force.y, force.z, moment.x, moment.y, moment.z]
        })
    }

    /// Returns 1 σ of each of them, N and N m.
    pub fn sigmas(&self) -> [f64; 6] {
        std::array::from_fn(|k| self.sigma[usize::from(k >= 3)])
    }
}

/// A wrench about the laboratory's origin as one about the base's origin in a frame.
pub(crate) fn about_base(frame: &Frame, [fx, fy, fz, mx, my, mz]: [f64; 6]) -> [f64; 6] {
    let at = Vector3::from_iterator(frame.positions.iter().take(3).copied());
    let moment = Vector3::new(mx, my, mz) - at.cross(&Vector3::new(fx, fy, fz));
    [fx, fy, fz, moment.x, moment.y, moment.z]
}

#[cfg(test)]
mod tests {
    use rigident_shared::tree::BaseMotion;

    use super::*;

    #[test]
    fn a_force_s_zero_turns_about_the_base() {
        // 1 N upwards 0.3 m ahead of the base's origin turns it by -0.3 N m about y.
        let frame = Frame {
            time_ns: 0,
            positions: vec![0.2, 0.0, 1.0],
            rates: Vec::new(),
            base: BaseMotion::still([0.0; 3]),
            wrench: [0.0; 6],
            efforts: Vec::new(),
            standing: Vec::new(),
        };
        let wrench = about_base(&frame, [0.0, 0.0, 1.0, 0.0, -0.5, 0.0]);
        assert!((wrench[4] + 0.3).abs() < 1e-12 && wrench[2] == 1.0, "{wrench:?}");
    }
}

//! Errors of the ground's wrench under a tree whose base is tracked: what each adds to the wrench about the base's origin.

use nalgebra::Vector3;
use rigident_shared::screening::Rejection;

use super::{Frame, Input, SignalError, TreeSource};
use crate::fit::{Basis, Effect, Kind, Nuisance, OtherColumns, Owner, Parameter, Scope};

const AXES: [&str; 3] = ["x", "y", "z"];

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

impl Input {
    /// Adds the zero of a force plate to the errors that are estimated and eliminated.
    pub fn add_zero(&mut self, zero: &UnknownZero) {
        let at = Vector3::from(zero.at_m);
        for (kind, unit, sigma) in [("force", "N", zero.sigma[0]), ("moment", "N m", zero.sigma[1])] {
            for (k, axis) in AXES.iter().enumerate() {
                let own = Vector3::ith(k, 1.0);
                let (force, moment) =
                    if kind == "force" { (own, at.cross(&own)) } else { (Vector3::zeros(), own) };
                self.nuisances.push(Nuisance {
                    name: format!("zero_{kind}_{axis} of {}", zero.plate),
                    group: "zero of a plate".to_owned(),
                    unit: unit.to_owned(),
                    sigma,
                    basis: Basis::Class("force plate".to_owned()),
                    scope: Scope::Recording,
                    effect: Effect::Signal(self.errors.len()),
                });
                let wrench = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
                self.errors.push(SignalError::Ground(wrench));
            }
        }
    }
}

/// A wrench about the laboratory's origin as one about the base's origin in a frame.
pub(crate) fn about_base(frame: &Frame, [fx, fy, fz, mx, my, mz]: [f64; 6]) -> [f64; 6] {
    let at = Vector3::from_iterator(frame.positions.iter().take(3).copied());
    let moment = Vector3::new(mx, my, mz) - at.cross(&Vector3::new(fx, fy, fz));
    [fx, fy, fz, moment.x, moment.y, moment.z]
}

/// Returns the columns of a source's errors, all of the ground's wrench.
pub(super) fn ground_columns(source: &TreeSource) -> OtherColumns<'_> {
    let errors = &source.input().errors;
    let parameter =
        |k: usize| Parameter::new(format!("error {k}"), Owner::Link(String::new()), Kind::Offset, "");
    OtherColumns::new(source, (0..errors.len()).map(parameter).collect(), move |sample, rows| {
        source.measure(sample, &mut rows.measured)?;
        rows.measured.fill(0.0);
        let frame = source.input().frames.get(sample).ok_or(Rejection::NotFinite(0))?;
        for (k, error) in errors.iter().enumerate() {
            let SignalError::Ground(wrench) = error else { continue };
            let column = rows.smoothed.iter_mut().skip(k).step_by(errors.len());
            column.zip(about_base(frame, *wrench)).for_each(|(to, value)| *to = value);
        }
        Ok(())
    })
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

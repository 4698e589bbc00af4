//! Errors of the ground's wrench under a tree whose base is tracked: what each adds to the wrench about the
//! base's origin.

use nalgebra::Vector3;

use super::{Frame, TreeSource};
use rigident_fit::{Kind, OtherColumns, Owner, Parameter, RowSource as _, SampleRows};

/// A force plate whose zero is not known.
#[derive(Clone, Debug, PartialEq)]
pub struct UnknownZero {
    /// The point that its moments' zero is about, laboratory axes, m.
    pub at_m: [f64; 3],
    /// 1 σ of each force's and each moment's zero, N and N m.
    pub sigma: [f64; 2],
}

impl UnknownZero {
    /// Returns the wrenches of unit zeros about the laboratory's origin: 1 N along each axis, then 1 N m
    /// about each.
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

/// Returns rows with `more` columns behind the parameters: wrenches about the laboratory's origin, N and N m,
/// that are added to the ground's in a sample.
pub fn with_wrenches<'a>(
    source: &'a TreeSource,
    more: usize,
    wrenches: impl Fn(usize) -> Vec<[f64; 6]> + Send + Sync + 'a,
) -> OtherColumns<'a> {
    let (n, channels) = (source.parameters().len(), source.channels().len());
    let column =
        |k: usize| Parameter::new(format!("plate error {k}"), Owner::Link(String::new()), Kind::Offset, "");
    let parameters = source.parameters().iter().cloned().chain((0..more).map(column)).collect();
    OtherColumns::new(source, parameters, move |sample, rows| {
        let mut own = SampleRows::default();
        own.clear(channels, n);
        source.rows(sample, &mut own)?;
        let all = n + more;
        for (to, from) in
            [(&mut rows.smoothed, &own.smoothed), (&mut rows.differentiated, &own.differentiated)]
        {
            for (to, from) in to.chunks_exact_mut(all).zip(from.chunks_exact(n)) {
                to[..n].copy_from_slice(from);
            }
        }
        if let Some(frame) = source.input().frames.get(sample) {
            for (k, wrench) in wrenches(sample).into_iter().enumerate() {
                let column = rows.smoothed.iter_mut().skip(n + k).step_by(all);
                column.zip(about_base(frame, wrench)).for_each(|(to, value)| *to = value);
            }
        }
        (rows.measured, rows.missing) = (own.measured, own.missing);
        Ok(())
    })
}

/// Returns a wrench about the laboratory's origin as a wrench about the base's origin in a frame.
fn about_base(frame: &Frame, [fx, fy, fz, mx, my, mz]: [f64; 6]) -> [f64; 6] {
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
            ground: Default::default(),
        };
        let wrench = about_base(&frame, [0.0, 0.0, 1.0, 0.0, -0.5, 0.0]);
        assert!((wrench[4] + 0.3).abs() < 1e-12 && wrench[2] == 1.0, "{wrench:?}");
    }
}

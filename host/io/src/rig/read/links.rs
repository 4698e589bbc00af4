//! Links, joints, feet and tree.

use super::{Check, NOISE, NOT_NEGATIVE, RigFileError};
use crate::rig::{Joint, Quantity};

impl Check<'_> {
    pub(super) fn links(&self) -> Result<(), RigFileError> {
        let mut names: Vec<&str> = Vec::new();
        for (n, link) in self.rig.link.iter().enumerate() {
            let key = |name: &str| format!("link[{n}].{name}");
            if names.contains(&link.name.as_str()) {
                return Err(self.refuse(&key("name"), &link.name, "two links have this name"));
            }
            match &link.parent {
                None if n > 0 => {
                    return Err(self.refuse(
                        &key("name"),
                        &link.name,
                        "every link but the first needs a parent",
                    ));
                }
                Some(parent) if !names.contains(&parent.as_str()) => {
                    return Err(self.refuse(&key("parent"), parent, "must be a link named above"));
                }
                _ => {}
            }
            names.push(&link.name);
            self.finite(&key("position_m"), link.position_m.as_ref().map_or(&[], |p| p.as_slice()))?;
            self.rotation(&key("rotation_wxyz"), &link.rotation_wxyz)?;
            if let Some(initial) = &link.initial_wxyz {
                self.rotation(&key("initial_wxyz"), initial)?;
            }
            let has_axis = matches!(link.joint, Some(Joint::Revolute | Joint::Continuous | Joint::Prismatic));
            if let (true, None, Some(joint)) = (has_axis, link.axis, link.joint) {
                return Err(self.refuse(&key("joint"), joint, "needs its axis = [x, y, z]"));
            }
            for (name, axis) in [("axis", link.axis), ("second_axis", link.second_axis)] {
                self.finite(&key(name), axis.as_ref().map_or(&[], |a| a.as_slice()))?;
            }
            let nominal = [
                link.nominal_mass_kg.is_some(),
                link.nominal_com_m.is_some(),
                link.nominal_inertia_com_kgm2.is_some(),
            ];
            if nominal.contains(&true) && nominal.contains(&false) {
                return Err(self.refuse(
                    &key("name"),
                    &link.name,
                    "nominal_mass_kg, nominal_com_m and nominal_inertia_com_kgm2 are given together or not \
                     at all",
                ));
            }
            self.positive(&key("nominal_mass_kg"), link.nominal_mass_kg.as_slice())?;
            self.finite(&key("nominal_com_m"), link.nominal_com_m.as_ref().map_or(&[], |v| v.as_slice()))?;
            let tensor = link.nominal_inertia_com_kgm2.as_ref();
            self.finite(&key("nominal_inertia_com_kgm2"), tensor.map_or(&[], |v| v.as_slice()))?;
        }
        Ok(())
    }

    pub(super) fn tree(&self) -> Result<(), RigFileError> {
        let tree = &self.rig.tree;
        for (name, sigma) in [
            ("joint_zero_std_rad", tree.joint_zero_std_rad),
            ("joint_zero_std_m", tree.joint_zero_std_m),
            ("base_tilt_std_rad", tree.base_tilt_std_rad),
            ("skew_std_s", tree.skew_std_s),
            ("effort_gain_std", tree.effort_gain_std),
            ("effort_drift_std", tree.effort_drift_std),
        ] {
            self.all(&format!("tree.{name}"), sigma.as_slice(), |v| v >= 0.0, NOT_NEGATIVE)?;
        }
        Ok(())
    }

    pub(super) fn feet(&self) -> Result<(), RigFileError> {
        for (n, foot) in self.rig.foot.iter().enumerate() {
            for (name, source) in &foot.columns {
                let quantity = match name.as_bytes().first() {
                    Some(b'f') => Some(Quantity::Force),
                    Some(b'm') => Some(Quantity::Moment),
                    _ => None,
                };
                self.unit(&format!("foot[{n}].columns.{name}"), source, quantity.as_slice())?;
            }
        }
        Ok(())
    }

    pub(super) fn joints(&self) -> Result<(), RigFileError> {
        let mut names: Vec<&str> = Vec::new();
        for (n, joint) in self.rig.joint.iter().enumerate() {
            let key = |name: &str| format!("joint[{n}].{name}");
            if names.contains(&joint.name.as_str()) {
                return Err(self.refuse(&key("name"), &joint.name, "two [[joint]] tables have this name"));
            }
            names.push(&joint.name);
            for (name, sigma) in [
                ("position_noise", &joint.position_noise),
                ("rate_noise", &joint.rate_noise),
                ("effort_noise", &joint.effort_noise),
            ] {
                self.all(&key(name), sigma.as_slice(), |v| v > 0.0, NOISE)?;
            }
            for (name, sigma) in [("zero_std", joint.zero_std), ("effort_gain_std", joint.effort_gain_std)] {
                self.all(&key(name), sigma.as_slice(), |v| v >= 0.0, NOT_NEGATIVE)?;
            }
            for (name, source) in
                [("position", &joint.position), ("rate", &joint.rate), ("effort", &joint.effort)]
            {
                let Some(source) = source else { continue };
                let (column, scale) = source.parts();
                if column.trim() != column || column.is_empty() {
                    let advice = "must be the column's name, without blanks around it";
                    return Err(self.refuse(&key(name), column, advice));
                }
                if !scale.is_finite() || scale == 0.0 {
                    return Err(self.refuse(&key(name), scale, "its scale must be finite and not zero"));
                }
                self.unit(
                    &key(name),
                    source,
                    match name {
                        "position" => &[Quantity::Angle, Quantity::Length],
                        "rate" => &[Quantity::AngularRate, Quantity::Speed],
                        _ => &[Quantity::Moment, Quantity::Force],
                    },
                )?;
                let others = source.plus().map(|(_, factor)| factor).chain([source.offset()]);
                let others: Vec<f64> = others.collect();
                self.all(
                    &key(name),
                    &others,
                    f64::is_finite,
                    "offset and the factors of plus must be finite",
                )?;
            }
        }
        Ok(())
    }
}

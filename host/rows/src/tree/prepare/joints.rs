//! The joints' columns: positions, rates, efforts, in units of their own.

use std::collections::BTreeMap;

use rigident_shared::tree::Joint;

use super::frames::Coordinates;
use super::{JointColumns, Preparation};
use crate::tree::TreePrepareError;
use crate::tree::columns::{Quantity, column, numbers, units};
use crate::tree::polynomial::Polynomial;

/// Units that positions, rates and efforts of joints are recorded in.
#[rustfmt::skip]
const UNITS: [&str; 40] = [
    "rad", "mrad", "deg", "rev", "turns", "radps", "mradps", "degps", "dps", "rpm", "rps", "m", "cm", "mm", "um", "in", "inch",
    "ft", "mps", "cmps", "mmps", "nm", "ncm", "nmm", "mnm", "knm", "lbfin", "lbfft", "ftlb", "ftlbf", "inlb", "inlbf", "kgfm", "kgfcm",
    "kgcm", "n", "kn", "lbf", "lb", "kgf",
];

impl Preparation<'_> {
    /// Columns of the joints of one freedom, by link.
    pub(super) fn joint_columns(&self) -> Result<BTreeMap<usize, JointColumns>, TreePrepareError> {
        let mut found = BTreeMap::new();
        let tables = &self.recording.rig.joint;
        if let Some(table) = tables.iter().find(|t| self.model.joint(&t.name).is_none()) {
            let names: Vec<&str> = self.model.links.iter().skip(1).map(|l| l.joint_name.as_str()).collect();
            return Err(self.misfit(format!(
                "the rig file's [[joint]] {} is not in it; its movable joints are {}",
                table.name,
                names.join(", ")
            )));
        }
        for (i, link) in self.model.links.iter().enumerate().skip(1) {
            let Some(units) = units(&link.link.joint) else { continue };
            let name = &link.joint_name;
            let read = |quantity: Quantity| {
                let Some(column) = column(&self.recording.rig, name, &link.link.joint, quantity) else {
                    return Ok(None);
                };
                let values = numbers(self.recording, &column)?;
                if values.is_none() && column.is_named {
                    return Err(self.missing(
                        format!("column {:?}, which the rig file names for joint {name}, is", column.name),
                        "correct the name in [[joint]]",
                    ));
                }
                Ok(values)
            };
            let positions = read(Quantity::Position)?;
            let rates = read(Quantity::Rate)?;
            let effort = read(Quantity::Effort)?;
            self.other_unit(name, &units)?;
            if positions.is_none() && rates.is_none() && effort.is_none() {
                continue;
            }
            let Some(positions) = positions else {
                return Err(self.missing(
                    format!("the position of joint {name} ({name}_{}) is", units[0]),
                    "rates and efforts alone do not give its position",
                ));
            };
            let table = tables.iter().find(|t| t.name == *name);
            let effort = match table.and_then(|t| t.effort_lowpass_hz) {
                Some(lowpass_hz) => {
                    effort.map(|values| self.before_lowpass(&values, lowpass_hz, name)).transpose()?
                }
                None => effort,
            };
            found.insert(
                i,
                JointColumns {
                    positions,
                    rates,
                    effort,
                    position_noise: table.and_then(|t| t.position_noise),
                    rate_noise: table.and_then(|t| t.rate_noise),
                    effort_noise: table.and_then(|t| t.effort_noise),
                },
            );
        }
        Ok(found)
    }

    /// Returns what went into a low-pass of first order that these efforts are the output of: `τ + τ̇/ω`,
    /// slopes by central differences of fourth order.
    fn before_lowpass(
        &self,
        values: &[f64],
        lowpass_hz: f64,
        joint: &str,
    ) -> Result<Vec<f64>, TreePrepareError> {
        let rate_hz = self.recording.rate_hz.unwrap_or(1.0);
        if !(lowpass_hz.is_finite() && lowpass_hz > 0.0) || self.recording.is_static {
            return Err(self.misfit(format!(
                "effort_lowpass_hz = {lowpass_hz} of joint {joint}: a frequency above zero, Hz, of a \
                 recording in motion"
            )));
        }
        let (last, lag) = (values.len().saturating_sub(1), rate_hz / (std::f64::consts::TAU * lowpass_hz));
        let at = |k: usize, by: isize| values[k.saturating_add_signed(by).min(last)];
        let slope = |k: usize| {
            if k < 2 || k + 2 > last {
                // At the ends, to what there is.
                return (at(k, 1) - at(k, -1))
                    / (k + 1).min(last).saturating_sub(k.saturating_sub(1)).max(1) as f64;
            }
            (8.0 * (at(k, 1) - at(k, -1)) - (at(k, 2) - at(k, -2))) / 12.0
        };
        Ok((0..values.len()).map(|k| values[k] + lag * slope(k)).collect())
    }

    /// Complains of a joint's column in a unit that is not its own.
    pub(super) fn other_unit(&self, joint: &str, units: &[&str; 3]) -> Result<(), TreePrepareError> {
        let named = |column: &str| {
            let sources = self.recording.rig.joint.iter().flat_map(|t| [&t.position, &t.rate, &t.effort]);
            sources.flatten().any(|source| source.parts().0 == column)
        };
        let strange = self.cells.keys().find(|column| {
            column
                .strip_prefix(joint)
                .and_then(|rest| rest.strip_prefix('_'))
                .is_some_and(|unit| UNITS.contains(&unit) && !units.contains(&unit) && !named(column))
        });
        let Some(column) = strange else { return Ok(()) };
        Err(self.misfit(format!(
            "column {column} of joint {joint} is in another unit than {joint}_{}, {joint}_{}, {joint}_{}; \
             name it with its scale in the rig file, [[joint]] name = \"{joint}\", position = \
             {{ name = \"{column}\", scale = … }}",
            units[0], units[1], units[2]
        )))
    }

    pub(super) fn efforts(
        &mut self,
        joints: &BTreeMap<usize, JointColumns>,
        has_feet: bool,
    ) -> Result<Option<Vec<Vec<f64>>>, TreePrepareError> {
        let mut efforts = Vec::new();
        let mut without = Vec::new();
        for (i, link) in self.model.links.iter().enumerate().skip(1) {
            match joints.get(&i).and_then(|j| j.effort.clone()) {
                Some(values) => efforts.push(values),
                // Rows are freed of them.
                None if has_feet => efforts.push(vec![0.0; self.recording.rows()]),
                None => without.push(link.joint_name.as_str()),
            }
        }
        if efforts.is_empty() {
            return Ok(None);
        }
        if !without.is_empty() {
            return Err(self.missing(
                format!("the efforts (JOINT_nm, or JOINT_n of what slides) of {} are", without.join(", ")),
                self.about_efforts(&without),
            ));
        }
        Ok(Some(efforts))
    }

    /// Returns positions and rates of joints with columns, and which rows have them.
    pub(super) fn coordinates(
        &mut self,
        joints: &BTreeMap<usize, JointColumns>,
        rate_hz: f64,
    ) -> Coordinates {
        let rows = self.recording.rows();
        let mut valid = vec![true; rows];
        let mut all = BTreeMap::new();
        let without = joints.values().filter(|j| j.rates.is_none()).count();
        let fit = (without > 0 && !self.recording.is_static).then(|| Polynomial::new(rate_hz));
        if let Some(fit) = &fit {
            self.notes.push(format!(
                "rates of {without} joints are the slopes of polynomials fitted to {} positions each",
                2 * fit.half() + 1
            ));
            // Stretches without gaps, less their ends.
            let period = 1e9 / rate_hz;
            let times = &self.recording.time_ns;
            let mut start = 0;
            for row in 1..=rows {
                let gap = row == rows
                    || matches!((times.get(row - 1), times.get(row)), (Some(a), Some(b)) if (b - a) as f64 > 1.5 * period);
                if gap {
                    for (k, v) in valid.iter_mut().enumerate().take(row).skip(start) {
                        *v = k >= start + fit.half() && k + fit.half() < row;
                    }
                    start = row;
                }
            }
        }
        for (i, joint) in joints {
            let series = (0..rows).map(|row| {
                let q = joint.positions.get(row).copied().unwrap_or(0.0);
                match (&joint.rates, &fit) {
                    (Some(rates), _) => (q, rates.get(row).copied().unwrap_or(0.0)),
                    (None, Some(fit)) if valid[row] => {
                        fit.at(&joint.positions[row - fit.half()..=row + fit.half()])
                    }
                    _ => (q, 0.0),
                }
            });
            all.insert(*i, series.collect());
        }
        Coordinates { series: all, is_valid: valid }
    }

    /// Returns what to do about columns of a revolute joint that is part of a spherical one.
    pub(super) fn about_spherical(&self) -> String {
        let has = |name: &str, unit: &str| self.cells.contains_key(format!("{name}_{unit}").as_str());
        let parts = self.model.links.iter().filter(|l| l.link.joint == Joint::Spherical);
        let part = parts.map(|l| l.joint_name.as_str()).find(|name| has(name, "nm") || has(name, "rad"));
        part.map_or_else(String::new, |name| {
            format!(
                ". {name} is a spherical joint here, whose motion is given by attitudes and gyros, and of \
                 which {name}_rad and {name}_nm are one axis alone: it is identified from these where the \
                 angles of all three revolute joints are recorded"
            )
        })
    }

    /// Returns what to do about efforts that are missing.
    fn about_efforts(&self, without: &[&str]) -> String {
        let mut advice =
            "joint rows need all of them; `lock` joints that were held, or remove the others' columns"
                .to_owned();
        advice += &self.about_spherical();
        let of_these = |column: &&&str| {
            without.iter().any(|joint| column.strip_prefix(*joint).is_some_and(|r| r.starts_with('_')))
        };
        let own = |column: &str| ["_rad", "_radps", "_m", "_mps"].iter().any(|unit| column.ends_with(unit));
        let others: Vec<&str> = self.cells.keys().filter(of_these).copied().filter(|c| !own(c)).collect();
        if !others.is_empty() {
            advice += &format!(
                ". There are columns {}: if they are efforts, name them with their scale in the rig file, \
                 [[joint]] effort",
                others.join(", ")
            );
        }
        advice
    }
}

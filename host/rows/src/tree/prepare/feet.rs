//! Feet: their columns, where they are, what of the ground's wrench is known, and what looks wrong.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use rigident_shared::tree::TreeError;

use super::{JointColumns, Preparation};
use crate::tree::columns::{Column, numbers};
use crate::tree::contact::{COMPONENTS, Contact, Foot, Ground};
use crate::tree::joints::attitude;
use crate::tree::{Input, TreePrepareError};
use rigident_io::rig::FootTable;
use rigident_model::edit::Place;
use rigident_model::idle::white_noise;

/// A foot stands where its force is above this share of the robot's weight.
const TOUCHING: f64 = 0.02;
/// A foot stands where its force is above this if the robot's weight is not known, N.
const TOUCHING_N: f64 = 20.0;
/// Noise that readings do not show is this share of the largest: rounding.
const ROUNDED: f64 = 1e-5;
/// A zero of which nothing is stated is off above this share of the foot's largest force.
const ZERO: f64 = 0.02;

/// The feet of a recording.
pub(super) struct Feet {
    pub(super) contact: Contact,
    /// By row.
    pub(super) ground: Vec<Ground>,
    /// True if the noise of all that is measured is stated.
    pub(super) is_stated: bool,
}

/// The readings of a foot's columns.
struct Readings {
    foot: Foot,
    wrenches: Vec<[f64; 6]>,
    touching: Vec<bool>,
    /// The average of its readings in the air.
    air: Option<[f64; 6]>,
    is_stated: bool,
}

impl Preparation<'_> {
    /// Returns the feet of the rig file; `None` where there are none.
    pub(super) fn feet(
        &mut self,
        joints: &BTreeMap<usize, JointColumns>,
    ) -> Result<Option<Feet>, TreePrepareError> {
        let tables = &self.recording.rig.foot;
        if tables.is_empty() {
            return Ok(None);
        }
        self.judge_feet()?;
        let mut all = Vec::new();
        for table in tables {
            all.push(self.foot(table)?);
        }
        for readings in &all {
            self.note_zero(readings);
        }
        let (mut efforts, mut unmeasured, mut is_stated) = (Vec::new(), Vec::new(), true);
        for (k, (i, link)) in self.model.links.iter().enumerate().skip(1).enumerate() {
            let column = joints.get(&i);
            if link.link.joint.freedoms() != 1 {
                return Err(TreePrepareError::Unsupported(format!(
                    "{}: joint {} has several freedoms; feet are for joints of one freedom each",
                    self.recording.name, link.joint_name
                )));
            }
            let effort = column.and_then(|joint| joint.effort.as_ref());
            let stated = column.and_then(|joint| joint.effort_noise);
            match effort {
                None => {
                    unmeasured.push(k);
                    efforts.push(1.0);
                }
                Some(values) => {
                    is_stated &= stated.is_some();
                    efforts.push(stated.unwrap_or_else(|| shown(values)));
                }
            }
        }
        is_stated &= all.iter().all(|readings| readings.is_stated);
        let base = |first: usize| {
            let own = all.iter().flat_map(|r| r.foot.sigma[first..first + 3].iter().filter(|s| **s > 0.0));
            let (sum, count) = own.fold((0.0, 0), |(sum, count), s| (sum + s * s, count + 1));
            if count == 0 { None } else { Some((sum / f64::from(count)).sqrt()) }
        };
        let (force, moment) = (base(0).unwrap_or(1.0), base(3).or(base(0).map(|s| 0.1 * s)).unwrap_or(0.1));
        let sigma = [[force; 3], [moment; 3]].concat().into_iter().chain(efforts).collect();
        let ground = (0..self.recording.rows()).map(|row| Ground {
            wrenches: all.iter().map(|r| r.wrenches.get(row).copied().unwrap_or_default()).collect(),
            touching: all.iter().map(|r| r.touching.get(row).copied().unwrap_or_default()).collect(),
            state: 0,
        });
        let ground = ground.collect();
        let feet = all.into_iter().map(|readings| readings.foot).collect();
        Ok(Some(Feet { contact: Contact { feet, unmeasured, sigma, states: Vec::new() }, ground, is_stated }))
    }

    /// Gives the frames their states of contact, and says how long each lasts.
    pub(super) fn stand(&mut self, input: &mut Input, feet: Feet) -> Result<(), TreePrepareError> {
        input.known_offset = Some([0.0; 6]);
        input.channel_sigma = feet.is_stated.then(|| feet.contact.sigma.clone());
        input.contact = Some(feet.contact);
        let refuse = |error: TreeError| self.misfit(format!("feet and links do not fit: {error:?}"));
        let left_out = input.choose_rows().map_err(refuse)?;
        let Some(contact) = &input.contact else { return Ok(()) };
        let mut times: Vec<(String, usize)> = Vec::new();
        for frame in &input.frames {
            let Some(state) = contact.states.get(frame.ground.state) else { continue };
            let name = contact.name(state);
            match times.iter_mut().find(|(other, _)| *other == name) {
                Some((_, count)) => *count += 1,
                None => times.push((name, 1)),
            }
            if state.pivots.len() >= contact.sigma.len() {
                return Err(self.missing(
                    "what the feet and the joints measure is",
                    "more is unknown than there are equations of motion: no row is left",
                ));
            }
        }
        let said = times.iter().map(|(name, count)| format!("{name} {:.2} s", *count as f64 / input.rate_hz));
        self.notes.push(format!(
            "on the ground: {}; {left_out} frames at changes of contact were left out",
            said.collect::<Vec<_>>().join(", ")
        ));
        let unmeasured: Vec<String> = {
            let names = input.freedom_names();
            contact.unmeasured.iter().filter_map(|k| names.get(*k).cloned()).collect()
        };
        if !unmeasured.is_empty() {
            self.notes.push(format!(
                "torques are not measured of {}: their rows are left out",
                unmeasured.join(", ")
            ));
        }
        Ok(())
    }

    /// Complains of what feet do not go with.
    fn judge_feet(&self) -> Result<(), TreePrepareError> {
        let recording = self.recording;
        if recording.wrench.is_some() || recording.gauges.is_some() {
            return Err(self.misfit(
                "the rig file has [[foot]] tables, and there is a wrench fx_n … on the base link as well: a \
                 robot on its feet is held by nothing else; remove one of them"
                    .to_owned(),
            ));
        }
        if recording.is_static || recording.imus.first().is_none_or(|imu| imu.accel.is_none()) {
            return Err(self.missing(
                "the base's IMU (imu_ax_mps2 …, imu_gx_radps …) is",
                "a robot on its feet moves, and how its base moves is not known otherwise; for a robot that \
                 is held remove the [[foot]] tables",
            ));
        }
        Ok(())
    }

    fn foot(&self, table: &FootTable) -> Result<Readings, TreePrepareError> {
        let place = self.foot_place(table)?;
        let mut columns: [Option<Vec<f64>>; 6] = Default::default();
        for (k, component) in COMPONENTS.into_iter().enumerate() {
            columns[k] = self.component(table, component, k)?;
        }
        let measured: [bool; 6] = std::array::from_fn(|k| {
            columns[k].is_some() && !table.unavailable.iter().any(|name| name == COMPONENTS[k])
        });
        let reading = |row: usize| -> [f64; 6] {
            std::array::from_fn(|k| columns[k].as_ref().and_then(|c| c.get(row)).copied().unwrap_or(0.0))
        };
        let rows = self.recording.rows();
        let readings: Vec<[f64; 6]> = (0..rows).map(reading).collect();
        let touching = self.touching(table, columns[..3].iter().any(Option::is_some), &readings)?;
        let stands = |row: &usize| touching.get(*row).copied().unwrap_or(false);
        let sigma = std::array::from_fn(|k| match table.noise_n_nm {
            Some(noise) if measured[k] => noise[k],
            None if measured[k] => shown(
                &(0..rows).filter(stands).filter_map(|row| Some(readings.get(row)?[k])).collect::<Vec<_>>(),
            ),
            _ => 0.0,
        });
        let mut air = [0.0; 6];
        let count = (0..rows).filter(|row| !stands(row)).count();
        for reading in (0..rows).filter(|row| !stands(row)).filter_map(|row| readings.get(row)) {
            air.iter_mut().zip(reading).for_each(|(sum, value)| *sum += value / count as f64);
        }
        let foot = Foot {
            name: table.name.clone(),
            link: place.link,
            position: place.position,
            rotation: place.rotation,
            known: std::array::from_fn(|k| measured[k] || (table.point && k >= 3)),
            measured,
            sigma,
        };
        let counts = |row: usize| stands(&row) || foot.is_measured();
        let wrenches = readings.iter().enumerate().map(|(row, reading)| {
            std::array::from_fn(|k| if counts(row) && measured[k] { reading[k] } else { 0.0 })
        });
        let wrenches = wrenches.collect();
        Ok(Readings {
            foot,
            wrenches,
            touching,
            air: (count > 0).then_some(air),
            is_stated: table.noise_n_nm.is_some(),
        })
    }

    /// Returns the sensor's place in the link that moves and carries it.
    fn foot_place(&self, table: &FootTable) -> Result<Place, TreePrepareError> {
        let known = |name: &&String| !COMPONENTS.contains(&name.as_str());
        if let Some(name) = table.unavailable.iter().chain(table.columns.keys()).find(known) {
            return Err(self.misfit(format!(
                "the rig file's [[foot]] {} names a component {name:?}: there are {}",
                table.name,
                COMPONENTS.join(", ")
            )));
        }
        let Some(link) = self.original.link(&table.link) else {
            let names: Vec<&str> = self.original.links.iter().map(|l| l.name.as_str()).collect();
            return Err(self.misfit(format!(
                "the rig file's [[foot]] {} is on link {:?}, which is not in it; its links are {}",
                table.name,
                table.link,
                names.join(", ")
            )));
        };
        let rotation = attitude(&table.rotation_wxyz).ok_or_else(|| {
            self.misfit(format!(
                "rotation_wxyz of [[foot]] {} is no unit quaternion w, x, y, z: {:?}",
                table.name, table.rotation_wxyz
            ))
        })?;
        let position = Vector3::from(table.position_m);
        let mut place = self.original.moving_place(&Place { link, rotation, position });
        let body = self.original.links.get(place.link).and_then(|body| self.model.link(&body.name));
        place.link = body.unwrap_or(0);
        Ok(place)
    }

    fn component(
        &self,
        table: &FootTable,
        component: &str,
        k: usize,
    ) -> Result<Option<Vec<f64>>, TreePrepareError> {
        let unit = if k < 3 { "n" } else { "nm" };
        let column = match table.columns.get(component) {
            None => Column::plain(format!("{}_{component}_{unit}", table.name)),
            Some(source) => Column::named(source),
        };
        let values = numbers(self.recording, &column)?;
        if values.is_none() && column.is_named {
            return Err(self.missing(
                format!("column {:?}, which the rig file names for foot {}, is", column.name, table.name),
                "correct the name in [[foot]] columns",
            ));
        }
        Ok(values)
    }

    /// Returns by rows whether a foot stands.
    fn touching(
        &self,
        table: &FootTable,
        has_force: bool,
        readings: &[[f64; 6]],
    ) -> Result<Vec<bool>, TreePrepareError> {
        if let Some(flags) = numbers(self.recording, &Column::plain(format!("{}_contact", table.name)))? {
            return Ok(flags.into_iter().map(|flag| flag > 0.5).collect());
        }
        if !has_force {
            return Err(self.missing(
                format!(
                    "a force of foot {0} ({0}_fz_n), or where it stands ({0}_contact, 0 or 1), is",
                    table.name
                ),
                "name its columns in [[foot]] columns, or remove the table",
            ));
        }
        let weight: Option<f64> = self.model.links.iter().map(|l| l.nominal.map(|phi| phi[0])).sum();
        let gravity = self.recording.rig.recording.gravity_mps2;
        let limit = table.touching_n.unwrap_or_else(|| weight.map_or(TOUCHING_N, |m| TOUCHING * m * gravity));
        let force = |reading: &[f64; 6]| Vector3::from_iterator(reading.iter().take(3).copied()).norm();
        Ok(readings.iter().map(|reading| force(reading) > limit).collect())
    }

    /// Says what a sensor reads where its foot is in the air, if that is more than its zero is known to.
    fn note_zero(&mut self, readings: &Readings) {
        let Some(air) = readings.air else { return };
        let table = self.recording.rig.foot.iter().find(|table| table.name == readings.foot.name);
        let limits = table.and_then(|table| table.zero_std_n_nm);
        let largest = readings.wrenches.iter().map(|w| w[2].abs()).fold(0.0, f64::max);
        let is_off = |k: &usize| {
            let limit = limits.map_or(ZERO * largest, |own| 3.0 * own[k / 3]);
            readings.foot.measured[*k] && air[*k].abs() > limit
        };
        let said: Vec<String> = (0..6)
            .filter(is_off)
            .map(|k| format!("{} {:+.3} {}", COMPONENTS[k], air[k], if k < 3 { "N" } else { "N m" }))
            .collect();
        if !said.is_empty() {
            self.warnings.push(format!(
                "the sensor of foot {} reads {} where the foot is in the air: zero it before the recording, \
                 or take it off in the rig file, [[foot]] columns = {{ {} = {{ name = …, offset = … }} }}",
                readings.foot.name,
                said.join(", "),
                said.first().and_then(|s| s.split(' ').next()).unwrap_or("fz"),
            ));
        }
    }
}

/// Returns the noise that readings show, at least that of their rounding.
fn shown(values: &[f64]) -> f64 {
    let largest = values.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    white_noise(values).max(ROUNDED * largest).max(f64::MIN_POSITIVE)
}

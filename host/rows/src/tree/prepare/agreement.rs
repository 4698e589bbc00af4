//! The comparison of several columns for one motion; what is assumed of IMUs that nothing is said of.

use nalgebra::{Quaternion, UnitQuaternion};
use rigident_shared::tree::{BaseMotion, Joint};

use super::Preparation;
use super::frames::LinkColumns;
use crate::body::input_checks;
use crate::tree::TreePrepareError;
use crate::tree::columns::{Quantity, column};
use crate::tree::input_checks::{Disagreement, SPAN_S, Spans, Turning, joint_disagreement};
use rigident_fit::figures::shortened;

impl Preparation<'_> {
    /// Refuses `[[imu]]` tables of links that there are not, and says what is assumed where there is none.
    pub(super) fn judge_imu_tables(&mut self, numbering: &[Option<usize>]) -> Result<(), TreePrepareError> {
        let name = |j: usize| match self.recording.rig.link.get(j) {
            Some(table) => Some(table.name.as_str()),
            None => Some(self.model.links[numbering.get(j).copied().flatten()?].name.as_str()),
        };
        if let Some(table) = self.recording.rig.imu.iter().find(|table| table.link >= numbering.len()) {
            let names: Vec<&str> = (0..numbering.len()).filter_map(name).collect();
            return Err(self.misfit(format!(
                "the rig file's [[imu]] link = {} is beyond its links, which are 0 to {} ({})",
                table.link,
                names.len().saturating_sub(1),
                names.join(", ")
            )));
        }
        let without = |j: &usize| {
            let imu = &self.recording.imus[*j];
            // Of links beyond the base gyros are used only.
            (imu.gyro.is_some() || (*j == 0 && imu.accel.is_some())) && self.imu(*j).is_none()
        };
        let said: Vec<String> = (0..self.recording.imus.len())
            .filter(without)
            .filter_map(|j| Some(format!("{} (link = {j})", name(j)?)))
            .collect();
        if !said.is_empty() {
            self.notes.push(format!(
                "no [[imu]] table says where the IMU of {} sits: assumed at the origin of its link, \
                 position_m = [0, 0, 0], its axes those of the link",
                shortened(&said, 4)
            ));
        }
        Ok(())
    }

    /// Refuses a base's specific force that at rest is nowhere near gravity.
    pub(super) fn judge_gravity(
        &self,
        motion: &dyn Fn(usize) -> BaseMotion<f64>,
        rate_hz: f64,
    ) -> Result<(), TreePrepareError> {
        let recording = self.recording;
        let accelerometer = recording.imus.first().is_some_and(|imu| imu.accel.is_some());
        if !accelerometer && recording.gravity.is_none() {
            return Ok(());
        }
        let readings = (0..recording.rows()).map(|row| {
            let motion = motion(row);
            (motion.specific_force.into(), motion.rate.into())
        });
        let gravity = recording.rig.recording.gravity_mps2;
        input_checks::check_gravity(readings, recording.is_static, rate_hz, gravity, !accelerometer, 0.0)
            .map_err(|error| TreePrepareError::Implausible { name: recording.name.clone(), error })
    }

    /// Compares attitudes with gyros, and joints' positions with their rates.
    pub(super) fn judge_agreement(
        &mut self,
        columns: &LinkColumns<'_>,
        rate_hz: f64,
    ) -> Result<(), TreePrepareError> {
        if self.recording.is_static {
            return Ok(());
        }
        let spans = Spans::new(&self.recording.time_ns, rate_hz);
        for (i, joint) in &columns.joints {
            let Some(rates) = &joint.rates else { continue };
            let link = &self.model.links[*i];
            let slides = matches!(link.link.joint, Joint::Prismatic(_));
            let [position, rate] = [Quantity::Position, Quantity::Rate].map(|quantity| {
                column(&self.recording.rig, &link.joint_name, &link.link.joint, quantity)
                    .map_or_else(String::new, |column| column.name)
            });
            let found = joint_disagreement(&spans, &joint.positions, rates, slides, [&position, &rate]);
            let unit = if slides { (1e3, " mm") } else { (1f64.to_degrees(), "°") };
            let what = format!("columns {position} and {rate} of joint {}", link.joint_name);
            self.tell(
                found,
                &what,
                unit,
                "is the rate that of this joint, in the same unit, by the same clock?",
            )?;
        }
        for (i, rows) in &columns.attitudes {
            let (Some(rate), Some(number)) = (columns.gyros.get(i), columns.number(*i)) else { continue };
            if columns.joints.contains_key(i) || *i == 0 {
                continue;
            }
            let [w, x, y, z] = self.imu(number).map_or([1.0, 0.0, 0.0, 0.0], |imu| imu.rotation_wxyz);
            let turning = Turning {
                number,
                name: &self.model.links[*i].name,
                attitudes: rows,
                rate,
                base: columns.gyros.get(&0).map(Vec::as_slice),
                mounting: UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)),
            };
            let what = format!(
                "the attitude q{number}_… of link {} and the gyros imu{number}_gx_radps … less the base's",
                turning.name
            );
            let ask = format!(
                "is it the attitude relative to S, w first, not its inverse; are both gyros in rad/s, with \
                 the axes that rotation_wxyz of [[imu]] link = 0 and {number} says; and are the clocks \
                 one?"
            );
            self.tell(turning.disagreement(&spans), &what, (1f64.to_degrees(), "°"), &ask)?;
        }
        Ok(())
    }

    fn tell(
        &mut self,
        found: Option<Disagreement>,
        what: &str,
        (scale, unit): (f64, &str),
        ask: &str,
    ) -> Result<(), TreePrepareError> {
        let Some(found) = found else { return Ok(()) };
        let said = format!(
            "{what} do not tell of one motion: over {SPAN_S} s it moves by {:.3}{unit} and by {:.3}{unit} \
             (rms), and they differ by {:.0} % of that: {}",
            scale * found.moved,
            scale * found.integrated,
            100.0 * found.share,
            found.cause.as_deref().unwrap_or(ask)
        );
        if found.is_gross() {
            return Err(self.misfit(said));
        }
        self.notes.push(said);
        Ok(())
    }
}

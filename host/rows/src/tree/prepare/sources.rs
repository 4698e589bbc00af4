//! Checks whether every joint's motion is there and fits, and finds the noise of the measured quantities.

use std::collections::BTreeMap;

use rigident_shared::tree::Joint;

use super::frames::LinkColumns;
use super::{JointColumns, Preparation};
use crate::tree::polynomial::Polynomial;
use crate::tree::{NoisySignal, SignalKind, TreePrepareError};
use crate::white_noise::sixth_differences;
use rigident_model::base::Rows;
use rigident_model::idle::white_noise;

/// Attitudes this much off what a joint can do are another joint's, rad: far beyond what IMUs and straps do.
const ANOTHER_JOINT: f64 = 0.15;
/// Worth a word, rad.
const NOTICEABLE: f64 = 0.02;

impl Preparation<'_> {
    /// Returns what of joint `i` is missing, and what to do.
    pub(super) fn missing_of(&self, i: usize) -> (String, String) {
        let link = &self.model.links[i];
        let name = &link.joint_name;
        let number = self.numbering().ok().and_then(|n| n.iter().position(|k| *k == Some(i))).unwrap_or(i);
        let columns = match link.link.joint {
            Joint::Revolute(_) => {
                format!("q{number}_w … q{number}_z with imu{number}_gx_radps …, or {name}_rad")
            }
            Joint::Prismatic(_) => format!("{name}_m"),
            Joint::Free => {
                return (
                    format!("the place of link {}, which moves freely against its parent, is", link.name),
                    "a recording has no columns for it: identify it as a body of its own".to_owned(),
                );
            }
            _ => format!("q{number}_w … q{number}_z with imu{number}_gx_radps …"),
        };
        // Between two joints of one body there is nothing that an IMU could sit on.
        if !link.is_body() {
            return (
                format!("the motion of joint {name}, one of several of a body, is"),
                format!(
                    "add {name}_{}, or declare three hinges through one point to be one ball by `spherical` \
                     and give its link's attitude and rate",
                    if matches!(link.link.joint, Joint::Prismatic(_)) { "m" } else { "rad" }
                ),
            );
        }
        (
            format!("the motion of joint {name} (link {}) is", link.name),
            format!(
                "add {columns}, or say `lock` {name} if it did not move, `lock` {name}=VALUE if it did not \
                 stand at zero"
            ),
        )
    }

    /// Refuses a tree one of whose joints has no columns of its motion.
    pub(super) fn check_sources(&self, columns: &LinkColumns<'_>) -> Result<(), TreePrepareError> {
        for i in 1..self.model.links.len() {
            let slides = matches!(self.model.links[i].link.joint, Joint::Prismatic(_) | Joint::Free);
            if columns.joints.contains_key(&i) {
                continue;
            }
            if slides || !columns.attitudes.contains_key(&i) {
                let (missing, advice) = self.missing_of(i);
                return Err(self.missing(missing, advice));
            }
            if !columns.gyros.contains_key(&i) && !self.recording.is_static {
                let j = columns.number(i).unwrap_or(i);
                return Err(self.missing(
                    format!("the angular rate imu{j}_gx_radps … of link {} is", self.model.links[i].name),
                    "rates are not differentiated from attitudes: give the link a gyro, or static = true for \
                     still poses",
                ));
            }
        }
        Ok(())
    }

    pub(super) fn judge_misfits(
        &mut self,
        squares: &[f64],
        frames: usize,
        columns: &LinkColumns<'_>,
    ) -> Result<(), TreePrepareError> {
        for (i, sum) in squares.iter().enumerate() {
            let rms = (sum / frames as f64).sqrt();
            let link = &self.model.links[i];
            let said = format!(
                "the attitude q{}_… of link {} is turned by {:.2}° (rms) against what its joint {} can do",
                columns.number(i).unwrap_or(i),
                link.name,
                rms.to_degrees(),
                link.joint_name
            );
            if rms > ANOTHER_JOINT {
                return Err(self.misfit(format!(
                    "{said}: is it the attitude relative to S, w first, and are joint kind, axis and \
                     rotation those of the model?"
                )));
            }
            if rms > NOTICEABLE {
                self.notes.push(format!("{said}; the rest is left out"));
            }
        }
        Ok(())
    }

    pub(super) fn channel_sigma(
        &mut self,
        rows: Rows,
        joints: &BTreeMap<usize, JointColumns>,
    ) -> Option<Vec<f64>> {
        let mut sigma: Vec<Option<f64>> = Vec::new();
        if rows != Rows::Joint {
            let wrench = self.recording.rig.load_cell.noise_n_nm;
            sigma.extend((0..6).map(|k| wrench.map(|w| w[k])));
        }
        if rows != Rows::Base {
            sigma.extend(joints.values().map(|joint| joint.effort_noise));
        }
        let all: Option<Vec<f64>> = sigma.iter().copied().collect();
        if all.is_none() && sigma.iter().any(Option::is_some) {
            self.notes.push(
                "the noise of some channels is stated and that of others is not: all are weighted by their \
                 residuals; state noise_n_nm of [load_cell] and effort_noise of every [[joint]], as far as \
                 they are measured"
                    .to_owned(),
            );
        }
        all
    }

    /// Says what of recording and rig file a tree has no use for.
    pub(super) fn note_unused(&mut self) {
        let (recording, rig) = (self.recording, &self.recording.rig);
        let accelerometers: Vec<String> = recording
            .imus
            .iter()
            .enumerate()
            .skip(1)
            .filter(|(_, imu)| imu.accel.is_some())
            .map(|(j, _)| format!("imu{j}"))
            .collect();
        let some = |there: bool, words: &str| there.then(|| words.to_owned());
        let base_has_one = recording.imus.first().is_some_and(|imu| imu.accel.is_some());
        let unused = [
            some(
                !accelerometers.is_empty(),
                &format!(
                    "accelerometers of links beyond the base were not used ({}): only the base's specific \
                     force is among the rows",
                    accelerometers.join(", ")
                ),
            ),
            some(
                base_has_one && recording.gravity.is_some(),
                "the gravity columns were not used: the base has an accelerometer",
            ),
            some(
                rig.body.is_some(),
                "[body] of the rig file was not used: the answer of a tree is in the frames of its links",
            ),
            some(rig.truth.is_some(), "[truth] of the rig file was not shown: it is of a single body"),
            some(
                rig.load_cell.gain_uncertainty.is_some()
                    && recording.wrench.is_none()
                    && recording.gauges.is_none(),
                "gain_uncertainty of the rig file was not used: there is no wrench",
            ),
        ];
        self.notes.extend(unused.into_iter().flatten());
    }

    /// Returns the signals that the frames are made of, with their noise.
    pub(super) fn signals(&self, columns: &LinkColumns<'_>) -> Vec<NoisySignal> {
        let is_static = self.recording.is_static;
        let mut signals = Vec::new();
        let mut add = |kind, link, stated, found| {
            // Differences of still poses show no noise.
            signals.push(NoisySignal { kind, link, stated, found: if is_static { 0.0 } else { found } });
        };
        if let Some(accel) = self.recording.imus.first().and_then(|imu| imu.accel.as_ref()) {
            let stated = self.imu(0).and_then(|imu| imu.accel_noise_mps2);
            add(SignalKind::Accelerometer, 0, stated, self.noise_of(3, |row| accel.get(row).copied()));
        }
        let is_seen = |i: usize| i == 0 || !columns.joints.contains_key(&i);
        for (i, rates) in columns.gyros.iter().filter(|(i, _)| is_seen(**i) && !is_static) {
            let stated = columns.number(*i).and_then(|j| self.imu(j)).and_then(|imu| imu.gyro_noise_radps);
            add(
                SignalKind::Gyro,
                *i,
                stated,
                self.noise_of(3, |row| rates.get(row).map(|rate| (*rate).into())),
            );
        }
        for (i, quaternions) in columns.attitudes.iter().filter(|(i, _)| **i > 0 && is_seen(**i)) {
            let stated = columns.number(*i).and_then(|j| self.imu(j)).and_then(|imu| imu.attitude_noise_rad);
            let continuous = continuous(quaternions);
            // A quaternion moves by half the angle.
            let found = 2.0 * self.noise_of(3, |row| continuous.get(row).copied());
            add(SignalKind::Attitude, *i, stated, found);
        }
        for (i, joint) in &columns.joints {
            let one = |values: &[f64]| self.noise_of(1, |row| values.get(row).map(|v| [*v]));
            let has_slope = joint.rates.is_none() && !is_static;
            let kind = if has_slope { SignalKind::PositionWithSlope } else { SignalKind::Position };
            add(kind, *i, joint.position_noise, one(&joint.positions));
            if let Some(rates) = joint.rates.as_ref().filter(|_| !is_static) {
                add(SignalKind::Rate, *i, joint.rate_noise, one(rates));
            }
        }
        signals
    }

    /// Returns σ of a signal of the given number of freedoms from sixth differences.
    fn noise_of<const N: usize>(&self, freedoms: u8, of: impl Fn(usize) -> Option<[f64; N]>) -> f64 {
        let times = self.recording.time_ns.iter().enumerate();
        let signals: Vec<(u64, [f64; N])> = times.filter_map(|(row, t)| Some((*t, of(row)?))).collect();
        sixth_differences(&signals, freedoms)
    }

    /// Returns the largest noise of a rate, rad/s or m/s: the given one, or by differences, which motion
    /// hardly enters.
    pub(super) fn rate_sigma(&self, columns: &LinkColumns<'_>, rate_hz: f64) -> f64 {
        if self.recording.is_static {
            return 0.0;
        }
        let slope = Polynomial::new(rate_hz).slope_noise();
        let of_joints = columns.joints.values().map(|j| match &j.rates {
            Some(rates) => white_noise(rates),
            None => slope * white_noise(&j.positions),
        });
        let of_links = columns.gyros.values().map(|rates| {
            let axis = |k: usize| white_noise(&rates.iter().map(|r| r[k]).collect::<Vec<f64>>());
            axis(0).max(axis(1)).max(axis(2))
        });
        let given = self.recording.rig.imu.iter().filter_map(|imu| imu.gyro_noise_radps).fold(0.0, f64::max);
        let links = if given > 0.0 { given } else { of_links.fold(0.0, f64::max) };
        of_joints.fold(links, f64::max)
    }
}

/// Returns the same attitudes, each with the sign of the one before: q and −q are one.
fn continuous(quaternions: &[[f64; 4]]) -> Vec<[f64; 4]> {
    let mut before = [1.0, 0.0, 0.0, 0.0];
    let next = |q: &[f64; 4]| {
        let along: f64 = q.iter().zip(before).map(|(a, b)| a * b).sum();
        before = if along < 0.0 { q.map(|v| -v) } else { *q };
        before
    };
    quaternions.iter().map(next).collect()
}

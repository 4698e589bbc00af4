//! The texts about an answer: why offsets are not identified, what is to be acted on, the tables of a rig
//! file.

use std::fmt::{self, Write as _};

use super::Setup;
use super::faults::{Contradiction, Fault};
use super::result::{Answer, Coarsest, Offset};
use rigident_fit::figures::{NOT_IDENTIFIED, significant};
use rigident_fit::{COVERAGE_95, Measured};

/// The excess of the residuals over the stated noise from which on it is reported, a ratio of variances.
const NOISIER: f64 = 1.5;

impl fmt::Display for Contradiction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Faults(found) => {
                f.write_str("these poses contradict the model, unless ")?;
                for (k, fault) in found.iter().enumerate() {
                    match (k, fault) {
                        // A joint that counts the other way is as well one whose axis is.
                        (0, Fault::Sign(_)) => write!(f, "{fault} (or turn the axis in the model)")?,
                        (0, _) => write!(f, "{fault}")?,
                        _ => write!(f, "\n  or {fault}")?,
                    }
                }
                Ok(())
            }
            Self::TooLarge(joint, offset) => write!(
                f,
                "the offset of {joint} would be {}°, and no zero is set so badly: does the joint count the \
                 other way, from another zero, or \
                 is the IMU turned on its link?",
                significant(offset.to_degrees(), 2)
            ),
            Self::NotNoise { ratio, attitude_rms, height_rms } => write!(
                f,
                "what is left is {} times what the stated noise explains (attitudes {}°, contacts {} mm), \
                 and no single fault explains it: are \
                 the soles flat on one plane in these poses, are their corners and the lengths of links \
                 right? If the noise is so large, \
                 state it by `attitude_noise_deg` and `height_noise_mm`",
                significant(ratio.sqrt(), 2),
                significant(attitude_rms.to_degrees(), 2),
                significant(1e3 * height_rms, 2)
            ),
        }
    }
}

/// Returns a limit or an uncertainty with its unit, mm of a joint that slides, degrees of one that turns.
pub fn sized(value: f64, slides: bool) -> String {
    if slides {
        format!("{} mm", significant(1e3 * value, 2))
    } else {
        format!("{}°", significant(value.to_degrees(), 2))
    }
}

impl Offset {
    /// Returns why the offset is not identified; nothing if it is.
    pub fn why_not(&self, coarsest: Coarsest) -> String {
        let Some(open) = &self.open else { return String::new() };
        let mut parts = Vec::new();
        if self.stands_still() {
            parts.push(format!(
                "the joint stands still in these poses (it moves by {}): move it",
                sized(self.moves_by, self.slides)
            ));
        }
        parts.push(match open.u95 {
            None => "the poses say nothing of it by itself".to_owned(),
            Some(u95) => format!(
                "its U95 would be {}, above {}",
                sized(u95, self.slides),
                sized(coarsest.of(self.slides), self.slides)
            ),
        });
        if !open.beside.is_empty() {
            parts.push(format!("it acts as {} in these poses", open.beside.join(" and ")));
        }
        parts.join("; ")
    }
}

impl Answer {
    /// Returns what is to be acted on.
    pub fn warnings(&self, setup: &Setup) -> Vec<String> {
        let mut warnings = Vec::new();
        for bad in &self.bad {
            let ((link, turn), (contact, height)) = (&bad.attitude_off, &bad.height_off);
            warnings.push(format!(
                "{} is left out: the others contradict it ({} times what the noise explains; attitude of \
                 {link} off by {}°, a corner of \
                 {contact} by {} mm)",
                bad.name,
                significant(bad.ratio, 2),
                significant(turn.to_degrees(), 2),
                significant(1e3 * height, 2)
            ));
        }
        let named = |of: &dyn Fn(&&Offset) -> bool| {
            self.offsets.iter().filter(of).map(|o| o.joint.as_str()).collect::<Vec<_>>().join(", ")
        };
        let open = named(&|o| o.measured.is_none());
        if !open.is_empty() {
            warnings.push(format!(
                "not determined by these poses: {open}; take poses with one knee bent more than the other, \
                 feet turned and apart, pelvis tilted"
            ));
        }
        let still = named(&|o| o.measured.is_some() && o.stands_still());
        if !still.is_empty() {
            warnings.push(format!(
                "{still}: stands still in all poses; its offset is determined by the motion of the others \
                 alone, and by the lengths of links"
            ));
        }
        if self.variance_ratio > NOISIER {
            warnings.push(format!(
                "what is left is {} times the variance that the stated noise explains; the intervals are \
                 widened by its root: is the \
                 floor level, are the corners where the file has them, is the noise as stated?",
                significant(self.variance_ratio, 2)
            ));
        }
        if setup.noise.mounting_rad == 0.0 {
            warnings.push(
                "the IMU is taken as mounted exactly: an error of its roll or pitch goes into the hips; say \
                 by `mounting_noise_deg` how far it may be off"
                    .to_owned(),
            );
        }
        if !self.converged {
            warnings.push("the search did not settle: do not use these numbers".to_owned());
        }
        warnings
    }

    /// Returns the offsets as `[[joint]]` tables of a rig file.
    pub fn rig_tables(&self) -> String {
        let mut out = "# Offsets of joints found by `calibrate_joints()`: [[joint]] tables of a rig file.\n\
                       # The true position is the measured one plus the offset; zero_std is 1 sigma of it. \
                       SI.\n"
            .to_owned();
        for offset in &self.offsets {
            let joint = &offset.joint;
            let Some(Measured { value, u95 }) = offset.measured else {
                let _ = writeln!(out, "\n# {joint}: {NOT_IDENTIFIED}");
                continue;
            };
            let name = toml::Value::String(joint.clone());
            let unit = if offset.slides { "m" } else { "rad" };
            let column = toml::Value::String(format!("{joint}_{unit}"));
            let _ = writeln!(
                out,
                "\n[[joint]]\nname = {name}\nposition = {{ name = {column}, offset = {value:?} }}\nzero_std \
                 = {:?}",
                u95 / COVERAGE_95
            );
        }
        out
    }
}

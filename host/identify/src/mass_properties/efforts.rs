//! Torques against the nominal model: a channel that is dead, of the wrong sign, or in another unit.

use crate::answer::predictor::Predictor;
use rigident_fit::{FitError, Prediction, RowSource as _};
use rigident_model::Model;
use rigident_rows::tree::{Ground, TreeSource};

/// A torque of this share of what the model predicts is none.
const DEAD: f64 = 0.02;
/// Predicted and measured torque are alike above this correlation.
const ALIKE: f64 = 0.8;
/// No nominal model is off by this much: the unit is another.
const OTHER_UNIT: f64 = 4.0;
/// Units that torques are recorded in instead of N m, and what they are of it.
const UNITS: [(&str, f64); 5] =
    [("N mm", 1e-3), ("N cm", 1e-2), ("lbf in", 0.112_985), ("lbf ft", 1.355_818), ("kgf m", 9.806_65)];

/// The fault of a channel.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// It hardly changes where the model predicts that it does.
    Dead,
    /// It has the other sign.
    Sign,
    /// It is this many times what the model predicts.
    Unit(f64),
}

/// A channel that contradicts the nominal model.
#[derive(Clone, Debug, PartialEq)]
pub struct Suspect {
    /// The joint.
    pub joint: String,
    /// The fault.
    pub fault: Fault,
}

impl Suspect {
    /// Returns what to do, in a sentence.
    pub fn text(&self) -> String {
        let joint = &self.joint;
        match &self.fault {
            Fault::Dead => format!(
                "the torque of joint {joint} hardly changes, and the model predicts that it does: its \
                 channel seems dead; repair it, or leave its column out"
            ),
            Fault::Sign => format!(
                "the torque of joint {joint} has the opposite sign of what the model predicts: turn it in \
                 the rig file, [[joint]] effort = {{ name = …, scale = -1 }}"
            ),
            Fault::Unit(times) => {
                let near = UNITS.iter().min_by(|a, b| {
                    let off = |unit: f64| (times * unit).ln().abs();
                    off(a.1).total_cmp(&off(b.1))
                });
                let unit = near.filter(|(_, unit)| (times * unit).ln().abs() < 0.7);
                let guess = unit.map_or_else(
                    || {
                        "state its scale in the rig file, [[joint]] effort = { name = …, scale = … }"
                            .to_owned()
                    },
                    |(name, scale)| {
                        format!("is it in {name}? then [[joint]] effort = {{ name = …, scale = {scale} }}")
                    },
                );
                format!("the torque of joint {joint} is {times:.3} times what the model predicts: {guess}")
            }
        }
    }
}

/// Returns the torques that contradict the nominal model, of a source with joint torques.
///
/// # Errors
/// [`FitError`] if the recording has no rows.
pub fn suspects(source: &TreeSource, model: &Model) -> Result<Vec<Suspect>, FitError> {
    let input = source.input();
    if !input.has_efforts() {
        return Ok(Vec::new());
    }
    let (values, _) = Predictor::of_model(model).values(source.parameters());
    // Rows as they are measured: without noise of feet nothing is mixed for its sake.
    let mut plain = input.clone();
    if let Some(contact) = &mut plain.contact {
        contact.feet.iter_mut().for_each(|foot| foot.sigma = [0.0; 6]);
    }
    let mut airborne = plain.clone();
    airborne.frames.iter_mut().for_each(|frame| {
        let ground: &mut Ground = &mut frame.ground;
        ground.wrenches.iter_mut().for_each(|wrench| *wrench = [0.0; 6]);
    });
    let predict = |input| {
        let source = source.of_same_model(input).map_err(|_| FitError::Columns { given: 0, wanted: 0 })?;
        Prediction::of(&source, &values, &[])
    };
    let (with, without) = (predict(plain)?, predict(airborne)?);
    let first = input.first_effort();
    let names = input.freedom_names();
    let unmeasured = input.contact.as_ref().map_or(&[][..], |contact| &contact.unmeasured);
    let mut found = Vec::new();
    for (k, joint) in names.iter().enumerate().filter(|(k, _)| !unmeasured.contains(k)) {
        let channel = first + k;
        let pairs: Vec<(f64, f64)> = with
            .blocks
            .iter()
            .zip(&without.blocks)
            .filter(|(block, _)| block.determined.get(channel) != Some(&false))
            .filter_map(|(block, own)| {
                let ground = block.measured.get(channel)? - own.measured.get(channel)?;
                Some((*own.measured.get(channel)?, block.predicted.get(channel)? - ground))
            })
            .collect();
        if let Some(fault) = judge(&pairs) {
            found.push(Suspect { joint: joint.clone(), fault });
        }
    }
    Ok(found)
}

/// Judges pairs of what was measured and what was predicted.
fn judge(pairs: &[(f64, f64)]) -> Option<Fault> {
    let count = pairs.len().max(1) as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / count;
    let (measured, predicted) = (mean(|p| p.0), mean(|p| p.1));
    let (mut a, mut b, mut both) = (0.0, 0.0, 0.0);
    for (own, other) in pairs {
        let (own, other) = (own - measured, other - predicted);
        (a, b, both) = (a + own * own, b + other * other, both + own * other);
    }
    if pairs.len() < 3 || b <= 0.0 {
        return None;
    }
    if a < DEAD * DEAD * b {
        return Some(Fault::Dead);
    }
    let correlation = both / (a * b).sqrt();
    let times = (a / b).sqrt();
    if correlation < -ALIKE {
        return Some(Fault::Sign);
    }
    let other_unit = !(1.0 / OTHER_UNIT..=OTHER_UNIT).contains(&times);
    (correlation > ALIKE && other_unit).then_some(Fault::Unit(times))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_of_a_channel_are_reported() {
        let wave = |k: usize| (0.1 * k as f64).sin();
        let pairs = |scale: f64, constant: f64| -> Vec<(f64, f64)> {
            (0..100).map(|k| (scale * wave(k) + constant, wave(k) + 0.1 * wave(7 * k))).collect()
        };
        assert_eq!(judge(&pairs(1.0, 0.3)), None);
        assert_eq!(judge(&pairs(0.0, 0.3)), Some(Fault::Dead));
        assert_eq!(judge(&pairs(-1.0, 0.0)), Some(Fault::Sign));
        assert!(
            matches!(judge(&pairs(1e3, 0.0)), Some(Fault::Unit(times)) if (times / 1e3 - 1.0).abs() < 0.1)
        );
        let text = Suspect { joint: "knee".to_owned(), fault: Fault::Unit(980.0) }.text();
        assert!(text.contains("N mm"), "{text}");
    }
}

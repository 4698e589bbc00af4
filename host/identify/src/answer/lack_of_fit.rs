//! The evidence of the residuals against the model, in the answer's terms and in words.

use super::result::{Answer, Change, Changed, NotRigid, ParameterStep, PoseDrift, WithinMotion};
use rigident_fit::figures::{significant, unit_symbol, with_u95};
use rigident_fit::lack_of_fit::{self as found, Motion};
use rigident_fit::{COVERAGE_95, Fit, Measured};

/// Steps below this many standard deviations are not reported.
const REPORTED_SD: f64 = 3.0;
/// Steps at most that words tell.
const IN_WORDS: usize = 4;
/// A resonance is reported by one frequency if its range is narrower than this factor.
const NARROW: f64 = 1.3;
/// A mass below this is given in grams.
const GRAMS: f64 = 0.5;

impl Answer {
    /// Adds what the residuals say against the model, and its warnings.
    pub(super) fn add_lack_of_fit(&mut self, fit: &Fit) {
        self.change = fit.lack_of_fit.change.as_ref().map(|change| of_change(fit, change));
        self.not_rigid = fit.lack_of_fit.not_rigid.as_ref().map(of_motion);
        self.pose_drift = fit.lack_of_fit.pose_drift.iter().map(|drift| of_drift(fit, drift)).collect();
        self.warnings.extend(self.change.iter().map(change_in_words));
        self.warnings.extend(self.not_rigid.iter().map(motion_in_words));
        self.warnings.extend(drift_in_words(&self.pose_drift));
    }
}

fn of_change(fit: &Fit, change: &found::Change) -> Change {
    let width_s = fit.filter.width_s;
    let begin_s = fit.residuals.first().map_or(0.0, |r| r.time_s - width_s);
    let mut steps: Vec<(f64, ParameterStep)> = change
        .steps
        .iter()
        .filter_map(|step| {
            let parameter = fit.parameters.get(step.column)?;
            let certain = step.value.abs() / step.deviation;
            let measured = Measured { value: step.value, u95: COVERAGE_95 * step.deviation };
            let reported =
                ParameterStep { name: parameter.name.clone(), unit: parameter.unit.clone(), step: measured };
            (certain > REPORTED_SD && measured.u95.is_finite()).then_some((certain, reported))
        })
        .collect();
    steps.sort_by(|a, b| b.0.total_cmp(&a.0));
    Change {
        time_s: Measured { value: change.time_s - begin_s, u95: change.time_u95_s },
        changed: match change.changed {
            found::Changed::Body => Changed::Body,
            found::Changed::Offset => Changed::Offset,
            found::Changed::Either => Changed::Either,
        },
        probability: change.probability,
        steps: steps.into_iter().map(|s| s.1).collect(),
    }
}

fn of_motion(found: &found::NotRigid) -> NotRigid {
    let (motion, frequency_hz, bursts) = match found.motion {
        Motion::Resonance { frequency_hz } => (WithinMotion::Resonance, Some(frequency_hz), None),
        Motion::Spring => (WithinMotion::Spring, None, None),
        Motion::Bursts { count } => (WithinMotion::Bursts, None, Some(count as u64)),
    };
    NotRigid { motion, frequency_hz, bursts, probability: found.probability }
}

fn of_drift(fit: &Fit, drift: &found::PoseDrift) -> PoseDrift {
    let channel = fit.channels.get(drift.channel).map(|c| c.channel.name.clone());
    PoseDrift {
        channel: channel.unwrap_or_default(),
        probability: drift.probability,
        correlation: drift.correlation,
        correlation_probability: drift.correlation_probability,
    }
}

/// Returns a step with its sign: `m −10.0 ± 0.9 g`.
fn step_in_words(step: &ParameterStep) -> String {
    let Measured { value, u95 } = step.step;
    let (value, u95, unit) = match step.unit.as_str() {
        "kg" if value.abs() < GRAMS => (1e3 * value, 1e3 * u95, "g".to_owned()),
        unit => (value, u95, unit_symbol(unit)),
    };
    let sign = if value < 0.0 { "−" } else { "+" };
    format!("{} {sign}{}", step.name, with_u95(value.abs(), u95, &unit))
}

/// Returns a probability in words.
fn chance(probability: f64) -> String {
    if probability < 1e-12 { "below 1e-12".to_owned() } else { significant(probability, 1) }
}

/// Returns a change in words.
pub fn change_in_words(change: &Change) -> String {
    let steps: Vec<String> = change.steps.iter().take(IN_WORDS).map(step_in_words).collect();
    let steps = if steps.is_empty() { String::new() } else { format!(": {}", steps.join(", ")) };
    let Measured { value, u95 } = change.time_s;
    let time = with_u95(value, u95, "s");
    let chance = chance(change.probability);
    let (what, then) = match change.changed {
        Changed::Body => (
            "something changed, came loose, was added or lost",
            "The numbers are a mean of before and after: identify the two parts on their own",
        ),
        Changed::Offset => (
            "the load cell's offset jumped, and the body did not change",
            "Look for a knock, a mount that slipped, a cable; identify the two parts on their own",
        ),
        Changed::Either => (
            "something changed, the body or the load cell's offset; the motion does not tell which",
            "The numbers are a mean of before and after: identify the two parts on their own",
        ),
    };
    format!("{time} after the beginning {what}{steps} (by chance in an honest recording: {chance}). {then}")
}

/// Returns in words what moves.
pub fn motion_in_words(found: &NotRigid) -> String {
    let chance = chance(found.probability);
    match found.motion {
        WithinMotion::Resonance => {
            let [low, high] = found.frequency_hz.unwrap_or_default();
            let at = if high < NARROW * low {
                format!("at about {} Hz", significant((low * high).sqrt(), 2))
            } else {
                format!("at {} to {} Hz", significant(low, 2), significant(high, 2))
            };
            format!(
                "the residuals are those of a part that swings {at}: an elastic mount, liquid, a load that \
                 hangs (by chance: {chance}). The parameters are not those of a rigid body"
            )
        }
        WithinMotion::Spring => format!(
            "the residuals follow the attitude as a spring does: does a cable or a hose pull? (by chance: \
             {chance})"
        ),
        WithinMotion::Bursts => format!(
            "the residuals come in {} bursts: does something rattle or knock, a loose bolt? (by chance: \
             {chance})",
            found.bursts.unwrap_or_default()
        ),
    }
}

fn drift_in_words(drift: &[PoseDrift]) -> Option<String> {
    if drift.is_empty() {
        return None;
    }
    let of = |d: &PoseDrift| {
        format!("{} (correlation from pose to pose {})", d.channel, significant(d.correlation, 2))
    };
    let channels: Vec<String> = drift.iter().map(of).collect();
    let least = drift.iter().map(|d| d.probability.min(d.correlation_probability)).fold(1.0, f64::min);
    Some(format!(
        "residuals drift from pose to pose in the order in which the poses were taken: {} (by chance: {}). \
         The intervals do not count this: let the load cell warm up, take the poses in another order, and \
         some of them twice",
        channels.join(", "),
        chance(least)
    ))
}

//! Limits of the joints that a trajectory keeps: those of the model, and of options instead or besides.

use rigident_shared::tree::Joint;

use super::family::Motion;
use rigident_model::Model;
use rigident_model::limits::Limits;

/// The margin to every limit for what happens between the instants that the search checks: a
/// three-hundredth.
const KEPT: f64 = 1.0 - 1.0 / 300.0;
/// If no start is given, a joint starts this share of its range away from its ends, as near to zero as that
/// is.
const FROM_ENDS: f64 = 0.2;

/// Shares of the limits that a trajectory may use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shares {
    /// Share of half the range of positions, about its middle.
    pub range: f64,
    /// Share of the largest rate.
    pub speed: f64,
    /// Share of the largest effort: the rest is for what the nominal model does not know.
    pub effort: f64,
}

impl Default for Shares {
    fn default() -> Self {
        Self { range: 0.95, speed: 0.9, effort: 0.8 }
    }
}

/// Limits of one joint, all stated, and what of them may be used.
#[derive(Clone, Debug, PartialEq)]
pub struct JointLimits {
    /// The joint.
    pub name: String,
    /// True if the joint slides.
    pub slides: bool,
    /// Least and largest position, rad or m.
    pub range: [f64; 2],
    /// Largest rate, rad/s or m/s.
    pub speed: f64,
    /// Largest effort, N m or N.
    pub effort: f64,
    /// Largest acceleration, rad/s² or m/s²; `None`: as efforts allow.
    pub acceleration: Option<f64>,
    /// The shares that may be used.
    pub shares: Shares,
    /// Dry friction as the model states it, N m or N: its sign is unknown, so that it is taken off the
    /// largest effort.
    pub dry: f64,
}

/// Limits given by options: `[JOINT=]VALUE`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GivenLimits {
    /// `[JOINT=]LOW,HIGH`
    pub range: Vec<String>,
    /// `[JOINT=]MOST`
    pub speed: Vec<String>,
    /// `[JOINT=]MOST`
    pub effort: Vec<String>,
    /// `[JOINT=]MOST`
    pub acceleration: Vec<String>,
}

/// A number, or two, of a joint, or of every one.
struct Given<'a, const N: usize> {
    joint: Option<&'a str>,
    values: [f64; N],
}

/// Reads `[JOINT=]VALUE[,VALUE]` of an option.
fn given<'a, const N: usize>(option: &str, words: &'a str, model: &Model) -> Result<Given<'a, N>, String> {
    let (joint, numbers) = match words.rsplit_once('=') {
        Some((joint, numbers)) => (Some(joint.trim()), numbers),
        None => (None, words),
    };
    if let Some(name) = joint.filter(|name| model.joint(name).is_none()) {
        return Err(format!("{option} {words}: {}", no_joint(model, name)));
    }
    let values: Vec<f64> = numbers.split(',').filter_map(|word| word.trim().parse().ok()).collect();
    let good = values.iter().all(|v| v.is_finite()) && numbers.split(',').count() == N;
    match <[f64; N]>::try_from(values).ok().filter(|_| good) {
        Some(values) => Ok(Given { joint, values }),
        None => {
            let form = if N == 2 { "JOINT=LOW,HIGH" } else { "JOINT=VALUE" };
            Err(format!("{option} {words}: is written as {form}, or without JOINT= for every joint"))
        }
    }
}

/// Reads limits that are above zero.
fn positive<'a>(option: &str, words: &'a [String], model: &Model) -> Result<Vec<Given<'a, 1>>, String> {
    let all = words.iter().map(|own| given::<1>(option, own, model)).collect::<Result<Vec<_>, _>>()?;
    match all.iter().find(|g| g.values[0] <= 0.0) {
        Some(g) => Err(format!("{option} {}: a limit is above zero", g.values[0])),
        None => Ok(all),
    }
}

/// Says that a model has no such joint.
pub(super) fn no_joint(model: &Model, name: &str) -> String {
    let movable = model.links.iter().skip(1).filter(|l| l.link.joint != Joint::Fixed);
    let names: Vec<&str> = movable.map(|l| l.joint_name.as_str()).collect();
    format!("there is no joint {name}; those that move are {}", names.join(", "))
}

/// Returns numbers `[JOINT=]VALUE` of an option for the joints of these names: a joint's own before that of
/// every one, the last one given.
///
/// # Errors
/// A word that is no such number, or names no such joint.
pub fn by_joint(
    option: &str,
    words: &[String],
    model: &Model,
    names: &[&str],
) -> Result<Vec<Option<f64>>, String> {
    let all = words.iter().map(|own| given::<1>(option, own, model)).collect::<Result<Vec<_>, _>>()?;
    let of = |name: Option<&str>| all.iter().rev().find(|g| g.joint == name).map(|g| g.values[0]);
    Ok(names.iter().map(|name| of(Some(name)).or_else(|| of(None))).collect())
}

impl GivenLimits {
    /// Returns the limits of the joints of a model that move, by link; those of a joint take the place of the
    /// model's, those of every joint apply where the model has none or wider ones.
    ///
    /// # Errors
    /// A limit that is missing, by joint, and how to give it; words that are none.
    pub fn of(&self, model: &Model, shares: Shares) -> Result<Vec<JointLimits>, String> {
        let ranges =
            self.range.iter().map(|own| given::<2>("`range`", own, model)).collect::<Result<Vec<_>, _>>()?;
        let (speeds, efforts) =
            (positive("`speed`", &self.speed, model)?, positive("`effort`", &self.effort, model)?);
        let accelerations = positive("`acceleration`", &self.acceleration, model)?;
        let one = |all: &[Given<1>], name: &str, own: Option<f64>| {
            let of = |joint: Option<&str>| all.iter().rev().find(|g| g.joint == joint).map(|g| g.values[0]);
            let every = of(None);
            of(Some(name)).or_else(|| own.map(|own| every.map_or(own, |every| own.min(every))).or(every))
        };
        let (mut limits, mut missing) = (Vec::new(), Vec::new());
        for link in model.links.iter().skip(1) {
            let name = link.joint_name.as_str();
            let Limits { position, velocity, effort } = link.limits;
            let of = |joint: Option<&str>| ranges.iter().rev().find(|g| g.joint == joint).map(|g| g.values);
            let every = of(None);
            let within =
                |[low, high]: [f64; 2]| every.map_or([low, high], |[l, h]| [low.max(l), high.min(h)]);
            let range = of(Some(name)).or_else(|| position.map(within).or(every));
            let (speed, effort) = (one(&speeds, name, velocity), one(&efforts, name, effort));
            let slides = matches!(link.link.joint, Joint::Prismatic(_));
            for (option, example, is_missing) in [
                ("`range`", "-3.1,3.1", range.is_none()),
                ("`speed`", "1", speed.is_none()),
                ("`effort`", "50", effort.is_none()),
            ] {
                if is_missing {
                    missing.push(format!("{option} {name}={example}"));
                }
            }
            if let Some([low, high]) = range.filter(|[low, high]| low >= high) {
                return Err(format!("`range`: {name} from {low} to {high} leaves no room"));
            }
            if let (Some(range), Some(speed), Some(effort)) = (range, speed, effort) {
                let dry = link.passive[0].friction.max(0.0);
                let acceleration = one(&accelerations, name, None);
                let name = name.to_owned();
                limits.push(JointLimits { name, slides, range, speed, effort, acceleration, shares, dry });
            }
        }
        if missing.is_empty() {
            return Ok(limits);
        }
        Err(format!(
            "limits that the model does not state: give them as, with numbers of your robot (rad, rad/s, N \
             m; of what slides m, m/s, N), {}; without JOINT= they are those of every joint, and joints that \
             are not to move are held with `lock`",
            missing.join(" ")
        ))
    }
}

impl JointLimits {
    /// Returns middle and half of the positions that may be used, rad or m.
    pub fn room(&self) -> (f64, f64) {
        let [low, high] = self.range;
        (0.5 * (low + high), 0.5 * self.shares.range * (high - low))
    }

    /// Returns the largest effort that the nominal model may need, N m or N.
    pub fn usable_effort(&self) -> f64 {
        self.shares.effort * self.effort - self.dry
    }

    /// Returns where it starts if nothing is said, rad or m.
    pub fn start(&self) -> f64 {
        let [low, high] = self.range;
        let away = FROM_ENDS * (high - low);
        0.0_f64.clamp(low + away, high - away)
    }

    /// Adds `−Σ log slack` of position, rate and acceleration of joint `j`, and its slopes to `worth`; `None`
    /// outside.
    pub(super) fn barrier(&self, motion: &Motion, j: usize, sum: &mut f64, worth: &mut Motion) -> Option<()> {
        let (middle, half) = self.room();
        worth.positions[j] += within(motion.positions[j] - middle, KEPT * half, sum)?;
        worth.rates[j] += within(motion.rates[j], KEPT * self.shares.speed * self.speed, sum)?;
        if let Some(most) = self.acceleration {
            worth.accelerations[j] += within(motion.accelerations[j], KEPT * self.shares.speed * most, sum)?;
        }
        Some(())
    }

    /// Adds `−Σ log slack` of an effort, and returns its slope; `None` outside.
    pub(super) fn effort_barrier(&self, effort: f64, sum: &mut f64) -> Option<f64> {
        within(effort, KEPT * self.usable_effort(), sum)
    }
}

/// Adds `−log(1 − (v/limit)²)`; returns its derivative, `None` outside.
fn within(value: f64, limit: f64, sum: &mut f64) -> Option<f64> {
    let ratio = value / limit;
    let slack = 1.0 - ratio * ratio;
    if slack.is_nan() || slack <= 0.0 || limit <= 0.0 {
        return None;
    }
    *sum -= slack.ln();
    Some(2.0 * ratio / (limit * slack))
}

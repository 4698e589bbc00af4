//! Motion and efforts against the limits that the model states.

use rigident_shared::tree::Joint;

use super::Input;
use rigident_fit::figures::significant;
use rigident_model::limits::Limits;

/// Beyond a limit by this share of it, or of the range, is worth a word;
const NOTICEABLE: f64 = 0.01;
/// by this one of it, it cannot be: a unit is wrong. Descriptions often state less than the machine can.
const IMPOSSIBLE: f64 = 2.0;

/// Readings beyond this share of them are outliers, which the fit deals with.
const ALL_BUT_OUTLIERS: f64 = 0.999;

/// A quantity of a joint that goes beyond what the model states.
#[derive(Clone, Debug, PartialEq)]
pub struct Beyond {
    /// It in words.
    pub text: String,
    /// True if it is so far beyond that it cannot be.
    pub impossible: bool,
}

/// Returns the largest size of some values but for outliers.
fn largest(values: impl Iterator<Item = f64>) -> f64 {
    let mut sizes: Vec<f64> = values.map(f64::abs).filter(|v| v.is_finite()).collect();
    let at = (ALL_BUT_OUTLIERS * sizes.len().saturating_sub(1) as f64) as usize;
    if sizes.is_empty() { 0.0 } else { *sizes.select_nth_unstable_by(at, f64::total_cmp).1 }
}

/// Returns what goes beyond the limits of the model.
pub fn beyond(input: &Input) -> Vec<Beyond> {
    let mut found = Vec::new();
    let (mut position, mut freedom) = (0, 0);
    for link in input.model.links.iter().skip(1) {
        let (at, own) = (position, freedom);
        freedom += link.link.joint.freedoms();
        position += link.link.joint.coordinates();
        let units = match link.link.joint {
            Joint::Revolute(_) => ["rad", "rad/s", "N m"],
            Joint::Prismatic(_) => ["m", "m/s", "N"],
            _ => continue,
        };
        let name = &link.joint_name;
        let Limits { position: range, velocity, effort } = link.limits;
        let frames = &input.frames;
        if let Some([lower, upper]) = range {
            let values = || frames.iter().filter_map(|frame| frame.positions.get(at).copied());
            let (least, most) =
                (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
            let over = (lower - least).max(most - upper) / (upper - lower);
            if over > NOTICEABLE {
                found.push(Beyond {
                    text: format!(
                        "{name} is at {} to {} {}, and the model limits it to {} to {}: are its unit and its \
                         zero right?",
                        significant(least, 3),
                        significant(most, 3),
                        units[0],
                        significant(lower, 3),
                        significant(upper, 3)
                    ),
                    impossible: over > IMPOSSIBLE,
                });
            }
        }
        let rate = largest(frames.iter().filter_map(|frame| frame.rates.get(own).copied()));
        let efforts = frames.iter().filter(|_| input.has_efforts());
        let force = largest(efforts.filter_map(|frame| frame.efforts.get(own).copied()));
        for (what, value, limit, unit) in
            [("moves at up to", rate, velocity, units[1]), ("has efforts up to", force, effort, units[2])]
        {
            let Some(limit) = limit.filter(|limit| value > (1.0 + NOTICEABLE) * limit) else { continue };
            found.push(Beyond {
                text: format!(
                    "{name} {what} {} {unit}, and the model limits it to {}: is its unit right?",
                    significant(value, 3),
                    significant(limit, 3)
                ),
                impossible: value > (1.0 + IMPOSSIBLE) * limit,
            });
        }
    }
    found
}

//! Changes to a model that depend on what is recorded: joints that are locked are where the recording has
//! them, unless it was stated; three revolute joints that are one spherical joint stay three where their
//! angles are recorded.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use rigident_shared::tree::Joint;

use super::{Caller, Error, Notice};
use rigident_io::recording::Recording;
use rigident_model::Model;
use rigident_model::idle::{DEVIATION, Spread};
use rigident_rows::tree::columns::{self, Column, Quantity};
use rigident_rows::tree::joints::{Resolved, Seen, attitude, resolve};

/// A joint that leaves its place by no more is held, rad or m, 1 σ, encoders and attitudes: controllers let
/// it sag by as much.
const HELD: f64 = 2e-3;
const HELD_BY_ATTITUDES: f64 = 0.02;

/// Locks joints, given as `JOINT` or `JOINT=VALUE`; returns what was taken for granted, in words.
///
/// # Errors
/// There is no such joint, or it moves in the recording.
pub(super) fn lock(
    model: &mut Model,
    words: &[String],
    recording: &Recording,
    caller: &Caller<'_>,
) -> Result<Vec<String>, Error> {
    let (mut notes, mut unseen) = (Vec::new(), Vec::new());
    let mut places = Vec::new();
    for words in words {
        let (name, stated) = model.locked(words)?;
        let Some(i) = model.joint(name) else { continue };
        let seen = match positions(model, i, recording)? {
            Some((column, values)) => Some((column, Stand::of(&values, HELD))),
            None => by_attitudes(model, i, recording),
        };
        let Some((source, stand)) = seen else {
            if stated.is_none() && model.links[i].link.joint != Joint::Fixed {
                unseen.push(name.to_owned());
            }
            places.push(words.clone());
            continue;
        };
        let unit = if matches!(model.links[i].link.joint, Joint::Prismatic(_)) { "m" } else { "rad" };
        if stand.moves {
            let moves = format!(
                "{source} in {} moves, from {:.4} to {:.4} {unit} (standard deviation {:.2e})",
                recording.file(),
                stand.least,
                stand.largest,
                stand.deviation
            );
            return Err(Error::LockedMoves { joint: name.to_owned(), moves });
        }
        let value = stated.unwrap_or(stand.mean);
        if stated.is_none() {
            notes.push(format!("joint {name} is locked at {value:.4} {unit}, where {source} has it"));
        } else if (value - stand.mean).abs() > HELD.max(DEVIATION * stand.deviation) {
            notes.push(format!(
                "joint {name} is locked at {value} {unit} as stated; {source} has it at {:.4} {unit}",
                stand.mean
            ));
        }
        match stand.turned {
            // A ball joint's place is no single number.
            Some(turned) if stated.is_none() => {
                model.links[i].link.rotation *= turned;
                notes.pop();
                notes.push(format!("joint {name} is locked in the attitude that {source} has"));
                places.push(name.to_owned());
            }
            _ => places.push(format!("{name}={value}")),
        }
    }
    if !unseen.is_empty() {
        notes.push(caller.words(&Notice::LockedAtZero(unseen)));
    }
    model.lock(&places)?;
    Ok(notes)
}

/// Declares three revolute joints each that are one spherical joint: where the angles of all three are
/// recorded they stay, and what is between them is no body.
///
/// # Errors
/// They are no such joint.
pub(super) fn meet(model: &mut Model, groups: &[[String; 3]], recording: &Recording) -> Result<(), Error> {
    for joints in groups {
        let recorded = |name: &String| {
            let i = model.joint(name);
            let column = i.and_then(|i| source(model, i, recording));
            column.is_some_and(|column| recording.extra.iter().any(|(name, _)| *name == column.name))
        };
        if joints.iter().all(recorded) {
            model.declare_meeting(joints)?;
        } else {
            model.declare_spherical(joints)?;
        }
    }
    Ok(())
}

/// The place of something.
struct Stand {
    mean: f64,
    least: f64,
    largest: f64,
    deviation: f64,
    moves: bool,
    turned: Option<Matrix3<f64>>,
}

impl Stand {
    fn of(values: &[f64], held: f64) -> Self {
        let Spread { mean, deviation, noise } = Spread::of(values);
        Self {
            mean,
            least: values.iter().copied().fold(f64::INFINITY, f64::min),
            largest: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            deviation,
            moves: deviation > held.max(DEVIATION * noise),
            turned: None,
        }
    }
}

/// Returns the column that a joint's position is searched for in, if it has one freedom.
fn source(model: &Model, i: usize, recording: &Recording) -> Option<Column> {
    let link = &model.links[i];
    columns::column(&recording.rig, &link.joint_name, &link.link.joint, Quantity::Position)
}

/// Positions of a joint that has a column, and which.
///
/// # Errors
/// One of them is no number.
fn positions(model: &Model, i: usize, recording: &Recording) -> Result<Option<(String, Vec<f64>)>, Error> {
    let Some(column) = source(model, i, recording) else { return Ok(None) };
    let values = columns::numbers(recording, &column)?;
    Ok(values.map(|values| (format!("column {}", column.name), values)))
}

/// A joint between two links whose attitudes are recorded, where `[[link]]` tables number them.
fn by_attitudes(model: &Model, i: usize, recording: &Recording) -> Option<(String, Stand)> {
    let link = &model.links[i];
    let attitudes = |name: &str| {
        let j = recording.rig.link.iter().position(|table| table.name == name)?;
        recording.attitudes.iter().find(|(k, _)| *k == j).map(|(_, rows)| (j, rows))
    };
    let (j, own) = attitudes(&link.name)?;
    let parent = attitudes(&model.links[link.link.parent].name);
    if parent.is_none() && link.link.parent != 0 {
        return None;
    }
    let zero = Vector3::zeros();
    let resolved = own.iter().enumerate().map(|(row, q)| {
        let base = match parent {
            Some((_, rows)) => attitude(rows.get(row)?)?,
            None => Matrix3::identity(),
        };
        let root =
            Resolved { attitude: base, rate: zero, positions: Vec::new(), rates: Vec::new(), misfit: 0.0 };
        Some(resolve(&link.link, &root, &Seen::Link { attitude: attitude(q)?, rate: zero })?.positions)
    });
    let positions = resolved.collect::<Option<Vec<_>>>()?;
    let source = format!("the attitude q{j}_w … q{j}_z");
    match link.link.joint {
        Joint::Revolute(_) => {
            let angles: Vec<f64> = positions.iter().filter_map(|p| p.first().copied()).collect();
            Some((source, Stand::of(&angles, HELD_BY_ATTITUDES)))
        }
        Joint::Spherical => {
            let turns: Vec<UnitQuaternion<f64>> = positions
                .iter()
                .filter_map(|p| match p.as_slice() {
                    [w, x, y, z] => {
                        Some(UnitQuaternion::new_normalize(nalgebra::Quaternion::new(*w, *x, *y, *z)))
                    }
                    _ => None,
                })
                .collect();
            let mean = UnitQuaternion::mean_of(turns.iter().copied());
            let off: Vec<f64> = turns.iter().map(|turn| mean.angle_to(turn)).collect();
            let mut stand = Stand::of(&off, HELD_BY_ATTITUDES);
            let square = off.iter().map(|a| a * a).sum::<f64>() / off.len().max(1) as f64;
            (stand.deviation, stand.moves) = (square.sqrt(), square.sqrt() > HELD_BY_ATTITUDES);
            stand.turned = Some(mean.to_rotation_matrix().into_inner());
            Some((source, stand))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rigident_model::idle::white_noise;

    #[test]
    fn held_joints_are_distinguished_from_moving_ones() {
        let series = |f: &dyn Fn(f64) -> f64| (0..2000).map(|k| f(f64::from(k))).collect::<Vec<f64>>();
        // Of about unit variance, white.
        let white = |k: f64| ((k * 12.9898).sin() * 43_758.545).fract() * 1.7;
        for (values, moves) in [
            (series(&|_| 0.4), false),
            (series(&|k| 0.4 + 1e-3 * white(k)), false),
            // Noise of an attitude, larger than what a controller lets go.
            (series(&|k| 0.4 + 1e-2 * white(k)), false),
            (series(&|k| 0.4 + 1e-2 * (k / 60.0).sin()), true),
            (series(&|k| 0.4 + 1e-5 * k), true),
        ] {
            let stand = Stand::of(&values, HELD);
            assert_eq!(stand.moves, moves, "{} {}", stand.deviation, white_noise(&values));
            assert!((stand.mean - 0.4).abs() < 0.011);
        }
    }
}

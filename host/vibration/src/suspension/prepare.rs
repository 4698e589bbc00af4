//! Rows from a recording of poses and a rig file.

use nalgebra::{Matrix3, Vector3};
use rigident_shared::tree::Joint;

use super::SuspensionError;
use super::mount::Instant;
use super::source::{SuspendedSource, Tracked};
use super::springs::COORDINATES;
use super::support::{Support, constant_rate_hz, missing};
use super::track::{Pose, Track, poses, rest};
use rigident_io::recording::Recording;
use rigident_model::{Finding, Model, ModelLink};
use rigident_rows::moved::Part;
use rigident_rows::smoothing::Smoother;
use rigident_rows::tree::columns::{Quantity, column, numbers};
use rigident_rows::tree::joints::{Resolved, Seen, attitude, resolve};
use rigident_rows::tree::{Input, TreePrepareError};

/// A locked coordinate that moves by more than this share of the largest free one of its kind is none.
const LOCKED_MOVES: f64 = 0.05;

/// Ready to be identified.
pub struct PreparedSuspension {
    /// The source of rows.
    pub source: SuspendedSource,
    /// The notes.
    pub notes: Vec<String>,
    /// Joints that never move.
    pub idle: Vec<Finding>,
}

/// Brings a recording of the poses of a platform, and of the links on it, to rows; of one body without a
/// model.
///
/// # Errors
/// [`SuspensionError`] says what is missing or does not fit.
pub fn prepare(recording: &Recording, model: Option<&Model>) -> Result<PreparedSuspension, SuspensionError> {
    let support = Support::of(&recording.rig, &recording.name)?;
    let table = recording.rig.suspension.clone().unwrap_or_default();
    let rows = recording.platform.as_deref().ok_or_else(|| {
        missing(
            &recording.name,
            "the poses of the platform (x_m, y_m, z_m, qw, qx, qy, qz) are",
            "springs push by how the platform stands; name the columns under [recording.columns] if they are \
             called otherwise",
        )
    })?;
    let rate_hz = constant_rate_hz(recording)?;
    let model = model.map_or_else(one_body, Model::welded);
    let at = Vector3::from(table.at_m);
    let poses = poses(rows, &at, |row| recording.place(row))?;
    let rest = rest(&poses);
    let (joints, parts) = joints(recording, &model)?;
    let track = Track::new(&poses, &rest, (&joints, &parts), recording.time_ns.clone(), rate_hz);
    let cut_off_hz = table.cut_off_hz.unwrap_or_else(|| track.cut_off_hz());
    let smoother =
        Smoother::new(cut_off_hz, rate_hz).ok_or(SuspensionError::CutOff { cut_off_hz, rate_hz })?;
    let (rows, taps) = (track.len(), 2 * smoother.half() + 1);
    let (tracked, instants, frames) = Tracked::new(track, smoother, &support);
    if frames.is_empty() {
        let name = recording.name.clone();
        return Err(SuspensionError::Short { name, rows, rate_hz, cut_off_hz, taps });
    }
    judge_locked(recording, &instants, &support.free)?;
    let tracked = tracked.with_noise();
    let notes = vec![about(&instants, &rest, cut_off_hz, rows)];
    let moves: Vec<(&[f64], Vector3<f64>)> =
        frames.iter().map(|f| (f.positions.get(7..).unwrap_or_default(), Vector3::zeros())).collect();
    let mut idle = rigident_model::idle::idle(&model, &moves, true);
    // How far the platform turns is judged by its rows.
    idle.retain(|finding| !finding.text.starts_with("the base never turns"));
    let input = Input::tracked(model, frames, rate_hz);
    let source = SuspendedSource::new(input, instants, support, Some(tracked))?;
    Ok(PreparedSuspension { source, notes, idle })
}

/// Returns a model of one link.
fn one_body() -> Model {
    let link = rigident_shared::tree::Link {
        parent: 0,
        joint: Joint::Free,
        rotation: Matrix3::identity(),
        position: Vector3::zeros(),
    };
    Model {
        name: "body".to_owned(),
        links: vec![ModelLink::new("body", "", link, None)],
        findings: Vec::new(),
        gravity_mps2: None,
    }
}

/// Returns the numbers of the joints of every row, and what they are.
pub(super) fn joints(
    recording: &Recording,
    model: &Model,
) -> Result<(Vec<Vec<f64>>, Vec<Part>), SuspensionError> {
    let tables = &recording.rig.link;
    let number_of = |i: usize| match tables.is_empty() {
        true => i,
        false => tables.iter().position(|t| t.name == model.links[i].name).unwrap_or(i),
    };
    let mut seen: Vec<SeenAt> = vec![None];
    let mut parts = Vec::new();
    for (i, link) in model.links.iter().enumerate().skip(1) {
        parts.push(match link.link.joint {
            Joint::Spherical => Part::Ball,
            Joint::Revolute(_) | Joint::Prismatic(_) => Part::Hinge,
            _ => {
                return Err(SuspensionError::Missing {
                    name: recording.name.clone(),
                    missing: format!(
                        "a way to track joint {}, which is neither spherical, revolute nor \
                                      prismatic, is",
                        link.joint_name
                    ),
                    advice: "on springs links hang on spherical, revolute and prismatic joints; lock the \
                             joint, or split it"
                        .to_owned(),
                });
            }
        });
        let own = column(&recording.rig, &link.joint_name, &link.link.joint, Quantity::Position);
        if let Some(values) = own.map(|own| numbers(recording, &own)).transpose()?.flatten() {
            seen.push(Some(Box::new(move |row| Some(Seen::Coordinate(*values.get(row)?, 0.0)))));
            continue;
        }
        let j = number_of(i);
        let Some((_, rows)) = recording.attitudes.iter().find(|(own, _)| *own == j) else {
            return Err(SuspensionError::Missing {
                name: recording.name.clone(),
                missing: format!("the position of link {} is", link.name),
                advice: format!(
                    "give its attitude against the base link, q{j}_w, q{j}_x, q{j}_y, q{j}_z, or the column \
                     of its joint; a joint that is locked by `lock` {}=VALUE",
                    link.joint_name
                ),
            });
        };
        let rows = rows.clone();
        seen.push(Some(Box::new(move |row| {
            Some(Seen::Link { attitude: attitude(rows.get(row)?)?, rate: Vector3::zeros() })
        })));
    }
    let mut all = Vec::with_capacity(recording.rows());
    for row in 0..recording.rows() {
        all.push(joints_of(row, model, &seen).ok_or_else(|| {
            SuspensionError::from(TreePrepareError::Cell {
                name: recording.file(),
                column: "attitudes of links".to_owned(),
                row: recording.place(row),
                reason: "one is no unit quaternion w, x, y, z".to_owned(),
            })
        })?);
    }
    Ok((all, parts))
}

/// The function that gives what is seen of a link in a row; of the base link nothing.
type SeenAt = Option<Box<dyn Fn(usize) -> Option<Seen>>>;

fn joints_of(row: usize, model: &Model, seen: &[SeenAt]) -> Option<Vec<f64>> {
    let root = Resolved {
        attitude: Matrix3::identity(),
        rate: Vector3::zeros(),
        positions: Vec::new(),
        rates: Vec::new(),
        misfit: 0.0,
    };
    let mut links = vec![root];
    for (link, seen) in model.links.iter().zip(seen).skip(1) {
        let seen = seen.as_ref()?(row)?;
        let resolved = resolve(&link.link, links.get(link.link.parent)?, &seen)?;
        links.push(resolved);
    }
    Some(links.into_iter().flat_map(|l| l.positions).collect())
}

fn rms(instants: &[Instant], coordinate: usize) -> f64 {
    let squares: f64 = instants.iter().map(|i| i.at.coordinates()[coordinate].powi(2)).sum();
    (squares / instants.len().max(1) as f64).sqrt()
}

/// Refuses a locked coordinate that moves.
fn judge_locked(recording: &Recording, instants: &[Instant], free: &[usize]) -> Result<(), SuspensionError> {
    for k in (0..6).filter(|k| !free.contains(k)) {
        let of_kind = free.iter().filter(|other| (**other < 3) == (k < 3));
        let largest = of_kind.map(|other| rms(instants, *other)).fold(0.0, f64::max);
        let moves = rms(instants, k);
        if moves > LOCKED_MOVES * largest {
            return Err(SuspensionError::NotLocked {
                name: recording.name.clone(),
                coordinate: COORDINATES[k].to_owned(),
                moves,
                unit: if k < 3 { "m" } else { "rad" },
                share: 100.0 * moves / largest,
            });
        }
    }
    Ok(())
}

fn about(instants: &[Instant], rest: &Pose, cut_off_hz: f64, rows: usize) -> String {
    let mm: Vec<String> = (0..3).map(|k| format!("{:.2}", 1e3 * rms(instants, k))).collect();
    let deg: Vec<String> = (3..6).map(|k| format!("{:.3}", rms(instants, k).to_degrees())).collect();
    let p = rest.position;
    format!(
        "the platform moves by {} mm and {} degrees (rms; x, y, z) about its rest at ({:.4}, {:.4}, {:.4}) \
         m; poses smoothed at {cut_off_hz:.1} Hz, {} of {rows} used",
        mm.join(", "),
        deg.join(", "),
        p.x,
        p.y,
        p.z,
        instants.len()
    )
}

//! Locked postures as recordings of their free vibration: the positions of the joints, the modes, and the
//! body that each posture is.

use nalgebra::{DMatrix, Matrix3, Quaternion, SVector, UnitQuaternion, Vector3, Vector4};

use super::SuspensionError;
use super::bare::fixture;
use super::by_modes::by_modes;
use super::free_decay::vibration;
use super::posture_modes::{PostureModes, posture_rows};
use super::postures::PostureSource;
use super::prepare::joints;
use super::support::Support;
use crate::modal_analysis::Shapes;
use rigident_fit::{Estimate, Factor, Fit, FitOptions, Silent, fit};
use rigident_io::recording::Recording;
use rigident_model::Model;
use rigident_rows::moved::Part;

/// Parameters of a body.
const TEN: usize = 10;
/// A joint that turns by more than this about its mean is not locked, rad and m, rms.
const LOCKED: f64 = 0.01;

/// A locked posture as it was recorded.
pub struct RecordedPosture {
    /// The posture's name.
    pub name: String,
    /// Coordinates of the joints: m, rad, quaternions w, x, y, z.
    pub positions: Vec<f64>,
    /// The posture's modes over the free coordinates.
    pub shapes: Shapes,
    /// The findings about them.
    pub findings: Vec<String>,
    /// Rest of the platform in the frame of the recording: position of O, m, and attitude; `None` without
    /// poses.
    pub rest: Option<(Vector3<f64>, Matrix3<f64>)>,
    /// 1 σ of the rest's coordinates, m and rad: what a mean over no whole periods leaves.
    pub rest_sd: [f64; 6],
    /// Ten parameters of everything on the springs, the platform too, in S.
    pub whole: Estimate,
    /// Factor of the ten without the platform.
    alone: Factor,
}

impl RecordedPosture {
    /// Returns the posture of a recording.
    ///
    /// # Errors
    /// [`SuspensionError`] if a joint moves, or the modes do not tell a body.
    pub fn of(recording: &Recording, model: &Model, support: &Support) -> Result<Self, SuspensionError> {
        let refuse = |why: String| SuspensionError::Posture { file: recording.name.clone(), why };
        let positions = locked(recording, model)?;
        let found = vibration(recording, support, None)?;
        let mut own = by_modes(support, &found).map_err(|why| refuse(why.to_string()))?;
        let shapes = found.modes.shapes.clone();
        let whole = own.estimate.clone();
        take_platform_off(recording, &mut own)?;
        if !own.estimate.unjudged().determined.iter().all(|determined| *determined) {
            return Err(refuse(
                "its modes do not tell all ten parameters of a body: strike the platform so that it moves in \
                 all directions".to_owned(),
            ));
        }
        let rest_sd = found.rest_sd(&support.free);
        Ok(Self {
            name: recording.name.clone(),
            positions,
            shapes,
            findings: found.modes.findings.iter().map(ToString::to_string).collect(),
            rest: found.samples.rest,
            rest_sd,
            whole,
            alone: own.scaled_factor(),
        })
    }

    /// Returns the mass of everything without the platform, and its 1 σ, kg.
    pub fn mass_kg(&self) -> Option<(f64, f64)> {
        let solution = self.alone.solve(self.alone.rounding());
        let is_determined = solution.determined.first() == Some(&true);
        is_determined.then(|| (solution.estimate[0], solution.covariance[(0, 0)].sqrt()))
    }

    /// Returns the ten parameters of everything about O, axes of P, and their covariance.
    pub(super) fn about_o(&self, support: &Support) -> (SVector<f64, TEN>, DMatrix<f64>) {
        let map = support.mount.map();
        let ten = map * SVector::<f64, TEN>::from_fn(|k, _| self.whole.unjudged().values[k]);
        let wide = DMatrix::from_fn(TEN, TEN, |i, j| map[(i, j)]);
        (ten, &wide * self.whole.unjudged().covariance * wide.transpose())
    }
}

fn take_platform_off(recording: &Recording, found: &mut Fit) -> Result<(), SuspensionError> {
    let Some(table) = recording.rig.suspension.as_ref() else { return Ok(()) };
    let taken = fixture(table).and_then(|own| own.map_or(Ok(()), |tare| tare.take_off(found)));
    taken.map_err(|e| SuspensionError::Posture { file: recording.name.clone(), why: e.to_string() })
}

/// Returns the joints as they are on average.
///
/// # Errors
/// [`SuspensionError`] if one moves.
fn locked(recording: &Recording, model: &Model) -> Result<Vec<f64>, SuspensionError> {
    let (rows, parts) = joints(recording, model)?;
    let count = rows.len().max(1) as f64;
    let (mut at, mut out) = (0, Vec::new());
    for (part, link) in parts.iter().zip(model.links.iter().skip(1)) {
        let width = part.numbers();
        let own = || rows.iter().filter_map(|row| row.get(at..at + width));
        let (mean, moves) = match part {
            Part::Ball => {
                let first = own().next().map_or_else(Vector4::zeros, Vector4::from_column_slice);
                let along = |q: &[f64]| {
                    let q = Vector4::from_column_slice(q);
                    if q.dot(&first) < 0.0 { -q } else { q }
                };
                let mean = own().map(along).sum::<Vector4<f64>>().normalize();
                let of = |v: &Vector4<f64>| {
                    UnitQuaternion::from_quaternion(Quaternion::new(v[0], v[1], v[2], v[3]))
                };
                let squares = own().map(|q| of(&along(q)).angle_to(&of(&mean)).powi(2)).sum::<f64>();
                (mean.as_slice().to_vec(), (squares / count).sqrt())
            }
            _ => {
                let mean = own().map(|v| v[0]).sum::<f64>() / count;
                let squares = own().map(|v| (v[0] - mean).powi(2)).sum::<f64>();
                (vec![mean], (squares / count).sqrt())
            }
        };
        if moves > LOCKED {
            return Err(SuspensionError::Posture {
                file: recording.name.clone(),
                why: format!(
                    "{} is not locked: it moves by {moves:.3} rad (m) against its mean, rms; lock it, or \
                     identify the motion by `identify()`",
                    link.name
                ),
            });
        }
        out.extend(mean);
        at += width;
    }
    Ok(out)
}

/// Returns the rows of postures over the base parameters of a tree, one by one, and the factor of all with
/// the errors of the springs that they share, the platform on it.
///
/// # Errors
/// [`SuspensionError`] if the postures do not fit the tree, or two have one name.
pub fn source(
    model: &Model,
    support: &Support,
    postures: &[RecordedPosture],
    name: &str,
) -> Result<(PostureSource, Fit), SuspensionError> {
    let modes: Vec<PostureModes> = postures
        .iter()
        .map(|own| PostureModes {
            name: own.name.clone(),
            positions: own.positions.clone(),
            shapes: own.shapes.clone(),
        })
        .collect();
    let rows = posture_rows(model, support, &modes)?;
    let refuse = |why: String| SuspensionError::Posture { file: name.to_owned(), why };
    let together = fit(&rows, &FitOptions::default(), &Silent).map_err(|e| refuse(e.to_string()))?;
    let one_by_one = postures.iter().map(|own| (own.name.clone(), own.positions.clone(), own.alone.clone()));
    let source = PostureSource::of_factors(model, one_by_one.collect(), name)?;
    Ok((source, together))
}

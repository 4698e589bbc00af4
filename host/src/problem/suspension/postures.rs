//! Locked postures: what the whole thing weighs in each says of the base parameters of its links.
//!
//! A tree whose joints stand still is one body. Its mass, first moment and tensor about the base's origin are sums over the links,
//! ```text
//! [M; MS; I] = Σ_j T(R_j, p_j) φ_j
//! ```
//! with the map T of ten parameters to another frame: linear in the standard parameters, and so in the base parameters. These are Eqs. 5
//! to 7 of the vibration paper in a form that holds for any tree and any place of the joints. However many postures there are, of n
//! spherical joints one direction for each is not told: `J_0 + α 1, J_j − α 1`.

use nalgebra::{DMatrix, Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use rigident_shared::inertia::{InertialParameters, tensor_from_elements};
use rigident_shared::screening::Rejection;
use rigident_shared::spatial::{Body, Position};
use rigident_shared::tree::{BaseMotion, Joint};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::SuspensionError;
use crate::fit::{Channel, Factor, Parameter, RowSource, SampleRows, Timing};
use crate::model::base::{BaseParameters, Rows, Situation};
use crate::model::inertial::map_to_parent;
use crate::model::rows::Moving;
use crate::model::{Model, ModelError, rig_links};
use crate::problem::body;
use crate::problem::tree::joints::attitude;
use crate::problem::tree::{BaseSensor, Input, TreeSource};
use crate::rig::LinkTable;

/// Parameters of the whole in one posture.
const TEN: usize = 10;
/// Rotations are orthonormal to the digits that people write.
const WRITTEN: f64 = 2e-3;

/// A file of postures: the tree, and what it weighs in each.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PosturesFile {
    /// The tree, as in a rig file.
    pub link: Vec<LinkTable>,
    /// 1 σ of the mass of each posture, kg; of all three or of none: then the postures' scatter tells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_std_kg: Option<f64>,
    /// 1 σ of each coordinate of the centre of mass, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub com_std_m: Option<f64>,
    /// 1 σ of each element of the tensor, kg m².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inertia_std_kgm2: Option<f64>,
    /// Masses of single links where they are known, kg: they narrow what the postures leave open.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub link_mass_kg: BTreeMap<String, f64>,
    /// The postures.
    pub posture: Vec<PostureTable>,
    /// Values to print beside those found, by the names that these have.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub reference: BTreeMap<String, f64>,
}

/// `[[posture]]`: the whole thing with its joints locked.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PostureTable {
    /// Its name.
    #[serde(default)]
    pub name: String,
    /// Mass of everything, kg.
    pub mass_kg: f64,
    /// Centre of mass in the base link's frame, m.
    pub com_m: [f64; 3],
    /// Tensor about the centre of mass, axes of the base link, Ixx, Iyy, Izz, Iyz, Izx, Ixy, kg m².
    pub inertia_com_kgm2: [f64; 6],
    /// How the joints stand, by the names of their links.
    #[serde(default)]
    pub joint: BTreeMap<String, JointStand>,
}

/// How a locked joint stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum JointStand {
    /// Angle of a revolute joint, rad, or length of a prismatic one, m.
    Coordinate(f64),
    /// Attitude of the link in its joint: quaternion w, x, y, z.
    Quaternion([f64; 4]),
    /// The same as a matrix, row by row: takes vectors in the link's axes to the parent's.
    Matrix([[f64; 3]; 3]),
}

/// The rows of postures.
pub struct PostureSource {
    /// Model, base parameters, names: a tree without frames.
    tree: TreeSource,
    names: Vec<String>,
    rows: Vec<(DMatrix<f64>, [f64; TEN])>,
    channels: Vec<Channel>,
    /// 1 σ of the ten values of each posture, where it is stated.
    sigma: Option<Vec<[f64; TEN]>>,
}

impl PostureSource {
    /// Returns the rows of a file of postures; `what` names it in complaints.
    ///
    /// # Errors
    /// [`SuspensionError`] names the posture and what is wrong with it.
    pub fn new(file: &PosturesFile, what: &str) -> Result<Self, SuspensionError> {
        let model =
            rig_links::from_tables(&file.link, what).map_err(|e| SuspensionError::Source(e.into()))?.welded();
        let tree = TreeSource::new(without_frames(&model))?;
        let refuse = |why: String| SuspensionError::Posture { file: what.to_owned(), why };
        if file.posture.is_empty() {
            return Err(refuse("there is no [[posture]] in it".to_owned()));
        }
        let mut moving = Moving::new(model.tree()).map_err(|e| refuse(format!("{e:?}")))?;
        let mut rows = Vec::new();
        let mut names = Vec::new();
        for (n, posture) in file.posture.iter().enumerate() {
            let name =
                if posture.name.is_empty() { format!("posture {}", n + 1) } else { posture.name.clone() };
            let positions = positions(&model, posture).map_err(|why| refuse(format!("{name}: {why}")))?;
            let composite =
                composite(&mut moving, &positions).map_err(|e| refuse(format!("{name}: {e:?}")))?;
            let columns = base_columns(tree.base(), &composite);
            rows.push((columns, whole(posture).map_err(|why| refuse(format!("{name}: {why}")))?));
            names.push(name);
        }
        let channels = body::parameters(TEN).into_iter().map(|p| Channel {
            name: p.name,
            unit: p.unit,
            sigma: None,
            offset: None,
            group: 0,
        });
        let mut source = Self { tree, names, rows, channels: channels.collect(), sigma: None };
        source.sigma = sigma(file).map_err(refuse)?;
        Ok(source)
    }

    /// Returns the base parameters.
    pub fn base(&self) -> &BaseParameters {
        self.tree.base()
    }

    /// Returns the model.
    pub fn model(&self) -> &Model {
        &self.tree.input().model
    }

    /// Returns what the rows are of.
    pub fn situation(&self) -> Situation {
        self.tree.input().situation
    }

    /// Returns the names of the postures.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Returns the ten rows of a posture over the base parameters, and its ten values: mass, first moments, tensor about the base's origin.
    pub fn of_posture(&self, posture: usize) -> Option<(&DMatrix<f64>, &[f64; TEN])> {
        self.rows.get(posture).map(|(rows, values)| (rows, values))
    }

    /// Returns the factor of some postures, whitened by what is stated of their noise, else of unit σ.
    pub fn factor(&self, postures: impl IntoIterator<Item = usize>) -> Factor {
        let mut factor = Factor::new(self.parameters().len());
        for k in postures {
            let Some((columns, values)) = self.of_posture(k) else { continue };
            let sigma = self.sigma.as_ref().and_then(|all| all.get(k)).copied().unwrap_or([1.0; TEN]);
            let rows: Vec<(Vec<f64>, f64)> = (0..TEN)
                .map(|i| (columns.row(i).iter().map(|v| v / sigma[i]).collect(), values[i] / sigma[i]))
                .collect();
            factor.absorb(rows.iter().map(|(row, value)| (row.as_slice(), *value)));
        }
        factor
    }

    /// Returns true if the noise is stated.
    pub fn sigma_given(&self) -> bool {
        self.sigma.is_some()
    }
}

/// Settings of a tree on springs without any frame.
pub fn without_frames(model: &Model) -> Input {
    Input {
        model: model.clone(),
        frames: Vec::new(),
        is_static: false,
        rate_hz: 1.0,
        base: BaseSensor::Tracked,
        situation: Situation { floating: true, rows: Rows::Base, mimic: false },
        channel_sigma: None,
        known_offset: Some([0.0; 6]),
        nuisances: Vec::new(),
        errors: Vec::new(),
        drives: Vec::new(),
        signals: Vec::new(),
        rate_sigma: 0.0,
    }
}

/// Returns the map of all standard parameters to the ten of the whole, 10 × 10 n, with the joints at these coordinates.
///
/// # Errors
/// [`rigident_shared::tree::TreeError`] if these do not fit the tree.
pub fn composite(
    moving: &mut Moving,
    positions: &[f64],
) -> Result<DMatrix<f64>, rigident_shared::tree::TreeError> {
    let rates = vec![0.0; moving.freedoms()];
    moving.set(positions, &rates, &rates, &BaseMotion::still([0.0; 3]))?;
    let mut all = DMatrix::zeros(TEN, moving.columns());
    for i in 0..moving.links().len() {
        let Some((rotation, position)) = moving.place(i) else { continue };
        let map = map_to_parent(&rotation, &Vector3::from(position));
        all.view_mut((0, TEN * i), (TEN, TEN)).copy_from(&map);
    }
    Ok(all)
}

/// Returns the base parameters' columns of rows over all standard parameters.
pub fn base_columns(base: &BaseParameters, standard: &DMatrix<f64>) -> DMatrix<f64> {
    let (leads, mix) = base.columns();
    let columns = DMatrix::from_fn(standard.nrows(), leads.len(), |i, j| standard[(i, leads[j])]);
    mix.map_or_else(|| columns.clone(), |mix| &columns * mix)
}

/// The ten parameters of a posture about the base's origin.
fn whole(posture: &PostureTable) -> Result<[f64; TEN], String> {
    let PostureTable { mass_kg, com_m, inertia_com_kgm2, .. } = posture;
    let finite = com_m.iter().chain(inertia_com_kgm2).chain([mass_kg]).all(|v| v.is_finite());
    if !finite || *mass_kg <= 0.0 {
        return Err(format!("its mass, {mass_kg} kg, must be greater than zero and every number finite"));
    }
    let body = InertialParameters::<Body, f64>::from_centre_of_mass(
        *mass_kg,
        Position::from_array(*com_m),
        tensor_from_elements(*inertia_com_kgm2),
    );
    if !body.is_physically_consistent() {
        return Err(format!(
            "no distribution of mass has the tensor {inertia_com_kgm2:?} kg m² about its centre: the elements are Ixx, Iyy, Izz, Iyz, Izx, Ixy, \
             Iyz = −∫ y z dm; about the centre of mass, not about the origin"
        ));
    }
    Ok(body.to_vector())
}

fn positions(model: &Model, posture: &PostureTable) -> Result<Vec<f64>, String> {
    if let Some(name) =
        posture.joint.keys().find(|name| !model.links.iter().skip(1).any(|l| l.name == **name))
    {
        let names: Vec<&str> = model.links.iter().skip(1).map(|l| l.name.as_str()).collect();
        return Err(format!("joint.{name} is none; the links that hang on joints are {}", names.join(", ")));
    }
    let mut all = Vec::new();
    for link in model.links.iter().skip(1) {
        let name = &link.name;
        let stand = posture.joint.get(name);
        match (&link.link.joint, stand) {
            (_, None) => return Err(format!("joint.{name} is missing: how does it stand?")),
            (Joint::Revolute(_) | Joint::Prismatic(_), Some(JointStand::Coordinate(q))) if q.is_finite() => {
                all.push(*q)
            }
            (Joint::Spherical, Some(JointStand::Quaternion(q))) => {
                let turn = attitude(q)
                    .ok_or_else(|| format!("joint.{name}: {q:?} is no unit quaternion w, x, y, z"))?;
                all.extend(quaternion(&turn));
            }
            (Joint::Spherical, Some(JointStand::Matrix(rows))) => {
                let turn = Matrix3::from_fn(|i, j| rows[i][j]);
                let off = (turn.transpose() * turn - Matrix3::identity()).abs().max();
                if !(off < WRITTEN && turn.determinant() > 0.0) {
                    return Err(format!(
                        "joint.{name}: the matrix is no rotation: its columns are not orthonormal by {off:.1e}, its determinant is {:.4}",
                        turn.determinant()
                    ));
                }
                all.extend(quaternion(&nearest(&turn)));
            }
            _ => {
                return Err(format!(
                    "joint.{name}: a spherical joint stands by a quaternion w, x, y, z or a matrix, a revolute or prismatic one by a number; other \
                     joints cannot be locked here"
                ));
            }
        }
    }
    Ok(all)
}

/// The rotation nearest to a matrix.
fn nearest(matrix: &Matrix3<f64>) -> Matrix3<f64> {
    let svd = matrix.svd(true, true);
    match (svd.u, svd.v_t) {
        (Some(u), Some(v_t)) => u * v_t,
        _ => *matrix,
    }
}

fn quaternion(turn: &Matrix3<f64>) -> [f64; 4] {
    let q: Quaternion<f64> =
        *UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*turn)).quaternion();
    [q.w, q.i, q.j, q.k]
}

/// 1 σ of the ten values of each posture: of the first moments `√((M σ_c)² + (c σ_M)²)`, of the tensor about the origin what mass and centre
/// move besides.
fn sigma(file: &PosturesFile) -> Result<Option<Vec<[f64; TEN]>>, String> {
    let (mass, com, inertia) = match (file.mass_std_kg, file.com_std_m, file.inertia_std_kgm2) {
        (None, None, None) => return Ok(None),
        (Some(mass), Some(com), Some(inertia)) => (mass, com, inertia),
        _ => {
            return Err(
                "mass_std_kg, com_std_m and inertia_std_kgm2 are given together, or none of them".to_owned()
            );
        }
    };
    if ![mass, com, inertia].iter().all(|v| v.is_finite() && *v > 0.0) {
        return Err(
            "mass_std_kg, com_std_m and inertia_std_kgm2 must be finite and greater than zero".to_owned()
        );
    }
    let of = |posture: &PostureTable| {
        let (m, c) = (posture.mass_kg, Vector3::from(posture.com_m));
        let moment = |k: usize| (m * com).hypot(c[k] * mass);
        let mut all = [0.0; TEN];
        all[0] = mass;
        (0..3).for_each(|k| all[1 + k] = moment(k));
        for (slot, (i, j)) in [(0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1)].into_iter().enumerate() {
            let (by_com, by_mass) = match i == j {
                true => {
                    let (a, b) = (c[(i + 1) % 3], c[(i + 2) % 3]);
                    (2.0 * m * com * a.hypot(b), mass * (a * a + b * b))
                }
                false => (m * com * c[i].hypot(c[j]), mass * c[i] * c[j]),
            };
            all[4 + slot] = (inertia * inertia + by_com * by_com + by_mass * by_mass).sqrt();
        }
        all
    };
    Ok(Some(file.posture.iter().map(of).collect()))
}

impl RowSource for PostureSource {
    fn parameters(&self) -> &[Parameter] {
        self.tree.parameters()
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn timing(&self) -> Timing {
        Timing::Static
    }

    fn samples(&self) -> usize {
        self.rows.len()
    }

    fn time_ns(&self, sample: usize) -> u64 {
        sample as u64
    }

    fn rows(&self, sample: usize, rows: &mut SampleRows) -> Result<(), Rejection> {
        let (columns, values) = self.rows.get(sample).ok_or(Rejection::NotFinite(0))?;
        let n = columns.ncols();
        for i in 0..TEN {
            for j in 0..n {
                rows.smoothed[i * n + j] = columns[(i, j)];
            }
        }
        rows.measured.copy_from_slice(values);
        Ok(())
    }

    fn nominal_sigma(&self) -> Vec<f64> {
        vec![1.0; TEN]
    }

    fn model_fingerprint(&self) -> u64 {
        self.tree.model_fingerprint()
    }
}

impl From<ModelError> for SuspensionError {
    fn from(error: ModelError) -> Self {
        Self::Source(error.into())
    }
}

#[cfg(test)]
#[path = "postures_tests.rs"]
mod tests;

//! Locked postures: what the whole thing weighs in each says of the base parameters of its links.
//!
//! A tree whose joints are at rest is one body. Its mass, first moment and tensor about the base's origin are
//! sums over the links,
//! ```text
//! [M; MS; I] = Σ_j T(R_j, p_j) φ_j
//! ```
//! with the map T of ten parameters to another frame: linear in the standard parameters, and so in the base
//! parameters. These are Eqs. 5 to 7 of the vibration paper in a form that holds for any tree and any place
//! of the joints. However many postures there are, of n spherical joints one direction for each is not
//! determined: `J_0 + α 1, J_j − α 1`.

use super::SuspensionError;
use super::posture_file::{JointStand, PostureTable, PosturesFile};
use super::whitened::pooled;
use nalgebra::{DMatrix, DVector, Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use rigident_fit::pool::PooledFactor;
use rigident_fit::{Factor, Parameter, RowSource as _};
use rigident_io::motion_capture::registration::nearest_rotation;
use rigident_model::base::BaseParameters;
use rigident_model::inertial::map_to_parent;
use rigident_model::rows::Moving;
use rigident_model::{Model, ModelError};
use rigident_rows::named_model::rig_links;
use rigident_rows::tree::joints::attitude;
use rigident_rows::tree::{Input, TreeSource};
use rigident_shared::inertia::{InertialParameters, tensor_from_elements};
use rigident_shared::spatial::{Body, Position};
use rigident_shared::tree::{BaseMotion, Joint};

/// Parameters of the whole in one posture.
const TEN: usize = 10;
/// Rounds in which scatter and weights settle.
const SCATTER_ROUNDS: usize = 8;
/// Rotations are orthonormal to the digits that people write.
const WRITTEN: f64 = 2e-3;

/// Locked postures: the rows of each over the base parameters.
pub struct PostureSource {
    /// Model, base parameters, names: a tree without frames.
    tree: TreeSource,
    names: Vec<String>,
    rows: Vec<(DMatrix<f64>, [f64; TEN])>,
    /// The whitening of the ten values of each posture.
    whitening: Vec<DMatrix<f64>>,
    /// 1 σ of these values.
    sigma: Vec<[f64; TEN]>,
    /// False if σ is from the scatter of the postures.
    sigma_given: bool,
    file: String,
}

impl PostureSource {
    /// Returns the rows of a file of postures; `what` names it in complaints.
    ///
    /// # Errors
    /// [`SuspensionError`] names the posture and what is wrong with it.
    pub fn new(file: &PosturesFile, what: &str) -> Result<Self, SuspensionError> {
        let model =
            rig_links::from_tables(&file.link, what).map_err(|e| SuspensionError::Source(e.into()))?.welded();
        let tree = TreeSource::new(Input::tracked(model.clone(), Vec::new(), 1.0))?;
        let refuse = |why: String| SuspensionError::Posture { file: what.to_owned(), why };
        if file.posture.is_empty() {
            return Err(refuse("there is no [[posture]] in it".to_owned()));
        }
        file.check().map_err(refuse)?;
        let mut moving = Moving::new(model.tree()).map_err(|e| refuse(format!("{e:?}")))?;
        let mut rows = Vec::new();
        let mut names: Vec<String> = Vec::new();
        for (n, posture) in file.posture.iter().enumerate() {
            let name =
                if posture.name.is_empty() { format!("posture {}", n + 1) } else { posture.name.clone() };
            if names.contains(&name) {
                return Err(refuse(format!("{name} is in it twice: give each posture a name of its own")));
            }
            let positions = positions(&model, posture).map_err(|why| refuse(format!("{name}: {why}")))?;
            let composite =
                composite(&mut moving, &positions).map_err(|e| refuse(format!("{name}: {e:?}")))?;
            let columns = base_columns(tree.base(), &composite);
            rows.push((columns, whole(posture).map_err(|why| refuse(format!("{name}: {why}")))?));
            names.push(name);
        }
        let stated = sigma(file).map_err(refuse)?;
        let sigma_given = stated.is_some();
        let sigma = stated.unwrap_or_else(|| scatter(&rows));
        let of = |sigma: &[f64; TEN]| DMatrix::from_diagonal(&DVector::from_fn(TEN, |k, _| 1.0 / sigma[k]));
        let whitening = sigma.iter().map(of).collect();
        Ok(Self { tree, names, rows, whitening, sigma, sigma_given, file: what.to_owned() })
    }

    /// Returns the rows of postures of a tree, each with its name, the positions of its joints, and the
    /// factor of its ten parameters in the base link's frame; `what` names them in complaints.
    ///
    /// # Errors
    /// [`SuspensionError`] if the joints do not fit the tree, or two postures have one name.
    pub fn of_factors(
        model: &Model,
        postures: Vec<(String, Vec<f64>, Factor)>,
        what: &str,
    ) -> Result<Self, SuspensionError> {
        let model = model.welded();
        let tree = TreeSource::new(Input::tracked(model.clone(), Vec::new(), 1.0))?;
        let refuse = |why: String| SuspensionError::Posture { file: what.to_owned(), why };
        let mut moving = Moving::new(model.tree()).map_err(|e| refuse(format!("{e:?}")))?;
        let (mut rows, mut names, mut whitening, mut sigma) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (name, positions, factor) in postures {
            if names.contains(&name) {
                return Err(refuse(format!("{name} is given twice: its vibration would count twice")));
            }
            let composite =
                composite(&mut moving, &positions).map_err(|e| refuse(format!("{name}: {e:?}")))?;
            let solution = factor.solve(factor.rounding());
            rows.push((
                base_columns(tree.base(), &composite),
                std::array::from_fn(|k| solution.estimate.get(k).copied().unwrap_or(0.0)),
            ));
            sigma.push(std::array::from_fn(|k| solution.covariance[(k, k)].sqrt()));
            whitening.push(factor.r());
            names.push(name);
        }
        Ok(Self { tree, names, rows, whitening, sigma, sigma_given: true, file: what.to_owned() })
    }

    /// Returns the unknowns: the base parameters of the tree.
    pub fn parameters(&self) -> &[Parameter] {
        self.tree.parameters()
    }

    /// Returns the base parameters.
    pub fn base(&self) -> &BaseParameters {
        self.tree.base()
    }

    /// Returns the model.
    pub fn model(&self) -> &Model {
        &self.tree.input().model
    }

    /// Returns the names of the postures.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Returns the ten rows of a posture over the base parameters, and its ten values: mass, first moments,
    /// tensor about the base's origin.
    pub fn of_posture(&self, posture: usize) -> Option<(&DMatrix<f64>, &[f64; TEN])> {
        self.rows.get(posture).map(|(rows, values)| (rows, values))
    }

    /// Returns the factor of some postures, whitened.
    pub fn factor(&self, postures: impl IntoIterator<Item = usize>) -> Factor {
        let mut factor = Factor::new(self.parameters().len());
        for k in postures {
            let (Some((columns, values)), Some(whitening)) = (self.rows.get(k), self.whitening.get(k)) else {
                continue;
            };
            let values = whitening * DVector::from_column_slice(values);
            factor.absorb_matrix(&(whitening * columns), values.as_slice());
        }
        factor
    }

    /// Returns the factor of all postures, to be merged with those of motions.
    pub fn pooled(&self) -> PooledFactor {
        let numbers = self.rows.iter().flat_map(|(_, values)| values.iter().copied());
        PooledFactor {
            model_fingerprint: self.tree.model_fingerprint(),
            ..pooled(
                &self.file,
                self.parameters().to_vec(),
                self.factor(0..self.rows.len()),
                numbers,
                self.sigma_given,
            )
        }
    }

    /// Returns 1 σ of the ten values of each posture: mass, kg; first moments, kg m; tensor about the base's
    /// origin, kg m².
    pub fn sigma(&self) -> &[[f64; TEN]] {
        &self.sigma
    }

    /// Returns true if the noise is stated.
    pub fn sigma_given(&self) -> bool {
        self.sigma_given
    }
}

/// Returns 1 σ of masses, first moments and tensors as residuals of all postures show it: the sum of squares
/// of each kind by what of its rows is not fitted. Of a kind that scatters by nothing, a millionth of its
/// values.
fn scatter(rows: &[(DMatrix<f64>, [f64; TEN])]) -> Vec<[f64; TEN]> {
    let n = rows.first().map_or(0, |(columns, _)| columns.ncols());
    let kind = |i: usize| [0, 1, 1, 1, 2, 2, 2, 2, 2, 2][i];
    let mut sigma = [1.0_f64; 3];
    for _ in 0..SCATTER_ROUNDS {
        let white = DMatrix::from_fn(rows.len() * TEN, n, |i, j| {
            rows[i / TEN].0[(i % TEN, j)] / sigma[kind(i % TEN)]
        });
        let values =
            DVector::from_fn(rows.len() * TEN, |i, _| rows[i / TEN].1[i % TEN] / sigma[kind(i % TEN)]);
        let svd = white.svd(true, false);
        let Some(u) = svd.u else { break };
        let most = svd.singular_values.max();
        let seen: Vec<usize> =
            (0..n.min(u.ncols())).filter(|k| svd.singular_values[*k] > 1e-9 * most).collect();
        let u = u.select_columns(&seen);
        let left = &values - &u * u.tr_mul(&values);
        let mut sums = [[0.0; 2]; 3];
        for i in 0..left.len() {
            let own = &mut sums[kind(i % TEN)];
            own[0] += left[i] * left[i];
            own[1] += 1.0 - u.row(i).norm_squared();
        }
        for (k, [squares, freedom]) in sums.into_iter().enumerate() {
            let least = rows
                .iter()
                .flat_map(|(_, v)| (0..TEN).filter(|i| kind(*i) == k).map(|i| v[i].abs()))
                .fold(0.0, f64::max);
            let found = if freedom > 1e-6 { (squares / freedom).sqrt() * sigma[k] } else { 0.0 };
            sigma[k] = found.max(1e-6 * least).max(f64::MIN_POSITIVE);
        }
    }
    vec![std::array::from_fn(|i| sigma[kind(i)]); rows.len()]
}

/// Returns the map of all standard parameters to the ten of the whole, 10 × 10 n, with the joints at these
/// coordinates.
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

/// Returns the ten parameters of a posture about the base's origin.
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
            "no distribution of mass has the tensor {inertia_com_kgm2:?} kg m² about its centre: the \
             elements are Ixx, Iyy, Izz, Iyz, Izx, Ixy, Iyz = −∫ y z dm; about the centre of mass, not about \
             the origin"
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
            (_, None) => return Err(format!("joint.{name} is missing: what is its position?")),
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
                        "joint.{name}: the matrix is no rotation: its columns are not orthonormal by \
                         {off:.1e}, its determinant is {:.4}",
                        turn.determinant()
                    ));
                }
                all.extend(quaternion(&nearest_rotation(&turn).unwrap_or(turn)));
            }
            _ => {
                return Err(format!(
                    "joint.{name}: a spherical joint is given by a quaternion w, x, y, z or a matrix, a \
                     revolute or prismatic one by a number; other joints cannot be locked here"
                ));
            }
        }
    }
    Ok(all)
}

fn quaternion(turn: &Matrix3<f64>) -> [f64; 4] {
    let q: Quaternion<f64> =
        *UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*turn)).quaternion();
    [q.w, q.i, q.j, q.k]
}

/// Returns 1 σ of the ten values of each posture: of the first moments `√((M σ_c)² + (c σ_M)²)`, of the
/// tensor about the origin what mass and centre move besides.
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

impl From<ModelError> for SuspensionError {
    fn from(error: ModelError) -> Self {
        Self::Source(error.into())
    }
}

#[cfg(test)]
#[path = "postures_tests.rs"]
mod tests;

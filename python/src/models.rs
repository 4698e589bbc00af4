//! Models of trees of links: their rows in motion.

use nalgebra::{DMatrix, Vector3};
use numpy::{PyArray3, PyArrayMethods, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rigident::model::base::{BaseParameters, Rows, Situation, base_parameters};
use rigident::model::human::{Person, Sex};
use rigident::model::rows::Moving;
use rigident::model::{Model, ModelError};
use rigident::rows::named_model::open;
use rigident_shared::inertia::PARAMETER_NAMES;
use rigident_shared::tree::{BaseMotion, TreeError};

use crate::errors::refused;

/// Standard parameters of a link in rows.
const PER_LINK: usize = 10;

/// Holds a tree of links, fixed joints welded.
#[pyclass(frozen, module = "rigident._rigident")]
pub struct Tree {
    model: Model,
    welded: Model,
    is_person: bool,
}

/// A motion of samples: positions, rates and accelerations of joints, and of the base its specific force,
/// angular rate and acceleration, or none of it where it is held still.
type Motion<'a, 'py> = (
    &'a PyReadonlyArray2<'py, f64>,
    &'a PyReadonlyArray2<'py, f64>,
    &'a PyReadonlyArray2<'py, f64>,
    Option<[&'a PyReadonlyArray2<'py, f64>; 3]>,
);

#[pymethods]
impl Tree {
    /// Opens a model: human34, human58, or the path of a URDF, MJCF, SDF or rig file, changed as the options
    /// of the command line do.
    ///
    /// # Errors
    /// Raises `RigidentError` if it cannot be read as a tree, or has no such joint.
    #[new]
    #[pyo3(signature = (name, lock, spherical, tool, height_m, mass_kg, sex, lengths_m))]
    #[allow(clippy::too_many_arguments)]
    pub fn new(
        py: Python<'_>,
        name: &str,
        lock: Vec<String>,
        spherical: Vec<[String; 3]>,
        tool: Vec<String>,
        height_m: f64,
        mass_kg: f64,
        sex: &str,
        lengths_m: Vec<(String, f64)>,
    ) -> PyResult<Self> {
        let sex = match sex {
            "female" => Sex::Female,
            "male" => Sex::Male,
            other => return Err(PyValueError::new_err(format!("sex {other:?}: must be 'female' or 'male'"))),
        };
        let person = Person { height_m, mass_kg, sex, lengths_m };
        let opened = || -> Result<Self, ModelError> {
            let (mut model, is_person) = open(name, &person)?;
            model.lock(&lock)?;
            for joints in &spherical {
                model.declare_spherical(joints)?;
            }
            for words in &tool {
                model.hold_tool(words)?;
            }
            Ok(Self { welded: model.welded(), model, is_person })
        };
        opened().map_err(|error| refused(py, error))
    }

    /// Returns its name.
    #[getter]
    pub fn name(&self) -> &str {
        &self.model.name
    }

    /// Returns true for human34 and human58, which have no fixed base.
    #[getter]
    pub fn is_person(&self) -> bool {
        self.is_person
    }

    /// Returns the names of the links, the base first, links on fixed joints welded to what they hang on.
    #[getter]
    pub fn links(&self) -> Vec<&str> {
        self.welded.links.iter().map(|link| link.name.as_str()).collect()
    }

    /// Returns the joints in the order of their numbers: name, kind, positions, rates.
    #[getter]
    pub fn joints(&self) -> Vec<(&str, usize, usize)> {
        let moving = self.welded.links.iter().skip(1);
        moving
            .map(|link| (link.joint_name.as_str(), link.link.joint.coordinates(), link.link.joint.freedoms()))
            .collect()
    }

    /// Returns the nominal standard parameters, ten a link.
    #[getter]
    pub fn nominal(&self) -> Vec<f64> {
        self.welded.nominal()
    }

    /// Returns what is strange in the file.
    #[getter]
    pub fn findings(&self) -> Vec<String> {
        self.model.findings.iter().map(ToString::to_string).collect()
    }

    /// Returns the names of the standard parameters, the columns of the rows.
    #[getter]
    pub fn columns(&self) -> Vec<String> {
        let of =
            |link: &str| PARAMETER_NAMES[..PER_LINK].iter().map(move |p| format!("{link}.{p}")).collect();
        self.welded.links.iter().flat_map(|link| -> Vec<String> { of(&link.name) }).collect()
    }

    /// Returns the rows of a motion in the standard parameters, samples × rows × ten a link, or in the base
    /// parameters of a situation.
    ///
    /// # Errors
    /// Raises `ValueError` if numbers are too few or too many, and `RigidentError` if there are no such rows.
    #[pyo3(signature = (positions, rates, accelerations, base, floating, rows, in_base_parameters))]
    #[allow(clippy::too_many_arguments)]
    pub fn rows<'py>(
        &self,
        py: Python<'py>,
        positions: PyReadonlyArray2<'py, f64>,
        rates: PyReadonlyArray2<'py, f64>,
        accelerations: PyReadonlyArray2<'py, f64>,
        base: Option<[PyReadonlyArray2<'py, f64>; 3]>,
        floating: bool,
        rows: &str,
        in_base_parameters: bool,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let which = match rows {
            "base" => Rows::Base,
            "joint" => Rows::Joint,
            "both" => Rows::Both,
            other => {
                return Err(PyValueError::new_err(format!(
                    "rows {other:?}: must be 'base', 'joint' or 'both'"
                )));
            }
        };
        let situation = Situation { floating, rows: which, mimic: false };
        let base = base.as_ref().map(|[force, rate, change]| [force, rate, change]);
        let motion = (&positions, &rates, &accelerations, base);
        let found = if in_base_parameters {
            let found = py.detach(|| base_parameters(&self.model, &situation));
            Some(found.map_err(|error| refused(py, error))?)
        } else {
            None
        };
        let samples = positions.as_array().nrows();
        let (flat, columns) = self.flat(which, motion, found.as_ref())?;
        let count = if samples == 0 || columns == 0 { 0 } else { flat.len() / samples / columns };
        numpy::PyArray1::from_vec(py, flat).reshape([samples, count, columns])
    }
}

impl Tree {
    /// The rows one after the other, and their columns.
    fn flat(
        &self,
        which: Rows,
        (positions, rates, accelerations, base): Motion<'_, '_>,
        found: Option<&BaseParameters>,
    ) -> PyResult<(Vec<f64>, usize)> {
        let refuse = |error: TreeError| PyValueError::new_err(format!("no rows: {error:?}"));
        let mut moving = Moving::new(self.welded.tree()).map_err(refuse)?;
        let standard = moving.columns();
        let leads = found.map(|found| lead_columns(found, standard));
        let columns = leads.as_ref().map_or(standard, |(leads, _)| leads.len());
        let mut flat = Vec::new();
        for sample in 0..positions.as_array().nrows() {
            let of = |numbers: &PyReadonlyArray2<'_, f64>| -> Option<Vec<f64>> {
                let array = numbers.as_array();
                (sample < array.nrows()).then(|| array.row(sample).to_vec())
            };
            let uneven =
                || PyValueError::new_err(format!("sample {sample}: the arrays have not the same rows"));
            let at = |numbers| of(numbers).ok_or_else(uneven);
            let base = match base {
                None => BaseMotion::still([0.0, 0.0, -STANDARD_GRAVITY_MPS2]),
                Some(motion) => base_motion(motion.map(at))?,
            };
            let (q, v, dv) = (at(positions)?, at(rates)?, at(accelerations)?);
            moving.set(&q, &v, &dv, &base).map_err(|error| match error {
                TreeError::Lengths => PyValueError::new_err(format!(
                    "the joints have {} positions and {} rates, the arrays {}, {} and {}",
                    moving.coordinates(),
                    moving.freedoms(),
                    q.len(),
                    v.len(),
                    dv.len()
                )),
                other => refuse(other),
            })?;
            let rows = match which {
                Rows::Base => moving.base_rows(),
                Rows::Joint => moving.joint_rows(),
                Rows::Both => moving.all_rows(),
            }
            .map_err(refuse)?;
            match &leads {
                None => flat.extend_from_slice(rows),
                Some((leads, map)) => {
                    let y = DMatrix::from_fn(rows.len() / standard, leads.len(), |i, j| {
                        rows[i * standard + leads[j]]
                    });
                    let y = map.as_ref().map_or_else(|| y.clone(), |map| &y * map);
                    flat.extend(y.row_iter().flat_map(|row| row.iter().copied().collect::<Vec<_>>()));
                }
            }
        }
        Ok((flat, columns))
    }
}

/// A base's motion from its specific force, rate and angular acceleration.
fn base_motion([force, rate, change]: [PyResult<Vec<f64>>; 3]) -> PyResult<BaseMotion<f64>> {
    let three = |numbers: PyResult<Vec<f64>>| {
        let refuse = |_| PyValueError::new_err("the base's motion: three columns each");
        <[f64; 3]>::try_from(numbers?).map(Vector3::from).map_err(refuse)
    };
    let (specific_force, rate, angular_acceleration) = (three(force)?, three(rate)?, three(change)?);
    Ok(BaseMotion { specific_force, rate, angular_acceleration })
}

/// Standard gravity along −z of a base that is held still.
const STANDARD_GRAVITY_MPS2: f64 = 9.80665;

/// Returns the columns of the rows that represent the base parameters, and the matrix that makes their own
/// columns of them.
fn lead_columns(found: &BaseParameters, standard: usize) -> (Vec<usize>, Option<DMatrix<f64>>) {
    // A base that is held still has no part in its joints' rows and is left out.
    let skipped = standard - found.standard.len();
    let (leads, map) = found.columns();
    (leads.into_iter().map(|lead| lead + skipped).collect(), map)
}

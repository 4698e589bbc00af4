//! Recordings from arrays.

use std::path::PathBuf;

use numpy::PyReadonlyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rigident::recording::arrays::Numbers;
use rigident::rig::RigFile;

use crate::errors::refused;

/// Holds a recording in memory.
#[pyclass(frozen, module = "rigident._rigident")]
pub struct Recording {
    /// The recording that the host makes of the arrays.
    pub inner: rigident::recording::Recording,
}

/// Holds the numbers of a column as Python has them.
#[derive(FromPyObject)]
pub enum Column<'py> {
    /// Of dtype float64.
    Floats(PyReadonlyArray1<'py, f64>),
    /// Of dtype int64.
    Integers(PyReadonlyArray1<'py, i64>),
}

#[pymethods]
impl Recording {
    /// Makes a recording of columns, one-dimensional and contiguous; `rig` is the path of a rig file.
    ///
    /// # Errors
    /// Raises `RigidentError` with column and index if the columns are not those of a recording.
    #[new]
    #[pyo3(signature = (name, columns, rig=None))]
    pub fn new(
        py: Python<'_>,
        name: &str,
        columns: Vec<(String, Column<'_>)>,
        rig: Option<PathBuf>,
    ) -> PyResult<Self> {
        let read = rig.as_deref().map(RigFile::load_with_text).transpose();
        let read = read.map_err(|error| refused(py, error))?;
        let (file, text) = read.unzip();
        let file = file.unwrap_or_default();
        let mut arrays = Vec::with_capacity(columns.len());
        for (name, column) in &columns {
            let numbers = match column {
                Column::Floats(array) => Numbers::Floats(array.as_slice()?),
                Column::Integers(array) => Numbers::Integers(array.as_slice()?),
            };
            arrays.push((name.clone(), numbers));
        }
        let made =
            py.detach(|| rigident::recording::Recording::from_arrays(name, &arrays, &file, text.as_deref()));
        made.map(|inner| Self { inner }).map_err(|error| refused(py, error))
    }

    /// Returns the number of rows.
    pub fn __len__(&self) -> usize {
        self.inner.rows()
    }
}

/// Returns the text of a TOML file that says what a JSON object says.
///
/// # Errors
/// Raises `ValueError` if TOML cannot say it, as it cannot say `null`.
#[pyfunction]
pub fn toml_of(json: &str) -> PyResult<String> {
    let refuse = |error: &dyn std::fmt::Display| PyValueError::new_err(format!("the rig: {error}"));
    let object: serde_json::Value = serde_json::from_str(json).map_err(|error| refuse(&error))?;
    let table =
        toml_value(&object).ok_or_else(|| refuse(&"it holds null, or a number that is not finite"))?;
    toml::to_string(&table).map_err(|error| refuse(&error))
}

/// Returns the same value of TOML, if it has one.
fn toml_value(value: &serde_json::Value) -> Option<toml::Value> {
    Some(match value {
        serde_json::Value::Null => return None,
        serde_json::Value::Bool(truth) => toml::Value::Boolean(*truth),
        serde_json::Value::Number(number) => match number.as_i64() {
            Some(whole) => toml::Value::Integer(whole),
            None => toml::Value::Float(number.as_f64()?),
        },
        serde_json::Value::String(text) => toml::Value::String(text.clone()),
        serde_json::Value::Array(values) => {
            toml::Value::Array(values.iter().map(toml_value).collect::<Option<_>>()?)
        }
        serde_json::Value::Object(fields) => {
            let pairs = fields.iter().map(|(key, value)| Some((key.clone(), toml_value(value)?)));
            toml::Value::Table(pairs.collect::<Option<_>>()?)
        }
    })
}

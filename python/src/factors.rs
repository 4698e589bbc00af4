//! The content of a factor file.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyDictMethods};
use rigident::fit::factor_file::FactorSource;
use rigident::fit::pool::PooledFactor;

use crate::errors::refused;

/// Returns the contents of a factor file's bytes: `parameters` and `units`, `recordings`, `runs`, `rows`, and
/// the triangle `r`, `z` of the whitened rows.
///
/// # Errors
/// Raises `RigidentError` if the bytes are no factor.
#[pyfunction]
pub fn contents<'py>(py: Python<'py>, bytes: &[u8], name: &str) -> PyResult<Bound<'py, PyDict>> {
    let pooled = PooledFactor::from_bytes(bytes, name).map_err(|error| refused(py, error))?;
    let (names, units): (Vec<&str>, Vec<&str>) =
        pooled.parameters.iter().map(|p| (p.name.as_str(), p.unit.as_str())).unzip();
    let recordings: Vec<String> = pooled.sources.iter().map(FactorSource::in_words).collect();
    let factor = pooled.factor();
    let r = factor.r();
    let rows: Vec<Vec<f64>> = r.row_iter().map(|row| row.iter().copied().collect()).collect();
    let dict = PyDict::new(py);
    dict.set_item("parameters", names)?;
    dict.set_item("units", units)?;
    dict.set_item("recordings", recordings)?;
    dict.set_item("runs", pooled.runs())?;
    dict.set_item("rows", pooled.rows())?;
    dict.set_item("r", PyArray2::from_vec2(py, &rows)?)?;
    dict.set_item("z", PyArray1::from_slice(py, factor.z()))?;
    Ok(dict)
}

//! Rigident in Python: what the package `rigident` calls.
//!
//! Lives here: the application's jobs and any command called in this process without Python's lock,
//! recordings from arrays, factors' contents, rows of models. May not live here: how a result is shown in
//! Python, which is the package's; and what a command does, which is the host's.

mod answers;
mod calls;
mod errors;
mod factors;
mod jobs;
mod models;
mod people;
mod plans;
mod recordings;
mod vibrations;
mod worded;

use pyo3::pymodule;

/// The compiled part of the package `rigident`.
#[pymodule]
mod _rigident {
    #[pymodule_export]
    use crate::calls::{call, main};
    #[pymodule_export]
    use crate::factors::contents;
    #[pymodule_export]
    use crate::jobs::{factor, identify, merge, solve};
    #[pymodule_export]
    use crate::models::Tree;
    #[pymodule_export]
    use crate::people::identify_person;
    #[pymodule_export]
    use crate::plans::{motion, poses};
    #[pymodule_export]
    use crate::recordings::{Recording, toml_of};
    #[pymodule_export]
    use crate::vibrations::identify_vibration;
}

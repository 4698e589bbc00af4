//! The verb `workflows`: checks the files of `.github/workflows`: their schema, and what could go wrong with
//! rights and secrets.

use anyhow::{Result, ensure};

use crate::places;
use crate::process;
use crate::setup;

/// Checks, offline. The checker is installed into the project's own Python.
///
/// # Errors
/// A workflow is none, or has a fault; or there is no linter.
pub fn run() -> Result<()> {
    setup::python_module(setup::LINTERS);
    ensure!(setup::has_module(setup::LINTERS), "zizmor and check-jsonschema cannot be installed into Python");
    let folder = places::root().join(".github/workflows");
    let mut files: Vec<_> =
        std::fs::read_dir(&folder)?.map(|entry| entry.map(|e| e.path())).collect::<Result<_, _>>()?;
    files.sort();
    let mut schema = process::command(setup::python(), places::root());
    schema.args(["-m", "check_jsonschema", "--builtin-schema", "vendor.github-workflows"]);
    process::run(schema.args(&files))?;
    let zizmor = setup::python().with_file_name("zizmor");
    process::run(process::command(zizmor, places::root()).args(["--offline", "--no-progress"]).arg(&folder))
}

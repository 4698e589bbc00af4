//! The program as a user runs it, and what it says.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

/// Runs the program in a folder.
pub fn rigident(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_rigident")).current_dir(folder).args(arguments).output().unwrap()
}

/// Runs the program where nothing is written.
pub fn rigident_anywhere(arguments: &[&str]) -> Output {
    rigident(Path::new("."), arguments)
}

/// Returns the interpreter of Python with what tests compare with.
pub fn python() -> String {
    std::env::var("RIGIDENT_PYTHON").unwrap_or_else(|_| "python3".to_owned())
}

/// Returns its exit status.
pub fn status(output: &Output) -> i32 {
    output.status.code().expect("not ended by a signal")
}

/// Returns what it said on standard error.
pub fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Returns the object that it printed.
pub fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(output)))
}

/// Returns what it said of bad input.
pub fn complaint(output: &Output) -> String {
    assert_eq!(status(output), 2, "{}", String::from_utf8_lossy(&output.stdout));
    said(output)
}

/// Returns a parameter of an answer.
pub fn parameter<'a>(result: &'a Value, name: &str) -> &'a Value {
    let parameters = result["parameters"].as_array().unwrap();
    parameters.iter().find(|p| p["name"] == name).unwrap_or_else(|| panic!("no {name}: {parameters:?}"))
}

//! `pipython` of the vendor, from PyPI, drives the server.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::Served;

/// The version that is driven.
const PIPYTHON: &str = "pipython==2.11.0.6";

/// A Python with the client, in the target folder; what is missing, if it cannot be had.
fn python() -> Result<PathBuf, String> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("pipython");
    let python = folder.join("bin/python");
    let has_it = |python: &Path| {
        Command::new(python).args(["-c", "import pipython"]).output().is_ok_and(|out| out.status.success())
    };
    if has_it(&python) {
        return Ok(python);
    }
    let run = |command: &mut Command| match command.output() {
        Ok(out) if out.status.success() => Ok(()),
        Ok(out) => Err(format!("{command:?}: {}", String::from_utf8_lossy(&out.stderr))),
        Err(e) => Err(format!("{command:?}: {e}")),
    };
    run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder))?;
    run(Command::new(&python).args([
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
        PIPYTHON,
    ]))?;
    if has_it(&python) { Ok(python) } else { Err("pipython was installed and cannot be imported".to_owned()) }
}

#[test]
fn the_vendors_own_client_references_moves_is_refused_stops_and_streams() {
    let python = match python() {
        Ok(python) => python,
        Err(missing) => {
            // Not by eprintln: the test harness keeps what a passing test prints that way.
            let said = format!("\nSKIPPED: {PIPYTHON} cannot be had here, nothing was tested: {missing}\n");
            std::io::stderr().write_all(said.as_bytes()).unwrap();
            return;
        }
    };
    let served = Served::new();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/integration/hexapod/client.py");
    let out = Command::new(python).arg(script).arg(served.server.address().to_string()).output().unwrap();
    let (facts, said) = (String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr));
    assert!(out.status.success(), "{facts}\n{said}");
    let expected = "\
kind: GCS2Device
idn: Rigident, C-887 simulated, 0, 1.0.0.0
axes: XYZUVW
move before referencing: 5
ready while referencing: False
referenced: True
limits around zero: True
VMO near: True
VMO far: False
velocity: 200.0
moves: True
arrived: True
commanded: True
out of limits: 7
unknown axis: 15
unknown command: 2
still there: True
stop: 10
stopped on the way: True
parameter: 0
moves in the stream: True
error after the stream: 0
back: True
";
    assert_eq!(facts, expected, "{said}");
}

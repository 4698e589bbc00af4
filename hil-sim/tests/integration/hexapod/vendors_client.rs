//! `pipython` of the vendor, from PyPI, drives the server. `RIGIDENT_PYTHON` names an interpreter that has
//! it, as `cargo xtask setup` installs it.

use std::path::Path;
use std::process::Command;

use super::Served;

#[test]
#[ignore = "needs the vendor's client in Python"]
fn the_vendors_own_client_references_moves_is_refused_stops_and_streams() {
    let python = std::env::var("RIGIDENT_PYTHON").unwrap_or_else(|_| "python3".to_owned());
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

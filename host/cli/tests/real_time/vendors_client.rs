//! `pipython` of the vendor, from PyPI, before and after a run. `RIGIDENT_PYTHON` names an interpreter that
//! has it, as `cargo xtask setup` installs it.

use std::path::Path;
use std::process::Command;

use hexapod::{Geometry, MotionProgram, Segment};
use rigident::plan::plan_file::PlanFile;

use super::runs::{run_at, said};
use super::{Served, python};

/// Returns what the vendor's client finds, and whether it can move the hexapod to a height, mm.
fn found(served: &Served, height_mm: &str) -> String {
    let python = python();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/real_time/vendors_client.py");
    let address = served.hexapod.as_ref().unwrap().address().to_string();
    let out = Command::new(python).arg(script).args([&address, height_mm]).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8(out.stdout).unwrap()
}

#[test]
#[ignore = "needs the vendor's client in Python"]
fn the_vendors_client_finds_the_controller_as_it_left_it_after_a_run_and_after_a_stop() {
    let served = Served::new();
    let before = found(&served, "7.5");
    for fact in
        ["0x19001900: 0", "velocity: 42.0", "pivot: [0.0, 0.0, 0.0]", "systems: ['ZERO']", "moved: True"]
    {
        assert!(before.contains(fact), "{before}");
    }
    let geometry = Geometry::thesis();
    let mut leaning = geometry.home();
    leaning.rpy_rad[0] = 0.2;
    let segments = vec![Segment::Move { to: leaning, duration_s: 2.0 }, Segment::Hold { duration_s: 1.0 }];
    let program = MotionProgram { start: geometry.home(), segments };
    let plan = served.path("plan.json");
    PlanFile::new("leaning".to_owned(), &geometry, program).write(&plan).unwrap();
    let plan = plan.to_str().unwrap();
    for (out, more) in [("whole", &[][..]), ("stopped", &["--at-most-s", "1.5"])] {
        let arguments = [&["--yes", "--plan", plan][..], more].concat();
        let output = run_at(&served, &served.address(), out, &arguments).output().unwrap();
        assert!(matches!(output.status.code(), Some(0 | 1)), "{}", said(&output));
        // Where the client left the plate the way begins.
        assert!(said(&output).contains("are the way to the start"), "{}", said(&output));
        assert_eq!(found(&served, "7.5"), before, "{out}");
    }
}

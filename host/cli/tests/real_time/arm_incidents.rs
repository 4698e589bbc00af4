//! Incidents of a run on an arm: at rest at once, and reported.

use std::time::{Duration, Instant};

use rigident::plan::plan_file::PlanFile;
use rigident_sim::serve::ur::Incident;

use super::PATIENCE;
use super::arm::{OnArm, swing};
use super::runs::{run_at, said};

#[test]
fn a_driver_that_dies_leaves_the_arm_at_rest() {
    let on = OnArm::new();
    let address = on.arm.url();
    let plan = on.served.path("plan.json");
    PlanFile::new("swing".to_owned(), &on.geometry, swing(20.0)).write(&plan).unwrap();
    let mut child =
        run_at(&on.served, &address, "out", &["--yes", "--plan", plan.to_str().unwrap()]).spawn().unwrap();
    let begun = Instant::now();
    while on.arm.rests() {
        assert!(begun.elapsed() < 3 * PATIENCE);
        std::thread::sleep(Duration::from_millis(5));
    }
    // On the way to the start, or in the experiment.
    std::thread::sleep(Duration::from_millis(700));
    child.kill().unwrap();
    let killed = Instant::now();
    while !on.arm.rests() {
        assert!(killed.elapsed() < Duration::from_millis(800));
        std::thread::sleep(Duration::from_millis(2));
    }
    child.wait().unwrap();
}

#[test]
fn a_run_whose_arm_is_stopped_says_so_and_keeps_what_was_recorded() {
    let on = OnArm::new();
    let plan = on.served.path("plan.json");
    PlanFile::new("swing".to_owned(), &on.geometry, swing(20.0)).write(&plan).unwrap();
    let address = on.arm.url();
    let running = run_at(&on.served, &address, "out", &["--yes", "--plan", plan.to_str().unwrap()]);
    let (output, _) = std::thread::scope(|scope| {
        let arm = &on.arm;
        let pressing = scope.spawn(move || {
            let begun = Instant::now();
            while begun.elapsed() < 3 * PATIENCE && arm.rests() {
                std::thread::sleep(Duration::from_millis(5));
            }
            // The way to the start takes less.
            std::thread::sleep(Duration::from_secs(6));
            arm.happens(Incident::Emergency);
        });
        let mut running = running;
        (running.output().unwrap(), pressing.join())
    });
    let all = said(&output);
    assert_eq!(output.status.code(), Some(3), "{all}");
    assert!(all.contains("its emergency stop is pressed"), "{all}");
    assert!(on.served.path("out/run.mcap").exists(), "{all}");
}

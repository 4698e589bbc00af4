//! Incidents of an arm: at rest at once, and reported.

use std::net::TcpStream;
use std::time::{Duration, Instant};

use hexapod::Geometry;
use rigident::device::platform::{Motion, Platform, PlatformError, connect};
use rigident_sim::serve::ur::Incident;

use super::PATIENCE;
use super::arm::{OnArm, swing};
use super::drivers::watch;
use super::runs::{run_at, said};

/// The first error of a motion, and how long the plate took to rest.
fn broken(on: &OnArm, platform: &mut dyn Platform, since: Instant) -> (PlatformError, Duration) {
    let (mut error, mut rested) = (None, None);
    while error.is_none() || rested.is_none() {
        assert!(since.elapsed() < PATIENCE);
        if let Err(found) = platform.motion() {
            error.get_or_insert(found);
        }
        if on.arm.rests() {
            rested.get_or_insert(since.elapsed());
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    (error.unwrap(), rested.unwrap())
}

#[test]
fn the_arm_is_at_rest_at_once_whatever_happens_and_the_cause_is_named() {
    for (incident, words, most_ms) in [
        (Incident::Protective, "protective stop", 300),
        (Incident::Emergency, "its emergency stop is pressed", 300),
        (Incident::Stopped, "no program runs on it: it was stopped at its panel", 300),
        // The points that it has, and then the deceleration that the rig file allows.
        (Incident::Cut, "it has said nothing for", 600),
    ] {
        let on = OnArm::new();
        let mut platform = on.started(&swing(30.0));
        let begun = Instant::now();
        watch(platform.as_mut(), &mut Vec::new(), || begun.elapsed() > Duration::from_secs(2));
        assert!(!on.arm.rests());
        on.arm.happens(incident);
        let (error, rested) = broken(&on, platform.as_mut(), Instant::now());
        assert!(error.to_string().contains(words), "{incident:?}: {error}");
        assert!(rested < Duration::from_millis(most_ms), "{incident:?}: {rested:?}");
        // Nor does it move again by itself.
        let [there, _] = on.arm.joints();
        std::thread::sleep(Duration::from_millis(500));
        assert_eq!(on.arm.joints(), [there, [0.0; 6]], "{incident:?}");
        eprintln!("{incident:?}: at rest after {:.0} ms: {error}", 1e3 * rested.as_secs_f64());
    }
}

#[test]
fn a_driver_that_dies_leaves_the_arm_at_rest() {
    let on = OnArm::new();
    let address = on.arm.url();
    let plan = on.served.path("plan.json");
    rigident::plan::plan_file::PlanFile::new("swing".to_owned(), &on.geometry, swing(20.0))
        .write(&plan)
        .unwrap();
    let mut child =
        run_at(&on.served, &address, "out", &["--yes", "--plan", plan.to_str().unwrap()]).spawn().unwrap();
    let begun = Instant::now();
    while on.arm.rests() {
        assert!(begun.elapsed() < PATIENCE);
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
    rigident::plan::plan_file::PlanFile::new("swing".to_owned(), &on.geometry, swing(20.0))
        .write(&plan)
        .unwrap();
    let address = on.arm.url();
    let running = run_at(&on.served, &address, "out", &["--yes", "--plan", plan.to_str().unwrap()]);
    let (output, _) = std::thread::scope(|scope| {
        let arm = &on.arm;
        let pressing = scope.spawn(move || {
            let begun = Instant::now();
            while begun.elapsed() < PATIENCE && arm.rests() {
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

#[test]
fn arms_that_cannot_be_driven_are_refused_before_anything_moves() {
    // A hexapod's rig file, a hexapod's address.
    let on = OnArm::new();
    let url = on.arm.url();
    let error = connect(&url, &Geometry::thesis()).err().unwrap().to_string();
    assert!(error.contains("[platform.arm]"), "{error}");
    let error = connect("gcs://127.0.0.1:1", &on.geometry).err().unwrap().to_string();
    assert!(error.contains("describes an arm") && error.contains("ur://"), "{error}");
    // Another client has the registers.
    let first = on.connect();
    let error = connect(&url, &on.geometry).err().unwrap().to_string();
    assert!(error.contains("in use by another program"), "{error}");
    drop(first);
    std::thread::sleep(Duration::from_millis(100));
    // Another program runs.
    let mut line = TcpStream::connect(on.arm.addresses()[1]).unwrap();
    std::io::Write::write_all(&mut line, b"def other():\n  while True:\n    sync()\n  end\nend\n").unwrap();
    std::thread::sleep(Duration::from_millis(200));
    let mut platform = on.connect();
    assert!(platform.found()[0].contains("a program runs on it"), "{:?}", platform.found());
    platform.load(&swing(3.0)).unwrap();
    let error = platform.approach(&|| true).unwrap_err().to_string();
    assert!(error.contains("it is not this one's"), "{error}");
    // In local mode it takes programs and does not run them.
    let local = OnArm::new();
    local.arm.happens(Incident::Local);
    let mut platform = local.connect();
    platform.load(&swing(3.0)).unwrap();
    let error = platform.approach(&|| true).unwrap_err().to_string();
    assert!(error.contains("remote control"), "{error}");
    // A pressed emergency stop is seen at once.
    local.arm.happens(Incident::Emergency);
    let error = platform.stands().unwrap_err().to_string();
    assert!(error.contains("its emergency stop is pressed"), "{error}");
    for arm in [&on, &local] {
        assert!(arm.arm.rests());
        assert_eq!(arm.arm.joints()[0], rigident_sim::serve::ur::HOME);
    }
    // Another program that takes the place of this one ends the motion.
    let on = OnArm::new();
    let mut platform = on.started(&swing(20.0));
    let begun = Instant::now();
    watch(platform.as_mut(), &mut Vec::new(), || begun.elapsed() > Duration::from_secs(1));
    let mut line = TcpStream::connect(on.arm.addresses()[1]).unwrap();
    std::io::Write::write_all(&mut line, b"def other():\n  while True:\n    sync()\n  end\nend\n").unwrap();
    let (error, _) = broken(&on, platform.as_mut(), Instant::now());
    assert!(error.to_string().contains("another program was started on it"), "{error}");
    assert!(matches!(platform.motion(), Ok(Motion::Done) | Err(_)));
}

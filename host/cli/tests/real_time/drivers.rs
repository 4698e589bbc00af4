//! The drivers by themselves.

use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::time::{Duration, Instant};

use hexapod::{Axis, Geometry, MotionProgram, Segment, SineTerm};
use rigident::device::platform::tracking::compare;
use rigident::device::platform::{Motion, MotionSample, Platform, PlatformError, Stop, connect};
use rigident_sim::rig::MotionState;
use rigident_sim::serve::{Controller, StreamServer};

use super::{PATIENCE, Served, rms_off_path};

pub fn swing(seconds: f64) -> MotionProgram {
    let mut start = Geometry::thesis().home();
    start.position_m[0] += 0.01;
    let term = |axis, amplitude, frequency_hz| SineTerm { axis, amplitude, frequency_hz, phase_rad: 0.4 };
    MotionProgram {
        start,
        segments: vec![Segment::Multisine {
            duration_s: seconds,
            ramp_s: 1.0,
            terms: vec![
                term(Axis::Z, 0.02, 0.8),
                term(Axis::Roll, 0.12, 0.6),
                term(Axis::Pitch, 0.1, 0.9),
                term(Axis::Yaw, 0.1, 0.5),
            ],
        }],
    }
}

pub fn ready(served: &Served, address: &str, program: &MotionProgram) -> Box<dyn Platform> {
    let mut platform = connect(address, &Geometry::thesis()).unwrap();
    platform.load(program).unwrap();
    assert_ne!(served.rig.lock().unwrap().motion(), MotionState::Moving, "loading moves nothing");
    platform.approach(&|| true).unwrap();
    platform
}

pub fn watch(platform: &mut dyn Platform, samples: &mut Vec<MotionSample>, mut until: impl FnMut() -> bool) {
    let deadline = Instant::now() + PATIENCE;
    while platform.motion().unwrap() == Motion::Moving && !until() {
        assert!(Instant::now() < deadline);
        samples.extend(platform.samples());
        std::thread::sleep(Duration::from_millis(10));
    }
    samples.extend(platform.samples());
}

#[test]
fn a_hexapod_follows_the_path_of_a_program_over_network_and_line() {
    let served = Served::new();
    let name = served.path("hexapod");
    let line = served.hexapod.as_ref().unwrap().open_port(Some(&name)).unwrap();
    for address in [served.address(), format!("gcs://{}", name.display())] {
        let program = swing(4.0);
        let mut platform = ready(&served, &address, &program);
        platform.start().unwrap();
        let mut samples = Vec::new();
        watch(platform.as_mut(), &mut samples, || false);
        assert_eq!(platform.motion().unwrap(), Motion::Done);
        let trajectory = program.trajectory().unwrap();
        assert!(compare(&trajectory, &samples).unwrap().samples > 40);
        // Its resolution is far below; chords of a controller that got set points late come on top.
        let poses: Vec<_> = samples.iter().filter_map(|sample| sample.measured).collect();
        let off = rms_off_path(&trajectory, &poses);
        assert!(off < 1e-3, "{address}: {off} m off the path");
        let rest = served.rig.lock().unwrap().pose();
        let end = program.trajectory().unwrap().end_pose();
        for i in 0..3 {
            assert!((rest.position_m[i] - end.position_m[i]).abs() < 1e-8);
            assert!((rest.rpy_rad[i] - end.rpy_rad[i]).abs() < 1e-7);
        }
    }
    drop(line);
}

#[test]
fn a_stop_in_the_middle_brings_it_to_rest_and_the_next_program_can_be_driven() {
    let served = Served::new();
    let mut platform = ready(&served, &served.address(), &swing(30.0));
    platform.start().unwrap();
    let begun = Instant::now();
    watch(platform.as_mut(), &mut Vec::new(), || begun.elapsed() > Duration::from_secs(2));
    platform.stop(Stop::Alarm).unwrap();
    watch(platform.as_mut(), &mut Vec::new(), || false);
    assert_eq!(served.rig.lock().unwrap().motion(), MotionState::Done);
    assert!(begun.elapsed() < Duration::from_secs(29), "it was not waited for the program's end");
    platform.load(&swing(2.0)).unwrap();
    platform.approach(&|| true).unwrap();
    platform.start().unwrap();
    watch(platform.as_mut(), &mut Vec::new(), || false);
}

/// Half the way that the rate would take it in 0.35 s, behind the points that it has: on the path, and no
/// error.
#[test]
fn a_planned_end_goes_to_rest_on_the_path() {
    let served = Served::new();
    let program = swing(30.0);
    let mut platform = ready(&served, &served.address(), &program);
    platform.start().unwrap();
    let begun = Instant::now();
    watch(platform.as_mut(), &mut Vec::new(), || begun.elapsed() > Duration::from_secs(2));
    platform.stop(Stop::Planned).unwrap();
    let stopped = Instant::now();
    let mut poses = Vec::new();
    watch(platform.as_mut(), &mut Vec::new(), || {
        poses.push(served.rig.lock().unwrap().pose());
        false
    });
    assert_eq!(platform.motion(), Ok(Motion::Done));
    assert!(stopped.elapsed() < Duration::from_secs(3), "{:?}", stopped.elapsed());
    let off = rms_off_path(&program.trajectory().unwrap(), &poses);
    assert!(off < 1e-3, "{off} m off the path");
}

#[test]
fn unreachable_motions_are_refused_before_anything_moves_with_the_axis_named() {
    let served = Served::new();
    let mut platform = connect(&served.address(), &Geometry::thesis()).unwrap();
    let mut far = Geometry::thesis().home();
    far.position_m[2] += 0.4;
    let program = MotionProgram {
        start: Geometry::thesis().home(),
        segments: vec![Segment::Move { to: far, duration_s: 9.0 }],
    };
    let said = platform.load(&program).unwrap_err().to_string();
    assert!(said.contains("Z = ") && said.contains("t = ") && said.contains("mm"), "{said}");
    // Inside each axis' travel, and out of reach together.
    let mut corner = Geometry::thesis().home();
    (corner.position_m[0], corner.position_m[2], corner.rpy_rad[0]) = (0.2, corner.position_m[2] + 0.08, 0.3);
    let program = MotionProgram {
        start: Geometry::thesis().home(),
        segments: vec![Segment::Move { to: corner, duration_s: 9.0 }],
    };
    let said = platform.load(&program).unwrap_err().to_string();
    assert!(said.contains("VMO?") && said.contains("t = "), "{said}");
    assert_eq!(served.rig.lock().unwrap().motion(), MotionState::Holding);
}

#[test]
fn the_users_stop_on_the_way_to_the_start_is_heeded() {
    let served = Served::new();
    let mut platform = connect(&served.address(), &Geometry::thesis()).unwrap();
    platform.load(&swing(2.0)).unwrap();
    assert_eq!(platform.approach(&|| false), Err(PlatformError::Interrupted));
    let deadline = Instant::now() + PATIENCE;
    while platform.motion().unwrap() != Motion::Holding {
        assert!(Instant::now() < deadline);
    }
}

/// Lines of a controller's answer to a question, as any other client would have it.
fn asked(served: &Served, question: &str) -> String {
    let mut client = TcpStream::connect(served.hexapod.as_ref().unwrap().address()).unwrap();
    client.write_all(format!("{question}\n").as_bytes()).unwrap();
    let mut answer = String::new();
    BufReader::new(client).read_line(&mut answer).unwrap();
    answer.trim().to_owned()
}

const STATE: [&str; 6] =
    ["SPA? X 0x19001900", "SPA? X 0x19001901", "SPA? X 0x19001903", "SCT?", "VLS?", "SVO? X"];

#[test]
fn a_controller_is_left_as_it_was_found_after_an_end_and_after_a_stop() {
    let served = Served::new();
    assert_eq!(asked(&served, "VLS 37\nERR?"), "0");
    let before = STATE.map(|question| asked(&served, question));
    assert!(before[0].ends_with("=0") && before[4] == "37.000000", "{before:?}");
    for stopped in [false, true] {
        let mut platform = ready(&served, &served.address(), &swing(2.5));
        let found = platform.found().join("\n");
        assert!(found.contains("0x19001901 0, 0x19001903 1, SCT T 10"), "{found}");
        assert!(found.contains("single moves 37.000000 mm/s") && found.contains("ZERO"), "{found}");
        assert!(found.contains("a reference move comes first") != stopped, "{found}");
        platform.start().unwrap();
        let begun = Instant::now();
        assert!(asked(&served, STATE[0]).ends_with("=1"), "it is a path meanwhile");
        if stopped {
            watch(platform.as_mut(), &mut Vec::new(), || begun.elapsed() > Duration::from_millis(1200));
        } else {
            watch(platform.as_mut(), &mut Vec::new(), || begun.elapsed() > PATIENCE);
            platform.release().unwrap();
        }
        drop(platform);
        assert_ne!(served.rig.lock().unwrap().motion(), MotionState::Moving);
        assert_eq!(STATE.map(|question| asked(&served, question)), before, "stopped: {stopped}");
        // A single move of another client is taken.
        let moved = asked(&served, "MOV Z 0.5\nERR?");
        assert_eq!(moved, "0", "stopped: {stopped}");
        while served.rig.lock().unwrap().motion() == MotionState::Moving {
            std::thread::sleep(Duration::from_millis(20));
        }
    }
    // Servos that were off are left on: they hold the load where it is.
    // The client that moved it went away, which stopped it: that error is read first.
    asked(&served, "ERR?");
    assert_eq!(asked(&served, "SVO X 0 Y 0 Z 0 U 0 V 0 W 0\nERR?"), "0");
    let platform = ready(&served, &served.address(), &swing(2.5));
    assert!(platform.found().iter().any(|found| found.contains("servos are off")));
    assert_eq!(asked(&served, "SVO? X"), "X=1");
    drop(platform);
    assert_eq!(asked(&served, "SVO? X"), "X=1");
    // As a program that was killed would leave it.
    asked(&served, "SPA X 0x19001900 1\nERR?");
    let platform = connect(&served.address(), &Geometry::thesis()).unwrap();
    assert!(platform.found()[0].contains("0x19001900 = 1"), "{:?}", platform.found());
}

#[test]
fn a_pivot_or_a_frame_of_the_controllers_own_is_refused_before_anything_moves() {
    let served = Served::new();
    let refused = |setting: &str| {
        assert_eq!(asked(&served, &format!("{setting}\nERR?")), "0");
        let Err(error) = connect(&served.address(), &Geometry::thesis()) else { panic!("{setting}") };
        error.to_string()
    };
    let said = refused("SPI T 12.5");
    assert!(said.contains("pivot point is at T = 12.5 mm") && said.contains("SPI R 0 S 0 T 0"), "{said}");
    assert_eq!(asked(&served, "SPI T 0\nERR?"), "0");
    let said = refused("KSD MINE Z 30\nKEN MINE");
    assert!(said.contains("coordinate system MINE") && said.contains("KEN ZERO"), "{said}");
    assert_eq!(asked(&served, "KEN ZERO\nERR?"), "0");
    connect(&served.address(), &Geometry::thesis()).unwrap();
    assert_eq!(served.rig.lock().unwrap().motion(), MotionState::Holding);
}

/// The controller puts the way to the start before a program; here it is driven by itself.
#[test]
fn the_way_to_the_start_is_no_part_of_the_program() {
    let served = Served::new();
    let controller = Controller::listen("127.0.0.1:0", Arc::clone(&served.rig)).unwrap();
    let address = format!("tcp://{}", controller.address());
    let program = swing(3.0);
    let mut platform = ready(&served, &address, &program);
    let at = served.rig.lock().unwrap().pose();
    assert!((at.position_m[0] - program.start.position_m[0]).abs() < 1e-9, "{at:?}");
    assert_ne!(served.rig.lock().unwrap().motion(), MotionState::Moving);
    platform.start().unwrap();
    let (begun, mut samples) = (Instant::now(), Vec::new());
    watch(platform.as_mut(), &mut samples, || begun.elapsed() > PATIENCE);
    let times: Vec<f64> = samples.iter().map(|sample| sample.time_s).collect();
    let [first, last] = [times.first(), times.last()].map(|time| *time.unwrap());
    assert!((0.0..1.0).contains(&first) && last <= program.duration_s() + 1e-6, "{first} {last}");
    let tracked = compare(&program.trajectory().unwrap(), &samples).unwrap();
    assert!(tracked.largest_m < 1e-6 && tracked.largest_rad < 1e-6, "{tracked:?}");

    // Asked to stop on the way.
    let elsewhere = MotionProgram { start: Geometry::thesis().home(), segments: Vec::new() };
    platform.load(&elsewhere).unwrap();
    assert_eq!(platform.approach(&|| false), Err(PlatformError::Interrupted));
}

#[test]
fn a_platform_that_nobody_watches_is_stopped() {
    let served = Served::new();
    let mut platform = ready(&served, &served.address(), &swing(30.0));
    platform.start().unwrap();
    std::thread::sleep(Duration::from_millis(2900));
    assert_ne!(served.rig.lock().unwrap().motion(), MotionState::Moving);
    assert!(matches!(platform.motion(), Err(PlatformError::Unwatched(_))));
    assert_eq!(platform.motion(), Ok(Motion::Done));
}

#[test]
fn a_controller_lost_in_mid_motion_is_named_with_the_command_and_the_plate_stops() {
    let mut served = Served::new();
    let mut platform = ready(&served, &served.address(), &swing(30.0));
    platform.start().unwrap();
    let begun = Instant::now();
    watch(platform.as_mut(), &mut Vec::new(), || begun.elapsed() > Duration::from_millis(1500));
    drop(served.hexapod.take());
    let deadline = Instant::now() + PATIENCE;
    let said = loop {
        match platform.motion() {
            Err(error) => break error.to_string(),
            Ok(_) => assert!(Instant::now() < deadline),
        }
    };
    assert!(said.contains("was lost at the command "), "{said}");
    while served.rig.lock().unwrap().motion() == MotionState::Moving {
        assert!(Instant::now() < deadline);
    }
}

#[test]
fn a_refusal_in_mid_motion_is_reported_in_words_and_the_plate_is_seen_at_rest() {
    let served = Served::new();
    let mut platform = ready(&served, &served.address(), &swing(30.0));
    platform.start().unwrap();
    let begun = Instant::now();
    watch(platform.as_mut(), &mut Vec::new(), || begun.elapsed() > Duration::from_millis(1500));
    // Somebody else stops it at the controller.
    let mut other = std::net::TcpStream::connect(served.hexapod.as_ref().unwrap().address()).unwrap();
    std::io::Write::write_all(&mut other, b"STP\n").unwrap();
    let deadline = Instant::now() + PATIENCE;
    let error = loop {
        match platform.motion() {
            Err(error) => break error,
            Ok(_) => assert!(Instant::now() < deadline),
        }
    };
    let said = error.to_string();
    assert!(
        said.contains("error 10, the controller was stopped") || said.contains("error 220, the set points"),
        "{said}"
    );
    assert!(said.contains("MOV X "), "{said}");
    while platform.motion() == Ok(Motion::Moving) {
        assert!(Instant::now() < deadline);
    }
    assert_eq!(platform.motion(), Ok(Motion::Done));
    assert_eq!(served.rig.lock().unwrap().motion(), MotionState::Done);
}

#[test]
fn lines_of_poses_and_legs_are_followed_by_connection_datagram_and_serial_line() {
    let served = Served::new();
    let said = std::sync::Arc::new(std::sync::Mutex::new(Vec::new()));
    let heard = std::sync::Arc::clone(&said);
    let mut lines = StreamServer::listen("127.0.0.1:0", std::sync::Arc::clone(&served.rig), move |s| {
        heard.lock().unwrap().push(s.to_owned());
    })
    .unwrap();
    let serial = served.path("lines");
    lines.open_port(&serial).unwrap();
    let at = lines.address();
    // There and back: each stream begins with the plate at home.
    let home = Geometry::thesis().home();
    let mut program = swing(2.0);
    program.start = home;
    let mut up = home;
    up.position_m[2] += 0.02;
    program.segments.insert(0, Segment::Move { to: up, duration_s: 1.0 });
    program.segments.push(Segment::Move { to: home, duration_s: 1.0 });
    let trajectory = program.trajectory().unwrap();
    for address in [
        format!("pose+tcp://{at}?lead_s=1"),
        format!("legs+udp://{at}?lead_s=1"),
        format!("pose+serial://{}?lead_s=1", serial.display()),
        format!("legs+tcp://{at}?rate_hz=200&lead_s=1"),
    ] {
        let mut platform = ready(&served, &address, &program);
        platform.start().unwrap();
        let mut farthest: f64 = 0.0;
        let mut samples = Vec::new();
        watch(platform.as_mut(), &mut samples, || {
            let pose = served.rig.lock().unwrap().pose();
            farthest = farthest.max(pose.rpy_rad[0].abs());
            false
        });
        let deadline = Instant::now() + PATIENCE;
        while served.rig.lock().unwrap().motion() == MotionState::Moving {
            assert!(Instant::now() < deadline);
        }
        assert_eq!(*said.lock().unwrap(), [""; 0], "{address}");
        assert!(farthest > 0.05, "{address}: {farthest}");
        assert!(samples.iter().all(|s| s.measured.is_none()) && samples.len() > 40);
        let (rest, end) = (served.rig.lock().unwrap().pose(), trajectory.end_pose());
        for i in 0..3 {
            // Nine decimals of a metre, through the legs' geometry.
            assert!((rest.position_m[i] - end.position_m[i]).abs() < 1e-7, "{address}: {rest:?}");
            assert!((rest.rpy_rad[i] - end.rpy_rad[i]).abs() < 1e-6, "{address}: {rest:?}");
        }
    }
}

#[test]
fn a_stream_is_led_to_rest_on_its_path_and_one_that_begins_elsewhere_or_is_garbage_moves_nothing() {
    let served = Served::new();
    let said = std::sync::Arc::new(std::sync::Mutex::new(Vec::new()));
    let heard = std::sync::Arc::clone(&said);
    let lines = StreamServer::listen("127.0.0.1:0", std::sync::Arc::clone(&served.rig), move |s| {
        heard.lock().unwrap().push(s.to_owned());
    })
    .unwrap();
    let home = served.rig.lock().unwrap().pose();
    let mut line = std::net::TcpStream::connect(lines.address()).unwrap();
    let garbage = b"0.01,0.3,0,0.734,1,0,0,0\n\xff\xfe,1\nnan,1,2\n0.1,1,2,3\n0.2,9,9,9,9,9,9\n,,,,\n0.3,0,0,0.7,3,0,0,0\n";
    std::io::Write::write_all(&mut line, garbage).unwrap();
    let deadline = Instant::now() + PATIENCE;
    while said.lock().unwrap().len() < 7 {
        assert!(Instant::now() < deadline, "{:?}", said.lock().unwrap());
    }
    assert!(said.lock().unwrap()[0].contains("from the pose of the plate"));
    assert_eq!(served.rig.lock().unwrap().pose(), home);

    let mut platform = ready(&served, &format!("pose+tcp://{}", lines.address()), &swing(30.0));
    platform.start().unwrap();
    let begun = Instant::now();
    watch(platform.as_mut(), &mut Vec::new(), || begun.elapsed() > Duration::from_secs(3));
    platform.stop(Stop::Alarm).unwrap();
    watch(platform.as_mut(), &mut Vec::new(), || false);
    while served.rig.lock().unwrap().motion() == MotionState::Moving {
        assert!(Instant::now() < deadline);
    }
    assert!(begun.elapsed() < Duration::from_secs(29), "it was not waited for the program's end");
    assert_eq!(said.lock().unwrap().len(), 7, "{:?}", said.lock().unwrap());
}

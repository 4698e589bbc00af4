//! Lines of set points: one stream after the other, and what becomes of the plate when something goes wrong.

use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hexapod::{Geometry, MotionProgram, Pose, Segment};
use rigident::device::platform::{Motion, Platform, PlatformError, Stop, connect};
use rigident_sim::rig::MotionState;
use rigident_sim::serve::{Controller, StreamServer};

use super::drivers::{ready, swing, watch};
use super::{PATIENCE, Served};

/// Ends 20 mm above home and rolled by 0.2 rad.
fn leaning() -> MotionProgram {
    let home = Geometry::thesis().home();
    let mut up = home;
    (up.position_m[2], up.rpy_rad[0]) = (home.position_m[2] + 0.02, 0.2);
    MotionProgram { start: home, segments: vec![Segment::Move { to: up, duration_s: 1.5 }] }
}

fn apart(a: &Pose, b: &Pose) -> f64 {
    (0..3).fold(0.0, |m: f64, i| {
        m.max((a.position_m[i] - b.position_m[i]).abs()).max((a.rpy_rad[i] - b.rpy_rad[i]).abs())
    })
}

fn drive(platform: &mut dyn Platform) {
    platform.start().unwrap();
    watch(platform, &mut Vec::new(), || false);
    assert_eq!(platform.motion(), Ok(Motion::Done));
}

#[test]
fn streams_follow_each_other_without_a_jump_and_the_last_leads_home() {
    let served = Served::new();
    let said = Arc::new(Mutex::new(Vec::new()));
    let heard = Arc::clone(&said);
    let server = StreamServer::listen("127.0.0.1:0", Arc::clone(&served.rig), move |s| {
        heard.lock().unwrap().push(s.to_owned());
    })
    .unwrap();
    let home = Geometry::thesis().home();
    let at = || served.rig.lock().unwrap().pose();
    for scheme in ["pose+tcp", "legs+udp"] {
        let mut platform = ready(&served, &format!("{scheme}://{}?lead_s=1", server.address()), &leaning());
        assert_eq!(platform.expects(), Some(home));
        drive(platform.as_mut());
        let end = leaning().trajectory().unwrap().end_pose();
        assert!(apart(&at(), &end) < 1e-6, "{scheme}: {:?}", at());
        // Another over the same connection: from where the plate is.
        let mut back = leaning();
        (back.start, back.segments) = (end, vec![Segment::Move { to: swing(1.0).start, duration_s: 1.0 }]);
        platform.load(&back).unwrap();
        drive(platform.as_mut());
        platform.go_home().unwrap();
        watch(platform.as_mut(), &mut Vec::new(), || false);
        assert!(apart(&at(), &home) < 1e-6, "{scheme}: {:?}", at());
        assert!(apart(&platform.expects().unwrap(), &home) < 1e-6);
        assert_eq!(*said.lock().unwrap(), [""; 0], "{scheme}");
    }
}

#[test]
fn a_motion_that_someone_else_ends_is_no_end() {
    let served = Served::new();
    let controller = Controller::listen("127.0.0.1:0", Arc::clone(&served.rig)).unwrap();
    let address = format!("tcp://{}", controller.address());
    let mut platform = ready(&served, &address, &swing(30.0));
    platform.start().unwrap();
    let begun = Instant::now();
    watch(platform.as_mut(), &mut Vec::new(), || begun.elapsed() > Duration::from_millis(1200));
    connect(&address, &Geometry::thesis()).unwrap().stop(Stop::Alarm).unwrap();
    let deadline = Instant::now() + PATIENCE;
    let error = loop {
        match platform.motion() {
            Err(error) => break error,
            Ok(motion) => assert!(motion == Motion::Moving && Instant::now() < deadline),
        }
    };
    assert!(matches!(error, PlatformError::Cut { at_s, of_s } if at_s < 5.0 && of_s > 29.0), "{error}");
    // Once asked, it is at rest; and a stop from here is no error.
    platform.stop(Stop::Alarm).unwrap();
    assert_eq!(platform.motion(), Ok(Motion::Done));
    platform.load(&swing(3.0)).unwrap();
    platform.start().unwrap();
    std::thread::sleep(Duration::from_millis(500));
    platform.stop(Stop::Alarm).unwrap();
    watch(platform.as_mut(), &mut Vec::new(), || false);
    assert_eq!(platform.motion(), Ok(Motion::Done));
}

#[test]
fn a_program_loaded_meanwhile_by_another_client_is_not_driven() {
    let served = Served::new();
    let controller = Controller::listen("127.0.0.1:0", Arc::clone(&served.rig)).unwrap();
    let address = format!("tcp://{}", controller.address());
    let mut platform = ready(&served, &address, &swing(20.0));
    connect(&address, &Geometry::thesis()).unwrap().load(&swing(30.0)).unwrap();
    let said = platform.start().unwrap_err().to_string();
    assert!(said.contains("another motion"), "{said}");
    let deadline = Instant::now() + PATIENCE;
    while platform.motion() != Ok(Motion::Done) {
        assert!(Instant::now() < deadline);
    }
    assert!(served.rig.lock().unwrap().program_time_s() < 5.0);
}

#[test]
fn stray_lines_do_not_stop_a_motion_of_another_client() {
    let served = Served::new();
    let server = StreamServer::listen("127.0.0.1:0", Arc::clone(&served.rig), |_| {}).unwrap();
    let controller = Controller::listen("127.0.0.1:0", Arc::clone(&served.rig)).unwrap();
    let stray = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let disturb = |begun: Instant| {
        let line = format!("{:.3},0.3,0,0.734,1,0,0,0\n", begun.elapsed().as_secs_f64());
        stray.send_to(line.as_bytes(), server.address()).unwrap();
        false
    };
    for address in [
        format!("tcp://{}", controller.address()),
        format!("pose+udp://{}?lead_s=1", server.address()),
        format!("gcs://{}", served.hexapod.as_ref().unwrap().address()),
    ] {
        let mut platform = ready(&served, &address, &swing(2.0));
        platform.start().unwrap();
        let begun = Instant::now();
        let mut reached: f64 = 0.0;
        watch(platform.as_mut(), &mut Vec::new(), || {
            reached = reached.max(served.rig.lock().unwrap().pose().rpy_rad[0].abs());
            begun.elapsed() > Duration::from_millis(300) && disturb(begun)
        });
        assert_eq!(platform.motion(), Ok(Motion::Done), "{address}");
        assert!(reached > 0.05, "{address}: {reached}");
        platform.go_home().unwrap();
        watch(platform.as_mut(), &mut Vec::new(), || false);
    }
}

/// A controller that keeps every line it gets, until `enough` or the end.
fn listener(enough: usize) -> (String, JoinHandle<Vec<Vec<f64>>>) {
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("legs+tcp://{}", server.local_addr().unwrap());
    let lines = std::thread::spawn(move || {
        let (stream, _) = server.accept().unwrap();
        let lines = BufReader::new(stream).lines().map_while(Result::ok).take(enough);
        lines.map(|line| line.split(',').map(|n| n.parse().unwrap()).collect()).collect()
    });
    (address, lines)
}

#[test]
fn a_stream_that_nobody_watches_is_led_to_rest_on_its_path_and_known_to_be_at_rest() {
    let (address, lines) = listener(usize::MAX);
    // On a busy machine lines are late without more of a lead.
    let mut platform = connect(&format!("{address}?lead_s=0.5"), &Geometry::thesis()).unwrap();
    platform.load(&swing(30.0)).unwrap();
    platform.approach(&|| true).unwrap();
    platform.start().unwrap();
    std::thread::sleep(Duration::from_millis(4000));
    assert!(matches!(platform.motion(), Err(PlatformError::Unwatched(_))));
    assert_eq!(platform.motion(), Ok(Motion::Done));
    drop(platform);
    let lines = lines.join().unwrap();
    let speed = |i: usize| (lines[i + 1][1] - lines[i][1]) / 0.01;
    let speeds: Vec<f64> = (0..lines.len() - 1).map(speed).collect();
    let fastest = speeds.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    assert!(fastest > 0.01, "it moved: {fastest}");
    assert!(speeds[speeds.len() - 15..].iter().all(|v| *v == 0.0), "it is led to rest");
    // From full speed within half a second by the quintic, whose slope is 1.875 at most; as much again for
    // the path itself.
    let steepest = speeds.windows(2).fold(0.0_f64, |m, v| m.max((v[1] - v[0]).abs() / 0.01));
    assert!(steepest < 2.0 * 1.875 * fastest / 0.5, "without a jump: {steepest} of {fastest}");
}

#[test]
fn after_a_broken_line_nobody_claims_to_know_whether_the_plate_moves() {
    // The way to the start is some seventy lines.
    let (address, lines) = listener(140);
    let mut platform = connect(&address, &Geometry::thesis()).unwrap();
    platform.load(&swing(30.0)).unwrap();
    platform.approach(&|| true).unwrap();
    platform.start().unwrap();
    let deadline = Instant::now() + PATIENCE;
    let mut errors = Vec::new();
    while errors.len() < 2 {
        assert!(Instant::now() < deadline);
        errors.extend(platform.motion().err().map(|e| e.to_string()));
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(errors[0].contains("was lost at the command 0."), "{errors:?}");
    assert!(errors[1].contains("does not say where the plate is"), "{errors:?}");
    assert_eq!(lines.join().unwrap().len(), 140);
}

#[test]
fn a_program_longer_than_the_controller_takes_is_bad_input_and_not_sent() {
    let served = Served::new();
    let controller = Controller::listen("127.0.0.1:0", Arc::clone(&served.rig)).unwrap();
    let mut platform = connect(&format!("tcp://{}", controller.address()), &Geometry::thesis()).unwrap();
    let segments = vec![Segment::Hold { duration_s: 0.01 }; 40_000];
    let program = MotionProgram { start: Geometry::thesis().home(), segments };
    let error = platform.load(&program).unwrap_err();
    assert!(matches!(error, PlatformError::TooLong { .. }), "{error}");
    assert!(error.to_string().contains("fewer segments"), "{error}");
    platform.load(&swing(3.0)).unwrap();
    assert_eq!(served.rig.lock().unwrap().motion(), MotionState::Holding);
}

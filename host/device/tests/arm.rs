//! The driver of arms of Universal Robots with the simulated controller, in real time: a program of its own,
//! so that no other test takes the processor from the simulated clock.
#![cfg(feature = "emulator")]

use std::io::Write;
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use hexapod::{Arm, Axis, Geometry, Hinge, MotionProgram, Mounting, Pose, Segment, SineTerm};
use rigident_device::platform::tracking::compare;
use rigident_device::platform::{Motion, MotionSample, Platform, PlatformError, Stop, connect};
use rigident_sim::rig::{BusEvent, Rig, SharedRig};
use rigident_sim::serve::ur::{self, Incident, UrServer};

const PATIENCE: Duration = Duration::from_secs(20);

/// `a`, `d` (m) and `alpha` (rad) of each joint, as Universal Robots publishes them for the UR5.
const UR5: [[f64; 3]; 6] = [
    [0.0, 0.089_159, std::f64::consts::FRAC_PI_2],
    [-0.425, 0.0, 0.0],
    [-0.392_25, 0.0, 0.0],
    [0.0, 0.109_15, std::f64::consts::FRAC_PI_2],
    [0.0, 0.094_65, -std::f64::consts::FRAC_PI_2],
    [0.0, 0.0823, 0.0],
];

/// Returns the fixed part of a joint, which comes after its turn.
fn after([a, d, alpha]: [f64; 3]) -> Mounting {
    let (s, c) = (0.5 * alpha).sin_cos();
    Mounting { position_m: [a, 0.0, d], rotation_wxyz: [c, s, 0.0, 0.0] }
}

fn geometry() -> Geometry {
    let hinge = |i: usize| Hinge {
        name: format!("joint {}", i + 1),
        place: if i == 0 { Mounting::IDENTITY } else { after(UR5[i - 1]) },
        axis: [0.0, 0.0, 1.0],
        range_rad: [-6.2, 6.2],
        rate_radps: ur::RATE_RADPS,
        acceleration_radps2: ur::ACCELERATION_RADPS2,
    };
    let arm = Arm {
        hinges: std::array::from_fn(hinge),
        flange: after(UR5[5]),
        home_rad: ur::HOME,
        payload_kg: Some(ur::PAYLOAD_KG),
    };
    Geometry::of_arm(arm, ur::travel())
}

/// A rig on an arm, whose clock is this machine's.
struct OnArm {
    // Its controller goes before the rig.
    arm: UrServer,
    rig: SharedRig,
    leave: Arc<AtomicBool>,
    said: Arc<Mutex<String>>,
}

impl OnArm {
    fn new() -> Self {
        let rig = Rig::new(ur::rig()).unwrap().shared();
        let (leave, said) = (Arc::new(AtomicBool::new(false)), Arc::new(Mutex::new(String::new())));
        let (shared, stop) = (Arc::clone(&rig), Arc::clone(&leave));
        std::thread::spawn(move || {
            let begun = Instant::now();
            while !stop.load(Ordering::Acquire) {
                let now_ns = begun.elapsed().as_nanos() as u64;
                while shared.lock().unwrap().next_event_before(now_ns) != BusEvent::Idle {}
                std::thread::sleep(Duration::from_millis(1));
            }
        });
        let heard = Arc::clone(&said);
        let report = move |words: &str| heard.lock().unwrap().push_str(&format!("{words}\n"));
        let arm = UrServer::listen(["127.0.0.1:0", "127.0.0.1:0"], Arc::clone(&rig), report).unwrap();
        Self { arm, rig, leave, said }
    }

    fn connect(&self) -> Box<dyn Platform> {
        connect(&self.arm.url(), &geometry()).unwrap()
    }

    /// Returns a driver under way with a program.
    fn started(&self, program: &MotionProgram) -> Box<dyn Platform> {
        let mut platform = self.connect();
        platform.load(program).unwrap();
        assert!(self.arm.rests(), "loading moves nothing");
        platform.approach(&|| true).unwrap_or_else(|e| panic!("{e}\n{}", self.said.lock().unwrap()));
        platform.start().unwrap();
        platform
    }

    /// Sends a program of somebody else.
    fn send(&self, program: &str) {
        let mut line = TcpStream::connect(self.arm.addresses()[1]).unwrap();
        line.write_all(program.as_bytes()).unwrap();
        std::thread::sleep(Duration::from_millis(200));
    }
}

impl Drop for OnArm {
    fn drop(&mut self) {
        self.leave.store(true, Ordering::Release);
    }
}

const OTHER: &str = "def other():\n  while True:\n    sync()\n  end\nend\n";

fn watch(platform: &mut dyn Platform, samples: &mut Vec<MotionSample>, mut until: impl FnMut() -> bool) {
    let deadline = Instant::now() + PATIENCE;
    while platform.motion().unwrap() == Motion::Moving && !until() {
        assert!(Instant::now() < deadline);
        samples.extend(platform.samples());
        std::thread::sleep(Duration::from_millis(10));
    }
    samples.extend(platform.samples());
}

fn swing(seconds: f64) -> MotionProgram {
    let term = |axis, amplitude, frequency_hz| SineTerm { axis, amplitude, frequency_hz, phase_rad: 0.4 };
    MotionProgram {
        start: Pose { position_m: [0.02, 0.0, 0.01], rpy_rad: [0.0; 3] },
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

#[test]
fn an_arm_follows_the_path_of_a_program_and_keeps_its_limits_between_samples() {
    let on = OnArm::new();
    let program = swing(5.0);
    let mut platform = on.started(&program);
    let (mut samples, over) = (Vec::new(), AtomicBool::new(false));
    // Positions and rates in every cycle of the controller, which the driver sees a fifth of.
    let cycles = std::thread::scope(|scope| {
        let looking = scope.spawn(|| {
            let mut cycles: Vec<[[f64; 6]; 2]> = Vec::new();
            while !over.load(Ordering::Relaxed) {
                let now = on.arm.joints();
                if cycles.last() != Some(&now) {
                    cycles.push(now);
                }
                std::thread::sleep(Duration::from_micros(500));
            }
            cycles
        });
        watch(platform.as_mut(), &mut samples, || false);
        over.store(true, Ordering::Relaxed);
        looking.join().unwrap()
    });
    assert_eq!(platform.motion().unwrap(), Motion::Done);
    assert!(on.arm.rests());
    let trajectory = program.trajectory().unwrap();
    let tracking = compare(&trajectory, &samples).unwrap();
    assert!(tracking.samples > 60, "{tracking:?}");
    // The controller's own law is late by its look-ahead of a tenth of a second, and rounds corners.
    assert!(tracking.delay_s < 0.25, "{tracking:?}");
    assert!(tracking.rms_without_delay_m.iter().all(|m| *m < 2e-3), "{tracking:?}");
    assert!(tracking.rms_without_delay_rad.iter().all(|rad| *rad < 0.01), "{tracking:?}");
    let fastest = cycles.iter().flat_map(|[_, rates]| rates).fold(0.0_f64, |most, rate| most.max(rate.abs()));
    assert!(cycles.len() > 400 && fastest > 0.1 && fastest < ur::RATE_RADPS, "{} {fastest}", cycles.len());
    // The law of the controller ends nearer than this.
    let (end, rest) = (trajectory.end_pose(), on.rig.lock().unwrap().pose());
    for (a, b) in end.coordinates().iter().zip(rest.coordinates()) {
        assert!((a - b).abs() < 1e-4, "{end:?} {rest:?}");
    }
    // The next one begins where it is.
    platform.load(&swing(2.0)).unwrap();
    platform.approach(&|| true).unwrap();
    platform.start().unwrap();
    watch(platform.as_mut(), &mut Vec::new(), || false);
}

#[test]
fn a_planned_end_takes_the_points_and_the_slowing_and_an_alarm_nothing_but_its_deceleration() {
    let on = OnArm::new();
    let program = swing(30.0);
    for stop in [Stop::Planned, Stop::Alarm] {
        let mut platform = on.started(&program);
        let begun = Instant::now();
        watch(platform.as_mut(), &mut Vec::new(), || begun.elapsed() > Duration::from_secs(2));
        platform.stop(stop).unwrap();
        let (stopped, mut rested) = (Instant::now(), None);
        watch(platform.as_mut(), &mut Vec::new(), || {
            if on.arm.rests() {
                rested.get_or_insert(stopped.elapsed());
            }
            false
        });
        assert_eq!(platform.motion(), Ok(Motion::Done));
        let rested = rested.unwrap_or_else(|| stopped.elapsed());
        let most = if stop == Stop::Planned { 1500 } else { 400 };
        assert!(rested < Duration::from_millis(most), "{stop:?}: {rested:?}");
    }
}

/// Returns the first error of a motion, and the time that the plate took to rest.
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
fn arms_that_cannot_be_driven_are_refused_before_anything_moves() {
    // A hexapod's rig file, a hexapod's address.
    let on = OnArm::new();
    let url = on.arm.url();
    let error = connect(&url, &Geometry::thesis()).err().unwrap().to_string();
    assert!(error.contains("[platform.arm]"), "{error}");
    let error = connect("gcs://127.0.0.1:1", &geometry()).err().unwrap().to_string();
    assert!(error.contains("describes an arm") && error.contains("ur://"), "{error}");
    // Another client has the registers.
    let first = on.connect();
    let error = connect(&url, &geometry()).err().unwrap().to_string();
    assert!(error.contains("in use by another program"), "{error}");
    drop(first);
    std::thread::sleep(Duration::from_millis(100));
    // Another program runs.
    on.send(OTHER);
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
        assert_eq!(arm.arm.joints()[0], ur::HOME);
    }
    // Another program that takes the place of this one ends the motion.
    let on = OnArm::new();
    let mut platform = on.started(&swing(20.0));
    let begun = Instant::now();
    watch(platform.as_mut(), &mut Vec::new(), || begun.elapsed() > Duration::from_secs(1));
    // Points go on while it is sent.
    let error = std::thread::scope(|scope| {
        scope.spawn(|| on.send(OTHER));
        broken(&on, platform.as_mut(), Instant::now()).0
    });
    assert!(error.to_string().contains("another program was started on it"), "{error}");
    assert!(matches!(platform.motion(), Ok(Motion::Done) | Err(_)));
}

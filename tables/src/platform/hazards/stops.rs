//! The time from an alarm to rest, and the legs' forces in it, by controller and stop: computed and
//! simulated.

use std::fmt::Write as _;

use hexapod::experiment::thesis_program;
use hexapod::{Geometry, Load, MotionProgram};
use rigident::device::platform::{self, Stop, stops};
use rigident_sim::rig::{BusEvent, Rig};

use super::referee::STEP_S;
use super::world::{Fault, World};
use super::{Hexapod, ended, six_points};

/// Instants at which a stop begins.
const INSTANTS: u32 = 4;
/// Points of a stop by the controller without a line: `tcp://`.
const LATEST_S: f64 = 1.5;

/// A controller and a stop: scheme, stop, how it is brought about, and the time that it takes by itself, s.
const CASES: [(&str, &str, Fault, f64); 6] = [
    ("`gcs://`", "planned: led on the path", Fault::Stop(Stop::Planned), 0.35),
    ("`gcs://`", "alarm: `HLT`", Fault::Stop(Stop::Alarm), 0.3),
    ("`gcs://`", "`#24`", Fault::SecondClient("\u{18}"), 0.05),
    ("`pose+tcp://`", "planned: led on the path", Fault::Stop(Stop::Planned), 0.35),
    ("`pose+tcp://`", "alarm: led on the path", Fault::Stop(Stop::Alarm), 0.35),
    ("`pose+tcp://`", "line lost: points cease", Fault::LinkCut, 0.3),
];

/// Returns the built-in machine with 20 kg standing: as point masses, and its default program.
fn machine() -> Hexapod {
    let (points, body) = six_points(20.0, [0.0, 0.0, 0.247], [0.1, 0.1, 0.2]);
    let geometry = Geometry::thesis();
    let program = thesis_program(&geometry, 40.0);
    Hexapod { radius_m: 0.25, geometry, body, points, programs: vec![program] }
}

/// Returns the largest force of the undisturbed program and of the stops, N, and the longest time to rest, s.
fn simulated(hexapod: &Hexapod, program: &MotionProgram, lines: bool, fault: Fault) -> [f64; 3] {
    let mut most = [0.0_f64; 3];
    let duration_s = program.duration_s();
    for k in 0..INSTANTS {
        let at_s = duration_s * (0.55 + 0.4 * f64::from(k) / f64::from(INSTANTS));
        // The plate is at home, where the program begins: there is no way to the start.
        let world = World::new(hexapod.config(), lines, fault, (1, at_s), hexapod.referee());
        let scheme = if lines { "pose+tcp" } else { "gcs" };
        let address = format!("{scheme}://simulated:1");
        let mut platform =
            platform::connect_simulated(&address, &hexapod.geometry, world.wire(), world.clone())
                .expect("a simulated controller");
        platform.load(program).and_then(|()| platform.approach(&|| true)).expect("it is at home");
        platform.start().expect("it begins where it is");
        let _ = ended(platform.as_mut());
        world.passes(1.0);
        let failed_s = world.failed_s().expect("it went wrong");
        world.referee(|referee| {
            let [before, after] = referee.peaks;
            most[0] = most[0].max(before.push_n).max(before.pull_n);
            most[1] = most[1].max(after.push_n).max(after.pull_n);
            most[2] = most[2].max(referee.moved_s - failed_s);
        });
    }
    most
}

/// Returns the largest forces and the longest time to rest as [`simulated`] does, for the rig's own
/// controller, which is stopped without a line.
fn simulated_by_program(hexapod: &Hexapod, program: &MotionProgram) -> [f64; 3] {
    let mut most = [0.0_f64; 3];
    for k in 0..INSTANTS {
        let at_s = program.duration_s() * (0.55 + 0.4 * f64::from(k) / f64::from(INSTANTS));
        let mut rig = Rig::new(hexapod.config()).expect("a simulated rig");
        rig.load_program(program.clone()).and_then(|()| rig.start()).expect("it keeps its limits");
        let mut referee = hexapod.referee();
        let steps = ((at_s + LATEST_S) / STEP_S) as u64;
        for n in 1..=steps {
            let time_s = n as f64 * STEP_S;
            while rig.next_event_before((1e9 * time_s).round() as u64) != BusEvent::Idle {}
            if referee.phase == 0 && time_s >= at_s {
                rig.stop();
                referee.phase = 1;
            }
            referee.sees(time_s, &rig.pose());
        }
        let [before, after] = referee.peaks;
        most[0] = most[0].max(before.push_n).max(before.pull_n);
        most[1] = most[1].max(after.push_n).max(after.pull_n);
        most[2] = most[2].max(referee.moved_s - at_s);
    }
    most
}

/// Makes the table.
///
/// # Panics
/// If a simulated controller refuses the built-in program.
pub fn table() -> String {
    let hexapod = machine();
    let program = hexapod.programs[0].clone();
    let trajectory = program.trajectory().expect("the built-in program");
    let load = Load::body(hexapod.body);
    let computed = |stop_s: f64| {
        stops::stopped(&trajectory, &hexapod.geometry, &load, stop_s).expect("no singular pose").leg_force_n
    };
    let mut text = String::from(
        "| controller | stop | takes by itself, s | from alarm to rest, simulated, s | leg force in the \
         program, N | in the stop, computed, N | in the stop, simulated, N \
         |\n|---|---|---|---|---|---|---|\n",
    );
    let mut row = |scheme: &str, stop: &str, own_s: f64, [before, after, rest_s]: [f64; 3]| {
        let _ = writeln!(
            text,
            "| {scheme} | {stop} | {own_s} | {rest_s:.2} | {before:.0} | {:.0} | {after:.0} |",
            computed(own_s)
        );
    };
    for (scheme, stop, fault, own_s) in CASES {
        row(scheme, stop, own_s, simulated(&hexapod, &program, scheme.contains("pose"), fault));
    }
    row("`tcp://`", "any", 0.5, simulated_by_program(&hexapod, &program));
    text
}

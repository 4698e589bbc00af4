//! Runs of simulated machines in which one thing goes wrong, on a simulated clock, measured by a referee of
//! its own.
//!
//! The drivers are the program's (`gcs://`, `pose+tcp://`), the controllers those of the simulated rig. Time
//! goes on only while somebody waits ([`world`]), so that a run takes milliseconds. What the plate does is
//! measured from its poses alone ([`referee`]).

mod referee;
mod stops;
mod world;

use std::f64::consts::TAU;
use std::fmt::Write as _;

use hexapod::{Axis, BodyParameters, Geometry, Load, MotionProgram, Mounting, Segment, SineTerm};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rigident::device::platform::{self, Motion, Platform, Stop, check};
use rigident::plan::carried;
use rigident_sim::rig::RigConfig;

use referee::{Machine, Peaks, Referee};
pub use stops::table as stops;
use world::{Fault, World};

/// Runs of the table.
const RUNS: u64 = 2000;
/// Share of each limit that programs use at most.
const USED: f64 = 0.9;
/// Programs of each machine.
const PROGRAMS: usize = 2;

/// Radius of the plate's joints, m, and mass of the body, kg.
const MACHINES: [(f64, f64); 5] = [(0.025, 0.5), (0.1, 5.0), (0.25, 20.0), (0.5, 80.0), (1.0, 300.0)];
const KINDS: [&str; 10] = [
    "none",
    "host stalled",
    "link cut",
    "controller late",
    "rounding",
    "buffer empty",
    "error in the reference move",
    "second client",
    "pivot moved",
    "servos off",
];

struct Draws(ChaCha8Rng);

impl Draws {
    fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.unit()
    }

    fn of<T: Copy>(&mut self, all: &[T]) -> T {
        all[(self.unit() * all.len() as f64) as usize]
    }
}

/// Returns six equal points about a centre of mass, two on each axis, kg and m, and the body that they are.
fn six_points(mass_kg: f64, com_m: [f64; 3], away_m: [f64; 3]) -> (Vec<(f64, [f64; 3])>, BodyParameters) {
    let sixth = mass_kg / 6.0;
    let mut points = Vec::new();
    for (k, away) in away_m.into_iter().enumerate() {
        for sign in [-1.0, 1.0] {
            let mut at = com_m;
            at[k] += sign * away;
            points.push((sixth, at));
        }
    }
    let [x, y, z] = away_m.map(|v| 2.0 * sixth * v * v);
    (points, BodyParameters { mass_kg, com_m, inertia_com_kgm2: [y + z, x + z, x + y, 0.0, 0.0, 0.0] })
}

/// A machine with its body and programs that keep its limits.
struct Hexapod {
    /// Radius of the plate's joints.
    radius_m: f64,
    geometry: Geometry,
    body: BodyParameters,
    points: Vec<(f64, [f64; 3])>,
    programs: Vec<MotionProgram>,
}

impl Hexapod {
    /// Returns the built-in machine enlarged; speeds go by the root of the size, forces by the weight.
    fn new(radius_m: f64, mass_kg: f64, draws: &mut Draws) -> Self {
        let scale = radius_m / 0.25;
        let mut geometry = Geometry::thesis();
        for joint in geometry.base_joints_m.iter_mut().chain(&mut geometry.plate_joints_m) {
            joint.iter_mut().for_each(|v| *v *= scale);
        }
        geometry.leg_length_m = geometry.leg_length_m.map(|l| l * scale);
        geometry.leg_rate_mps = 0.5 * scale.sqrt();
        let away = [0.25, 0.35, 0.2].map(|v| v * radius_m);
        let com_m = [0.1 * radius_m, -0.05 * radius_m, 0.3 * radius_m];
        let (points, body) = six_points(mass_kg, com_m, away);
        let load = Load::body(body);
        let still = geometry.peak_leg_forces(&hexapod::Trajectory::resting(&geometry.home()), 1.0, &load);
        let weight = still.expect("home is not singular").into_iter().fold(0.0, f64::max);
        let limits = &mut geometry.limits;
        limits.leg_acceleration_mps2 = Some(6.0);
        limits.leg_jerk_mps3 = Some(3000.0 / scale.sqrt());
        limits.leg_push_n = Some(4.0 * weight);
        limits.leg_pull_n = Some(2.0 * weight);
        limits.leg_buckling_nm2 = Some(4.0 * weight * (0.8 * scale).powi(2));
        let mut hexapod = Self { radius_m, geometry, body, points, programs: Vec::new() };
        while hexapod.programs.len() < PROGRAMS {
            hexapod.programs.extend(hexapod.program(scale, draws));
        }
        hexapod
    }

    /// Returns a motion of all axes, as large as the machine takes it, its stops included, within a share of
    /// the limits.
    fn program(&self, scale: f64, draws: &mut Draws) -> Option<MotionProgram> {
        let inner = self.geometry.within(USED);
        let load = Load::body(self.body);
        let mut start = self.geometry.home();
        if draws.unit() < 0.4 {
            start.position_m[0] += 0.03 * scale;
            start.rpy_rad = [0.1, -0.08, 0.05];
        }
        let axes = [Axis::X, Axis::Y, Axis::Z, Axis::Roll, Axis::Pitch, Axis::Yaw];
        let terms: Vec<SineTerm> = (0..9)
            .map(|k| {
                let frequency_hz = draws.between(0.3, 1.5);
                let largest = if k % 6 < 3 { 0.05 * scale } else { 0.25 };
                let amplitude = largest * draws.between(0.3, 1.0) / (1.0 + frequency_hz);
                SineTerm { axis: axes[k % 6], amplitude, frequency_hz, phase_rad: draws.between(0.0, TAU) }
            })
            .collect();
        let sized = |size: f64| {
            let terms = terms.iter().map(|t| SineTerm { amplitude: size * t.amplitude, ..*t }).collect();
            let motion = Segment::Multisine { duration_s: 3.0, ramp_s: 0.6, terms };
            MotionProgram { start, segments: vec![Segment::Hold { duration_s: 0.3 }, motion] }
        };
        let kept = |size: f64| {
            check::check(&sized(size), &inner, Some(&load)).is_ok_and(|summary| {
                summary.stops.is_some_and(|[led, _]| led.overloads.is_none() && led.too_quick.is_none())
            })
        };
        let (mut inside, mut outside) = (0.0, 2.0);
        for _ in 0..4 {
            let middle = 0.5 * (inside + outside);
            if kept(middle) { inside = middle } else { outside = middle }
        }
        (inside > 0.02).then(|| sized(inside))
    }

    fn config(&self) -> RigConfig {
        RigConfig {
            geometry: self.geometry.clone(),
            body: self.body,
            load_cell: Mounting::IDENTITY,
            ..RigConfig::thesis_horizontal()
        }
    }

    fn referee(&self) -> Referee {
        let machine = Machine {
            base: self.geometry.base_joints_m,
            plate: self.geometry.plate_joints_m,
            points: self.points.clone(),
            gravity: [0.0, 0.0, -9.80665],
        };
        // A ten-thousandth of the highest speed.
        Referee::new(machine, 1e-4 * self.geometry.leg_rate_mps)
    }

    /// Returns the largest shares of the limits: stroke, speed, acceleration, jerk, force.
    fn shares(&self, peaks: &Peaks) -> [f64; 5] {
        let [lo, hi] = self.geometry.leg_length_m;
        let limits = &self.geometry.limits;
        let over = |value: f64, limit: Option<f64>| limit.map_or(0.0, |limit| value / limit);
        if peaks.longest_m == 0.0 {
            return [0.0; 5];
        }
        let (middle, half) = (0.5 * (lo + hi), 0.5 * (hi - lo));
        [
            (peaks.longest_m - middle).max(middle - peaks.shortest_m) / half,
            peaks.rate_mps / self.geometry.leg_rate_mps,
            over(peaks.acceleration_mps2, limits.leg_acceleration_mps2),
            over(peaks.jerk_mps3, limits.leg_jerk_mps3),
            over(peaks.push_n, limits.leg_push_n)
                .max(over(peaks.pull_n, limits.leg_pull_n))
                .max(over(peaks.buckling_nm2, limits.leg_buckling_nm2)),
        ]
    }
}

/// The outcome of one run.
#[derive(Clone, Debug, Default)]
struct Outcome {
    kind: usize,
    refused: bool,
    error: Option<String>,
    /// Time from the fault, or the stall's end, to rest, s.
    rest_s: Option<f64>,
    /// Shares of the limits before and after the fault.
    shares: [[f64; 5]; 2],
    /// Lines are not answered: the driver cannot see that the plate did not follow, only the IMU's guard can.
    unseen: bool,
    /// A statement that was not true.
    untrue: Option<String>,
}

/// The directions of "up" in A, by the place where the base is fastened.
const MOUNTS: [[f64; 3]; 3] = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]];

fn fault(kind: usize, draws: &mut Draws) -> Fault {
    match kind {
        1 => Fault::HostStalled(draws.between(0.05, 5.0)),
        2 => Fault::LinkCut,
        3 => Fault::ControllerLate(draws.between(0.05, 2.0)),
        4 => Fault::Rounding,
        5 => Fault::BufferEmpty(draws.between(0.003, 0.05)),
        6 => Fault::ReferenceError(draws.between(0.05, 0.9)),
        7 => {
            Fault::SecondClient(draws.of(&["HLT\n", "STP\n", "\u{18}", "MOV Z 1\n", "SPA X 0x19001900 0\n"]))
        }
        8 => Fault::PivotMoved(draws.unit() < 0.5),
        9 => Fault::ServoOff,
        _ => Fault::None,
    }
}

/// Does one run, wholly decided by its number.
fn run(machines: &[Hexapod], number: u64) -> Outcome {
    let mut draws = Draws(ChaCha8Rng::seed_from_u64(1000 + number));
    let hexapod = &machines[number as usize % machines.len()];
    let kind = (number as usize / machines.len()) % KINDS.len();
    // Lines know nothing of what only a controller with answers has.
    let lines = [0, 1, 2, 3, 5].contains(&kind) && draws.unit() < 0.4;
    let fault = fault(kind, &mut draws);
    let program = &hexapod.programs[(draws.unit() * hexapod.programs.len() as f64) as usize];
    let mut outcome = Outcome { kind, ..Outcome::default() };
    let mount = if draws.unit() < 0.8 { MOUNTS[0] } else { draws.of(&MOUNTS[1..]) };
    // At rest at home the plate's axes are those of A.
    if carried::off_level_rad(&mount.into(), &hexapod.geometry.home()) >= carried::LEVEL_RAD {
        (outcome.refused, outcome.error) = (true, Some("base not level".to_owned()));
        return outcome;
    }
    let has_way = program.start != hexapod.geometry.home();
    let motion = if has_way && draws.unit() < 0.25 { 1 } else { 1 + usize::from(has_way) };
    let when = (motion, draws.between(0.05, if has_way && motion == 1 { 0.6 } else { 3.0 }));
    let world = World::new(hexapod.config(), lines, fault, when, hexapod.referee());
    let rate_hz = if fault == Fault::Rounding { 300 } else { 100 };
    let address = format!("{}://simulated:1?rate_hz={rate_hz}", if lines { "pose+tcp" } else { "gcs" });
    let result = driven(hexapod, program, &world, &address, fault);
    judge(&mut outcome, hexapod, program, &world, (fault, lines), result);
    outcome
}

/// Drives as `run` does; what was said at the end.
fn driven(
    hexapod: &Hexapod,
    program: &MotionProgram,
    world: &std::sync::Arc<World>,
    address: &str,
    fault: Fault,
) -> Result<(), String> {
    let text = |e: platform::PlatformError| e.to_string();
    let mut platform =
        platform::connect_simulated(address, &hexapod.geometry, world.wire(), world.clone()).map_err(text)?;
    platform.carries(Some(Load::body(hexapod.body)));
    platform.load(program).map_err(text)?;
    if fault == Fault::PivotMoved(false) {
        world.other_says("SPI R 20 S 0 T 0\n");
    }
    platform.approach(&|| true).map_err(text)?;
    if fault == Fault::PivotMoved(true) {
        world.other_says("SPI R 20 S 0 T 0\n");
    }
    platform.start().map_err(text)?;
    let ended = ended(platform.as_mut());
    // As the session does after every error.
    if ended.is_err() {
        let _ = platform.stop(Stop::Alarm);
    }
    let at_rest = platform.motion().is_ok_and(|motion| motion != Motion::Moving);
    match (ended, at_rest) {
        (Ok(()), _) => Ok(()),
        (Err(error), true) => Err(format!("{error}\nThe platform is at rest.")),
        (Err(error), false) => Err(format!("{error}\nThe platform could not be seen at rest.")),
    }
}

fn ended(platform: &mut dyn Platform) -> Result<(), String> {
    loop {
        match platform.motion() {
            Ok(Motion::Moving) => {}
            Ok(_) => return Ok(()),
            Err(error) => return Err(error.to_string()),
        }
    }
}

/// Compares what was said with what the referee saw.
fn judge(
    outcome: &mut Outcome,
    hexapod: &Hexapod,
    program: &MotionProgram,
    world: &World,
    (fault, lines): (Fault, bool),
    result: Result<(), String>,
) {
    let said_at_s = platform::World::now_s(world);
    world.passes(3.0);
    let moved_s = world.referee(|referee| referee.moved_s);
    outcome.shares = world.referee(|referee| referee.peaks.map(|peaks| hexapod.shares(&peaks)));
    let end = program.trajectory().map(|trajectory| trajectory.end_pose());
    let (moves, at) = world.machine();
    let there = end.is_ok_and(|end| {
        let away = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max);
        away(end.position_m, at.position_m) < 1e-3 * hexapod.radius_m && away(end.rpy_rad, at.rpy_rad) < 1e-3
    });
    outcome.refused = result.is_err() && moved_s == 0.0;
    match &result {
        Ok(()) if lines && !moves && !there => outcome.unseen = true,
        Ok(()) if !there || moves => outcome.untrue = Some("said to be done, and is not there".to_owned()),
        Err(error) if error.contains("is at rest") && moved_s > said_at_s + 0.002 => {
            outcome.untrue = Some(format!("said to be at rest {:.2} s before it was", moved_s - said_at_s));
        }
        Err(_) if fault == Fault::None => outcome.untrue = Some("an error without a fault".to_owned()),
        _ => {}
    }
    let stalled_s = if let Fault::HostStalled(s) = fault { s } else { 0.0 };
    if result.is_err() {
        // The controller may have stopped it before the host went on.
        outcome.rest_s = world
            .failed_s()
            .map(|at_s| if moved_s > at_s + stalled_s { moved_s - at_s - stalled_s } else { 0.0 });
    }
    outcome.error = result.err();
}

fn machines() -> Vec<Hexapod> {
    let mut draws = Draws(ChaCha8Rng::seed_from_u64(5));
    MACHINES.iter().map(|&(radius_m, mass_kg)| Hexapod::new(radius_m, mass_kg, &mut draws)).collect()
}

fn outcomes(runs: u64) -> Vec<Outcome> {
    let machines = machines();
    (0..runs)
        .map(|number| {
            let outcome = run(&machines, number);
            if let Some(untrue) = &outcome.untrue {
                eprintln!("hazards {number}: {}: {untrue}: {:?}", KINDS[outcome.kind], outcome.error);
            }
            outcome
        })
        .collect()
}

/// Makes the table.
pub fn table() -> String {
    written(&outcomes(RUNS))
}

fn written(outcomes: &[Outcome]) -> String {
    let mut text = String::from(
        "| fault | runs | refused before it moved | ended | went on to its end | at rest after, s, at most | \
         undisturbed: stroke, speed, acceleration, jerk, force | after the fault | unseen by lines | untrue \
         words |\n|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for (kind, name) in KINDS.iter().enumerate() {
        let all: Vec<&Outcome> = outcomes.iter().filter(|o| o.kind == kind).collect();
        let count = |of: &dyn Fn(&Outcome) -> bool| all.iter().filter(|o| of(o)).count();
        let rest = all.iter().filter(|o| !o.refused).filter_map(|o| o.rest_s).reduce(f64::max);
        let shares = |phase: usize| {
            let most = all
                .iter()
                .fold([0.0_f64; 5], |most, o| std::array::from_fn(|k| most[k].max(o.shares[phase][k])));
            if most[0] == 0.0 { "–".to_owned() } else { most.map(|v| format!("{v:.2}")).join(" ") }
        };
        let _ = writeln!(
            text,
            "| {name} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
            all.len(),
            count(&|o| o.refused),
            count(&|o| !o.refused && o.error.is_some()),
            count(&|o| o.error.is_none()),
            rest.map_or("–".to_owned(), |s| format!("{s:.2}")),
            shares(0),
            shares(1),
            count(&|o| o.unseen),
            count(&|o| o.untrue.is_some())
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first of the table's.
    const RUNS: u64 = 50;
    /// The plate is at rest so soon after a fault that ends the motion, s; after a stall of the host, after
    /// its end.
    const REST_S: f64 = 0.8;

    /// A fixed part of the table's runs: no limit is exceeded before the fault, and stroke and speed never;
    /// words are true, and the plate is at rest in time.
    #[test]
    fn whatever_goes_wrong_limits_are_kept_and_words_are_true() {
        for outcome in outcomes(RUNS) {
            let [before, after] = outcome.shares;
            assert!(before.iter().all(|share| *share <= 1.0), "{outcome:?}");
            assert!(after[..2].iter().all(|share| *share <= 1.0), "{outcome:?}");
            assert_eq!(outcome.untrue, None, "{outcome:?}");
            assert!(outcome.rest_s.is_none_or(|s| s <= REST_S), "{outcome:?}");
        }
    }
}

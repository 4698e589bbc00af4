//! Arms of Universal Robots: RTDE for state and set points, URScript for the program that follows them.
//!
//! Lives here: the line ([`rtde`]), the program on the controller ([`script`]), its states in words
//! ([`states`]), the driver ([`UrPlatform`]). May not live here: when set points are due (`platform::pace`),
//! the arm's kinematics and limits ([`hexapod::Arm`]).
//!
//! The plate is the flange. A motion becomes control points of a joint path, one every [`ARM_STEP_S`]; the
//! limits of the curve between them were checked when it was loaded. The program runs on the controller,
//! reads them from its registers, and brings the arm to rest by itself when they cease: whatever becomes of
//! this machine, it moves no farther than the points that it has.

mod rtde;
mod script;
pub mod states;
#[cfg(test)]
mod tests;

use std::io::Write;
use std::time::Duration;

use hexapod::{ARM_STEP_S, Arm, Geometry, Load, MotionProgram, Pose};

use super::PATIENCE;
use super::clock::Clock;
use super::pace::{Follows, GAP_S, Pace, Sink, Timing};
use super::{Motion, MotionSample, Platform, PlatformError, Said, Stop, Trace, check, tcp, way};
use rtde::{Rtde, State, refused};
use script::{LEAD, Order, status};

/// The port of RTDE and that of programs, where the address does not say.
pub(super) const RTDE_PORT: u16 = 30_004;
/// The port of programs: the secondary client's.
pub(super) const SCRIPT_PORT: u16 = 30_002;
/// The arm is checked this many times a second.
const LOOKS_HZ: f64 = 25.0;
/// A joint at rest is slower than this, rad/s.
const REST_RADPS: f64 = 2e-3;
/// Longest time from sending a program to its running, s.
const BEGINS_S: f64 = 3.0;
/// A controller that is to stop is not waited for longer to take the program for it.
const SOON: Duration = Duration::from_millis(300);
/// Joints that are farther from where the program begins are elsewhere, rad.
const THERE_RAD: f64 = 5e-3;
/// Joints that are farther from the posture of home than their pose has them are in another posture, rad.
const POSTURE_RAD: f64 = 0.02;
/// The distance between where the arm is and where the program begins fades within, s.
const FADE_S: f64 = 1.0;
/// The time that the drop of a moving arm waits for its rest, s.
const REST_S: f64 = 3.0;

/// An arm of Universal Robots.
pub struct UrPlatform {
    geometry: Geometry,
    arm: Arm,
    program: Option<MotionProgram>,
    load: Option<Load>,
    clock: Clock,
    /// Motions so far.
    motions: i32,
    found: State,
    state: Phase,
}

enum Phase {
    Resting(Box<Controller>),
    Moving(Pace<Controller>),
    Gone,
}

/// The controller as set points see it.
struct Controller {
    rtde: Rtde,
    script: (String, u16),
    arm: Arm,
    /// The last positions sent, rad.
    last: [f64; 6],
    /// Positions of the arm before less those where the program begins, rad.
    offset: [f64; 6],
    /// The end of the program once no further point comes.
    end: Order,
}

impl UrPlatform {
    /// Says hello; nothing moves. `ports` are those of RTDE and of programs.
    ///
    /// # Errors
    /// Nobody answers; the controller lacks something; the geometry is not that of an arm.
    pub(super) fn connect(
        address: &str,
        host: &str,
        ports: [u16; 2],
        geometry: &Geometry,
        clock: Clock,
    ) -> Result<Self, PlatformError> {
        let Some(arm) = geometry.arm.clone() else {
            return Err(PlatformError::Refused(
                "ur:// drives an arm, and the rig file describes none: give [platform.arm] with model, \
                 flange, home_rad and acceleration_radps2"
                    .to_owned(),
            ));
        };
        let [port, script] = ports;
        let unreachable = |reason: String| PlatformError::Unreachable { address: address.to_owned(), reason };
        let stream = tcp((host, port), PATIENCE).map_err(|e| unreachable(at_port(port, &e)))?;
        let mut rtde = Rtde::new(stream, address.to_owned(), clock.clone())?;
        let found = rtde.fresh(PATIENCE.as_secs_f64())?;
        let controller = Controller {
            rtde,
            script: (host.to_owned(), script),
            last: found.q,
            offset: [0.0; 6],
            arm: arm.clone(),
            end: Order::Finish,
        };
        Ok(Self {
            geometry: geometry.clone(),
            arm,
            program: None,
            load: None,
            clock,
            // The registers may still hold numbers of another run.
            motions: first_motion(),
            found,
            state: Phase::Resting(Box::new(controller)),
        })
    }

    fn resting(&mut self) -> Result<&mut Controller, PlatformError> {
        if let Phase::Moving(pace) = &self.state {
            if pace.motion()? == Motion::Moving {
                return Err(PlatformError::Refused("it is moving: stop it or wait".to_owned()));
            }
            if let Phase::Moving(pace) = std::mem::replace(&mut self.state, Phase::Gone) {
                let sink = pace.end();
                self.state = sink.map_or(Phase::Gone, |sink| Phase::Resting(Box::new(sink)));
                if let Phase::Resting(controller) = &mut self.state {
                    controller.rtde.pause()?;
                }
            }
        }
        match &mut self.state {
            Phase::Resting(controller) => Ok(controller),
            _ => Err(gone()),
        }
    }

    /// Returns the pose where the arm is at rest, in the posture of home.
    fn here(&mut self) -> Result<Pose, PlatformError> {
        let arm = self.arm.clone();
        let state = self.resting()?.rtde.fresh(1.0)?;
        if state.fastest() > REST_RADPS {
            return Err(PlatformError::Refused("its arm moves, and not by a command from here".to_owned()));
        }
        let pose = arm.pose(&state.q);
        let home = arm.positions(&pose);
        let posture = home.and_then(|home| (0..6).find(|i| (state.q[*i] - home[*i]).abs() > POSTURE_RAD));
        if let Some(i) = posture.or_else(|| home.is_none().then_some(0)) {
            return Err(PlatformError::Refused(format!(
                "its arm is not in the posture that home_rad has: {} is at {:.3} rad, home is at {:.3} rad. \
                 Bring it home by its own program first",
                arm.hinges[i].name, state.q[i], arm.home_rad[i]
            )));
        }
        Ok(pose)
    }
}

/// Returns the number of the first motion. Numbers begin anywhere, so that numbers left in the registers
/// belong to another.
fn first_motion() -> i32 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
    i32::try_from(since.as_millis() % 1_000_000_000).unwrap_or(0) + 1
}

fn gone() -> PlatformError {
    PlatformError::Refused("its connection is gone".to_owned())
}

fn at_port(port: u16, error: &std::io::Error) -> String {
    format!("port {port}: {error}")
}

/// Returns why an arm in this state does not move, if so.
fn hindrance(state: &State) -> Option<&'static str> {
    if !states::is_safe(state.safety_mode) {
        return Some(states::safety(state.safety_mode));
    }
    (state.robot_mode != states::RUNNING).then(|| states::robot(state.robot_mode))
}

impl Drop for UrPlatform {
    fn drop(&mut self) {
        // Whoever wants to know has called it before.
        let _ = self.release();
    }
}

impl Platform for UrPlatform {
    fn found(&self) -> Vec<String> {
        let mut words = vec![format!(
            "an arm: {}, {}; {}",
            states::robot(self.found.robot_mode),
            states::safety(self.found.safety_mode),
            states::program(self.found.runtime_state)
        )];
        if self.found.speed < 0.999 {
            words.push(format!(
                "its speed slider is at {:.0} %: set it to 100 % at its panel, or the motion is ended",
                100.0 * self.found.speed
            ));
        }
        words.push(
            "the payload in its settings must be that of the body, with its centre: else it may make a \
             protective stop"
                .to_owned(),
        );
        words
    }

    fn load(&mut self, program: &MotionProgram) -> Result<(), PlatformError> {
        self.resting()?;
        check::check(program, &self.geometry, self.load.as_ref())?;
        self.program = Some(program.clone());
        Ok(())
    }

    fn way(&mut self, program: &MotionProgram) -> Result<Option<MotionProgram>, PlatformError> {
        let here = self.here()?;
        way::between(&here, &program.start, &self.geometry, self.load.as_ref()).map(Some)
    }

    fn approach(&mut self, go_on: &dyn Fn() -> bool) -> Result<(), PlatformError> {
        let Some(program) = self.program.clone() else {
            return Err(PlatformError::Refused("no motion program is loaded".to_owned()));
        };
        if let Some(way) = self.way(&program)? {
            let clock = self.clock.clone();
            way::drive(self, &way, go_on, &clock)?;
        }
        self.load(&program)
    }

    fn start(&mut self) -> Result<(), PlatformError> {
        let Some(program) = self.program.take() else {
            return Err(PlatformError::Refused("no motion program is loaded".to_owned()));
        };
        let trajectory = program.trajectory()?;
        self.here()?;
        let clock = self.clock.clone();
        self.motions += 1;
        let motion = self.motions;
        let first =
            self.arm.positions(&program.start).ok_or_else(|| refused("it does not reach the start"))?;
        let controller = self.resting()?;
        if let Err(error) = controller.begin(motion, &first, &clock) {
            // Nobody listens.
            let _ = controller.rtde.pause();
            return Err(error);
        }
        let timing =
            Timing { rate_hz: rtde::POINTS_HZ, lead_s: LEAD as f64 * ARM_STEP_S, follows: Follows::Time };
        match std::mem::replace(&mut self.state, Phase::Gone) {
            Phase::Resting(controller) => {
                self.state = Phase::Moving(Pace::begin(*controller, trajectory, timing, LOOKS_HZ, &clock));
                Ok(())
            }
            _ => Err(gone()),
        }
    }

    fn stop(&mut self, stop: Stop) -> Result<(), PlatformError> {
        match &mut self.state {
            Phase::Moving(pace) => {
                pace.stop(stop);
                Ok(())
            }
            Phase::Resting(controller) => {
                let state = controller.rtde.fresh(1.0)?;
                let own = state.is_run_of(controller.rtde.motion);
                if own { controller.halt_abruptly() } else { Ok(()) }
            }
            Phase::Gone => Err(gone()),
        }
    }

    fn motion(&mut self) -> Result<Motion, PlatformError> {
        match &mut self.state {
            Phase::Moving(pace) => pace.motion(),
            Phase::Resting(controller) => {
                let moves = controller.rtde.fresh(1.0)?.fastest() > REST_RADPS;
                Ok(if moves { Motion::Moving } else { Motion::Holding })
            }
            Phase::Gone => Err(gone()),
        }
    }

    fn stands(&mut self) -> Result<Option<Pose>, PlatformError> {
        let state = self.resting()?.rtde.fresh(1.0)?;
        match hindrance(&state) {
            Some(why) => Err(PlatformError::Halted(why.to_owned())),
            None => self.here().map(Some),
        }
    }

    fn carries(&mut self, load: Option<Load>) {
        self.load = load;
    }

    fn trace(&mut self, to: Trace) {
        if let Phase::Resting(controller) = &mut self.state {
            controller.rtde.trace = Some(to);
        }
    }

    fn release(&mut self) -> Result<Vec<String>, PlatformError> {
        if let Phase::Moving(pace) = &self.state
            && pace.motion().is_ok_and(|motion| motion == Motion::Moving)
        {
            pace.stop(Stop::Alarm);
            let begun_s = self.clock.now_s();
            while pace.motion().is_ok_and(|motion| motion == Motion::Moving)
                && self.clock.now_s() - begun_s < REST_S
            {
                self.clock.wait_s(0.02);
            }
        }
        // Nobody listens any more.
        let _ = self.resting();
        Ok(Vec::new())
    }

    fn samples(&mut self) -> Vec<MotionSample> {
        if let Phase::Moving(pace) = &self.state { pace.samples() } else { Vec::new() }
    }
}

impl Controller {
    /// Has the controller run the program, and sees it wait for points. `first` is where the motion begins,
    /// rad.
    fn begin(&mut self, motion: i32, first: &[f64; 6], clock: &Clock) -> Result<(), PlatformError> {
        let state = self.rtde.fresh(1.0)?;
        if let Some(why) = hindrance(&state) {
            return Err(PlatformError::Halted(why.to_owned()));
        }
        if state.runtime_state != states::STOPPED {
            return Err(PlatformError::Refused(format!(
                "{}, and it is not this one's: stop it at its panel, or end the other connection",
                states::program(state.runtime_state)
            )));
        }
        self.offset = std::array::from_fn(|i| state.q[i] - first[i]);
        if let Some(i) = (0..6).find(|i| self.offset[*i].abs() > THERE_RAD) {
            return Err(PlatformError::Refused(format!(
                "its {} is at {:.4} rad, and the motion begins at {:.4} rad",
                self.arm.hinges[i].name, state.q[i], first[i]
            )));
        }
        (self.last, self.end) = (*first, Order::Finish);
        self.rtde.begin(motion);
        self.rtde.run()?;
        self.rtde.order(Order::Follow)?;
        self.send_program(
            "the program that follows set points",
            &script::program(&self.arm, motion),
            PATIENCE,
        )?;
        let begun_s = clock.now_s();
        loop {
            let state = self.rtde.now()?;
            if state.motion == motion && state.status == status::READY {
                self.rtde.note();
                return Ok(());
            }
            if let Some(why) = hindrance(&state) {
                return Err(PlatformError::Halted(why.to_owned()));
            }
            if clock.now_s() - begun_s > BEGINS_S {
                return Err(PlatformError::Refused(format!(
                    "it took the program and did not run it within {BEGINS_S} s: an e-Series must be in \
                     remote control (the symbol at the top right of its panel), and no message may wait \
                     there for an answer"
                )));
            }
            // The program is there when the registers are known to be fed.
            self.rtde.order(Order::Follow)?;
            clock.wait_s(ARM_STEP_S);
        }
    }

    /// Sends a program; the controller runs it in place of any other.
    fn send_program(&mut self, name: &str, text: &str, within: Duration) -> Result<(), PlatformError> {
        let (host, port) = &self.script;
        let unreachable =
            |reason: String| PlatformError::Unreachable { address: format!("ur://{host}"), reason };
        let mut stream = tcp((&**host, *port), within).map_err(|e| unreachable(at_port(*port, &e)))?;
        if let Some(trace) = &self.rtde.trace {
            trace(Said::Command(&format!("port {port}: {name}")));
        }
        stream
            .set_write_timeout(Some(within))
            .and_then(|()| stream.write_all(text.as_bytes()))
            .and_then(|()| stream.flush())
            .map_err(|e| unreachable(e.to_string()))
    }

    /// Returns why the arm does not follow, if so.
    fn fault(&self, state: &State) -> Option<PlatformError> {
        if let Some(why) = hindrance(state) {
            return Some(PlatformError::Halted(why.to_owned()));
        }
        let own = state.motion == self.rtde.motion;
        // Points that ceased at rest are an end, unless more were sent.
        if own && state.reason == script::AT_REST {
            let more = state.used < self.rtde.newest;
            return script::reason(script::CEASED)
                .filter(|_| more)
                .map(|why| PlatformError::Halted(why.to_owned()));
        }
        if let Some(why) = script::reason(state.reason).filter(|_| own) {
            return Some(PlatformError::Halted(why.to_owned()));
        }
        if state.runtime_state != states::PLAYING {
            return Some(PlatformError::Halted(format!(
                "{}: it was stopped at its panel or by another connection",
                states::program(state.runtime_state)
            )));
        }
        (!own || state.status == status::ENDED).then(|| {
            PlatformError::Halted(
                "another program was started on it, in place of the one from here".to_owned(),
            )
        })
    }
}

impl Sink for Controller {
    fn send(&mut self, time_s: f64, pose: &Pose) -> Result<(), PlatformError> {
        let q = self.arm.follow(pose, &self.last).ok_or_else(|| refused("it does not reach a set point"))?;
        self.last = q;
        // The little by which the arm was elsewhere fades.
        let u = (time_s / FADE_S).clamp(0.0, 1.0);
        let left = 1.0 - u * u * u * (10.0 + u * (6.0 * u - 15.0));
        self.rtde.point(&std::array::from_fn(|i| q[i] + left * self.offset[i]))
    }

    fn patience_s(&self) -> f64 {
        // Points go without a time; the program on the controller says when they ceased.
        GAP_S
    }

    fn look(&mut self) -> Result<Option<Pose>, PlatformError> {
        let state = self.rtde.now()?;
        self.rtde.note();
        match self.fault(&state) {
            Some(fault) => Err(fault),
            None => Ok(Some(self.arm.pose(&state.q))),
        }
    }

    fn halt(&mut self) -> Result<bool, PlatformError> {
        self.end = Order::Halt;
        match self.rtde.order(Order::Halt) {
            Ok(()) => Ok(true),
            Err(error) => {
                // The other port may be open; else the program on the controller ends it by itself.
                let _ = self.halt_abruptly();
                Err(error)
            }
        }
    }

    fn halt_abruptly(&mut self) -> Result<(), PlatformError> {
        let text = script::stop(&self.arm);
        self.send_program("the program that stops", &text, SOON)
    }

    fn at_rest(&mut self) -> Result<Option<bool>, PlatformError> {
        let state = self.rtde.now()?;
        self.rtde.note();
        let own = state.is_run_of(self.rtde.motion) && !self.rtde.replaced;
        let follows = own && matches!(state.status, status::READY | status::FOLLOWING | status::STOPPING);
        if follows && state.status != status::STOPPING {
            self.rtde.order(self.end)?;
        }
        Ok(Some(!follows && state.fastest() < REST_RADPS))
    }
}

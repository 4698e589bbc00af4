//! PI hexapods: General Command Set 2.0 over TCP or a serial line.
//!
//! Lives here: the questions and answers (`Line`), the driver ([`GcsPlatform`]), the errors in words. May not
//! live here: when set points are due (`platform::pace`). What is known of the protocol, with its sources, is
//! in
//! [`hexapod::gcs`].
//!
//! A program that ends early by plan is led to rest on its path. For an alarm `HLT` stops it smoothly, and
//! `#24` abruptly if `#5` still shows motion half a second later.
//!
//! A program, and the way to its start, is driven as a path of consecutive `MOV`, one every `1/rate_hz`,
//! buffered by `lead_s`; what that changes is read before and brought back after (`Found`). Before, every
//! hundredth of a second of it is compared with the controller's limits (`TMN?`, `TMX?`), and poses all along
//! it against `VMO?`. The built-in description of the platform must have its home where the hexapod has its
//! zero.

mod errors;
mod found;
mod line;
#[cfg(test)]
mod tests;

pub use errors::words;

use hexapod::gcs::{
    AXES, GcsPosition, HALT, IS_READY, MOVING, PATH_BUFFERED, PATH_SOURCE, PATH_THRESHOLD, READY, error,
};
use hexapod::{Geometry, Load, MotionProgram, Pose};

use super::address::{Address, Wire};
use super::clock::Clock;
use super::pace::{self, GAP_S, Pace, Sink, Timing};
use super::{Motion, MotionSample, Platform, PlatformError, Stop, Trace, check, way};
use found::{Found, set};
use line::Line;

/// Poses of a program that `VMO?` is asked about, at most.
const ASKED: usize = 200;
/// Steps in which positions are compared with the limits, s.
const STEP_S: f64 = 0.01;
/// The plate is checked this many times a second.
const LOOKS_HZ: f64 = 20.0;
/// The longest reference move, s.
const LONGEST_S: f64 = 120.0;

/// A PI hexapod.
pub struct GcsPlatform {
    geometry: Geometry,
    reference: Pose,
    timing: Timing,
    program: Option<MotionProgram>,
    found: Found,
    /// Something of what was found has been changed.
    changed: bool,
    load: Option<Load>,
    clock: Clock,
    state: State,
}

enum State {
    Resting(Hexapod),
    Moving(Pace<Hexapod>),
    Gone,
}

/// The hexapod as set points see it.
struct Hexapod {
    line: Line,
    reference: Pose,
    last: String,
    clock: Clock,
}

/// The time that the drop of a moving platform waits for its rest, s.
const REST_S: f64 = 3.0;

impl GcsPlatform {
    /// Says hello; nothing moves.
    pub(super) fn connect(
        address: &Address,
        wire: Box<dyn Wire>,
        geometry: &Geometry,
        clock: Clock,
    ) -> Result<Self, PlatformError> {
        let mut line = Line::new(wire, address.text.clone(), clock.clone());
        let identity = line.ask("*IDN?")?;
        let version = line.ask("CSV?")?;
        if !version.trim().starts_with('2') {
            return Err(PlatformError::Refused(format!(
                "{} speaks GCS {}, and 2.0 is needed",
                identity.trim(),
                version.trim()
            )));
        }
        let axes = line.ask("SAI?")?;
        let has = |axis: &str| axes.lines().any(|l| l.trim() == axis);
        if let Some(missing) = AXES.iter().find(|axis| !has(axis)) {
            return Err(PlatformError::Refused(format!(
                "{} has no axis {missing}: it is no hexapod",
                identity.trim()
            )));
        }
        // Errors of whoever was here before.
        line.ask("ERR?")?;
        let reference = geometry.home();
        let found = Found::ask(&mut line)?;
        Ok(Self {
            geometry: geometry.clone(),
            reference,
            timing: address.timing,
            program: None,
            found,
            changed: false,
            load: None,
            clock: clock.clone(),
            state: State::Resting(Hexapod { line, reference, last: String::new(), clock }),
        })
    }

    fn resting(&mut self) -> Result<&mut Hexapod, PlatformError> {
        if let State::Moving(pace) = &self.state {
            if pace.motion()? == Motion::Moving {
                return Err(PlatformError::Refused("it is moving: stop it or wait".to_owned()));
            }
            if let State::Moving(pace) = std::mem::replace(&mut self.state, State::Gone) {
                self.state = pace.end().map_or(State::Gone, State::Resting);
            }
        }
        match &mut self.state {
            State::Resting(hexapod) => Ok(hexapod),
            _ => Err(PlatformError::Refused("its connection is gone".to_owned())),
        }
    }
}

impl Drop for GcsPlatform {
    fn drop(&mut self) {
        // Whoever wants to know has called it before.
        let _ = self.release();
    }
}

impl Platform for GcsPlatform {
    fn found(&self) -> Vec<String> {
        self.found.words()
    }

    fn release(&mut self) -> Result<Vec<String>, PlatformError> {
        if let State::Moving(pace) = &self.state
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
        if !std::mem::take(&mut self.changed) {
            return Ok(Vec::new());
        }
        let (commands, left) = (self.found.back(), self.found.left());
        let hexapod = self.resting()?;
        // Nothing is changed in a machine that moves.
        if hexapod.moving()? {
            hexapod.bring_to_rest()?;
        }
        // What a stop has left is no refusal of what follows.
        hexapod.line.ask("ERR?")?;
        let mut refused = Ok(());
        for command in commands {
            match hexapod.line.order(&command) {
                Err(error @ PlatformError::Controller { .. }) => refused = refused.and(Err(error)),
                other => other?,
            }
        }
        refused.map(|()| left)
    }

    fn stands(&mut self) -> Result<Option<Pose>, PlatformError> {
        let reference = self.reference;
        let line = &mut self.resting()?.line;
        if line.six("FRF?")?.contains(&0.0) {
            return Ok(None);
        }
        Ok(Some(GcsPosition(line.six("POS?")?).pose(&reference)))
    }

    fn carries(&mut self, load: Option<Load>) {
        self.load = load;
    }

    fn trace(&mut self, to: Trace) {
        if let State::Resting(hexapod) = &mut self.state {
            hexapod.line.trace = Some(to);
        }
    }

    fn load(&mut self, program: &MotionProgram) -> Result<(), PlatformError> {
        let trajectory = program.trajectory()?;
        let reference = self.reference;
        let hexapod = self.resting()?;
        let [low, high] = [hexapod.line.six("TMN?")?, hexapod.line.six("TMX?")?];
        let steps = (trajectory.duration_s() / STEP_S).ceil() as usize;
        let at = |k: usize| (k as f64 * STEP_S).min(trajectory.duration_s());
        for k in 0..=steps {
            let position = GcsPosition::of(&trajectory.state(at(k)).pose(), &reference);
            for (i, value) in position.0.into_iter().enumerate() {
                if !(low[i]..=high[i]).contains(&value) {
                    let unit = if i < 3 { "mm" } else { "degrees" };
                    return Err(PlatformError::Refused(format!(
                        "the program goes to {} = {value:.3} {unit} at t = {:.2} s, and the axis from {:.3} \
                         to {:.3} {unit}: use smaller tilts or translations",
                        AXES[i],
                        at(k),
                        low[i],
                        high[i]
                    )));
                }
            }
        }
        for k in (0..=steps).step_by(steps.div_ceil(ASKED).max(1)) {
            let position = GcsPosition::of(&trajectory.state(at(k)).pose(), &reference);
            let question = position.command("VMO?");
            let answer = hexapod.line.ask(&question)?;
            match answer.trim() {
                "1" => {}
                "0" => {
                    return Err(PlatformError::Refused(format!(
                        "it cannot reach the program's pose at t = {:.2} s ({question}): use smaller tilts \
                         or translations",
                        at(k)
                    )));
                }
                _ => return Err(hexapod.line.nonsense(&question, &answer)),
            }
        }
        self.program = Some(program.clone());
        Ok(())
    }

    fn way(&mut self, program: &MotionProgram) -> Result<Option<MotionProgram>, PlatformError> {
        let reference = self.reference;
        let hexapod = self.resting()?;
        // A reference move ends at zero.
        let referenced = !hexapod.line.six("FRF?")?.contains(&0.0);
        let here = if referenced { GcsPosition(hexapod.line.six("POS?")?) } else { GcsPosition::default() };
        way::between(&here.pose(&reference), &program.start, &self.geometry, self.load.as_ref()).map(Some)
    }

    fn approach(&mut self, go_on: &dyn Fn() -> bool) -> Result<(), PlatformError> {
        let Some(program) = self.program.clone() else {
            return Err(PlatformError::Refused("no motion program is loaded".to_owned()));
        };
        self.changed = true;
        let found = self.found.clone();
        let hexapod = self.resting()?;
        found.ask_again(&mut hexapod.line)?;
        if hexapod.line.six("SVO?")?.contains(&0.0) {
            hexapod.line.order("SVO X 1 Y 1 Z 1 U 1 V 1 W 1")?;
        }
        if hexapod.line.six("FRF?")?.contains(&0.0) {
            hexapod.line.tell("FRF")?;
            hexapod.wait("FRF", go_on, |line| {
                Ok(line.ask_byte(IS_READY)?.first() == Some(&READY) && !line.six("FRF?")?.contains(&0.0))
            })?;
        }
        if let Some(way) = self.way(&program)? {
            let clock = self.clock.clone();
            way::drive(self, &way, go_on, &clock)?;
        }
        self.program = Some(program);
        Ok(())
    }

    fn start(&mut self) -> Result<(), PlatformError> {
        let Some(program) = self.program.take() else {
            return Err(PlatformError::Refused("no motion program is loaded".to_owned()));
        };
        let (trajectory, reference) = (program.trajectory()?, self.reference);
        let here = GcsPosition(self.resting()?.line.six("POS?")?).pose(&reference);
        if !way::near(&here, &program.start) {
            return Err(PlatformError::Refused(format!(
                "its plate is at {}, and the program begins at {}",
                check::words(&here),
                check::words(&program.start)
            )));
        }
        let (timing, found) = (self.timing, self.found.clone());
        self.changed = true;
        let hexapod = self.resting()?;
        // Minutes may have gone by since it was asked, and others may be connected.
        found.ask_again(&mut hexapod.line)?;
        if hexapod.line.six("SVO?")?.contains(&0.0) {
            return Err(PlatformError::Refused(
                "its servos have been switched off: is another program connected to it?".to_owned(),
            ));
        }
        // The source last: it begins a path.
        let buffered = (timing.lead_s * timing.rate_hz).floor().max(2.0);
        hexapod.line.order(&set(PATH_BUFFERED, 1))?;
        hexapod.line.order(&set(PATH_THRESHOLD, buffered))?;
        let interval_ms = 1e3 / timing.rate_hz;
        hexapod.line.order(&format!("SCT T {interval_ms}"))?;
        found::agree_on_interval(&mut hexapod.line, interval_ms)?;
        hexapod.line.order(&set(PATH_SOURCE, 1))?;
        if let State::Resting(hexapod) = std::mem::replace(&mut self.state, State::Gone) {
            self.state = State::Moving(Pace::begin(hexapod, trajectory, timing, LOOKS_HZ, &self.clock));
        }
        Ok(())
    }

    fn stop(&mut self, stop: Stop) -> Result<(), PlatformError> {
        match &mut self.state {
            State::Moving(pace) => {
                pace.stop(stop);
                Ok(())
            }
            State::Resting(hexapod) => hexapod.bring_to_rest(),
            State::Gone => Err(PlatformError::Refused("its connection is gone".to_owned())),
        }
    }

    fn motion(&mut self) -> Result<Motion, PlatformError> {
        match &mut self.state {
            State::Moving(pace) => pace.motion(),
            State::Resting(hexapod) => Ok(if hexapod.moving()? { Motion::Moving } else { Motion::Holding }),
            State::Gone => Err(PlatformError::Refused("its connection is gone".to_owned())),
        }
    }

    fn samples(&mut self) -> Vec<MotionSample> {
        if let State::Moving(pace) = &self.state { pace.samples() } else { Vec::new() }
    }
}

impl Hexapod {
    fn moving(&mut self) -> Result<bool, PlatformError> {
        let answer = String::from_utf8_lossy(&self.line.ask_byte(MOVING)?).into_owned();
        let bits = answer.trim();
        let digits = bits.strip_prefix("0x").unwrap_or(bits);
        u32::from_str_radix(digits, 16).map(|m| m != 0).map_err(|_| self.line.nonsense("#5", &answer))
    }

    /// Stops the machine and sees it at rest.
    fn bring_to_rest(&mut self) -> Result<(), PlatformError> {
        self.halt()?;
        let clock = self.clock.clone();
        match pace::rest(&clock, self, true)? {
            Some(false) => Err(PlatformError::Unseen("it still moves after an abrupt stop (#24)".to_owned())),
            _ => Ok(()),
        }
    }

    /// Waits for what a command should bring about. It is stopped on request, if that does not come, and at
    /// any error: the controller would go on.
    fn wait(
        &mut self,
        command: &str,
        go_on: &dyn Fn() -> bool,
        there: impl Fn(&mut Line) -> Result<bool, PlatformError>,
    ) -> Result<(), PlatformError> {
        let Err(why) = self.look_for(command, go_on, there) else { return Ok(()) };
        match self.bring_to_rest() {
            Ok(()) => Err(why),
            Err(unknown) => Err(PlatformError::Unseen(format!(
                "{why}\nThe platform could not be seen at rest ({unknown}): use its own emergency stop."
            ))),
        }
    }

    fn look_for(
        &mut self,
        command: &str,
        go_on: &dyn Fn() -> bool,
        there: impl Fn(&mut Line) -> Result<bool, PlatformError>,
    ) -> Result<(), PlatformError> {
        let begun_s = self.clock.now_s();
        loop {
            self.line.check(command)?;
            if there(&mut self.line)? {
                return Ok(());
            }
            if self.clock.now_s() - begun_s > LONGEST_S {
                return Err(PlatformError::Refused(format!(
                    "{command} did not come to its end within {LONGEST_S} s, and was stopped"
                )));
            }
            if !go_on() {
                return Err(PlatformError::Interrupted);
            }
            self.clock.wait_s(0.02);
        }
    }
}

impl Sink for Hexapod {
    fn send(&mut self, _: f64, pose: &Pose) -> Result<(), PlatformError> {
        self.last = GcsPosition::of(pose, &self.reference).command("MOV");
        self.line.tell(&self.last)
    }

    fn look(&mut self) -> Result<Option<Pose>, PlatformError> {
        let last = std::mem::take(&mut self.last);
        self.line.check(&last)?;
        self.last = last;
        Ok(Some(GcsPosition(self.line.six("POS?")?).pose(&self.reference)))
    }

    fn patience_s(&self) -> f64 {
        // Set points go without a time; the controller says when they ceased.
        GAP_S
    }

    fn halt(&mut self) -> Result<bool, PlatformError> {
        let sent = self.line.tell(HALT);
        match sent.and_then(|()| self.line.check_soon(HALT)) {
            // A controller that does not know it.
            Err(PlatformError::Controller { code, .. }) if code == i32::from(error::UNKNOWN_COMMAND) => {
                self.halt_abruptly().map(|()| true)
            }
            // That is what a stop is answered by.
            Ok(()) | Err(PlatformError::Controller { .. }) => Ok(true),
            Err(error) => {
                // Whoever answers no more may still hear.
                let _ = self.line.stop();
                Err(error)
            }
        }
    }

    fn halt_abruptly(&mut self) -> Result<(), PlatformError> {
        self.line.stop()?;
        match self.line.check_soon("#24 (stop)") {
            Ok(()) | Err(PlatformError::Controller { .. }) => Ok(()),
            Err(error) => Err(error),
        }
    }

    fn at_rest(&mut self) -> Result<Option<bool>, PlatformError> {
        self.moving().map(|moving| Some(!moving))
    }
}

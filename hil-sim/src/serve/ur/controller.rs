//! The controller at work: one cycle after the other by the rig's clock, its program, and the plate that the
//! arm carries.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use super::joints::{Command, plate};
use super::state::{PLAYING, STOPPED, Shared, Tell};
use super::task::{Did, Task, lock};
use crate::rig::SharedRig;

/// Cycle of a CB3 controller, s.
pub const CYCLE_S: f64 = 0.008;
/// The plate is where the arm is this long after the controller's cycle, ns.
const BEHIND_NS: f64 = 5e7;
/// The rig's clock is looked at this often.
const LOOK: Duration = Duration::from_millis(2);
/// Cycles that are made up for at once; the rest of a longer stall of this computer is left out.
const MOST_AT_ONCE: u64 = 25;

/// The controller's own loop. Dropping it ends it.
pub struct Loop {
    leave: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Loop {
    /// Begins the controller's loop.
    pub fn begin(rig: SharedRig, shared: Arc<Mutex<Shared>>, tell: Tell) -> Self {
        let leave = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&leave);
        let thread = Some(thread::spawn(move || {
            let origin_ns = crate::runner::lock(&rig).now_ns() as f64;
            let mut work = Work { rig, shared, tell, task: None, origin_ns, late: false };
            while !stop.load(Ordering::Acquire) {
                work.catch_up();
                thread::sleep(LOOK);
            }
        }));
        Self { leave, thread }
    }
}

impl Drop for Loop {
    fn drop(&mut self) {
        self.leave.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            // A panic there has printed itself.
            let _ = thread.join();
        }
    }
}

struct Work {
    rig: SharedRig,
    shared: Arc<Mutex<Shared>>,
    tell: Tell,
    task: Option<Task>,
    /// The rig's clock at the controller's zero, ns.
    origin_ns: f64,
    late: bool,
}

impl Work {
    /// Makes the cycles that the rig's clock asks for.
    fn catch_up(&mut self) {
        let now_ns = crate::runner::lock(&self.rig).now_ns() as f64;
        for _ in 0..MOST_AT_ONCE {
            let cycle = lock(&self.shared).cycle;
            let time_ns = self.origin_ns + 1e9 * CYCLE_S * (cycle + 1) as f64;
            if time_ns > now_ns {
                return;
            }
            self.cycle(time_ns);
        }
        let cycle = lock(&self.shared).cycle;
        self.origin_ns = now_ns - 1e9 * CYCLE_S * cycle as f64;
    }

    fn cycle(&mut self, time_ns: f64) {
        self.begin_program();
        if self.task.is_some() && !self.may_go_on() {
            self.task = None;
            // It may have given one more command.
            self.brake();
        }
        if let Some(Did::Ended(fault)) = self.task.as_ref().map(Task::cycle) {
            self.task = None;
            if let Some(fault) = fault {
                (self.tell)(&format!("the program is wrong: {fault}"));
            }
            self.ended();
        }
        let mut shared = lock(&self.shared);
        shared.cycle += 1;
        if !shared.joints.step(CYCLE_S) {
            (self.tell)("a joint is too fast or beyond its range: protective stop");
            shared.protective_stop();
        }
        let pose = plate(&shared.joints.q);
        drop(shared);
        let mut rig = crate::runner::lock(&self.rig);
        if rig.pass_through(&pose, (time_ns + BEHIND_NS) as u64).is_err() {
            // This computer stalled: from rest, once more.
            rig.stop();
            if !std::mem::replace(&mut self.late, true) {
                (self.tell)("this computer is too slow: the plate jumps");
            }
        }
    }

    /// Begins a program that was sent, in the place of the one that runs.
    fn begin_program(&mut self) {
        let mut shared = lock(&self.shared);
        let Some(program) = shared.sent.take() else { return };
        if !shared.remote {
            (self.tell)(&format!("{} is not obeyed: the controller is in local mode", program.name));
        } else if !shared.may_move() {
            (self.tell)(&format!("{} is not obeyed: the arm may not move", program.name));
        } else {
            self.task = None;
            (shared.watchdog, shared.runtime_state) = (None, PLAYING);
            if !shared.joints.rest() {
                shared.joints.brake();
            }
            drop(shared);
            self.task = Some(Task::new(program, Arc::clone(&self.shared)));
        }
    }

    /// Returns whether the program may have another cycle; else it is stopped.
    fn may_go_on(&self) -> bool {
        let mut shared = lock(&self.shared);
        if shared.runtime_state != PLAYING {
            return false;
        }
        let now_s = shared.now_s();
        let starved =
            shared.watchdog.as_ref().is_some_and(|(_, period_s, seen_s)| now_s - seen_s > *period_s);
        if starved {
            (self.tell)("the watchdog stops the program: its variable was not written");
            shared.runtime_state = STOPPED;
            shared.joints.brake();
        }
        !starved
    }

    /// Receives that a program has ended: an arm that it left moving brakes.
    fn ended(&self) {
        let mut shared = lock(&self.shared);
        (shared.runtime_state, shared.watchdog) = (STOPPED, None);
        drop(shared);
        self.brake();
    }

    /// Brakes an arm that follows nobody's points.
    fn brake(&self) {
        let mut shared = lock(&self.shared);
        if matches!(shared.joints.command, Command::Servo { .. }) {
            shared.joints.brake();
        }
    }
}

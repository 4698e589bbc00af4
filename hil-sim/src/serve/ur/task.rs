//! A program that runs on the controller, a cycle at a time, and the functions that it may call.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;

use super::interpreter::{Fault, Functions, Run, Value};
use super::joints::Command;
use super::language::Program;
use super::state::{REGISTERS, Shared};

/// The outcome of one cycle of a program.
pub enum Did {
    /// The program waits for the next cycle.
    Waits,
    /// The program is over, with its fault, if any.
    Ended(Option<String>),
}

/// A program under way. Dropping it takes it away.
pub struct Task {
    go: SyncSender<()>,
    did: Receiver<Did>,
}

pub fn lock(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Task {
    /// Makes a program that begins with the next cycle.
    pub fn new(program: Program, shared: Arc<Mutex<Shared>>) -> Self {
        let ((go, going), (doing, did)) = (sync_channel(0), sync_channel(0));
        thread::spawn(move || {
            let mut machine = Machine { shared, going, doing, cycles: 0 };
            if machine.going.recv().is_err() {
                return;
            }
            let ended = match Run::program(&program, &mut machine) {
                Ok(()) | Err(Fault::Halted) => Did::Ended(None),
                Err(Fault::Killed) => return,
                Err(Fault::Error(why)) => Did::Ended(Some(why)),
            };
            // Nobody is left to hear it.
            let _ = machine.doing.send(ended);
        });
        Self { go, did }
    }

    /// Lets it have one cycle.
    pub fn cycle(&self) -> Did {
        match self.go.send(()).ok().and_then(|()| self.did.recv().ok()) {
            Some(did) => did,
            None => Did::Ended(Some("it broke".to_owned())),
        }
    }
}

/// The controller as a program sees it.
struct Machine {
    shared: Arc<Mutex<Shared>>,
    going: Receiver<()>,
    doing: SyncSender<Did>,
    cycles: u64,
}

impl Machine {
    fn wait(&mut self) -> Result<(), Fault> {
        self.doing.send(Did::Waits).map_err(|_| Fault::Killed)?;
        self.going.recv().map_err(|_| Fault::Killed)?;
        self.cycles += 1;
        Ok(())
    }

    /// Waits for this long by the arm's time, s, which is stretched by its speed slider.
    fn wait_s(&mut self, duration_s: f64) -> Result<(), Fault> {
        let mut left = duration_s;
        loop {
            let (cycle_s, speed) = {
                let shared = lock(&self.shared);
                (shared.cycle_s, shared.speed)
            };
            self.wait()?;
            left -= cycle_s * speed.max(0.01);
            if left < 1e-9 {
                return Ok(());
            }
        }
    }
}

fn six(value: &Value) -> Result<[f64; 6], Fault> {
    match value {
        Value::List(list) => <[f64; 6]>::try_from(list.as_slice()).ok(),
        _ => None,
    }
    .ok_or(Fault::Error(format!("{value:?} is no list of six")))
}

fn register(value: &Value) -> Result<usize, Fault> {
    let at = value.number()?;
    let index = (0..REGISTERS).find(|k| *k as f64 == at);
    index.ok_or(Fault::Error(format!("there is no register {at}")))
}

fn integer(value: &Value) -> Result<i32, Fault> {
    match value {
        Value::Integer(value) => i32::try_from(*value).ok(),
        _ => None,
    }
    .ok_or(Fault::Error(format!("{value:?} is no integer of 32 bits")))
}

impl Functions for Machine {
    fn cycles(&self) -> u64 {
        self.cycles
    }

    fn call(&mut self, name: &str, arguments: &[Value]) -> Result<Value, Fault> {
        let shared = Arc::clone(&self.shared);
        match (name, arguments) {
            ("get_steptime", []) => return Ok(Value::Float(lock(&shared).cycle_s)),
            ("get_target_joint_positions" | "get_actual_joint_positions" | "get_joint_positions", []) => {
                return Ok(Value::List(lock(&shared).joints.q.to_vec()));
            }
            ("read_input_integer_register", [at]) => {
                return Ok(Value::Integer(lock(&shared).input_int[register(at)?].into()));
            }
            ("read_input_float_register", [at]) => {
                return Ok(Value::Float(lock(&shared).input_double[register(at)?]));
            }
            ("write_output_integer_register", [at, value]) => {
                lock(&shared).output_int[register(at)?] = integer(value)?;
            }
            ("write_output_float_register", [at, value]) => {
                lock(&shared).output_double[register(at)?] = value.number()?;
            }
            ("norm", [value]) => return Ok(Value::Float(value.number()?.abs())),
            ("textmsg", _) => {}
            ("rtde_set_watchdog", [Value::Text(variable), frequency, Value::Text(action)])
                if action == "stop" =>
            {
                let period_s = 1.0 / frequency.number()?;
                let mut shared = lock(&shared);
                let now_s = shared.now_s();
                shared.watchdog = Some((variable.clone(), period_s, now_s));
            }
            ("sync", []) => self.wait()?,
            ("sleep", [duration]) => self.wait_s(duration.number()?)?,
            ("servoj", [q, _, _, t, lookahead, gain]) => {
                let (target, lookahead_s, gain) = (six(q)?, lookahead.number()?, gain.number()?);
                if !(0.03..=0.2).contains(&lookahead_s) || !(100.0..=2000.0).contains(&gain) {
                    return Err("servoj: look-ahead from 0.03 to 0.2 s, gain from 100 to 2000"
                        .to_owned()
                        .into());
                }
                lock(&shared).joints.command = Command::Servo { target, lookahead_s, gain };
                self.wait_s(t.number()?)?;
            }
            ("stopj", [deceleration]) => {
                let deceleration = deceleration.number()?;
                if deceleration.is_nan() || deceleration <= 0.0 {
                    return Err("stopj: a deceleration is above zero".to_owned().into());
                }
                lock(&shared).joints.command = Command::Stop(deceleration);
                loop {
                    self.wait()?;
                    if lock(&shared).joints.rest() {
                        break;
                    }
                }
            }
            _ => {
                let count = arguments.len();
                return Err(format!("there is no function {name} of {count} arguments here").into());
            }
        }
        Ok(Value::None)
    }
}

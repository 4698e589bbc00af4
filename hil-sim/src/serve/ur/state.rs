//! The state that the controller's interfaces and its program share.

use std::collections::HashMap;
use std::sync::Arc;

use super::joints::{Joints, tool};
use super::language::Program;

/// Receives faults of programs.
pub type Tell = Arc<dyn Fn(&str) + Send + Sync>;

/// General purpose registers of each kind.
pub const REGISTERS: usize = 48;
/// `robot_mode`: running, and power off.
pub const RUNNING: i32 = 7;
const POWER_OFF: i32 = 3;
/// `safety_mode`: normal, protective stop, emergency stop of the robot.
pub const NORMAL: i32 = 1;
const PROTECTIVE: i32 = 3;
const EMERGENCY: i32 = 7;
/// `runtime_state`.
pub const STOPPED: u32 = 1;
pub const PLAYING: u32 = 2;
const PAUSED: u32 = 4;

/// The state.
pub struct Shared {
    pub cycle_s: f64,
    /// Cycles since it was switched on.
    pub cycle: u64,
    pub joints: Joints,
    pub input_int: [i32; REGISTERS],
    pub input_double: [f64; REGISTERS],
    pub output_int: [i32; REGISTERS],
    pub output_double: [f64; REGISTERS],
    pub robot_mode: i32,
    pub safety_mode: i32,
    pub runtime_state: u32,
    /// True if the arm obeys programs from outside.
    pub remote: bool,
    /// The speed slider, as a share.
    pub speed: f64,
    /// A variable that must be written, how often, s, and when it was, s.
    pub watchdog: Option<(String, f64, f64)>,
    /// A program that is to begin.
    pub sent: Option<Program>,
    /// The client of each input.
    pub claims: HashMap<String, u64>,
    /// True if no answer is given to anybody: the network is cut.
    pub cut: bool,
}

/// A variable that a client may write.
#[derive(Clone, Copy)]
enum Input {
    /// A register of integers.
    Integer(usize),
    /// A register of doubles.
    Double(usize),
    /// One that is taken and does nothing here, by its type.
    Idle(&'static str),
}

impl Input {
    /// Returns the variable of a name of the RTDE guide.
    fn of(name: &str) -> Option<Self> {
        let at = |prefix: &str| name.strip_prefix(prefix)?.parse::<usize>().ok().filter(|k| *k < REGISTERS);
        let register = at("input_int_register_").map(Self::Integer);
        register.or_else(|| at("input_double_register_").map(Self::Double)).or_else(|| {
            let kind = match name {
                "speed_slider_mask" | "input_bit_registers0_to_31" | "input_bit_registers32_to_63" => {
                    "UINT32"
                }
                "speed_slider_fraction" | "standard_analog_output_0" | "standard_analog_output_1" => "DOUBLE",
                "standard_digital_output_mask"
                | "configurable_digital_output_mask"
                | "standard_digital_output"
                | "configurable_digital_output"
                | "standard_analog_output_mask"
                | "standard_analog_output_type"
                | "tool_digital_output_mask"
                | "tool_digital_output" => "UINT8",
                "external_force_torque" => "VECTOR6D",
                _ => return None,
            };
            Some(Self::Idle(kind))
        })
    }

    fn kind(self) -> &'static str {
        match self {
            Self::Integer(_) => "INT32",
            Self::Double(_) => "DOUBLE",
            Self::Idle(kind) => kind,
        }
    }

    /// Returns the length of its value, bytes.
    fn length(self) -> usize {
        match self.kind() {
            "UINT8" => 1,
            "DOUBLE" => 8,
            "VECTOR6D" => 48,
            _ => 4,
        }
    }
}

impl Shared {
    /// Returns an arm that is switched on, at rest.
    pub fn new(cycle_s: f64) -> Self {
        Self {
            cycle_s,
            cycle: 0,
            joints: Joints::new(),
            input_int: [0; REGISTERS],
            input_double: [0.0; REGISTERS],
            output_int: [0; REGISTERS],
            output_double: [0.0; REGISTERS],
            robot_mode: RUNNING,
            safety_mode: NORMAL,
            runtime_state: STOPPED,
            remote: true,
            speed: 1.0,
            watchdog: None,
            sent: None,
            claims: HashMap::new(),
            cut: false,
        }
    }

    /// Returns the controller's time, s.
    pub fn now_s(&self) -> f64 {
        self.cycle as f64 * self.cycle_s
    }

    /// Stops the arm at once; it holds, its program paused.
    pub fn protective_stop(&mut self) {
        if self.safety_mode == NORMAL {
            (self.safety_mode, self.runtime_state) = (PROTECTIVE, PAUSED);
            self.joints.brake();
        }
    }

    /// Stops the arm at once, and its power goes off.
    pub fn emergency_stop(&mut self) {
        (self.safety_mode, self.robot_mode, self.runtime_state) = (EMERGENCY, POWER_OFF, STOPPED);
        self.joints.brake();
    }

    /// Returns whether a program may run.
    pub fn may_move(&self) -> bool {
        self.safety_mode == NORMAL && self.robot_mode == RUNNING
    }

    /// Returns the type of an input variable.
    pub fn input_kind(name: &str) -> Option<&'static str> {
        Some(Input::of(name)?.kind())
    }

    /// Writes input variables from the bytes of a package. Returns false if these are not of their length.
    pub fn write(&mut self, names: &[String], mut bytes: &[u8]) -> bool {
        let mut writes = Vec::new();
        for name in names {
            let Some(input) = Input::of(name) else { return false };
            let Some((value, rest)) = bytes.split_at_checked(input.length()) else { return false };
            writes.push((input, value));
            bytes = rest;
        }
        if !bytes.is_empty() {
            return false;
        }
        for (input, value) in writes {
            match (input, <[u8; 4]>::try_from(value), <[u8; 8]>::try_from(value)) {
                (Input::Integer(at), Ok(value), _) => self.input_int[at] = i32::from_be_bytes(value),
                (Input::Double(at), _, Ok(value)) => self.input_double[at] = f64::from_be_bytes(value),
                _ => {}
            }
        }
        let now_s = self.now_s();
        if let Some((variable, _, seen_s)) = &mut self.watchdog
            && names.contains(variable)
        {
            *seen_s = now_s;
        }
        true
    }

    /// Returns an output variable: its type and its bytes.
    pub fn read(&self, name: &str) -> Option<(&'static str, Vec<u8>)> {
        let doubles =
            |kind, values: &[f64]| Some((kind, values.iter().flat_map(|v| v.to_be_bytes()).collect()));
        let integer = |value: i32| Some(("INT32", value.to_be_bytes().to_vec()));
        let at = |prefix: &str| name.strip_prefix(prefix)?.parse::<usize>().ok().filter(|k| *k < REGISTERS);
        match name {
            "timestamp" => doubles("DOUBLE", &[self.now_s()]),
            "target_q" | "actual_q" => doubles("VECTOR6D", &self.joints.q),
            "target_qd" | "actual_qd" => doubles("VECTOR6D", &self.joints.qd),
            "actual_TCP_pose" => doubles("VECTOR6D", &tool(&self.joints.q)),
            "speed_scaling" | "target_speed_fraction" => doubles("DOUBLE", &[self.speed]),
            "robot_mode" => integer(self.robot_mode),
            "safety_mode" | "safety_status" => integer(self.safety_mode),
            "runtime_state" => Some(("UINT32", self.runtime_state.to_be_bytes().to_vec())),
            _ => {
                if let Some(k) = at("output_int_register_") {
                    return integer(self.output_int[k]);
                }
                if let Some(k) = at("input_int_register_") {
                    return integer(self.input_int[k]);
                }
                let double = at("output_double_register_").map(|k| self.output_double[k]);
                let double = double.or_else(|| at("input_double_register_").map(|k| self.input_double[k]));
                double.and_then(|value| doubles("DOUBLE", &[value]))
            }
        }
    }
}

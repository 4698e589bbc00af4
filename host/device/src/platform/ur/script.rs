//! The program that follows set points on the controller: URScript.
//!
//! | register | content |
//! |---|---|
//! | `input_int_register_24` | number of the motion, so that no other program's points are followed |
//! | `input_int_register_25` | number of the newest control point, from 1 |
//! | `input_int_register_26` | [`Order`] |
//! | `input_double_register_24` to `47` | the newest four control points, the newest first, rad |
//! | `output_int_register_24` | number of the motion that is followed |
//! | `output_int_register_25` | [`Status`] |
//! | `output_int_register_26` | [`Reason`] |
//! | `output_int_register_27` | number of the last control point that was used |
//! | `output_int_register_28` | number of the last control point that was taken: no more than four are sent beyond it |
//!
//! Registers 24 to 47 are those of programs outside; the lower ones belong to field buses. Four points in each package: where several
//! packages meet one cycle of the controller, none is lost. The arm sets off when `FIRST` points are there, evaluates their uniform
//! cubic B-spline in every cycle of its own and gives that to `servoj`. When points cease the arm is brought to rest by `stopj`, with
//! the lowest acceleration limit of its joints.

use std::fmt::Write as _;

use hexapod::{ARM_STEP_S, Arm};

/// Control points that are sent before their time.
pub const LEAD: usize = 10;
/// Control points that are there when the arm sets off.
const FIRST: usize = 4;
/// Control points that the program keeps at most.
const SLOTS: usize = 20;
/// The controller stops the program where no package came for this long, s, whatever the program does: its own watchdog.
const WATCHDOG_S: f64 = 0.3;
/// A step of a cycle may be longer than the joint's limit by this share: rounding, and the fade to where the arm was.
const OVER: f64 = 1.2;

/// The orders to the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Follow, and stop when points cease.
    Follow = 1,
    /// No further point comes: the end is reached when all are used.
    Finish = 2,
    /// Come to rest at once.
    Halt = 3,
}

/// The phases of the program.
pub mod status {
    /// It waits for its first points.
    pub const READY: i32 = 1;
    /// It follows points.
    pub const FOLLOWING: i32 = 2;
    /// It is being brought to rest.
    pub const STOPPING: i32 = 3;
    /// It is over.
    pub const ENDED: i32 = 4;
}

/// The points ended with the arm at rest.
pub const AT_REST: i32 = 2;
/// The points ceased while the arm moved.
pub const CEASED: i32 = 3;

/// Why the program ended, in words; `None` where it did so as commanded.
pub fn reason(number: i32) -> Option<&'static str> {
    match number {
        0..=2 => None,
        CEASED => Some(
            "its program got no set point in time and has brought the arm to rest: this machine or the network was too slow",
        ),
        4 => Some("its program has missed set points and has brought the arm to rest: is the network sound?"),
        5 => {
            Some("another program has written the registers that this one uses; the arm was brought to rest")
        }
        6 => Some(
            "a set point was farther away than the arm's joints may go in one cycle; the arm was brought to rest",
        ),
        7 => Some(
            "the arm was slower than its set points and was brought to rest: is its speed slider at 100 %, and does its payload setting \
             fit?",
        ),
        _ => Some("its program ended for a reason that is not known here"),
    }
}

/// Returns the program for an arm and the motion of this number.
pub fn program(arm: &Arm, motion: i32) -> String {
    let stop = arm.hinges.iter().map(|hinge| hinge.acceleration_radps2).fold(f64::INFINITY, f64::min);
    let rates: Vec<String> =
        arm.hinges.iter().map(|hinge| format!("{:.6}", OVER * hinge.rate_radps)).collect();
    let mut text = format!(
        "def rigident():\n\
         \x20 motion = {motion}\n\
         \x20 step = {ARM_STEP_S:.6}\n\
         \x20 most = [{rates}]\n\
         \x20 cycle = get_steptime()\n\
         \x20 a = get_target_joint_positions()\n\
         \x20 b = a\n\x20 c = a\n\x20 d = a\n\x20 p = a\n\x20 x = a\n",
        rates = rates.join(", ")
    );
    for slot in 0..SLOTS {
        let _ = writeln!(text, "  s{slot} = a");
    }
    let _ = write!(
        text,
        "  waiting = 0\n\
         \x20 last = 0\n\
         \x20 used = 0\n\
         \x20 u = 0.0\n\
         \x20 reason = 0\n\
         \x20 moves = False\n\
         \x20 write_output_integer_register(26, 0)\n\
         \x20 write_output_integer_register(27, 0)\n\
         \x20 write_output_integer_register(28, 0)\n\
         \x20 write_output_integer_register(25, {ready})\n\
         \x20 write_output_integer_register(24, motion)\n\
         \x20 rtde_set_watchdog(\"input_int_register_25\", {watchdog:.3}, \"stop\")\n\
         \x20 while reason == 0:\n\
         \x20   newest = read_input_integer_register(25)\n\
         \x20   order = read_input_integer_register(26)\n\
         \x20   if read_input_integer_register(24) != motion:\n\
         \x20     reason = 5\n\
         \x20   elif order == {halt}:\n\
         \x20     reason = 1\n\
         \x20   elif newest < last or newest > last + 4:\n\
         \x20     reason = 4\n\
         \x20   end\n\
         \x20   behind = newest - last\n\
         \x20   began = last\n\
         \x20   had = waiting\n\
         \x20   while reason == 0 and behind > 0:\n\
         \x20     at = 24 + 6 * (behind - 1)\n\
         \x20     x = [read_input_float_register(at), read_input_float_register(at + 1), read_input_float_register(at + 2), \
         read_input_float_register(at + 3), read_input_float_register(at + 4), read_input_float_register(at + 5)]\n",
        ready = status::READY,
        watchdog = 1.0 / WATCHDOG_S,
        halt = Order::Halt as i32,
    );
    for slot in 0..SLOTS {
        let word = if slot == 0 { "if" } else { "elif" };
        let _ = write!(text, "      {word} waiting == {slot}:\n        s{slot} = x\n");
    }
    let _ = write!(
        text,
        "      else:\n\
         \x20       reason = 7\n\
         \x20     end\n\
         \x20     waiting = waiting + 1\n\
         \x20     last = last + 1\n\
         \x20     behind = behind - 1\n\
         \x20   end\n\
         \x20   if read_input_integer_register(25) != newest:\n\
         \x20     # A package came meanwhile: once more.\n\
         \x20     waiting = had\n\
         \x20     last = began\n\
         \x20   end\n\
         \x20   write_output_integer_register(28, last)\n\
         \x20   if reason == 0 and moves == False:\n\
         \x20     if waiting >= {FIRST}:\n\
         \x20       moves = True\n\
         \x20       write_output_integer_register(25, {following})\n\
         \x20     else:\n\
         \x20       sync()\n\
         \x20     end\n\
         \x20   elif reason == 0:\n\
         \x20     u = u + cycle / step\n\
         \x20     while u >= 1.0 and reason == 0:\n\
         \x20       u = u - 1.0\n\
         \x20       a = b\n\x20       b = c\n\x20       c = d\n\
         \x20       if waiting > 0:\n\
         \x20         d = s0\n",
        following = status::FOLLOWING,
    );
    for slot in 1..SLOTS {
        let _ = writeln!(text, "          s{} = s{slot}", slot - 1);
    }
    let _ = write!(
        text,
        "          waiting = waiting - 1\n\
         \x20         used = used + 1\n\
         \x20       elif order == {finish}:\n\
         \x20         reason = {AT_REST}\n\
         \x20       else:\n\
         \x20         reason = {AT_REST}\n\
         \x20         i = 0\n\
         \x20         while i < 6:\n\
         \x20           if norm(d[i] - a[i]) > 0.000001 or norm(d[i] - b[i]) > 0.000001:\n\
         \x20             reason = {CEASED}\n\
         \x20           end\n\
         \x20           i = i + 1\n\
         \x20         end\n\
         \x20       end\n\
         \x20     end\n\
         \x20     if reason == 0:\n\
         \x20       v = 1.0 - u\n\
         \x20       wa = v * v * v / 6.0\n\
         \x20       wb = (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0\n\
         \x20       wc = (3.0 * v * v * v - 6.0 * v * v + 4.0) / 6.0\n\
         \x20       wd = u * u * u / 6.0\n\
         \x20       i = 0\n\
         \x20       while i < 6:\n\
         \x20         x[i] = wa * a[i] + wb * b[i] + wc * c[i] + wd * d[i]\n\
         \x20         if norm(x[i] - p[i]) > most[i] * cycle + 0.0001:\n\
         \x20           reason = 6\n\
         \x20         end\n\
         \x20         i = i + 1\n\
         \x20       end\n\
         \x20     end\n\
         \x20     if reason == 0:\n\
         \x20       p = x\n\
         \x20       servoj(p, 0, 0, cycle, 0.1, 300)\n\
         \x20       write_output_integer_register(27, used)\n\
         \x20     end\n\
         \x20   end\n\
         \x20 end\n\
         \x20 write_output_integer_register(26, reason)\n\
         \x20 write_output_integer_register(25, {stopping})\n\
         \x20 stopj({stop:.4})\n\
         \x20 write_output_integer_register(25, {ended})\n\
         end\n",
        finish = Order::Finish as i32,
        stopping = status::STOPPING,
        ended = status::ENDED,
    );
    text
}

/// A program that brings the arm to rest, whatever runs on the controller, for an arm that does not hear its registers.
pub fn stop(arm: &Arm) -> String {
    let most = arm.hinges.iter().map(|hinge| hinge.acceleration_radps2).fold(0.0, f64::max);
    format!("def rigident_stop():\n  stopj({most:.4})\nend\n")
}

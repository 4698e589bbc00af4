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
//! Registers 24 to 47 are those of programs outside; the lower ones belong to field buses. Four points in
//! each package: where several packages meet one cycle of the controller, none is lost. The arm sets off when
//! `FIRST` points are there, evaluates their uniform cubic B-spline in every cycle of its own and gives that
//! to `servoj`. When points cease the arm is brought to rest by `stopj`, with the lowest acceleration limit
//! of its joints.

use hexapod::{ARM_STEP_S, Arm};

/// The program, with names in double braces where values go.
const FOLLOW: &str = include_str!("follow.script");
/// Control points that are sent before their time.
pub const LEAD: usize = 10;
/// Control points that are there when the arm sets off.
const FIRST: usize = 4;
/// Control points that the program keeps at most.
const SLOTS: usize = 20;
/// The controller stops the program where no package came for this long, s, whatever the program does: its
/// own watchdog.
const WATCHDOG_S: f64 = 0.3;
/// A step of a cycle may be longer than the joint's limit by this share: rounding, and the fade to where the
/// arm was.
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
    /// The program waits for its first points.
    pub const READY: i32 = 1;
    /// The program follows points.
    pub const FOLLOWING: i32 = 2;
    /// The arm is being brought to rest.
    pub const STOPPING: i32 = 3;
    /// The program is over.
    pub const ENDED: i32 = 4;
}

/// The points ended with the arm at rest.
pub const AT_REST: i32 = 2;
/// The points ceased while the arm moved.
pub const CEASED: i32 = 3;

/// Returns why the program ended, in words; `None` where it did so as commanded.
pub fn reason(number: i32) -> Option<&'static str> {
    match number {
        0..=2 => None,
        CEASED => Some(
            "its program got no set point in time and has brought the arm to rest: this machine or the \
             network was too slow",
        ),
        4 => Some("its program has missed set points and has brought the arm to rest: is the network sound?"),
        5 => {
            Some("another program has written the registers that this one uses; the arm was brought to rest")
        }
        6 => Some(
            "a set point was farther away than the arm's joints may go in one cycle; the arm was brought to \
             rest",
        ),
        7 => Some(
            "the arm was slower than its set points and was brought to rest: is its speed slider at 100 %, \
             and does its payload setting fit?",
        ),
        _ => Some("its program ended for a reason that is not known here"),
    }
}

/// Returns the program for an arm and the motion of this number.
pub fn program(arm: &Arm, motion: i32) -> String {
    let lowest = arm.hinges.iter().map(|hinge| hinge.acceleration_radps2).fold(f64::INFINITY, f64::min);
    let rates: Vec<String> =
        arm.hinges.iter().map(|hinge| format!("{:.6}", OVER * hinge.rate_radps)).collect();
    let slots = |line: &dyn Fn(usize) -> String| (0..SLOTS).map(line).collect::<Vec<_>>().join("\n");
    let word = |slot: usize| if slot == 0 { "if" } else { "elif" };
    let values = [
        ("motion", motion.to_string()),
        ("step", format!("{ARM_STEP_S:.6}")),
        ("most", format!("[{}]", rates.join(", "))),
        ("slots", slots(&|slot| format!("  s{slot} = a"))),
        ("push", slots(&|slot| format!("      {} waiting == {slot}:\n        s{slot} = x", word(slot)))),
        ("shift", slots(&|slot| format!("          s{slot} = s{}", (slot + 1).min(SLOTS - 1)))),
        ("ready", status::READY.to_string()),
        ("following", status::FOLLOWING.to_string()),
        ("stopping", status::STOPPING.to_string()),
        ("ended", status::ENDED.to_string()),
        ("watchdog_hz", format!("{:.3}", 1.0 / WATCHDOG_S)),
        ("halt", (Order::Halt as i32).to_string()),
        ("finish", (Order::Finish as i32).to_string()),
        ("first", FIRST.to_string()),
        ("at_rest", AT_REST.to_string()),
        ("ceased", CEASED.to_string()),
        ("deceleration", format!("{lowest:.4}")),
    ];
    values
        .iter()
        .fold(FOLLOW.to_owned(), |text, (name, value)| text.replace(&format!("{{{{{name}}}}}"), value))
}

/// Returns a program that brings the arm to rest, whatever runs on the controller, for an arm that does not
/// hear its registers.
pub fn stop(arm: &Arm) -> String {
    let most = arm.hinges.iter().map(|hinge| hinge.acceleration_radps2).fold(0.0, f64::max);
    format!("def rigident_stop():\n  stopj({most:.4})\nend\n")
}

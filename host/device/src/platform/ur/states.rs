//! The numbers by which a Universal Robots controller says how it is, in words.

/// `robot_mode` of an arm that can move.
pub const RUNNING: i32 = 7;
/// `runtime_state` without a program.
pub const STOPPED: u32 = 1;
/// `runtime_state` of a program that runs.
pub const PLAYING: u32 = 2;

/// Returns whether the safety system lets the arm move: normal, or with its reduced limits.
pub fn is_safe(safety_mode: i32) -> bool {
    matches!(safety_mode, 1 | 2)
}

/// Returns `safety_mode` in words.
pub fn safety(mode: i32) -> &'static str {
    match mode {
        1 => "its safety system is in normal mode",
        2 => "its safety system is in reduced mode",
        3 => {
            "it has made a protective stop: look for a collision or an overload, then unlock it at its panel"
        }
        4 => "its safety system is in recovery mode: move it back inside its safety limits at its panel",
        5 => "a safeguard stop is active: close the guard, then reset it",
        6 => "the emergency stop of the system is pressed",
        7 => "its emergency stop is pressed",
        8 => "its safety system has found a violation of a safety limit: restart it at its panel",
        9 => "its safety system has a fault: restart it at its panel",
        10 => "the identity of its joints is to be confirmed at its panel",
        12 => "a safeguard stop of automatic mode is active: close the guard, then reset it",
        13 => "the three-position enabling device has stopped it",
        _ => "its safety system is in a mode that is not known here",
    }
}

/// Returns `robot_mode` in words.
pub fn robot(mode: i32) -> &'static str {
    match mode {
        -1 => "its panel has no controller",
        0 => "its joints are disconnected",
        1 => "the safety configuration is to be confirmed at its panel",
        2 => "it is booting",
        3 => "its power is off: switch it on at its panel",
        4 => "its power is on, its brakes are not released: start it at its panel",
        5 => "its brakes are not released: start it at its panel",
        6 => "it is moved by hand (backdrive)",
        7 => "it is running",
        8 => "its firmware is being updated",
        _ => "it is in a mode that is not known here",
    }
}

/// Returns `runtime_state` in words.
pub fn program(state: u32) -> &'static str {
    match state {
        0 => "its program is stopping",
        STOPPED => "no program runs on it",
        PLAYING => "a program runs on it",
        3 | 4 => "its program is paused",
        5 => "its program is resuming",
        _ => "its program is in a state that is not known here",
    }
}

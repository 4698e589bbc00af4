//! The vendor's numbers of errors, in words that say what to do.

/// Returns what a number means. The numbers are those of the vendor's manuals (C-887: MS204E) and of its
/// client `pipython`.
pub fn words(code: i32) -> &'static str {
    match code {
        0 => "no error",
        1 => "a parameter's syntax is wrong",
        2 => "the command is unknown: is this a hexapod's controller that speaks GCS 2.0?",
        3 => "the command is too long, or the command buffer ran over",
        4 => "a parameter could not be read",
        5 => "an axis is not referenced or its servo is off: reference it first (FRF, SVO)",
        7 => {
            "the position is out of limits: use smaller tilts and translations, or look at the soft limits \
             and the centre of rotation"
        }
        8 => "the velocity is out of limits: give the motion more time",
        9 => "the centre of rotation can be set only while U, V and W are 0",
        10 => "the controller was stopped by command, perhaps by another user of it",
        15 => "there is no such axis",
        17 => "a parameter is out of range",
        22 => "an axis is named twice",
        23 => "that axis cannot do this",
        24 => "the number of parameters is wrong",
        25 => "a number could not be read",
        26 => "a parameter is missing",
        27 => "a soft limit is out of range",
        31 => "the axis has no reference sensor",
        34 => "the command is not allowed for this stage",
        45 => "referencing failed: look for something in the platform's way, then reference it again",
        50 => "referencing is switched off",
        51 => "the axis is under the joystick's control: switch that off",
        52 => "the controller saw a communication error: check the cable",
        53 => "that cannot be done while the axis moves: wait, or stop it first",
        54 => {
            "there is no such parameter: does the controller's firmware know motion paths by consecutive MOV?"
        }
        56 => "the password is wrong",
        60 => "the command level is too low for this parameter",
        63 => "the controller is still starting: wait",
        64 => "the parameter can only be read",
        73 => "the wave generator runs: switch it off (WGO)",
        76 => "the interface's buffer ran over: lower rate_hz or raise the baud rate",
        220 => {
            "the set points ceased and the platform came to rest: the connection or this machine is too \
             slow, raise lead_s or lower rate_hz"
        }
        221 => "set points came faster than they were driven",
        301 => "the send buffer ran over",
        304 => "the command is too long",
        307 => "the command did not come whole in time",
        308 => "an operation took longer than expected",
        _ => "see the list of errors in the controller's manual",
    }
}

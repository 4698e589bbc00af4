//! The agreement between PI hexapods and their clients: General Command Set 2.0.
//!
//! Lives here: axes and positions ([`GcsPosition`]), the lines that carry them, numbers of errors ([`error`])
//! and of parameters. A driver and a simulated controller both take them from here, so that neither is the
//! other's measure; the tests compare them with what the vendor publishes (`tests/vectors/gcs.py` says what).
//! May not live here: connections.
//!
//! Facts are from the vendor's manual of the C-887 controller (MS204E), from the hexapods' manuals (H-850:
//! MS202E, H-845: MS222E), from its Python client `pipython` and from its ROS driver:
//! - a command ends with LF; a single byte 4, 5, 7, 8, 11 or 24 is a command by itself. Of an answer's lines
//!   all but the last end with a space before LF;
//! - an error is not answered: its number is stored until `ERR?` fetches it;
//! - `HLT` stops motion smoothly; `STP` and the byte 24 stop it abruptly, reference moves and macros
//!   included. After either the number of the error is 10 (`pipython`, GCS2Commands: "Halt the motion of
//!   given axes smoothly", "Stop all axes abruptly"; the controller's own `HLP?`: "Halt motion smoothly",
//!   "Stop all axes abruptly");
//! - X, Y, Z are mm and U, V, W degrees from the reference pose. The rotations follow each other in the order
//!   U, V, W about axes that go with the plate (MS202E 3.7, MS222E 3.7): `R = Rx(U) Ry(V) Rz(W)`, not the
//!   roll, pitch, yaw about fixed axes of [`Pose`];
//! - `SPA X 0x19001900 1` makes the path one of consecutive `MOV`, `SPA X 0x19001901 1` buffers their points
//!   until there are as many as parameter `0x19001903`, and `SCT T` sets their interval in ms.

use super::pose::Pose;

/// Names of the axes, in order.
pub const AXES: [&str; 6] = ["X", "Y", "Z", "U", "V", "W"];
/// Longest line that a controller takes, bytes.
pub const LINE_BYTES: usize = 1024;
/// Single byte that asks for the status register.
pub const STATUS: u8 = 4;
/// Single byte that asks which axes move: a hexadecimal number, a bit for each.
pub const MOVING: u8 = 5;
/// Single byte that asks whether the controller is ready; answered by [`READY`] if it is.
pub const IS_READY: u8 = 7;
/// Single byte that asks whether a macro runs: 0 or 1.
pub const MACRO: u8 = 8;
/// Single byte that asks for the free places of the buffer of points.
pub const FREE_POINTS: u8 = 11;
/// Single byte that stops all motion abruptly.
pub const STOP: u8 = 24;
/// Command that stops motion smoothly.
pub const HALT: &str = "HLT";
/// First byte of the answer to [`IS_READY`].
pub const READY: u8 = 0xb1;
/// Parameter that says where a path comes from: 0 from the profile generator, 1 from consecutive `MOV`.
pub const PATH_SOURCE: u32 = 0x1900_1900;
/// Parameter that says how a path begins: 0 with its first point, 1 when [`PATH_THRESHOLD`] points are there.
pub const PATH_BUFFERED: u32 = 0x1900_1901;
/// Parameter with the number of points that begin a buffered path.
pub const PATH_THRESHOLD: u32 = 0x1900_1903;
/// Parameter with the number of points in the buffer, which can only be read.
pub const PATH_POINTS: u32 = 0x1900_1904;

/// Numbers of errors, as `ERR?` gives them; the vendor's names follow.
pub mod error {
    /// `PARAM_SYNTAX`.
    pub const SYNTAX: u16 = 1;
    /// `UNKNOWN_COMMAND`.
    pub const UNKNOWN_COMMAND: u16 = 2;
    /// `COMMAND_TOO_LONG`.
    pub const TOO_LONG: u16 = 3;
    /// `MOVE_WITHOUT_REF_OR_NO_SERVO`.
    pub const NOT_ALLOWED: u16 = 5;
    /// `POS_OUT_OF_LIMITS`.
    pub const POSITION: u16 = 7;
    /// `VEL_OUT_OF_LIMITS`.
    pub const VELOCITY: u16 = 8;
    /// `STOP`.
    pub const STOPPED: u16 = 10;
    /// `INVALID_AXIS_IDENTIFIER`.
    pub const AXIS: u16 = 15;
    /// `PARAM_OUT_OF_RANGE`.
    pub const RANGE: u16 = 17;
    /// `PARAM_NR`: the number of parameters is wrong.
    pub const PARAMETER_COUNT: u16 = 24;
    /// `INVALID_REAL_NR`.
    pub const NUMBER: u16 = 25;
    /// `DYNAMIC_MOVE_IN_PROCESS`.
    pub const IN_MOTION: u16 = 53;
    /// `UNKNOWN_PARAMETER`.
    pub const UNKNOWN_PARAMETER: u16 = 54;
    /// `READ_ONLY_PARAMETER`.
    pub const READ_ONLY: u16 = 64;
    /// `INTERPOLATION_FIFO_UNDERRUN`: the points of a path ceased.
    pub const UNDERRUN: u16 = 220;
}

/// Translations, mm, and rotations, degrees, from the reference pose: X, Y, Z, U, V, W.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GcsPosition(pub [f64; 6]);

impl GcsPosition {
    /// Returns the position of a pose against the reference pose, which is level. With
    /// `R = Rx(U) Ry(V) Rz(W)`: `sin V = R₁₃`, `tan U = −R₂₃ / R₃₃`, `tan W = −R₁₂ / R₁₁`.
    pub fn of(pose: &Pose, reference: &Pose) -> Self {
        let r = pose.rotation();
        let mut out = [0.0; 6];
        for (i, mm) in out.iter_mut().take(3).enumerate() {
            *mm = 1e3 * (pose.position_m[i] - reference.position_m[i]);
        }
        out[3] = (-r[1][2]).atan2(r[2][2]).to_degrees();
        out[4] = r[0][2].clamp(-1.0, 1.0).asin().to_degrees();
        out[5] = (-r[0][1]).atan2(r[0][0]).to_degrees();
        Self(out)
    }

    /// Returns the pose at this position. From `R = Rz(yaw) Ry(pitch) Rx(roll)`: `sin pitch = −R₃₁`,
    /// `tan roll = R₃₂ / R₃₃`, `tan yaw = R₂₁ / R₁₁`.
    pub fn pose(&self, reference: &Pose) -> Pose {
        let [x, y, z, u, v, w] = self.0;
        let [(su, cu), (sv, cv), (sw, cw)] = [u, v, w].map(|d| d.to_radians().sin_cos());
        let (r11, r21, r31) = (cv * cw, cu * sw + su * sv * cw, su * sw - cu * sv * cw);
        let (r32, r33) = (su * cw + cu * sv * sw, cu * cv);
        let [x0, y0, z0] = reference.position_m;
        Pose {
            position_m: [x0 + 1e-3 * x, y0 + 1e-3 * y, z0 + 1e-3 * z],
            rpy_rad: [r32.atan2(r33), (-r31).clamp(-1.0, 1.0).asin(), r21.atan2(r11)],
        }
    }

    /// Returns a command with all six axes and their values, as `MOV X 1.500000 Y 0.000000 …`, without the
    /// line's end.
    pub fn command(&self, verb: &str) -> String {
        AXES.iter()
            .zip(self.0)
            .fold(verb.to_owned(), |line, (axis, value)| format!("{line} {axis} {value:.6}"))
    }

    /// Reads the answer to a question about all axes: `X=1.5` and so on, a line for each, in any order.
    /// `None` if an axis is missing or a value is no finite number.
    pub fn read_answer(answer: &str) -> Option<Self> {
        let mut found = [None; 6];
        for line in answer.lines() {
            if let Some((axis, value)) = line.trim().split_once('=')
                && let Some(place) = axis_number(axis.trim()).and_then(|i| found.get_mut(i))
            {
                *place = value.trim().parse().ok().filter(|v: &f64| v.is_finite());
            }
        }
        let mut out = [0.0; 6];
        for (value, found) in out.iter_mut().zip(found) {
            *value = found?;
        }
        Some(Self(out))
    }
}

/// Returns the place of an axis in [`AXES`]; `None` for a name that is none of them.
pub fn axis_number(name: &str) -> Option<usize> {
    AXES.iter().position(|axis| *axis == name)
}

/// Reads the arguments of a command, items and numbers in turn: `X 1.5 U -2`.
///
/// # Errors
/// [`error::PARAMETER_COUNT`] for none or an odd number of words, [`error::NUMBER`] for what is no finite
/// number.
pub fn read_pairs<'a>(words: &[&'a str]) -> Result<Vec<(&'a str, f64)>, u16> {
    if words.is_empty() || !words.len().is_multiple_of(2) {
        return Err(error::PARAMETER_COUNT);
    }
    words
        .chunks_exact(2)
        .map(|pair| match pair {
            [item, number] => {
                let value = number.parse().ok().filter(|v: &f64| v.is_finite());
                value.map(|v| (*item, v)).ok_or(error::NUMBER)
            }
            _ => Err(error::SYNTAX),
        })
        .collect()
}

/// Returns the lines of one answer: every line's end but the last has a space before it.
pub fn answer(lines: impl IntoIterator<Item = String>) -> String {
    let mut out = String::new();
    for line in lines {
        if !out.is_empty() {
            out.push_str(" \n");
        }
        out.push_str(&line);
    }
    out.push('\n');
    out
}

/// Returns whether these bytes are a whole answer: they end with a line's end without a space before it.
pub fn is_whole_answer(bytes: &[u8]) -> bool {
    bytes.ends_with(b"\n") && !bytes.ends_with(b" \n")
}

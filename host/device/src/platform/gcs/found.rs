//! The state in which a controller was found, and how it is brought back.

use std::fmt::Display;

use hexapod::gcs::{GcsPosition, MACRO, PATH_BUFFERED, PATH_SOURCE, PATH_THRESHOLD};

use super::line::Line;
use crate::platform::PlatformError;

/// A pivot point nearer to zero than this is there, mm.
const ZERO_MM: f64 = 1e-6;
/// Coordinate systems that a controller has from its maker: the hexapod's own, and those of levelling and
/// orientation.
const MAKERS: [&str; 3] = ["ZERO", "HEXAPOD", "PI_"];
/// An interval read back may differ by this much, by its printed form, a share: half a millisecond in ten
/// minutes.
const PRINTED: f64 = 1e-6;

/// The state that a program changes, or must know of.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Found {
    /// The origin of a path: consecutive moves?
    consecutive: bool,
    /// Parameters of the path and its interval, as the commands that set them.
    path: Vec<String>,
    /// Velocity of single moves, mm/s, if it says.
    velocity: Option<String>,
    /// True for each axis that is held.
    servo: [bool; 6],
    /// True if the platform knows where it is.
    pub(super) referenced: bool,
    /// The pose of the plate, if it knows.
    pub(super) position: Option<GcsPosition>,
    /// Names of the coordinate systems in force, if it says.
    frames: Option<String>,
    /// The questions that it can be asked.
    knows: Knows,
}

/// Questions that not every controller knows: one that is not known has no answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Knows {
    pivot: bool,
    frames: bool,
    macros: bool,
}

/// Returns the command that sets a parameter of the motion path.
pub(super) fn set(parameter: u32, value: impl Display) -> String {
    format!("SPA X 0x{parameter:X} {value}")
}

/// Asks for a parameter of the motion path.
fn parameter(line: &mut Line, parameter: u32) -> Result<String, PlatformError> {
    let question = format!("SPA? X 0x{parameter:X}");
    let answer = line.ask(&question)?;
    value(&answer).ok_or_else(|| line.nonsense(&question, &answer))
}

/// Returns the text after the equals sign of the only line.
fn value(answer: &str) -> Option<String> {
    answer.trim().rsplit_once('=').map(|(_, value)| value.trim().to_owned())
}

impl Found {
    /// Asks for everything; nothing is changed.
    ///
    /// # Errors
    /// A pivot point or a coordinate system that the rig file's platform does not have; no answer.
    pub(super) fn ask(line: &mut Line) -> Result<Self, PlatformError> {
        let help = line.ask("HLP?")?;
        let has = |verb: &str| help.lines().any(|l| l.split_whitespace().next() == Some(verb));
        let knows = Knows { pivot: has("SPI?"), frames: has("KEN?"), macros: has("#8") };
        let frames = knows.ask(line)?;
        let source = parameter(line, PATH_SOURCE)?;
        let buffered = set(PATH_BUFFERED, parameter(line, PATH_BUFFERED)?);
        let threshold = set(PATH_THRESHOLD, parameter(line, PATH_THRESHOLD)?);
        let answer = line.ask("SCT?")?;
        let interval = value(&answer).ok_or_else(|| line.nonsense("SCT?", &answer))?;
        let velocity = if has("VLS?") { Some(line.ask("VLS?")?.trim().to_owned()) } else { None };
        let referenced = !line.six("FRF?")?.contains(&0.0);
        Ok(Self {
            consecutive: source == "1",
            // Single moves come first: a path that was broken off is then over.
            path: vec![set(PATH_SOURCE, 0), buffered, threshold, format!("SCT T {interval}")],
            velocity,
            servo: line.six("SVO?")?.map(|on| on != 0.0),
            referenced,
            position: if referenced { Some(GcsPosition(line.six("POS?")?)) } else { None },
            frames,
            knows,
        })
    }

    /// Asks again, right before something moves, for what others may have changed since.
    ///
    /// # Errors
    /// A pivot point, a coordinate system or a macro that was not there; no answer.
    pub(super) fn ask_again(&self, line: &mut Line) -> Result<(), PlatformError> {
        self.knows.ask(line).map(drop)
    }

    /// Returns the commands that bring it back, in order.
    pub(super) fn back(&self) -> Vec<String> {
        let mut commands = self.path.clone();
        commands.extend(self.velocity.as_ref().map(|velocity| format!("VLS {velocity}")));
        commands
    }

    /// Returns what is not brought back, a sentence each: servos stay on, as legs that do not lock themselves
    /// let the load sink or drop where it is.
    pub(super) fn left(&self) -> Vec<String> {
        if self.servo.iter().all(|on| *on) {
            return Vec::new();
        }
        vec![
            "the platform's servos were off before the run and are left on: they hold the load where it is. \
             Switch them off (SVO) only where nothing can sink or fall, nobody being near"
                .to_owned(),
        ]
    }

    /// Returns what its owner should know before anything moves, a sentence each.
    pub(super) fn words(&self) -> Vec<String> {
        let mut words = Vec::new();
        if self.consecutive {
            words.push(
                "an earlier program has left it in the mode of consecutive moves (0x19001900 = 1), in which \
                 single moves are refused: it is left in that of single moves. What 0x19001901, 0x19001903 \
                 and SCT were before that program is not known; restarting the controller brings its own \
                 back"
                    .to_owned(),
            );
        }
        let velocity = self
            .velocity
            .as_ref()
            .map_or(String::new(), |v| format!(", the velocity of single moves {v} mm/s"));
        let path: Vec<&str> = self.path.iter().skip(1).map(|c| c.trim_start_matches("SPA X ")).collect();
        words.push(format!(
            "a path of consecutive moves is driven (0x19001900 = 1); found {}{velocity}; all of it is \
             brought back at the end",
            path.join(", ")
        ));
        if !self.servo.iter().all(|on| *on) {
            words.push(
                "its servos are off: they are switched on, and left on at the end, as the load may sink or \
                 fall without them"
                    .to_owned(),
            );
        }
        if !self.referenced {
            words.push(
                "it is not referenced: a reference move comes first, on a way and at a speed of its own, \
                 which nothing here checks"
                    .to_owned(),
            );
        }
        if !self.knows.macros {
            words.push("it does not say whether one of its macros runs: none must".to_owned());
        }
        words.push(match (&self.frames, self.knows.pivot) {
            (Some(frames), true) => format!(
                "coordinate systems {frames}, pivot point at zero: as in the rig \
                                             file"
            ),
            _ => "it does not say which coordinate systems and which pivot point are in force: they must be \
                  its maker's"
                .to_owned(),
        });
        words
    }
}

impl Knows {
    /// Asks for what poses depend on, and for whoever else commands; names of the coordinate systems in
    /// force, if it says.
    ///
    /// # Errors
    /// A pivot point or a coordinate system that the rig file's platform does not have; a macro that runs; no
    /// answer.
    fn ask(&self, line: &mut Line) -> Result<Option<String>, PlatformError> {
        if self.pivot {
            let answer = line.ask("SPI?")?;
            agree_on_pivot(&answer).map_err(|at| match at {
                Some(at) => PlatformError::Refused(format!(
                    "its pivot point is at {at} mm, and the rig file's poses are those of the plate's \
                     origin: bring it back by SPI, as SPI R 0 S 0 T 0"
                )),
                None => line.nonsense("SPI?", &answer),
            })?;
        }
        if self.macros {
            let answer = String::from_utf8_lossy(&line.ask_byte(MACRO)?).into_owned();
            match answer.trim().parse::<u32>() {
                Ok(0) => {}
                Ok(_) => {
                    return Err(PlatformError::Refused(
                        "one of its macros runs, which may move it at any time: end it first (MAC STOP, or \
                         #24 while nobody is near)"
                            .to_owned(),
                    ));
                }
                Err(_) => return Err(line.nonsense("#8", &answer)),
            }
        }
        if self.frames { frames(&line.ask("KEN?")?).map(Some) } else { Ok(None) }
    }
}

/// Asks for the interval of consecutive moves, which a controller may have rounded: the points would run out,
/// or be driven faster than they are meant.
///
/// # Errors
/// It is another than this, ms; no answer.
pub(super) fn agree_on_interval(line: &mut Line, wanted_ms: f64) -> Result<(), PlatformError> {
    let answer = line.ask("SCT?")?;
    let has_ms: Option<f64> = value(&answer).and_then(|value| value.parse().ok());
    match has_ms {
        Some(ms) if (ms / wanted_ms - 1.0).abs() <= PRINTED => Ok(()),
        Some(ms) => Err(PlatformError::Refused(format!(
            "it takes a point every {ms} ms (SCT), and {wanted_ms:.6} ms were asked for: give the address a \
             rate_hz whose interval it takes as it is, such as 100, 200 or 250"
        ))),
        None => Err(line.nonsense("SCT?", &answer)),
    }
}

/// Checks whether the pivot point is at zero; where it is, otherwise, if that is understood.
fn agree_on_pivot(answer: &str) -> Result<(), Option<String>> {
    let mut off = Vec::new();
    for line in answer.lines() {
        let (name, value) = line.trim().split_once('=').ok_or(None)?;
        let mm: f64 = value.trim().parse().map_err(|_| None)?;
        if mm.is_nan() || mm.abs() > ZERO_MM {
            off.push(format!("{} = {mm}", name.trim()));
        }
    }
    if off.is_empty() { Ok(()) } else { Err(Some(off.join(", "))) }
}

/// Returns the coordinate systems in force, if all are the maker's.
fn frames(answer: &str) -> Result<String, PlatformError> {
    let names: Vec<&str> =
        answer.lines().filter_map(|l| l.split('=').next()).map(str::trim).filter(|n| !n.is_empty()).collect();
    match names.iter().find(|name| !MAKERS.iter().any(|makers| name.starts_with(makers))) {
        Some(other) => Err(PlatformError::Refused(format!(
            "its coordinate system {other} is in force, and the rig file's poses are those of the hexapod's \
             own: bring that back by KEN ZERO"
        ))),
        None if names.is_empty() => Ok("none".to_owned()),
        None => Ok(names.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pivot_and_a_frame_of_its_own_are_named() {
        assert_eq!(agree_on_pivot("R=0.000000\nS=-0.000000\nT=0"), Ok(()));
        assert_eq!(agree_on_pivot("R=0\nS=0\nT=12.5"), Err(Some("T = 12.5".to_owned())));
        assert_eq!(agree_on_pivot("R=0\nS=0\nT=NaN"), Err(Some("T = NaN".to_owned())));
        assert_eq!(agree_on_pivot("what"), Err(None));
        assert_eq!(frames("PI_Levelling=KLF\nZERO=KSD").unwrap(), "PI_Levelling, ZERO");
        let said = frames("MINE=KSD").unwrap_err().to_string();
        assert!(said.contains("MINE") && said.contains("KEN ZERO"), "{said}");
    }
}

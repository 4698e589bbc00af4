//! Asks whether a platform may move: last of all, and once more by a countdown.

use std::io::{self, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::Failure;
use crate::screen::question::answered;
use crate::screen::tell::tell;
use rigident::device::session::INTERRUPTED;

/// The time that anybody has to stop it by a key, s.
const COUNTDOWN_S: u64 = 5;

/// The form of the agreement to a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Agreed {
    /// By `--yes`.
    Beforehand,
    /// By a yes at the terminal.
    AtTerminal,
}

impl Agreed {
    /// Returns how, for the trace.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Beforehand => "--yes",
            Self::AtTerminal => "yes at the terminal",
        }
    }
}

/// Refuses early what nobody could agree to later.
///
/// # Errors
/// Bad input: no `--yes`, and no terminal to ask at.
pub(crate) fn can_be_asked(yes: bool) -> Result<(), Failure> {
    if yes || io::stdin().is_terminal() {
        return Ok(());
    }
    Err(Failure::input(
        "nothing was moved: there is no terminal to ask at, give --yes if nobody is in the platform's \
         way",
    ))
}

/// Goes on by `--yes`, or by a yes at the terminal.
///
/// # Errors
/// Anything but a clear yes; Ctrl-C.
pub(crate) fn agree(yes: bool) -> Result<Agreed, Failure> {
    can_be_asked(yes)?;
    if yes {
        return Ok(Agreed::Beforehand);
    }
    let input = io::stdin();
    forget_typed(&input);
    tell(format_args!("Is its way clear, and shall it move [y/N]? "), "");
    // A terminal that cannot be written to cannot be read from either.
    let _ = io::stderr().flush();
    let read = move || {
        let mut answer = String::new();
        input.read_line(&mut answer).map(|_| answer)
    };
    match answered(read, &INTERRUPTED)? {
        Some(answer) if agreed(&answer) => Ok(Agreed::AtTerminal),
        Some(_) => Err(Failure::input("nothing was moved, as you said")),
        None => Err(Failure::interrupted("stopped before the experiment began; nothing was moved")),
    }
}

/// Counts down to the motion where somebody sits at a terminal: any key ends it.
///
/// # Errors
/// A key, or Ctrl-C: nothing was moved.
pub(crate) fn count_down() -> Result<(), Failure> {
    let input = io::stdin();
    if !input.is_terminal() {
        return Ok(());
    }
    forget_typed(&input);
    tell(format_args!("It moves in {COUNTDOWN_S} s; any key stops it:"), "");
    let second = |left: u64| tell(format_args!("\u{7} {left}"), "");
    let ended = counted(&input, COUNTDOWN_S, &INTERRUPTED, second);
    tell(format_args!(""), "\n");
    match ended {
        Counted::Down => Ok(()),
        Counted::Key => {
            forget_typed(&input);
            Err(Failure::interrupted("stopped by a key in the countdown; nothing was moved"))
        }
        Counted::Interrupted => {
            Err(Failure::interrupted("stopped before the experiment began; nothing was moved"))
        }
    }
}

/// The end of a countdown.
#[derive(Debug, PartialEq, Eq)]
enum Counted {
    Down,
    Key,
    Interrupted,
}

#[cfg(unix)]
fn counted(
    terminal: &impl std::os::fd::AsFd,
    seconds: u64,
    interrupted: &AtomicBool,
    each: impl FnMut(u64),
) -> Counted {
    use rustix::termios::{LocalModes, OptionalActions, tcgetattr, tcsetattr};
    // Each key by itself, and unseen.
    let before = tcgetattr(terminal).ok();
    if let Some(mut modes) = before.clone() {
        modes.local_modes.remove(LocalModes::ICANON | LocalModes::ECHO);
        // Where that cannot be had, the return key stops it.
        let _ = tcsetattr(terminal, OptionalActions::Now, &modes);
    }
    let typed = || rustix::io::ioctl_fionread(terminal).is_ok_and(|waiting| waiting > 0);
    let ended = watched(seconds, &typed, interrupted, each);
    if let Some(modes) = before {
        let _ = tcsetattr(terminal, OptionalActions::Now, &modes);
    }
    ended
}

#[cfg(not(unix))]
fn counted(_: &io::Stdin, seconds: u64, interrupted: &AtomicBool, each: impl FnMut(u64)) -> Counted {
    use ratatui::crossterm::terminal::{disable_raw_mode, enable_raw_mode};
    // Each key by itself, and unseen. Where there is no console nobody types.
    let is_console = enable_raw_mode().is_ok();
    let ended = watched(seconds, &|| is_console && key_typed(), interrupted, each);
    if is_console {
        let _ = disable_raw_mode();
    }
    ended
}

/// Takes what waits at the console; true if a key is among it.
#[cfg(not(unix))]
fn key_typed() -> bool {
    use ratatui::crossterm::event::{Event, KeyEventKind, poll, read};
    let mut typed = false;
    while poll(Duration::ZERO).unwrap_or(false) {
        match read() {
            Ok(Event::Key(key)) => typed |= key.kind == KeyEventKind::Press,
            Ok(_) => {}
            Err(_) => break,
        }
    }
    typed
}

fn watched(
    seconds: u64,
    typed: &dyn Fn() -> bool,
    interrupted: &AtomicBool,
    mut each: impl FnMut(u64),
) -> Counted {
    let begun = Instant::now();
    let mut shown = 0;
    while begun.elapsed() < Duration::from_secs(seconds) {
        if interrupted.load(Ordering::Relaxed) {
            return Counted::Interrupted;
        }
        if typed() {
            return Counted::Key;
        }
        if begun.elapsed() >= Duration::from_secs(shown) {
            each(seconds - shown);
            shown += 1;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    Counted::Down
}

/// Forgets what was typed before the question was there to be read.
#[cfg(unix)]
fn forget_typed(terminal: &impl std::os::fd::AsFd) {
    // What is no terminal holds nothing typed.
    let _ = rustix::termios::tcflush(terminal, rustix::termios::QueueSelector::IFlush);
}

#[cfg(not(unix))]
fn forget_typed(_: &io::Stdin) {
    key_typed();
}

fn agreed(answer: &str) -> bool {
    ["y", "yes"].contains(&answer.trim().to_lowercase().as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_clear_yes_moves_the_platform() {
        assert!(agreed("y\n") && agreed(" Yes \n"));
        let (stop, silent) = (AtomicBool::new(false), || Ok("y\n".to_owned()));
        assert_eq!(answered(silent, &stop).unwrap().as_deref(), Some("y\n"));
        for answer in ["", "\n", "n\n", "yess\n", "ok\n", "y y\n"] {
            assert!(!agreed(answer), "{answer:?}");
        }
    }

    /// Returns the two ends of a terminal: the keyboard, and the one that the program reads from.
    #[cfg(unix)]
    fn terminal() -> [std::fs::File; 2] {
        use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
        let keyboard = std::fs::File::from(openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap());
        grantpt(&keyboard).unwrap();
        unlockpt(&keyboard).unwrap();
        let name = ptsname(&keyboard, Vec::new()).unwrap().into_string().unwrap();
        [keyboard, std::fs::File::options().read(true).write(true).open(name).unwrap()]
    }

    #[cfg(unix)]
    #[test]
    fn keys_typed_before_the_question_are_no_answer() {
        let [mut keyboard, terminal] = terminal();
        keyboard.write_all(b"y\n").unwrap();
        // The line is there to be read as soon as the terminal has seen it.
        let waiting = || rustix::io::ioctl_fionread(&terminal).unwrap();
        while waiting() == 0 {
            std::thread::yield_now();
        }
        forget_typed(&terminal);
        assert_eq!(waiting(), 0);
    }

    #[cfg(unix)]
    #[test]
    fn any_key_ends_the_countdown_and_the_terminal_is_as_it_was() {
        let [mut keyboard, terminal] = terminal();
        let modes = || rustix::termios::tcgetattr(&terminal).unwrap().local_modes;
        let (before, calm) = (modes(), AtomicBool::new(false));
        let mut seconds = Vec::new();
        assert_eq!(counted(&terminal, 2, &calm, |left| seconds.push(left)), Counted::Down);
        assert_eq!(seconds, [2, 1]);
        let begun = Instant::now();
        // A space, and no return.
        let ended = counted(&terminal, 3600, &calm, |_| keyboard.write_all(b" ").unwrap());
        assert!(ended == Counted::Key && begun.elapsed() < Duration::from_secs(5), "{ended:?}");
        assert_eq!(modes(), before);
        forget_typed(&terminal);
        assert_eq!(counted(&terminal, 3600, &AtomicBool::new(true), |_| {}), Counted::Interrupted);
    }

    #[test]
    fn a_stop_at_the_question_does_not_wait_for_an_answer() {
        let stop = AtomicBool::new(false);
        let never = || {
            std::thread::sleep(Duration::from_secs(3600));
            Ok(String::new())
        };
        let begun = std::time::Instant::now();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                std::thread::sleep(Duration::from_millis(100));
                stop.store(true, Ordering::Relaxed);
            });
            assert_eq!(answered(never, &stop).unwrap(), None);
        });
        assert!(begun.elapsed() < Duration::from_secs(5));
    }
}

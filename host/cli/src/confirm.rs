use std::io::{self, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use super::Failure;
use super::tell::tell;
use rigident::device::session::INTERRUPTED;
use rigident::platform::check::Summary;

/// Shows what is about to move and goes on by `--yes`, or by a yes at the terminal.
pub(super) fn confirm(summary: &Summary, address: &str, yes: bool) -> Result<(), Failure> {
    let input = io::stdin();
    if io::stderr().is_terminal() {
        // Colours and concealment that something before has left on.
        let _ = io::stderr().write_all(b"\x1b[0m");
    }
    tell(format_args!("{address}: {summary}"), "");
    if yes {
        return Ok(());
    }
    if !input.is_terminal() {
        return Err(Failure::input(
            "nothing was moved: there is no terminal to ask at, give --yes if nobody stands in the platform's way",
        ));
    }
    forget_typed(&input);
    tell(format_args!("Is its way clear, and shall it move [y/N]? "), "");
    // A terminal that cannot be written to cannot be read from either.
    let _ = io::stderr().flush();
    let read = move || {
        let mut answer = String::new();
        input.read_line(&mut answer).map(|_| answer)
    };
    match answered(read, &INTERRUPTED)? {
        Some(answer) if agreed(&answer) => Ok(()),
        Some(_) => Err(Failure::input("nothing was moved, as you said")),
        None => Err(Failure::interrupted("stopped before the experiment began; nothing was moved")),
    }
}

/// Forgets what was typed before the question was there to be read.
#[cfg(unix)]
fn forget_typed(terminal: &impl std::os::fd::AsFd) {
    // What is no terminal holds nothing typed.
    let _ = rustix::termios::tcflush(terminal, rustix::termios::QueueSelector::IFlush);
}

#[cfg(not(unix))]
fn forget_typed(_: &io::Stdin) {}

/// What `read` gives, in a thread that is left behind if nobody answers before `interrupted`: `None` then.
pub(super) fn answered(
    read: impl FnOnce() -> io::Result<String> + Send + 'static,
    interrupted: &AtomicBool,
) -> Result<Option<String>, Failure> {
    let (tell, answer) = mpsc::channel();
    std::thread::spawn(move || {
        // Nobody listens any more once the user has stopped it.
        let _ = tell.send(read());
    });
    loop {
        match answer.recv_timeout(Duration::from_millis(50)) {
            _ if interrupted.load(Ordering::Relaxed) => return Ok(None),
            Ok(answer) => return answer.map(Some).map_err(Failure::input),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Ok(Some(String::new())),
        }
    }
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
        let (told, silent) = (AtomicBool::new(false), || Ok("y\n".to_owned()));
        assert_eq!(answered(silent, &told).unwrap().as_deref(), Some("y\n"));
        for answer in ["", "\n", "n\n", "yess\n", "ok\n", "y y\n"] {
            assert!(!agreed(answer), "{answer:?}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn what_was_typed_before_the_question_is_no_answer() {
        use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
        let mut keyboard = std::fs::File::from(openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap());
        grantpt(&keyboard).unwrap();
        unlockpt(&keyboard).unwrap();
        let name = ptsname(&keyboard, Vec::new()).unwrap().into_string().unwrap();
        let terminal = std::fs::File::options().read(true).write(true).open(name).unwrap();
        keyboard.write_all(b"y\n").unwrap();
        // The line is there to be read as soon as the terminal has seen it.
        let waiting = || rustix::io::ioctl_fionread(&terminal).unwrap();
        while waiting() == 0 {
            std::thread::yield_now();
        }
        forget_typed(&terminal);
        assert_eq!(waiting(), 0);
    }

    #[test]
    fn a_stop_at_the_question_does_not_wait_for_an_answer() {
        let told = AtomicBool::new(false);
        let never = || {
            std::thread::sleep(Duration::from_secs(3600));
            Ok(String::new())
        };
        let begun = std::time::Instant::now();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                std::thread::sleep(Duration::from_millis(100));
                told.store(true, Ordering::Relaxed);
            });
            assert_eq!(answered(never, &told).unwrap(), None);
        });
        assert!(begun.elapsed() < Duration::from_secs(5));
    }
}

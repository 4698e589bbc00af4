use std::io::{self, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use super::Failure;
use rigident::device::session::INTERRUPTED;
use rigident::platform::check::Summary;

/// Shows what is about to move and goes on by `--yes`, or by a yes at the terminal.
pub(super) fn confirm(summary: &Summary, address: &str, yes: bool) -> Result<(), Failure> {
    let input = io::stdin();
    eprint!("{address}: {summary}");
    if yes {
        return Ok(());
    }
    if !input.is_terminal() {
        return Err(Failure::input(
            "nothing was moved: there is no terminal to ask at, give --yes if nobody stands in the platform's way",
        ));
    }
    eprint!("Is its way clear, and shall it move [y/N]? ");
    // A terminal that cannot be written to cannot be read from either.
    let _ = std::io::stderr().flush();
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

use std::io::{BufRead, IsTerminal, Write};

use super::Failure;
use crate::platform::check::Summary;

/// Shows what is about to move and goes on by `--yes`, or by a yes at the terminal.
pub(super) fn confirm(summary: &Summary, address: &str, yes: bool) -> Result<(), Failure> {
    let input = std::io::stdin();
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
    let mut answer = String::new();
    input.lock().read_line(&mut answer).map_err(Failure::input)?;
    if agreed(&answer) { Ok(()) } else { Err(Failure::input("nothing was moved, as you said")) }
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
        for answer in ["", "\n", "n\n", "yess\n", "ok\n", "y y\n"] {
            assert!(!agreed(answer), "{answer:?}");
        }
    }
}

//! The emulated board as other verbs start it.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use anyhow::{Result, bail};

use crate::firmware;
use crate::places;
use crate::process;
use crate::toolchain::Core;

/// The binary of the board crate that counts instructions, and that can be asked to end badly.
pub const BENCH: &str = "bench";
/// Exit statuses of the board after a panic and after a fault of the processor.
const BAD_ENDS: [(&str, i32); 2] = [("panic", 101), ("fault", 102)];
const LIMIT: Duration = Duration::from_secs(30);

/// Returns the emulator with one instruction a nanosecond, running `elf` to its end; the program gets `words`
/// as its command line.
pub fn emulator(elf: &Path, words: &[&str]) -> Command {
    let words: String = words.iter().map(|word| format!(",arg={word}")).collect();
    let mut command = process::command("qemu-system-arm", places::root());
    command.args(["-M", "mps2-an386", "-display", "none", "-monitor", "none", "-serial", "null"]);
    command.args(["-icount", "shift=0", "-semihosting-config"]);
    command.arg(format!("enable=on,target=native{words}")).arg("-kernel").arg(elf);
    command
}

/// Checks that a panic and a fault on the board each end the emulator with the status that says so.
pub fn bad_ends(core: Core) -> Result<()> {
    let elf = firmware::build_binary(core, BENCH, &[firmware::WATCH])?;
    for (word, expected) in BAD_ENDS {
        let status = process::status_bounded(&mut emulator(&elf, &[BENCH, word]), LIMIT)?;
        match status.map(|status| status.code()) {
            Some(Some(code)) if code == expected => println!("a {word} ends with status {code}"),
            Some(_) => bail!("a {word} on the board should end with status {expected}"),
            None => bail!("a {word} on the board did not end within {} s", LIMIT.as_secs()),
        }
    }
    Ok(())
}

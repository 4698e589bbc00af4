//! The verb `board-test`: the procedure for the first person with a board, whose output is a page.
//!
//! Steps that the device answers by itself are done; the others are printed with what to do and what to look
//! for, to be filled in by hand. Of every step the page says whether it was done on silicon: one against the
//! emulator never is.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use serde_json::Value;

use crate::firmware::{self, Board};
use crate::places;
use crate::process;
use crate::toolchain::{self, Core};

/// The emulator's message about its second serial port.
const REDIRECTED: &str = "char device redirected to ";
const LIMIT: Duration = Duration::from_secs(30);

/// Which device, and where the page goes.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// The board's serial port. Without one the page says what is missing.
    #[arg(long)]
    port: Option<String>,
    /// Try the procedure itself, against the STM32F405's image in the emulator: nothing of it is done on
    /// silicon.
    #[arg(long, conflicts_with = "port")]
    emulated: bool,
    /// The page, in Markdown.
    #[arg(long, default_value = "board-test.md")]
    page: PathBuf,
}

/// The outcome of a step.
enum Outcome {
    Good(String),
    Bad(String),
    /// The step is not done: there is nobody but a person to do it.
    ByHand,
    /// The step is not done: no board answers, for this reason.
    NoBoard(String),
}

/// A question that the device's own words answer: its name, what is looked at, and what of the words is
/// right.
type Asked = (&'static str, &'static str, fn(&Value) -> std::result::Result<String, String>);

const ASKED: [Asked; 7] = [
    ("answer", "it answers, and has the messages of this program", |info| {
        let firmware = info["firmware"].as_str().unwrap_or_default();
        right(info["same_messages"] == true, format!("firmware {firmware}, {}", info["firmware_hash"]))
    }),
    ("number", "the chip's own number is there", |info| {
        right(!info["unique_id"].is_null(), info["unique_id"].to_string())
    }),
    ("crystal", "time comes from a crystal", |info| {
        right(info["clock"] == "crystal", format!("time from {}", info["time_from"]))
    }),
    ("start", "it was not started by a watchdog, a panic, a fault or a sagging supply", |info| {
        let reset = info["reset"].as_str().unwrap_or_default();
        right(["power_on", "pin", "software"].contains(&reset), format!("started by {}", info["started_by"]))
    }),
    ("end", "its last program did not end badly", |info| {
        right(info["ended_at"].is_null(), format!("ended at {}", info["ended_at"]))
    }),
    ("line", "no byte of the line was lost or damaged", |info| {
        let counters = &info["counters"];
        let none = counters["bad_frames"] == 0 && counters["overruns"] == 0;
        right(none, format!("bad frames {}, overruns {}", counters["bad_frames"], counters["overruns"]))
    }),
    ("stack", "the stack has been no deeper than three quarters of its size", |info| {
        let bytes = &info["counters"]["stack_bytes"];
        let (deepest, size) = (bytes[0].as_u64().unwrap_or(0), bytes[1].as_u64().unwrap_or(0));
        right(deepest > 0 && 4 * deepest < 3 * size, format!("{deepest} of {size} bytes"))
    }),
];

/// The steps that a person does: the feature that each shows, and the procedure.
const BY_HAND: [(&str, &str); 12] = [
    (
        "crystal's frequency",
        "a counter at MCO2: 84 MHz/n within 100 parts in a million; else a pulse generator of 1000.000 Hz at \
         PA1: `rate_error_ppm` within 100",
    ),
    (
        "rates of the sensors",
        "`rigident doctor`: rates of converter and IMU, errors within 500 and 10 000 parts in a million",
    ),
    (
        "inputs shorted",
        "AINnP and AINnN of all gauges to 1.25 V, ten seconds: rms of each below 1.2 µV at gain 64",
    ),
    ("IMU in six poses", "each axis up and down for five seconds: 9.81 m/s² within 0.2; `lost` 0"),
    (
        "link at 2 Mbaud",
        "a loop from TX to RX of the adapter, then the device at 2 000 000 baud for an hour: `bad_frames` \
         and `overruns` 0",
    ),
    (
        "erase times",
        "`rigident replay` twice, the log of the time from configure to the first checkpoint: below 4 s a \
         sector pair",
    ),
    ("watchdog", "a test build that stops in a loop: `started_by` its watchdog after 4 to 11 s"),
    (
        "panic and fault",
        "a test build that panics and one that jumps to zero: `ended_at` names line, or pc and status",
    ),
    ("stack's guard", "a test build that recurses: `ended_at` with a fault, statics unchanged"),
    (
        "brown-out",
        "a bench supply to 2.6 V and back, 100 times while it measures: `started_by` a supply that sagged, \
         `kept` whole",
    ),
    ("power cuts", "a relay in the supply, cut at random during checkpoints, 1000 times: `kept` whole"),
    ("crystal stops", "a screwdriver on the crystal: `started_by` says that the clock was lost"),
];

fn right(is: bool, words: String) -> std::result::Result<String, String> {
    if is { Ok(words) } else { Err(words) }
}

/// Goes through the procedure and writes the page; fails if a step that the device answers is not as it
/// should be.
pub fn run(options: &Options, core: Option<Core>) -> Result<()> {
    let emulator = options.emulated.then(|| Emulator::start(core)).transpose()?;
    let port = emulator.as_ref().map(|emulator| &emulator.port).or(options.port.as_ref());
    let answer = match port {
        Some(port) => info(port, &[]).map_err(|why| format!("{port} does not answer: {why:#}")),
        None => Err(NO_PORT.to_owned()),
    };
    let restart = || port.map_or(Outcome::ByHand, |port| restarted(port));
    let steps = steps(&answer, restart);
    let info = answer.as_ref().ok();
    let page = page(info, &steps, emulator.is_some());
    std::fs::write(&options.page, &page)
        .with_context(|| format!("cannot write {}", options.page.display()))?;
    println!("{page}");
    if let Err(why) = answer {
        bail!("no step was done: {why}; what is to be done is in {}", options.page.display());
    }
    // What the emulator lacks is no fault of the board.
    let bad: Vec<&str> = steps.iter().filter(|(.., r)| matches!(r, Outcome::Bad(_))).map(|s| s.0).collect();
    if bad.is_empty() || emulator.is_some() {
        Ok(())
    } else {
        bail!("not as it should be: {}", bad.join(", "))
    }
}

/// The message where no port is named.
const NO_PORT: &str = "no board: name its serial port by --port (`rigident ports` lists them), or try the \
                       procedure by --emulated";

/// Returns all steps with what became of them: of those that a device answers, nothing where none answers.
fn steps(
    answer: &std::result::Result<Value, String>,
    restart: impl FnOnce() -> Outcome,
) -> Vec<(&'static str, &'static str, Outcome)> {
    let asked = |ask: fn(&Value) -> _| match answer {
        Ok(info) => of(ask(info)),
        Err(why) => Outcome::NoBoard(why.clone()),
    };
    let mut steps: Vec<_> = ASKED.iter().map(|(name, shows, ask)| (*name, *shows, asked(*ask))).collect();
    let restarts = match answer {
        Ok(_) => restart(),
        Err(why) => Outcome::NoBoard(why.clone()),
    };
    steps.push(("restart", "it starts anew when it is asked to, and says so", restarts));
    steps.extend(BY_HAND.iter().map(|(name, how)| (*name, *how, Outcome::ByHand)));
    steps
}

fn of(answer: std::result::Result<String, String>) -> Outcome {
    answer.map_or_else(Outcome::Bad, Outcome::Good)
}

fn info(port: &str, more: &[&str]) -> Result<Value> {
    let mut command = process::cargo(places::root());
    command.args(["run", "--quiet", "--", "info", "--json", "--port", port]).args(more);
    Ok(serde_json::from_str(&process::output(&mut command)?)?)
}

fn restarted(port: &str) -> Outcome {
    match info(port, &["--restart"]) {
        Ok(info) if info["reset"] == "software" => Outcome::Good("started by the host's command".into()),
        Ok(info) => Outcome::Bad(format!("started by {}", info["started_by"])),
        Err(error) => Outcome::Bad(format!("{error:#}")),
    }
}

/// Returns the page.
fn page(info: Option<&Value>, steps: &[(&str, &str, Outcome)], emulated: bool) -> String {
    let mut text = String::from("# A board's test\n\n");
    match info {
        Some(info) => {
            let number = info["unique_id"].as_str().unwrap_or("none");
            let _ = writeln!(text, "Board {}, chip {number}, firmware {}.", info["board"], info["firmware"]);
        }
        None => text.push_str("**No board answered: nothing on this page was done.**\n"),
    }
    if emulated {
        text.push_str("\n**The emulator: nothing on this page was done on silicon.**\n");
    }
    text.push_str("\n| step | what it shows, or how it is done | on silicon | result |\n|---|---|---|---|\n");
    for (name, shows, result) in steps {
        let (done, result) = match result {
            Outcome::Good(words) => (!emulated, format!("good: {words}")),
            Outcome::Bad(words) => (!emulated, format!("**not as it should be**: {words}")),
            Outcome::ByHand => (false, "not done".to_owned()),
            Outcome::NoBoard(why) => (false, format!("**missing**: {}", why.replace(['\n', '|'], " "))),
        };
        let _ = writeln!(text, "| {name} | {shows} | {} | {result} |", if done { "yes" } else { "no" });
    }
    text
}

/// The STM32F405's image in the emulator.
struct Emulator {
    child: Child,
    port: String,
}

impl Emulator {
    fn start(core: Option<Core>) -> Result<Self> {
        let elf = firmware::build_for(Board::F405, toolchain::choose(core)?, &[])?;
        let words = places::own().join("board-test-emulator");
        let output = std::fs::File::create(&words)?;
        let mut command = process::command("qemu-system-arm", places::root());
        command.args(["-M", "netduinoplus2", "-display", "none", "-monitor", "none", "-serial", "null"]);
        command.args(["-serial", "pty", "-kernel"]).arg(elf);
        let child = command.stdout(output.try_clone()?).stderr(Stdio::from(output)).spawn()?;
        let mut emulator = Self { child, port: String::new() };
        let deadline = Instant::now() + LIMIT;
        while emulator.port.is_empty() {
            let text = std::fs::read_to_string(&words)?;
            let named = text.lines().find_map(|line| line.strip_prefix(REDIRECTED)?.split(' ').next());
            emulator.port = named.unwrap_or_default().to_owned();
            if Instant::now() > deadline {
                bail!("the emulator names no port: {text}");
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        Ok(emulator)
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_page_says_of_each_step_whether_it_was_done_on_silicon() {
        let info =
            json!({ "board": "stm32f405", "same_messages": true, "unique_id": null, "clock": "internal" });
        let all = steps(&Ok(info.clone()), || Outcome::Good("by the host".to_owned()));
        let (real, emulated) = (page(Some(&info), &all, false), page(Some(&info), &all, true));
        assert_eq!(real.matches("| yes |").count(), ASKED.len() + 1);
        assert_eq!(
            (emulated.matches("| yes |").count(), real.matches("not done").count()),
            (0, BY_HAND.len())
        );
        // A chip without a number, and one whose crystal does not start.
        assert!(real.contains("| number | the chip's own number is there | yes | **not as it should be**"));
        assert!(real.contains("| crystal | time comes from a crystal | yes | **not as it should be**"));
        assert!(emulated.contains("nothing on this page was done on silicon"));
    }

    #[test]
    fn a_page_without_a_board_names_the_missing_part_of_each_step() {
        let all = steps(&Err(NO_PORT.to_owned()), || panic!("nobody is there to be restarted"));
        let page = page(None, &all, false);
        assert!(page.contains("No board answered") && !page.contains("| yes |"));
        let missing = "**missing**: no board: name its serial port by --port";
        assert_eq!(page.matches(missing).count(), ASKED.len() + 1, "{page}");
        assert_eq!(page.matches("| no | not done |").count(), BY_HAND.len());
    }
}

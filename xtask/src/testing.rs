//! Runs cargo's tests, counts them, and leaves out those that need what is not here.
//!
//! A test that needs something from outside the repository is `#[ignore = "needs …"]` and says in its name
//! what it needs, by the word in [`Need`]. Plain `cargo test` prints it as ignored; here it runs if what it
//! needs is there and is counted as skipped if not. Where `CI` is set, what is not there is a failure.

use std::collections::BTreeSet;
use std::fmt;
use std::io::{BufRead, BufReader, Write};
use std::ops::AddAssign;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

use crate::places;
use crate::process;
use crate::setup;

/// The tool that some tests need.
#[derive(Clone, Copy)]
struct Need {
    /// The word in the names of the tests that need it.
    word: &'static str,
    /// The tool, and how it is installed.
    what: &'static str,
}

const BOARD: Need = Need { word: "emulated", what: "firmware and qemu-system-arm: cargo xtask firmware" };
const FLASHED: Need = Need {
    word: "flashed_image",
    what: "the STM32F405's images and qemu-system-arm: cargo xtask firmware --board stm32f405",
};
const SECOND_CORE: Need = Need {
    word: "second_core",
    what: "the kernels for a Cortex-M33 and qemu-system-arm: cargo xtask firmware --board rp2350",
};
const DATA: Need = Need { word: "shared_data", what: "the recordings and robots in ../shared/data" };
const CASES: Need =
    Need { word: "shared_cases", what: "the small files of other programs in ../shared/cases" };
const READER: Need = Need { word: "mcap_reader", what: "mcap and mcap-ros2-support in Python" };
const PINOCCHIO: Need = Need { word: "live_pinocchio", what: "Pinocchio (the wheel pin) in Python" };
const ROBOTS: Need = Need {
    word: "published_robots",
    what: "Pinocchio (the wheel pin) and robot descriptions (the wheel example-robot-data) in Python",
};
const CLIENT: Need = Need { word: "vendors_client", what: "pipython, the vendor's client, in Python" };
const C3D: Need = Need { word: "independent_c3d", what: "ezc3d in Python" };
const ROS: Need = Need { word: "independent_ros_reader", what: "rosbags in Python" };
const SENSORS: Need = Need { word: "independent_sensors", what: "NetFT, ur_rtde and foxglove-sdk in Python" };
const OPENSIM: Need = Need { word: "independent_opensim", what: "opensim in Python" };
const SPRINGS: Need = Need { word: "springs_independent", what: "numpy in Python" };
const BROWSER: Need = Need { word: "in_a_browser", what: "chromium: cargo xtask setup" };

/// The variable by which tests know that they may take long: studies run at full length.
pub const NIGHTLY: &str = "RIGIDENT_NIGHTLY";

/// The number of tests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Tests that passed.
    pub passed: u32,
    /// Tests that failed.
    pub failed: u32,
    /// Tests that did not run because something they need is not here.
    pub skipped: u32,
}

impl AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.passed += other.passed;
        self.failed += other.failed;
        self.skipped += other.skipped;
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { passed, failed, skipped } = self;
        write!(formatter, "{passed} passed, {failed} failed, {skipped} skipped")
    }
}

/// The tools here for tests to use.
#[derive(Clone)]
pub struct Surroundings {
    missing: Vec<Need>,
    firmware: Option<PathBuf>,
    python: Option<PathBuf>,
    nightly: bool,
}

impl Surroundings {
    /// Searches for everything that some tests need, and prints what is not here.
    pub fn look(firmware: Option<&Path>, nightly: bool) -> Self {
        let mut missing = Vec::new();
        let mut look = |need, is_here: bool| {
            if !is_here {
                missing.push(need);
            }
        };
        look(BOARD, firmware.is_some() && process::is_installed("qemu-system-arm"));
        let images = [places::stm32_elf(), places::stm32_watch_elf()];
        look(FLASHED, images.iter().all(|elf| elf.is_file()) && process::is_installed("qemu-system-arm"));
        look(SECOND_CORE, places::kernel_bits_elf().is_file() && process::is_installed("qemu-system-arm"));
        look(DATA, places::root().join("../shared/data").is_dir());
        look(CASES, places::root().join("../shared/cases").is_dir());
        look(READER, setup::has_module(setup::MCAP_READER));
        look(PINOCCHIO, setup::has_module(setup::PINOCCHIO));
        look(ROBOTS, [setup::PINOCCHIO, setup::ROBOTS].into_iter().all(setup::has_module));
        look(CLIENT, setup::has_module(setup::VENDORS_CLIENT));
        look(C3D, setup::has_module(setup::C3D_READER));
        look(ROS, setup::has_module(setup::ROS_READER));
        look(SENSORS, setup::has_module(setup::SENSORS));
        look(OPENSIM, setup::has_module(setup::OPENSIM));
        look(SPRINGS, setup::has_module(setup::NUMPY));
        look(BROWSER, setup::browser().is_some());
        let python = Some(setup::python()).filter(|python| python.is_file());
        let here = Self { missing, firmware: firmware.map(Path::to_owned), python, nightly };
        for Need { word, what } in &here.missing {
            println!("skipped: tests named *{word}*, because there is no {what}");
        }
        here
    }

    /// Checks that no test is skipped where `CI` is set.
    ///
    /// # Errors
    /// Names everything that is missing.
    pub fn check(&self) -> Result<()> {
        if !self.missing.is_empty() && is_ci() {
            let list: Vec<&str> = self.missing.iter().map(|need| need.what).collect();
            bail!("CI is set, and tests lack what they need: {}", list.join("; "));
        }
        Ok(())
    }

    /// Returns these surroundings with another firmware.
    pub fn with_firmware(&self, firmware: PathBuf) -> Self {
        Self { firmware: Some(firmware), ..self.clone() }
    }

    /// Runs `cargo test` with these arguments, adds up what the test programs report, and returns the names
    /// of what passed.
    ///
    /// # Errors
    /// Fails as cargo does; the counts are added all the same.
    pub fn test(
        &self,
        arguments: &[&str],
        filters: &[&str],
        counts: &mut Counts,
    ) -> Result<BTreeSet<String>> {
        let mut command = process::cargo(places::root());
        command.arg("test").args(arguments).args(["--", "--include-ignored"]).args(filters);
        command.args(self.missing.iter().flat_map(|need| ["--skip", need.word]));
        command.envs(self.firmware.as_ref().map(|elf| ("RIGIDENT_FIRMWARE_ELF", elf)));
        command.envs(self.python.as_ref().map(|python| ("RIGIDENT_PYTHON", python)));
        command.envs(setup::browser().map(|browser| ("RIGIDENT_BROWSER", browser)));
        command.envs(self.nightly.then_some((NIGHTLY, "1")));
        let found = counted(&mut command, !filters.is_empty(), counts);
        println!("{counts} so far");
        found
    }
}

/// Tells whether this runs in continuous integration.
pub fn is_ci() -> bool {
    std::env::var("CI").is_ok_and(|value| !matches!(value.as_str(), "" | "0" | "false"))
}

/// Runs tests, passes their output on and adds up its last lines. With a filter, tests that were filtered out
/// are not skipped.
pub fn counted(command: &mut Command, filtered: bool, counts: &mut Counts) -> Result<BTreeSet<String>> {
    let shown = process::shown(command);
    eprintln!("$ {shown}");
    let mut child =
        command.stdout(Stdio::piped()).spawn().with_context(|| format!("cannot start `{shown}`"))?;
    let output = child.stdout.take().context("there is no output to read")?;
    let mut reader = BufReader::new(output);
    let mut line = Vec::new();
    let mut programs = 0;
    let mut passed = BTreeSet::new();
    while reader.read_until(b'\n', &mut line)? > 0 {
        std::io::stdout().write_all(&line)?;
        passed.extend(passed_test(&String::from_utf8_lossy(&line)).map(str::to_owned));
        if let Some(mut found) = summary(&String::from_utf8_lossy(&line)) {
            found.skipped = if filtered { 0 } else { found.skipped };
            *counts += found;
            programs += 1;
        }
        line.clear();
    }
    let status = child.wait()?;
    if !status.success() {
        bail!("`{shown}` ended with {status}");
    }
    if programs == 0 {
        bail!("`{shown}` ran no test");
    }
    Ok(passed)
}

/// Reads the name of a test that passed. What a test prints may precede the verdict.
fn passed_test(line: &str) -> Option<&str> {
    let name = line.trim_end().strip_prefix("test ")?.strip_suffix(" ... ok")?;
    (!name.contains(' ')).then_some(name)
}

/// Reads the last line of a test program: what was ignored or filtered out is skipped.
fn summary(line: &str) -> Option<Counts> {
    let rest = line.trim().strip_prefix("test result: ")?;
    let (_, figures) = rest.split_once(". ")?;
    let mut counts = Counts::default();
    for part in figures.split("; ") {
        let Some((number, word)) = part.split_once(' ') else { continue };
        let Ok(number) = number.parse::<u32>() else { continue };
        match word {
            "passed" => counts.passed += number,
            "failed" => counts.failed += number,
            "ignored" | "filtered out" => counts.skipped += number,
            _ => {}
        }
    }
    Some(counts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_test_programs_last_line_is_counted() {
        let line = "test result: FAILED. 9 passed; 1 failed; 2 ignored; 0 measured; 3 filtered out; finished \
                    in 29.40s\n";
        assert_eq!(summary(line), Some(Counts { passed: 9, failed: 1, skipped: 5 }));
        assert_eq!(summary("test a ... ok"), None);
        assert_eq!(passed_test("test a::b ... ok\n"), Some("a::b"));
        for line in ["test a::b ... FAILED", "test a::b ... ignored", "test result: ok. 1 passed"] {
            assert_eq!(passed_test(line), None);
        }
    }

    fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                if !path.ends_with("target") {
                    sources(&path, found);
                }
            } else if path.extension().is_some_and(|end| end == "rs") {
                found.push(path);
            }
        }
    }

    /// Otherwise it would fail where what it needs is missing instead of being skipped.
    #[test]
    fn ignored_tests_have_the_word_of_their_need_in_their_names() {
        let mut files = Vec::new();
        sources(places::root(), &mut files);
        let words = [
            BOARD,
            FLASHED,
            SECOND_CORE,
            DATA,
            CASES,
            READER,
            PINOCCHIO,
            ROBOTS,
            CLIENT,
            C3D,
            ROS,
            SENSORS,
            OPENSIM,
            SPRINGS,
            BROWSER,
        ]
        .map(|need| need.word);
        let mut ignored = 0;
        for file in files {
            let text = std::fs::read_to_string(&file).unwrap();
            let mut lines = text.lines();
            while let Some(line) = lines.next() {
                if !line.trim_start().starts_with("#[ignore") {
                    continue;
                }
                assert!(line.contains("#[ignore = \"needs "), "{}: {line}", file.display());
                let name = lines.next().unwrap();
                let place = format!("{}::{name}", file.display());
                assert!(words.iter().any(|word| place.contains(word)), "{place}");
                ignored += 1;
            }
        }
        assert!(ignored > 0);
    }
}

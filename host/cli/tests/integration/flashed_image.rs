//! The image that is flashed onto an STM32F405, as it is, in QEMU's machine with that chip, over its own
//! serial port.
//!
//! The machine has core, FPU, timers and USART of the chip. Clock tree, DMA, pins and sensors it has not:
//! what the board does with edges is tested on the host (`rigident_firmware::capture`).
#![cfg(feature = "emulator")]

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::program::{json, rigident, said, status};

/// The path where `cargo xtask firmware --board stm32f405` leaves it.
const IMAGE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../firmware/boards/stm32f405/target/thumbv7em-none-eabihf/release/rigident-stm32f405"
);
/// The path of the image with the feature `watch`.
const WATCH_IMAGE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../firmware/boards/stm32f405/target/thumbv7em-none-eabihf/release/rigident-stm32f405-watch"
);
/// The emulator's message about its second serial port, before the port's name.
const REDIRECTED: &str = "char device redirected to ";

/// Six gauges, each of which reads one channel.
const RIG: &str = "
[recording]
rate_hz = 1000.0
[[imu]]
[load_cell]
noise_n_nm = [1.0, 1.0, 1.0, 0.1, 0.1, 0.1]
calibration = [
    [1e5, 0, 0, 0, 0, 0],
    [0, 1e5, 0, 0, 0, 0],
    [0, 0, 1e5, 0, 0, 0],
    [0, 0, 0, 1e4, 0, 0],
    [0, 0, 0, 0, 1e4, 0],
    [0, 0, 0, 0, 0, 1e4],
]
";

/// The emulated chip; dropping it switches it off.
struct Board {
    emulator: Child,
    port: String,
}

impl Board {
    fn boot(folder: &Path) -> Self {
        Self::boot_image(folder, IMAGE)
    }

    fn boot_image(folder: &Path, image: &str) -> Self {
        assert!(Path::new(image).is_file(), "no image: cargo xtask firmware --board stm32f405");
        let words = folder.join("emulator");
        let output = File::create(&words).unwrap();
        let emulator = Command::new("qemu-system-arm")
            .args(["-M", "netduinoplus2", "-display", "none", "-monitor", "none"])
            .args(["-serial", "null", "-serial", "pty", "-kernel", image])
            .stdin(Stdio::null())
            .stdout(output.try_clone().unwrap())
            .stderr(output)
            .spawn()
            .unwrap();
        let mut board = Self { emulator, port: String::new() };
        let deadline = Instant::now() + Duration::from_secs(30);
        loop {
            let text = fs::read_to_string(&words).unwrap();
            let port = text.lines().find_map(|line| line.strip_prefix(REDIRECTED));
            if let Some(port) = port.and_then(|rest| rest.split(' ').next()) {
                port.clone_into(&mut board.port);
                return board;
            }
            assert!(Instant::now() < deadline, "the emulator names no port: {text}");
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    fn info(&self, folder: &Path) -> Value {
        let output = rigident(folder, &["info", "--port", &self.port, "--json"]);
        assert_eq!(status(&output), 0, "{}", said(&output));
        json(&output)
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.emulator.kill();
        let _ = self.emulator.wait();
    }
}

#[test]
#[ignore = "needs the STM32F405's image"]
fn it_says_its_name_and_why_it_started() {
    let place = tempfile::tempdir().unwrap();
    let board = Board::boot(place.path());
    let info = board.info(place.path());
    assert_eq!(info["board"], "stm32f405");
    // The emulator has no register that tells why, and no clock tree.
    assert_eq!((&info["reset"], &info["clock"]), (&"unknown".into(), &"emulated".into()));
    assert_eq!(info["counters"]["lost"], serde_json::json!([0, 0, 0]));
    let output = rigident(place.path(), &["info", "--port", &board.port]);
    let words = String::from_utf8(output.stdout).unwrap();
    assert!(words.contains("started_by: something that it does not say"), "{words}");
    assert!(words.contains("time_from: the emulator"), "{words}");
}

/// A command makes it start anew from any state, and it reports how deep its stack has been.
#[test]
#[ignore = "needs the STM32F405's image"]
fn it_starts_anew_when_it_is_asked_to() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let board = Board::boot(at);
    fs::write(at.join("rig.toml"), RIG).unwrap();
    // No converter answers in the emulator: a fault, out of which only a reset led.
    let output = rigident(at, &["configure", "--port", &board.port, "--rig", "rig.toml"]);
    assert!(status(&output) > 1, "{}", said(&output));
    assert_eq!(board.info(at)["state"], "fault");
    let output = rigident(at, &["info", "--port", &board.port, "--restart", "--json"]);
    assert_eq!(status(&output), 0, "{}", said(&output));
    let info = json(&output);
    assert_eq!((&info["state"], &info["reason"]), (&"idle".into(), &"boot".into()));
    // The stack is examined while the board has nothing else to do.
    std::thread::sleep(Duration::from_millis(1500));
    let stack = board.info(at)["counters"]["stack_bytes"].clone();
    let (deepest, size) = (stack[0].as_u64().unwrap(), stack[1].as_u64().unwrap());
    assert!(deepest > 1000 && deepest < size, "{stack}");
}

#[test]
#[ignore = "needs the STM32F405's image"]
fn it_replays_a_recording_with_the_bits_of_the_firmware_in_this_process() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let board = Board::boot(at);
    // A thousand readings: the emulated port takes some hundred a second.
    let recording = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/examples/bracket.csv");
    let replay = |mcu: &str, out: &str| {
        let output = rigident(at, &["replay", recording, "--mcu", mcu, "--json", "--out", out]);
        assert!(status(&output) < 2, "{}", said(&output));
        let factor: Vec<(PathBuf, Vec<u8>)> = fs::read_dir(at.join(out))
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.extension().is_some_and(|end| end == "factor"))
            .map(|path| (path.file_name().unwrap().into(), fs::read(&path).unwrap()))
            .collect();
        assert!(!factor.is_empty());
        (json(&output)["parameters"].clone(), factor)
    };
    assert_eq!(replay(&board.port, "board"), replay("inproc", "inproc"));
    // It is still there, and has taken every reading.
    let counters = board.info(at)["counters"].clone();
    assert!(counters["readings"] == 1_001, "{counters}");
    assert_eq!(counters["bad_frames"], 0);
}

/// Frames over the board's own port, each when it is due, at its usual rate and at a faster one, which the
/// emulator has not but both ends change to and back.
#[test]
#[ignore = "needs the STM32F405's image"]
fn it_watches_a_recording_with_the_bits_of_the_firmware_in_this_process() {
    const EXAMPLES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/examples/");
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let files = ["picks-up.csv", "picks-up.urdf"].map(|name| format!("{EXAMPLES}{name}"));
    let watch = |mcu: &str, more: &[&str]| {
        let line =
            ["watch", &files[0], "--model", &files[1], "--link", "hand", "--settle-s", "6", "--mcu", mcu];
        rigident(at, &[&line[..], more].concat())
    };
    let here = json(&watch("inproc", &["--json"]));
    assert_eq!(here["changes"].as_array().map(Vec::len), Some(2), "{here}");
    let board = Board::boot_image(at, WATCH_IMAGE);
    for rate in [&["--json"][..], &["--json", "--baud", "2000000"]] {
        let output = watch(&board.port, rate);
        assert_eq!(status(&output), 0, "{}", said(&output));
        let there = json(&output);
        for field in ["changes", "frames", "excess"] {
            assert_eq!(here[field], there[field], "{rate:?}");
        }
    }
    assert_eq!(board.info(at)["state"], "holding");
    let standard = Board::boot(at);
    let output = watch(&standard.port, &[]);
    assert!(status(&output) == 3 && said(&output).contains("feature `watch`"), "{}", said(&output));
    drop(standard);
    let output = watch("inproc", &["--baud", "2000000"]);
    assert!(status(&output) == 2 && said(&output).contains("no line with a rate"), "{}", said(&output));
}

/// If no converter answers, the words say which sensor and what was found; nothing hangs.
#[test]
#[ignore = "needs the STM32F405's image"]
fn it_says_that_another_chip_answers_where_the_load_cell_should() {
    let place = tempfile::tempdir().unwrap();
    let board = Board::boot(place.path());
    fs::write(place.path().join("rig.toml"), RIG).unwrap();
    let output = rigident(place.path(), &["configure", "--port", &board.port, "--rig", "rig.toml"]);
    assert!(status(&output) > 1 && said(&output).contains("sensors do not come up"), "{}", said(&output));
    let info = board.info(place.path());
    let found = [&info["state"], &info["reason"], &info["fault"]];
    assert_eq!(found, ["fault", "load_cell", "wrong_id"], "{info}");
}

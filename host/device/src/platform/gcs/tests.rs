//! The driver against a controller of a few lines, which does what a test wants it to do.

use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use hexapod::Segment;

use super::*;

/// The state of a controller, and the commands that it received and when.
struct Machine {
    servo: bool,
    referenced: bool,
    moving: bool,
    /// The machine's answer to `HLT`: it obeys it, ignores it, or does not know it.
    halt: Halts,
    pivot_mm: f64,
    frame: &'static str,
    in_macro: bool,
    interval_ms: f64,
    /// Rounds its interval to this many ms.
    cycle_ms: f64,
    /// The error that a reference move meets.
    reference_error: i32,
    error: i32,
    received: Vec<(Instant, String)>,
    answers: VecDeque<u8>,
    line: Vec<u8>,
}

#[derive(PartialEq)]
enum Halts {
    Obeyed,
    Ignored,
    Unknown,
    /// Nor does it obey the abrupt stop.
    Never,
}

impl Default for Machine {
    fn default() -> Self {
        Self {
            servo: true,
            referenced: true,
            moving: false,
            halt: Halts::Obeyed,
            pivot_mm: 0.0,
            frame: "ZERO",
            in_macro: false,
            interval_ms: 10.0,
            cycle_ms: 1e-6,
            reference_error: 0,
            error: 0,
            received: Vec::new(),
            answers: VecDeque::new(),
            line: Vec::new(),
        }
    }
}

impl Machine {
    fn six(&mut self, value: impl std::fmt::Display) {
        let lines: Vec<String> = AXES.iter().map(|axis| format!("{axis}={value}")).collect();
        self.answer(&lines.join(" \n"));
    }

    fn answer(&mut self, text: &str) {
        self.answers.extend(text.bytes().chain([b'\n']));
    }

    fn stopped(&mut self) {
        (self.moving, self.error) = (false, 10);
    }

    fn byte(&mut self, byte: u8) {
        match byte {
            MOVING => self.answer(if self.moving { "3F" } else { "0" }),
            IS_READY => self.answers.extend([if self.moving { READY - 1 } else { READY }, b'\n']),
            hexapod::gcs::MACRO => self.answer(if self.in_macro { "1" } else { "0" }),
            hexapod::gcs::STOP => {
                self.received.push((Instant::now(), "#24".to_owned()));
                if self.halt != Halts::Never {
                    self.stopped();
                }
            }
            b'\n' => {
                let line = String::from_utf8(std::mem::take(&mut self.line)).unwrap();
                self.obey(&line);
            }
            other => self.line.push(other),
        }
    }

    fn obey(&mut self, line: &str) {
        let verb = line.split(' ').next().unwrap();
        if !verb.ends_with('?') {
            self.received.push((Instant::now(), line.to_owned()));
        }
        match verb {
            "*IDN?" => self.answer("a hexapod of the tests"),
            "CSV?" => self.answer("2.0"),
            "SAI?" => self.answer("X \nY \nZ \nU \nV \nW"),
            "HLP?" => self.answer("#8 macro \nSPI? pivot \nKEN? frames \nVLS? velocity \nend of help"),
            "ERR?" => {
                let error = std::mem::take(&mut self.error);
                self.answer(&error.to_string());
            }
            "SPI?" => self.answer(&format!("R=0 \nS=0 \nT={}", self.pivot_mm)),
            "KEN?" => self.answer(&format!("{}=KSD", self.frame)),
            "SPA?" => self.answer("X 0x0=0"),
            "SCT?" => self.answer(&format!("T={:.6}", self.interval_ms)),
            "VLS?" => self.answer("10"),
            "FRF?" => self.six(u8::from(self.referenced)),
            "SVO?" => self.six(u8::from(self.servo)),
            "POS?" => self.six(0),
            "TMN?" => self.six(-100),
            "TMX?" => self.six(100),
            "VMO?" => self.answer("1"),
            "SVO" => self.servo = line.contains('1'),
            "SCT" => {
                let ms: f64 = line.trim_start_matches("SCT T ").parse().unwrap();
                self.interval_ms = (ms / self.cycle_ms).round() * self.cycle_ms;
            }
            "FRF" => (self.moving, self.error) = (true, self.reference_error),
            "HLT" if self.halt == Halts::Obeyed => self.stopped(),
            "HLT" if self.halt == Halts::Unknown => self.error = 2,
            _ => {}
        }
    }

    fn when(&self, command: &str) -> Option<Instant> {
        self.received.iter().find(|(_, said)| said.starts_with(command)).map(|(at, _)| *at)
    }
}

struct Cable(Arc<Mutex<Machine>>);

impl io::Read for Cable {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner).answers.pop_front() {
            Some(byte) => {
                buffer[0] = byte;
                Ok(1)
            }
            None => Err(io::ErrorKind::TimedOut.into()),
        }
    }
}

impl io::Write for Cable {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut machine = self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        bytes.iter().for_each(|byte| machine.byte(*byte));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn connected(machine: Machine, address: &str) -> (Arc<Mutex<Machine>>, GcsPlatform) {
    let machine = Arc::new(Mutex::new(machine));
    let address = Address::parse(address).unwrap();
    let cable = Box::new(Cable(Arc::clone(&machine)));
    let platform =
        GcsPlatform::connect(&address, cable, &Geometry::thesis(), Clock::of_this_machine()).unwrap();
    (machine, platform)
}

fn hold() -> MotionProgram {
    MotionProgram { start: Geometry::thesis().home(), segments: vec![Segment::Hold { duration_s: 1.0 }] }
}

#[test]
fn a_reference_move_that_meets_an_error_is_stopped() {
    let unreferenced = Machine { referenced: false, reference_error: 45, ..Machine::default() };
    let (machine, mut platform) = connected(unreferenced, "gcs://h:1");
    platform.load(&hold()).unwrap();
    let error = platform.approach(&|| true).unwrap_err();
    assert!(matches!(error, PlatformError::Controller { code: 45, .. }), "{error}");
    let machine = machine.lock().unwrap();
    assert!(machine.when("HLT").is_some() && !machine.moving, "{:?}", machine.received);
}

#[test]
fn a_smooth_stop_without_effect_turns_abrupt_half_a_second_later() {
    for (halt, seconds) in [(Halts::Ignored, 0.5..0.9), (Halts::Unknown, 0.0..0.3)] {
        let unreferenced = Machine { referenced: false, halt, ..Machine::default() };
        let (machine, mut platform) = connected(unreferenced, "gcs://h:1");
        platform.load(&hold()).unwrap();
        assert_eq!(platform.approach(&|| false), Err(PlatformError::Interrupted));
        let machine = machine.lock().unwrap();
        let [smooth, abrupt] = ["HLT", "#24"].map(|command| machine.when(command).unwrap());
        assert!(seconds.contains(&(abrupt - smooth).as_secs_f64()), "{:?}", abrupt - smooth);
    }
}

/// The change of a machine, and words of the refusal.
type Change = (fn(&mut Machine), &'static str);

#[test]
fn changes_by_another_client_after_the_connection_are_found_before_anything_moves() {
    let changes: [Change; 4] = [
        (|m| m.pivot_mm = 100.0, "pivot point is at T = 100 mm"),
        (|m| m.frame = "MINE", "coordinate system MINE"),
        (|m| m.in_macro = true, "one of its macros runs"),
        (|m| m.servo = false, "servos have been switched off"),
    ];
    for (change, words) in changes {
        let (machine, mut platform) = connected(Machine::default(), "gcs://h:1");
        platform.load(&hold()).unwrap();
        platform.approach(&|| true).unwrap();
        platform.load(&hold()).unwrap();
        change(&mut machine.lock().unwrap());
        let error = platform.start().unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
        assert!(machine.lock().unwrap().when("MOV").is_none(), "{words}");
    }
}

#[test]
fn an_interval_that_the_controller_rounds_is_refused() {
    for (address, refused) in [("gcs://h:1?rate_hz=300", true), ("gcs://h:1?rate_hz=250", false)] {
        let (machine, mut platform) = connected(Machine { cycle_ms: 0.1, ..Machine::default() }, address);
        platform.load(&hold()).unwrap();
        let started = platform.start();
        match started {
            Err(error) if refused => {
                let said = error.to_string();
                assert!(said.contains("3.3 ms") && said.contains("3.333333 ms") && said.contains("rate_hz"));
                assert!(machine.lock().unwrap().when("MOV").is_none());
            }
            other => assert!(other.is_ok() && !refused, "{address}: {other:?}"),
        }
    }
}

#[test]
fn servos_that_were_off_are_left_on_and_nothing_is_changed_in_a_machine_that_moves() {
    let (machine, mut platform) = connected(Machine { servo: false, ..Machine::default() }, "gcs://h:1");
    assert!(platform.found().iter().any(|found| found.contains("left on at the end")));
    platform.load(&hold()).unwrap();
    platform.approach(&|| true).unwrap();
    machine.lock().unwrap().moving = true;
    let left = platform.release().unwrap();
    assert!(left[0].contains("left on"), "{left:?}");
    let machine = machine.lock().unwrap();
    assert!(machine.servo && machine.when("HLT") < machine.when("SPA"), "{:?}", machine.received);
}

#[test]
fn a_machine_that_does_not_come_to_rest_is_left_as_it_is() {
    let (machine, mut platform) = connected(Machine::default(), "gcs://h:1");
    platform.load(&hold()).unwrap();
    platform.approach(&|| true).unwrap();
    {
        let mut machine = machine.lock().unwrap();
        (machine.moving, machine.halt) = (true, Halts::Never);
    }
    let error = platform.release().unwrap_err().to_string();
    assert!(error.contains("still moves"), "{error}");
    let machine = machine.lock().unwrap();
    assert!(machine.when("#24").is_some() && machine.when("SPA").is_none(), "{:?}", machine.received);
}

//! The served rig as another program meets it: a port to open, a controller to talk to.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rigident_sim::link::ByteLink;
use rigident_sim::rig::{BusEvent, MotionState, Rig, RigConfig, SharedRig};
use rigident_sim::runner::{InProcess, Mcu, Pacing};
use rigident_sim::serve::{Controller, Port, carry};
use serde_json::{Value, json};
use serialport::TTYPort;

const PATIENCE: Duration = Duration::from_secs(10);

/// Gives back what was written.
#[derive(Default)]
struct Echo(Vec<u8>);

impl ByteLink for Echo {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.0.extend_from_slice(bytes);
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], _: Duration) -> std::io::Result<usize> {
        let n = self.0.len().min(buffer.len());
        buffer[..n].copy_from_slice(&self.0[..n]);
        self.0.drain(..n);
        Ok(n)
    }
}

/// Sets a flag when dropped, so that a failed assertion ends the other thread too.
struct LeaveAtLast<'a>(&'a AtomicBool);

impl Drop for LeaveAtLast<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

fn open(name: &Path) -> TTYPort {
    serialport::new(name.to_str().unwrap(), 115_200).timeout(PATIENCE).open_native().unwrap()
}

#[test]
fn the_port_carries_every_byte_value_both_ways_and_its_name_goes_with_it() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("rig");
    let leave = AtomicBool::new(false);
    let mut port = Port::open(Some(&name)).unwrap();
    std::thread::scope(|scope| {
        let served = scope.spawn(|| carry(&mut port, &mut Echo::default(), &leave));
        let at_last = LeaveAtLast(&leave);
        let sent: Vec<u8> = (0..20_000_u32).map(|i| (i ^ (i >> 8)) as u8).collect();
        // Twice: a port can be closed and opened again.
        for _ in 0..2 {
            let mut line = open(&name);
            let mut got = vec![0; sent.len()];
            for (out, back) in sent.chunks(500).zip(got.chunks_mut(500)) {
                line.write_all(out).unwrap();
                line.read_exact(back).unwrap();
            }
            assert_eq!(got, sent);
        }
        drop(at_last);
        served.join().unwrap().unwrap();
    });
    drop(port);
    assert!(!name.is_symlink());
}

#[test]
fn bytes_unread_by_one_user_are_not_given_to_the_next() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("rig");
    let mut port = Port::open(Some(&name)).unwrap();
    assert!(!port.in_use().unwrap());
    let first = open(&name);
    assert!(port.in_use().unwrap());
    assert_eq!(port.write(b"for the first").unwrap(), 13);
    drop(first);
    assert!(!port.in_use().unwrap());
    let mut second = open(&name);
    assert!(port.in_use().unwrap());
    assert_eq!(port.write(b"for the second").unwrap(), 14);
    let mut got = [0; 14];
    second.read_exact(&mut got).unwrap();
    assert_eq!(&got, b"for the second");
}

#[test]
fn a_name_in_use_is_refused_and_a_dead_link_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("rig");
    fs::write(&name, "something of value").unwrap();
    assert!(Port::open(Some(&name)).is_err());
    assert_eq!(fs::read(&name).unwrap(), b"something of value");
    fs::remove_file(&name).unwrap();
    std::os::unix::fs::symlink(folder.path().join("gone"), &name).unwrap();
    let port = Port::open(Some(&name)).unwrap();
    assert_eq!(fs::read_link(&name).unwrap(), port.terminal());
}

/// A microcontroller that never stops talking.
struct Talker(InProcess);

impl ByteLink for Talker {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.0.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> std::io::Result<usize> {
        buffer.fill(0x55);
        if buffer.is_empty() { self.0.read(buffer, timeout) } else { Ok(buffer.len()) }
    }
}

#[test]
fn the_rig_keeps_its_own_time_while_nobody_reads_its_port() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("rig");
    let leave = AtomicBool::new(false);
    let mut port = Port::open(Some(&name)).unwrap();
    let rig = Rig::new(RigConfig::thesis_horizontal()).unwrap().shared();
    let mut talker = Talker(InProcess::new(Arc::clone(&rig), Pacing::RealTime));
    std::thread::scope(|scope| {
        let served = scope.spawn(|| carry(&mut port, &mut talker, &leave));
        let at_last = LeaveAtLast(&leave);
        let _reads_nothing = open(&name);
        let now_ns = || rig.lock().unwrap().now_ns();
        // Once the line is full the clock goes on.
        let deadline = Instant::now() + PATIENCE;
        while now_ns() < 1_000_000_000 {
            assert!(Instant::now() < deadline, "{} ns", now_ns());
            std::thread::sleep(Duration::from_millis(20));
        }
        drop(at_last);
        served.join().unwrap().unwrap();
    });
}

/// Lets the rig's clock run, whatever its sensors have to say.
fn run_until(rig: &SharedRig, time_ns: u64) {
    let mut rig = rig.lock().unwrap();
    while rig.next_event_before(time_ns) != BusEvent::Idle {}
}

struct Client(BufReader<TcpStream>);

impl Client {
    fn new(controller: &Controller) -> Self {
        Self(BufReader::new(TcpStream::connect(controller.address()).unwrap()))
    }

    fn ask(&mut self, line: &str) -> Value {
        self.0.get_mut().write_all(format!("{line}\n").as_bytes()).unwrap();
        let mut answer = String::new();
        self.0.read_line(&mut answer).unwrap();
        serde_json::from_str(&answer).unwrap()
    }
}

#[test]
fn the_controller_loads_starts_reports_and_stops() {
    let rig = Rig::new(RigConfig::thesis_horizontal()).unwrap().shared();
    let controller = Controller::listen("127.0.0.1:0", Arc::clone(&rig)).unwrap();
    let mut client = Client::new(&controller);
    let home = rig.lock().unwrap().pose();

    assert_eq!(client.ask(r#"{"cmd":"state"}"#)["state"], "holding");
    assert_eq!(client.ask(r#"{"cmd":"start"}"#)["ok"], false);
    for nonsense in ["", "{", r#"{"cmd":"jump"}"#, r#"{"cmd":"load"}"#, "\u{1F600}"] {
        let answer = client.ask(nonsense);
        assert_eq!(answer["ok"], false, "{nonsense}");
        assert!(answer["error"].as_str().unwrap().starts_with("not a command"), "{answer}");
    }
    let mut far = home;
    far.position_m[0] += 5.0;
    let out_of_reach = json!({"start": home, "segments": [{"move": {"to": far, "duration_s": 10.0}}]});
    assert_eq!(client.ask(&json!({"cmd": "load", "program": out_of_reach}).to_string())["ok"], false);

    let mut near = home;
    near.position_m[2] += 0.02;
    let program = json!({"start": home, "segments": [{"move": {"to": near, "duration_s": 4.0}}]});
    let loaded = client.ask(&json!({"cmd": "load", "program": program}).to_string());
    assert_eq!((&loaded["ok"], &loaded["duration_s"]), (&json!(true), &json!(4.0)), "{loaded}");
    assert_eq!(client.ask(r#"{"cmd":"start"}"#)["state"], "moving");
    run_until(&rig, 1_000_000_000);
    assert_eq!(client.ask(r#"{"cmd":"state"}"#)["time_s"], 1.0);
    assert_eq!(client.ask(r#"{"cmd":"stop"}"#)["state"], "moving");
    run_until(&rig, 1_600_000_000);
    assert_eq!(client.ask(r#"{"cmd":"state"}"#)["state"], "done");
}

#[test]
fn a_client_that_goes_away_stops_its_motion() {
    let rig = Rig::new(RigConfig::thesis_horizontal()).unwrap().shared();
    let controller = Controller::listen("127.0.0.1:0", Arc::clone(&rig)).unwrap();
    let mut client = Client::new(&controller);
    let home = rig.lock().unwrap().pose();
    let program = json!({"start": home, "segments": [{"hold": {"duration_s": 1000.0}}]});
    assert_eq!(client.ask(&json!({"cmd": "load", "program": program}).to_string())["ok"], true);
    assert_eq!(client.ask(r#"{"cmd":"start"}"#)["state"], "moving");
    drop(client);
    let deadline = Instant::now() + PATIENCE;
    loop {
        // Once stopped, the plate is at rest half a second of rig time later.
        let later = rig.lock().unwrap().now_ns() + 100_000_000;
        run_until(&rig, later);
        if rig.lock().unwrap().motion() == MotionState::Done {
            assert!(rig.lock().unwrap().program_time_s() < 1000.0);
            break;
        }
        assert!(Instant::now() < deadline, "the motion goes on");
        std::thread::sleep(Duration::from_millis(2));
    }
}

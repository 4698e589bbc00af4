//! `rigident-sim serve` as a user starts and ends it.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use rigident_shared::wire::{
    Answer, Command as Ask, Decoder, Kind, PROTOCOL_VERSION, Reply, encode, frame::MAX_FRAME,
};
use tempfile::TempDir;

const PATIENCE: Duration = Duration::from_secs(60);

/// A server in a folder of its own, temporary files included.
struct Server {
    child: Child,
    folder: TempDir,
    said: Vec<String>,
}

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rigident-sim"));
    command.arg("serve").args(arguments).current_dir(folder).env("TMPDIR", folder).stderr(Stdio::piped());
    command
}

impl Server {
    fn start(arguments: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let child = command(folder.path(), arguments).spawn().unwrap();
        let mut server = Self { child, folder, said: Vec::new() };
        for line in BufReader::new(server.child.stderr.take().unwrap()).lines() {
            server.said.push(line.unwrap());
            if server.said.last().is_some_and(|line| line.starts_with("Ctrl-C")) {
                return server;
            }
        }
        panic!("it ended by itself: {:?}", server.said);
    }

    fn hello(&self) {
        let name = self.folder.path().join("rigident-rig");
        let mut line =
            serialport::new(name.to_str().unwrap(), 921_600).timeout(PATIENCE).open_native().unwrap();
        let mut frame = [0; MAX_FRAME];
        let n = encode(Kind::Command, 7, &Ask::Hello, &mut frame).unwrap();
        line.write_all(&frame[..n]).unwrap();
        let mut decoder = Decoder::new();
        let mut byte = [0];
        loop {
            line.read_exact(&mut byte).unwrap();
            // An announcement may come first.
            if let Some(Ok(frame)) = decoder.push(byte[0])
                && frame.kind == Kind::Answer
            {
                assert_eq!(frame.sequence, 7);
                let answer: Answer = frame.message().unwrap();
                assert!(
                    matches!(&answer, Ok(Reply::Hello(who)) if who.protocol_version == PROTOCOL_VERSION),
                    "{answer:?}"
                );
                return;
            }
        }
    }

    /// Presses Ctrl-C. Returns what is left in the folder.
    fn interrupt(mut self) -> Vec<String> {
        let sent = Command::new("kill").args(["-INT", &self.child.id().to_string()]).status();
        assert!(sent.unwrap().success());
        let deadline = Instant::now() + PATIENCE;
        let status = loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                break status;
            }
            assert!(Instant::now() < deadline, "it does not end");
            std::thread::sleep(Duration::from_millis(5));
        };
        assert!(status.success(), "{status}");
        let left = fs::read_dir(self.folder.path()).unwrap();
        left.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn the_firmware_answers_at_the_named_port_and_an_interrupt_leaves_nothing_behind() {
    let server = Server::start(&["--platform", "127.0.0.1:0"]);
    server.hello();
    assert_eq!(server.interrupt(), [""; 0]);
}

#[test]
#[ignore = "needs the emulated board"]
fn the_emulated_firmware_answers_too_and_leaves_neither_process_nor_pipe() {
    let server = Server::start(&["--mcu", "qemu", "--platform", "127.0.0.1:0"]);
    assert!(server.said.iter().any(|line| line.contains("qemu")), "{:?}", server.said);
    server.hello();
    let of_server = format!("/proc/{}/task/{0}/children", server.child.id());
    let children = fs::read_to_string(of_server).unwrap();
    let emulator = children.split_whitespace().next().expect("the emulator is its child").to_owned();
    assert_eq!(server.interrupt(), [""; 0]);
    assert!(!Path::new("/proc").join(emulator).exists());
}

#[test]
fn a_faulty_line_still_carries_an_answer_in_the_end() {
    let server = Server::start(&["--platform", "127.0.0.1:0", "--duplicate", "1"]);
    server.hello();
    assert_eq!(server.interrupt(), [""; 0]);
}

#[test]
fn the_rig_file_is_written_once_and_nothing_is_written_over() {
    let server = Server::start(&["--platform", "127.0.0.1:0", "--write-rig", "rig.toml"]);
    let path = server.folder.path().join("rig.toml");
    let text = fs::read_to_string(&path).unwrap();
    for table in ["[recording]", "[[imu]]", "[load_cell]", "[platform]", "[truth]"] {
        assert!(text.contains(table), "{table}");
    }
    let again = fails(server.folder.path(), &["--write-rig", "rig.toml"]);
    assert_eq!(again.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&again.stderr).contains("rig.toml"));
    assert_eq!(fs::read_to_string(&path).unwrap(), text);
    assert_eq!(server.interrupt(), ["rig.toml"]);
}

#[test]
fn unavailable_places_are_named_with_the_option_that_changes_them() {
    let folder = tempfile::tempdir().unwrap();
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let output = fails(folder.path(), &["--platform", &address]);
    assert_eq!(output.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&output.stderr).contains("--platform"));

    fs::write(folder.path().join("rigident-rig"), "mine").unwrap();
    let output = fails(folder.path(), &["--platform", "127.0.0.1:0"]);
    assert_eq!(output.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&output.stderr).contains("--port-link"));

    let output = fails(folder.path(), &["--freeze", "gw@3"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("gw is no channel"));
}

fn fails(folder: &Path, arguments: &[&str]) -> Output {
    command(folder, arguments).output().unwrap()
}

//! The traffic on the line.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rigident_sim::rig::MotionState;

use super::Served;

const PATIENCE: Duration = Duration::from_secs(10);

struct Client<S: Read + Write>(BufReader<S>);

impl Client<TcpStream> {
    fn new(served: &Served) -> Self {
        let stream = TcpStream::connect(served.server.address()).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        Self(BufReader::new(stream))
    }
}

impl<S: Read + Write> Client<S> {
    fn tell(&mut self, bytes: &[u8]) {
        self.0.get_mut().write_all(bytes).unwrap();
    }

    fn ask(&mut self, line: &str) -> String {
        self.tell(format!("{line}\n").as_bytes());
        let mut answer = String::new();
        loop {
            self.0.read_line(&mut answer).unwrap();
            if !answer.ends_with(" \n") {
                return answer;
            }
        }
    }

    fn error(&mut self) -> u16 {
        self.ask("ERR?").trim().parse().unwrap()
    }

    fn reference(&mut self) {
        self.tell(b"FRF\n");
        self.until(|c| c.ask("FRF?").starts_with("X=1"));
        assert_eq!(self.error(), 0);
    }

    fn until(&mut self, mut done: impl FnMut(&mut Self) -> bool) {
        let deadline = Instant::now() + PATIENCE;
        while !done(self) {
            assert!(Instant::now() < deadline, "it does not come");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn z(&mut self) -> f64 {
        self.ask("POS? Z").trim().strip_prefix("Z=").unwrap().parse().unwrap()
    }
}

#[test]
fn every_line_of_an_answer_but_the_last_ends_with_a_space() {
    let served = Served::new();
    let mut client = Client::new(&served);
    assert_eq!(client.ask("SAI?"), "X \nY \nZ \nU \nV \nW\n");
    assert_eq!(client.ask("ONT? Z W"), "Z=1 \nW=1\n");
    assert!(client.ask("HLP?").ends_with(" \nend of help\n"));
}

#[test]
fn errors_are_kept_until_they_are_asked_for_and_name_the_fault() {
    let served = Served::new();
    let mut client = Client::new(&served);
    for (line, code) in [
        ("XYZZY", 2),
        ("MOV", 24),
        ("MOV X", 24),
        ("MOV X ten", 25),
        ("MOV X inf", 25),
        ("MOV A 1", 15),
        ("MOV X 1", 5),
        ("POS? Q", 15),
        ("SPA X 0x1 1", 54),
        ("SPA X 0x19001904 1", 64),
        ("SPA X 0x19001900 2", 17),
        ("VLS 1e9", 8),
        ("SCT T 0", 17),
        ("SVO X 3", 17),
    ] {
        client.tell(format!("{line}\n").as_bytes());
        assert_eq!(client.error(), code, "{line}");
        assert_eq!(client.error(), 0, "{line}");
    }
}

/// At 100 mm/s at most: 15 mm in 0.3 s, 2.5 mm in 0.05 s, and somewhat more where it still speeds up.
#[test]
fn a_halt_is_smooth_a_stop_is_abrupt_and_ends_macros_too() {
    let served = Served::new();
    let mut client = Client::new(&served);
    client.reference();
    for (command, way_mm) in [("HLT", 6.0..18.0), ("STP", 0.2..4.0)] {
        client.tell(b"MAC START own\nVLS 100\nMOV Z 60\n");
        client.until(|c| c.z() > 20.0);
        // One after the other in one go: nothing moves between.
        client.tell(format!("POS? Z\n{command}\n").as_bytes());
        let mut before = String::new();
        client.0.read_line(&mut before).unwrap();
        let before: f64 = before.trim().strip_prefix("Z=").unwrap().parse().unwrap();
        client.until(|_| served.rig.lock().unwrap().motion() == MotionState::Done);
        assert_eq!(client.error(), 10);
        let way = client.z() - before;
        assert!(way_mm.contains(&way), "{command}: {way} mm");
        client.tell(b"\x08");
        let mut runs = String::new();
        client.0.read_line(&mut runs).unwrap();
        assert_eq!(runs, if command == "HLT" { "1\n" } else { "0\n" });
        client.tell(b"VLS 200\nMOV Z 0\n");
        client.until(|c| c.ask("ONT? Z") == "Z=1\n");
        assert_eq!(client.error(), 0);
    }
}

#[test]
fn a_stream_that_ceases_brakes_and_takes_no_more_points_until_it_is_begun_anew() {
    let served = Served::new();
    let mut client = Client::new(&served);
    client.reference();
    client.tell(b"SPA X 0x19001900 1\nSPA X 0x19001901 1\nSPA X 0x19001903 10\nSCT T 10\n");
    for k in 1..=60 {
        client.tell(format!("MOV Z {}\n", 0.01 * f64::from(k * k)).as_bytes());
    }
    // 0.6 s of points at up to 120 mm/s, then silence.
    client.until(|c| c.error() == 220);
    client.until(|_| served.rig.lock().unwrap().motion() == MotionState::Done);
    let rest = client.z();
    assert!(rest > 30.0 && rest < 60.0, "{rest}");
    client.tell(b"MOV Z 36\n");
    assert_eq!(client.error(), 220);
    assert_eq!(client.z(), rest);
    client.tell(b"SPA X 0x19001900 0\nMOV Z 0\n");
    assert_eq!(client.error(), 0);
    client.until(|c| c.ask("ONT? Z") == "Z=1\n");
}

#[test]
fn a_client_that_goes_away_stops_its_own_motion_and_no_other() {
    let served = Served::new();
    let mut client = Client::new(&served);
    client.reference();
    client.tell(b"VLS 5\nMOV Z 20\n");
    assert_eq!(client.error(), 0);
    drop(Client::new(&served));
    std::thread::sleep(Duration::from_millis(200));
    assert_eq!(served.rig.lock().unwrap().motion(), MotionState::Moving);
    drop(client);
    let mut other = Client::new(&served);
    other.until(|_| served.rig.lock().unwrap().motion() == MotionState::Done);
    assert!(other.z() < 10.0);
    assert_eq!(other.error(), 10);
}

#[test]
fn the_same_controller_answers_on_a_serial_line() {
    let served = Served::new();
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("hexapod");
    let line = served.server.open_port(Some(&name)).unwrap();
    let opened = serialport::new(name.to_str().unwrap(), 115_200).timeout(PATIENCE).open_native().unwrap();
    let mut client = Client(BufReader::new(opened));
    client.reference();
    client.tell(b"VLS 200\nMOV Z 10\n");
    client.until(|c| c.ask("ONT? Z") == "Z=1\n");
    assert_eq!(client.z(), 10.0);
    client.tell(b"VLS 1\nMOV Z 0\n");
    assert_eq!(client.error(), 0);
    drop(client);
    let mut other = Client::new(&served);
    other.until(|_| served.rig.lock().unwrap().motion() == MotionState::Done);
    assert!(other.z() > 5.0);
    drop(line);
    assert!(!name.is_symlink());
}

#[test]
fn garbage_is_survived_and_the_controller_still_answers() {
    let served = Served::new();
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let words: Vec<&[u8]> = [
        "MOV ",
        "MVR ",
        "FRF",
        "SVO ",
        "SPA ",
        "SPA? ",
        "X ",
        "W ",
        "0x19001900 ",
        "0x19001903 ",
        "1 ",
        "-1e308 ",
        "nan ",
        "POS? ",
        "VMO? ",
        "SCT T ",
        "VLS ",
        "\u{e9}",
        "STP",
        "HLP?",
        "=",
        "\n",
        " ",
    ]
    .iter()
    .map(|w| w.as_bytes())
    .collect();
    for _ in 0..20 {
        let mut client = Client::new(&served);
        let mut reader = client.0.get_ref().try_clone().unwrap();
        // Somebody must read the answers, or the server would wait for room.
        let sink = std::thread::spawn(move || while reader.read(&mut [0; 4096]).is_ok_and(|n| n > 0) {});
        let mut bytes = Vec::new();
        while bytes.len() < 20_000 {
            if random.next_u32().is_multiple_of(4) {
                bytes.push(random.next_u32() as u8);
            } else {
                bytes.extend_from_slice(words[random.next_u32() as usize % words.len()]);
            }
        }
        client.tell(&bytes);
        client.0.get_ref().shutdown(std::net::Shutdown::Both).unwrap();
        sink.join().unwrap();
    }
    let mut client = Client::new(&served);
    assert_eq!(client.ask("CSV?"), "2.0\n");
    let (geometry, pose) = {
        let rig = served.rig.lock().unwrap();
        (rig.config().geometry.clone(), rig.pose())
    };
    let [lo, hi] = geometry.leg_length_m;
    // A brake may take a leg beyond its end by what it needs to stop.
    assert!(geometry.leg_lengths(&pose).iter().all(|l| (lo - 0.05..hi + 0.05).contains(l)));
}

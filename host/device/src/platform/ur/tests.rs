//! The driver with controllers that are written here, and not well.

use std::io::{Read, Write};
use std::net::TcpListener;
use std::thread;

use hexapod::{Arm, Geometry, Hinge, Mounting, Travel};

use super::*;

fn arm() -> Geometry {
    let hinge = |i: usize| Hinge {
        name: format!("joint {}", i + 1),
        place: Mounting { position_m: [0.0, 0.1, 0.2], ..Mounting::IDENTITY },
        axis: if i.is_multiple_of(2) { [0.0, 0.0, 1.0] } else { [0.0, 1.0, 0.0] },
        range_rad: [-3.0, 3.0],
        rate_radps: 2.0,
        acceleration_radps2: 4.0 + i as f64,
    };
    let arm = Arm {
        hinges: std::array::from_fn(hinge),
        flange: Mounting::IDENTITY,
        home_rad: [0.3; 6],
        payload_kg: None,
    };
    let travel =
        Travel { shift_m: [0.1; 3], turn_rad: [0.5; 3], together: true, speed_mps: None, rate_radps: None };
    Geometry::of_arm(arm, travel)
}

/// Returns the error of a connection to a controller that answers each type of package like this.
fn refusal(answer: impl Fn(u8) -> Option<Vec<u8>> + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut head = [0; 3];
        while stream.read_exact(&mut head).is_ok() {
            let mut payload = vec![0; usize::from(u16::from_be_bytes([head[0], head[1]])) - 3];
            stream.read_exact(&mut payload).unwrap();
            let Some(bytes) = answer(head[2]) else { return };
            let _ = stream.write_all(&bytes);
        }
    });
    let clock = Clock::of_this_machine();
    let connected = UrPlatform::connect("ur://arm", "127.0.0.1", [port, 1], &arm(), clock);
    connected.err().unwrap().to_string()
}

fn package(kind: u8, payload: &[u8]) -> Option<Vec<u8>> {
    Some(rigident_io::sources::rtde::package(kind, payload))
}

const OUTPUTS: &str = "DOUBLE,VECTOR6D,VECTOR6D,INT32,INT32,UINT32,DOUBLE,INT32,INT32,INT32,INT32,INT32";

#[test]
fn a_controller_that_lacks_something_is_refused_by_name() {
    for (outputs, words) in [
        (
            "NOT_FOUND,VECTOR6D,VECTOR6D,INT32,INT32,UINT32,DOUBLE,INT32,INT32,INT32,INT32,INT32",
            "has no timestamp",
        ),
        (
            "DOUBLE,DOUBLE,VECTOR6D,INT32,INT32,UINT32,DOUBLE,INT32,INT32,INT32,INT32,INT32",
            "its actual_q is a DOUBLE",
        ),
        (
            "DOUBLE,\u{7},VECTOR6D,INT32,INT32,UINT32,DOUBLE,INT32,INT32,INT32,INT32,INT32",
            "its actual_q is a",
        ),
        ("DOUBLE", "12 variables were asked for, it answers for 1"),
    ] {
        let answer = move |kind| match kind {
            b'V' => package(kind, &[1]),
            _ => package(kind, &[&[1], outputs.as_bytes()].concat()),
        };
        let error = refusal(answer);
        assert!(error.contains(words) && !error.contains('\u{7}'), "{error}");
    }
    let in_use = |kind| match kind {
        b'V' => package(kind, &[1]),
        b'O' => package(kind, &[&[1], OUTPUTS.as_bytes()].concat()),
        _ => package(kind, &[&[0][..], "IN_USE,".repeat(26).as_bytes(), b"IN_USE"].concat()),
    };
    assert!(refusal(in_use).contains("input_int_register_24 is in use by another program"));
    assert!(refusal(|kind| package(kind, &[0])).contains("version 2 of RTDE"));
}

#[test]
fn bytes_that_are_no_packages_end_the_connection_and_silence_is_reported() {
    assert!(refusal(|_| Some(vec![0, 1, b'V'])).contains("no RTDE"));
    assert!(refusal(|_| None).contains("closed the connection"));
    // It agrees to everything and sends states that are none.
    let mute = |kind| match kind {
        b'V' | b'S' | b'P' => package(kind, &[1]),
        b'O' => package(kind, &[&[1], OUTPUTS.as_bytes()].concat()),
        _ => package(
            kind,
            &[&[1][..], "INT32,INT32,INT32".as_bytes(), ",DOUBLE".repeat(24).as_bytes()].concat(),
        ),
    };
    let half = move |kind| {
        let mut bytes = mute(kind)?;
        if kind == b'S' {
            for length in [0, 1, 7, 100, 160] {
                bytes.extend(package(b'U', &[&[1][..], &vec![0xff; length]].concat())?);
            }
        }
        Some(bytes)
    };
    let error = refusal(half);
    assert!(error.contains("said nothing for 3 s"), "{error}");
}

#[test]
fn the_program_stops_by_the_lowest_acceleration_and_names_its_motion() {
    let text = script::program(&arm().arm.unwrap(), 4711);
    for words in ["def rigident():", "motion = 4711", "stopj(4.0000)", "step = 0.020000", "servoj("] {
        assert!(text.contains(words), "{words}\n{text}");
    }
    assert!(!text.contains("{{"), "{text}");
    let opened = |word: &str| text.lines().filter(|line| line.trim_start().starts_with(word)).count();
    assert_eq!(opened("def ") + opened("if ") + opened("while "), opened("end"));
    assert!(script::stop(&arm().arm.unwrap()).contains("stopj(9.0000)"));
}

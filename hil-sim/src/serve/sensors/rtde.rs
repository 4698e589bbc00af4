//! A controller of Universal Robots that answers by RTDE, version 2, as the maker's guide has it.

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::{Quaternion, UnitQuaternion};

use super::{Played, Sample};
use crate::serve::listener::{LOOK_AGAIN, Listener};

/// Version of the controller: major, minor, bugfix, build.
const CONTROLLER: [u32; 4] = [5, 11, 0, 0];

/// Serves as the controller.
pub struct RtdeServer(Listener);

impl RtdeServer {
    /// Listens at an address. The flange reads what the body does to it: the reaction.
    ///
    /// # Errors
    /// The address is taken.
    pub fn listen(address: &str, played: Played) -> io::Result<Self> {
        Ok(Self(Listener::listen(address, move |stream, leave| {
            // A client that breaks off has nobody left to be informed.
            let _ = attend(stream, &played, leave);
        })?))
    }

    /// Returns where it listens.
    pub fn address(&self) -> SocketAddr {
        self.0.address()
    }
}

/// Returns the type of a variable, as far as it is here.
fn kind(name: &str) -> &'static str {
    match name {
        "timestamp" => "DOUBLE",
        "ft_raw_wrench" | "actual_TCP_pose" | "actual_TCP_force" | "actual_q" | "actual_qd" => "VECTOR6D",
        "actual_tool_accelerometer" => "VECTOR3D",
        "robot_mode" | "safety_mode" => "INT32",
        "runtime_state" | "robot_status_bits" | "safety_status_bits" | "safety_status" => "UINT32",
        _ => "NOT_FOUND",
    }
}

fn value(name: &str, own_s: f64, sample: &Sample) -> Vec<u8> {
    let doubles = |values: &[f64]| values.iter().flat_map(|v| v.to_be_bytes()).collect();
    match name {
        "timestamp" => doubles(&[own_s]),
        "ft_raw_wrench" => doubles(&sample.wrench.map(|v| -v)),
        "actual_tool_accelerometer" => doubles(&sample.accel),
        "actual_TCP_pose" => {
            let [x, y, z, qw, qx, qy, qz] = sample.pose;
            let turn = UnitQuaternion::from_quaternion(Quaternion::new(qw, qx, qy, qz)).scaled_axis();
            doubles(&[x, y, z, turn.x, turn.y, turn.z])
        }
        "robot_mode" => 7_i32.to_be_bytes().to_vec(),
        "safety_mode" => 1_i32.to_be_bytes().to_vec(),
        name => match kind(name) {
            "UINT32" => 1_u32.to_be_bytes().to_vec(),
            _ => doubles(&[0.0; 6]),
        },
    }
}

fn package(kind: u8, payload: &[u8]) -> Vec<u8> {
    let length = u16::try_from(payload.len() + 3).unwrap_or(u16::MAX);
    [&length.to_be_bytes()[..], &[kind], payload].concat()
}

fn read(stream: &mut TcpStream, leave: &AtomicBool) -> io::Result<(u8, Vec<u8>)> {
    let mut head = [0; 3];
    exactly(stream, &mut head, leave)?;
    let length = usize::from(u16::from_be_bytes([head[0], head[1]]));
    let mut payload = vec![0; length.saturating_sub(3)];
    exactly(stream, &mut payload, leave)?;
    Ok((head[2], payload))
}

fn exactly(stream: &mut TcpStream, buffer: &mut [u8], leave: &AtomicBool) -> io::Result<()> {
    let mut at = 0;
    while at < buffer.len() {
        if leave.load(Ordering::Acquire) {
            return Err(io::ErrorKind::Interrupted.into());
        }
        match stream.read(&mut buffer[at..]) {
            Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(n) => at += n,
            Err(e) if matches!(e.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {}
            Err(e) => return Err(e),
        }
    }
    Ok(())
}

fn attend(mut stream: TcpStream, played: &Played, leave: &AtomicBool) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(LOOK_AGAIN))?;
    let (mut names, mut step) = (Vec::new(), 1);
    loop {
        let (kind_of, payload) = read(&mut stream, leave)?;
        let answer = match kind_of {
            b'V' => vec![u8::from(payload == [0, 2])],
            b'v' => CONTROLLER.into_iter().flat_map(u32::to_be_bytes).collect(),
            b'O' => {
                let (rate, list) = payload.split_first_chunk::<8>().ok_or(io::ErrorKind::InvalidData)?;
                step = (played.rate_hz / f64::from_be_bytes(*rate)).round().max(1.0) as u64;
                let list = String::from_utf8_lossy(list);
                // Clients end the list with a comma, too.
                names = list.split(',').filter(|name| !name.is_empty()).map(str::to_owned).collect();
                let types: Vec<&str> = names.iter().map(|name| kind(name)).collect();
                let recipe = u8::from(!types.contains(&"NOT_FOUND"));
                [&[recipe], types.join(",").as_bytes()].concat()
            }
            b'I' => {
                [&[1], vec!["DOUBLE"; payload.split(|b| *b == b',').count()].join(",").as_bytes()].concat()
            }
            b'S' | b'P' => vec![1],
            _ => continue,
        };
        stream.write_all(&package(kind_of, &answer))?;
        if kind_of == b'S' {
            let mut failed = None;
            played.play(leave, |number, sample| {
                if number % step != 0 {
                    return true;
                }
                let mut payload = vec![1];
                names.iter().for_each(|name| payload.extend(value(name, played.own_s(number), sample)));
                failed = stream.write_all(&package(b'U', &payload)).err();
                failed.is_none()
            });
            return failed.map_or(Ok(()), Err);
        }
    }
}

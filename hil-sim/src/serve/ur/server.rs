//! The ports: RTDE by the maker's guide, and the one that takes programs.

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use super::controller::CYCLE_S;
use super::language::{is_whole, read};
use super::state::{Shared, Tell};
use super::task::lock;
use crate::serve::listener::{LOOK_AGAIN, Listener};

/// Version of the controller: major, minor, bugfix, build.
const CONTROLLER: [u32; 4] = [3, 15, 4, 0];
/// Longest program, bytes.
const LONGEST: usize = 1 << 20;
/// Bytes of the length and type of a package.
const HEAD: usize = 3;

fn package(kind: u8, payload: &[u8]) -> Vec<u8> {
    let length = u16::try_from(payload.len() + HEAD).unwrap_or(u16::MAX);
    [&length.to_be_bytes()[..], &[kind], payload].concat()
}

/// One client of RTDE.
struct Client<'a> {
    stream: TcpStream,
    shared: &'a Mutex<Shared>,
    number: u64,
    bytes: Vec<u8>,
    outputs: Vec<String>,
    /// Cycles between two packages.
    every: u64,
    inputs: Vec<Vec<String>>,
    runs: bool,
    next: u64,
}

fn names(bytes: &[u8]) -> Vec<String> {
    // Clients end the list with a comma, too.
    String::from_utf8_lossy(bytes).split(',').filter(|name| !name.is_empty()).map(str::to_owned).collect()
}

impl Client<'_> {
    fn attend(&mut self, leave: &AtomicBool) -> io::Result<()> {
        self.stream.set_nonblocking(false)?;
        self.stream.set_nodelay(true)?;
        self.stream.set_read_timeout(Some(Duration::from_millis(1)))?;
        self.stream.set_write_timeout(Some(LOOK_AGAIN))?;
        let mut buffer = [0; 8192];
        while !leave.load(Ordering::Acquire) {
            match self.stream.read(&mut buffer) {
                Ok(0) => return Ok(()),
                Ok(n) => self.bytes.extend_from_slice(buffer.get(..n).unwrap_or_default()),
                Err(e) if matches!(e.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {}
                Err(e) => return Err(e),
            }
            if lock(self.shared).cut {
                // Nothing goes over a cut line, and nobody is informed of it.
                self.bytes.clear();
                continue;
            }
            while let Some((kind, payload)) = self.next_package()? {
                if let Some(answer) = self.obey(kind, &payload) {
                    self.stream.write_all(&package(kind, &answer))?;
                }
            }
            if self.runs {
                self.report()?;
            }
        }
        Ok(())
    }

    fn next_package(&mut self) -> io::Result<Option<(u8, Vec<u8>)>> {
        let Some(head) = self.bytes.first_chunk::<HEAD>().copied() else { return Ok(None) };
        let length = usize::from(u16::from_be_bytes([head[0], head[1]]));
        if length < HEAD {
            return Err(io::ErrorKind::InvalidData.into());
        }
        if self.bytes.len() < length {
            return Ok(None);
        }
        let rest = self.bytes.split_off(length);
        let payload = self.bytes.split_off(HEAD);
        self.bytes = rest;
        Ok(Some((head[2], payload)))
    }

    fn obey(&mut self, kind: u8, payload: &[u8]) -> Option<Vec<u8>> {
        Some(match kind {
            b'V' => vec![u8::from(payload == [0, 2])],
            b'v' => CONTROLLER.into_iter().flat_map(u32::to_be_bytes).collect(),
            b'O' => self.set_outputs(payload)?,
            b'I' => self.set_inputs(payload),
            b'S' => {
                self.runs = true;
                self.next = lock(self.shared).cycle;
                vec![1]
            }
            b'P' => {
                self.runs = false;
                vec![1]
            }
            b'U' => {
                let (recipe, values) = payload.split_first()?;
                let list = usize::from(*recipe).checked_sub(1).and_then(|k| self.inputs.get(k))?;
                lock(self.shared).write(list, values);
                return None;
            }
            _ => return None,
        })
    }

    fn set_outputs(&mut self, payload: &[u8]) -> Option<Vec<u8>> {
        let (rate, list) = payload.split_first_chunk::<8>()?;
        let rate_hz = f64::from_be_bytes(*rate);
        self.every =
            if rate_hz > 0.0 { (1.0 / (rate_hz * CYCLE_S)).round().clamp(1.0, 1e6) as u64 } else { 1 };
        self.outputs = names(list);
        let shared = lock(self.shared);
        let kinds: Vec<&str> =
            self.outputs.iter().map(|name| shared.read(name).map_or("NOT_FOUND", |(kind, _)| kind)).collect();
        let recipe = u8::from(!kinds.contains(&"NOT_FOUND"));
        Some([&[recipe], kinds.join(",").as_bytes()].concat())
    }

    fn set_inputs(&mut self, payload: &[u8]) -> Vec<u8> {
        let list = names(payload);
        let mut shared = lock(self.shared);
        let kind = |name: &String| match Shared::input_kind(name) {
            None => "NOT_FOUND",
            Some(_) if shared.claims.get(name).is_some_and(|owner| *owner != self.number) => "IN_USE",
            Some(kind) => kind,
        };
        let kinds: Vec<&str> = list.iter().map(kind).collect();
        let good = kinds.iter().all(|kind| !matches!(*kind, "NOT_FOUND" | "IN_USE"));
        let answer = kinds.join(",");
        let recipe = if good { u8::try_from(self.inputs.len() + 1).unwrap_or(0) } else { 0 };
        if recipe > 0 {
            shared.claims.extend(list.iter().map(|name| (name.clone(), self.number)));
            self.inputs.push(list);
        }
        [&[recipe], answer.as_bytes()].concat()
    }

    fn report(&mut self) -> io::Result<()> {
        let shared = lock(self.shared);
        if shared.cycle < self.next {
            return Ok(());
        }
        self.next = shared.cycle + self.every;
        let mut payload = vec![1];
        self.outputs
            .iter()
            .for_each(|name| payload.extend(shared.read(name).map_or(Vec::new(), |(_, bytes)| bytes)));
        drop(shared);
        self.stream.write_all(&package(b'U', &payload))
    }
}

/// The port of RTDE. Dropping it closes every connection.
pub struct Rtde(Listener);

impl Rtde {
    pub fn listen(address: &str, shared: Arc<Mutex<Shared>>) -> io::Result<Self> {
        let clients = AtomicU64::new(1);
        let attend = move |stream: TcpStream, leave: &AtomicBool| {
            let number = clients.fetch_add(1, Ordering::Relaxed);
            let mut client = Client {
                stream,
                shared: &shared,
                number,
                bytes: Vec::new(),
                outputs: Vec::new(),
                every: 1,
                inputs: Vec::new(),
                runs: false,
                next: 0,
            };
            // A client that breaks off has nobody left to be informed.
            let _ = client.attend(leave);
            lock(&shared).claims.retain(|_, owner| *owner != number);
        };
        Ok(Self(Listener::listen(address, attend)?))
    }

    pub fn address(&self) -> SocketAddr {
        self.0.address()
    }
}

/// The port that takes programs: of the secondary client. The state that a controller sends there is not
/// simulated.
pub struct Scripts(Listener);

impl Scripts {
    pub fn listen(address: &str, shared: Arc<Mutex<Shared>>, tell: Tell) -> io::Result<Self> {
        let attend = move |stream: TcpStream, leave: &AtomicBool| {
            // A client that breaks off has nobody left to be informed.
            let _ = programs(stream, &shared, &tell, leave);
        };
        Ok(Self(Listener::listen(address, attend)?))
    }

    pub fn address(&self) -> SocketAddr {
        self.0.address()
    }
}

fn programs(
    mut stream: TcpStream,
    shared: &Mutex<Shared>,
    tell: &Tell,
    leave: &AtomicBool,
) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(LOOK_AGAIN))?;
    let (mut text, mut buffer) = (Vec::new(), [0; 8192]);
    while !leave.load(Ordering::Acquire) {
        match stream.read(&mut buffer) {
            Ok(0) => return Ok(()),
            Ok(n) => text.extend_from_slice(buffer.get(..n).unwrap_or_default()),
            Err(e) if matches!(e.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {}
            Err(e) => return Err(e),
        }
        if text.len() > LONGEST || lock(shared).cut {
            return Ok(());
        }
        let so_far = String::from_utf8_lossy(&text);
        if !is_whole(&so_far) {
            continue;
        }
        match read(&so_far) {
            Ok(program) => lock(shared).sent = Some(program),
            Err(why) => tell(&format!("a program is not understood: {why}")),
        }
        text.clear();
    }
    Ok(())
}

//! The controller on the network and on a serial line.

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};

use super::controller::Hexapod;
use super::syntax::Input;
use crate::rig::SharedRig;
use crate::serve::listener::{LOOK_AGAIN, Listener};
use crate::serve::port::Port;

type Shared = Arc<Mutex<Hexapod>>;

fn lock(hexapod: &Shared) -> MutexGuard<'_, Hexapod> {
    hexapod.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Feeds one client's bytes; what to answer.
fn feed(hexapod: &Shared, input: &mut Input, bytes: &[u8], client: u64) -> Vec<u8> {
    bytes
        .iter()
        .filter_map(|byte| input.push(*byte))
        .flat_map(|said| lock(hexapod).obey(&said, client))
        .collect()
}

/// A client of a controller without a line between: of a simulation that has a clock of its own.
pub struct Client {
    hexapod: Shared,
    input: Input,
    number: u64,
}

impl Client {
    /// Returns clients of one controller of a rig.
    #[must_use]
    pub fn of_one<const N: usize>(rig: SharedRig) -> [Self; N] {
        let hexapod = Arc::new(Mutex::new(Hexapod::new(rig)));
        std::array::from_fn(|k| Self {
            hexapod: Arc::clone(&hexapod),
            input: Input::default(),
            number: k as u64 + 1,
        })
    }

    /// Says bytes; the controller's answer.
    pub fn say(&mut self, bytes: &[u8]) -> Vec<u8> {
        feed(&self.hexapod, &mut self.input, bytes, self.number)
    }

    /// Goes away: the controller stops a motion that this client has started.
    pub fn leave(&mut self) {
        lock(&self.hexapod).left(self.number);
    }
}

/// A controller on a network port. Dropping it closes every connection.
pub struct GcsServer {
    listener: Listener,
    hexapod: Shared,
}

impl GcsServer {
    /// Listens at `address`; port 0 takes a free one.
    ///
    /// # Errors
    /// If the address is taken or cannot be had.
    pub fn listen(address: impl ToSocketAddrs, rig: SharedRig) -> io::Result<Self> {
        let hexapod = Arc::new(Mutex::new(Hexapod::new(rig)));
        let (shared, clients) = (Arc::clone(&hexapod), AtomicU64::new(1));
        let listener = Listener::listen(address, move |stream, leave| {
            let client = clients.fetch_add(1, Ordering::Relaxed);
            // A client that breaks off has nobody left to be informed.
            let _ = converse(stream, &shared, client, leave);
            lock(&shared).left(client);
        })?;
        Ok(Self { listener, hexapod })
    }

    /// Returns where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.listener.address()
    }

    /// Serves the controller on a serial line too; `name` becomes a link to it.
    ///
    /// # Errors
    /// See [`Port::open`].
    pub fn open_port(&self, name: Option<&Path>) -> io::Result<GcsPort> {
        let mut port = Port::open(name)?;
        let terminal = port.terminal().to_owned();
        let leave = Arc::new(AtomicBool::new(false));
        let (stop, hexapod) = (Arc::clone(&leave), Arc::clone(&self.hexapod));
        let serving = thread::spawn(move || {
            // A line that is gone has nobody left to be informed.
            let _ = serve_port(&mut port, &hexapod, &stop);
            lock(&hexapod).left(0);
        });
        Ok(GcsPort { terminal, leave, serving: Some(serving) })
    }
}

/// A controller on a serial line. Dropping it removes the line.
pub struct GcsPort {
    terminal: PathBuf,
    leave: Arc<AtomicBool>,
    serving: Option<JoinHandle<()>>,
}

impl GcsPort {
    /// Returns the terminal's own path.
    #[must_use]
    pub fn terminal(&self) -> &Path {
        &self.terminal
    }
}

impl Drop for GcsPort {
    fn drop(&mut self) {
        self.leave.store(true, Ordering::Release);
        if let Some(thread) = self.serving.take() {
            // A panic there has printed itself.
            let _ = thread.join();
        }
    }
}

fn converse(mut stream: TcpStream, hexapod: &Shared, client: u64, leave: &AtomicBool) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(LOOK_AGAIN))?;
    // A client that does not read its answers is not waited for.
    stream.set_write_timeout(Some(20 * LOOK_AGAIN))?;
    let mut input = Input::default();
    let mut buffer = [0; 4096];
    while !leave.load(Ordering::Acquire) {
        match stream.read(&mut buffer) {
            Ok(0) => return Ok(()),
            Ok(n) => {
                let answer = feed(hexapod, &mut input, buffer.get(..n).unwrap_or_default(), client);
                stream.write_all(&answer)?;
            }
            Err(e) if matches!(e.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {}
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(())
}

fn serve_port(port: &mut Port, hexapod: &Shared, leave: &AtomicBool) -> io::Result<()> {
    let mut input = Input::default();
    let mut buffer = [0; 4096];
    let mut answers = Vec::new();
    let mut used = false;
    while !leave.load(Ordering::Acquire) {
        let n = port.read(&mut buffer, if answers.is_empty() { LOOK_AGAIN } else { LOOK_AGAIN / 50 })?;
        answers.extend(feed(hexapod, &mut input, buffer.get(..n).unwrap_or_default(), 0));
        let now_used = port.in_use()?;
        if used && !now_used {
            lock(hexapod).left(0);
            answers.clear();
            input = Input::default();
        }
        used = now_used;
        let taken = port.write(&answers)?;
        answers.drain(..taken);
    }
    Ok(())
}

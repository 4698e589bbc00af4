//! A platform that takes lines of set points: over TCP, over UDP, over a serial line; nothing is answered.
//!
//! Lines are those of [`hexapod::set_points`]. The first one must be where the plate is, within 5 mm and 20
//! mrad. A line that cannot be followed, and lines that cease, bring the plate to rest; a stream is then
//! over. Every connection and every sender of datagrams has a stream of its own, and none touches what
//! another client moves.

use std::collections::HashMap;
use std::io::{self, Read};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs, UdpSocket};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use super::listener::{LOOK_AGAIN, Listener};
use super::port::Port;
use crate::rig::{MotionState, Rig, SharedRig};
use crate::runner::lock;
use hexapod::set_points::{LINE_BYTES, SetPoint};
use hexapod::{Geometry, Pose};

/// The plate is at a line's pose this long after the line's time at the earliest, ns.
const BEHIND_NS: f64 = 5e7;
/// This many senders of datagrams are distinguished before those that move nothing are forgotten.
const SENDERS: usize = 64;
/// The distance that the first line may be from where the plate is, m and rad.
const NEAR: [f64; 2] = [0.005, 0.02];

/// Receives what was wrong with a stream.
pub type Tell = Arc<dyn Fn(&str) + Send + Sync>;

/// The receiving end. Dropping it closes every connection.
pub struct StreamServer {
    listener: Listener,
    leave: Arc<AtomicBool>,
    others: Vec<JoinHandle<()>>,
    rig: SharedRig,
    tell: Tell,
}

impl StreamServer {
    /// Listens at `address` for connections and for datagrams (port 0 takes a free one); `tell` receives why
    /// a stream was refused.
    ///
    /// # Errors
    /// If the address is taken or cannot be had.
    pub fn listen(
        address: impl ToSocketAddrs,
        rig: SharedRig,
        tell: impl Fn(&str) + Send + Sync + 'static,
    ) -> io::Result<Self> {
        let tell: Tell = Arc::new(tell);
        let (shared, report) = (Arc::clone(&rig), Arc::clone(&tell));
        let listener = Listener::listen(address, move |stream, leave| {
            let mut receiver = Receiver::new(Arc::clone(&shared), Arc::clone(&report));
            // A client that breaks off has nobody left to be informed.
            let _ = connection(stream, &mut receiver, leave);
        })?;
        let datagrams = UdpSocket::bind(listener.address())?;
        datagrams.set_read_timeout(Some(LOOK_AGAIN))?;
        let leave = Arc::new(AtomicBool::new(false));
        let mut server = Self { listener, leave, others: Vec::new(), rig, tell };
        let (shared, report) = (Arc::clone(&server.rig), Arc::clone(&server.tell));
        server.also(move |leave| {
            let mut senders: HashMap<SocketAddr, Receiver> = HashMap::new();
            let mut buffer = [0; 2048];
            while !leave.load(Ordering::Acquire) {
                // Nothing arrived, or what arrived was broken: try again.
                if let Ok((n, sender)) = datagrams.recv_from(&mut buffer) {
                    if senders.len() >= SENDERS {
                        senders.retain(|_, receiver| receiver.moves());
                    }
                    let receiver = senders
                        .entry(sender)
                        .or_insert_with(|| Receiver::new(Arc::clone(&shared), Arc::clone(&report)));
                    receiver.feed(buffer.get(..n).unwrap_or_default());
                }
            }
        });
        Ok(server)
    }

    /// Takes lines from a serial line of this name too.
    ///
    /// # Errors
    /// See [`Port::open`].
    pub fn open_port(&mut self, name: &Path) -> io::Result<()> {
        let mut port = Port::open(Some(name))?;
        let mut receiver = Receiver::new(Arc::clone(&self.rig), Arc::clone(&self.tell));
        self.also(move |leave| {
            let mut buffer = [0; 2048];
            while !leave.load(Ordering::Acquire) {
                match port.read(&mut buffer, LOOK_AGAIN) {
                    Ok(n) => receiver.feed(buffer.get(..n).unwrap_or_default()),
                    Err(_) => return,
                }
            }
        });
        Ok(())
    }

    fn also(&mut self, serve: impl FnOnce(&AtomicBool) + Send + 'static) {
        let leave = Arc::clone(&self.leave);
        self.others.push(thread::spawn(move || serve(&leave)));
    }

    /// Returns where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.listener.address()
    }
}

impl Drop for StreamServer {
    fn drop(&mut self) {
        self.leave.store(true, Ordering::Release);
        for thread in self.others.drain(..) {
            // A panic there has printed itself.
            let _ = thread.join();
        }
    }
}

fn connection(mut stream: TcpStream, receiver: &mut Receiver, leave: &AtomicBool) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(LOOK_AGAIN))?;
    let mut buffer = [0; 2048];
    while !leave.load(Ordering::Acquire) {
        match stream.read(&mut buffer) {
            Ok(0) => return Ok(()),
            Ok(n) => receiver.feed(buffer.get(..n).unwrap_or_default()),
            Err(e) if matches!(e.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {}
            Err(e) => return Err(e),
        }
    }
    Ok(())
}

/// A stream under way.
struct Course {
    /// The rig's clock at the stream's zero, ns.
    origin_ns: f64,
    last_s: f64,
    pose: Pose,
    /// Nothing more of it is followed.
    over: bool,
    /// The number of the rig's motion.
    motion: u64,
}

/// A receiver that follows the lines of one sender.
pub struct Receiver {
    rig: SharedRig,
    geometry: Geometry,
    tell: Tell,
    line: Vec<u8>,
    course: Option<Course>,
}

impl Receiver {
    /// Makes the receiver of a rig; `tell` receives the faults of lines.
    pub fn new(rig: SharedRig, tell: Tell) -> Self {
        let geometry = lock(&rig).config().geometry.clone();
        Self { rig, geometry, tell, line: Vec::new(), course: None }
    }

    /// Takes bytes of lines, whole or not.
    pub fn feed(&mut self, bytes: &[u8]) {
        for byte in bytes {
            if *byte != b'\n' {
                // What is longer is no line; its end is not understood either.
                if self.line.len() < LINE_BYTES {
                    self.line.push(*byte);
                }
                continue;
            }
            let line = std::mem::take(&mut self.line);
            let text = String::from_utf8_lossy(&line);
            if let Err(said) = self.follow(text.trim()) {
                if self.moves() {
                    lock(&self.rig).stop();
                }
                if let Some(course) = &mut self.course {
                    course.over = true;
                }
                (self.tell)(&format!("{text:?}: {said}"));
            }
        }
    }

    /// Returns whether the plate moves, or moved last, by this stream.
    fn moves(&self) -> bool {
        self.course.as_ref().is_some_and(|c| !c.over && c.motion == lock(&self.rig).motions_begun())
    }

    fn follow(&mut self, line: &str) -> Result<(), String> {
        let (time_s, point) = SetPoint::read(line).map_err(|e| e.to_string())?;
        let shared = Arc::clone(&self.rig);
        let rig = &mut *lock(&shared);
        // Time that does not go on, and a plate at rest: another stream.
        let idle = rig.motion() != MotionState::Moving;
        if self.course.as_ref().is_none_or(|c| time_s <= c.last_s && idle) {
            self.begin(rig, time_s, &point)?;
        }
        let Some(course) = &mut self.course else { return Ok(()) };
        if course.over {
            return Ok(());
        }
        course.pose = pose(&point, &self.geometry, &course.pose)?;
        course.last_s = time_s;
        let at_ns = course.origin_ns + 1e9 * time_s;
        if course.motion != rig.motions_begun() {
            return Err("another client moves the plate".to_owned());
        }
        rig.pass_through(&course.pose, at_ns as u64).map_err(|e| e.to_string())?;
        course.motion = rig.motions_begun();
        Ok(())
    }

    fn begin(&mut self, rig: &mut Rig, time_s: f64, point: &SetPoint) -> Result<(), String> {
        let here = rig.pose();
        let first = pose(point, &self.geometry, &here)?;
        let far = |a: [f64; 3], b: [f64; 3]| (0..3).fold(0.0_f64, |m, i| m.max((a[i] - b[i]).abs()));
        let away = [far(first.position_m, here.position_m), far(first.rpy_rad, here.rpy_rad)];
        if rig.motion() == MotionState::Moving {
            return Err("the plate is moving already".to_owned());
        }
        if away[0] > NEAR[0] || away[1] > NEAR[1] {
            return Err(format!(
                "the stream begins {:.1} mm and {:.1} mrad from the pose of the plate: begin there",
                1e3 * away[0],
                1e3 * away[1]
            ));
        }
        // What is left of a stream before is forgotten.
        rig.stop();
        let origin_ns = rig.now_ns() as f64 + BEHIND_NS - 1e9 * time_s;
        self.course =
            Some(Course { origin_ns, last_s: time_s, pose: here, over: false, motion: rig.motions_begun() });
        Ok(())
    }
}

fn pose(point: &SetPoint, geometry: &Geometry, near: &Pose) -> Result<Pose, String> {
    match point {
        SetPoint::Pose(pose) => Ok(*pose),
        SetPoint::Legs(lengths) => geometry.forward(lengths, near).map_err(|e| e.to_string()),
    }
}

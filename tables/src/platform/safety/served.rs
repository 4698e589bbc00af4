//! A simulated rig in this process, in real time, that a `rigident run` of its own process drives, and what
//! can go wrong with it.

use std::fs;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use hexapod::{Axis, Geometry, MotionProgram, Pose, Segment, SineTerm};
use rigident::plan::plan_file::PlanFile;
use rigident_sim::link::ByteLink;
use rigident_sim::rig::{Rig, RigConfig, SharedRig};
use rigident_sim::runner::{InProcess, Pacing};
use rigident_sim::sensors::{Channel, Fault as SensorFault};
use rigident_sim::serve::gcs::GcsServer;
use rigident_sim::serve::{Controller, Firmware, Port, StreamServer, carry, rig_file};

use super::{Driver, Fault};

/// The time that the first pose is held, s, and the motion after it.
pub const HOLD_S: f64 = 2.0;
const MOTION_S: f64 = 6.0;

/// Returns a program away from home, so that there is a way to the start and one home: a rest, then a motion
/// of several axes.
fn program(geometry: &Geometry) -> MotionProgram {
    let mut start = geometry.home();
    start.position_m[0] += 0.03;
    start.rpy_rad = [0.2, -0.1, 0.0];
    let term = |axis, amplitude, frequency_hz| SineTerm { axis, amplitude, frequency_hz, phase_rad: 0.3 };
    let terms = vec![
        term(Axis::Z, 0.02, 0.7),
        term(Axis::Roll, 0.12, 0.6),
        term(Axis::Pitch, 0.1, 0.9),
        term(Axis::Yaw, 0.1, 0.5),
    ];
    let motion = Segment::Multisine { duration_s: MOTION_S, ramp_s: 1.0, terms };
    MotionProgram { start, segments: vec![Segment::Hold { duration_s: HOLD_S }, motion] }
}

/// The firmware, unless its line is cut.
struct Cut {
    firmware: Firmware,
    cut: Arc<AtomicBool>,
}

impl ByteLink for Cut {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.cut.load(Ordering::Acquire) { Ok(()) } else { self.firmware.write(bytes) }
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let cut = self.cut.load(Ordering::Acquire);
        self.firmware.read(if cut { &mut [] } else { buffer }, timeout)
    }
}

/// The line between host and controller: it can be frozen, or cut.
struct Between {
    address: SocketAddr,
    frozen: Arc<AtomicBool>,
    sides: Arc<Mutex<Vec<TcpStream>>>,
}

impl Between {
    fn new(controller: SocketAddr) -> io::Result<Self> {
        let listener = TcpListener::bind("127.0.0.1:0")?;
        let between = Self { address: listener.local_addr()?, frozen: Arc::default(), sides: Arc::default() };
        let (frozen, sides) = (Arc::clone(&between.frozen), Arc::clone(&between.sides));
        thread::spawn(move || {
            // One client: the run.
            let Ok((host, _)) = listener.accept() else { return };
            let Ok(controller) = TcpStream::connect(controller) else { return };
            let both = [&host, &controller].map(TcpStream::try_clone);
            let [Ok(a), Ok(b)] = both else { return };
            if let (Ok(c), Ok(d)) = (a.try_clone(), b.try_clone()) {
                sides.lock().unwrap_or_else(PoisonError::into_inner).extend([c, d]);
            }
            let is_frozen = Arc::clone(&frozen);
            thread::spawn(move || pass(host, b, &is_frozen));
            pass(controller, a, &frozen);
        });
        Ok(between)
    }

    fn cut(&self) {
        for side in self.sides.lock().unwrap_or_else(PoisonError::into_inner).iter() {
            // One that is gone already is cut.
            let _ = side.shutdown(Shutdown::Both);
        }
    }
}

/// Hands bytes on, until an end is gone; while frozen they stay where they are.
fn pass(mut from: TcpStream, mut to: TcpStream, frozen: &AtomicBool) {
    let mut buffer = [0; 4096];
    // However this ends, the other side is to see it.
    while let Ok(n @ 1..) = from.read(&mut buffer) {
        while frozen.load(Ordering::Acquire) {
            thread::sleep(Duration::from_millis(5));
        }
        if to.set_nodelay(true).and_then(|()| to.write_all(&buffer[..n])).is_err() {
            break;
        }
    }
    let _ = to.shutdown(Shutdown::Both);
}

/// The rig, its controllers, and the run that uses them.
pub struct Served {
    folder: PathBuf,
    rig: SharedRig,
    between: Between,
    own: SocketAddr,
    driver: Driver,
    cut: Arc<AtomicBool>,
    leave: Arc<AtomicBool>,
    carrying: Option<JoinHandle<()>>,
    child: Child,
    said: Receiver<String>,
    _servers: (Controller, GcsServer, StreamServer),
}

impl Served {
    /// Starts both, in a folder that is made for it.
    pub fn start(folder: &Path, driver: Driver) -> io::Result<Self> {
        fs::create_dir_all(folder)?;
        let config = RigConfig::thesis_horizontal().with_seed(3);
        let rig = Rig::new(config).map_err(io::Error::other)?;
        fs::write(folder.join("rig.toml"), rig_file(&rig))?;
        let geometry = rig.config().geometry.clone();
        PlanFile::new("safety".to_owned(), &geometry, program(&geometry))
            .write(&folder.join("plan.json"))
            .map_err(io::Error::other)?;
        let rig = rig.shared();
        let json = Controller::listen("127.0.0.1:0", Arc::clone(&rig))?;
        let gcs = GcsServer::listen("127.0.0.1:0", Arc::clone(&rig))?;
        let lines = StreamServer::listen("127.0.0.1:0", Arc::clone(&rig), |_| {})?;
        let own = match driver {
            Driver::Json => json.address(),
            Driver::Gcs => gcs.address(),
            Driver::Lines => lines.address(),
        };
        let between = Between::new(own)?;
        let mut port = Port::open(Some(&folder.join("port")))?;
        let (leave, cut) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
        let (stop, mute, shared) = (Arc::clone(&leave), Arc::clone(&cut), Arc::clone(&rig));
        let carrying = thread::spawn(move || {
            let firmware = Firmware(Box::new(InProcess::new(shared, Pacing::RealTime)));
            // A line that is gone is seen by the run.
            let _ = carry(&mut port, &mut Cut { firmware, cut: mute }, &stop);
        });
        let scheme = match driver {
            Driver::Json => "tcp",
            Driver::Gcs => "gcs",
            Driver::Lines => "pose+tcp",
        };
        let program = std::env::current_exe()?.with_file_name("rigident");
        let mut child = Command::new(program)
            .current_dir(folder)
            .args(["run", "--rig", "rig.toml", "--port", "port", "--plan", "plan.json", "--out", "out"])
            .args(["--warm-up-s", "0", "--yes", "--platform", &format!("{scheme}://{}", between.address)])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()?;
        let (tell, said) = mpsc::channel();
        if let Some(stderr) = child.stderr.take() {
            thread::spawn(move || {
                // Nobody listens any more once the run is judged.
                BufReader::new(stderr).lines().map_while(Result::ok).for_each(|line| drop(tell.send(line)));
            });
        }
        let folder = folder.to_owned();
        let (carrying, servers) = (Some(carrying), (json, gcs, lines));
        Ok(Self { folder, rig, between, own, driver, cut, leave, carrying, child, said, _servers: servers })
    }

    /// Returns the rig's clock, s, and where the plate is.
    pub fn look(&self) -> (f64, Pose) {
        let rig = self.rig.lock().unwrap_or_else(PoisonError::into_inner);
        (rig.now_ns() as f64 * 1e-9, rig.pose())
    }

    /// Returns lines that the run has said since the last time.
    pub fn heard(&self) -> Vec<String> {
        self.said.try_iter().collect()
    }

    /// Returns the run's exit status, once it has one; a signal's number below zero.
    pub fn status(&mut self) -> io::Result<Option<i32>> {
        let status = self.child.try_wait()?;
        Ok(status.map(|status| status.code().unwrap_or(-9)))
    }

    /// Has something go wrong.
    pub fn fail(&self, fault: Fault) -> io::Result<()> {
        match fault {
            Fault::CtrlC => self.signal("-INT"),
            Fault::Terminate => self.signal("-TERM"),
            Fault::Kill => self.signal("-KILL"),
            Fault::Stall => self.signal("-STOP"),
            Fault::SecondClient => self.second_client(),
            Fault::DeadController => {
                self.between.frozen.store(true, Ordering::Release);
                Ok(())
            }
            Fault::LostPlatform => {
                self.between.cut();
                Ok(())
            }
            Fault::LostDevice => {
                self.cut.store(true, Ordering::Release);
                Ok(())
            }
            Fault::Overload => {
                let mut rig = self.rig.lock().unwrap_or_else(PoisonError::into_inner);
                let now_s = rig.now_ns() as f64 * 1e-9;
                rig.add_fault(SensorFault::Saturated {
                    channel: Channel::Wrench(3),
                    during: now_s..f64::INFINITY,
                });
                Ok(())
            }
        }
    }

    /// Lets a run that was stopped go on.
    pub fn go_on(&self) -> io::Result<()> {
        self.signal("-CONT")
    }

    /// Lets another client stop the plate; where there is no stop it says where it would have it.
    fn second_client(&self) -> io::Result<()> {
        let mut other = TcpStream::connect(self.own)?;
        let line = match self.driver {
            Driver::Json => "{\"cmd\":\"stop\"}\n".to_owned(),
            Driver::Gcs => "STP\n".to_owned(),
            Driver::Lines => {
                let pose = self.look().1;
                let [x, y, z] = pose.position_m;
                format!("0.01,{x},{y},{z},1,0,0,0\n")
            }
        };
        other.write_all(line.as_bytes())?;
        // So that it is read before the connection is closed.
        thread::sleep(Duration::from_millis(50));
        Ok(())
    }

    fn signal(&self, name: &str) -> io::Result<()> {
        let status =
            Command::new("kill").args([name, &self.child.id().to_string()]).stderr(Stdio::null()).status()?;
        if status.success() { Ok(()) } else { Err(io::Error::other("the run has ended already")) }
    }

    /// Returns the number of readings in the recording that is left, if one can be read.
    pub fn kept(&self) -> Option<usize> {
        let recording = rigident::recording::Recording::load(&self.folder.join("out/run.mcap"), None).ok()?;
        Some(recording.rows())
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        // One that has ended needs no end.
        let _ = self.child.kill();
        let _ = self.child.wait();
        self.leave.store(true, Ordering::Release);
        if let Some(thread) = self.carrying.take() {
            let _ = thread.join();
        }
        let _ = fs::remove_dir_all(&self.folder);
    }
}

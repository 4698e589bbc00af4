//! The release firmware in QEMU's Cortex-M4F.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::fd::AsRawFd;
use std::os::unix::fs::OpenOptionsExt;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use nix::errno::Errno;
use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::poll::{PollFd, PollFlags};
use nix::sys::stat::Mode;
use serialport::{SerialPort, TTYPort};
use tempfile::TempDir;

use super::emulator_log::{Log, LogLine};
#[cfg(feature = "firmware-log")]
use super::emulator_log_decoded::Decoder;
#[cfg(not(feature = "firmware-log"))]
use super::emulator_log_unread::Decoder;
use super::error::RunnerError;
use super::requests::answer_requests;
use super::sensor_bus::{PacedRig, SensorBus};
use super::{Mcu, Pacing};
use crate::rig::SharedRig;

/// Environment variable that names another firmware image.
pub const FIRMWARE_VARIABLE: &str = "RIGIDENT_FIRMWARE_ELF";
const FIRMWARE_IN_BOARD: &str = "target/thumbv7em-none-eabihf/release/rigident-mps2-an386";
const REQUESTS: &str = "requests";
const ANSWERS: &str = "answers";
const ERRORS: &str = "errors";
/// The time that a write may go without a byte being taken. The firmware takes bytes whatever else it does,
/// so only a dead one comes near.
const STALLED: Duration = Duration::from_secs(30);
/// The time between two checks of a wait whether the emulator still lives.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// Returns where `cargo xtask firmware` leaves the firmware, unless `RIGIDENT_FIRMWARE_ELF` names another.
#[must_use]
pub fn firmware_elf() -> PathBuf {
    std::env::var_os(FIRMWARE_VARIABLE).map_or_else(
        || {
            let here = Path::new(env!("CARGO_MANIFEST_DIR"));
            here.with_file_name("firmware").join("boards/mps2-an386").join(FIRMWARE_IN_BOARD)
        },
        PathBuf::from,
    )
}

/// Returns where the image that watches robots lies: beside [`firmware_elf`], its name ends in `-watch`.
#[must_use]
pub fn watch_elf() -> PathBuf {
    let standard = firmware_elf();
    let mut name = standard.file_stem().unwrap_or_default().to_os_string();
    name.push("-watch");
    if let Some(extension) = standard.extension() {
        name.push(".");
        name.push(extension);
    }
    standard.with_file_name(name)
}

/// The board to emulate.
#[derive(Clone, Debug)]
pub struct QemuOptions {
    /// The firmware image.
    pub elf: PathBuf,
    /// The emulator.
    pub program: PathBuf,
    /// Print the firmware's log on standard error.
    pub show_log: bool,
    /// `Some(shift)`: one instruction takes 2^shift virtual nanoseconds. The firmware's results do not depend
    /// on it.
    pub instruction_clock: Option<u8>,
}

impl Default for QemuOptions {
    fn default() -> Self {
        Self {
            elf: firmware_elf(),
            program: PathBuf::from("qemu-system-arm"),
            show_log: false,
            instruction_clock: None,
        }
    }
}

/// The depth to which the firmware's stack has been.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StackUse {
    /// Deepest use, bytes.
    pub used: usize,
    /// The size available, bytes.
    pub size: usize,
}

/// An emulated microcontroller. Dropping it ends the emulator and leaves nothing behind.
pub struct Qemu {
    line: TTYPort,
    // Held open, so that the line does not hang up before the last byte is read.
    _device_end: TTYPort,
    child: Child,
    ended: Option<ExitStatus>,
    leave: Arc<AtomicBool>,
    log: Arc<Log>,
    threads: Vec<JoinHandle<()>>,
    // Pipes and error output live in it.
    folder: TempDir,
}

impl Qemu {
    /// Starts the emulator with the rig's sensors behind its drivers.
    ///
    /// # Errors
    /// See [`Self::spawn_on`].
    pub fn spawn(options: &QemuOptions, rig: SharedRig, pacing: Pacing) -> Result<Self, RunnerError> {
        Self::spawn_on(options, Box::new(PacedRig::new(rig, pacing)))
    }

    /// Starts the emulator with `bus` behind its sensor drivers.
    ///
    /// # Errors
    /// Emulator or firmware missing, or the machine refuses a terminal, a pipe or a process.
    pub fn spawn_on(options: &QemuOptions, bus: Box<dyn SensorBus>) -> Result<Self, RunnerError> {
        let io = RunnerError::io;
        let elf = options
            .elf
            .canonicalize()
            .map_err(|_| RunnerError::FirmwareMissing { path: options.elf.clone() })?;
        let image = fs::read(&elf).map_err(io("reading the firmware"))?;
        let decoder = Decoder::new(&image, &elf)?;

        let folder = tempfile::Builder::new()
            .prefix("rigident-")
            .tempdir()
            .map_err(io("making a folder for pipes"))?;
        let (requests, answers) = pipes(folder.path()).map_err(io("making pipes"))?;
        let (line, device_end) = TTYPort::pair().map_err(|e| io("making a pseudo-terminal")(e.into()))?;
        let errors = File::create(folder.path().join(ERRORS))
            .map_err(io("making a file for the emulator's errors"))?;
        let mut child = command(options, &elf, &device_end.name().unwrap_or_default())
            // The pipes' names are relative: no path has to survive the emulator's option syntax.
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(errors)
            // Ctrl-C is for whoever runs the experiment: the motion stops first, then the firmware.
            .process_group(0)
            .spawn()
            .map_err(|e| match e.kind() {
                io::ErrorKind::NotFound => RunnerError::EmulatorMissing { program: options.program.clone() },
                _ => RunnerError::Io { doing: "starting the emulator", source: e },
            })?;

        let log = Arc::new(Log::default());
        let leave = Arc::new(AtomicBool::new(false));
        let mut threads = Vec::new();
        if let Some(output) = child.stdout.take() {
            let (log, show) = (Arc::clone(&log), options.show_log);
            threads.push(thread::spawn(move || follow_log(&decoder, output, &log, show)));
        }
        let (bus_log, bus_leave) = (Arc::clone(&log), Arc::clone(&leave));
        threads.push(thread::spawn(move || serve_bus(requests, answers, bus, &bus_log, &bus_leave)));
        Ok(Self { line, _device_end: device_end, child, ended: None, leave, log, threads, folder })
    }

    /// Returns the last lines the firmware logged, oldest first; at most 50 are stored.
    #[must_use]
    pub fn log(&self) -> Vec<LogLine> {
        self.log.last(usize::MAX)
    }

    /// Asks the firmware to leave, and waits for it; what it still sends is discarded. Gives its stack use.
    ///
    /// # Errors
    /// `BrokenPipe` if it did not end well, `TimedOut` if it does not leave within `patience`.
    pub fn finish(mut self, patience: Duration) -> io::Result<Option<StackUse>> {
        self.leave.store(true, Ordering::Release);
        let deadline = Instant::now() + patience;
        let mut discarded = [0; 1024];
        while self.look()?.is_none() {
            if Instant::now() > deadline {
                return Err(io::Error::new(io::ErrorKind::TimedOut, "the emulated firmware does not leave"));
            }
            if let Err(e) = self.read(&mut discarded, LOOK_AGAIN)
                && self.ended.is_none()
            {
                return Err(e);
            }
        }
        self.join();
        match self.ended {
            Some(status) if status.success() => Ok(self.log().iter().rev().find_map(stack_use)),
            _ => Err(self.obituary()),
        }
    }

    /// Process number of the emulator.
    #[must_use]
    pub fn process_id(&self) -> u32 {
        self.child.id()
    }

    fn look(&mut self) -> io::Result<Option<ExitStatus>> {
        if self.ended.is_none() {
            self.ended = self.child.try_wait()?;
        }
        Ok(self.ended)
    }

    /// Waits for the threads; only once the emulator has ended.
    fn join(&mut self) {
        // A reader of requests that never had a writer would wait for one: this one comes and goes.
        let _ = OpenOptions::new()
            .write(true)
            .custom_flags(OFlag::O_NONBLOCK.bits())
            .open(self.folder.path().join(REQUESTS));
        for thread in self.threads.drain(..) {
            // A panic there has printed itself.
            let _ = thread.join();
        }
    }

    /// Returns what is left to say about an emulator that has ended.
    fn obituary(&mut self) -> io::Error {
        self.join();
        let how = match self.ended.map(|status| (status.code(), status.signal())) {
            Some((Some(0), _)) => "left".to_owned(),
            Some((Some(code), _)) => format!("ended with exit status {code}"),
            Some((None, Some(signal))) => format!("was ended by signal {signal}"),
            _ => "is gone".to_owned(),
        };
        let mut text = format!("the emulated firmware {how}");
        if let Some(line) = self.log().iter().rev().find(|line| line.level == "error") {
            text += &format!("; it logged: {}", line.message);
        }
        let errors = fs::read_to_string(self.folder.path().join(ERRORS)).unwrap_or_default();
        if let Some(line) = errors.lines().last() {
            text += &format!("; the emulator said: {line}");
        }
        io::Error::new(io::ErrorKind::BrokenPipe, text)
    }
}

impl Mcu for Qemu {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut rest = bytes;
        let mut moved = Instant::now();
        self.line.set_timeout(LOOK_AGAIN)?;
        while !rest.is_empty() {
            if self.look()?.is_some() {
                return Err(self.obituary());
            }
            match self.line.write(rest) {
                Ok(n) => {
                    rest = rest.get(n..).unwrap_or_default();
                    moved = Instant::now();
                }
                Err(e) if retry(&e) => {
                    if moved.elapsed() > STALLED {
                        return Err(io::Error::new(
                            io::ErrorKind::TimedOut,
                            "the emulated firmware takes no bytes",
                        ));
                    }
                }
                Err(e) => return Err(e),
            }
        }
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        if buffer.is_empty() {
            // It works by itself.
            thread::sleep(timeout);
            return Ok(0);
        }
        let deadline = Instant::now() + timeout;
        let mut ended = false;
        loop {
            let left =
                if ended { Duration::ZERO } else { deadline.saturating_duration_since(Instant::now()) };
            self.line.set_timeout(left.min(LOOK_AGAIN))?;
            match self.line.read(buffer) {
                Ok(n) if n > 0 => return Ok(n),
                Ok(_) => {}
                Err(e) if retry(&e) => {}
                Err(e) => return Err(e),
            }
            if ended {
                return Err(self.obituary());
            }
            // What arrived between that read and the end is found by one more.
            ended = self.look()?.is_some();
            if left.is_zero() && !ended {
                return Ok(0);
            }
        }
    }

    fn name(&self) -> &'static str {
        "qemu"
    }
}

impl Drop for Qemu {
    fn drop(&mut self) {
        if self.ended.is_none() {
            // Failing means that it has just ended by itself.
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
        self.join();
    }
}

fn retry(e: &io::Error) -> bool {
    matches!(e.kind(), io::ErrorKind::TimedOut | io::ErrorKind::Interrupted | io::ErrorKind::WouldBlock)
}

/// Returns the pipe that requests are read from and the one that answers are written to.
///
/// Neither opening waits for the other side: not to block lets a reader in alone, and a pipe opened for both
/// is its own other side. The emulator's openings then find a partner.
fn pipes(folder: &Path) -> io::Result<(File, File)> {
    let (requests, answers) = (folder.join(REQUESTS), folder.join(ANSWERS));
    for pipe in [&requests, &answers] {
        nix::unistd::mkfifo(pipe, Mode::S_IRUSR | Mode::S_IWUSR)?;
    }
    let requests = OpenOptions::new().read(true).custom_flags(OFlag::O_NONBLOCK.bits()).open(requests)?;
    let answers = OpenOptions::new().read(true).write(true).open(answers)?;
    Ok((requests, answers))
}

fn command(options: &QemuOptions, elf: &Path, port: &str) -> Command {
    let mut command = Command::new(&options.program);
    command
        .args(["-M", "mps2-an386", "-display", "none", "-monitor", "none", "-serial", port])
        // In one option: a second one would count the arguments of the first again.
        .arg("-semihosting-config")
        .arg(format!("enable=on,target=native,arg=rigident,arg={REQUESTS},arg={ANSWERS}"))
        .arg("-kernel")
        .arg(elf);
    if let Some(shift) = options.instruction_clock {
        command.args(["-icount", &format!("shift={shift}")]);
    }
    command
}

fn follow_log(decoder: &Decoder, mut output: ChildStdout, log: &Log, show: bool) {
    let each = |line: &LogLine| {
        if show {
            eprintln!("firmware {}: {}", line.level, line.message);
        }
    };
    if let Err(e) = decoder.follow(&mut output, log, each) {
        log.error(format!("the log broke off: {e}"));
    }
}

fn serve_bus(
    mut requests: File,
    mut answers: File,
    mut bus: Box<dyn SensorBus>,
    log: &Log,
    leave: &AtomicBool,
) {
    let served = wait_for_writer(&requests)
        .and_then(|()| answer_requests(&mut requests, &mut answers, bus.as_mut(), leave));
    if let Err(e) = served {
        log.error(format!("the sensor bus failed: {e}"));
    }
}

/// Waits for the first request, then lets reads wait.
fn wait_for_writer(requests: &File) -> io::Result<()> {
    let mut poll = [PollFd::new(requests.as_raw_fd(), PollFlags::POLLIN)];
    while nix::poll::poll(&mut poll, -1).or_else(|e| if e == Errno::EINTR { Ok(0) } else { Err(e) })? == 0 {}
    fcntl(requests.as_raw_fd(), FcntlArg::F_SETFL(OFlag::empty()))?;
    Ok(())
}

/// Reads the line that the firmware logs as it leaves.
fn stack_use(line: &LogLine) -> Option<StackUse> {
    let (used, size) =
        line.message.strip_prefix("stack: ")?.strip_suffix(" bytes used")?.split_once(" of ")?;
    Some(StackUse { used: used.parse().ok()?, size: size.parse().ok()? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_with_the_stack_is_distinguished_from_others() {
        let line = |message: &str| stack_use(&LogLine { level: "info", message: message.to_owned() });
        assert_eq!(line("stack: 4296 of 124892 bytes used"), Some(StackUse { used: 4296, size: 124_892 }));
        for other in ["", "stack: many of 3 bytes used", "stack: 1 of 2 bytes", "running: commanded"] {
            assert_eq!(line(other), None);
        }
    }
}

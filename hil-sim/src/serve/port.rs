//! A pseudo-terminal with a name, that a program opens like any serial port.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::fd::AsRawFd;
use std::os::unix::fs::{OpenOptionsExt, symlink};
use std::path::{Path, PathBuf};
use std::time::Duration;

use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::poll::{PollFd, PollFlags};
use nix::pty::{PtyMaster, grantpt, posix_openpt, ptsname_r, unlockpt};
use nix::sys::inotify::{AddWatchFlags, InitFlags, Inotify};
use nix::sys::termios::{FlushArg, SetArg, cfmakeraw, tcflush, tcgetattr, tcsetattr};

/// Our end of a pseudo-terminal. Dropping it removes its name.
pub struct Port {
    line: PtyMaster,
    // Held open, so that the line neither hangs up between two users nor falls back to echoing.
    user_end: File,
    terminal: PathBuf,
    name: Option<PathBuf>,
    watch: Inotify,
    users: usize,
}

impl Port {
    /// Opens one; `name` becomes a symbolic link to it.
    ///
    /// # Errors
    /// If there is a file of that name already (a link that leads nowhere is replaced), or the system
    /// refuses.
    pub fn open(name: Option<&Path>) -> io::Result<Self> {
        let line = posix_openpt(OFlag::O_RDWR | OFlag::O_NOCTTY)?;
        grantpt(&line)?;
        unlockpt(&line)?;
        let terminal = PathBuf::from(ptsname_r(&line)?);
        let user_end =
            OpenOptions::new().read(true).write(true).custom_flags(OFlag::O_NOCTTY.bits()).open(&terminal)?;
        let mut settings = tcgetattr(user_end.as_raw_fd())?;
        cfmakeraw(&mut settings);
        tcsetattr(user_end.as_raw_fd(), SetArg::TCSANOW, &settings)?;
        fcntl(line.as_raw_fd(), FcntlArg::F_SETFL(OFlag::O_RDWR | OFlag::O_NONBLOCK))?;

        let watch = Inotify::init(InitFlags::IN_NONBLOCK | InitFlags::IN_CLOEXEC)?;
        watch.add_watch(&terminal, AddWatchFlags::IN_OPEN | AddWatchFlags::IN_CLOSE)?;
        if let Some(name) = name {
            // A link left behind by a run that was killed leads nowhere.
            if name.is_symlink() && !name.exists() {
                fs::remove_file(name)?;
            }
            symlink(&terminal, name)?;
        }
        Ok(Self { line, user_end, terminal, name: name.map(Path::to_owned), watch, users: 0 })
    }

    /// Returns the terminal's own path.
    #[must_use]
    pub fn terminal(&self) -> &Path {
        &self.terminal
    }

    /// Returns whether somebody has it open. What a user who has left had not read is gone.
    ///
    /// # Errors
    /// Any error of the system.
    pub fn in_use(&mut self) -> io::Result<bool> {
        let events = match self.watch.read_events() {
            Ok(events) => events,
            Err(nix::errno::Errno::EAGAIN) => return Ok(self.users > 0),
            Err(e) => return Err(e.into()),
        };
        let mut deserted = false;
        for event in events {
            if event.mask.contains(AddWatchFlags::IN_OPEN) {
                self.users += 1;
            } else if event.mask.intersects(AddWatchFlags::IN_CLOSE) {
                self.users = self.users.saturating_sub(1);
                deserted |= self.users == 0;
            }
        }
        if deserted {
            tcflush(self.user_end.as_raw_fd(), FlushArg::TCIFLUSH)?;
        }
        Ok(self.users > 0)
    }

    /// Returns the bytes that the user has sent; 0 if none come within `timeout`.
    ///
    /// # Errors
    /// Any error of the system.
    pub fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let mut wait = [PollFd::new(self.line.as_raw_fd(), PollFlags::POLLIN)];
        let milliseconds = i32::try_from(timeout.as_millis()).unwrap_or(i32::MAX);
        match nix::poll::poll(&mut wait, milliseconds) {
            Ok(0) | Err(nix::errno::Errno::EINTR) => return Ok(0),
            Ok(_) => {}
            Err(e) => return Err(e.into()),
        }
        match self.line.read(buffer) {
            Err(e) if e.kind() == io::ErrorKind::WouldBlock => Ok(0),
            result => result,
        }
    }

    /// Sends what the line takes now; how much that was.
    ///
    /// # Errors
    /// Any error of the system.
    pub fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self.line.write(bytes) {
            Err(e) if e.kind() == io::ErrorKind::WouldBlock => Ok(0),
            result => result,
        }
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        if let Some(name) = &self.name
            && fs::read_link(name).is_ok_and(|target| target == self.terminal)
        {
            // Nothing more can be done about a name that cannot be removed.
            let _ = fs::remove_file(name);
        }
    }
}

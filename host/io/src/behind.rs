//! Writes in a thread of its own: whoever takes readings while something moves waits for no disk and no
//! terminal.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// The tasks, in order.
enum Task {
    Write(Vec<u8>),
    Flush,
}

/// Takes bytes at once and has them written behind, in order. What fails there is the error of the next call
/// here; after it nothing more is written. Dropping it waits for what is still to be written.
pub struct Behind {
    tasks: Option<Sender<Task>>,
    thread: Option<JoinHandle<io::Result<()>>>,
    failed: Arc<Mutex<Option<io::Error>>>,
    written: u64,
}

impl Behind {
    /// Writes to this from now on, and ends it by `end`.
    pub fn new<W: Write + Send + 'static>(
        to: W,
        end: impl FnOnce(W) -> io::Result<()> + Send + 'static,
    ) -> Self {
        let (tasks, received) = channel();
        let failed = Arc::new(Mutex::new(None));
        let shared = Arc::clone(&failed);
        let thread = std::thread::spawn(move || {
            let (written, to) = work(to, &received);
            match written {
                Ok(()) => end(to),
                Err(error) => {
                    *shared.lock().unwrap_or_else(PoisonError::into_inner) = Some(again(&error));
                    Err(error)
                }
            }
        });
        Self { tasks: Some(tasks), thread: Some(thread), failed, written: 0 }
    }

    /// Writes to a file, which is on the disk once it was closed.
    pub fn file(file: File) -> Self {
        Self::new(BufWriter::new(file), |buffer| {
            buffer.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()
        })
    }

    /// Waits until everything is written.
    ///
    /// # Errors
    /// Returns the error of a write that failed in the thread.
    pub fn close(mut self) -> io::Result<()> {
        self.join()
    }

    fn join(&mut self) -> io::Result<()> {
        drop(self.tasks.take());
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(ended)) => ended,
            // A panic there has printed itself.
            Some(Err(_)) => Err(io::ErrorKind::BrokenPipe.into()),
            None => Ok(()),
        }
    }

    fn tell(&self, task: Task) -> io::Result<()> {
        if let Some(error) = &*self.failed.lock().unwrap_or_else(PoisonError::into_inner) {
            return Err(again(error));
        }
        // It is gone only after a failure that has been noted by then, or that `close` will tell.
        self.tasks
            .as_ref()
            .map_or(Ok(()), |tasks| tasks.send(task).map_err(|_| io::ErrorKind::BrokenPipe.into()))
    }
}

fn work<W: Write>(mut to: W, tasks: &Receiver<Task>) -> (io::Result<()>, W) {
    let written = tasks.iter().try_for_each(|task| match task {
        Task::Write(bytes) => to.write_all(&bytes),
        Task::Flush => to.flush(),
    });
    (written, to)
}

/// Returns a copy of an error.
fn again(error: &io::Error) -> io::Error {
    match error.raw_os_error() {
        Some(code) => io::Error::from_raw_os_error(code),
        None => io::Error::new(error.kind(), error.to_string()),
    }
}

impl Write for Behind {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.tell(Task::Write(bytes.to_vec()))?;
        self.written += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.tell(Task::Flush)
    }
}

/// Only where it is can be asked for.
impl Seek for Behind {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match to {
            SeekFrom::Current(0) => Ok(self.written),
            _ => Err(io::ErrorKind::Unsupported.into()),
        }
    }
}

impl Drop for Behind {
    fn drop(&mut self) {
        // Whoever wants to know has closed it.
        let _ = self.join();
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;

    /// A disk that stands still for a second at its first byte, and may be full then.
    struct Stalled {
        kept: Arc<Mutex<Vec<u8>>>,
        full: bool,
    }

    impl Write for Stalled {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let mut kept = self.kept.lock().unwrap();
            if kept.is_empty() {
                std::thread::sleep(Duration::from_secs(1));
            }
            if self.full {
                return Err(io::ErrorKind::StorageFull.into());
            }
            kept.extend(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_disk_that_stands_still_holds_nobody_back_and_loses_nothing() {
        let kept = Arc::default();
        let mut behind = Behind::new(Stalled { kept: Arc::clone(&kept), full: false }, |_| Ok(()));
        let begun = Instant::now();
        for k in 0..1000_u16 {
            behind.write_all(&k.to_le_bytes()).unwrap();
            behind.flush().unwrap();
        }
        assert!(begun.elapsed() < Duration::from_millis(250), "{:?}", begun.elapsed());
        assert_eq!(behind.stream_position().unwrap(), 2000);
        behind.close().unwrap();
        let expected: Vec<u8> = (0..1000_u16).flat_map(u16::to_le_bytes).collect();
        assert_eq!(*kept.lock().unwrap(), expected);
    }

    #[test]
    fn failures_behind_are_the_error_of_the_next_call_and_of_the_end() {
        let mut behind = Behind::new(Stalled { kept: Arc::default(), full: true }, |_| Ok(()));
        behind.write_all(b"first").unwrap();
        let deadline = Instant::now() + Duration::from_secs(20);
        let error = loop {
            match behind.write_all(b"more") {
                Err(error) => break error,
                Ok(()) => assert!(Instant::now() < deadline),
            }
            std::thread::sleep(Duration::from_millis(10));
        };
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
        assert_eq!(behind.close().unwrap_err().kind(), io::ErrorKind::StorageFull);
    }
}

//! Sources that are listened to, each by a thread of its own.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::source::{Losses, OwnClock, Row, Source, SourceError};
use crate::recording::columns::Group;

/// The time that a thread waits before it checks whether to end.
const LOOK_AGAIN: Duration = Duration::from_millis(50);

/// Holds what arrived from a source.
#[derive(Debug)]
pub struct Arrival {
    /// The number, in the order in which they were given.
    pub source: usize,
    /// The time, ns after the feeds began.
    pub at_ns: i64,
    /// The rows, or why no more come.
    pub rows: Result<Vec<Row>, SourceError>,
}

/// Describes a source before its thread has it.
#[derive(Clone, Debug)]
pub struct Described {
    /// The columns of the source.
    pub groups: Vec<Group>,
    /// The clock of the source.
    pub clock: OwnClock,
    /// The parts to check if it falls silent.
    pub when_silent: String,
}

/// Holds sources under way.
pub struct Feeds {
    begun: Instant,
    arrivals: Receiver<Arrival>,
    leave: Arc<AtomicBool>,
    losses: Vec<Arc<Mutex<Losses>>>,
    /// In the order in which they were given.
    pub described: Vec<Described>,
    threads: Vec<JoinHandle<()>>,
}

impl Feeds {
    /// Starts to listen.
    pub fn new(sources: Vec<Box<dyn Source>>) -> Self {
        let (sender, arrivals) = channel();
        let mut feeds = Self {
            begun: Instant::now(),
            arrivals,
            leave: Arc::new(AtomicBool::new(false)),
            losses: Vec::new(),
            described: Vec::new(),
            threads: Vec::new(),
        };
        for (number, source) in sources.into_iter().enumerate() {
            feeds.described.push(Described {
                groups: source.groups().to_vec(),
                clock: source.clock(),
                when_silent: source.when_silent(),
            });
            let losses = Arc::new(Mutex::new(Losses::default()));
            feeds.losses.push(Arc::clone(&losses));
            let (leave, sender, begun) = (Arc::clone(&feeds.leave), sender.clone(), feeds.begun);
            let listen = move || listen(number, source, &begun, &sender, &leave, &losses);
            feeds.threads.push(std::thread::spawn(listen));
        }
        feeds
    }

    /// Returns the time since they began, ns.
    pub fn now_ns(&self) -> i64 {
        nanoseconds(&self.begun)
    }

    /// Waits up to the given time for something to arrive.
    pub fn next(&self, timeout: Duration) -> Option<Arrival> {
        match self.arrivals.recv_timeout(timeout) {
            Ok(arrival) => Some(arrival),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => {
                // Everything has ended and was reported.
                std::thread::sleep(timeout);
                None
            }
        }
    }

    /// Returns what a source has lost until now.
    pub fn losses(&self, source: usize) -> Losses {
        self.losses
            .get(source)
            .map_or_else(Losses::default, |l| *l.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Drop for Feeds {
    fn drop(&mut self) {
        self.leave.store(true, Ordering::Release);
        for thread in self.threads.drain(..) {
            // A panic there has printed itself.
            let _ = thread.join();
        }
    }
}

fn nanoseconds(since: &Instant) -> i64 {
    i64::try_from(since.elapsed().as_nanos()).unwrap_or(i64::MAX)
}

fn listen(
    number: usize,
    mut source: Box<dyn Source>,
    begun: &Instant,
    sender: &Sender<Arrival>,
    leave: &AtomicBool,
    losses: &Mutex<Losses>,
) {
    while !leave.load(Ordering::Acquire) {
        let mut rows = Vec::new();
        let read = source.read(LOOK_AGAIN, &mut rows);
        let at_ns = nanoseconds(begun);
        *losses.lock().unwrap_or_else(PoisonError::into_inner) = source.losses();
        let ended = read.is_err();
        let arrival = |rows| Arrival { source: number, at_ns, rows };
        // Nobody listens any more where sending fails.
        if !rows.is_empty() && sender.send(arrival(Ok(rows))).is_err() {
            return;
        }
        if let Err(error) = read {
            let _ = sender.send(arrival(Err(error)));
        }
        if ended {
            return;
        }
    }
}

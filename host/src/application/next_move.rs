//! The next move of a body that is moved by hand: what the readings so far lack, in words, while they come.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rigident_shared::calibration::Reading;

use super::{Caller, Loaded};
use rigident_identify::answer::{Answer, Context, Status};
use rigident_io::rig::RigFile;

/// There is a check this often at most, and for no more than a tenth of the time.
const LOOK_EVERY: Duration = Duration::from_secs(3);
const SHARE: u32 = 10;
/// Before this much has come nothing is said, s.
const LEAST_S: f64 = 2.0;
/// Readings are handed over in pieces of this length.
const PIECE: usize = 50;

/// The advice given when nothing is missing.
const ENOUGH: &str = "everything asked for is identified: go on for smaller intervals, or end by Ctrl-C";

/// Examines what has arrived, beside whoever takes it in.
pub struct NextMove {
    piece: Vec<Reading<f64>>,
    sender: Option<Sender<Vec<Reading<f64>>>>,
    said: Arc<Mutex<Option<String>>>,
    thread: Option<JoinHandle<()>>,
    returned: Option<String>,
}

impl NextMove {
    /// Starts to examine readings of one body, `rate_hz` a second; `asked` are the parameters that must be
    /// identified.
    pub fn new(rig: &RigFile, rate_hz: f64, asked: &[String]) -> Self {
        let (sender, receiver) = channel();
        let said = Arc::new(Mutex::new(None));
        let (rig, asked, written) = (rig.clone(), asked.to_vec(), Arc::clone(&said));
        let thread = std::thread::spawn(move || look(&receiver, &rig, rate_hz, &asked, &written));
        Self { piece: Vec::new(), sender: Some(sender), said, thread: Some(thread), returned: None }
    }

    /// Takes a reading.
    pub fn take(&mut self, reading: Reading<f64>) {
        self.piece.push(reading);
        if self.piece.len() >= PIECE
            && let Some(sender) = &self.sender
        {
            // The viewer may have ended; nothing depends on it.
            let _ = sender.send(std::mem::take(&mut self.piece));
        }
    }

    /// Returns what to do next, if that is something else than was returned last.
    pub fn news(&mut self) -> Option<String> {
        let said = self.said.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if said == self.returned {
            return None;
        }
        self.returned.clone_from(&said);
        said
    }
}

impl Drop for NextMove {
    fn drop(&mut self) {
        drop(self.sender.take());
        // A panic there has printed itself.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn look(
    receiver: &Receiver<Vec<Reading<f64>>>,
    rig: &RigFile,
    rate_hz: f64,
    asked: &[String],
    said: &Mutex<Option<String>>,
) {
    let (mut readings, mut looked) = (Vec::new(), Instant::now());
    let mut rest = LOOK_EVERY;
    loop {
        match receiver.recv_timeout(LOOK_EVERY) {
            Ok(piece) => readings.extend(piece),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
        if looked.elapsed() < rest || (readings.len() as f64) < LEAST_S * rate_hz {
            continue;
        }
        // What has come meanwhile; who has left waits for no more.
        loop {
            match receiver.try_recv() {
                Ok(piece) => readings.extend(piece),
                Err(std::sync::mpsc::TryRecvError::Empty) => break,
                Err(std::sync::mpsc::TryRecvError::Disconnected) => return,
            }
        }
        let begun = Instant::now();
        if let Some(words) = words(rig, readings.clone(), rate_hz, asked) {
            *said.lock().unwrap_or_else(PoisonError::into_inner) = Some(words);
        }
        looked = Instant::now();
        rest = LOOK_EVERY.max(begun.elapsed() * SHARE);
    }
}

/// Returns what readings lack; `None` where they make no answer yet.
fn words(rig: &RigFile, readings: Vec<Reading<f64>>, rate_hz: f64, asked: &[String]) -> Option<String> {
    let loaded = Loaded::of_readings("live", rig, readings, Some(rate_hz), false);
    let found = loaded.fit(None, 0, &Caller::default()).ok()?;
    let answer = Answer::new(&found, Context { asked, ..Context::default() }).ok()?;
    if answer.status == Status::Identified {
        return Some(ENOUGH.to_owned());
    }
    let contradicted = answer.status == Status::Implausible;
    let warning = answer.warnings.first().filter(|_| contradicted).cloned();
    warning.or_else(|| answer.advice.first().cloned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};

    /// A body of 2 kg that stands still says nothing but its weight along one direction: what to do is said.
    #[test]
    fn a_body_at_rest_is_to_be_moved() {
        let noise = |k: usize, c: usize| ((k * 7919 + c * 104_729) as f64 * 0.618_033_988_75).fract() - 0.5;
        let readings: Vec<Reading<f64>> = (0..1000)
            .map(|k| Reading {
                time_ns: 5_000_000 * k as u64,
                wrench: Wrench::from_array(std::array::from_fn(|c| {
                    0.01 * noise(k, c) + if c == 2 { 19.6 } else { 0.0 }
                })),
                specific_force: SpecificForce::new(
                    0.01 * noise(k, 6),
                    0.01 * noise(k, 7),
                    9.8 + 0.01 * noise(k, 8),
                ),
                angular_rate: AngularRate::new(1e-3 * noise(k, 9), 1e-3 * noise(k, 10), 1e-3 * noise(k, 11)),
            })
            .collect();
        let said = words(&RigFile::default(), readings.clone(), 200.0, &[]).unwrap();
        assert!(said.contains("tilt") || said.contains("pose"), "{said}");
        let mut next = NextMove::new(&RigFile::default(), 200.0, &[]);
        readings.into_iter().for_each(|reading| next.take(reading));
        let begun = Instant::now();
        let news = loop {
            match next.news() {
                Some(news) => break news,
                None => assert!(begun.elapsed() < Duration::from_secs(120)),
            }
            std::thread::sleep(Duration::from_millis(50));
        };
        assert_eq!((news, next.news()), (said, None));
    }
}

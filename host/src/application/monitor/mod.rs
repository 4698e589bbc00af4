//! The state that the threads of a monitor share: readings as they come, the view as it grows.

mod sources;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use rigident_shared::calibration::Reading;
use rigident_shared::wire::{CounterReport, EstimateReport, ReadingMessage, Reason, StateName};

use super::loaded::PLOT_POINTS;
use super::{Caller, Error, Loaded, Report};
use rigident_device::session::{Heard, INTERRUPTED, Observer, widen};
use rigident_device::words;
use rigident_io::rig::RigFile;
use rigident_present::monitor::{Answered, Counted, LinkHealth, View};

pub use sources::{follow, hear, rig_of};

/// Readings are fitted anew not more often than this, and not for more than a fourth of the time.
const FIT_EVERY: Duration = Duration::from_secs(1);
const PAUSE: u32 = 3;
/// But not before there are this many seconds of them: of half a second at rest the test of the residuals
/// believes too much.
const FIRST_AFTER_S: f64 = 2.0;
/// The rate is that of this many of the last readings.
const RATE_OF: usize = 1000;
/// The time that a thread sleeps that has nothing to do.
pub const NAP: Duration = Duration::from_millis(50);

/// A view that grows while one thread hears, one fits and one shows it.
///
/// ```
/// use rigident::application::{Caller, Error};
/// use rigident::application::monitor::{GrowingView, follow};
///
/// let bracket = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/examples/bracket.csv");
/// let view = GrowingView::new(bracket.to_owned(), Error::to_string);
/// follow(bracket.as_ref(), None, true, &view, &Caller::default());
/// let seen = view.view();
/// assert!(view.has_ended() && seen.trouble.is_none() && seen.answer.is_some());
/// ```
pub struct GrowingView {
    view: Mutex<View>,
    /// Words why there is no answer.
    wording: fn(&Error) -> String,
    readings: Mutex<Vec<Reading<f64>>>,
    /// Nothing more comes.
    ended: AtomicBool,
    /// The viewer has gone.
    left: AtomicBool,
}

/// Returns what a panic of another thread left is still a view.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl GrowingView {
    /// Returns the view of what is watched, by its name; `wording` words why there is no answer.
    pub fn new(watched: String, wording: fn(&Error) -> String) -> Self {
        Self {
            view: Mutex::new(View { watched, ..View::default() }),
            wording,
            readings: Mutex::default(),
            ended: AtomicBool::new(false),
            left: AtomicBool::new(false),
        }
    }

    /// Returns the view as it is.
    pub fn view(&self) -> View {
        lock(&self.view).clone()
    }

    /// Changes the view.
    pub fn change(&self, change: impl FnOnce(&mut View)) {
        change(&mut lock(&self.view));
    }

    /// States that nothing more comes.
    pub fn end(&self) {
        self.ended.store(true, Ordering::Release);
    }

    /// Returns true if nothing more comes.
    pub fn has_ended(&self) -> bool {
        self.ended.load(Ordering::Acquire)
    }

    /// States that nobody watches any more.
    pub fn leave(&self) {
        self.left.store(true, Ordering::Relaxed);
    }

    /// Returns true if nobody watches any more, or after Ctrl-C.
    pub fn is_left(&self) -> bool {
        self.left.load(Ordering::Relaxed) || INTERRUPTED.load(Ordering::Relaxed)
    }

    /// Shows the answer of a recording; why there is none where there is none.
    fn answer(&self, found: Result<Answered, Error>) {
        self.change(|view| match found {
            Ok(answer) => (view.answer, view.trouble) = (Some(answer), None),
            Err(why) => view.trouble = Some((self.wording)(&why)),
        });
    }

    /// Fits the readings of one body as they come, until nothing more does; then calls `done`.
    pub fn fit_readings(&self, rig: &RigFile, rate_hz: f64) {
        let (mut fitted, mut due) = (0, Instant::now());
        while !self.is_left() {
            // Asked first: what comes before the end is fitted.
            let ended = self.has_ended();
            let (count, span_s) = {
                let readings = lock(&self.readings);
                (readings.len(), span(&readings).0)
            };
            if count == fitted && ended {
                return;
            }
            let too_few = span_s < FIRST_AFTER_S && !ended;
            if count == fitted || too_few || (Instant::now() < due && !ended) {
                std::thread::sleep(NAP);
                continue;
            }
            let (started, readings) = (Instant::now(), lock(&self.readings).clone());
            fitted = readings.len();
            let loaded = Loaded::of_readings("monitor", rig, readings, Some(rate_hz), false);
            self.answer(answered(&loaded));
            due = Instant::now() + FIT_EVERY.max(started.elapsed() * PAUSE);
        }
    }
}

/// Answers as `identify` would.
fn answered(loaded: &Loaded) -> Result<Answered, Error> {
    let caller = Caller::default();
    let fit = loaded.fit(None, PLOT_POINTS, &caller)?;
    let answer = Report::of_recording(loaded, "host").answer(&fit, &caller)?;
    Ok(Answered::new(&answer, &fit))
}

/// Hears a device for the view.
pub struct Listener<'a> {
    watch: &'a GrowingView,
    /// Readings are taken as fast as they were made, from here on.
    paced_from: Option<Instant>,
}

impl<'a> Listener<'a> {
    /// Returns who hears for this view; paced, if readings are to be taken as fast as they were made.
    pub fn new(watch: &'a GrowingView, is_paced: bool) -> Self {
        Self { watch, paced_from: is_paced.then(Instant::now) }
    }
}

/// Returns the time from the first reading to the last, s, and the rate of the last ones, 1/s.
fn span(readings: &[Reading<f64>]) -> (f64, Option<f64>) {
    let [Some(first), Some(last)] = [readings.first(), readings.last()] else { return (0.0, None) };
    let between = |a: &Reading<f64>, b: &Reading<f64>| b.time_ns.saturating_sub(a.time_ns) as f64 * 1e-9;
    let recent = readings.get(readings.len().saturating_sub(RATE_OF)..).unwrap_or_default();
    let rate = recent.first().map(|from| (recent.len() - 1) as f64 / between(from, last));
    (between(first, last), rate.filter(|rate| rate.is_finite() && *rate > 0.0))
}

impl Observer for Listener<'_> {
    fn reading(&mut self, reading: &ReadingMessage) -> Result<(), String> {
        let mut readings = lock(&self.watch.readings);
        // A device that began anew.
        if readings.last().is_some_and(|last| last.time_ns >= reading.time_ns) {
            readings.clear();
        }
        readings.push(widen(reading));
        Ok(())
    }

    fn estimate(&mut self, report: &EstimateReport) {
        let said = format!("by itself, of {} readings: {}", report.readings, words::estimate(report));
        self.watch.change(|view| view.device = Some(said));
    }

    fn progress(&mut self, _: usize) {
        let (elapsed_s, rate_hz, count) = {
            let readings = lock(&self.watch.readings);
            let (elapsed_s, rate_hz) = span(&readings);
            (elapsed_s, rate_hz, readings.len())
        };
        self.watch.change(|view| {
            (view.elapsed_s, view.sensors.readings, view.sensors.rate_hz) =
                (elapsed_s, count as u64, rate_hz);
        });
        let Some(from) = self.paced_from else { return };
        while from.elapsed().as_secs_f64() < elapsed_s && !self.watch.is_left() {
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn heard(&mut self, heard: &Heard) {
        let is_paced = self.paced_from.is_some();
        self.watch.change(|view| {
            let link = view.link.get_or_insert_with(LinkHealth::default);
            link.lost_readings = u64::from(heard.missing);
            link.lost_messages = u64::from(heard.lost_messages);
            link.damaged_frames = u64::from(heard.damaged_frames);
            // One that is paced by the clock is not silent.
            link.silent_s = if is_paced { 0.0 } else { heard.silent_s };
        });
    }

    fn state(&mut self, state: StateName, reason: Reason) {
        let said = words::phase(state, reason);
        self.watch.change(|view| view.phase = said);
    }

    fn counters(&mut self, counters: &CounterReport) {
        self.watch.change(|view| {
            view.sensors.trouble = trouble(counters);
            let link = view.link.get_or_insert_with(LinkHealth::default);
            link.damaged_there = u64::from(counters.bad_frames);
            link.dropped_there = u64::from(counters.telemetry_dropped);
        });
    }
}

/// Returns what a device's counters say of its sensors, for a view.
pub fn trouble(counters: &CounterReport) -> Vec<Counted> {
    words::trouble(counters).into_iter().map(|(count, what)| Counted { what, count }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_of_a_device_that_began_anew_take_the_place_of_the_old_ones() {
        let watch = GrowingView::new("x".to_owned(), Error::to_string);
        let mut listener = Listener::new(&watch, false);
        for time_ns in [0, 1_000_000, 2_000_000, 500_000, 1_500_000] {
            listener.reading(&ReadingMessage { time_ns, ..ReadingMessage::default() }).unwrap();
        }
        listener.progress(0);
        let view = watch.view();
        assert_eq!((view.sensors.readings, view.sensors.rate_hz), (2, Some(1000.0)));
        assert!((view.elapsed_s - 1e-3).abs() < 1e-12);
    }
}

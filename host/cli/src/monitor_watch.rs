//! The data that the threads of a monitor share: readings as they come, the view as it grows.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use rigident_shared::calibration::Reading;
use rigident_shared::screening::CHANNEL_NAMES;
use rigident_shared::wire::{CounterReport, EstimateReport, ReadingMessage, Reason, StateName};

use super::device_words::of_reason;
use super::experiment::in_words;
use super::info::of_state;
use super::{Failure, Stages};
use rigident::application::loaded::PLOT_POINTS;
use rigident::application::{Loaded, Report};
use rigident::device::session::{Heard, INTERRUPTED, Observer, widen};
use rigident::present::monitor::{Answered, Counted, LinkHealth, View};
use rigident_io::rig::RigFile;

/// Readings are fitted anew not more often than this, and not for more than a fourth of the time.
const FIT_EVERY: Duration = Duration::from_secs(1);
const PAUSE: u32 = 3;
/// But not before there are this many seconds of them: of half a second at rest the test of the residuals
/// believes too much.
const FIRST_AFTER_S: f64 = 2.0;
/// The rate is that of this many of the last readings.
const RATE_OF: usize = 1000;
/// The time that a thread sleeps that has nothing to do.
pub(super) const NAP: Duration = Duration::from_millis(50);

/// The shared data of the threads.
#[derive(Default)]
pub(super) struct Watch {
    view: Mutex<View>,
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

impl Watch {
    pub(super) fn new(watched: String) -> Self {
        let watch = Self::default();
        lock(&watch.view).watched = watched;
        watch
    }

    /// The view now.
    pub(super) fn view(&self) -> View {
        lock(&self.view).clone()
    }

    pub(super) fn change(&self, change: impl FnOnce(&mut View)) {
        change(&mut lock(&self.view));
    }

    pub(super) fn end(&self) {
        self.ended.store(true, Ordering::Release);
    }

    pub(super) fn has_ended(&self) -> bool {
        self.ended.load(Ordering::Acquire)
    }

    pub(super) fn leave(&self) {
        self.left.store(true, Ordering::Relaxed);
    }

    /// Nobody watches any more, or Ctrl-C.
    pub(super) fn is_left(&self) -> bool {
        self.left.load(Ordering::Relaxed) || INTERRUPTED.load(Ordering::Relaxed)
    }

    /// Shows the answer of a recording; why there is none where there is none.
    pub(super) fn answer(&self, found: Result<Answered, Failure>) {
        self.change(|view| match found {
            Ok(answer) => (view.answer, view.trouble) = (Some(answer), None),
            Err(why) => view.trouble = Some(why.to_string()),
        });
    }

    /// Fits the readings of one body as they come, until nothing more does; then calls `done`.
    pub(super) fn fit_readings(&self, rig: &RigFile, rate_hz: f64) {
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

/// Answers as `rigident identify` would.
pub(super) fn answered(loaded: &Loaded) -> Result<Answered, Failure> {
    let stages = Stages::silent();
    let fit = loaded.fit(None, PLOT_POINTS, &stages.caller())?;
    let answer = Report::of_recording(loaded, "host").answer(&fit, &stages.caller())?;
    Ok(Answered::new(&answer, &fit))
}

/// Hears a device for the view.
pub(super) struct Listener<'a> {
    watch: &'a Watch,
    /// Readings are taken as fast as they were made, from here on.
    paced_from: Option<Instant>,
}

impl<'a> Listener<'a> {
    pub(super) fn new(watch: &'a Watch, is_paced: bool) -> Self {
        Self { watch, paced_from: is_paced.then(Instant::now) }
    }
}

/// From the first reading to the last, s, and readings a second of the last ones.
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
        let said = format!("by itself, of {} readings: {}", report.readings, in_words(report));
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
        let said = phase(state, reason);
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

/// A state in words.
pub(super) fn phase(state: StateName, reason: Reason) -> String {
    let (why, fault) = of_reason(reason);
    let why = why.replace('_', " ");
    match (state, reason) {
        (StateName::Fault, _) => format!("fault of {why}: {}", fault.unwrap_or_default().replace('_', " ")),
        (StateName::Holding, Reason::StopRule) => "holding: what was asked for is reached".to_owned(),
        (StateName::Holding, Reason::HostQuiet) => "holding: it did not hear its host".to_owned(),
        (state, _) => of_state(state).to_owned(),
    }
}

/// Returns what the device's counters tell of its sensors.
pub(super) fn trouble(counters: &CounterReport) -> Vec<Counted> {
    let reason = match counters.last_rejection {
        1 => " (not finite)",
        2 => " (saturated)",
        3 => " (frozen)",
        _ => "",
    };
    let mut found = Vec::new();
    let mut add = |count: u64, what: String| {
        if count > 0 {
            found.push(Counted { what, count });
        }
    };
    for (k, (name, count)) in CHANNEL_NAMES.iter().zip(counters.rejected_by_channel).enumerate() {
        let last = if k == usize::from(counters.last_rejected_channel) { reason } else { "" };
        add(count.into(), format!("rejected by {name}{last}"));
    }
    let gauges: Vec<String> =
        (0..8).filter(|gauge| counters.clipped_gauges >> gauge & 1 == 1).map(|g: u8| g.to_string()).collect();
    for (name, count) in CHANNEL_NAMES.iter().zip(counters.knocks) {
        add(count.into(), format!("knocks in {name}"));
    }
    for (count, name) in counters.lost.into_iter().zip(["load cell", "IMU", "second IMU"]) {
        add(count.into(), format!("of the {name} lost, for which the board had no room"));
    }
    for (count, what) in [
        (counters.load_cell_clipped, format!("clipped (gauge {})", gauges.join(", "))),
        (counters.load_cell_crc_errors, "of the load cell with a wrong check sum".to_owned()),
        (counters.load_cell_errors, "of the load cell without a sample".to_owned()),
        (counters.load_cell_stale, "of the load cell that came again".to_owned()),
        (counters.load_cell_resyncs, "of the load cell whose filters began anew".to_owned()),
        (counters.without_excitation, "of the load cell without its excitation".to_owned()),
        (counters.overdue_transfers, "transfers with sensors that did not end".to_owned()),
        (counters.failed_transfers, "transfers with sensors that failed".to_owned()),
        (counters.imu_errors, "of the IMU not read".to_owned()),
        (counters.second_imu_errors, "of the second IMU not read".to_owned()),
        (counters.unaligned, "without an IMU sample beside them".to_owned()),
        (counters.gaps, "gaps".to_owned()),
    ] {
        add(count.into(), what);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counters_become_words_and_what_never_happened_is_left_out() {
        assert_eq!(trouble(&CounterReport::default()), []);
        let mut counters = CounterReport {
            last_rejection: 2,
            last_rejected_channel: 3,
            gaps: 1,
            load_cell_clipped: 4,
            ..CounterReport::default()
        };
        (counters.rejected_by_channel[3], counters.clipped_gauges) = (5, 0b10);
        let said: Vec<String> =
            trouble(&counters).iter().map(|c| format!("{} {}", c.count, c.what)).collect();
        let rejected = format!("5 rejected by {} (saturated)", CHANNEL_NAMES[3]);
        assert_eq!(said, [rejected.as_str(), "4 clipped (gauge 1)", "1 gaps"]);
    }

    #[test]
    fn readings_of_a_device_that_began_anew_take_the_place_of_the_old_ones() {
        let watch = Watch::new("x".to_owned());
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

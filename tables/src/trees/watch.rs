//! A humanoid of 31 links that the firmware watches: what it finds of what hands pick up and lose, and what
//! it tells where nothing changes.
//!
//! The seeds here judge. They were drawn after the constants of the watch were set, and have been run once.

use std::fmt::Write as _;
use std::io;
use std::time::Duration;

use rigident::device::link::{Client, Transport};
use rigident::device::session::Session;
use rigident::device::session::streamed::{Pace, Watched};
use rigident::device::session::watched::{WatchOptions, WatchedRobot};
use rigident::fit::parallel::{map, threads};
use rigident::laboratory::picks_up::{HAND, PicksUp, RATE_HZ};

use rigident_sim::rig::{Rig, RigConfig};
use rigident_sim::runner::{InProcess, Mcu, Pacing};

/// First seed: tests have those below 1000.
const FIRST: u64 = 310_000;
/// Coverage factor of 95 %.
const COVERAGE: f64 = 1.96;
/// A change that is found later than this many seconds is missed.
const LATE_S: f64 = 5.0;
/// Length of a run in which nothing changes, s.
const HONEST_S: f64 = 300.0;

/// Robots of a row.
struct Case {
    words: &'static str,
    robots: usize,
    off: f64,
    /// Mass of what is picked up and dropped again, kg, least and most; negative: it is lost and put back.
    masses: Option<[f64; 2]>,
}

const CASES: [Case; 5] = [
    Case { words: "0.2 to 2 kg, exact", robots: 16, off: 0.0, masses: Some([0.2, 2.0]) },
    Case { words: "0.2 to 2 kg, *off* by 3 %", robots: 48, off: 0.03, masses: Some([0.2, 2.0]) },
    Case {
        words: "a cover of 0.1 to 0.3 kg, *off* by 3 %",
        robots: 24,
        off: 0.03,
        masses: Some([-0.1, -0.3]),
    },
    Case { words: "nothing, exact", robots: 36, off: 0.0, masses: None },
    Case { words: "nothing, *off* by 3 %", robots: 36, off: 0.03, masses: None },
];

struct Line(InProcess);

impl Transport for Line {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.0.read(buffer, timeout)
    }
}

/// The result of one change, or of a row.
#[derive(Clone, Default)]
struct Tally {
    changes: usize,
    /// Delays of those found, s.
    delays: Vec<f64>,
    /// Intervals that hold the time.
    in_time: usize,
    /// Mass within U95, first moments within U95, and first moments that have a number.
    mass_inside: usize,
    measured: usize,
    moments: [usize; 2],
    /// U95 of masses, kg.
    u95: Vec<f64>,
    alarms: usize,
    watched_s: f64,
}

impl Tally {
    fn add(&mut self, other: Self) {
        self.changes += other.changes;
        self.delays.extend(other.delays);
        self.in_time += other.in_time;
        self.mass_inside += other.mass_inside;
        self.measured += other.measured;
        self.moments[0] += other.moments[0];
        self.moments[1] += other.moments[1];
        self.u95.extend(other.u95);
        self.alarms += other.alarms;
        self.watched_s += other.watched_s;
    }
}

/// Returns a number from 0 to 1 of a seed, van der Corput's by the golden ratio.
fn part(seed: u64, k: u64) -> f64 {
    ((seed * 7 + k) as f64 * 0.618_033_988_749_895).fract()
}

fn scene(case: &Case, seed: u64) -> PicksUp {
    let scene = PicksUp { off: case.off, seed, seconds: HONEST_S, ..PicksUp::default() };
    let Some([least, most]) = case.masses else { return scene };
    let from = 24.0 + 10.0 * part(seed, 1);
    let to = from + 6.0 + 6.0 * part(seed, 2);
    PicksUp {
        holds_s: Some([from, to]),
        mass_kg: least * (most / least).powf(part(seed, 3)),
        link: if seed.is_multiple_of(2) { HAND } else { "l_hand" },
        seconds: to + 6.0,
        ..scene
    }
}

fn watched(scene: &PicksUp) -> Watched {
    let (_, input, _) = scene.input().expect("a hand");
    let robot = WatchedRobot::new(&input, scene.link, &WatchOptions::default()).expect("a robot that fits");
    drop(input);
    // Its own sensors are asked nothing.
    let idle = Rig::new(RigConfig::thesis_horizontal()).expect("a rig").shared();
    let line = Line(InProcess::new(idle, Pacing::LockStep));
    let mut session = Session::open(Client::new(Box::new(line))).expect("the firmware");
    session.watch_robot(&robot, Pace::AsTaken, &mut |_| ()).expect("a watch")
}

fn judged(scene: &PicksUp) -> Tally {
    let watched = watched(scene);
    assert!(watched.counters.watch.settled, "seed {}", scene.seed);
    let seconds = |number: u32| f64::from(number) / RATE_HZ;
    let settled = WatchOptions::default().settle_s;
    let mut tally = Tally::default();
    let mut left: Vec<_> = watched.changes.iter().filter(|change| change.size.is_none()).collect();
    let events = scene.holds_s.map_or(Vec::new(), |[from, to]| vec![(from, 1.0), (to, -1.0)]);
    tally.changes = events.len();
    for (at_s, sign) in events {
        let mine = |found: u32| (0.0..LATE_S).contains(&(seconds(found) - at_s));
        let Some(k) = left.iter().position(|change| mine(change.found)) else { continue };
        let found = left.remove(k);
        tally.delays.push(seconds(found.found) - at_s);
        let Some(measured) = watched.changes.iter().find(|c| c.change == found.change && c.size.is_some())
        else {
            continue;
        };
        let Some(size) = measured.size else { continue };
        tally.measured += 1;
        let [from, to] = measured.between.map(seconds);
        tally.in_time += usize::from((from..=to).contains(&at_s));
        let wanted = scene.thing().map(|value| sign * value);
        for (k, (value, sd)) in size.change.iter().zip(size.standard_deviation).enumerate().take(4) {
            let u95 = COVERAGE * f64::from(sd);
            let inside = (f64::from(*value) - wanted[k]).abs() <= u95;
            if k == 0 {
                tally.mass_inside += usize::from(inside);
                tally.u95.push(u95);
            } else if u95.is_finite() {
                tally.moments[0] += usize::from(inside);
                tally.moments[1] += 1;
            }
        }
    }
    tally.alarms = left.len();
    tally.watched_s = if scene.holds_s.is_none() { scene.seconds - settled } else { 0.0 };
    for wrong in left {
        eprintln!(
            "seed {}: reported at {:.2} s of {:?}, {:.2}",
            scene.seed,
            seconds(wrong.found),
            scene.holds_s,
            wrong.ratio
        );
    }
    tally
}

fn quantile(values: &[f64], part: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get((part * (sorted.len().max(1) - 1) as f64).round() as usize).copied().unwrap_or(f64::NAN)
}

/// Returns the expected count that gives such a small count with a probability of 5 %: Poisson.
fn upper(count: usize) -> f64 {
    let below = |mean: f64| {
        let mut term = (-mean).exp();
        let mut sum = term;
        for k in 1..=count {
            term *= mean / k as f64;
            sum += term;
        }
        sum
    };
    let (mut low, mut high) = (0.0, 10.0 * (count + 1) as f64);
    for _ in 0..60 {
        let mid = 0.5 * (low + high);
        if below(mid) > 0.05 { low = mid } else { high = mid }
    }
    high
}

pub fn table() -> String {
    let mut jobs = Vec::new();
    for (row, case) in CASES.iter().enumerate() {
        jobs.extend((0..case.robots as u64).map(|k| (row, scene(case, FIRST + 100 * row as u64 + k))));
    }
    let done = map(threads().min(2), jobs.len(), |k| judged(&jobs[k].1));
    let mut rows = vec![Tally::default(); CASES.len()];
    for ((row, _), tally) in jobs.iter().zip(done) {
        rows[*row].add(tally);
    }
    let mut text = "| what changes, known parameters | changes found | after, s: half, 95 %, all | time \
                    within its interval | mass within its U95 | first moments within theirs | U95 of mass, \
                    kg: half, 95 % | other alarms |\n|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for (case, tally) in CASES.iter().zip(&rows).filter(|(case, _)| case.masses.is_some()) {
        let delay = |part| quantile(&tally.delays, part);
        let _ = writeln!(
            text,
            "| {} | {} of {} | {:.2}, {:.2}, {:.2} | {} of {} | {} of {} | {} of {} | {:.3}, {:.3} | {} |",
            case.words,
            tally.delays.len(),
            tally.changes,
            delay(0.5),
            delay(0.95),
            delay(1.0),
            tally.in_time,
            tally.measured,
            tally.mass_inside,
            tally.measured,
            tally.moments[0],
            tally.moments[1],
            quantile(&tally.u95, 0.5),
            quantile(&tally.u95, 0.95),
            tally.alarms
        );
    }
    let stated = WatchOptions::default().false_alarms_per_hour;
    let _ = writeln!(
        text,
        "\n| what changes, known parameters | watched, min | false alarms | expected at the stated {stated} \
         an hour | at 95 % no more an hour than |\n|---|---|---|---|---|"
    );
    for (case, tally) in CASES.iter().zip(&rows).filter(|(case, _)| case.masses.is_none()) {
        let hours = tally.watched_s / 3600.0;
        let _ = writeln!(
            text,
            "| {} | {:.0} | {} | {:.2} | {:.1} |",
            case.words,
            60.0 * hours,
            tally.alarms,
            stated * hours,
            upper(tally.alarms) / hours
        );
    }
    text
}

//! The behaviour of the plate, and of the readings, when something goes wrong: every driver in every phase.

mod served;

use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use hexapod::Pose;
use served::{HOLD_S, Served};

/// The driver of the platform.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Driver {
    Json,
    Gcs,
    Lines,
}

/// The fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    CtrlC,
    Terminate,
    Kill,
    Stall,
    SecondClient,
    DeadController,
    LostPlatform,
    LostDevice,
    Overload,
}

/// The time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Zero,
    Way,
    Rest,
    Motion,
    Home,
}

const FAULTS: [(Fault, &str); 9] = [
    (Fault::CtrlC, "Ctrl-C"),
    (Fault::Terminate, "SIGTERM"),
    (Fault::Kill, "kill -9"),
    (Fault::Stall, "stall of 2 s"),
    (Fault::SecondClient, "second client"),
    (Fault::DeadController, "dead controller"),
    (Fault::LostPlatform, "lost platform"),
    (Fault::LostDevice, "lost device"),
    (Fault::Overload, "overload"),
];
const DRIVERS: [(Driver, &str); 3] =
    [(Driver::Json, "`tcp://`"), (Driver::Gcs, "`gcs://`"), (Driver::Lines, "`pose+tcp://`")];
const PHASES: [(Phase, &str); 5] = [
    (Phase::Zero, "zeroing"),
    (Phase::Way, "way to the start"),
    (Phase::Rest, "rest in the experiment"),
    (Phase::Motion, "motion"),
    (Phase::Home, "way home"),
];

/// The plate must be at rest so soon, s.
const MOST_S: f64 = 0.8;
/// The largest change at rest, m or rad, from one check to the next.
const STILL: f64 = 2e-6;
const LOOK: Duration = Duration::from_millis(5);
/// So long without motion is rest, s.
const RESTS_S: f64 = 0.4;
/// The time that a run may take to a phase, and to its end after a fault.
const PATIENCE: Duration = Duration::from_secs(30);
/// The time that a stalled run is stalled.
const STALLED: Duration = Duration::from_secs(2);
/// Runs at a time.
const AT_ONCE: usize = 6;

/// The result of one run.
#[derive(Clone, Debug)]
struct Outcome {
    /// Time from the fault to rest, s; none if it never rested, or went on to its end.
    rest_s: Option<f64>,
    status: Option<i32>,
    kept: Option<usize>,
    /// The last words of the run.
    said: String,
}

/// Returns whether there is such a case: only lines of set points are led home.
fn applies(driver: Driver, phase: Phase) -> bool {
    phase != Phase::Home || driver == Driver::Lines
}

/// Returns whether the fault is none to this driver: another stream is not followed while this one moves the
/// plate.
fn goes_on(driver: Driver, fault: Fault) -> bool {
    driver == Driver::Lines && fault == Fault::SecondClient
}

/// Makes the table.
///
/// # Panics
/// If the plate was not at rest in time where it should have been.
pub fn table() -> String {
    let mut cases = Vec::new();
    for (phase, _) in PHASES {
        for (driver, _) in DRIVERS {
            cases.extend(
                FAULTS.iter().filter(|_| applies(driver, phase)).map(|(fault, _)| (driver, phase, *fault)),
            );
        }
    }
    let (next, outcomes) = (AtomicUsize::new(0), Mutex::new(vec![None; cases.len()]));
    thread::scope(|scope| {
        for _ in 0..AT_ONCE {
            scope.spawn(|| {
                while let Some((driver, phase, fault)) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let number =
                        cases.iter().position(|case| *case == (*driver, *phase, *fault)).expect("a case");
                    let outcome = run(number, *driver, *phase, *fault).expect("a simulated rig");
                    eprintln!(
                        "safety {} of {}: {driver:?} {phase:?} {fault:?}: {outcome:?}",
                        number + 1,
                        cases.len()
                    );
                    outcomes.lock().expect("no panic")[number] = Some(outcome);
                }
            });
        }
    });
    let outcomes: Vec<Outcome> = outcomes.into_inner().expect("no panic").into_iter().flatten().collect();
    let of = |case: (Driver, Phase, Fault)| cases.iter().position(|c| *c == case).map(|k| &outcomes[k]);
    let late: Vec<String> = cases
        .iter()
        .zip(&outcomes)
        .filter(|((driver, _, fault), outcome)| {
            !goes_on(*driver, *fault) && outcome.rest_s.is_none_or(|s| s > MOST_S)
        })
        .map(|(case, outcome)| format!("{case:?}: {:?} s: {}", outcome.rest_s, outcome.said))
        .collect();
    assert!(late.is_empty(), "not at rest within {MOST_S} s:\n{}", late.join("\n"));
    written(of)
}

fn written<'a>(of: impl Fn((Driver, Phase, Fault)) -> Option<&'a Outcome>) -> String {
    let mut text = String::from("| | |");
    FAULTS.iter().for_each(|(_, name)| {
        let _ = write!(text, " {name} |");
    });
    text.push_str("\n|---|---|");
    text.push_str(&"---|".repeat(FAULTS.len()));
    text.push('\n');
    for (phase, name) in PHASES {
        for (driver, scheme) in DRIVERS.iter().filter(|(driver, _)| applies(*driver, phase)) {
            let _ = write!(text, "| {name} | {scheme} |");
            for (fault, _) in FAULTS {
                let cell = of((*driver, phase, fault)).map_or_else(String::new, cell);
                let _ = write!(text, " {cell} |");
            }
            text.push('\n');
        }
    }
    text
}

fn cell(outcome: &Outcome) -> String {
    let rest = outcome.rest_s.map_or("goes on".to_owned(), |s| match s {
        0.0 => "at rest".to_owned(),
        s => format!("{s:.2} s"),
    });
    let status = outcome.status.map_or("hangs".to_owned(), |status| match status {
        -9 => "killed".to_owned(),
        code => format!("exit {code}"),
    });
    let kept = outcome.kept.map_or(String::new(), |rows| format!(", {:.1} s kept", 1e-3 * rows as f64));
    format!("{rest}, {status}{kept}")
}

fn apart(a: &Pose, b: &Pose) -> f64 {
    let far = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).fold(0.0, |m: f64, (p, q)| m.max((p - q).abs()));
    far(a.position_m, b.position_m).max(far(a.rpy_rad, b.rpy_rad))
}

/// Follows a run to a phase, has something go wrong, and watches the plate.
fn run(number: usize, driver: Driver, phase: Phase, fault: Fault) -> std::io::Result<Outcome> {
    let folder: PathBuf =
        std::env::temp_dir().join(format!("rigident-safety-{}-{number}", std::process::id()));
    let mut served = Served::start(&folder, driver)?;
    let mut said = Vec::new();
    reach(&mut served, phase, &mut said)?;
    let (began_s, mut last) = served.look();
    served.fail(fault)?;
    let failed = Instant::now();
    let (mut moved_s, mut rest_s, mut stalled) = (began_s, None, fault == Fault::Stall);
    while failed.elapsed() < PATIENCE {
        thread::sleep(LOOK);
        said.extend(served.heard());
        let (now_s, pose) = served.look();
        if apart(&last, &pose) > STILL {
            moved_s = now_s;
        }
        last = pose;
        if rest_s.is_none() && now_s - moved_s > RESTS_S {
            rest_s = Some(moved_s - began_s);
        }
        if stalled && failed.elapsed() > STALLED {
            served.go_on()?;
            stalled = false;
        }
        if rest_s.is_some() && !stalled && served.status()?.is_some() {
            break;
        }
    }
    thread::sleep(10 * LOOK);
    said.extend(served.heard());
    let said =
        said.into_iter().rev().take(4).collect::<Vec<_>>().into_iter().rev().collect::<Vec<_>>().join(" / ");
    if goes_on(driver, fault) {
        rest_s = None;
    }
    Ok(Outcome { rest_s, status: served.status()?, kept: served.kept(), said })
}

/// Waits until the run is in a phase.
fn reach(served: &mut Served, phase: Phase, said: &mut Vec<String>) -> std::io::Result<()> {
    let begun = Instant::now();
    let (mut way, mut experiment_s, mut turned) = (false, None, 0.0_f64);
    let (mut before_s, mut before) = served.look();
    loop {
        thread::sleep(LOOK);
        let (now_s, pose) = served.look();
        let heard = served.heard();
        way |= heard.iter().any(|line| line.starts_with("to the first pose"));
        if heard.iter().any(|line| line.starts_with("the experiment takes")) {
            experiment_s = Some(now_s);
        }
        let asked = heard.iter().any(|line| line.contains("about to move")) || !said.is_empty();
        said.extend(heard);
        let speed = apart(&before, &pose) / (now_s - before_s).max(1e-3);
        (before_s, before) = (now_s, pose);
        let since_s = experiment_s.map_or(0.0, |s| now_s - s);
        turned = turned.max(if since_s > HOLD_S { since_s } else { 0.0 });
        let there = match phase {
            Phase::Zero => asked,
            Phase::Way => way && experiment_s.is_none() && speed > 0.05,
            Phase::Rest => since_s > 0.3 * HOLD_S && speed < 1e-3,
            Phase::Motion => since_s > HOLD_S + 1.5 && speed > 0.1,
            Phase::Home => said.iter().any(|line| line.contains("way home")) || since_s > 8.4 && speed > 0.05,
        };
        if there {
            return Ok(());
        }
        if begun.elapsed() > PATIENCE || served.status()?.is_some() {
            return Err(std::io::Error::other(format!("{phase:?} was not reached: {}", said.join(" / "))));
        }
    }
}

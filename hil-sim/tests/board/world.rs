//! A board with its program, its rig and its host, from power-on to the end of a run.

use std::panic::{self, AssertUnwindSafe};
use std::rc::Rc;
use std::sync::{Mutex, MutexGuard, PoisonError};

use hexapod::experiment::thesis_program;
use rigident_firmware::Path;
use rigident_firmware::capture::{Place, Ring};
use rigident_shared::wire::{Settings, StateName, TelemetrySettings};
use rigident_sim::rig::{Rig, RigConfig};
use stm32f405::flash;
use stm32f405::program::{self, Program};
use stm32f405::sensors;
use stm32f405::start;

use super::chip::{Chip, Restarted};
use super::host::{Host, Outcome, Plan};
use super::settings::settings;

/// The drivers keep what they know in statics, as on the board: one board at a time.
static ONE: Mutex<()> = Mutex::new(());

/// The program's room for its estimator, made once: no program is left when the next one is begun.
struct Room(*mut Path);
// SAFETY: it is used by whoever holds the lock alone.
unsafe impl Send for Room {}
static ROOM: Mutex<Option<Room>> = Mutex::new(None);

/// The outcome of a board's life.
#[derive(Debug)]
pub struct Life {
    pub outcome: Outcome,
    /// Acts that the manual forbids.
    pub breaches: Vec<String>,
    /// The program panicked.
    pub panicked: Option<String>,
    pub resets: Vec<super::chip::Reset>,
    pub seconds: f64,
    /// Edges that reached the chip while a run was on, of load cell, IMU and second IMU.
    pub edges: [u64; 3],
    /// The board's rate on the line is one that the host understands.
    pub reachable: bool,
    pub truth: [f64; 10],
}

/// Returns the rig and its settings at this rate, with this many seconds of the thesis' motion.
pub fn rig(rate_hz: f64, seconds: f64, seed: u64) -> (Rig, Settings) {
    let config = RigConfig::thesis_horizontal().with_rates(rate_hz, rate_hz).with_seed(seed);
    let settings = Settings {
        row_every: (rate_hz / 100.0) as u16,
        telemetry: TelemetrySettings { estimate_every_blocks: 100, stream_readings: false },
        host_timeout_ms: 3_000,
        ..settings(&config)
    };
    let mut rig = Rig::new(config).unwrap();
    rig.hold_two_conversions();
    let program = thesis_program(&rig.config().geometry, seconds);
    rig.load_program(program).unwrap();
    (rig, settings)
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Boots a chip, without a program, for something to be done with it.
pub fn with_chip(rig: Rig, what: impl FnOnce(&Chip)) {
    let _one = locked(&ONE);
    start::EVENTS.forget();
    let chip = Chip::new(rig, 1);
    chip.begins();
    sensors::forget();
    start::forget_the_loader();
    program::boot();
    what(&chip);
}

/// Runs a board until its host has done with it.
pub fn live(rig: Rig, plan: &mut Plan, seed: u64, prepare: impl FnOnce(&Chip, &mut Plan)) -> Life {
    let _one = locked(&ONE);
    start::EVENTS.forget();
    let body = rig.truth().body;
    let chip = Chip::new(rig, seed);
    prepare(&chip, plan);
    let mut host = Host::new(plan.clone());
    let mut panicked = None;
    loop {
        chip.begins();
        let over = panic::catch_unwind(AssertUnwindSafe(|| boot(&chip, &mut host)));
        match over {
            Ok(()) => break,
            Err(cause) if cause.is::<Restarted>() => {
                chip.with(|machine| machine.comes_up());
            }
            Err(cause) => {
                let text = cause.downcast_ref::<String>().cloned();
                let text = text.or_else(|| cause.downcast_ref::<&str>().map(|s| (*s).to_owned()));
                panicked = Some(text.unwrap_or_default());
                break;
            }
        }
    }
    let (breaches, resets) = chip.with(|m| (m.breaches.clone(), m.resets.clone()));
    Life {
        outcome: host.outcome,
        breaches,
        panicked,
        resets,
        seconds: chip.now_s(),
        edges: chip.with(|m| m.pins.edges_of_run),
        reachable: chip.with(|m| m.understands()),
        truth: parameters(body.mass_kg, body.com_m, body.inertia_com_kgm2),
    }
}

/// Returns mass, first moments, and the inertia about S's origin in the order of the device: xx, yy, zz, yz,
/// xz, xy.
fn parameters(m: f64, c: [f64; 3], about_com: [f64; 6]) -> [f64; 10] {
    let [xx, yy, zz, yz, xz, xy] = about_com;
    [
        m,
        m * c[0],
        m * c[1],
        m * c[2],
        xx + m * (c[1] * c[1] + c[2] * c[2]),
        yy + m * (c[0] * c[0] + c[2] * c[2]),
        zz + m * (c[0] * c[0] + c[1] * c[1]),
        yz - m * c[1] * c[2],
        xz - m * c[0] * c[2],
        xy - m * c[0] * c[1],
    ]
}

fn boot(chip: &Rc<Chip>, host: &mut Host) {
    sensors::forget();
    start::forget_the_loader();
    let boot = program::boot();
    let mut rooms = locked(&ROOM);
    let room = rooms.get_or_insert_with(|| Room(Box::leak(Box::new(Path::EMPTY))));
    // SAFETY: whatever program had it before is gone, with everything that pointed into it.
    let path = unsafe { &mut *room.0 };
    *path = Path::EMPTY;
    // A few kilobytes for each start: an interrupt's side keeps the ring for ever.
    let ring = Box::leak(Box::new(Ring::new()));
    let place: &'static Place = Box::leak(Box::new(Place::new(None)));
    let mut board = Box::new(program::instrument(path, place));
    let mut store = flash::store();
    let mut program = Program::new(&boot, &mut board, (ring, place), store.as_mut(), || (0, 1));
    while !host.step(chip) {
        program.turn();
        let running = program.instrument().app().state().0 == StateName::Running;
        chip.with(|machine| machine.pins.count(running));
    }
}

//! A recording sent to a device that loses its supply again and again, or whose flash fails: every reading is
//! to be in its factor once.
//!
//! The oracle: readings of still poses make a row block each, with no filter between them. So the factor's
//! rows are six times the readings if and only if none is lost and none is there twice, and its `RᵀR` is that
//! of a device that was left alone.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rigident::device::link::{Client, TakenFactor, Transport};
use rigident::device::session::{Nobody, Session};
use rigident_shared::calibration::Reading;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};
use rigident_shared::wire::{
    ImuSettings, Kept, LoadCellSettings, MemorySettings, ModelSettings, Settings, Source, TelemetrySettings,
};
use rigident_sim::flash::{FlashFault, SharedFlash};
use rigident_sim::rig::{Rig, RigConfig};
use rigident_sim::runner::{Mcu, PacedRig, Pacing, WithFlash};

use super::mcu::{Place, boot};
use super::{Extent, Verdict};

/// Readings in the recording.
const READINGS: u32 = 4000;
/// Cuts in one recording at most, and writes of the host from one to the next at most: a batch of sixteen
/// readings is one.
const CUTS_AT_MOST: usize = 100;
const CUT_WITHIN: u64 = 12;
/// Recordings at the same time.
const AT_ONCE: usize = 3;

fn settings() -> Settings {
    Settings {
        // A checkpoint every 50 readings.
        rate_hz: 5.0,
        source: Source::Injected,
        model: ModelSettings::Body,
        imu: ImuSettings {
            rate_hz: 5.0,
            rotation_wxyz: [1.0, 0.0, 0.0, 0.0],
            position_m: [0.0; 3],
            accel_scale: [1.0; 3],
            accel_bias_mps2: [0.0; 3],
            gyro_bias_radps: [0.0; 3],
            accel_noise_mps2: 0.0,
            gyro_noise_radps: 0.0,
            group_delay_ns: 0,
            range_mps2: 160.0,
            range_radps: 35.0,
        },
        load_cell: LoadCellSettings {
            calibration: std::array::from_fn(|i| std::array::from_fn(|j| f32::from(u8::from(i == j)))),
            noise_n_nm: [1.0; 6],
            known_offset_n_nm: None,
            group_delay_ns: 0,
            range_n_nm: [1e4; 6],
            excitation_v: None,
        },
        filter_width_s: 0.0,
        row_every: 1,
        knock_limit_sd: 0.0,
        memory: MemorySettings::Forever,
        stop: None,
        telemetry: TelemetrySettings { estimate_every_blocks: 0, stream_readings: false },
        frozen_after: 0,
        host_timeout_ms: 0,
    }
}

/// Returns still poses of a body of 2 kg at (0, 0, 0.1) m, each reading another one.
fn recording() -> Vec<Reading<f64>> {
    (0..READINGS)
        .map(|n| {
            let t = f64::from(n) * 0.37;
            let a = [3.0 * t.sin(), 4.0 * (0.7 * t).cos(), 8.0 + (1.3 * t).sin()];
            let f = a.map(|a| 2.0 * a);
            let wrench = [f[0], f[1], f[2], -0.1 * f[1], 0.1 * f[0], 0.0];
            Reading {
                time_ns: u64::from(n) * 200_000_000,
                wrench: Wrench::from_array(wrench),
                specific_force: SpecificForce::from_array(a),
                angular_rate: AngularRate::from_array([0.0; 3]),
            }
        })
        .collect()
}

/// The event of the supply.
struct Supply {
    random: ChaCha8Rng,
    /// Cuts that are left.
    cuts: usize,
    /// A cut comes after at most this many writes of the host.
    within: u64,
    /// Writes until the next.
    until: u64,
}

impl Supply {
    /// Returns a supply that ends the given number of times, drawn from a seed.
    fn failing(cuts: usize, within: u64, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        // Not before the device is configured: a host that has not begun says so and ends.
        let until = 8 + random.next_u64() % within;
        Self { random, cuts, within, until }
    }
}

/// A device that is ended and booted again on the same flash, in the middle of whatever it does.
struct Restarting {
    place: Place,
    flash: SharedFlash,
    mcu: Box<dyn Mcu>,
    supply: Supply,
    done: Arc<AtomicUsize>,
}

fn board(place: Place, flash: &SharedFlash) -> io::Result<Box<dyn Mcu>> {
    let rig = Rig::new(RigConfig::thesis_horizontal()).map_err(io::Error::other)?.shared();
    let bus = WithFlash::new(PacedRig::new(rig, Pacing::LockStep), flash.clone());
    boot(place, Box::new(bus)).map_err(io::Error::other)
}

impl Restarting {
    fn restart(&mut self) -> io::Result<()> {
        self.supply.cuts -= 1;
        self.supply.until = 1 + self.supply.random.next_u64() % self.supply.within;
        self.done.fetch_add(1, Ordering::Relaxed);
        // The emulator is killed, whatever its processor does; the flash has what it has.
        self.mcu = Box::new(Nothing);
        self.flash.lock().power_up();
        self.mcu = board(self.place, &self.flash)?;
        Ok(())
    }
}

/// No device.
struct Nothing;

impl Mcu for Nothing {
    fn write(&mut self, _: &[u8]) -> io::Result<()> {
        Ok(())
    }
    fn read(&mut self, _: &mut [u8], _: Duration) -> io::Result<usize> {
        Ok(0)
    }
    fn name(&self) -> &'static str {
        "nothing"
    }
}

impl Transport for Restarting {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.supply.cuts > 0 {
            self.supply.until -= 1;
            if self.supply.until == 0 {
                // Half of the cuts come in the middle of whatever the flash does next, the others before what
                // the host says is heard.
                if self.supply.random.next_u64().is_multiple_of(2) {
                    let after = self.supply.random.next_u64() % 1500;
                    self.flash.lock().fail(FlashFault::PowerCut { after });
                    self.supply.until = 1 + self.supply.random.next_u64() % self.supply.within;
                } else {
                    self.restart()?;
                }
            } else if self.flash.lock().is_off() {
                self.restart()?;
            }
        }
        self.mcu.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.mcu.read(buffer, timeout)
    }
}

/// Sends the recording to a device; its factor, readings that it counts, and restarts of which the host
/// knows.
fn replay(restarting: Restarting) -> Result<(TakenFactor, u32, usize), String> {
    let mut session = Session::open(Client::new(Box::new(restarting))).map_err(|e| e.to_string())?;
    session.configure(&settings()).map_err(|e| e.to_string())?;
    let take = session.inject(&recording(), &mut Nobody).map_err(|e| e.to_string())?;
    match (take.factor, take.broken) {
        (Some(factor), None) => Ok((factor, take.counters.readings, take.restarts)),
        (_, broken) => Err(broken.unwrap_or_else(|| "no factor".to_owned())),
    }
}

/// Compares with a device that was left alone.
fn judged(place: Place, flash: &SharedFlash, supply: Supply) -> Result<(Verdict, usize), String> {
    let whole = Restarting {
        place: Place::Process,
        flash: SharedFlash::of_board(),
        mcu: board(Place::Process, &SharedFlash::of_board()).map_err(|e| e.to_string())?,
        supply: Supply::failing(0, 1, 0),
        done: Arc::default(),
    };
    let (whole, ..) = replay(whole)?;
    let (wanted, done) = (supply.cuts, Arc::new(AtomicUsize::new(0)));
    let mcu = board(place, flash).map_err(|e| e.to_string())?;
    let (factor, readings, restarts) =
        replay(Restarting { place, flash: flash.clone(), mcu, supply, done: Arc::clone(&done) })?;
    if readings != READINGS || factor.factor.rows() != u64::from(6 * READINGS) {
        return Err(format!(
            "{readings} readings and {} rows of {READINGS} readings are in the factor",
            factor.factor.rows()
        ));
    }
    let gram = |taken: &TakenFactor| {
        let r = taken.factor.r();
        r.transpose() * r
    };
    let (one, other) = (gram(&whole), gram(&factor));
    // A diagonal of n rows in single precision; each restart rounds once more.
    let scale = |j: usize| one[(j, j)].max(f64::MIN_POSITIVE).sqrt();
    let off = (0..one.nrows())
        .flat_map(|i| (0..one.ncols()).map(move |j| (i, j)))
        .filter(|(i, j)| one[(*i, *i)] > 0.0 && one[(*j, *j)] > 0.0)
        .map(|(i, j)| (one[(i, j)] - other[(i, j)]).abs() / (scale(i) * scale(j)))
        .fold(0.0, f64::max);
    if off > 1e-3 {
        return Err(format!("the factor is off by {off:.1e} of what it is to be"));
    }
    let wear = flash.lock().wear().iter().sum::<u32>();
    let over = flash.lock().overprogrammed();
    if over > 0 {
        return Err(format!("{over} bytes of flash were programmed twice"));
    }
    let verdict = Verdict {
        detected: restarts > 0 || wanted == 0,
        worst: Some(0.0),
        words: format!(
            "{restarts} restarts, {READINGS} of {READINGS} readings once each, {wear} erases of the flash"
        ),
    };
    Ok((verdict, done.load(Ordering::Relaxed)))
}

/// Ends the supply a number of times in the middle of a recording.
pub fn power_cuts(place: Place, extent: Extent) -> Result<Verdict, String> {
    let (mut restarts, mut recordings, mut last) = (0, 0, None);
    while restarts < extent.restarts {
        // Both sides mostly wait for each other: several at once.
        let left = extent.restarts - restarts;
        let at_once = left.div_ceil(CUTS_AT_MOST).min(AT_ONCE);
        let ended: Vec<_> = std::thread::scope(|scope| {
            let begun: Vec<_> = (0..at_once)
                .map(|k| {
                    let supply = Supply::failing(left.min(CUTS_AT_MOST), CUT_WITHIN, recordings + k as u64);
                    scope.spawn(move || judged(place, &SharedFlash::of_board(), supply))
                })
                .collect();
            begun.into_iter().map(|thread| thread.join().map_err(|_| "a panic".to_owned())).collect()
        });
        let before = restarts;
        for ended in ended {
            let (verdict, done) = ended??;
            (restarts, recordings, last) = (restarts + done, recordings + 1, Some(verdict));
        }
        if restarts == before {
            return Err("no cut came to pass".to_owned());
        }
        if !extent.short {
            eprintln!("    {restarts} cuts in {recordings} recordings so far");
        }
    }
    let verdict = last.ok_or("nothing was cut")?;
    let words = format!(
        "{restarts} cuts in {recordings} recordings of {READINGS} readings; in each every reading once"
    );
    Ok(Verdict { detected: true, words, ..verdict })
}

/// Runs a recording while the flash does not answer: nothing is stored, and the recording goes through all
/// the same.
pub fn dead_flash(place: Place, cuts: usize) -> Result<Verdict, String> {
    let flash = SharedFlash::of_board();
    flash.lock().fail(FlashFault::Dead);
    let (mut verdict, _) = judged(place, &flash, Supply::failing(cuts, 200, 0))?;
    let mut session = Session::open(Client::new(Box::new(Restarting {
        place,
        flash: flash.clone(),
        mcu: {
            flash.lock().fail(FlashFault::Dead);
            board(place, &flash).map_err(|e| e.to_string())?
        },
        supply: Supply::failing(0, 1, 0),
        done: Arc::default(),
    })))
    .map_err(|e| e.to_string())?;
    let kept = session.client().hello().map_err(|e| e.to_string())?.kept;
    verdict.detected = kept == Kept::NoStorage;
    verdict.words = format!("the hello says {kept:?}; {}", verdict.words);
    Ok(verdict)
}

/// Flips a bit of what is stored: it is read as damaged or as an older checkpoint, and never as something
/// else.
pub fn bit_rot(place: Place) -> Result<Verdict, String> {
    let flash = SharedFlash::of_board();
    let mut random = ChaCha8Rng::seed_from_u64(9);
    judged(place, &flash, Supply::failing(1, 100, 0))?;
    let mut kept = Vec::new();
    for _ in 0..20 {
        let spoilt = SharedFlash::of_board();
        *spoilt.lock() = flash.lock().clone();
        let bit = random.next_u64() as usize % (8 * 600);
        spoilt.lock().fail(FlashFault::BitRot { bit });
        let restarting = Restarting {
            place,
            mcu: board(place, &spoilt).map_err(|e| e.to_string())?,
            flash: spoilt,
            supply: Supply::failing(0, 1, 0),
            done: Arc::default(),
        };
        let mut session = Session::open(Client::new(Box::new(restarting))).map_err(|e| e.to_string())?;
        kept.push(session.client().hello().map_err(|e| e.to_string())?.kept);
    }
    let honest = kept.iter().filter(|kept| match kept {
        Kept::Run(run) => run.readings <= READINGS && run.blocks == run.readings,
        Kept::Nothing | Kept::Damaged | Kept::OtherFirmware { .. } => true,
        Kept::NoStorage => false,
    });
    let honest = honest.count();
    let runs = kept.iter().filter(|kept| matches!(kept, Kept::Run(_))).count();
    if honest < kept.len() {
        return Err(format!("{kept:?}"));
    }
    Ok(Verdict {
        detected: runs < kept.len(),
        worst: None,
        words: format!("of {} rotten bits of the settings {} were reported", kept.len(), kept.len() - runs),
    })
}

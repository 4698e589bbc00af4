//! A power cut at any byte leaves the old or the new, on a small flash for every byte, on the board's for
//! random ones.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rigident_firmware::storage::{CheckpointHead, Layout, Store, StoreError};
use rigident_firmware::{Buses, Instrument, Path};
use rigident_shared::wire::frame::MAX_FRAME;
use rigident_shared::wire::{
    Command, CounterReport, ImuSettings, Kept, Kind, LoadCellSettings, MemorySettings, ModelSettings,
    Settings, Source, TelemetrySettings, encode,
};
use rigident_sim::flash::{FlashDriver, FlashFault, SECTOR_BYTES, SECTORS, SharedFlash};

/// Sectors so small that a few records fill one.
const SMALL: usize = 512;

fn settings(rate_hz: f32) -> Settings {
    Settings {
        rate_hz,
        source: Source::Injected,
        model: ModelSettings::Body,
        imu: ImuSettings {
            rate_hz,
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
            calibration: [[1.0; 6]; 6],
            noise_n_nm: [1.0; 6],
            known_offset_n_nm: None,
            group_delay_ns: 0,
            range_n_nm: [1e4; 6],
            excitation_v: None,
        },
        filter_width_s: 0.1,
        row_every: 2,
        knock_limit_sd: 6.0,
        memory: MemorySettings::Forever,
        stop: None,
        telemetry: TelemetrySettings { estimate_every_blocks: 25, stream_readings: false },
        frozen_after: 50,
        host_timeout_ms: 0,
    }
}

/// The operation on a store.
#[derive(Clone, Copy, Debug)]
enum Step {
    Begin(f32),
    Keep(u32),
}

/// The content of a store by its own report: what is reported of the run, the rate of its settings, the
/// factor's bytes.
type Held = (Kept, Option<f32>, Option<Vec<u8>>);

fn store<const SECTOR: usize>(flash: &SharedFlash) -> Store<FlashDriver<SECTOR>> {
    let capacity = flash.lock().cells().len() as u32;
    let layout = Layout { settings: 0..capacity / 2, checkpoints: capacity / 2..capacity };
    Store::new(FlashDriver(flash.clone()), layout).unwrap()
}

/// Returns numbers in place of a factor's.
fn numbers(readings: u32) -> Vec<u8> {
    (0..24).flat_map(|k| (readings as f32 + k as f32).to_le_bytes()).collect()
}

fn run_step<const SECTOR: usize>(flash: &SharedFlash, step: Step) -> Result<(), StoreError> {
    let mut store = store::<SECTOR>(flash);
    match step {
        Step::Begin(rate_hz) => store.begin_run(&settings(rate_hz)).map(drop),
        Step::Keep(readings) => {
            let Kept::Run(run) = store.look() else { return Err(StoreError::NoSuchRun) };
            let head = CheckpointHead {
                counters: CounterReport { readings, blocks: readings / 2, ..CounterReport::default() },
                next_index: readings + 1,
                ..CheckpointHead::default()
            };
            let kept = store.keep(run.run, &head, |out| {
                let bytes = numbers(readings);
                out.get_mut(..bytes.len())?.copy_from_slice(&bytes);
                Some(bytes.len())
            });
            kept.map(drop)
        }
    }
}

fn held<const SECTOR: usize>(flash: &SharedFlash) -> Held {
    let mut store = store::<SECTOR>(flash);
    let kept = store.look();
    let Kept::Run(run) = kept else { return (kept, None, None) };
    let rate = store.settings(run.run).unwrap().rate_hz;
    let factor = store.checkpoint(run.run).unwrap().map(|(_, bytes)| bytes.to_vec());
    if run.readings > 0 {
        // The one that is reported is the one that is found.
        assert_eq!(factor, Some(numbers(run.readings)));
    }
    (kept, Some(rate), factor)
}

/// Runs in which both journals go round and a full one turns a checkpoint away.
fn script() -> Vec<Step> {
    let mut steps = Vec::new();
    for run in 0..8 {
        steps.push(Step::Begin(100.0 + run as f32));
        steps.extend((1..=run % 4).map(|k| Step::Keep(100 * run + 10 * k)));
    }
    steps
}

/// Does the steps until the supply ends: how many were done.
fn until_cut<const SECTOR: usize>(flash: &SharedFlash, steps: &[Step]) -> usize {
    for (k, step) in steps.iter().enumerate() {
        let _ = run_step::<SECTOR>(flash, *step);
        if flash.lock().is_off() {
            return k;
        }
    }
    steps.len()
}

/// Returns what is held before each step and after the last, and how many bytes all of them cost.
fn oracle<const SECTOR: usize>(flash: &SharedFlash, steps: &[Step]) -> (Vec<Held>, u64) {
    let mut states = vec![held::<SECTOR>(flash)];
    for step in steps {
        let _ = run_step::<SECTOR>(flash, *step);
        states.push(held::<SECTOR>(flash));
    }
    (states, flash.lock().spent())
}

/// Cuts the supply after `fuel` bytes, and in the recovery after `again` of them if given; then does another
/// run.
fn cut<const SECTOR: usize>(
    fresh: &SharedFlash,
    steps: &[Step],
    states: &[Held],
    fuel: u64,
    again: Option<u64>,
) -> u64 {
    let flash = SharedFlash::new(SECTOR, fresh.lock().wear().len());
    flash.lock().fail(FlashFault::PowerCut { after: fuel });
    let done = until_cut::<SECTOR>(&flash, steps);
    let before = flash.lock().spent();
    flash.lock().power_up();
    if let Some(again) = again {
        flash.lock().fail(FlashFault::PowerCut { after: again });
        let _ = store::<SECTOR>(&flash).look();
        flash.lock().power_up();
    }
    let found = held::<SECTOR>(&flash);
    let recovery = flash.lock().spent() - before;
    let (old, new) = (&states[done], &states[(done + 1).min(steps.len())]);
    assert!(
        found == *old || found == *new,
        "cut at {fuel} of step {done}: {found:?}, not {old:?} or {new:?}"
    );
    // It goes on: a further run and its checkpoint are stored, its number the next.
    run_step::<SECTOR>(&flash, Step::Begin(7.0)).unwrap();
    run_step::<SECTOR>(&flash, Step::Keep(77)).unwrap();
    let (kept, rate, _) = held::<SECTOR>(&flash);
    let number = |kept: &Kept| if let Kept::Run(run) = kept { run.run } else { 0 };
    assert!(matches!(kept, Kept::Run(run) if run.readings == 77 && run.checkpoints == 1), "{kept:?}");
    assert_eq!((number(&kept), rate), (number(&found.0) + 1, Some(7.0)));
    recovery
}

#[test]
fn a_cut_at_every_byte_of_a_small_flash_leaves_the_old_or_the_new() {
    let fresh = SharedFlash::new(SMALL, 4);
    let steps = script();
    let (states, all) = oracle::<SMALL>(&fresh, &steps);
    let wear = fresh.lock().wear().to_vec();
    assert!(wear.iter().all(|erases| *erases > 0), "both journals are to go round: {wear:?}");
    assert_eq!(fresh.lock().overprogrammed(), 0);
    let mut recoveries = 0;
    for fuel in 0..all {
        let recovery = cut::<SMALL>(&fresh, &steps, &states, fuel, None);
        recoveries += u32::from(recovery > 0);
        // Cuts in the recovery: all of the short ones, some of those that erase.
        let stride = if recovery > 64 { 1 + recovery / 8 } else { 1 };
        for again in (0..recovery).step_by(stride as usize) {
            cut::<SMALL>(&fresh, &steps, &states, fuel, Some(again));
        }
    }
    println!("{all} cuts, {recoveries} of them repaired at start-up");
}

#[test]
fn a_cut_at_random_bytes_of_the_board_s_flash_leaves_the_old_or_the_new() {
    let fresh = SharedFlash::of_board();
    let mut steps = Vec::new();
    for run in 0..3 {
        steps.push(Step::Begin(run as f32));
        steps.extend((1..=15).map(|k| Step::Keep(100 * run + k)));
    }
    let (states, all) = oracle::<SECTOR_BYTES>(&fresh, &steps);
    assert_eq!(fresh.lock().wear(), [0; SECTORS]);
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for _ in 0..60 {
        cut::<SECTOR_BYTES>(&fresh, &steps, &states, random.next_u64() % all, None);
    }
}

#[test]
fn while_a_run_is_under_way_nothing_is_erased_and_a_full_journal_says_so() {
    let flash = SharedFlash::new(SMALL, 4);
    run_step::<SMALL>(&flash, Step::Begin(1.0)).unwrap();
    let wear = flash.lock().wear().to_vec();
    let kept: Vec<_> = (1..9).map(|k| run_step::<SMALL>(&flash, Step::Keep(k))).collect();
    let full = kept.iter().position(|kept| *kept == Err(StoreError::Full)).unwrap();
    assert!(full >= 2 && kept[full..].iter().all(|kept| *kept == Err(StoreError::Full)), "{kept:?}");
    assert_eq!(flash.lock().wear(), wear);
    let (found, ..) = held::<SMALL>(&flash);
    assert!(matches!(found, Kept::Run(run) if run.readings as usize == full), "{found:?}");
}

#[test]
fn records_of_other_firmware_are_reported_and_not_read() {
    let flash = SharedFlash::new(SMALL, 4);
    let mut other = store::<SMALL>(&flash).written_by(0x0BAD_F00D);
    other.begin_run(&settings(1.0)).unwrap();
    let mut own = store::<SMALL>(&flash);
    assert_eq!(own.look(), Kept::OtherFirmware { hash: 0x0BAD_F00D });
    assert_eq!(own.settings(1), Err(StoreError::Damaged));
    own.begin_run(&settings(2.0)).unwrap();
    assert!(matches!(own.look(), Kept::Run(_)));
}

#[test]
fn any_rotten_bit_is_found_out() {
    let whole = SharedFlash::new(SMALL, 4);
    for step in [Step::Begin(1.0), Step::Keep(5), Step::Keep(9)] {
        run_step::<SMALL>(&whole, step).unwrap();
    }
    let written = [Some(numbers(5)), Some(numbers(9)), None];
    let bits = 8 * whole.lock().cells().len();
    for bit in 0..bits {
        let flash = SharedFlash::new(SMALL, 4);
        *flash.lock() = whole.lock().clone();
        flash.lock().fail(FlashFault::BitRot { bit });
        let found = held::<SMALL>(&flash);
        // A record the fewer, or none, and never one that was not written.
        let (kept, rate, factor) = &found;
        let honest = match kept {
            Kept::Run(run) => run.run == 1 && *rate == Some(1.0) && written.contains(factor),
            Kept::Nothing | Kept::Damaged => true,
            Kept::NoStorage | Kept::OtherFirmware { .. } => false,
        };
        assert!(honest, "bit {bit}: {found:?}");
    }
}

/// A place without sensor.
struct Nowhere;

impl embedded_hal::spi::ErrorType for Nowhere {
    type Error = embedded_hal::spi::ErrorKind;
}

impl embedded_hal::spi::SpiDevice for Nowhere {
    fn transaction(&mut self, _: &mut [embedded_hal::spi::Operation<'_, u8>]) -> Result<(), Self::Error> {
        Err(embedded_hal::spi::ErrorKind::Other)
    }
}

impl embedded_hal::delay::DelayNs for Nowhere {
    fn delay_ns(&mut self, _: u32) {}
}

/// A board stands still for seconds while sectors are erased: the answer leaves first, or the host gives up.
#[test]
fn nothing_is_erased_before_the_answer_has_left_and_while_the_host_is_heard() {
    let flash = SharedFlash::of_board();
    let mut store = store::<SECTOR_BYTES>(&flash);
    let buses = Buses { load_cell: Nowhere, imus: [Nowhere, Nowhere], frames: Nowhere };
    let mut instrument = Instrument::new("test", Box::new(Path::EMPTY), buses, Nowhere);
    instrument.tend_when_quiet(&mut store, true);
    let untouched = flash.lock().cells().to_vec();
    let mut frame = [0; MAX_FRAME];
    let length = encode(Kind::Command, 1, &Command::Configure(settings(200.0)), &mut frame).unwrap();
    instrument.on_bytes(&frame[..length], 0);
    assert_eq!(instrument.app().state().0, rigident_shared::wire::StateName::Configured);
    assert!(instrument.tx_pending() > 0);
    // The answer waits, in the instrument and then in the port's queue; then bytes of the host do.
    instrument.tend_when_quiet(&mut store, true);
    while instrument.poll_tx(&mut frame) > 0 {
        instrument.tend_when_quiet(&mut store, false);
    }
    instrument.tend_when_quiet(&mut store, false);
    assert!(*flash.lock().cells() == untouched[..], "something was erased");
    instrument.tend_when_quiet(&mut store, true);
    assert!(*flash.lock().cells() != untouched[..], "the settings are kept");
    assert!(matches!(store.look(), Kept::Run(_)));
}

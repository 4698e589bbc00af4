//! Faults of a board, drawn at random.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rigident_sim::devices::Device;
use rigident_sim::rig::Rig;

use super::chip::{BusFault, Chip, Crystal, EdgeFault, MS, Pace, US};
use super::host::Plan;

/// A kind of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    ClockLineHeld,
    DataLineHeld,
    BusNoise,
    EdgesLost,
    EdgesBesides,
    SignalLatched,
    ConverterRegister,
    ImuRegister,
    ConverterResync,
    ConverterOscillator,
    SlowFlash,
    SupplySags,
    SupplyCut,
    CrystalMissing,
    CrystalOff,
    CrystalOther,
    CrystalStops,
    NoiseOnTheLine,
    HostFloods,
    HostSleeps,
    ProgramLate,
    WatchdogOscillator,
    TimeWraps,
}

impl Kind {
    pub const ALL: [Self; 23] = [
        Self::ClockLineHeld,
        Self::DataLineHeld,
        Self::BusNoise,
        Self::EdgesLost,
        Self::EdgesBesides,
        Self::SignalLatched,
        Self::ConverterRegister,
        Self::ImuRegister,
        Self::ConverterResync,
        Self::ConverterOscillator,
        Self::SlowFlash,
        Self::SupplySags,
        Self::SupplyCut,
        Self::CrystalMissing,
        Self::CrystalOff,
        Self::CrystalOther,
        Self::CrystalStops,
        Self::NoiseOnTheLine,
        Self::HostFloods,
        Self::HostSleeps,
        Self::ProgramLate,
        Self::WatchdogOscillator,
        Self::TimeWraps,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::ClockLineHeld => "bus: clock held",
            Self::DataLineHeld => "bus: data held low or high",
            Self::BusNoise => "bus: bits inverted",
            Self::EdgesLost => "edges lost",
            Self::EdgesBesides => "edges that are none",
            Self::SignalLatched => "IMU's signal stays up",
            Self::ConverterRegister => "a bit of the converter's registers flips",
            Self::ImuRegister => "a bit of the IMU's registers flips",
            Self::ConverterResync => "a pulse at the converter's SYNC",
            Self::ConverterOscillator => "the converter's oscillator is another",
            Self::SlowFlash => "slow flash",
            Self::SupplySags => "the supply sags",
            Self::SupplyCut => "the supply is cut",
            Self::CrystalMissing => "no crystal",
            Self::CrystalOff => "the crystal is off",
            Self::CrystalOther => "a crystal of 12, 16 or 25 MHz",
            Self::CrystalStops => "the crystal stops",
            Self::NoiseOnTheLine => "noise on RX",
            Self::HostFloods => "the host floods",
            Self::HostSleeps => "the host sleeps",
            Self::ProgramLate => "the program is late",
            Self::WatchdogOscillator => "the watchdog's oscillator",
            Self::TimeWraps => "the timer wraps",
        }
    }
}

/// Faults of one run.
pub struct Drawn {
    pub kinds: Vec<Kind>,
    random: ChaCha8Rng,
}

impl Drawn {
    /// Draws one to three kinds.
    pub fn new(seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let count = 1 + random.next_u64() % 3;
        let mut kinds: Vec<Kind> = Vec::new();
        while kinds.len() < count as usize {
            let kind = Kind::ALL[(random.next_u64() % Kind::ALL.len() as u64) as usize];
            if !kinds.contains(&kind) {
                kinds.push(kind);
            }
        }
        kinds.sort();
        Self { kinds, random }
    }

    /// Returns the faults of these kinds, drawn by the seed in what they are like.
    pub fn of(kinds: &[Kind], seed: u64) -> Self {
        Self { kinds: kinds.to_vec(), random: ChaCha8Rng::seed_from_u64(seed) }
    }

    fn below(&mut self, below: u64) -> u64 {
        self.random.next_u64() % below
    }

    fn between(&mut self, from: u64, to: u64) -> u64 {
        from + self.below(to - from)
    }

    fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len() as u64) as usize]
    }

    /// Returns a stretch within the run, from 1 ms to two seconds long, or to its end; ps. The run is on from
    /// about 1 s.
    fn stretch(&mut self, run: u64) -> (u64, u64) {
        let from = self.between(300 * MS, 1_000 * MS + run);
        let lasts = self.pick(&[MS, 10 * MS, 100 * MS, 2_000 * MS, run]);
        (from, from + self.between(lasts / 2, lasts + 1))
    }

    /// Has all of them happen to a chip and its host.
    pub fn happen(&mut self, chip: &Chip, plan: &mut Plan) {
        for kind in self.kinds.clone() {
            self.one(kind, chip, plan);
            let ends = chip.with(|m| m.ends_of_faults());
            let host = [plan.sleeps, plan.floods].into_iter().flatten().map(|(_, to)| to).max().unwrap_or(0);
            plan.calm_after = plan.calm_after.max(ends).max(host);
        }
        plan.calm_after = plan.calm_after.max(plan.duration + 3_000 * MS);
    }

    fn one(&mut self, kind: Kind, chip: &Chip, plan: &mut Plan) {
        let (from, to) = self.stretch(plan.duration);
        match kind {
            Kind::ClockLineHeld => chip.with(|m| m.spi.faults.push((BusFault::Clock, from, to))),
            Kind::DataLineHeld => {
                let high = self.below(2) == 0;
                chip.with(|m| m.spi.faults.push((BusFault::Data(high), from, to)));
            }
            Kind::BusNoise => {
                let every = self.pick(&[30, 1_000, 30_000]);
                chip.with(|m| m.spi.faults.push((BusFault::Noise(every), from, to)));
            }
            Kind::EdgesLost => {
                let (of, every) = (self.sensor(), self.pick(&[1, 3, 50, 500]));
                chip.with(|m| m.pins.faults.push((of, EdgeFault::Lost(every), from, to)));
            }
            Kind::EdgesBesides => {
                let (fault, of) = (self.glitches(), self.sensor());
                chip.with(|m| m.pins.faults.push((of, fault, from, to)));
            }
            Kind::SignalLatched => {
                chip.with(|m| m.pins.faults.push((Device::Imu, EdgeFault::Latched, from, to)));
            }
            Kind::ConverterRegister => {
                let what = self.converter_register();
                chip.with(|m| m.later.push((from, what)));
            }
            Kind::ImuRegister => {
                let what = self.imu_register();
                chip.with(|m| m.later.push((from, what)));
            }
            Kind::ConverterResync => chip.with(|m| m.later.push((from, What::Resync))),
            Kind::ConverterOscillator => {
                let hz = self.pick(&[8.0e6, 8.192e6 * 1.0004, 8.192e6 * 0.9992, 8.192e6 * 1.01]);
                chip.with(|m| m.rig.set_load_cell_clock_hz(hz));
            }
            Kind::SlowFlash => self.slow_flash(chip),
            Kind::SupplySags => self.sag(chip, from),
            Kind::SupplyCut => chip.with(|m| m.supply.cut = Some(from)),
            Kind::CrystalMissing => self.miss_crystal(chip),
            Kind::CrystalOff => self.mistune_crystal(chip),
            Kind::CrystalOther => self.exchange_crystal(chip),
            Kind::CrystalStops => chip.with(|m| m.clocks.crystal.stops = Some(from)),
            Kind::NoiseOnTheLine => {
                let every = self.pick(&[12 * US, 200 * US, 5 * MS]);
                chip.with(|m| m.add_noise(from, to, every));
            }
            Kind::HostFloods => plan.floods = Some((from, to)),
            Kind::HostSleeps => plan.sleeps = Some((from, from + self.between(500 * MS, 8_000 * MS))),
            Kind::ProgramLate => self.compute_long(chip),
            Kind::WatchdogOscillator => {
                let hz = self.between(17_000, 47_001) as f64;
                chip.with(|m| m.supply.watchdog_hz = hz);
            }
            Kind::TimeWraps => {
                let before = self.between(0, 4_000_000 * 8) as u32;
                chip.with(|m| m.timer.begins_at = u32::MAX - before);
            }
        }
    }

    /// Lowers the supply for a while.
    fn sag(&mut self, chip: &Chip, from: u64) {
        let volts = self.pick(&[2.85, 2.75, 2.6, 1.2]);
        let to = from + self.between(MS, 500 * MS);
        chip.with(|m| m.supply.sags.push((from, to, volts)));
    }

    fn slow_flash(&mut self, chip: &Chip) {
        let (word, sector) = (self.between(16, 101) * US, self.between(1_000, 2_001) * MS);
        chip.with(|m| m.flash.pace = Pace { word, sector });
    }

    /// Takes the crystal away; the internal oscillator is off by up to 4 %.
    fn miss_crystal(&mut self, chip: &Chip) {
        let internal = 1.0 + (self.below(801) as f64 - 400.0) * 1e-4;
        chip.with(|m| {
            m.clocks.crystal = Crystal { hz: 0.0, stops: None };
            m.clocks.internal = internal;
        });
    }

    fn mistune_crystal(&mut self, chip: &Chip) {
        let ppm = self.pick(&[-5_000.0, -900.0, -100.0, 100.0, 900.0, 5_000.0]);
        chip.with(|m| m.clocks.crystal.hz = 8e6 * (1.0 + 1e-6 * ppm));
    }

    fn exchange_crystal(&mut self, chip: &Chip) {
        let hz = self.pick(&[12e6, 16e6, 25e6]);
        chip.with(|m| m.clocks.crystal.hz = hz);
    }

    fn compute_long(&mut self, chip: &Chip) {
        let long = self.pick(&[2 * MS, 6 * MS, 40 * MS, 150 * MS]);
        chip.with(|m| m.long_computing = (2_000, long));
    }

    fn glitches(&mut self) -> EdgeFault {
        let (lasts, every) = (self.pick(&[50_000, 200_000, 5 * US]), self.pick(&[MS / 2, 20 * MS, 300 * MS]));
        EdgeFault::Glitches { lasts, every }
    }

    fn converter_register(&mut self) -> What {
        // MODE, CLOCK, gains, CFG, and the channels' own.
        let register = self.between(2, 0x31) as usize;
        What::Converter(register, 1 << self.below(16))
    }

    fn imu_register(&mut self) -> What {
        let register = self.pick(&[
            0x11, 0x13, 0x14, 0x16, 0x4c, 0x4d, 0x4e, 0x4f, 0x50, 0x51, 0x52, 0x53, 0x54, 0x5f, 0x60, 0x61,
            0x63, 0x64, 0x65, 0x76,
        ]);
        What::Imu(register, 1 << self.below(8))
    }

    fn sensor(&mut self) -> Device {
        if self.below(2) == 0 { Device::LoadCell } else { Device::Imu }
    }
}

/// A disturbance of a sensor that happens once.
#[derive(Clone, Copy, Debug)]
pub enum What {
    Converter(usize, u16),
    Imu(u8, u8),
    Resync,
}

impl What {
    pub fn happen(self, rig: &mut Rig) {
        match self {
            Self::Converter(register, bits) => rig.disturb_load_cell_register(register, bits),
            Self::Imu(register, bits) => rig.imu_device_mut().disturb(register, bits),
            Self::Resync => rig.resynchronise_load_cell(),
        }
    }
}

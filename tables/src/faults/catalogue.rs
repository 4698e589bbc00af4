//! Every fault that the simulator can make, in matches that leave none out.

use rigident_sim::devices::Device;
use rigident_sim::flash::FlashFault;
use rigident_sim::link::LinkFaults;
use rigident_sim::rig::{Rig, WiringFault};
use rigident_sim::sensors::{Channel, Fault};

use super::experiment::{experiment, overloaded, restarted, rig, wired};
use super::mcu::Place;
use super::replayed::{bit_rot, dead_flash, power_cuts};
use super::{Expected, Extent, Verdict};

/// A fault and what is to become of it.
pub struct Case {
    /// The fault.
    pub name: String,
    /// The place.
    pub place: Place,
    /// The expected outcome.
    pub expected: Expected,
    /// True if it is in the short selection.
    pub short: bool,
    /// True if it restarts the device as often as the extent says.
    pub restarts: bool,
    /// Does it.
    pub run: Run,
}

/// Does a case.
pub type Run =
    std::sync::Arc<dyn Fn(Extent) -> Result<Verdict, String> + Send + Sync + std::panic::RefUnwindSafe>;

/// The time when sensor faults act: in the middle of the motion, s.
const DURING: std::ops::Range<f64> = 8.0..10.0;

/// Returns the kind of sensor fault after this one, with numbers of its own; the first if there is none
/// before it.
fn next_fault(before: Option<&Fault>) -> Option<Fault> {
    match before {
        None => Some(Fault::Frozen { channel: Channel::Wrench(2), during: DURING }),
        Some(Fault::Frozen { .. }) => Some(Fault::Saturated { channel: Channel::Wrench(2), during: DURING }),
        Some(Fault::Saturated { .. }) => Some(Fault::Drift {
            rate_n_nm_per_s: [2.0, -1.0, 4.0, 0.1, 0.2, -0.1],
            during: 0.0..f64::INFINITY,
        }),
        Some(Fault::Drift { .. }) => {
            Some(Fault::WarmUp { amplitude_n_nm: [10.0, -10.0, 30.0, 1.0, 1.0, -1.0], time_constant_s: 6.0 })
        }
        Some(Fault::WarmUp { .. }) => {
            Some(Fault::Knock { during: 9.0..9.02, peak_n_nm: [200.0, 0.0, 300.0, 20.0, 0.0, 0.0] })
        }
        Some(Fault::Knock { .. }) => Some(Fault::Excitation { to: 0.99, during: 0.0..20.0 }),
        Some(Fault::Excitation { .. }) => None,
    }
}

/// Returns the channel after this one; the first if there is none before it.
fn next_channel(before: Option<Channel>) -> Option<Channel> {
    match before {
        None => Some(Channel::Wrench(2)),
        Some(Channel::Wrench(_)) => Some(Channel::LoadCell),
        Some(Channel::LoadCell) => Some(Channel::Accelerometer(0)),
        Some(Channel::Accelerometer(_)) => Some(Channel::Gyro(1)),
        Some(Channel::Gyro(_)) => Some(Channel::Imu),
        Some(Channel::Imu) => None,
    }
}

fn channels() -> Vec<Channel> {
    std::iter::successors(next_channel(None), |channel| next_channel(Some(*channel))).collect()
}

/// Returns a sensor fault, on every channel that it can have.
fn on_channels(fault: &Fault) -> Vec<(String, Fault)> {
    match fault {
        Fault::Frozen { during, .. } => channels()
            .into_iter()
            .map(|channel| (format!("{channel:?} frozen"), Fault::Frozen { channel, during: during.clone() }))
            .collect(),
        Fault::Saturated { during, .. } => channels()
            .into_iter()
            .map(|channel| {
                (format!("{channel:?} at its range"), Fault::Saturated { channel, during: during.clone() })
            })
            .collect(),
        Fault::Drift { .. } => vec![("offset that runs away".to_owned(), fault.clone())],
        Fault::WarmUp { .. } => vec![("offset that settles".to_owned(), fault.clone())],
        Fault::Knock { .. } => vec![("a knock".to_owned(), fault.clone())],
        Fault::Excitation { .. } => vec![
            ("excitation that drifts by 1 %".to_owned(), fault.clone()),
            ("excitation that is gone".to_owned(), Fault::Excitation { to: 0.0, during: 8.0..8.001 }),
        ],
    }
}

/// Returns line faults, each by itself and all together.
fn line_faults() -> Vec<(&'static str, LinkFaults)> {
    // No field is left out: a new one does not compile.
    let LinkFaults { drop_byte, flip_bit, duplicate_byte, drop_frame, duplicate_frame, delay_frame } =
        LinkFaults::one_in(50);
    let none = LinkFaults::default();
    vec![
        ("line: bytes vanish", LinkFaults { drop_byte: 2.0 * drop_byte, ..none }),
        ("line: bits flip", LinkFaults { flip_bit: 2.0 * flip_bit, ..none }),
        ("line: bytes come twice", LinkFaults { duplicate_byte: 2.0 * duplicate_byte, ..none }),
        ("line: frames vanish", LinkFaults { drop_frame, ..none }),
        ("line: frames come twice", LinkFaults { duplicate_frame, ..none }),
        ("line: frames overtake", LinkFaults { delay_frame, ..none }),
        ("line: all of it", LinkFaults::one_in(100)),
    ]
}

/// Returns the wiring fault after this one; the first if there is none before it.
fn next_wiring(before: Option<WiringFault>) -> Option<WiringFault> {
    match before {
        None => Some(WiringFault::Exchanged),
        Some(WiringFault::Exchanged) => Some(WiringFault::Unpowered(Device::LoadCell)),
        Some(WiringFault::Unpowered(Device::LoadCell)) => Some(WiringFault::Unpowered(Device::Imu)),
        Some(WiringFault::Unpowered(Device::Imu | Device::SecondImu)) => {
            Some(WiringFault::Open(Device::LoadCell))
        }
        Some(WiringFault::Open(Device::LoadCell)) => Some(WiringFault::Open(Device::Imu)),
        Some(WiringFault::Open(Device::Imu | Device::SecondImu)) => None,
    }
}

/// Returns wiring faults, from the beginning and, where a plug can come off, in the middle of the motion.
fn wiring_cases() -> Vec<Case> {
    let faults = std::iter::successors(next_wiring(None), |fault| next_wiring(Some(*fault)));
    let of = |fault: WiringFault| {
        let (name, later) = match fault {
            WiringFault::Exchanged => ("chip selects exchanged".to_owned(), false),
            WiringFault::Unpowered(device) => (format!("{device:?} without supply"), true),
            WiringFault::Open(device) => (format!("data-ready line of {device:?} open"), true),
        };
        let short = fault == WiringFault::Exchanged;
        let first = case(format!("wiring: {name}"), Place::Board, Expected::Detected, short, move |_| {
            wired(Place::Board, fault)
        });
        let middle = later.then(|| {
            disturbed(format!("wiring: {name}, in mid-run"), Expected::Detected, false, move |rig| {
                rig.wire(fault)
            })
        });
        std::iter::once(first).chain(middle)
    };
    faults.flat_map(of).collect()
}

/// Returns the flash fault after this one.
fn next_flash(before: Option<&FlashFault>) -> Option<FlashFault> {
    match before {
        None => Some(FlashFault::PowerCut { after: 0 }),
        Some(FlashFault::PowerCut { .. }) => Some(FlashFault::BitRot { bit: 0 }),
        Some(FlashFault::BitRot { .. }) => Some(FlashFault::Dead),
        Some(FlashFault::Dead) => None,
    }
}

fn case(
    name: impl Into<String>,
    place: Place,
    expected: Expected,
    short: bool,
    run: impl Fn(Extent) -> Result<Verdict, String> + Send + Sync + std::panic::RefUnwindSafe + 'static,
) -> Case {
    Case { name: name.into(), place, expected, short, restarts: false, run: std::sync::Arc::new(run) }
}

/// Makes an experiment on the emulated board with a rig that is disturbed.
fn disturbed(
    name: impl Into<String>,
    expected: Expected,
    short: bool,
    disturb: impl Fn(&mut Rig) + Send + Sync + std::panic::RefUnwindSafe + 'static,
) -> Case {
    case(name, Place::Board, expected, short, move |_| {
        experiment(Place::Board, rig(), LinkFaults::default(), &disturb)
    })
}

/// Returns sensor faults, on every channel that can have them.
fn sensor_cases() -> Vec<Case> {
    let faults = std::iter::successors(next_fault(None), |fault| next_fault(Some(fault)));
    let of = |(name, fault): (String, Fault)| {
        let short = matches!(fault, Fault::Frozen { channel: Channel::LoadCell, .. } | Fault::Knock { .. });
        // It is measured, and the gauges are divided by it.
        let divided = matches!(fault, Fault::Excitation { to, .. } if to > 0.9);
        let expected = if divided { Expected::Survived } else { Expected::Detected };
        disturbed(name, expected, short, move |rig| rig.add_fault(fault.clone()))
    };
    faults.flat_map(|fault| on_channels(&fault)).map(of).collect()
}

/// Returns faults of the load cell's converter.
fn converter_cases() -> Vec<Case> {
    vec![
        disturbed("converter: its oscillator has 8.0 and not 8.192 MHz", Expected::Detected, true, |rig| {
            rig.set_load_cell_clock_hz(8.0e6);
        }),
        disturbed("converter: a bit of a frame flips", Expected::Detected, true, |rig| {
            rig.flip_load_cell_bit(2000, 53);
        }),
        disturbed("converter: bits of many frames in a row flip", Expected::Detected, false, |rig| {
            (2000..2040).for_each(|frame| rig.flip_load_cell_bit(frame, 53));
        }),
    ]
}

/// Returns faults of the line to the host.
fn line_cases() -> Vec<Case> {
    let of = |(name, faults): (&'static str, LinkFaults)| {
        let short = name.ends_with("all of it");
        case(name, Place::Process, Expected::Survived, short, move |_| {
            experiment(Place::Process, rig(), faults, |_| {})
        })
    };
    line_faults().into_iter().map(of).collect()
}

/// Returns faults of clocks: their rates and delays are others than stated.
fn clock_cases() -> Vec<Case> {
    vec![
        case(
            "clock: the IMU's samples come at another rate",
            Place::Board,
            Expected::Survived,
            false,
            |_| {
                let config = rig().with_rates(500.0, 1000.0);
                experiment(Place::Board, config, LinkFaults::default(), |_| {})
            },
        ),
        case("clock: the IMU lags as nobody knows", Place::Board, Expected::Detected, false, |_| {
            let mut config = rig();
            config.sensors.imu.undeclared_delay_s = 0.02;
            experiment(Place::Board, config, LinkFaults::default(), |_| {})
        }),
        case("clock: the load cell lags as nobody knows", Place::Board, Expected::Detected, false, |_| {
            let mut config = rig();
            config.sensors.load_cell.undeclared_delay_s = 0.02;
            experiment(Place::Board, config, LinkFaults::default(), |_| {})
        }),
    ]
}

/// Returns faults of the processor: it is busy, or starts anew.
fn processor_cases() -> Vec<Case> {
    vec![
        case(
            "overload: every third sample comes while the processor is busy",
            Place::Board,
            Expected::Detected,
            true,
            |_| overloaded(Place::Board),
        ),
        case(
            "power: a restart in the middle of an experiment",
            Place::Board,
            Expected::Detected,
            true,
            |_| restarted(Place::Board),
        ),
    ]
}

/// Returns faults of the flash.
fn flash_cases() -> Vec<Case> {
    let faults = std::iter::successors(next_flash(None), |fault| next_flash(Some(fault)));
    let of = |fault: FlashFault| match fault {
        FlashFault::PowerCut { .. } => Case {
            restarts: true,
            ..case("power: cut at random, flash included", Place::Board, Expected::Detected, true, |extent| {
                power_cuts(Place::Board, extent)
            })
        },
        FlashFault::BitRot { .. } => {
            case("flash: bits rot", Place::Process, Expected::Detected, true, |_| bit_rot(Place::Process))
        }
        FlashFault::Dead => {
            case("flash: dead", Place::Board, Expected::Detected, true, |_| dead_flash(Place::Board, 0))
        }
    };
    faults.map(of).collect()
}

/// Returns all cases.
pub fn cases() -> Vec<Case> {
    let mut cases = vec![disturbed("none", Expected::Survived, true, |_| {})];
    cases.extend(sensor_cases());
    cases.extend(converter_cases());
    cases.extend(wiring_cases());
    cases.extend(line_cases());
    cases.extend(clock_cases());
    cases.extend(processor_cases());
    cases.extend(flash_cases());
    cases
}

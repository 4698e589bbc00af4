//! Ports A and B, external interrupts and what drives their pins: RM0090, sections 8, 9.2 and 12.

use rigident_sim::devices::Device;

use super::{Machine, US};

/// A fault between a data-ready pin and the chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EdgeFault {
    /// One edge in this many does not arrive.
    Lost(u64),
    /// Pulses of so long, ps, come in between, every so often, ps.
    Glitches { lasts: u64, every: u64 },
    /// The IMU's signal stays up, whatever is read.
    Latched,
}

/// Data-ready pins: of whom, port, number, channel of TIM2, whether they rise.
const READY: [(Device, usize, u32, usize, bool); 3] =
    [(Device::LoadCell, 0, 1, 2, false), (Device::Imu, 1, 10, 3, true), (Device::SecondImu, 0, 15, 1, true)];
/// Chip selects: of whom, port, number.
const SELECTS: [(Device, usize, u32); 3] =
    [(Device::LoadCell, 0, 4), (Device::Imu, 1, 0), (Device::SecondImu, 1, 1)];

#[derive(Clone, Copy, Default)]
struct Port {
    mode: u32,
    speed: u32,
    pull: u32,
    output: u32,
    function: [u32; 2],
}

#[derive(Default)]
pub struct Pins {
    ports: [Port; 2],
    routing: [u32; 4],
    masks: u32,
    rising: u32,
    falling: u32,
    pending: u32,
    /// The fault of each sensor, with its beginning and end, ps.
    pub faults: Vec<(Device, EdgeFault, u64, u64)>,
    /// The IMUs' signals as they were last.
    up: [bool; 3],
    next_glitch: u64,
    /// Edges that left each sensor, and those that a fault kept from the chip.
    edges: [u64; 3],
    kept_away: [u64; 3],
    /// Edges of each sensor that reached the chip while a run was on.
    pub edges_of_run: [u64; 3],
    counted: [u64; 3],
    selected: [bool; 3],
}

impl Pins {
    pub(super) fn reset(&mut self) {
        self.reset_ports(3);
        self.reset_routing();
        (self.masks, self.rising, self.falling, self.pending) = (0, 0, 0, 0);
    }

    pub(super) fn reset_ports(&mut self, which: u32) {
        for (k, port) in self.ports.iter_mut().enumerate() {
            if which >> k & 1 != 0 {
                *port = Port::default();
            }
        }
    }

    pub(super) fn reset_routing(&mut self) {
        self.routing = [0; 4];
    }

    /// Returns true if a pin belongs to a peripheral, by the number of its function.
    pub(super) fn is_peripheral(&self, port: usize, number: u32, function: u32) -> bool {
        let port = &self.ports[port];
        let four = port.function[number as usize / 8] >> (4 * (number % 8)) & 0xf;
        port.mode >> (2 * number) & 3 == 2 && four == function
    }

    /// Returns true for line 1, and for lines 10 to 15, if they interrupt.
    pub(super) fn waiting(&self) -> [bool; 2] {
        let now = self.pending & self.masks;
        [now & 2 != 0, now & 0xfc00 != 0]
    }

    /// Receives in each turn of the program whether a run is on.
    pub fn count(&mut self, running: bool) {
        for k in 0..3 {
            let came = self.edges[k] - self.kept_away[k];
            self.edges_of_run[k] += if running { came - self.counted[k] } else { 0 };
            self.counted[k] = came;
        }
    }

    pub(super) fn next_glitch(&self) -> u64 {
        if self.faults.is_empty() { u64::MAX } else { self.next_glitch }
    }

    fn arrives(&mut self, port: usize, number: u32, rises: bool) {
        let route = self.routing[number as usize / 4] >> (4 * (number % 4)) & 0xf;
        let wanted = if rises { self.rising } else { self.falling };
        if route as usize == port && wanted & self.masks & 1 << number != 0 {
            self.pending |= 1 << number;
        }
    }

    fn fault_now(&self, device: Device, now: u64) -> impl Iterator<Item = EdgeFault> + '_ {
        let acts = move |(of, _, from, to): &&(Device, EdgeFault, u64, u64)| {
            *of == device && (*from..*to).contains(&now)
        };
        self.faults.iter().filter(acts).map(|(_, fault, ..)| *fault)
    }
}

fn index(device: Device) -> usize {
    match device {
        Device::LoadCell => 0,
        Device::Imu => 1,
        Device::SecondImu => 2,
    }
}

impl Machine {
    /// Lets a sensor signal a sample.
    pub(super) fn signal(&mut self, device: Device, at: u64) {
        let k = index(device);
        // A signal that is up already makes no edge.
        if device != Device::LoadCell && std::mem::replace(&mut self.pins.up[k], true) {
            return;
        }
        self.pins.edges[k] += 1;
        let faults: Vec<EdgeFault> = self.pins.fault_now(device, at).collect();
        for fault in faults {
            match fault {
                EdgeFault::Lost(in_so_many) if self.draw(in_so_many) == 0 => {
                    self.pins.kept_away[k] += 1;
                    return;
                }
                _ => {}
            }
        }
        self.edge(k, at, u64::MAX);
    }

    fn edge(&mut self, k: usize, at: u64, lasts: u64) {
        let (_, port, number, channel, rises) = READY[k];
        if self.pins.is_peripheral(port, number, 1) {
            self.timer.edge(channel, rises, at, lasts);
        }
        self.pins.arrives(port, number, rises);
    }

    pub(super) fn look_at_glitches(&mut self) {
        let now = self.now;
        if now >= self.pins.next_glitch {
            self.pins.next_glitch = now + 100 * US;
            for k in 0..3 {
                let faults: Vec<EdgeFault> = self.pins.fault_now(READY[k].0, now).collect();
                for fault in faults {
                    if let EdgeFault::Glitches { lasts, every } = fault
                        && self.draw(every / (100 * US)) == 0
                    {
                        self.edge(k, now, lasts);
                    }
                }
            }
        }
        // A signal that is no longer asked for goes down.
        for (device, up) in [(Device::Imu, self.rig.imu_device().signals()), (Device::SecondImu, false)] {
            let stays = self.pins.fault_now(device, now).any(|fault| fault == EdgeFault::Latched);
            self.pins.up[index(device)] &= up || stays;
        }
    }

    /// Looks at the IMU's signal, right after it was read.
    pub(super) fn look_at_signals(&mut self) {
        let stays = self.pins.fault_now(Device::Imu, self.now).any(|fault| fault == EdgeFault::Latched);
        self.pins.up[1] &= self.rig.imu_device().signals() || stays;
    }

    pub(super) fn deselect_all(&mut self) {
        for (k, (device, ..)) in SELECTS.into_iter().enumerate() {
            if std::mem::take(&mut self.pins.selected[k]) {
                self.rig.deselect(device);
            }
        }
    }

    /// Returns the device that is selected, if it is one.
    pub(super) fn selected(&self) -> Option<Device> {
        let mut selected =
            SELECTS.iter().zip(self.pins.selected).filter(|(_, on)| *on).map(|((d, ..), _)| *d);
        let first = selected.next();
        first.filter(|_| selected.next().is_none())
    }

    fn look_at_selects(&mut self) {
        for (k, (device, port, number)) in SELECTS.into_iter().enumerate() {
            let port = &self.pins.ports[port];
            // Not driven, it is pulled up from outside.
            let low = port.mode >> (2 * number) & 3 == 1 && port.output >> number & 1 == 0;
            if low == self.pins.selected[k] {
                continue;
            }
            self.pins.selected[k] = low;
            if self.spi.is_clocking() {
                self.breach("a chip select moves while bits do");
            }
            if low {
                self.rig.select(device)
            } else {
                self.rig.deselect(device)
            }
            self.look_at_signals();
            self.plan_sensors();
        }
        if self.pins.selected.iter().filter(|on| **on).count() > 1 {
            self.breach("two chips are selected");
        }
    }

    pub(super) fn read_pins(&mut self, address: usize) -> u32 {
        let (k, offset) = (address >> 10 & 1, address & 0x3ff);
        if !self.clocks.feeds(0, k as u32) {
            return 0;
        }
        let port = &self.pins.ports[k];
        match offset {
            0x00 => port.mode,
            0x08 => port.speed,
            0x0c => port.pull,
            0x14 => port.output,
            0x20 | 0x24 => port.function[(offset - 0x20) / 4],
            _ => 0,
        }
    }

    pub(super) fn write_pins(&mut self, address: usize, value: u32) {
        let (k, offset) = (address >> 10 & 1, address & 0x3ff);
        if !self.clocks.feeds(0, k as u32) {
            return self.breach("a port is written without its clock");
        }
        let port = &mut self.pins.ports[k];
        match offset {
            0x00 => port.mode = value,
            0x08 => port.speed = value,
            0x0c => port.pull = value,
            0x18 => port.output = port.output & !(value >> 16) | value & 0xffff,
            0x20 | 0x24 => port.function[(offset - 0x20) / 4] = value,
            _ => return self.breach(format!("a port's {offset:#x} is written")),
        }
        self.look_at_selects();
    }

    pub(super) fn read_edges(&mut self, address: usize) -> u32 {
        match address {
            0x4001_3808..=0x4001_3814 => self.pins.routing[(address - 0x4001_3808) / 4],
            0x4001_3c00 => self.pins.masks,
            0x4001_3c08 => self.pins.rising,
            0x4001_3c0c => self.pins.falling,
            0x4001_3c14 => self.pins.pending,
            _ => 0,
        }
    }

    pub(super) fn write_edges(&mut self, address: usize, value: u32) {
        match address {
            0x4001_3808..=0x4001_3814 if self.clocks.feeds(3, 14) => {
                self.pins.routing[(address - 0x4001_3808) / 4] = value;
            }
            0x4001_3c00 => self.pins.masks = value,
            0x4001_3c08 => self.pins.rising = value,
            0x4001_3c0c => self.pins.falling = value,
            0x4001_3c14 => self.pins.pending &= !value,
            _ => self.breach(format!("{address:#x} is written")),
        }
    }
}

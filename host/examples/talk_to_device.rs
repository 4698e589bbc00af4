//! Talks to a device: the firmware, here compiled into this process with a simulated rig behind its sensors.
//! `cargo run --release -p rigident --example talk_to_device`
//!
//! With a board on a serial port the transport is `SerialTransport::open("/dev/ttyACM0")`; the rest stays as
//! it is.

use std::error::Error;
use std::io;
use std::time::Duration;

use rigident::device::link::{Client, Transport};
use rigident::device::session::{DeviceTiming, Observer, Session, settings};
use rigident::rig::{ImuTable, LoadCellTable, RigFile};
use rigident_shared::wire::{ReadingMessage, Source};
use rigident_sim::rig::{Rig, RigConfig};
use rigident_sim::runner::{InProcess, Mcu, Pacing};

/// Any line that carries bytes both ways is a transport.
struct InThisProcess(InProcess);

impl Transport for InThisProcess {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.0.read(buffer, timeout)
    }
}

/// Counts the readings as they come.
struct Counter(usize);

impl Observer for Counter {
    fn reading(&mut self, _: &ReadingMessage) -> Result<(), String> {
        self.0 += 1;
        Ok(())
    }
}

/// Configures the device, watches half a second of its readings at rest, and returns the mean vertical force,
/// N.
pub fn weigh() -> Result<f64, Box<dyn Error>> {
    let config = RigConfig::thesis_horizontal();
    let rig = RigFile {
        imu: vec![ImuTable { rate_hz: Some(config.imu_hz), ..ImuTable::default() }],
        load_cell: LoadCellTable {
            calibration: Some(config.gauge_calibration),
            noise_n_nm: Some(config.sensors.load_cell.noise_n_nm),
            ..LoadCellTable::default()
        },
        ..RigFile::default()
    };
    let rate_hz = config.adc_hz;
    let firmware = InProcess::new(Rig::new(config)?.shared(), Pacing::RealTime);
    let mut session = Session::open(Client::new(Box::new(InThisProcess(firmware))))?;
    println!("{:?}", session.identity());
    let timing = DeviceTiming { rate_hz, is_static: false, source: Source::Sensors, host_timeout_ms: 0 };
    session.configure(&settings(&rig, &timing, None, None)?)?;
    let mut counter = Counter(0);
    let readings = session.watch(0.5, &mut counter)?;
    println!("{} readings", counter.0);
    Ok(readings.iter().map(|reading| reading.wrench.array()[2]).sum::<f64>() / readings.len() as f64)
}

/// Prints what the body weighs, the load cell's offset included.
pub fn main() -> Result<(), Box<dyn Error>> {
    println!("mean Fz {:.1} N", weigh()?);
    Ok(())
}

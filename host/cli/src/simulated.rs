//! The built-in simulated rig, as a device, a platform and a rig file.

use std::io;
use std::path::PathBuf;
use std::time::Duration;

use rigident_shared::wire::Identity;
use rigident_sim::rig::{Rig, RigConfig, SharedRig};
use rigident_sim::runner::{FrameBus, FrameGate, InProcess, PacedRig, Pacing, SensorBus};

use super::Failure;
use super::arguments::Mcu;
use super::options::microcontroller::Image;
#[cfg(feature = "emulator")]
use rigident::device::link::Client;
use rigident::device::link::{LinkError, Transport};
use rigident::device::session::tree::FrameSource;
use rigident_io::rig::{
    BodyTable, Calibrated, ImuClass, ImuTable, LoadCellClass, LoadCellTable, RecordingTable, RigFile,
    TruthTable,
};

/// A simulated microcontroller at the end of a line.
struct Simulated(Box<dyn rigident_sim::runner::Mcu>);

impl Transport for Simulated {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.0.read(buffer, timeout)
    }
}

/// The firmware on the chosen microcontroller, in lock-step with the rig.
pub(super) fn transport(mcu: Mcu, rig: &SharedRig) -> Result<Box<dyn Transport>, Failure> {
    on_rig(mcu, Image::Standard, rig)
}

fn on_rig(mcu: Mcu, image: Image, rig: &SharedRig) -> Result<Box<dyn Transport>, Failure> {
    let mcu: Box<dyn rigident_sim::runner::Mcu> = match mcu {
        Mcu::Inproc => Box::new(InProcess::new(rig.clone(), Pacing::LockStep)),
        Mcu::Qemu => emulated(image, Box::new(PacedRig::new(rig.clone(), Pacing::LockStep)))?,
    };
    Ok(Box::new(Simulated(mcu)))
}

/// The release firmware on the emulated board with this bus behind its drivers.
#[cfg(feature = "emulator")]
fn emulated(image: Image, bus: Box<dyn SensorBus>) -> Result<Box<dyn rigident_sim::runner::Mcu>, Failure> {
    use rigident_sim::runner::{Qemu, QemuOptions, firmware_elf, watch_elf};
    let elf = if image == Image::Watch { watch_elf() } else { firmware_elf() };
    Ok(Box::new(Qemu::spawn_on(&QemuOptions { elf, ..QemuOptions::default() }, bus).map_err(Failure::link)?))
}

#[cfg(not(feature = "emulator"))]
fn emulated(_: Image, _: Box<dyn SensorBus>) -> Result<Box<dyn rigident_sim::runner::Mcu>, Failure> {
    Err(Failure::input(
        "--mcu qemu: this program was built without the emulated board (feature `emulator`, Unix only); say --mcu inproc",
    ))
}

/// An image with who answers in it, and who does in this process; or why there is no answer.
pub(super) type Greeted = (PathBuf, Result<[Identity; 2], LinkError>);

/// Starts the image of the emulated board, and the firmware in this process; who answers.
///
/// # Errors
/// Why there is no image, or no emulator to start it in.
#[cfg(feature = "emulator")]
pub(super) fn greeted_image() -> Result<Greeted, String> {
    let path = rigident_sim::runner::firmware_elf();
    if !path.exists() {
        return Err(format!("no image {}", path.display()));
    }
    let greeted = |mcu: Mcu| -> Result<Result<Identity, LinkError>, String> {
        let transport = idle_rig().and_then(|rig| transport(mcu, &rig)).map_err(|e| e.to_string())?;
        Ok(Client::new(transport).hello())
    };
    let answers = greeted(Mcu::Qemu)?
        .and_then(|image| Ok([image, greeted(Mcu::Inproc).map_err(|_| LinkError::Silent("hello"))??]));
    Ok((path, answers))
}

/// Starts no image: this program was built without.
///
/// # Errors
/// Always.
#[cfg(not(feature = "emulator"))]
pub(super) fn greeted_image() -> Result<Greeted, String> {
    Err("this program was built without the emulated board (feature `emulator`, Unix only)".to_owned())
}

/// The firmware that a recording is sent to, on the microcontroller of this name; `None` if the name is not one of a
/// simulated one.
pub(super) fn named(mcu: &str, image: Image) -> Result<Option<super::link::NamedTransport>, Failure> {
    let mcu = match mcu {
        "inproc" => Mcu::Inproc,
        "qemu" => Mcu::Qemu,
        _ => return Ok(None),
    };
    Ok(Some((name(mcu), on_rig(mcu, image, &idle_rig()?)?)))
}

/// The firmware on the chosen microcontroller, fed with frames over the lock-step bus, and who lets them go.
pub(super) fn frames(
    mcu: Mcu,
    frames: Vec<Vec<u8>>,
    rate_hz: f64,
) -> Result<(Box<dyn Transport>, Gate), Failure> {
    let (bus, gate) = FrameBus::new(frames, rate_hz);
    let mcu: Box<dyn rigident_sim::runner::Mcu> = match mcu {
        Mcu::Inproc => Box::new(InProcess::on(Box::new(bus))),
        Mcu::Qemu => emulated(Image::Standard, Box::new(bus))?,
    };
    Ok((Box::new(Simulated(mcu)), Gate(gate)))
}

/// Lets frames go.
pub(super) struct Gate(FrameGate);

impl FrameSource for Gate {
    fn set_open(&self, open: bool) {
        self.0.set_open(open);
    }

    fn is_done(&self) -> bool {
        self.0.is_done()
    }
}

/// Returns what the command line calls it.
pub(super) fn name(mcu: Mcu) -> &'static str {
    match mcu {
        Mcu::Inproc => "inproc",
        Mcu::Qemu => "qemu",
    }
}

/// A rig that nothing is asked of: for a firmware that is fed a recording.
fn idle_rig() -> Result<SharedRig, Failure> {
    Rig::new(RigConfig::thesis_horizontal()).map(Rig::shared).map_err(Failure::input)
}

/// Returns what a user would have written into the rig file of this rig.
pub(super) fn rig_file(rig: &Rig, body_name: &str) -> RigFile {
    let config = rig.config();
    let (cell, imu) = (&config.sensors.load_cell, &config.sensors.imu);
    let truth = rig.truth();
    let positive = |v: f64| (v > 0.0 && v.is_finite()).then_some(v);
    // Noise that is switched off still leaves the converter's: without σ it is estimated from the residuals.
    let noise = cell.noise_n_nm.iter().all(|v| *v > 0.0).then_some(cell.noise_n_nm);
    RigFile {
        recording: RecordingTable {
            rate_hz: Some(config.adc_hz),
            gravity_mps2: config.gravity_mps2,
            ..RecordingTable::default()
        },
        imu: vec![ImuTable {
            position_m: config.imu.position_m,
            rotation_wxyz: normalised(config.imu.rotation_wxyz),
            accel_scale: Calibrated::Numbers([1.0; 3]),
            group_delay_s: config.imu_group_delay_s(),
            rate_hz: Some(config.imu_hz),
            range_mps2: positive(imu.accel_range_mps2),
            range_radps: positive(imu.gyro_range_radps),
            accel_noise_mps2: positive(imu.accel_noise_mps2.iter().copied().fold(0.0, f64::max)),
            gyro_noise_radps: positive(imu.gyro_noise_radps.iter().copied().fold(0.0, f64::max)),
            class: Some(ImuClass::Exact),
            serial: Some("simulated".to_owned()),
            ..ImuTable::default()
        }],
        load_cell: LoadCellTable {
            noise_n_nm: noise,
            class: Some(LoadCellClass::Exact),
            gain_uncertainty: cell
                .gain_error
                .spread
                .iter()
                .any(|s| *s > 0.0)
                .then_some(cell.gain_error.spread),
            calibration: Some(config.gauge_calibration),
            group_delay_s: config.load_cell_group_delay_s(),
            range_n_nm: cell.range_n_nm.iter().all(|v| v.is_finite()).then_some(cell.range_n_nm),
            serial: Some("simulated".to_owned()),
            ..LoadCellTable::default()
        },
        // A customer's frame that is not S, so that the difference can be seen.
        body: Some(BodyTable {
            name: body_name.to_owned(),
            position_m: [0.0, 0.0, 0.02],
            rotation_wxyz: [std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2],
        }),
        truth: Some(TruthTable {
            mass_kg: truth.body.mass_kg,
            com_m: truth.body.com_m,
            inertia_com_kgm2: truth.body.inertia_com_kgm2,
            apparent_offset_n_nm: Some(truth.apparent_offset_n_nm),
        }),
        ..RigFile::default()
    }
}

pub(super) fn normalised(q: [f64; 4]) -> [f64; 4] {
    let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    q.map(|v| v / norm)
}

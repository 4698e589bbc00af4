//! The release firmware on the emulated Cortex-M4F, against the same firmware in this process.

use std::time::{Duration, Instant};

use super::device::{Device, settings};
use hexapod::experiment::thesis_program;
use rigident_shared::wire::{MemorySettings, Settings, StateName};
use rigident_sim::rig::{Rig, RigConfig, SharedRig};
use rigident_sim::runner::{InProcess, Mcu, Pacing, Qemu, QemuOptions, SensorBus};

const PATIENCE: Duration = Duration::from_secs(60);

fn rig() -> SharedRig {
    Rig::new(RigConfig::thesis_horizontal()).unwrap().shared()
}

/// Starts the emulator. The message says what to type if the emulator or the firmware is missing.
fn emulate(rig: &SharedRig) -> Qemu {
    Qemu::spawn(&QemuOptions::default(), rig.clone(), Pacing::LockStep).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
#[ignore = "needs the emulated board"]
fn the_emulated_processor_gives_the_same_bits_as_this_one() {
    gives_the_same_bits(MemorySettings::Forever);
}

#[test]
#[ignore = "needs the emulated board"]
fn the_emulated_processor_forgets_the_same_bits() {
    gives_the_same_bits(MemorySettings::Forgetting {
        time_constant_s: 4.0,
        accel_noise_mps2: 0.02,
        gyro_noise_radps: 1.9e-3,
    });
}

#[test]
#[ignore = "needs the emulated board"]
fn the_emulated_processor_s_window_holds_the_same_bits() {
    gives_the_same_bits(MemorySettings::Window { length_s: 6.0 });
}

fn gives_the_same_bits(memory: MemorySettings) {
    let run = |mcu: &mut dyn Mcu, rig: &SharedRig| {
        let config = RigConfig::thesis_horizontal();
        let program = thesis_program(&config.geometry, 20.0);
        let mut device = Device::greet(mcu);
        let mut settings = Settings { memory, ..settings(&config) };
        // Larger than that of the simulated one, so that it counts.
        (settings.imu.accel_noise_mps2, settings.imu.gyro_noise_radps) = (0.2, 5e-3);
        device.run(rig, &settings, &program);
        let factor: Vec<u32> = device.factor().iter().map(|v| v.to_bits()).collect();
        let counters = device.counters();
        assert_eq!((counters.telemetry_dropped, counters.bad_frames), (0, 0));
        assert!(counters.blocks > 1900 && device.estimates > 70, "{counters:?} {}", device.estimates);
        let bits = |r: &rigident_shared::wire::ReadingMessage| {
            (
                r.time_ns,
                r.wrench.map(f32::to_bits),
                r.specific_force.map(f32::to_bits),
                r.angular_rate.map(f32::to_bits),
            )
        };
        let readings: Vec<_> = device.readings.iter().map(bits).collect();
        (readings, factor, counters)
    };
    let here = rig();
    let (readings, factor, counters) = run(&mut InProcess::new(here.clone(), Pacing::LockStep), &here);
    assert!(readings.len() > 19_900);
    assert_eq!(factor.len(), 16 * 19 / 2 + 1);
    let there = rig();
    let mut qemu = emulate(&there);
    let (emulated_readings, emulated_factor, emulated_counters) = run(&mut qemu, &there);
    for (k, (ours, theirs)) in readings.iter().zip(&emulated_readings).enumerate() {
        assert_eq!(ours, theirs, "reading {k}");
    }
    assert_eq!(readings.len(), emulated_readings.len());
    assert_eq!(factor, emulated_factor);
    assert_eq!(counters, emulated_counters);
    let stack = qemu.finish(PATIENCE).unwrap().expect("the firmware reports its stack");
    assert!(stack.used > 0 && stack.used < stack.size, "{stack:?}");
    // What was used is below what `cargo xtask size` says can be used.
    let golden = concat!(env!("CARGO_MANIFEST_DIR"), "/../xtask/golden/size.json");
    let sizes: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(golden).unwrap()).unwrap();
    let bound = sizes["whole"]["worst_stack_bytes"].as_u64().unwrap();
    assert!(stack.used as u64 <= bound, "{stack:?}, bound {bound}");
}

#[test]
#[ignore = "needs the emulated board"]
fn one_flipped_bit_in_an_adc_frame_raises_the_crc_counter_by_exactly_one() {
    let config = RigConfig::thesis_horizontal();
    let program = thesis_program(&config.geometry, 20.0);
    let rig = rig();
    let mut qemu = emulate(&rig);
    let mut device = Device::greet(&mut qemu);
    // Some hundred frames into the run, a bit of the second channel's word.
    rig.lock().unwrap().flip_load_cell_bit(500, 2 * 24 + 5);
    device.run(&rig, &settings(&config), &program);
    let counters = device.counters();
    assert_eq!(counters.load_cell_crc_errors, 1, "{counters:?}");
    assert_eq!(counters.gaps, 1, "{counters:?}");
    assert!(!device.states.contains(&StateName::Fault));
}

#[test]
#[ignore = "needs the emulated board"]
fn many_kilobytes_pass_the_serial_port_whole_in_both_directions() {
    use rigident_shared::wire::{Command, Reply};
    let rig = rig();
    let mut qemu = emulate(&rig);
    let mut device = Device::greet(&mut qemu);
    let settings = settings(&RigConfig::thesis_horizontal());
    assert_eq!(device.ask(&Command::Configure(settings.clone())), Ok(Reply::Done));
    // Each way some 400 bytes, checked by the frame's CRC and by the settings themselves.
    for _ in 0..100 {
        assert_eq!(device.ask(&Command::Configure(settings.clone())), Ok(Reply::Done));
        assert_eq!(device.ask(&Command::ReadSettings), Ok(Reply::Settings(settings.clone())));
    }
    assert_eq!(device.counters().bad_frames, 0);
}

#[test]
#[ignore = "needs the emulated board"]
fn a_killed_emulator_is_reported_and_does_not_hang() {
    let rig = rig();
    let mut qemu = emulate(&rig);
    Device::greet(&mut qemu);
    let killed = std::process::Command::new("kill").args(["-9", &qemu.process_id().to_string()]).status();
    assert!(killed.unwrap().success());
    let deadline = Instant::now() + PATIENCE;
    let error = loop {
        assert!(Instant::now() < deadline, "reads go on as if nothing had happened");
        if let Err(e) = qemu.read(&mut [0; 64], Duration::from_secs(1)) {
            break e;
        }
    };
    assert_eq!(error.kind(), std::io::ErrorKind::BrokenPipe);
    assert!(error.to_string().contains("signal 9"), "{error}");
    assert_eq!(qemu.write(b"x").unwrap_err().kind(), std::io::ErrorKind::BrokenPipe);
}

/// A bus that panics when it is asked: the pipes close.
struct Broken;

impl SensorBus for Broken {
    fn poll(&mut self) -> rigident_shared::wire::bus::PollAnswer {
        panic!("as the test wants it")
    }
    fn transfer_load_cell(&mut self, _: &mut [u8]) {}
    fn transfer_imu(&mut self, _: &mut [u8]) {}
}

#[test]
#[ignore = "needs the emulated board"]
fn a_bus_that_breaks_ends_the_firmware_with_its_reason() {
    let mut qemu =
        Qemu::spawn_on(&QemuOptions::default(), Box::new(Broken)).unwrap_or_else(|e| panic!("{e}"));
    let deadline = Instant::now() + PATIENCE;
    let error = loop {
        assert!(Instant::now() < deadline, "the firmware goes on without its sensors");
        if let Err(e) = qemu.read(&mut [0; 64], Duration::from_secs(1)) {
            break e;
        }
    };
    let text = error.to_string();
    assert!(text.contains("exit status 103") && text.contains("sensor bus is gone"), "{text}");
}

#[test]
#[ignore = "needs the emulated board"]
fn missing_parts_are_named_with_the_command_to_type() {
    let message = |options: QemuOptions| match Qemu::spawn(&options, rig(), Pacing::LockStep) {
        Ok(_) => panic!("it started"),
        Err(e) => e.to_string(),
    };
    let no_firmware = QemuOptions { elf: "/nowhere/firmware".into(), ..QemuOptions::default() };
    assert!(message(no_firmware).contains("cargo xtask firmware"));
    let no_emulator = QemuOptions { program: "/nowhere/qemu".into(), ..QemuOptions::default() };
    assert!(message(no_emulator).contains("apt-get install qemu-system-arm"));
    let not_firmware = QemuOptions { elf: std::env::current_exe().unwrap(), ..QemuOptions::default() };
    assert!(message(not_firmware).contains("not a firmware image"));
}

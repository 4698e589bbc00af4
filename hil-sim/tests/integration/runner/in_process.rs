//! The firmware in this process, on the simulated rig.

use std::time::{Duration, Instant};

use super::device::{Device, settings};
use hexapod::experiment::thesis_program;
use rigident_shared::wire::{Command, Reason, Reply, StateName};
use rigident_sim::rig::{Rig, RigConfig, SharedRig};
use rigident_sim::runner::{InProcess, Pacing};

fn rig() -> (RigConfig, SharedRig) {
    let config = RigConfig::thesis_horizontal();
    (config.clone(), Rig::new(config).unwrap().shared())
}

#[test]
fn in_lock_step_time_moves_only_with_the_program() {
    let (config, rig) = rig();
    let mut mcu = InProcess::new(rig.clone(), Pacing::LockStep);
    let mut device = Device::greet(&mut mcu);
    assert_eq!(device.ask(&Command::Configure(settings(&config))), Ok(Reply::Done));
    for _ in 0..20 {
        device.listen(Duration::from_millis(1));
    }
    assert_eq!(rig.lock().unwrap().now_ns(), 0);
    assert!(device.readings.is_empty());
    let program = thesis_program(&config.geometry, 20.0);
    device.run(&rig, &settings(&config), &program);
    let moved_s = rig.lock().unwrap().now_ns() as f64 * 1e-9;
    assert!((moved_s - program.duration_s()).abs() < 1e-6, "{moved_s}");
}

#[test]
fn in_real_time_samples_come_at_their_rate_whether_or_not_the_plate_moves() {
    let (config, rig) = rig();
    let mut mcu = InProcess::new(rig.clone(), Pacing::RealTime);
    let mut device = Device::greet(&mut mcu);
    assert_eq!(device.ask(&Command::Configure(settings(&config))), Ok(Reply::Done));
    let (begun, before) = (Instant::now(), device.readings.len());
    // By the rig's clock and not by ours, which a loaded machine may stop.
    let until = rig.lock().unwrap().now_ns() + 500_000_000;
    while rig.lock().unwrap().now_ns() < until {
        device.listen(Duration::from_millis(5));
    }
    assert!(begun.elapsed() >= Duration::from_millis(490));
    let came = device.readings.len() - before;
    // A batch of eight may be under way at either end, and the filters' delays.
    assert!(came.abs_diff(500) <= 30 || begun.elapsed() > Duration::from_millis(600), "{came}");
    let steps = device.readings.windows(2).map(|w| w[1].time_ns - w[0].time_ns);
    assert!(steps.clone().all(|step| step == 1_000_000), "{:?}", steps.max());
}

#[test]
fn a_quiet_host_is_noticed_and_reported() {
    let (config, rig) = rig();
    let mut mcu = InProcess::new(rig.clone(), Pacing::LockStep);
    let mut device = Device::greet(&mut mcu);
    let mut settings = settings(&config);
    settings.host_timeout_ms = 1_500;
    assert_eq!(device.ask(&Command::Configure(settings)), Ok(Reply::Done));
    device.hold(&rig, 4.0);
    while !rig.lock().unwrap().is_done() {
        device.listen(Duration::from_millis(20));
    }
    device.listen(Duration::from_millis(1));
    assert_eq!(device.states.last(), Some(&StateName::Holding));
    match device.ask(&Command::Hello) {
        Ok(Reply::Hello(who)) => assert_eq!(who.reason, Reason::HostQuiet),
        other => panic!("{other:?}"),
    }
    let readings = device.counters().readings;
    assert!(readings.abs_diff(1_500) <= 20, "{readings}");
}

#[test]
fn a_minute_of_rig_time_takes_less_than_three_seconds() {
    let (config, rig) = rig();
    let mut mcu = InProcess::new(rig.clone(), Pacing::LockStep);
    let mut device = Device::greet(&mut mcu);
    let program = thesis_program(&config.geometry, 60.0);
    // The processor's time: what others do on this machine is not ours.
    let begun = processor_s();
    device.run(&rig, &settings(&config), &program);
    let took = processor_s() - begun;
    assert!(took < 3.0, "{took} s");
    assert!(device.readings.len() > 59_900);
}

/// Returns the processor time of this thread so far, s: user and system ticks of 1/100 s.
fn processor_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/thread-self/stat").unwrap();
    // The name in parentheses may hold spaces; the counts are the 12th and 13th fields behind it.
    let fields: Vec<&str> = stat.rsplit_once(')').unwrap().1.split_whitespace().collect();
    (fields[11].parse::<f64>().unwrap() + fields[12].parse::<f64>().unwrap()) / 100.0
}

//! The faults of a converter and its gauges without a word: the device says it, or makes up for it.

use std::time::Duration;

use super::device::{Device, settings};
use rigident_shared::wire::{
    Command, CounterReport, ReadingMessage, Reason, Reply, SensorFault, Settings, StateName,
};
use rigident_sim::rig::{EXCITATION_V, Rig, RigConfig};
use rigident_sim::runner::{InProcess, Pacing};
use rigident_sim::sensors::{Fault, SensorModels};

/// GAIN1 of the converter.
const GAIN1: usize = 0x04;

/// The messages of a device at rest for four seconds.
struct Said {
    readings: Vec<ReadingMessage>,
    counters: CounterReport,
    reason: Reason,
    state: StateName,
}

/// Runs four seconds at rest without noise; `happens` to the rig before, and `later` after two of them.
fn rest(change: impl Fn(&mut Settings), happens: impl Fn(&mut Rig), later: impl Fn(&mut Rig)) -> Said {
    let config = RigConfig::thesis_horizontal().with_sensors(SensorModels::ideal());
    let rig = Rig::new(config.clone()).unwrap().shared();
    let mut mcu = InProcess::new(rig.clone(), Pacing::LockStep);
    let mut device = Device::greet(&mut mcu);
    let mut settings = settings(&config);
    settings.load_cell.noise_n_nm = [1.0; 6];
    settings.frozen_after = 0;
    change(&mut settings);
    happens(&mut rig.lock().unwrap());
    assert_eq!(device.ask(&Command::Configure(settings)), Ok(Reply::Done));
    device.hold(&rig, 4.0);
    let mut later = Some(later);
    while !rig.lock().unwrap().is_done() {
        if rig.lock().unwrap().now_ns() > 2_000_000_000
            && let Some(later) = later.take()
        {
            later(&mut rig.lock().unwrap());
        }
        device.listen(Duration::from_millis(20));
    }
    let counters = device.counters();
    let Ok(Reply::Hello(who)) = device.ask(&Command::Hello) else { panic!("no hello") };
    Said { readings: std::mem::take(&mut device.readings), counters, reason: who.reason, state: who.state }
}

fn nothing(_: &mut Rig) {}

/// A logic regulator that drifts by 1 % is 1 % of every mass, unless the gauges are divided by what it gives
/// them.
#[test]
fn an_excitation_that_drifts_is_divided_out_where_it_is_measured() {
    let drifts = |rig: &mut Rig| rig.add_fault(Fault::Excitation { to: 0.99, during: 1.0..3.0 });
    let measures = |settings: &mut Settings| settings.load_cell.excitation_v = Some(EXCITATION_V as f32);
    let truth = rest(|_| {}, nothing, nothing);
    let blind = rest(|_| {}, drifts, nothing);
    let ratiometric = rest(measures, drifts, nothing);
    let weight = |said: &Said| said.readings.last().unwrap().wrench[2];
    let error = |said: &Said| f64::from(weight(said) / weight(&truth)) - 1.0;
    assert!((error(&blind) + 0.01).abs() < 1e-5, "{}", error(&blind));
    assert!(error(&ratiometric).abs() < 2e-6, "{}", error(&ratiometric));
    assert_eq!(ratiometric.readings.len(), truth.readings.len());
}

#[test]
fn gauges_without_their_excitation_give_no_reading_and_say_so() {
    let off = |rig: &mut Rig| rig.add_fault(Fault::Excitation { to: 0.0, during: 1.999..2.0 });
    let said = rest(|s| s.load_cell.excitation_v = Some(EXCITATION_V as f32), nothing, off);
    assert_eq!((said.state, said.reason), (StateName::Fault, Reason::LoadCell(SensorFault::Excitation)));
    assert_eq!(said.counters.without_excitation, 10);
    let [first, .., last] = said.readings.as_slice() else { panic!("no readings") };
    assert!((last.wrench[2] / first.wrench[2] - 1.0).abs() < 1e-5);
}

/// 8.0 for 8.192 MHz would be 2.4 % of every inertia.
#[test]
fn a_converter_with_another_oscillator_is_found_within_a_second_and_a_good_one_is_measured() {
    let said = rest(|_| {}, |rig| rig.set_load_cell_clock_hz(8.0e6), nothing);
    assert_eq!((said.state, said.reason), (StateName::Fault, Reason::LoadCell(SensorFault::Rate)));
    let ppm = said.counters.rate_error_ppm[0].unwrap();
    assert!((ppm + 23_438).abs() <= 2, "{ppm}");
    assert!(said.readings.len() < 1_010, "{}", said.readings.len());
    let said = rest(|_| {}, |rig| rig.set_load_cell_clock_hz(8.192e6 * (1.0 + 80e-6)), nothing);
    assert_eq!(said.state, StateName::Running);
    let [Some(cell), Some(imu), None] = said.counters.rate_error_ppm else { panic!("{:?}", said.counters) };
    assert!((cell - 80).abs() <= 2 && imu.abs() <= 2, "{cell} {imu}");
}

#[test]
fn a_gain_that_changes_by_itself_ends_the_run_before_its_first_sample_counts() {
    let said = rest(|_| {}, nothing, |rig| rig.disturb_load_cell_register(GAIN1, 0x0010));
    assert_eq!((said.state, said.reason), (StateName::Fault, Reason::LoadCell(SensorFault::Verify)));
    let first = said.readings.first().unwrap().wrench;
    let others = said.readings.iter().map(|reading| reading.wrench);
    assert!(others.flat_map(|w| (0..6).map(move |k| (w[k] - first[k]).abs())).all(|change| change < 0.01));
}

#[test]
fn a_pulse_on_the_sync_pin_costs_a_sample_and_is_counted() {
    let undisturbed = rest(|_| {}, nothing, nothing);
    let said = rest(|_| {}, nothing, Rig::resynchronise_load_cell);
    assert_eq!((said.state, said.counters.load_cell_resyncs), (StateName::Running, 1));
    assert_eq!(said.counters.readings + 1, undisturbed.counters.readings);
}

/// A device in a process has nothing that could start it anew, and says so.
#[test]
fn a_restart_is_refused_where_there_is_none() {
    let config = RigConfig::thesis_horizontal();
    let rig = Rig::new(config).unwrap().shared();
    let mut mcu = InProcess::new(rig, Pacing::LockStep);
    let mut device = Device::greet(&mut mcu);
    assert_eq!(device.ask(&Command::Restart), Err(rigident_shared::wire::ErrorCode::NotBuiltIn));
}

//! The sources of a monitor: a recording as it is written, or a device.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use std::time::{Duration, Instant, SystemTime};

use rigident_shared::wire::Settings;

use super::{GrowingView, Listener, NAP, answered};
use crate::application::{Caller, Loaded, Tree};
use rigident_device::ports;
use rigident_device::session::Session;
use rigident_device::words;
use rigident_io::recording::extension;
use rigident_io::recording::mcap::container::MAGIC;
use rigident_io::rig::{Calibrated, ImuTable, OffsetTable, OffsetWord, RigFile};
use rigident_rows::tree::ProblemOptions;

/// A port that vanished is tried again this often.
const TRY_EVERY: Duration = Duration::from_secs(1);

/// A file, as far as it is written.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Written {
    length: u64,
    at: Option<SystemTime>,
}

fn written(path: &Path) -> Option<Written> {
    let metadata = std::fs::metadata(path).ok()?;
    Some(Written { length: metadata.len(), at: metadata.modified().ok() })
}

/// Returns true if a recording was ended by who wrote it; of a CSV nobody knows.
fn is_finished(path: &Path) -> bool {
    let last = || -> std::io::Result<bool> {
        let mut file = File::open(path)?;
        file.seek(SeekFrom::End(-(MAGIC.len() as i64)))?;
        let mut bytes = [0; MAGIC.len()];
        file.read_exact(&mut bytes)?;
        // A file of nothing but its head ends with the same.
        Ok(bytes == MAGIC && file.stream_position()? > MAGIC.len() as u64)
    };
    extension(path) == "mcap" && last().unwrap_or(false)
}

/// Follows a recording, until it is left or, `once`, has been read.
pub fn follow(path: &Path, rig: Option<&Path>, once: bool, watch: &GrowingView, caller: &Caller<'_>) {
    let (mut seen, mut cost) = (None, Duration::ZERO);
    while !watch.is_left() {
        let now = written(path);
        if now == seen || now.is_none() {
            let phase = if is_finished(path) { "finished" } else { "waits for more" };
            watch.change(|view| phase.clone_into(&mut view.phase));
            if once {
                break;
            }
            std::thread::sleep(NAP.max(cost * 3));
            continue;
        }
        let started = Instant::now();
        seen = now;
        watch.change(|view| "reading".clone_into(&mut view.phase));
        let options = ProblemOptions::default();
        let read = Loaded::read(path, rig, None, &Tree::default(), &options, caller);
        watch.answer(read.and_then(|loaded| {
            tell_samples(&loaded, watch);
            answered(&loaded)
        }));
        cost = started.elapsed();
    }
    watch.end();
}

/// Tells how much there is of a recording, and how fast it was taken.
fn tell_samples(loaded: &Loaded, watch: &GrowingView) {
    let source = loaded.source();
    let samples = source.samples();
    let at = |sample: usize| source.time_ns(sample) as f64 * 1e-9;
    let elapsed_s = if samples > 1 { at(samples - 1) - at(0) } else { 0.0 };
    watch.change(|view| {
        (view.elapsed_s, view.sensors.readings) = (elapsed_s, samples as u64);
        view.sensors.rate_hz = (elapsed_s > 0.0).then(|| (samples - 1) as f64 / elapsed_s);
    });
}

/// Hears a device until it is left. A port that vanishes is waited for.
pub fn hear(port: &str, session: Session, watch: &GrowingView) {
    let mut session = Some(session);
    while !watch.is_left() {
        let Some(mut open) = session.take() else {
            std::thread::sleep(TRY_EVERY);
            match ports::open(port).and_then(|mut open| Ok(open.held_settings().map(|_| open)?)) {
                Ok(open) => session = Some(open),
                Err(why) => watch.change(|view| view.trouble = Some(format!("{why} It is tried again"))),
            }
            continue;
        };
        let (state, reason) = (open.identity().state, open.identity().reason);
        watch.change(|view| (view.phase, view.trouble) = (words::phase(state, reason), None));
        if let Err(why) = open.attend(&|| watch.is_left(), &mut Listener::new(watch, false)) {
            watch.change(|view| {
                "not heard".clone_into(&mut view.phase);
                view.trouble = Some(why.to_string());
            });
        }
    }
    watch.end();
}

/// Returns a rig file of the settings given to a device; of those not given nothing is assumed to be known
/// well.
pub fn rig_of(settings: &Settings) -> RigFile {
    let mut rig = RigFile::default();
    let (imu, cell) = (&settings.imu, &settings.load_cell);
    let wide = |values: [f32; 3]| values.map(f64::from);
    // What represents none.
    let finite = |v: f32| (v < 1e8).then_some(f64::from(v));
    let positive = |v: f32| (v > 0.0).then_some(f64::from(v));
    rig.recording.rate_hz = Some(f64::from(settings.rate_hz));
    rig.imu = vec![ImuTable {
        position_m: wide(imu.position_m),
        rotation_wxyz: imu.rotation_wxyz.map(f64::from),
        accel_scale: Calibrated::Numbers(wide(imu.accel_scale)),
        accel_bias_mps2: Calibrated::Numbers(wide(imu.accel_bias_mps2)),
        gyro_bias_radps: Calibrated::Numbers(wide(imu.gyro_bias_radps)),
        accel_noise_mps2: positive(imu.accel_noise_mps2),
        gyro_noise_radps: positive(imu.gyro_noise_radps),
        rate_hz: Some(f64::from(imu.rate_hz)),
        range_mps2: finite(imu.range_mps2),
        range_radps: finite(imu.range_radps),
        ..ImuTable::default()
    }];
    rig.load_cell.noise_n_nm = Some(cell.noise_n_nm.map(f64::from));
    rig.load_cell.range_n_nm =
        cell.range_n_nm.iter().all(|v| finite(*v).is_some()).then(|| cell.range_n_nm.map(f64::from));
    rig.load_cell.offset_n_nm = match cell.known_offset_n_nm {
        Some(offset) => OffsetTable::Known(offset.map(f64::from)),
        None => OffsetTable::Word(OffsetWord::Estimate),
    };
    rig
}

#[cfg(test)]
mod tests {
    use rigident_shared::wire::Source;

    use super::*;
    use rigident_device::session::{DeviceTiming, settings};

    #[test]
    fn settings_of_a_device_make_the_same_settings_again() {
        let mut rig = RigFile::default();
        rig.recording.rate_hz = Some(500.0);
        rig.load_cell.noise_n_nm = Some([0.1, 0.1, 0.2, 0.01, 0.01, 0.01]);
        rig.load_cell.offset_n_nm = OffsetTable::Known([1.0, 2.0, 3.0, 0.1, 0.2, 0.3]);
        rig.imu =
            vec![ImuTable { position_m: [0.1, 0.0, -0.05], range_radps: Some(8.5), ..ImuTable::default() }];
        let timing =
            DeviceTiming { rate_hz: 500.0, is_static: false, source: Source::Injected, host_timeout_ms: 0 };
        let given = settings(&rig, &timing, None, None).unwrap();
        let again = settings(&rig_of(&given), &timing, None, None).unwrap();
        assert_eq!(again, given);
    }

    #[test]
    fn a_file_of_a_writer_that_still_writes_is_not_finished() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("a.mcap");
        std::fs::write(&path, MAGIC).unwrap();
        assert!(!is_finished(&path));
        std::fs::write(&path, [MAGIC, MAGIC].concat()).unwrap();
        assert!(is_finished(&path) && !is_finished(&place.path().join("none.mcap")));
    }
}

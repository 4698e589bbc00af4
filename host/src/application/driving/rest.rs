//! The sensors at rest: their zero and their noise, and whether the plate moves.

use std::sync::atomic::Ordering;
use std::time::Instant;

use rigident_shared::calibration::Reading;
use rigident_shared::forgetting::{ImuNoise, MemoryConfig, Span};
use rigident_shared::spatial::{AngularRate, SpecificForce};
use rigident_shared::wire::Settings;

use super::super::Error;
use super::super::device::{configure, device_settings};
use super::{Attendant, DrivingError};
use rigident_device::session::{
    DeviceTiming, INTERRUPTED, Session, precision, state_imu_noise, state_memory, widen,
};
use rigident_io::rig::{Calibrated, ImuTable, RigFile};
use rigident_rows::body::imu_noise::{imu_noise, white_imu_noise};
use rigident_rows::body::prepare::mounting;

/// Length of one check of the sensors at rest, s.
const WINDOW_S: f64 = 2.0;
/// A plate that moves is examined this often before nothing comes of it.
const LOOKS: usize = 6;
/// The gyro's mean over a quarter of a second may wander by this much at rest, rad/s, and the
/// accelerometer's, m/s².
const CHANGE_RADPS: f64 = 0.01;
const CHANGE_MPS2: f64 = 0.05;
/// The range of eight means of noise is wider than this many of their standard deviations once in two
/// million.
const CHANCE_SD: f64 = 8.0;

/// The sensors at rest.
#[derive(Clone, Debug)]
pub struct Rest {
    /// Mean wrench, N and N m.
    pub wrench: [f64; 6],
    /// 1 σ of its readings.
    pub sigma: [f64; 6],
    /// Mean angular rate, rad/s.
    pub angular_rate: [f64; 3],
    /// In the IMU's axes, m/s².
    pub(super) specific_force: [f64; 3],
    /// Noise of the IMU that forgetting counts with.
    pub imu_noise: ImuNoise<f64>,
    /// Noise of the IMU that rows are weighed by: as stated, else as found at rest.
    pub white_imu_noise: ImuNoise<f64>,
    /// The number of readings.
    pub(super) readings: usize,
    /// The evidence that the plate moves, if anything does.
    pub(super) moving: Option<String>,
}

impl Rest {
    /// Returns the settings of a run that begins from here: noise as it was found, and how fast the run
    /// forgets.
    ///
    /// # Errors
    /// Bad input: what the rig file lacks, or more links than the device takes from sensors.
    pub fn settings(
        &self,
        rig: &RigFile,
        timing: &DeviceTiming,
        span: Option<Span<f64>>,
    ) -> Result<Settings, Error> {
        let mut settings = device_settings(rig, timing, Some(self.sigma))?;
        state_imu_noise(&mut settings, &self.white_imu_noise);
        let memory = span.map(|span| MemoryConfig { span, imu_noise: self.imu_noise });
        state_memory(&mut settings, memory.as_ref());
        Ok(settings)
    }

    /// Returns what a recording says of the zero.
    pub fn comments(&self) -> [(String, String); 2] {
        [
            ("zero, mean wrench at rest".to_owned(), format!("{:?} N, N m", self.wrench)),
            ("zero, mean angular rate at rest".to_owned(), format!("{:?} rad/s", self.angular_rate)),
        ]
    }
}

/// Returns what readings at rest say.
///
/// # Errors
/// [`DrivingError::Silent`]: there are next to none.
pub fn at_rest(readings: &[Reading<f64>], imu: Option<&ImuTable>) -> Result<Rest, DrivingError> {
    let n = readings.len() as f64;
    if readings.len() < 10 {
        return Err(DrivingError::Silent);
    }
    let imu_noise = imu_noise(imu, readings);
    let mean = |f: &dyn Fn(&Reading<f64>) -> f64| readings.iter().map(f).sum::<f64>() / n;
    let wrench: [f64; 6] = std::array::from_fn(|c| mean(&|r| r.wrench.array()[c]));
    Ok(Rest {
        wrench,
        sigma: std::array::from_fn(|c| {
            (mean(&|r| (r.wrench.array()[c] - wrench[c]).powi(2)) * n / (n - 1.0)).sqrt()
        }),
        angular_rate: std::array::from_fn(|c| mean(&|r| r.angular_rate.array()[c])),
        specific_force: std::array::from_fn(|c| mean(&|r| r.specific_force.array()[c])),
        readings: readings.len(),
        moving: moving(readings, &imu_noise),
        imu_noise,
        white_imu_noise: white_imu_noise(imu, readings),
    })
}

/// Returns what changed within the readings by more than noise explains: means of eighths are compared.
fn moving(readings: &[Reading<f64>], noise: &ImuNoise<f64>) -> Option<String> {
    let part = readings.len() / 8;
    if part == 0 {
        return None;
    }
    let spread = |of: &dyn Fn(&Reading<f64>) -> [f64; 3]| {
        let means = readings.chunks_exact(part).take(8).map(|rows| {
            let sum = rows.iter().map(of).fold([0.0; 3], |s, v| std::array::from_fn(|k| s[k] + v[k]));
            sum.map(|s| s / part as f64)
        });
        let ends = means.fold([[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]], |[lo, hi], m| {
            [std::array::from_fn(|k| lo[k].min(m[k])), std::array::from_fn(|k| hi[k].max(m[k]))]
        });
        (0..3).map(|k| ends[1][k] - ends[0][k]).fold(0.0, f64::max)
    };
    let by_chance = |sigma: f64| CHANCE_SD * sigma / (part as f64).sqrt();
    let turned = spread(&|r| r.angular_rate.array());
    if turned > CHANGE_RADPS + by_chance(noise.gyro) {
        return Some(format!("the gyro changed by {turned:.3} rad/s within {WINDOW_S} s"));
    }
    let tilted = spread(&|r| r.specific_force.array());
    if tilted > CHANGE_MPS2 + by_chance(noise.accel) {
        return Some(format!("the accelerometer changed by {tilted:.2} m/s² within {WINDOW_S} s"));
    }
    None
}

/// Reads the sensors for two seconds, absorbing nothing.
///
/// # Errors
/// They send nothing, or Ctrl-C.
pub(super) fn look(session: &mut Session, rig: &RigFile, at: &dyn Attendant) -> Result<Rest, DrivingError> {
    let readings = session.watch(WINDOW_S, &mut *at.observer())?;
    if INTERRUPTED.load(Ordering::Relaxed) {
        return Err(DrivingError::Stopped);
    }
    at_rest(&readings, rig.imu.first())
}

/// Waits until the mean wrench changes by less than σ from one check to the next, twice in a row.
///
/// # Errors
/// The sensors send nothing, or Ctrl-C.
pub fn warm_up(
    session: &mut Session,
    rig: &RigFile,
    longest_s: f64,
    warnings: &mut Vec<String>,
    at: &dyn Attendant,
) -> Result<(), DrivingError> {
    let begun = Instant::now();
    let mut last: Option<Rest> = None;
    let mut settled = 0;
    while begun.elapsed().as_secs_f64() < longest_s {
        let now = look(session, rig, at)?;
        if let Some(last) = &last {
            let sigma = rig.load_cell.noise_n_nm.unwrap_or(now.sigma);
            let still = (0..6).all(|c| (now.wrench[c] - last.wrench[c]).abs() < sigma[c]);
            settled = if still { settled + 1 } else { 0 };
            if settled == 2 {
                return Ok(());
            }
        }
        last = Some(now);
        let elapsed_s = begun.elapsed().as_secs_f64();
        at.hear(&format!("warm-up: {elapsed_s:.0} s, the load cell is steady in {settled} of 2 looks"));
    }
    if longest_s > 0.0 {
        warnings.push(format!(
            "the load cell still drifted by more than its noise after {longest_s} s of warm-up"
        ));
    }
    Ok(())
}

/// Measures the sensors at rest: bias of the gyro, and the noise where the rig file states none. Waits for a
/// plate that moves.
///
/// # Errors
/// It does not come to rest, the sensors send nothing, or Ctrl-C.
pub fn zero(
    session: &mut Session,
    rig: &mut RigFile,
    warnings: &mut Vec<String>,
    at: &dyn Attendant,
) -> Result<Rest, DrivingError> {
    let mut rest = look(session, rig, at)?;
    for _ in 1..LOOKS {
        let Some(shown) = &rest.moving else { break };
        at.hear(&format!("zero: the plate is not at rest, {shown}; looking again"));
        rest = look(session, rig, at)?;
    }
    if let Some(shown) = &rest.moving {
        return Err(DrivingError::Moves(shown.clone()));
    }
    at.hear(&format!("zero: mean wrench {:.2?} N, N m", rest.wrench));
    if rig.imu.is_empty() {
        rig.imu.push(Default::default());
    }
    if let Some(imu) = rig.imu.first_mut() {
        let before = mounting(imu).gyro_bias.array();
        imu.gyro_bias_radps = Calibrated::Numbers(rest.angular_rate);
        let moved = (0..3).map(|k| (rest.angular_rate[k] - before[k]).abs()).fold(0.0, f64::max);
        if moved > 0.05 {
            warnings.push(format!(
                "the gyro showed {moved:.3} rad/s at rest, and that was taken for its bias: was the platform \
                 turning evenly?"
            ));
        }
    }
    let mut sigma = rig.load_cell.noise_n_nm.unwrap_or(rest.sigma);
    let felt = rest.specific_force.iter().fold(1.0_f64, |most, v| most.max(v.abs()));
    let raised = precision::raise(&mut sigma, &rest.wrench.map(|w| w.abs().max(felt)));
    warnings.extend(precision::raised_warning(&sigma, &raised));
    if rig.load_cell.noise_n_nm.is_none() {
        warnings.push(format!("noise_n_nm is not given: measured at rest, {sigma:.3?} N, N m"));
    }
    rig.load_cell.noise_n_nm = Some(sigma);
    Ok(rest)
}

/// Measures the second link at rest: bias of its gyro.
///
/// # Errors
/// It moves, or its IMU sends nothing.
pub(super) fn zero_second(
    session: &mut Session,
    rig: &mut RigFile,
    timing: &DeviceTiming,
    rest: &Rest,
    at: &dyn Attendant,
) -> Result<(), Error> {
    let settings = device_settings(rig, timing, Some(rest.sigma))?;
    configure(session, &settings)?;
    let seen = session.watch_links(WINDOW_S, &mut *at.observer()).map_err(DrivingError::from)?;
    if INTERRUPTED.load(Ordering::Relaxed) {
        return Err(DrivingError::Stopped.into());
    }
    let readings: Vec<Reading<f64>> = seen
        .iter()
        .map(|r| Reading {
            specific_force: SpecificForce::from_array(r.specific_force.map(f64::from)),
            angular_rate: AngularRate::from_array(r.angular_rate.map(f64::from)),
            ..widen(&r.base)
        })
        .collect();
    let Some(imu) = rig.imu.iter_mut().find(|imu| imu.link == 1) else { return Ok(()) };
    let rest = at_rest(&readings, Some(imu)).map_err(|_| DrivingError::SecondSilent)?;
    if let Some(shown) = &rest.moving {
        return Err(DrivingError::SecondMoves(shown.clone()).into());
    }
    imu.gyro_bias_radps = Calibrated::Numbers(rest.angular_rate);
    Ok(())
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Makes readings of two seconds at 200/s. The body is at rest and turned by `angle` about x at each time
    /// (s); the gyro has the noise of a poor one.
    pub(in super::super) fn readings(angle: impl Fn(f64) -> f64) -> Vec<Reading<f64>> {
        (0..400)
            .map(|k| {
                let t = f64::from(k) * 0.005;
                let rate = (angle(t + 1e-5) - angle(t - 1e-5)) / 2e-5;
                // A fixed sequence that resembles noise, σ = 0.058 of a range of 0.2.
                let noise = 0.2 * ((f64::from(k) * 0.618_033_988_75).fract() - 0.5);
                Reading {
                    time_ns: u64::from(k as u32) * 5_000_000,
                    specific_force: SpecificForce::new(noise, 9.8 * angle(t).sin(), 9.8 * angle(t).cos()),
                    angular_rate: AngularRate::new(0.2 + rate + 0.1 * noise, 0.0, 0.0),
                    ..Reading::default()
                }
            })
            .collect()
    }

    #[test]
    fn a_plate_that_moves_is_distinguished_from_noise_and_bias() {
        let seen = |angle: fn(f64) -> f64| at_rest(&readings(angle), None).unwrap().moving;
        assert_eq!(seen(|_| 0.0), None);
        assert_eq!(seen(|_| 0.4), None);
        assert!(seen(|t| 0.03 * (2.0 * t).sin()).unwrap().contains("rad/s"));
        assert!(seen(|t| 0.01 * (12.0 * t).sin()).unwrap().contains("rad/s"));
        // Turning evenly, the gyro shows nothing; gravity does.
        assert!(seen(|t| 0.05 * t).unwrap().contains("m/s²"));
    }
}

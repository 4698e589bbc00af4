//! The readings of the sensors before anything moves: their zero, their noise, whether the plate is at rest
//! and level.

use std::sync::atomic::Ordering;
use std::time::Instant;

use hexapod::{BodyParameters, BodySet, Pose};
use nalgebra::Vector3;
use rigident_shared::calibration::Reading;
use rigident_shared::forgetting::{ImuNoise, MemoryConfig, Span};
use rigident_shared::spatial::{AngularRate, Imu, SpecificForce};
use rigident_shared::wire::Settings;

use crate::Failure;
use crate::device::experiment::Watcher;
use crate::device::link::{configured, device_settings};
use crate::options::forgetting;
use rigident::device::platform::check;
use rigident::device::session::{DeviceTiming, INTERRUPTED, Session, precision, state_imu_noise, widen};
use rigident::plan::carried::{self, CarriedError, LoadBound, Weighing};
use rigident::plan::machine;
use rigident::rows::body::imu_noise::{imu_noise, white_imu_noise};
use rigident::rows::body::prepare::mounting;
use rigident_io::rig::{Calibrated, ImuTable, RigFile, WRENCH_CHANNELS};

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
/// More than this is worth a word, rad.
const DOUBTFUL_RAD: f64 = 0.035;
/// A mean that changed by more of the standard deviations of a reading was not changed by drift alone: after
/// the warm-up that is below one.
const TOUCHED_SD: f64 = 6.0;

/// The sensors at rest.
pub(crate) struct Rest {
    pub(crate) wrench: [f64; 6],
    pub(crate) sigma: [f64; 6],
    pub(crate) angular_rate: [f64; 3],
    /// In the IMU's axes, m/s².
    specific_force: [f64; 3],
    pub(crate) imu_noise: ImuNoise<f64>,
    /// Noise of the IMU that rows are weighed by: as stated, else as found at rest.
    pub(crate) white_imu_noise: ImuNoise<f64>,
    /// The number of readings.
    readings: usize,
    /// The evidence that the plate moves, if anything does.
    moving: Option<String>,
}

impl Rest {
    /// Returns the settings of a run that begins from here: noise as it was found, and how fast the run
    /// forgets.
    ///
    /// # Errors
    /// Bad input: what the rig file lacks, or more links than the device takes from sensors.
    pub(crate) fn settings(
        &self,
        rig: &RigFile,
        timing: &DeviceTiming,
        span: Option<Span<f64>>,
    ) -> Result<Settings, Failure> {
        let mut settings = device_settings(rig, timing, Some(self.sigma))?;
        state_imu_noise(&mut settings, &self.white_imu_noise);
        let memory = span.map(|span| MemoryConfig { span, imu_noise: self.imu_noise });
        forgetting::put_into(&mut settings, memory.as_ref());
        Ok(settings)
    }

    /// Returns what a recording says of the zero.
    pub(crate) fn comments(&self) -> [(String, String); 2] {
        [
            ("zero, mean wrench at rest".to_owned(), format!("{:?} N, N m", self.wrench)),
            ("zero, mean angular rate at rest".to_owned(), format!("{:?} rad/s", self.angular_rate)),
        ]
    }
}

/// Returns what readings at rest say.
///
/// # Errors
/// There are next to none.
pub(crate) fn at_rest(readings: &[Reading<f64>], imu: Option<&ImuTable>) -> Result<Rest, Failure> {
    let n = readings.len() as f64;
    if readings.len() < 10 {
        return Err(Failure::link(
            "the sensors send nothing: check their supply and wiring (`rigident info` shows the counters)",
        ));
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

/// The comparison of gravity with the plate's pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Attitude {
    /// It agrees.
    Compared,
    /// Nothing could be compared, and why.
    Unknown(&'static str),
}

const UNPLACED: &str = "the base is level, NOT compared with gravity: the rig file does not give the \
                        places of [[imu]] and [platform.load_cell]; on a wall or a ceiling all forces are \
                        others";
const UNKNOWN: &str = "the base is level, NOT compared with gravity: the platform does not know its \
                       plate's pose yet; on a wall or a ceiling all forces are others";

/// Checks whether the plate is tilted as the platform says that it is, as far as gravity shows it. Nothing is
/// known without the places of the IMU and the load cell, or where the platform does not know it.
///
/// # Errors
/// It is not: what is sent would begin with a jump, or forces be those of another attitude.
pub(crate) fn check_attitude(
    rest: &Rest,
    rig: &RigFile,
    stands: Option<&Pose>,
    warnings: &mut Vec<String>,
) -> Result<Attitude, Failure> {
    let Some(stands) = stands else { return Ok(Attitude::Unknown(UNKNOWN)) };
    let (Some(imu), Some(_)) = (rig.imu.first(), rig.platform.as_ref().and_then(|p| p.load_cell.as_ref()))
    else {
        return Ok(Attitude::Unknown(UNPLACED));
    };
    let (_, cell) = machine::load_cell(rig).map_err(Failure::input)?;
    // At rest the accelerometer feels "up".
    let off = carried::off_level_rad(&(cell * felt(rest, imu)), stands);
    let against =
        format!("against the attitude by the platform ({}), as gravity shows it", check::words(stands));
    if off >= carried::LEVEL_RAD {
        return Err(Failure::link(format!(
            "the plate is tilted by {:.0} degrees {against}: bring it there first. If it is there, the \
             base is not level, the controller levels it by a coordinate system, or the rotations of [[imu]] \
             or [platform.load_cell] in the rig file are wrong. A platform on a wall or a ceiling is not \
             driven: its forces are others.\nNothing was moved.",
            off.to_degrees()
        )));
    }
    if off >= DOUBTFUL_RAD {
        warnings.push(format!(
            "the plate is tilted by {:.1} degrees {against}: forces were checked for a level base; look at \
             the base, and at the rotations of [[imu]] and [platform.load_cell]",
            off.to_degrees()
        ));
    }
    Ok(Attitude::Compared)
}

/// Checks whether the load cell still reads what it read when it was zeroed: minutes may pass before somebody
/// says yes.
///
/// # Errors
/// It does not: somebody has been at it.
pub(crate) fn check_untouched(rest: &Rest, now: &Rest) -> Result<(), Failure> {
    let changed = |c: usize| now.wrench[c] - rest.wrench[c];
    let touched = || {
        let c = (0..6).find(|c| changed(*c).abs() > TOUCHED_SD * rest.sigma[*c])?;
        let (channel, unit) = WRENCH_CHANNELS[c];
        Some(format!("{channel} of the load cell changed by {:.2} {unit}", changed(c)))
    };
    match now.moving.clone().or_else(touched) {
        None => Ok(()),
        Some(shown) => Err(Failure::link(format!(
            "since the zero was taken, {shown}: somebody, or something, is at the platform. Run again when \
             nobody is.\nNothing was moved."
        ))),
    }
}

/// Returns the specific force in S, m/s².
fn felt(rest: &Rest, imu: &ImuTable) -> Vector3<f64> {
    let mounting = mounting(imu);
    let [bx, by, bz] = mounting.accel_bias.array();
    let [[fx, fy, fz], [sx, sy, sz]] = [rest.specific_force, mounting.accel_scale];
    let felt = SpecificForce::<Imu, f64>::new(sx * fx - bx, sy * fy - by, sz * fz - bz);
    Vector3::from((mounting.rotation * felt).array())
}

/// Returns what the load cell may carry, in S, by what it reads at rest; `None` where nothing bounds it and
/// no force has a limit.
///
/// # Errors
/// Bad input: a force has a limit and nothing bounds the body, or what is read contradicts the bound. Nothing
/// was moved.
pub(crate) fn weigh(rest: &Rest, rig: &RigFile) -> Result<Option<BodySet>, Failure> {
    let unmoved = |e: CarriedError| Failure::input(format!("{e}.\nNothing was moved."));
    let Some(bound) = bound(rig)? else { return Ok(None) };
    let up = match rig.imu.first().and_then(|imu| carried::up_of(felt(rest, imu))) {
        Some(up) => up,
        None => carried::up_when_level(rig).map_err(Failure::input)?,
    };
    let weighing = Weighing { wrench: rest.wrench, sigma: rest.sigma, readings: rest.readings, up };
    let set = weighing.set(rig, &bound).map_err(unmoved)?;
    let [least, most] = set.masses_kg();
    tell!(
        "the load cell carries {:.2} to {:.2} kg, within {} m of its origin",
        least.max(0.0),
        most,
        bound.within_m
    );
    Ok(Some(set))
}

/// Holds the body that a plan was made for, in P, against the bounds and against what the load cell carries.
///
/// # Errors
/// Bad input: it contradicts the bounds. Nothing was moved.
pub(crate) fn check_carries(carries: &BodyParameters, rig: &RigFile, body: &BodySet) -> Result<(), Failure> {
    let (at, rotation) = machine::load_cell(rig).map_err(Failure::input)?;
    let away = (rotation.transpose() * (Vector3::from(carries.com_m) - at)).norm();
    if let Some(bound) = bound(rig)?
        && (carries.mass_kg > bound.mass_kg || away > bound.within_m)
    {
        return Err(Failure::input(format!(
            "the plan was made for {:.2} kg with their centre of mass {away:.3} m from the load cell's \
             origin, and the rig file allows {:.2} kg within {} m: one of them is wrong.\nNothing was \
             moved.",
            carries.mass_kg, bound.mass_kg, bound.within_m
        )));
    }
    let [least, most] = body.masses_kg();
    if !(least..=most).contains(&carries.mass_kg) {
        tell!(
            "rigident: the plan was made for {:.2} kg, and the load cell carries {:.2} to {most:.2} kg: its \
             limits are checked for these, what it predicts is not for this body",
            carries.mass_kg,
            least.max(0.0)
        );
    }
    Ok(())
}

/// Returns how heavy and how large the body may be; `None` where that is not said and no force has a limit.
///
/// # Errors
/// Bad input: a force has a limit.
pub(crate) fn bound(rig: &RigFile) -> Result<Option<LoadBound>, Failure> {
    let bound = LoadBound::of(rig);
    let limits = rig.platform.as_ref().map(machine::limits).unwrap_or_default();
    let limited = carried::limited(&limits, &rig.load_cell.range_n_nm.unwrap_or([f64::INFINITY; 6]));
    match (bound, limited) {
        (None, Some(limited)) => {
            Err(Failure::input(format!("{}.\nNothing was moved.", CarriedError::NoBound { limited })))
        }
        (bound, _) => Ok(bound),
    }
}

/// Reads the sensors for two seconds, absorbing nothing.
///
/// # Errors
/// They send nothing, or Ctrl-C.
pub(crate) fn look(session: &mut Session, rig: &RigFile) -> Result<Rest, Failure> {
    let readings = session.watch(WINDOW_S, &mut Watcher::new(0)).map_err(Failure::link)?;
    if INTERRUPTED.load(Ordering::Relaxed) {
        return Err(Failure::interrupted("stopped before the experiment began; nothing was moved"));
    }
    at_rest(&readings, rig.imu.first())
}

/// Waits until the mean wrench changes by less than σ from one check to the next, twice in a row.
pub(crate) fn warm_up(
    session: &mut Session,
    rig: &RigFile,
    longest_s: f64,
    warnings: &mut Vec<String>,
) -> Result<(), Failure> {
    let begun = Instant::now();
    let mut last: Option<Rest> = None;
    let mut settled = 0;
    while begun.elapsed().as_secs_f64() < longest_s {
        let now = look(session, rig)?;
        if let Some(last) = &last {
            let sigma = rig.load_cell.noise_n_nm.unwrap_or(now.sigma);
            let still = (0..6).all(|c| (now.wrench[c] - last.wrench[c]).abs() < sigma[c]);
            settled = if still { settled + 1 } else { 0 };
            if settled == 2 {
                return Ok(());
            }
        }
        last = Some(now);
        tell!(
            "warm-up: {:.0} s, the load cell is steady in {settled} of 2 looks",
            begun.elapsed().as_secs_f64()
        );
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
pub(crate) fn zero(
    session: &mut Session,
    rig: &mut RigFile,
    warnings: &mut Vec<String>,
) -> Result<Rest, Failure> {
    let mut rest = look(session, rig)?;
    for _ in 1..LOOKS {
        let Some(shown) = &rest.moving else { break };
        tell!("zero: the plate is not at rest, {shown}; looking again");
        rest = look(session, rig)?;
    }
    if let Some(shown) = &rest.moving {
        return Err(Failure::link(format!(
            "the plate does not come to rest: {shown}. The gyro's zero and the noise are measured at rest: \
             is another program moving the platform, or is something shaking it?\nNothing was moved."
        )));
    }
    tell!("zero: mean wrench {:.2?} N, N m", rest.wrench);
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
pub(crate) fn zero_second(
    session: &mut Session,
    rig: &mut RigFile,
    timing: &DeviceTiming,
    rest: &Rest,
) -> Result<(), Failure> {
    let settings = device_settings(rig, timing, Some(rest.sigma))?;
    configured(session, &settings)?;
    let seen = session.watch_links(WINDOW_S, &mut Watcher::new(0)).map_err(Failure::link)?;
    if INTERRUPTED.load(Ordering::Relaxed) {
        return Err(Failure::interrupted("stopped before the experiment began; nothing was moved"));
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
    let rest = at_rest(&readings, Some(imu))
        .map_err(|_| Failure::link("the second link's IMU sends nothing: check its supply and wiring"))?;
    if let Some(shown) = &rest.moving {
        return Err(Failure::link(format!(
            "the second link does not hang still: {shown}. Its gyro's zero is measured at rest, and its \
             attitude at the start is initial_wxyz of its [[link]].\nNothing was moved."
        )));
    }
    imu.gyro_bias_radps = Calibrated::Numbers(rest.angular_rate);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexapod::Geometry;

    /// Makes readings of two seconds at 200/s. The body is at rest and turned by `angle` about x at each time
    /// (s); the gyro has the noise of a poor one.
    fn readings(angle: impl Fn(f64) -> f64) -> Vec<Reading<f64>> {
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
    fn a_plan_made_for_a_body_that_the_bounds_do_not_allow_is_refused() {
        let rig = RigFile::parse("[platform]\nload_max_kg = 30\nload_within_m = 0.4").unwrap();
        let made_for =
            |mass_kg: f64, com_m: [f64; 3]| BodyParameters { mass_kg, com_m, inertia_com_kgm2: [0.1; 6] };
        let weighed = BodySet::bounded(25.0, [0.0; 3], 0.4);
        check_carries(&made_for(20.0, [0.0, 0.0, 0.1]), &rig, &weighed).unwrap();
        for (mass_kg, z) in [(80.0, 0.1), (20.0, 3.0)] {
            let error = check_carries(&made_for(mass_kg, [0.0, 0.0, z]), &rig, &weighed).unwrap_err();
            let said = format!("{error:?}");
            assert!(said.contains("Nothing was moved") && said.contains("30.00 kg within 0.4 m"), "{said}");
        }
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

    #[test]
    fn a_plate_that_is_tilted_otherwise_does_not_stand_where_the_platform_says() {
        let home = Geometry::thesis().home();
        let text = "[[imu]]\nposition_m = [0, 0, 0]\nrotation_wxyz = [1, 0, 0, 0]\n[platform.load_cell]\n\
                    position_m = [0, 0, 0]\nrotation_wxyz = [0, 1, 0, 0]\n";
        // The load cell hangs: its x is the plate's, its z points down.
        let rig = RigFile::parse(text).unwrap();
        let seen = |angle: f64, rig: &RigFile, stands: Option<&Pose>| {
            let rest = at_rest(&readings(|_| angle), None).unwrap();
            let mut warnings = Vec::new();
            check_attitude(&rest, rig, stands, &mut warnings).map_err(|e| e.to_string()).map(|seen| {
                assert_eq!(seen == Attitude::Compared, stands.is_some() && rig.platform.is_some());
                warnings
            })
        };
        let check = |angle: f64, rig: &RigFile| seen(angle, rig, Some(&home));
        let pi = std::f64::consts::PI;
        assert_eq!(check(pi + 0.02, &rig), Ok(vec![]));
        let doubtful = check(pi + 0.05, &rig).unwrap();
        assert!(doubtful[0].contains("2.9 degrees") && doubtful[0].contains("level base"), "{doubtful:?}");
        let said = check(pi + 0.5, &rig).unwrap_err();
        assert!(said.contains("tilted by 29 degrees") && said.contains("Nothing was moved"), "{said}");
        // Where the load cell's place is not given, nothing is known.
        assert_eq!(check(0.5, &RigFile::default()), Ok(vec![]));
        assert_eq!(seen(pi + 0.5, &rig, None), Ok(vec![]));
        // The plate leans as the platform says: the load cell's x is the plate's, and so is the IMU's.
        let mut leaning = home;
        leaning.rpy_rad[0] = -0.5;
        let leans = [0.5, -0.5].map(|angle| seen(pi + angle, &rig, Some(&leaning)).is_ok());
        assert!(leans[0] != leans[1], "one of the two, by the sign of the IMU's axes: {leans:?}");
        // A base on a wall, and on a ceiling.
        for (angle, words) in [(0.5 * pi, "tilted by 90 degrees"), (0.0, "tilted by 180 degrees")] {
            let said = check(angle, &rig).unwrap_err();
            assert!(said.contains(words) && said.contains("wall or a ceiling is not driven"), "{said}");
        }
    }

    #[test]
    fn a_load_cell_that_somebody_touched_after_its_zero_is_noticed() {
        let rest = || at_rest(&readings(|_| 0.0), None).unwrap();
        let with = |newtons: f64| {
            let mut rest = rest();
            rest.sigma = [1.0; 6];
            rest.wrench[2] += newtons;
            rest
        };
        assert!(check_untouched(&with(0.0), &with(4.0)).is_ok());
        let said = check_untouched(&with(0.0), &with(-9.0)).unwrap_err().to_string();
        assert!(said.contains("Fz of the load cell changed by -9.00 N"), "{said}");
    }
}

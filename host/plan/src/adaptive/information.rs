//! The information of a motion on the body.

use hexapod::{
    Bodies, BodyParameters, BodySet, Coordinates, Geometry, Load, MotionError, MotionProgram, PlateState,
    Pose, STANDARD_GRAVITY_MPS2, Trajectory,
};
use nalgebra::Vector3;
use rigident_shared::calibration::ImuMounting;
use rigident_shared::estimator::{Estimator, EstimatorConfig};
use rigident_shared::regressor::{block, signals};
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{Position, Sensor};

use super::compact::Compact;
use crate::carried::{self, LoadBound};
use crate::machine::{self, MachineError};
pub use crate::motion::information::Information;
use crate::motion::information::{Instrument, PARAMETERS};
use crate::motion::plan::{GYRO_SHARE, SENSOR_SHARE};
use rigident_fit::{ESTIMATOR_TAPS, Factor, filter_width_s, row_every};
use rigident_io::rig::{OffsetTable, OffsetWord, RigFile};

/// Rows per second from which information is summed. Motions up to 2.5 Hz make rows up to 5 Hz.
const ROWS_HZ: f64 = 50.0;
/// Highest angular rate where the gyro has no range, rad/s.
pub const HIGHEST_RATE_RADPS: f64 = 1.2;
/// Information on a known offset: that of a standard deviation of 1e-6 N or N m.
const KNOWN: f64 = 1e12;

/// A parameter whose deviation is this many times that without the others counts as not determined: rounding.
const MOST_INFLATED: f64 = 1e6;

/// The planner's knowledge of the rig.
#[derive(Clone, Debug)]
pub struct RigModel {
    /// The machine and its limits.
    pub geometry: Geometry,
    /// The place of S in P, m.
    pub load_cell_m: Vector3<f64>,
    /// Axes of S to those of P.
    pub load_cell_rotation: nalgebra::Matrix3<f64>,
    /// σ of the wrench per reading that rows are whitened by, N and N m.
    pub channel_sigma: [f64; 6],
    /// Readings per second.
    pub rate_hz: f64,
    /// Range of the gyro, rad/s.
    pub rate_range_radps: f64,
    /// Range of the accelerometer, m/s².
    pub felt_range_mps2: f64,
    /// Ranges of the load cell, N and N m.
    pub wrench_range_n_nm: [f64; 6],
    /// White noise of the gyro, rad/s.
    pub gyro_noise_radps: f64,
    /// The parts that the legs carry and the load cell does not feel, in P.
    pub parts: Vec<BodyParameters>,
    /// The bodies that the load cell may carry, in S: before the body is identified what bounds and a scale
    /// leave, then the estimate with its uncertainty; `None` if nothing bounds it.
    pub body: Option<BodySet>,
    /// Ten parameters are estimated, not sixteen.
    pub offset_known: bool,
}

impl RigModel {
    /// Makes the model of a rig file. `sigma` is used where the file states none.
    ///
    /// # Errors
    /// A fault of its platform.
    pub fn of(
        rig: &RigFile,
        geometry: Geometry,
        rate_hz: f64,
        sigma: [f64; 6],
    ) -> Result<Self, MachineError> {
        let (load_cell_m, load_cell_rotation) = machine::load_cell(rig)?;
        let imu = rig.imu.first();
        let range = imu.and_then(|imu| imu.range_radps);
        Ok(Self {
            geometry,
            load_cell_m,
            load_cell_rotation,
            channel_sigma: rig.load_cell.noise_n_nm.unwrap_or(sigma),
            rate_hz,
            rate_range_radps: range.unwrap_or(f64::INFINITY),
            felt_range_mps2: imu.and_then(|imu| imu.range_mps2).unwrap_or(f64::INFINITY),
            wrench_range_n_nm: rig.load_cell.range_n_nm.unwrap_or([f64::INFINITY; 6]),
            gyro_noise_radps: imu.and_then(|imu| imu.gyro_noise_radps).unwrap_or(0.0),
            parts: machine::parts(rig.platform.as_ref()),
            body: LoadBound::of(rig).map(|bound| bound.set()),
            offset_known: !matches!(rig.load_cell.offset_n_nm, OffsetTable::Word(OffsetWord::Estimate)),
        })
    }

    /// Returns how fast the plate may turn, rad/s.
    pub fn highest_rate_radps(&self) -> f64 {
        (GYRO_SHARE * self.rate_range_radps).min(HIGHEST_RATE_RADPS)
    }

    /// Returns what has a limit that depends on the body, in words; `None` if nothing has.
    pub fn limits_forces(&self) -> Option<&'static str> {
        carried::limited(&self.geometry.limits, &self.wrench_range_n_nm)
    }

    /// Returns the largest share of what is allowed that a program takes, checked every 10 ms, if all of it
    /// is then shown to be met: the machine's limits and the gyro's range at every instant, by bounds between
    /// checks. Above one if it is not; infinite for a program without sense.
    pub fn overstepped(&self, program: &MotionProgram) -> f64 {
        const LOOK_S: f64 = 0.01;
        /// If bounds show nothing although the checks do, the program is made smaller by a little.
        const NOT_SHOWN: f64 = 1.03;
        /// A tenth of a second of work.
        const MOST_LOOKS: u32 = 10_000;
        let Ok(trajectory) = program.trajectory() else { return f64::INFINITY };
        let (load, instrument) = (self.load(), self.instrument(1.0));
        let highest = self.highest_rate_radps();
        let looks = (trajectory.duration_s() / LOOK_S).ceil() as usize;
        let seen = (0..=looks).fold(0.0, |seen: f64, k| {
            let state = trajectory.state(k as f64 * LOOK_S);
            seen.max(self.share(&state, load.as_ref(), &instrument))
        });
        let seen = seen.max(self.geometry.jerk_share(&trajectory));
        if seen > 1.0 || self.geometry.proves(&trajectory, load.as_ref(), highest, MOST_LOOKS) {
            return seen;
        }
        seen.max(1.0) * NOT_SHOWN
    }

    /// Returns the largest share of what is allowed that standing still at `pose` takes.
    pub fn share_at_rest(&self, pose: &Pose) -> f64 {
        let state = Coordinates { value: pose.coordinates(), ..Coordinates::default() }.plate_state();
        self.share(&state, self.load().as_ref(), &self.instrument(1.0))
    }

    /// Returns the largest share of what is allowed at one instant; infinite where one is no number.
    fn share(&self, state: &PlateState, load: Option<&Load>, instrument: &Instrument) -> f64 {
        let machine = 1.0 - self.geometry.margins(state, load).tightest().relative;
        let turning = state.angular_rate.norm() / self.highest_rate_radps();
        // What is no number is not known to be met.
        let most = |most: f64, v: f64| if v.is_nan() { f64::INFINITY } else { most.max(v) };
        [instrument.load_share(state), machine, turning].into_iter().fold(0.0, most)
    }

    /// Returns the load cell with its range and the accelerometer's, the given number of readings at each
    /// instant.
    pub(super) fn instrument(&self, readings: f64) -> Instrument {
        Instrument::new(
            &self.load_cell_m,
            &self.load_cell_rotation,
            STANDARD_GRAVITY_MPS2,
            &self.channel_sigma,
            readings,
        )
        .within(
            self.body.clone(),
            self.wrench_range_n_nm.map(|range| SENSOR_SHARE * range),
            SENSOR_SHARE * self.felt_range_mps2,
        )
    }

    /// Returns the most compact body of the mass that the load cell carries; of 20 kg where nothing is known
    /// of it.
    pub fn compact(&self) -> Compact {
        Compact::of(self.body.as_ref().map_or(20.0, |body| body.middle[0].max(0.01)))
    }

    /// Returns what the legs may carry; `None` if nothing bounds it.
    fn load(&self) -> Option<Load> {
        let body = self.body.as_ref()?.in_frame(&self.load_cell_m, &self.load_cell_rotation);
        Some(Load::new(Bodies::Within { known: self.parts.clone(), body }))
    }

    /// Returns the variance of the whitened, filtered noise per row of the device's factor.
    pub fn noise_gain(&self) -> f64 {
        let config = EstimatorConfig {
            rate_hz: self.rate_hz,
            filter_width_s: filter_width_s(self.rate_hz),
            row_every: row_every(self.rate_hz),
            channel_sigma: [1.0; 6],
            known_offset: [0.0; 6],
            mounting: ImuMounting::default(),
            limits: Limits::none(),
        };
        Estimator::<f64, 10, ESTIMATOR_TAPS>::new(&config).map_or(1.0, |estimator| estimator.noise_gain())
    }

    /// Returns the information before anything has moved.
    pub fn prior(&self) -> Information {
        let known = if self.offset_known { KNOWN } else { 0.0 };
        Information::from_fn(|i, j| if i == j && i >= 10 { known } else { 0.0 })
    }

    /// Returns what a program brings if the coordinates in `lost` stay where they are at its beginning. The
    /// estimator's filter is left out: at 2.5 Hz it takes 3 % off the information.
    ///
    /// # Errors
    /// A segment that makes no sense.
    pub fn information(&self, program: &MotionProgram, lost: &[bool; 6]) -> Result<Information, MotionError> {
        let trajectory = program.trajectory()?;
        Ok(self.of_trajectory(&trajectory, lost))
    }

    fn of_trajectory(&self, trajectory: &Trajectory, lost: &[bool; 6]) -> Information {
        let start = trajectory.coordinates(0.0);
        let rows = (trajectory.duration_s() * ROWS_HZ).round().max(1.0) as usize;
        let step_s = trajectory.duration_s() / rows as f64;
        let weight = self.rate_hz * step_s;
        let weights = self.channel_sigma.map(|sigma| weight / (sigma * sigma));
        let mut sum = Information::zeros();
        for k in 0..rows {
            let mut c = trajectory.coordinates((k as f64 + 0.5) * step_s);
            for (axis, _) in lost.iter().enumerate().filter(|(_, lost)| **lost) {
                (c.value[axis], c.rate[axis], c.acceleration[axis]) = (start.value[axis], 0.0, 0.0);
            }
            let plate = c.plate_state();
            let (w, dw, p) = (plate.angular_rate, plate.angular_acceleration, self.load_cell_m);
            let up = Vector3::new(0.0, 0.0, STANDARD_GRAVITY_MPS2);
            let force =
                plate.rotation.tr_mul(&(plate.acceleration + up)) + dw.cross(&p) + w.cross(&w.cross(&p));
            let to_s = |v: &Vector3<f64>| -> [f64; 3] { self.load_cell_rotation.tr_mul(v).into() };
            let mut s = signals(to_s(&force), to_s(&w), [0.0; 6]);
            if let Some(last) = s.last_chunk_mut::<3>() {
                *last = to_s(&dw);
            }
            let columns = block(&s, &Position::<Sensor, f64>::from_array([0.0; 3])).columns;
            for channel in 0..6 {
                let mut row = nalgebra::SVector::<f64, 16>::zeros();
                for (entry, column) in row.iter_mut().zip(&columns) {
                    *entry = column[channel];
                }
                row[10 + channel] = 1.0;
                sum.syger(weights[channel], &row, &row, 1.0);
            }
        }
        sum.fill_upper_triangle_with_lower_triangle();
        sum
    }

    /// Returns what a device's factor says.
    pub fn of_factor(&self, factor: &Factor) -> Information {
        let (mut sum, r) = (self.prior(), factor.r());
        let n = factor.parameters().min(PARAMETERS);
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            sum[(i, j)] = r.row_iter().map(|row| row[i] * row[j]).sum();
        }
        sum
    }
}

/// `L⁻¹` with `L Lᵀ` the information, columns scaled to one: parameters in kg and in kg m² are of very
/// different sizes.
pub struct InverseRoot {
    inverse: Information,
    scale: [f64; 16],
}

impl InverseRoot {
    /// Makes the inverse root of an information. Returns `None` if something is not determined.
    pub fn of(information: &Information) -> Option<Self> {
        let scale: [f64; 16] = std::array::from_fn(|j| information[(j, j)].sqrt().recip());
        if !scale.iter().all(|s| s.is_finite()) {
            return None;
        }
        let scaled = Information::from_fn(|i, j| information[(i, j)] * scale[i] * scale[j]);
        let l = scaled.cholesky()?.unpack();
        let mut inverse = Information::identity();
        l.solve_lower_triangular_mut(&mut inverse).then_some(())?;
        let within = |j: usize| inverse.column(j).norm() < MOST_INFLATED;
        (0..16).all(within).then_some(Self { inverse, scale })
    }

    /// Returns the standard deviations: (L Lᵀ)⁻¹_jj is the squared length of column j of L⁻¹.
    pub fn deviations(&self) -> [f64; 16] {
        std::array::from_fn(|j| self.inverse.column(j).norm() * self.scale[j])
    }

    /// Returns the half-axes of the first ten parameters' ellipsoid of one standard deviation: `Σ l lᵀ` is
    /// their covariance.
    pub fn half_axes(&self) -> Vec<[f64; 10]> {
        let half_axis = |k: usize| std::array::from_fn(|j| self.inverse[(k, j)] * self.scale[j]);
        (0..16).map(half_axis).collect()
    }

    /// Returns the standard deviation of a linear combination of the first ten.
    pub fn deviation_of(&self, slope: &[f64; 10]) -> f64 {
        let mut sum = nalgebra::SVector::<f64, 16>::zeros();
        for (j, weight) in slope.iter().enumerate().filter(|(_, weight)| **weight != 0.0) {
            sum.axpy(weight * self.scale[j], &self.inverse.column(j), 1.0);
        }
        sum.norm()
    }
}

/// Returns the standard deviations of all sixteen; `None` if one of them is not determined.
pub fn deviations(information: &Information) -> Option<[f64; 16]> {
    InverseRoot::of(information).map(|inverse| inverse.deviations())
}

//! The information that an experiment will bring: the factor that the pipeline makes of it without noise, and
//! its uncertainties.

use hexapod::{BadRotation, MotionError, MotionProgram};
use rigident_shared::calibration::Reading;
use rigident_shared::estimator::{ConfigError, Estimator, EstimatorConfig};
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};

use crate::equipment::Equipment;
use rigident_fit::{ESTIMATOR_TAPS, Estimate, Factor, Noise, filter_width_s, row_every};
use rigident_identify::answer::derived;

/// 95 % expanded uncertainties, and the conditioning.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// Predictions for `[m, mcx, mcy, mcz, Ixx, Iyy, Izz, Iyz, Izx, Ixy]` about S's origin, SI.
    pub parameters: [f64; 10],
    /// Predictions for the centre of mass, m.
    pub com_m: [f64; 3],
    /// Predictions for the tensor about the centre of mass, kg m².
    pub inertia_com_kgm2: [f64; 6],
    /// 2-norm condition number of the triangular factor, columns scaled to unit length, offsets included.
    pub condition_number: f64,
    /// 2-norm condition number of the body's ten parameters with the offsets eliminated: of the Schur
    /// complement, its diagonal scaled to one, the root.
    pub condition_eliminated: f64,
    /// `ln det` of the information on the ten parameters, offsets eliminated, SI: what D-optimality makes
    /// large.
    pub log_determinant: f64,
    /// True if every parameter of the body is determined.
    pub determined: bool,
}

/// The reason why nothing can be predicted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PredictError {
    /// The platform cannot follow the program.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// A mounting without a rotation.
    #[error(transparent)]
    BadRotation(#[from] BadRotation),
    /// A rate for readings that makes no sense.
    #[error("{0} Hz is not a rate at which readings can be taken")]
    BadRate(f64),
    /// The pipeline cannot be set up for this rate.
    #[error("the pipeline cannot be set up for {rate_hz} Hz: {error:?}")]
    Config {
        /// 1/s.
        rate_hz: f64,
        /// Why.
        error: ConfigError,
    },
}

/// Parameters of the body; those of the wrench's offset follow.
const BODY: usize = 10;

/// Predicts by the factor of what perfect sensors read, with the noise of the rig's load cell in its weights.
///
/// # Errors
/// A program that the platform cannot follow, or a rate that cannot be.
pub fn predict(
    equipment: &Equipment,
    program: &MotionProgram,
    rate_hz: f64,
) -> Result<Prediction, PredictError> {
    const K95: f64 = 1.959_963_984_540_054;
    if !(rate_hz.is_finite() && rate_hz > 0.0) {
        return Err(PredictError::BadRate(rate_hz));
    }
    let sensors = equipment.payload.sensors()?;
    let trajectory = program.trajectory()?;
    equipment.geometry.check(&trajectory)?;
    let mut estimator = Box::new(
        Estimator::<f64, 16, ESTIMATOR_TAPS>::new(&EstimatorConfig {
            rate_hz,
            filter_width_s: filter_width_s(rate_hz),
            row_every: row_every(rate_hz),
            channel_sigma: equipment.noise_n_nm,
            known_offset: [0.0; 6],
            mounting: equipment.mounting(),
            limits: equipment.limits(),
        })
        .map_err(|error| PredictError::Config { rate_hz, error })?,
    );
    let readings = (trajectory.duration_s() * rate_hz * (1.0 + 1e-12)).floor() as u64 + 1;
    for k in 0..readings {
        let time_s = k as f64 / rate_hz;
        let plate = trajectory.state(time_s);
        let (specific_force, angular_rate) = sensors.imu(&plate);
        estimator.absorb(&Reading {
            time_ns: (time_s * 1e9).round() as u64,
            wrench: Wrench::from_array(sensors.wrench(&plate)),
            specific_force: SpecificForce::from_array(specific_force),
            angular_rate: AngularRate::from_array(angular_rate),
        });
    }
    let factor = Factor::from(&estimator.factor());
    let estimate = Estimate::new(&factor, factor.rounding(), 1.0, Noise::Given);
    let alone = factor.leading(BODY);
    let sd: [f64; 10] = std::array::from_fn(|j| estimate.unjudged().covariance[(j, j)].sqrt());
    Ok(Prediction {
        parameters: sd.map(|s| K95 * s),
        com_m: derived::centre_of_mass(&estimate).sd.map(|s| K95 * s),
        inertia_com_kgm2: derived::inertia_com(&estimate).sd.map(|s| K95 * s),
        condition_number: estimate.condition_number,
        condition_eliminated: alone.solve(alone.rounding()).condition_number,
        log_determinant: alone.log_determinant(),
        determined: estimate.rank() == estimate.len(),
    })
}

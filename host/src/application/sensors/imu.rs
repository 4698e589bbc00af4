//! Scales, misalignments and biases of an IMU from the motion that a platform drove it through.

use std::fmt;
use std::path::Path;

use hexapod::{Geometry, IdealSensors, MotionProgram};
use serde::Serialize;

use super::super::Error;
use super::super::calibrate_error::CalibrateError;
use rigident_fit::figures::with_u95;
use rigident_fit::{FitOptions, Measured, Silent, fit};
use rigident_identify::problem::ProblemError;
use rigident_io::recording::Recording;
use rigident_plan::{machine, ranges};
use rigident_rows::body::prepare::{Prepared, prepare};
use rigident_rows::imu::{AXES, ImuRun, OF_AN_AXIS};

/// The part that a program may leave unexplained, as a share of the RMS by which readings vary.
const UNEXPLAINED: f64 = 0.3;

/// The readings of an IMU that a platform drove through a program.
///
/// ```no_run
/// use hexapod::experiment::thesis_program;
/// use rigident::application::DrivenImu;
///
/// let driven = DrivenImu::read("run.mcap".as_ref(), None)?;
/// let found = driven.calibrate(&thesis_program(&driven.geometry, 60.0))?;
/// println!("{found}");
/// # Ok::<(), rigident::application::Error>(())
/// ```
pub struct DrivenImu {
    /// Warnings from reading the recording.
    pub warnings: Vec<String>,
    /// The platform.
    pub geometry: Geometry,
    sensors: IdealSensors,
    prepared: Prepared,
}

/// The errors of an IMU; its text is the table.
#[derive(Clone, Debug, Serialize)]
pub struct CalibratedImu {
    /// The beginning of the program after the first reading, s.
    pub begins_s: f64,
    /// Biases, and what each axis reads of each component, axis by axis, the gyro's first.
    pub parameters: Vec<ImuParameter>,
}

/// An error of an IMU.
#[derive(Clone, Debug, Serialize)]
pub struct ImuParameter {
    /// The name of the error.
    pub name: String,
    /// The unit of the error.
    pub unit: String,
    /// The value of the error with its 95 % expanded uncertainty; `None` if the motion leaves it open.
    #[serde(flatten)]
    pub measured: Option<Measured>,
}

impl DrivenImu {
    /// Reads the recording of a run; `rig` is its rig file, by default `NAME.rig.toml` beside it.
    ///
    /// # Errors
    /// It cannot be read, has no readings of an IMU in motion, or its rig file describes no platform with an
    /// IMU.
    pub fn read(recording: &Path, rig: Option<&Path>) -> Result<Self, Error> {
        let mut recording = Recording::load(recording, rig)?;
        recording.leave_out_bad_readings();
        let prepared = prepare(&recording).map_err(ProblemError::from)?;
        if prepared.gravity_columns || prepared.input.is_static {
            return Err(CalibrateError::NoMotion.into());
        }
        let geometry = machine::geometry_or_thesis(&prepared.rig).map_err(CalibrateError::from)?;
        let (at, _) = machine::load_cell(&prepared.rig).map_err(CalibrateError::from)?;
        let sensors = ranges::ideal(&prepared.rig, &at).ok_or(CalibrateError::NoImu)?;
        Ok(Self { warnings: recording.warnings, geometry, sensors, prepared })
    }

    /// Finds the errors of the IMU by the program that the platform was driven through.
    ///
    /// # Errors
    /// The program has no trajectory, has no fit, or is not the one of the recording.
    pub fn calibrate(&self, program: &MotionProgram) -> Result<CalibratedImu, Error> {
        let trajectory = program.trajectory().map_err(|error| CalibrateError::Program(error.to_string()))?;
        let input = &self.prepared.input;
        let run = ImuRun::new(&trajectory, self.sensors.clone(), &input.readings, input.rate_hz);
        let found = fit(&run, &FitOptions::default(), &Silent)?;
        let measured = |j: usize| found.estimate.measured(j);
        let values: Vec<f64> =
            (0..found.parameters.len()).map(|j| measured(j).map_or(0.0, |own| own.value)).collect();
        let [gyro, accelerometer] = run.unexplained(&values);
        if gyro.max(accelerometer) > UNEXPLAINED {
            return Err(CalibrateError::OtherProgram { gyro, accelerometer, most: UNEXPLAINED }.into());
        }
        let parameters = found.parameters.iter().enumerate().map(|(j, parameter)| ImuParameter {
            name: parameter.name.clone(),
            unit: parameter.unit.clone(),
            measured: measured(j),
        });
        Ok(CalibratedImu { begins_s: run.begins_s(), parameters: parameters.collect() })
    }
}

impl CalibratedImu {
    /// Returns true if the motion leaves nothing open.
    pub fn is_whole(&self) -> bool {
        self.parameters.iter().all(|parameter| parameter.measured.is_some())
    }

    fn measured(&self, axis: usize, k: usize) -> Option<Measured> {
        self.parameters.get(OF_AN_AXIS * axis + k)?.measured
    }
}

impl fmt::Display for CalibratedImu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "The program began {:.3} s after the first reading.\n\n{:<8}{:>24}{:>24}{:>24}{:>26}",
            self.begins_s, "", "bias", "of x", "of y", "of z"
        )?;
        for (axis, name) in AXES.iter().enumerate() {
            write!(f, "\n  {name:<6}")?;
            for k in 0..OF_AN_AXIS {
                match self.measured(axis, k) {
                    Some(m) => write!(f, "{:>24}", with_u95(m.value, m.u95, ""))?,
                    None => write!(f, "{:>24}", "this motion leaves it open")?,
                }
            }
            write!(f, "  {}", if axis < 3 { "rad/s" } else { "m/s2" })?;
        }
        let value = |axis: usize, k: usize| self.measured(axis, k).map(|m| m.value);
        let three = |value: &dyn Fn(usize) -> Option<f64>| -> Option<String> {
            let [x, y, z] = [value(0)?, value(1)?, value(2)?];
            Some(format!("[{x:.6}, {y:.6}, {z:.6}]"))
        };
        let scale = three(&|k| value(3 + k, 1 + k).map(|own| 1.0 / own));
        let accel = three(&|k| Some(value(3 + k, 0)? / value(3 + k, 1 + k)?));
        if let (Some(scale), Some(accel), Some(gyro)) = (scale, accel, three(&|k| value(k, 0))) {
            write!(
                f,
                "\n\nIn the rig file's [[imu]]:\n  accel_scale = {scale}\n  accel_bias_mps2 = \
                 {accel}\n  gyro_bias_radps = {gyro}"
            )?;
        }
        Ok(())
    }
}

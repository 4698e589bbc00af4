use std::process::ExitCode;

use serde::Serialize;

use super::calibration_arguments::CalibrateImu;
use super::outcome::say;
use super::{ExitStatus, Failure};
use rigident::fit::figures::with_u95;
use rigident::plan::{machine, ranges};
use rigident::rows::body::prepare::prepare;
use rigident::rows::imu::{AXES, ImuRun, OF_AN_AXIS};
use rigident_fit::{Fit, FitOptions, Silent, fit};
use rigident_io::recording::Recording;

/// The part that a program may leave unexplained, as a share of the RMS by which readings vary.
const UNEXPLAINED: f64 = 0.3;

/// The object of `--json`.
#[derive(Serialize)]
struct Object<'a> {
    begins_s: f64,
    parameters: Vec<Found<'a>>,
}

#[derive(Serialize)]
struct Found<'a> {
    name: &'a str,
    unit: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    value: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    u95: Option<f64>,
}

/// `rigident calibrate imu`
pub(super) fn run(arguments: &CalibrateImu) -> Result<ExitCode, Failure> {
    let mut recording =
        Recording::load(&arguments.recording, arguments.rig.as_deref()).map_err(Failure::input)?;
    recording.leave_out_spikes();
    let prepared = prepare(&recording).map_err(Failure::input)?;
    if prepared.gravity_columns || prepared.input.is_static {
        return Err(Failure::input(
            "there are no readings of an IMU in motion: take the recording of a `rigident run` with an IMU",
        ));
    }
    let rig = &prepared.rig;
    let geometry = machine::geometry_or_thesis(rig).map_err(Failure::input)?;
    let program = arguments.programme.program(&geometry)?;
    let trajectory = program.trajectory().map_err(Failure::input)?;
    let (at, _) = machine::load_cell(rig).map_err(Failure::input)?;
    let sensors = ranges::ideal(rig, &at).ok_or_else(|| {
        Failure::input("the rig file has no [[imu]] that says where the IMU is and how it is turned")
    })?;
    recording.warnings.iter().for_each(|warning| tell!("rigident: {warning}"));
    let run = ImuRun::new(&trajectory, sensors, &prepared.input.readings, prepared.input.rate_hz);
    let found = fit(&run, &FitOptions::default(), &Silent).map_err(Failure::input)?;
    let values: Vec<f64> = (0..found.parameters.len())
        .map(|j| found.estimate.measured(j).map_or(0.0, |measured| measured.value))
        .collect();
    let [of_gyro, of_accelerometer] = run.unexplained(&values);
    if of_gyro.max(of_accelerometer) > UNEXPLAINED {
        return Err(Failure::input(format!(
            "the IMU was not driven through this program: it leaves {:.0} % of what the gyro read and {:.0} % of what the accelerometer read \
             unexplained (at most {:.0} %); give --plan or --duration-s of the run",
            100.0 * of_gyro,
            100.0 * of_accelerometer,
            100.0 * UNEXPLAINED
        )));
    }
    let whole = (0..found.parameters.len()).all(|j| found.estimate.measured(j).is_some());
    if arguments.json {
        let parameters = found.parameters.iter().enumerate().map(|(j, parameter)| {
            let measured = found.estimate.measured(j);
            Found {
                name: &parameter.name,
                unit: &parameter.unit,
                value: measured.map(|m| m.value),
                u95: measured.map(|m| m.u95),
            }
        });
        let object = Object { begins_s: run.begins_s(), parameters: parameters.collect() };
        say(serde_json::to_string(&object).map_err(Failure::input)?);
    } else {
        say(text(&found, run.begins_s()));
    }
    Ok(ExitStatus::of(whole).into())
}

fn text(found: &Fit, begins_s: f64) -> String {
    let cell = |axis: usize, k: usize| match found.estimate.measured(OF_AN_AXIS * axis + k) {
        Some(m) => with_u95(m.value, m.u95, ""),
        None => "this motion leaves it open".to_owned(),
    };
    let mut text = format!(
        "The program began {begins_s:.3} s after the first reading.\n\n{:<8}{:>24}{:>24}{:>24}{:>26}",
        "", "bias", "of x", "of y", "of z"
    );
    for (axis, name) in AXES.iter().enumerate() {
        let unit = if axis < 3 { "rad/s" } else { "m/s2" };
        text += &format!(
            "\n  {name:<6}{:>24}{:>24}{:>24}{:>24}",
            cell(axis, 0),
            cell(axis, 1),
            cell(axis, 2),
            cell(axis, 3)
        );
        text += &format!("  {unit}");
    }
    let value = |axis: usize, k: usize| found.estimate.measured(OF_AN_AXIS * axis + k).map(|m| m.value);
    let three = |value: &dyn Fn(usize) -> Option<f64>| -> Option<String> {
        let [x, y, z] = [value(0)?, value(1)?, value(2)?];
        Some(format!("[{x:.6}, {y:.6}, {z:.6}]"))
    };
    let scale = three(&|k| value(3 + k, 1 + k).map(|own| 1.0 / own));
    let accel = three(&|k| Some(value(3 + k, 0)? / value(3 + k, 1 + k)?));
    if let (Some(scale), Some(accel), Some(gyro)) = (scale, accel, three(&|k| value(k, 0))) {
        text += &format!(
            "\n\nIn the rig file's [[imu]]:\n  accel_scale = {scale}\n  accel_bias_mps2 = {accel}\n  gyro_bias_radps = {gyro}"
        );
    }
    text
}

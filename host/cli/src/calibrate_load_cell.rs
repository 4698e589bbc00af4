//! `rigident calibrate load-cell`: the 6 × 6 matrix from known weights at known places.

use std::fmt::Write as _;
use std::process::ExitCode;

use serde::Serialize;

use super::calibrate_joints::{positive, text_of};
use super::calibration_arguments::CalibrateLoadCell;
use super::outcome::say;
use super::{ExitStatus, Failure, factor};
use rigident::fit::figures::significant;
use rigident::load_cell::matrix::Matrix;
use rigident::load_cell::{COARSEST, COMPONENTS, Uncertainty, calibrate, table};
use rigident_io::recording::Recording;
use rigident_io::recording::new_file::write_new_text;
use rigident_io::rig::is_number_of_chip;

/// Residuals above this share of full scale are said: places known to 0.3 mm leave less.
const LARGE_RESIDUAL: f64 = 5e-3;
/// A stretch of a recording has at least this many readings.
const FEWEST: usize = 10;

/// The object of `--json`.
#[derive(Serialize)]
struct Object<'a> {
    schema: &'static str,
    status: &'static str,
    loadings: usize,
    /// `wrench = calibration · gauges`, N/V and N m/V; not there where it is too coarse to be used.
    #[serde(skip_serializing_if = "Option::is_none")]
    calibration: Option<[[f64; 6]; 6]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    calibration_u95: Option<[[f64; 6]; 6]>,
    gain_uncertainty: [f64; 6],
    crosstalk_std: f64,
    error_u95: [[f64; 6]; 6],
    full_scale_n_nm: [f64; 2],
    zeros_v: &'a [[f64; 6]],
    reading_std_v: f64,
    condition_number: f64,
    largest_residual: f64,
    residuals_n_nm: &'a [[f64; 6]],
    warnings: Vec<String>,
}

/// `rigident calibrate load-cell`
pub(super) fn run(arguments: &CalibrateLoadCell) -> Result<ExitCode, Failure> {
    if let Some(path) = &arguments.output {
        factor::absent(path)?;
    }
    let uncertainty = uncertainty(arguments)?;
    let board_id = arguments.board_id.as_deref();
    if let Some(id) = board_id.filter(|id| !is_number_of_chip(id)) {
        return Err(Failure::input(format!(
            "--board-id {id}: must be 24 hexadecimal digits, as `rigident info` shows under unique_id"
        )));
    }
    if !(9.0..=10.0).contains(&arguments.gravity_mps2) {
        let given = arguments.gravity_mps2;
        return Err(Failure::input(format!("--gravity-mps2 {given}: on Earth it is between 9.76 and 9.84")));
    }
    let source = arguments.loads.display().to_string();
    let text = text_of(&arguments.loads)?;
    let recording = arguments.recording.as_ref().map(|path| Recording::load(path, None)).transpose();
    let recording = recording.map_err(Failure::input)?;
    let stretch = recording.as_ref().map(|recording| |from: f64, to: f64| mean_gauges(recording, from, to));
    let stretch = stretch.as_ref().map(|stretch| stretch as table::Stretch<'_>);
    let loadings = table::parse(&text, &source, arguments.gravity_mps2, stretch).map_err(Failure::input)?;
    let matrix =
        calibrate(&loadings, &uncertainty).map_err(|error| Failure::input(format!("{source}: {error}")))?;
    let good = matrix.worst_u95() <= COARSEST;
    let warnings = warnings(&matrix, good);
    warnings.iter().for_each(|warning| tell!("rigident: {warning}"));
    if let (Some(path), true) = (&arguments.output, good) {
        write_new_text(path, &rig_table(&matrix, board_id)).map_err(Failure::input)?;
    }
    if arguments.json {
        let object = Object {
            schema: "rigident/load-cell/1",
            status: if good { "identified" } else { "not_identified" },
            loadings: loadings.len(),
            calibration: good.then_some(matrix.matrix),
            calibration_u95: good.then_some(matrix.matrix_u95),
            gain_uncertainty: matrix.gain_std,
            crosstalk_std: matrix.crosstalk_std,
            error_u95: matrix.error_u95,
            full_scale_n_nm: matrix.full_scale,
            zeros_v: &matrix.zeros_v,
            reading_std_v: matrix.reading_v,
            condition_number: matrix.condition_number,
            largest_residual: matrix.largest_residual,
            residuals_n_nm: &matrix.residuals,
            warnings,
        };
        say(serde_json::to_string_pretty(&object).map_err(Failure::input)?);
    } else {
        say(shown(&matrix, loadings.len()));
        if good {
            say(format_args!("\nFor the rig file:\n\n{}", rig_table(&matrix, board_id).trim_end()));
        }
    }
    Ok(ExitStatus::of(good).into())
}

fn uncertainty(arguments: &CalibrateLoadCell) -> Result<Uncertainty, Failure> {
    let from_zero = |option: &str, value: f64, most: f64| {
        if (0.0..=most).contains(&value) {
            Ok(value)
        } else {
            Err(Failure::input(format!("{option} {value}: must be from 0 to {most}")))
        }
    };
    let noise = arguments.reading_noise_v;
    let reading_v = noise.map(|noise| positive("--reading-noise-v", noise)).transpose()?;
    Ok(Uncertainty {
        mass: 1e-2 * from_zero("--mass-noise-percent", arguments.mass_noise_percent, 10.0)?,
        place_m: 1e-3 * from_zero("--place-noise-mm", arguments.place_noise_mm, 50.0)?,
        level_rad: from_zero("--level-noise-deg", arguments.level_noise_deg, 10.0)?.to_radians(),
        reading_v,
    })
}

/// Mean voltages of a stretch of a recording.
fn mean_gauges(recording: &Recording, from_s: f64, to_s: f64) -> Result<[f64; 6], String> {
    let gauges = recording.gauges.as_ref().ok_or("the recording has no voltages g1_v to g6_v")?;
    let inside = |time_ns: &u64| (from_s..=to_s).contains(&(*time_ns as f64 * 1e-9));
    let rows: Vec<&[f64; 6]> =
        gauges.iter().zip(&recording.time_ns).filter(|(_, time)| inside(time)).map(|(row, _)| row).collect();
    let usable = rows.iter().all(|row| row.iter().all(|v| v.is_finite()));
    if rows.len() < FEWEST || !usable {
        return Err(format!(
            "from {from_s} to {to_s} s the recording has {} usable readings of six bridges",
            rows.len()
        ));
    }
    let mean = |k: usize| rows.iter().map(|row| row[k]).sum::<f64>() / rows.len() as f64;
    Ok(std::array::from_fn(mean))
}

fn warnings(matrix: &Matrix, good: bool) -> Vec<String> {
    let mut warnings = Vec::new();
    if !good {
        warnings.push(format!(
            "the matrix is known to {:.0} % of full scale only, and not written: load the cell in more directions and places, heavier, or state \
             smaller uncertainties if they are",
            100.0 * matrix.worst_u95()
        ));
    }
    if matrix.largest_residual > LARGE_RESIDUAL {
        warnings.push(format!(
            "the matrix leaves up to {:.2} % of full scale of a loading: bridges that bend, stick or creep, or places that are not as typed in",
            100.0 * matrix.largest_residual
        ));
    }
    if matrix.condition_number > 20.0 {
        warnings.push(format!(
            "condition number {:.0}: the bridges hardly tell some wrenches apart; is a bar without load, or are two side by side?",
            matrix.condition_number
        ));
    }
    warnings
}

/// The tables of what it reads at full scale.
fn shown(matrix: &Matrix, loadings: usize) -> String {
    let mut text = format!(
        "{loadings} loadings up to {} N and {} N m; a mean reading scatters by {} µV; condition number {:.1};\nthe largest residual is {:.2} % of full \
         scale.\n\nU95 of what is read, % of full scale, where one component alone is at full scale:\n\n read ",
        significant(matrix.full_scale[0], 3),
        significant(matrix.full_scale[1], 3),
        significant(1e6 * matrix.reading_v, 2),
        matrix.condition_number,
        100.0 * matrix.largest_residual
    );
    COMPONENTS.iter().for_each(|name| text += &format!("{name:>8}"));
    for (name, row) in COMPONENTS.iter().zip(&matrix.error_u95) {
        let _ = write!(text, "\n {name:<5}");
        row.iter().for_each(|u95| text += &format!("{:>8.3}", 100.0 * u95));
    }
    text
}

/// The keys of the rig file.
fn rig_table(matrix: &Matrix, board_id: Option<&str>) -> String {
    let board = board_id.map_or_else(String::new, |id| format!("board_id = \"{id}\"\n"));
    let row = |row: &[f64; 6]| format!("  [{}],\n", row.map(|v| format!("{v:.8e}")).join(", "));
    format!(
        "[load_cell]\ncalibration = [\n{}]\ngain_uncertainty = [{}]\ncrosstalk_std = {:.2e}\n{board}",
        matrix.matrix.iter().map(row).collect::<String>(),
        matrix.gain_std.map(|sd| format!("{sd:.2e}")).join(", "),
        matrix.crosstalk_std
    )
}

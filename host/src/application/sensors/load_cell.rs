//! The 6 × 6 matrix of a load cell from known weights at known places.

use std::fmt;
use std::path::{Path, PathBuf};

use hexapod::STANDARD_GRAVITY_MPS2;
use serde::Serialize;

use super::super::calibrate_error::CalibrateError;
use super::super::{Caller, Error};
use rigident_fit::Progress;
use rigident_fit::figures::significant;
use rigident_identify::load_cell::matrix::Matrix;
use rigident_identify::load_cell::{COARSEST, COMPONENTS, Uncertainty, calibrate, table};
use rigident_io::recording::Recording;
use rigident_io::rig::is_number_of_chip;

/// Residuals above this share of full scale are said: places known to 0.3 mm leave less.
const LARGE_RESIDUAL: f64 = 5e-3;
/// A matrix that enlarges errors of bridges by more is said.
const LARGE_CONDITION: f64 = 20.0;
/// A stretch of a recording has at least this many readings.
const FEWEST: usize = 10;

/// Options of the calibration of a load cell.
#[derive(Clone, Debug)]
pub struct LoadCellOptions {
    /// The recording that `from_s` and `to_s` of the loadings are of.
    pub recording: Option<PathBuf>,
    /// The uncertainty of the loadings.
    pub uncertainty: Uncertainty,
    /// Gravity where the weights hang, m/s².
    pub gravity_mps2: f64,
    /// Number of the board that read the bridges, 24 hexadecimal digits, for the rig file.
    pub board_id: Option<String>,
}

impl Default for LoadCellOptions {
    fn default() -> Self {
        Self {
            recording: None,
            uncertainty: Uncertainty::default(),
            gravity_mps2: STANDARD_GRAVITY_MPS2,
            board_id: None,
        }
    }
}

/// The matrix of a load cell; its text is the table of its errors.
#[derive(Clone, Debug, Serialize)]
pub struct CalibratedLoadCell {
    /// Name of this object.
    pub schema: &'static str,
    /// `identified`, or `not_identified` where the matrix is too coarse to be used.
    pub status: &'static str,
    /// Number of loadings.
    pub loadings: usize,
    /// `wrench = calibration · gauges`, N/V and N m/V; `None` where it is too coarse to be used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration: Option<[[f64; 6]; 6]>,
    /// 95 % expanded uncertainty of its entries.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration_u95: Option<[[f64; 6]; 6]>,
    /// The matrix with its errors.
    #[serde(flatten)]
    pub matrix: Matrix,
    /// Warnings that the user should act on.
    pub warnings: Vec<String>,
    #[serde(skip)]
    board_id: Option<String>,
}

/// Finds the matrix of a load cell from a table of loadings, CSV.
///
/// # Errors
/// The table or the recording cannot be read, or the loadings are too few or contradict each other; the
/// caller stops the job.
///
/// ```
/// use rigident::application::{Caller, LoadCellOptions, load_cell};
///
/// let folder = tempfile::tempdir().unwrap();
/// let path = folder.path().join("weights.csv");
/// // Bridges that each see one component, 10 µV/N and 100 µV/(N m).
/// let mut text = "mass_kg,x_m,y_m,z_m,down_x,down_y,down_z,g1_v,g2_v,g3_v,g4_v,g5_v,g6_v\n".to_owned();
/// for (down, places) in [
///     ([0.0, 0.0, -1.0], [[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, -0.1, 0.0]]),
///     ([1.0, 0.0, 0.0], [[0.0, 0.1, 0.0], [0.0, -0.1, 0.0], [0.0, 0.0, 0.1], [0.0, 0.0, 0.0]]),
///     ([0.0, 1.0, 0.0], [[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0], [0.0, 0.0, 0.1], [0.0, 0.0, 0.0]]),
/// ] {
///     for [x, y, z] in places {
///         for mass in [0.0, 1.0, 2.0] {
///             let f: [f64; 3] = down.map(|d: f64| -mass * 9.80665 * d);
///             let m = [y * f[2] - z * f[1], z * f[0] - x * f[2], x * f[1] - y * f[0]];
///             let [a, b, c] = down;
///             let wrench = [f[0], f[1], f[2], 10.0 * m[0], 10.0 * m[1], 10.0 * m[2]];
///             let v = wrench.map(|w| format!("{}", 1e-5 * w));
///             text += &format!("{mass},{x},{y},{z},{a},{b},{c},{}\n", v.join(","));
///         }
///     }
/// }
/// std::fs::write(&path, text).unwrap();
/// let found = load_cell(&path, &LoadCellOptions::default(), &Caller::default())?;
/// let (matrix, u95) = (found.calibration.unwrap(), found.calibration_u95.unwrap());
/// assert!((matrix[2][2] - 1e5).abs() < u95[2][2]);
/// # Ok::<(), rigident::application::Error>(())
/// ```
pub fn load_cell(
    loads: &Path,
    options: &LoadCellOptions,
    caller: &Caller<'_>,
) -> Result<CalibratedLoadCell, Error> {
    caller.stoppable(|| found(loads, options, caller))
}

fn found(loads: &Path, options: &LoadCellOptions, caller: &Caller<'_>) -> Result<CalibratedLoadCell, Error> {
    if let Some(id) = options.board_id.as_ref().filter(|id| !is_number_of_chip(id)) {
        return Err(CalibrateError::BoardId(id.clone()).into());
    }
    if !(9.0..=10.0).contains(&options.gravity_mps2) {
        return Err(CalibrateError::Gravity(options.gravity_mps2).into());
    }
    caller.stage("matrix of the load cell", 0.0);
    let source = loads.display().to_string();
    let text = Error::text_of(loads)?;
    let recording = options.recording.as_ref().map(|path| Recording::load(path, None)).transpose()?;
    let stretch = recording.as_ref().map(|recording| |from: f64, to: f64| mean_gauges(recording, from, to));
    let stretch = stretch.as_ref().map(|stretch| stretch as table::Stretch<'_>);
    let loadings =
        table::parse(&text, &source, options.gravity_mps2, stretch).map_err(CalibrateError::from)?;
    let matrix = calibrate(&loadings, &options.uncertainty)
        .map_err(|error| Error::from(CalibrateError::from(error)).of(source))?;
    let is_good = matrix.worst_u95() <= COARSEST;
    Ok(CalibratedLoadCell {
        schema: "rigident/load-cell/1",
        status: if is_good { "identified" } else { "not_identified" },
        loadings: loadings.len(),
        calibration: is_good.then_some(matrix.matrix),
        calibration_u95: is_good.then_some(matrix.matrix_u95),
        warnings: warnings(&matrix, is_good),
        matrix,
        board_id: options.board_id.clone(),
    })
}

/// Returns mean voltages of a stretch of a recording.
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

fn warnings(matrix: &Matrix, is_good: bool) -> Vec<String> {
    let mut warnings = Vec::new();
    if !is_good {
        warnings.push(format!(
            "the matrix is known to {:.0} % of full scale only, and not written: load the cell in more \
             directions and places, heavier, or state \
             smaller uncertainties if they are",
            100.0 * matrix.worst_u95()
        ));
    }
    if matrix.largest_residual > LARGE_RESIDUAL {
        warnings.push(format!(
            "the matrix leaves up to {:.2} % of full scale of a loading: bridges that bend, stick or creep, \
             or places that are not as typed in",
            100.0 * matrix.largest_residual
        ));
    }
    if matrix.condition_number > LARGE_CONDITION {
        warnings.push(format!(
            "condition number {:.0}: the bridges hardly tell some wrenches apart; is a bar without load, or \
             are two side by side?",
            matrix.condition_number
        ));
    }
    warnings
}

impl CalibratedLoadCell {
    /// Returns true if the matrix is fine enough to be used.
    pub fn is_identified(&self) -> bool {
        self.calibration.is_some()
    }

    /// Returns the keys of the rig file, TOML; `None` where the matrix is too coarse to be used.
    pub fn rig_table(&self) -> Option<String> {
        let board = self.board_id.as_ref().map_or_else(String::new, |id| format!("board_id = \"{id}\"\n"));
        let row = |row: &[f64; 6]| format!("  [{}],\n", row.map(|v| format!("{v:.8e}")).join(", "));
        let rows: String = self.calibration?.iter().map(row).collect();
        Some(format!(
            "[load_cell]\ncalibration = [\n{rows}]\ngain_uncertainty = [{}]\ncrosstalk_std = {:.2e}\n{board}",
            self.matrix.gain_std.map(|sd| format!("{sd:.2e}")).join(", "),
            self.matrix.crosstalk_std
        ))
    }
}

impl fmt::Display for CalibratedLoadCell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let matrix = &self.matrix;
        write!(
            f,
            "{} loadings up to {} N and {} N m; a mean reading scatters by {} µV; condition number \
             {:.1};\nthe largest residual is {:.2} % of full \
             scale.\n\nU95 of what is read, % of full scale, where one component alone is at full scale:\n\n \
             read ",
            self.loadings,
            significant(matrix.full_scale[0], 3),
            significant(matrix.full_scale[1], 3),
            significant(1e6 * matrix.reading_v, 2),
            matrix.condition_number,
            100.0 * matrix.largest_residual
        )?;
        COMPONENTS.iter().try_for_each(|name| write!(f, "{name:>8}"))?;
        for (name, row) in COMPONENTS.iter().zip(&matrix.error_u95) {
            write!(f, "\n {name:<5}")?;
            row.iter().try_for_each(|u95| write!(f, "{:>8.3}", 100.0 * u95))?;
        }
        Ok(())
    }
}

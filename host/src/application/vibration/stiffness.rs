//! The springs of a platform by a body that is known.

use std::fmt;
use std::path::{Path, PathBuf};

use nalgebra::{DMatrix, DVector, Matrix6};
use serde::Serialize;

use super::super::calibrate_error::CalibrateError;
use super::super::vibration_error::VibrationError;
use super::super::{Caller, Error};
use rigident_fit::Progress;
use rigident_fit::figures::significant;
use rigident_identify::reference::ReferenceBody;
use rigident_io::recording::Recording;
use rigident_vibration::suspension::bare::bare_parameters;
use rigident_vibration::suspension::free_decay::vibration;
use rigident_vibration::suspension::modal::Swing;
use rigident_vibration::suspension::springs::COORDINATES;
use rigident_vibration::suspension::stiffness::stiffness;
use rigident_vibration::suspension::support::Support;

/// The ratio of the residuals to those by chance from which on body, springs or modes contradict each other.
const CONTRADICTED: f64 = 4.0;

/// Options of the identification of the springs.
#[derive(Clone, Debug, Default)]
pub struct StiffnessOptions {
    /// The file of the body that is known.
    pub body: PathBuf,
    /// The mounting of the body: a name from its file; its own place if empty.
    pub mounting: String,
    /// Rig file. Default: `NAME.rig.toml` beside the recording.
    pub rig: Option<PathBuf>,
    /// The number of modes. Default: one for each coordinate that is free.
    pub modes: Option<usize>,
}

/// The stiffness of the springs; its text is the keys of the rig file.
#[derive(Clone, Debug, Serialize)]
pub struct IdentifiedStiffness {
    /// Name of this object.
    pub schema: &'static str,
    /// The recording.
    pub recording: String,
    /// Frequencies of the modes, Hz.
    pub modes_hz: Vec<f64>,
    /// The place that the stiffness is about, m.
    pub at_m: [f64; 3],
    /// The height at which the springs hold, m.
    pub anchor_height_m: f64,
    /// The stiffness, N/m, N, N m.
    pub stiffness: [[f64; 6]; 6],
    /// 1 σ of its elements.
    pub stiffness_element_std: [[f64; 6]; 6],
    /// The variance of the residuals, divided by the variance that chance gives.
    pub variance_ratio: f64,
    /// Degrees of freedom of what is left.
    pub degrees_of_freedom: f64,
    /// Findings about the modes.
    pub findings: Vec<String>,
    /// Warnings that the user should act on.
    pub warnings: Vec<String>,
    /// True if nothing contradicts the stiffness: neither what is left, nor the springs that the rig file
    /// states.
    #[serde(skip)]
    pub is_believed: bool,
    #[serde(skip)]
    keeps_springs: bool,
}

/// Finds the stiffness of a platform's springs from the free vibration of a body that is known.
///
/// # Errors
/// A file cannot be read, or the modes do not tell the stiffness; the caller stops the job.
///
/// ```
/// use rigident::application::{Caller, StiffnessOptions, vibration_stiffness};
/// # #[cfg(feature = "simulator")]
/// # {
/// use hexapod::BodyParameters;
/// use rigident::laboratory::suspended::Experiment;
///
/// let swing = Experiment::of_body(BodyParameters::thesis_horizontal(), 2e-4, 1).swing().unwrap();
/// let folder = tempfile::tempdir().unwrap();
/// let at = |name: &str| folder.path().join(name);
/// std::fs::write(at("swing.csv"), swing.to_csv()).unwrap();
/// std::fs::write(at("swing.rig.toml"), swing.rig.to_toml()).unwrap();
/// let body = "name = \"steel\"\nmass_kg = 20.0\nmass_std_kg = 2e-3\n[measured]\ncom_m = [0.0, 0.0, 0.053]\n\
///             com_std_m = [1e-4, 1e-4, 1e-4]\ninertia_com_kgm2 = [0.3813, 0.0185, 0.3791, 0.0, 0.0, 0.0]\n\
///             inertia_com_std_kgm2 = [1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3]\n";
/// std::fs::write(at("steel.toml"), body).unwrap();
/// let options = StiffnessOptions { body: at("steel.toml"), ..StiffnessOptions::default() };
/// let found = vibration_stiffness(&at("swing.csv"), &options, &Caller::default())?;
/// assert!(found.stiffness[2][2] > 0.0 && found.variance_ratio < 4.0);
/// # }
/// # Ok::<(), rigident::application::Error>(())
/// ```
pub fn vibration_stiffness(
    recording: &Path,
    options: &StiffnessOptions,
    caller: &Caller<'_>,
) -> Result<IdentifiedStiffness, Error> {
    caller.stoppable(|| found(recording, options, caller))
}

fn found(path: &Path, options: &StiffnessOptions, caller: &Caller<'_>) -> Result<IdentifiedStiffness, Error> {
    caller.stage(&format!("reading {}", path.display()), 0.0);
    let body = ReferenceBody::load(&options.body).map_err(CalibrateError::from)?;
    let mounting = body.mounting(&options.mounting).map_err(CalibrateError::from)?;
    let mut mounted = body.mounted(mounting);
    let recording = Recording::load(path, options.rig.as_deref())?;
    let name = recording.name.clone();
    let support = Support::of(&recording.rig, &name).map_err(VibrationError::from)?;
    let table = recording.rig.suspension.clone().unwrap_or_default();
    let mut warnings = recording.warnings.clone();
    if let Some((mean, covariance)) = bare_parameters(&table) {
        let own: [f64; 10] = std::array::from_fn(|k| mean[k]);
        mounted = mounted.with_fixture(&own, &DMatrix::from_fn(10, 10, |i, j| covariance[(i, j)]));
    }
    if table.platform.is_none() {
        warnings.push(
            "[suspension.platform] is not stated: the platform is taken to weigh nothing, and the springs \
             come out too soft for it"
                .to_owned(),
        );
    }
    caller.stage("modes", 0.1);
    let found = vibration(&recording, &support, options.modes).map_err(VibrationError::from)?;
    let shapes = &found.modes.shapes;
    found.judge(support.free.len()).map_err(|why| VibrationError::Refused { name: name.clone(), why })?;
    let known = (&DVector::from_column_slice(&mounted.parameters), &mounted.covariance());
    let swing = Swing::of_body(shapes, found.rests(&support));
    let springs = stiffness(&table, &support, &swing, known)
        .ok_or_else(|| VibrationError::FewModes { name: name.clone(), modes: shapes.modes.len() })?;
    let is_contradicted = springs.variance_ratio > CONTRADICTED;
    if is_contradicted {
        warnings.push(format!(
            "what is left is {:.1} times what chance gives: is the body the one on the platform, mounted so, \
             and anchor_height_m right?",
            springs.variance_ratio.sqrt()
        ));
    }
    let others = springs.other_than(&support.springs);
    if let Some((k, [stated, found, off])) = others.iter().max_by(|a, b| a.1[2].total_cmp(&b.1[2])) {
        warnings.push(format!(
            "[suspension] states {} along {}, this body says {}: {off:.0} times what both are uncertain; is \
             it the body of {}, mounted so? Springs that are \
             a guess have a stiffness_std of their own",
            significant(*stated, 4),
            COORDINATES[*k],
            significant(*found, 4),
            options.body.display()
        ));
    }
    Ok(IdentifiedStiffness {
        schema: "rigident/stiffness/1",
        recording: name,
        modes_hz: shapes.modes.iter().map(|mode| mode.hz()).collect(),
        at_m: table.at_m,
        anchor_height_m: support.preload.height_m(),
        stiffness: rows(&springs.stiffness),
        stiffness_element_std: rows(&springs.std),
        variance_ratio: springs.variance_ratio,
        degrees_of_freedom: springs.degrees_of_freedom,
        findings: found.modes.findings.iter().map(ToString::to_string).collect(),
        warnings,
        is_believed: !is_contradicted && others.is_empty(),
        keeps_springs: support.preload.is_more_than_a_height(),
    })
}

fn rows(matrix: &Matrix6<f64>) -> [[f64; 6]; 6] {
    std::array::from_fn(|i| std::array::from_fn(|j| matrix[(i, j)]))
}

impl fmt::Display for IdentifiedStiffness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let matrix = |name: &str, matrix: &[[f64; 6]; 6]| {
            let row = |row: &[f64; 6]| format!("  [{}],\n", row.map(|v| format!("{v:.3}")).join(", "));
            format!("\n{name} = [\n{}]", matrix.iter().map(row).collect::<String>())
        };
        let springs = if self.keeps_springs {
            "# keep the [[suspension.spring]] tables: they lean, or have a length, and say what the weight \
             does\n"
        } else {
            ""
        };
        write!(
            f,
            "# {}: {} modes; what is left is {:.2} times what chance gives ({:.0} degrees of \
             freedom)\n{springs}[suspension]\nat_m = {:?}\n\
             anchor_height_m = {:.6}{}{}",
            self.recording,
            self.modes_hz.len(),
            self.variance_ratio.sqrt(),
            self.degrees_of_freedom,
            self.at_m,
            self.anchor_height_m,
            matrix("stiffness", &self.stiffness),
            matrix("stiffness_element_std", &self.stiffness_element_std)
        )
    }
}

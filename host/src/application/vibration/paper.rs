//! The vibration paper's experiment, simulated and identified: three locked postures are struck and vibrate
//! freely, then link 1 is
//! released and swings.

use nalgebra::DVector;
use serde::Serialize;

use super::super::bare_platform::take_platform_off;
use super::super::vibration_error::VibrationError;
use super::super::{Caller, Error};
use rigident_fit::pool::PooledFactor;
use rigident_fit::{Fit, FitOptions, Measured, Progress, Silent, fit};
use rigident_identify::problem::{Problem, ProblemOptions};
use rigident_io::recording::Recording;
use rigident_io::rig::RigFile;
use rigident_laboratory::suspended::{Experiment, truth};
use rigident_model::Model;
use rigident_rows::named_model::rig_links;
use rigident_vibration::suspension::free_decay::vibration;
use rigident_vibration::suspension::posture_modes::{PostureModes, posture_rows};
use rigident_vibration::suspension::posture_sets::{OpenBounds, RANK, Subset};
use rigident_vibration::suspension::support::Support;

/// The name of the demonstration in messages.
const NAME: &str = "the demonstration";
/// Names of Table 4: M, MS and J of both links.
const NAMES: [&str; 19] = [
    "base.M", "base.MSx", "base.MSy", "base.MSz", "base.Jxx", "base.Jyy", "base.Jzz", "base.Jyz", "base.Jzx",
    "base.Jxy", "arm.MSx", "arm.MSy", "arm.MSz", "arm.Jxx", "arm.Jyy", "arm.Jzz", "arm.Jyz", "arm.Jzx",
    "arm.Jxy",
];
/// The place of Jyy of the base.
const JYY: usize = 5;
/// The values that the paper identified: its Table 4, row ID; mass was weighed.
const PAPER: [f64; 19] = [
    80.817, 0.0599, -20.2678, -7.6113, 8.9788, 2.3708, 7.6291, -2.5027, 0.0121, 0.0192, -0.0177, 0.3212,
    -2.6268, 0.5369, 0.5607, 0.0543, 0.0519, -0.0087, -0.0052,
];
/// Errors of the paper, Table 5: E_MS / M_0 in m and E_J / I_m of both links.
const PAPER_ERRORS: [[f64; 2]; 2] = [[0.0007, 0.0003], [0.003_657, 0.001_006]];
/// Largest moment that Table 5 divides by, kg m².
const LARGEST_MOMENT: f64 = 8.946;
/// Steps of the bounded search.
const STEPS: usize = 200;

/// The experiment of the vibration paper; its text is the tables.
#[derive(Clone, Debug, Serialize)]
pub struct PaperExperiment {
    /// Name of this object.
    pub schema: &'static str,
    /// Seed of the noise.
    pub seed: u64,
    /// Standard deviation of a marker's noise along each axis, mm.
    pub marker_noise_mm: f64,
    /// The quantities that the postures determine: Table 3.
    pub table_3: Vec<PaperRow>,
    /// The quantities that the postures and the motion determine together: Table 4.
    pub table_4: Vec<PaperRow>,
    /// The largest errors.
    pub table_5: Vec<PaperErrors>,
    /// Jyy of the base.
    pub jyy: PaperJyy,
    /// The recordings, the release last.
    #[serde(skip)]
    pub recordings: Vec<Recording>,
    /// Their rig file.
    #[serde(skip)]
    pub rig: RigFile,
    /// The factor of the postures and that of the release.
    #[serde(skip)]
    pub factors: [PooledFactor; 2],
}

/// A quantity beside its true value and the paper's.
#[derive(Clone, Debug, Serialize)]
pub struct PaperRow {
    /// The name of the quantity.
    pub name: String,
    /// The unit of the quantity.
    pub unit: String,
    /// The true value.
    pub truth: f64,
    /// The estimated value with its 95 % expanded uncertainty, if it is identified.
    #[serde(flatten)]
    pub measured: Option<Measured>,
    /// The paper's.
    pub paper: f64,
}

/// The largest errors of a link.
#[derive(Clone, Debug, Serialize)]
pub struct PaperErrors {
    /// The link.
    pub link: &'static str,
    /// Of its first moments by the whole mass, m.
    pub first_moment_by_mass_m: f64,
    /// The paper's.
    pub paper_first_moment_by_mass_m: f64,
    /// Of its tensor by the largest moment.
    pub tensor_by_largest: f64,
    /// The paper's.
    pub paper_tensor_by_largest: f64,
}

/// Jyy of the base by three ways, kg m².
#[derive(Clone, Debug, Serialize)]
pub struct PaperJyy {
    /// By a search within the bounds, as the paper.
    pub bounded_search: f64,
    /// In closed form.
    pub least_squares: f64,
    /// By all rows together.
    pub merged: f64,
    /// 95 % expanded uncertainty of that.
    pub merged_u95: f64,
    /// The least that it can be.
    pub least: f64,
    /// The most that it can be.
    pub most: f64,
    /// The true value.
    pub truth: f64,
    /// The paper's.
    pub paper: f64,
}

/// Simulates the experiment of the vibration paper and identifies it. Markers have white noise of
/// `marker_noise_mm` along each axis.
///
/// # Errors
/// Noise hides what the experiment shows; the caller stops the job.
///
/// ```no_run
/// use rigident::application::{Caller, vibration_paper};
///
/// let found = vibration_paper(1, 0.2, &Caller::default())?;
/// println!("{found}");
/// # Ok::<(), rigident::application::Error>(())
/// ```
pub fn vibration_paper(
    seed: u64,
    marker_noise_mm: f64,
    caller: &Caller<'_>,
) -> Result<PaperExperiment, Error> {
    caller.stoppable(|| found(seed, marker_noise_mm, caller))
}

fn found(seed: u64, marker_noise_mm: f64, caller: &Caller<'_>) -> Result<PaperExperiment, Error> {
    let experiment = Experiment::new([0.0; 3], 1e-3 * marker_noise_mm, seed);
    let rig = experiment.rig_file();
    caller.stage("simulating the postures", 0.0);
    let attitudes = Experiment::postures();
    let mut recordings = Vec::new();
    for (k, wxyz) in attitudes.iter().enumerate() {
        recordings.push(experiment.posture(k, *wxyz).map_err(simulated)?);
    }
    caller.stage("simulating the release", 0.2);
    let release = experiment.release().map_err(simulated)?;
    caller.stage("modes of the postures", 0.4);
    let model = rig_links::from_tables(&rig.link, NAME)?;
    let by_postures = by_postures(&recordings, &attitudes, &rig, &model.welded())?;
    caller.stage("the motion", 0.8);
    let problem = Problem::from_recording(&release, Some(&model), &ProblemOptions::default())?;
    let by_motion = fit(problem.source(), &FitOptions::default(), &Silent)?;
    recordings.push(release);
    let factors =
        [(&by_postures, "postures"), (&by_motion, "release")].map(|(fit, name)| PooledFactor::of(fit, name));
    let (table_3, table_4, jyy) = tables(&rig, &model.welded(), &factors)?;
    Ok(PaperExperiment {
        schema: "rigident/vibration-demo/1",
        seed,
        marker_noise_mm,
        table_5: table_5(&table_4),
        table_3,
        table_4,
        jyy,
        recordings,
        rig,
        factors,
    })
}

fn simulated(error: impl std::fmt::Display) -> VibrationError {
    VibrationError::Simulated(error.to_string())
}

/// Fits all postures as rows of the base parameters, the platform among them.
fn by_postures(
    recordings: &[Recording],
    attitudes: &[[f64; 4]],
    rig: &RigFile,
    model: &Model,
) -> Result<Fit, Error> {
    let support = Support::of(rig, NAME).map_err(VibrationError::from)?;
    let mut all = Vec::new();
    for (recording, wxyz) in recordings.iter().zip(attitudes) {
        let found = vibration(recording, &support, None).map_err(VibrationError::from)?;
        let name = recording.name.clone();
        found.judge(support.free.len()).map_err(|why| VibrationError::Refused { name: name.clone(), why })?;
        all.push(PostureModes { name, positions: wxyz.to_vec(), shapes: found.modes.shapes });
    }
    let source = posture_rows(model, &support, &all).map_err(VibrationError::from)?;
    Ok(fit(&source, &FitOptions::default(), &Silent)?)
}

/// Returns Tables 3 and 4, and Jyy.
fn tables(
    rig: &RigFile,
    model: &Model,
    [postures, motion]: &[PooledFactor; 2],
) -> Result<(Vec<PaperRow>, Vec<PaperRow>, PaperJyy), Error> {
    let without_offsets = PooledFactor::merged(vec![motion.clone()], false)?;
    let mut merged = PooledFactor::merged(vec![postures.clone(), motion.clone()], false)?.fit();
    let (mut alone, mut moving) = (postures.fit(), without_offsets.only(|p| p.kind.is_inertial()).fit());
    if let Some(table) = &rig.suspension {
        for found in [&mut merged, &mut alone, &mut moving] {
            take_platform_off(table, found)?;
        }
    }
    let subset = Subset::new(&merged.parameters, model);
    let truth = truth();
    let row = |name: &str, unit: String, measured: Option<Measured>| PaperRow {
        name: name.to_owned(),
        unit,
        truth: named(&truth, name),
        measured,
        paper: named(&PAPER, name),
    };
    let table_3 = subset.values(&alone).into_iter().map(|v| row(&v.name, v.unit, v.measured)).collect();
    let of_merged = |name: &str| {
        let at = merged.parameters.iter().position(|p| p.name == name);
        let unit = at.map_or_else(String::new, |at| merged.parameters[at].unit.clone());
        row(name, unit, at.and_then(|at| merged.estimate.measured(at)))
    };
    let table_4: Vec<PaperRow> = NAMES.into_iter().map(of_merged).collect();
    let known = table_4[JYY].measured.zip(subset.bounds(&alone, None));
    let jyy = known.and_then(|(found, bounds)| jyy(&subset, [&alone, &moving], &bounds, found));
    Ok((table_3, table_4, jyy.ok_or(VibrationError::PaperIncomplete)?))
}

/// Returns a quantity of Φ_s or of Table 4 by its name, from the 19 values of Table 4.
fn named(all: &[f64; 19], name: &str) -> f64 {
    let of = |name: &str| NAMES.iter().position(|own| *own == name).map_or(f64::NAN, |k| all[k]);
    if name == "sum of Jyy" {
        return of("base.Jyy") + of("arm.Jyy");
    }
    match name.strip_suffix("-Jyy") {
        Some(first) => of(first) - of(&format!("{}.Jyy", first.split('.').next().unwrap_or_default())),
        None => of(name),
    }
}

/// Returns the largest errors of each link: of its first moments, divided by the whole mass, and of its
/// tensor, divided by the largest moment.
fn table_5(table_4: &[PaperRow]) -> Vec<PaperErrors> {
    let value = |row: &PaperRow| row.measured.map_or(f64::NAN, |m| m.value);
    let error = |range: std::ops::Range<usize>| {
        table_4[range].iter().map(|row| (value(row) - row.truth).abs()).fold(0.0, f64::max)
    };
    let of = |link: &'static str, k: usize, from: usize| PaperErrors {
        link,
        first_moment_by_mass_m: error(from..from + 3) / truth()[0],
        paper_first_moment_by_mass_m: PAPER_ERRORS[0][k],
        tensor_by_largest: error(from + 3..from + 9) / LARGEST_MOMENT,
        paper_tensor_by_largest: PAPER_ERRORS[1][k],
    };
    vec![of("base", 0, 1), of("arm", 1, 10)]
}

/// Returns Jyy of the base with Φ_s from the postures: by a search within the bounds, and in closed form,
/// beside the merged value.
fn jyy(
    subset: &Subset,
    [alone, moving]: [&Fit; 2],
    bounds: &OpenBounds,
    merged: Measured,
) -> Option<PaperJyy> {
    let identified = subset.factor(&alone.scaled_factor()).solve(RANK);
    let there = subset.factor(&moving.scaled_factor());
    let (r, z) = (there.r(), DVector::from_column_slice(there.z()));
    let [arm] = *subset.open() else { return None };
    // The open column is Jyy of the arm: Σ Jyy less that of the base.
    let sum = alone.parameters.iter().position(|p| p.name == NAMES[JYY])?;
    let mut psi = DVector::from_vec(identified.estimate);
    let total = psi[sum];
    psi[arm] = 0.0;
    let left = &z - &r * &psi;
    let column = r.column(arm);
    let residual = |base: f64| (&left - column * (total - base)).norm_squared();
    let (mut low, mut high) = (bounds.least, bounds.most);
    for _ in 0..STEPS {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if residual(a) < residual(b) { high = b } else { low = a }
    }
    let closed = total - column.dot(&left) / column.norm_squared();
    Some(PaperJyy {
        bounded_search: 0.5 * (low + high),
        least_squares: closed,
        merged: merged.value,
        merged_u95: merged.u95,
        least: bounds.least,
        most: bounds.most,
        truth: truth()[JYY],
        paper: PAPER[JYY],
    })
}

//! The body by the modes of a swing, as far as its modes and springs can be true.
//!
//! This is the one place that judges a swing: a motion, a factor, a posture on the same springs hang on the
//! same verdict.

use nalgebra::{Matrix6, SVector};

use super::free_decay::{Vibration, vibration};
use super::modal::{ModalSource, Swing, mass_matrix};
use super::support::Support;
use super::suspects::{judged_rests, suspects};
use crate::modal_analysis::{Finding, Severity};
use rigident_fit::{Fit, FitOptions, Silent, fit};
use rigident_io::recording::Recording;
use rigident_rows::body;

/// Parameters of a body.
const TEN: usize = 10;
/// A wrong mode would move the answer: this many of the modes that there are may be missing.
const MAY_MISS: usize = 1;
/// Residuals by what noise and errors of the springs explain: more is an error of the model, which no wider
/// interval covers.
const SYSTEMATIC: f64 = 2.5;
/// The possible faults where a rest is not where modes and springs let it be.
const REST: &str = "look whether springs are stiffer at rest than in motion or the further they are drawn, \
                    at their own mass, at the mass that was added and its place, and whether cameras or \
                    springs were moved between both";
/// The possible faults where residuals are systematic.
const LEFT: &str = "look at the stiffness and its σ, places and axes of the springs, their length, preload \
                    and mass, anchor_height_m, units and frames of poses, a part that is loose, and what the \
                    springs stand on";

/// A line so near to a mode, relative to its frequency, may be another mode.
const BESIDE: f64 = 0.25;

/// A missing mode whose frequency is further than this ratio from all others is in none of them.
const APART: f64 = 1.3;

/// The reason why modes give no body.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refused {
    /// The springs are not those that are stated, or not linear: the motion gives no body either.
    #[error("{0}")]
    Springs(String),
    /// The modes are not all there, or not distinguished: the motion may give a body.
    #[error("{0}")]
    Modes(String),
}

impl Vibration {
    /// Judges the modes of a platform with the given number of free coordinates.
    ///
    /// # Errors
    /// [`Refused`] says why they are not to be continued.
    pub fn judge(&self, free: usize) -> Result<(), Refused> {
        let first = |of: &dyn Fn(&Finding) -> bool| {
            self.modes.findings.iter().find(|finding| of(finding)).map(ToString::to_string)
        };
        let changes = first(&Finding::is_change);
        let too_large = first(&|f| f.is_change() && f.severity() == Severity::Error);
        let lacks = first(&|f| matches!(f, Finding::MissingModes { .. } | Finding::TooClose { .. }));
        // Two modes that are taken for one seem to change their frequency, as one decays faster, and leave a
        // line beside it.
        let beside = first(&|f| match f {
            Finding::OtherLine { hz, .. } | Finding::Harmonic { line_hz: hz, .. } => {
                self.is_beside_a_mode(*hz)
            }
            _ => false,
        });
        match (lacks, changes, beside) {
            (Some(lacks), Some(other), _) | (Some(lacks), None, Some(other)) => {
                Err(Refused::Springs(format!(
                    "{lacks}; and {other}. Either two modes near each other are taken for one, or the \
                 springs are not linear: strike the platform so that it moves in all directions, more \
                 gently, and shift a mass so that the frequencies part"
                )))
            }
            _ => too_large.map_or_else(|| self.lacking(free), |change| Err(Refused::Springs(change))),
        }
    }

    fn is_beside_a_mode(&self, hz: f64) -> bool {
        self.modes.shapes.modes.iter().any(|mode| (hz - mode.hz()).abs() < BESIDE * mode.hz())
    }

    fn lacking(&self, free: usize) -> Result<(), Refused> {
        if self.modes.shapes.modes.len() + MAY_MISS >= free {
            return Ok(());
        }
        let worst = self.modes.findings.iter().find(|finding| finding.severity() == Severity::Error);
        worst.map_or(Ok(()), |finding| Err(Refused::Modes(finding.to_string())))
    }
}

/// Returns the fit of everything that swings to its modes, and to the rests that the rig file states.
///
/// # Errors
/// [`Refused`] if modes or springs cannot be true.
pub fn by_modes(support: &Support, found: &Vibration) -> Result<Fit, Refused> {
    found.judge(support.free.len())?;
    let shapes = &found.modes.shapes;
    let rests = found.rests(support);
    if let Some(off) = judged_rests(support, found).iter().find(|own| own.is_off()) {
        return Err(Refused::Springs(format!("{off}; {REST}")));
    }
    let swing = Swing::of_body(shapes, rests);
    let source = ModalSource::new(std::slice::from_ref(&swing), support, body::parameters(TEN), 0)
        .ok_or_else(|| Refused::Modes("the covariance of the modes has no inverse".to_owned()))?;
    let fit = fit(&source, &FitOptions::default(), &Silent).map_err(|e| Refused::Modes(e.to_string()))?;
    let left = fit.noise.variance_ratio.sqrt();
    if left > SYSTEMATIC {
        let blamed = suspects(support, &swing).unwrap_or_default();
        return Err(Refused::Springs(format!(
            "the modes leave {left:.1} times what their noise and the springs' errors explain{blamed}; {LEFT}"
        )));
    }
    missing_is_apart(support, found, &fit)?;
    Ok(fit)
}

/// Refuses the modes where the one that was not found is expected beside another: both may be in that one's
/// shape.
fn missing_is_apart(support: &Support, found: &Vibration, fit: &Fit) -> Result<(), Refused> {
    let modes = &found.modes.shapes.modes;
    if modes.len() + 1 != support.free.len() {
        return Ok(());
    }
    let values = fit.estimate.unjudged().values;
    let ten = support.mount.map() * SVector::<f64, TEN>::from_fn(|k, _| values[k]);
    let Some(expected) = frequencies(support, &std::array::from_fn(|k| ten[k])) else { return Ok(()) };
    let own: Vec<f64> = modes.iter().map(|mode| mode.hz()).collect();
    // Both rise: leaving one of the expected out pairs the others.
    let off = |missing: usize| -> f64 {
        let others = expected.iter().enumerate().filter(|(k, _)| *k != missing);
        others.zip(&own).map(|((_, a), b)| (a / b).ln().powi(2)).sum()
    };
    let missing = (0..expected.len()).min_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap_or(0);
    let hz = expected[missing];
    let ratio = |own: &f64| (own / hz).max(hz / own);
    match own.into_iter().min_by(|a, b| ratio(a).total_cmp(&ratio(b))) {
        Some(nearest) if ratio(&nearest) < APART => Err(Refused::Modes(format!(
            "a mode is missing; springs and the other modes let it be at {hz:.2} Hz, beside that at \
             {nearest:.2} Hz: both may be taken for one; strike the platform so that it moves in all \
             directions, or shift a mass so that the frequencies part"
        ))),
        _ => Ok(()),
    }
}

/// Returns the frequencies of ten parameters about O on the springs, rising, Hz; `None` if no body has them.
fn frequencies(support: &Support, ten: &[f64; TEN]) -> Option<Vec<f64>> {
    let free = &support.free;
    let part = |all: &Matrix6<f64>| all.select_rows(free).select_columns(free);
    let mass = part(&mass_matrix(ten)).cholesky()?.l().try_inverse()?;
    let stiffness = part(&(support.springs.stiffness() + support.preload.stiffness(ten)));
    let values = (&mass * stiffness * mass.transpose()).symmetric_eigenvalues();
    let mut all: Vec<f64> =
        values.iter().map(|square| square.max(0.0).sqrt() / std::f64::consts::TAU).collect();
    all.sort_by(f64::total_cmp);
    (all.first().copied().unwrap_or(0.0) > 0.0).then_some(all)
}

/// Returns why a recording of one body on springs cannot be true by its modes; `Err` with the reason if there
/// are no modes to judge by.
///
/// # Errors
/// The reason in words, with its consequence.
pub fn contradiction(recording: &Recording, support: &Support) -> Result<Option<String>, String> {
    let unknown = |why: String| format!("nothing says whether the springs are as stated, and linear: {why}");
    let found = vibration(recording, support, None).map_err(|e| unknown(e.to_string()))?;
    match by_modes(support, &found) {
        Ok(_) => Ok(None),
        Err(Refused::Springs(why)) => Ok(Some(why)),
        Err(Refused::Modes(why)) => Err(unknown(why)),
    }
}

//! The tool that a person holds: its own parameters from motions with it and without it.
//!
//! With K the weights of the ten parameters of the link that holds it in the base parameters φ, motions with
//! the tool are rows over `φ + K τ`, those without over φ. Both factors and the table are merged. Joint
//! centres, markers of the hand, whose axes τ is in, skin that slides and errors of plates are the same in
//! both, and are counted as they move τ.

use nalgebra::{DMatrix, DVector, Vector4};

use super::calibration::{Drawn, draws, factor_as};
use super::error::{DrawError, StudyError};
use super::segments::centre_of_mass;
use super::study::{Study, held_sigma, known};
use crate::person::Person;
use rigident_fit::pool::PooledFactor;
use rigident_fit::{COVERAGE_95, Factor, Measured, Solution};
use rigident_identify::answer::person::ToolResult;
use rigident_identify::answer::standard_beside::joined;
use rigident_io::motion_capture::trial::Trial;

/// Markers that show the place and the attitude of a link.
const WHOLE_PLACE: usize = 3;

/// Returns the number of the link that holds a tool.
///
/// # Errors
/// [`StudyError::NoFrames`] if the model has none of that name, or too few markers show how it turns.
pub fn holding(person: &Person, link: &str) -> Result<usize, StudyError> {
    let own = person.subject.model.link(link);
    let markers = person.subject.markers.iter().filter(|marker| Some(marker.link) == own).count();
    if own.is_some() && markers < WHOLE_PLACE {
        return Err(StudyError::NoFrames(format!(
            "`tool_link` {link}: {markers} markers do not show how it turns, and with it the tool: put a third \
             one on it"
        )));
    }
    let model = person.subject.model.welded();
    model.link(link).ok_or_else(|| {
        let links: Vec<&str> = model.links.iter().map(|l| l.name.as_str()).collect();
        StudyError::NoFrames(format!(
            "`tool_link` {link}: there is no such link; there are {}",
            links.join(", ")
        ))
    })
}

/// Motions with a tool, and those without.
pub struct Compared<'a> {
    /// The person of both.
    pub person: &'a Person,
    /// The trials that the person was made of.
    pub trials: &'a [Trial],
    /// Motions with the tool.
    pub with: &'a Study,
    /// Motions without it.
    pub without: &'a Study,
}

impl Compared<'_> {
    /// Returns what a link holds in the motions of one study and not in those of the other.
    ///
    /// # Errors
    /// [`StudyError`] if the model has no such link, or the motions do not fit together.
    pub fn tool(
        &self,
        link: &str,
        name: &str,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<ToolResult, StudyError> {
        let at = holding(self.person, link)?;
        let weights = self.with.base().map().columns(10 * at, 10).into_owned();
        let all = |study: &Study| {
            let factors = study.motions.iter().map(|motion| motion.pooled.clone()).collect();
            PooledFactor::merged(factors, false).map(|pooled| pooled.factor())
        };
        let [with, without] = [all(self.with)?, all(self.without)?];
        let beforehand = known(&self.without.table);
        let (tau, mut covariance) = held(&with, &[&without, &beforehand], &weights);
        let solved = |drawn: &Drawn| -> Result<DVector<f64>, DrawError> {
            let of = |study: &Study| factor_as(drawn, self.person, self.trials, &study.motions);
            let (Some(with), Some(without)) = (of(self.with)?, of(self.without)?) else {
                return Ok(tau.clone());
            };
            Ok(held(&with, &[&without, &beforehand], &weights).0)
        };
        let moved = draws(self.person, progress, &solved)?;
        covariance += &moved * moved.transpose();
        let plates = self.by_plates([&with, &without], &beforehand, &weights)?;
        covariance += &plates * plates.transpose();
        Ok(result((link, name), tau.as_slice(), &covariance))
    }

    /// Returns how errors of plates, 1 σ each, move τ, one column an error.
    fn by_plates(
        &self,
        [with, without]: [&Factor; 2],
        beforehand: &Factor,
        weights: &DMatrix<f64>,
    ) -> Result<DMatrix<f64>, StudyError> {
        let n = with.parameters();
        let identity = DMatrix::identity(n, n);
        let (wide, alone) = (joined(&identity, weights), joined(&identity, &DMatrix::zeros(n, 10)));
        let [own, others] = [self.with.plates_scores(self.person)?, self.without.plates_scores(self.person)?];
        let right = wide.transpose() * own + alone.transpose() * others;
        let moved = both(with, &[without, beforehand], weights).covariance * right;
        Ok(moved.rows(n, 10).into_owned())
    }
}

/// Returns φ and τ by rows with the tool and others without; of τ next to nothing is known beforehand.
fn both(with: &Factor, without: &[&Factor], weights: &DMatrix<f64>) -> Solution {
    let n = with.parameters();
    let identity = DMatrix::identity(n, n);
    let mut all = with.substitute(&joined(&identity, weights));
    // Of the tool rows without it say nothing.
    let alone = joined(&identity, &DMatrix::zeros(n, 10));
    without.iter().for_each(|rows| all.merge(&rows.substitute(&alone)));
    let beforehand = DMatrix::from_fn(10, n + 10, |i, j| if j == n + i { 1.0 / held_sigma(i) } else { 0.0 });
    all.absorb_matrix(&beforehand, &[0.0; 10]);
    all.solve(f64::EPSILON * n as f64)
}

/// Returns τ of these and its covariance.
fn held(with: &Factor, without: &[&Factor], weights: &DMatrix<f64>) -> (DVector<f64>, DMatrix<f64>) {
    let n = with.parameters();
    let found = both(with, without, weights);
    let tau = DVector::from_column_slice(&found.estimate[n..]);
    (tau, found.covariance.view((n, n), (10, 10)).into_owned())
}

fn result((link, name): (&str, &str), estimate: &[f64], covariance: &DMatrix<f64>) -> ToolResult {
    let value =
        |k: usize| Measured { value: estimate[k], u95: COVERAGE_95 * covariance[(k, k)].max(0.0).sqrt() };
    let mass = value(0);
    let body = Vector4::from_row_slice(&estimate[..4]);
    ToolResult {
        name: name.to_owned(),
        link: link.to_owned(),
        mass_kg: mass,
        first_moment_kgm: std::array::from_fn(|k| value(1 + k)),
        com_m: (mass.value > mass.u95).then(|| centre_of_mass(&body, covariance)),
        inertia_kgm2: std::array::from_fn(|k| value(4 + k)),
    }
}

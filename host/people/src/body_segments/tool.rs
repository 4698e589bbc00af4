//! The tool that a person holds: its own parameters from motions with it and without it.
//!
//! With K the weights of the ten parameters of the link that holds it in the base parameters φ, motions with
//! the tool are rows over `φ + K τ`, those without over φ. Both factors and the table are merged, and φ is
//! eliminated.

use nalgebra::{DMatrix, Vector4};

use super::error::StudyError;
use super::segments::centre_of_mass;
use super::study::{Study, known};
use rigident_fit::pool::PooledFactor;
use rigident_fit::{COVERAGE_95, Measured, RigRows};
use rigident_identify::answer::person::ToolResult;

/// Returns what a link holds in the motions of one study and not in those of another of the same person.
///
/// # Errors
/// [`StudyError`] if the model has no such link, or the motions do not fit together.
pub fn tool(with: &Study, without: &Study, link: &str, name: &str) -> Result<ToolResult, StudyError> {
    let model = &with.model;
    let at = model.link(link).ok_or_else(|| {
        let links: Vec<&str> = model.links.iter().map(|l| l.name.as_str()).collect();
        StudyError::NoFrames(format!(
            "`tool_link` {link}: there is no such link; there are {}",
            links.join(", ")
        ))
    })?;
    let n = with.parameters();
    let weights = with.base().map().columns(10 * at, 10).into_owned();
    let all = |study: &Study| {
        let factors = study.motions.iter().map(|motion| motion.pooled.clone()).collect();
        PooledFactor::merged(factors, false).map(|pooled| pooled.factor())
    };
    let mut others = all(without)?;
    others.merge(&known(&with.table));
    let [with, others] = [all(with)?, others].map(RigRows::plain);
    let own = with.beyond(&others, &DMatrix::identity(n, n), &weights).rows.own();
    let solved = own.solve(f64::EPSILON * n as f64);
    let value = |k: usize| Measured {
        value: solved.estimate[k],
        u95: COVERAGE_95 * solved.covariance[(k, k)].max(0.0).sqrt(),
    };
    let mass = value(0);
    let body = Vector4::from_row_slice(&solved.estimate[..4]);
    Ok(ToolResult {
        name: name.to_owned(),
        link: link.to_owned(),
        mass_kg: mass,
        first_moment_kgm: std::array::from_fn(|k| value(1 + k)),
        com_m: (mass.value > mass.u95).then(|| centre_of_mass(&body, &solved.covariance)),
        inertia_kgm2: std::array::from_fn(|k| value(4 + k)),
    })
}

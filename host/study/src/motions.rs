//! The planned motions, each repeated: what was predicted of it against what many experiments find.

use std::sync::atomic::AtomicBool;

use rigident_sim::rig::RigConfig;

use super::{Campaign, CampaignError, K95, Prepared, Verdict};
use rigident_plan::motion::compare::{Row, bodies};

/// One motion of one mounting.
#[derive(Clone, Debug)]
pub struct RepeatedMotion {
    /// Mounting.
    pub body: &'static str,
    /// Name of the motion.
    pub motion: &'static str,
    /// Predicted 95 % uncertainties of mass, first moment and tensor about S, kg, kg m, kg m².
    pub predicted_u95: [f64; 10],
    /// The finding.
    pub verdict: Verdict,
}

impl RepeatedMotion {
    /// Returns found over predicted standard deviations of the ten parameters.
    pub fn ratios(&self) -> [f64; 10] {
        std::array::from_fn(|j| K95 * self.verdict.parameters[j].std / self.predicted_u95[j])
    }
}

/// Repeats every planned motion with the thesis' sensors, `runs` times at `rate_hz`.
///
/// # Errors
/// Fails as [`Campaign::prepare`] and [`super::Prepared::run`] do, or if it is stopped before the first
/// motion is done.
pub fn motions(
    rows: &[Row],
    rate_hz: f64,
    [runs, seed]: [u64; 2],
    stop: &AtomicBool,
    mut note: impl FnMut(&str, &str, u64),
) -> Result<Vec<RepeatedMotion>, CampaignError> {
    rows.iter()
        .map(|row| {
            let done = |done| note(row.body, row.objective, done);
            let verdict = prepared(row, rate_hz)?.run(runs, seed, stop, done)?;
            let predicted_u95 = row.plan.prediction.parameters;
            Ok(RepeatedMotion { body: row.body, motion: row.objective, predicted_u95, verdict })
        })
        .collect()
}

/// Makes a planned motion with the thesis' sensors ready to be repeated.
pub(super) fn prepared(row: &Row, rate_hz: f64) -> Result<Prepared, CampaignError> {
    let body = bodies().into_iter().find(|(_, name)| *name == row.body).map(|(body, _)| body);
    let config = RigConfig::thesis_horizontal();
    let config = body.map_or(config.clone(), |body| config.with_body(body));
    Campaign { rate_hz, program: Some(row.plan.program.clone()), ..Campaign::new(config) }.prepare()
}

/// Returns found over predicted standard deviations as a table in Markdown.
pub fn table(motions: &[RepeatedMotion]) -> String {
    let mut text = "| mounting | motion | m | mcx | mcy | mcz | Ixx | Iyy | Izz | Iyz | Izx | Ixy |\n\
                    |---|---|---|---|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for motion in motions {
        let ratios = motion.ratios().map(|ratio| format!("{ratio:.2}")).join(" | ");
        text += &format!("| {} | {} | {ratios} |\n", motion.body, motion.motion);
    }
    text
}

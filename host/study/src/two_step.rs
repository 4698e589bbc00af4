//! Two steps beside one: mass and centre of mass from the poses, then the tensor from the motion with these
//! held, against one estimate of everything.
//!
//! With `p = [m, mc]`, the motion's own estimate `(p₂, I₂)` and its covariance `Σ`, and `p₁` of the poses
//! with covariance `C`, the tensor is `I₂ + G (p₁ − p₂)`, `G = Σ_Ip Σ_pp⁻¹`; its covariance is
//! `Σ_II − G Σ_pI` if `p₁` is believed, and `G C Gᵀ` more if it is not.

use std::sync::atomic::AtomicBool;

use nalgebra::{DMatrix, DVector, Dyn, OMatrix};
use rigident_sim::rig::ReadingRow;

use super::motions::prepared;
use super::repeat::repeat;
use super::{CampaignError, K95, Prepared, true_parameters};
use rigident_fit::{Estimate, FitError, FitOptions, Silent, fit};
use rigident_laboratory::reading;
use rigident_plan::motion::compare::Row;

/// Mass and first moment, then the tensor, in the order of the parameters.
const HELD: usize = 4;
const TENSOR: usize = 6;

/// Errors of the tensor's elements about S's origin and the standard deviations stated, kg m².
#[derive(Clone, Copy, Debug)]
struct Stated {
    error: [f64; TENSOR],
    sd: [f64; TENSOR],
}

/// One experiment: everything at once; with the first step believed; with its covariance.
type Three = [Stated; 3];

/// The six elements of one estimator over many experiments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judged {
    /// Root mean square of each element's error, kg m².
    pub rms: [f64; TENSOR],
    /// Share of the experiments in which the stated 95 % interval holds the truth.
    pub coverage95: [f64; TENSOR],
}

/// One motion of one mounting.
#[derive(Clone, Debug)]
pub struct TwoSteps {
    /// Mounting.
    pub body: &'static str,
    /// Name of the motion.
    pub motion: &'static str,
    /// Experiments done.
    pub runs: u64,
    /// Everything at once.
    pub joint: Judged,
    /// In two steps, the first one believed.
    pub believed: Judged,
    /// In two steps, with the covariance of the first.
    pub carried: Judged,
}

impl TwoSteps {
    /// Returns the largest ratio of the errors in two steps over those of the joint estimate, of the six
    /// elements.
    pub fn worse(&self) -> f64 {
        self.believed.rms.iter().zip(self.joint.rms).map(|(two, one)| two / one).fold(0.0, f64::max)
    }
}

/// Repeats every planned motion with the thesis' sensors, `runs` times at `rate_hz`.
///
/// # Errors
/// Fails as [`super::Campaign::prepare`] does, if an experiment cannot be identified, or if there are fewer
/// than two of them.
pub fn two_steps(
    rows: &[Row],
    rate_hz: f64,
    [runs, seed]: [u64; 2],
    stop: &AtomicBool,
    mut note: impl FnMut(&str, &str, u64),
) -> Result<Vec<TwoSteps>, CampaignError> {
    rows.iter()
        .map(|row| {
            let prepared = prepared(row, rate_hz)?;
            let [poses_end_s, _] = row.plan.motion_s;
            let mut done = |done| note(row.body, row.objective, done);
            let all = repeat(runs, seed, stop, &mut done, |seed| prepared.in_steps(poses_end_s, seed))
                .map_err(|(seed, error)| CampaignError::Identification { seed, error })?;
            if all.len() < 2 {
                return Err(CampaignError::TooFew(all.len() as u64));
            }
            let [joint, believed, carried] =
                [0, 1, 2].map(|k| judged(all.iter().map(|three: &Three| three[k])));
            let runs = all.len() as u64;
            Ok(TwoSteps { body: row.body, motion: row.objective, runs, joint, believed, carried })
        })
        .collect()
}

fn judged(all: impl Iterator<Item = Stated>) -> Judged {
    let (mut squares, mut held, mut count) = ([0.0; TENSOR], [0.0; TENSOR], 0.0);
    for Stated { error, sd } in all {
        count += 1.0;
        for j in 0..TENSOR {
            squares[j] += error[j] * error[j];
            held[j] += f64::from(u8::from(error[j].abs() <= K95 * sd[j]));
        }
    }
    Judged { rms: squares.map(|s: f64| (s / count).sqrt()), coverage95: held.map(|h| h / count) }
}

impl Prepared {
    fn in_steps(&self, poses_end_s: f64, seed: u64) -> Result<Three, FitError> {
        let rows: Vec<ReadingRow> = self.readings.measured(seed).collect();
        let split = rows.partition_point(|row| (row.time_ns as f64) < 1e9 * poses_end_s);
        let of = |rows: &[ReadingRow]| {
            let source = self.source(rows.iter().map(reading).collect());
            fit(&source, &FitOptions::default(), &Silent).map(|fit| fit.estimate)
        };
        let (whole, poses, motion) = (of(&rows)?, of(&rows[..split])?, of(&rows[split..])?);
        let truth = true_parameters(&self.readings.truth(seed));
        let stated = |tensor: &DVector<f64>, covariance: &OMatrix<f64, Dyn, Dyn>| Stated {
            error: std::array::from_fn(|j| tensor[j] - truth[HELD + j]),
            sd: std::array::from_fn(|j| covariance[(j, j)].max(0.0).sqrt()),
        };
        let parts = |estimate: &Estimate| {
            let at = |from: usize, n: usize| DVector::from_fn(n, |i, _| estimate.unjudged().values[from + i]);
            let block = |i: usize, j: usize, n: usize, m: usize| {
                estimate.unjudged().covariance.view((i, j), (n, m)).into_owned()
            };
            (
                [at(0, HELD), at(HELD, TENSOR)],
                block(0, 0, HELD, HELD),
                block(HELD, 0, TENSOR, HELD),
                block(HELD, HELD, TENSOR, TENSOR),
            )
        };
        let ([_, joint], _, _, joint_covariance) = parts(&whole);
        let ([p1, _], c, _, _) = parts(&poses);
        let ([p2, i2], pp, ip, ii) = parts(&motion);
        let gain: DMatrix<f64> = pp
            .cholesky()
            .map_or_else(|| DMatrix::zeros(TENSOR, HELD), |pp| pp.solve(&ip.transpose()).transpose());
        let tensor = i2 + &gain * (p1 - p2);
        let believed = ii - &gain * ip.transpose();
        let carried = &believed + &gain * c * gain.transpose();
        Ok([stated(&joint, &joint_covariance), stated(&tensor, &believed), stated(&tensor, &carried)])
    }
}

/// Returns the table in Markdown.
pub fn table(all: &[TwoSteps]) -> String {
    let mut text = "| mounting | motion | errors in two steps over joint, worst element | coverage of 95 %, \
                    joint | two steps, the first believed | two steps, with its covariance \
                    |\n|---|---|---|---|---|---|\n"
        .to_owned();
    let range = |judged: &Judged| {
        let (least, most) =
            judged.coverage95.iter().fold((1.0_f64, 0.0_f64), |(l, m), share| (l.min(*share), m.max(*share)));
        format!("{:.0}–{:.0} %", 100.0 * least, 100.0 * most)
    };
    for row in all {
        text += &format!(
            "| {} | {} | {:.2} | {} | {} | {} |\n",
            row.body,
            row.motion,
            row.worse(),
            range(&row.joint),
            range(&row.believed),
            range(&row.carried)
        );
    }
    text
}

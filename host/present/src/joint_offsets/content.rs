//! The content of the page from an answer: which poses are drawn, and how far off contacts are.

use super::text::facts;
use super::{Deviations, DrawnPose, OffsetRow, OffsetsPage};
use rigident_identify::joint_offsets::result::{Answer, Coarsest};
use rigident_identify::joint_offsets::search::beginning;
use rigident_identify::joint_offsets::solve::State;
use rigident_identify::joint_offsets::{Pose, Setup};

/// Poses that are drawn.
const DRAWN: usize = 4;

impl OffsetsPage {
    /// Returns the page of an answer; `model` and `source` are the names of the robot and of the file of
    /// poses.
    pub fn new(
        setup: &Setup,
        poses: &[Pose],
        answer: &Answer,
        (model, source): (&str, &str),
        coarsest: Coarsest,
        warnings: &[String],
    ) -> Self {
        let before = beginning(setup, poses);
        let states = [&before, &answer.state];
        let base = |state: &State, k: usize| state.bases.get(k).copied().unwrap_or_default();
        let deviations = |(k, pose): (usize, &Pose)| {
            let [before_m, after_m] =
                states.map(|state| setup.deviations(pose, &base(state, k), &state.shared));
            Deviations { left_out: answer.left_out.get(k) == Some(&true), before_m, after_m }
        };
        let deviations: Vec<Deviations> = poses.iter().enumerate().map(deviations).collect();
        let drawn = shown(&deviations).into_iter().filter_map(|k| {
            let pose = poses.get(k)?;
            let note = if deviations.get(k)?.left_out { ", left out" } else { "" };
            Some(DrawnPose {
                name: format!("{}{note}", pose.name),
                figures: states.map(|state| setup.figure(pose, &base(state, k), &state.shared)),
            })
        });
        let offsets = answer.offsets.iter().map(|own| OffsetRow {
            joint: own.joint.clone(),
            slides: own.slides,
            measured: own.measured,
            why: own.why_not(coarsest),
        });
        Self {
            model: model.to_owned(),
            source: source.to_owned(),
            offsets: offsets.collect(),
            contacts: setup.contacts.names().map(str::to_owned).collect(),
            drawn: drawn.collect(),
            deviations,
            warnings: warnings.to_vec(),
            along: answer.along.iter().map(|own| (own.name.clone(), own.length, own.measured)).collect(),
            facts: facts(answer),
        }
    }
}

/// Returns the poses to draw: those with the largest distances before, the smallest, and between; of those
/// left out the first.
fn shown(deviations: &[Deviations]) -> Vec<usize> {
    let most = |k: &usize| {
        let all = deviations.get(*k).into_iter().flat_map(|pose| &pose.before_m).flatten();
        all.copied().fold(0.0, f64::max)
    };
    let (mut out, mut kept): (Vec<usize>, Vec<usize>) =
        (0..deviations.len()).partition(|k| deviations.get(*k).is_some_and(|pose| pose.left_out));
    out.truncate(1);
    kept.sort_by(|a, b| most(b).total_cmp(&most(a)));
    let wanted = (DRAWN - out.len()).min(kept.len());
    let spread = (0..wanted).filter_map(|n| {
        let last = kept.len().saturating_sub(1);
        kept.get(if wanted > 1 { n * last / (wanted - 1) } else { 0 }).copied()
    });
    let mut all: Vec<usize> = spread.collect();
    all.extend(out);
    all
}

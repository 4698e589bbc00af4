//! The table of offsets for the terminal, and the numbers that describe the fit.

use std::fmt::Write as _;

use super::with_unit;
use rigident_fit::COVERAGE_95;
use rigident_fit::figures::{NOT_IDENTIFIED, counted, significant};
use rigident_identify::joint_offsets::remarks::sized;
use rigident_identify::joint_offsets::result::{Answer, Coarsest};

/// Returns the numbers that describe the fit: name and value.
pub(super) fn facts(answer: &Answer) -> Vec<(String, String)> {
    let fact = |name: &str, value: String| (name.to_owned(), value);
    vec![
        fact("left of attitudes, RMS", format!("{}°", significant(answer.attitude_rms.to_degrees(), 2))),
        fact("left of contacts, RMS", format!("{} mm", significant(1e3 * answer.height_rms, 2))),
        fact("variance over that of the stated noise", significant(answer.variance_ratio, 2)),
        fact("degrees of freedom", significant(answer.degrees_of_freedom, 4)),
        fact("known worst", worst(answer).unwrap_or_else(|| "–".to_owned())),
    ]
}

/// Returns the combination of offsets that is known worst.
fn worst(answer: &Answer) -> Option<String> {
    let (sigma, shares) = answer.weakest.as_ref()?;
    let slides = |joint: &str| answer.offsets.iter().any(|own| own.joint == joint && own.slides);
    let known = if sigma.is_finite() {
        let all_slide = shares.iter().all(|(joint, _)| slides(joint));
        format!("known to ± {} (95 %)", sized(COVERAGE_95 * sigma, all_slide))
    } else {
        "not known at all".to_owned()
    };
    let shares: Vec<String> = shares.iter().map(|(joint, share)| format!("{share:+.2} {joint}")).collect();
    Some(format!("{known}: {}", shares.join(" ")))
}

/// Returns the answer of a number of poses as text.
pub fn text(answer: &Answer, poses: usize, coarsest: Coarsest) -> String {
    let identified = answer.offsets.iter().filter(|offset| offset.measured.is_some()).count();
    let mut out = format!(
        "{identified} of {} from {}; attitudes are left with {}°, contacts with {} mm\n\n",
        counted(answer.offsets.len(), "offset", "offsets"),
        counted(poses - answer.bad.len(), "pose", "poses"),
        significant(answer.attitude_rms.to_degrees(), 2),
        significant(1e3 * answer.height_rms, 2)
    );
    let width = answer.offsets.iter().map(|offset| offset.joint.chars().count()).max().unwrap_or(0);
    for offset in &answer.offsets {
        let cell =
            offset.measured.map_or_else(|| NOT_IDENTIFIED.to_owned(), |own| with_unit(own, offset.slides));
        let _ = writeln!(out, "  {:<width$}  {cell:>20}  {}", offset.joint, offset.why_not(coarsest));
    }
    if let Some(worst) = worst(answer) {
        let _ = writeln!(out, "\nKnown worst, {worst}");
    }
    out.push_str("\n  poses  identified  largest U95\n");
    for own in &answer.over_poses {
        let parts = [own.worst_u95.map(|u| sized(u, false)), own.worst_u95_m.map(|u| sized(u, true))];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        let worst = if parts.is_empty() { "–".to_owned() } else { parts.join(", ") };
        let _ = writeln!(out, "  {:>5}  {:>10}  {worst:>11}", own.poses, own.identified);
    }
    let lines = out.lines().map(str::trim_end).collect::<Vec<_>>();
    lines.join("\n")
}

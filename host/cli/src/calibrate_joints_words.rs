//! The messages of `rigident calibrate joints`: the table, warnings, reasons, refusals.

use std::fmt::Write as _;

use super::Failure;
use rigident::fit::figures::{NOT_IDENTIFIED, counted, significant};
use rigident::joint_offsets::faults::{Contradiction, Fault, contradiction};
use rigident::joint_offsets::result::{Answer, Coarsest, Offset};
use rigident::joint_offsets::{Pose, Setup};
use rigident::present::joint_offsets::with_unit;
use rigident_fit::COVERAGE_95;

/// The excess of the residuals over the stated noise from which on it is reported, a ratio of variances.
const NOISIER: f64 = 1.5;

/// Refuses poses that contradict each other, with the fault that explains them if there is one.
///
/// # Errors
/// Says what is wrong, and what to do.
pub(super) fn believed(setup: &Setup, poses: &[Pose], answer: &Answer) -> Result<(), Failure> {
    let Some(why) = contradiction(setup, poses, answer).map_err(Failure::input)? else { return Ok(()) };
    Err(Failure::input(match why {
        Contradiction::Faults(found) => {
            let words = |(k, fault): (usize, &Fault)| match (k, fault) {
                // A joint that counts the other way is as well one whose axis is.
                (0, Fault::Sign(_)) => format!("{fault} (or turn the axis in the model)"),
                (0, _) => fault.to_string(),
                _ => format!("\n  or {fault}"),
            };
            let all: String = found.iter().enumerate().map(words).collect();
            format!("these poses contradict the model, unless {all}")
        }
        Contradiction::TooLarge(joint, offset) => format!(
            "the offset of {joint} would be {}°, and no zero is set so badly: does the joint count the other way, from another zero, or \
             is the IMU turned on its link?",
            significant(offset.to_degrees(), 2)
        ),
        Contradiction::NotNoise => format!(
            "what is left is {} times what the stated noise explains (attitudes {}°, contacts {} mm), and no single fault explains it: are \
             the soles flat on one plane in these poses, are their corners and the lengths of links right? If the noise is so large, \
             state it by --attitude-noise-deg and --height-noise-mm",
            significant(answer.variance_ratio.sqrt(), 2),
            significant(answer.attitude_rms.to_degrees(), 2),
            significant(1e3 * answer.height_rms, 2)
        ),
    }))
}

/// Returns a limit or an uncertainty with its unit.
fn sized(value: f64, slides: bool) -> String {
    if slides {
        format!("{} mm", significant(1e3 * value, 2))
    } else {
        format!("{}°", significant(value.to_degrees(), 2))
    }
}

/// Returns why an offset is not identified.
pub(super) fn why(offset: &Offset, coarsest: Coarsest) -> String {
    let Some(open) = &offset.open else { return String::new() };
    let mut parts = Vec::new();
    if offset.stands_still() {
        parts.push(format!(
            "the joint stands still in these poses (it moves by {}): move it",
            sized(offset.moves_by, offset.slides)
        ));
    }
    parts.push(match open.u95 {
        None => "the poses say nothing of it by itself".to_owned(),
        Some(u95) => format!(
            "its U95 would be {}, above {}",
            sized(u95, offset.slides),
            sized(coarsest.of(offset.slides), offset.slides)
        ),
    });
    if !open.beside.is_empty() {
        parts.push(format!("it acts as {} in these poses", open.beside.join(" and ")));
    }
    parts.join("; ")
}

/// Returns what is to be known of an answer.
pub(super) fn warnings(setup: &Setup, answer: &Answer) -> Vec<String> {
    let mut warnings = Vec::new();
    for bad in &answer.bad {
        let (link, turn) = &bad.attitude_off;
        let (contact, height) = &bad.height_off;
        warnings.push(format!(
            "{} is left out: the others contradict it ({} times what the noise explains; attitude of {link} off by {}°, a corner of \
             {contact} by {} mm)",
            bad.name,
            significant(bad.ratio, 2),
            significant(turn.to_degrees(), 2),
            significant(1e3 * height, 2)
        ));
    }
    let named = |of: &dyn Fn(&&Offset) -> bool| {
        answer.offsets.iter().filter(of).map(|o| o.joint.as_str()).collect::<Vec<_>>().join(", ")
    };
    let open = named(&|o| o.measured.is_none());
    if !open.is_empty() {
        warnings.push(format!(
            "not told by these poses: {open}; take poses with one knee bent more than the other, feet turned and apart, pelvis tilted"
        ));
    }
    let still = named(&|o| o.measured.is_some() && o.stands_still());
    if !still.is_empty() {
        warnings.push(format!(
            "{still}: stands still in all poses; its offset is told by the motion of the others alone, and by the lengths of links"
        ));
    }
    if answer.variance_ratio > NOISIER {
        warnings.push(format!(
            "what is left is {} times the variance that the stated noise explains; the intervals are widened by its root: is the \
             floor level, are the corners where the file has them, is the noise as stated?",
            significant(answer.variance_ratio, 2)
        ));
    }
    if setup.noise.mounting_rad == 0.0 {
        warnings.push(
            "the IMU is taken as mounted exactly: an error of its roll or pitch goes into the hips; say by --mounting-noise-deg how far it may be off"
                .to_owned(),
        );
    }
    if !answer.converged {
        warnings.push("the search did not settle: do not use these numbers".to_owned());
    }
    warnings
}

/// Returns the numbers that describe the fit.
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

/// Returns the answer as text.
pub(super) fn words(answer: &Answer, poses: usize, coarsest: Coarsest) -> String {
    let told = answer.offsets.iter().filter(|offset| offset.measured.is_some()).count();
    let mut out = format!(
        "{told} of {} from {}; attitudes are left with {}°, contacts with {} mm\n\n",
        counted(answer.offsets.len(), "offset", "offsets"),
        counted(poses - answer.bad.len(), "pose", "poses"),
        significant(answer.attitude_rms.to_degrees(), 2),
        significant(1e3 * answer.height_rms, 2)
    );
    let width = answer.offsets.iter().map(|offset| offset.joint.chars().count()).max().unwrap_or(0);
    for offset in &answer.offsets {
        let cell =
            offset.measured.map_or_else(|| NOT_IDENTIFIED.to_owned(), |own| with_unit(own, offset.slides));
        let _ = writeln!(out, "  {:<width$}  {cell:>20}  {}", offset.joint, why(offset, coarsest));
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

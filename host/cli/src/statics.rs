use std::process::ExitCode;

use serde::Serialize;

use super::arguments::Statics as Arguments;
use super::outcome::say;
use super::{ExitStatus, Failure};
use rigident::plan::poses::statics::{Estimated, Held, Statics, held, statics};
use rigident::rows::body::prepare::prepare;
use rigident_io::recording::Recording;
use rigident_io::rig::WRENCH_CHANNELS;

/// The object of `--json`.
#[derive(Serialize)]
struct Object<'a> {
    poses: usize,
    reference: usize,
    estimators: Vec<Figures<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mass_kg: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    offset_n_nm: Option<[[f64; 2]; 6]>,
    sigma_n_nm: [f64; 6],
    differences_n_nm: &'a [[f64; 6]],
}

#[derive(Serialize)]
struct Figures<'a> {
    name: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    com_m: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    u95_m: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    condition_number_normal: Option<f64>,
}

/// `rigident statics`
pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let reference = arguments
        .reference
        .checked_sub(1)
        .ok_or_else(|| Failure::input("--reference 0: poses are counted from 1"))?;
    let mut recording =
        Recording::load(&arguments.recording, arguments.rig.as_deref()).map_err(Failure::input)?;
    recording.leave_out_spikes();
    let prepared = prepare(&recording).map_err(Failure::input)?;
    let input = &prepared.input;
    let poses = held(input);
    let found = statics(&poses, input.channel_sigma.as_ref(), reference).map_err(Failure::input)?;
    if arguments.json {
        let object = Object {
            poses: poses.len(),
            reference: arguments.reference,
            estimators: found.estimates.iter().map(figures).collect(),
            mass_kg: found.mass_kg,
            offset_n_nm: found.offset_n_nm,
            sigma_n_nm: found.sigma_n_nm,
            differences_n_nm: &found.differences,
        };
        say(serde_json::to_string(&object).map_err(Failure::input)?);
    } else {
        recording.warnings.iter().for_each(|warning| tell!("rigident: {warning}"));
        say(text(&found, &poses, input.is_static, input.rate_hz, arguments.reference));
    }
    let whole = found.estimates.iter().all(|estimated| estimated.com_m.is_some());
    Ok(if whole { ExitCode::SUCCESS } else { ExitStatus::NotIdentified.into() })
}

fn figures(estimated: &Estimated) -> Figures<'_> {
    Figures {
        name: estimated.name,
        com_m: estimated.com_m,
        u95_m: estimated.u95_m,
        condition_number_normal: Some(estimated.condition_number_normal).filter(|v| v.is_finite()),
    }
}

fn text(found: &Statics, poses: &[Held], is_static: bool, rate_hz: f64, reference: usize) -> String {
    let mut text = format!(
        "{} still poses; relative to pose {reference}.\n\nCentre of mass, mm          x ± U95            y ± U95            z ± U95   \
         condition number of the normal matrix",
        poses.len()
    );
    for Estimated { name, com_m, u95_m, condition_number_normal } in &found.estimates {
        text += &format!("\n  {name:<25}");
        text += &match (com_m, u95_m) {
            (Some(com), Some(u95)) => {
                (0..3).map(|k| format!(" {:>8.2} ± {:<6.2}", 1e3 * com[k], 1e3 * u95[k])).collect::<String>()
            }
            _ => format!(" {:<53}", "these poses leave it open"),
        };
        text += &match condition_number_normal {
            v if v.is_finite() => format!("  {v:.3}"),
            _ => "  infinite".to_owned(),
        };
    }
    text += "\n\nThe first takes the forces as read for the body's weight: their offset is an error of it, and its interval counts the one \
             that the third finds.\nThe second takes what changes from one pose to the others, the third gravity from the attitude \
             and six offsets.\n";
    if let (Some([mass, u95]), Some(offset)) = (found.mass_kg, &found.offset_n_nm) {
        text += &format!("\nMass {mass:.4} ± {u95:.4} kg. Offsets");
        for (k, ((name, unit), [value, u95])) in WRENCH_CHANNELS.into_iter().zip(offset).enumerate() {
            text += &format!("{} {name} {value:.3} ± {u95:.3} {unit}", if k > 0 { "," } else { "" });
        }
        text += ".\n";
    }
    if found.differences.is_empty() {
        return text;
    }
    let [f, _, _, m, _, _] = found.sigma_n_nm;
    text += &format!(
        "\nMeasured less theoretical wrench (one standard deviation of the noise: {f:.3} N in Fx, {m:.4} N m in Mx)\n  pose        at       Fx       \
         Fy       Fz        Mx        My        Mz\n             s        N        N        N       N m       N m       N m"
    );
    for (k, (pose, [fx, fy, fz, mx, my, mz])) in poses.iter().zip(&found.differences).enumerate() {
        let at = if is_static { "–".to_owned() } else { format!("{:.1}", pose.first as f64 / rate_hz) };
        text +=
            &format!("\n  {:>4} {at:>9} {fx:>8.3} {fy:>8.3} {fz:>8.3} {mx:>9.4} {my:>9.4} {mz:>9.4}", k + 1);
    }
    text
}

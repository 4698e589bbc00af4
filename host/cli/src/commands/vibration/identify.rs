//! `rigident vibration identify`: the modes, and the body by them and by the motion.

use std::process::ExitCode;

use crate::commands::vibration::arguments::IdentifyVibration;
use crate::screen::outcome::{say, say_object};
use crate::{ExitStatus, Failure, Folder, Stages};
use rigident::application::vibration::identify::IdentifiedVibration;
use rigident::application::{VibrationOptions, vibration_of, vibration_recording};

/// Runs `rigident vibration identify`.
pub(crate) fn run(arguments: &IdentifyVibration) -> Result<ExitCode, Failure> {
    if let Some(out) = &arguments.out {
        Folder::check(out)?;
    }
    let path = &arguments.recording;
    let options = VibrationOptions { rig: arguments.rig.clone(), modes: arguments.modes };
    let stages = Stages::new(&format!("reading {}", path.display()));
    let recording = vibration_recording(path, &options)?;
    let folder = arguments.out.as_ref().map(|out| Folder::new(Some(out), "vibration")).transpose()?;
    let found = vibration_of(recording, arguments.modes, &stages.caller())?;
    drop(stages);
    finish(&found, folder.as_ref(), arguments.json)
}

/// Shows and writes one body on springs.
pub(crate) fn finish(
    found: &IdentifiedVibration,
    folder: Option<&Folder>,
    json: bool,
) -> Result<ExitCode, Failure> {
    if json {
        say_object(found)?;
    } else {
        say(found.text().trim_end());
        found.notes.iter().for_each(|note| say(format_args!("note: {note}")));
        let said = found.warnings.iter().chain(&found.findings);
        said.for_each(|warning| tell!("rigident: {warning}"));
        for (way, answer) in ["modes", "motion"].into_iter().zip(found.answers()) {
            for warning in answer.iter().flat_map(|answer| &answer.warnings) {
                tell!("rigident: by the {way}: {warning}");
            }
        }
    }
    if let Some(folder) = folder {
        folder.write_text("result.json", &serde_json::to_string_pretty(found).map_err(Failure::input)?)?;
        for (name, factor) in &found.factors {
            folder.write(name, &factor.to_bytes())?;
        }
        let spectrum = found.spectrum()?;
        folder.write("spectrum.svg", spectrum.as_bytes())?;
        folder.write_text("modes.html", &found.page(&spectrum))?;
        if !json {
            say(format_args!("\nFiles in {}", folder.path().display()));
        }
    }
    Ok(ExitStatus::of(found.is_identified()).into())
}

//! `rigident vibration demo`: the vibration paper's experiment, simulated and identified.

use std::process::ExitCode;

use hexapod::BodyParameters;

use crate::commands::vibration::arguments::DemoVibration;
use crate::commands::vibration::identify;
use crate::options::test_body::DemoBody;
use crate::screen::outcome::{say, say_answer};
use crate::{ExitStatus, Failure, Folder, Stages};
use rigident::application::{vibration_of, vibration_paper};
use rigident::laboratory::suspended::Experiment;

/// Runs `rigident vibration demo`.
pub(crate) fn run(arguments: &DemoVibration) -> Result<ExitCode, Failure> {
    let noise_mm = arguments.marker_noise_mm;
    if !(noise_mm.is_finite() && (0.0..=10.0).contains(&noise_mm)) {
        return Err(Failure::input(format!("--marker-noise-mm {noise_mm}: must be 0 to 10")));
    }
    if let Some(out) = &arguments.out {
        Folder::check(out)?;
    }
    if let Some(body) = arguments.body {
        return of_body(arguments, body);
    }
    let stages = Stages::new("simulating the postures");
    let found = vibration_paper(arguments.seed, noise_mm, &stages.caller())?;
    drop(stages);
    let folder = Folder::new(arguments.out.as_deref(), "vibration")?;
    for recording in &found.recordings {
        folder.write(&format!("{}.csv", recording.name), recording.to_csv().as_bytes())?;
        folder.write(&format!("{}.rig.toml", recording.name), found.rig.to_toml().as_bytes())?;
    }
    for (name, factor) in ["postures", "release"].into_iter().zip(&found.factors) {
        folder.write(&format!("{name}.factor"), &factor.to_bytes())?;
    }
    folder.write_text("result.json", &serde_json::to_string_pretty(&found).map_err(Failure::input)?)?;
    say_answer(&found, arguments.json)?;
    if !arguments.json {
        say(format_args!("\nFiles in {}", folder.path().display()));
    }
    Ok(ExitStatus::of(found.table_4.iter().all(|row| row.measured.is_some())).into())
}

/// Identifies one body on the springs as `rigident vibration identify` does.
fn of_body(arguments: &DemoVibration, body: DemoBody) -> Result<ExitCode, Failure> {
    let body = match body {
        DemoBody::Horizontal => BodyParameters::thesis_horizontal(),
        DemoBody::Vertical => BodyParameters::thesis_vertical(),
    };
    let stages = Stages::new("simulating the vibration");
    let experiment = Experiment::of_body(body, 1e-3 * arguments.marker_noise_mm, arguments.seed);
    let recording = experiment.swing().map_err(Failure::input)?;
    let folder = Folder::new(arguments.out.as_deref(), "vibration")?;
    folder.write("swing.csv", recording.to_csv().as_bytes())?;
    folder.write("swing.rig.toml", recording.rig.to_toml().as_bytes())?;
    let found = vibration_of(recording, None, &stages.caller())?;
    drop(stages);
    identify::finish(&found, Some(&folder), arguments.json)
}

//! `rigident predict` and `rigident validate`: what models say of a recording, beside what was measured.

pub(crate) mod arguments;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use crate::commands::predict::arguments::{Predict, Predicting, Validate};
use crate::screen::outcome::say;
use crate::{ExitStatus, Failure, Folder, Stages};
use rigident::application::{self, PredictOptions, Predicted};
use rigident::present::prediction::text;

/// Runs `rigident predict`.
pub(crate) fn predict(arguments: &Predict) -> Result<ExitCode, Failure> {
    run(std::slice::from_ref(&arguments.given), &arguments.recording, None, &arguments.how, false)
}

/// Runs `rigident validate`.
pub(crate) fn validate(arguments: &Validate) -> Result<ExitCode, Failure> {
    let Some((recording, models)) = arguments.files.split_last() else {
        return Err(Failure::input("give a model and a recording"));
    };
    run(models, recording, arguments.train.as_deref(), &arguments.how, true)
}

fn run(
    models: &[PathBuf],
    recording: &Path,
    train: Option<&Path>,
    how: &Predicting,
    needs_measured: bool,
) -> Result<ExitCode, Failure> {
    how.out.as_deref().map_or(Ok(()), Folder::check)?;
    let options = PredictOptions {
        rig: how.rig.clone(),
        tree: how.tree.typed()?,
        train: train.map(Path::to_owned),
        needs_measured,
    };
    let stages = Stages::new(&format!("reading {}", recording.display()));
    let predicted = application::predict(models, recording, &options, &stages.caller())?;
    drop(stages);
    finish(&predicted, how)
}

/// Prints and writes.
fn finish(predicted: &Predicted, how: &Predicting) -> Result<ExitCode, Failure> {
    if how.json {
        say(serde_json::to_string_pretty(&predicted.found).map_err(Failure::input)?);
    } else {
        say(text(&predicted.found).trim_end());
    }
    if let Some(out) = how.out.as_deref() {
        let folder = Folder::new(Some(out), "predict")?;
        folder.write("prediction.csv", predicted.csv().as_bytes())?;
        let page = folder.write_text("report.html", &predicted.page())?;
        if !how.json {
            say(format_args!(
                "\nFiles in {}; open {} in a browser.",
                folder.path().display(),
                page.display()
            ));
        }
    }
    Ok(ExitStatus::Identified.into())
}

use std::path::Path;
use std::process::ExitCode;

use serde_json::json;

use crate::Failure;
use crate::options::trees::{BenchCommand, BenchRegressors, BenchVerb};
use crate::screen::outcome::say;
use rigident_model::speed::{Asked, pinocchio, shapes, time};
use rigident_model::urdf;

/// Runs `rigident bench`.
pub(crate) fn run(command: &BenchCommand) -> Result<ExitCode, Failure> {
    match &command.verb {
        BenchVerb::Regressors(arguments) => regressors(arguments),
    }
}

/// Runs `rigident bench regressors`.
fn regressors(arguments: &BenchRegressors) -> Result<ExitCode, Failure> {
    let folder = tempfile::tempdir().map_err(Failure::input)?;
    let mut models = Vec::new();
    for name in &arguments.models {
        // A colon and the word: the base moves.
        let (path, floating) = name.strip_suffix(":floating").map_or((name.as_str(), false), |p| (p, true));
        let shown = Path::new(path).file_stem().map_or(path.into(), |s| s.to_string_lossy());
        models.push((shown.into_owned(), path.to_owned(), floating));
    }
    if models.is_empty() {
        for (name, text, floating) in shapes() {
            let path = folder.path().join(format!("{name}.urdf"));
            std::fs::write(&path, text).map_err(Failure::input)?;
            models.push((name.to_owned(), path.display().to_string(), floating));
        }
    }
    let mut ours = Vec::new();
    for (_, path, floating) in &models {
        let model = urdf::read(Path::new(path)).map_err(Failure::input)?;
        ours.push(time(&model, *floating).map_err(Failure::input)?);
    }
    let asked: Vec<Asked> =
        models.iter().map(|(_, path, floating)| Asked { path: path.clone(), floating: *floating }).collect();
    let python = arguments.python.clone().unwrap_or_else(|| "python3".to_owned());
    let theirs = pinocchio(&python, &asked);
    if let Err(why) = &theirs {
        tell!(
            "rigident: no times of Pinocchio: {why}; `pip install pin`, and name that Python by --python or \
             RIGIDENT_PYTHON"
        );
    }
    let theirs = theirs.ok();
    if arguments.json {
        let rows: Vec<_> = models
            .iter()
            .zip(&ours)
            .enumerate()
            .map(|(k, ((name, _, _), own))| {
                let theirs = theirs.as_ref().and_then(|t| t.models.get(k));
                json!({
                    "model": name, "freedoms": own.freedoms, "regressor_us": own.regressor_us,
                    "unit_changes_us": own.unit_changes_us,
                    "pinocchio_us": theirs.map(|t| t.1),
                    "base_parameters": own.count, "base_parameters_ms": own.base_parameters_ms,
                })
            })
            .collect();
        say(json!({"pinocchio": theirs.as_ref().map(|t| &t.version), "models": rows}));
        return Ok(ExitCode::SUCCESS);
    }
    let version = theirs.as_ref().map_or("not there".to_owned(), |t| t.version.clone());
    say(format_args!(
        "regressor of all rows, one core, best of many; Pinocchio {version} through Python: \
         computeJointTorqueRegressor less the call, Python's copy of the matrix with it, so that its C++ is \
         faster than this"
    ));
    say("model                 freedoms      here   Pinocchio   unit changes         base parameters");
    for (k, ((name, _, _), own)) in models.iter().zip(&ours).enumerate() {
        let their = theirs.as_ref().and_then(|t| t.models.get(k));
        let their = their.map_or_else(|| "–".to_owned(), |(_, us)| format!("{us:6.1} µs"));
        say(format_args!(
            "{name:20} {:9} {:6.1} µs {their:>11} {:7.0} µs ({:3.0} times)   {} in {:.1} ms",
            own.freedoms,
            own.regressor_us,
            own.unit_changes_us,
            own.unit_changes_us / own.regressor_us,
            own.count,
            own.base_parameters_ms
        ));
    }
    Ok(ExitCode::SUCCESS)
}

//! An answer printed and written.

use std::process::ExitCode;
use std::time::Instant;

use crate::options::output::Output;
use crate::screen::outcome::say;
use crate::{ExitStatus, Failure, Folder, certificate};
use rigident::application::{Identified, Load};
use rigident::present;

/// The start of a command, and what it prints and writes.
#[derive(Clone, Copy)]
pub(crate) struct Outlet<'a> {
    pub(crate) started: Instant,
    pub(crate) output: &'a Output,
}

/// Prints an answer, writes the files and returns the exit status; `loads` writes those of controllers.
///
/// # Errors
/// A file cannot be written, or the experiment broke off.
pub(crate) fn show(
    mut identified: Identified,
    Outlet { started, output }: Outlet<'_>,
    loads: impl FnOnce(&Identified) -> Result<Vec<Load>, Failure>,
    folder: impl FnOnce() -> Result<Option<Folder>, Failure>,
) -> Result<ExitCode, Failure> {
    let folder = folder()?;
    identified.answer.elapsed_s = started.elapsed().as_secs_f64();
    let json = serde_json::to_string_pretty(&identified.answer)
        .map_err(|e| Failure::input(format!("the result cannot be put into JSON: {e}")))?;
    // The answer first: a full disk must not keep it from the user.
    if output.json {
        say(json.as_str());
    } else {
        say(present::plain::text(&identified.answer).trim_end());
    }
    let loads = loads(&identified)?;
    for Load { path, refused } in &loads {
        if let Some(why) = refused {
            tell!("rigident: --write-load {}: not written: {why}", path.display());
        }
    }
    if output.certificate.is_some() {
        let own = folder.as_ref().filter(|_| output.evidence.is_empty());
        let own = own.map(|folder| certificate::in_folder(folder.path()));
        let files = own.as_ref().unwrap_or(&output.evidence);
        let written = certificate::write(output, &identified.rig, files, &identified.answer)?;
        if let Some(path) = written.filter(|_| !output.json) {
            say(format_args!("Certificate: {}; print it from a browser", path.display()));
        }
    }
    if let Some(folder) = folder {
        write(&identified, &json, &folder, output, &loads)?;
    }
    let whole = loads.iter().all(|load| load.refused.is_none());
    Ok(ExitStatus::of(whole && identified.is_whole()).into())
}

fn write(
    identified: &Identified,
    json: &str,
    folder: &Folder,
    output: &Output,
    loads: &[Load],
) -> Result<(), Failure> {
    folder.write_text("result.json", json)?;
    if let Some(factor) = &identified.factor {
        folder.write(&identified.factor_name(), &factor.to_bytes())?;
    }
    let page = folder.write_text("report.html", &identified.page())?;
    let model = match &identified.model {
        Some(model) => format!("; the model is {}", model.write()?.display()),
        None => String::new(),
    };
    let place = folder.path().display();
    if let Some(error) = &identified.error {
        return Err(Failure::link(format!("{error}\nWhat came before is in {place}")));
    }
    if !output.json {
        let written = loads.iter().filter(|load| load.refused.is_none());
        let written: Vec<String> = written.map(|load| load.path.display().to_string()).collect();
        let loads =
            if written.is_empty() { String::new() } else { format!("; the load is {}", written.join(", ")) };
        say(format_args!("\nFiles in {place}; open {} in a browser{model}{loads}.", page.display()));
    }
    Ok(())
}

//! The end of every command that identifies a tree of links: the answer, its files, the exit status.

use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use super::arguments::Output;
use super::followed::Followed;
use super::outcome::say;
use super::{Failure, Folder, Stages};
use crate::answer::result::{ParameterState, ResultSource, Status};
use crate::model::{self, Model};
use crate::trees::nearest::{Full, nearest};
use crate::trees::possible::{Possible, possible};
use crate::trees::prepare::PreparedTree;
use crate::trees::result::{self as tree_result, Answer};
use crate::trees::{TreeIdentification, answer};

/// How full parameters are sought.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fullness<'a> {
    /// 1 σ that the nominal model is trusted with, relative.
    pub(super) trust: f64,
    /// Right sides mirror left ones.
    pub(super) symmetric: bool,
    /// Where a model with them goes.
    pub(super) write_model: Option<&'a Path>,
    /// The file that it is made of.
    pub(super) source: Option<&'a Path>,
}

impl Fullness<'_> {
    /// As nobody asks for anything.
    pub(super) const USUAL: Self = Self { trust: 1.0, symmetric: false, write_model: None, source: None };

    /// There must be full parameters.
    fn is_asked_for(&self) -> bool {
        self.write_model.is_some() || self.symmetric
    }
}

/// Everything a command knows at its end.
pub(super) struct TreeEnding<'a> {
    pub(super) started: Instant,
    pub(super) output: &'a Output,
    pub(super) model: &'a Model,
    /// What was identified from.
    pub(super) ready: &'a PreparedTree,
    pub(super) found: &'a TreeIdentification,
    pub(super) fullness: Fullness<'a>,
    pub(super) source: ResultSource,
    /// What is really the case, parameter by parameter.
    pub(super) truth: Option<&'a [f64]>,
    /// How the platform followed.
    pub(super) followed: Option<&'a Followed>,
    pub(super) warnings: Vec<String>,
    /// What broke, if anything.
    pub(super) broken: Option<String>,
}

impl TreeEnding<'_> {
    /// Prints the answer, writes the files into a folder that is asked for now, and gives the exit status.
    ///
    /// # Errors
    /// What was asked for is no parameter, full parameters that were asked for cannot be found, a file cannot be written.
    pub(super) fn conclude(
        self,
        folder: impl FnOnce() -> Result<Folder, Failure>,
    ) -> Result<ExitCode, Failure> {
        let Self { output, model, ready, found, fullness, .. } = self;
        let stages = Stages::new("full parameters");
        let possible = possible(&ready.input, found);
        let states = answer::states(&ready.input, found, possible.as_ref());
        let asked = tree_result::asked(&found.names, &output.estimate).map_err(Failure::input)?;
        let impossible = possible.as_ref().and_then(Possible::warning);
        let reversed = impossible.as_ref().filter(|_| possible.is_some_and(|p| p.reversed));
        let (full, without_full) = match reversed {
            Some(why) if fullness.is_asked_for() => return Err(Failure::input(why)),
            Some(_) => (None, None),
            None => full_parameters(model, found, &fullness)?,
        };
        drop(stages);
        let folder = folder()?;
        let missing = asked.iter().filter(|j| !matches!(states[**j], ParameterState::Identified(_))).count();
        let status = match missing {
            _ if self.broken.is_some() => Status::Failed,
            0 => Status::Identified,
            m if m == asked.len() => Status::NotIdentified,
            _ => Status::PartlyIdentified,
        };
        let mut warnings = self.warnings;
        warnings.extend(model.findings.iter().map(ToString::to_string));
        warnings.extend(ready.notes.iter().cloned());
        warnings.extend(tree_result::warnings(&ready.input, found));
        warnings.extend(without_full.into_iter().chain(impossible.clone()));
        let answer = Answer {
            input: &ready.input,
            // No motion would help.
            reasons: match reversed {
                Some(_) => Vec::new(),
                None => answer::reasons(&ready.input, found, &states, &ready.idle),
            },
            states,
            possible,
            found,
            full: full.as_ref(),
            trust: fullness.trust,
            symmetric: fullness.symmetric,
            truth: self.truth,
            status,
            source: self.source,
            warnings,
        };
        let mut object = answer.object(self.started.elapsed().as_secs_f64());
        if let (Some(out), Some(tracking)) =
            (object.as_object_mut(), self.followed.and_then(Followed::to_json))
        {
            out.insert("tracking".to_owned(), tracking);
        }
        if let (Some(out), Some(broken)) = (object.as_object_mut(), &self.broken) {
            out.insert("error".to_owned(), broken.as_str().into());
        }
        let text = serde_json::to_string_pretty(&object)
            .map_err(|e| Failure::input(format!("the result cannot be put into JSON: {e}")))?;
        if output.json {
            say(text.as_str());
        } else {
            say(answer.text().trim_end());
            if let Some(followed) = self.followed {
                say(format_args!("\n{followed}"));
            }
        }
        folder.write("result.json", text.as_bytes())?;
        let page = folder.write("report.html", answer.page().as_bytes())?;
        if let (Some(path), Some(full)) = (fullness.write_model, &full) {
            let identified = model::write::with_parameters(
                model,
                full.links.iter().map(|link| (link.name.as_str(), link.parameters)),
            );
            model::write::write(&identified, fullness.source, path).map_err(Failure::input)?;
        }
        let place = folder.path().display();
        if !output.json {
            let written = fullness.write_model;
            let also = written.map_or_else(String::new, |path| format!("; the model is {}", path.display()));
            say(format_args!("\nFiles in {place}; open {} in a browser{also}", page.display()));
        }
        if let Some(broken) = self.broken {
            return Err(Failure::link(format!("{broken}\nWhat came before is in {place}")));
        }
        Ok(if status == Status::Identified { ExitCode::SUCCESS } else { ExitCode::from(1) })
    }
}

/// Full parameters, where there is a nominal model, or why there are none; where they are asked for there must be one.
fn full_parameters(
    model: &Model,
    found: &TreeIdentification,
    fullness: &Fullness<'_>,
) -> Result<(Option<Full>, Option<String>), Failure> {
    let asked_for = fullness.is_asked_for();
    let without = model.welded().links.iter().all(|link| link.nominal.is_none());
    if without && !asked_for {
        return Ok((None, None));
    }
    match nearest(model, found, fullness.trust, fullness.symmetric) {
        Ok(full) => Ok((Some(full), None)),
        Err(error) if asked_for => Err(Failure::input(error)),
        Err(error) => Ok((None, Some(format!("no full parameters: {error}")))),
    }
}

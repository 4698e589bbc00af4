//! Several results of one body, or of one tree, summed up.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::Error;
use super::predict::answer_in;
use rigident_identify::answer::Answer;
use rigident_identify::answer::repeated::{self, Summary, is_usable};

/// Several results of one body, or of one tree, summed up.
#[derive(Clone, Debug, Serialize)]
pub struct SummedUp {
    /// Means and scatter of what at least two of them identify.
    #[serde(flatten)]
    pub summary: Summary,
    /// The files whose numbers are not to be used.
    pub left_out: Vec<String>,
    /// The files that have all numbers of one before: one run is counted once.
    pub given_twice: Vec<String>,
}

/// Sums up results, each the path of a `result.json` or of the folder that has it.
///
/// # Errors
/// [`Error::Unreadable`] and [`Error::Result`] of a file, [`Error::OtherSubject`] if it is of another body
/// than the first.
///
/// ```
/// use rigident::application::{Caller, IdentifyOptions, identify, summary};
///
/// let folder = tempfile::tempdir().unwrap();
/// let example = |name: &str| format!("{}/../docs/examples/{name}", env!("CARGO_MANIFEST_DIR"));
/// let options = IdentifyOptions::default();
/// let found = identify(example("bracket.csv").as_str().into(), &options, &Caller::default())?;
/// let paths = ["a.json", "again.json"].map(|name| folder.path().join(name));
/// for path in &paths {
///     std::fs::write(path, serde_json::to_string(&found.answer).unwrap()).unwrap();
/// }
/// let summed = summary(&paths)?;
/// assert!(summed.summary.runs == 1 && summed.given_twice.len() == 1);
/// # Ok::<(), rigident::application::Error>(())
/// ```
pub fn summary(results: &[PathBuf]) -> Result<SummedUp, Error> {
    let (mut answers, mut left_out, mut given_twice): (Vec<Answer>, _, _) =
        (Vec::new(), Vec::new(), Vec::new());
    for path in results {
        let file = file_of(path);
        let answer = answer_in(&file)?;
        if !is_usable(&answer) {
            left_out.push(file.display().to_string());
        } else if let Some(first) = answers.first().filter(|first| of(first) != of(&answer)) {
            return Err(Error::OtherSubject { path: file, of: of(&answer), first: of(first) });
        } else if answers.iter().any(|before| repeated::is_same_run(before, &answer)) {
            given_twice.push(file.display().to_string());
        } else {
            answers.push(answer);
        }
    }
    Ok(SummedUp { summary: repeated::summary(&answers), left_out, given_twice })
}

/// Returns the file, or the folder's.
fn file_of(path: &Path) -> PathBuf {
    if path.is_dir() { path.join("result.json") } else { path.to_owned() }
}

/// Returns what an answer is of, in words.
fn of(answer: &Answer) -> String {
    match &answer.model {
        Some(model) => format!("the model {}", model.name),
        None => "one body".to_owned(),
    }
}

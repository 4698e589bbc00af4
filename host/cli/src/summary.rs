use std::path::{Path, PathBuf};
use std::process::ExitCode;

use serde::Serialize;

use super::arguments::Summary as Arguments;
use super::outcome::say;
use super::{ExitStatus, Failure};
use rigident::answer::Answer;
use rigident::answer::repeated::{Repeated, Summary, is_usable, summary};
use rigident::application::predict::answer_in;

/// The object of `--json`.
#[derive(Serialize)]
struct Object<'a> {
    runs: usize,
    quantities: Vec<Figures<'a>>,
    not_identified: &'a [String],
    surprising: &'a [String],
    left_out: Vec<String>,
}

#[derive(Serialize)]
struct Figures<'a> {
    name: &'a str,
    unit: &'a str,
    runs: usize,
    mean: f64,
    mean_u95: f64,
    std: f64,
    stated_std: f64,
    range: [f64; 2],
    probability: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    truth: Option<f64>,
}

/// `rigident summary`
pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let (mut answers, mut left_out): (Vec<Answer>, _) = (Vec::new(), Vec::new());
    for path in &arguments.results {
        let (path, answer) = read(path)?;
        if !is_usable(&answer) {
            tell!("rigident: {}: its numbers are not to be used; it is left out", path.display());
            left_out.push(path.display().to_string());
        } else if let Some(first) = answers.first().filter(|first| of(first) != of(&answer)) {
            return Err(Failure::input(format!(
                "{}: it is of {}, and the first of {}",
                path.display(),
                of(&answer),
                of(first)
            )));
        } else {
            answers.push(answer);
        }
    }
    let summed = summary(&answers);
    if arguments.json {
        let object = Object {
            runs: summed.runs,
            quantities: summed.quantities.iter().map(figures).collect(),
            not_identified: &summed.left_out,
            surprising: &summed.surprising,
            left_out,
        };
        say(serde_json::to_string(&object).map_err(Failure::input)?);
    } else {
        say(text(&summed));
    }
    let whole = summed.surprising.is_empty() && !summed.quantities.is_empty();
    Ok(if whole { ExitCode::SUCCESS } else { ExitStatus::NotIdentified.into() })
}

/// The file, or the folder's, and what it says.
fn read(path: &Path) -> Result<(PathBuf, Answer), Failure> {
    let file = if path.is_dir() { path.join("result.json") } else { path.to_owned() };
    let answer = answer_in(&file)?;
    Ok((file, answer))
}

/// Returns what an answer is of, in words.
fn of(answer: &Answer) -> String {
    match &answer.model {
        Some(model) => format!("the model {}", model.name),
        None => "one body".to_owned(),
    }
}

fn figures(repeated: &Repeated) -> Figures<'_> {
    let Repeated { name, unit, runs, mean, mean_u95, std, stated_std, range, probability, truth } = repeated;
    Figures {
        name,
        unit,
        runs: *runs,
        mean: *mean,
        mean_u95: *mean_u95,
        std: *std,
        stated_std: *stated_std,
        range: *range,
        probability: *probability,
        truth: *truth,
    }
}

fn text(summed: &Summary) -> String {
    let with_truth = summed.quantities.iter().any(|q| q.truth.is_some());
    let mut text = format!(
        "{} runs\n\n  {:<14} {:<6} {:>4} {:>13} {:>10} {:>10} {:>10} {:>6} {:>11}{}",
        summed.runs,
        "",
        "",
        "runs",
        "mean",
        "± U95",
        "std",
        "stated",
        "ratio",
        "probability",
        if with_truth { "        truth" } else { "" }
    );
    for q in &summed.quantities {
        text += &format!(
            "\n  {:<14} {:<6} {:>4} {:>13.6} {:>10.2e} {:>10.2e} {:>10.2e} {:>6.2} {:>11}{}",
            q.name,
            q.unit,
            q.runs,
            q.mean,
            q.mean_u95,
            q.std,
            q.stated_std,
            q.std / q.stated_std,
            if q.probability < 1e-4 { "< 0.0001".to_owned() } else { format!("{:.4}", q.probability) },
            q.truth.map_or_else(String::new, |truth| format!(" {truth:>12.6}"))
        );
    }
    text += "\n\nThe uncertainty of the mean is by the scatter alone; what all runs have in common does not scatter.";
    if !summed.left_out.is_empty() {
        text += &format!("\nIdentified in fewer than two runs: {}.", summed.left_out.join(", "));
    }
    if summed.quantities.is_empty() {
        text += "\nThere is nothing that two runs identify.";
    }
    if !summed.surprising.is_empty() {
        text += &format!(
            "\nThe runs scatter more than their uncertainties explain: {}. Something changed between them that none of them shows: \
             the mounting, the body, the offset, the temperature. Take the scatter for the uncertainty.",
            summed.surprising.join(", ")
        );
    }
    text
}

//! What merging gains: the best run alone beside all of them.

use super::text::{NOT_IDENTIFIED, with_u95};
use crate::problem::instruments::is_unnamed;
use rigident_fit::pool::{PooledFactor, names_in_words};
use rigident_fit::{CheckedRun, Measured};

/// Lines of a table at most.
const MOST: usize = 16;
/// More runs than that are not solved one by one.
const MOST_RUNS: usize = 50;
/// A name of a run is cut after so many characters.
const NAME: usize = 20;

/// A parameter in one run, and in all.
struct Line {
    name: String,
    unit: String,
    best: Option<(Measured, String)>,
    merged: Measured,
}

impl Line {
    /// U95 of all by that of the best run; zero where no run tells the parameter.
    fn share(&self) -> f64 {
        self.best.as_ref().map_or(0.0, |(best, _)| self.merged.u95 / best.u95)
    }
}

/// Returns what merging runs assumed of their rigs, in words; nothing of one run.
pub fn assumptions(pooled: &PooledFactor) -> Vec<String> {
    if pooled.sources.len() < 2 {
        return Vec::new();
    }
    let mut said = Vec::new();
    if pooled.instruments().iter().any(|name| is_unnamed(name)) {
        said.push(
            "the rig files name no serial numbers of load cell and IMU: runs whose files state the same of one count as \
             taken with one, whose errors do not average out"
                .to_owned(),
        );
    }
    if pooled.rigs.len() > 1 {
        said.push(format!(
            "the runs count as those of {} rigs, whose errors are independent",
            pooled.rigs.len()
        ));
    }
    if !pooled.differing.is_empty() {
        said.push(format!(
            "runs of one rig state different standard deviations of {}: the largest was taken",
            names_in_words(&pooled.differing, ", ")
        ));
    }
    said
}

/// Returns true if a table is made of so many runs.
pub fn is_shown(runs: usize) -> bool {
    (2..=MOST_RUNS).contains(&runs)
}

/// Returns a table of the inertial parameters by the best run alone and by all, those first that gain most;
/// `None` of one run, of more than can be looked at, or if a recording of them cannot be true.
pub fn table(runs: &[PooledFactor], all: &PooledFactor) -> Option<String> {
    if !is_shown(runs.len()) {
        return None;
    }
    let merged = all.fit();
    if merged.runs.iter().any(CheckedRun::is_contradicted) {
        return None;
    }
    let name = |run: &PooledFactor| -> String {
        run.name.rsplit(['/', '\\']).next().unwrap_or_default().chars().take(NAME).collect()
    };
    let alone: Vec<(_, String)> = runs.iter().map(|run| (run.fit(), name(run))).collect();
    let line = |(j, parameter): (usize, &rigident_fit::Parameter)| {
        let of_run = |(fit, name): &(rigident_fit::Fit, String)| {
            let k = fit.parameters.iter().position(|p| p.name == parameter.name)?;
            Some((fit.estimate.measured(k)?, name.clone()))
        };
        let best = alone.iter().filter_map(of_run).min_by(|a, b| a.0.u95.total_cmp(&b.0.u95));
        let merged = merged.estimate.measured(j)?;
        Some(Line { name: parameter.name.clone(), unit: parameter.unit.clone(), best, merged })
    };
    let inertial = merged.parameters.iter().enumerate().filter(|(_, p)| p.kind.is_inertial());
    let mut lines: Vec<Line> = inertial.filter_map(line).collect();
    let count = lines.len();
    if count > MOST {
        lines.sort_by(|a, b| a.share().total_cmp(&b.share()));
        lines.truncate(MOST);
    }
    let mut out = format!(
        "  {:<12} {:>28}  {:<NAME$} {:>28}  {}\n",
        "", "best run alone ± U95", "which", "all merged ± U95", "U95 by that of the best"
    );
    for line in &lines {
        let (alone, which) = line.best.as_ref().map_or_else(
            || (NOT_IDENTIFIED.to_owned(), ""),
            |(own, name)| (with_u95(own.value, own.u95, &line.unit), name.as_str()),
        );
        let share = if line.best.is_some() { format!("{:.2}", line.share()) } else { String::new() };
        let all = with_u95(line.merged.value, line.merged.u95, &line.unit);
        out.push_str(&format!("  {:<12} {alone:>28}  {which:<NAME$} {all:>28}  {share}\n", line.name));
    }
    if count > MOST {
        out.push_str(&format!("  and {} more, which gain less\n", count - MOST));
    }
    Some(out)
}

//! The gain of merging: the best run alone beside all of them.

use rigident_fit::factor_file::FactorSource;
use rigident_fit::figures::{NOT_IDENTIFIED, with_u95};
use rigident_fit::pool::{PooledFactor, names_in_words};
use rigident_fit::{CheckedRun, Measured, RigError, RigRows};

/// Lines of a table at most.
const MOST: usize = 16;
/// More runs than that are not solved one by one.
const MOST_RUNS: usize = 50;
/// A name of a run is cut after this many characters.
const NAME: usize = 20;

/// A parameter in one run, and in all.
struct Line {
    name: String,
    unit: String,
    best: Option<(Measured, String)>,
    merged: Measured,
}

impl Line {
    /// Returns U95 of all runs divided by that of the best run; zero where no run determines the parameter.
    fn share(&self) -> f64 {
        self.best.as_ref().map_or(0.0, |(best, _)| self.merged.u95 / best.u95)
    }
}

/// The advice where instruments have no names.
const NAME_THEM: &str = "state `serial` of each in the rig file, or its label rig, where that is not so";

/// Returns the kinds of instruments that have no name: load cell, IMU.
fn unnamed<'a>(rigs: impl Iterator<Item = &'a RigRows>) -> String {
    let errors = rigs.flat_map(|rig| rig.errors()).filter(|error| error.is_unnamed());
    let mut words: Vec<&str> =
        errors.filter_map(|e| e.instrument.split_once(" #").map(|own| own.0)).collect();
    words.sort_unstable();
    words.dedup();
    words.join(" and ")
}

/// Returns the instruments that errors are of, those of a kind together: `one load cell (FT 17)`,
/// `2 IMUs (a, b)`.
fn instruments(rigs: &[RigRows]) -> Vec<String> {
    // Where an IMU sits makes no other one.
    let is_place = |error: &&RigError| matches!(error.group.as_str(), "lever arm" | "IMU rotation");
    let errors = || rigs.iter().flat_map(RigRows::errors).filter(|error| !is_place(error));
    let of_kind = |(one, many): (&str, &str)| {
        let name =
            |error: &RigError| error.instrument.strip_prefix(one)?.strip_prefix(' ').map(str::to_owned);
        let mut names: Vec<String> = errors().filter_map(name).collect();
        names.sort_unstable();
        names.dedup();
        let count = match names.len() {
            0 => return None,
            1 => format!("one {one}"),
            several => format!("{several} {many}"),
        };
        names.retain(|name| !name.starts_with('#'));
        let named = names_in_words(&names, ", ");
        Some(if names.is_empty() { count } else { format!("{count} ({named})") })
    };
    [("load cell", "load cells"), ("IMU", "IMUs"), ("machine", "machines")]
        .into_iter()
        .filter_map(of_kind)
        .collect()
}

/// Returns what merging runs assumed of their rigs and noise, in words; nothing of one run.
pub fn assumptions(pooled: &PooledFactor) -> Vec<String> {
    if pooled.runs() < 2 {
        return Vec::new();
    }
    let mut said = Vec::new();
    let unnamed = unnamed(pooled.rigs.iter());
    let (rigs, runs) = (pooled.rigs.len() as u64, pooled.runs());
    let instruments = instruments(&pooled.rigs);
    if !instruments.is_empty() {
        let how =
            if unnamed.is_empty() || rigs < 2 { "" } else { ", as their rig files state different things" };
        let several = if rigs > 1 { "; those of different ones are independent" } else { "" };
        said.push(format!(
            "the {runs} runs count as taken with {}{how}: errors of one instrument do not average \
             out{several}",
            instruments.join(" and ")
        ));
    }
    if !pooled.overlapping.is_empty() {
        said.push(format!(
            "{} have readings in common, so that these count twice and the intervals are too narrow: leave \
             one of each two out",
            names_in_words(&pooled.overlapping, ", ")
        ));
    }
    if !unnamed.is_empty() && rigs < runs {
        said.push(format!(
            "no serial number names the {unnamed}: runs whose rig files state the same count as taken with \
             one, whose errors do not average out; {NAME_THEM}"
        ));
    } else if !unnamed.is_empty() {
        said.push(format!("no serial number names the {unnamed}; {NAME_THEM}"));
    }
    if !pooled.differing.is_empty() {
        said.push(format!(
            "runs of one rig state different standard deviations of {}: the largest was taken",
            names_in_words(&pooled.differing, ", ")
        ));
    }
    let noisy = pooled.sources.iter().filter(|run| run.variance_scale > 1.0);
    let times = |run: &FactorSource| {
        let most = if run.runs() > 1 { "up to " } else { "" };
        format!("{} ({most}{:.1} times)", run.in_words(), run.variance_scale.sqrt())
    };
    let noisy: Vec<String> = noisy.map(times).collect();
    if !noisy.is_empty() {
        said.push(format!(
            "residuals are larger than the noise stated in {}: each of these counts by what it shows, and \
             widens no other",
            names_in_words(&noisy, ", ")
        ));
    }
    let contradicted =
        pooled.sources.iter().filter(|run| run.checks.as_ref().is_some_and(|c| c.contradicted));
    let contradicted: Vec<String> = contradicted.map(FactorSource::in_words).collect();
    if !contradicted.is_empty() {
        said.push(format!(
            "{} cannot be true, so nothing of all is identified: leave it out",
            names_in_words(&contradicted, ", ")
        ));
    }
    said
}

/// Returns what taking a fixture off assumed of the rigs of both runs, in words.
pub fn rigs_of_tare(total: &RigRows, fixture: &RigRows) -> Option<String> {
    let (own, other) = (total.errors(), fixture.errors());
    if own.is_empty() || other.is_empty() {
        return None;
    }
    let shared = other.iter().filter(|error| own.iter().any(|own| own.is(error))).count();
    let differ =
        own.iter().find(|e| other.iter().any(|o| o.name == e.name) && !other.iter().any(|o| e.is(o)));
    let unnamed = unnamed([total, fixture].into_iter());
    match differ {
        Some(error) if shared == 0 || error.group.contains("load-cell") => Some(format!(
            "tare: by their rig files the fixture was recorded with another rig ({}): its errors count as \
             independent, and do not cancel; state the same of both where it was one",
            error.instrument
        )),
        _ if !unnamed.is_empty() => Some(format!(
            "tare: no serial number names the {unnamed}: both runs count as taken with one, whose errors \
             cancel; {NAME_THEM}"
        )),
        _ => None,
    }
}

/// Returns true if a table is made of the given number of runs.
pub fn is_shown(runs: usize) -> bool {
    (2..=MOST_RUNS).contains(&runs)
}

/// Returns a table of the inertial parameters by the best run alone and by all, those first that gain most;
/// `None` of one run, of more than can be examined, or if a recording of them cannot be true.
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

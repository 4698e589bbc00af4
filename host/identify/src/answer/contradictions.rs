//! Errors of the rig that contradict what is stated of them: which, and how large.
//!
//! Each error by itself, the axes of a sensor each for itself, and scales that several axes share are freed
//! of what is known of them ([`ErrorScores::larger`]); what explains most is named with the size that the
//! rows then give it. What explains nearly as much is named beside it.

use nalgebra::DMatrix;

use rigident_fit::figures::{significant, unit_symbol, with_u95};
use rigident_fit::{
    Basis, CONTRADICTED, Effect, ErrorScores, Fit, Larger, Nuisance, NuisanceFit, contradict,
};

/// Contradictions that are named.
const NAMED: usize = 3;
/// Causes are not distinguished if one is up to a hundred times likelier than the other; an error more has to
/// make the recording as much likelier.
const TIE: f64 = 9.2;
/// A cause that would have to be this many times further from what is known than another one is not named
/// beside it.
const FARTHER: f64 = 4.0;
/// Causes that are named beside one another.
const CAUSES: usize = 4;

/// Returns true if the recording contradicts what is stated of an error, or of all together.
pub(super) fn is_contradicted(fit: &Fit) -> bool {
    contradict(&fit.nuisances, fit.agreement) || is_scaled(fit)
}

/// Returns true if scales that several axes share are further off than stated, though none by itself is.
fn is_scaled(fit: &Fit) -> bool {
    let Some(scores) = &fit.error_scores else { return false };
    let alike = candidates(fit).into_iter().filter(|cause| cause.alike).collect::<Vec<_>>();
    weighed(&alike, scores, &[]).first().is_some_and(|most| most.weight() > CONTRADICTED * CONTRADICTED)
}

/// Returns in words what of the errors of the rig contradicts what is known of them beforehand; empty if
/// nothing does.
pub fn contradictions(fit: &Fit) -> Vec<String> {
    if !is_contradicted(fit) {
        return Vec::new();
    }
    let found = causes(fit);
    if let (true, Some(agreement)) = (found.is_empty(), fit.agreement) {
        return vec![format!(
            "the errors of the rig are larger than stated: χ² {:.0} for {:.0} degrees of freedom; the \
             standard deviations in the rig file, or those of its classes, are too small, or something else \
             is wrong with the recording",
            agreement.chi2, agreement.degrees_of_freedom
        )];
    }
    found.iter().map(|alternatives| in_words(fit, alternatives)).collect()
}

/// One or several errors of one group as a cause.
#[derive(Clone, Debug)]
struct Cause<'a> {
    /// Numbers of the errors.
    errors: Vec<usize>,
    /// True if they are one and the same.
    alike: bool,
    fits: Vec<&'a NuisanceFit>,
}

impl<'a> Cause<'a> {
    fn of(fit: &'a Fit, errors: Vec<usize>, alike: bool) -> Self {
        let fits = errors.iter().filter_map(|k| fit.nuisances.get(*k)).collect();
        Self { errors, alike, fits }
    }

    fn columns(&self) -> usize {
        if self.alike { 1 } else { self.errors.len() }
    }

    /// Returns its directions, in standard deviations beforehand per unit.
    fn directions(&self, count: usize) -> DMatrix<f64> {
        let mut all = DMatrix::zeros(count, self.columns());
        for (column, (k, found)) in self.errors.iter().zip(&self.fits).enumerate() {
            all[(*k, if self.alike { 0 } else { column })] = 1.0 / found.nuisance.sigma;
        }
        all
    }
}

/// A cause with its size.
#[derive(Clone, Debug)]
struct Sized<'a> {
    cause: Cause<'a>,
    larger: Larger,
}

impl Sized<'_> {
    /// Returns how much likelier it makes the recording, the number of its errors counted.
    fn weight(&self) -> f64 {
        self.larger.chi2 - TIE * (self.cause.columns() - 1) as f64
    }

    /// Returns how far it is from what is known beforehand, in standard deviations of that.
    fn distance(&self) -> f64 {
        let column = |k: usize| if self.cause.alike { 0 } else { k };
        let each = self.cause.fits.iter().enumerate();
        let square = each.map(|(k, found)| (self.larger.value[column(k)] / found.nuisance.sigma).powi(2));
        (square.sum::<f64>() / self.cause.fits.len() as f64).sqrt()
    }
}

/// Returns the causes to be asked: each error; of a group of several axes all of them, and its scales alike.
fn candidates(fit: &Fit) -> Vec<Cause<'_>> {
    let of_rig = |k: &usize| !fit.nuisances[*k].nuisance.is_of_friction();
    let mut all: Vec<Cause> =
        (0..fit.nuisances.len()).filter(of_rig).map(|k| Cause::of(fit, vec![k], false)).collect();
    let mut groups: Vec<(String, Vec<usize>)> = Vec::new();
    for (k, found) in fit.nuisances.iter().enumerate().filter(|(k, _)| of_rig(k)) {
        let Nuisance { group, effect, .. } = &found.nuisance;
        let key = match effect {
            Effect::CrossTalk { .. } | Effect::Drift { .. } | Effect::None => continue,
            Effect::Gain { channel } => {
                let unit = fit.channels.get(*channel).map_or("", |c| c.channel.unit.as_str());
                format!("{group} {unit}")
            }
            Effect::Signal(_) => group.clone(),
        };
        match groups.iter_mut().find(|(name, _)| *name == key) {
            Some((_, members)) => members.push(k),
            None => groups.push((key, vec![k])),
        }
    }
    let gains =
        |k: &usize| fit.nuisances.get(*k).is_some_and(|k| matches!(k.nuisance.effect, Effect::Gain { .. }));
    let every_gain: Vec<usize> = (0..fit.nuisances.len()).filter(gains).collect();
    for (_, members) in groups {
        if (2..=3).contains(&members.len()) {
            all.push(Cause::of(fit, members.clone(), false));
        }
        let is_scale = |k: &usize| fit.nuisances.get(*k).is_some_and(|k| is_scale(&k.nuisance));
        if members.len() > 1 && members.iter().all(is_scale) {
            all.push(Cause::of(fit, members, true));
        }
    }
    if every_gain.len() > 1 {
        all.push(Cause::of(fit, every_gain, true));
    }
    all
}

/// Returns true for an error that multiplies a reading.
fn is_scale(nuisance: &Nuisance) -> bool {
    matches!(nuisance.effect, Effect::Gain { .. })
        || (nuisance.unit == "1" && nuisance.group.ends_with("scale"))
}

/// Returns the causes, the weightiest first: of each those that explain it as well, the likeliest beforehand
/// first.
fn causes(fit: &Fit) -> Vec<Vec<Sized<'_>>> {
    let Some(scores) = &fit.error_scores else { return Vec::new() };
    let candidates = candidates(fit);
    let mut first: Vec<Cause> = Vec::new();
    let mut left = scores.clone();
    while first.len() < NAMED {
        let best = weighed(&candidates, &left, &first).into_iter().next();
        let Some(best) = best.filter(|best| best.weight() > CONTRADICTED * CONTRADICTED) else { break };
        left = left.freed(&best.cause.directions(scores.count()));
        first.push(best.cause);
    }
    let alone = |k: usize| {
        let others =
            first.iter().enumerate().filter(|(other, _)| *other != k).map(|(_, cause)| cause.clone());
        let others: Vec<Cause> = others.collect();
        let free = |left: ErrorScores, cause: &Cause| left.freed(&cause.directions(scores.count()));
        equally_good(weighed(&candidates, &others.iter().fold(scores.clone(), free), &others))
    };
    (0..first.len()).map(alone).filter(|alternatives| !alternatives.is_empty()).collect()
}

/// Returns the causes that share no error with those that are free, by their weight.
fn weighed<'a>(candidates: &[Cause<'a>], scores: &ErrorScores, free: &[Cause]) -> Vec<Sized<'a>> {
    let apart = |cause: &&Cause| !free.iter().any(|other| overlap(cause, other));
    let sized = |cause: &Cause<'a>| {
        let larger = scores.larger(&cause.directions(scores.count()))?;
        Some(Sized { cause: cause.clone(), larger })
    };
    let mut all: Vec<Sized> = candidates.iter().filter(apart).filter_map(sized).collect();
    all.sort_by(|a, b| b.weight().total_cmp(&a.weight()));
    all
}

fn overlap(one: &Cause, other: &Cause) -> bool {
    one.errors.iter().any(|k| other.errors.contains(k))
}

/// Returns those that explain as much as the first one, the likeliest beforehand first.
fn equally_good(weighed: Vec<Sized<'_>>) -> Vec<Sized<'_>> {
    let most = weighed.first().map_or(0.0, Sized::weight);
    let mut kept: Vec<Sized> = Vec::new();
    for sized in weighed.into_iter().take_while(|sized| sized.weight() > most - TIE) {
        let several = sized.cause.errors.len() > 1;
        let is_part =
            |other: &Sized| (several || other.cause.errors.len() > 1) && overlap(&sized.cause, &other.cause);
        if !kept.iter().any(is_part) {
            kept.push(sized);
        }
    }
    kept.sort_by(|a, b| a.distance().total_cmp(&b.distance()));
    let nearest = kept.first().map_or(0.0, Sized::distance);
    kept.retain(|sized| sized.distance() <= FARTHER * nearest);
    kept.truncate(CAUSES);
    kept
}

/// Returns the unit of an error; nothing of a pure number.
pub(super) fn unit(nuisance: &Nuisance) -> &str {
    if nuisance.unit == "1" { "" } else { &nuisance.unit }
}

/// Returns the same with a space before it.
pub(super) fn symbol(nuisance: &Nuisance) -> String {
    match unit(nuisance) {
        "" => String::new(),
        unit => format!(" {}", unit_symbol(unit)),
    }
}

/// Returns a cause with its size: `gyro_scale_x 0.020 ± 0.001, 5.3 standard deviations of 0.004 from what …`.
fn sized_in_words(sized: &Sized, coverage: f64) -> String {
    let Sized { cause, larger } = sized;
    let Some(found) = cause.fits.first() else { return String::new() };
    let nuisance = &found.nuisance;
    let known = match &nuisance.basis {
        Basis::Stated(key) => format!("{key} of the rig file states"),
        Basis::Class(class) => format!("the class {class} lets expect"),
        Basis::Calibration(of) => format!("the calibration {of} states"),
    };
    let names: Vec<&str> = cause.fits.iter().map(|found| found.nuisance.name.as_str()).collect();
    let size = |k: usize, expected: f64| {
        with_u95(expected + larger.value[k], coverage * larger.sd[k], unit(nuisance))
    };
    let what = if cause.alike {
        format!("{} alike {}", names.join(", "), size(0, found.expected))
    } else {
        let each = names.iter().zip(&cause.fits).enumerate();
        each.map(|(k, (name, found))| format!("{name} {}", size(k, found.expected)))
            .collect::<Vec<_>>()
            .join(", ")
    };
    let far = if cause.columns() == 1 {
        let sd = larger.drawn_sd[0];
        format!(
            "{:.1} standard deviations of {}{} from what {known}",
            larger.chi2.max(0.0).sqrt(),
            significant(sd, 2),
            symbol(nuisance)
        )
    } else {
        format!("χ² {:.0} for {} of them against what {known}", larger.chi2, cause.columns())
    };
    let about = if found.expected == 0.0 { "0".to_owned() } else { significant(found.expected, 3) };
    format!("{what}, {far}, {about} ± {}{}", significant(nuisance.sigma, 2), symbol(nuisance))
}

/// Returns causes between which the recording does not tell in words.
fn in_words(fit: &Fit, alternatives: &[Sized]) -> String {
    let coverage = fit.estimate.coverage_factor();
    let mut groups: Vec<&str> = Vec::new();
    for found in alternatives.iter().flat_map(|sized| &sized.cause.fits) {
        if !groups.contains(&found.nuisance.group.as_str()) {
            groups.push(&found.nuisance.group);
        }
    }
    let each: Vec<String> = alternatives.iter().map(|sized| sized_in_words(sized, coverage)).collect();
    let calibrated = |found: &&NuisanceFit| matches!(found.nuisance.basis, Basis::Calibration(_));
    let is_calibrated = alternatives.iter().flat_map(|sized| &sized.cause.fits).all(calibrated);
    let remedy = if is_calibrated { "calibrate the rig again" } else { "correct the rig file" };
    let apart = if alternatives.len() > 1 {
        let ratio = ratio_in_words(alternatives, coverage);
        format!("; the recording does not tell these apart, the likeliest beforehand is first{ratio}")
    } else {
        String::new()
    };
    format!(
        "{}: {}{apart}; the intervals do not count that: {remedy}, or look for another cause that looks the \
         same",
        groups.join(" or "),
        each.join("; or "),
    )
}

/// Returns the ratio of two scales that is off, where each of two causes would be as large.
fn ratio_in_words(alternatives: &[Sized], coverage: f64) -> String {
    let [one, other] = alternatives else { return String::new() };
    let scales = |sized: &Sized| {
        let of_ratio = |k: &&NuisanceFit| {
            is_scale(&k.nuisance) || k.nuisance.unit == "1" && k.nuisance.effect == Effect::None
        };
        sized.cause.columns() == 1 && sized.cause.fits.iter().all(of_ratio)
    };
    let (a, b) = (one.larger.value[0].abs(), other.larger.value[0].abs());
    let sd = one.larger.sd[0].max(other.larger.sd[0]);
    if !scales(one) || !scales(other) || (a - b).abs() > 2.0 * sd {
        return String::new();
    }
    format!(": their ratio is off by {}", with_u95(100.0 * a, 100.0 * coverage * sd, "%"))
}

//! Compares the predictions of a person's model with those of a model with fewer degrees of freedom.

use std::path::PathBuf;

use super::super::{Caller, Error};
use super::{BodyOptions, people, read_trials, study_options};
use rigident_fit::figures::significant;
use rigident_fit::{FitOptions, Progress as _};
use rigident_identify::answer::person::LeftOut;
use rigident_io::motion_capture::trial::Trial;
use rigident_people::body_segments::left_out::left_out;
use rigident_people::body_segments::{Study, StudyError};
use rigident_people::inverse_kinematics::subject::HumanModel;
use rigident_people::person::Person;

/// A model predicts better if it leaves less by more than this, relative, on average over the axes.
const BETTER: f64 = 0.02;

/// Returns which of both models predicts left-out motions better, in words, if the person was asked for with
/// 58 degrees of freedom and can be made with 34; `own` is how the motions of the 58 are predicted.
pub(super) fn beside_human34(
    paths: &[PathBuf],
    options: &BodyOptions,
    own: &[LeftOut],
    caller: &Caller<'_>,
) -> Option<String> {
    if options.model != HumanModel::Human58 || options.osim.is_some() {
        return None;
    }
    let fewer = BodyOptions {
        model: HumanModel::Human34,
        tool: None,
        motions: None,
        write_model: None,
        ..options.clone()
    };
    caller.stage("the model of 34 degrees of freedom", 0.0);
    let other = predicted(paths, &fewer, caller).ok()?;
    let pairs = || own.iter().filter_map(|a| Some((a, other.iter().find(|b| b.name == a.name)?)));
    let mean = pairs().map(|(a, b)| (a.rms / b.rms.max(f64::MIN_POSITIVE)).ln()).sum::<f64>()
        / pairs().count().max(1) as f64;
    let each: Vec<String> = pairs()
        .map(|(a, b)| {
            format!("{} {} against {} {}", a.name, significant(a.rms, 2), significant(b.rms, 2), a.unit)
        })
        .collect();
    let verdict = if mean < (-BETTER).ln_1p() {
        "human58 predicts left-out motions better than human34"
    } else if mean > BETTER.ln_1p() {
        "human58 predicts left-out motions worse than human34, which is to be preferred"
    } else {
        "human58 predicts left-out motions no better than human34, which is to be preferred"
    };
    Some(format!("{verdict}: {}", each.join(", ")))
}

/// Predicts left-out motions by another model of the same person.
fn predicted(paths: &[PathBuf], options: &BodyOptions, caller: &Caller<'_>) -> Result<Vec<LeftOut>, Error> {
    let mut trials = read_trials(paths, options)?;
    let standing = options.standing.as_deref().map(|path| Trial::read(path, None)).transpose()?;
    let silent = |_: &str, _: f64| {};
    let person = Person::new(&mut trials, standing.as_ref(), &people(options, None)?, &silent)
        .map_err(StudyError::from)?;
    let all: Vec<usize> = (0..paths.len()).collect();
    let mut study = Study::new(&person, &all, &study_options(options), &FitOptions::default(), caller)?;
    study.draw(&person, &trials, caller)?;
    Ok(left_out(&study, &person, 0.0)?.channels)
}

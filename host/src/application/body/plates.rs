//! The report of force plates that contradict a person's motion, or one another.

use rigident_fit::COVERAGE_95;
use rigident_identify::answer::Finding;
use rigident_people::body_segments::plates::{PlateErrors, plate_errors};
use rigident_people::body_segments::{Study, StudyError};
use rigident_people::person::Person;

/// Returns plates that are not where the file has them, and plates with different scales. Of such a scale no
/// interval counts anything: the trials contradict each other.
pub(super) fn doubtful_plates(person: &Person, study: &Study) -> Result<Vec<Finding>, StudyError> {
    // A slope, or axes of a belt: far more than any interval counts.
    let leans =
        person.trials.iter().filter(|tracked| tracked.report.tilt.is_some_and(|tilt| tilt.is_a_slope()));
    let mut findings: Vec<Finding> =
        leans.filter_map(|tracked| Some(Finding::contradiction(tracked.tilt_words()?))).collect();
    for found in plate_errors(study, person)? {
        let name = person.trials.get(found.trial).map_or("", |tracked| &tracked.name);
        findings.extend(shifts(name, &found).into_iter().map(Finding::warning));
        findings.extend(scales(name, &found).into_iter().map(Finding::contradiction));
    }
    Ok(findings)
}

fn shifts(name: &str, found: &PlateErrors) -> Vec<String> {
    let sentences = found.carrying.iter().filter_map(|k| Some((*k, found.shift(*k).if_significant()?)));
    let sentences = sentences.map(|(k, shift)| {
        let [x, y] = [0, 1].map(|axis| {
            let u95 = COVERAGE_95 * shift.covariance[(axis, axis)].max(0.0).sqrt();
            format!("{:.1} ± {:.1} cm", 1e2 * shift.value_m[axis], 1e2 * u95)
        });
        let plate = found.plates.get(k).map_or("", String::as_str);
        format!(
            "{name}, {plate}: by feet and motion it is not where the file has it, but that is off by {x} \
             along x and {y} along y (z up): check the plate's corners (FORCE_PLATFORM:CORNERS) or the \
             centres of pressure; first moments are wrong by it"
        )
    });
    sentences.collect()
}

fn scales(name: &str, found: &PlateErrors) -> Vec<String> {
    let plate = |k: usize| found.plates.get(k).map_or("", String::as_str);
    let other = found.pairs().filter_map(|(a, b)| Some((a, b, found.ratio(a, b)?)));
    let sentences = other.map(|(a, b, [ratio, sigma])| {
        format!(
            "{name}: {} reads {ratio:.2} ± {:.2} times what {} does of one motion: check the scales of both",
            plate(a),
            COVERAGE_95 * sigma,
            plate(b)
        )
    });
    sentences.collect()
}

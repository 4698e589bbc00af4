//! The result about a person, from a study.

use super::error::StudyError;
use super::segments::segments;
use super::study::{Segments, Study};
use crate::person::{Person, Tracked, Unmeasured};
use rigident_fit::figures::significant;
use rigident_fit::{COVERAGE_95, Fit, Measured};
use rigident_identify::answer::Answer;
use rigident_identify::answer::person::{
    DroppedFrames, FarMarker, LeftOut, PersonResult, TrialResult, UnmeasuredContact,
};
use rigident_identify::answer::result::ParameterState;

/// Markers that are named as farthest off.
const FARTHEST: usize = 3;

/// A channel with a lower gain is predicted worse than by the table beyond chance ([`LeftOut::gain_sd`]).
const WORSE_SD: f64 = -2.0;

/// Returns why segments are not identified if motions that were left out are predicted worse than by the
/// table: what is found holds in no other motion.
pub fn worse_than_table(left_out: &[LeftOut]) -> Option<String> {
    let each = left_out.iter().filter(|own| own.gain_sd < WORSE_SD).map(|own| {
        let [own_rms, table_rms] = [own.rms, own.table_rms].map(|rms| significant(rms, 2));
        format!("{} {own_rms} against {table_rms} {}", own.name, own.unit)
    });
    let each: Vec<String> = each.collect();
    (!each.is_empty()).then(|| {
        format!(
            "left-out motions are predicted worse than by the table ({}): what is found of the segments does \
             not hold in other motions, so none is identified; record motions of other kinds",
            each.join(", ")
        )
    })
}

/// Returns what is found of a person; `fit` is of all motions with the table, `found` the segments, `answer`
/// what the fit says, `left_out` how left-out motions are predicted.
///
/// # Errors
/// [`StudyError`] as the fits have it.
pub fn person_result(
    study: &Study,
    person: &Person,
    fit: &Fit,
    found: &Segments,
    answer: &Answer,
    left_out: &[LeftOut],
) -> Result<PersonResult, StudyError> {
    let whole = study.table.names().first();
    let place = whole.and_then(|name| fit.parameters.iter().position(|p| p.name == *name));
    let state = place.and_then(|place| answer.parameters.get(place)).map(|p| p.state);
    let spread = &study.options.spread;
    let mass_with_table_kg = state.and_then(|state| state.measured());
    // Whoever is not of rigid segments in these motions shows none, nor does one whose mass is not known.
    let mass_kg = state.filter(ParameterState::is_identified).and_then(|_| fit.data_alone().measured(place?));
    let tells = study.tells_segments() && mass_kg.is_some();
    let found_segments = tells.then(|| segments(study, person, found)).transpose()?;
    let (segments, centre) = found_segments.unzip();
    let mut segments = segments.unwrap_or_default();
    if worse_than_table(left_out).is_some() {
        segments.iter_mut().for_each(|own| own.identified = false);
    }
    Ok(PersonResult {
        model: person.subject.model.name.clone(),
        table: format!("P. de Leva (1996), {}", person.subject.person.sex.words()),
        height_m: person.subject.person.height_m,
        table_mass_kg: person.subject.person.mass_kg,
        mass_kg,
        mass_with_table_kg,
        table_sigma: [spread.mass, spread.centre, spread.inertia, spread.whole],
        segments,
        centre_of_mass_m: centre,
        left_out: left_out.to_vec(),
        motions: study.motions.len() as u64,
        choices: Vec::new(),
        tool: None,
        device: None,
        trials: person.trials.iter().map(trial).collect(),
    })
}

fn trial(tracked: &Tracked) -> TrialResult {
    let report = &tracked.report;
    let mut far = report.by_marker.clone();
    far.sort_by(|a, b| b.1.total_cmp(&a.1));
    far.truncate(FARTHEST);
    let dropped = report
        .dropped
        .iter()
        .map(|(reason, count)| DroppedFrames { reason: reason.words().to_owned(), frames: *count as u64 });
    TrialResult {
        name: tracked.name.clone(),
        frames: report.frames as u64,
        used: tracked.frames.len() as u64,
        rate_hz: report.rate_hz,
        dropped: dropped.collect(),
        unmeasured: report.unmeasured.iter().map(contact).collect(),
        beside_plates_n: report.beside_n,
        tilt_deg: report.tilt.map(|tilt| {
            let u95 = COVERAGE_95 * tilt.sigma.to_degrees();
            [tilt.lean.x, tilt.lean.y].map(|lean| Measured { value: lean.atan().to_degrees(), u95 })
        }),
        filled: report.filled as u64,
        cut_off_hz: report.cut_off_hz,
        delay_s: report.delay.map(|(d, _)| Measured { value: d.delay_s, u95: COVERAGE_95 * d.sigma_s }),
        delay_taken_out: report.delay.is_some_and(|(_, taken)| taken),
        marker_rms_m: report.rms_m,
        farthest: far.into_iter().map(|(name, rms_m)| FarMarker { name, rms_m }).collect(),
    }
}

fn contact(of: &Unmeasured) -> UnmeasuredContact {
    UnmeasuredContact {
        times_s: of.times_s,
        force_n: of.force_n.into(),
        most_n: of.most_n,
        near: of.near.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_is_predicted_worse_than_by_the_table_has_no_segments() {
        let channel = |name: &str, gain_sd: f64| LeftOut {
            name: name.to_owned(),
            unit: "N".to_owned(),
            rms: 17.0,
            table_rms: 13.0,
            gain_sd,
            ..LeftOut::default()
        };
        assert_eq!(worse_than_table(&[channel("fx", 3.0), channel("fz", -1.9)]), None);
        let said = worse_than_table(&[channel("fx", 3.0), channel("fz", -2.1)]).unwrap();
        assert!(said.contains("(fz 17 against 13 N)") && said.contains("none is identified"), "{said}");
    }
}

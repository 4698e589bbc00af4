//! The covariance that ships against the exact one of white noise after the filter, `G⁻¹ (Ãᵀ T Ã) G⁻¹`.

use rigident::fit::{FitOptions, RowSource, Silent};
use rigident::rows::body::{BodySource, Input};

use super::{Study, fit_body};
use crate::estimation::coloured_noise;
use crate::estimation::filter_response::impulse_response;
use crate::estimation::problem::Normal;

/// Within 5 % for every one of the sixteen parameters, at the rates that ship, and not by being the same
/// computation.
#[test]
fn shipped_standard_deviations_are_those_of_the_sandwich() {
    for rate_hz in [200.0, 1000.0] {
        let ratios = Study::new(rate_hz).shipped_over_sandwich();
        assert!(ratios.iter().all(|r| (0.95..=1.05).contains(r)), "{rate_hz} Hz: {ratios:?}");
        assert!(ratios.iter().any(|r| (r - 1.0).abs() > 1e-3), "{rate_hz} Hz: {ratios:?}");
    }
}

/// Noise that is correlated over 0.05 and 0.2 s. Of 16 · 60 intervals, correlated within a run, the standard
/// error of the share is below 2 %.
#[test]
fn intervals_count_noise_that_is_not_white() {
    for (time_s, seed) in [(0.05, 7), (0.2, 8)] {
        let stated = coloured_noise::line(&Study::new(coloured_noise::RATE_HZ), time_s, seed, 60).given;
        let [counted, as_white] = [stated.held, stated.held_as_white].map(|held| held / 60.0);
        assert!((0.90..=0.99).contains(&counted), "{time_s} s: {counted}");
        assert!(as_white < 0.82, "{time_s} s: {as_white}");
    }
}

/// Of a hundred points the last before the end rests on all but a hundredth of the rows.
#[test]
fn the_course_to_an_answer_counts_colour_as_the_answer_does() {
    let study = Study::new(coloured_noise::RATE_HZ);
    let readings = coloured_noise::readings(&study, 0.2, &mut Normal::new(9));
    let input = Input { readings, ..study.input().clone() };
    let found = fit_body(&input, &FitOptions { convergence_points: 100, ..FitOptions::default() });
    assert!(found.largest_inflation().unwrap() > 2.0);
    let course = found.convergence.as_slice();
    let [.., before, end] = course else { panic!("{} points", course.len()) };
    for (before, end) in before.parameters.iter().zip(&end.parameters) {
        let ratio = before.unwrap().u95 / end.unwrap().u95;
        assert!((0.95..1.1).contains(&ratio), "{ratio}");
    }
}

/// The filter that the fit takes for the rows' is the one that the pipeline has.
#[test]
fn the_fit_knows_the_pipeline_s_filter() {
    for rate_hz in [200.0, 1000.0] {
        let study = Study::new(rate_hz);
        let source = BodySource::new(study.input().clone(), None);
        let rows = source.condition(&Silent).unwrap();
        let asked = impulse_response(study.settings());
        assert_eq!(rows.filter().response.len(), asked.len());
        for (known, asked) in rows.filter().response.iter().zip(asked) {
            assert!((known - asked).abs() < 1e-14, "{rate_hz} Hz: {known} {asked}");
        }
    }
}

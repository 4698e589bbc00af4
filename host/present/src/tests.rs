//! Text and page of answers of every kind.

use roxmltree::{Document, ParsingOptions};

use super::plain;
use super::{Series, report};
use rigident_fit::figures::with_u95;
use rigident_fit::{Convergence, Fit};
use rigident_identify::answer::Context;
use rigident_identify::answer::result::{Answer, Measured};
use rigident_shared::spatial::Wrench;

#[path = "../../identify/src/answer/samples.rs"]
mod samples;

use samples::{input, of_body, readings, rig, samples};

/// Returns a convergence that follows the square root of time.
fn converging(fit: &Fit) -> Vec<Convergence> {
    let end = fit.residuals.last().map_or(1.0, |r| r.time_s);
    (1..=200)
        .map(|k| {
            let time_s = end * f64::from(k) / 200.0;
            let wider = (end / time_s).sqrt();
            let at = |j: usize| {
                let Measured { value, u95 } = fit.estimate.measured(j)?;
                let off = 0.4 * u95 * (wider - 1.0) * (f64::from(k) * 0.3 + j as f64).sin();
                Some(Measured { value: value + off, u95: u95 * wider })
            };
            Convergence { time_s, parameters: (0..fit.parameters.len()).map(at).collect() }
        })
        .collect()
}

fn page(fit: &mut Fit, answer: &Answer) -> String {
    if fit.parameters.len() < 40 {
        fit.convergence = converging(fit);
    }
    report(answer, &Series::new(fit, answer, false, 0.0))
}

fn text_of(document: &Document) -> String {
    document.descendants().filter(|n| n.is_text()).filter_map(|n| n.text()).collect::<Vec<_>>().join(" ")
}

#[test]
fn every_kind_of_body_has_a_page_with_the_same_sections() {
    for (name, mut fit, answer) in samples() {
        let page = page(&mut fit, &answer);
        let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
        let document = Document::parse_with_options(&page, options).unwrap_or_else(|e| panic!("{name}: {e}"));
        let heads: Vec<&str> =
            document.descendants().filter(|n| n.has_tag_name("h2")).filter_map(|n| n.text()).collect();
        for head in ["Results", "Residuals by channel", "Residuals", "Provenance"] {
            assert!(heads.contains(&head), "{name}: {heads:?}");
        }
        let shown = text_of(&document);
        assert!(!shown.contains("NaN") && !shown.contains(" inf"), "{name}");
        // Every table but the narrow ones can be scrolled by itself.
        let wide = document.descendants().filter(|n| n.has_tag_name("table"));
        for table in wide.filter(|n| !["plainrows", "xyz", "tensor"].contains(&n.attribute("class").unwrap()))
        {
            let around = table.parent().and_then(|p| p.attribute("class")).unwrap_or_default();
            assert!(around.split(' ').any(|class| class == "scroll"), "{name}: {around}");
        }
        let ids: Vec<&str> = document.descendants().filter_map(|n| n.attribute("id")).collect();
        let unique: std::collections::HashSet<&str> = ids.iter().copied().collect();
        assert_eq!(ids.len(), unique.len(), "{name}: an id occurs twice");
        assert_eq!(shown.contains("the connection to /dev/ttyACM0 was lost"), name == "failed");
    }
}

#[test]
fn the_text_holds_every_number_rounded_to_its_uncertainty_and_tells_notes_from_warnings() {
    for (name, _, answer) in samples() {
        let text = plain::text(&answer);
        for parameter in &answer.parameters {
            let Some(m) = parameter.state.measured() else { continue };
            let line = text.lines().find(|l| l.split_whitespace().next() == Some(parameter.name.as_str()));
            let line = line.unwrap_or_else(|| panic!("{name}: no line for {}", parameter.name));
            let words: Vec<&str> = line.split_whitespace().collect();
            let wanted = with_u95(m.value, m.u95, &parameter.unit);
            assert!(words.join(" ").contains(&wanted), "{name}: {line} for {wanted}");
        }
        let count = |label: &str| text.lines().filter(|l| l.starts_with(label)).count();
        assert_eq!(count("warning: "), answer.warnings.len(), "{name}");
        assert_eq!(count("note: "), answer.notes.len(), "{name}");
        assert_eq!(count("error: "), usize::from(name == "failed"));
    }
}

/// A body that changed: text and page begin with it, and six plots mark the time.
#[test]
fn a_change_is_marked_in_the_plots_of_the_page() {
    let mut all = readings(4000, 200.0, 0.4, 0.5);
    let offset = rig().truth.unwrap().apparent_offset_n_nm.unwrap();
    for reading in &mut all[2400..] {
        let wrench = reading.wrench.array();
        reading.wrench =
            Wrench::from_array(std::array::from_fn(|c| wrench[c] - 0.05 * (wrench[c] - offset[c])));
    }
    let fit = of_body(&input(all, false, Some(0.5)));
    let rig = rig();
    let answer = Answer::new(&fit, Context { body: rig.body.as_ref(), ..Context::default() }).unwrap();
    let text = plain::text(&answer);
    assert!(text.starts_with("Not to be used"), "{text}");
    let series = Series::new(&fit, &answer, false, 0.0);
    assert!(series.convergence.is_empty());
    let page = report(&answer, &series);
    let unmarked = report(&answer, &Series { change_s: None, ..series });
    assert_eq!(page.matches("V1").count(), unmarked.matches("V1").count() + 6);
}

//! The promises of the report page, checked by an XML parser that knows nothing of how it was written.

mod synthetic;

use std::collections::HashSet;

use rigident::answer::result::{Consistency, Measured, NearestBody, ParameterState};
use rigident::present::{Along, TimePlot};
use roxmltree::{Document, Node, ParsingOptions};

/// Parses the page strictly; the page is HTML and XML at once.
fn parse(page: &str) -> Document<'_> {
    Document::parse_with_options(page, ParsingOptions { allow_dtd: true, ..ParsingOptions::default() })
        .unwrap_or_else(|error| panic!("not well-formed: {error}"))
}

fn all_text(node: Node) -> String {
    node.descendants().filter(|n| n.is_text()).filter_map(|n| n.text()).collect::<Vec<_>>().join(" ")
}

fn elements<'a>(document: &'a Document, name: &'static str) -> Vec<Node<'a, 'a>> {
    document.descendants().filter(|n| n.has_tag_name(name)).collect()
}

fn has_digit(text: &str) -> bool {
    text.chars().any(char::is_numeric)
}

#[test]
fn the_page_is_well_formed_self_contained_and_labelled() {
    for data in [synthetic::experiment(100.0), synthetic::still_poses(), synthetic::Experiment::default()] {
        let page = data.page();
        let document = parse(&page);
        let ids: Vec<&str> = document.descendants().filter_map(|n| n.attribute("id")).collect();
        let unique: HashSet<&str> = ids.iter().copied().collect();
        assert_eq!(ids.len(), unique.len(), "an id occurs twice");
        for plot in elements(&document, "svg").into_iter().filter(|n| n.attribute("role") == Some("img")) {
            let labels = plot.attribute("aria-labelledby").unwrap();
            assert!(labels.split(' ').all(|id| unique.contains(id)), "{labels}");
            assert!(plot.children().any(|n| n.has_tag_name("title") && n.text().is_some()));
        }
        for loading in ["script", "link", "img", "iframe", "object", "use", "image"] {
            assert!(elements(&document, loading).is_empty(), "{loading}");
        }
        for attribute in document.descendants().flat_map(|n| n.attributes()) {
            assert!(
                !["src", "href", "srcset"].contains(&attribute.name()) && !attribute.name().starts_with("on")
            );
        }
        let style = all_text(elements(&document, "style")[0]);
        assert!(!style.contains("url(") && !style.contains("@import"));
    }
}

#[test]
fn every_parameter_channel_and_motion_has_its_plot() {
    let page = synthetic::experiment(100.0).page();
    let document = parse(&page);
    let plots = elements(&document, "svg").into_iter().filter(|n| n.attribute("role") == Some("img"));
    let titles: Vec<String> =
        plots.filter_map(|n| n.children().find(|c| c.has_tag_name("title")).map(all_text)).collect();
    for (name, ..) in synthetic::PARAMETERS {
        assert!(titles.contains(&format!("Convergence of {name}")), "{name}");
    }
    for channel in ["fx", "fy", "fz", "mx", "my", "mz"] {
        assert!(titles.contains(&format!("Residual of {channel}")));
    }
    assert_eq!(titles.len(), 10 + 6 + 2 + 1);
}

/// Numbers that could only come from parameters that are not identified are planted everywhere they could
/// leak.
#[test]
fn unidentified_parameters_show_no_number() {
    let mut data = synthetic::still_poses();
    for history in data.series.convergence.iter_mut().skip(4) {
        history.estimate.fill(777.125);
        history.u95.fill(7.125);
    }
    for parameter in &mut data.answer.parameters {
        if parameter.state.measured().is_none() {
            parameter.truth = Some(777.125);
        }
    }
    data.answer.truth.as_mut().unwrap().inertia_com_kgm2 = [777.125; 6];
    data.answer.truth.as_mut().unwrap().body_frame_inertia_origin_kgm2 = Some([777.125; 6]);
    // An estimate that is not a number, or as uncertain as can be, is none.
    data.answer.parameters[10].state =
        ParameterState::Identified(Measured { value: 777.125, u95: f64::INFINITY });
    let page = data.page();
    let document = parse(&page);
    // The paths' coordinates are the plots' own.
    let shown = document.descendants().filter(|n| n.is_text()).filter_map(|n| n.text());
    assert_eq!(shown.filter(|t| t.contains("777")).collect::<Vec<_>>(), [""; 0]);
    let without = |n: &Node| all_text(*n).contains("not identified");
    let rows: Vec<Node> = elements(&document, "tr").into_iter().filter(without).collect();
    let figures: Vec<Node> = elements(&document, "figure").into_iter().filter(without).collect();
    // Six moments in S and about the centre of mass, and one offset.
    assert_eq!((rows.len(), figures.len()), (13, 6));
    assert!(figures.iter().all(|f| !f.descendants().any(|n| n.has_tag_name("svg"))));
    for node in rows.into_iter().chain(figures) {
        assert!(!has_digit(&all_text(node).replace('²', "")), "{}", all_text(node));
    }
    let text = data.text();
    let lines: Vec<&str> = text.lines().skip(1).filter(|l| l.contains("not identified")).collect();
    assert_eq!(lines.len(), 13);
    assert!(lines.iter().all(|l| !has_digit(l)) && !text.contains("777"), "{text}");
}

#[test]
fn an_hour_of_samples_makes_no_larger_page_than_a_minute() {
    let minute = synthetic::experiment(1000.0).page().len();
    assert!(minute < 300_000, "{minute}");
    let longer = synthetic::experiment(10_000.0).page().len();
    assert!(longer < minute + minute / 20, "{minute} {longer}");
}

#[test]
fn text_from_outside_arrives_as_text() {
    let name = "<script>alert('1')</script> & \"x\" \u{1b}[31m";
    let mut data = synthetic::experiment(50.0);
    data.answer.source.recording = name.to_owned();
    data.answer.source.mcu = name.to_owned();
    data.series.provenance = vec![(name.to_owned(), name.to_owned())];
    data.series.rejected = vec![(name.to_owned(), 1)];
    data.answer.warnings = vec![name.to_owned()];
    data.answer.advice = vec![name.to_owned()];
    data.answer.parameters[3].name = name.to_owned();
    data.answer.parameters[4].unit = name.to_owned();
    data.series.convergence[4].name = name.to_owned();
    data.series.residuals[0].channel = name.to_owned();
    data.series.motion[0].title = name.to_owned();
    data.series.motion[0].series[0].0 = name.to_owned();
    data.series.stages[5].name = name.to_owned();
    data.answer.body_frame.as_mut().unwrap().name = name.to_owned();
    let page = data.page();
    let document = parse(&page);
    assert_eq!(all_text(elements(&document, "h1")[0]), name.replace('\u{1b}', "\u{fffd}"));
    assert!(elements(&document, "script").is_empty());
    assert!(!data.text().contains('\u{1b}'));
}

#[test]
fn any_data_make_a_page() {
    let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, 1e300, -1e-300, 5e-324];
    for (i, a) in bad.into_iter().enumerate() {
        let b = bad[(i + 3) % bad.len()];
        let mut data = synthetic::experiment(20.0);
        data.answer.source.rate_hz = Some(a);
        data.answer.source.duration_s = Some(b);
        data.answer.condition_number = Some(a);
        for quantity in &mut data.answer.parameters {
            quantity.truth = Some(b);
            if let Some(m) = quantity.state.measured_mut() {
                (m.value, m.u95) = (a, b.abs());
            }
        }
        for history in &mut data.series.convergence {
            history.estimate.iter_mut().step_by(2).for_each(|v| *v = b);
            history.u95.iter_mut().step_by(3).for_each(|v| *v = a);
            history.time_s[5] = b;
        }
        for residual in &mut data.series.residuals {
            residual.sigma = a;
            residual.values.fill(b);
            residual.values.truncate(100 * i);
        }
        for plot in &mut data.series.motion {
            plot.range_s = Some((a, b));
            plot.series[1].1.iter_mut().step_by(3).for_each(|point| *point = (a, b));
            plot.series[0].1.clear();
        }
        data.series.stages[1].start_s = a;
        let drift = data.answer.drift.as_mut().unwrap();
        drift.elapsed_s = a;
        drift.changes[2].change.as_mut().unwrap().value = b;
        drift.changes[3].change.as_mut().unwrap().u95 = b.abs();
        let page = data.page();
        parse(&page);
        for word in ["NaN", "inf ", "inf<", ">inf", "-inf"] {
            assert!(!page.contains(word), "{a} {b}: {word}");
        }
        data.text();
    }
}

#[test]
fn a_drift_beyond_its_uncertainty_is_named_and_a_missing_one_is_not_called_none() {
    let mut data = synthetic::experiment(20.0);
    let changes = &mut data.answer.drift.as_mut().unwrap().changes;
    for (i, change) in changes.iter_mut().enumerate() {
        let m = change.change.as_mut().unwrap();
        m.value = if i == 1 { -1.01 } else { 0.99 } * m.u95;
    }
    assert!(data.page().contains("<b>fy</b> changed by more"));
    data.answer.drift.as_mut().unwrap().changes[1].change = None;
    assert!(data.page().contains("No channel changed by more"));
    data.answer.drift.as_mut().unwrap().changes.iter_mut().for_each(|c| c.change = None);
    assert!(data.page().contains("No change could be measured"));
}

#[test]
fn still_poses_are_counted_not_timed() {
    let mut data = synthetic::still_poses();
    data.series.along = Along::Poses;
    let poses: Vec<f64> = (1..=24).map(f64::from).collect();
    data.series.motion.clear();
    data.series.convergence.clear();
    for residual in &mut data.series.residuals {
        residual.time_s.clone_from(&poses);
        residual.values.truncate(24);
    }
    let page = data.page();
    let document = parse(&page);
    let texts: Vec<String> = elements(&document, "text").into_iter().map(all_text).collect();
    assert_eq!(texts.iter().filter(|t| *t == "pose").count(), 6);
    assert!(!texts.iter().any(|t| t.contains("time")));
    let dots = elements(&document, "path").into_iter().filter(|n| n.attribute("class") == Some("dots"));
    let drawn: Vec<usize> = dots.map(|n| n.attribute("d").unwrap().matches('M').count()).collect();
    assert_eq!(drawn, [24; 6]);
}

#[test]
fn the_terminals_columns_are_aligned_and_say_how_far_the_truth_is() {
    let mut data = synthetic::experiment(20.0);
    let mass = &mut data.answer.parameters[0];
    let measured = mass.state.measured_mut().unwrap();
    (measured.value, measured.u95) = (20.0196, 0.0196);
    let text = data.text();
    let mut group = text.lines().skip_while(|l| !l.starts_with("In S")).skip(1).take(11);
    let at = |line: &str, c: char| line.chars().position(|x| x == c);
    let plus_minus = at(group.next().unwrap(), '±');
    let lines: Vec<&str> = group.collect();
    assert!(lines.iter().all(|l| at(l, '±') == plus_minus), "{text}");
    // (20.0196 − 20) / (0.0196 / 1.96) = 1.96.
    let expected = ["m", "20.020", "±", "0.020", "kg", "20", "+1.96", "sd"];
    assert_eq!(lines[0].split_whitespace().collect::<Vec<_>>(), expected);
}

#[test]
fn an_answer_that_no_body_has_comes_with_the_nearest_one() {
    let mut data = synthetic::experiment(100.0);
    data.answer.physically_consistent = Some(false);
    let nearest_body = NearestBody {
        mass_kg: 2.5,
        com_m: [0.1, -0.02, 0.0],
        inertia_com_kgm2: [0.01, 0.2, 0.2, 0.0, 0.0, 0.001],
        ..NearestBody::default()
    };
    data.answer.consistency =
        Some(Consistency { distance_sd: 1.2345, nearest_body: Some(nearest_body), ..Consistency::default() });
    let words = "1.2 standard deviations away: m 2.5 kg; centre of mass 0.1, -0.02, 0 m; Ixx, Iyy, Izz, Iyz, \
                 Izx, Ixy about it 0.01, 0.2, 0.2, 0, 0, 0.001 kg m²";
    assert!(data.text().contains(words), "{}", data.text());
    assert!(data.page().contains(words));
}

/// Nothing is known of what lies between two poses.
#[test]
fn still_poses_are_points_and_a_note_is_no_warning() {
    let mut data = synthetic::still_poses();
    data.series.along = Along::Poses;
    data.answer.notes = vec!["the answer is that of the last 5 s".to_owned()];
    data.answer.warnings = Vec::new();
    let plot = TimePlot::new("Gravity from its columns, axes of S", "m/s2");
    data.series.motion = vec![plot.with("x", 3, |k| (1.0 + k as f64, 1.0 + 4.0 * k as f64))];
    let page = data.page();
    let document = parse(&page);
    let svg = elements(&document, "svg")
        .into_iter()
        .find(|n| n.attribute("aria-labelledby").is_some_and(|ids| ids.starts_with("motion-0")));
    let drawn: Vec<Node> = svg.unwrap().descendants().filter(|n| n.has_tag_name("path")).collect();
    let points: Vec<_> = drawn.iter().filter(|n| n.attribute("class") == Some("s0 points")).collect();
    assert_eq!(points.len(), 1);
    let path = points[0].attribute("d").unwrap();
    assert!(path.matches('M').count() == 3 && !path.contains('l'), "{path}");
    assert!(drawn.iter().all(|n| n.attribute("class") != Some("s0")));

    let boxes = elements(&document, "section").into_iter().filter(|n| n.attribute("class") == Some("box"));
    assert!(
        boxes.clone().all(|n| !all_text(n).contains("of the last 5 s")) && page.contains("of the last 5 s")
    );
    assert!(data.text().contains("\nnote: the answer is that of the last 5 s\n"));
}

use ratatui::Terminal;
use ratatui::backend::TestBackend;

use super::*;
use crate::monitor::{LinkHealth, SensorHealth};

/// Uncertainties that fall as one over the root of the time.
fn parameter(name: &str, unit: &str, value: f64, u95: f64) -> ParameterView {
    let history: Vec<Band> = (1..=100)
        .map(|k| {
            let time_s = 0.6 * f64::from(k);
            Band {
                time_s,
                value: value + 0.2 * u95 * (f64::from(k)).sin(),
                u95: u95 * (60.0 / time_s).sqrt(),
            }
        })
        .collect();
    let now = Band { time_s: 60.0, value, u95 };
    ParameterView { name: name.to_owned(), unit: unit.to_owned(), now: Some(now), history }
}

fn view() -> View {
    let mut parameters = vec![parameter("m", "kg", 20.013, 0.014)];
    for (k, name) in ["mcx", "mcy", "mcz"].into_iter().enumerate() {
        parameters.push(parameter(name, "kg m", 1.06 - 0.3 * k as f64, 0.0019));
    }
    for (k, name) in ["Ixx", "Iyy", "Izz", "Iyz", "Izx"].into_iter().enumerate() {
        parameters.push(parameter(name, "kg m2", 0.12 + 0.01 * k as f64, 0.0011));
    }
    let open = ParameterView { name: "Ixy".to_owned(), unit: "kg m2".to_owned(), ..ParameterView::default() };
    parameters.push(open);
    parameters.extend(
        ["fx", "fy", "fz", "tx", "ty", "tz"].map(|c| parameter(&format!("offset_{c}"), "N", 0.5, 0.02)),
    );
    View {
        watched: "/dev/ttyACM0: stm32f405, firmware 0.1.0".to_owned(),
        phase: "running".to_owned(),
        elapsed_s: 60.0,
        answer: Some(Answered {
            status: Status::PartlyIdentified,
            readings: 60_000,
            parameters,
            condition_number: Some(12.34),
            left_out: Vec::new(),
            advice: vec![
                "rotate about S.z: 2.5 times the rate, or 6.3 times as long, and tilt about S.x in \
                          between so that gravity moves across it"
                    .to_owned(),
            ],
            warnings: Vec::new(),
        }),
        sensors: SensorHealth {
            readings: 60_000,
            rate_hz: Some(1000.2),
            trouble: vec![Counted { what: "rejected: fz saturated".to_owned(), count: 7 }],
        },
        link: Some(LinkHealth { lost_readings: 3, ..LinkHealth::default() }),
        ..View::default()
    }
}

/// Returns the letters of a terminal of this size.
fn drawn(view: &View, width: u16, height: u16, look: Look) -> Vec<String> {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| draw(frame, view, look)).unwrap();
    let buffer = terminal.backend().buffer();
    let line = |y: u16| (0..width).map(|x| buffer[(x, y)].symbol()).collect::<String>();
    (0..height).map(|y| line(y).trim_end().to_owned()).collect()
}

#[test]
fn a_terminal_of_80_by_24_shows_parameters_weakest_sensors_and_link() {
    let lines = drawn(&view(), 80, 24, Look::default());
    let text = lines.join("\n");
    assert!(lines[0].starts_with("Rigident  /dev/ttyACM0") && lines[0].ends_with("running"), "{text}");
    assert!(
        lines[1].contains("60.0 s, 60000 readings, 1000/s   partly identified, condition 12.3"),
        "{text}"
    );
    assert!(lines[3].starts_with(">m          20.013 ± 0.014 kg"), "{text}");
    for words in [
        "Ixy        not identified",
        "weakest   Ixy, not identified",
        "next      rotate about S.z",
        "sensors   7 rejected: fz saturated",
        "link      3 readings lost",
        "q quits",
    ] {
        assert!(text.contains(words), "{words}\n{text}");
    }
    assert!(lines.iter().all(|line| line.chars().count() <= 80));
}

#[test]
fn every_size_is_drawn_and_the_chosen_parameter_is_always_seen() {
    for (width, height) in [(1, 1), (40, 8), (41, 9), (79, 23), (80, 24), (132, 50), (300, 100)] {
        for chosen in [0, 15, 99] {
            let lines = drawn(&view(), width, height, Look { colour: true, chosen });
            if width >= 40 && height >= 8 {
                let name = if chosen == 0 { ">m" } else { ">offset_tz" };
                assert!(
                    lines.iter().any(|line| line.starts_with(name)),
                    "{width} {height}: {}",
                    lines.join("\n")
                );
            }
        }
    }
    drawn(&View::default(), 80, 24, Look::default());
}

#[test]
fn no_colour_is_used_where_none_is_wanted() {
    let mut terminal = Terminal::new(TestBackend::new(100, 40)).unwrap();
    for colour in [true, false] {
        terminal.draw(|frame| draw(frame, &view(), Look { colour, chosen: 0 })).unwrap();
        let coloured = terminal
            .backend()
            .buffer()
            .content()
            .iter()
            .any(|cell| cell.fg != Color::Reset || cell.bg != Color::Reset);
        assert_eq!(coloured, colour);
    }
}

#[test]
fn a_band_is_as_wide_as_its_interval_on_the_axis_of_the_older_one() {
    let now = Band { time_s: 10.0, value: 5.0, u95: 1.0 };
    let history = [Band { time_s: 5.0, value: 5.0, u95: 2.0 }, now];
    let drawn = band(&history, now, 41);
    assert_eq!(drawn.chars().filter(|c| *c == '-').count(), 20, "{drawn}");
    assert_eq!(drawn.chars().nth(20), Some('|'));
    assert!(drawn.starts_with("----------=") && drawn.ends_with("=----------"), "{drawn}");
    let exact = Band { u95: 0.0, ..now };
    assert_eq!(band(&[exact], exact, 5), "  |  ");
}

#[test]
fn the_course_falls_with_the_logarithm_of_the_uncertainty() {
    let history: Vec<Band> =
        (0..8).map(|k| Band { time_s: f64::from(k), value: 0.0, u95: 10_f64.powi(-k) }).collect();
    assert_eq!(course(&history, 8), "█▇▆▅▄▃▂▁");
    assert_eq!((course(&[], 8), course(&history[..1], 3)), (String::new(), "▁▁▁".to_owned()));
    let nothing = Band { u95: 0.0, ..Band::default() };
    assert_eq!(course(&[nothing], 8), "");
}

#[test]
fn words_are_wrapped_and_text_cut_off_is_marked() {
    assert_eq!(wrapped("one two three four", 9, 2), ["one two", "three fo…"]);
    assert_eq!(wrapped("one two", 9, 2), ["one two"]);
    assert_eq!(wrapped("incomprehensible", 9, 2), ["incompre…"]);
    assert_eq!(
        (cut("1234", 3).as_str(), cut("123", 3).as_str(), both_ends("left", "right", 8).as_str()),
        ("12…", "123", "l… right")
    );
}

#[test]
fn everything_is_seen_in_the_height_that_is_said_to_be_enough() {
    let text = drawn(&view(), 100, height(&view(), 100), Look::default()).join("\n");
    for words in [">m ", "offset_tz", "link      3", "q quits"] {
        assert!(text.contains(words), "{words}\n{text}");
    }
    assert!(!text.contains("\n\n"), "{text}");
}

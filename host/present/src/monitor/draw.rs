//! A view drawn in a terminal of any size: nothing but the view decides what is drawn.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Chart, Dataset, GraphType, Paragraph, Wrap};

use super::{Answered, Band, Counted, ParameterView, View};
use rigident_fit::figures::{CONTRADICTED, NOT_IDENTIFIED, significant, with_u95};
use rigident_identify::answer::Status;

/// Terminals smaller than this show a word alone.
const LEAST: [u16; 2] = [40, 8];
/// Rows from which on there is room for a chart of the chosen parameter.
const CHART_FROM: u16 = 36;
const CHART: u16 = 12;
/// The chart reaches this many U95 to either side.
const CHART_U95: f64 = 6.0;
/// Columns of a parameter's name, its value, and the course of its uncertainty.
const NAME: usize = 11;
const VALUE: usize = 26;
const COURSE: usize = 16;
/// Heights of the course.
const LEVELS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// Tells how a view is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Look {
    /// Colours may be used; nothing is shown by colour alone.
    pub colour: bool,
    /// The parameter that is chosen.
    pub chosen: usize,
}

impl Look {
    fn tint(self, colour: Color) -> Style {
        if self.colour { Style::new().fg(colour) } else { Style::new() }
    }
}

/// Draws a view.
pub fn draw(frame: &mut Frame, view: &View, look: Look) {
    let area = frame.area();
    if area.width < LEAST[0] || area.height < LEAST[1] {
        return frame.render_widget(Paragraph::new("too small: make the window larger"), area);
    }
    let below = below(view, look, area.width);
    let chart = if area.height >= CHART_FROM && view.answer.is_some() { CHART } else { 0 };
    // Words give way to numbers in a low window.
    let words = (below.len() as u16).min(area.height / 2);
    let [head, table, plot, foot, keys] = Layout::vertical([
        Constraint::Length(3),
        Constraint::Min(1),
        Constraint::Length(chart),
        Constraint::Length(words),
        Constraint::Length(1),
    ])
    .areas(area);
    frame.render_widget(Paragraph::new(top(view, look, area.width)), head);
    match &view.answer {
        Some(answer) => frame.render_widget(Paragraph::new(rows(answer, look, table)), table),
        None => {
            let why = view.trouble.as_deref().unwrap_or("no answer yet");
            frame.render_widget(Paragraph::new(why).wrap(Wrap { trim: true }), table);
        }
    }
    if let Some(parameter) = view.answer.as_ref().and_then(|answer| answer.parameters.get(look.chosen)) {
        draw_chart(frame, parameter, look, plot);
    }
    frame.render_widget(Paragraph::new(below), foot);
    let keys_said =
        Line::styled("q quits   up, down choose a parameter", Style::new().add_modifier(Modifier::DIM));
    frame.render_widget(Paragraph::new(keys_said), keys);
}

/// Returns the rows in which everything is seen; the chart only where there are many.
pub fn height(view: &View, width: u16) -> u16 {
    let parameters = view.answer.as_ref().map_or(1, |answer| answer.parameters.len());
    let rows = 3 + parameters + below(view, Look::default(), width).len() + 1;
    let rows = u16::try_from(rows).unwrap_or(u16::MAX).max(LEAST[1]);
    if rows >= CHART_FROM { rows.saturating_add(CHART) } else { rows }
}

fn top(view: &View, look: Look, width: u16) -> Vec<Line<'static>> {
    let title = both_ends(&format!("Rigident  {}", view.watched), &view.phase, usize::from(width));
    let rate = view.sensors.rate_hz.map_or_else(String::new, |rate| format!(", {rate:.0}/s"));
    let taken = format!("{:.1} s, {} readings{rate}", view.elapsed_s, view.sensors.readings);
    let mut second = vec![Span::raw(taken)];
    if let Some(answer) = &view.answer {
        let (words, colour) = status(answer.status);
        second.push(Span::raw("   "));
        second.push(Span::styled(words, look.tint(colour).add_modifier(Modifier::BOLD)));
        // Fitting takes its time.
        let at = answer.time_s().filter(|at| view.elapsed_s - at > 1.0);
        second.push(Span::raw(at.map_or_else(String::new, |at| format!(" at {at:.1} s"))));
        let condition = answer.condition_number.map(|c| format!(", condition {}", significant(c, 3)));
        second.push(Span::raw(condition.unwrap_or_default()));
    }
    let band = usize::from(width).saturating_sub(NAME + VALUE + COURSE + 3);
    let heads = format!(
        "{:NAME$} {:VALUE$} {:band$} {}",
        "parameter", "value ± U95", "95 % interval, - at half", "U95 since start"
    );
    vec![
        Line::styled(title, Style::new().add_modifier(Modifier::BOLD)),
        Line::from(second),
        Line::styled(cut(&heads, usize::from(width)), Style::new().add_modifier(Modifier::UNDERLINED)),
    ]
}

fn status(status: Status) -> (&'static str, Color) {
    match status {
        Status::Identified => ("identified", Color::Green),
        Status::PartlyIdentified => ("partly identified", Color::Yellow),
        Status::NotIdentified => ("not identified", Color::Yellow),
        Status::Implausible => ("IMPLAUSIBLE: not to be used", Color::Red),
        Status::Failed => ("FAILED", Color::Red),
    }
}

/// Returns the rows of parameters that fit, the chosen one among them.
fn rows(answer: &Answered, look: Look, area: Rect) -> Vec<Line<'static>> {
    let (count, room) = (answer.parameters.len(), usize::from(area.height));
    let chosen = look.chosen.min(count.saturating_sub(1));
    let skipped = (chosen + 1).saturating_sub(room).min(count.saturating_sub(room));
    let shown = answer.parameters.iter().enumerate().skip(skipped).take(room);
    let width = usize::from(area.width).saturating_sub(NAME + VALUE + COURSE + 3);
    let missing = if answer.status == Status::Implausible { CONTRADICTED } else { NOT_IDENTIFIED };
    shown.map(|(j, parameter)| row(parameter, missing, width, look, j == chosen)).collect()
}

/// Returns the row of a parameter; `missing` are the words in place of its number, where there is none.
fn row(
    parameter: &ParameterView,
    missing: &'static str,
    width: usize,
    look: Look,
    chosen: bool,
) -> Line<'static> {
    let mark = if chosen { '>' } else { ' ' };
    let name = cut(&format!("{mark}{}", parameter.name), NAME);
    let Some(now) = parameter.now else {
        return Line::from(vec![
            Span::raw(format!("{name:NAME$} ")),
            Span::styled(missing, look.tint(Color::Yellow)),
        ]);
    };
    let value = cut(&with_u95(now.value, now.u95, &parameter.unit), VALUE);
    Line::from(vec![
        Span::raw(format!("{name:NAME$} {value:VALUE$} ")),
        Span::styled(band(&parameter.history, now, width), look.tint(Color::Cyan)),
        Span::raw(" "),
        Span::raw(course(&parameter.history, COURSE)),
    ])
}

/// Draws the interval now (`=`, its middle `|`) within the one at half of the time (`-`), on an axis that
/// holds both.
fn band(history: &[Band], now: Band, width: usize) -> String {
    let half = history.iter().rev().find(|band| band.time_s <= 0.5 * now.time_s).unwrap_or(&now);
    let ([a, b], [c, d]) = (now.ends(), half.ends());
    let (from, to) = (a.min(c), b.max(d));
    let at = |column: usize| from + (to - from) * (column as f64 + 0.5) / width as f64;
    // Half a column: an interval is never drawn as none.
    let slack = 0.5 * (to - from) / width as f64;
    let within = |x: f64, [low, high]: [f64; 2]| x >= low - slack && x <= high + slack;
    let sign = |column: usize| {
        let x = at(column);
        if (x - now.value).abs() <= slack {
            '|'
        } else if within(x, [a, b]) {
            '='
        } else if within(x, [c, d]) {
            '-'
        } else {
            ' '
        }
    };
    if to > from { (0..width).map(sign).collect() } else { format!("{:^width$}", "|") }
}

/// Draws the logarithm of the uncertainty from the first interval to the last, the lowest as `▁`.
fn course(history: &[Band], width: usize) -> String {
    let logs: Vec<f64> = history.iter().map(|band| band.u95.log10()).filter(|log| log.is_finite()).collect();
    let (low, high) =
        logs.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    let level = |column: usize| {
        let log = logs.get(column * (logs.len() - 1) / (width - 1).max(1))?;
        let share = if high > low { (log - low) / (high - low) } else { 0.0 };
        LEVELS.get((share * 7.0).round() as usize).copied()
    };
    if logs.is_empty() { String::new() } else { (0..width).filter_map(level).collect() }
}

/// Returns the text below the parameters, a line each.
fn below(view: &View, look: Look, width: u16) -> Vec<Line<'static>> {
    let width = usize::from(width);
    let mut lines = Vec::new();
    let mut add = |what: &str, said: &str, style: Style, most: usize| {
        for (k, line) in wrapped(said, width.saturating_sub(10), most).into_iter().enumerate() {
            let what = if k == 0 { what } else { "" };
            lines.push(Line::from(vec![Span::raw(format!("{what:<10}")), Span::styled(line, style)]));
        }
    };
    if let Some(answer) = &view.answer {
        if let Some((name, ratio)) = answer.worst().filter(|_| answer.status != Status::Implausible) {
            let how = if ratio.is_finite() {
                format!("{name}, U95 {} % of the largest of its kind", significant(100.0 * ratio, 2))
            } else {
                format!("{name}, not identified")
            };
            add("weakest", &how, Style::new(), 1);
        }
        if let Some(next) = answer.advice.first() {
            add("next", next, look.tint(Color::Yellow), 3);
        }
        if let Some(warning) = answer.warnings.first() {
            let more = answer.warnings.len() - 1;
            let more = if more > 0 { format!(" (and {more} more)") } else { String::new() };
            add("warning", &format!("{warning}{more}"), look.tint(Color::Red), 2);
        }
        if let Some(trouble) = &view.trouble {
            add("now", trouble, look.tint(Color::Red), 2);
        }
    }
    if let Some(device) = &view.device {
        add("device", device, Style::new(), 1);
    }
    // A device counts for itself.
    let left_out = view.answer.as_ref().filter(|_| view.link.is_none()).map(|answer| &answer.left_out);
    let (said, colour) = counted(left_out.unwrap_or(&view.sensors.trouble));
    add("sensors", &said, look.tint(colour), 2);
    if let Some(link) = &view.link {
        let counts = [
            ("readings lost", link.lost_readings),
            ("messages lost", link.lost_messages),
            ("frames damaged here", link.damaged_frames),
            ("damaged there", link.damaged_there),
            ("messages dropped there", link.dropped_there),
        ];
        let counts = counts.map(|(what, count)| Counted { what: what.to_owned(), count });
        let (mut said, mut colour) = counted(&counts);
        if link.silent_s >= 1.0 {
            said = format!("nothing has come for {:.0} s; {said}", link.silent_s);
            colour = Color::Red;
        }
        add("link", &said, look.tint(colour), 2);
    }
    lines
}

/// Returns what happened, or that nothing did.
fn counted(counts: &[Counted]) -> (String, Color) {
    let happened = counts.iter().filter(|counted| counted.count > 0);
    let words: Vec<String> = happened.map(|Counted { what, count }| format!("{count} {what}")).collect();
    if words.is_empty() {
        ("nothing lost, nothing rejected".to_owned(), Color::Green)
    } else {
        (words.join(", "), Color::Yellow)
    }
}

fn draw_chart(frame: &mut Frame, parameter: &ParameterView, look: Look, area: Rect) {
    let Some(now) = parameter.now.filter(|now| area.height > 0 && (now.value + now.u95).is_finite()) else {
        return;
    };
    // The first intervals are so wide that nothing else would be seen.
    let (least, most) = (now.value - CHART_U95 * now.u95, now.value + CHART_U95 * now.u95);
    let from_s = parameter.history.first().map_or(0.0, |band| band.time_s);
    let points = |of: &dyn Fn(&Band) -> f64| -> Vec<(f64, f64)> {
        parameter.history.iter().map(|band| (band.time_s, of(band).clamp(least, most))).collect()
    };
    let [low, middle, high] = [points(&|b| b.ends()[0]), points(&|b| b.value), points(&|b| b.ends()[1])];
    let line = |data, colour| {
        Dataset::default()
            .marker(Marker::Braille)
            .graph_type(GraphType::Line)
            .style(look.tint(colour))
            .data(data)
    };
    let digits = |v: f64| significant(v, 5);
    let chart =
        Chart::new(vec![line(&low, Color::Cyan), line(&high, Color::Cyan), line(&middle, Color::Reset)])
            .x_axis(
                Axis::default()
                    .bounds([from_s, now.time_s])
                    .labels([format!("{from_s:.0} s"), format!("{:.0} s", now.time_s)]),
            )
            .y_axis(
                Axis::default()
                    .title(format!("{} {}", parameter.name, parameter.unit))
                    .bounds([least, most])
                    .labels([digits(least), digits(most)]),
            );
    frame.render_widget(chart, area);
}

/// Returns two texts at the ends of a line; the first is cut to fit.
fn both_ends(left: &str, right: &str, width: usize) -> String {
    let room = width.saturating_sub(right.chars().count() + 1);
    let left = cut(left, room);
    format!("{left:<room$} {right}")
}

fn cut(text: &str, width: usize) -> String {
    if text.chars().count() <= width {
        return text.to_owned();
    }
    text.chars().take(width.saturating_sub(1)).chain(['…']).collect()
}

/// Breaks a text into lines of the given number of letters, and no more than `most` of them.
fn wrapped(text: &str, width: usize, most: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let (line, count) = (lines.len() - 1, lines.len());
        let is_empty = lines[line].is_empty();
        if is_empty || lines[line].chars().count() + 1 + word.chars().count() <= width {
            if !is_empty {
                lines[line].push(' ');
            }
            lines[line].push_str(word);
        } else if count < most {
            lines.push(word.to_owned());
        } else {
            lines[line] = cut(&format!("{} {word}…", lines[line]), width);
            break;
        }
    }
    lines.iter().map(|line| cut(line, width)).collect()
}

#[cfg(test)]
#[path = "draw_tests.rs"]
mod tests;

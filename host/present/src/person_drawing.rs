//! A person drawn from the front, and when something that no plate measures pushed her.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::page::escape;
use super::table::printable;
use rigident_fit::figures::significant;
use rigident_identify::answer::person::{PersonResult, SegmentResult, TrialResult, UnmeasuredContact};
use rigident_model::human::Person;

/// Pixels of a metre.
const SCALE: f64 = 240.0;
/// Width of the drawing, pixels.
const WIDTH: f64 = 520.0;
/// Width of a line as thick as the segment is heavy: pixels over √kg.
const THICK: f64 = 4.5;
/// Names are so far beside the arms, pixels.
const BESIDE: f64 = 14.0;
/// Height of a line of text, and the width of a letter at most, pixels of the drawing: on a telephone letters
/// are larger.
const LINE: f64 = 17.0;
const LETTER: f64 = 8.5;
/// Less than this is no part of a line, pixels.
const ROUNDING: f64 = 1e-6;
/// A time line is so far from either edge, pixels.
const EDGE: f64 = 8.0;

/// Where a link begins in somebody upright, and the link that follows it, m.
type Ends = (Vector3<f64>, Option<Vector3<f64>>);

/// Returns the ends of links by their names.
fn joints(found: &PersonResult) -> Option<BTreeMap<String, Ends>> {
    let person = Person { height_m: found.height_m, mass_kg: found.table_mass_kg, ..Person::default() };
    let model = if found.model == "human58" { person.human58() } else { person.human34() }.ok()?;
    let mut at = vec![Vector3::zeros(); model.links.len()];
    for (i, link) in model.links.iter().enumerate().skip(1) {
        at[i] = at.get(link.link.parent)? + link.link.position;
    }
    let side = |name: &str| name.get(..2).filter(|side| ["l_", "r_"].contains(side)).map(str::to_owned);
    let next = |i: usize, name: &str| {
        let mut others = model.links.iter().enumerate().skip(1);
        others.find(|(_, l)| l.link.parent == i && side(&l.name) == side(name)).map(|(k, _)| at[k])
    };
    let of =
        |(i, link): (usize, &rigident_model::ModelLink)| (link.name.clone(), (at[i], next(i, &link.name)));
    Some(model.links.iter().enumerate().map(of).collect())
}

/// Returns the person drawn: segments green as far as the motions tell their masses, with the centre of mass
/// and its U95 as an ellipse; nothing without segments.
pub(super) fn drawn(found: &PersonResult) -> String {
    let Some(joints) = joints(found).filter(|_| !found.segments.is_empty()) else { return String::new() };
    let (mut lines, mut ellipses, mut names) = (String::new(), String::new(), String::new());
    let lowest = joints.values().map(|(at, _)| at.z).fold(f64::INFINITY, f64::min) - 0.1;
    let highest = joints.values().map(|(at, _)| at.z).fold(f64::NEG_INFINITY, f64::max) + 0.28;
    // Names are beside the arms, on either side one below the other.
    let beside = SCALE * joints.values().map(|(at, _)| at.y.abs()).fold(0.0, f64::max) + BESIDE;
    let mut labels = [Vec::new(), Vec::new()];
    // She faces the reader: her left is on the right.
    let on = |p: &Vector3<f64>| [WIDTH / 2.0 + SCALE * p.y, SCALE * (highest - p.z)];
    for segment in &found.segments {
        let Some((from, next)) = joints.get(&segment.name) else { continue };
        let end = next.unwrap_or_else(|| from + Vector3::from(segment.table_com_m) * 2.0);
        let ([x1, y1], [x2, y2]) = (on(from), on(&end));
        let (class, kg) = if segment.identified {
            ("learned", segment.mass_kg.value)
        } else {
            ("table", segment.table_mass_kg)
        };
        lines.push_str(&format!(
            "<line class=\"{class}\" x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" \
             stroke-width=\"{:.1}\" stroke-opacity=\"{:.2}\"><title>{}</title></line>\n",
            THICK * kg.max(0.2).sqrt(),
            if segment.identified { 0.4 + 0.6 * segment.informed } else { 0.35 },
            escape(&words(segment))
        ));
        if segment.identified {
            let [_, y, z] = &segment.com_m;
            let [cx, cy] = on(&(from + Vector3::from(segment.com_m.each_ref().map(|c| c.value))));
            let (rx, ry) = (SCALE * y.u95, SCALE * z.u95);
            ellipses.push_str(&format!(
                "<ellipse class=\"centre\" cx=\"{cx:.1}\" cy=\"{cy:.1}\" rx=\"{rx:.1}\" ry=\"{ry:.1}\"/>\
                 <circle class=\"centre\" cx=\"{cx:.1}\" cy=\"{cy:.1}\" r=\"2\"/>\n"
            ));
            let (sign, anchor) = if cx > WIDTH / 2.0 { (1.0, "start") } else { (-1.0, "end") };
            let y = free(&mut labels[usize::from(sign < 0.0)], cy + 4.0);
            names.push_str(&format!(
                "<text class=\"{anchor}\" x=\"{:.1}\" y=\"{y:.1}\">{}</text>\n",
                WIDTH / 2.0 + sign * beside,
                escape(&words(segment))
            ));
        }
    }
    format!(
        "<figure class=\"person\"><svg viewBox=\"0 0 {WIDTH} {:.0}\" role=\"img\" aria-label=\"The person \
         from the front\">\n\
         {lines}{ellipses}{names}</svg>\n<figcaption>Upright, facing you, as thick as heavy. Green: the \
         motions determine the mass, the more the deeper; the dot is the centre of mass, the ellipse its U95. \
         Grey: the table's alone.</figcaption></figure>\n",
        SCALE * (highest - lowest)
    )
}

/// Returns the height of a line of text at a height or the next below that is free, and takes it.
fn free(taken: &mut Vec<f64>, mut y: f64) -> f64 {
    // A line below another one is free although their difference is rounded.
    while let Some(other) = taken.iter().find(|other| (**other - y).abs() < LINE - ROUNDING) {
        y = other + LINE;
    }
    taken.push(y);
    y
}

fn words(segment: &SegmentResult) -> String {
    let name = printable(&segment.name).replace('_', " ");
    if segment.identified {
        format!("{name} {:.2} ± {:.2} kg", segment.mass_kg.value, segment.mass_kg.u95)
    } else {
        format!("{name}: the table's {:.2} kg", segment.table_mass_kg)
    }
}

/// Returns a time line of each trial in which something pushed that no plate measures; nothing without one.
pub(super) fn time_lines(found: &PersonResult) -> String {
    let lines: String = found.trials.iter().filter(|t| !t.unmeasured.is_empty()).map(time_line).collect();
    if lines.is_empty() {
        return lines;
    }
    format!(
        "<h2>Contacts that no plate measures</h2>\n<p class=\"soft\">Mean force beside the plates over the \
         time of each trial, s; these frames are left out.</p>\n{lines}"
    )
}

/// A label of a time line: where it is anchored and how, its row, and its words.
struct Label {
    x: f64,
    class: &'static str,
    row: usize,
    words: String,
}

/// Returns the labels of contacts, none beyond the edges, and none over another one.
fn labels(trial: &TrialResult, x: &dyn Fn(f64) -> f64) -> Vec<Label> {
    let mut ends: Vec<f64> = Vec::new();
    let label = |c: &UnmeasuredContact| {
        let near = c.near.as_deref().map_or_else(String::new, |near| format!(", {}", near.replace('_', " ")));
        let words = format!("{} N{near}", significant(Vector3::from(c.force_n).norm(), 2));
        let half = LETTER * words.chars().count() as f64 / 2.0;
        let [from, to] = c.times_s.map(x);
        let middle = (from + to) / 2.0;
        let (x, class, first) = if middle + half > WIDTH - EDGE {
            (WIDTH - EDGE, "end", WIDTH - EDGE - 2.0 * half)
        } else if middle - half < EDGE {
            (EDGE, "start", EDGE)
        } else {
            (middle, "mid", middle - half)
        };
        let row = ends.iter().position(|end| *end < first).unwrap_or(ends.len());
        ends.resize(ends.len().max(row + 1), 0.0);
        ends[row] = first + 2.0 * half;
        Label { x, class, row, words }
    };
    trial.unmeasured.iter().map(label).collect()
}

fn time_line(trial: &TrialResult) -> String {
    let end_s = (trial.frames as f64 / trial.rate_hz).max(f64::MIN_POSITIVE);
    let x = |time_s: f64| EDGE + (WIDTH - 2.0 * EDGE) * (time_s / end_s).clamp(0.0, 1.0);
    let labels = labels(trial, &x);
    let bar = LINE * (1.0 + labels.iter().map(|own| own.row).max().unwrap_or(0) as f64) + 4.0;
    let below = bar + 14.0 + LINE;
    let rect = |class: &str, from: f64, wide: f64| {
        format!(
            "<rect class=\"{class}\" x=\"{from:.1}\" y=\"{bar:.1}\" width=\"{wide:.1}\" height=\"14\"/>\n"
        )
    };
    let text = |class: &str, x: f64, y: f64, words: &str| {
        format!("<text class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\">{}</text>\n", escape(words))
    };
    let pushed = |c: &UnmeasuredContact| {
        let [from, to] = c.times_s.map(x);
        rect("pushed", from, (to - from).max(1.0))
    };
    let marks: String = trial.unmeasured.iter().map(pushed).collect();
    let words: String = labels
        .iter()
        .map(|own| text(own.class, own.x, bar - 6.0 - LINE * own.row as f64, &own.words))
        .collect();
    format!(
        "<figure class=\"times\"><svg viewBox=\"0 0 {WIDTH} {:.0}\" role=\"img\" aria-label=\"Time line of \
         contacts\">\n{}{marks}{words}{}{}</svg><figcaption>{}</figcaption></figure>\n",
        below + 5.0,
        rect("whole-time", EDGE, WIDTH - 2.0 * EDGE),
        text("start", EDGE, below, "0"),
        text("end", WIDTH - EDGE, below, &format!("{} s", significant(end_s, 3))),
        escape(&printable(&trial.name))
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_finds_a_line() {
        // 53.1 + 17.0 − 53.1 < 17.0
        for first in [53.1, 243.9, 244.4] {
            let mut taken = Vec::new();
            let found: Vec<f64> = (0..4).map(|_| free(&mut taken, first)).collect();
            assert!(found.windows(2).all(|pair| (pair[1] - pair[0] - LINE).abs() < 1e-3), "{found:?}");
        }
    }

    #[test]
    fn labels_of_a_time_line_stay_inside_and_apart() {
        let contact = |from: f64, to: f64| UnmeasuredContact {
            times_s: [from, to],
            force_n: [0.0, 0.0, 365.0],
            most_n: 500.0,
            near: Some("pelvis".to_owned()),
        };
        let trial = TrialResult {
            frames: 860,
            rate_hz: 100.0,
            unmeasured: vec![contact(0.09, 0.3), contact(0.5, 0.9), contact(8.2, 8.51)],
            ..TrialResult::default()
        };
        let x = |time_s: f64| EDGE + (WIDTH - 2.0 * EDGE) * time_s / 8.6;
        let found = labels(&trial, &x);
        assert_eq!(found.iter().map(|own| own.class).collect::<Vec<_>>(), ["start", "start", "end"]);
        assert_eq!(found.iter().map(|own| own.row).collect::<Vec<_>>(), [0, 1, 0]);
        assert_eq!(found[2].x, WIDTH - EDGE);
    }
}

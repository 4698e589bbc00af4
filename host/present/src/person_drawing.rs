//! A person drawn from the front, and when something that no plate measures pushed her.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::page::escape;
use super::table::printable;
use rigident_fit::figures::significant;
use rigident_identify::answer::person::{PersonResult, SegmentResult, TrialResult};
use rigident_model::human::Person;

/// Pixels of a metre.
const SCALE: f64 = 240.0;
/// Width of the drawing, pixels.
const WIDTH: f64 = 520.0;
/// Width of a line as thick as the segment is heavy: pixels over √kg.
const THICK: f64 = 4.5;

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
            let (x, anchor) = if cx > WIDTH / 2.0 { (cx + 34.0, "start") } else { (cx - 34.0, "end") };
            names.push_str(&format!(
                "<text class=\"{anchor}\" x=\"{x:.1}\" y=\"{:.1}\">{}</text>\n",
                cy + 4.0,
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

fn time_line(trial: &TrialResult) -> String {
    const HIGH: f64 = 52.0;
    let end_s = (trial.frames as f64 / trial.rate_hz).max(f64::MIN_POSITIVE);
    let x = |time_s: f64| 8.0 + (WIDTH - 16.0) * (time_s / end_s).clamp(0.0, 1.0);
    let contact = |c: &rigident_identify::answer::person::UnmeasuredContact| {
        let [from, to] = c.times_s.map(x);
        let force = Vector3::from(c.force_n).norm();
        let near = c.near.as_deref().map_or_else(String::new, |near| format!(", {}", near.replace('_', " ")));
        format!(
            "<rect class=\"pushed\" x=\"{from:.1}\" y=\"20\" width=\"{:.1}\" height=\"14\"/><text \
             class=\"mid\" x=\"{:.1}\" y=\"14\">{} N{}</text>\n",
            (to - from).max(1.0),
            (from + to) / 2.0,
            significant(force, 2),
            escape(&near)
        )
    };
    let marks: String = trial.unmeasured.iter().map(contact).collect();
    format!(
        "<figure><svg viewBox=\"0 0 {WIDTH} {HIGH}\" role=\"img\" aria-label=\"Time line of \
         contacts\">\n<rect class=\"whole-time\" x=\"8\" y=\"20\" width=\"{:.1}\" \
         height=\"14\"/>\n{marks}<text x=\"8\" y=\"{:.1}\">0</text><text class=\"end\" x=\"{:.1}\" \
         y=\"{:.1}\">{} s</text></svg><figcaption>{}</figcaption></figure>\n",
        WIDTH - 16.0,
        HIGH - 4.0,
        WIDTH - 8.0,
        HIGH - 4.0,
        significant(end_s, 3),
        escape(&printable(&trial.name))
    )
}

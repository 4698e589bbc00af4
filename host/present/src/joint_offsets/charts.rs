//! Offsets with their intervals, and distances of contacts over the poses.

use super::super::plot::axis::Axis;
use super::super::plot::{FULL_WIDTH, WIDTH, line, open_svg, text};
use super::{OffsetRow, OffsetsPage, with_unit};
use rigident_fit::figures::NOT_IDENTIFIED;

/// Height of a joint's row, user units.
const ROW: f64 = 24.0;
/// Room for names at the left and for numbers at the right.
const SIDES: (f64, f64) = (250.0, 150.0);
/// Height of the chart of distances.
const HEIGHT: f64 = 220.0;
/// Distances below this are drawn as if they were it, m.
const LEAST_M: f64 = 1e-5;
/// A tick of the numbers of poses for this many user units.
const TICK_WIDTH: f64 = 60.0;

/// Returns the chart of the offsets of joints that turn, or of those that slide; nothing if there is none.
pub(super) fn offsets(rows: &[OffsetRow], slides: bool) -> String {
    let rows: Vec<&OffsetRow> = rows.iter().filter(|row| row.slides == slides).collect();
    if rows.is_empty() {
        return String::new();
    }
    let scale = if slides { 1e3 } else { 1_f64.to_degrees() };
    let known = rows.iter().filter_map(|row| row.measured);
    let most = known.map(|own| scale * (own.value.abs() + own.u95)).fold(0.1, f64::max);
    let axis = Axis::covering(-1.05 * most, 1.05 * most, 8);
    let (left, width) = (SIDES.0, FULL_WIDTH - SIDES.0 - SIDES.1);
    let x = |v: f64| left + width * axis.share(v);
    let (top, bottom) = (18.0, 18.0 + ROW * rows.len() as f64);
    let id = if slides { "offsets-mm" } else { "offsets-deg" };
    let mut svg = open_svg(
        id,
        "Offsets of joints",
        "The offset of each joint with its 95 % interval",
        FULL_WIDTH,
        bottom + 34.0,
    );
    for tick in &axis.ticks {
        let class = if tick.abs() < 1e-12 { "zero" } else { "grid" };
        svg.push_str(&line(class, x(*tick), top, x(*tick), bottom));
        svg.push_str(&text("mid", x(*tick), bottom + 16.0, &axis.label(*tick)));
    }
    svg.push_str(&text(
        "end",
        left + width,
        bottom + 31.0,
        &axis.unit(if slides { "mm" } else { "degrees" }),
    ));
    for (k, row) in rows.iter().enumerate() {
        let y = top + ROW * (k as f64 + 0.5);
        svg.push_str(&text("end ink", left - 12.0, y + 4.0, &row.joint));
        let Some(own) = row.measured else {
            svg.push_str(&text("open", left + width + 12.0, y + 4.0, NOT_IDENTIFIED));
            continue;
        };
        let (value, u95) = (scale * own.value, scale * own.u95);
        svg.push_str(&line("interval", x(value - u95), y, x(value + u95), y));
        svg.push_str(&format!(
            "<circle class=\"dot after\" cx=\"{:.1}\" cy=\"{y:.1}\" r=\"3.5\"/>\n",
            x(value)
        ));
        svg.push_str(&text(
            "ink",
            left + width + 12.0,
            y + 4.0,
            &with_unit(own, slides).replace('-', "\u{2212}"),
        ));
    }
    svg.push_str("</svg>\n");
    format!("<figure>{svg}</figure>\n")
}

/// Returns the distances of one contact over the poses, on a logarithmic scale.
pub(super) fn deviations(found: &OffsetsPage, contact: usize) -> String {
    let of = |all: &[Option<f64>]| all.get(contact).copied().flatten();
    let name = found.contacts.get(contact).map_or("", String::as_str);
    let decade = |v: f64| (1e3 * v.max(LEAST_M)).log10();
    let all = found.deviations.iter().flat_map(|pose| [of(&pose.before_m), of(&pose.after_m)]).flatten();
    let ends = all.map(decade).fold([0.0, 1.0], |[low, high]: [f64; 2], v| [low.min(v), high.max(v)]);
    let (low, high) = (ends[0].floor(), ends[1].ceil());
    let (left, top) = (52.0, 20.0);
    let (width, height) = (WIDTH - left - 14.0, HEIGHT - top - 34.0);
    let count = found.deviations.len().max(1) as f64;
    let x = |k: f64| left + width * (k - 0.5) / count;
    let y = |v: f64| top + height * (high - v) / (high - low);
    let title = format!("Distances of {name}");
    let mut svg =
        open_svg(&format!("distance-{contact}"), &title, "Largest distance in every pose, mm", WIDTH, HEIGHT);
    svg.push_str(&text("unit", left, 12.0, "mm"));
    for tick in low as i32..=high as i32 {
        let at = y(f64::from(tick));
        svg.push_str(&line("grid", left, at, left + width, at));
        let label = if tick < 0 {
            format!("{:.*}", tick.unsigned_abs() as usize, 10_f64.powi(tick))
        } else {
            format!("{:.0}", 10_f64.powi(tick))
        };
        svg.push_str(&text("end", left - 7.0, at + 4.0, &label));
    }
    let numbers = Axis::covering(1.0, count.max(2.0), (width / TICK_WIDTH) as usize);
    for tick in numbers.ticks.iter().filter(|tick| tick.fract() == 0.0 && **tick <= count) {
        svg.push_str(&text("mid", x(*tick), top + height + 16.0, &numbers.label(*tick)));
    }
    svg.push_str(&text("end", left + width, top + height + 31.0, "pose"));
    svg.push_str(&line("axis", left, top + height, left + width, top + height));
    svg.push_str(&line("axis", left, top, left, top + height));
    for (k, pose) in found.deviations.iter().enumerate() {
        let at = x(k as f64 + 1.0);
        if let (Some(before), Some(after)) = (of(&pose.before_m), of(&pose.after_m)) {
            let (before, after) = (y(decade(before)), y(decade(after)));
            svg.push_str(&line("grid", at, before, at, after));
            svg.push_str(&format!(
                "<circle class=\"dot before\" cx=\"{at:.1}\" cy=\"{before:.1}\" r=\"3\"/>"
            ));
            svg.push_str(&format!(
                "<circle class=\"dot after\" cx=\"{at:.1}\" cy=\"{after:.1}\" r=\"3\"/>\n"
            ));
            if pose.left_out {
                svg.push_str(&line("out", at - 5.0, after - 5.0, at + 5.0, after + 5.0));
                svg.push_str(&line("out", at - 5.0, after + 5.0, at + 5.0, after - 5.0));
            }
        }
    }
    svg.push_str("</svg>\n");
    format!("<figure><figcaption><b>{}</b></figcaption>{svg}</figure>\n", super::escape(name))
}

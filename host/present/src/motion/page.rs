//! The page's markup: the stage with its controls, the curves, the table of errors, and the data for the
//! player.

use serde::Serialize;

use super::series::{Packed, largest, pack};
use super::{Curve, ErrorRow, MotionPage, Rms, Side};
use crate::Along;
use crate::envelope::{envelope, extremes};
use crate::page::{END, beginning_with, escape, number};
use crate::plot::axis::Axis;
use crate::plot::{Chart, Layer};
use rigident_fit::figures::{count, duration, significant, three_digits, unit_symbol};

const STYLE: &str = include_str!("style.css");
/// The player, in the order in which its parts need each other.
const PLAYER: [&str; 4] =
    [include_str!("data.js"), include_str!("camera.js"), include_str!("scene.js"), include_str!("player.js")];
/// Nothing may be loaded, whatever the titles and labels say.
const POLICY: &str = "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src \
                      'unsafe-inline'; script-src 'unsafe-inline'\"/>\n";

/// Steps of positions of the figure and of markers, m, and of forces, N.
const POINT_STEP_M: f64 = 5e-4;
const MARKER_STEP_M: f64 = 1e-3;
const FORCE_STEP_N: f64 = 1.0;
/// Steps from zero to a curve's largest value.
const CURVE_STEPS: f64 = 2000.0;
/// Width and height of a chart, of which three are beside each other, and the buckets of its lines.
const CHART: (f64, f64) = (344.0, 176.0);
const BUCKETS: usize = 300;

/// The data that the player reads.
#[derive(Serialize)]
struct Data<'a> {
    frames: usize,
    rate: f64,
    forward: [f32; 2],
    bones: Vec<(&'a str, usize, usize, Side, Option<f32>)>,
    /// Three channels for each point, as for markers, centre of mass and forces.
    points: Packed,
    markers: Packed,
    marker_names: &'a [String],
    com: Packed,
    plates: &'a [[[f32; 3]; 4]],
    forces: Vec<Arrow<'a>>,
    curves: Vec<Lines<'a>>,
    /// First and last frame of each stretch that was not used.
    unused: Vec<[usize; 2]>,
}

#[derive(Serialize)]
struct Arrow<'a> {
    name: &'a str,
    at: Packed,
    measured: Packed,
    predicted: Packed,
}

#[derive(Serialize)]
struct Lines<'a> {
    name: &'a str,
    unit: String,
    decimals: usize,
    /// Measured, identified, table.
    lines: [Packed; 3],
}

/// Returns the page of a motion that was checked.
pub fn html(motion: &MotionPage) -> String {
    let unused = unused(&motion.used);
    let mut html = beginning_with(&motion.title, "motion", &format!("{POLICY}<style>\n{STYLE}</style>\n"));
    html.push_str(&header(motion));
    html.push_str(&stage(motion, &unused));
    html.push_str(&curves(motion, &unused));
    html.push_str(&errors(&motion.errors));
    html.push_str(FOOTER);
    html.push_str(&format!(
        "<script type=\"application/json\" id=\"motion\">{}</script>\n<script>{}</script>\n",
        data(motion, unused),
        player()
    ));
    html.push_str(END);
    html
}

/// Returns the text of the script that plays a motion, which is the same in every page.
pub fn player() -> String {
    format!("\n(() => {{\n\"use strict\";\n{}}})();\n", PLAYER.concat())
}

/// Returns the data as JSON in which nothing can end the element around it.
fn data(motion: &MotionPage, unused: Vec<[usize; 2]>) -> String {
    let bones = motion.bones.iter().map(|b| (b.name.as_str(), b.ends[0], b.ends[1], b.side, b.radius_m));
    let forces = motion.forces.iter().map(|force| Arrow {
        name: &force.name,
        at: pack(POINT_STEP_M, &coordinates(&force.at_m)),
        measured: pack(FORCE_STEP_N, &coordinates(&force.measured_n)),
        predicted: pack(FORCE_STEP_N, &coordinates(&force.predicted_n)),
    });
    let data = Data {
        frames: motion.points_m.len(),
        rate: motion.rate_hz,
        forward: motion.forward,
        bones: bones.collect(),
        points: pack(POINT_STEP_M, &channels(&motion.points_m)),
        markers: pack(MARKER_STEP_M, &channels(&motion.markers_m)),
        marker_names: &motion.marker_names,
        com: pack(POINT_STEP_M, &coordinates(&motion.com_m)),
        plates: &motion.plates_m,
        forces: forces.collect(),
        curves: motion.curves.iter().map(lines).collect(),
        unused,
    };
    let json = serde_json::to_string(&data).unwrap_or_else(|_| "null".to_owned());
    json.replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026")
}

/// Returns x, y and z of each point as channels of their own.
fn channels(frames: &[Vec<[f32; 3]>]) -> Vec<Vec<f32>> {
    let points = frames.first().map_or(0, Vec::len);
    let channel = |k: usize| frames.iter().map(|frame| frame[k / 3][k % 3]).collect();
    (0..3 * points).map(channel).collect()
}

fn coordinates(points: &[[f32; 3]]) -> Vec<Vec<f32>> {
    if points.is_empty() {
        return Vec::new();
    }
    (0..3).map(|axis| points.iter().map(|p| p[axis]).collect()).collect()
}

fn lines(curve: &Curve) -> Lines<'_> {
    let three = [&curve.measured, &curve.identified, &curve.table];
    let largest = largest(three.into_iter().flatten());
    let step = if largest > 0.0 { largest / CURVE_STEPS } else { 1.0 };
    // Three significant digits of the largest value.
    let decimals = if largest > 0.0 { (2 - largest.log10().floor() as i32).clamp(0, 9) } else { 0 };
    let lines = three.map(|values| pack(step, std::slice::from_ref(values)));
    Lines { name: &curve.name, unit: unit_symbol(&curve.unit), decimals: decimals as usize, lines }
}

/// Returns the stretches of frames that were not used, first and last of each.
pub(super) fn unused(used: &[bool]) -> Vec<[usize; 2]> {
    let mut stretches: Vec<[usize; 2]> = Vec::new();
    for (k, _) in used.iter().enumerate().filter(|(_, used)| !**used) {
        match stretches.last_mut() {
            Some(last) if last[1] + 1 == k => last[1] = k,
            _ => stretches.push([k, k]),
        }
    }
    stretches
}

fn header(motion: &MotionPage) -> String {
    let frames = motion.points_m.len();
    let mut parts = vec![
        duration(motion.duration_s()),
        format!("{} frames at {} Hz", count(frames as u64), significant(motion.rate_hz, 6)),
    ];
    if !motion.used.is_empty() {
        let used = motion.used.iter().filter(|used| **used).count();
        parts.push(format!("identified from {} of them", count(used as u64)));
    }
    let parts: String = parts.iter().map(|part| format!("<span>{}</span>", escape(part))).collect();
    format!("<header><h1>{}</h1>\n<p class=\"source\">{parts}</p></header>\n", escape(&motion.title))
}

/// Returns the canvas and everything that steers it.
fn stage(motion: &MotionPage, unused: &[[usize; 2]]) -> String {
    let last = motion.points_m.len().saturating_sub(1);
    let mut shown = Vec::new();
    let mut show = |is_there: bool, id: &str, words: &str, checked: bool| {
        if is_there {
            let checked = if checked { " checked=\"\"" } else { "" };
            shown.push(format!("<label><input type=\"checkbox\" id=\"{id}\"{checked}/>{words}</label>\n"));
        }
    };
    let predicted = motion.forces.iter().any(|force| !force.predicted_n.is_empty());
    show(
        !motion.forces.is_empty(),
        "show-measured",
        "<span class=\"key measured\">measured force</span>",
        true,
    );
    show(predicted, "show-predicted", "<span class=\"key identified\">predicted force</span>", true);
    show(!motion.com_m.is_empty(), "show-com", "<span class=\"key com\">centre of mass</span>", true);
    show(!motion.com_m.is_empty(), "show-trace", "its path", true);
    show(
        motion.markers_m.iter().any(|m| !m.is_empty()),
        "show-markers",
        "<span class=\"key marker\">markers</span>",
        true,
    );
    show(true, "follow", "follow the person", false);
    show(true, "repeat", "repeat", true);
    let sides = motion.bones.iter().any(|b| b.side != Side::Middle);
    let sides =
        if sides { "<span class=\"key right\">right</span><span class=\"key left\">left</span>" } else { "" };
    STAGE
        .replace("{last}", &last.to_string())
        .replace("{unused}", &strip(unused, last))
        .replace("{shown}", &shown.concat())
        .replace("{sides}", sides)
        .replace("{title}", &escape(&motion.title))
}

/// The title comes last, so that nothing in it is replaced.
const STAGE: &str = "<noscript><p class=\"box bad\">This page plays a motion and needs JavaScript to do so.</p></noscript>
<section class=\"player\" aria-label=\"Motion\">
<div class=\"stage\">
<canvas id=\"scene\" tabindex=\"0\" role=\"img\" aria-label=\"Figure of {title} in motion\" aria-describedby=\"now\"></canvas>
<div class=\"views\" role=\"group\" aria-label=\"View\">
<button type=\"button\" id=\"front\">Front</button><button type=\"button\" id=\"side\">Side</button>\
<button type=\"button\" id=\"top\">Top</button><button type=\"button\" id=\"reset\">Reset</button>
</div>
<p class=\"legend\">{sides}<span id=\"scale\"></span></p>
<p class=\"hover\" id=\"hover\" hidden=\"\"></p>
</div>
<div class=\"transport\">
<button type=\"button\" id=\"play\"><svg viewBox=\"0 0 16 16\" aria-hidden=\"true\"><path class=\"go\" d=\"M3 1.5 14 8 3 14.5Z\"/>\
<path class=\"halt\" d=\"M3 2h3.4v12H3ZM9.6 2H13v12H9.6Z\"/></svg><span>Play</span></button>
<div class=\"along\"><input type=\"range\" id=\"time\" min=\"0\" max=\"{last}\" step=\"1\" value=\"0\" aria-label=\"Time\"/>{unused}</div>
<output id=\"clock\" for=\"time\"></output>
<label class=\"speed\">speed <select id=\"speed\"><option value=\"0.1\">0.1×</option><option value=\"0.25\">0.25×</option>\
<option value=\"0.5\">0.5×</option><option value=\"1\" selected=\"\">1×</option><option value=\"2\">2×</option></select></label>
</div>
<div class=\"show\" role=\"group\" aria-label=\"Show\">
{shown}</div>
<p id=\"now\" class=\"now\" role=\"status\" aria-live=\"polite\"></p>
</section>
";

/// Draws the frames that were not used under the slider.
fn strip(unused: &[[usize; 2]], last: usize) -> String {
    if unused.is_empty() {
        return String::new();
    }
    let x = |frame: f64| 1000.0 * (frame / last.max(1) as f64).clamp(0.0, 1.0);
    let bars: String = unused
        .iter()
        .map(|[from, to]| {
            let (from, to) = (x(*from as f64 - 0.5), x(*to as f64 + 0.5));
            format!("<rect x=\"{from:.1}\" width=\"{:.1}\" height=\"4\"/>", to - from)
        })
        .collect();
    format!(
        "<svg class=\"strip\" viewBox=\"0 0 1000 4\" preserveAspectRatio=\"none\" \
         aria-hidden=\"true\">{bars}</svg>"
    )
}

fn curves(motion: &MotionPage, unused: &[[usize; 2]]) -> String {
    if motion.curves.is_empty() {
        return String::new();
    }
    let about =
        if motion.about.is_empty() { String::new() } else { format!(" about {}", escape(&motion.about)) };
    let shaded = if unused.is_empty() { "" } else { "<span class=\"key unused\">not used</span>" };
    let charts: String = motion.curves.iter().enumerate().map(|(k, c)| chart(motion, k, c, unused)).collect();
    format!(
        "<h2>Wrench{about}</h2>\n<p class=\"soft keys\"><span class=\"key measured\">measured</span><span \
         class=\"key identified\">identified parameters</span><span class=\"key table\">scaled \
         table</span>{shaded}<span>Click a curve to go there.</span></p>\n<div \
         class=\"curves\">\n{charts}</div>\n"
    )
}

fn chart(motion: &MotionPage, index: usize, curve: &Curve, unused: &[[usize; 2]]) -> String {
    let seconds = |frame: f64| frame / motion.rate_hz;
    let end = motion.duration_s().max(seconds(1.0));
    let time = Axis::covering(0.0, end, 6);
    let all = [&curve.measured, &curve.identified, &curve.table];
    let (low, high) = extremes(all.into_iter().flatten().map(|v| f64::from(*v))).unwrap_or((0.0, 1.0));
    let margin = 0.05 * (high - low);
    let values = Axis::covering(low - margin, high + margin, 5);
    let times: Vec<f64> = (0..motion.points_m.len()).map(|k| seconds(k as f64)).collect();
    let mut shade = Vec::new();
    for [from, to] in unused {
        shade.push((seconds(*from as f64 - 0.5).max(0.0), values.low, values.high));
        shade.push((seconds(*to as f64 + 0.5).min(end), values.low, values.high));
        shade.push((end, f64::NAN, f64::NAN));
    }
    let mut layers = vec![Layer::Band("unused", shade)];
    for (class, line) in ["measured", "table", "identified"].into_iter().zip([all[0], all[2], all[1]]) {
        let line: Vec<f64> = line.iter().map(|v| f64::from(*v)).collect();
        layers.push(Layer::Line(class, envelope(&times, &line, BUCKETS)));
    }
    let unit = unit_symbol(&curve.unit);
    let (from, to) = (time.low, time.high);
    let svg = Chart {
        id: format!("curve-{index}"),
        title: format!("{} over time", curve.name),
        description: format!(
            "{} in {unit}: measured, by the identified parameters, by the scaled table.",
            curve.name
        ),
        unit,
        time,
        along: Along::Time,
        values,
        width: CHART.0,
        height: CHART.1,
        stages: &[],
        name_stages: false,
        layers,
    };
    let value = |class: &str, words: &str| {
        format!(
            "<span class=\"key {class}\"><span class=\"unseen\">{words} </span><span \
             class=\"value\"></span></span>"
        )
    };
    format!(
        "<figure class=\"curve\" data-from=\"{from}\" \
         data-to=\"{to}\"><figcaption><b>{}</b>{}{}{}</figcaption>\n{}</figure>\n",
        escape(&curve.name),
        value("measured", "measured"),
        value("identified", "by identified parameters"),
        value("table", "by the scaled table"),
        svg.render()
    )
}

fn errors(rows: &[ErrorRow]) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let printed = |v: f64, text: String| if v.is_finite() { number(&text) } else { "–".to_owned() };
    let cells = |rms: Rms, is_less: bool| {
        let less = if is_less { " less" } else { "" };
        format!(
            "<td class=\"right{less}\">{}</td><td class=\"right soft\">{}</td>",
            printed(rms.value, three_digits(rms.value)),
            printed(rms.percent, format!("{:.2}", rms.percent))
        )
    };
    let body: String = rows
        .iter()
        .map(|row| {
            format!(
                "<tr><th scope=\"row\">{}</th>{}{}<td>{}</td></tr>\n",
                escape(&row.name),
                cells(row.identified, row.identified.value < row.table.value),
                cells(row.table, row.table.value < row.identified.value),
                escape(&unit_symbol(&row.unit))
            )
        })
        .collect();
    let right = |head: &str| format!("<th class=\"right\" scope=\"col\">{head}</th>");
    format!(
        "<h2>Errors of the predictions</h2>\n<p class=\"soft\">Root mean squares, and these in percent of \
         body weight (moments: of body weight times stature). The smaller of each pair is bold.</p>\n<div \
         class=\"scroll\"><table class=\"short errors\"><thead><tr><th></th>{}{}{}{}<th \
         scope=\"col\">unit</th></tr></thead>\n<tbody>\n{body}</tbody></table></div>\n",
        right("identified parameters"),
        right("%"),
        right("scaled table"),
        right("%"),
    )
}

const FOOTER: &str = "<footer><p>Drag to turn, with Shift to shift; the wheel comes nearer. Space plays and \
                      pauses. The arrow keys step by one frame, with Shift by ten; after Tab to the picture \
                      they turn it. Home and End go to the ends; F, S, T and R choose the \
                      view.</p>\n<p>Laboratory axes, z up. Arrows of forces begin at the point of \
                      application.</p></footer>\n";

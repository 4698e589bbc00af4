//! A small plotter: one chart over time as inline SVG that takes its colours from the page's style sheet.
//!
//! Lives here: ticks ([`axis`]), frame, grid, lines and bands. May not live here: what the numbers mean.

pub mod axis;

use axis::Axis;

use super::page::escape;
use super::{Along, Stage};

/// Width of a chart in user units, two of them beside each other; the page scales it.
pub const WIDTH: f64 = 520.0;
/// Width of a chart that has the page to itself.
pub const FULL_WIDTH: f64 = 1072.0;
/// Width of a character of the axis labels.
const CHARACTER: f64 = 6.1;
const RIGHT: f64 = 14.0;
const BOTTOM: f64 = 32.0;

/// The layers of a chart, in order. Points are (time, value).
pub enum Layer {
    /// A dot of the style class at every finite point.
    Dots(&'static str, Vec<(f64, f64)>),
    /// A line of the style class; points that are not finite break it.
    Line(&'static str, Vec<(f64, f64)>),
    /// An area of the style class between (time, low, high); likewise.
    Band(&'static str, Vec<(f64, f64, f64)>),
    /// A horizontal line.
    Level(&'static str, f64),
    /// A vertical line at a time.
    Moment(&'static str, f64),
}

/// One chart over time.
pub struct Chart<'a> {
    /// Unique within the page.
    pub id: String,
    /// Accessible name.
    pub title: String,
    /// Accessible description.
    pub description: String,
    /// Unit of the values.
    pub unit: String,
    /// Time in s, or the number of the pose.
    pub time: Axis,
    /// The one of the two.
    pub along: Along,
    /// Values.
    pub values: Axis,
    /// Width in user units.
    pub width: f64,
    /// Height in user units.
    pub height: f64,
    /// Boundaries to mark.
    pub stages: &'a [Stage],
    /// True if the stages' names are written above the plot.
    pub name_stages: bool,
    /// The layers to draw.
    pub layers: Vec<Layer>,
}

/// Returns the opening tag with accessible name and description.
pub fn open_svg(id: &str, title: &str, description: &str, width: f64, height: f64) -> String {
    let (id, title, description) = (escape(id), escape(title), escape(description));
    format!(
        "<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-labelledby=\"{id}-t {id}-d\">\
         <title id=\"{id}-t\">{title}</title><desc id=\"{id}-d\">{description}</desc>\n"
    )
}

/// Colours and letters of a separate figure: those of the report, light or dark as the reader's screen is.
const ALONE: &str = "svg{--ink:#1a1f26;--soft:#5a6572;--rule:#dfe4ea;--a:#1f5fa8;--b:#c2570c;--c:#1d7a4f;--d:#8a4fa0;--sand:#f3c79f;background:#fff;font:13px system-ui,-apple-system,'Segoe UI',Roboto,'DejaVu Sans',sans-serif}@media (prefers-color-scheme:dark){svg{--ink:#e7eaee;--soft:#9aa5b1;--rule:#2e353d;--a:#6fb0f5;--b:#f29a56;--c:#5fcb97;--d:#c79be0;--sand:#7a4a1e;background:#14171b}}text{fill:var(--soft)}.title{fill:var(--ink);font-size:15px;font-weight:600}.ink{fill:var(--ink)}.end{text-anchor:end}.mid{text-anchor:middle}.grid{stroke:var(--rule)}.axis{stroke:var(--soft)}";

/// Panels of a size, width and height, beside each other with `room` (left, top, right, bottom) around each,
/// as a figure that is a file of its own.
pub fn beside(
    [id, title, style]: [&str; 3],
    (side, room): ((f64, f64), [f64; 4]),
    panels: impl ExactSizeIterator<Item = (String, String)>,
) -> String {
    let [left, top, right, bottom] = room;
    let step = left + side.0 + right;
    let (width, height) = (step * panels.len() as f64, top + side.1 + bottom);
    let (names, drawn): (Vec<_>, Vec<_>) = panels.unzip();
    let mut svg = open_alone(id, title, &names.join("; "), width, height, style);
    for (k, panel) in drawn.iter().enumerate() {
        svg.push_str(&format!("<g transform=\"translate({:.1} {top:.1})\">\n", left + step * k as f64));
        svg.push_str(panel);
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>\n");
    svg
}

/// Returns the opening tag of a figure that is a file of its own and needs no style sheet; `style` is added
/// to the standard one.
pub fn open_alone(id: &str, title: &str, description: &str, width: f64, height: f64, style: &str) -> String {
    let svg = open_svg(id, title, description, width, height).replacen(
        "<svg ",
        "<svg xmlns=\"http://www.w3.org/2000/svg\" ",
        1,
    );
    format!("{svg}<style>{ALONE}{style}</style>\n")
}

/// Returns a text element; `class` names style and anchor.
pub fn text(class: &str, x: f64, y: f64, content: &str) -> String {
    format!("<text class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\">{}</text>\n", escape(content))
}

/// Returns a straight line.
pub fn line(class: &str, x1: f64, y1: f64, x2: f64, y2: f64) -> String {
    format!("<line class=\"{class}\" x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\"/>\n")
}

impl Chart<'_> {
    /// Returns the chart as an `svg` element.
    pub fn render(&self) -> String {
        let unit = self.values.unit(&self.unit);
        let left = 14.0 + CHARACTER * self.values.widest_label() as f64;
        let named = self.name_stages && self.stages.iter().any(|s| !s.name.is_empty());
        let top = if named { 36.0 } else { 20.0 };
        let (width, height) = (self.width - left - RIGHT, self.height - top - BOTTOM);
        let x = |t: f64| left + width * self.time.share(t);
        let y = |v: f64| top + height * (1.0 - self.values.share(v));

        let along = match self.along {
            Along::Time => format!("time, {}", self.time.unit("s")),
            Along::Poses => self.time.unit("pose"),
        };
        let mut svg = open_svg(&self.id, &self.title, &self.description, self.width, self.height);
        svg.push_str(&text("unit", left, 12.0, &unit));
        for tick in &self.values.ticks {
            svg.push_str(&line("grid", left, y(*tick), left + width, y(*tick)));
            svg.push_str(&text("end", left - 6.0, y(*tick) + 3.8, &self.values.label(*tick)));
        }
        for tick in &self.time.ticks {
            svg.push_str(&line("tick", x(*tick), top + height, x(*tick), top + height + 4.0));
            svg.push_str(&text("mid", x(*tick), top + height + 16.0, &self.time.label(*tick)));
        }
        svg.push_str(&text("end", left + width, top + height + 29.0, &along));
        svg.push_str(&self.stage_marks(left, width, top, height, named));
        // The data live in tenths of a unit, so that their coordinates are short integers, clipped by the
        // frame.
        let (w, h) = ((10.0 * width).round(), (10.0 * height).round());
        svg.push_str(&format!(
            "<svg x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" \
             viewBox=\"0 0 {w} {h}\" preserveAspectRatio=\"none\">\n"
        ));
        for layer in &self.layers {
            svg.push_str(&self.draw(layer, w, h));
        }
        svg.push_str("</svg>\n");
        svg.push_str(&line("axis", left, top + height, left + width, top + height));
        svg.push_str(&line("axis", left, top, left, top + height));
        svg.push_str("</svg>\n");
        svg
    }

    /// Draws dotted boundaries, and the names where they fit between two of them.
    fn stage_marks(&self, left: f64, width: f64, top: f64, height: f64, named: bool) -> String {
        let mut svg = String::new();
        let place = |t: f64| left + width * self.time.share(t).clamp(0.0, 1.0);
        for (i, Stage { start_s, name }) in
            self.stages.iter().enumerate().filter(|(_, s)| s.start_s.is_finite())
        {
            let from = place(*start_s);
            let to = self.stages.get(i + 1).map_or(left + width, |next| place(next.start_s));
            if (0.001..0.999).contains(&self.time.share(*start_s)) {
                svg.push_str(&line("stage", from, top, from, top + height));
            }
            if named && to - from > CHARACTER * name.chars().count() as f64 + 6.0 {
                svg.push_str(&text("stage-name mid", 0.5 * (from + to), top - 5.0, name));
            }
        }
        svg
    }

    fn draw(&self, layer: &Layer, w: f64, h: f64) -> String {
        let x = |t: f64| (w * self.time.share(t)).clamp(-w, 2.0 * w).round() as i64;
        let y = |v: f64| (h * (1.0 - self.values.share(v))).clamp(-h, 2.0 * h).round() as i64;
        match layer {
            Layer::Dots(class, points) => {
                let finite = points.iter().filter(|p| p.1.is_finite());
                let dots: String = finite.map(|(t, v)| format!("M{} {}h0", x(*t), y(*v))).collect();
                format!("<path class=\"{class}\" d=\"{dots}\"/>\n")
            }
            Layer::Line(class, points) => {
                let mut path = Path::default();
                for (t, v) in points {
                    if v.is_finite() { path.to(x(*t), y(*v)) } else { path.lift() }
                }
                path.lift();
                format!("<path class=\"{class}\" d=\"{}\"/>\n", path.text)
            }
            Layer::Band(class, points) => {
                let mut path = Path::default();
                for part in points.split(|p| !(p.1.is_finite() && p.2.is_finite())).filter(|p| !p.is_empty())
                {
                    part.iter().for_each(|p| path.to(x(p.0), y(p.2)));
                    part.iter().rev().for_each(|p| path.to(x(p.0), y(p.1)));
                    path.close();
                }
                format!("<path class=\"{class}\" d=\"{}\"/>\n", path.text)
            }
            Layer::Level(class, v) => {
                let y = y(*v);
                format!("<path class=\"{class}\" d=\"M0 {y}H{w}\"/>\n")
            }
            Layer::Moment(class, t) => format!("<path class=\"{class}\" d=\"M{} 0V{h}\"/>\n", x(*t)),
        }
    }
}

/// Path data with relative integer coordinates.
#[derive(Default)]
struct Path {
    text: String,
    at: Option<(i64, i64)>,
    alone: bool,
}

impl Path {
    fn to(&mut self, x: i64, y: i64) {
        match self.at {
            None => {
                self.text.push_str(&format!("M{x} {y}"));
                self.alone = true;
            }
            Some((x0, y0)) => {
                // A minus sign separates by itself.
                let (dx, dy) = (x - x0, y - y0);
                let space = if dy < 0 { "" } else { " " };
                self.text.push_str(&format!("l{dx}{space}{dy}"));
                self.alone = false;
            }
        }
        self.at = Some((x, y));
    }

    /// Ends a line; a round cap makes a point between two gaps a dot.
    fn lift(&mut self) {
        if self.at.take().is_some() && self.alone {
            self.text.push_str("h0");
        }
    }

    fn close(&mut self) {
        self.text.push('z');
        self.at = None;
    }
}

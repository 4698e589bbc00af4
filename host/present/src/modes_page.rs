//! A page of modes: each drawn on the platform and animated, the spectrum, and what was found. No script;
//! nothing is loaded.

use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};

use nalgebra::Vector3;

use super::page::{END, beginning_with, escape};
use super::plot::{line, open_svg};
use super::vibration::ModeRow;
use rigident_fit::figures::with_u95;

/// Width and height of a mode's figure, user units.
const SIZE: (f64, f64) = (360.0, 250.0);
/// The largest movement that is drawn, as a share of the platform's side.
const DRAWN: f64 = 0.16;
/// Pictures of a period.
const PICTURES: usize = 16;
/// A mode of 1 Hz is drawn with this period, s; others by the root of their frequencies.
const PERIOD_S: f64 = 2.4;
/// Half the side of a platform whose springs are a matrix, m.
const HALF_SIDE_M: f64 = 0.4;
/// The platform is this much larger than its springs' places.
const RIM: f64 = 1.12;
/// Length of a spring that is drawn, as a share of the platform's side.
const SPRING: f64 = 0.35;
const STYLE: &str = "<style>figure \
                     svg{width:100%}.plate{fill:var(--band);stroke:var(--x);stroke-width:1.4}.rest{fill:none;stroke:var(--soft);stroke-dasharray:3 3}.spring{stroke:var(--soft);stroke-width:2}.com{fill:var(--y)}figure{margin:0}figcaption{color:var(--soft)}pre{overflow-x:auto;font-size:13px}@media (prefers-reduced-motion: reduce){animate{display:none}}</style>\n";

/// The body on the springs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// The points where springs hold the platform, m; empty where a matrix is stated.
    pub anchors_m: Vec<[f64; 3]>,
    /// The point O, m.
    pub at_m: [f64; 3],
    /// Centre of mass of the body, m.
    pub com_m: Option<[f64; 3]>,
}

/// Returns the page of the modes of a recording, with its spectrum as SVG, what was noticed, and the answers
/// as text.
pub fn page(
    title: &str,
    modes: &[ModeRow],
    scene: &Scene,
    spectrum: &str,
    (said, text): (&[&str], &str),
) -> String {
    let mut html = beginning_with(title, "modes of free vibration", STYLE);
    html.push_str(&format!("<h1>{}</h1>\n<p class=\"source\">Modes of free vibration</p>\n", escape(title)));
    if !said.is_empty() {
        let items: String = said.iter().map(|what| format!("<li>{}</li>\n", escape(what))).collect();
        html.push_str(&format!("<h2>Noticed</h2>\n<ul class=\"warnings\">\n{items}</ul>\n"));
    }
    html.push_str(
        "<h2>Modes</h2>\n<p class=\"soft\">Each at the same size, whatever it was, and slowed down; x points \
         to the right, y away, z upward. Dashed: rest. The dot is the body's centre of mass.</p>\n<div \
         class=\"grid\">\n",
    );
    for (k, mode) in modes.iter().enumerate() {
        html.push_str(&figure(k, mode, scene));
    }
    // The figure's own colours follow the screen; its name space is the page's.
    html.push_str("</div>\n<h2>Spectrum</h2>\n<div class=\"wide\">\n");
    html.push_str(spectrum);
    html.push_str(&format!("</div>\n<h2>Found</h2>\n<pre>{}</pre>\n", escape(text)));
    html + END
}

/// Returns where a point is drawn.
fn projected(point: &Vector3<f64>) -> (f64, f64) {
    ((point.x + 0.6 * point.y) * FRAC_1_SQRT_2 * 1.3, -point.z - 0.42 * point.y)
}

/// The displacement of points by a shape.
struct Shape {
    shift: Vector3<f64>,
    turn: Vector3<f64>,
    origin: Vector3<f64>,
}

impl Shape {
    fn of(mode: &ModeRow, origin: Vector3<f64>) -> Self {
        let of = |name: &str| {
            let place = mode.coordinates.iter().position(|own| *own == name);
            place.and_then(|k| mode.shape.get(k)).copied().unwrap_or(0.0)
        };
        let vector = |names: [&str; 3]| Vector3::from(names.map(of));
        Self { shift: vector(["x", "y", "z"]), turn: vector(["roll", "pitch", "yaw"]), origin }
    }

    fn at(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.shift + self.turn.cross(&(point - self.origin))
    }
}

/// Corners of the platform, and its larger side.
fn plate(scene: &Scene) -> ([Vector3<f64>; 4], f64) {
    let o = Vector3::from(scene.at_m);
    let (mut low, mut high) = (o - Vector3::repeat(HALF_SIDE_M), o + Vector3::repeat(HALF_SIDE_M));
    if let Some(first) = scene.anchors_m.first() {
        (low, high) = (Vector3::from(*first), Vector3::from(*first));
        for anchor in &scene.anchors_m {
            (low, high) = (low.inf(&Vector3::from(*anchor)), high.sup(&Vector3::from(*anchor)));
        }
    }
    let (middle, half) = ((low + high) * 0.5, (high - low) * (0.5 * RIM));
    let side = 2.0 * half.x.max(half.y).max(1e-3);
    let corner = |x: f64, y: f64| Vector3::new(middle.x + x * half.x, middle.y + y * half.y, middle.z);
    ([corner(1.0, 1.0), corner(-1.0, 1.0), corner(-1.0, -1.0), corner(1.0, -1.0)], side)
}

fn figure(number: usize, mode: &ModeRow, scene: &Scene) -> String {
    let (corners, side) = plate(scene);
    let shape = Shape::of(mode, Vector3::from(scene.at_m));
    let com = scene.com_m.map(Vector3::from);
    let moves = corners.iter().chain(&com).map(|p| shape.at(p).norm()).fold(1e-12, f64::max);
    let (size, zoom) = (DRAWN * side / moves, 0.62 * SIZE.0 / (1.5 * side));
    let middle = Vector3::from(scene.at_m);
    let place = |point: &Vector3<f64>| {
        let (u, v) = projected(&(point - middle));
        (SIZE.0 / 2.0 + zoom * u, SIZE.1 * 0.5 + zoom * v)
    };
    let phase = |k: usize| (TAU * k as f64 / PICTURES as f64).cos();
    let moved = |p: &Vector3<f64>, k: usize| place(&(p + shape.at(p) * (size * phase(k))));
    let period = PERIOD_S / mode.hz.max(0.05).sqrt();
    let animated = |attribute: &str, of: &dyn Fn(usize) -> String| {
        let values: Vec<String> = (0..=PICTURES).map(of).collect();
        format!(
            "<animate attributeName=\"{attribute}\" dur=\"{period:.2}s\" repeatCount=\"indefinite\" \
             values=\"{}\"/>",
            values.join(";")
        )
    };
    let outline = |at: &dyn Fn(&Vector3<f64>) -> (f64, f64)| {
        let points = corners.iter().map(at).map(|(x, y)| format!("{x:.1},{y:.1}"));
        points.collect::<Vec<_>>().join(" ")
    };
    let words = format!("{} Hz", with_u95(mode.hz, mode.hz_u95, ""));
    let largest = largest(mode);
    let mut svg = open_svg(&format!("mode{number}"), &words, &largest, SIZE.0, SIZE.1);
    for anchor in &scene.anchors_m {
        let anchor = Vector3::from(*anchor);
        let foot = place(&(anchor - Vector3::z() * (SPRING * side)));
        let start = moved(&anchor, 0);
        let drawn = line("spring", start.0, start.1, foot.0, foot.1);
        let x = animated("x1", &|k| format!("{:.1}", moved(&anchor, k).0));
        let y = animated("y1", &|k| format!("{:.1}", moved(&anchor, k).1));
        svg.push_str(&drawn.trim_end().replacen("/>", &format!(">{x}{y}</line>\n"), 1));
    }
    svg.push_str(&format!("<polygon class=\"rest\" points=\"{}\"/>\n", outline(&place)));
    let first = outline(&|p| moved(p, 0));
    let all = animated("points", &|k| outline(&|p| moved(p, k)));
    svg.push_str(&format!("<polygon class=\"plate\" points=\"{first}\">{all}</polygon>\n"));
    if let Some(com) = com {
        let (x, y) = moved(&com, 0);
        let cx = animated("cx", &|k| format!("{:.1}", moved(&com, k).0));
        let cy = animated("cy", &|k| format!("{:.1}", moved(&com, k).1));
        svg.push_str(&format!(
            "<circle class=\"com\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\">{cx}{cy}</circle>\n"
        ));
    }
    svg.push_str("</svg>\n");
    let damping = with_u95(mode.damping, mode.damping_u95, "");
    format!(
        "<figure>\n{svg}<figcaption>{}: {}; damping ratio {}</figcaption>\n</figure>\n",
        escape(&words),
        escape(&largest),
        escape(&damping)
    )
}

/// Returns what a mode does most, in words: the coordinates with more than a third of the largest, turns at
/// half a metre.
fn largest(mode: &ModeRow) -> String {
    let arm = |name: &str| if ["x", "y", "z"].contains(&name) { 1.0 } else { 0.5 };
    let sizes: Vec<f64> =
        mode.shape.iter().zip(&mode.coordinates).map(|(v, name)| (v * arm(name)).abs()).collect();
    let most = sizes.iter().copied().fold(0.0, f64::max);
    let mut named: Vec<(f64, &str)> = sizes.iter().copied().zip(mode.coordinates.iter().copied()).collect();
    named.retain(|(size, _)| *size > most / PI);
    named.sort_by(|a, b| b.0.total_cmp(&a.0));
    let names: Vec<&str> = named.into_iter().map(|(_, name)| name).collect();
    format!("moves in {}", names.join(" and "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mode() -> ModeRow {
        ModeRow {
            hz: 2.0,
            hz_u95: 0.01,
            damping: 0.01,
            damping_u95: 0.001,
            coordinates: vec!["x", "y", "z", "roll", "pitch", "yaw"],
            shape: vec![0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
        }
    }

    #[test]
    fn a_mode_upward_moves_every_corner_upward_and_back() {
        let drawn = figure(0, &mode(), &Scene::default());
        assert!(drawn.contains("moves in z;"), "{drawn}");
        let values = drawn.split("values=\"").nth(1).unwrap().split('"').next().unwrap();
        let heights = |picture: &str| -> Vec<f64> {
            picture.split([' ', ',']).skip(1).step_by(2).map(|v| v.parse().unwrap()).collect()
        };
        let pictures: Vec<Vec<f64>> = values.split(';').map(heights).collect();
        assert_eq!(pictures.len(), PICTURES + 1);
        assert_eq!(pictures[0], pictures[PICTURES]);
        let by: Vec<f64> = pictures[0].iter().zip(&pictures[PICTURES / 2]).map(|(a, b)| b - a).collect();
        assert!(by.iter().all(|v| *v > 10.0 && (v - by[0]).abs() < 0.21), "{by:?}");
    }

    #[test]
    fn the_page_is_well_formed_and_loads_nothing() {
        let scene = Scene {
            anchors_m: vec![[0.3, 0.3, 0.0], [-0.3, 0.3, 0.0], [-0.3, -0.3, 0.0], [0.3, -0.3, 0.0]],
            com_m: Some([0.0, 0.1, 0.2]),
            ..Scene::default()
        };
        let page = page("a < b", &[mode()], &scene, "<svg></svg>", (&["3 < 4"], "1 & 2"));
        assert!(page.find("3 &lt; 4").unwrap() < page.find("<h2>Modes").unwrap(), "{page}");
        let read = roxmltree::Document::parse_with_options(
            &page,
            roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() },
        );
        let document = read.unwrap_or_else(|e| panic!("{e}: {page}"));
        assert_eq!(document.descendants().filter(|n| n.has_tag_name("animate")).count(), 4 * 2 + 1 + 2);
        assert!(!page.contains("<script") && !page.contains("http"), "{page}");
    }
}

//! Uncertainty over the number of still poses: what was found as dots, what was predicted as lines.

use super::plot::axis::Axis;
use super::plot::{beside, line, text};

/// Width and height of a panel's frame, user units.
const SIDE: (f64, f64) = (400.0, 320.0);
/// Room around it: left, top, right, bottom.
const ROOM: [f64; 4] = [58.0, 84.0, 18.0, 46.0];
/// Style of dots and lines, one colour for each curve.
const STYLE: &str = "path{fill:none;stroke-width:1.5}.line0{stroke:var(--a)}.line1{stroke:var(--b)}.line2{stroke:var(--c)}.line3{stroke:var(--d)}.dot0{fill:var(--a)}.dot1{fill:var(--b)}.dot2{fill:var(--c)}.dot3{fill:var(--d)}";

/// One estimator. Points are (number of poses, uncertainty).
#[derive(Clone, Debug)]
pub struct Curve {
    /// In the key.
    pub name: String,
    /// Dots.
    pub found: Vec<(f64, f64)>,
    /// The line.
    pub predicted: Vec<(f64, f64)>,
}

/// A panel of up to four curves.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Above it.
    pub title: String,
    /// Of the uncertainties.
    pub unit: String,
    /// At most four are distinguished by colour.
    pub curves: Vec<Curve>,
}

/// Returns the panels beside each other, as an SVG that needs no style sheet.
pub fn svg(title: &str, panels: &[Panel]) -> String {
    let drawn = panels.iter().map(|panel| (panel.title.clone(), panel.render()));
    beside(["over-n", title, STYLE], (SIDE, ROOM), drawn)
}

impl Panel {
    fn render(&self) -> String {
        let (w, h) = SIDE;
        let all = self.curves.iter().flat_map(|c| c.found.iter().chain(&c.predicted));
        let (mut range, mut highest) = ([f64::INFINITY, f64::NEG_INFINITY], 0.0_f64);
        for (n, value) in all.filter(|(_, value)| value.is_finite()) {
            range = [range[0].min(*n), range[1].max(*n)];
            highest = highest.max(*value);
        }
        let mut along = Axis::covering(range[0] - 0.3, range[1] + 0.3, 9);
        along.ticks.retain(|tick| tick.fract() == 0.0);
        let values = Axis::covering(0.0, 1.05 * highest, 6);
        let (x, y) = (|n: f64| w * along.share(n), |v: f64| h * (1.0 - values.share(v)));
        let mut svg = text("title", 0.0, -60.0, &self.title);
        for (k, curve) in self.curves.iter().enumerate() {
            let (column, row) = ((k % 2) as f64, (k / 2) as f64);
            let (at, above) = (0.5 * w * column, 18.0 * row - 42.0);
            svg.push_str(&format!(
                "<circle class=\"dot{k}\" cx=\"{:.1}\" cy=\"{above:.1}\" r=\"4\"/>",
                at + 4.0
            ));
            svg.push_str(&text("", at + 13.0, above + 4.5, &curve.name));
        }
        for tick in &values.ticks {
            svg.push_str(&line("grid", 0.0, y(*tick), w, y(*tick)));
            svg.push_str(&text("end", -7.0, y(*tick) + 4.0, &values.label(*tick)));
        }
        for tick in &along.ticks {
            svg.push_str(&text("mid", x(*tick), h + 18.0, &along.label(*tick)));
        }
        svg.push_str(&text("", 0.0, -7.0, &values.unit(&self.unit)));
        svg.push_str(&text("end", w, h + 37.0, "poses"));
        svg.push_str(&line("axis", 0.0, h, w, h));
        svg.push_str(&line("axis", 0.0, 0.0, 0.0, h));
        for (k, curve) in self.curves.iter().enumerate() {
            let finite = |points: &[(f64, f64)]| {
                points.iter().copied().filter(|p| p.1.is_finite()).collect::<Vec<_>>()
            };
            let mut path = String::new();
            for (n, value) in finite(&curve.predicted) {
                path += &format!("{}{:.1} {:.1}", if path.is_empty() { 'M' } else { 'L' }, x(n), y(value));
            }
            svg.push_str(&format!("<path class=\"line{k}\" d=\"{path}\"/>\n"));
            for (n, value) in finite(&curve.found) {
                svg.push_str(&format!(
                    "<circle class=\"dot{k}\" cx=\"{:.1}\" cy=\"{:.1}\" r=\"3.5\"/>\n",
                    x(n),
                    y(value)
                ));
            }
        }
        svg
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_finite_point_has_its_dot_and_the_lines_go_through_the_predicted() {
        let curve = Curve {
            name: "ours".to_owned(),
            found: vec![(2.0, f64::INFINITY), (3.0, 2.0), (4.0, 1.0)],
            predicted: vec![(3.0, 2.0), (4.0, 1.0)],
        };
        let panel = Panel { title: "lying".to_owned(), unit: "mm".to_owned(), curves: vec![curve] };
        let svg = svg("t", &[panel]);
        assert_eq!(svg.matches("r=\"3.5\"").count(), 2, "{svg}");
        let line = svg.split("class=\"line0\" d=\"M").nth(1).unwrap().split('"').next().unwrap();
        let points: Vec<&str> = line.split('L').collect();
        for point in points {
            let (x, y) = point.split_once(' ').unwrap();
            assert!(svg.contains(&format!("cx=\"{x}\" cy=\"{y}\"")), "{svg}");
        }
    }
}

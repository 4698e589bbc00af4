//! The directions that vectors point into, on the sphere: two discs of equal area, the upper and the lower
//! half, both seen from above.

use super::plot::{line, open_alone, text};

/// Radius of a disc, user units.
const RADIUS: f64 = 130.0;
/// Room about a disc: beside, above, below.
const ROOM: [f64; 3] = [26.0, 74.0, 30.0];
/// Style of the dots: the longer a vector, the darker.
const STYLE: &str =
    ".disc{fill:none;stroke:var(--soft)}.ring{fill:none;stroke:var(--rule)}.dot{fill:var(--a)}";
/// Shorter vectors than this share of the longest have no dot.
const LEAST: f64 = 0.3;

/// Vectors with what they are.
#[derive(Clone, Debug)]
pub struct Directions {
    /// Above the discs.
    pub title: String,
    /// In the axes of the plate.
    pub vectors: Vec<[f64; 3]>,
}

/// Returns the spheres one below the other, as an SVG that needs no style sheet. Lambert's projection: equal
/// areas of the sphere are equal areas of the disc.
pub fn svg(title: &str, spheres: &[Directions]) -> String {
    let [beside, above, below] = ROOM;
    let width = 2.0 * (2.0 * RADIUS + 2.0 * beside);
    let step = above + 2.0 * RADIUS + below;
    let names: Vec<&str> = spheres.iter().map(|s| s.title.as_str()).collect();
    let height = 30.0 + step * spheres.len() as f64;
    let mut svg = open_alone("directions", title, &names.join("; "), width, height, STYLE);
    svg.push_str(&text("title", beside, 22.0, title));
    for (k, sphere) in spheres.iter().enumerate() {
        let y = 30.0 + step * k as f64 + above + RADIUS;
        svg.push_str(&text("ink", beside, y - RADIUS - 44.0, &sphere.title));
        for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
            let x = (2.0 * side as f64 + 1.0) * (RADIUS + beside);
            svg.push_str(&sphere.half(x, y, sign));
        }
    }
    svg.push_str("</svg>\n");
    svg
}

/// Returns where a direction lies on the disc of its half, from the middle, of the disc's radius.
fn place([x, y, z]: [f64; 3], sign: f64) -> Option<[f64; 2]> {
    let length = (x * x + y * y + z * z).sqrt();
    let up = sign * z / length;
    // On the rim, half the sphere's area lies within: 1 - cos = 1.
    (up >= 0.0).then(|| {
        let stretch = 1.0 / (length * (1.0 + up).sqrt());
        [stretch * x, stretch * y]
    })
}

impl Directions {
    fn half(&self, x0: f64, y0: f64, sign: f64) -> String {
        let size = |v: &[f64; 3]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
        let longest = self.vectors.iter().map(size).fold(0.0, f64::max);
        let mut svg = String::new();
        for tilt in [30.0_f64, 60.0] {
            let radius = RADIUS * (1.0 - tilt.to_radians().cos()).sqrt();
            svg.push_str(&format!(
                "<circle class=\"ring\" cx=\"{x0:.1}\" cy=\"{y0:.1}\" r=\"{radius:.1}\"/>\n"
            ));
        }
        svg.push_str(&line("grid", x0 - RADIUS, y0, x0 + RADIUS, y0));
        svg.push_str(&line("grid", x0, y0 - RADIUS, x0, y0 + RADIUS));
        for vector in self.vectors.iter().filter(|v| longest > 0.0 && size(v) > LEAST * longest) {
            let Some([x, y]) = place(*vector, sign) else { continue };
            let (x, y, dark) = (x0 + RADIUS * x, y0 - RADIUS * y, 0.15 + 0.6 * size(vector) / longest);
            svg.push_str(&format!(
                "<circle class=\"dot\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2\" fill-opacity=\"{dark:.2}\"/>\n"
            ));
        }
        svg.push_str(&format!("<circle class=\"disc\" cx=\"{x0:.1}\" cy=\"{y0:.1}\" r=\"{RADIUS:.1}\"/>\n"));
        let name = if sign > 0.0 { "up to +z" } else { "down to -z" };
        svg.push_str(&text("mid", x0, y0 - RADIUS - 8.0, name));
        svg.push_str(&text("", x0 + RADIUS + 4.0, y0 + 4.0, "x"));
        svg.push_str(&text("mid", x0, y0 + RADIUS + 16.0, "-y"));
        svg
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_areas_stay_equal_and_every_direction_lies_on_one_of_the_discs() {
        assert_eq!(place([0.0, 0.0, 2.0], 1.0), Some([0.0, 0.0]));
        assert_eq!(place([0.0, 0.0, 2.0], -1.0), None);
        // Half of the half sphere is above 60 degrees of tilt: cos = 1/2, half of the disc's area.
        let [x, y] = place([0.75_f64.sqrt(), 0.0, 0.5], 1.0).unwrap();
        assert!((x - 0.5_f64.sqrt()).abs() < 1e-12 && y == 0.0);
        let [x, y] = place([0.0, -3.0, 0.0], 1.0).unwrap();
        assert!(x == 0.0 && (y + 1.0).abs() < 1e-12);
        let vectors = vec![[1.0, 0.0, 0.1], [0.0, 0.0, -1.0], [0.01, 0.0, 0.0]];
        let svg = svg("t", &[Directions { title: "A & B".to_owned(), vectors }]);
        // The last one is too short.
        assert!(svg.matches("class=\"dot\"").count() == 2 && svg.contains("A &amp; B"), "{svg}");
    }
}

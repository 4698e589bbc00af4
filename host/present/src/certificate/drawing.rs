//! The axes of a certificate, drawn: the load cell's frame S, the IMUs, the part's frame, and the centre of
//! mass.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rigident_io::rig::RigFile;

use super::{imus, named};
use crate::page::escape;
use rigident_identify::answer::Answer;

const WIDTH: f64 = 520.0;
const HEIGHT: f64 = 300.0;
const MARGIN: f64 = 46.0;
/// Points of the circle that the load cell is drawn as.
const AROUND: usize = 48;

/// The objects drawn, in S, m.
struct Scene {
    /// Frames with a name, an origin, and axes.
    frames: Vec<(String, Vector3<f64>, UnitQuaternion<f64>)>,
    /// Points with a class and a name.
    points: Vec<(&'static str, String, Vector3<f64>)>,
    /// Length of an axis, m.
    axis_m: f64,
}

impl Scene {
    fn new(answer: &Answer, rig: &RigFile) -> Self {
        let mut points: Vec<(&'static str, String, Vector3<f64>)> = Vec::new();
        for (name, imu) in named(imus(answer, rig)) {
            points.push(("imu", name, Vector3::from(imu.position_m)));
        }
        if let Some(com) = answer.com_m {
            points.push(("com", "centre of mass".to_owned(), Vector3::from(com)));
        }
        let mut frames = vec![("S".to_owned(), Vector3::zeros(), UnitQuaternion::identity())];
        if let Some(body) = &rig.body {
            let [w, x, y, z] = body.rotation_wxyz;
            let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
            frames.push((body.name.clone(), Vector3::from(body.position_m), turn));
        }
        let places = frames.iter().map(|f| f.1).chain(points.iter().map(|p| p.2));
        let farthest = places.map(|place| place.norm()).fold(0.0, f64::max);
        Self { frames, points, axis_m: (0.6 * farthest).max(0.03) }
    }

    /// Returns all points that must be on the sheet.
    fn extent(&self) -> Vec<Vector3<f64>> {
        let ends = self.frames.iter().flat_map(|(_, origin, turn)| {
            let tip = |k: usize| origin + turn * (Vector3::ith(k, 1.0) * self.axis_m);
            [*origin, tip(0), tip(1), tip(2)]
        });
        ends.chain(self.points.iter().map(|p| p.2)).chain(self.load_cell()).collect()
    }

    fn load_cell(&self) -> Vec<Vector3<f64>> {
        let angle = |k: usize| 2.0 * std::f64::consts::PI * k as f64 / AROUND as f64;
        (0..AROUND).map(|k| 0.5 * self.axis_m * Vector3::new(angle(k).cos(), angle(k).sin(), 0.0)).collect()
    }
}

/// Places on the sheet, x to the right and down, y to the right and up, z up: all three as long (isometric).
fn projected(place: &Vector3<f64>) -> [f64; 2] {
    let (cos, sin) = (30_f64.to_radians().cos(), 30_f64.to_radians().sin());
    [(place.x + place.y) * cos, (place.x - place.y) * sin - place.z]
}

/// Returns the drawing with its caption.
pub(super) fn figure(answer: &Answer, rig: &RigFile, marked: Option<&str>) -> String {
    let scene = Scene::new(answer, rig);
    let flat: Vec<[f64; 2]> = scene.extent().iter().map(projected).collect();
    let bounds = |k: usize| {
        let along = flat.iter().map(|p| p[k]);
        (along.clone().fold(f64::INFINITY, f64::min), along.fold(f64::NEG_INFINITY, f64::max))
    };
    let ((left, right), (top, bottom)) = (bounds(0), bounds(1));
    let scale = ((WIDTH - 2.0 * MARGIN) / (right - left)).min((HEIGHT - 2.0 * MARGIN) / (bottom - top));
    let middle = [(left + right) / 2.0, (top + bottom) / 2.0];
    let on_sheet = |place: &Vector3<f64>| {
        let [x, y] = projected(place);
        [WIDTH / 2.0 + scale * (x - middle[0]), HEIGHT / 2.0 + scale * (y - middle[1])]
    };
    let ring: Vec<String> =
        scene.load_cell().iter().map(on_sheet).map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
    let mut svg = format!(
        "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"Axes of the load cell and of the \
         part\"><polygon class=\"cell\" points=\"{}\"/>",
        ring.join(" ")
    );
    for (at, (name, origin, turn)) in scene.frames.iter().enumerate() {
        let from = on_sheet(origin);
        let suffix = if at == 0 { "S" } else { "P" };
        for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
            let to = on_sheet(&(origin + turn * (Vector3::ith(k, 1.0) * scene.axis_m)));
            svg.push_str(&arrow(k, from, to, &format!("{axis}{suffix}")));
        }
        // Where no axis leads: under the load cell's origin, to the right of the part's.
        if at == 0 {
            svg.push_str(&label([from[0] - 8.0, from[1] + 16.0], "end", "S: load cell"));
        } else {
            svg.push_str(&label([from[0] + 8.0, from[1] - 5.0], "", &format!("P: {name}")));
        }
    }
    for (class, name, place) in &scene.points {
        let [x, y] = on_sheet(place);
        svg.push_str(&format!("<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4.5\"/>"));
        let is_left = *class == "com";
        let (beside, class) = if is_left { (-8.0, "end") } else { (8.0, "") };
        svg.push_str(&label([x + beside, y + 4.0], class, name));
    }
    svg.push_str("</svg>");
    let words = marked.map_or_else(
        || "Isometric, to scale. The disc is the load cell.".to_owned(),
        |marked| format!("Isometric, to scale. The disc is the load cell. On the part: {}", escape(marked)),
    );
    format!("<h2>Axes</h2>\n<figure class=\"axes\">{svg}<figcaption>{words}</figcaption></figure>\n")
}

fn arrow(axis: usize, from: [f64; 2], to: [f64; 2], name: &str) -> String {
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    let length = dx.hypot(dy).max(1.0);
    let (ux, uy) = (dx / length, dy / length);
    let side = |s: f64| [to[0] - 9.0 * ux - s * 3.5 * uy, to[1] - 9.0 * uy + s * 3.5 * ux];
    let (one, other) = (side(1.0), side(-1.0));
    let line = format!(
        "<line class=\"s{axis}\" x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\"/>\
         <polygon class=\"head s{axis}\" points=\"{:.1},{:.1} {:.1},{:.1} {:.1},{:.1}\"/>",
        from[0], from[1], to[0], to[1], to[0], to[1], one[0], one[1], other[0], other[1]
    );
    line + &label([to[0] + 13.0 * ux, to[1] + 13.0 * uy + 4.0], "mid", name)
}

fn label([x, y]: [f64; 2], class: &str, text: &str) -> String {
    format!("<text class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\">{}</text>", escape(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_right_handed_as_they_are_drawn() {
        let [x, y, z] = [0, 1, 2].map(|k| projected(&Vector3::ith(k, 1.0)));
        // Examined from above, x turns to y against the clock; the sheet's second axis points down.
        assert!(x[0] * y[1] - x[1] * y[0] < 0.0 && z == [0.0, -1.0]);
        for axis in [x, y, z] {
            assert!((axis[0].hypot(axis[1]) - 1.0).abs() < 1e-12);
        }
    }
}

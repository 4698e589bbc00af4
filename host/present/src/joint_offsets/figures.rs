//! A pose as a stick figure, before and after, from the side and from the front.

use nalgebra::Vector3;

use super::super::plot::{WIDTH, line, open_svg, text};
use super::{DrawnPose, escape};
use rigident_identify::joint_offsets::drawn::Figure;

/// Height of the figure and of the strip of contacts below it, user units.
const HEIGHTS: (f64, f64) = (300.0, 90.0);
const GAP: f64 = 34.0;
/// Enlargements of heights in the strip, of which the largest that fits is taken.
const ENLARGED: [f64; 7] = [50.0, 20.0, 10.0, 5.0, 2.0, 1.0, 0.5];
const CLASSES: [&str; 2] = ["before", "after"];

/// The projection of a point in a view: along the paper and up, m.
type View = fn(&Vector3<f64>) -> [f64; 2];

/// Returns the figure of a pose.
pub(super) fn pose(number: usize, pose: &DrawnPose) -> String {
    let views: [(&str, View); 2] =
        [("side", |p: &Vector3<f64>| [p.x, p.z]), ("front", |p: &Vector3<f64>| [p.y, p.z])];
    let panel = WIDTH / 2.0;
    let height = HEIGHTS.0 + GAP + HEIGHTS.1;
    let title = format!("{} before and after", pose.name);
    let mut svg = open_svg(
        &format!("pose-{number}"),
        &title,
        "Stick figures from the side and from the front, and the contacts against the floor",
        WIDTH,
        height,
    );
    // Both views have one scale, or the legs seem to change their lengths.
    let zoom = views.iter().map(|(_, view)| zoom(pose, *view, panel)).fold(f64::INFINITY, f64::min);
    for (k, (name, view)) in views.into_iter().enumerate() {
        svg.push_str(&format!("<g transform=\"translate({:.1} 0)\">\n", panel * k as f64));
        svg.push_str(&text("", 8.0, 12.0, name));
        svg.push_str(&sticks(pose, view, panel, zoom));
        svg.push_str(&strip(pose, view, panel));
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>\n");
    format!("<figure><figcaption><b>{}</b></figcaption>{svg}</figure>\n", escape(&pose.name))
}

/// Returns all points of both figures.
fn points(pose: &DrawnPose) -> impl Iterator<Item = &Vector3<f64>> {
    pose.figures.iter().flat_map(|figure| {
        figure.bones.iter().flatten().chain(figure.contacts.iter().flat_map(|(_, corners)| corners))
    })
}

/// Returns the least and the largest value of both coordinates of a view.
fn ends(all: impl Iterator<Item = [f64; 2]>) -> [[f64; 2]; 2] {
    let none = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    let found = all.filter(|p| p.iter().all(|v| v.is_finite())).fold(none, |[low, high], p| {
        [[low[0].min(p[0]), low[1].min(p[1])], [high[0].max(p[0]), high[1].max(p[1])]]
    });
    if found[0][0] > found[1][0] { [[-0.5; 2], [0.5; 2]] } else { found }
}

fn zoom(pose: &DrawnPose, view: View, panel: f64) -> f64 {
    let [low, high] = ends(points(pose).map(view));
    let (wide, tall) = ((high[0] - low[0]).max(0.05), (high[1].max(0.0) - low[1].min(0.0)).max(0.05));
    ((panel - 40.0) / wide).min((HEIGHTS.0 - 40.0) / tall)
}

fn sticks(pose: &DrawnPose, view: View, panel: f64, zoom: f64) -> String {
    let [low, high] = ends(points(pose).map(view));
    let ground = HEIGHTS.0 - 12.0 + zoom * low[1].min(0.0);
    let at = |p: &Vector3<f64>| {
        let [u, v] = view(p);
        [panel / 2.0 + zoom * (u - 0.5 * (low[0] + high[0])), ground - zoom * v]
    };
    let stroke = |class: &str, a: [f64; 2], b: [f64; 2]| line(class, a[0], a[1], b[0], b[1]);
    let mut svg = line("ground", 8.0, ground, panel - 8.0, ground);
    for (figure, class) in pose.figures.iter().zip(CLASSES) {
        for [a, b] in figure.bones.iter().filter(|[a, b]| (a - b).norm() > 1e-6) {
            svg.push_str(&stroke(&format!("bone {class}{}", dashed(class)), at(a), at(b)));
        }
        for (_, corners) in &figure.contacts {
            let [from, to] = outline(corners, view);
            svg.push_str(&stroke(&format!("sole {class}"), at(&from), at(&to)));
        }
    }
    for [_, joint] in pose.figures.last().iter().flat_map(|figure| &figure.bones) {
        let [x, y] = at(joint);
        svg.push_str(&format!("<circle class=\"joint\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2.6\"/>\n"));
    }
    svg
}

fn dashed(class: &str) -> &'static str {
    if class == "before" { " dashed" } else { "" }
}

/// Returns the outermost points of a contact along the paper.
fn outline(corners: &[Vector3<f64>], view: View) -> [Vector3<f64>; 2] {
    let along = |a: &&Vector3<f64>, b: &&Vector3<f64>| view(a)[0].total_cmp(&view(b)[0]);
    let ends = corners.iter().min_by(along).zip(corners.iter().max_by(along));
    ends.map_or([Vector3::zeros(); 2], |(a, b)| [*a, *b])
}

/// Contacts near the floor with their heights enlarged.
fn strip(pose: &DrawnPose, view: View, panel: f64) -> String {
    // Hands are not near the floor.
    let near = |figure: &Figure| -> Vec<Vec<Vector3<f64>>> {
        let low = |corners: &Vec<Vector3<f64>>| corners.len() > 1 && corners.iter().all(|c| c.z.abs() < 0.15);
        figure.contacts.iter().map(|(_, corners)| corners.clone()).filter(low).collect()
    };
    let both = pose.figures.each_ref().map(near);
    let [low, high] = ends(both.iter().flatten().flatten().map(view));
    if both.iter().all(Vec::is_empty) {
        return String::new();
    }
    let zoom = (panel - 60.0) / (high[0] - low[0]).max(0.05);
    let most = low[1].abs().max(high[1].abs()).max(1e-6);
    let half = HEIGHTS.1 / 2.0 - 8.0;
    let fits = |by: &f64| zoom * by * most <= half;
    let enlarged = ENLARGED.into_iter().find(fits).unwrap_or(0.5);
    let ground = HEIGHTS.0 + GAP + HEIGHTS.1 / 2.0;
    let mut svg = line("ground", 8.0, ground, panel - 8.0, ground);
    svg.push_str(&text("", 8.0, HEIGHTS.0 + GAP - 6.0, &format!("heights × {enlarged}")));
    for (soles, class) in both.iter().zip(CLASSES) {
        for corners in soles {
            let at = |p: &Vector3<f64>| {
                let [u, v] = view(p);
                [panel / 2.0 + zoom * (u - 0.5 * (low[0] + high[0])), ground - zoom * enlarged * v]
            };
            let ring = hull(corners.iter().map(at).collect());
            let path: Vec<String> = ring.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
            svg.push_str(&format!(
                "<polygon class=\"{class}\" fill=\"none\" stroke-width=\"1.8\" points=\"{}\"/>\n",
                path.join(" ")
            ));
        }
    }
    svg
}

/// Returns the convex hull of points (Andrew's monotone chain).
fn hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let turns =
        |a: [f64; 2], b: [f64; 2], c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let half = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for point in points {
            while let [.., a, b] = chain.as_slice() {
                if turns(*a, *b, point) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut ring = half(&mut points.iter().copied());
    ring.extend(half(&mut points.iter().rev().copied()));
    if ring.is_empty() { points } else { ring }
}

//! The orientations that the plate can be tilted to: the maps of `rigident workspace` in figures, two
//! strokes.

use std::sync::atomic::AtomicBool;

use hexapod::Geometry;
use rigident::plan::workspace::{Map, Reach, Span};

/// Stroke, m, and the largest tilt that the thesis prints for it.
const STROKES: [(f64, &str); 2] = [(0.3048, "–"), (0.20, "32.0–32.7°")];
const AZIMUTHS: usize = 180;

/// Returns the table.
pub fn table() -> String {
    let mut text = String::from(
        "| stroke | orientations kept by legs and joints | and by cond(H) ≤ 40 | tilt in every direction: \
         legs and joints | and cond(H) | in the best direction, both | printed \
         |\n|---|---|---|---|---|---|---|\n",
    );
    for (stroke_m, printed) in STROKES {
        let geometry = Geometry::thesis().with_stroke(stroke_m).expect("a stroke of the thesis' legs");
        let map = Map::make(&geometry, &Span::default(), &AtomicBool::new(false), |_| ()).expect("a grid");
        let reach = Reach::around(&geometry, 0.0, AZIMUTHS);
        let [least, with_guard] = [|r: &Reach| r.reachable_deg, |r: &Reach| r.singularity_free_deg]
            .map(|value| reach.iter().map(value).fold(f64::INFINITY, f64::min));
        let best = reach.iter().map(|r| r.singularity_free_deg).fold(0.0, f64::max);
        text += &format!(
            "| {:.2} cm | {:.1} % | {:.1} % | {least:.1}° | {with_guard:.1}° | {best:.1}° | {printed} |\n",
            100.0 * stroke_m,
            share(&map.reachable),
            share(&map.singularity_free),
        );
    }
    text
}

/// Returns the share of all orientations, per cent.
fn share(cells: &[Vec<bool>]) -> f64 {
    let kept = cells.iter().flatten().filter(|kept| **kept).count();
    100.0 * kept as f64 / cells.iter().flatten().count() as f64
}

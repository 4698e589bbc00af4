//! The workspace over roll and pitch: where the legs can hold the plate, and on top where no singular pose is
//! near.

use super::plot::axis::Axis;
use super::plot::{line, open_alone, text};

/// Side of the map's frame, user units.
const SIDE: f64 = 540.0;
/// Room around it: left, top, right, bottom.
const ROOM: [f64; 4] = [58.0, 100.0, 18.0, 46.0];
/// Style of the maps.
const STYLE: &str = ".title{font-size:16px}.held{fill:var(--sand)}.free{fill:var(--a);fill-opacity:.78}.tilt{fill:none;stroke:var(--ink);stroke-width:1.2;stroke-dasharray:2 4}.pose{fill:var(--ink);stroke:var(--rule);stroke-width:1.5}.halo{paint-order:stroke;stroke:var(--rule);stroke-width:3px;stroke-linejoin:round;fill:var(--ink)}";

/// The content of the figure. Rows are rolls, columns pitches.
#[derive(Clone, Copy, Debug)]
pub struct Workspace<'a> {
    /// Above the figure.
    pub title: &'a str,
    /// Below the title.
    pub subtitle: &'a str,
    /// Of the rows, degrees, equally spaced.
    pub roll_deg: &'a [f64],
    /// Of the columns, degrees, equally spaced.
    pub pitch_deg: &'a [f64],
    /// The lower map.
    pub reachable: &'a [Vec<bool>],
    /// The upper map.
    pub singularity_free: &'a [Vec<bool>],
    /// Highest `cond(H)`, for the key.
    pub cond_max: f64,
    /// Still poses of a plan, roll and pitch, degrees: numbered dots.
    pub poses_deg: &'a [[f64; 2]],
}

impl Workspace<'_> {
    /// Draws both maps over each other, as an SVG that needs no style sheet. Dotted lines are lines of equal
    /// tilt.
    pub fn svg(&self) -> String {
        let [left, top, right, bottom] = ROOM;
        let (width, height) = (left + SIDE + right, top + SIDE + bottom);
        let mut svg = open_alone("workspace", self.title, self.subtitle, width, height, STYLE);
        svg.push_str(&text("title", left, 24.0, self.title));
        svg.push_str(&text("", left, 44.0, self.subtitle));
        let guard = format!("and cond(H) ≤ {}", self.cond_max);
        for (x, class, words) in
            [(0.0, "held", "within the limits of legs and joints"), (270.0, "free", &guard)]
        {
            let x = left + x;
            svg.push_str(&format!(
                "<rect class=\"{class}\" x=\"{x:.1}\" y=\"60\" width=\"22\" height=\"12\"/>\n"
            ));
            svg.push_str(&text("ink", x + 29.0, 70.5, words));
        }
        let (rolls, pitches) = (half_cells(self.roll_deg), half_cells(self.pitch_deg));
        let x = |roll: f64| left + SIDE * rolls.share(roll);
        let y = |pitch: f64| top + SIDE * (1.0 - pitches.share(pitch));
        for tick in &pitches.ticks {
            svg.push_str(&line("grid", left, y(*tick), left + SIDE, y(*tick)));
            svg.push_str(&text("end", left - 8.0, y(*tick) + 4.5, &pitches.label(*tick)));
        }
        for tick in &rolls.ticks {
            svg.push_str(&line("grid", x(*tick), top, x(*tick), top + SIDE));
            svg.push_str(&text("mid", x(*tick), top + SIDE + 18.0, &rolls.label(*tick)));
        }
        svg.push_str(&text("end", left + SIDE, top + SIDE + 38.0, "roll, °"));
        svg.push_str(&text("", left, top - 6.0, "pitch, °"));
        for (class, cells) in [("held", self.reachable), ("free", self.singularity_free)] {
            svg.push_str(&format!("<path class=\"{class}\" d=\"{}\"/>\n", self.cells(cells, &x, &y)));
        }
        for tilt in [30.0_f64, 60.0] {
            svg.push_str(&self.tilt_line(tilt, &x, &y));
        }
        for (k, [roll, pitch]) in self.poses_deg.iter().enumerate() {
            let (x, y) = (x(*roll), y(*pitch));
            svg.push_str(&format!("<circle class=\"pose\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\"/>\n"));
            svg.push_str(&text("halo", x + 8.0, y - 6.0, &format!("{}", k + 1)));
        }
        for (x1, y1, x2, y2) in [(left, top + SIDE, left + SIDE, top + SIDE), (left, top, left, top + SIDE)] {
            svg.push_str(&line("axis", x1, y1, x2, y2));
        }
        svg.push_str("</svg>\n");
        svg
    }

    /// Draws one column of the picture after another, runs of cells as one rectangle.
    fn cells(&self, cells: &[Vec<bool>], x: &impl Fn(f64) -> f64, y: &impl Fn(f64) -> f64) -> String {
        let (half_roll, half_pitch) = (half_step(self.roll_deg), half_step(self.pitch_deg));
        let mut path = String::new();
        for (roll, row) in self.roll_deg.iter().zip(cells) {
            let (x0, x1) = (x(roll - half_roll), x(roll + half_roll));
            let mut begun: Option<f64> = None;
            let ends = row.iter().copied().zip(self.pitch_deg.iter().copied());
            let last = self.pitch_deg.last().map(|p| (false, p + 2.0 * half_pitch));
            for (held, pitch) in ends.chain(last) {
                match (begun, held) {
                    (None, true) => begun = Some(pitch - half_pitch),
                    (Some(from), false) => {
                        let (y0, y1) = (y(from), y(pitch - half_pitch));
                        path.push_str(&format!("M{x0:.2} {y0:.2}H{x1:.2}V{y1:.2}H{x0:.2}z"));
                        begun = None;
                    }
                    _ => {}
                }
            }
        }
        path
    }

    /// Returns where `cos roll · cos pitch = cos tilt`.
    fn tilt_line(&self, tilt_deg: f64, x: &impl Fn(f64) -> f64, y: &impl Fn(f64) -> f64) -> String {
        let ends = [self.roll_deg, self.pitch_deg].map(|d| d.last().copied().unwrap_or(0.0));
        if ends.iter().any(|end| *end < tilt_deg) {
            return String::new();
        }
        let cos = tilt_deg.to_radians().cos();
        let side = |sign: f64| {
            (-60..=60).map(move |k| {
                // Finer where the line is steep.
                let roll = tilt_deg * (f64::from(k) / 60.0 * std::f64::consts::FRAC_PI_2).sin();
                (sign * roll, sign * (cos / roll.to_radians().cos()).clamp(-1.0, 1.0).acos().to_degrees())
            })
        };
        let mut path = String::new();
        for (k, (roll, pitch)) in side(1.0).chain(side(-1.0)).enumerate() {
            let command = if k == 0 { 'M' } else { 'L' };
            path.push_str(&format!("{command}{:.1} {:.1}", x(roll), y(pitch)));
        }
        let label = text("halo mid", x(0.0), y(tilt_deg) - 5.0, &format!("tilt {tilt_deg:.0}°"));
        format!("<path class=\"tilt\" d=\"{path}z\"/>\n{label}")
    }
}

fn half_step(degrees: &[f64]) -> f64 {
    match degrees {
        [first, second, ..] => 0.5 * (second - first),
        _ => 0.5,
    }
}

/// Returns an axis that shows the outermost cells whole, with ticks at every 30°, 15° or less.
fn half_cells(degrees: &[f64]) -> Axis {
    let half = half_step(degrees);
    let (low, high) = (degrees.first().copied().unwrap_or(0.0), degrees.last().copied().unwrap_or(0.0));
    let mut axis = Axis::covering(low - half, high + half, 9);
    if let Some(step) = [30.0, 15.0, 5.0].into_iter().find(|step| (high - low) / step >= 4.0) {
        let (first, last) = ((low / step).ceil() as i32, (high / step).floor() as i32);
        axis.ticks = (first..=last).map(|k| f64::from(k) * step).collect();
    }
    axis
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_figure_is_well_formed_and_covers_as_many_cells_as_the_map_holds() {
        let degrees = [-20.0, -10.0, 0.0, 10.0, 20.0];
        let held: Vec<Vec<bool>> =
            (0..5).map(|i| (0..5).map(|j| (i - 2_i32).abs() + (j - 2_i32).abs() < 3).collect()).collect();
        let free: Vec<Vec<bool>> = (0..5).map(|i| (0..5).map(|j| i == 2 && j != 2).collect()).collect();
        let figure = Workspace {
            title: "A & B",
            subtitle: "c < d",
            roll_deg: &degrees,
            pitch_deg: &degrees,
            reachable: &held,
            singularity_free: &free,
            cond_max: 40.0,
            poses_deg: &[[0.0, 10.0], [-20.0, 0.0]],
        };
        let svg = figure.svg();
        assert!(svg.contains("A &amp; B") && svg.contains("c &lt; d") && svg.contains("cond(H) ≤ 40"));
        // In the middle of the frame's width, and of its left column.
        assert!(svg.contains("cx=\"328.0\"") && svg.contains("cx=\"112.0\""), "{svg}");
        for (class, cells) in [("held", &held), ("free", &free)] {
            let path = svg.split(&format!("<path class=\"{class}\" d=\"")).nth(1).unwrap();
            let path = path.split('"').next().unwrap();
            // Each rectangle is M x0 y0 H x1 V y1 …: their areas in cells of a fifth of the side.
            let mut area = 0.0;
            for rectangle in path.split('M').skip(1) {
                let numbers: Vec<f64> =
                    rectangle.split(['H', 'V', 'z', ' ']).filter_map(|n| n.parse().ok()).collect();
                area += (numbers[2] - numbers[0]) * (numbers[1] - numbers[3]);
            }
            let want = cells.iter().flatten().filter(|c| **c).count() as f64;
            // Coordinates are written to 0.005.
            assert!((area / (SIDE / 5.0).powi(2) - want).abs() < 0.01, "{class}: {area}");
        }
    }
}

//! Modes of a platform on springs, and a body by two ways beside each other, for the terminal; the spectrum
//! as a figure.

use serde::Serialize;

use super::plot::axis::Axis;
use super::plot::{beside, line, text as word};
use rigident_fit::COVERAGE_95;
use rigident_fit::figures::{NOT_IDENTIFIED, significant, with_u95};
use rigident_identify::answer::Answer;
use rigident_vibration::modal_analysis::{Shapes, Spectrum};

/// Width and height of a panel's frame, user units.
const SIDE: (f64, f64) = (520.0, 320.0);
/// Room around it: left, top, right, bottom.
const ROOM: [f64; 4] = [70.0, 62.0, 18.0, 46.0];
const STYLE: &str = "path{fill:none;stroke-width:1.2}.line0{stroke:var(--a)}.line1{stroke:var(--b)}.line2{stroke:var(--c)}.peak{stroke:var(--d);stroke-dasharray:3 3}.dot0{fill:var(--a)}.dot1{fill:var(--b)}.dot2{fill:var(--c)}";

/// A mode.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ModeRow {
    /// Undamped natural frequency, Hz.
    pub hz: f64,
    /// 95 % expanded uncertainty of the frequency, Hz.
    pub hz_u95: f64,
    /// Damping ratio.
    pub damping: f64,
    /// 95 % expanded uncertainty of the damping ratio.
    pub damping_u95: f64,
    /// Names of the coordinates of `shape`: shifts in m, turns in rad.
    pub coordinates: Vec<&'static str>,
    /// Shape of unit norm.
    pub shape: Vec<f64>,
}

/// Returns the rows of modes over coordinates of these names.
pub fn mode_rows(shapes: &Shapes, coordinates: &[&'static str]) -> Vec<ModeRow> {
    let of = |mode: &rigident_vibration::modal_analysis::Mode| ModeRow {
        hz: mode.hz(),
        hz_u95: COVERAGE_95 * mode.angular_sd / std::f64::consts::TAU,
        damping: mode.damping,
        damping_u95: COVERAGE_95 * mode.damping_sd,
        coordinates: coordinates.to_vec(),
        shape: mode.shape.iter().copied().collect(),
    };
    shapes.modes.iter().map(of).collect()
}

/// Returns the name, unit, value and 95 % uncertainty of each quantity of a body.
fn quantities(answer: &Answer) -> Vec<(String, &'static str, f64, f64)> {
    let mut all = Vec::new();
    let mass = answer.parameters.iter().find(|p| p.name == "m").and_then(|p| p.state.measured());
    if let Some(mass) = mass {
        all.push(("mass".to_owned(), "kg", mass.value, mass.u95));
    }
    if let (Some(com), Some(u95)) = (answer.com_m, answer.com_u95_m) {
        for (k, axis) in ["x", "y", "z"].iter().enumerate() {
            all.push((format!("centre of mass {axis}"), "mm", 1e3 * com[k], 1e3 * u95[k]));
        }
    }
    if let (Some(tensor), Some(u95)) = (answer.inertia_com_kgm2, answer.inertia_com_u95_kgm2) {
        for (k, name) in ["Ixx", "Iyy", "Izz", "Iyz", "Izx", "Ixy"].iter().enumerate() {
            all.push(((*name).to_owned(), "kg m²", tensor[k], u95[k]));
        }
    }
    all
}

/// Returns how far two answers are apart, by the root of the sum of the squares of their uncertainties,
/// quantity by quantity.
pub fn differences(answers: [Option<&Answer>; 2]) -> Vec<(String, f64)> {
    let [Some(a), Some(b)] = answers else { return Vec::new() };
    let theirs = quantities(b);
    let of = |(name, _, value, u95): (String, &str, f64, f64)| {
        let (_, _, other, own) = theirs.iter().find(|(other, ..)| *other == name)?;
        Some((name, (value - other).abs() / u95.hypot(*own)))
    };
    quantities(a).into_iter().filter_map(of).collect()
}

/// Returns modes and both answers as text.
pub fn text(modes: &[ModeRow], answers: [Option<&Answer>; 2]) -> String {
    let mut out = "Modes of free vibration\n".to_owned();
    let names = modes.first().map_or(&[][..], |mode| &mode.coordinates);
    out.push_str(&format!("  {:>22} {:>20}  shape:", "Hz", "damping ratio"));
    names.iter().for_each(|name| out.push_str(&format!(" {name:>7}")));
    out.push('\n');
    for mode in modes {
        let (hz, damping) =
            (with_u95(mode.hz, mode.hz_u95, ""), with_u95(mode.damping, mode.damping_u95, ""));
        out.push_str(&format!("  {hz:>22} {damping:>20}        "));
        mode.shape.iter().for_each(|v| out.push_str(&format!(" {v:>7.3}")));
        out.push('\n');
    }
    let titles = ["by the modes", "by the motion"];
    out.push_str(&format!("\nThe body in S, ± U95\n  {:<18}", ""));
    titles.iter().for_each(|title| out.push_str(&format!(" {title:>24}")));
    out.push_str("  difference / U95\n");
    let all = answers.map(|answer| answer.map_or_else(Vec::new, quantities));
    let mut names: Vec<(String, &str)> = Vec::new();
    for (name, unit, ..) in all.iter().flatten() {
        if !names.iter().any(|(own, _)| own == name) {
            names.push((name.clone(), unit));
        }
    }
    let apart = differences(answers);
    for (name, unit) in &names {
        out.push_str(&format!("  {:<18}", format!("{name} ({unit})")));
        for own in &all {
            let cell = own.iter().find(|(other, ..)| other == name);
            let cell = cell
                .map_or_else(|| NOT_IDENTIFIED.to_owned(), |(_, _, value, u95)| with_u95(*value, *u95, ""));
            out.push_str(&format!(" {cell:>24}"));
        }
        if let Some((_, ratio)) = apart.iter().find(|(own, _)| own == name) {
            out.push_str(&format!(" {:>17}", significant(*ratio, 2)));
        }
        out.push('\n');
    }
    for (title, answer) in titles.iter().zip(answers) {
        let Some(answer) = answer else { continue };
        let Some(largest) = answer.budget.first().and_then(|b| Some((b, b.contributions.first()?))) else {
            continue;
        };
        out.push_str(&format!(
            "  {title}: most of the uncertainty of {} is of {} ({:.0} %)\n",
            largest.0.quantity,
            largest.1.source,
            100.0 * largest.1.share
        ));
    }
    out
}

/// Returns the spectrum with the modes as dashed lines: shifts and turns beside each other, as an SVG that
/// needs no style sheet.
pub fn spectrum_svg(spectrum: &Spectrum, names: &[&str], modes: &[ModeRow]) -> String {
    let highest = modes.iter().map(|m| m.hz).fold(1.0, f64::max) * 1.6;
    let shifts: Vec<usize> =
        (0..names.len()).filter(|k| ["x", "y", "z", "fx", "fy", "fz"].contains(&names[*k])).collect();
    let turns: Vec<usize> = (0..names.len()).filter(|k| !shifts.contains(k)).collect();
    let is_imu = names.first() == Some(&"fx");
    let panels = [
        (if is_imu { "Specific force" } else { "Shift" }, if is_imu { "m/s²/√Hz" } else { "m/√Hz" }, shifts),
        (if is_imu { "Angular rate" } else { "Turn" }, if is_imu { "rad/s/√Hz" } else { "rad/√Hz" }, turns),
    ];
    let drawn =
        panels.into_iter().filter(|(.., channels)| !channels.is_empty()).map(|(title, unit, channels)| {
            (title.to_owned(), panel(spectrum, names, modes, highest, (title, unit, &channels)))
        });
    let drawn: Vec<(String, String)> = drawn.collect();
    beside(["vibration-spectrum", "Spectrum of the free vibration", STYLE], (SIDE, ROOM), drawn.into_iter())
}

fn panel(
    spectrum: &Spectrum,
    names: &[&str],
    modes: &[ModeRow],
    highest: f64,
    (title, unit, channels): (&str, &str, &[usize]),
) -> String {
    let (w, h) = SIDE;
    let rows: Vec<usize> = (1..spectrum.hz.len()).filter(|k| spectrum.hz[*k] <= highest).collect();
    let decade = |v: f64| v.max(1e-300).log10();
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for k in &rows {
        for c in channels {
            let v = decade(spectrum.density[(*k, *c)]);
            (low, high) = (low.min(v), high.max(v));
        }
    }
    low = low.max(high - 7.0).floor();
    let (along, values) = (Axis::covering(0.0, highest, 8), Axis::covering(low, high.ceil(), 7));
    let x = |hz: f64| w * along.share(hz);
    let y = |v: f64| h * (1.0 - values.share(v.max(low)));
    let mut svg = word("title", 0.0, -38.0, title);
    for (k, c) in channels.iter().enumerate() {
        svg.push_str(&format!(
            "<circle class=\"dot{k}\" cx=\"{:.1}\" cy=\"-20\" r=\"4\"/>",
            80.0 * k as f64 + 4.0
        ));
        svg.push_str(&word("", 80.0 * k as f64 + 13.0, -15.5, names[*c]));
    }
    for tick in values.ticks.iter().filter(|t| t.fract() == 0.0) {
        svg.push_str(&line("grid", 0.0, y(*tick), w, y(*tick)));
        svg.push_str(&word("end", -7.0, y(*tick) + 4.0, &format!("1e{tick:.0}")));
    }
    for tick in &along.ticks {
        svg.push_str(&word("mid", x(*tick), h + 18.0, &along.label(*tick)));
    }
    for mode in modes {
        svg.push_str(&line("peak", x(mode.hz), 0.0, x(mode.hz), h));
    }
    for (k, c) in channels.iter().enumerate() {
        let mut path = String::new();
        for (n, row) in rows.iter().enumerate() {
            let step = if n == 0 { 'M' } else { 'L' };
            path.push_str(&format!(
                "{step}{:.1} {:.1}",
                x(spectrum.hz[*row]),
                y(decade(spectrum.density[(*row, *c)]))
            ));
        }
        svg.push_str(&format!("<path class=\"line{k}\" d=\"{path}\"/>"));
    }
    svg.push_str(&word("", -60.0, -5.0, unit));
    svg.push_str(&word("end", w, h + 37.0, "Hz; dashed: the modes"));
    svg.push_str(&line("axis", 0.0, h, w, h));
    svg.push_str(&line("axis", 0.0, 0.0, 0.0, h));
    svg
}

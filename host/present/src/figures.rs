//! The page's figures: convergence, residuals, motion, drift.

use super::data::{Along, Convergence, Drift, Quantity, Residual, TimePlot};
use super::envelope::{band, envelope, extremes};
use super::page::{describe, escape, measured_markup, number, symbol};
use super::plot::axis::Axis;
use super::plot::{Chart, FULL_WIDTH, Layer, WIDTH, line, open_svg, text};
use super::series::Series;
use rigident_fit::figures::{Rounded, beside, three_digits, unit_symbol};

/// Buckets of an envelope: about one per user unit of the plot's width.
const BUCKETS: usize = 450;
/// Up to this many residuals are dots, more are a line.
const FEW: usize = 150;
/// Estimates move slowly: fewer will do.
const CONVERGENCE_BUCKETS: usize = 220;

/// Returns the time axis that all figures share, s.
pub fn time_axis(data: &Series) -> Axis {
    let convergence = data.convergence.iter().map(|c| &c.time_s);
    let residuals = data.residuals.iter().map(|r| &r.time_s);
    let motion = data.motion.iter().filter_map(|m| m.range_s).flat_map(|(low, high)| [low, high]);
    let range = extremes(convergence.chain(residuals).flatten().copied().chain(motion));
    let (low, high) = range.unwrap_or((0.0, 1.0));
    if data.along == Along::Poses {
        // No tick between two poses.
        return Axis::covering(low - 0.5, high + 0.5, (high - low + 1.0).clamp(1.0, 8.0) as usize);
    }
    let low = if low >= 0.0 && low < 0.05 * (high - low) { 0.0 } else { low };
    Axis::covering(low, high, 8)
}

fn figure(class: &str, caption: &str, content: &str) -> String {
    format!("<figure class=\"{class}\"><figcaption>{caption}</figcaption>\n{content}</figure>\n")
}

/// Draws one figure for each parameter that is identified and has a history; for each that is not identified
/// it writes a word.
pub fn convergence(quantities: &[Quantity], data: &Series, time: &Axis) -> String {
    let mut html = String::new();
    for quantity in quantities {
        let history = data.convergence.iter().find(|c| c.name == quantity.name);
        if quantity.known().is_none() {
            let caption = format!("<b>{}</b> {}", symbol(&quantity.name), describe(&quantity.name));
            html.push_str(&figure(
                "",
                &caption,
                &format!("<p class=\"nothing\">{}</p>\n", quantity.missing()),
            ));
        } else if let Some(history) = history {
            html.push_str(&converging(quantity, history, time, data));
        }
    }
    html
}

fn converging(quantity: &Quantity, history: &Convergence, time: &Axis, data: &Series) -> String {
    let unit = unit_symbol(&quantity.unit);
    let (low, high) = settled_range(quantity, history);
    let mut layers = vec![
        Layer::Band("band", band(&history.time_s, &history.estimate, &history.u95, CONVERGENCE_BUCKETS)),
        Layer::Line("s0", envelope(&history.time_s, &determined(history), CONVERGENCE_BUCKETS)),
    ];
    let truth = quantity.truth.filter(|t| t.is_finite());
    layers.extend(truth.map(|t| Layer::Level("truth", t)));
    let u95 = quantity.known().map_or(0.0, |m| m.u95);
    let mut caption = format!(
        "<b>{}</b> {} <span class=\"reading\">{}</span>",
        symbol(&quantity.name),
        describe(&quantity.name),
        measured_markup(quantity)
    );
    if let Some(truth) = truth {
        caption.push_str(&format!(" <span class=\"key truth\">truth {}</span>", number(&beside(truth, u95))));
    }
    let chart = Chart {
        id: format!("convergence-{}", identifier(&quantity.name)),
        title: format!("Convergence of {}", quantity.name),
        description: format!("Estimate of {} in {unit} over time with its 95 % band.", quantity.name),
        unit,
        time: time.clone(),
        along: data.along,
        values: Axis::covering(low, high, 7),
        width: WIDTH,
        height: 178.0,
        stages: &data.stages,
        name_stages: false,
        layers,
    };
    figure("", &caption, &chart.render())
}

/// Returns the estimate where it has an uncertainty.
fn determined(history: &Convergence) -> Vec<f64> {
    let known = |(e, u): (&f64, &f64)| if u.is_finite() { *e } else { f64::NAN };
    history.estimate.iter().zip(&history.u95).map(known).collect()
}

/// Returns a range for the settled part: what most of the last 60 % covers, at least 1.6 and at most 8 times
/// the last U95 to either side, and the truth unless it lies far outside.
fn settled_range(quantity: &Quantity, history: &Convergence) -> (f64, f64) {
    let Some(last) = quantity.known() else { return (0.0, 1.0) };
    let points: Vec<(f64, f64)> = history
        .estimate
        .iter()
        .zip(&history.u95)
        .filter(|(e, u)| e.is_finite() && u.is_finite())
        .map(|(e, u)| (*e, *u))
        .collect();
    let settled = points.get(points.len() * 2 / 5..).unwrap_or(&[]);
    let mut reach: Vec<f64> = settled.iter().map(|(e, u)| (e - last.value).abs() + u).collect();
    reach.sort_by(f64::total_cmp);
    let most = reach.get(reach.len() * 9 / 10).copied().unwrap_or(last.u95);
    let mut half = if last.u95 > 0.0 { most.clamp(1.6 * last.u95, 8.0 * last.u95) } else { most };
    let to_truth = quantity.truth.map_or(0.0, |t| (t - last.value).abs() + 0.3 * last.u95);
    if to_truth <= 15.0 * last.u95 {
        half = half.max(to_truth);
    }
    (last.value - 1.05 * half, last.value + 1.05 * half)
}

/// Draws one figure for each channel.
pub fn residuals(data: &Series, time: &Axis) -> String {
    data.residuals.iter().map(|r| residual(r, time, data)).collect()
}

fn residual(residual: &Residual, time: &Axis, data: &Series) -> String {
    let unit = unit_symbol(&residual.unit);
    let finite = || residual.values.iter().filter(|v| v.is_finite());
    let number_of = finite().count();
    let limit = Some(1.96 * residual.sigma).filter(|l| l.is_finite() && *l > 0.0);
    let largest = extremes(finite().map(|v| v.abs())).map_or(0.0, |range| range.1);
    let half = 1.08 * largest.max(limit.unwrap_or(0.0));
    let mut caption = format!("<b>{}</b>", symbol(&residual.channel));
    if number_of > 0 {
        let rms = (finite().map(|v| v * v).sum::<f64>() / number_of as f64).sqrt();
        caption.push_str(&format!(
            " <span class=\"reading\">RMS {} {}</span>",
            number(&three_digits(rms)),
            escape(&unit)
        ));
    }
    if let Some(limit) = limit {
        let inside = finite().filter(|v| v.abs() <= limit).count();
        caption.push_str(&format!(" expected {} {}", number(&three_digits(residual.sigma)), escape(&unit)));
        if number_of > 0 {
            let share = 100.0 * inside as f64 / number_of as f64;
            caption.push_str(&format!(" <span class=\"key limit\">{share:.1} % within ±1.96 σ</span>"));
        }
    }
    let mut layers = vec![Layer::Level("zero", 0.0)];
    let points = envelope(&residual.time_s, &residual.values, BUCKETS);
    layers.push(if points.len() <= FEW { Layer::Dots("dots", points) } else { Layer::Line("dense", points) });
    if let Some(limit) = limit {
        layers.extend([Layer::Level("limit", -limit), Layer::Level("limit", limit)]);
    }
    layers.extend(data.change_s.map(|time_s| Layer::Moment("limit", time_s)));
    let chart = Chart {
        id: format!("residual-{}", identifier(&residual.channel)),
        title: format!("Residual of {}", residual.channel),
        description: format!(
            "Measured minus modelled {} in {unit} over time, smallest and largest per interval.",
            residual.channel
        ),
        unit,
        time: time.clone(),
        along: data.along,
        values: Axis::covering(-half, half, 5),
        width: WIDTH,
        height: 168.0,
        stages: &data.stages,
        name_stages: false,
        layers,
    };
    figure("", &caption, &chart.render())
}

/// Returns a name as part of an identifier: letters and digits, everything else by its number.
fn identifier(name: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric();
    name.chars().map(|c| if plain(c) { c.to_string() } else { format!("-{:x}-", u32::from(c)) }).collect()
}

/// Draws one figure for each group of series.
pub fn motion(data: &Series, time: &Axis) -> String {
    data.motion.iter().enumerate().map(|(i, m)| moving(i, m, time, data)).collect()
}

fn moving(index: usize, plot: &TimePlot, time: &Axis, data: &Series) -> String {
    let (low, high) =
        extremes(plot.series.iter().flat_map(|s| s.1.iter().map(|p| p.1))).unwrap_or((-1.0, 1.0));
    let margin = (0.06 * (high - low)).max(1e-12);
    let mut caption = format!("<b>{}</b>", escape(&plot.title));
    let mut layers = vec![Layer::Level("zero", 0.0)];
    let classes = [("s0", "s0 points"), ("s1", "s1 points"), ("s2", "s2 points")];
    for ((label, envelope), (class, points)) in plot.series.iter().zip(classes) {
        caption.push_str(&format!(" <span class=\"key {class}\">{}</span>", escape(label)));
        layers.push(match data.along {
            Along::Time => Layer::Line(class, envelope.clone()),
            // Nothing is known of what lies between two poses.
            Along::Poses => Layer::Dots(points, envelope.clone()),
        });
    }
    let along = if data.along == Along::Poses { "of each still pose" } else { "over time" };
    let unit = unit_symbol(&plot.unit);
    let chart = Chart {
        id: format!("motion-{index}"),
        title: plot.title.clone(),
        description: format!("{} in {unit} {along}.", plot.title),
        unit,
        time: time.clone(),
        along: data.along,
        values: Axis::covering(low - margin, high + margin, 5),
        width: FULL_WIDTH,
        height: 200.0,
        stages: &data.stages,
        name_stages: true,
        layers,
    };
    figure("", &caption, &chart.render())
}

/// Returns a change in units of its U95.
fn relative(change: &Quantity) -> Option<f64> {
    change.known().map(|m| m.value / m.u95).filter(|r| r.is_finite())
}

/// Draws the change of each channel beside its uncertainty, and explains it.
pub fn drift(drift: &Drift) -> String {
    let moved: Vec<&str> = drift
        .changes
        .iter()
        .filter(|q| relative(q).is_some_and(|r| r.abs() > 1.0))
        .map(|q| q.name.as_str())
        .collect();
    let verdict = if drift.changes.iter().all(|q| q.known().is_none()) {
        "No change could be measured.".to_owned()
    } else if moved.is_empty() {
        "No channel changed by more than its uncertainty.".to_owned()
    } else {
        // 1 − 0.95⁶ = 0.26.
        format!(
            "<b>{}</b> changed by more than the uncertainty. By chance alone one of six channels does so in \
             a quarter of all experiments; far outside the band, the sensor drifted or the mounting moved.",
            escape(&moved.join(", "))
        )
    };
    format!(
        "<p>{verdict}</p>\n<div class=\"grid\">{}</div>\n",
        figure("", DRIFT_CAPTION, &drift_chart(drift))
    )
}

const DRIFT_CAPTION: &str =
    "<b>Change between the first pose and its repetition</b> <span class=\"key strip\">±U95</span>";

fn drift_chart(drift: &Drift) -> String {
    let farthest = drift.changes.iter().filter_map(relative).fold(1.0_f64, |a, b| a.max(b.abs()));
    let axis = Axis::covering(-(farthest + 1.4), farthest + 1.4, 6);
    let (left, width, top, row) = (34.0, WIDTH - 34.0 - 150.0, 8.0, 24.0);
    let height = row * drift.changes.len() as f64;
    let x = |v: f64| left + width * axis.share(v);
    let mut svg = open_svg(
        "drift",
        "Drift check",
        "Change of the mean wrench in the first pose, in units of its 95 % uncertainty, per channel.",
        WIDTH,
        top + height + 34.0,
    );
    svg.push_str(&format!(
        "<rect class=\"strip\" x=\"{:.1}\" y=\"{top}\" width=\"{:.1}\" height=\"{height}\"/>\n",
        x(-1.0),
        x(1.0) - x(-1.0)
    ));
    for tick in &axis.ticks {
        svg.push_str(&line("grid", x(*tick), top, x(*tick), top + height));
        svg.push_str(&text("mid", x(*tick), top + height + 16.0, &axis.label(*tick)));
    }
    svg.push_str(&line("axis", x(0.0), top, x(0.0), top + height));
    svg.push_str(&text("end", left + width, top + height + 30.0, "change / U95"));
    for (i, change) in drift.changes.iter().enumerate() {
        let y = top + row * (i as f64 + 0.5);
        svg.push_str(&text("end", left - 8.0, y + 3.8, &change.name));
        let Some(m) = change.known() else {
            svg.push_str(&text("start", left + width + 12.0, y + 3.8, "not measured"));
            continue;
        };
        if let Some(r) = relative(change) {
            let class = if r.abs() > 1.0 { "s1" } else { "s0" };
            svg.push_str(&line(class, x(r - 1.0), y, x(r + 1.0), y));
            svg.push_str(&format!(
                "<circle class=\"dot {class}\" cx=\"{:.1}\" cy=\"{y}\" r=\"3.6\"/>\n",
                x(r)
            ));
        }
        if let Some(rounded) = Rounded::new(m.value, m.u95) {
            let reading = format!("{rounded} {}", unit_symbol(&change.unit)).replace('-', "\u{2212}");
            svg.push_str(&text("start", left + width + 12.0, y + 3.8, &reading));
        }
    }
    svg.push_str("</svg>\n");
    svg
}

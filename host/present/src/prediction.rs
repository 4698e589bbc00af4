//! The predictions of models for a recording, as text and page: measured against predicted, channel by
//! channel.

use serde::Serialize;

use super::data::TimePlot;
use super::figures;
use super::page::{END, beginning, escape, number, symbol};
use super::series::Series;
use super::table::printable;
use rigident_fit::Prediction;
use rigident_fit::figures::{significant, unit_symbol};

/// The object of `--json`.
#[derive(Clone, Debug, Serialize)]
pub struct Predictions {
    /// Name of the recording.
    pub recording: String,
    /// The divisor of root mean squares.
    pub normalised_by: String,
    /// Names of the models, in order.
    pub models: Vec<String>,
    /// Every channel.
    pub channels: Vec<PredictedChannel>,
    /// The steps and findings on the way.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

/// A channel with what models leave of it.
#[derive(Clone, Debug, Serialize)]
pub struct PredictedChannel {
    /// The name of the channel: `fx`, or a joint's name.
    pub name: String,
    /// The unit of the channel.
    pub unit: String,
    /// Standard deviation of what was measured; absent where nothing was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured_sd: Option<f64>,
    /// The residuals of each model; empty where nothing was measured.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub models: Vec<ChannelError>,
}

/// The residuals of a model in a channel.
#[derive(Clone, Debug, Serialize)]
pub struct ChannelError {
    /// The model's name.
    pub model: String,
    /// Root mean square of measured less predicted, in the channel's unit.
    pub rms: f64,
    /// `rms` divided by the standard deviation of the measured values; absent where that is zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nrmse: Option<f64>,
}

fn is_measured(found: &Predictions) -> bool {
    found.channels.iter().any(|channel| !channel.models.is_empty())
}

fn percent(error: &ChannelError) -> String {
    error.nrmse.map_or_else(|| "–".to_owned(), |share| format!("{} %", significant(100.0 * share, 3)))
}

/// Returns the predictions for a terminal.
pub fn text(found: &Predictions) -> String {
    let mut out = format!("{}\n", printable(&found.recording));
    for note in &found.notes {
        out.push_str(&format!("  {note}\n"));
    }
    if !is_measured(found) {
        out.push_str("  nothing was measured to compare with; `out` FOLDER keeps what is predicted\n");
        return out;
    }
    let mut rows: Vec<Vec<String>> = vec![vec![String::new(), "measured, sd".to_owned(), String::new()]];
    rows[0].extend(found.models.iter().flat_map(|model| [format!("{model}: RMS"), "NRMSE".to_owned()]));
    for channel in &found.channels {
        let sd = channel.measured_sd.map_or_else(String::new, |sd| significant(sd, 3));
        let mut row = vec![printable(&channel.name), sd, unit_symbol(&channel.unit)];
        row.extend(channel.models.iter().flat_map(|error| [significant(error.rms, 3), percent(error)]));
        rows.push(row);
    }
    let width = |column: usize| rows.iter().filter_map(|r| r.get(column)).map(|c| c.chars().count()).max();
    for row in &rows {
        let cells = row.iter().enumerate().map(|(k, cell)| {
            let room = " ".repeat(width(k).unwrap_or(0).saturating_sub(cell.chars().count()));
            if k == 0 || k == 2 { format!("{cell}{room}") } else { format!("{room}{cell}") }
        });
        out.push_str(&format!("  {}\n", cells.collect::<Vec<_>>().join("  ").trim_end()));
    }
    out.push_str(&format!(
        "NRMSE: root mean square of measured less predicted over the {}\n",
        found.normalised_by
    ));
    out
}

/// Returns the predictions as one self-contained page with a figure for each channel.
pub fn page(found: &Predictions, columns: &[(String, Prediction)]) -> String {
    let mut html = beginning("Prediction");
    html.push_str(&format!("<header><h1>Prediction of {}</h1></header>\n", escape(&found.recording)));
    for note in &found.notes {
        html.push_str(&format!("<p class=\"soft\">{}</p>\n", escape(note)));
    }
    if is_measured(found) {
        html.push_str(&table(found));
    }
    let plots: Vec<TimePlot> = (0..found.channels.len()).filter_map(|c| plot(found, columns, c)).collect();
    let series = Series { motion: plots, ..Series::default() };
    let time = figures::time_axis(&series);
    html.push_str("<h2>Over time</h2>\n");
    html.push_str(&figures::motion(&series, &time));
    html.push_str(END);
    html
}

fn table(found: &Predictions) -> String {
    let right = |cell: &str| format!("<td class=\"right\">{cell}</td>");
    let heads: String = found
        .models
        .iter()
        .map(|model| {
            format!(
                "<th class=\"right\" scope=\"col\">{}, RMS</th><th class=\"right\" scope=\"col\">NRMSE</th>",
                escape(model)
            )
        })
        .collect();
    let rows: String = found
        .channels
        .iter()
        .map(|channel| {
            let sd = channel.measured_sd.map_or_else(String::new, |sd| number(&significant(sd, 3)));
            let cells: String = channel
                .models
                .iter()
                .map(|error| right(&number(&significant(error.rms, 3))) + &right(&percent(error)))
                .collect();
            format!(
                "<tr><th scope=\"row\">{}</th>{}<td>{}</td>{cells}</tr>\n",
                symbol(&channel.name),
                right(&sd),
                escape(&unit_symbol(&channel.unit))
            )
        })
        .collect();
    format!(
        "<h2>Measured against predicted</h2>\n<p class=\"soft\">NRMSE is the root mean square of measured \
         less predicted over the {}.</p>\n<div class=\"scroll\"><table \
         class=\"tight\"><thead><tr><th></th><th class=\"right\" scope=\"col\">measured, \
         sd</th><th></th>{heads}</tr></thead>\n<tbody>\n{rows}</tbody></table></div>\n",
        escape(&found.normalised_by)
    )
}

/// Returns the figure of a channel: measured, and what the last but least squares predict.
fn plot(found: &Predictions, columns: &[(String, Prediction)], c: usize) -> Option<TimePlot> {
    let channel = found.channels.get(c)?;
    let (name, shown) = columns.iter().rev().find(|(name, _)| name != "least squares")?;
    let shown_blocks: Vec<_> =
        shown.blocks.iter().filter(|block| block.determined.get(c) != Some(&false)).collect();
    let mut plot = TimePlot::new(channel.name.clone(), channel.unit.clone());
    let value = |values: &[f64]| values.get(c).copied().unwrap_or(f64::NAN);
    if channel.measured_sd.is_some() {
        plot = plot.with("measured", shown_blocks.len(), |k| {
            (shown_blocks[k].time_s, value(&shown_blocks[k].measured))
        });
    }
    Some(plot.with(name, shown_blocks.len(), |k| (shown_blocks[k].time_s, value(&shown_blocks[k].predicted))))
}

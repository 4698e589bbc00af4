//! The result as a plain table for a terminal.

use super::data::{PrincipalAxis, Quantity};
use rigident_fit::figures::{
    CONTRADICTED, NOT_IDENTIFIED, Rounded, beside, fixed, signed, significant, unit_symbol,
};

/// Cells of one row; numbers are right-aligned, everything else left.
pub(super) type Row = [String; 6];

pub(super) fn head(with_truth: bool) -> Row {
    let (truth, deviation) = if with_truth { ("truth", "deviation") } else { ("", "") };
    ["", "estimate", "± U95", "", truth, deviation].map(str::to_owned)
}

pub(super) fn row(quantity: &Quantity) -> Row {
    let name = printable(&quantity.name);
    let known = quantity.known().and_then(|m| Rounded::new(m.value, m.u95).map(|r| (m, r)));
    let Some((m, rounded)) = known else {
        return [
            name,
            quantity.missing().to_owned(),
            String::new(),
            String::new(),
            String::new(),
            String::new(),
        ];
    };
    let prior = if quantity.state.is_prior_dominated() { " (prior)" } else { "" };
    let truth = quantity.truth.map_or(String::new(), |t| beside(t, m.u95));
    let deviation = quantity.deviation_sd().map_or(String::new(), |sd| format!("{} sd", signed(sd, 2)));
    [
        name,
        rounded.value_alone(),
        format!("± {}{prior}", rounded.u95_alone()),
        printable(&unit_symbol(&quantity.unit)),
        truth,
        deviation,
    ]
}

/// Returns true of words in place of a number: they are wider than numbers.
fn is_missing(cell: &str) -> bool {
    cell == NOT_IDENTIFIED || cell == CONTRADICTED
}

/// Columns as wide as their widest cell; names, uncertainties and units start, numbers end together.
pub(super) fn aligned(rows: &[Row]) -> String {
    let width = |column: usize| {
        rows.iter()
            .filter_map(|r| r.get(column))
            .filter(|cell| !is_missing(cell))
            .map(|cell| cell.chars().count())
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..6).map(width).collect();
    let mut text = String::new();
    for row in rows {
        let mut line = String::from(" ");
        for (column, (cell, width)) in row.iter().zip(&widths).enumerate() {
            let width = *width;
            match column {
                0 | 2 | 3 => line.push_str(&format!(" {cell:<width$} ")),
                _ if is_missing(cell) => line.push_str(&format!("  {cell}")),
                _ => line.push_str(&format!(" {cell:>width$}")),
            }
        }
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text
}

pub(super) fn principal(text: &mut String, axes: &[PrincipalAxis]) {
    if axes.is_empty() {
        return;
    }
    text.push_str("\nPrincipal moments about the centre of mass and their axes in S\n");
    let mut rows = vec![head(axes.iter().any(|a| a.moment.known().is_some() && a.moment.truth.is_some()))];
    rows.extend(axes.iter().map(|a| row(&a.moment)));
    let table = aligned(&rows);
    let width = table.lines().map(|l| l.chars().count()).max().unwrap_or(0);
    let directions = std::iter::once(String::new()).chain(axes.iter().map(direction));
    for (line, direction) in table.lines().zip(directions) {
        text.push_str(format!("{line:<width$}   {direction}").trim_end());
        text.push('\n');
    }
}

fn direction(axis: &PrincipalAxis) -> String {
    if axis.moment.known().is_none() {
        return String::new();
    }
    if !axis.direction_u95_rad.is_finite() {
        return "axis free: two moments are equal within U95".to_owned();
    }
    let direction = axis.axis.map(|c| format!("{:>6}", fixed(c, 3))).join(" ");
    format!("[{direction}] ± {}°", significant(axis.direction_u95_rad.to_degrees(), 2))
}

/// Replaces control characters, which would steer the terminal, by spaces.
pub(super) fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

//! One person's segments for a terminal.

use super::page::{escape, notes};
use super::person_drawing::{drawn, time_lines};
use super::plain::UNUSABLE;
use super::quantities::{headline, learned};
use super::table::printable;
use rigident_fit::Measured;
use rigident_fit::figures::{NOT_IDENTIFIED, significant, with_u95};
use rigident_identify::answer::Answer;
use rigident_identify::answer::person::{DeviceResult, PersonResult, ToolResult, TrialResult};

/// Returns an answer about a person: her tables, then warnings and notes.
pub fn whole_text(answer: &Answer) -> String {
    let mut out = format!("{}\n", printable(&answer.source.recording));
    if answer.is_contradicted() {
        out.push_str(&format!("{}\n{UNUSABLE}\n", printable(&headline(answer))));
    }
    out.push_str(&answer.person.as_ref().map_or_else(String::new, text));
    for (word, all) in [("warning", &answer.warnings), ("note", &answer.notes)] {
        for said in all {
            out.push_str(&format!("{word}: {}\n", printable(said)));
        }
    }
    out
}

/// Returns the tables of a person.
pub fn text(found: &PersonResult) -> String {
    let mut out = format!(
        "{}\n{}, {} m tall; the table: {}, scaled to {} kg\n\n",
        learned(found),
        found.model,
        significant(found.height_m, 3),
        found.table,
        significant(found.table_mass_kg, 4)
    );
    // Trials that cannot be true say nothing of her.
    if says_of_her(found) {
        out.push_str(&format!("Whole mass            {}\n", mass(found.mass_kg)));
        out.push_str(&format!("  with the table      {}\n", mass(found.mass_with_table_kg)));
        out.push_str(&format!("  its centre          {}\n\n", centre(found)));
    }
    if !found.segments.is_empty() {
        out.push_str(&columns(&segments(found)));
        out.push_str(&format!("\n{SEGMENTS_NOTE}\n\n"));
    }
    let what = how_left_out(found);
    out.push_str(&format!("{what}: root mean square of what is left\n"));
    out.push_str(&columns(&left_out(found)));
    if !found.choices.is_empty() {
        out.push_str(&format!("\n{CHOICES_NOTE}\n"));
        out.push_str(&columns(&choices(found)));
    }
    out.push('\n');
    for trial in &found.trials {
        out.push_str(&format!("{}\n", frames(trial)));
    }
    if let Some(tool) = &found.tool {
        out.push_str(&format!("{}\n", held(tool)));
    }
    if let Some(device) = &found.device {
        out.push_str(&format!("{}\n", on_device(device)));
    }
    out
}

/// Returns whom the answer is about: stature, and mass if it is known.
pub(super) fn title(found: &PersonResult) -> String {
    let mass =
        found.mass_with_table_kg.map_or_else(String::new, |m| format!(", {} kg", significant(m.value, 3)));
    format!("A person of {} m{mass}", significant(found.height_m, 3))
}

/// Returns true if some segment is identified beside the whole mass.
pub(super) fn tells_segments(found: &PersonResult) -> bool {
    found.segments.iter().any(|segment| segment.identified)
}

fn says_of_her(found: &PersonResult) -> bool {
    !found.segments.is_empty() || found.mass_with_table_kg.is_some()
}

fn mass(measured: Option<Measured>) -> String {
    measured.map_or_else(|| NOT_IDENTIFIED.to_owned(), |m| with_u95(m.value, m.u95, "kg"))
}

/// Returns the whole mass and the segments for a page; nothing of trials that cannot be true.
fn masses(found: &PersonResult) -> String {
    if !says_of_her(found) {
        return String::new();
    }
    let segments = match found.segments.as_slice() {
        [] => String::new(),
        _ => {
            let (drawn, all) = (drawn(found), table(&segments(found)));
            format!("\n<h2>Segments</h2>\n<p class=\"soft\">{SEGMENTS_NOTE}</p>\n{drawn}{all}")
        }
    };
    format!(
        "<h2>Whole mass</h2>\n<p>{} by the plates and the motion alone; {} with what the table of people \
         knows of the segments; its centre {}. The table ({}) is scaled to {} kg and {} m.</p>{segments}",
        escape(&mass(found.mass_kg)),
        escape(&mass(found.mass_with_table_kg)),
        escape(&centre(found)),
        escape(&found.table),
        significant(found.table_mass_kg, 4),
        significant(found.height_m, 3),
    )
}

fn centre(found: &PersonResult) -> String {
    let Some(centre) = &found.centre_of_mass_m else { return NOT_IDENTIFIED.to_owned() };
    let [x, y, z] = centre.each_ref().map(|m| with_u95(m.value, m.u95, "m"));
    format!("{x} forward, {y} to the left, {z} above the hips, standing upright")
}

fn held(tool: &ToolResult) -> String {
    let name = printable(&tool.name);
    let mass = with_u95(tool.mass_kg.value, tool.mass_kg.u95, "kg");
    let centre = tool.com_m.as_ref().map_or_else(
        || "its centre of mass is not identified".to_owned(),
        |c| {
            let of = |m: &Measured| with_u95(m.value, m.u95, "m");
            format!("its centre of mass is at {}, {}, {} of it", of(&c[0]), of(&c[1]), of(&c[2]))
        },
    );
    format!("{name}: {mass}, on {}; {centre}", printable(&tool.link))
}

fn on_device(device: &DeviceResult) -> String {
    format!(
        "microcontroller ({}): {} frames, {} rows; its parameters are those of the same rows in double \
         precision to {} standard deviations ({}), {} of what is allowed",
        device.mcu,
        device.frames,
        device.rows,
        significant(device.largest_difference_sd, 2),
        printable(&device.parameter),
        significant(device.share_of_allowed, 2),
    )
}

/// Returns the tables of a person for a page.
pub(super) fn html(found: &PersonResult) -> String {
    let trials: Vec<String> = found
        .trials
        .iter()
        .map(frames)
        .chain(found.tool.as_ref().map(held))
        .chain(found.device.as_ref().map(on_device))
        .collect();
    format!(
        "{}{}<h2>{}</h2>\n<p class=\"soft\">Root mean square of what is left and its mean, by the person's \
         own parameters and by the scaled table; then without the means of both; moments about the pelvis, \
         in per cent of weight times stature.</p>\n{}{}",
        masses(found),
        time_lines(found),
        escape(&how_left_out(found)),
        table(&left_out(found)),
        if found.choices.is_empty() {
            notes("Trials", &trials)
        } else {
            let choices = table(&choices(found));
            format!(
                "<h2>Choice of motions</h2>\n<p class=\"soft\">{CHOICES_NOTE}</p>\n{choices}{}",
                notes("Trials", &trials)
            )
        },
    )
}

fn table(rows: &[Vec<String>]) -> String {
    let line = |row: &Vec<String>, is_head: bool| -> String {
        let cells = row.iter().enumerate().map(|(k, cell)| match (k, is_head) {
            (0, _) => format!("<th scope=\"row\">{}</th>", escape(cell)),
            (_, true) => format!("<th class=\"right\" scope=\"col\">{}</th>", escape(cell)),
            _ => format!("<td class=\"right\">{}</td>", escape(cell)),
        });
        format!("<tr>{}</tr>\n", cells.collect::<String>())
    };
    let head = rows.first().map_or_else(String::new, |row| line(row, true));
    let body: String = rows.iter().skip(1).map(|row| line(row, false)).collect();
    format!(
        "<div class=\"scroll\"><table \
         class=\"tight\"><thead>{head}</thead>\n<tbody>\n{body}</tbody></table></div>\n"
    )
}

/// The meaning of the columns of the segments.
const SEGMENTS_NOTE: &str = "Mass, and place of the centre of mass along the segment from its proximal joint \
                             (feet: before it), ± U95, the table's beside with how far one person is from \
                             it; radii of gyration about the axes forward, left and up; how much of the \
                             table's variance of the mass the plates took away. Where that is less than a \
                             quarter the motions determine nothing of the segment, and only the table's values \
                             are there.";

fn how_left_out(found: &PersonResult) -> String {
    match (found.motions, found.trials.len()) {
        (1, _) => "The motion predicted by itself: there is no other".to_owned(),
        (n, 1) => {
            format!("{n} parts of one trial, each predicted by the others with the joint centres of all")
        }
        (n, _) => format!("{n} motions, each predicted by the others with the joint centres of all"),
    }
}

fn segments(found: &PersonResult) -> Vec<Vec<String>> {
    let head =
        ["segment", "mass/kg", "", "table", "", "centre/m", "", "table", "radii/m", "table", "from data"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for s in &found.segments {
        let axis = if s.table_com_m[0].abs() > s.table_com_m[2].abs() { 0 } else { 2 };
        let fixed = |v: f64, digits: usize| format!("{v:.digits$}");
        let radii = |r: &[f64; 3]| r.map(|v| fixed(v, 3)).join(" ");
        let own = |text: String| if s.identified { text } else { "-".to_owned() };
        rows.push(vec![
            printable(&s.name),
            own(fixed(s.mass_kg.value, 2)),
            own(format!("± {}", fixed(s.mass_kg.u95, 2))),
            fixed(s.table_mass_kg, 2),
            format!("± {}", fixed(s.table_mass_u95_kg, 2)),
            own(fixed(s.com_m[axis].value, 3)),
            own(format!("± {}", fixed(s.com_m[axis].u95, 3))),
            fixed(s.table_com_m[axis], 3),
            own(radii(&s.radii_m)),
            radii(&s.table_radii_m),
            format!("{:.0} %", 100.0 * s.informed),
        ]);
    }
    rows
}

fn left_out(found: &PersonResult) -> Vec<Vec<String>> {
    let head = [
        "",
        "own",
        "mean",
        "table",
        "mean",
        "",
        "% BW (x height)",
        "measured, sd",
        "against the table",
        "scatter alone",
    ];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for c in &found.left_out {
        let against = |gain_sd: f64| match gain_sd {
            g if g >= 2.0 => format!("better ({g:.1} sd)"),
            g if g <= -2.0 => format!("worse ({g:.1} sd)"),
            g => format!("no difference beyond chance ({g:.1} sd)"),
        };
        rows.push(vec![
            printable(&c.name),
            significant(c.rms, 3),
            significant(c.mean, 2),
            significant(c.table_rms, 3),
            significant(c.table_mean, 2),
            c.unit.clone(),
            significant(c.percent_of_weight, 2),
            significant(c.measured_sd, 3),
            against(c.gain_sd),
            against(c.scatter_gain_sd),
        ]);
    }
    rows
}

/// The meaning of the columns of the choices.
const CHOICES_NOTE: &str = "Ways to choose motions: parameters known to 5 %, to 15 %, worse, and small ones \
                            (1 σ, the table known beforehand); condition number of the rows, and with \
                            columns of unit length; log10 of the determinant of the information; root mean \
                            square of what is left of the whitened rows of the other motions.";

fn choices(found: &PersonResult) -> Vec<Vec<String>> {
    let head = [
        "",
        "motions",
        "< 5 %",
        "5-15 %",
        "> 15 %",
        "small",
        "condition",
        "scaled",
        "log det",
        "left out",
        "",
    ];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    let number = |v: Option<f64>| v.map_or_else(|| "-".to_owned(), |v| significant(v, 3));
    for c in &found.choices {
        rows.push(vec![
            c.name.clone(),
            c.motions.len().to_string(),
            c.good.to_string(),
            c.fair.to_string(),
            c.poor.to_string(),
            c.small.to_string(),
            number(c.condition),
            number(c.condition_scaled),
            number(c.log10_determinant),
            number(c.left_out),
            if c.used { "used".to_owned() } else { String::new() },
        ]);
    }
    rows
}

fn frames(trial: &TrialResult) -> String {
    let dropped: Vec<String> = trial.dropped.iter().map(|d| format!("{} {}", d.frames, d.reason)).collect();
    let dropped =
        if dropped.is_empty() { String::new() } else { format!("; dropped: {}", dropped.join(", ")) };
    let delay = trial.delay_s.map_or_else(String::new, |d| {
        let done = if trial.delay_taken_out { "taken out" } else { "left" };
        format!("; plates late by {} ms, {done}", with_u95(1e3 * d.value, 1e3 * d.u95, ""))
    });
    let beside = trial
        .beside_plates_n
        .map_or_else(String::new, |n| format!("; beside the plates {} N at most", significant(n, 2)));
    let far: Vec<String> =
        trial.farthest.iter().map(|f| format!("{} {:.0}", printable(&f.name), 1e3 * f.rms_m)).collect();
    format!(
        "{}: {} of {} frames used{dropped}; smoothed at {} Hz{delay}{beside}; markers {:.1} mm off the \
         model, most {} mm; {} filled in",
        printable(&trial.name),
        trial.used,
        trial.frames,
        significant(trial.cut_off_hz, 2),
        1e3 * trial.marker_rms_m,
        far.join(", "),
        trial.filled
    )
}

/// Columns as wide as their widest cell: the first from the left, the others from the right.
fn columns(rows: &[Vec<String>]) -> String {
    let width = |column: usize| rows.iter().filter_map(|r| r.get(column)).map(|c| c.chars().count()).max();
    let mut out = String::new();
    for row in rows {
        let cells = row.iter().enumerate().map(|(k, cell)| {
            let room = " ".repeat(width(k).unwrap_or(0).saturating_sub(cell.chars().count()));
            if k == 0 || k + 1 == row.len() { format!("{cell}{room}") } else { format!("{room}{cell}") }
        });
        out.push_str(&format!("  {}\n", cells.collect::<Vec<_>>().join("  ").trim_end()));
    }
    out
}

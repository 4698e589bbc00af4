//! The page of `rigident calibrate joints`: offsets with their intervals, poses before and after, how far
//! contacts are off. No script; nothing is loaded.

mod charts;
mod content;
mod figures;
pub mod text;

use super::page::{END, beginning_with, escape, fact, notes};
use rigident_fit::Measured;
use rigident_fit::figures::{NOT_IDENTIFIED, counted, with_u95};
use rigident_identify::joint_offsets::drawn::Figure;

const STYLE: &str = "<style>.before{stroke:var(--y)}.after{stroke:var(--x)}svg \
                     .dashed{stroke-dasharray:5 4}.bone{stroke-width:2}.sole{stroke-width:3}circle.joint{fill:var(--paper);stroke:var(--x);stroke-width:1.4}.ground{stroke:var(--soft);stroke-width:1.4}.dot.before{fill:var(--y);stroke:none}.dot.after{fill:var(--x);stroke:none}.out{stroke:var(--bad);stroke-width:1.6}line.interval{stroke:var(--x);stroke-width:5;opacity:.35}line.zero{stroke:var(--soft);stroke-width:1;stroke-dasharray:2 3}svg text.ink{fill:var(--ink)}svg text.open{fill:var(--fair);font-style:italic}.key.after::before{border-color:var(--x)}.key.before::before{border-color:var(--y)}.key.cross::before{border-color:var(--bad)}</style>\n";

/// The offset of a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct OffsetRow {
    /// The joint.
    pub joint: String,
    /// True if the joint slides: then the number is in m, otherwise in rad.
    pub slides: bool,
    /// The offset, if it is identified.
    pub measured: Option<Measured>,
    /// Why it is not, in words.
    pub why: String,
}

/// A pose that is drawn before and after.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnPose {
    /// The name of the pose.
    pub name: String,
    /// With the angles as measured, and with the offsets.
    pub figures: [Figure; 2],
}

/// The deviations of the contacts of a pose, m, before and after: the largest of each contact, `None` where
/// it is not made.
#[derive(Clone, Debug, PartialEq)]
pub struct Deviations {
    /// True if the pose was left out.
    pub left_out: bool,
    /// With the angles as measured.
    pub before_m: Vec<Option<f64>>,
    /// With the offsets.
    pub after_m: Vec<Option<f64>>,
}

/// The content of the page.
#[derive(Clone, Debug, PartialEq)]
pub struct OffsetsPage {
    /// Name of the model.
    pub model: String,
    /// Name of the file of poses.
    pub source: String,
    /// The offsets.
    pub offsets: Vec<OffsetRow>,
    /// Names of the contacts.
    pub contacts: Vec<String>,
    /// All poses, in the file's order.
    pub deviations: Vec<Deviations>,
    /// Some of them.
    pub drawn: Vec<DrawnPose>,
    /// The warnings.
    pub warnings: Vec<String>,
    /// The parameters estimated along: name, whether it is a length (m, otherwise rad), value.
    pub along: Vec<(String, bool, Measured)>,
    /// Numbers that describe the fit: name and value.
    pub facts: Vec<(String, String)>,
}

/// Returns a number in degrees, or in mm where it is a length.
pub fn with_unit(measured: Measured, length: bool) -> String {
    if length {
        return with_u95(1e3 * measured.value, 1e3 * measured.u95, "mm");
    }
    format!("{}°", with_u95(measured.value.to_degrees(), measured.u95.to_degrees(), ""))
}

/// Returns the page as one self-contained HTML file.
pub fn page(found: &OffsetsPage) -> String {
    let mut html = beginning_with(&found.model, "offsets of joint angles", STYLE);
    let identified = found.offsets.iter().filter(|row| row.measured.is_some()).count();
    let all = counted(found.offsets.len(), "offset", "offsets");
    let left_out = found.deviations.iter().filter(|pose| pose.left_out).count();
    let poses = counted(found.deviations.len() - left_out, "pose", "poses");
    let class = if identified == found.offsets.len() { "good" } else { "fair" };
    html.push_str(&format!(
        "<header><h1>{}</h1>\n<p class=\"source\"><span>Offsets of joint \
         angles</span><span>{}</span><span>{poses}</span></p>\n\
         <p class=\"status {class}\">{identified} of {all} identified</p></header>\n{}",
        escape(&found.model),
        escape(&found.source),
        notes("Warnings", &found.warnings)
    ));
    html.push_str(
        "<h2>Offsets</h2>\n<p class=\"soft\">True position = measured position + offset. Bars are 95 % \
         intervals.</p>\n<div class=\"wide\">\n",
    );
    for slides in [false, true] {
        html.push_str(&charts::offsets(&found.offsets, slides));
    }
    html.push_str("</div>\n");
    html.push_str(&not_identified(&found.offsets));
    if !found.drawn.is_empty() {
        html.push_str(
            "<h2>Poses before and after</h2>\n<p class=\"soft\">From the right side and from the front. \
             Below each, its contacts against the floor, heights enlarged.<span class=\"key before\">angles \
             as measured</span><span class=\"key after\">with the offsets</span></p>\n<div \
             class=\"grid\">\n",
        );
        html.extend(found.drawn.iter().enumerate().map(|(k, pose)| figures::pose(k, pose)));
        html.push_str("</div>\n");
    }
    html.push_str(
        "<h2>Contacts before and after</h2>\n<p class=\"soft\">Largest distance of a corner from its plane, \
         or of a held point from its place, in every pose.<span class=\"key before\">angles as \
         measured</span><span class=\"key after\">with the offsets</span><span class=\"key cross\">left \
         out</span></p>\n<div class=\"grid\">\n",
    );
    html.extend((0..found.contacts.len()).map(|k| charts::deviations(found, k)));
    html.push_str("</div>\n<h2>Fit</h2>\n<table class=\"short plainrows\"><tbody>\n");
    html.extend(found.facts.iter().map(|(name, value)| fact(name, &escape(value))));
    html.extend(found.along.iter().map(|(name, length, own)| fact(name, &escape(&with_unit(*own, *length)))));
    html.push_str("</tbody></table>\n");
    html + END
}

/// Returns the joints that are not identified, with the reason.
fn not_identified(offsets: &[OffsetRow]) -> String {
    let rows: String = offsets
        .iter()
        .filter(|row| row.measured.is_none())
        .map(|row| fact(&row.joint, &escape(&row.why)))
        .collect();
    if rows.is_empty() {
        return String::new();
    }
    format!("<h3>{NOT_IDENTIFIED}</h3>\n<table class=\"plainrows\"><tbody>\n{rows}</tbody></table>\n")
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn the_page_is_well_formed_loads_nothing_and_shows_every_row() {
        let own = Measured { value: 0.01, u95: 0.002 };
        let row = |joint: &str, slides: bool, measured: Option<Measured>| OffsetRow {
            joint: joint.to_owned(),
            slides,
            measured,
            why: "it stands still <".to_owned(),
        };
        let figure = |up: f64| Figure {
            bones: vec![[Vector3::new(0.0, 0.0, 1.0), Vector3::new(0.0, 0.1, up)]],
            contacts: vec![(0, vec![Vector3::new(0.1, 0.1, up), Vector3::new(-0.1, 0.1, 0.0)])],
        };
        let found = OffsetsPage {
            model: "a < b".to_owned(),
            source: "poses.csv".to_owned(),
            offsets: vec![
                row("knee", false, Some(own)),
                row("lift", true, Some(own)),
                row("hip", false, None),
            ],
            contacts: vec!["left".to_owned()],
            deviations: vec![
                Deviations { left_out: false, before_m: vec![Some(0.02)], after_m: vec![Some(0.0)] },
                Deviations { left_out: true, before_m: vec![None], after_m: vec![None] },
            ],
            drawn: vec![DrawnPose { name: "pose & 1".to_owned(), figures: [figure(0.02), figure(0.0)] }],
            warnings: vec!["<".to_owned()],
            along: vec![("slope".to_owned(), false, own)],
            facts: vec![("ratio".to_owned(), "1".to_owned())],
        };
        let page = page(&found);
        let read = roxmltree::Document::parse_with_options(
            &page,
            roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() },
        );
        let document = read.unwrap_or_else(|e| panic!("{e}: {page}"));
        assert!(!page.contains("<script") && !page.contains("http") && !page.contains("NaN"), "{page}");
        assert!(
            page.contains("0.57 ± 0.11°")
                && page.contains("10.0 ± 2.0 mm")
                && page.contains("stands still &lt;"),
            "{page}"
        );
        let soles =
            document.descendants().filter(|n| n.attribute("class").is_some_and(|c| c.starts_with("sole")));
        assert_eq!(soles.count(), 2 * 2);
    }
}

//! A certificate of an answer: a page to print, modelled on what ISO/IEC 17025:2017 asks for in 7.8.2 and
//! 7.8.4 (docs/certificate.md lists the items). It asks for what is missing, and a draft says that it is one.

mod drawing;
mod results;

use rigident_io::rig::{CertificateTable, ImuTable, RigFile};

use super::page::{END, beginning_with, escape, fact, notes};
use super::quantities::headline;
use rigident_fit::figures::{count, duration};
use rigident_identify::answer::result::{Answer, Status};

/// Coverage factor of the expanded uncertainties on a certificate.
pub const COVERAGE_FACTOR: f64 = 2.0;

/// A file that the answer rests on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Evidence {
    /// The name of the file, without folders.
    pub name: String,
    /// The length of the file, bytes.
    pub bytes: u64,
    /// SHA-256 of its bytes, in hexadecimal digits.
    pub sha256: String,
}

/// Something that a certificate has to say and that is not stated.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Missing {
    /// The key of the rig file: `certificate.number`, `load_cell.serial`.
    pub key: &'static str,
    /// The meaning, in words.
    pub what: &'static str,
}

/// The statements of a certificate beside the answer.
#[derive(Clone, Copy, Debug)]
pub struct Certified<'a> {
    /// The laboratory's statements.
    pub table: &'a CertificateTable,
    /// The rig, with its instruments.
    pub rig: &'a RigFile,
    /// The files that the answer rests on.
    pub evidence: &'a [Evidence],
}

/// Returns why there is no certificate of an answer, if there is none.
pub fn refused(answer: &Answer) -> Option<&'static str> {
    match answer.status {
        Status::Implausible => Some("the recording cannot be true"),
        Status::Failed => Some("the experiment did not come to its end"),
        Status::NotIdentified => Some("nothing of what was asked for is identified"),
        Status::Identified | Status::PartlyIdentified => None,
    }
}

impl Certified<'_> {
    /// Returns what has to be stated and is not, in the order of the page.
    pub fn missing(&self, answer: &Answer) -> Vec<Missing> {
        let table = self.table;
        let is_there = |text: &Option<String>| text.as_ref().is_some_and(|text| !text.trim().is_empty());
        let measured = is_there(&table.measured_on) || is_there(&answer.source.recorded);
        let mut wanted = vec![
            ("certificate.number", "number of the certificate", is_there(&table.number)),
            ("certificate.laboratory", "name of the laboratory", is_there(&table.laboratory)),
            (
                "certificate.laboratory_address",
                "address of the laboratory",
                is_there(&table.laboratory_address),
            ),
            ("certificate.place", "place of the measurement", is_there(&table.place)),
            ("certificate.customer", "name of the customer", is_there(&table.customer)),
            ("certificate.customer_address", "address of the customer", is_there(&table.customer_address)),
            ("certificate.part", "what was measured", is_there(&table.part)),
            ("certificate.part_serial", "serial number or mark of the part", is_there(&table.part_serial)),
            ("certificate.measured_on", "date of the measurement", measured),
            ("certificate.procedure", "procedure", is_there(&table.procedure)),
            ("certificate.conditions", "conditions of the measurement", is_there(&table.conditions)),
            ("certificate.traceability", "traceability to the SI", is_there(&table.traceability)),
            ("certificate.operator", "who measured", is_there(&table.operator)),
            ("certificate.authorised_by", "who authorises the certificate", is_there(&table.authorised_by)),
        ];
        let cell = &self.rig.load_cell;
        let has_springs = self.rig.suspension.is_some();
        wanted.extend([
            ("load_cell.serial", "serial number of the load cell", has_springs || is_there(&cell.serial)),
            (
                "load_cell.calibrated_on",
                "calibration of the load cell",
                has_springs || is_there(&cell.calibrated_on),
            ),
        ]);
        for imu in imus(answer, self.rig) {
            wanted.extend([
                ("imu.serial", "serial number of the IMU", is_there(&imu.serial)),
                ("imu.calibrated_on", "calibration of the IMU", is_there(&imu.calibrated_on)),
            ]);
        }
        wanted
            .into_iter()
            .filter(|(_, _, there)| !there)
            .map(|(key, what, _)| Missing { key, what })
            .collect()
    }

    /// Returns the certificate as one self-contained page; `None` where [`refused`] says why there is none.
    pub fn page(&self, answer: &Answer) -> Option<String> {
        if refused(answer).is_some() {
            return None;
        }
        let missing = self.missing(answer);
        let number = self.table.number.as_deref().unwrap_or("without a number");
        let title = if missing.is_empty() { "Certificate of measurement" } else { "Draft of a certificate" };
        let head =
            format!("<style>\n{}{}</style>\n", include_str!("certificate.css"), running(title, number));
        let mut html = beginning_with(&format!("{title} {number}"), "mass properties", &head);
        html.push_str(&self.header(answer, title, number));
        html.push_str(&incomplete(&missing));
        html.push_str(&self.facts(answer));
        html.push_str(&results::html(answer, self.table));
        html.push_str(&drawing::figure(answer, self.rig, self.table.axes.as_deref()));
        html.push_str(&self.equipment(answer));
        html.push_str(&results::budget(answer, self.table));
        html.push_str(&self.basis(answer));
        html.push_str(&self.end(answer, number));
        html.push_str(END);
        Some(html)
    }

    fn header(&self, answer: &Answer, title: &str, number: &str) -> String {
        let table = self.table;
        let laboratory = [&table.laboratory, &table.laboratory_address]
            .into_iter()
            .flatten()
            .map(|line| format!("{}<br/>", escape(line)))
            .collect::<String>();
        let class = if answer.status == Status::Identified { "good" } else { "fair" };
        format!(
            "<header><p class=\"laboratory\">{laboratory}</p><h1>{title}</h1>\n\
             <p class=\"source\"><span>No. {}</span><span>mass, centre of mass and inertia \
             tensor</span></p>\n\
             <p class=\"status {class}\">{}</p></header>\n",
            escape(number),
            escape(&headline(answer))
        )
    }

    fn facts(&self, answer: &Answer) -> String {
        let table = self.table;
        let joined = |texts: &[&Option<String>]| {
            let lines: Vec<String> = texts.iter().filter_map(|t| t.as_deref()).map(escape).collect();
            (!lines.is_empty()).then(|| lines.join("<br/>"))
        };
        let measured = table.measured_on.clone().or_else(|| answer.source.recorded.as_deref().map(day));
        let issued = Some(day(&answer.date)).filter(|day| !day.is_empty());
        let required = |label: &str, value: Option<String>| {
            fact(label, &value.unwrap_or_else(|| "<span class=\"none\">not stated</span>".to_owned()))
        };
        let stated = |label: &str, value: Option<String>| value.map_or(String::new(), |v| fact(label, &v));
        let rows = [
            required("Part", joined(&[&table.part, &table.part_number])),
            required("Serial number or mark", joined(&[&table.part_serial])),
            stated("Condition", joined(&[&table.condition])),
            required("Customer", joined(&[&table.customer, &table.customer_address])),
            stated("Received on", joined(&[&table.received_on])),
            required("Measured on", measured.map(|m| escape(&m))),
            required("Measured at", joined(&[&table.place])),
            required("Measured by", joined(&[&table.operator])),
            required("Procedure", joined(&[&table.procedure])),
            stated("Deviations from it", joined(&[&table.deviations])),
            required("Conditions", joined(&[&table.conditions])),
            required("Traceability", joined(&[&table.traceability])),
            stated("Provided by others", joined(&[&table.external])),
            stated("Issued on", issued.map(|i| escape(&i))),
        ];
        format!("<table class=\"plainrows\"><tbody>\n{}</tbody></table>\n", rows.concat())
    }

    fn equipment(&self, answer: &Answer) -> String {
        let mut rows = String::new();
        let mut row =
            |name: &str, serial: Option<&str>, calibrated: Option<&str>, certificate: Option<&str>| {
                let cell = |text: Option<&str>| text.map_or("–".to_owned(), escape);
                rows.push_str(&format!(
                    "<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                    escape(name),
                    cell(serial),
                    cell(calibrated),
                    cell(certificate)
                ));
            };
        let cell = &self.rig.load_cell;
        if self.rig.suspension.is_none() {
            row("Load cell", cell.serial.as_deref(), cell.calibrated_on.as_deref(), None);
        }
        for (name, imu) in named(imus(answer, self.rig)) {
            row(&name, imu.serial.as_deref(), imu.calibrated_on.as_deref(), None);
        }
        if let Some(calibration) = self.rig.calibrated() {
            let by = format!("by the reference body {}", calibration.name);
            row("Rig", None, Some(&calibration.date), Some(&by));
        }
        for item in &self.table.equipment {
            let texts = [&item.serial, &item.calibrated_on, &item.certificate].map(Option::as_deref);
            row(&item.name, texts[0], texts[1], texts[2]);
        }
        format!(
            "<h2>Equipment</h2>\n<div class=\"scroll\"><table class=\"equipment\"><thead><tr><th \
             scope=\"col\">instrument</th><th scope=\"col\">serial number</th><th scope=\"col\">calibrated \
             on</th><th scope=\"col\">certificate</th></tr></thead>\n\
             <tbody>{rows}</tbody></table></div>\n"
        )
    }

    /// Returns what the result rests on: recording with hashes, what was known, errors counted, remarks of
    /// the evaluation.
    fn basis(&self, answer: &Answer) -> String {
        let source = &answer.source;
        let mut rows = fact("Recording", &escape(&source.recording));
        let mut samples = format!("{} samples", count(source.rows));
        if let (Some(rate_hz), Some(seconds)) = (source.rate_hz, source.duration_s) {
            samples.push_str(&format!(", {} at {rate_hz} a second", duration(seconds)));
        }
        rows.push_str(&fact("Samples", &escape(&samples)));
        for file in self.evidence {
            let words = format!("{} bytes, SHA-256 <code>{}</code>", count(file.bytes), escape(&file.sha256));
            rows.push_str(&fact(&file.name, &words));
        }
        for known in &answer.known {
            rows.push_str(&fact("Known beforehand", &escape(&known.text)));
        }
        for (basis, groups) in errors(answer) {
            rows.push_str(&fact(&format!("Errors counted, by {basis}"), &escape(&groups)));
        }
        rows.push_str(&fact("Evaluated by", &escape(concat!("Rigident ", env!("CARGO_PKG_VERSION")))));
        if !answer.date.is_empty() {
            rows.push_str(&fact("Evaluated on", &escape(&answer.date)));
        }
        let mut remarks = answer.warnings.clone();
        remarks.extend(self.table.remarks.clone());
        format!(
            "<h2>What the results rest on</h2>\n<table class=\"plainrows\"><tbody>{rows}</tbody></table>\n{}",
            notes("Remarks", &remarks)
        )
    }

    fn end(&self, answer: &Answer, number: &str) -> String {
        let signature = |role: &str, name: &Option<String>| {
            format!(
                "<div><span class=\"line\"></span>{}<br/><span class=\"soft\">{role}</span></div>",
                name.as_deref().map_or("<span class=\"none\">not stated</span>".to_owned(), escape)
            )
        };
        format!(
            "<section class=\"statements\"><h2>Statements</h2>\n<ul><li>The results relate only to the part \
             described here, in the condition in which it was measured.</li><li>{}</li><li>What is stated of customer and part is the \
             customer's, and the laboratory answers for all else.</li><li>This certificate may be reproduced \
             as a whole only, unless the laboratory agrees in writing.</li></ul>\n\
             <div class=\"signatures\">{}{}</div>\n<p class=\"soft end\">End of certificate \
             {}</p></section>\n",
            results::Expanded::of(answer).statement(),
            signature("measured by", &self.table.operator),
            signature("authorised by", &self.table.authorised_by),
            escape(number)
        )
    }
}

/// Returns the IMUs that an answer rests on: none where all errors counted are of others, as where gravity is
/// stated pose by pose.
fn imus<'a>(answer: &Answer, rig: &'a RigFile) -> &'a [ImuTable] {
    let of_imu = |group: &str| {
        matches!(group, "lever arm" | "IMU rotation")
            || group.starts_with("gyro")
            || group.starts_with("accelerometer")
    };
    let is_used = answer.errors.is_empty() || answer.errors.iter().any(|error| of_imu(&error.group));
    if is_used { &rig.imu } else { &[] }
}

/// Returns IMUs with their names.
fn named(imus: &[ImuTable]) -> impl Iterator<Item = (String, &ImuTable)> {
    let name = |k: usize| if imus.len() == 1 { "IMU".to_owned() } else { format!("IMU {}", k + 1) };
    imus.iter().enumerate().map(move |(k, imu)| (name(k), imu))
}

/// Returns the day of a date and time.
fn day(date: &str) -> String {
    date.split('T').next().unwrap_or(date).to_owned()
}

/// Says what is missing, and where to state it.
fn incomplete(missing: &[Missing]) -> String {
    if missing.is_empty() {
        return String::new();
    }
    let items: String = missing
        .iter()
        .map(|m| format!("<li>{} <code>{}</code></li>", escape(m.what), escape(m.key)))
        .collect();
    format!(
        "<section class=\"box\"><h3>Draft: no certificate before this is stated in the rig file</h3><ul \
         class=\"missing\">{items}</ul></section>\n"
    )
}

/// Returns each key or class that errors were counted by, and which these are.
fn errors(answer: &Answer) -> Vec<(String, String)> {
    let mut found: Vec<(String, Vec<&str>)> = Vec::new();
    for error in &answer.errors {
        let basis = if error.stated { error.basis.clone() } else { format!("{}, a default", error.basis) };
        match found.iter_mut().find(|(known, _)| *known == basis) {
            Some((_, groups)) if groups.contains(&error.group.as_str()) => {}
            Some((_, groups)) => groups.push(&error.group),
            None => found.push((basis, vec![&error.group])),
        }
    }
    found.into_iter().map(|(basis, groups)| (basis, groups.join(", "))).collect()
}

/// Returns the lines at the foot of each printed page.
fn running(title: &str, number: &str) -> String {
    format!(
        "@page \
         {{ @bottom-left {{ content: {}; }} @bottom-right {{ content: \"page \" counter(page) \" of \" counter(pages); }} }}\n",
        css_text(&format!("{title} {number}"))
    )
}

/// Returns a text as CSS writes it: all but plain characters by their number, so that none ends the text or
/// the style sheet.
fn css_text(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, ' ' | '-' | '.' | '_');
    let shown = |c: char| if plain(c) { c.to_string() } else { format!("\\{:x} ", u32::from(c)) };
    format!("\"{}\"", text.chars().map(shown).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_number_ends_the_style_sheet() {
        let said = running("Certificate", "7\"; } </style><script>");
        assert!(!said.contains('<') && said.matches('"').count() == 6, "{said}");
    }

    #[test]
    fn unusable_answers_have_no_certificate() {
        let (table, rig) = (CertificateTable::default(), RigFile::default());
        let certified = Certified { table: &table, rig: &rig, evidence: &[] };
        for status in [Status::Implausible, Status::Failed, Status::NotIdentified] {
            let answer = Answer { status, ..Answer::default() };
            assert!(certified.page(&answer).is_none() && refused(&answer).is_some());
        }
        let answer = Answer { status: Status::Identified, ..Answer::default() };
        let page = certified.page(&answer).unwrap();
        let missing = certified.missing(&answer);
        assert_eq!(missing.len(), 16);
        assert!(missing.iter().all(|m| page.contains(m.key)) && page.contains("Draft of a certificate"));
    }
}

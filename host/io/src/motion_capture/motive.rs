//! OptiTrack Motive's CSV: measured markers of a take.
//!
//! A line of names and values (rates, unit); rows that say for each column its type, the name of the marker
//! and what it is, `Position`; a row `Frame, Time (Seconds), X, Y, Z, …`; then frames, cells blank where a
//! marker was not seen. Columns of solved bodies and bones are left out, and so are fragments of markers that
//! nobody has named.

use std::io::Read;

use csv::StringRecord;

use super::frames::{at_its_time, rename_equal};

/// The words that a file begins with.
pub const FIRST: &str = "Format Version";
/// Fragments of markers without a name begin so.
const UNNAMED: &str = "Unlabeled";
/// Rows of names above the frames.
const MOST_HEADERS: usize = 16;

/// The reason that a file is no take with markers.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MotiveError {
    /// It is no table.
    #[error("it cannot be read: {0}")]
    Unreadable(String),
    /// It lacks something; with the advice.
    #[error("{0}")]
    Missing(String),
    /// A line is wrong.
    #[error("line {line}: {what}")]
    Line {
        /// The line, from 1.
        line: u64,
        /// The fault.
        what: String,
    },
}

/// Markers of a take, in its axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Take {
    /// Frames per second.
    pub rate_hz: f64,
    /// Time of the first frame, s.
    pub first_s: f64,
    /// Names of the markers.
    pub labels: Vec<String>,
    /// Markers of one frame after another, m; NaN where one was not seen.
    pub points_m: Vec<[f32; 3]>,
    /// The notes.
    pub notes: Vec<String>,
}

impl Take {
    /// Reads a take.
    ///
    /// # Errors
    /// [`MotiveError`] says what is missing or wrong.
    pub fn read(reader: impl Read) -> Result<Self, MotiveError> {
        let mut csv = csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(reader);
        let mut records = csv.records();
        let mut next =
            move || records.next().transpose().map_err(|error| MotiveError::Unreadable(error.to_string()));
        let first = next()?.unwrap_or_default();
        let (rate_hz, metre) = settings(&first)?;
        let (places, mut take) = Self::head(&mut next, rate_hz)?;
        let mut frames = 0_usize;
        while let Some(record) = next()? {
            if record.iter().any(|cell| !cell.trim().is_empty()) {
                take.frame(&record, (&places, metre), frames)?;
                frames += 1;
            }
        }
        take.points_m.shrink_to_fit();
        Ok(take)
    }

    /// Reads the rows above the frames; returns the first column of each marker.
    fn head(
        next: &mut impl FnMut() -> Result<Option<StringRecord>, MotiveError>,
        rate_hz: f64,
    ) -> Result<(Vec<usize>, Self), MotiveError> {
        let mut rows: Vec<StringRecord> = Vec::new();
        let axes = loop {
            let Some(row) = next()? else { return Err(without_frames()) };
            if row.get(0).is_some_and(|cell| cell.trim().eq_ignore_ascii_case("frame")) {
                break row;
            }
            if rows.len() == MOST_HEADERS {
                return Err(without_frames());
            }
            if row.iter().any(|cell| !cell.trim().is_empty()) {
                rows.push(row);
            }
        };
        let [types, names, .., kinds] = rows.as_slice() else { return Err(without_frames()) };
        let cell = |row: &StringRecord, k: usize| row.get(k).unwrap_or_default().trim().to_owned();
        let mut places = Vec::new();
        let mut take =
            Self { rate_hz, first_s: 0.0, labels: Vec::new(), points_m: Vec::new(), notes: Vec::new() };
        let mut unnamed = 0;
        for k in 2..axes.len() {
            let is_marker = cell(types, k) == "Marker" && cell(kinds, k).eq_ignore_ascii_case("position");
            let whole = [0, 1, 2].map(|axis| cell(&axes, k + axis));
            if !is_marker || whole != ["X", "Y", "Z"] {
                continue;
            }
            let name = cell(names, k);
            // Of a name only what follows its last colon is read: before it may be a person's.
            let label = name.rsplit(':').next().unwrap_or_default().trim().to_owned();
            if label.is_empty() || label.starts_with(UNNAMED) {
                unnamed += 1;
                continue;
            }
            places.push(k);
            take.labels.push(label);
        }
        rename_equal(&mut take.labels, &mut take.notes);
        if places.is_empty() {
            return Err(MotiveError::Missing(
                "it has no measured markers with names, columns of the type Marker: label them, and export \
                 with markers"
                    .to_owned(),
            ));
        }
        if unnamed > 0 {
            take.notes.push(format!("{unnamed} fragments of markers without a name are left out"));
        }
        Ok((places, take))
    }

    /// Adds the markers of a frame.
    fn frame(
        &mut self,
        record: &StringRecord,
        (places, metre): (&[usize], f64),
        frames: usize,
    ) -> Result<(), MotiveError> {
        let line = record.position().map_or(0, csv::Position::line);
        let wrong = |what: String| MotiveError::Line { line, what };
        let number = |k: usize, what: &str| {
            let text = record.get(k).unwrap_or_default().trim();
            if text.is_empty() {
                return Ok(f64::NAN);
            }
            text.parse::<f64>().map_err(|_| wrong(format!("{what} is {text:?}, no number")))
        };
        let time = number(1, "the time")?;
        if frames == 0 && time.is_finite() {
            self.first_s = time;
        }
        at_its_time(frames, time, self.first_s, self.rate_hz)
            .map_err(|what| wrong(format!("{what}: export every frame")))?;
        for (k, label) in places.iter().zip(&self.labels) {
            let own = [0, 1, 2].map(|axis| number(k + axis, label));
            let [x, y, z] = own;
            let point = [x?, y?, z?].map(|v| (metre * v) as f32);
            let is_seen = point.iter().all(|v| v.is_finite());
            self.points_m.push(if is_seen { point } else { [f32::NAN; 3] });
        }
        Ok(())
    }
}

fn without_frames() -> MotiveError {
    MotiveError::Missing(
        "it has no rows Type, Name and Position above a row that begins with Frame: export it with its \
         header"
            .to_owned(),
    )
}

/// Reads rate and unit in the first line: names, each with its value behind it.
fn settings(first: &StringRecord) -> Result<(f64, f64), MotiveError> {
    let cells: Vec<&str> = first.iter().map(|cell| cell.trim_start_matches('\u{feff}').trim()).collect();
    if cells.first() != Some(&FIRST) {
        return Err(MotiveError::Missing(format!(
            "a CSV is a trial if OptiTrack's Motive wrote it, and this one does not begin with {FIRST}: give \
             such a one, or .c3d or .trc"
        )));
    }
    let value =
        |name: &str| cells.chunks(2).find(|pair| pair[0] == name).and_then(|pair| pair.get(1).copied());
    let rate = value("Export Frame Rate").or_else(|| value("Capture Frame Rate")).unwrap_or_default();
    let rate_hz =
        rate.parse::<f64>().ok().filter(|rate| rate.is_finite() && *rate > 0.0).ok_or_else(|| {
            MotiveError::Missing(format!("Export Frame Rate is {rate:?} in its first line, no rate"))
        })?;
    let metre = match value("Length Units").unwrap_or_default() {
        "Meters" => 1.0,
        "Centimeters" => 1e-2,
        "Millimeters" => 1e-3,
        other => {
            return Err(MotiveError::Missing(format!(
                "Length Units is {other:?} in its first line, none of Meters, Centimeters and Millimeters"
            )));
        }
    };
    Ok((rate_hz, metre))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "Format Version,1.23,Take Name,\"walk, 1\",Capture Frame Rate,100.000000,Export Frame \
                        Rate,100.000000,Length Units,Millimeters,Coordinate Space,Global\n\n";
    const ROWS: &str = ",Type,,Rigid Body,Marker,Marker,Marker,Marker,Marker,Marker,Marker,Marker,Marker\n\
                        ,Name,,Plate,Anna:LASI,Anna:LASI,Anna:LASI,Unlabeled 7,Unlabeled 7,Unlabeled \
                        7,\"Anna:RASI\",\"Anna:RASI\",\"Anna:RASI\"\n\
                        ,ID,,1,2,2,2,3,3,3,4,4,4\n\
                        ,,,Rotation,Position,Position,Position,Position,Position,Position,Position,Position,\
                        Position\n\
                        Frame,Time (Seconds),TimeCode,X,X,Y,Z,X,Y,Z,X,Y,Z\n";

    fn read(text: &str) -> Result<Take, String> {
        Take::read(text.as_bytes()).map_err(|error| error.to_string())
    }

    #[test]
    fn named_markers_are_read_in_metres_and_gaps_stay_open() {
        let text = format!("\u{feff}{HEAD}{ROWS}0,0.00,0:0,9,1,2,3,,,,4,5,6\n1,0.01,0:1,9,,,,7,7,7,4,5,7\n");
        let take = read(&text).unwrap();
        assert_eq!(
            (take.labels.as_slice(), take.rate_hz),
            (&["LASI".to_owned(), "RASI".to_owned()][..], 100.0)
        );
        assert_eq!(take.points_m[..2], [[1e-3, 2e-3, 3e-3], [4e-3, 5e-3, 6e-3]]);
        assert!(take.points_m[2][0].is_nan() && take.points_m[3][2] == 7e-3);
        assert!(take.notes[0].contains("1 fragments"), "{:?}", take.notes);
    }

    #[test]
    fn faults_are_named_with_their_line() {
        let whole = format!("{HEAD}{ROWS}0,0.00,,9,1,2,3,,,,4,5,6\n");
        for (text, words) in [
            (whole.replace("Millimeters", "Feet"), "Length Units is \"Feet\""),
            (whole.replace("Export Frame Rate,100.000000", "Export Frame Rate,fast"), "\"fast\""),
            (whole.replace("0,0.00,,9,1", "0,0.00,,9,one"), "line 8: LASI is \"one\""),
            (format!("{whole}5,0.05,,9,1,2,3,,,,4,5,6\n"), "frame 2 is at 0.05 s"),
            (whole.replace(",Marker", ",Bone Marker"), "no measured markers"),
            (HEAD.to_owned(), "row that begins with Frame"),
            ("t_s,fx_n\n0,1\n".to_owned(), "does not begin with Format Version"),
            (String::new(), "does not begin with Format Version"),
        ] {
            let said = read(&text).unwrap_err();
            assert!(said.contains(words), "{said}");
        }
    }
}

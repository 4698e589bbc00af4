//! Recordings as CSV.

use std::fmt::Write as _;

use super::recording::{ImuColumns, Recording, RecordingError};
use super::rig::{RigFile, WrenchSign};

const WRENCH: [&str; 6] = ["fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"];
const ACCEL: [&str; 3] = ["ax_mps2", "ay_mps2", "az_mps2"];
const GYRO: [&str; 3] = ["gx_radps", "gy_radps", "gz_radps"];
const GRAVITY: [&str; 3] = ["gx_mps2", "gy_mps2", "gz_mps2"];
const GAUGES: [&str; 6] = ["g1_v", "g2_v", "g3_v", "g4_v", "g5_v", "g6_v"];
const PLATFORM: [&str; 7] = ["x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"];
const ATTITUDE: [&str; 4] = ["w", "x", "y", "z"];
/// More IMUs or attitudes than this are a slip of the pen.
const MOST_LINKS: usize = 64;

/// The names of a group of columns, with a prefix.
fn names<const K: usize>(prefix: &str, group: [&str; K]) -> [String; K] {
    group.map(|name| format!("{prefix}{name}"))
}

struct Table<'a> {
    name: &'a str,
    rig: &'a RigFile,
    header: Vec<String>,
    /// Cells by column.
    cells: Vec<Vec<String>>,
    lines: Vec<u64>,
    used: Vec<bool>,
}

impl Table<'_> {
    fn error(&self, reason: impl Into<String>) -> RecordingError {
        RecordingError::Columns { name: self.name.to_owned(), reason: reason.into() }
    }

    /// Index and scale of a known column.
    fn find(&self, known: &str) -> Option<(usize, f64)> {
        let (name, scale) = self.rig.recording.columns.get(known).map_or((known, 1.0), |c| c.parts());
        self.header.iter().position(|h| h == name).map(|i| (i, scale))
    }

    fn number(&self, column: usize, row: usize, scale: f64) -> Result<f64, RecordingError> {
        let cell = self.cells[column][row].as_str();
        let at =
            |reason: String| RecordingError::At { name: self.name.to_owned(), line: self.lines[row], reason };
        let header = &self.header[column];
        let value: f64 =
            cell.trim().parse().map_err(|_| at(format!("column {header} holds {cell:?}, not a number")))?;
        if !value.is_finite() {
            return Err(at(format!(
                "column {header} holds {cell}: remove the row, or the column, or mend the number"
            )));
        }
        // Multiplying by one would change nothing but the sign of a zero.
        Ok(if scale == 1.0 { value } else { value * scale })
    }

    /// A group of columns: all of them, or none.
    fn group<const K: usize>(
        &mut self,
        wanted: &[String; K],
    ) -> Result<Option<Vec<[f64; K]>>, RecordingError> {
        let found = wanted.each_ref().map(|name| self.find(name));
        if found.iter().all(Option::is_none) {
            return Ok(None);
        }
        let mut columns = [(0, 1.0); K];
        for ((slot, found), name) in columns.iter_mut().zip(found).zip(wanted) {
            *slot = found.ok_or_else(|| {
                self.error(format!(
                    "column {name} is missing beside {}: add it, or name it in [recording] columns",
                    {
                        let others: Vec<_> =
                            wanted.iter().filter(|n| self.find(n).is_some()).cloned().collect();
                        others.join(", ")
                    }
                ))
            })?;
        }
        for (column, _) in columns {
            self.used[column] = true;
        }
        (0..self.lines.len())
            .map(|row| {
                let mut values = [0.0; K];
                for (value, (column, scale)) in values.iter_mut().zip(columns) {
                    *value = self.number(column, row, scale)?;
                }
                Ok(values)
            })
            .collect::<Result<Vec<_>, _>>()
            .map(Some)
    }
}

/// A known quantity, without its unit: `fx`, `imu0_ax`, …
fn quantity(known: &str) -> Option<&str> {
    known.rsplit_once('_').map(|(quantity, _)| quantity)
}

/// Why a column that is not known is an error: it is a known quantity in another unit.
fn wrong_unit(header: &str) -> Option<String> {
    let (stem, _) = header.rsplit_once('_')?;
    let plain = if let Some(rest) = stem.strip_prefix("imu") {
        rest.trim_start_matches(|c: char| c.is_ascii_digit()).strip_prefix('_')?
    } else {
        stem
    };
    let is_imu = plain != stem;
    let candidates: Vec<&str> = if is_imu {
        ACCEL.iter().chain(&GYRO).copied().collect()
    } else {
        WRENCH.iter().chain(&GRAVITY).chain(&GAUGES).chain(&PLATFORM[..3]).chain(&["t_s"]).copied().collect()
    };
    let known = candidates.into_iter().find(|k| quantity(k) == Some(plain))?;
    let prefix = if is_imu { &stem[..stem.len() - plain.len()] } else { "" };
    if header == format!("{prefix}{known}") {
        return None;
    }
    Some(format!(
        "column {header} has an unknown unit: it must be {prefix}{known}, or be named with its scale in \
         [recording] columns = {{ {prefix}{known} = {{ name = \"{header}\", scale = … }} }}"
    ))
}

impl Recording {
    /// Reads the bytes of a CSV file.
    ///
    /// # Errors
    /// [`RecordingError`] with line and column.
    pub fn from_csv_bytes(name: &str, bytes: &[u8], rig: &RigFile) -> Result<Self, RecordingError> {
        let not =
            |reason: &str| RecordingError::NotARecording { name: name.to_owned(), reason: reason.to_owned() };
        let text = std::str::from_utf8(bytes).map_err(|_| not("it is not text"))?;
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut comments = Vec::new();
        let mut skipped = 0;
        let mut body = text;
        while let Some(rest) = body.strip_prefix('#') {
            let (line, after) = rest.split_once('\n').unwrap_or((rest, ""));
            if let Some((key, value)) = line.split_once('=') {
                comments.push((key.trim().to_owned(), value.trim().trim_end_matches('\r').to_owned()));
            }
            (body, skipped) = (after, skipped + 1);
        }
        let mut reader =
            csv::ReaderBuilder::new().flexible(true).trim(csv::Trim::All).from_reader(body.as_bytes());
        let at = |line: u64, reason: String| RecordingError::At { name: name.to_owned(), line, reason };
        let header: Vec<String> =
            reader.headers().map_err(|e| not(&e.to_string()))?.iter().map(str::to_owned).collect();
        if header.len() < 2 {
            return Err(not("it has no header row with names separated by commas"));
        }
        for (i, column) in header.iter().enumerate() {
            if header[..i].contains(column) {
                return Err(RecordingError::Columns {
                    name: name.to_owned(),
                    reason: format!("column {column} stands there twice: rename one"),
                });
            }
        }
        let mut table = Table {
            name,
            rig,
            used: vec![false; header.len()],
            cells: vec![Vec::new(); header.len()],
            header,
            lines: Vec::new(),
        };
        for record in reader.records() {
            let record = record.map_err(|e| {
                at(e.position().map_or(0, |p| p.line()) + skipped, format!("not a row of a CSV file: {e}"))
            })?;
            let line = record.position().map_or(0, csv::Position::line) + skipped;
            if record.len() != table.header.len() {
                return Err(at(
                    line,
                    format!(
                        "the row has {} values, the header {}: was the file cut off?",
                        record.len(),
                        table.header.len()
                    ),
                ));
            }
            table.lines.push(line);
            for (column, cell) in table.cells.iter_mut().zip(&record) {
                column.push(cell.to_owned());
            }
        }
        if table.lines.is_empty() {
            return Err(not("it has a header and no rows"));
        }
        table.into_recording(comments)
    }
}

impl Table<'_> {
    fn into_recording(mut self, comments: Vec<(String, String)>) -> Result<Recording, RecordingError> {
        for (known, source) in &self.rig.recording.columns {
            let (name, _) = source.parts();
            if !self.header.iter().any(|h| h == name) {
                return Err(self.error(format!(
                    "the rig file names column {name:?} for {known}, and there is none: the columns are {}",
                    self.header.join(", ")
                )));
            }
        }
        let named: Vec<&str> = self.rig.recording.columns.values().map(|c| c.parts().0).collect();
        let slip = self.header.iter().filter(|h| !named.contains(&h.as_str())).find_map(|h| wrong_unit(h));
        if let Some(reason) = slip {
            return Err(self.error(reason));
        }
        let is_static = self.rig.recording.is_static;
        let time_ns = if is_static { Vec::new() } else { self.times()? };
        let wrench = self.group(&names("", WRENCH))?.map(|rows| match self.rig.recording.wrench_sign {
            WrenchSign::OnBody => rows,
            WrenchSign::OnSensor => rows.into_iter().map(|w| w.map(|v| -v)).collect(),
        });
        let gravity = self.group(&names("", GRAVITY))?;
        let gauges = self.group(&names("", GAUGES))?;
        let platform = self.group(&names("", PLATFORM))?;
        let commanded = self.group(&names("cmd_", PLATFORM))?;
        let mut imus = Vec::new();
        let mut attitudes = Vec::new();
        for j in 0..MOST_LINKS {
            let mut prefix = format!("imu{j}_");
            let mut columns = ImuColumns {
                accel: self.group(&names(&prefix, ACCEL))?,
                gyro: self.group(&names(&prefix, GYRO))?,
            };
            if j == 0 {
                prefix = "imu_".to_owned();
                columns.accel = columns.accel.or(self.group(&names(&prefix, ACCEL))?);
                columns.gyro = columns.gyro.or(self.group(&names(&prefix, GYRO))?);
            }
            if columns != ImuColumns::default() {
                imus.resize(j, ImuColumns::default());
                imus.push(columns);
            }
            if let Some(rows) = self.group(&names(&format!("q{j}_"), ATTITUDE))? {
                attitudes.push((j, rows));
            }
        }
        let mut extra = Vec::new();
        for (i, header) in self.header.iter().enumerate() {
            if self.used[i] || (is_static && header == "t_s") {
                continue;
            }
            extra.push((header.clone(), self.cells[i].clone()));
        }
        let mut warnings = Vec::new();
        let rate_hz = (!is_static).then(|| measured_rate(&time_ns)).flatten();
        if let (Some(measured), Some(stated)) = (rate_hz, self.rig.recording.rate_hz)
            && (measured / stated - 1.0).abs() > 0.02
        {
            return Err(self.error(format!(
                "the times make {measured:.6} rows per second, the rig file says rate_hz = {stated}: correct \
                 rate_hz, or the unit of t_s (its scale in [recording] columns)"
            )));
        }
        if let Some(rate) = rate_hz {
            let period = 1e9 / rate;
            let gaps = time_ns.windows(2).filter(|w| (w[1] - w[0]) as f64 > 1.5 * period).count();
            if gaps > 0 {
                warnings.push(format!("{gaps} gaps in time; the filter starts anew after each"));
            }
        }
        Ok(Recording {
            name: self.name.to_owned(),
            rig: self.rig.clone(),
            is_static,
            time_ns,
            rate_hz,
            wrench,
            imus,
            gravity,
            gauges,
            platform,
            commanded,
            attitudes,
            extra,
            comments,
            warnings,
        })
    }

    fn times(&mut self) -> Result<Vec<u64>, RecordingError> {
        let Some((column, scale)) = self.find("t_s") else {
            return Err(self.error(
                "there is no column t_s: name the time column in [recording] columns, or say static = true if \
                 every row is a still pose",
            ));
        };
        self.used[column] = true;
        let mut times: Vec<u64> = Vec::with_capacity(self.lines.len());
        for row in 0..self.lines.len() {
            let seconds = self.number(column, row, scale)?;
            let at = |reason: String| RecordingError::At {
                name: self.name.to_owned(),
                line: self.lines[row],
                reason,
            };
            if !(0.0..1e10).contains(&seconds) {
                return Err(at(format!(
                    "time {seconds} s: times are seconds from zero on (see scale in [recording] columns)"
                )));
            }
            let ns = (seconds * 1e9).round() as u64;
            if let Some(last) = times.last().filter(|last| **last >= ns) {
                return Err(at(format!(
                    "time runs backwards or stands still: {:.9} s after {:.9} s; sort the rows, or split the \
                     file where the clock restarts",
                    ns as f64 * 1e-9,
                    *last as f64 * 1e-9
                )));
            }
            times.push(ns);
        }
        Ok(times)
    }
}

/// Rows per second: from the median step, refined by the mean of the steps like it.
pub(super) fn measured_rate(time_ns: &[u64]) -> Option<f64> {
    let mut steps: Vec<u64> = time_ns.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_unstable();
    let median = *steps.get(steps.len() / 2)? as f64;
    let alike: Vec<f64> =
        steps.iter().map(|s| *s as f64).filter(|s| (s / median - 1.0).abs() < 0.5).collect();
    Some(1e9 * alike.len() as f64 / alike.iter().sum::<f64>())
}

impl Recording {
    /// The text of a CSV file that holds the recording without loss, in SI units, on-body sign, own names.
    pub fn to_csv(&self) -> String {
        let mut columns: Vec<(String, Vec<String>)> = Vec::new();
        if !self.is_static {
            columns.push(("t_s".to_owned(), self.time_ns.iter().map(|t| seconds(*t)).collect()));
        }
        add(&mut columns, "", WRENCH, self.wrench.as_ref());
        for (j, imu) in self.imus.iter().enumerate() {
            let prefix = if j == 0 { "imu_".to_owned() } else { format!("imu{j}_") };
            add(&mut columns, &prefix, ACCEL, imu.accel.as_ref());
            add(&mut columns, &prefix, GYRO, imu.gyro.as_ref());
        }
        add(&mut columns, "", GRAVITY, self.gravity.as_ref());
        add(&mut columns, "", GAUGES, self.gauges.as_ref());
        add(&mut columns, "", PLATFORM, self.platform.as_ref());
        add(&mut columns, "cmd_", PLATFORM, self.commanded.as_ref());
        for (j, rows) in &self.attitudes {
            add(&mut columns, &format!("q{j}_"), ATTITUDE, Some(rows));
        }
        columns.extend(self.extra.iter().cloned());
        let mut text = String::new();
        for (key, value) in &self.comments {
            let _ = writeln!(text, "# {key} = {value}");
        }
        let mut writer = csv::Writer::from_writer(Vec::new());
        // Writing into memory has no way to fail.
        let _ = writer.write_record(columns.iter().map(|(name, _)| name.as_str()));
        for row in 0..self.rows() {
            let _ = writer
                .write_record(columns.iter().map(|(_, cells)| cells.get(row).map_or("", String::as_str)));
        }
        text + &writer.into_inner().map(|b| String::from_utf8_lossy(&b).into_owned()).unwrap_or_default()
    }
}

/// Adds a group's columns, every number with as many digits as it takes to read it back.
fn add<const K: usize>(
    columns: &mut Vec<(String, Vec<String>)>,
    prefix: &str,
    group: [&str; K],
    rows: Option<&Vec<[f64; K]>>,
) {
    for (k, name) in group.into_iter().enumerate() {
        if let Some(rows) = rows {
            columns.push((format!("{prefix}{name}"), rows.iter().map(|r| format!("{:?}", r[k])).collect()));
        }
    }
}

/// Nanoseconds as seconds, exactly.
fn seconds(ns: u64) -> String {
    format!("{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,imu_ax_mps2,imu_ay_mps2,imu_az_mps2,\
                          imu_gx_radps,imu_gy_radps,imu_gz_radps,lamp\n";

    fn text(rows: usize) -> String {
        let mut text = String::from("# operator = A. N. Other\n") + HEADER;
        for n in 0..rows {
            let _ = writeln!(
                text,
                "{:?},1.5,-2,3e2,0.1,{:?},0,0,0.25,9.81,0,1e-5,0,on",
                n as f64 * 0.005,
                n as f64 / 3.0
            );
        }
        text
    }

    fn read(text: &str, rig: &str) -> Result<Recording, RecordingError> {
        Recording::from_csv_bytes("test", text.as_bytes(), &RigFile::parse(rig).unwrap())
    }

    #[test]
    fn what_is_written_is_read_to_the_last_bit() {
        let recording = read(&text(50), "").unwrap();
        assert_eq!(recording.rows(), 50);
        assert!((recording.rate_hz.unwrap() - 200.0).abs() < 1e-6);
        assert_eq!(recording.extra[0].0, "lamp");
        assert_eq!(recording.comments, [("operator".to_owned(), "A. N. Other".to_owned())]);
        assert_eq!(read(&recording.to_csv(), "").unwrap(), recording);
    }

    #[test]
    fn foreign_columns_units_and_signs_are_brought_into_the_notation() {
        let foreign = text(10).replace("fx_n", "Fx").replace("t_s", "time");
        let rig = "[recording]\nwrench_sign = \"on_sensor\"\ncolumns = { fx_n = \"Fx\", t_s = { name = \"time\", scale = 1e-3 } }";
        let recording = read(&foreign, rig).unwrap();
        assert_eq!(recording.wrench.unwrap()[0][..3], [-1.5, 2.0, -300.0]);
        assert_eq!(recording.time_ns[1], 5_000);
    }

    /// Each kind of bad input, and the words that its message must hold.
    #[test]
    fn bad_input_is_named_with_its_place() {
        let good = text(10);
        let line = |n: usize, from: &str, to: &str| {
            let mut lines: Vec<_> = good.lines().map(str::to_owned).collect();
            lines[n] = lines[n].replace(from, to);
            lines.join("\n")
        };
        for (text, rig, words) in [
            (String::new(), "", "not a recording"),
            ("\u{0}PNG".to_owned(), "", "not a recording"),
            (HEADER.to_owned(), "", "no rows"),
            (good.replace("my_nm,", ""), "", "line"),
            (good.replace("my_nm", "torque"), "", "my_nm is missing"),
            (good.replace("fx_n", "fx_lbf"), "", "fx_lbf has an unknown unit: it must be fx_n"),
            (HEADER.replace("lamp", "gx_g") + "0,1,1,1,1,1,1,1,1,1,1,1,1,1\n", "", "unknown unit"),
            (HEADER.replace("lamp", "imu1_ax_g") + "0,1,1,1,1,1,1,1,1,1,1,1,1,1\n", "", "imu1_ax_mps2"),
            (good.replace("t_s", "time_h"), "", "no column t_s"),
            (good.replace("lamp", "fx_n"), "", "twice"),
            (line(4, "3e2", "NaN"), "", "line 5: column fz_n holds NaN"),
            (line(4, "3e2", "inf"), "", "line 5: column fz_n holds inf"),
            (line(4, "3e2", "n/a"), "", "not a number"),
            (line(4, "0.01,", "0.002,"), "", "line 5: time runs backwards"),
            (line(6, ",on", ""), "", "line 7: the row has 13 values, the header 14"),
            (good.clone(), "[recording]\nrate_hz = 100", "rate_hz = 100"),
            (good.clone(), "[recording]\ncolumns = { fx_n = \"Fx\" }", "\"Fx\""),
        ] {
            let error = read(&text, rig).expect_err(words).to_string();
            assert!(error.contains(words), "{words}: {error}");
        }
    }

    #[test]
    fn mutated_files_never_panic() {
        let good = text(6).into_bytes();
        let rig = RigFile::default();
        let mut state = 88_172_645_463_325_252_u64;
        for _ in 0..20_000 {
            let mut bytes = good.clone();
            for _ in 0..4 {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                let position = state as usize % bytes.len();
                bytes[position] = (state >> 32) as u8;
            }
            let _ = Recording::from_csv_bytes("x", &bytes, &rig);
        }
    }
}

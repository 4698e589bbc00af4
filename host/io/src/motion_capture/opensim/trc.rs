//! TRC: markers as tab-separated text.
//!
//! Three lines of header, of which the second names and the third gives rates, counts and the unit; one line
//! of marker names, one of axes; then frames: number, time, three coordinates a marker, blank where one was
//! not seen.

use std::io::BufRead;

use super::error::{OpenSimError, at, number};
use super::lines::Lines;
use crate::motion_capture::frames::at_its_time;
use crate::motion_capture::ground::with_room;

/// Markers of a TRC file, in its axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Trc {
    /// Frames per second.
    pub rate_hz: f64,
    /// Time of the first frame, s.
    pub first_s: f64,
    /// Names of the markers.
    pub labels: Vec<String>,
    /// Markers of one frame after another, m; NaN where one was not seen.
    pub points_m: Vec<[f32; 3]>,
}

/// The reader of the frames of a file.
pub struct Frames<R> {
    lines: Lines<R>,
    header: Header,
}

impl<R> Frames<R> {
    /// Returns how many frames the header tells of.
    pub fn count(&self) -> usize {
        self.header.frames
    }
}

struct Header {
    rate_hz: f64,
    frames: usize,
    markers: usize,
    metre: f64,
}

impl Trc {
    /// Reads a text.
    ///
    /// # Errors
    /// It is no TRC file, is cut off, or contradicts itself.
    pub fn parse(text: &str) -> Result<Self, OpenSimError> {
        let (trc, frames) = Self::open(text.as_bytes())?;
        trc.read(frames)
    }

    /// Reads the header of a file, and returns it as a recording without frames, with what reads them.
    ///
    /// # Errors
    /// See [`Trc::parse`].
    pub fn open<R: BufRead>(reader: R) -> Result<(Self, Frames<R>), OpenSimError> {
        let mut lines = Lines::new(reader);
        let (header, trc) = Self::head(&mut lines)?;
        Ok((trc, Frames { lines, header }))
    }

    /// Reads the frames of a file.
    ///
    /// # Errors
    /// See [`Trc::parse`].
    pub fn read(mut self, file: Frames<impl BufRead>) -> Result<Self, OpenSimError> {
        let Frames { mut lines, header } = file;
        let trc = &mut self;
        let mut frames = 0;
        while let Some((line, text)) = lines.next_filled()? {
            let time = trc.frame(text, line, header.metre)?;
            if frames == 0 {
                trc.first_s = time;
            }
            at_its_time(frames, time, trc.first_s, trc.rate_hz).map_err(|what| at(line, what))?;
            frames += 1;
        }
        if frames != header.frames {
            return Err(OpenSimError::Missing(format!(
                "{frames} frames, and the header says {}: the file is cut off, or its header is of another",
                header.frames
            )));
        }
        self.points_m.shrink_to_fit();
        Ok(self)
    }

    /// Reads what comes before the frames.
    fn head(lines: &mut Lines<impl BufRead>) -> Result<(Header, Self), OpenSimError> {
        let mut next = |what: &str| -> Result<(usize, String), OpenSimError> {
            let line = lines.next()?.map(|(line, text)| (line, text.to_owned()));
            line.ok_or_else(|| OpenSimError::Missing(format!("the file ends before {what}")))
        };
        let (line, first) = next("the first line of the header")?;
        if !first.trim_start().starts_with("PathFileType") {
            return Err(at(line, "no TRC file: it does not begin with PathFileType"));
        }
        let (_, names) = next("the names of the header")?;
        let (line, values) = next("the values of the header")?;
        let header = Header::parse(&names, &values, line)?;
        let (line, names) = next("the names of the markers")?;
        let labels: Vec<String> = names
            .split('\t')
            .skip(2)
            .map(str::trim)
            .filter(|name| !name.is_empty())
            .map(|name| name.rsplit(':').next().unwrap_or_default().to_owned())
            .collect();
        if labels.len() != header.markers {
            return Err(at(
                line,
                format!("{} names of markers, the header says {}", labels.len(), header.markers),
            ));
        }
        next("the names of the axes")?;
        let points_m = with_room(header.frames.saturating_mul(header.markers));
        let trc = Self { rate_hz: header.rate_hz, first_s: 0.0, labels, points_m };
        Ok((header, trc))
    }

    /// Adds the markers of a frame and returns its time, s.
    fn frame(&mut self, text: &str, line: usize, metre: f64) -> Result<f64, OpenSimError> {
        let mut cells = text.split('\t').skip(1);
        let time = number(cells.next().unwrap_or_default(), line, "the time")?;
        let mut cell = || -> Result<f32, OpenSimError> {
            let text = cells.next().unwrap_or_default().trim();
            if text.is_empty() {
                Ok(f32::NAN)
            } else {
                Ok((number(text, line, "a coordinate")? * metre) as f32)
            }
        };
        for _ in 0..self.labels.len() {
            let point = [cell()?, cell()?, cell()?];
            let is_seen = point.iter().all(|v| v.is_finite());
            self.points_m.push(if is_seen { point } else { [f32::NAN; 3] });
        }
        if cells.any(|rest| !rest.trim().is_empty()) {
            return Err(at(
                line,
                format!("more than three coordinates for each of {} markers", self.labels.len()),
            ));
        }
        Ok(time)
    }
}

impl Header {
    fn parse(names: &str, values: &str, line: usize) -> Result<Self, OpenSimError> {
        // Some programs write two tabs, or blanks, between them.
        let values: Vec<&str> = values.split_whitespace().collect();
        let get = |name: &str| {
            let at_name = names.split_whitespace().position(|n| n == name);
            at_name.and_then(|k| values.get(k).copied()).ok_or_else(|| at(line, format!("{name} is missing")))
        };
        let count = |name: &str| {
            let text = get(name)?;
            text.parse::<usize>().map_err(|_| at(line, format!("{name} is {text:?}, no count")))
        };
        let rate_hz = number(get("DataRate")?, line, "DataRate")?;
        if !(rate_hz > 0.0 && rate_hz.is_finite()) {
            return Err(at(line, format!("{rate_hz} frames a second are no rate")));
        }
        let metre = match get("Units")? {
            "mm" => 1e-3,
            "cm" => 1e-2,
            "m" => 1.0,
            other => return Err(at(line, format!("the unit {other:?} is none of mm, cm and m"))),
        };
        Ok(Self { rate_hz, frames: count("NumFrames")?, markers: count("NumMarkers")?, metre })
    }
}

//! C3D: markers, analog channels and force plates in one binary file.
//!
//! Of the format's description (c3d.org): a header block of 512 bytes, a parameter section of groups and
//! parameters, then frames. Each frame has all points, then a set number of samples of all analog channels.
//! Numbers are Intel's, DEC's or MIPS', integers or floating.

mod bytes;
mod error;
mod parameters;
mod plates;

use std::io::{BufRead, Cursor, Read, Seek, SeekFrom};

use super::frames::rename_equal;
use bytes::{Bytes, Processor};
pub use error::C3dError;
use error::parameter;
use parameters::{MOST, Parameters};
pub use plates::{Plate, PlateKind};

/// A block of the file, bytes.
const BLOCK: usize = 512;
/// The second byte of header and parameter section.
const KEY: u8 = 0x50;
/// Header and parameter section end before this byte: both are counted in blocks by one byte.
const HEAD: u64 = (2 * 256 * BLOCK) as u64;
/// A recording of markers, with analog channels and force plates.
#[derive(Clone, Debug, PartialEq)]
pub struct C3d {
    /// Frames per second.
    pub rate_hz: f64,
    /// Number of frames.
    pub frames: usize,
    /// Names of the points, without a prefix that names a subject.
    pub labels: Vec<String>,
    /// Points of one frame after another, m; NaN where a marker was not seen.
    pub points_m: Vec<[f32; 3]>,
    /// Analog samples of each channel per frame.
    pub samples_per_frame: usize,
    /// Names of the analog channels.
    pub channels: Vec<String>,
    /// Samples of all channels, one instant after another, in the channels' units.
    pub analog: Vec<f32>,
    /// Force plates, in their order; those that are not described or not wired are left out.
    pub plates: Vec<Plate>,
    /// The notes about what was read, in sentences.
    pub notes: Vec<String>,
}

impl C3d {
    /// Reads all of a file.
    ///
    /// # Errors
    /// It is no C3D file, is cut off, or contradicts itself.
    pub fn parse(file: &[u8]) -> Result<Self, C3dError> {
        let (mut c3d, mut frames) = Self::open(Cursor::new(file))?;
        while frames.add_next(&mut c3d.points_m, &mut c3d.analog)? {}
        Ok(c3d)
    }

    /// Reads what comes before the frames of a file, and returns it, without points and samples, with the
    /// frames.
    ///
    /// # Errors
    /// See [`C3d::parse`].
    pub fn open<R: BufRead + Seek>(mut reader: R) -> Result<(Self, Frames<R>), C3dError> {
        let length = reader.seek(SeekFrom::End(0)).map_err(unreadable)?;
        reader.seek(SeekFrom::Start(0)).map_err(unreadable)?;
        let mut head = Vec::new();
        (&mut reader).take(HEAD).read_to_end(&mut head).map_err(unreadable)?;
        if head.get(1) != Some(&KEY) {
            return Err(C3dError::NotC3d);
        }
        let section = (usize::from(head[0]).max(1) - 1) * BLOCK;
        let begin = Bytes::slice(&head, section, 4, "the parameter section")?;
        let (processor, parameters, note) = understood(&head, section, begin[3])?;
        let bytes = Bytes { file: &head, processor };
        // The data are behind the parameters, whose length in blocks is stated.
        let behind = section / BLOCK + usize::from(begin[2]) + 1;
        let layout = Layout::of(bytes, &parameters, behind)?;
        let mut c3d = layout.empty(&parameters)?;
        c3d.notes.extend(note);
        let frame_bytes = layout.frame_bytes(length)?;
        reader.seek(SeekFrom::Start(layout.begin as u64)).map_err(unreadable)?;
        let frames = Frames {
            reader,
            left: layout.frames,
            buffer: vec![0; frame_bytes],
            to_metres: parameters.unit_m()?,
            analog: Scaling::of(&parameters, layout.channels, layout.unsigned)?,
            processor,
            layout,
        };
        Ok((c3d, frames))
    }

    /// Returns a point in a frame, m; `None` where it was not seen.
    pub fn point(&self, frame: usize, label: usize) -> Option<[f32; 3]> {
        let at = frame.checked_mul(self.labels.len())?.checked_add(label)?;
        self.points_m.get(at).copied().filter(|_| label < self.labels.len()).filter(|p| p[0].is_finite())
    }
}

/// The frames of a file, one after the other.
pub struct Frames<R> {
    reader: R,
    layout: Layout,
    processor: Processor,
    left: usize,
    buffer: Vec<u8>,
    to_metres: f64,
    analog: Scaling,
}

impl<R: BufRead> Frames<R> {
    /// Adds the points of the next frame, m, and its samples of all channels, in their units; returns false
    /// after the last one.
    ///
    /// # Errors
    /// [`C3dError::Unreadable`].
    pub fn add_next(
        &mut self,
        points_m: &mut Vec<[f32; 3]>,
        samples: &mut Vec<f32>,
    ) -> Result<bool, C3dError> {
        if self.left == 0 {
            return Ok(false);
        }
        self.left -= 1;
        self.reader.read_exact(&mut self.buffer).map_err(unreadable)?;
        let bytes = Bytes { file: &self.buffer, processor: self.processor };
        let (layout, size) = (&self.layout, self.layout.number_bytes());
        for point in 0..layout.points {
            points_m.push(layout.point(bytes, 4 * size * point, self.to_metres)?);
        }
        let first = 4 * size * layout.points;
        for sample in 0..layout.samples_per_frame * layout.channels {
            let raw = layout.analog(bytes, first + size * sample)?;
            samples.push(self.analog.value(raw, sample % layout.channels));
        }
        Ok(true)
    }
}

fn unreadable(error: std::io::Error) -> C3dError {
    C3dError::Unreadable(error.to_string())
}

/// The place of the frames and the way they are written.
struct Layout {
    frames: usize,
    points: usize,
    channels: usize,
    samples_per_frame: usize,
    rate_hz: f64,
    /// Absolute value: metres (or the file's unit) for an integer step; floating numbers where the file's is
    /// negative.
    point_scale: f64,
    floating: bool,
    unsigned: bool,
    begin: usize,
}

impl Layout {
    fn of(bytes: Bytes, parameters: &Parameters, behind: usize) -> Result<Self, C3dError> {
        let count = |group: &'static str, name: &'static str, header: usize| -> Result<usize, C3dError> {
            let of_header = || bytes.u16(2 * header, "the header").map(usize::from);
            parameters.count(group, name)?.map_or_else(of_header, Ok)
        };
        let points = count("POINT", "USED", 1)?;
        let per_frame = usize::from(bytes.u16(4, "the header")?);
        let channels = parameters.count("ANALOG", "USED")?.unwrap_or(0);
        let rate_hz = match parameters.number("POINT", "RATE")? {
            Some(rate) => rate,
            None => f64::from(bytes.f32(20, "the header")?),
        };
        if !(rate_hz > 0.0 && rate_hz.is_finite()) {
            return Err(parameter("POINT", "RATE", format!("{rate_hz} frames a second are no rate")));
        }
        let samples_per_frame = samples_per_frame(parameters, rate_hz, channels, per_frame)?;
        let scale = match parameters.number("POINT", "SCALE")? {
            Some(scale) => scale,
            None => f64::from(bytes.f32(12, "the header")?),
        };
        if scale == 0.0 || !scale.is_finite() {
            return Err(parameter("POINT", "SCALE", format!("{scale} is no scale")));
        }
        if points == 0 && parameters.count("ROTATION", "USED")?.is_some_and(|used| used > 0) {
            let reason =
                "it holds rotations of segments and no markers: export the markers' positions as well"
                    .to_owned();
            return Err(parameter("ROTATION", "USED", reason));
        }
        // Some programs leave the parameter at zero, and state the block in the header alone, or nowhere.
        let stated = [count("POINT", "DATA_START", 8)?, usize::from(bytes.u16(16, "the header")?)];
        let block = stated.into_iter().find(|block| *block > 0).unwrap_or(behind);
        if points > MOST || channels > MOST || block == 0 {
            return Err(parameter("POINT", "DATA_START", "counts that no file has".to_owned()));
        }
        Ok(Self {
            frames: frames(bytes, parameters)?,
            points,
            channels,
            samples_per_frame,
            rate_hz,
            point_scale: scale.abs(),
            floating: scale < 0.0,
            unsigned: parameters
                .text("ANALOG", "FORMAT")
                .is_some_and(|format| format.eq_ignore_ascii_case("UNSIGNED")),
            begin: (block - 1) * BLOCK,
        })
    }

    /// Returns how many bytes a frame has, of a file of this length.
    fn frame_bytes(&self, length: u64) -> Result<usize, C3dError> {
        let size = self.number_bytes();
        let frame_bytes = size * (4 * self.points + self.samples_per_frame * self.channels);
        if frame_bytes == 0 {
            return Err(parameter(
                "POINT",
                "USED",
                "neither points nor channels are in its frames".to_owned(),
            ));
        }
        let needed =
            (self.begin as u64).saturating_add((self.frames as u64).saturating_mul(frame_bytes as u64));
        if needed > length {
            return Err(C3dError::Truncated { what: "the last frame", needed, bytes: length });
        }
        Ok(frame_bytes)
    }

    fn number_bytes(&self) -> usize {
        if self.floating { 4 } else { 2 }
    }

    /// Returns the recording without its points and samples.
    fn empty(&self, parameters: &Parameters) -> Result<C3d, C3dError> {
        let mut notes = Vec::new();
        let mut names = labels(parameters, "POINT", self.points);
        rename_equal(&mut names, &mut notes);
        let plates = plates::of(parameters, self.channels, &mut notes)?;
        Ok(C3d {
            rate_hz: self.rate_hz,
            frames: self.frames,
            labels: names,
            points_m: Vec::new(),
            samples_per_frame: self.samples_per_frame,
            channels: labels(parameters, "ANALOG", self.channels),
            analog: Vec::new(),
            plates,
            notes,
        })
    }

    /// Reads a point; its fourth number is negative where it was not seen.
    fn point(&self, bytes: Bytes, at: usize, to_metres: f64) -> Result<[f32; 3], C3dError> {
        const WHAT: &str = "a frame";
        let mut point = [f32::NAN; 3];
        if self.floating {
            if bytes.f32(at + 12, WHAT)? >= 0.0 {
                for (k, value) in point.iter_mut().enumerate() {
                    *value = (f64::from(bytes.f32(at + 4 * k, WHAT)?) * to_metres) as f32;
                }
            }
        } else if bytes.i16(at + 6, WHAT)? >= 0 {
            for (k, value) in point.iter_mut().enumerate() {
                *value = (f64::from(bytes.i16(at + 2 * k, WHAT)?) * self.point_scale * to_metres) as f32;
            }
        }
        Ok(if point.iter().all(|v| v.is_finite()) { point } else { [f32::NAN; 3] })
    }

    fn analog(&self, bytes: Bytes, at: usize) -> Result<f64, C3dError> {
        const WHAT: &str = "a frame";
        Ok(match (self.floating, self.unsigned) {
            (true, _) => f64::from(bytes.f32(at, WHAT)?),
            (false, true) => f64::from(bytes.u16(at, WHAT)?),
            (false, false) => f64::from(bytes.i16(at, WHAT)?),
        })
    }
}

/// From what the converter gave to a channel's unit: `(raw − offset) · scale · general scale`.
struct Scaling {
    scales: Vec<f64>,
    offsets: Vec<f64>,
}

impl Scaling {
    fn of(parameters: &Parameters, channels: usize, unsigned: bool) -> Result<Self, C3dError> {
        let general = parameters.number("ANALOG", "GEN_SCALE")?.unwrap_or(1.0);
        let all = |name: &'static str, absent: f64| -> Result<Vec<f64>, C3dError> {
            let mut values = parameters.numbers("ANALOG", name)?.unwrap_or_default();
            if values.iter().any(|value| !value.is_finite()) {
                return Err(parameter("ANALOG", name, "a value is no number".to_owned()));
            }
            values.resize(channels, absent);
            Ok(values)
        };
        let scales = all("SCALE", 1.0)?.into_iter().map(|scale| scale * general).collect();
        // An unsigned converter's zero is unsigned as well.
        let lifted = |offset: f64| if unsigned && offset < 0.0 { offset + 65_536.0 } else { offset };
        Ok(Self { scales, offsets: all("OFFSET", 0.0)?.into_iter().map(lifted).collect() })
    }

    fn value(&self, raw: f64, channel: usize) -> f32 {
        ((raw - self.offsets[channel]) * self.scales[channel]) as f32
    }
}

/// Returns how many frames there are: the parameters know of more than the header's sixteen bits.
fn frames(bytes: Bytes, parameters: &Parameters) -> Result<usize, C3dError> {
    let field = |name: &'static str| -> Result<Option<i64>, C3dError> {
        let Some(words) = parameters.numbers("TRIAL", name)? else { return Ok(None) };
        let word = |k: usize| words.get(k).map_or(0, |word| i64::from(*word as i32 as u16));
        Ok(Some(word(0) + 65_536 * word(1)))
    };
    let between = |first: i64, last: i64| usize::try_from(last - first + 1).ok().filter(|frames| *frames > 0);
    let found = match (field("ACTUAL_START_FIELD")?, field("ACTUAL_END_FIELD")?) {
        (Some(first), Some(last)) => between(first, last),
        _ => match parameters.count("POINT", "FRAMES")? {
            Some(frames) if frames < MOST => Some(frames),
            _ => {
                let word = |k: usize| bytes.u16(2 * k, "the header").map(i64::from);
                between(word(3)?, word(4)?)
            }
        },
    };
    found.ok_or_else(|| parameter("POINT", "FRAMES", "there are no frames".to_owned()))
}

fn samples_per_frame(
    parameters: &Parameters,
    rate_hz: f64,
    channels: usize,
    per_frame: usize,
) -> Result<usize, C3dError> {
    if channels == 0 {
        return Ok(0);
    }
    let ratio = match parameters.number("ANALOG", "RATE")? {
        Some(rate) => rate / rate_hz,
        None => per_frame as f64 / channels as f64,
    };
    let whole = ratio.round();
    if (whole - ratio).abs() > 1e-3 * ratio || !(1.0..=MOST as f64).contains(&whole) {
        let reason = format!("{ratio} samples of a channel for each frame are no whole number");
        return Err(parameter("ANALOG", "RATE", reason));
    }
    Ok(whole as usize)
}

/// Returns the processor that a file was written by, its parameters, and what to know if it is not the one
/// that the file names.
///
/// Some programs name another byte order than they write, count processors from 1, or name none.
fn understood(
    head: &[u8],
    section: usize,
    code: u8,
) -> Result<(Processor, Parameters, Option<String>), C3dError> {
    let read = |processor| Parameters::parse(Bytes { file: head, processor }, section);
    let is_whole = |parameters: &Parameters| parameters.has("POINT", "USED");
    let named = match code {
        0 => None,
        1..4 => Processor::of(83 + code),
        _ => Some(Processor::of(code).ok_or(C3dError::Processor(code))?),
    };
    let first = named.map(read);
    if let (Some(processor), Some(Ok(parameters))) = (named, &first)
        && is_whole(parameters)
    {
        return Ok((processor, read(processor)?, None));
    }
    let others =
        [Processor::Intel, Processor::Mips, Processor::Dec].into_iter().filter(|own| Some(*own) != named);
    for processor in others {
        if let Ok(parameters) = read(processor)
            && is_whole(&parameters)
            && processor.fits(head)
        {
            let note = format!(
                "its processor type {code} is not the byte order of its numbers: they are read as those of \
                 {}",
                processor.name()
            );
            return Ok((processor, parameters, Some(note)));
        }
    }
    match (named, first) {
        (Some(processor), Some(Ok(parameters))) => Ok((processor, parameters, None)),
        (Some(_), Some(Err(error))) => Err(error),
        _ => Err(C3dError::Processor(code)),
    }
}

/// Names, with those of LABELS2 and on behind; a name that is missing is its number.
fn labels(parameters: &Parameters, group: &'static str, count: usize) -> Vec<String> {
    let mut names = parameters.texts(group, "LABELS");
    for more in ["LABELS2", "LABELS3", "LABELS4", "LABELS5"] {
        names.extend(parameters.texts(group, more));
    }
    names.truncate(count);
    let mut names: Vec<String> =
        names.into_iter().map(|name| name.rsplit(':').next().unwrap_or_default().trim().to_owned()).collect();
    while names.len() < count {
        names.push(format!("{}", names.len() + 1));
    }
    names
}

#[cfg(test)]
mod tests;

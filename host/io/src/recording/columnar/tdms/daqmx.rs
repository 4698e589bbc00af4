//! Raw data of NI-DAQmx, as a task writes them that logs by itself: counts of converters, sample by sample,
//! in a buffer for each device. A channel's index says where in a sample its count is, after NI's *TDMS File
//! Format Internal Structure*.

use super::super::Room;
use super::segments::{Cursor, Kind, Object, TORN};

/// The code of an index whose channel is a number in each sample.
pub(super) const NUMBERS: u32 = 0x1269;
/// The code of an index whose channel is a bit in each sample.
pub(super) const LINES: u32 = 0x126A;
/// The type of what is scaled by its channel's properties; others are as they are.
const SCALED: u32 = u32::MAX;
/// More devices than these are no recording.
const MOST_BUFFERS: u32 = 64;

/// The place of a channel's values.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) kind: Kind,
    /// The scale that its properties name its counts by.
    pub(super) scale: usize,
    /// True if the channel's numbers are counts, which scales convert to its unit.
    pub(super) is_counts: bool,
    /// Samples in a chunk.
    count: usize,
    buffer: usize,
    /// Bytes from the beginning of a sample.
    offset: usize,
    /// The bit of a digital line.
    bit: Option<u32>,
    /// Bytes of a sample, by buffers.
    widths: Vec<usize>,
}

impl Layout {
    /// Reads an index behind its code.
    ///
    /// # Errors
    /// It is damaged, or its channel is made of several numbers.
    pub(super) fn read(cursor: &mut Cursor<'_>, code: u32, name: &str) -> Result<Self, String> {
        let whole = |value: u32| usize::try_from(value).map_err(|_| TORN);
        let is_scaled = cursor.u32()? == SCALED;
        if cursor.u32()? != 1 {
            return Err(format!("{TORN}: {name} has more than one dimension"));
        }
        let count = usize::try_from(cursor.u64()?).map_err(|_| TORN)?;
        let numbers = cursor.u32()?;
        if numbers != 1 {
            return Err(format!(
                "{name} is made of {numbers} numbers of the converter, as those of thermocouples are: save \
                 it scaled"
            ));
        }
        let kind = kind(cursor.u32()?)?;
        let buffer = whole(cursor.u32()?)?;
        let place = cursor.u32()?;
        // The format of a sample: nothing that its kind does not say.
        if code == LINES {
            cursor.take(1)?
        } else {
            cursor.take(4)?
        };
        let scale = whole(cursor.u32()?)?;
        let buffers = cursor.u32()?;
        if buffers > MOST_BUFFERS {
            return Err(format!("{TORN}: {name} has {buffers} devices"));
        }
        let widths = (0..buffers).map(|_| whole(cursor.u32()?).map_err(str::to_owned));
        let widths: Vec<usize> = widths.collect::<Result<_, _>>()?;
        let (offset, bit) = if code == LINES { (place / 8, Some(place % 8)) } else { (place, None) };
        let offset = whole(offset)?;
        let size = kind.size().ok_or(TORN)?;
        let width = widths.get(buffer).copied().unwrap_or(0);
        if offset.checked_add(size).is_none_or(|end| end > width) {
            return Err(format!("{TORN}: {name} is beyond its samples"));
        }
        let is_counts = is_scaled && bit.is_none() && !matches!(kind, Kind::F32 | Kind::F64);
        Ok(Self { kind, scale, is_counts, count, buffer, offset, bit, widths })
    }

    /// Returns a channel's value in a sample.
    fn value(&self, sample: &[u8], is_big: bool, into: &mut super::segments::Values) -> Result<(), String> {
        let mut own = Cursor { rest: sample.get(self.offset..).ok_or(TORN)?, is_big };
        match self.bit {
            None => own.value(self.kind, into),
            Some(bit) => {
                let line = [(own.take(1)?.first().copied().unwrap_or(0) >> bit) & 1];
                Cursor { rest: &line, is_big }.value(Kind::U8, into)
            }
        }
    }
}

/// Returns the kind of numbers of a converter, whose codes are not those of other values.
fn kind(code: u32) -> Result<Kind, String> {
    let all = [
        Kind::U8,
        Kind::I8,
        Kind::U16,
        Kind::I16,
        Kind::U32,
        Kind::I32,
        Kind::U64,
        Kind::I64,
        Kind::F32,
        Kind::F64,
    ];
    match usize::try_from(code).ok().and_then(|code| all.get(code)) {
        Some(kind) => Ok(*kind),
        None if code == u32::MAX => Ok(Kind::Time),
        None => Err(format!("{TORN}: it holds numbers of a converter of type {code}")),
    }
}

/// Takes the chunks of a segment: one buffer after the other; the last one as far as it goes.
///
/// # Errors
/// Channels disagree on the samples, or there is no room.
pub(super) fn raw_data(
    mut cursor: Cursor<'_>,
    objects: &mut [Object],
    active: &[(usize, Layout)],
    room: &mut Room,
) -> Result<(), String> {
    let Some((_, first)) = active.first() else { return Ok(()) };
    if active.iter().any(|(_, own)| own.widths != first.widths) {
        return Err(format!("{TORN}: its channels disagree on how long a sample is"));
    }
    let samples = |buffer: usize| {
        let own = active.iter().filter(|(_, own)| own.buffer == buffer);
        own.map(|(_, own)| own.count).max().unwrap_or(0)
    };
    let buffers: Vec<(usize, usize)> =
        first.widths.iter().enumerate().map(|(k, width)| (*width, samples(k))).collect();
    if buffers.iter().all(|(width, samples)| *width == 0 || *samples == 0) {
        return Ok(());
    }
    while !cursor.rest.is_empty() {
        for (k, (width, samples)) in buffers.iter().enumerate().filter(|(_, (width, _))| *width > 0) {
            let there = (*samples).min(cursor.rest.len() / width);
            let bytes = cursor.take(there * width)?;
            for (place, own) in active.iter().filter(|(_, own)| own.buffer == k) {
                let values = objects.get_mut(*place).and_then(|object| object.values.as_mut()).ok_or(TORN)?;
                room.take(there.min(own.count).saturating_mul(16))?;
                for sample in bytes.chunks_exact(*width).take(own.count) {
                    own.value(sample, cursor.is_big, values)?;
                }
            }
            if there < *samples {
                cursor.rest = &[];
            }
        }
    }
    Ok(())
}

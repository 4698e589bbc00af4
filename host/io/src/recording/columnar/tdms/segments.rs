//! The segments of a TDMS file: objects with properties, and the raw data of channels, after NI's *TDMS File
//! Format Internal Structure*.

use std::collections::HashMap;

use super::super::Room;
use super::daqmx::{self, Layout};

/// Bytes of a segment's lead-in.
const LEAD_IN: usize = 28;
/// Objects of a file; more is no recording.
const MOST_OBJECTS: usize = 4096;
/// Seconds from 1904-01-01 to 1970.
const EPOCH_S: i64 = 2_082_844_800;
pub(super) const TORN: &str = "as a TDMS file it is damaged or cut off";

/// Bits of the table of contents.
mod has {
    pub const METADATA: u32 = 1 << 1;
    pub const NEW_LIST: u32 = 1 << 2;
    pub const RAW_DATA: u32 = 1 << 3;
    pub const INTERLEAVED: u32 = 1 << 5;
    pub const BIG_ENDIAN: u32 = 1 << 6;
}

/// The value of a property.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Number(f64),
    Text(String),
    /// Nanoseconds since 1970.
    Time(i128),
}

/// The values of a channel.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    Numbers(Vec<f64>),
    /// Whole numbers of 64 bits, which a float would round.
    Whole(Vec<i128>),
    /// Nanoseconds since 1970.
    Times(Vec<i128>),
    Texts(Vec<String>),
}

impl Values {
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Numbers(values) => values.len(),
            Self::Whole(values) | Self::Times(values) => values.len(),
            Self::Texts(values) => values.len(),
        }
    }
}

/// An object: the file, a group or a channel.
#[derive(Clone, Debug, Default)]
pub(super) struct Object {
    /// Names in its path: none of the file, one of a group, two of a channel.
    pub(super) path: Vec<String>,
    pub(super) properties: HashMap<String, Value>,
    pub(super) values: Option<Values>,
    index: Option<Index>,
    /// The place of its values in samples of NI-DAQmx, which have no index.
    pub(super) layout: Option<Layout>,
}

/// The layout of an object's raw data in a segment.
#[derive(Clone, Copy, Debug)]
struct Index {
    kind: Kind,
    count: usize,
    /// Bytes in a chunk.
    bytes: usize,
}

/// A type of values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    I8,
    I16,
    I32,
    I64,
    U8,
    U16,
    U32,
    U64,
    F32,
    F64,
    Text,
    Boolean,
    Time,
}

impl Kind {
    fn of(code: u32) -> Result<Self, String> {
        Ok(match code {
            1 => Self::I8,
            2 => Self::I16,
            3 => Self::I32,
            4 => Self::I64,
            5 => Self::U8,
            6 => Self::U16,
            7 => Self::U32,
            8 => Self::U64,
            9 | 0x19 => Self::F32,
            10 | 0x1a => Self::F64,
            0x20 => Self::Text,
            0x21 => Self::Boolean,
            0x44 => Self::Time,
            11 | 0x1b => {
                return Err("it holds numbers of extended precision: write them as doubles".to_owned());
            }
            0x0008_000c | 0x0010_000d => {
                return Err("it holds complex numbers: write real ones".to_owned());
            }
            _ => return Err(format!("{TORN}: it holds values of type {code:#x}")),
        })
    }

    /// Bytes of a value; `None` of a text.
    pub(super) fn size(self) -> Option<usize> {
        Some(match self {
            Self::I8 | Self::U8 | Self::Boolean => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
            Self::Time => 16,
            Self::Text => return None,
        })
    }

    fn none(self) -> Values {
        match self {
            Self::Time => Values::Times(Vec::new()),
            Self::Text => Values::Texts(Vec::new()),
            Self::I64 | Self::U64 => Values::Whole(Vec::new()),
            _ => Values::Numbers(Vec::new()),
        }
    }
}

/// Takes values off the front of bytes.
#[derive(Clone, Copy)]
pub(super) struct Cursor<'a> {
    pub(super) rest: &'a [u8],
    pub(super) is_big: bool,
}

impl<'a> Cursor<'a> {
    pub(super) fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let (taken, rest) = self.rest.split_at_checked(count).ok_or(TORN)?;
        self.rest = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let mut bytes: [u8; N] = self.take(N)?.try_into().map_err(|_| TORN)?;
        if self.is_big {
            bytes.reverse();
        }
        Ok(bytes)
    }

    pub(super) fn u32(&mut self) -> Result<u32, String> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(super) fn u64(&mut self) -> Result<u64, String> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    fn text(&mut self) -> Result<String, String> {
        let length = self.u32()? as usize;
        Ok(String::from_utf8_lossy(self.take(length)?).into_owned())
    }

    /// Nanoseconds since 1970: fractions of 2⁻⁶⁴ s, and seconds since 1904.
    fn time(&mut self) -> Result<i128, String> {
        let (fraction, seconds) = if self.is_big {
            let seconds = i64::from_le_bytes(self.array()?);
            (self.u64()?, seconds)
        } else {
            (self.u64()?, i64::from_le_bytes(self.array()?))
        };
        let ns = (u128::from(fraction) * 1_000_000_000 + (1 << 63)) >> 64;
        Ok((i128::from(seconds) - i128::from(EPOCH_S)) * 1_000_000_000 + ns as i128)
    }

    /// Takes one value of a fixed size.
    pub(super) fn value(&mut self, kind: Kind, into: &mut Values) -> Result<(), String> {
        let number = match (kind, into) {
            (Kind::Time, Values::Times(times)) => {
                times.push(self.time()?);
                return Ok(());
            }
            (Kind::I64, Values::Whole(values)) => {
                values.push(i128::from(i64::from_le_bytes(self.array()?)));
                return Ok(());
            }
            (Kind::U64, Values::Whole(values)) => {
                values.push(i128::from(self.u64()?));
                return Ok(());
            }
            (_, Values::Numbers(values)) => (self.number(kind)?, values),
            _ => return Err(TORN.to_owned()),
        };
        number.1.push(number.0);
        Ok(())
    }

    fn number(&mut self, kind: Kind) -> Result<f64, String> {
        Ok(match kind {
            Kind::I8 => f64::from(i8::from_le_bytes(self.array()?)),
            Kind::I16 => f64::from(i16::from_le_bytes(self.array()?)),
            Kind::I32 => f64::from(i32::from_le_bytes(self.array()?)),
            Kind::I64 => i64::from_le_bytes(self.array()?) as f64,
            Kind::U8 | Kind::Boolean => f64::from(u8::from_le_bytes(self.array()?)),
            Kind::U16 => f64::from(u16::from_le_bytes(self.array()?)),
            Kind::U32 => f64::from(self.u32()?),
            Kind::U64 => self.u64()? as f64,
            Kind::F32 => f64::from(f32::from_le_bytes(self.array()?)),
            Kind::F64 => f64::from_le_bytes(self.array()?),
            Kind::Text | Kind::Time => return Err(TORN.to_owned()),
        })
    }

    fn property(&mut self) -> Result<(String, Value), String> {
        let name = self.text()?;
        let kind = Kind::of(self.u32()?)?;
        let value = match kind {
            Kind::Text => Value::Text(self.text()?),
            Kind::Time => Value::Time(self.time()?),
            kind => Value::Number(self.number(kind)?),
        };
        Ok((name, value))
    }
}

/// Returns true if bytes begin as a TDMS file does.
pub(super) fn is_tdms(bytes: &[u8]) -> bool {
    bytes.starts_with(b"TDSm")
}

/// Returns the objects of a file in the order in which they come.
///
/// # Errors
/// It is damaged, or holds what is not read.
pub(super) fn read(bytes: &[u8]) -> Result<Vec<Object>, String> {
    let mut room = Room::of_file(bytes.len());
    let (mut objects, mut places, mut active) = (Vec::new(), HashMap::new(), Vec::new());
    let mut at = 0;
    while at < bytes.len() {
        let lead = bytes.get(at..).and_then(|rest| rest.get(..LEAD_IN));
        let Some(lead) = lead.filter(|lead| lead.starts_with(b"TDSm")) else {
            // What a writer that was stopped left of a segment's beginning.
            if at > 0 && bytes.len() - at < LEAD_IN {
                break;
            }
            return Err(TORN.to_owned());
        };
        let contents = Cursor { rest: lead.get(4..).ok_or(TORN)?, is_big: false }.u32()?;
        let mut cursor =
            Cursor { rest: lead.get(12..).ok_or(TORN)?, is_big: contents & has::BIG_ENDIAN != 0 };
        let (next, raw) = (cursor.u64()?, cursor.u64()?);
        let begin = at + LEAD_IN;
        let whole = |offset: u64| usize::try_from(offset).ok().and_then(|offset| begin.checked_add(offset));
        // A segment that was never ended reaches to the file's end.
        let end = if next == u64::MAX { bytes.len() } else { whole(next).ok_or(TORN)?.min(bytes.len()) };
        let data = whole(raw).ok_or(TORN)?.min(end);
        let meta = Cursor { rest: bytes.get(begin..data).ok_or(TORN)?, is_big: cursor.is_big };
        if contents & has::METADATA != 0 {
            metadata(meta, contents, &mut objects, &mut places, &mut active, &mut room)?;
        }
        if contents & has::RAW_DATA != 0 {
            let raw = Cursor { rest: bytes.get(data..end).ok_or(TORN)?, is_big: cursor.is_big };
            let layout = |place: &usize| Some((*place, objects.get(*place)?.layout.clone()?));
            let layouts: Vec<(usize, Layout)> = active.iter().filter_map(layout).collect();
            if layouts.is_empty() {
                raw_data(raw, contents, &mut objects, &active, &mut room)?;
            } else if layouts.len() < active.len() {
                return Err("it holds raw data of NI-DAQmx among others: save it scaled".to_owned());
            } else {
                daqmx::raw_data(raw, &mut objects, &layouts, &mut room)?;
            }
        }
        at = end;
    }
    Ok(objects)
}

fn metadata(
    mut cursor: Cursor<'_>,
    contents: u32,
    objects: &mut Vec<Object>,
    places: &mut HashMap<String, usize>,
    active: &mut Vec<usize>,
    room: &mut Room,
) -> Result<(), String> {
    if contents & has::NEW_LIST != 0 {
        active.clear();
    }
    for _ in 0..cursor.u32()? {
        let path = cursor.text()?;
        let place = match places.get(&path) {
            Some(place) => *place,
            None => {
                if objects.len() >= MOST_OBJECTS {
                    return Err(format!("it has more than {MOST_OBJECTS} channels and groups: split it"));
                }
                let names =
                    names(&path).ok_or_else(|| format!("{TORN}: {path:?} is no path of an object"))?;
                objects.push(Object { path: names, ..Object::default() });
                places.insert(path, objects.len() - 1);
                objects.len() - 1
            }
        };
        let object = objects.get_mut(place).ok_or(TORN)?;
        match cursor.u32()? {
            u32::MAX => active.retain(|own| *own != place),
            0 if object.index.is_none() && object.layout.is_none() => {
                return Err(format!(
                    "{TORN}: {} says that its data are as before, and there are none",
                    object.name()
                ));
            }
            0 => push_once(active, place),
            code @ (daqmx::NUMBERS | daqmx::LINES) => {
                let layout = Layout::read(&mut cursor, code, &object.name())?;
                object.hold(layout.kind)?;
                (object.layout, object.index) = (Some(layout), None);
                push_once(active, place);
            }
            _ => {
                let kind = Kind::of(cursor.u32()?)?;
                if cursor.u32()? != 1 {
                    return Err(format!("{TORN}: {} has more than one dimension", object.name()));
                }
                let count = usize::try_from(cursor.u64()?).map_err(|_| TORN)?;
                let bytes = match kind.size() {
                    Some(size) => count.checked_mul(size).ok_or(TORN)?,
                    None => usize::try_from(cursor.u64()?).map_err(|_| TORN)?,
                };
                (object.index, object.layout) = (Some(Index { kind, count, bytes }), None);
                object.hold(kind)?;
                push_once(active, place);
            }
        }
        for _ in 0..cursor.u32()? {
            let (name, value) = cursor.property()?;
            room.take_cells(1, name.len())?;
            object.properties.insert(name, value);
        }
    }
    Ok(())
}

fn push_once(active: &mut Vec<usize>, place: usize) {
    if !active.contains(&place) {
        active.push(place);
    }
}

/// Takes the chunks of a segment's raw data; a last one that is cut off as far as it goes.
fn raw_data(
    mut cursor: Cursor<'_>,
    contents: u32,
    objects: &mut [Object],
    active: &[usize],
    room: &mut Room,
) -> Result<(), String> {
    let index = |objects: &[Object], place: &usize| objects.get(*place).and_then(|object| object.index);
    let chunk = active
        .iter()
        .filter_map(|place| index(objects, place))
        .try_fold(0_usize, |sum, index| sum.checked_add(index.bytes))
        .ok_or(TORN)?;
    if chunk == 0 {
        return Ok(());
    }
    let is_interleaved = contents & has::INTERLEAVED != 0;
    // Of very many objects without values none is examined again for each value of another.
    let active: Vec<usize> =
        active.iter().copied().filter(|p| index(objects, p).is_some_and(|i| i.bytes > 0)).collect();
    let active = active.as_slice();
    while !cursor.rest.is_empty() {
        let before = cursor.rest.len();
        if is_interleaved {
            interleaved(&mut cursor, chunk, objects, active, room)?;
        } else {
            for place in active {
                let Some(object) = objects.get_mut(*place) else { continue };
                let Some(index) = object.index else { continue };
                let Some(values) = object.values.as_mut() else { continue };
                contiguous(&mut cursor, index, values, room)?;
            }
        }
        // What is left is less than a value.
        if cursor.rest.len() == before {
            break;
        }
    }
    Ok(())
}

fn contiguous(
    cursor: &mut Cursor<'_>,
    index: Index,
    values: &mut Values,
    room: &mut Room,
) -> Result<(), String> {
    match index.kind.size() {
        Some(size) => {
            let count = index.count.min(cursor.rest.len() / size);
            room.take(count.saturating_mul(16))?;
            for _ in 0..count {
                cursor.value(index.kind, values)?;
            }
            if count < index.count {
                cursor.rest = &[];
            }
        }
        None => {
            if cursor.rest.len() < index.bytes {
                cursor.rest = &[];
                return Ok(());
            }
            let mut own = Cursor { rest: cursor.take(index.bytes)?, is_big: cursor.is_big };
            let all = own.rest;
            let length = index.count.checked_mul(4).filter(|length| *length <= all.len()).ok_or(TORN)?;
            let texts = all.get(length..).ok_or(TORN)?;
            let mut start = 0;
            let Values::Texts(into) = values else { return Err(TORN.to_owned()) };
            for _ in 0..index.count {
                let end = own.u32()? as usize;
                let text = texts.get(start..end).ok_or(TORN)?;
                room.take_cells(1, text.len())?;
                into.push(String::from_utf8_lossy(text).into_owned());
                start = end;
            }
        }
    }
    Ok(())
}

fn interleaved(
    cursor: &mut Cursor<'_>,
    chunk: usize,
    objects: &mut [Object],
    active: &[usize],
    room: &mut Room,
) -> Result<(), String> {
    let with_data: Vec<(usize, Index)> =
        active.iter().filter_map(|place| Some((*place, objects.get(*place)?.index?))).collect();
    let count = with_data.first().map_or(0, |(_, index)| index.count);
    let sizes: Option<usize> = with_data.iter().map(|(_, index)| index.kind.size()).sum();
    let width = sizes.filter(|width| *width > 0).ok_or(TORN)?;
    if with_data.iter().any(|(_, index)| index.count != count) || count.checked_mul(width) != Some(chunk) {
        return Err(format!("{TORN}: its interleaved channels have different lengths"));
    }
    let rows = count.min(cursor.rest.len() / width);
    room.take(rows.saturating_mul(16 * with_data.len()))?;
    for _ in 0..rows {
        for (place, index) in &with_data {
            let values = objects.get_mut(*place).and_then(|object| object.values.as_mut()).ok_or(TORN)?;
            cursor.value(index.kind, values)?;
        }
    }
    if rows < count {
        cursor.rest = &[];
    }
    Ok(())
}

/// Returns the names in a path: `/'group'/'channel'`, a quote in a name being two.
fn names(path: &str) -> Option<Vec<String>> {
    let (mut names, mut rest) = (Vec::new(), path.strip_prefix('/')?);
    while !rest.is_empty() {
        let (mut name, mut letters) = (String::new(), rest.strip_prefix('\'')?.char_indices().peekable());
        let inside = rest.get(1..)?;
        let mut end = None;
        while let Some((at, letter)) = letters.next() {
            match (letter, letters.peek()) {
                ('\'', Some((_, '\''))) => {
                    letters.next();
                    name.push('\'');
                }
                ('\'', _) => {
                    end = Some(at + 1);
                    break;
                }
                _ => name.push(letter),
            }
        }
        names.push(name);
        rest = inside.get(end?..)?;
        rest = if rest.is_empty() { rest } else { rest.strip_prefix('/')? };
    }
    (names.len() <= 2).then_some(names)
}

impl Object {
    /// Makes room for values of a kind.
    fn hold(&mut self, kind: Kind) -> Result<(), String> {
        let values = self.values.get_or_insert_with(|| kind.none());
        if std::mem::discriminant(values) != std::mem::discriminant(&kind.none()) {
            return Err(format!("{} changes its type of values: save it anew", self.name()));
        }
        Ok(())
    }

    /// Returns its name for messages.
    pub(super) fn name(&self) -> String {
        self.path.join("/")
    }

    /// Returns a property that is a number.
    pub(super) fn number(&self, name: &str) -> Option<f64> {
        match self.properties.get(name) {
            Some(Value::Number(value)) => Some(*value),
            _ => None,
        }
    }

    /// Returns a property that is a text, without blanks around it; `None` of an empty one.
    pub(super) fn text(&self, name: &str) -> Option<&str> {
        match self.properties.get(name) {
            Some(Value::Text(text)) => Some(text.trim()).filter(|text| !text.is_empty()),
            _ => None,
        }
    }

    /// Returns a property that is a time, ns since 1970.
    pub(super) fn time(&self, name: &str) -> Option<i128> {
        match self.properties.get(name) {
            Some(Value::Time(ns)) => Some(*ns),
            _ => None,
        }
    }
}

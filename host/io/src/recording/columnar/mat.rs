//! Variables of a MAT file, level 5 (MATLAB's `save -v7` and `-v6`, SciPy's `savemat`), after MathWorks'
//! *MAT-File Format*.
//!
//! A variable that is a vector is a column with the variable's name; one that is a matrix of n columns is n
//! columns `NAME_1` … `NAME_n`. A scalar structure is its fields, named without the structure.

use std::collections::BTreeMap;
use std::io::Read;

use super::{Room, Table, number};
use crate::recording::columns::{Cells, Known};

/// Bytes before the first element.
const HEADER: usize = 128;
/// Structures inside structures.
const DEEPEST: usize = 8;
/// Memory of a number once it is unpacked: it is read as f64, whatever it is stored as.
const NUMBER: usize = size_of::<f64>();

mod kind {
    pub const MATRIX: u32 = 14;
    pub const COMPRESSED: u32 = 15;
}

mod class {
    pub const STRUCT: u8 = 2;
    pub const FIRST_NUMERIC: u8 = 6;
    pub const LAST_NUMERIC: u8 = 15;
}

/// Bits of the array flags.
const COMPLEX: u8 = 0x08;

/// Takes elements off the front of bytes.
struct Elements<'a> {
    rest: &'a [u8],
    big_endian: bool,
}

/// An array: its name, its dimensions, and what it holds.
struct Array {
    name: String,
    rows: usize,
    columns: usize,
    content: Content,
}

enum Content {
    /// By columns.
    Numbers(Vec<f64>),
    Fields(Vec<Array>),
    /// Text, cells, sparse, complex, or objects.
    Other(&'static str),
}

const TORN: &str = "as a MAT file it is damaged or cut off";

/// Returns the columns of a file.
pub(super) fn table(bytes: &[u8]) -> Result<Table, String> {
    if bytes.starts_with(b"MATLAB 7.3") || bytes.starts_with(b"\x89HDF") {
        return Err(
            "it is a MAT file of version 7.3 (HDF5), which is not read: save it with `save(…, '-v7')`"
                .to_owned(),
        );
    }
    let mark = bytes.get(HEADER - 2..HEADER).ok_or(TORN)?;
    let big_endian = match mark {
        b"IM" => false,
        b"MI" => true,
        _ => return Err("it is no MAT file of level 5: save it with `save(…, '-v7')`".to_owned()),
    };
    let mut elements = Elements { rest: bytes.get(HEADER..).ok_or(TORN)?, big_endian };
    let (mut arrays, mut room) = (Vec::new(), Room::of_file(bytes.len()));
    let mut cells = Room::of_file(bytes.len());
    while !elements.rest.is_empty() {
        let (kind, data) = elements.next()?;
        match kind {
            kind::MATRIX => arrays.push(array(data, big_endian, 0)?),
            kind::COMPRESSED => {
                let mut unpacked = Vec::new();
                // Each byte may become a number.
                let most = room.0 / NUMBER;
                let mut decoder = flate2::read::ZlibDecoder::new(data).take(most as u64 + 1);
                decoder.read_to_end(&mut unpacked).map_err(|e| format!("{TORN}: {e}"))?;
                room.take(unpacked.len().saturating_mul(NUMBER))?;
                let mut inside = Elements { rest: &unpacked, big_endian };
                let (kind, data) = inside.next()?;
                if kind == kind::MATRIX {
                    arrays.push(array(data, big_endian, 0)?);
                }
            }
            // Other elements hold no variables.
            _ => {}
        }
    }
    let (mut columns, mut others, mut scalars) = (Vec::new(), Vec::new(), Vec::new());
    let (rows, mut left_out) = (most_rows(&arrays), Vec::new());
    for array in arrays {
        array.take_cells(&mut cells)?;
        flatten(array, rows, &mut columns, &mut scalars, (&mut others, &mut left_out));
    }
    if columns.is_empty() {
        return Err(format!(
            "it holds no vectors of numbers{}",
            if others.is_empty() { String::new() } else { format!("; there are {}", others.join(", ")) }
        ));
    }
    let mut warnings = Vec::new();
    if !left_out.is_empty() {
        warnings.push(format!("left out, as not of {} rows: {}", rows.unwrap_or(0), left_out.join(", ")));
    }
    Ok(Table { columns, warnings, ..Table::default() })
}

impl Array {
    /// Takes the room of the cells that it becomes.
    fn take_cells(&self, room: &mut Room) -> Result<(), String> {
        match &self.content {
            Content::Numbers(values) => {
                room.take_cells(values.len().saturating_add(self.columns), self.name.len())
            }
            Content::Fields(fields) => fields.iter().try_for_each(|field| field.take_cells(room)),
            Content::Other(_) => Ok(()),
        }
    }
}

/// Returns how long most vectors are; of equally many the longer ones. `None` if there are none.
fn most_rows(arrays: &[Array]) -> Option<usize> {
    fn count(arrays: &[Array], lengths: &mut BTreeMap<usize, usize>) {
        for array in arrays {
            match &array.content {
                Content::Numbers(values) if values.len() > 1 && (array.rows == 1 || array.columns == 1) => {
                    *lengths.entry(values.len()).or_default() += 1;
                }
                Content::Fields(fields) => count(fields, lengths),
                _ => {}
            }
        }
    }
    let mut lengths = BTreeMap::new();
    count(arrays, &mut lengths);
    lengths.into_iter().max_by_key(|(length, count)| (*count, *length)).map(|(length, _)| length)
}

/// Makes columns of an array. Scalars beside vectors are settings, and no columns; nor are a matrix or a
/// vector of another length, unless it is named as a column of a recording.
fn flatten(
    array: Array,
    most: Option<usize>,
    columns: &mut Vec<Cells>,
    scalars: &mut Vec<String>,
    (others, left_out): (&mut Vec<String>, &mut Vec<String>),
) {
    let Array { name, rows, columns: count, content } = array;
    match content {
        Content::Numbers(_) if rows * count == 1 => scalars.push(name),
        Content::Numbers(values) if rows == 1 || count == 1 => {
            if most.is_some_and(|most| most != values.len()) && Known::parse(&name).is_none() {
                left_out.push(format!("{name} ({rows} × {count})"));
                return;
            }
            columns.push((name, values.into_iter().map(number).collect()));
        }
        // One quantity a row, as timeseries and simulations store them.
        Content::Numbers(values) if most.is_some_and(|most| most == count && most != rows) => {
            for k in 0..rows {
                let cells = values.iter().skip(k).step_by(rows).copied().map(number).collect();
                columns.push((format!("{name}_{}", k + 1), cells));
            }
        }
        Content::Numbers(_) if most.is_some_and(|most| most != rows) => {
            left_out.push(format!("{name} ({rows} × {count})"));
        }
        Content::Numbers(values) => {
            for (k, column) in values.chunks(rows.max(1)).enumerate() {
                let cells = column.iter().copied().map(number).collect();
                columns.push((format!("{name}_{}", k + 1), cells));
            }
        }
        Content::Fields(fields) => {
            fields
                .into_iter()
                .for_each(|field| flatten(field, most, columns, scalars, (&mut *others, &mut *left_out)));
        }
        Content::Other(what) => others.push(format!("{name} ({what})")),
    }
}

impl<'a> Elements<'a> {
    fn u32_at(&self, at: usize) -> Option<u32> {
        let bytes: [u8; 4] = self.rest.get(at..at + 4)?.try_into().ok()?;
        Some(if self.big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    }

    /// Returns the kind and the data of the next element.
    fn next(&mut self) -> Result<(u32, &'a [u8]), String> {
        let word = self.u32_at(0).ok_or(TORN)?;
        // Up to four bytes are in the tag itself.
        if word >> 16 != 0 {
            let (kind, length) = (word & 0xffff, (word >> 16) as usize);
            let data = self.rest.get(4..8).and_then(|data| data.get(..length)).ok_or(TORN)?;
            self.rest = self.rest.get(8..).ok_or(TORN)?;
            return Ok((kind, data));
        }
        let length = self.u32_at(4).ok_or(TORN)? as usize;
        let end = length.checked_add(8).ok_or(TORN)?;
        let data = self.rest.get(8..end).ok_or(TORN)?;
        // Elements begin at multiples of eight bytes, but for what is packed.
        let padded = if word == kind::COMPRESSED { end } else { end.next_multiple_of(8) };
        self.rest = self.rest.get(padded..).unwrap_or_default();
        Ok((word, data))
    }

    /// Returns the numbers of the next element, of whichever type they are stored as.
    fn numbers(&mut self) -> Result<Vec<f64>, String> {
        let (kind, data) = self.next()?;
        let big = self.big_endian;
        macro_rules! read {
            ($type:ty, $number:expr) => {{
                let size = size_of::<$type>();
                let word = |bytes: &[u8]| -> Option<$type> {
                    let bytes = bytes.try_into().ok()?;
                    Some(if big { <$type>::from_be_bytes(bytes) } else { <$type>::from_le_bytes(bytes) })
                };
                data.chunks_exact(size).map(|bytes| word(bytes).map($number)).collect::<Option<Vec<f64>>>()
            }};
        }
        let numbers = match kind {
            1 => read!(i8, f64::from),
            2 => read!(u8, f64::from),
            3 => read!(i16, f64::from),
            4 => read!(u16, f64::from),
            5 => read!(i32, f64::from),
            6 => read!(u32, f64::from),
            7 => read!(f32, f64::from),
            9 => read!(f64, |v| v),
            12 => read!(i64, |v| v as f64),
            13 => read!(u64, |v| v as f64),
            _ => None,
        };
        numbers.ok_or_else(|| TORN.to_owned())
    }
}

/// Reads the content of a matrix element.
fn array(data: &[u8], big_endian: bool, depth: usize) -> Result<Array, String> {
    let mut elements = Elements { rest: data, big_endian };
    if data.is_empty() {
        return Ok(Array { name: String::new(), rows: 0, columns: 0, content: Content::Other("empty") });
    }
    let (_, flags) = elements.next()?;
    let word: [u8; 4] = flags.get(..4).and_then(|word| word.try_into().ok()).ok_or(TORN)?;
    let word = if big_endian { u32::from_be_bytes(word) } else { u32::from_le_bytes(word) };
    let (class, bits) = ((word & 0xff) as u8, (word >> 8) as u8);
    let dimensions: Vec<usize> = elements.numbers()?.into_iter().map(|v| v.max(0.0) as usize).collect();
    let (_, name) = elements.next()?;
    let name = String::from_utf8_lossy(name).into_owned();
    let rows = dimensions.first().copied().unwrap_or(0);
    let columns =
        dimensions.get(1..).unwrap_or_default().iter().try_fold(1_usize, |all, d| all.checked_mul(*d));
    let count = columns.and_then(|columns| columns.checked_mul(rows)).ok_or(TORN)?;
    let columns = columns.unwrap_or(0);
    let content = match class {
        class::FIRST_NUMERIC..=class::LAST_NUMERIC if bits & COMPLEX != 0 => Content::Other("complex"),
        class::FIRST_NUMERIC..=class::LAST_NUMERIC => {
            let numbers = elements.numbers()?;
            if numbers.len() != count {
                return Err(format!(
                    "{TORN}: {name} says that it has {count} numbers, and has {}",
                    numbers.len()
                ));
            }
            Content::Numbers(numbers)
        }
        class::STRUCT if count == 1 && depth < DEEPEST => Content::Fields(fields(&mut elements, depth)?),
        class::STRUCT => Content::Other("a structure array"),
        1 => Content::Other("cells"),
        4 => Content::Other("text"),
        5 => Content::Other("sparse"),
        _ => Content::Other("an object"),
    };
    Ok(Array { name, rows, columns, content })
}

/// Reads the fields of a scalar structure.
fn fields(elements: &mut Elements<'_>, depth: usize) -> Result<Vec<Array>, String> {
    let length = elements.numbers()?.first().map_or(0.0, |v| v.max(0.0)) as usize;
    let (_, names) = elements.next()?;
    if length == 0 {
        return Ok(Vec::new());
    }
    let mut fields = Vec::new();
    for name in names.chunks_exact(length) {
        let end = name.iter().position(|byte| *byte == 0).unwrap_or(length);
        let name = String::from_utf8_lossy(name.get(..end).unwrap_or_default()).into_owned();
        let (kind, data) = elements.next()?;
        if kind != kind::MATRIX {
            return Err(TORN.to_owned());
        }
        fields.push(Array { name, ..array(data, elements.big_endian, depth + 1)? });
    }
    Ok(fields)
}

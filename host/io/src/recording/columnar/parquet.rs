//! Columns of a Parquet file, flat ones.

use ::parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type};
use ::parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use ::parquet::data_type::{ByteArray, DataType};
use ::parquet::errors::ParquetError;
use ::parquet::file::reader::{FileReader, RowGroupReader, SerializedFileReader};
use ::parquet::schema::types::ColumnDescriptor;

use super::{Room, Table, number};
use crate::parquet_file::{guarded, open_bytes};
use crate::recording::columns::Cells;
use crate::recording::text::one_line;

/// Rows that are read at once.
const AT_ONCE: usize = 4096;

/// Returns the columns of a file.
pub(super) fn table(bytes: Vec<u8>) -> Result<Table, String> {
    let room = Room::of_file(bytes.len());
    let reader = open_bytes(bytes)?;
    guarded(|| of_reader(&reader, room))
}

fn of_reader(reader: &SerializedFileReader<bytes::Bytes>, mut room: Room) -> Result<Table, String> {
    let damaged = |e: ParquetError| format!("as a Parquet file it is damaged or cut off: {e}");
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let (mut columns, mut times): (Vec<Cells>, _) = (Vec::new(), Vec::new());
    for column in schema.columns() {
        let name = column.path().string();
        if column.max_rep_level() > 0 || column.max_def_level() > 1 {
            return Err(format!("its column {name} is nested: write a column for each number"));
        }
        if let Some(places) = time_places(column) {
            times.push((name.clone(), [1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9][places]));
        }
        columns.push((name, Vec::new()));
    }
    for k in 0..reader.num_row_groups() {
        let group = reader.get_row_group(k).map_err(damaged)?;
        for (n, (name, cells)) in columns.iter_mut().enumerate() {
            let column = schema.column(n);
            let found = read(&*group, n, &column, &mut room).map_err(|e| format!("column {name}: {e}"))?;
            cells.extend(found);
        }
    }
    Ok(Table { columns, times, ..Table::default() })
}

/// Returns the decimal places of a whole number that the file says is a time, in s.
fn time_places(column: &ColumnDescriptor) -> Option<usize> {
    match (column.physical_type(), column.logical_type_ref(), column.converted_type()) {
        // What Spark and older writers have for a time.
        (Type::INT96, ..) => Some(9),
        (_, Some(LogicalType::Timestamp(time) | LogicalType::Time(time)), _) => Some(match time.unit {
            TimeUnit::MILLIS => 3,
            TimeUnit::MICROS => 6,
            TimeUnit::NANOS => 9,
        }),
        (_, None, ConvertedType::TIMESTAMP_MILLIS | ConvertedType::TIME_MILLIS) => Some(3),
        (_, None, ConvertedType::TIMESTAMP_MICROS | ConvertedType::TIME_MICROS) => Some(6),
        _ => None,
    }
}

/// Returns true of a column that the file says to hold decimals.
fn is_decimal(column: &ColumnDescriptor) -> bool {
    matches!(column.logical_type_ref(), Some(LogicalType::Decimal(_)))
        || column.converted_type() == ConvertedType::DECIMAL
}

/// Returns the whole number of bytes, the largest first, in two's complement.
///
/// # Errors
/// It has more than sixteen.
fn whole_of(bytes: &[u8]) -> Result<i128, String> {
    if bytes.len() > 16 {
        return Err("it has decimals of more than 38 digits: store it as float64".to_owned());
    }
    let sign = if bytes.first().is_some_and(|byte| *byte >= 0x80) { -1 } else { 0 };
    Ok(bytes.iter().fold(sign, |whole, byte| (whole << 8) | i128::from(*byte)))
}

/// Returns the decimal places of any whole number.
///
/// # Errors
/// It has more than a number can have.
fn places(column: &ColumnDescriptor) -> Result<usize, String> {
    let scale = if is_decimal(column) { column.type_scale() } else { 0 };
    let places = time_places(column).map_or_else(|| usize::try_from(scale), Ok);
    places.ok().filter(|places| *places <= 38).ok_or_else(|| format!("its scale {scale} is none"))
}

/// Returns a whole number with its last digits behind the point.
fn shifted(value: i128, places: usize) -> String {
    if places == 0 {
        return value.to_string();
    }
    let digits = format!("{:0>width$}", value.unsigned_abs(), width = places + 1);
    let (whole, fraction) = digits.split_at(digits.len() - places);
    format!("{}{whole}.{fraction}", if value < 0 { "-" } else { "" })
}

fn read(
    group: &dyn RowGroupReader,
    n: usize,
    column: &ColumnDescriptor,
    room: &mut Room,
) -> Result<Vec<String>, String> {
    let is_text = column.logical_type_ref() == Some(&LogicalType::String)
        || column.converted_type() == ConvertedType::UTF8;
    let places = places(column)?;
    let is_unsigned = matches!(column.logical_type_ref(), Some(LogicalType::Integer(whole)) if !whole.is_signed)
        || matches!(column.converted_type(), ConvertedType::UINT_32 | ConvertedType::UINT_64);
    let text = |bytes: &ByteArray| {
        bytes.as_utf8().map(one_line).map_err(|_| "it holds text that is not UTF-8".to_owned())
    };
    match group.get_column_reader(n).map_err(in_words)? {
        ColumnReader::BoolColumnReader(reader) => cells(reader, room, |v| Ok(u8::from(*v).to_string())),
        ColumnReader::Int32ColumnReader(reader) => {
            let whole = |v: &i32| if is_unsigned { i128::from(v.cast_unsigned()) } else { i128::from(*v) };
            cells(reader, room, |v| Ok(shifted(whole(v), places)))
        }
        ColumnReader::Int64ColumnReader(reader) => {
            let whole = |v: &i64| if is_unsigned { i128::from(v.cast_unsigned()) } else { i128::from(*v) };
            cells(reader, room, |v| Ok(shifted(whole(v), places)))
        }
        ColumnReader::Int96ColumnReader(reader) => {
            cells(reader, room, |v| Ok(shifted(i128::from(v.to_nanos()), places)))
        }
        ColumnReader::FloatColumnReader(reader) => cells(reader, room, |v| Ok(number(f64::from(*v)))),
        ColumnReader::DoubleColumnReader(reader) => cells(reader, room, |v| Ok(number(*v))),
        ColumnReader::ByteArrayColumnReader(reader) if is_text => cells(reader, room, text),
        ColumnReader::ByteArrayColumnReader(reader) if is_decimal(column) => {
            cells(reader, room, |v| Ok(shifted(whole_of(v.data())?, places)))
        }
        ColumnReader::FixedLenByteArrayColumnReader(reader) if is_decimal(column) => {
            cells(reader, room, |v| Ok(shifted(whole_of(v.data())?, places)))
        }
        _ => Err("it holds neither numbers nor text: store it as float64".to_owned()),
    }
}

/// Says why a column cannot be read.
fn in_words(error: ParquetError) -> String {
    let said = error.to_string();
    // What it was packed by is the last word.
    match said.rsplit_once("Disabled feature at compile time: ") {
        Some((_, packing)) => {
            format!("packed by {packing}, which is not read: write the file with zstd, gzip, lz4 or snappy")
        }
        None => format!("damaged: {said}"),
    }
}

fn cells<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    room: &mut Room,
    text: impl Fn(&T::T) -> Result<String, String>,
) -> Result<Vec<String>, String> {
    let mut cells = Vec::new();
    loop {
        let (mut values, mut levels) = (Vec::new(), Vec::new());
        let (records, ..) =
            reader.read_records(AT_ONCE, Some(&mut levels), None, &mut values).map_err(in_words)?;
        if records == 0 {
            return Ok(cells);
        }
        // A column that may not be null has no levels.
        levels.resize(records, 1);
        let mut values = values.iter();
        for level in levels {
            let value = if level > 0 { values.next() } else { None };
            let cell = value.map_or_else(|| Ok(String::new()), &text)?;
            room.take_cells(1, cell.len())?;
            cells.push(cell);
        }
    }
}

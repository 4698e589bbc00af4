//! Tables of factors as Parquet files, which engines for large collections read: a factor a row, with the
//! labels of its runs.
//!
//! | column | type | content |
//! |---|---|---|
//! | `name` | string | name of the factor |
//! | `label_KEY` | string or null | what all its runs have as label KEY |
//! | `runs`, `rows` | int64 | runs in it, scalar rows absorbed |
//! | `parameters` | int64 | its columns |
//! | `model` | int64 | fingerprint of the model |
//! | `factor` | binary | the bytes of a factor file |
//!
//! Reading needs `factor` alone, and `name` for messages; other columns may be there.

use std::collections::BTreeSet;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::column::reader::ColumnReader;
use parquet::data_type::{ByteArray, ByteArrayType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;

use crate::parquet_file::{self, guarded};
use rigident_fit::factor_file::{FactorFileError, MOST_BYTES};
use rigident_fit::groups::values;
use rigident_fit::pool::{PoolError, PooledFactor};

/// Rows that are written and read together.
const GROUP: usize = 64;
/// The most bytes of the factors that are read together.
const MOST_OF_GROUP: u64 = 1 << 30;
const FACTOR: &str = "factor";
const NAME: &str = "name";

/// Names some factors that are read together: of a factor file its one, of a table those of a group of rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    path: PathBuf,
    group: Option<usize>,
    /// Places in the group; `None`: all.
    chosen: Option<Vec<usize>>,
}

/// Returns true if a path is that of a table by its name.
pub fn is_table(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("parquet"))
}

/// Returns the parts of a file: a factor file is one, a table has several.
///
/// # Errors
/// [`PoolError::Access`] if a table cannot be opened, or is none.
pub fn parts(path: &Path) -> Result<Vec<Part>, PoolError> {
    let part = |group| Part { path: path.to_owned(), group, chosen: None };
    if !is_table(path) {
        return Ok(vec![part(None)]);
    }
    Ok((0..open(path)?.metadata().num_row_groups()).map(|k| part(Some(k))).collect())
}

impl Part {
    /// Returns the part of the factors at some places of what [`Part::read`] returns of the whole.
    #[must_use]
    pub fn only(&self, chosen: Vec<usize>) -> Self {
        Self { chosen: Some(chosen), ..self.clone() }
    }

    /// Returns its factors.
    ///
    /// # Errors
    /// Fails as [`PooledFactor::read`] does; rows of a table are named by their number, from 1.
    pub fn read(&self) -> Result<Vec<PooledFactor>, PoolError> {
        let Some(group) = self.group else { return Ok(vec![PooledFactor::read(&self.path)?]) };
        let reader = open(&self.path)?;
        guarded(|| Ok(self.rows(&reader, group))).map_err(|e| refused(&self.path, &e))?
    }

    /// Returns the factors of a group of rows.
    fn rows(
        &self,
        reader: &SerializedFileReader<File>,
        group: usize,
    ) -> Result<Vec<PooledFactor>, PoolError> {
        let refuse = |error: &dyn std::fmt::Display| refused(&self.path, error);
        let before: i64 = (0..group).map(|k| reader.metadata().row_group(k).num_rows()).sum();
        let rows = reader.get_row_group(group).map_err(|e| refuse(&e))?;
        let columns = rows.metadata().columns();
        let place = |name: &str| columns.iter().position(|c| c.column_path().string() == name);
        let factor = place(FACTOR).ok_or_else(|| refuse(&"it has no column factor"))?;
        let size = columns.get(factor).map_or(0, |c| c.uncompressed_size());
        if u64::try_from(size).is_ok_and(|size| size > MOST_OF_GROUP) {
            return Err(refuse(&"a group of its rows holds more than 1 GiB: write fewer rows a group"));
        }
        let bytes = read(rows.get_column_reader(factor).map_err(|e| refuse(&e))?).map_err(|e| refuse(&e))?;
        let names = place(NAME)
            .and_then(|k| rows.get_column_reader(k).ok())
            .and_then(|reader| read(reader).ok())
            .unwrap_or_default();
        let named = |(k, bytes): (usize, Option<ByteArray>)| {
            let name = names.get(k).and_then(|name| Some(name.as_ref()?.as_utf8().ok()?.to_owned()));
            let row = format!("{}, row {}", self.path.display(), before + k as i64 + 1);
            let place = name.map_or(row.clone(), |name| format!("{row} ({name})"));
            let bytes =
                bytes.ok_or(PoolError::Access { name: place.clone(), reason: "has no factor".to_owned() })?;
            if bytes.len() as u64 > MOST_BYTES {
                let error =
                    FactorFileError::TooLarge { what: "bytes", got: bytes.len() as u64, most: MOST_BYTES };
                return Err(PoolError::File { name: place, error });
            }
            PooledFactor::from_bytes(bytes.data(), &place)
        };
        let chosen = |k: usize| self.chosen.as_ref().is_none_or(|chosen| chosen.contains(&k));
        bytes.into_iter().enumerate().filter(|(k, _)| chosen(*k)).map(named).collect()
    }
}

fn refused(path: &Path, error: &dyn std::fmt::Display) -> PoolError {
    let reason = format!("cannot be read as a table of factors: {error}");
    PoolError::Access { name: path.display().to_string(), reason }
}

fn open(path: &Path) -> Result<SerializedFileReader<File>, PoolError> {
    let file = rigident_files::open(path).map_err(|e| refused(path, &e))?;
    parquet_file::open(file).map_err(|e| refused(path, &e))
}

/// Returns the values of a column of bytes; `None` for null.
fn read(reader: ColumnReader) -> Result<Vec<Option<ByteArray>>, ParquetError> {
    let ColumnReader::ByteArrayColumnReader(mut reader) = reader else {
        return Err(ParquetError::General("its column factor does not hold bytes".to_owned()));
    };
    let (mut values, mut levels) = (Vec::new(), Vec::new());
    let mut all = 0;
    loop {
        let (records, ..) = reader.read_records(GROUP, Some(&mut levels), None, &mut values)?;
        if records == 0 {
            break;
        }
        all += records;
    }
    // A column that may not be null has no levels.
    levels.resize(all, 1);
    let mut values = values.into_iter();
    Ok(levels.into_iter().map(|level| if level > 0 { values.next() } else { None }).collect())
}

/// Returns the bytes of a table of factors.
///
/// # Errors
/// [`PoolError::Access`] names what cannot be written.
pub fn to_bytes(factors: &[PooledFactor], name: &str) -> Result<Vec<u8>, PoolError> {
    let failed = |error: ParquetError| PoolError::Access {
        name: name.to_owned(),
        reason: format!("cannot be written: {error}"),
    };
    let keys: Vec<String> = factors
        .iter()
        .flat_map(|factor| &factor.sources)
        .flat_map(|run| run.labels.keys().cloned())
        .collect::<BTreeSet<String>>()
        .into_iter()
        .collect();
    let schema = Arc::new(schema(&keys).map_err(failed)?);
    let properties = Arc::new(WriterProperties::builder().build());
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, properties).map_err(failed)?;
    for group in factors.chunks(GROUP) {
        let mut rows = writer.next_row_group().map_err(failed)?;
        write_group(&mut rows, group, &keys).map_err(failed)?;
        rows.close().map_err(failed)?;
    }
    writer.into_inner().map_err(failed)
}

fn schema(keys: &[String]) -> Result<Type, ParquetError> {
    let column = |name: &str, physical, logical, repetition| {
        let column = Type::primitive_type_builder(name, physical);
        column.with_logical_type(logical).with_repetition(repetition).build().map(Arc::new)
    };
    let (required, text) = (Repetition::REQUIRED, Some(LogicalType::String));
    let mut columns = vec![column(NAME, Physical::BYTE_ARRAY, text.clone(), required)?];
    for key in keys {
        let name = format!("label_{key}");
        columns.push(column(&name, Physical::BYTE_ARRAY, text.clone(), Repetition::OPTIONAL)?);
    }
    for name in ["runs", "rows", "parameters", "model"] {
        columns.push(column(name, Physical::INT64, None, required)?);
    }
    columns.push(column(FACTOR, Physical::BYTE_ARRAY, None, required)?);
    Type::group_type_builder("factors").with_fields(columns).build()
}

fn write_group(
    rows: &mut SerializedRowGroupWriter<'_, Vec<u8>>,
    group: &[PooledFactor],
    keys: &[String],
) -> Result<(), ParquetError> {
    let texts = |values: Vec<Option<String>>, rows: &mut SerializedRowGroupWriter<'_, Vec<u8>>| {
        let levels: Vec<i16> = values.iter().map(|value| i16::from(value.is_some())).collect();
        let values: Vec<ByteArray> =
            values.into_iter().flatten().map(|v| ByteArray::from(v.into_bytes())).collect();
        write_column::<ByteArrayType>(rows, &values, Some(&levels))
    };
    texts(group.iter().map(|f| Some(f.name.clone())).collect(), rows)?;
    for key in keys {
        let one = std::slice::from_ref(key);
        let of = |factor: &PooledFactor| values(factor, one).ok().and_then(|mut v| v.pop());
        texts(group.iter().map(of).collect(), rows)?;
    }
    let numbers: [&dyn Fn(&PooledFactor) -> u64; 4] =
        [&|f| f.runs(), &|f| f.rows(), &|f| f.parameters.len() as u64, &|f| f.model_fingerprint];
    for number in numbers {
        // The bits of the fingerprint, whatever sign they make.
        let values: Vec<i64> = group.iter().map(|f| number(f).cast_signed()).collect();
        write_column::<Int64Type>(rows, &values, None)?;
    }
    let bytes: Vec<ByteArray> = group.iter().map(|f| ByteArray::from(f.to_bytes())).collect();
    write_column::<ByteArrayType>(rows, &bytes, None)
}

fn write_column<T: parquet::data_type::DataType>(
    rows: &mut SerializedRowGroupWriter<'_, Vec<u8>>,
    values: &[T::T],
    levels: Option<&[i16]>,
) -> Result<(), ParquetError> {
    let Some(mut column) = rows.next_column()? else {
        return Err(ParquetError::General("a column more than the schema has".to_owned()));
    };
    column.typed::<T>().write_batch(values, levels, None)?;
    column.close()
}

#[cfg(test)]
#[path = "factor_table_tests.rs"]
mod tests;

//! Parquet files, opened so that a damaged one is an error.

use std::panic::{AssertUnwindSafe, catch_unwind};

use bytes::Bytes;
use parquet::file::metadata::ColumnChunkMetaData;
use parquet::file::reader::{ChunkReader, FileReader, SerializedFileReader};

const DAMAGED: &str = "as a Parquet file it is damaged or cut off";

/// Returns a reader of a file's bytes, or of a file on the disk, whose columns lie inside the file.
///
/// # Errors
/// Says what is wrong with it.
pub fn open<R: ChunkReader + 'static>(file: R) -> Result<SerializedFileReader<R>, String> {
    let length = file.len();
    let reader = guarded(|| SerializedFileReader::new(file).map_err(|e| format!("{DAMAGED}: {e}")))?;
    let inside = |column: &ColumnChunkMetaData| {
        let start = column.dictionary_page_offset().unwrap_or(column.data_page_offset());
        let end = start.checked_add(column.compressed_size());
        start >= 0
            && column.compressed_size() >= 0
            && column.uncompressed_size() >= 0
            && end.and_then(|end| u64::try_from(end).ok()).is_some_and(|end| end <= length)
    };
    let metadata = reader.metadata();
    let groups = metadata.row_groups();
    if groups.iter().any(|group| group.num_rows() < 0 || !group.columns().iter().all(inside)) {
        return Err(format!("{DAMAGED}: a column lies outside of it"));
    }
    Ok(reader)
}

/// Opens bytes in memory as [`open`] opens a file.
///
/// # Errors
/// Fails as [`open`] does.
pub fn open_bytes(bytes: Vec<u8>) -> Result<SerializedFileReader<Bytes>, String> {
    open(Bytes::from(bytes))
}

/// Returns what `read` makes of a file. Where damage makes the decoder panic, which is another project's, the
/// panic becomes an error like any other.
///
/// # Errors
/// Fails as `read` does, or if it panics.
pub fn guarded<T>(read: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    guarded_as(DAMAGED, read)
}

/// Reads a file of any kind as [`guarded`] does; `damaged` is the message for a file on which the decoder
/// panics.
///
/// # Errors
/// Fails as [`guarded`] does.
pub fn guarded_as<T>(damaged: &str, read: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    // Nothing outlives a panic but the error.
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|_| Err(damaged.to_owned()))
}

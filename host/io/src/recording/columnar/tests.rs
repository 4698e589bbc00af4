use std::io::Write as _;
use std::sync::Arc;

use ::parquet::basic::{Compression, LogicalType, Repetition, TimeUnit, Type as Physical};
use ::parquet::data_type::{DoubleType, FloatType, Int64Type};
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::writer::SerializedFileWriter;
use ::parquet::schema::types::Type;

use super::*;
use crate::recording::Recording;
use crate::rig::RigFile;

/// Makes a Parquet file with a time in ns, a force with gaps, and a rate in single precision.
fn parquet_file(compression: Compression) -> Vec<u8> {
    let column = |name: &str, kind, repetition| {
        Arc::new(Type::primitive_type_builder(name, kind).with_repetition(repetition).build().unwrap())
    };
    let schema = Type::group_type_builder("schema")
        .with_fields(vec![
            column("time_ns", Physical::INT64, Repetition::REQUIRED),
            column("fx_n", Physical::DOUBLE, Repetition::OPTIONAL),
            column("rate", Physical::FLOAT, Repetition::REQUIRED),
        ])
        .build()
        .unwrap();
    let properties = Arc::new(WriterProperties::builder().set_compression(compression).build());
    let mut writer = SerializedFileWriter::new(Vec::new(), Arc::new(schema), properties).unwrap();
    for first in [0, 3] {
        let mut group = writer.next_row_group().unwrap();
        let times: Vec<i64> = (first..first + 3).map(|k| 1_700_000_000_000_000_001 + k).collect();
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<Int64Type>().write_batch(&times, None, None).unwrap();
        column.close().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<DoubleType>().write_batch(&[0.1, -2.5e-7], Some(&[1, 0, 1]), None).unwrap();
        column.close().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<FloatType>().write_batch(&[0.1, 1.0, 2.0], None, None).unwrap();
        column.close().unwrap();
        group.close().unwrap();
    }
    writer.into_inner().unwrap()
}

const AS_CSV: &str = "time_ns,fx_n,rate\n\
                      1700000000000000001,0.1,0.10000000149011612\n1700000000000000002,,1.0\n1700000000000000003,-2.5e-7,2.0\n\
                      1700000000000000004,0.1,0.10000000149011612\n1700000000000000005,,1.0\n1700000000000000006,-2.5e-7,2.0\n";

fn csv(ending: &str, bytes: Vec<u8>) -> Result<String, String> {
    let columns = columns("run", ending, bytes).map_err(|error| error.to_string())?.columns;
    let rows = columns.iter().map(|(_, cells)| cells.len()).max().unwrap_or(0);
    let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
    let mut text = names.join(",") + "\n";
    for row in 0..rows {
        let cells: Vec<&str> = columns.iter().map(|(_, cells)| cells[row].as_str()).collect();
        text += &(cells.join(",") + "\n");
    }
    Ok(text)
}

#[test]
fn parquet_columns_keep_every_digit() {
    for compression in [Compression::UNCOMPRESSED, Compression::SNAPPY] {
        assert_eq!(csv("parquet", parquet_file(compression)).as_deref(), Ok(AS_CSV));
    }
}

#[test]
fn damaged_parquet_is_refused_without_a_panic() {
    let bytes = parquet_file(Compression::SNAPPY);
    for position in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[position] ^= 0x41;
        // There is no check sum in it: what can be read may be wrong, as of a CSV.
        let _ = csv("parquet", damaged);
        assert!(csv("parquet", bytes[..position].to_vec()).is_err(), "cut at {position}");
    }
}

fn element(kind: u32, data: &[u8]) -> Vec<u8> {
    let mut bytes = [kind.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
    bytes.extend(data);
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    bytes
}

/// Makes a matrix of f64, by columns, stored as `kind`.
fn matrix(name: &str, rows: u32, columns: u32, numbers: Vec<u8>) -> Vec<u8> {
    let flags = element(6, &[6, 0, 0, 0, 0, 0, 0, 0]);
    let dimensions = element(5, &[rows.to_le_bytes(), columns.to_le_bytes()].concat());
    let name = if name.len() <= 4 {
        let mut small = ((name.len() as u32) << 16 | 1).to_le_bytes().to_vec();
        small.extend(name.as_bytes());
        small.resize(8, 0);
        small
    } else {
        element(1, name.as_bytes())
    };
    element(14, &[flags, dimensions, name, numbers].concat())
}

fn doubles(values: &[f64]) -> Vec<u8> {
    element(9, &values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())
}

fn mat_file(elements: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = b"MATLAB 5.0 MAT-file".to_vec();
    bytes.resize(124, b' ');
    bytes.extend([0x00, 0x01]);
    bytes.extend(b"IM");
    bytes.extend(elements.concat());
    bytes
}

#[test]
fn variables_of_mat_files_become_columns() {
    let time = matrix("t_s", 3, 1, doubles(&[0.0, 0.001, 0.1 + 0.2]));
    // MATLAB stores whole numbers in the smallest type.
    let force = matrix("fx_n_raw", 1, 3, element(2, &[1, 2, 250]));
    let both = matrix("acc", 3, 2, doubles(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
    let scalar = matrix("rate", 1, 1, doubles(&[1000.0]));
    let expected =
        "t_s,fx_n_raw,acc_1,acc_2\n0.0,1.0,1.0,4.0\n0.001,2.0,2.0,5.0\n0.30000000000000004,250.0,3.0,6.0\n";
    let plain = mat_file(&[time.clone(), force.clone(), both.clone(), scalar.clone()]);
    assert_eq!(csv("mat", plain.clone()).as_deref(), Ok(expected));
    let packed: Vec<Vec<u8>> = [time, force, both, scalar]
        .iter()
        .map(|plain| {
            let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
            encoder.write_all(plain).unwrap();
            let data = encoder.finish().unwrap();
            // What is packed is not padded.
            [15_u32.to_le_bytes().to_vec(), (data.len() as u32).to_le_bytes().to_vec(), data].concat()
        })
        .collect();
    assert_eq!(csv("mat", mat_file(&packed)).as_deref(), Ok(expected));
    for position in 0..plain.len() {
        let mut damaged = plain.clone();
        damaged[position] ^= 0x41;
        let _ = csv("mat", damaged);
        let _ = csv("mat", plain[..position].to_vec());
    }
}

#[test]
fn a_matrix_with_a_quantity_in_each_row_becomes_columns() {
    let time = matrix("t_s", 3, 1, doubles(&[0.0, 1.0, 2.0]));
    let force = matrix("F", 2, 3, doubles(&[1.0, 4.0, 2.0, 5.0, 3.0, 6.0]));
    let known = "t_s,F_1,F_2\n0.0,1.0,4.0\n1.0,2.0,5.0\n2.0,3.0,6.0\n";
    assert_eq!(csv("mat", mat_file(&[time, force])).as_deref(), Ok(known));
}

#[test]
fn tables_of_unequal_length_are_reported() {
    let two = [matrix("t_s", 3, 1, doubles(&[0.0, 1.0, 2.0])), matrix("fx_n", 2, 1, doubles(&[0.0, 1.0]))];
    let said =
        Recording::from_columns("run.mat", mat_file(&two), &RigFile::default()).unwrap_err().to_string();
    assert!(said.contains("column fx_n has 2 rows and column t_s has 3"), "{said}");
    let mut newer = b"MATLAB 7.3 MAT-file".to_vec();
    newer.resize(600, 0);
    assert!(csv("mat", newer).unwrap_err().contains("'-v7'"));
    assert!(csv("mat", b"t_s,fx_n\n".to_vec()).is_err());
    assert!(csv("parquet", b"t_s,fx_n\n".to_vec()).is_err());
}

/// Small files that unpack to more than any memory.
#[test]
fn bombs_end_in_words_before_they_fill_the_memory() {
    // Zeros of one byte: each becomes a number, and a cell.
    let zeros = matrix("t_s", 64 << 20, 1, element(2, &vec![0; 64 << 20]));
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(&zeros).unwrap();
    let data = encoder.finish().unwrap();
    let packed = [15_u32.to_le_bytes().to_vec(), (data.len() as u32).to_le_bytes().to_vec(), data].concat();
    assert!(csv("mat", mat_file(&[packed])).unwrap_err().contains("unpacks to far more"));

    // One text of a megabyte in each of 40 000 rows, by a dictionary.
    let text = Type::primitive_type_builder("note", Physical::BYTE_ARRAY)
        .with_repetition(Repetition::REQUIRED)
        .with_logical_type(Some(::parquet::basic::LogicalType::String))
        .build()
        .unwrap();
    let schema = Type::group_type_builder("schema").with_fields(vec![Arc::new(text)]).build().unwrap();
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(Default::default()))
        .set_dictionary_page_size_limit(4 << 20)
        .build();
    let mut writer = SerializedFileWriter::new(Vec::new(), Arc::new(schema), Arc::new(properties)).unwrap();
    let mut group = writer.next_row_group().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    let long = ::parquet::data_type::ByteArray::from(vec![b'x'; 1 << 20]);
    let values = vec![long; 40_000];
    column.typed::<::parquet::data_type::ByteArrayType>().write_batch(&values, None, None).unwrap();
    column.close().unwrap();
    group.close().unwrap();
    let bytes = writer.into_inner().unwrap();
    assert!(bytes.len() < 1 << 16, "{}", bytes.len());
    assert!(csv("parquet", bytes).unwrap_err().contains("unpacks to far more"));
}

/// Reads a file of a folder beside the project.
fn case(name: &str, rig: &str) -> Result<Recording, String> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/cases/");
    let bytes = std::fs::read(format!("{path}{name}")).unwrap();
    Recording::from_columns(name, bytes, &RigFile::parse(rig).unwrap()).map_err(|error| error.to_string())
}

#[test]
#[ignore = "needs ../shared/cases"]
fn shared_cases_of_parquet_have_the_unit_that_the_file_says() {
    let read = case("parquet-timestamp/t_timestamp_ns.parquet", "").unwrap();
    assert_eq!((read.time_ns[1], read.rate_hz), (1_700_000_000_009_999_872, Some(100.0)));
    // A scale that says the same is the same; another contradicts the file.
    let rig =
        |scale: &str| format!("[recording]\ncolumns = {{ t_s = {{ name = \"t_s\", scale = {scale} }} }}");
    let again = case("parquet-timestamp/t_timestamp_ns.parquet", &rig("1e-9")).unwrap();
    assert_eq!(again.time_ns, read.time_ns);
    let said = case("parquet-timestamp/t_timestamp_ns.parquet", &rig("1e-6")).unwrap_err();
    assert!(said.contains("leave the scale out"), "{said}");
}

#[test]
#[ignore = "needs ../shared/cases"]
fn shared_cases_with_a_matrix_beside_columns_leave_it_out() {
    let read = case("mat-matrix/m_otherlen.mat", "").unwrap();
    assert_eq!((read.rows(), read.extra.len()), (1001, 0));
    assert!(read.warnings.iter().any(|said| said.contains("calib (6 × 6)")), "{:?}", read.warnings);
}

#[test]
fn whole_numbers_have_their_unit_and_their_decimals() {
    use ::parquet::basic::{LogicalType, TimeUnit};
    let logical = [
        (LogicalType::timestamp(true, TimeUnit::MILLIS), "1700000000.123"),
        (LogicalType::timestamp(false, TimeUnit::MICROS), "1700000.000123"),
        (LogicalType::timestamp(false, TimeUnit::NANOS), "1700.000000123"),
        (LogicalType::time(false, TimeUnit::NANOS), "1700.000000123"),
        (LogicalType::decimal(2, 18), "17000000001.23"),
        (LogicalType::integer(64, false), "1700000000123"),
    ];
    for (kind, known) in logical {
        let column = Type::primitive_type_builder("a", Physical::INT64).with_logical_type(Some(kind.clone()));
        let column = column.with_repetition(Repetition::REQUIRED).with_precision(18);
        let column = column.with_scale(if known == "17000000001.23" { 2 } else { 0 });
        let schema = Type::group_type_builder("schema").with_fields(vec![Arc::new(column.build().unwrap())]);
        let schema = Arc::new(schema.build().unwrap());
        let mut writer = SerializedFileWriter::new(Vec::new(), schema, Arc::default()).unwrap();
        let mut group = writer.next_row_group().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<Int64Type>().write_batch(&[1_700_000_000_123, -1], None, None).unwrap();
        column.close().unwrap();
        group.close().unwrap();
        let table = columns("run", "parquet", writer.into_inner().unwrap()).unwrap();
        assert_eq!(table.columns[0].1[0], known, "{kind:?}");
        assert_eq!(table.times.is_empty(), matches!(known, "17000000001.23" | "1700000000123"), "{kind:?}");
    }
}

/// Decimals of pyarrow (`fuzz/make_tables.py`) in 4, 8 and 16 bytes, and as whole numbers.
#[test]
fn decimals_of_parquet_are_the_numbers_that_were_written() {
    use crate::recording::csv::exports_tests::check;

    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/recording_table");
    for name in ["decimals.parquet", "decimals_whole.parquet"] {
        check(&Recording::load(&folder.join(name), None).unwrap_or_else(|e| panic!("{e}")), name);
    }
}

/// Times that a file declares are in seconds, with names of other programs and without a rig file too.
#[test]
fn declared_times_need_no_unit_in_their_name() {
    for (name, unit) in
        [("time", TimeUnit::MICROS), ("time_ns", TimeUnit::NANOS), ("Zeit [ms]", TimeUnit::MILLIS)]
    {
        let kind = LogicalType::timestamp(false, unit);
        let time = Type::primitive_type_builder(name, Physical::INT64).with_logical_type(Some(kind));
        let mut fields = vec![Arc::new(time.with_repetition(Repetition::REQUIRED).build().unwrap())];
        let axes = ["Fx [N]", "Fy [N]", "Fz [N]", "Mx [Nm]", "My [Nm]", "Mz [Nm]"];
        fields.extend(axes.map(|axis| {
            let axis = Type::primitive_type_builder(axis, Physical::DOUBLE);
            Arc::new(axis.with_repetition(Repetition::REQUIRED).build().unwrap())
        }));
        let schema = Type::group_type_builder("schema").with_fields(fields).build().unwrap();
        let properties = Arc::new(WriterProperties::builder().build());
        let mut writer = SerializedFileWriter::new(Vec::new(), Arc::new(schema), properties).unwrap();
        let mut group = writer.next_row_group().unwrap();
        // Steps of 20 ms from 2023 on.
        let step = match unit {
            TimeUnit::MILLIS => 20,
            TimeUnit::MICROS => 20_000,
            TimeUnit::NANOS => 20_000_000,
        };
        let times: Vec<i64> = (0..4).map(|k| (85_000_000_000 + k) * step).collect();
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<Int64Type>().write_batch(&times, None, None).unwrap();
        column.close().unwrap();
        for _ in axes {
            let mut column = group.next_column().unwrap().unwrap();
            column.typed::<DoubleType>().write_batch(&[1.0, 2.0, 3.0, 4.0], None, None).unwrap();
            column.close().unwrap();
        }
        group.close().unwrap();
        let bytes = writer.into_inner().unwrap();
        let recording = Recording::from_columns("run.parquet", bytes, &RigFile::default());
        let recording = recording.unwrap_or_else(|error| panic!("{name}: {error}"));
        let wanted: Vec<u64> = (0..4).map(|k| 1_700_000_000_000_000_000 + 20_000_000 * k).collect();
        assert_eq!(recording.time_ns, wanted, "{name}");
    }
}

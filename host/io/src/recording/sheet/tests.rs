use std::path::{Path, PathBuf};

use super::*;
use crate::recording::csv::exports_tests::check;
use crate::recording::import::{Choices, understand};
use crate::recording::{Recording, RecordingError};
use crate::rig::RigFile;

/// Files of openpyxl and of pandas with XlsxWriter; `fuzz/make_tables.py` writes them.
fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/recording_table").join(name)
}

fn load(name: &str) -> Result<Recording, RecordingError> {
    Recording::load(&path(name), None)
}

#[test]
fn a_german_sheet_with_a_preamble_and_times_is_read() {
    let recording = load("openpyxl.xlsx").unwrap();
    check(&recording, "openpyxl");
    // 2026-11-20T10:12:33Z; a serial day has 0.6 µs.
    assert!(recording.time_ns[0].abs_diff(1_795_169_553_000_000_000) < 1_000, "{}", recording.time_ns[0]);
    // Names in row 4, units in row 5.
    assert_eq!(recording.place(0), "line 6");
    assert!(recording.comments[0].1.starts_with("Prüfling:\t"), "{:?}", recording.comments);
    assert!(recording.extra.iter().any(|(name, cells)| name == "Bemerkung" && cells[0] == "Start"));
    let found = understand(&path("openpyxl.xlsx")).unwrap();
    assert_eq!(found.written, [("form", "xlsx".to_owned()), ("sheet", "Messung 1".to_owned())]);
    assert_eq!(found.header_line, Some(5));
    let columns = found.proposal(&Choices::default()).unwrap();
    assert_eq!(columns["mz_nm"], ("Moment Z".to_owned(), Some("Nm".to_owned())));
    assert_eq!(columns["t_s"], ("Zeit".to_owned(), None));
}

#[test]
fn the_first_sheet_with_a_table_is_read_and_others_are_named() {
    let recording = load("pandas.xlsx").unwrap();
    check(&recording, "pandas");
    assert!(
        recording.warnings.iter().any(|w| w.contains("\"run 1\" is read; \"run 2\" hold tables too")),
        "{:?}",
        recording.warnings
    );
}

#[test]
fn numbers_that_are_text_are_read_where_it_is_clear_which_they_are() {
    check(&load("text_cells.xlsx").unwrap(), "text with decimal commas");
    let said = load("unclear_cells.xlsx").unwrap_err().to_string();
    assert!(said.contains("decimals or of thousands") && said.contains("decimal = \"comma\""), "{said}");
    let bytes = std::fs::read(path("unclear_cells.xlsx")).unwrap();
    let first = |mark: &str| {
        let rig = RigFile::parse(&format!("[recording]\ndecimal = \"{mark}\"\n")).unwrap();
        Recording::from_columns("a.xlsx", bytes.clone(), &rig).unwrap().wrench.unwrap()[3][0]
    };
    assert_eq!((first("comma"), first("point")), (1.503, 1503.0));
}

#[test]
fn days_are_dates() {
    use calamine::ExcelDateTimeType::{DateTime, TimeDelta};
    for (serial, kind, is_1904, text) in [
        (46_346.425, DateTime, false, "2026-11-20T10:12:00.000000"),
        (44_884.425, DateTime, true, "2026-11-20T10:12:00.000000"),
        (46_346.999_999_999_99, DateTime, false, "2026-11-21T00:00:00.000000"),
        (61.0, DateTime, false, "1900-03-01T00:00:00.000000"),
        (0.5, DateTime, false, "12:00:00.000000"),
        (0.5, TimeDelta, false, "1899-12-30T12:00:00.000000"),
        (1.5, TimeDelta, false, "1899-12-31T12:00:00.000000"),
        (1e300, DateTime, false, "1e300"),
    ] {
        assert_eq!(stamp(&ExcelDateTime::new(serial, kind, is_1904)), text, "{serial}");
    }
}

#[test]
fn damaged_and_swollen_workbooks_are_refused() {
    let good = std::fs::read(path("pandas.xlsx")).unwrap();
    for length in (0..good.len()).step_by(97) {
        assert!(read(&good[..length], None).is_err());
    }
    // A gigabyte of blanks in a megabyte.
    let mut file = zip::ZipWriter::new(Cursor::new(Vec::new()));
    file.start_file("xl/workbook.xml", zip::write::SimpleFileOptions::default()).unwrap();
    let piece = vec![b' '; 1 << 20];
    for _ in 0..1024 {
        std::io::Write::write_all(&mut file, &piece).unwrap();
    }
    let bytes = file.finish().unwrap().into_inner();
    let said = read(&bytes, None).unwrap_err();
    assert!(said.contains("far more than a recording"), "{said}");
}

#[test]
fn old_workbooks_are_named_with_advice() {
    let said = Recording::load(Path::new("a.xls"), None).unwrap_err().to_string();
    assert!(said.contains("save it as .xlsx"), "{said}");
}

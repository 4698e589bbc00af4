use std::fmt::Write as _;
use std::io::Write;

use super::*;
use crate::rig::WrenchSign;

const HEADER: &str = "t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,imu_ax_mps2,imu_ay_mps2,imu_az_mps2,\
                      imu_gx_radps,imu_gy_radps,imu_gz_radps,lamp\n";

/// Rows at 200 per second; line n + 3 holds row n.
fn text(rows: usize) -> String {
    let mut text = String::from("# operator = A. N. Other\n") + HEADER;
    for n in 0..rows {
        let third = n as f64 / 3.0;
        writeln!(
            text,
            "{:?},1.5,-2.0,300.0,0.1,{third:?},-0.0,0.0,0.25,9.81,0.0,1e-5,0.0,on",
            n as f64 / 200.0
        )
        .unwrap();
    }
    text
}

fn read(text: &str, rig: &str) -> Result<Recording, RecordingError> {
    Recording::from_csv_bytes("test.csv", text.as_bytes(), &RigFile::parse(rig).unwrap())
}

fn with_line(n: usize, from: &str, to: &str) -> String {
    let good = text(10);
    let mut lines: Vec<_> = good.lines().map(str::to_owned).collect();
    let changed = lines[n].replacen(from, to, 1);
    assert_ne!(changed, lines[n]);
    lines[n] = changed;
    lines.join("\n")
}

#[test]
fn written_files_are_read_to_the_last_bit_and_byte() {
    let recording = read(&text(50), "").unwrap();
    assert_eq!((recording.name.as_str(), recording.rows()), ("test", 50));
    assert_eq!(recording.rate_hz, Some(200.0));
    assert_eq!(recording.extra[0].0, "lamp");
    assert_eq!(recording.comment("operator"), Some("A. N. Other"));
    assert!(recording.wrench.as_ref().unwrap()[0][5].is_sign_negative());
    assert_eq!(recording.to_csv(), text(50));
    assert_eq!(read(&recording.to_csv(), "").unwrap(), recording);
}

#[test]
fn order_of_columns_and_quoted_texts_are_kept() {
    let text = "# taken on a \
                Tuesday\nnote,imu_gx_radps,imu_gy_radps,t_s,imu_gz_radps\n\"a, \"\"b\"\"\",1.0,2.0,0.0,3.0\n\
                ,1.0,2.0,0.3333333333333333,3.0\n,1.0,2.0,0.6666666666666666,3.0\n";
    let recording = read(text, "").unwrap();
    assert_eq!(recording.to_csv(), text);
    assert_eq!(recording.imus[0].gyro.as_ref().unwrap()[0], [1.0, 2.0, 3.0]);
    assert_eq!(recording.imus[0].accel, None);
}

#[test]
fn a_first_column_that_looks_like_a_comment_stays_a_column() {
    let text = "\"#\",imu_gx_radps,imu_gy_radps,imu_gz_radps,t_s\n#1,1.0,2.0,3.0,0.0\n#2,1.0,2.0,3.0,0.5\n";
    let recording = read(text, "").unwrap();
    assert_eq!(recording.extra, [("#".to_owned(), vec!["#1".to_owned(), "#2".to_owned()])]);
    assert_eq!(recording.to_csv(), text);
    assert_eq!(read(&recording.to_csv(), "").unwrap(), recording);
}

#[test]
fn a_name_full_of_other_separators_is_read_again_as_one_column() {
    let tabs = "\t".repeat(40);
    for (before, name) in [("", format!("\"a{tabs}\"")), ("\n", format!("\"{tabs}\""))] {
        let first = read(&text(5).replacen("t_s", &format!("{before}t_s"), 1).replacen("lamp", &name, 1), "")
            .unwrap();
        assert_eq!(first.extra.len(), 1);
        let written = first.to_csv();
        let again = read(&written, "").unwrap();
        // The name may take two lines.
        assert_eq!(
            Recording { first_line: None, ..again },
            Recording { first_line: None, ..first },
            "{name:?}"
        );
    }
}

#[test]
fn a_mark_of_byte_order_and_other_line_ends_do_not_matter() {
    let plain = read(&text(5), "").unwrap();
    let dos = format!("\u{feff}{}", text(5).replace('\n', "\r\n"));
    assert_eq!(read(&dos, "").unwrap(), plain);
}

#[test]
fn semicolons_tabs_and_bars_separate_columns_too() {
    let plain = read(&text(5), "").unwrap();
    for separator in [";", "\t", "|"] {
        assert_eq!(read(&text(5).replace(',', separator), "").unwrap(), plain, "{separator:?}");
    }
    // A comma inside a name does not make it the separator.
    let named = text(5).replace(',', ";").replace("lamp", "lamp, left");
    assert_eq!(read(&named, "").unwrap().extra[0].0, "lamp, left");
    let comma = read(&text(5).replace(',', ";").replace("0.0", "0,0"), "").unwrap_err().to_string();
    assert!(comma.contains("decimals have a point"), "{comma}");
}

#[test]
fn foreign_columns_units_and_signs_are_brought_into_the_notation() {
    let foreign = text(10).replace("fx_n", "Fx").replace("fy_n", "fy_lbf").replace("t_s", "time");
    let rig = "[recording]\nwrench_sign = \"on_sensor\"\n[recording.columns]\nfx_n = \"Fx\"\n\
               fy_n = { name = \"fy_lbf\", scale = 4.4482216152605 }\nt_s = \
               { name = \"time\", scale = 1e-3 }";
    let recording = read(&foreign, rig).unwrap();
    let wrench = recording.wrench.as_ref().unwrap();
    assert_eq!(wrench[0][..3], [-1.5, 2.0 * 4.4482216152605, -300.0]);
    assert_eq!(recording.time_ns[1], 5_000);
    assert_eq!(recording.rate_hz, Some(200e3));
    // The rig file says what the recording now is; the number before scaling is stored.
    assert_eq!(recording.rig, RigFile::default());
    assert_eq!((recording.extra[0].0.as_str(), recording.extra[0].1[0].as_str()), ("raw_fy_lbf", "-2.0"));
    assert_eq!(recording.extra[1].0, "lamp");
    let again = read(&recording.to_csv(), "").unwrap();
    assert_eq!((again.wrench, again.time_ns), (recording.wrench, recording.time_ns));
}

#[test]
fn gauges_of_a_sensor_that_reports_the_reaction_take_the_sign_in_their_matrix() {
    let text = "t_s,g1_v,g2_v,g3_v,g4_v,g5_v,g6_v\n0,1,2,3,4,5,6\n1,1,2,3,4,5,6\n";
    let mut rig = RigFile::default();
    rig.recording.wrench_sign = WrenchSign::OnSensor;
    rig.load_cell.calibration = Some([[2.0; 6]; 6]);
    let recording = Recording::from_csv_bytes("g.csv", text.as_bytes(), &rig).unwrap();
    assert_eq!(recording.rig.load_cell.calibration, Some([[-2.0; 6]; 6]));
    assert_eq!(recording.gauges.unwrap()[0], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
}

#[test]
fn comments_state_keys_of_the_rig_file() {
    let signed = format!("# wrench_sign = \"on_sensor\"\n# rate_hz = 200.0\n{}", text(5));
    let recording = read(&signed, "").unwrap();
    assert_eq!(recording.wrench.as_ref().unwrap()[0][0], -1.5);
    // Written again it is in the on-body sign, and says nothing else.
    assert_eq!(read(&recording.to_csv(), "").unwrap().wrench, recording.wrench);
    let still = "# static = true\nfx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,t_s\n1,2,3,4,5,6,9\n1,2,3,4,5,6,7\n";
    let recording = read(still, "").unwrap();
    assert!(recording.is_static && recording.time_ns.is_empty() && recording.rate_hz.is_none());
    assert_eq!(recording.extra, [("t_s".to_owned(), vec!["9".to_owned(), "7".to_owned()])]);
    for (comment, rig) in
        [("rate_hz = 100", "[recording]\nrate_hz = 200"), ("rate_hz = often", ""), ("wrench_sign = 3", "")]
    {
        let error = read(&format!("# {comment}\n{}", text(5)), rig).unwrap_err().to_string();
        assert!(error.contains("test.csv, line 1") && error.contains("comment"), "{error}");
    }
}

#[test]
fn a_comment_stays_on_its_line() {
    let mut recording = read(&text(3), "").unwrap();
    recording.comments.push(("note".to_owned(), "one\r\ntwo, three".to_owned()));
    let again = read(&recording.to_csv(), "").unwrap();
    assert_eq!((again.comment("note"), again.rows()), (Some("one  two, three"), 3));
    let words = format!("# = no key\n# = \n{}", text(3));
    assert_eq!(read(&words, "").unwrap().to_csv(), words.replace("# = \n", "# =\n"));
}

#[test]
fn a_full_disk_is_distinguished_from_other_failures() {
    struct Full;
    impl Write for Full {
        fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
            Err(std::io::ErrorKind::StorageFull.into())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let mut recording = read(&text(3000), "").unwrap();
    recording.comments.clear();
    let error = recording.write_csv(Full).err().unwrap();
    assert_eq!(error.kind(), std::io::ErrorKind::StorageFull);
}

#[test]
fn jitter_is_tolerated_and_gaps_are_reported() {
    let mut text = String::from("t_s,imu_gx_radps,imu_gy_radps,imu_gz_radps\n");
    // 300 rows per second, stamped in whole milliseconds; a quarter of a second is missing.
    for n in (0..600).chain(675..900) {
        writeln!(text, "{:.3},0,0,0", f64::from(n) / 300.0).unwrap();
    }
    let recording = read(&text, "[recording]\nrate_hz = 300").unwrap();
    assert!((recording.rate_hz.unwrap() - 300.0).abs() < 0.5);
    assert_eq!(recording.warnings.len(), 1);
    assert!(recording.warnings[0].contains("about 75 rows"), "{:?}", recording.warnings);
}

#[test]
fn times_before_zero_and_between_nanoseconds_come_back() {
    let mut text = String::from("t_s,imu_gx_radps,imu_gy_radps,imu_gz_radps\n");
    let times: Vec<f64> = (0..20).map(|n| f64::from(n) / 3.0 - 1.0).collect();
    for t in &times {
        writeln!(text, "{t:?},0.0,0.0,0.0").unwrap();
    }
    let recording = read(&text, "").unwrap();
    assert_eq!(recording.time_ns[..2], [0, 333_333_333]);
    assert_eq!(recording.exact_time_s.as_ref(), Some(&times));
    assert_eq!(recording.to_csv(), text);
    // Microseconds since 1970 keep all their digits.
    let stamps = "t,imu_gx_radps,imu_gy_radps,imu_gz_radps\n1708857503931759,0,0,0\n1708857503935705,0,0,0\n";
    let rig = "[recording]\ncolumns = { t_s = { name = \"t\", scale = 1e-6 } }";
    let recording = read(stamps, rig).unwrap();
    assert_eq!(recording.time_ns, [1_708_857_503_931_759_000, 1_708_857_503_935_705_000]);
    assert!(recording.to_csv().contains("\n1708857503.935705,"));
}

/// Each kind of bad input, and the words that its message must hold.
#[test]
fn bad_input_is_named_with_its_place() {
    let good = text(10);
    let one = "0,1,1,1,1,1,1,1,1,1,1,1,1,1\n";
    for (text, rig, words) in [
        (String::new(), "", &["test.csv is not a recording", "empty"][..]),
        ("\u{0}PNG".to_owned(), "", &["not a recording", "not text"]),
        ("\u{FFFD}a,b\n1,2\n".to_owned(), "", &["not a recording", "none of its columns is known"]),
        ("<html></html>".to_owned(), "", &["not a recording"]),
        (HEADER.to_owned(), "", &["not a recording", "no rows"]),
        (good.replace(',', ":"), "", &["unknown unit"]),
        (good.replace("my_nm,", ""), "", &["line 3", "14 values, the header 13 names"]),
        (good.replace("my_nm", "torque"), "", &["column my_nm is missing beside fx_n, fy_n"]),
        (good.replace("my_nm", "My"), "", &["my_nm is missing", "is it \"My\"?"]),
        (good.replace("fx_n", "fx_lbf"), "", &["column fx_lbf", "unknown unit: it must be fx_n", "scale"]),
        (HEADER.replace("lamp", "gx_g") + one, "", &["gx_g", "unknown unit", "gx_mps2"]),
        (HEADER.replace("lamp", "imu1_ax_g") + one, "", &["imu1_ax_mps2"]),
        // An angular rate is not taken for gravity.
        (HEADER.replace("lamp", "gx_radps") + one, "", &["column gx_radps", "it must be imu_gx_radps"]),
        (good.replace("t_s", "t_ms"), "", &["t_ms", "it must be t_s"]),
        (good.replace("t_s", "Time"), "", &["column t_s is missing", "is it \"Time\"?"]),
        (good.replace("t_s", "lamp2"), "", &["column t_s is missing", "static = true"]),
        (good.replace("lamp", "fx_n"), "", &["\"fx_n\" appears twice"]),
        (HEADER.replace("lamp", "imu0_ax_mps2") + one, "", &["imu_ax_mps2 is in two columns"]),
        (with_line(4, "300.0", "NaN"), "", &["test.csv, line 5, column fz_n", "NaN is not a finite number"]),
        (with_line(4, "300.0", "-inf"), "", &["line 5, column fz_n", "finite"]),
        (with_line(4, "300.0", "1e999"), "", &["line 5, column fz_n", "finite"]),
        (with_line(4, "300.0", "n/a"), "", &["line 5, column fz_n", "\"n/a\" is not a number: correct it"]),
        (with_line(4, "300.0", ""), "", &["line 5, column fz_n", "missing"]),
        (
            with_line(4, "0.01,", "0.002,"),
            "",
            &["line 5, column t_s", "backwards from 0.005 s (row 2, line 4) to 0.002 s"],
        ),
        (with_line(4, "0.01,", "0.005,"), "", &["line 5", "stands still"]),
        (with_line(4, "0.01,", "soon,"), "", &["line 5, column t_s"]),
        (with_line(6, ",on", ""), "", &["line 7", "13 values, the header 14 names"]),
        (good.clone(), "[recording]\nrate_hz = 100", &["200.000000 rows per second", "rate_hz says 100"]),
        (good.clone(), "[recording]\ncolumns = { fx_n = \"Fx\" }", &["\"Fx\"", "is it \"fx_n\"?"]),
        (
            good.clone(),
            "[recording]\ncolumns = { fx_n = \"lamp\", fy_n = \"lamp\" }",
            &["can be one of them"],
        ),
        (good.clone(), "[recording]\ncolumns = { fx_n = \"fy_n\" }", &["fx_n is in two columns"]),
        (good.clone(), "[recording]\ncolumns = { fx_n = { name = \"lamp\", scale = 2 } }", &["two columns"]),
    ] {
        let error = read(&text, rig).expect_err(words[0]).to_string();
        for word in words {
            assert!(error.contains(word), "{word}\n{error}");
        }
    }
    let mcap = Recording::from_csv_bytes("a.csv", b"\x89MCAP0\r\n", &RigFile::default()).unwrap_err();
    assert!(mcap.to_string().contains(".mcap"));
    let latin = Recording::from_csv_bytes("a.csv", b"t_s,\n\xE9\x01", &RigFile::default()).unwrap_err();
    assert!(latin.to_string().contains("not text (line 2)"));
}

#[test]
fn mutated_files_never_panic() {
    let good = text(6).into_bytes();
    let rig = RigFile::default();
    let mut state = 88_172_645_463_325_252_u64;
    for _ in 0..20_000 {
        let mut bytes = good.clone();
        for _ in 0..4 {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            let position = state as usize % bytes.len();
            bytes[position] = (state >> 32) as u8;
        }
        let _ = Recording::from_csv_bytes("x", &bytes, &rig);
    }
}

/// Both readers give the same recording; a file that is not plain is left to the careful one.
#[test]
fn plain_files_are_read_to_the_same_bits_in_pieces() {
    let both = |text: &str, rig: &str| {
        let rig = RigFile::parse(rig).unwrap();
        let careful = Recording::from_csv_with_care("test.csv", text.as_bytes(), &rig);
        (Recording::from_plain_csv("test.csv", text.as_bytes(), &rig), careful)
    };
    // More than a piece, with numbers of all kinds, blanks, empty lines and texts.
    let mut long = text(40_000);
    long = long.replace(",0.25,", ", 2.5e-1,").replace(",on\n", ", on the lamp \n").replacen(
        "on the lamp \n",
        "\n\n",
        3,
    );
    assert!(long.len() > 2 << 20, "{}", long.len());
    let scaled = "[recording]\ncolumns = { fx_n = { name = \"fx_n\", scale = 2.0, offset = 0.5 } }\n";
    let separated = long.replace(',', ";").replace('\n', "\r\n");
    let before_zero = long.replace("\n0.", "\n-0.");
    for (text, rig) in [(&long, ""), (&long, scaled), (&separated, ""), (&before_zero, "")] {
        match both(text, rig) {
            (Some(plain), Ok(careful)) => {
                assert_eq!(plain, careful);
                let bits = |r: &Recording| {
                    r.wrench.iter().flatten().flatten().map(|v| v.to_bits()).collect::<Vec<_>>()
                };
                assert_eq!(bits(&plain), bits(&careful));
                assert_eq!(plain.place(39_999), careful.place(39_999));
            }
            (None, Err(error)) => assert!(text == &before_zero, "{error}"),
            (plain, careful) => panic!("{} {:?}", plain.is_some(), careful.err()),
        }
    }
    let good = text(10);
    for wrong in [
        good.replace("0.1,", "\"0.1\","),
        good.replace("0.1,", "x,"),
        good.replace("0.1,", "nan,"),
        good.replace("0.1,", ""),
        good.replace("0.1,", "0.1\r,"),
        good.replace("on\n", "\0\n"),
        good.replace("fx_n,", ""),
        good.replace("\n0.01,", "\n0.005,"),
        String::from(HEADER),
        String::new(),
    ] {
        let (plain, careful) = both(&wrong, "");
        assert!(plain.is_none(), "{wrong}");
        let whole = Recording::from_csv_bytes("test.csv", wrong.as_bytes(), &RigFile::default());
        assert_eq!(whole, careful);
    }
}

#[test]
fn a_column_whose_name_steers_and_a_line_without_end_are_refused() {
    for name in ["\"a\nrigident: safe\"", "\u{1b}[2J", "a\u{202e}b", "\u{9b}8m"] {
        let text = format!("t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,{name}\n0,1,2,3,4,5,6,7\n");
        let said =
            Recording::from_csv_bytes("a.csv", text.as_bytes(), &RigFile::default()).unwrap_err().to_string();
        assert!(said.contains("column 8 has control characters"), "{said}");
        assert!(!said.chars().any(rigident_shared::printable::steers), "{said:?}");
    }
    let long = format!("t_s,fx_n\n0,{}\n", "1".repeat(20 << 20));
    let said =
        Recording::from_csv_bytes("a.csv", long.as_bytes(), &RigFile::default()).unwrap_err().to_string();
    assert!(said.contains("line 2 is longer than"), "{said}");
}

#[test]
fn more_columns_than_a_recording_has_are_refused_before_they_are_searched() {
    for separator in [",", ";", "\t"] {
        let row = |cell: &dyn Fn(usize) -> String| (0..5000).map(cell).collect::<Vec<_>>().join(separator);
        let text = format!("{}\n{}\n", row(&|k| format!("c{k}")), row(&|_| "1".to_owned()));
        let said = read(&text, "").unwrap_err().to_string();
        assert!(said.contains("5000 columns") && said.contains("up to 4096"), "{said}");
    }
}

//! Tables as other programs write them: every number is the one that was written, or there is none.

use std::fmt::Write as _;

use super::*;

/// A country's way of writing.
struct Locale {
    separator: char,
    decimal: char,
    thousands: &'static str,
}

const fn locale(separator: char, decimal: char, thousands: &'static str) -> Locale {
    Locale { separator, decimal, thousands }
}

/// German, French, Swiss, American, British with tabs, Brazilian, Swedish, Polish.
const LOCALES: [Locale; 8] = [
    locale(';', ',', "."),
    locale(';', ',', "\u{202f}"),
    locale(';', '.', "'"),
    locale('\t', '.', ","),
    locale('\t', '.', ""),
    locale('\t', ',', "."),
    locale(';', ',', "\u{a0}"),
    locale('|', ',', " "),
];
pub(in crate::recording) const ROWS: usize = 40;
const NAMES: [&str; 7] = ["Time", "Fx", "Fy", "Fz", "Mx", "My", "Mz"];
const UNITS: [&str; 7] = ["s", "N", "N", "N", "Nm", "Nm", "Nm"];

/// Returns whole thousandths for every cell: known numbers without a rounding.
pub(in crate::recording) fn thousandths(row: usize, k: usize) -> i64 {
    let (row, k) = (row as i64, k as i64);
    match k {
        0 => 2 * row,
        1 => 1_234_567 + 17 * row,
        3 => -2_000_500 - row,
        _ => (row * 37 + k * 101) % 4001 - 2000,
    }
}

pub(in crate::recording) fn number(thousandths: i64) -> f64 {
    format!(
        "{}{}.{:03}",
        if thousandths < 0 { "-" } else { "" },
        thousandths.abs() / 1000,
        thousandths.abs() % 1000
    )
    .parse()
    .unwrap()
}

fn written(thousandths: i64, locale: &Locale) -> String {
    let size = thousandths.abs();
    let mut whole = (size / 1000).to_string();
    if whole.len() > 3 {
        whole.insert_str(whole.len() - 3, locale.thousands);
    }
    let sign = if thousandths < 0 { "-" } else { "" };
    format!("{sign}{whole}{}{:03}", locale.decimal, size % 1000)
}

fn rows(locale: &Locale) -> String {
    let mut text = String::new();
    for row in 0..ROWS {
        let cells: Vec<String> = (0..7).map(|k| written(thousandths(row, k), locale)).collect();
        writeln!(text, "{}", cells.join(&locale.separator.to_string())).unwrap();
    }
    text
}

fn header(locale: &Locale) -> String {
    let between = locale.separator.to_string();
    let units: Vec<String> = UNITS.iter().map(|unit| format!("[{unit}]")).collect();
    format!("{}\n{}\n", NAMES.join(&between), units.join(&between))
}

fn read(bytes: &[u8], rig: &str) -> Result<Recording, RecordingError> {
    Recording::from_csv_bytes("export.csv", bytes, &RigFile::parse(rig).unwrap())
}

#[track_caller]
pub(in crate::recording) fn check(recording: &Recording, what: &str) {
    let wrench = recording.wrench.as_ref().unwrap_or_else(|| panic!("{what}: no wrench"));
    assert_eq!(wrench.len(), ROWS, "{what}");
    let start = recording.time_ns[0];
    for (row, own) in wrench.iter().enumerate() {
        for (k, value) in own.iter().enumerate() {
            assert_eq!(
                value.to_bits(),
                number(thousandths(row, k + 1)).to_bits(),
                "{what}, row {row}, column {k}"
            );
        }
        assert_eq!(recording.time_ns[row] - start, 2_000_000 * row as u64, "{what}");
    }
}

#[test]
fn every_country_and_encoding_gives_the_same_numbers() {
    for (n, locale) in LOCALES.iter().enumerate() {
        let text = format!("Prüfling: Halter 4711\nDatum: 20.11.2026\n\n{}{}", header(locale), rows(locale));
        for ends in ["\n", "\r\n"] {
            let text = text.replace('\n', ends);
            let what = format!("locale {n}, {ends:?}");
            check(&read(text.as_bytes(), "").unwrap(), &what);
            check(&read(format!("\u{feff}{text}").as_bytes(), "").unwrap(), &what);
            let little: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
            let big: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
            check(&read(&little, "").unwrap(), &what);
            check(&read(&big, "").unwrap(), &what);
            check(&read(&[&[0xff, 0xfe], little.as_slice()].concat(), "").unwrap(), &what);
            check(&read(&[&[0xfe, 0xff], big.as_slice()].concat(), "").unwrap(), &what);
            if locale.thousands != "\u{202f}" {
                // Letters up to ÿ have their own number in Windows-1252.
                let windows: Vec<u8> = text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
                check(&read(&windows, "").unwrap(), &what);
            }
        }
    }
}

/// Five tables in each of six locales, which pandas wrote (`fuzz/make_tables.py`): the numbers that were
/// written.
#[test]
fn thirty_tables_of_pandas_in_six_locales_are_read() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/recording_csv");
    for locale in ["de", "fr", "ch", "us", "gb", "pl"] {
        for kind in ["", "_utf16", "_cp1252", "_quoted", "_dates"] {
            let name = format!("pandas_{locale}{kind}");
            let bytes = std::fs::read(folder.join(&name)).unwrap();
            let recording = read(&bytes, "").unwrap_or_else(|error| panic!("{name}: {error}"));
            check(&recording, &name);
            let begins = recording.time_ns[0];
            let wanted = if kind == "_dates" { 1_795_169_553_000_000_000 } else { 0 };
            assert_eq!(begins, wanted, "{name}");
        }
    }
}

#[test]
fn lines_that_are_no_rows_do_not_matter() {
    let german = &LOCALES[0];
    let (head, body) = (header(german), rows(german));
    let trailing = |text: &str| text.lines().map(|line| format!("{line};\n")).collect::<String>();
    let quoted = |text: &str| {
        let line =
            |line: &str| line.split(';').map(|c| format!("\"{c}\"")).collect::<Vec<_>>().join(";") + "\n";
        text.lines().map(line).collect::<String>()
    };
    let commas = |text: &str| quoted(text).replace("\";\"", "\",\"");
    let with_units = "Time [s];Fx [N];Fy [N];Fz [N];Mx [Nm];My [Nm];Mz [Nm]\n";
    let slashes = "t/s;F_x/N;F_y/N;F_z/N;M_x/Nm;M_y/Nm;M_z/Nm\n";
    let words = "Zeit (s);Kraft X (N);Kraft Y (N);Kraft Z (N);Torque X (N m);Torque Y (N m);Torque Z (N m)\n";
    for (what, text) in [
        ("names with units", format!("{with_units}{body}")),
        ("names with units after a slash", format!("{slashes}{body}")),
        ("words", format!("{words}{body}")),
        ("separators at the end", trailing(&format!("{head}{body}"))),
        ("separators at the end of the rows", format!("{head}{}", trailing(&body))),
        ("everything quoted", quoted(&format!("{head}{body}"))),
        ("quoted between commas", commas(&format!("{head}{body}"))),
        ("blank lines", format!("\n\n{head}\n{}", body.replace("\n0,0", "\n\n;;;;;;\n0,0"))),
        ("comments between", format!("# one\n# two\n{head}{}", body.replace("\n0,0", "\n# a mark\n0,0"))),
        ("units above", {
            let (names, units) = head.split_once('\n').unwrap();
            format!("{units}{names}\n{body}")
        }),
        ("a group above", format!("Messung 1\n;Kraftaufnehmer;;;;;\n{head}{body}")),
        ("a long preamble", format!("{}{head}{body}", "Kanal;Bereich\n1;500\nSensor: K6D\n".repeat(20))),
        ("names in a comment", format!("# {with_units}{body}")),
    ] {
        check(&read(text.as_bytes(), "").unwrap_or_else(|error| panic!("{what}: {error}")), what);
    }
    // Blanks between columns, as numpy writes them.
    let plain = locale(' ', '.', "");
    let names = "t_s fx_n fy_n fz_n mx_nm my_nm mz_nm\n";
    check(&read(format!("# {names}{}", rows(&plain)).as_bytes(), "").unwrap(), "numpy");
    check(&read(format!("{names}{}", rows(&plain).replace(' ', "   ")).as_bytes(), "").unwrap(), "blanks");
}

#[test]
fn times_of_day_and_dates_are_times() {
    let rows = |time: &dyn Fn(usize) -> String| -> String {
        let cells =
            |row| (1..7).map(|k| written(thousandths(row, k), &LOCALES[0])).collect::<Vec<_>>().join(";");
        (0..ROWS).map(|row| format!("{};{}\n", time(row), cells(row))).collect()
    };
    let head = "Zeit;Fx [N];Fy [N];Fz [N];Mx [Nm];My [Nm];Mz [Nm]\n";
    let start = 1_795_169_553_000_000_000_u64;
    let seconds = |row: usize| 2 * row;
    type Time = Box<dyn Fn(usize) -> String>;
    let cases: [(&str, Time, Option<u64>); 9] = [
        ("s", Box::new(move |r| format!("0,{:03}", seconds(r))), Some(0)),
        ("time of day", Box::new(move |r| format!("10:12:33.{:03}", seconds(r))), Some(36_753_000_000_000)),
        ("comma", Box::new(move |r| format!("10:12:33,{:03}", seconds(r))), Some(36_753_000_000_000)),
        ("iso", Box::new(move |r| format!("2026-11-20T10:12:33.{:03}Z", seconds(r))), Some(start)),
        ("german", Box::new(move |r| format!("20.11.2026 10:12:33,{:03}", seconds(r))), Some(start)),
        ("american", Box::new(move |r| format!("11/20/2026 10:12:33.{:03} AM", seconds(r))), Some(start)),
        (
            "unclear",
            Box::new(move |r| format!("03/04/2026 10:12:33.{:03}", seconds(r))),
            Some(36_753_000_000_000),
        ),
        ("minutes", Box::new(move |r| format!("12:33,{:03}", seconds(r))), Some(753_000_000_000)),
        ("matlab", Box::new(move |r| format!("20-Nov-2026 10:12:33.{:03}", seconds(r))), Some(start)),
    ];
    for (what, time, first) in &cases {
        let head = if *what == "s" { head.replacen("Zeit", "Zeit [s]", 1) } else { head.to_owned() };
        let recording = read((head + &rows(time)).as_bytes(), "").unwrap_or_else(|e| panic!("{what}: {e}"));
        check(&recording, what);
        assert_eq!(recording.time_ns.first().copied(), *first, "{what}");
    }
    // Excel's days, and milliseconds, by their unit.
    let days = |r: usize| format!("46346,{:09}", 1_000_000 * r);
    let rig = "[recording]\ncolumns = \
               { t_s = { name = \"Zeit\", unit = \"d\" }, fx_n = \"Fx [N]\", fy_n = \"Fy [N]\", fz_n = \"Fz [N]\", mx_nm = \"Mx [Nm]\", my_nm = \"My [Nm]\", mz_nm = \"Mz [Nm]\" }\n";
    let recording = read((head.to_owned() + &rows(&days)).as_bytes(), rig).unwrap();
    assert!((recording.rate_hz.unwrap() - 1.0 / 86.4).abs() < 1e-9);
    let milli = |r: usize| format!("88123,{:02}", 0).replace("88123", &(88_123 + 2 * r).to_string());
    let text = head.replacen("Zeit", "TimeStamp_ms", 1) + &rows(&milli);
    assert_eq!(read(text.as_bytes(), "").unwrap().time_ns[..2], [88_123_000_000, 88_125_000_000]);
}

#[test]
fn ambiguous_numbers_are_refused() {
    let head = "Time [s];Fx [N];Fy [N];Fz [N];Mx [Nm];My [Nm];Mz [Nm]\n";
    let row = |t: i64| format!("{t};1,234;-5,678;9,012;1,000;2,345;3,456\n");
    let text = head.to_owned() + &(0..20).map(row).collect::<String>();
    let said = read(text.as_bytes(), "").unwrap_err().to_string();
    assert!(
        said.contains("1,234 is more than a thousand or has decimals") && said.contains("decimal ="),
        "{said}"
    );
    let first = |rig: &str, text: &str| read(text.as_bytes(), rig).unwrap().wrench.unwrap()[0][0];
    assert_eq!(first("[recording]\ndecimal = \"comma\"\n", &text), 1.234);
    assert_eq!(first("[recording]\ndecimal = \"point\"\n", &text), 1234.0);
    // One number that has no three digits shows it, wherever it is: even in a column that is not used.
    assert_eq!(first("", &text.replace("3,456\n7;", "3,45\n7;")), 1.234);
    assert_eq!(first("", &text.replace("\n", ";0,5\n").replace("[Nm];0,5\n", "[Nm];note\n")), 1.234);
    // The same with points, in names that are not of the notation.
    let points = text.replace(',', ".");
    let said = read(points.as_bytes(), "").unwrap_err().to_string();
    assert!(said.contains("1.234 is more than a thousand"), "{said}");
    assert_eq!(first("[recording]\ndecimal = \"comma\"\n", &points), 1234.0);
    assert_eq!(first("", &points.replace(';', ",")), 1.234);
    // In names of the notation, too, the rig file has the last word, and what is written then has points.
    let own = "t_s;fx_n;fy_n;fz_n;mx_nm;my_nm;mz_nm\n0;1.234;2;3;4;5;6\n1;1.235;2;3;4;5;6\n";
    assert_eq!(first("", own), 1.234);
    let comma = read(own.as_bytes(), "[recording]\ndecimal = \"comma\"\n").unwrap();
    assert_eq!(comma.wrench.as_ref().unwrap()[0][0], 1234.0);
    assert_eq!(first(&comma.rig.to_toml(), &comma.to_csv()), 1234.0);
    // Both ways in one file.
    let mixed = text.replacen("1,234", "1.5", 1).replacen("2,345\n", "2,5\n", 1).replacen("3,456", "3,5", 1);
    let said = read(mixed.as_bytes(), "").unwrap_err().to_string();
    assert!(said.contains("line 2, column Mz [Nm]") && said.contains("as those before it"), "{said}");
    // A row of units is not passed over.
    let kilo = format!("{}{}", header(&LOCALES[0]).replacen("[N]", "[kN]", 1), rows(&LOCALES[0]));
    let scaled = read(kilo.as_bytes(), "").unwrap().wrench.unwrap()[0][0];
    assert_eq!(scaled, number(thousandths(0, 1)) * 1e3);
    let rig = "[recording]\ncolumns = \
               { t_s = \"Time\", fx_n = \"Fx\", fy_n = \"Fy\", fz_n = \"Fz\", mx_nm = \"Mx\", my_nm = \"My\", mz_nm = \"Mz\" }\n";
    let said = read(kilo.as_bytes(), rig).unwrap_err().to_string();
    assert!(said.contains("fx_n is read in N") && said.contains("kN"), "{said}");
    let own = "t_s;fx_n;fy_n;fz_n;mx_nm;my_nm;mz_nm\n";
    let strange = format!("{own}[s];[mV/V];[N];[N];[Nm];[Nm];[Nm]\n{}", rows(&LOCALES[0]));
    let said = read(strange.as_bytes(), "").unwrap_err().to_string();
    assert!(said.contains("fx_n is read in N") && said.contains("mV/V"), "{said}");
    check(&read(strange.replace("mV/V", "N").as_bytes(), "").unwrap(), "own names over units");
    // Nor is a unit in a name.
    let named = kilo.replacen("Fx", "Fx [kN]", 1).replace("[kN];[N];[N]", "[N];[N];[N]");
    let said = read(named.as_bytes(), &rig.replacen("\"Fx\"", "\"Fx [kN]\"", 1)).unwrap_err().to_string();
    assert!(said.contains("kN"), "{said}");
    // Without a unit nothing is taken.
    let bare = format!("{}\n{}", NAMES.join(";"), rows(&LOCALES[0]));
    let said = read(bare.as_bytes(), "").unwrap_err().to_string();
    assert!(said.contains("the unit of Time, Fx") && said.contains("written nowhere"), "{said}");
    assert!(said.contains("as in t_s = { name = \"Time\", unit = \"s\" }"), "{said}");
}

#[test]
fn lines_are_counted_as_an_editor_does() {
    for ends in ["\n", "\r\n"] {
        let names = "t_s;fx_n;fy_n;fz_n;mx_nm;my_nm;mz_nm\n";
        let mut text = format!("{names}{}", rows(&LOCALES[0]));
        text = text.replace("\n0,006", "\n\n0,006").replacen("\n0,010;1.234", "\n0,010;1.2x4", 1);
        let said = read(text.replace('\n', ends).as_bytes(), "").unwrap_err().to_string();
        // Header, rows 0 to 4, and an empty line.
        assert!(said.contains("line 8, column fx_n"), "{ends:?}: {said}");
    }
    let german = format!("Halter\n\n{}{}", header(&LOCALES[0]), rows(&LOCALES[0]));
    assert_eq!(read(german.as_bytes(), "").unwrap().place(0), "line 5");
}

/// A rig file may name a column that has its whole name in the line of groups above it, too.
#[test]
fn a_rig_file_names_columns_below_their_groups() {
    let english = &LOCALES[3];
    let text =
        format!("Time\tForce\t\t\tMoment\t\t\n\tX\tY\tZ\tX\tY\tZ\ns\tN\tN\tN\tNm\tNm\tNm\n{}", rows(english));
    check(&read(text.as_bytes(), "").unwrap(), "by its names");
    let rig = "[recording]\ncolumns = \
               { t_s = \"Time\", fx_n = \"Force X\", fy_n = \"Force Y\", fz_n = \"Force Z\", mx_nm = \"Moment X\", my_nm = \"Moment Y\", mz_nm = \"Moment Z\" }\n";
    check(&read(text.as_bytes(), rig).unwrap(), "by the rig file");
    let said = read(text.as_bytes(), &rig.replace("Force Y", "Force Q")).unwrap_err().to_string();
    assert!(said.contains("Force Q"), "{said}");
}

/// The files of a laboratory, as they were received.
#[test]
#[ignore = "needs ../shared/cases"]
fn shared_cases_of_a_laboratory_are_read() {
    let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/cases/exports"));
    let load = |name: &str| Recording::load(&folder.join(name), None).unwrap_or_else(|e| panic!("{e}"));
    let first = |recording: &Recording| recording.wrench.as_ref().unwrap()[0];
    let german = load("Messung_01.csv");
    assert_eq!(first(&german), [-3.10, 1.66, -78.04, 0.481, 0.941, -0.035]);
    assert_eq!((german.rows(), german.rate_hz), (1194, Some(500.0)));
    assert_eq!(german.place(0), "line 7");
    let labview = load("messung_02.lvm");
    assert_eq!(first(&labview), [-3.100148, 1.664151, -78.036313, 0.480880, 0.940830, -0.034548]);
    assert_eq!((labview.rows(), labview.rate_hz), (1177, Some(500.0)));
    let ati = load("ati_log.csv");
    assert_eq!(first(&ati), [-3.1001, 1.6642, -78.0363, 0.48088, 0.94083, -0.03455]);
    assert_eq!((ati.rows(), ati.rate_hz), (1195, Some(500.0)));
    assert_eq!(ati.time_ns[0], 1_795_169_553_000_000_000);
    let imu = load("imu_logger.csv");
    let own = &imu.imus[0];
    assert_eq!(own.accel.as_ref().unwrap()[0], [0.00496, -0.00446, 1.00775].map(|v: f64| v * 9.80665));
    let degree = std::f64::consts::PI / 180.0;
    assert_eq!(own.gyro.as_ref().unwrap()[0], [0.1928, -0.3789, 0.1041].map(|v: f64| v * degree));
    assert_eq!((imu.rows(), imu.rate_hz, imu.time_ns[0]), (1199, Some(400.0), 88_123_000_000));
}

/// Every table that can be read is written and read again as the same numbers.
#[test]
fn damaged_exports_never_panic_and_rows_read_come_back() {
    let folder =
        std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fuzz/corpus/recording_csv"));
    let mut state = 88_172_645_463_325_252_u64;
    let mut next = |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 16) as usize % below
    };
    let letters = b"0123456789.,;:\t\r\n\"#%/- []()eE'NnmsgxyzT\xa0\xfc\0";
    let mut read_again = 0;
    for name in ["german", "labview", "log_with_dates", "dynamic.csv"] {
        let good = std::fs::read(folder.join(name)).unwrap();
        read(&good, "").unwrap_or_else(|error| panic!("{name}: {error}"));
        for _ in 0..4000 {
            let mut bytes = good.clone();
            for _ in 0..=next(3) {
                let position = next(bytes.len());
                match next(3) {
                    0 => bytes[position] = letters[next(letters.len())],
                    1 => bytes.insert(position, letters[next(letters.len())]),
                    _ => drop(bytes.remove(position)),
                }
            }
            let Ok(first) = read(&bytes, "") else { continue };
            let (rig, _) = first.rig_in_notation();
            let text = first.to_csv();
            let what = || format!("{name}: {}\n{text}", String::from_utf8_lossy(&bytes));
            let second = Recording::from_csv_bytes("export.csv", text.as_bytes(), &rig)
                .unwrap_or_else(|error| panic!("{error}\n{}", what()));
            assert_eq!(
                (&first.time_ns, &first.wrench, &first.imus),
                (&second.time_ns, &second.wrench, &second.imus),
                "{}",
                what()
            );
            read_again += 1;
        }
    }
    assert!(read_again > 2000, "{read_again}");
}

/// Times and negative numbers as other programs write them.
#[test]
fn foreign_times_and_signs_are_read_or_named() {
    let text = |times: &dyn Fn(usize) -> String, force: &str, end: &str| {
        let body: String = (0..40).map(|k| format!("{};{force};0.5;70.5;1.5;2.5;3.5\n", times(k))).collect();
        format!("Time;Fx [N];Fy [N];Fz [N];Mx [Nm];My [Nm];Mz [Nm]\n{body}{end}")
    };
    let read = |text: String| Recording::from_csv_bytes("a.csv", text.as_bytes(), &RigFile::default());
    let plain = |k: usize| format!("00:00:00.{:03}", 5 * k);
    for times in [
        &|k: usize| format!("0 days 00:00:00.{:06}", 5000 * k) as _,
        &|k: usize| format!("20261120T101233.{:03}", 5 * k),
        &|k: usize| format!("Fri Nov 20 10:12:33.{:03} 2026", 5 * k),
        &|k: usize| format!("20 déc. 2026 10:12:33.{:03}", 5 * k),
        &|k: usize| format!("10:12:33:{:06}", 5000 * k),
    ] as [&dyn Fn(usize) -> String; 5]
    {
        let recording = read(text(times, "-5.58", "")).unwrap_or_else(|e| panic!("{}: {e}", times(0)));
        assert_eq!((recording.rate_hz, recording.rows()), (Some(200.0), 40), "{}", times(0));
    }
    for force in ["-5.58", "5.58-", "(5.58)", "- 5.58", "\u{2212}5.58"] {
        let recording = read(text(&plain, force, "")).unwrap_or_else(|e| panic!("{force}: {e}"));
        assert_eq!(recording.wrench.unwrap()[3][0], -5.58, "{force}");
    }
    let said = read(text(&|k| format!("T+{k}ms"), "5.58", "")).unwrap_err().to_string();
    assert!(said.contains("the form of the time in column Time is not known: \"T+0ms\""), "{said}");
    let said = read(text(&plain, "5.58", "\nEnde der Messung\n")).unwrap_err().to_string();
    assert!(said.contains("line 43") && said.contains("\"Ende der Messung\" is text after"), "{said}");
}

//! `--certificate`: numbers of the result in the customer's units, what is missing, hashes, hostile names,
//! and what has none.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::program::{complaint, json, rigident, said, status};

const EXAMPLES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/examples/");

/// Caption of the table of centre and tensor.
const CENTRE: &str = "Centre of mass in S";

/// Everything that a certificate has to say.
const STATED: &str = r#"
[certificate]
number = "2026-117"
laboratory = "Prüflabor Süd"
laboratory_address = "Hauptstraße 1, 80331 München"
place = "Bench 3"
customer = "Example GmbH"
customer_address = "Am Werk 2"
part = "Bracket <A> & lid"
part_serial = "SN 0042"
measured_on = "2026-11-20"
procedure = "PA-12, issue 3"
conditions = "21.0 °C ± 0.5 °C"
traceability = "mass and length standards of the load cell's calibration"
operator = "A. Weber"
authorised_by = "Dr B. Klein"

[[certificate.equipment]]
name = "Thermometer"
serial = "T 7"
calibrated_on = "2026-02-01"
certificate = "D-K-0001"
"#;

/// The bracket with a rig file that names its instruments, and more.
fn bracket(folder: &Path, more: &str) {
    fs::copy(format!("{EXAMPLES}bracket.csv"), folder.join("bracket.csv")).unwrap();
    let rig = fs::read_to_string(format!("{EXAMPLES}bracket.rig.toml")).unwrap();
    let named = |rig: String, table: &str, serial: &str| {
        rig.replace(table, &format!("{table}\nserial = \"{serial}\"\ncalibrated_on = \"2026-01-15\""))
    };
    let rig = named(named(rig, "[[imu]]", "IMU 1"), "[load_cell]", "LC 2");
    fs::write(folder.join("bracket.rig.toml"), rig + more).unwrap();
}

/// The text of the cells of the row that begins with this name, in the table behind a caption.
fn row(page: &str, caption: &str, name: &str) -> Vec<String> {
    let document = roxmltree::Document::parse_with_options(
        page.trim_start_matches("<!DOCTYPE html>\n"),
        roxmltree::ParsingOptions::default(),
    )
    .unwrap();
    let text = |node: roxmltree::Node<'_, '_>| -> String {
        node.descendants().filter(|n| n.is_text()).filter_map(|n| n.text()).collect()
    };
    let table = document
        .descendants()
        .filter(|n| n.has_tag_name("table"))
        .find(|table| table.descendants().any(|n| n.has_tag_name("caption") && text(n).starts_with(caption)))
        .unwrap_or_else(|| panic!("no table {caption}"));
    let rows = table.descendants().filter(|n| n.has_tag_name("tr"));
    let cells =
        rows.map(|row| row.children().filter(roxmltree::Node::is_element).map(text).collect::<Vec<_>>());
    cells.into_iter().find(|cells| cells.first().is_some_and(|first| first == name)).unwrap()
}

fn number(text: &str) -> f64 {
    text.replace('\u{2212}', "-").replace("± ", "").parse().unwrap()
}

#[test]
fn a_certificate_has_the_results_numbers_in_the_customers_units_and_its_files_hashes() {
    let place = tempfile::tempdir().unwrap();
    bracket(place.path(), STATED);
    let words = ["identify", "bracket.csv", "--json", "--out", "out", "--certificate", "c.html"];
    let output = rigident(place.path(), &words);
    let result: Value = json(&output);
    assert_eq!(status(&output), 0, "{}", said(&output));
    let page = fs::read_to_string(place.path().join("c.html")).unwrap();
    assert!(page.contains("<h1>Certificate of measurement</h1>") && !page.contains("not stated"));
    for stated in
        ["2026-117", "SN 0042", "Bracket &lt;A&gt; &amp; lid", "LC 2", "IMU 1", "D-K-0001", "Dr B. Klein"]
    {
        assert!(page.contains(stated), "{stated}");
    }
    assert!(page.contains("End of certificate 2026-117"));
    // kg, mm and kg cm², U = 2 u where U95 = 1.96 u; each printed with two digits of U.
    let close = |cells: &[String], value: f64, u95: f64, unit: &str| {
        let expanded = 2.0 * u95 / 1.96;
        assert!((number(&cells[1]) - value).abs() <= 0.051 * expanded, "{cells:?} {value}");
        assert!((number(&cells[2]) / expanded - 1.0).abs() < 0.051, "{cells:?} {expanded}");
        assert_eq!(cells[3], unit);
    };
    let mass = &result["parameters"][0];
    close(&row(&page, "Mass", "m"), mass["value"].as_f64().unwrap(), mass["u95"].as_f64().unwrap(), "kg");
    for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
        let of = |field: &str| 1e3 * result[field][k].as_f64().unwrap();
        close(&row(&page, CENTRE, axis), of("com_m"), of("com_u95_m"), "mm");
    }
    for (k, name) in ["Ixx", "Iyy", "Izz", "Iyz", "Izx", "Ixy"].into_iter().enumerate() {
        let of = |field: &str| 1e4 * result[field][k].as_f64().unwrap();
        let cells = row(&page, CENTRE, name);
        close(&cells, of("inertia_com_kgm2"), of("inertia_com_u95_kgm2"), "kg cm²");
    }
    // Another program's hash of the example, which no run may change.
    let python = crate::program::python();
    let script = "import hashlib, sys; print(hashlib.sha256(open(sys.argv[1], 'rb').read()).hexdigest())";
    for file in ["bracket.csv", "bracket.rig.toml"] {
        let path = place.path().join(file);
        let hash = std::process::Command::new(&python).args(["-c", script]).arg(path).output().unwrap();
        let hash = String::from_utf8(hash.stdout).unwrap();
        assert!(hash.trim().len() == 64 && page.contains(hash.trim()), "{file}");
    }
    // Nothing is overwritten.
    let again = rigident(place.path(), &["identify", "bracket.csv", "--certificate", "c.html"]);
    assert!(complaint(&again).contains("is there already"));
}

#[test]
fn missing_entries_are_listed_and_make_a_draft() {
    let place = tempfile::tempdir().unwrap();
    bracket(place.path(), "");
    let words = ["identify", "bracket.csv", "--out", "out", "--certificate", "c.html", "--certify"];
    let output = rigident(place.path(), &[&words[..], &["number=\u{1}"]].concat());
    assert!(complaint(&output).contains("control characters"));
    let output = rigident(place.path(), &[&words[..], &["nummer=7"]].concat());
    assert!(complaint(&output).contains("nummer"));
    let output = rigident(place.path(), &[&words[..], &["number=7</style><script>"]].concat());
    let words = said(&output);
    assert!(words.contains("is a draft") && words.contains("certificate.customer"), "{words}");
    let page = fs::read_to_string(place.path().join("c.html")).unwrap();
    assert!(page.contains("Draft of a certificate") && !page.contains("<script"));
    assert!(page.contains("<code>certificate.procedure</code>") && page.contains("not stated"));
    let named = rigident(place.path(), &["identify", "bracket.csv", "--certificate", "c.pdf"]);
    assert!(complaint(&named).contains(".html"));
}

#[test]
fn a_recording_that_cannot_be_true_has_no_certificate() {
    let place = tempfile::tempdir().unwrap();
    bracket(place.path(), STATED);
    let path = place.path().join("bracket.rig.toml");
    let rig = fs::read_to_string(&path).unwrap();
    fs::write(&path, rig.replace("[recording]", "[recording]\nwrench_sign = \"on_sensor\"")).unwrap();
    let words = ["identify", "bracket.csv", "--json", "--out", "out", "--certificate", "c.html"];
    let output = rigident(place.path(), &words);
    assert_eq!((status(&output), &json(&output)["status"]), (1, &Value::from("implausible")));
    assert!(said(&output).contains("not written: the recording cannot be true"), "{}", said(&output));
    assert!(!place.path().join("c.html").exists());
}

#[test]
fn a_solved_factor_has_a_certificate_too() {
    let place = tempfile::tempdir().unwrap();
    bracket(place.path(), STATED);
    let made = rigident(place.path(), &["factor", "bracket.csv", "-o", "a.factor"]);
    assert_eq!(status(&made), 0, "{}", said(&made));
    let words = ["solve", "a.factor", "--rig", "bracket.rig.toml", "--certificate", "c.html"];
    let output = rigident(place.path(), &words);
    assert_eq!(status(&output), 0, "{}", said(&output));
    let page = fs::read_to_string(place.path().join("c.html")).unwrap();
    assert!(page.contains("a.factor") && page.contains("SHA-256"));
}

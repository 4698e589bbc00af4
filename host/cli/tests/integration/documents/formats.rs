//! `docs/formats.md` against what the readers and writers know.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use rigident::fit::factor_file::{self, FactorSource, SourceChannel};
use rigident::fit::{Kind, Owner, Parameter};
use rigident::joint_offsets::contacts_file::{ContactsFile, FixedTable, ImuTable, PlaneTable, SoleTable};
use rigident::plan::excitation::boxes::{BoxFile, BoxTable};
use rigident::recording::columns::{Group, Known};
use rigident::recording::convert::convert;
use rigident::rig::RigFile;
use rigident_cli::ExitStatus;

use super::{document, first_cells, same, section};

fn formats() -> String {
    document("docs/formats.md")
}

fn names(words: impl IntoIterator<Item = impl Into<String>>) -> BTreeSet<String> {
    words.into_iter().map(Into::into).collect()
}

#[test]
fn every_column_is_described() {
    let mut known = names(["t_s"]);
    for group in Group::kinds() {
        known.extend(group.names());
    }
    // Of numbered groups those of link 1 are described; the first IMU has no number.
    known.retain(|name| !name.starts_with("q0_"));
    known.extend([Group::Accel(1), Group::Gyro(1), Group::Attitude(1)].into_iter().flat_map(Group::names));
    let text = formats();
    let mut documented = first_cells(section(&text, "### Columns"));
    documented.retain(|name| !name.contains('…'));
    same("columns", &documented, &known);
    assert!(documented.iter().all(|name| Known::parse(name).is_some()));
}

/// The keys of a table, by what the reader says of one that it does not know; `None` if that is no table.
fn keys(header: &str) -> Option<Vec<String>> {
    let error = RigFile::parse(&format!("{header}\nno_such_key = 1\n")).err()?.to_string();
    let known = error.split_once("key no_such_key is not known")?.1.split_once("known here: ")?.1;
    Some(known.split(", ").map(str::to_owned).collect())
}

/// Walks the tables of a rig file from the reader's own lists.
fn tables(header: &str, inside: &str, keys_there: &[String], found: &mut Vec<(String, BTreeSet<String>)>) {
    found.push((header.to_owned(), names(keys_there)));
    for key in keys_there {
        let path = if inside.is_empty() { key.clone() } else { format!("{inside}.{key}") };
        for (open, close) in [("[[", "]]"), ("[", "]")] {
            let line = format!("{open}{path}{close}");
            // A table inside one of an array needs that one first.
            let above = if header.starts_with("[[") { format!("{header}\n") } else { String::new() };
            if let Some(inner) = keys(&format!("{above}{line}")) {
                tables(&line, &path, &inner, found);
                break;
            }
        }
    }
}

#[test]
fn every_key_of_a_rig_file_is_described() {
    let root = keys("").unwrap();
    let mut found = Vec::new();
    tables("", "", &root, &mut found);
    let text = formats();
    let rig = section(&text, "## Rig file");
    let headings = rig.lines().filter_map(|line| line.strip_prefix("### `")?.strip_suffix('`'));
    same(
        "tables of a rig file",
        &names(headings),
        &names(found.iter().map(|(header, _)| header.as_str()).filter(|header| !header.is_empty())),
    );
    assert!(found.len() > 10, "{found:?}");
    for (header, keys) in &found[1..] {
        same(header, &first_cells(section(rig, &format!("### `{header}`"))), keys);
    }
}

#[test]
fn every_topic_of_a_recording_is_described() {
    let folder = tempfile::tempdir().unwrap();
    let columns: Vec<String> = Group::kinds().into_iter().flat_map(Group::names).collect();
    let row = |time: &str| format!("{time},a{}\n", ",1".repeat(columns.len()));
    let csv = format!("t_s,word,{}\n{}{}", columns.join(","), row("0.00"), row("0.01"));
    let [from, to] = ["all.csv", "all.mcap"].map(|name| folder.path().join(name));
    std::fs::write(&from, csv).unwrap();
    convert(&from, &to, None).unwrap();
    let bytes = std::fs::read(&to).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let pairs = |(topic, message): (&str, &str)| format!("{topic} {message}");
    let real = names(summary.channels.values().map(|channel| {
        pairs((channel.topic.as_str(), channel.schema.as_ref().map_or("", |schema| &schema.name)))
    }));
    let text = formats();
    let documented = section(&text, "## Recording, MCAP").lines().filter_map(|line| {
        let words: Vec<&str> = line.strip_prefix("| `/")?.split('`').collect();
        Some(pairs((&format!("/{}", words[0]), words[words.iter().position(|w| w.contains("/msg/"))?])))
    });
    let mut real = real;
    // Link 0 is S; the document shows link 1.
    real.retain(|pair| !pair.starts_with("/link0/"));
    real.insert("/link1/attitude geometry_msgs/msg/QuaternionStamped".to_owned());
    same("topics", &names(documented), &real);
}

#[test]
fn every_key_of_a_plan_is_described() {
    let schema = rigident::schema::schema("plan").unwrap();
    let mut real = BTreeSet::new();
    fields(&schema, &schema, "", &mut real);
    let text = formats();
    let described: BTreeSet<&str> = section(&text, "## Plan file").split('`').skip(1).step_by(2).collect();
    // A pose and a segment are written out as an example each.
    let named =
        |key: &str| described.iter().any(|words| *words == key || words.contains(&format!("\"{key}\"")));
    let missing: Vec<_> = real.iter().filter(|path| !named(path.rsplit('.').next().unwrap())).collect();
    assert!(missing.is_empty(), "a plan has {missing:?}, which docs/formats.md does not name");
    assert!(real.contains("program.segments[].hold.duration_s"), "{real:?}");
}

/// An editor that has the schema accepts what the reader accepts.
#[test]
fn the_schema_of_a_rig_file_has_the_readers_keys() {
    let schema = rigident::schema::schema("rig").unwrap();
    let mut real = BTreeSet::new();
    fields(&schema, &schema, "", &mut real);
    let root = keys("").unwrap();
    let mut found = Vec::new();
    tables("", "", &root, &mut found);
    let mut known = BTreeSet::new();
    for (header, keys) in &found {
        let path = header.trim_matches(['[', ']']);
        let lists = header.starts_with("[[");
        known.extend(keys.iter().map(|key| match (path, lists) {
            ("", _) => key.clone(),
            (_, true) => format!("{path}[].{key}"),
            (_, false) => format!("{}.{key}", path.replace("stream.", "stream[].")),
        }));
    }
    // Below a key that takes several forms there are no keys of tables.
    real.retain(|path| {
        known.contains(path)
            || !known.iter().any(|key| path.starts_with(&format!("{key}.")) && !is_table(key, &found))
    });
    same("keys of the rig file's schema", &real, &known);
}

/// Tells whether a key is the name of a table that the reader has keys of.
fn is_table(key: &str, found: &[(String, BTreeSet<String>)]) -> bool {
    found.iter().any(|(header, _)| header.trim_matches(['[', ']']) == key.replace("[]", ""))
}

#[test]
fn every_key_of_a_file_of_contacts_is_described() {
    let sole = SoleTable {
        name: Some("left".to_owned()),
        link: "foot".to_owned(),
        corners_m: vec![[0.0; 3]],
        corner_links: vec!["corner".to_owned()],
        corner_sites: vec!["site".to_owned()],
        plane: Some("wall".to_owned()),
    };
    let file = ContactsFile {
        sole: vec![sole],
        plane: vec![PlaneTable { normal_noise_deg: Some(1.0), ..PlaneTable::default() }],
        fixed: vec![FixedTable { name: Some("hand".to_owned()), ..FixedTable::default() }],
        imu: vec![ImuTable::default()],
    };
    let tables = serde_json::to_value(file).unwrap();
    let tables = tables.as_object().unwrap();
    let keys = |table: &serde_json::Value| table[0].as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    let real = tables.values().flat_map(keys).collect();
    let section_of = section(&formats(), "## File of contacts").to_owned();
    assert!(tables.keys().all(|name| section_of.contains(&format!("[[{name}]]"))));
    let text = formats();
    same("keys of a file of contacts", &first_cells(section(&text, "## File of contacts")), &real);
}

#[test]
fn every_key_of_a_file_of_boxes_is_described() {
    let table = BoxTable { link: "arm".to_owned(), size_m: [1.0; 3], ..BoxTable::default() };
    let file = BoxFile {
        boxes: vec![table.clone()],
        no_box: vec!["tool".to_owned()],
        skip_pairs: vec![["a".to_owned(), "b".to_owned()]],
    };
    let keys = |value: serde_json::Value| value.as_object().unwrap().keys().cloned().collect::<BTreeSet<_>>();
    let mut real = keys(serde_json::to_value(table).unwrap());
    real.extend(keys(serde_json::to_value(file).unwrap()));
    real.remove("box");
    let text = formats();
    same("keys of a file of boxes", &first_cells(section(&text, "## File of boxes")), &real);
}

#[test]
fn every_exit_status_is_described() {
    let text = formats();
    let rows = section(&text, "## Exit statuses")
        .lines()
        .filter_map(|line| line.strip_prefix("| ")?.split(" |").next());
    let documented = rows.filter(|cell| cell.parse::<u8>().is_ok()).map(str::to_owned).collect();
    same("exit statuses", &documented, &names(ExitStatus::ALL.map(|status| (status as u8).to_string())));
}

#[test]
fn a_schema_is_printed_for_each_file_that_has_one() {
    for name in rigident::schema::NAMES {
        assert_eq!(Some(json(&["schema", name])), rigident::schema::schema(name));
    }
    let text = formats();
    let said = section(&text, "## JSON of the other commands");
    for name in rigident::schema::NAMES {
        assert!(said.contains(&format!("`schema {name}`")), "{name}");
    }
}

/// Runs the program and returns what it prints as JSON.
fn json(arguments: &[&str]) -> serde_json::Value {
    let output = Command::new(env!("CARGO_BIN_EXE_rigident")).args(arguments).output().unwrap();
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|e| panic!("{arguments:?}: {e}: {}", String::from_utf8_lossy(&output.stderr)))
}

#[test]
fn every_field_of_the_other_commands_is_described() {
    let rig = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples/two-links.rig.toml");
    let folder = tempfile::tempdir().unwrap();
    let urdf = folder.path().join("a.urdf");
    std::fs::write(
        &urdf,
        "<robot name=\"x\"><link name=\"a\"><inertial><mass value=\"1\"/>\
         <inertia ixx=\"1\" iyy=\"1\" izz=\"5\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link></robot>",
    )
    .unwrap();
    let arm = folder.path().join("arm.urdf");
    std::fs::write(&arm, crate::plan_excitation::ARM).unwrap();
    let arm = arm.display().to_string();
    let (rig, urdf) = (rig.display().to_string(), urdf.display().to_string());
    let humanoid = crate::calibrate_joints::Files::new();
    let [model, poses, soles] = humanoid.paths();
    let text = formats();
    let table = section(&text, "## JSON of the other commands");
    for (command, arguments) in [
        ("calibrate joints", vec!["calibrate", "joints", &model, &poses, "--contacts", &soles, "--json"]),
        ("montecarlo", vec!["montecarlo", "--runs", "2", "--duration-s", "20", "--json"]),
        ("montecarlo poses", vec!["montecarlo", "poses", "--runs", "2", "--to", "2", "--json"]),
        ("plan poses", vec!["plan", "poses", "--n", "3", "--json"]),
        ("plan motion", vec!["plan", "motion", "--objective", "rpy", "--duration-s", "20", "--json"]),
        (
            "plan excitation",
            vec!["plan", "excitation", &arm, "--duration-s", "3", "--restarts", "1", "--json"],
        ),
        ("workspace", vec!["workspace", "--step-deg", "90", "--json"]),
        ("model base-params", vec!["model", "base-params", &rig, "--floating", "--json"]),
        ("model check", vec!["model", "check", &urdf, "--json"]),
    ] {
        let line = table.lines().find(|line| line.starts_with(&format!("| `{command}` |")));
        let line = line.unwrap_or_else(|| panic!("no line for {command}"));
        let object = json(&arguments);
        let mut fields = BTreeSet::new();
        collect(&object, &mut fields);
        let described: BTreeSet<String> = line.split('`').skip(1).step_by(2).map(str::to_owned).collect();
        let missing: Vec<_> = fields.difference(&described).collect();
        assert!(missing.is_empty(), "{command} prints {missing:?}, which docs/formats.md does not name");
        for field in object.as_object().unwrap().keys() {
            assert!(described.contains(field), "{command}: {field}");
        }
    }
}

/// Names of all fields, of objects inside lists too, but for maps by parameter or limit.
fn collect(value: &serde_json::Value, fields: &mut BTreeSet<String>) {
    match value {
        serde_json::Value::Object(object) => {
            for (name, inner) in object {
                fields.insert(name.clone());
                match name.as_str() {
                    "predicted_u95" | "limits" | "singular_values" => {}
                    "peaks" => {
                        inner.as_object().into_iter().flatten().for_each(|(_, peak)| collect(peak, fields))
                    }
                    _ => collect(inner, fields),
                }
            }
        }
        serde_json::Value::Array(items) => items.iter().for_each(|item| collect(item, fields)),
        _ => {}
    }
}

#[test]
fn every_part_of_a_factor_file_is_described() {
    let channel = SourceChannel {
        name: "fx".to_owned(),
        unit: "N".to_owned(),
        sigma: 1.0,
        gain_sigma: 0.0,
        measured_rms: 1.0,
    };
    let run = FactorSource {
        recording: "a".to_owned(),
        recorded_unix_s: None,
        fingerprint: 1,
        samples: 1,
        rejected: 0,
        rows: 6,
        noise_gain: 1.0,
        variance_scale: 1.0,
        fitted: None,
        sigma_given: true,
        spurious_information: 0.0,
        channels: vec![channel],
        checks: None,
        labels: std::collections::BTreeMap::new(),
        readings: Vec::new(),
        folded: None,
    };
    let parameter = Parameter::new("m", Owner::Link(String::new()), Kind::Mass, "kg");
    let mut real = BTreeSet::new();
    collect(&serde_json::to_value(run).unwrap(), &mut real);
    let of_parameter = serde_json::to_value(parameter).unwrap();
    real.extend(of_parameter.as_object().unwrap().keys().cloned());
    let text = formats();
    let factor = section(&text, "## Factor file");
    let rows =
        factor.lines().filter(|line| line.starts_with("| parameters |") || line.starts_with("| runs |"));
    let described = rows.flat_map(|line| line.split('`').skip(1).step_by(2)).map(str::to_owned).collect();
    same("parts of a factor file", &described, &real);
    assert!(factor.contains(&format!("Version: {};", factor_file::VERSION)));
}

/// Paths of all fields below a schema: `source.rows`, `parameters[].name`.
fn fields(schema: &serde_json::Value, root: &serde_json::Value, path: &str, found: &mut BTreeSet<String>) {
    let named = schema["$ref"].as_str().and_then(|place| root.pointer(place.trim_start_matches('#')));
    if let Some(named) = named {
        fields(named, root, path, found);
    }
    for choice in ["oneOf", "anyOf", "allOf"] {
        schema[choice].as_array().into_iter().flatten().for_each(|one| fields(one, root, path, found));
    }
    for (name, inner) in schema["properties"].as_object().into_iter().flatten() {
        let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
        found.insert(path.clone());
        fields(inner, root, &path, found);
    }
    if schema["items"].is_object() {
        fields(&schema["items"], root, &format!("{path}[]"), found);
    }
}

#[test]
fn every_field_of_the_result_is_described() {
    let schema = schemars::schema_for!(rigident::answer::result::Answer);
    let mut real = BTreeSet::new();
    fields(schema.as_value(), schema.as_value(), "", &mut real);
    let text = formats();
    same("fields of the result", &first_cells(section(&text, "## Result")), &real);
    assert!(text.contains(rigident::answer::result::SCHEMA));
}

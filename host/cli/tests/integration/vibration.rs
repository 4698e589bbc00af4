//! `rigident vibration`: bodies on springs, beside the vibration paper's numbers, and with bad input.
#![cfg(feature = "simulator")]

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::factors::simulated::{rigident, said, status};

const POSTURES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/examples/two-link-postures.toml");

fn object(place: &Path, arguments: &[&str]) -> Value {
    let output = rigident(place, arguments);
    assert!(status(&output) < 2, "{}", said(&output));
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&output)))
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn postures_of_the_paper_give_its_table_and_its_bounds() {
    let place = tempfile::tempdir().unwrap();
    let found = object(
        place.path(),
        &["vibration", "postures", POSTURES, "--json", "--factor", "p.factor", "--plot", "p.svg"],
    );
    let svg = fs::read_to_string(place.path().join("p.svg")).unwrap();
    assert!(svg.matches("<rect ").count() == 7 && svg.contains("rank 18"), "{svg}");
    let shares: f64 = found["shares"].as_array().unwrap().iter().map(|s| number(&s["share"])).sum();
    assert!((shares - 1.0).abs() < 1e-9, "{shares}");
    let compared: Vec<&Value> =
        found["subset"].as_array().unwrap().iter().filter(|v| v["reference"].is_f64()).collect();
    assert_eq!(compared.len(), 17);
    for value in compared {
        // The paper's solution is no least-squares one: within 0.02 of each other.
        let off = number(&value["value"]) - number(&value["reference"]);
        assert!(off.abs() < 0.02, "{value}");
    }
    let ranks: Vec<u64> =
        found["sets"].as_array().unwrap().iter().map(|s| s["rank"].as_u64().unwrap()).collect();
    assert_eq!(ranks, [10, 10, 10, 16, 16, 16, 18]);
    // Eq. 19 with these numbers, and what a leaf of known mass must be: narrower. Table 1 has 2.3640.
    let open = &found["open"];
    assert!((number(&open["most"]) - 2.4251).abs() < 0.03, "{open}");
    assert!(number(&open["most_of_leaf"]) < number(&open["most"]), "{open}");
    assert!(fs::metadata(place.path().join("p.factor")).unwrap().len() > 100);
    assert!(number(&found["next"]["gain"]) < 1.0, "{}", found["next"]);
}

#[test]
fn the_paper_s_experiment_is_identified_better_than_by_the_paper() {
    let place = tempfile::tempdir().unwrap();
    let (mut outside, mut all) = (0, 0);
    let (mut ratios, seeds) = ([0.0; 2], ["1", "2", "3", "4"]);
    for seed in seeds {
        let found = object(place.path(), &["vibration", "demo", "--seed", seed, "--out", seed, "--json"]);
        for row in found["table_5"].as_array().unwrap() {
            // The largest of both links in the paper's Table 5, of one experiment: on average, and nearly
            // each time.
            let papers = [("first_moment_by_mass_m", 0.7e-3), ("tensor_by_largest", 0.0037)];
            for ((quantity, paper), sum) in papers.into_iter().zip(&mut ratios) {
                let ratio = number(&row[quantity]) / paper;
                assert!(ratio <= 1.3, "{seed}: {row}");
                *sum += ratio / seeds.len() as f64 * f64::from(u8::from(row["link"] == "base"));
            }
        }
        for row in ["table_3", "table_4"].iter().flat_map(|t| found[*t].as_array().unwrap()) {
            let off = (number(&row["value"]) - number(&row["truth"])).abs();
            all += 1;
            outside += u32::from(off > number(&row["u95"]));
            assert!(off < 2.0 * number(&row["u95"]), "{seed}: {row}");
        }
        let jyy = &found["jyy"];
        let of = |name: &str| number(&jyy[name]);
        // One is the other, held to the bounds.
        let clamped = of("least_squares").clamp(of("least"), of("most"));
        assert!((of("bounded_search") - clamped).abs() < 1e-6, "{jyy}");
        // What postures leave open the motion tells, to 0.77 %.
        assert!(
            (of("merged") - of("truth")).abs() < 2.0 * of("merged_u95") && of("merged_u95") < 0.018,
            "{jyy}"
        );
    }
    assert!(ratios.iter().all(|ratio| *ratio <= 1.0), "{ratios:?}");
    assert!(outside * 10 <= all, "{outside} of {all}");
}

#[test]
fn a_locked_posture_is_one_body_by_its_modes_and_by_its_motion() {
    let place = tempfile::tempdir().unwrap();
    object(place.path(), &["vibration", "demo", "--out", "demo", "--json"]);
    let rig = fs::read_to_string(place.path().join("demo/posture1.rig.toml")).unwrap();
    let (before, rest) = rig.split_once("[[link]]").unwrap();
    let springs = rest.split_once("[suspension]").unwrap().1;
    fs::write(place.path().join("one.rig.toml"), format!("{before}[suspension]{springs}")).unwrap();
    let file = "demo/posture1.csv";
    let found = object(
        place.path(),
        &["vibration", "identify", file, "--rig", "one.rig.toml", "--json", "--out", "one"],
    );
    assert_eq!(found["modes"].as_array().unwrap().len(), 6);
    let mass = |way: &str| {
        let all = found[way]["parameters"].as_array().unwrap();
        let mass = all.iter().find(|p| p["name"] == "m").unwrap();
        (number(&mass["value"]) - 80.817, number(&mass["u95"]))
    };
    let (off, u95) = mass("by_modes");
    assert!(found["by_modes"]["status"] == "identified" && off.abs() < 1.5 * u95, "{off} {u95}");
    // Noise is in the coefficients and in the springs' forces: what it adds to the normal equations, some 10
    // kg, is taken off.
    let (off, u95) = mass("by_motion");
    assert!(off.abs() < 1.5 * u95 && u95 < 8.0, "{off} {u95}");
    let noise = &found["by_motion"]["signals"][0];
    assert!(noise["name"] == "poses", "{noise}");
    let svg = fs::read_to_string(place.path().join("one/spectrum.svg")).unwrap();
    assert!(svg.starts_with("<svg") && svg.matches("class=\"peak\"").count() == 12, "{svg}");
    let page = fs::read_to_string(place.path().join("one/modes.html")).unwrap();
    assert!(page.matches("<figure>").count() == 6 && page.contains("<animate "), "{page}");
    // Locked postures of a tree are no one body.
    let output = rigident(place.path(), &["vibration", "identify", file]);
    assert!(status(&output) == 2 && said(&output).contains("vibration postures"), "{}", said(&output));
    // Springs that are known to 2.9 % are counted, and the rows are not asked for them.
    let one = fs::read_to_string(place.path().join("one.rig.toml")).unwrap();
    let loose = one.replace("stiffness_std = 0.0", "stiffness_std = 0.029");
    let loose = loose.replacen("axial_npm = 8700.0", "axial_npm = 9050.0", 2);
    fs::write(place.path().join("loose.rig.toml"), loose.replacen("1060.0", "1010.0", 2)).unwrap();
    let found = object(place.path(), &["vibration", "identify", file, "--rig", "loose.rig.toml", "--json"]);
    for way in ["by_modes", "by_motion"] {
        let all = found[way]["parameters"].as_array().unwrap();
        let mass = all.iter().find(|p| p["name"] == "m").unwrap();
        let (off, u95) = (number(&mass["value"]) - 80.817, number(&mass["u95"]));
        assert!(off.abs() < u95 && (1.5..8.0).contains(&u95), "{way}: {off} {u95}");
    }
    // Both ways are of the same readings.
    let output =
        rigident(place.path(), &["merge", "one/modes.factor", "one/motion.factor", "-o", "both.factor"]);
    assert!(status(&output) == 2 && said(&output).contains("is in it twice"), "{}", said(&output));
}

#[test]
fn the_microcontroller_makes_the_same_of_a_motion() {
    let place = tempfile::tempdir().unwrap();
    object(place.path(), &["vibration", "demo", "--seed", "2", "--out", "demo", "--json"]);
    let found =
        object(place.path(), &["replay", "demo/release.csv", "--mcu", "inproc", "--json", "--out", "there"]);
    let notes: Vec<&str> = found["notes"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    let note = notes.iter().find(|n| n.starts_with("the microcontroller's parameters")).unwrap();
    let words: Vec<&str> = note.split(' ').collect();
    let at = words.iter().position(|w| *w == "to").unwrap();
    let off: f64 = words[at + 1].parse().unwrap();
    // Single precision, and the springs as a matrix.
    assert!(off < 0.2, "{note}");
    let here = object(place.path(), &["identify", "demo/release.csv", "--json", "--out", "here"]);
    for (there, here) in
        found["parameters"].as_array().unwrap().iter().zip(here["parameters"].as_array().unwrap())
    {
        assert_eq!((&there["name"], &there["state"]), (&here["name"], &here["state"]));
    }
    let refused = |arguments: &[&str], words: &str| {
        let output = rigident(place.path(), arguments);
        assert!(status(&output) == 2 && said(&output).contains(words), "{arguments:?}: {}", said(&output));
    };
    refused(&["replay", "demo/release.csv", "--mcu", "/dev/null"], "inproc or qemu");
    refused(&["replay", "demo/release.csv", "--mcu", "inproc", "--forget", "2"], "--forget");
    refused(
        &["replay", "demo/release.csv", "--mcu", "inproc", "--tare", "demo/release.csv"],
        "suspension.platform",
    );
}

/// Moves a column of a recording by an amount, or by a factor.
fn altered(from: &Path, to: &Path, column: usize, change: impl Fn(f64) -> f64) {
    let text = fs::read_to_string(from).unwrap();
    let line = |(k, line): (usize, &str)| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if k > 0 {
            cells[column] = format!("{:?}", change(cells[column].parse().unwrap()));
        }
        cells.join(",")
    };
    fs::write(to, text.lines().enumerate().map(line).collect::<Vec<_>>().join("\n") + "\n").unwrap();
}

#[test]
fn recordings_of_postures_show_their_postures_and_whether_a_spring_changed() {
    let place = tempfile::tempdir().unwrap();
    object(place.path(), &["vibration", "demo", "--seed", "2", "--out", "demo", "--json"]);
    let posture = |k: usize| format!("demo/posture{k}.csv");
    let all = [posture(1), posture(2), posture(3)];
    let run = |files: &[&str]| {
        let arguments =
            [&["vibration", "postures"], files, &["--rig", "demo/posture1.rig.toml", "--json"]].concat();
        object(place.path(), &arguments)
    };
    let found = run(&[&all[0], &all[1], &all[2]]);
    // As the demonstration has it, which knows the joint's position; here cameras tell it.
    let demo: Value =
        serde_json::from_slice(&fs::read(place.path().join("demo/result.json")).unwrap()).unwrap();
    for (own, other) in found["subset"].as_array().unwrap().iter().zip(demo["table_3"].as_array().unwrap()) {
        assert_eq!(own["name"], other["name"]);
        let off = (number(&own["value"]) - number(&other["value"])).abs();
        assert!(off < 0.05 * number(&own["u95"]), "{own} {other}");
    }
    let ranks: Vec<u64> =
        found["sets"].as_array().unwrap().iter().map(|s| s["rank"].as_u64().unwrap()).collect();
    assert_eq!(ranks, [10, 10, 10, 16, 16, 16, 18]);
    let warned = |found: &Value| found["warnings"].to_string();
    assert!(!warned(&found).contains("settled") && !warned(&found).contains("softer"), "{}", warned(&found));
    // A rest that is half a millimetre lower, and springs of which all frequencies are half a per cent lower.
    altered(&place.path().join(&all[2]), &place.path().join("low.csv"), 3, |z| z - 5e-4);
    assert!(warned(&run(&[&all[0], &all[1], "low.csv"])).contains("has settled"));
    altered(&place.path().join(&all[2]), &place.path().join("soft.csv"), 0, |t| 1.005 * t);
    assert!(warned(&run(&[&all[0], &all[1], "soft.csv"])).contains("a spring is softer"));
    // A joint that is not locked, and one recording twice.
    let output = rigident(place.path(), &["vibration", "postures", &all[0], "demo/release.csv"]);
    assert!(status(&output) == 2 && said(&output).contains("arm is not locked"), "{}", said(&output));
    let output = rigident(place.path(), &["vibration", "postures", &all[0], &all[0]]);
    assert!(status(&output) == 2 && said(&output).contains("twice"), "{}", said(&output));
}

#[test]
fn one_body_on_two_rigs_is_known_better_than_on_either() {
    let place = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let output = rigident(place.path(), arguments);
        assert!(status(&output) == 0, "{arguments:?}: {}", said(&output));
        String::from_utf8(output.stdout).unwrap()
    };
    run(&["demo", "--out", "driven"]);
    run(&["vibration", "demo", "--body", "horizontal", "--out", "springs"]);
    let table = run(&["merge", "driven/demo.factor", "springs/modes.body.factor", "--output", "both.factor"]);
    // The springs tell the mass, the load cell the products of inertia, both the rest.
    let line = |name: &str| {
        let start = format!("  {name} ");
        table.lines().find(|l| l.starts_with(&start)).unwrap_or_else(|| panic!("{table}")).to_owned()
    };
    assert!(line("m").contains("modes.body.factor") && line("Iyz").contains("demo.factor"), "{table}");
    let gain = |name: &str| -> f64 { line(name).split_whitespace().next_back().unwrap().parse().unwrap() };
    assert!(gain("Iyy") < 0.9 && gain("Ixx") < 0.9 && gain("Iyz") <= 1.0, "{table}");
    let both = object(place.path(), &["solve", "both.factor", "--rig", "springs/swing.rig.toml", "--json"]);
    for parameter in both["parameters"].as_array().unwrap() {
        if parameter["truth"].is_f64() {
            let off = (number(&parameter["value"]) - number(&parameter["truth"])).abs();
            assert!(off < 1.5 * number(&parameter["u95"]), "{parameter}");
        }
    }
    // With the platform on, the springs are those of another body.
    let output = rigident(
        place.path(),
        &["merge", "driven/demo.factor", "springs/modes.factor", "-o", "wrong.factor"],
    );
    assert!(status(&output) == 2 && said(&output).contains("not runs of one body"), "{}", said(&output));
}

#[test]
fn springs_that_contradict_the_modes_give_no_body_in_any_way() {
    let place = tempfile::tempdir().unwrap();
    let output = rigident(place.path(), &["vibration", "demo", "--body", "horizontal", "--out", "demo"]);
    assert!(status(&output) == 0, "{}", said(&output));
    let rig = fs::read_to_string(place.path().join("demo/swing.rig.toml")).unwrap();
    // A spring that is elsewhere.
    let place_of_one = "at_m = [0.38, 0.32, -0.05]";
    assert!(rig.contains(place_of_one), "{rig}");
    let wrong = rig.replacen(place_of_one, "at_m = [0.3, 0.2, -0.05]", 1);
    fs::write(place.path().join("wrong.rig.toml"), wrong).unwrap();
    let of = |command: &[&str]| {
        rigident(
            place.path(),
            &[command, &["demo/swing.csv", "--rig", "wrong.rig.toml", "--out", "out"]].concat(),
        )
    };
    let output = of(&["vibration", "identify"]);
    assert!(
        status(&output) == 1 && said(&output).contains("neither by the modes nor by the motion"),
        "{}",
        said(&output)
    );
    let out = place.path().join("out");
    assert!(!out.join("modes.factor").exists() && !out.join("motion.factor").exists());
    let page = fs::read_to_string(out.join("modes.html")).unwrap();
    assert!(page.find("neither by the modes").unwrap() < page.find("<figure>").unwrap(), "{page}");
    fs::remove_dir_all(&out).unwrap();
    let output = of(&["identify"]);
    assert_eq!(status(&output), 1, "{}", said(&output));
    let found: Value = serde_json::from_slice(&fs::read(out.join("result.json")).unwrap()).unwrap();
    assert_eq!(found["status"], "implausible");
    let factor = rigident(place.path(), &["solve", "out/swing.factor"]);
    assert_eq!(status(&factor), 1, "{}", said(&factor));
}

#[test]
fn faults_are_named() {
    let place = tempfile::tempdir().unwrap();
    let refused = |arguments: &[&str], words: &str| {
        let output = rigident(place.path(), arguments);
        assert!(status(&output) == 2 && said(&output).contains(words), "{arguments:?}: {}", said(&output));
    };
    refused(&["vibration", "postures", "none.toml"], "none.toml");
    refused(&["vibration", "demo", "--marker-noise-mm", "-1"], "--marker-noise-mm");
    let good = fs::read_to_string(POSTURES).unwrap();
    let altered = |name: &str, from: &str, to: &str, words: &str| {
        assert!(good.contains(from), "{from}");
        fs::write(place.path().join(name), good.replacen(from, to, 1)).unwrap();
        refused(&["vibration", "postures", name], words);
    };
    altered("a.toml", "[[0.9999, 0.0071", "[[0.9999, 0.5071", "no rotation");
    altered("b.toml", "mass_kg = 80.817", "mass_kg = nan", "greater than zero");
    altered("c.toml", "name = \"posture 2\"", "name = \"posture 1\"", "twice");
    altered("d.toml", "mass_kg = 80.817", "mas_kg = 80.817", "mas_kg");
    altered("grams.toml", "mass_kg = 80.817", "mass_kg = 80817.0", "is it in g?");
    altered("mm.toml", "[0.0002, -0.2562, -0.1265]", "[0.2, -256.2, -126.5]", "is it in mm?");
    altered("heavy.toml", "{ arm = 14.896 }", "{ arm = 148.96 }", "less than all");
    altered("nobody.toml", "{ arm = 14.896 }", "{ leg = 14.896 }", "no such [[link]]");
    // An attitude the wrong way round contradicts the others; the paper's own do not.
    let turned = [
        (
            "[[0.9999, 0.0071, 0.0099], [-0.0096, 0.9576, 0.2880], [-0.0074, -0.2881, 0.9576]]",
            "[[0.9999, -0.0096, -0.0074], [0.0071, 0.9576, -0.2881], [0.0099, 0.2880, 0.9576]]",
        ),
        ("", ""),
    ];
    for (from, to) in turned {
        fs::write(place.path().join("t.toml"), good.replacen(from, to, 1)).unwrap();
        let output = rigident(place.path(), &["vibration", "postures", "t.toml"]);
        assert_eq!(said(&output).contains("contradict one another"), !from.is_empty(), "{}", said(&output));
    }
    // A posture taken twice adds no rank, and what it leaves is named.
    let first = good.split("[[posture]]").nth(1).unwrap().replace("posture 1", "again");
    let start = good.split("[[posture]]").take(2).collect::<Vec<_>>().join("[[posture]]");
    fs::write(place.path().join("e.toml"), format!("{start}[[posture]]{first}")).unwrap();
    let output = rigident(place.path(), &["vibration", "postures", "e.toml"]);
    let table = String::from_utf8_lossy(&output.stdout);
    assert!(status(&output) == 1 && said(&output).contains("again adds no rank"), "{}", said(&output));
    assert!(table.contains("not identified"), "{table}");
    // Springs.
    let springs = "[suspension]\nanchor_height_m = 0.0\nstiffness = \
                   [[1.0,0,0,0,0,0],[0,1.0,0,0,0,0],[0,0,1.0,0,0,0],[0,0,0,1.0,0,0],[0,0,0,0,1.0,0],[0,0,0,0,0,1.0]]\n";
    let rows: String = (0..400).map(|k| format!("{},0,0,0,1,0,0,0\n", f64::from(k) * 0.01)).collect();
    fs::write(place.path().join("s.csv"), format!("t_s,x_m,y_m,z_m,qw,qx,qy,qz\n{rows}")).unwrap();
    for (from, to, words) in [
        ("[0,1.0,0,0,0,0]", "[0.5,1.0,0,0,0,0]", "symmetric"),
        ("[0,0,1.0,0,0,0]", "[0,0,-1.0,0,0,0]", "greater than zero"),
    ] {
        fs::write(place.path().join("s.rig.toml"), springs.replacen(from, to, 1)).unwrap();
        refused(&["vibration", "identify", "s.csv"], words);
    }
    // Nothing moves.
    fs::write(place.path().join("s.rig.toml"), springs).unwrap();
    refused(&["vibration", "identify", "s.csv"], "s: ");
}

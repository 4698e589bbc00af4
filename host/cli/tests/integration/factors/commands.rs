use std::fs;

use serde_json::Value;

use super::simulated::{body, fixture, json, noise, rigident, said, status, together, values, write};

/// Largest difference of values and of uncertainties, in units of the uncertainty.
fn apart(a: &[(f64, f64)], b: &[(f64, f64)]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|((v, u), (w, t))| (v - w).abs().max((u - t).abs()) / u).fold(0.0, f64::max)
}

#[test]
fn a_factor_answers_as_its_recording_does_and_runs_merge_in_any_order() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    // Two rig files give σ, one leaves it to the residuals.
    for (name, seed, cell) in [("a", 1, noise()), ("b", 2, noise()), ("c", 3, String::new())] {
        write(at, name, body(), seed, &cell);
        let output = rigident(at, &["factor", &format!("{name}.csv"), "-o", &format!("{name}.factor")]);
        assert_eq!(status(&output), 0, "{}", said(&output));
        let identified = json(at, &["identify", &format!("{name}.csv"), "--json", "--out", name]);
        let solved = json(at, &["solve", &format!("{name}.factor"), "--json"]);
        // The factor is solved anew: rounding times the condition number, below 1e3.
        let distance = apart(&values(&identified), &values(&solved));
        assert!(distance < 1e-8, "{name}: {distance}");
        assert_eq!(solved["source"]["recording"], name);
        assert!(solved.get("residual_rms").is_none() && identified.get("residual_rms").is_some());
        // The file that every identification leaves is the very same.
        let left = fs::read(at.join(format!("{name}/{name}.factor"))).unwrap();
        assert_eq!(left, fs::read(at.join(format!("{name}.factor"))).unwrap());
    }
    let mut answers: Vec<Value> = Vec::new();
    for (k, order) in [["a", "b", "c"], ["c", "a", "b"], ["b", "c", "a"]].iter().enumerate() {
        let files = order.map(|name| format!("{name}.factor"));
        let output = format!("m{k}.factor");
        let [x, y, z] = &files;
        let merged = rigident(at, &["merge", x, y, z, "-o", &output]);
        assert_eq!(status(&merged), 0, "{}", said(&merged));
        answers.push(json(at, &["solve", &output, "--json", "--out", &format!("out{k}")]));
        assert_eq!(
            answers[k],
            serde_json::from_slice::<Value>(&fs::read(at.join(format!("out{k}/result.json"))).unwrap())
                .unwrap()
        );
    }
    // In pairs, and from the recordings themselves.
    for arguments in [
        &["merge", "a.factor", "b.factor", "-o", "ab.factor"][..],
        &["merge", "ab.factor", "c.factor", "-o", "m3.factor"],
        &["factor", "b.csv", "c.csv", "a.csv", "-o", "m4.factor"],
    ] {
        let output = rigident(at, arguments);
        assert_eq!(status(&output), 0, "{}", said(&output));
    }
    answers.extend(["m3.factor", "m4.factor"].map(|file| json(at, &["solve", file, "--json"])));
    let first = values(&answers[0]);
    assert_eq!(first.len(), 10);
    for other in &answers[1..] {
        // Rounding: the condition number, below 1e3, times ε.
        assert!(apart(&first, &values(other)) < 1e-11, "{}", apart(&first, &values(other)));
    }
    // Three alike runs know what one knows, √3 times better.
    let one = values(&json(at, &["solve", "a.factor", "--json"]));
    for ((_, alone), (_, merged)) in one.iter().zip(&first) {
        let gain = alone / merged;
        // The third's σ is estimated, from about 250 effective readings a channel: 5 % at most.
        assert!((gain / 3_f64.sqrt() - 1.0).abs() < 0.05, "{gain}");
    }
    assert!(answers[0]["warnings"].as_array().unwrap().is_empty(), "{}", answers[0]["warnings"]);
}

/// Gives the numbers of a table, but for its times, digits that single precision does not hold.
fn beyond_single(path: &std::path::Path) {
    let text = fs::read_to_string(path).unwrap();
    let cell = |(k, cell): (usize, &str)| match cell.parse::<f64>() {
        Ok(value) if k > 0 => (value * (1.0 + 1e-8 * (k % 3) as f64)).to_string(),
        _ => cell.to_owned(),
    };
    let row = |line: &str| line.split(',').enumerate().map(cell).collect::<Vec<_>>().join(",");
    let is_row = |line: &str| line.starts_with(|c: char| c.is_ascii_digit() || c == '-');
    let lines = text.lines().map(|line| if is_row(line) { row(line) } else { line.to_owned() });
    fs::write(path, lines.collect::<Vec<_>>().join("\n") + "\n").unwrap();
}

/// A recording streamed through the firmware, of one body and of two links, with its noise stated or not,
/// leaves the factor that the recording has: they answer as one, and merged they count once. A part of a
/// recording counts twice beside the whole, and that is reported.
#[test]
fn the_factor_that_a_replay_leaves_is_that_of_its_recording() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    write(at, "stated", body(), 1, &noise());
    write(at, "shown", body(), 2, "");
    let words = ["demo", "--body", "two-links", "--duration-s", "20", "--json", "--out", "links"];
    json(at, &words);
    let packed = rigident(at, &["convert", "links/demo.mcap", "links.csv"]);
    assert_eq!(status(&packed), 0, "{}", said(&packed));
    beyond_single(&at.join("links.csv"));
    for name in ["stated", "shown", "links"] {
        let [file, identify, replay] = [".csv", "-identified", "-replayed"].map(|end| format!("{name}{end}"));
        let identified = json(at, &["identify", &file, "--json", "--out", &identify]);
        let replayed = json(at, &["replay", &file, "--mcu", "inproc", "--json", "--out", &replay]);
        let [a, b] = [&replay, &identify].map(|folder| format!("{folder}/{name}.factor"));
        let both = format!("{name}-both.factor");
        let merged = rigident(at, &["merge", &a, &b, "-o", &both]);
        assert_eq!(status(&merged), 0, "{}", said(&merged));
        assert!(said(&merged).contains("1 of 2 factors are left out"), "{}", said(&merged));
        for other in [&replayed, &json(at, &["solve", &a, "--json"]), &json(at, &["solve", &both, "--json"])]
        {
            let distance = apart(&values(&identified), &values(other));
            assert!(distance < 1e-9, "{name}: {distance}");
        }
    }
    // Two thirds of it: of the eight readings that a factor keeps some five are in both.
    let whole = fs::read_to_string(at.join("stated.csv")).unwrap();
    let part: Vec<&str> = whole.lines().take(2 * whole.lines().count() / 3).collect();
    fs::write(at.join("part.csv"), format!("{}\n", part.join("\n"))).unwrap();
    fs::copy(at.join("stated.rig.toml"), at.join("part.rig.toml")).unwrap();
    json(at, &["replay", "part.csv", "--mcu", "inproc", "--json", "--out", "begun"]);
    let twice = ["merge", "begun/part.factor", "stated-identified/stated.factor", "-o", "twice.factor"];
    let twice = rigident(at, &twice);
    assert!(said(&twice).contains("have readings in common"), "{}", said(&twice));
}

/// A factor whose recording lost a part of the body half-way, and one of an honest recording.
#[test]
fn accusations_of_a_recording_follow_its_factor() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    write(at, "lost", together(&body(), &fixture()), 1, &noise());
    let both = fs::read_to_string(at.join("lost.csv")).unwrap();
    write(at, "lost", body(), 1, &noise());
    let alone = fs::read_to_string(at.join("lost.csv")).unwrap();
    let half = both.lines().count() / 2;
    let lines: Vec<&str> = both.lines().take(half).chain(alone.lines().skip(half)).collect();
    fs::write(at.join("lost.csv"), format!("{}\n", lines.join("\n"))).unwrap();
    write(at, "honest", together(&body(), &fixture()), 2, &noise());
    write(at, "bare", fixture(), 3, &noise());
    for name in ["lost", "honest", "bare"] {
        let output = rigident(at, &["factor", &format!("{name}.csv"), "-o", &format!("{name}.factor")]);
        assert_eq!(status(&output), 0, "{}", said(&output));
        assert_eq!(said(&output).contains("not to be used"), name == "lost", "{}", said(&output));
    }
    let merged = rigident(at, &["merge", "honest.factor", "lost.factor", "-o", "merged.factor", "--force"]);
    assert_eq!(status(&merged), 0, "{}", said(&merged));
    let accused = |answer: &Value| {
        let runs = answer["runs"].as_array().unwrap().clone();
        let bad = runs.iter().filter(|run| run["verdict"] == "implausible");
        let named = bad.map(|run| run["recording"].as_str().unwrap().to_owned()).collect::<Vec<_>>();
        let words = answer["warnings"].as_array().unwrap();
        assert!(named.iter().all(|name| words.iter().any(|w| w.as_str().unwrap().starts_with(name))));
        (answer["status"].as_str().unwrap().to_owned(), named)
    };
    let lost = ("implausible".to_owned(), vec!["lost".to_owned()]);
    for arguments in [
        &["solve", "lost.factor", "--json"][..],
        &["solve", "merged.factor", "--json"],
        &["solve", "honest.factor", "--tare", "lost.factor", "--json"],
    ] {
        let answer: Value = serde_json::from_slice(&rigident(at, arguments).stdout).unwrap();
        assert_eq!(accused(&answer), lost, "{arguments:?}");
    }
    let honest = json(at, &["solve", "honest.factor", "--json"]);
    assert_eq!(accused(&honest), ("identified".to_owned(), Vec::new()));
    let tared = json(at, &["solve", "honest.factor", "--tare", "bare.factor", "--json"]);
    assert_eq!(accused(&tared).1, Vec::<String>::new());
}

#[test]
fn a_shared_offset_is_one_and_knows_more() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    write(at, "a", body(), 1, &noise());
    // Each seed draws offsets of its own: two halves of one run have them in common.
    let text = fs::read_to_string(at.join("a.csv")).unwrap();
    let mut lines = text.lines();
    let header = lines.next().unwrap().to_owned();
    let rows: Vec<&str> = lines.collect();
    let (early, late) = rows.split_at(rows.len() / 2);
    for (name, half) in [("early", early), ("late", late)] {
        fs::write(at.join(format!("{name}.csv")), format!("{header}\n{}\n", half.join("\n"))).unwrap();
        fs::copy(at.join("a.rig.toml"), at.join(format!("{name}.rig.toml"))).unwrap();
    }
    for (extra, file) in [(&["--shared-offset"][..], "shared.factor"), (&[], "own.factor")] {
        let output = rigident(at, &[&["factor", "early.csv", "late.csv", "-o", file][..], extra].concat());
        assert_eq!(status(&output), 0, "{}", said(&output));
    }
    let whole = values(&json(at, &["identify", "a.csv", "--json", "--out", "o"]));
    let shared = values(&json(at, &["solve", "shared.factor", "--json"]));
    let own = values(&json(at, &["solve", "own.factor", "--json"]));
    assert_eq!((whole.len(), shared.len(), own.len()), (16, 16, 10));
    for ((w, s), o) in whole.iter().zip(&shared).zip(&own) {
        // Only the row blocks across the cut are missing: one in a hundred.
        assert!((s.1 / w.1 - 1.0).abs() < 0.02 && (s.0 - w.0).abs() < 0.3 * w.1, "{w:?} {s:?}");
        assert!(o.1 > s.1, "{s:?} {o:?}");
    }
}

#[test]
fn the_fixture_is_taken_off_by_every_command_alike() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    write(at, "total", together(&body(), &fixture()), 1, &noise());
    write(at, "fixture", fixture(), 2, &noise());
    for name in ["total", "fixture"] {
        let output = rigident(at, &["factor", &format!("{name}.csv"), "-o", &format!("{name}.factor")]);
        assert_eq!(status(&output), 0, "{}", said(&output));
    }
    let untared = values(&json(at, &["solve", "total.factor", "--json"]));
    let bare = values(&json(at, &["solve", "fixture.factor", "--json"]));
    let answers = [
        json(at, &["solve", "total.factor", "--tare", "fixture.factor", "--json"]),
        json(at, &["identify", "total.csv", "--json", "--out", "i", "--tare", "fixture.csv"]),
        json(at, &["identify", "total.csv", "--json", "--out", "j", "--tare", "fixture.factor"]),
        json(at, &["replay", "total.csv", "--json", "--out", "r", "--tare", "fixture.csv"]),
    ];
    let truth = body().parameters();
    for (k, answer) in answers.iter().enumerate() {
        let tared = values(answer);
        assert_eq!(tared.len(), 16);
        // Firmware rounds to f32: a hundredth of the uncertainty. In double precision ε times the condition
        // number times value over uncertainty, 2e-16 · 1e3 · 1e3, some times over.
        let rounding = if k == 3 { 1e-2 } else { 1e-8 };
        for j in 0..10 {
            let (value, u95) = tared[j];
            assert!((value - (untared[j].0 - bare[j].0)).abs() < rounding * u95, "{k} {j}: {value}");
            assert!((u95 / untared[j].1.hypot(bare[j].1) - 1.0).abs() < rounding, "{k} {j}: {u95}");
            assert!((value - truth[j]).abs() < 5.0 * u95 / 1.96, "{k} {j}: {value} ± {u95}");
        }
        // The offsets are the run's own.
        for j in 10..16 {
            assert!((tared[j].0 - untared[j].0).abs() < rounding * untared[j].1, "{k} {j}");
            assert!((tared[j].1 / untared[j].1 - 1.0).abs() < rounding, "{k} {j}");
        }
        assert!(answer["notes"].to_string().contains("tare: a fixture of 5.98"), "{}", answer["notes"]);
    }
    // What is left behind is the run as it was.
    assert_eq!(fs::read(at.join("i/total.factor")).unwrap(), fs::read(at.join("total.factor")).unwrap());
}

#[test]
fn a_tare_that_does_not_tell_the_tensor_leaves_it_unknown() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    write(at, "total", together(&body(), &fixture()), 1, &noise());
    // Still poses: the fixture's weight turned about, and an offset.
    let mut text = "fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,gx_mps2,gy_mps2,gz_mps2\n".to_owned();
    let (m, c) = (fixture().mass_kg, nalgebra::Vector3::from(fixture().com_m));
    for (roll, pitch) in
        [(0.0, 0.0), (0.4, 0.0), (-0.4, 0.1), (0.0, 0.4), (0.1, -0.4), (0.3, 0.3), (-0.3, 0.3)]
    {
        let r = nalgebra::Rotation3::from_euler_angles(roll, pitch, 0.0);
        let g = r.inverse() * nalgebra::Vector3::new(0.0, 0.0, -9.80665);
        let force = -m * g;
        let moment = c.cross(&force);
        let cells: Vec<String> =
            (force.iter().map(|v| v + 1.0).chain(moment.iter().copied()).chain(g.iter().copied()))
                .map(|v: f64| v.to_string())
                .collect();
        text.push_str(&format!("{}\n", cells.join(",")));
    }
    fs::write(at.join("poses.csv"), text).unwrap();
    fs::write(
        at.join("poses.rig.toml"),
        "[recording]\nstatic = true\n[load_cell]\nnoise_n_nm = [0.1, 0.1, 0.1, 0.01, 0.01, 0.01]\n",
    )
    .unwrap();
    let asked = ["--estimate", "m,mc", "--json", "--out", "o"];
    let result = json(at, &[&["identify", "total.csv", "--tare", "poses.csv"][..], &asked].concat());
    let states: Vec<&str> =
        result["parameters"].as_array().unwrap().iter().map(|p| p["state"].as_str().unwrap()).collect();
    assert_eq!(states[..4], ["identified"; 4]);
    assert_eq!(states[4..10], ["not_identified"; 6]);
    assert_eq!(states[10..], ["identified"; 6]);
    let truth = body().parameters();
    for (j, (value, u95)) in values(&result).iter().take(4).enumerate() {
        assert!((value - truth[j]).abs() < 5.0 * u95 / 1.96, "{j}: {value} ± {u95}, truth {}", truth[j]);
    }
    assert!(result["condition_number"].as_f64().unwrap() < 1e3);
    assert!(result.get("inertia_com_kgm2").is_none() && !result.to_string().contains("null"));
}

#[test]
fn runs_of_different_bodies_are_refused_unless_forced_and_then_distinguished() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    write(at, "a", body(), 1, &noise());
    write(at, "b", together(&body(), &fixture()), 2, &noise());
    let refused = rigident(at, &["factor", "a.csv", "b.csv", "-o", "ab.factor"]);
    assert_eq!(status(&refused), 2, "{}", said(&refused));
    assert!(said(&refused).contains("disagree") && said(&refused).contains("--force"), "{}", said(&refused));
    for name in ["a", "b"] {
        let output = rigident(at, &["factor", &format!("{name}.csv"), "-o", &format!("{name}.factor")]);
        assert_eq!(status(&output), 0, "{}", said(&output));
    }
    let refused = rigident(at, &["merge", "a.factor", "b.factor", "-o", "ab.factor"]);
    assert_eq!(status(&refused), 2, "{}", said(&refused));
    assert!(said(&refused).contains("a + b disagree"), "{}", said(&refused));
    assert!(!at.join("ab.factor").exists());
    let output = rigident(at, &["merge", "a.factor", "b.factor", "--force", "-o", "ab.factor"]);
    assert_eq!(status(&output), 0, "{}", said(&output));
    assert!(said(&output).contains("disagree"), "{}", said(&output));
    let result = json(at, &["solve", "ab.factor", "--json", "--estimate", "m"]);
    assert!(result["warnings"].to_string().contains("disagree"), "{}", result["warnings"]);
    // 20 kg and 26 kg: the interval says so.
    let (mass, u95) = values(&result)[0];
    assert!(mass - u95 < 23.0 && mass + u95 > 23.0 && u95 > 0.3, "{mass} ± {u95}");
}

#[test]
fn offsets_asked_of_merged_runs_are_reported_as_eliminated() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    for (name, seed) in [("a", 1), ("b", 2)] {
        write(at, name, body(), seed, &noise());
    }
    let output = rigident(at, &["factor", "a.csv", "b.csv", "-o", "both.factor"]);
    assert_eq!(status(&output), 0, "{}", said(&output));
    let solved = rigident(at, &["solve", "both.factor", "--estimate", "offset"]);
    let table = String::from_utf8_lossy(&solved.stdout).into_owned();
    let table = format!("{table}{}", said(&solved));
    assert_eq!(status(&solved), 2, "{table}");
    assert!(table.contains("each run has its own") && table.contains("--shared-offset"), "{table}");
    let body_only = json(at, &["solve", "both.factor", "--json"]);
    assert!(!body_only["warnings"].to_string().contains("offset"), "{}", body_only["warnings"]);
}

#[test]
fn runs_of_one_rig_share_its_errors_and_say_so() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    for (name, seed) in [("a", 1), ("b", 2)] {
        write(at, name, body(), seed, &format!("{}\ngain_uncertainty = {:?}", noise(), [0.01; 6]));
    }
    let output = rigident(at, &["factor", "a.csv", "b.csv", "-o", "ab.factor"]);
    assert_eq!(status(&output), 0, "{}", said(&output));
    assert!(said(&output).contains("serial number"), "{}", said(&output));
    let alone = rigident(at, &["factor", "a.csv", "-o", "a.factor"]);
    assert!(!said(&alone).contains("serial number"), "{}", said(&alone));
    let u95 = |result: &serde_json::Value| values(result)[0].1;
    let one = u95(&json(at, &["solve", "a.factor", "--json"]));
    let both = json(at, &["solve", "ab.factor", "--json"]);
    assert!(both["notes"].to_string().contains("serial number"), "{}", both["notes"]);
    // Gains are most of the mass's interval, and of one load cell.
    assert!(u95(&both) > 0.9 * one, "{} {one}", u95(&both));
    for (name, label) in [("a", "rig=north"), ("b", "rig=south")] {
        let [csv, out] = [format!("{name}.csv"), format!("{name}-of.factor")];
        let output = rigident(at, &["factor", &csv, "--label", label, "-o", &out]);
        assert_eq!(status(&output), 0, "{}", said(&output));
    }
    let output = rigident(at, &["merge", "a-of.factor", "b-of.factor", "-o", "two.factor"]);
    assert!(said(&output).contains("2 load cells (north, south)"), "{}", said(&output));
    let two = u95(&json(at, &["solve", "two.factor", "--json"]));
    assert!((two / one - 0.5_f64.sqrt()).abs() < 0.05, "{two} {one}");
}

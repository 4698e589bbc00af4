//! Many factors: by label, from tables, done again.

use std::fs;

use super::simulated::{body, fixture, json, noise, rigident, said, status, values, write};

/// Two bodies on two rigs, a recording each twice.
fn factors(at: &std::path::Path) -> Vec<String> {
    let mut files = Vec::new();
    for (name, seed, what, rig) in
        [("a", 1, body(), "1"), ("b", 2, body(), "1"), ("c", 3, body(), "2"), ("d", 4, fixture(), "1")]
    {
        let labels = format!("[recording]\nlabels = {{ rig = \"{rig}\" }}\n");
        write(at, name, what, seed, &noise());
        let rig_file = at.join(format!("{name}.rig.toml"));
        let text = fs::read_to_string(&rig_file).unwrap_or_default();
        assert!(!text.contains("[recording]"));
        fs::write(&rig_file, format!("{labels}{text}")).unwrap();
        let kind = if name == "d" { "body=fixture" } else { "body=payload" };
        let file = format!("{name}.factor");
        let made = rigident(at, &["factor", &format!("{name}.csv"), "--label", kind, "-o", &file]);
        assert_eq!(status(&made), 0, "{}", said(&made));
        files.push(file);
    }
    files
}

#[test]
fn factors_are_merged_by_the_labels_of_their_runs() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let files = factors(at);
    fs::write(at.join("list.txt"), files.join("\n") + "\na.factor\n").unwrap();
    let merged = rigident(at, &["merge", "--from", "list.txt", "--by", "body,rig", "-o", "bodies"]);
    assert_eq!(status(&merged), 0, "{}", said(&merged));
    assert!(said(&merged).contains("body=payload,rig=1: 1 of 3 factors are left out"), "{}", said(&merged));
    let mut names: Vec<String> = fs::read_dir(at.join("bodies"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(
        names,
        ["body=fixture,rig=1.factor", "body=payload,rig=1.factor", "body=payload,rig=2.factor"]
    );
    let both = rigident(at, &["merge", "a.factor", "b.factor", "-o", "both.factor"]);
    assert_eq!(status(&both), 0, "{}", said(&both));
    let solved = |file: &str| values(&json(at, &["solve", file, "--json"]));
    assert_eq!(solved("bodies/body=payload,rig=1.factor"), solved("both.factor"));
    // Different bodies as one, and a label that some lack, are refused, and nothing is written.
    let foreign = rigident(at, &["merge", "--from", "list.txt", "--by", "rig", "-o", "rigs"]);
    assert_eq!(status(&foreign), 2, "{}", said(&foreign));
    assert!(said(&foreign).contains("rig=1") && !at.join("rigs").exists(), "{}", said(&foreign));
    let day = rigident(at, &["merge", "--from", "list.txt", "--by", "body,day", "-o", "days"]);
    assert_eq!(status(&day), 2);
    assert!(said(&day).contains("label day") && said(&day).contains("--label day="), "{}", said(&day));
    let label = rigident(at, &["factor", "a.csv", "--label", "day", "-o", "x.factor"]);
    assert_eq!(status(&label), 2);
    assert!(said(&label).contains("KEY=VALUE"), "{}", said(&label));
}

#[test]
fn a_table_of_factors_is_merged_as_its_factors_are() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let files = factors(at);
    let made = rigident(at, &["factor", "a.csv", "b.csv", "-o", "ab.parquet"]);
    assert_eq!(status(&made), 0, "{}", said(&made));
    let made = rigident(at, &["merge", &files[2], &files[3], "--by", "rig", "-o", "cd.parquet"]);
    assert_eq!(status(&made), 0, "{}", said(&made));
    for (name, sources) in [("tables", ["ab.parquet", "c.factor"]), ("again", ["ab.parquet", "ab.parquet"])] {
        let merged = rigident(at, &["merge", sources[0], sources[1], "-o", &format!("{name}.factor")]);
        assert_eq!(status(&merged), 0, "{}", said(&merged));
    }
    let solved = |file: &str| values(&json(at, &["solve", file, "--json"]));
    for (name, sources) in [("abc", &files[..3]), ("ab", &files[..2])] {
        let output = format!("{name}.factor");
        let arguments: Vec<&str> =
            ["merge"].into_iter().chain(sources.iter().map(String::as_str)).chain(["-o", &output]).collect();
        assert_eq!(status(&rigident(at, &arguments)), 0);
    }
    assert_eq!(solved("tables.factor"), solved("abc.factor"));
    assert_eq!(solved("again.factor"), solved("ab.factor"));
    let whole = fs::read(at.join("ab.parquet")).unwrap();
    fs::write(at.join("half.parquet"), &whole[..whole.len() / 2]).unwrap();
    for arguments in [&["merge", "half.parquet", "-o", "x.factor"][..], &["solve", "ab.parquet"]] {
        let refused = rigident(at, arguments);
        assert_eq!(status(&refused), 2, "{}", said(&refused));
        assert!(said(&refused).contains("parquet"), "{}", said(&refused));
    }
    assert!(!at.join("x.factor").exists());
}

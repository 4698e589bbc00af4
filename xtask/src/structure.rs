//! The verb `structure`: what must hold of the sources as a whole.
//!
//! No options and no commands of the command line in texts of crates below it, no circles among a crate's
//! rooms, no code for Unix alone outside its features, sizes of factors named in one file of the host,
//! answers judged in one room, textbook words, comments of 110 columns, functions of 80 lines. What is not so
//! yet is in lists here, each entry with its reason; an entry that is no longer needed fails too.

mod circles;
mod judgements;
mod modules;
mod options;
mod words;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::places;
use crate::process;
use circles::{Arrows, circles, levels};
use modules::Crate;

/// Crates of the host's workspace, by folder; xtask itself is a tool of this repository.
const CRATES: [&str; 20] = [
    "shared",
    "firmware",
    "hexapod",
    "hil-sim",
    "host/fit",
    "host/io",
    "host/model",
    "host/rows",
    "host/vibration",
    "host/identify",
    "host/people",
    "host/present",
    "host/device",
    "host/laboratory",
    "host/plan",
    "host/study",
    "host",
    "host/cli",
    "python",
    "tables",
];

/// Packages that only Unix has, or that only the emulator needs: optional wherever they are used.
const OPTIONAL: [&str; 4] = ["defmt-decoder", "inotify", "libc", "nix"];

/// The host's names for sizes of factors.
const SIZES: [&str; 2] = ["Ten", "Sixteen"];

/// An arrow that closes a circle and is known: crate, room that holds both ends ("" for the crate itself),
/// from, to, reason.
type KnownArrow = (&'static str, &'static str, &'static str, &'static str, &'static str);

const KNOWN_ARROWS: [KnownArrow; 27] = [
    ("shared", "", "factor", "forgetting", "a factor in a cascade forgets by itself"),
    ("shared", "", "scalar", "factor", "a scalar brings the factor's fastest kernel for it"),
    ("shared", "", "scalar", "linear_algebra", "a scalar brings the fastest sums over slices for it"),
    ("shared", "factor", "cascade", "body", "the levels are factors, and the factor holds levels"),
    ("shared", "wire", "links", "messages", "a reading of a link holds one of a body"),
    ("firmware", "", "settings", "sample_path", "the settings hold the limits that the sample path checks"),
    ("host/io", "", "rig", "recording", "a rig file's columns are those a recording may have"),
    ("host/fit", "", "pool", "factor_file", "a pooled factor reads and writes itself"),
    ("host/fit", "", "source", "condition", "the default of a source's filter is in another file"),
    ("host/fit", "", "source", "made_blocks", "the default of a source's blocks is in another file"),
    (
        "host/device",
        "platform",
        "clock",
        "pace",
        "a simulated world holds the watch of the motion that it drives",
    ),
    ("host/device", "platform", "error", "gcs", "an error words the codes of the protocol"),
    ("host/device", "platform", "gcs", "address", "the line is beside the address that opens it"),
    ("host/device", "platform", "stream", "address", "the line is beside the address that opens it"),
    ("host/rows", "tree", "frames", "contact", "the input of a tree holds its contacts"),
    ("host/rows", "tree", "frames", "errors", "the input of a tree holds errors of its signals"),
    ("host/rows", "tree", "frames", "rows", "the input of a tree makes the maker of its rows"),
    ("host/rows", "tree", "contact", "rows", "the number of rows of a base is beside them"),
    ("host/rows", "tree", "source", "friction_speed", "a source finds the speed of friction in itself"),
    ("host/rows", "tree", "source", "sensitivities", "a source makes the rows of its own errors"),
    ("host/people", "person", "people", "level", "a person is judged by what was made of the trials"),
    ("host/people", "person", "people", "plausible", "a person is judged by what was made of the trials"),
    ("tables", "", "document", "estimation", "the list of documents is beside their type"),
    ("tables", "", "document", "faults", "the list of documents is beside their type"),
    ("tables", "", "document", "people", "the list of documents is beside their type"),
    ("tables", "", "document", "platform", "the list of documents is beside their type"),
    ("tables", "", "document", "trees", "the list of documents is beside their type"),
];

/// Files of the host that name sizes of factors, with the reason: none, as it has one `Factor`.
const KNOWN_SIZES: [(&str, &str); 0] = [];

/// Crates that know neither options nor commands: the command line and Python word the remedy in their own
/// terms.
const WITHOUT_OPTIONS: [&str; 15] = [
    "shared",
    "hexapod",
    "host/fit",
    "host/io",
    "host/model",
    "host/rows",
    "host/vibration",
    "host/identify",
    "host/people",
    "host/present",
    "host/device",
    "host/laboratory",
    "host/plan",
    "host/study",
    "host",
];

/// The room that judges answers: nothing else sets a status or a state of a parameter.
const JUDGE: (&str, &str) = ("host/identify", "answer");

/// Runs every check.
pub fn run() -> Result<()> {
    let mut complaints = Vec::new();
    for folder in CRATES {
        let parsed = parse(folder)?;
        complaints.extend(circle_complaints(folder, &levels(&parsed.references()), &KNOWN_ARROWS));
        complaints.extend(parsed.unguarded_unix().into_iter().map(|(file, path)| {
            format!(
                "{folder}/src/{}: {path} is there on Unix alone: put it under cfg(unix) or the feature \
                     `emulator`",
                file.display()
            )
        }));
        if folder.starts_with("host") {
            complaints.extend(size_complaints(folder, &parsed.files_naming(&SIZES), &KNOWN_SIZES));
        }
        if WITHOUT_OPTIONS.contains(&folder) {
            complaints.extend(option_complaints(folder, &parsed.files_with(options::names_the_command_line)));
        }
        complaints.extend(judgement_complaints(folder, &parsed.files_with(judgements::sets_judgement)));
    }
    complaints.extend(package_complaints()?);
    complaints.extend(words::complaints()?);
    if complaints.is_empty() {
        println!("the sources are in order: {}", CRATES.join(", "));
        return Ok(());
    }
    bail!("{} findings\n{}", complaints.len(), complaints.join("\n"))
}

fn parse(folder: &str) -> Result<Crate> {
    let root = places::root().join(folder).join("src");
    let mut sources = BTreeMap::new();
    read(&root, &root, &mut sources)?;
    // A program's modules hang on its main file.
    if let Some(main) = sources.remove(Path::new("main.rs")) {
        sources.entry(PathBuf::from("lib.rs")).or_insert(main);
    }
    Crate::parse(&sources).with_context(|| format!("in {folder}/src"))
}

fn read(root: &Path, folder: &Path, sources: &mut BTreeMap<PathBuf, String>) -> Result<()> {
    for entry in std::fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let path = entry?.path();
        if path.is_dir() {
            read(root, &path, sources)?;
        } else if path.extension().is_some_and(|e| e == "rs") {
            sources.insert(path.strip_prefix(root)?.to_owned(), std::fs::read_to_string(&path)?);
        }
    }
    Ok(())
}

/// Returns circles that are not known, and known arrows that close none.
fn circle_complaints(folder: &str, levels: &BTreeMap<String, Arrows>, known: &[KnownArrow]) -> Vec<String> {
    let mut complaints = Vec::new();
    for (room, arrows) in levels {
        let here: BTreeSet<(String, String)> = known
            .iter()
            .filter(|(of, within, ..)| *of == folder && within == room)
            .map(|(_, _, from, to, _)| ((*from).to_owned(), (*to).to_owned()))
            .collect();
        for group in circles(arrows.keys().filter(|arrow| !here.contains(arrow))) {
            let inside = |(from, to): &(String, String)| group.contains(from) && group.contains(to);
            let list: Vec<String> = arrows
                .iter()
                .filter(|(arrow, _)| inside(arrow) && !here.contains(arrow))
                .map(|((from, to), file)| format!("  {from} -> {to}, as in {}", file.display()))
                .collect();
            let place = if room.is_empty() { folder.to_owned() } else { format!("{folder}, {room}") };
            complaints.push(format!("{place}: {} form a circle\n{}", group.join(", "), list.join("\n")));
        }
        for arrow in &here {
            let others = arrows.keys().filter(|other| *other == arrow || !here.contains(*other));
            let closes = arrows.contains_key(arrow)
                && circles(others).iter().any(|group| group.contains(&arrow.0) && group.contains(&arrow.1));
            if !closes {
                complaints.push(format!(
                    "{folder}, {room}: {} -> {} closes no circle any more: take it off the list",
                    arrow.0, arrow.1
                ));
            }
        }
    }
    for (of, within, from, to, _) in
        known.iter().filter(|(of, within, ..)| *of == folder && !levels.contains_key(*within))
    {
        complaints.push(format!("{of}, {within}: {from} -> {to} is gone: take it off the list"));
    }
    complaints
}

/// Returns files that name sizes of factors and may not, and listed ones that do not.
fn size_complaints(folder: &str, files: &BTreeSet<PathBuf>, known: &[(&str, &str)]) -> Vec<String> {
    let listed = |file: &Path| known.iter().any(|(name, _)| Path::new(name) == file);
    let new = files.iter().filter(|file| !listed(file)).map(|file| {
        format!("{folder}/src/{}: names {}: use the dynamic factor", file.display(), SIZES.join(" or "))
    });
    let gone = known.iter().filter(|(name, _)| !files.contains(Path::new(name))).map(|(name, _)| {
        format!("{folder}/src/{name}: names no sizes of factors any more: take it off the list")
    });
    new.chain(gone).collect()
}

/// Returns files that judge answers and are not in the room that does.
fn judgement_complaints(folder: &str, files: &BTreeSet<PathBuf>) -> Vec<String> {
    let elsewhere = files.iter().filter(|file| folder != JUDGE.0 || !file.starts_with(JUDGE.1));
    let words = |file: &PathBuf| {
        format!(
            "{folder}/src/{}: sets the status of an answer or the state of a parameter: give what was found \
             to `Context`",
            file.display()
        )
    };
    elsewhere.map(words).collect()
}

/// Returns complaints about files whose texts name options or commands.
fn option_complaints(folder: &str, files: &BTreeSet<PathBuf>) -> Vec<String> {
    let words = |file: &PathBuf| {
        format!(
            "{folder}/src/{}: a text names an option or a command of the command line: name the parameter as \
             `lock`, the job as `factor()`, which the command line words as its own",
            file.display()
        )
    };
    files.iter().map(words).collect()
}

/// Returns packages for Unix alone that are not optional.
fn package_complaints() -> Result<Vec<String>> {
    let mut command = process::cargo(places::root());
    let text = process::output(command.args(["metadata", "--no-deps", "--format-version", "1"]))?;
    let metadata: serde_json::Value = serde_json::from_str(&text)?;
    let list = |value: &serde_json::Value| value.as_array().cloned().unwrap_or_default();
    let mut complaints = Vec::new();
    for package in list(&metadata["packages"]).iter().filter(|p| p["name"] != "xtask") {
        for dependency in list(&package["dependencies"]) {
            let name = dependency["name"].as_str().unwrap_or_default();
            if OPTIONAL.contains(&name) && dependency["optional"] != true && dependency["kind"].is_null() {
                complaints.push(format!("{}: {name} must be optional", package["name"]));
            }
        }
    }
    Ok(complaints)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn planted(files: &[(&str, &str)]) -> Crate {
        let sources = files.iter().map(|(file, text)| (PathBuf::from(file), (*text).to_owned())).collect();
        Crate::parse(&sources).unwrap()
    }

    fn found(files: &[(&str, &str)], known: &[KnownArrow]) -> Vec<String> {
        circle_complaints("planted", &levels(&planted(files).references()), known)
    }

    const RIGHT: [(&str, &str); 4] = [
        ("lib.rs", "mod a; mod b; mod c;"),
        ("a.rs", "use crate::b::B; fn f() -> crate::c::C { todo!() }"),
        ("b.rs", "use super::c; pub struct B;"),
        ("c.rs", "pub struct C; #[cfg(test)] mod tests { use crate::a; }"),
    ];

    #[test]
    fn an_answer_is_judged_in_its_room_alone() {
        let files = BTreeSet::from(["answer/new.rs", "cli.rs"].map(PathBuf::from));
        let said = judgement_complaints("host/identify", &files);
        assert!(said.len() == 1 && said[0].starts_with("host/identify/src/cli.rs"), "{said:?}");
        assert_eq!(judgement_complaints("host/cli", &files).len(), 2);
    }

    #[test]
    fn a_text_with_an_option_is_complained_of_wherever_it_is() {
        let files = [
            ("lib.rs", "mod a; mod b; mod c;"),
            ("a.rs", "fn f() -> &'static str { \"say --lock JOINT\" }"),
            ("b.rs", "fn f() -> &'static str { \"say `lock` JOINT, and `factor()`\" }"),
            ("c.rs", "#[derive(Error)] #[error(\"`rigident factor` makes one\")] struct E;"),
        ];
        let found = planted(&files).files_with(options::names_the_command_line);
        let said = option_complaints("planted", &found);
        assert!(said.len() == 2, "{said:?}");
        assert!(
            said[0].starts_with("planted/src/a.rs") && said[1].starts_with("planted/src/c.rs"),
            "{said:?}"
        );
    }

    #[test]
    fn a_planted_circle_is_found_and_a_test_closes_none() {
        assert_eq!(found(&RIGHT, &[]), Vec::<String>::new());
        let mut files = RIGHT;
        files[3].1 = "pub struct C; fn g() { crate::a::f(); }";
        let said = found(&files, &[]).join("\n");
        assert!(said.contains("a, b, c form a circle") && said.contains("c -> a, as in c.rs"), "{said}");
    }

    #[test]
    fn a_circle_through_a_name_that_the_root_hands_on_is_found() {
        let files = [
            ("lib.rs", "mod a; mod b; pub use a::A; pub use b::B;"),
            ("a.rs", "use super::B; pub struct A;"),
            ("b.rs", "use crate::{A as Other}; pub struct B;"),
        ];
        assert!(found(&files, &[])[0].contains("a, b form a circle"));
    }

    #[test]
    fn a_circle_through_a_macro_is_found() {
        let mut files = RIGHT;
        files[3].1 = "pub struct C; fn g() { assert!(matches!(crate::a::f(), Some(_))); }";
        assert!(found(&files, &[])[0].contains("a, b, c form a circle"));
    }

    #[test]
    fn a_circle_within_a_folder_is_found_and_its_own_page_is_no_room() {
        let files = [
            ("lib.rs", "mod room;"),
            ("room/mod.rs", "mod x; mod y; pub struct Page; use x::X;"),
            ("room/x.rs", "use super::{Page, y::Y}; pub struct X;"),
            ("room/y.rs", "pub struct Y(super::Page, Box<super::X>);"),
        ];
        let said = found(&files, &[]);
        assert_eq!(said.len(), 1);
        assert!(said[0].starts_with("planted, room: x, y form a circle"), "{said:?}");
    }

    #[test]
    fn a_known_arrow_is_let_through_and_one_that_closes_nothing_is_not() {
        let mut files = RIGHT;
        files[3].1 = "pub struct C; fn g() { crate::a::f(); }";
        let arrow = ("planted", "", "c", "a", "planted");
        assert_eq!(found(&files, &[arrow]), Vec::<String>::new());
        assert!(found(&RIGHT, &[arrow])[0].contains("closes no circle any more"));
        let elsewhere = ("planted", "gone", "c", "a", "planted");
        assert!(found(&RIGHT, &[elsewhere])[0].contains("is gone"));
    }

    #[test]
    fn code_for_unix_is_found_unless_it_is_guarded() {
        let files = [
            ("lib.rs", "#[cfg(feature = \"emulator\")] mod board; mod a; #[cfg(not(unix))] mod other;"),
            ("board.rs", "use nix::fcntl::OFlag;"),
            ("other.rs", "use std::os::unix::fs::symlink;"),
            (
                "a.rs",
                "fn f() { #[cfg(unix)] b.permissions(std::os::unix::fs::mode(1)); } #[cfg(unix)] fn g() \
                 { use std::os::fd::X; } #[cfg(test)] mod tests { use nix::X; } fn h(_: serialport::TTYPort) \
                 {}",
            ),
        ];
        let found: Vec<_> = planted(&files).unguarded_unix().into_iter().collect();
        let file = |name: &str| PathBuf::from(name);
        assert_eq!(
            found,
            [
                (file("a.rs"), "serialport::TTYPort".to_owned()),
                (file("other.rs"), "std::os::unix::fs::symlink".to_owned())
            ]
        );
    }

    #[test]
    fn a_file_that_names_sizes_is_reported_and_one_that_does_not_any_more_is_too() {
        let files = [
            ("lib.rs", "mod a; mod b;"),
            ("a.rs", "fn f(x: F) { assert!(matches!(x, F::Ten(_)), \"{}\", 1); }"),
            ("b.rs", "/// Factor::Ten is only spoken of.\nfn g() {}"),
        ];
        let plain = [("lib.rs", "mod a;"), ("a.rs", "fn f(x: F) { match x { super::F::Sixteen(_) => {} } }")];
        assert_eq!(planted(&plain).files_naming(&SIZES), [PathBuf::from("a.rs")].into());
        let naming = planted(&files).files_naming(&SIZES);
        assert_eq!(naming, [PathBuf::from("a.rs")].into());
        assert!(size_complaints("planted", &naming, &[])[0].contains("a.rs: names Ten or Sixteen"));
        let both = [("a.rs", "planted"), ("b.rs", "planted")];
        assert!(size_complaints("planted", &naming, &both)[0].contains("b.rs: names no sizes"));
    }
}

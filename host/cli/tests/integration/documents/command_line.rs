//! `docs/commands.md` against the program's own help.

use std::collections::BTreeSet;
use std::process::Command;

use super::{document, same};

fn help(command: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_rigident")).args(command).arg("--help").output().unwrap();
    assert!(output.status.success(), "{command:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// Names of the commands below one.
fn commands(help: &str) -> Vec<String> {
    let below = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let names = below.take_while(|line| !line.is_empty()).filter_map(|line| line.split_whitespace().next());
    names.filter(|name| *name != "help").map(str::to_owned).collect()
}

/// Long options, but for those that every program has.
fn options(help: &str) -> impl Iterator<Item = String> {
    help.lines().filter_map(|line| {
        let line = line.trim_start();
        let long = if line.starts_with("--") { line } else { line.strip_prefix('-')?.get(3..)? };
        let name = long.strip_prefix("--")?.split([' ', '[', '<', '=']).next()?;
        (!matches!(name, "help" | "version")).then(|| format!("--{name}"))
    })
}

/// Every command and option that the help of the program knows.
pub fn known() -> (BTreeSet<String>, BTreeSet<String>) {
    let (mut names, mut longs) = (BTreeSet::new(), BTreeSet::new());
    let mut open: Vec<String> = commands(&help(&[]));
    while let Some(command) = open.pop() {
        let text = help(&command.split(' ').collect::<Vec<_>>());
        longs.extend(options(&text));
        open.extend(commands(&text).into_iter().map(|below| format!("{command} {below}")));
        names.insert(command);
    }
    (names, longs)
}

#[test]
fn every_command_and_every_option_is_described_and_no_other() {
    let text = document("docs/commands.md");
    let (names, longs) = known();
    assert!(names.contains("plan poses") && longs.contains("--rig"), "{names:?} {longs:?}");
    let headings: BTreeSet<String> = text
        .lines()
        .filter(|line| line.starts_with('#'))
        .flat_map(|line| line.split('`').skip(1).step_by(2))
        .map(str::to_owned)
        .collect();
    // `plan` and the like only hold others.
    let alone = names.iter().filter(|name| !names.iter().any(|other| other.starts_with(&format!("{name} "))));
    let alone: BTreeSet<String> = alone.cloned().chain(["montecarlo".to_owned()]).collect();
    same("commands", &headings, &alone);
    let named = text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '-')).filter(|word| {
        word.strip_prefix("--").is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_lowercase()))
    });
    let mut named: BTreeSet<String> = named.map(str::to_owned).collect();
    // Of cargo and of the simulator, whose help is its own.
    for other in ["--release", "--path", "--write-rig", "--help", "--ati", "--ur", "--xsens-port-link"] {
        named.remove(other);
    }
    same("options", &named, &longs);
}

/// Names in backticks that are commands.
fn named_commands(line: &str, names: &BTreeSet<String>) -> Vec<String> {
    line.split('`').skip(1).step_by(2).filter(|word| names.contains(*word)).map(str::to_owned).collect()
}

/// Options in the first cell of a table's row.
fn in_first_cell(line: &str) -> Vec<String> {
    let cell = line.strip_prefix("| ").and_then(|rest| rest.split(" |").next()).unwrap_or_default();
    let words = cell.split('`').skip(1).step_by(2).filter_map(|word| word.split([' ', '=']).next());
    words.filter(|word| word.starts_with("--")).map(str::to_owned).collect()
}

/// Each pair of a command and an option that a heading with the tables below it promises.
fn promised(text: &str, names: &BTreeSet<String>) -> BTreeSet<(String, String)> {
    let (mut commands, mut pairs) = (Vec::new(), BTreeSet::new());
    for line in text.lines() {
        if line.starts_with('#') || line.ends_with(" alone:") {
            commands = named_commands(line, names);
        }
        for option in in_first_cell(line) {
            assert!(!commands.is_empty(), "{option} is of no command");
            pairs.extend(commands.iter().map(|command| (command.clone(), option.clone())));
        }
    }
    pairs
}

#[test]
fn every_option_is_described_for_commands_that_take_it() {
    let (names, _) = known();
    let pairs = promised(&document("docs/commands.md"), &names);
    assert!(pairs.len() > 100, "{}", pairs.len());
    let wrong: Vec<_> = pairs
        .into_iter()
        .filter(|(command, option)| {
            let taken = help(&command.split(' ').collect::<Vec<_>>());
            !options(&taken).any(|long| long == *option)
        })
        .collect();
    assert!(wrong.is_empty(), "described and not taken: {wrong:?}");
}

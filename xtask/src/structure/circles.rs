//! Circles among rooms: the folders and files right below a source folder, and those right below each of
//! them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use super::modules::Reference;

/// Dependencies of one level: from room to room, each with a file in which it is.
pub type Arrows = BTreeMap<(String, String), PathBuf>;

/// Returns the arrows of every level, under the name of the room that holds them; the crate's own under "".
///
/// A folder's own page (its `mod.rs`) is no room: it shows what is inside.
pub fn levels(references: &BTreeSet<Reference>) -> BTreeMap<String, Arrows> {
    let mut levels: BTreeMap<String, Arrows> = BTreeMap::new();
    let mut add = |level: &str, from: &str, to: &str, file: &PathBuf| {
        if from != to {
            let arrows = levels.entry(level.to_owned()).or_default();
            arrows.entry((from.to_owned(), to.to_owned())).or_insert_with(|| file.clone());
        }
    };
    for Reference { from, to, file } in references {
        let (Some(a), Some(b)) = (from.first(), to.first()) else { continue };
        add("", a, b, file);
        if let (true, Some(inner), Some(other)) = (a == b, from.get(1), to.get(1)) {
            add(a, inner, other, file);
        }
    }
    levels
}

/// Returns the rooms that depend on each other in a circle, in groups.
pub fn circles<'a>(arrows: impl Iterator<Item = &'a (String, String)> + Clone) -> Vec<Vec<String>> {
    let rooms: BTreeSet<&str> = arrows.clone().flat_map(|(a, b)| [a.as_str(), b.as_str()]).collect();
    let reached = |from: &str| {
        let (mut seen, mut next) = (BTreeSet::new(), vec![from.to_owned()]);
        while let Some(room) = next.pop() {
            for (_, to) in arrows.clone().filter(|(a, _)| *a == room) {
                if seen.insert(to.clone()) {
                    next.push(to.clone());
                }
            }
        }
        seen
    };
    let reach: BTreeMap<&str, BTreeSet<String>> = rooms.iter().map(|room| (*room, reached(room))).collect();
    let mut done = BTreeSet::new();
    let mut found = Vec::new();
    for room in &rooms {
        if done.contains(room) || !reach[room].contains(*room) {
            continue;
        }
        let group: Vec<&str> = rooms
            .iter()
            .filter(|other| reach[room].contains(**other) && reach[*other].contains(*room))
            .copied()
            .collect();
        done.extend(group.iter().copied());
        found.push(group.into_iter().map(str::to_owned).collect());
    }
    found
}

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use crate::commands::factor::arguments::Merge;
use crate::commands::factor::{absent, check_agreement, read, refused, write_pooled, write_table};
use crate::screen::outcome::say;
use crate::{Failure, Folder, Stages};
use rigident::application::{self, Merged};
use rigident::present;
use rigident_fit::groups::{Values, grouped, values};
use rigident_fit::parallel::{map, threads};
use rigident_fit::pool::PooledFactor;
use rigident_io::factor_table::{Part, is_table, parts};
use rigident_io::union::{Union, union_of_parts};

/// Runs `rigident merge`.
pub(crate) fn merge(arguments: &Merge) -> Result<ExitCode, Failure> {
    let mut files = arguments.factors.clone();
    if let Some(list) = &arguments.from {
        files.extend(listed(list)?);
    }
    if !arguments.by.is_empty() {
        return merge_by(arguments, &files);
    }
    absent(&arguments.output)?;
    let shared = arguments.shared_offset;
    let tables = files.iter().any(|file| is_table(file));
    let (runs, all) = if !tables && present::merged::is_shown(files.len()) {
        let runs = files.iter().map(|path| read(path)).collect::<Result<Vec<_>, _>>()?;
        (runs.clone(), application::merge(runs, shared, arguments.force))
    } else {
        let stages = Stages::new("merging");
        (Vec::new(), application::merge_files(&files, shared, arguments.force, &stages.caller()))
    };
    let Merged { factor, repeated, given, warnings } = all?;
    if repeated > 0 {
        tell!("rigident: {repeated} of {given} factors are left out: their recordings are in others");
    }
    for said in &warnings {
        tell!("rigident: {said}");
    }
    write_pooled(&factor, &runs, &arguments.output)
}

/// Returns the paths that are in a list, one a line; `-` is standard input.
fn listed(list: &Path) -> Result<Vec<PathBuf>, Failure> {
    let refuse = |why: &dyn std::fmt::Display| {
        Failure::input(format!("--from {}: cannot be read: {why}", list.display()))
    };
    let text = if list.as_os_str() == "-" {
        std::io::read_to_string(std::io::stdin())
    } else {
        let bytes = rigident_files::read_or_pipe(list, rigident_files::MOST_OF_TEXT);
        bytes.and_then(|bytes| std::io::read_to_string(bytes.as_slice()))
    }
    .map_err(|error| refuse(&error))?;
    let files: Vec<PathBuf> =
        text.lines().map(str::trim).filter(|line| !line.is_empty()).map(PathBuf::from).collect();
    if files.is_empty() {
        return Err(Failure::input(format!("--from {}: there is no path in it", list.display())));
    }
    Ok(files)
}

/// Merges the factors of each combination of labels by themselves. Nothing is written unless all of them can
/// be merged.
fn merge_by(arguments: &Merge, files: &[PathBuf]) -> Result<ExitCode, Failure> {
    let table = is_table(&arguments.output);
    if table {
        absent(&arguments.output)?
    } else {
        Folder::check(&arguments.output)?
    }
    let groups = sorted(files, &arguments.by)?;
    let stages = Stages::new("merging");
    let mut merged = Vec::new();
    for (n, (values, parts)) in groups.iter().enumerate() {
        let name = file_name(&arguments.by, values);
        stages.at(&name, n as f64 / groups.len() as f64);
        let Union { factor, repeated, given } =
            union_of_parts(parts, arguments.shared_offset, &|_, _| ()).map_err(refused)?;
        if repeated > 0 {
            tell!(
                "rigident: {name}: {repeated} of {given} factors are left out: their recordings are in others"
            );
        }
        check_agreement(&factor, arguments.shared_offset, arguments.force).map_err(|e| e.context(&name))?;
        merged.push(PooledFactor { name, ..factor });
    }
    drop(stages);
    if table {
        return write_table(&merged, &arguments.output);
    }
    let folder = Folder::new(Some(&arguments.output), "merge")?;
    for factor in merged {
        let path = folder.write(&format!("{}.factor", factor.name), &factor.to_bytes())?;
        say(format_args!("{} rows of {} runs in {}", factor.rows(), factor.runs(), path.display()));
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns the factors of each combination of the values of some labels.
fn sorted(files: &[PathBuf], keys: &[String]) -> Result<BTreeMap<Values, Vec<Part>>, Failure> {
    let stages = Stages::new("sorting");
    let parts: Vec<Vec<Part>> =
        files.iter().map(|file| parts(file)).collect::<Result<_, _>>().map_err(refused)?;
    let parts = parts.concat();
    let read = std::sync::atomic::AtomicUsize::new(0);
    let found = map(threads(), parts.len(), |k| {
        let done = 1 + read.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        stages.at("reading labels", done as f64 / parts.len() as f64);
        let part = parts.get(k)?;
        let values = |factors: Vec<PooledFactor>| factors.iter().map(|factor| values(factor, keys)).collect();
        Some(part.read().and_then(values).map(|found: Vec<Values>| (found, part)))
    });
    let found: Vec<(Vec<Values>, &Part)> =
        found.into_iter().flatten().collect::<Result<_, _>>().map_err(refused)?;
    let of_part = |(values, part): (Vec<Values>, &Part)| -> Vec<(Values, Part)> {
        let places = grouped(values.into_iter().enumerate().map(|(place, values)| (values, place)));
        places.into_iter().map(|(values, places)| (values, part.only(places))).collect()
    };
    Ok(grouped(found.into_iter().flat_map(of_part)))
}

/// Returns the name of a group, `body=a,rig=2`; what no file's name may have is written as `%` and its two
/// digits.
fn file_name(keys: &[String], values: &Values) -> String {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-_. ".contains(&byte);
    let escaped = |value: &str| -> String {
        value
            .bytes()
            .map(|b| if plain(b) { char::from(b).to_string() } else { format!("%{b:02X}") })
            .collect()
    };
    let parts: Vec<String> =
        keys.iter().zip(values).map(|(key, value)| format!("{key}={}", escaped(value))).collect();
    parts.join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_are_distinguished_and_stay_in_their_folder() {
        let keys = ["body".to_owned(), "rig".to_owned()];
        let name = |body: &str, rig: &str| file_name(&keys, &vec![body.to_owned(), rig.to_owned()]);
        assert_eq!(name("bracket 7", "2"), "body=bracket 7,rig=2");
        assert_eq!(name("../a", "2,rig=3"), "body=..%2Fa,rig=2%2Crig%3D3");
        assert_ne!(name("a%2F", ""), name("a/", ""));
    }
}

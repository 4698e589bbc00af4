//! `--certificate`: what the options state, what is asked for, and the files that the answer rests on.

use std::io::{IsTerminal, Read};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use crate::options::output::Output;
use crate::screen::question::answered;
use crate::screen::terms::in_own_terms;
use crate::{Failure, Folder, Progress, kept};
use rigident::answer::Answer;
use rigident::application::recorded::is_rig_file;
use rigident::device::session::INTERRUPTED;
use rigident::present::certificate::{Certified, Evidence, Missing, refused};
use rigident_io::recording::rig_path;
use rigident_io::rig::{CertificateTable, RigFile};

/// Bytes that are read and hashed at once.
const PIECE: usize = 1 << 20;

/// Refuses a folder that cannot be written into, and a certificate that cannot, before anything is done or
/// moves.
///
/// # Errors
/// Bad input: as [`Folder::check`], and the certificate's file is there already, is no page by its name, or
/// `--certify` names no key.
pub(crate) fn check_output(output: &Output) -> Result<(), Failure> {
    check(output)?;
    output.out.as_deref().map_or(Ok(()), Folder::check)
}

/// Refuses what no certificate can be made of, before anything is done or moves.
///
/// # Errors
/// Bad input: the file is there already, is no page by its name, or `--certify` names no key.
fn check(output: &Output) -> Result<(), Failure> {
    let Some(path) = &output.certificate else { return Ok(()) };
    let is_page = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("html"));
    if !is_page {
        let words = "a certificate is a page to be printed from a browser; name it with .html";
        return Err(Failure::input(format!("--certificate {}: {words}", path.display())));
    }
    let refuse = |e: &dyn std::fmt::Display| Failure::input(format!("--certificate: {e}"));
    rigident_files::new_file::check_new(path).map_err(|e| refuse(&e))?;
    let mut table = CertificateTable::default();
    state(&mut table, &output.certify)
}

/// Puts what the command line states into the table.
fn state(table: &mut CertificateTable, stated: &[String]) -> Result<(), Failure> {
    for words in stated {
        let Some((key, text)) = words.split_once('=') else {
            return Err(Failure::input(format!("--certify {words}: KEY=VALUE, as number=2026-117")));
        };
        table.set(key.trim(), text.trim()).map_err(|e| Failure::input(format!("--certify {e}")))?;
    }
    Ok(())
}

/// Returns the files that an answer rests on: the recording, or all in its folder, those that its rig file
/// lists, and the rig file; and the same of each tare.
pub(crate) fn evidence(recording: &Path, rig: Option<&Path>, tare: &[PathBuf]) -> Vec<PathBuf> {
    let recordings = std::iter::once(recording).chain(tare.iter().map(PathBuf::as_path));
    let mut files: Vec<PathBuf> = recordings.flat_map(|recording| of_recording(recording, rig)).collect();
    files.retain(|file| file.is_file());
    files.sort();
    files.dedup();
    files
}

fn of_recording(recording: &Path, rig: Option<&Path>) -> Vec<PathBuf> {
    let mut files = if recording.is_dir() { in_folder(recording) } else { vec![recording.to_owned()] };
    let beside = rig.map_or_else(|| rig_path(recording), Path::to_owned);
    let listing = [Some(recording), Some(beside.as_path())].into_iter().flatten();
    for file in listing.filter(|file| is_rig_file(file)) {
        let folder = if recording.is_dir() { recording } else { file.parent().unwrap_or(Path::new("")) };
        let streams = RigFile::load(file).map(|rig| rig.stream).unwrap_or_default();
        files.extend(streams.iter().map(|stream| folder.join(&stream.file)));
    }
    files.push(beside);
    files
}

/// Returns the regular files of a folder, by name.
pub(crate) fn in_folder(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(|path| path.is_file()).collect();
    files.sort();
    files
}

/// Writes the certificate of an answer, if one is asked for. Of a contradicted answer there is none, which is
/// said.
///
/// # Errors
/// Bad input: a file of the evidence cannot be read, or the page cannot be written.
pub(crate) fn write(
    output: &Output,
    rig: &RigFile,
    files: &[PathBuf],
    answer: &Answer,
) -> Result<Option<PathBuf>, Failure> {
    let Some(path) = &output.certificate else { return Ok(None) };
    if let Some(why) = refused(answer) {
        tell!("rigident: --certificate {}: not written: {why}", path.display());
        return Ok(None);
    }
    let mut table = rig.certificate.clone().unwrap_or_default();
    state(&mut table, &output.certify)?;
    // Nobody is asked by a program, nor by another one that calls this.
    let is_asked = !output.json && !kept::is_called();
    if is_asked && std::io::stdin().is_terminal() && std::io::stderr().is_terminal() {
        ask_for_missing(&mut table, rig, answer)?;
    }
    let evidence = files.iter().map(|file| hashed(file)).collect::<Result<Vec<_>, _>>()?;
    let certified = Certified { table: &table, rig, evidence: &evidence };
    let missing = certified.missing(answer);
    let Some(page) = certified.page(answer) else { return Ok(None) };
    rigident_files::new_file::write_new_text(path, &in_own_terms(&page))
        .map_err(|e| Failure::input(format!("--certificate: {e}")))?;
    if !missing.is_empty() {
        tell!("rigident: {} is a draft: {}", path.display(), in_words(&missing));
    }
    Ok(Some(path.clone()))
}

/// Says what is missing and where it is to be stated.
fn in_words(missing: &[Missing]) -> String {
    let list: Vec<String> = missing.iter().map(|m| format!("{} ({})", m.what, m.key)).collect();
    format!(
        "not stated: {}. State keys of [certificate] in the rig file or by --certify KEY=VALUE, those of \
         instruments in the rig file",
        list.join(", ")
    )
}

/// Asks for each key of `[certificate]` that is missing; an empty line leaves it out.
fn ask_for_missing(table: &mut CertificateTable, rig: &RigFile, answer: &Answer) -> Result<(), Failure> {
    let missing = Certified { table, rig, evidence: &[] }.missing(answer);
    let keys = missing.iter().filter_map(|m| Some((m.key.strip_prefix("certificate.")?, m.what)));
    for (at, (key, what)) in keys.enumerate() {
        if at == 0 {
            tell!("For the certificate (an empty line leaves out what is not known):");
        }
        crate::screen::tell::tell(format_args!("  {what}: "), "");
        let read = || {
            let mut line = String::new();
            std::io::stdin().read_line(&mut line).map(|_| line)
        };
        let Some(line) = answered(read, &INTERRUPTED)? else {
            return Err(Failure::interrupted("stopped; no certificate was written"));
        };
        if !line.trim().is_empty() {
            table.set(key, line.trim()).map_err(Failure::input)?;
        }
    }
    Ok(())
}

/// Reads a file piece by piece and returns its name, length and hash.
fn hashed(path: &Path) -> Result<Evidence, Failure> {
    let failed = |e: std::io::Error| Failure::input(format!("{} cannot be read: {e}", path.display()));
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let mut file = rigident_files::open(path).map_err(failed)?;
    let (mut hash, mut bytes, mut progress) = (Sha256::new(), 0_u64, Progress::new());
    let mut piece = vec![0; PIECE];
    loop {
        let read = file.read(&mut piece).map_err(failed)?;
        if read == 0 {
            break;
        }
        hash.update(&piece[..read]);
        bytes += read as u64;
        progress.show(|| format!("hash of {name}: {} MB", bytes >> 20));
    }
    let sha256 = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    Ok(Evidence { name, bytes, sha256 })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The test vector of FIPS 180-4 for "abc".
    #[test]
    fn hashes_are_those_of_the_standard() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("a.csv");
        std::fs::write(&path, "abc").unwrap();
        let found = hashed(&path).unwrap();
        let standard = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!((found.name.as_str(), found.bytes, found.sha256.as_str()), ("a.csv", 3, standard));
    }

    #[test]
    fn an_answer_rests_on_recording_rig_file_and_streams() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        for name in ["a.csv", "a.rig.toml", "force.csv", "other.txt"] {
            std::fs::write(at(name), "").unwrap();
        }
        assert_eq!(evidence(&at("a.csv"), None, &[]), [at("a.csv"), at("a.rig.toml")]);
        let with_tare = evidence(&at("a.csv"), None, &[at("other.txt")]);
        assert_eq!(with_tare, [at("a.csv"), at("a.rig.toml"), at("other.txt")]);
        let listing = "[[stream]]\nfile = \"force.csv\"\n";
        std::fs::write(at("run.rig.toml"), listing).unwrap();
        assert_eq!(evidence(&at("run.rig.toml"), None, &[]), [at("force.csv"), at("run.rig.toml")]);
        assert_eq!(evidence(&at("none.csv"), None, &[]), [] as [PathBuf; 0]);
    }
}

//! Completions and manual pages: read by the programs that they are for, where these are here.

use std::io::Write;
use std::process::{Command, Output, Stdio};

use crate::program::{rigident, rigident_anywhere, said, status};

/// Feeds a program; `None` if it is not here.
fn fed(program: &str, arguments: &[&str], input: &[u8]) -> Option<Output> {
    let mut child = Command::new(program)
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .ok()?;
    let mut to = child.stdin.take().unwrap();
    let input = input.to_owned();
    let feeding = std::thread::spawn(move || to.write_all(&input));
    let output = child.wait_with_output().unwrap();
    feeding.join().unwrap().unwrap();
    Some(output)
}

#[test]
fn completions_of_every_shell_name_every_command_and_the_shell_reads_them() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let output = rigident_anywhere(&["completions", shell]);
        assert_eq!(status(&output), 0, "{shell}: {}", said(&output));
        let script = String::from_utf8_lossy(&output.stdout);
        for word in ["identify", "monitor", "--platform", "--udev-rule"] {
            // fish and elvish have long options without their dashes.
            assert!(script.contains(word.trim_start_matches('-')), "{shell} lacks {word}");
        }
        if ["bash", "zsh", "fish"].contains(&shell)
            && let Some(read) = fed(shell, &["-n"], script.as_bytes())
        {
            assert!(read.status.success(), "{shell}: {}", said(&read));
        }
    }
}

#[cfg(unix)]
#[test]
fn bash_completes_a_command_by_its_first_letters() {
    let script = rigident_anywhere(&["completions", "bash"]).stdout;
    let asked = "\nCOMP_WORDS=(rigident ident); COMP_CWORD=1; _rigident rigident ident rigident; \
                 echo \"${COMPREPLY[*]}\"\n";
    let Some(read) = fed("bash", &["--norc"], &[script, asked.as_bytes().to_vec()].concat()) else { return };
    assert_eq!(String::from_utf8_lossy(&read.stdout).trim(), "identify", "{}", said(&read));
}

#[test]
fn every_command_has_a_page_that_groff_reads() {
    let place = tempfile::tempdir().unwrap();
    let output = rigident(place.path(), &["man", "--out", "man"]);
    assert_eq!(status(&output), 0, "{}", said(&output));
    let page = |name: &str| std::fs::read(place.path().join("man").join(name)).unwrap();
    for (name, words) in [
        ("rigident.1", "identify"),
        ("rigident-plan-poses.1", "rigident plan poses"),
        ("rigident-configure.1", "bracket.settings.toml"),
    ] {
        let text = String::from_utf8(page(name)).unwrap();
        // What is typed has its dashes escaped.
        assert!(text.replace("\\-", "-").contains(words), "{name}: {text}");
        if let Some(read) = fed("groff", &["-man", "-Kutf8", "-Tutf8", "-P-cbou"], text.as_bytes()) {
            let shown = String::from_utf8_lossy(&read.stdout).into_owned();
            assert!(read.status.success() && shown.contains("SYNOPSIS"), "{name}: {}", said(&read));
        }
    }
    assert!(std::fs::read_dir(place.path().join("man")).unwrap().count() > 40);
    // Nothing is written among other files.
    assert_eq!(status(&rigident(place.path(), &["man", "--out", "man"])), 2);
}

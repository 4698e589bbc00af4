//! The checks of the program for Windows in Wine beside its tests: the numbers of this system's program,
//! files as Windows writes them, ports by name, closed pipes, sensors over UDP.

use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use super::wine::Wine;
use crate::places;
use crate::process::{self, Steps};

/// The most that a number may differ from this system's, in its U95. Libraries round sines and roots
/// differently in the last bit, which rows multiply by their condition; a thousandth of a U95 changes no
/// digit that is printed.
const MOST_U95: f64 = 1e-3;

/// The data that the checks need.
struct Bench<'a> {
    wine: &'a Wine,
    program: &'a Path,
    /// A folder whose name has blanks and umlauts.
    folder: PathBuf,
}

/// Runs all of them, each a step.
pub fn run(steps: &mut Steps, wine: &Wine, program: &Path) {
    let folder = super::folder().join("Prüfstand Süd 7");
    let made = steps.run("folder with blanks and umlauts", || fresh(&folder));
    if made.is_none() {
        return;
    }
    let bench = Bench { wine, program, folder };
    steps.run("numbers equal to this system's", || bench.same_numbers());
    steps.run("CSV with CRLF and Windows-1252", || bench.files_of_windows());
    steps.run("a closed pipe", || bench.closed_pipe());
    steps.run("COM ports by name", || bench.ports());
    steps.run("live from UDP", || bench.live());
}

/// Makes an empty folder.
fn fresh(folder: &Path) -> Result<()> {
    if folder.exists() {
        std::fs::remove_dir_all(folder)?;
    }
    Ok(std::fs::create_dir_all(folder)?)
}

impl Bench<'_> {
    fn windows(&self, words: &[&str]) -> Command {
        let mut command = self.wine.command(&self.folder);
        command.arg(self.program).args(words);
        command
    }

    /// Runs the program in Wine and returns the object that it printed.
    fn answer(&self, words: &[&str]) -> Result<Value> {
        object(&self.windows(words).output()?)
    }

    /// Checks each recording of the examples, the demonstration, and a recorded person where there is one.
    fn same_numbers(&self) -> Result<()> {
        let example = |name: &str| places::root().join("docs/examples").join(name).display().to_string();
        let data = places::root().join("../shared/data/human_gait2354_subject01_walk");
        let person = |name: &str| data.join(name).display().to_string();
        let (bracket, links) = (example("bracket.csv"), example("two-links.csv"));
        let (walk, standing) = (person("subject01_walk1.trc"), person("subject01_static.trc"));
        let mut lines =
            vec![vec!["identify", &bracket], vec!["identify", &links], vec!["demo", "--duration-s", "20"]];
        if data.is_dir() {
            lines.push(vec!["body", "identify", &walk, "--static", &standing, "--height-m", "1.8"]);
        } else {
            println!("skipped: a person, because there is no ../shared/data");
        }
        for (at, line) in lines.iter().enumerate() {
            let folder = |system: &str| format!("{system} {at}");
            let words = |system: &str| -> Vec<String> {
                let more = ["--json".to_owned(), "--out".to_owned(), folder(system)];
                line.iter().map(|word| (*word).to_owned()).chain(more).collect()
            };
            let (here, there) = (words("here"), words("Windows"));
            let output = process::command(places::built("rigident"), &self.folder).args(here).output()?;
            let there: Vec<&str> = there.iter().map(String::as_str).collect();
            let (compared, most) = difference(&object(&output)?, &self.answer(&there)?)?;
            println!("{}: {compared} numbers, at most {most:.1e} U95 apart", line.join(" "));
            ensure!(compared > 0 && most < MOST_U95, "{}: {most:e} U95 apart", line.join(" "));
        }
        Ok(())
    }

    /// Checks the bracket as a spreadsheet of Windows saves it, under a name with an umlaut.
    fn files_of_windows(&self) -> Result<()> {
        let examples = places::root().join("docs/examples");
        let text = std::fs::read_to_string(examples.join("bracket.csv"))?;
        // 0xE4 is ä, 0xB0 the degree in Windows-1252; neither is UTF-8.
        let mut bytes = b"Pr\xfcfling;Geh\xe4use bei 20 \xb0C\r\n\r\n".to_vec();
        for line in text.lines() {
            bytes.extend(line.replace(',', ";").replace('.', ",").bytes());
            bytes.extend(b"\r\n");
        }
        std::fs::write(self.folder.join("Gehäuse 1.csv"), bytes)?;
        let rig = std::fs::read_to_string(examples.join("bracket.rig.toml"))?;
        std::fs::write(self.folder.join("Gehäuse 1.rig.toml"), rig.replace('\n', "\r\n"))?;
        let found = self.answer(&["identify", "Gehäuse 1.csv", "--json", "--out", "Gehäuse Ergebnis"])?;
        let plain = self.folder.join("Windows 0/result.json");
        let plain: Value = serde_json::from_str(&std::fs::read_to_string(plain)?)?;
        let (compared, most) = difference(&plain, &found)?;
        ensure!(compared > 0 && most == 0.0, "{most:e} U95 from the plain file's");
        ensure!(self.folder.join("Gehäuse Ergebnis/report.html").is_file(), "there is no report");
        // Nothing is overwritten here either.
        let again = self.windows(&["identify", "Gehäuse 1.csv", "--out", "Gehäuse Ergebnis"]).output()?;
        ensure!(again.status.code() == Some(2) && said(&again).contains("not empty"), "{}", said(&again));
        Ok(())
    }

    /// Checks that a reader that goes away early has read as much as it wanted.
    fn closed_pipe(&self) -> Result<()> {
        for words in [&["schema", "result"][..], &["--help"], &["man"]] {
            let mut command = self.windows(words);
            let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn()?;
            drop(child.stdout.take());
            let output = child.wait_with_output()?;
            let quiet = output.status.code() == Some(0) && output.stderr.is_empty();
            ensure!(quiet, "{words:?}: {:?}, {}", output.status, said(&output));
        }
        Ok(())
    }

    /// Checks that a port that is not there is named. Real ones Wine cannot show.
    fn ports(&self) -> Result<()> {
        let missing = self.windows(&["info", "--port", "COM77"]).output()?;
        let words = said(&missing);
        ensure!(missing.status.code() == Some(3), "{:?}: {words}", missing.status);
        ensure!(words.contains("COM77") && words.contains("rigident ports"), "{words}");
        Ok(())
    }

    /// Checks lines over UDP from this system, in real time.
    fn live(&self) -> Result<()> {
        let text = std::fs::read_to_string(places::root().join("docs/examples/bracket.csv"))?;
        let rig = places::root().join("docs/examples/bracket.rig.toml").display().to_string();
        let listener = UdpSocket::bind("127.0.0.1:0")?.local_addr()?;
        let address = format!("udp://{listener}");
        let sensors = ["live", "--wrench", &address, "--imu", &address, "--rig", &rig];
        let mut command =
            self.windows(&[&sensors[..], &["--at-most-s", "4", "--json", "--out", "live"]].concat());
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn()?;
        let sender = UdpSocket::bind("127.0.0.1:0")?;
        sender.connect(listener)?;
        if let Err(error) = play(&text, &sender, &mut child) {
            child.kill()?;
            return Err(error.context(said(&child.wait_with_output()?)));
        }
        let output = child.wait_with_output()?;
        let found = object(&output)?;
        let mass = found["mass_kg"].as_f64().with_context(|| format!("no mass: {}", said(&output)))?;
        println!("live: {mass:.3} kg");
        ensure!((mass - 3.2).abs() < 0.1, "{mass} kg, and the bracket has 3.2");
        Ok(())
    }
}

/// Sends the recording's lines at their times from when somebody listens, and waits for the program's end.
fn play(text: &str, sender: &UdpSocket, child: &mut Child) -> Result<()> {
    let mut lines = text.lines();
    let header = lines.next().context("the example is empty")?;
    let limit = Instant::now() + Duration::from_secs(90);
    // A datagram that nobody takes makes the next one fail.
    let mut taken = 0;
    while taken < 3 {
        ensure!(child.try_wait()?.is_none() && Instant::now() < limit, "it does not listen");
        taken = if sender.send(header.as_bytes()).is_ok() { taken + 1 } else { 0 };
        std::thread::sleep(Duration::from_millis(100));
    }
    let begun = Instant::now();
    for line in lines {
        let time_s: f64 = line.split(',').next().and_then(|cell| cell.parse().ok()).context("no time")?;
        std::thread::sleep(Duration::from_secs_f64(time_s).saturating_sub(begun.elapsed()));
        // It may have had enough.
        let _ = sender.send(line.as_bytes());
    }
    while child.try_wait()?.is_none() {
        ensure!(Instant::now() < limit, "it does not end");
        std::thread::sleep(Duration::from_millis(50));
    }
    Ok(())
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Returns the object that a program printed.
fn object(output: &Output) -> Result<Value> {
    serde_json::from_slice(&output.stdout)
        .with_context(|| format!("no object on standard output: {:?}, {}", output.status, said(output)))
}

/// Returns how many numbers two answers have, and the most that they are apart in U95.
fn difference(one: &Value, other: &Value) -> Result<(usize, f64)> {
    ensure!(one["status"] == other["status"], "status {} and {}", one["status"], other["status"]);
    let of = |answer: &Value| answer["parameters"].as_array().cloned().unwrap_or_default();
    let (one, other) = (of(one), of(other));
    ensure!(one.len() == other.len(), "{} parameters and {}", one.len(), other.len());
    let (mut compared, mut most) = (0, 0.0_f64);
    for (a, b) in one.iter().zip(&other) {
        ensure!(a["name"] == b["name"] && a["state"] == b["state"], "{a} and {b}");
        let figures = |p: &Value| Some((p["value"].as_f64()?, p["u95"].as_f64()?));
        let Some(((value, u95), (there, u95_there))) = figures(a).zip(figures(b)) else { continue };
        compared += 1;
        most = most.max((value - there).abs() / u95).max((u95 - u95_there).abs() / u95);
    }
    Ok((compared, most))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_compared_number_by_number() {
        let answer = |value: f64, state: &str| {
            serde_json::json!({ "status": "identified", "parameters": [
                { "name": "m", "state": state, "value": value, "u95": 0.5 }, { "name": "Ixx", "state": "not_identified" }] })
        };
        let (one, other) = (answer(3.0, "identified"), answer(3.25, "identified"));
        assert_eq!(difference(&one, &other).unwrap(), (1, 0.5));
        assert!(difference(&one, &answer(3.0, "contradicted")).is_err());
    }
}

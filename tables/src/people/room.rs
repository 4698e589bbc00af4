//! The cost of long recordings: time and memory of the program, from files of a simulated person to the
//! answer.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rigident::laboratory::laboratory::Laboratory;
use rigident::motion_capture::trial::Trial;
use rigident::people::inverse_kinematics::subject::HumanModel;

use super::subjects::{Subject, subject};

/// Frames, and whether they are worked on by one core.
const RUNS: [(usize, bool); 4] = [(6_000, true), (6_000, false), (60_000, false), (300_000, false)];
/// The child's memory is read this often.
const EVERY: Duration = Duration::from_millis(20);

/// Returns the table.
pub fn table() -> String {
    let program = built();
    let folder = std::env::temp_dir().join(format!("rigident-room-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a folder for the recordings");
    let own = subject(HumanModel::Human34, None, 1);
    let laboratory = Laboratory::default();
    write(&folder, &own, &own.somebody.standing(&laboratory, 1));
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let mut out = String::from(
        "| frames | cores | time, s | most memory, MB | of it markers and plate, MB | mass less truth, kg | \
         U95, kg |\n\
         |---|---|---|---|---|---|---|\n",
    );
    for (frames, one) in RUNS {
        let seconds = frames as f64 / laboratory.rate_hz;
        let trial = own.somebody.trial(&format!("walk{frames}"), &Laboratory { seconds, ..laboratory }, 7);
        let samples = frames as f64 * (laboratory.rate_hz * 2.0).max(150.0) / laboratory.rate_hz;
        let kept_mb = (12 * frames * columns(&own, &trial).len()) as f64 / 1e6 + 24.0 * samples / 1e6;
        write(&folder, &own, &trial);
        let mut command = Command::new(if one { Path::new("taskset") } else { &program });
        if one {
            command.args(["-c", "0"]).arg(&program);
        }
        let answer = folder.join(format!("answer{frames}{one}"));
        command
            .args([
                "body",
                "identify",
                &format!("walk{frames}.trc"),
                "--plates-zeroed",
                "--static",
                "standing.trc",
                "--out",
            ])
            .arg(&answer)
            .current_dir(&folder)
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        let begun = Instant::now();
        let (status, most_mb) = watched(command.spawn().expect("the program runs"));
        let took_s = begun.elapsed().as_secs_f64();
        assert!(status.success(), "{frames} frames: {status}");
        let [mass, u95] = mass(&answer);
        let truth: f64 = own.truth.chunks(10).map(|phi| phi[0]).sum();
        out.push_str(&format!(
            "| {frames} | {} | {took_s:.1} | {most_mb:.0} | {kept_mb:.0} | {:.3} | {u95:.3} |\n",
            if one { 1 } else { cores },
            mass - truth,
        ));
    }
    fs::remove_dir_all(&folder).expect("the folder can go");
    out
}

/// Builds the program as people use it, and returns its path.
fn built() -> PathBuf {
    let build = ["build", "--quiet", "--release", "--package", "rigident", "--bin", "rigident"];
    let status = Command::new(env!("CARGO")).args(build).current_dir(env!("CARGO_MANIFEST_DIR")).status();
    assert!(status.expect("cargo runs").success(), "the program is not built");
    // This program is in a folder of its own profile, beside that of the released ones.
    let own = std::env::current_exe().expect("a path");
    let target = own.parent().and_then(Path::parent).expect("a target folder");
    target.join("release/rigident")
}

/// Waits for the program, and returns how it ended and the most memory that it had, MB.
fn watched(mut child: Child) -> (ExitStatus, f64) {
    let status = format!("/proc/{}/status", child.id());
    let mut most_kb = 0.0_f64;
    loop {
        let text = fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let own = line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok());
        most_kb = most_kb.max(own.unwrap_or(0.0));
        if let Some(status) = child.try_wait().expect("the program is waited for") {
            return (status, most_kb * 1024.0 / 1e6);
        }
        std::thread::sleep(EVERY);
    }
}

/// Returns mass and its U95 by the answer, kg.
fn mass(folder: &Path) -> [f64; 2] {
    let text = fs::read_to_string(folder.join("result.json")).expect("an answer");
    let answer: serde_json::Value = serde_json::from_str(&text).expect("an answer");
    ["value", "u95"].map(|key| answer["person"]["mass_kg"][key].as_f64().expect("a mass"))
}

/// Markers that laboratories place, as columns of a trial.
fn columns(subject: &Subject, trial: &Trial) -> Vec<usize> {
    let clusters = subject.somebody.clusters();
    (0..trial.labels.len()).filter(|k| !clusters.marker.contains_key(&trial.labels[*k])).collect()
}

/// Writes a trial as TRC and MOT.
fn write(folder: &Path, subject: &Subject, trial: &Trial) {
    let file = |ending: &str| {
        let file = File::create(folder.join(format!("{}{ending}", trial.name)));
        BufWriter::new(file.expect("a file"))
    };
    markers(&mut file(".trc"), trial, &columns(subject, trial)).expect("room on the disc");
    forces(&mut file("_grf.mot"), trial).expect("room on the disc");
}

fn markers(out: &mut impl Write, trial: &Trial, columns: &[usize]) -> std::io::Result<()> {
    let (rate, frames) = (trial.rate_hz, trial.frames());
    writeln!(out, "PathFileType\t4\t(X/Y/Z)\t{}.trc", trial.name)?;
    writeln!(out, "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits")?;
    writeln!(out, "{rate}\t{rate}\t{frames}\t{}\tm", columns.len())?;
    let names: Vec<String> = columns.iter().map(|k| format!("{}\t\t", trial.labels[*k])).collect();
    writeln!(out, "Frame#\tTime\t{}\n\n", names.join("\t"))?;
    for frame in 0..frames {
        write!(out, "{}\t{:.4}", frame + 1, trial.time_s(frame))?;
        for p in columns.iter().filter_map(|k| trial.point(frame, *k)) {
            write!(out, "\t{:.6}\t{:.6}\t{:.6}", p.x, p.y, p.z)?;
        }
        writeln!(out)?;
    }
    out.flush()
}

/// Writes the forces, and the moment about the laboratory's origin.
fn forces(out: &mut impl Write, trial: &Trial) -> std::io::Result<()> {
    let plate = &trial.ground[0];
    let axes = |stem: &str| ["x", "y", "z"].map(|axis| format!("ground_{stem}{axis}")).join("\t");
    writeln!(out, "forces\nversion=1\nnRows={}\nnColumns=10\nendheader", plate.wrench.len())?;
    writeln!(out, "time\t{}\t{}\t{}", axes("force_v"), axes("force_p"), axes("torque_"))?;
    for (k, [fx, fy, fz, mx, my, mz]) in plate.wrench.iter().enumerate() {
        let time_s = plate.first_s + k as f64 / plate.rate_hz;
        writeln!(out, "{time_s:.5}\t{fx:.4}\t{fy:.4}\t{fz:.4}\t0\t0\t0\t{mx:.5}\t{my:.5}\t{mz:.5}")?;
    }
    out.flush()
}

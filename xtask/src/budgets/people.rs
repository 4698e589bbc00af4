//! A person's long recording, and a merge of many factors; their limits are in reference builds and bytes.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context, Result, ensure};

use super::{Figure, Setting, building, measure};
use crate::process;
use crate::tables;

/// Factors that are merged.
const FACTORS: usize = 10_000;
/// Still poses in each.
const POSES: usize = 12;

/// Measures both.
pub fn figures(setting: &Setting) -> Result<Vec<Figure>> {
    let reference_s = building::reference_build_s(setting)?;
    let mut figures = person(reference_s)?;
    figures.push(merge(setting, reference_s)?);
    Ok(figures)
}

/// Measures the last line of the table `room-long`: 300 000 frames on all cores.
fn person(reference_s: f64) -> Result<Vec<Figure>> {
    let text = process::output(tables::program()?.arg("room-long"))?;
    let line =
        text.lines().rfind(|line| line.starts_with("| 300000 ")).context("no line of 300 000 frames")?;
    let cell = |k: usize| line.split('|').nth(k).and_then(|cell| cell.trim().parse::<f64>().ok());
    let (seconds, memory_mb) = (cell(3).context("no time")?, cell(4).context("no memory")?);
    Ok(vec![
        Figure {
            name: "a person's 300 000 frames, reference builds by the clock".to_owned(),
            value: seconds / reference_s,
            limit: 1.0,
            note: format!("{seconds:.0} s, two cores"),
        },
        Figure {
            name: "the same, memory, MB".to_owned(),
            value: memory_mb,
            limit: 300.0,
            note: "of it markers and plate 155".to_owned(),
        },
    ])
}

/// Measures a merge of ten thousand factor files by one process.
fn merge(setting: &Setting, reference_s: f64) -> Result<Figure> {
    let folder = setting.folder.join("factors");
    let list = folder.join("list.txt");
    if !list.is_file() {
        make_factors(setting, &folder)?;
        let names: Vec<String> = (0..FACTORS).map(|k| folder.join(name(k)).display().to_string()).collect();
        std::fs::write(&list, names.join("\n"))?;
    }
    let merged = folder.join("all.factor");
    if merged.exists() {
        std::fs::remove_file(&merged)?;
    }
    let mut command = process::command(&setting.program, &folder);
    let used = measure::run(command.args(["merge", "--from", "list.txt", "-o", "all.factor"]), &[0])?;
    Ok(Figure {
        name: "a merge of 10 000 factors, reference builds".to_owned(),
        value: used.processor_s / reference_s,
        limit: 0.02,
        note: format!("{:.2} s of the processor", used.processor_s),
    })
}

fn name(k: usize) -> String {
    format!("{k}.factor")
}

/// Makes factors from still poses of one body, with noise that is a sum of uniform numbers.
fn make_factors(setting: &Setting, folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder)?;
    let rig = folder.join("poses.rig.toml");
    let noise = "[load_cell]\nnoise_n_nm = [0.1, 0.1, 0.1, 0.005, 0.005, 0.005]\nclass = \"exact\"\n";
    std::fs::write(&rig, format!("[recording]\nstatic = true\n\n{noise}"))?;
    let mut state = 7_u64;
    let mut uniform = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    for k in 0..FACTORS {
        let mut text = "fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,gx_mps2,gy_mps2,gz_mps2\n".to_owned();
        for _ in 0..POSES {
            let up = [(); 3].map(|()| uniform());
            let length = up.iter().map(|x| x * x).sum::<f64>().sqrt();
            let [gx, gy, gz] = up.map(|x| -9.80665 * x / length);
            let [fx, fy, fz] = [gx, gy, gz].map(|g| -3.2 * g + 0.3 * uniform());
            // The centre of mass at (0, 0.01, 0.05) m: moments m c × (−g).
            let [mx, my, mz] =
                [0.01 * -gz + 0.05 * gy, -0.05 * gx, 0.01 * gx].map(|m| 3.2 * m + 0.015 * uniform());
            let _ = writeln!(text, "{fx},{fy},{fz},{mx},{my},{mz},{gx},{gy},{gz}");
        }
        let recording = folder.join("poses.csv");
        std::fs::write(&recording, text)?;
        let mut command = process::command(&setting.program, folder);
        command.args(["factor", "poses.csv", "--rig", "poses.rig.toml", "-o", &name(k)]);
        let output = command.output()?;
        let said = String::from_utf8_lossy(&output.stderr);
        ensure!(output.status.success(), "factor {k}: {said}");
    }
    Ok(())
}

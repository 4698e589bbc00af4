//! Ratios to what a user would write in Python, and to Pinocchio's C++. The scripts are in
//! `../shared/cases/speed`.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use super::{Figure, Setting, measure};
use crate::places;
use crate::process;
use crate::setup;

/// Runs of each program in turn.
const TIMES: usize = 3;
/// Columns of a recording of one body: time, wrench, specific force, rates.
const COLUMNS: f64 = 13.0;

/// Robots: file, and whether the base moves.
const ROBOTS: [(&str, bool); 8] = [
    ("double_pendulum", false),
    ("ur5_robot", false),
    ("panda", false),
    ("solo12", true),
    ("simple_humanoid", true),
    ("human", true),
    ("g1_29dof_rev_1_0", true),
    ("jvrc1", true),
];

fn script(name: &str) -> Result<PathBuf> {
    let path = places::root().join("../shared/cases/speed").join(name);
    ensure!(path.is_file(), "{} is not there", path.display());
    Ok(path)
}

fn robot(name: &str) -> PathBuf {
    places::root().join("../shared/data/urdf").join(name).with_extension("urdf")
}

/// Installs what the scripts import.
fn set_up_python() -> Result<()> {
    for module in [setup::PINOCCHIO, setup::PEERS] {
        setup::python_module(module);
        ensure!(setup::has_module(module), "Python lacks what the scripts import: cargo xtask setup");
    }
    Ok(())
}

/// Returns Python without settings that would slow its linear algebra.
fn python() -> Command {
    let mut command = process::command(setup::python(), places::root());
    command.env_remove("OPENBLAS_CORETYPE").env_remove("OPENBLAS_L2_SIZE");
    command
}

/// Makes a recording unless it is there.
fn recording(setting: &Setting, name: &str, script_name: &str, arguments: &[&str]) -> Result<PathBuf> {
    let path = setting.folder.join(name);
    if !path.is_file() {
        let half = path.with_extension("half");
        process::run(python().arg(script(script_name)?).args(arguments).arg(&half))?;
        std::fs::rename(&half, &path)?;
    }
    Ok(path)
}

fn identify(setting: &Setting, recording: &Path, more: &[&str]) -> Command {
    let mut command = process::command(&setting.program, &setting.folder);
    command.arg("identify").arg(recording).args(more).arg("--json");
    command
}

/// Measures `identify` of one body against plain least squares by numpy.
pub fn one_body(setting: &Setting) -> Result<Vec<Figure>> {
    set_up_python()?;
    let file = recording(setting, "body-1e6.csv", "generate.py", &["1e6"])?;
    let plain = script("plain_numpy.py")?;
    let theirs = || {
        let mut command = python();
        command.arg(&plain).arg(&file);
        command
    };
    let [ours, theirs] = measure::in_turn(TIMES, || identify(setting, &file, &[]), theirs)?;
    Ok(vec![ratio("one body, 1 000 000 rows / numpy", ours, theirs, 1.2)])
}

/// Measures `identify` of an arm with friction against plain least squares by numpy with Pinocchio.
pub fn arm(setting: &Setting) -> Result<Vec<Figure>> {
    set_up_python()?;
    let urdf = robot("ur5_robot").display().to_string();
    let model = urdf.as_str();
    let file = recording(setting, "ur5.csv", "arm.py", &[model, "100", "1000"])?;
    let plain = script("plain_pinocchio.py")?;
    let theirs = || {
        let mut command = python();
        command.arg(&plain).arg(&file).arg(model);
        command
    };
    let ours = || identify(setting, &file, &["--model", model, "--friction", "viscous,coulomb"]);
    let [ours, theirs] = measure::in_turn(TIMES, ours, theirs)?;
    Ok(vec![ratio("UR5, 100 000 rows / numpy with Pinocchio", ours, theirs, 1.8)])
}

fn ratio(name: &str, ours: f64, theirs: f64, limit: f64) -> Figure {
    let note = format!("{ours:.2} s / {theirs:.2} s of the processor");
    Figure { name: name.to_owned(), value: ours / theirs, limit, note }
}

/// Measures the most memory for a recording of ten million rows, against that of its numbers.
pub fn memory(setting: &Setting) -> Result<Vec<Figure>> {
    const ROWS: f64 = 1e7;
    set_up_python()?;
    let file = recording(setting, "body-1e7.csv", "generate.py", &["1e7"])?;
    let used = measure::run(&mut identify(setting, &file, &[]), &[0, 3])?;
    let numbers_mb = ROWS * COLUMNS * 8.0 / 1e6;
    Ok(vec![Figure {
        name: "10 000 000 rows of CSV: memory / the numbers'".to_owned(),
        value: used.memory_mb / numbers_mb,
        limit: 1.6,
        note: format!(
            "{:.2} GB / {:.2} GB; {:.0} s of the processor",
            used.memory_mb / 1e3,
            numbers_mb / 1e3,
            used.processor_s
        ),
    }])
}

/// Measures rows of each robot against Pinocchio's own C++.
pub fn rows(setting: &Setting) -> Result<Vec<Figure>> {
    set_up_python()?;
    let theirs = pinocchio_program(setting)?;
    let mut figures = Vec::new();
    let mut logarithms = 0.0;
    for (name, floating) in ROBOTS {
        let urdf = robot(name);
        ensure!(urdf.is_file(), "{} is not there", urdf.display());
        let (mut own, mut other) = (Vec::new(), Vec::new());
        for _ in 0..TIMES {
            own.push(own_us(setting, &urdf, floating)?);
            let mut command = process::command(&theirs, &setting.folder);
            command.arg(&urdf).args(floating.then_some("floating"));
            let text = process::output(&mut command)?;
            let us = text.rsplit_once(": ").and_then(|(_, rest)| rest.split_once(" us"));
            other.push(us.and_then(|(us, _)| us.parse().ok()).context("Pinocchio printed no time")?);
        }
        let [own, other] = [own, other].map(measure::median);
        logarithms += (own / other).ln();
        let note = format!("{own:.2} µs / {other:.2} µs");
        let title = format!("rows of {name} / Pinocchio's C++");
        figures.push(Figure { name: title, value: own / other, limit: 0.8, note });
    }
    figures.push(Figure {
        name: "the same, geometric mean".to_owned(),
        value: (logarithms / ROBOTS.len() as f64).exp(),
        limit: 0.4,
        note: format!("{} robots", ROBOTS.len()),
    });
    Ok(figures)
}

fn own_us(setting: &Setting, urdf: &Path, floating: bool) -> Result<f64> {
    let mut command = process::command(&setting.program, &setting.folder);
    let name = format!("{}{}", urdf.display(), if floating { ":floating" } else { "" });
    command.args(["bench", "regressors", "--json", "--python", "/nonexistent"]).arg(name);
    let answer: Value = serde_json::from_str(&process::output(&mut command)?)?;
    answer["models"][0]["regressor_us"].as_f64().context("there is no time of ours")
}

/// Compiles the program that times Pinocchio, with the headers of the wheel and of Debian.
fn pinocchio_program(setting: &Setting) -> Result<PathBuf> {
    let source = script("pinocchio.cpp")?;
    let program = setting.folder.join("pinocchio");
    if program.is_file() {
        return Ok(program);
    }
    if !Path::new("/usr/include/eigen3").is_dir() || !Path::new("/usr/include/urdf_model").is_dir() {
        setup::apt_install(&["libeigen3-dev", "liburdfdom-headers-dev", "g++"])?;
    }
    let look = "import cmeel, os; print(os.path.dirname(cmeel.__file__) + '.prefix')";
    let prefix = process::output(python().args(["-c", look]))?;
    let prefix = prefix.trim();
    let mut command = process::command("g++", &setting.folder);
    command.args(["-O3", "-DNDEBUG", "-std=c++17", "-DBOOST_FUSION_INVOKE_MAX_ARITY=10"]);
    command.args(["-DBOOST_MPL_LIMIT_LIST_SIZE=30", "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30"]);
    command.args(["-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS", "-I/usr/include/eigen3"]);
    command.args([format!("-I{prefix}/include"), format!("-I{prefix}/include/pinocchio/deprecated")]);
    command.arg(&source).arg("-o").arg(&program).arg(format!("-L{prefix}/lib"));
    command.args(["-lpinocchio_default", "-lpinocchio_parsers", "-lurdfdom_model", "-lconsole_bridge"]);
    process::run(command.arg(format!("-Wl,-rpath,{prefix}/lib")))?;
    Ok(program)
}

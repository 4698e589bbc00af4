//! The verb `package`: what a release holds for a system, made and tried here: program, manual, completions,
//! notices of third parties, bill of materials, checksums; and the Python wheel. The release workflow calls
//! nothing else.

mod graph;
mod notices;
mod sbom;

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};
use sha2::{Digest, Sha256};

use crate::places;
use crate::process;
use crate::toolchain::Core;
use crate::windows;

/// The parts of the program beside code.
const TEXTS: [&str; 4] = ["README.md", "CHANGELOG.md", "LICENSE-MIT", "LICENSE-APACHE"];
const SHELLS: [&str; 4] = ["bash", "zsh", "fish", "powershell"];
/// Linux without any shared library.
const STATIC: &str = "x86_64-unknown-linux-musl";

/// Says what is packaged.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// The target triple; without it this system's. `x86_64-pc-windows-gnu` is built here and tried in Wine,
    /// `x86_64-unknown-linux-musl` is static.
    #[arg(long, value_name = "TRIPLE")]
    pub target: Option<String>,
    /// Folder that the archive is put into.
    #[arg(long, value_name = "DIR", default_value = "target/package")]
    pub out: PathBuf,
    /// Take the program that developers build in place of the released one: a quick look at all the rest.
    #[arg(long)]
    pub quick: bool,
    /// The Python wheel for this system and the source distribution instead; needs maturin.
    #[arg(long, conflicts_with_all = ["target", "quick"])]
    pub wheel: bool,
    /// Link the wheel for every Linux with glibc 2.17 or later, by zig (`pip install "maturin[zig]"`).
    #[arg(long, requires = "wheel")]
    pub portable: bool,
    /// Only the checksums of what is in the folder.
    #[arg(long, conflicts_with_all = ["target", "quick", "wheel"])]
    pub checksums: bool,
}

/// Packages.
pub fn run(options: &Options, core: Option<Core>) -> Result<()> {
    let out = std::path::absolute(places::root().join(&options.out))?;
    std::fs::create_dir_all(&out)?;
    if options.checksums {
        return checksums(&out);
    }
    if options.wheel {
        return wheel(&out, options.portable);
    }
    let target = match &options.target {
        Some(target) => target.clone(),
        None => this_system()?,
    };
    let program = build(&target, options, core)?;
    let version = version()?;
    let name = format!("rigident-{version}-{target}");
    let folder = out.join(&name);
    if folder.exists() {
        std::fs::remove_dir_all(&folder)?;
    }
    std::fs::create_dir_all(&folder)?;
    fill(&folder, &program, &target)?;
    let archive = pack(&out, &name, &target)?;
    smoke(&out, &name, &archive, &target)?;
    println!("{}", archive.display());
    Ok(())
}

/// Returns the triple of the compiler's own system.
fn this_system() -> Result<String> {
    let text = process::output(process::command("rustc", places::root()).arg("-vV"))?;
    let host = text.lines().find_map(|line| line.strip_prefix("host: "));
    Ok(host.context("rustc names no host")?.to_owned())
}

/// Returns the version of the workspace.
fn version() -> Result<String> {
    let metadata = graph::metadata(None)?;
    let packages = metadata["packages"].as_array().context("cargo lists no packages")?;
    let own = packages.iter().find(|package| package["name"] == graph::PROGRAM);
    Ok(own.and_then(|own| own["version"].as_str()).context("rigident-cli has no version")?.to_owned())
}

/// Builds the program and returns where it is.
fn build(target: &str, options: &Options, core: Option<Core>) -> Result<PathBuf> {
    let released: &[&str] = if options.quick { &[] } else { &["--release"] };
    if target == windows::TARGET && !cfg!(windows) {
        return windows::build(windows::ready(core)?, released);
    }
    let mut command = process::cargo(places::root());
    command.args(["build", "--locked", "-p", "rigident-cli"]).args(released);
    let mut folder = places::target();
    if *target != this_system()? {
        command.args(["--target", target]);
        folder = folder.join(target);
    }
    if target == STATIC {
        command.env(crate::toolchain::linker_variable(STATIC), "musl-gcc");
    }
    process::run(&mut command)?;
    Ok(folder.join(if options.quick { "debug" } else { "release" }).join(program_name(target)))
}

fn program_name(target: &str) -> &'static str {
    if target.contains("windows") { "rigident.exe" } else { "rigident" }
}

/// Runs the packaged program: by itself, or by Wine where it is Windows' and this is not.
fn runs(program: &Path, target: &str, folder: &Path) -> Result<Command> {
    if target.contains("windows") && !cfg!(windows) {
        return windows::in_wine(program, folder);
    }
    Ok(process::command(program, folder))
}

/// Puts everything into the folder.
fn fill(folder: &Path, program: &Path, target: &str) -> Result<()> {
    let own = folder.join(program_name(target));
    std::fs::copy(program, &own).with_context(|| format!("no program {}", program.display()))?;
    for text in TEXTS {
        std::fs::copy(places::root().join(text), folder.join(text))?;
    }
    let examples = folder.join("examples");
    std::fs::create_dir_all(&examples)?;
    for name in ["bracket.csv", "bracket.rig.toml", "two-links.csv", "two-links.rig.toml"] {
        std::fs::copy(places::root().join("docs/examples").join(name), examples.join(name))?;
    }
    process::run(runs(&own, target, folder)?.args(["man", "--out", "man"]))?;
    for shell in SHELLS {
        let script = process::output(runs(&own, target, folder)?.args(["completions", shell]))?;
        std::fs::create_dir_all(folder.join("completions"))?;
        std::fs::write(folder.join("completions").join(shell), script)?;
    }
    let parts = graph::parts(target)?;
    std::fs::write(folder.join("THIRD-PARTY-NOTICES.txt"), notices::text(&parts)?)?;
    let bill = sbom::bill(&parts, &version()?, target);
    std::fs::write(folder.join("rigident.cdx.json"), format!("{bill:#}\n"))?;
    Ok(())
}

/// Makes one file of the folder: a zip for Windows, else a tar.gz. Python has both on every system.
fn pack(out: &Path, name: &str, target: &str) -> Result<PathBuf> {
    let (kind, end) = if target.contains("windows") { ("zip", "zip") } else { ("gztar", "tar.gz") };
    let script = "import shutil, sys; shutil.make_archive(sys.argv[1], sys.argv[2], '.', sys.argv[1])";
    process::run(process::command(python(), out).args(["-c", script, name, kind]))?;
    Ok(out.join(format!("{name}.{end}")))
}

fn python() -> &'static str {
    if cfg!(windows) { "python" } else { "python3" }
}

/// Unpacks the archive elsewhere and has the program do README's first job.
fn smoke(out: &Path, name: &str, archive: &Path, target: &str) -> Result<()> {
    let place = out.join("tried");
    if place.exists() {
        std::fs::remove_dir_all(&place)?;
    }
    std::fs::create_dir_all(&place)?;
    let script = "import shutil, sys; shutil.unpack_archive(sys.argv[1], sys.argv[2])";
    process::run(process::command(python(), out).args(["-c", script]).arg(archive).arg(&place))?;
    let folder = place.join(name);
    let program = folder.join(program_name(target));
    // Zip files made by Python forget who may run what.
    allow_to_run(&program)?;
    let said = process::output(runs(&program, target, &folder)?.arg("--version"))?;
    ensure!(said.contains(&version()?), "--version says {said:?}");
    let words = ["identify", "examples/bracket.csv", "--json", "--out", "tried"];
    let answer: serde_json::Value =
        serde_json::from_str(&process::output(runs(&program, target, &folder)?.args(words))?)?;
    let mass = answer["mass_kg"].as_f64().context("the bracket has no mass")?;
    ensure!(answer["status"] == "identified" && (mass - 3.2).abs() < 0.05, "the bracket weighs {mass} kg");
    println!("tried: {} identifies a bracket of {mass:.3} kg", said.trim());
    if target == STATIC {
        let shared = process::command("ldd", &folder).arg(&program).output()?;
        let text = String::from_utf8_lossy(&shared.stdout) + String::from_utf8_lossy(&shared.stderr);
        ensure!(!text.contains("=>"), "not static: {text}");
    }
    Ok(std::fs::remove_dir_all(&place)?)
}

#[cfg(unix)]
fn allow_to_run(program: &Path) -> Result<()> {
    use std::os::unix::fs::PermissionsExt;
    Ok(std::fs::set_permissions(program, std::fs::Permissions::from_mode(0o755))?)
}

#[cfg(not(unix))]
fn allow_to_run(_: &Path) -> Result<()> {
    Ok(())
}

/// Builds the wheel for this system and the source distribution.
fn wheel(out: &Path, is_portable: bool) -> Result<()> {
    let folder = places::root().join("python");
    let anywhere: &[&str] = if is_portable { &["--zig", "--compatibility", "manylinux2014"] } else { &[] };
    for words in [&[&["build", "--release", "--locked"], anywhere].concat()[..], &["sdist"]] {
        let mut command = process::command(python(), &folder);
        command.args(["-m", "maturin"]).args(words).arg("--out").arg(out);
        process::run(&mut command).context("python -m pip install maturin")?;
    }
    Ok(())
}

/// Writes SHA256SUMS of all archives in a folder, as `sha256sum --check` reads it.
fn checksums(folder: &Path) -> Result<()> {
    let is_archive = |path: &Path| {
        let end = path.extension().and_then(OsStr::to_str);
        path.is_file() && matches!(end, Some("gz" | "zip" | "whl"))
    };
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder)?.map(|entry| entry.map(|e| e.path())).collect::<Result<_, _>>()?;
    files.retain(|path| is_archive(path));
    files.sort();
    ensure!(!files.is_empty(), "{}: no archive", folder.display());
    let mut text = String::new();
    for file in files {
        let hash = Sha256::digest(std::fs::read(&file)?);
        let hash: String = hash.iter().map(|byte| format!("{byte:02x}")).collect();
        let name = file.file_name().context("no name")?.to_string_lossy();
        writeln!(text, "{hash}  {name}")?;
    }
    std::fs::write(folder.join("SHA256SUMS"), &text)?;
    print!("{text}");
    Ok(())
}

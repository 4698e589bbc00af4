//! The verb `setup`: installs what is missing, as root only; otherwise says what to type.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};

use crate::places;
use crate::process::{self, is_installed};
use crate::toolchain::{self, Core};

const CARGO_FUZZ: &str = "0.13.2";
/// A Python module that tests use, and the packages that bring it.
#[derive(Clone, Copy)]
pub struct Module {
    name: &'static str,
    /// The Python code that succeeds if the module is there.
    look: &'static str,
    packages: &'static [&'static str],
}

/// An MCAP reader that shares no code with ours, for the test that reads our recordings with it.
pub const MCAP_READER: Module = Module {
    name: "mcap_ros2.reader",
    look: "import mcap_ros2.reader",
    packages: &["mcap==1.6.0", "mcap-ros2-support==0.6.0"],
};
/// Rigid-body dynamics that share no code with ours.
pub const PINOCCHIO: Module =
    Module { name: "pinocchio", look: "import pinocchio", packages: &["pin==4.1.0"] };
/// Published robot descriptions with their meshes, 69 URDFs; it has no module.
pub const ROBOTS: Module = Module {
    name: "example-robot-data",
    look: "from importlib.metadata import version; version('example-robot-data')",
    packages: &["example-robot-data==6.0.0"],
};
/// The client of the hexapod's vendor.
pub const VENDORS_CLIENT: Module =
    Module { name: "pipython", look: "import pipython", packages: &["pipython==2.11.0.6"] };
/// A reader of C3D files that shares no code with ours.
pub const C3D_READER: Module = Module { name: "ezc3d", look: "import ezc3d", packages: &["ezc3d==1.7.2"] };
/// ROS 2's definitions of messages, and a reader of YAML.
pub const ROS_READER: Module = Module {
    name: "rosbags",
    look: "import rosbags.typesys, ruamel.yaml",
    packages: &["rosbags==0.11.9", "ruamel.yaml==0.19.1"],
};
/// Clients and a bridge of other makers for the sensors of `live`: ATI's records, Universal Robots' RTDE,
/// Foxglove's own SDK.
pub const SENSORS: Module = Module {
    name: "NetFT, ur_rtde, foxglove",
    look: "import NetFT, rtde_receive, foxglove",
    packages: &["NetFT==2.0.1", "ur_rtde==1.6.5", "foxglove-sdk==0.30.3"],
};
/// Arrays, for worlds that Python simulates; the wheel's modules have them.
pub const NUMPY: Module = Module { name: "numpy", look: "import numpy", packages: &["numpy>=1.23"] };
/// The modules that the scripts import that budgets compare with.
pub const PEERS: Module = Module {
    name: "numpy, scipy, polars",
    look: "import numpy, scipy, polars",
    packages: &["numpy>=1.23", "scipy==1.17.1", "polars==2.1.0"],
};
/// The modules that build the wheel and test it.
pub const WHEEL: Module = Module {
    name: "maturin, numpy, pytest, mypy, nbclient, ipykernel, dask, pyspark, pyarrow, scipy",
    look: "import maturin, numpy, pytest, mypy, nbclient, ipykernel, distributed, pyspark, pyarrow, scipy",
    packages: &[
        "maturin==1.16.0",
        "numpy>=1.23",
        "pytest==9.2.0",
        "mypy==2.4.1",
        "nbclient==0.11.0",
        "ipykernel==7.4.0",
        "dask==2026.8.0",
        "distributed==2026.8.0",
        "pyspark==4.3.0",
        "pyarrow==26.0.1",
        "scipy==1.17.1",
    ],
};
/// The checker of the workflows.
pub const LINTERS: Module = Module {
    name: "zizmor, check-jsonschema",
    look: "from importlib.metadata import version; version('zizmor'); version('check-jsonschema')",
    packages: &["zizmor==1.32.0", "check-jsonschema==0.39.0"],
};
/// OpenSim itself, which reads its own files.
pub const OPENSIM: Module = Module { name: "opensim", look: "import opensim", packages: &["opensim==4.6"] };

/// Browsers that show a page without a window, by the names of their programs; the first is Debian's.
const BROWSERS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "chrome"];

/// Says what to install.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// Only what tests take from Python.
    #[arg(long)]
    pub python: bool,
}

/// Installs everything that any other verb may need.
pub fn run(options: &Options, core: Option<Core>) -> Result<()> {
    if !options.python {
        programs(core)?;
        cargo_fuzz()?;
    }
    python_modules();
    Ok(())
}

/// Installs the system's packages and what the boards are compiled with.
pub fn programs(core: Option<Core>) -> Result<()> {
    system_packages()?;
    toolchain::choose(core)?;
    // Spark's workers are Java's.
    if !is_installed("java")
        && let Err(error) = apt_install(&["default-jre-headless"])
    {
        eprintln!("no Java for Spark: {error:#}");
    }
    if browser().is_none()
        && let Err(error) = apt_install(&BROWSERS[..1])
    {
        eprintln!("no browser to test pages in: {error:#}");
    }
    Ok(())
}

/// Returns a browser that shows a page without a window, if one is installed.
pub fn browser() -> Option<&'static str> {
    BROWSERS.into_iter().find(|program| is_installed(program))
}

/// Installs the emulator, and the C++ compiler that the fuzzer's run-time needs.
pub fn system_packages() -> Result<()> {
    let wanted = [("qemu-system-arm", "qemu-system-arm"), ("g++", "g++")];
    let missing: Vec<&str> =
        wanted.iter().filter(|(program, _)| !is_installed(program)).map(|(_, package)| *package).collect();
    if missing.is_empty() { Ok(()) } else { apt_install(&missing) }
}

/// Installs Debian packages as root; for anyone else the error says what to type.
pub fn apt_install(packages: &[&str]) -> Result<()> {
    let list = packages.join(" ");
    let by_hand = format!("sudo apt-get install -y --no-install-recommends {list}");
    if !is_installed("apt-get") {
        bail!("{list}: missing, and there is no apt-get here; install them by hand");
    }
    let user = process::output(process::command("id", places::root()).arg("-u"))?;
    if user.trim() != "0" {
        bail!("{list}: missing; type\n  {by_hand}");
    }
    let apt = || {
        let mut command = process::command("apt-get", places::root());
        command.env("DEBIAN_FRONTEND", "noninteractive");
        command
    };
    process::run(apt().args(["-q", "update"]))?;
    process::run(apt().args(["-q", "install", "-y", "--no-install-recommends"]).args(packages))
        .with_context(|| format!("cannot install; by hand it is\n  {by_hand}"))
}

/// Returns the pinned cargo-fuzz, in this project's own folder.
pub fn cargo_fuzz() -> Result<PathBuf> {
    let folder = places::own().join("tools");
    let program = folder.join("bin/cargo-fuzz");
    let version = process::command(&program, places::root()).arg("--version").output();
    let is_pinned = version.is_ok_and(|v| String::from_utf8_lossy(&v.stdout).contains(CARGO_FUZZ));
    if !is_pinned {
        process::run(
            process::cargo(places::root())
                .args(["install", "--quiet", "--locked", "cargo-fuzz", "--version", CARGO_FUZZ, "--root"])
                .arg(&folder)
                .env("CARGO_TARGET_DIR", places::own().join("tools-build")),
        )?;
    }
    Ok(program)
}

/// Installs the modules that tests compare with into a Python of this project's own; says which cannot be
/// had. The tests that need them are skipped then.
fn python_modules() {
    for module in
        [MCAP_READER, PINOCCHIO, ROBOTS, VENDORS_CLIENT, C3D_READER, ROS_READER, SENSORS, OPENSIM, WHEEL]
    {
        python_module(module);
    }
}

/// Installs one of them if it is not here, or says why it cannot be had.
pub fn python_module(module: Module) {
    if has_module(module) {
        return;
    }
    let install = || -> Result<()> {
        let folder = places::own().join("python");
        if !python().is_file() {
            process::run(process::command("python3", places::root()).args(["-m", "venv"]).arg(&folder))?;
        }
        process::run(
            process::command(python(), places::root())
                .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"])
                .args(module.packages),
        )
    };
    if let Err(error) = install() {
        eprintln!("no {} in Python: {error:#}", module.name);
    }
}

/// Returns the project's own Python, if it was made.
pub fn python() -> PathBuf {
    places::own().join("python/bin/python")
}

/// Tells whether the project's own Python has what a module brings.
pub fn has_module(module: Module) -> bool {
    process::command(python(), places::root())
        .args(["-c", module.look])
        .output()
        .is_ok_and(|output| output.status.success())
}

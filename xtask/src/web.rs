//! The verb `web`: the program as WebAssembly behind one page, checked for its size and in a browser.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use crate::places;
use crate::process::{self, is_installed};
use crate::setup;

const TARGET: &str = "wasm32-wasip1";
/// Debian's compiler, whose sources of `std` are a package: rustup's target is not needed.
const COMPILER: [&str; 2] = ["/usr/bin/rustc", "/usr/bin/cargo"];
/// The packages that bring compiler, linker, the system's library, and a compiler for the C of SQLite and
/// zstd.
const PACKAGES: [&str; 7] =
    ["rustc-web", "cargo-web", "rust-web-src", "lld", "clang-14", "wasi-libc", "libclang-rt-14-dev-wasm32"];
/// The system's library for the target.
const LIBRARY: &str = "/usr/lib/wasm32-wasi";
/// The size that the page may have on the way to a browser, bytes: everything, packed by gzip.
const MOST_BYTES: u64 = 5_000_000;
/// Packages of npm: the program that shrinks WebAssembly, the driver of the browser, and rules of
/// accessibility.
const NPM: [&str; 3] = ["axe-core@4.10.3", "binaryen@132.0.0", "playwright-core@1.65.1"];
/// Parts of SQLite that no bag needs: full-text search, R-trees, statistics, extensions of other people.
const SQLITE: [&str; 8] = [
    "-USQLITE_ENABLE_FTS3",
    "-USQLITE_ENABLE_FTS3_PARENTHESIS",
    "-USQLITE_ENABLE_FTS5",
    "-USQLITE_ENABLE_RTREE",
    "-USQLITE_ENABLE_DBSTAT_VTAB",
    "-USQLITE_ENABLE_STAT4",
    "-USQLITE_ENABLE_LOAD_EXTENSION",
    "-DSQLITE_OMIT_LOAD_EXTENSION",
];

/// Says how much is done.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// Build, and check the size; no tests in a browser.
    #[arg(long)]
    pub build: bool,
    /// Test what was built before.
    #[arg(long, conflicts_with = "build")]
    pub test: bool,
    /// Build the page, and the released program with it inside, for `rigident ui`.
    #[arg(long, conflicts_with_all = ["build", "test"])]
    pub program: bool,
    /// Leave the pictures that the tests take in this folder.
    #[arg(long, value_name = "FOLDER")]
    pub pictures: Option<PathBuf>,
}

/// Returns where the page is put together.
pub fn site() -> PathBuf {
    places::target().join("web/site")
}

/// Builds the page and tests it.
///
/// # Errors
/// Fails if a tool is missing and cannot be installed, if it does not build, is too large, or if a test
/// fails.
pub fn run(options: &Options) -> Result<()> {
    tools()?;
    if !options.test {
        compile()?;
        assemble()?;
    }
    let bytes = weigh()?;
    if options.build {
        return Ok(());
    }
    if options.program {
        let build = ["build", "--release", "-p", "rigident-cli", "--features", "page"];
        process::run(process::cargo(places::root()).args(build).env("RIGIDENT_SITE", site()))?;
        println!("{}", places::released("rigident").display());
        return Ok(());
    }
    let browser = setup::browser().context("there is no Chromium or Chrome: cargo xtask setup")?;
    process::run(process::cargo(places::root()).args(["build", "--quiet", "-p", "rigident-cli"]))?;
    let mut test = process::command("node", &places::root().join("web/tests"));
    test.arg("page.mjs")
        .env("NODE_PATH", npm().join("node_modules"))
        .env("RIGIDENT_BROWSER", browser)
        .env("RIGIDENT_SITE", site())
        .env("RIGIDENT_PROGRAM", places::built("rigident"));
    if let Some(folder) = &options.pictures {
        test.env("RIGIDENT_PICTURES", std::path::absolute(folder)?);
    }
    process::run(&mut test)?;
    ensure!(bytes <= MOST_BYTES, "{bytes} B: the page may take {MOST_BYTES}");
    Ok(())
}

/// Returns where npm's packages are.
fn npm() -> PathBuf {
    places::own().join("npm")
}

/// Installs what is missing.
fn tools() -> Result<()> {
    let is_there = Path::new(LIBRARY).is_dir()
        && is_installed("wasm-ld")
        && is_installed("clang-14")
        && Path::new("/usr/lib/rustlib/src/rust/library").is_dir()
        && COMPILER.iter().all(|program| Path::new(program).is_file());
    if !is_there {
        setup::apt_install(&PACKAGES)?;
    }
    ensure!(is_installed("npm"), "there is no npm: install Node.js 20 or later");
    let packages = ["axe-core", "binaryen", "playwright-core"];
    if !packages.iter().all(|name| npm().join("node_modules").join(name).is_dir()) {
        std::fs::create_dir_all(npm())?;
        process::run(
            process::command("npm", &npm())
                .args(["install", "--no-audit", "--no-fund", "--prefix", "."])
                .args(NPM),
        )?;
    }
    Ok(())
}

/// Compiles the program; in a folder of its own, because its compiler is another one.
fn compile() -> Result<()> {
    let own = places::target().join("web");
    std::fs::create_dir_all(&own)?;
    let missing = own.join("missing.o");
    let system = ["--target=wasm32-wasi", "--sysroot=/usr", "-isystem", "/usr/include/wasm32-wasi"];
    process::run(
        process::command("clang-14", &places::root().join("web/wasi"))
            .args(system)
            .args(["-O2", "-c", "missing.c", "-o"])
            .arg(&missing),
    )?;
    let flags = format!(
        "-C link-self-contained=no -C linker-flavor=wasm-ld -L native={LIBRARY} -C \
         target-feature=+crt-static -C link-arg={LIBRARY}/crt1-command.o -C link-arg=--wrap=link -C \
         link-arg=--wrap=linkat -C link-arg={}",
        missing.display()
    );
    let [rustc, cargo] = COMPILER;
    process::run(
        process::command(cargo, places::root())
            .args(["build", "--profile", "web", "-p", "rigident-cli", "--no-default-features"])
            .args(["--target", TARGET, "-Zbuild-std=std,panic_abort"])
            .env("RUSTC", rustc)
            .env("RUSTC_BOOTSTRAP", "1")
            .env_remove("RUSTUP_TOOLCHAIN")
            .env("CARGO_TARGET_DIR", &own)
            .env("CARGO_TARGET_WASM32_WASIP1_LINKER", "wasm-ld")
            .env("CARGO_TARGET_WASM32_WASIP1_RUSTFLAGS", flags)
            .env("CC_wasm32_wasip1", "clang-14")
            .env("AR_wasm32_wasip1", "llvm-ar-14")
            .env("CFLAGS_wasm32_wasip1", system.join(" "))
            .env("LIBSQLITE3_FLAGS", SQLITE.join(" ")),
    )
}

/// Puts the page, the program and the example into one folder.
fn assemble() -> Result<()> {
    let site = site();
    if site.exists() {
        std::fs::remove_dir_all(&site)?;
    }
    std::fs::create_dir_all(site.join("example"))?;
    let page = places::root().join("web/page");
    let embedded = std::fs::read_to_string(places::root().join("host/cli/src/commands/ui/files.rs"))?;
    let cached = std::fs::read_to_string(page.join("sw.js"))?;
    for entry in std::fs::read_dir(&page)? {
        let path = entry?.path();
        let name = path.file_name().context("a file without a name")?;
        std::fs::copy(&path, site.join(name)).with_context(|| path.display().to_string())?;
        let quoted = format!("\"{}\"", name.to_string_lossy());
        ensure!(embedded.contains(&quoted), "host/cli/src/commands/ui/files.rs does not list {quoted}");
        let is_kept = cached.contains(&quoted) || name == "index.html" || name == "sw.js";
        ensure!(is_kept, "web/page/sw.js does not keep {quoted}");
    }
    for name in ["bracket.csv", "bracket.rig.toml"] {
        std::fs::copy(places::root().join("docs/examples").join(name), site.join("example").join(name))?;
    }
    let built = places::target().join("web").join(TARGET).join("web/rigident.wasm");
    let shrink = npm().join("node_modules/.bin/wasm-opt");
    // Bit for bit the same numbers: without --fast-math nothing is reordered.
    process::run(
        process::command(shrink, places::root())
            .args(["-O3", "--enable-bulk-memory", "--enable-nontrapping-float-to-int", "--enable-sign-ext"])
            .args(["--enable-mutable-globals", "--enable-multivalue", "--enable-reference-types"])
            .arg("--strip-debug")
            .arg(built)
            .arg("-o")
            .arg(site.join("rigident.wasm")),
    )?;
    let mut gzip = process::command("gzip", &site);
    process::run(gzip.args(["--keep", "--force", "-9", "rigident.wasm"]))
}

/// Returns the bytes that a browser has to load.
fn weigh() -> Result<u64> {
    let packed = std::fs::metadata(site().join("rigident.wasm.gz"))
        .context("the page is not built: cargo xtask web")?
        .len();
    let mut rest = 0;
    for entry in std::fs::read_dir(site())? {
        let path = entry?.path();
        if path.extension().is_some_and(|ending| ending == "js" || ending == "css" || ending == "html") {
            rest += path.metadata()?.len();
        }
    }
    println!("program {packed} B packed, page {rest} B; in {}", site().display());
    Ok(packed + rest)
}

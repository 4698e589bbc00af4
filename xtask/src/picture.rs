//! The verb `picture`: makes the documents' pictures anew: the report of the demonstration as a browser shows
//! it, and the monitor.

use std::path::Path;

use anyhow::{Context, Result};

use crate::places;
use crate::process;
use crate::setup;

/// The monitor's page: what `rigident monitor --once` prints.
const MONITOR: &str = "<!doctype html><meta \
                       charset=\"utf-8\"><style>body{margin:0;background:#16181d;color:#d8dee9}pre{margin:14px;font:14px/1.25 'DejaVu Sans Mono',monospace}</style><pre>";

/// Runs the demonstration and takes a picture of the upper part of its report, and of its recording in the
/// monitor.
///
/// # Errors
/// Fails without a browser, or if the demonstration does.
pub fn run() -> Result<()> {
    let browser = setup::browser().context("there is no Chromium or Chrome: cargo xtask setup")?;
    let folder = places::own().join("picture");
    if folder.exists() {
        std::fs::remove_dir_all(&folder).with_context(|| folder.display().to_string())?;
    }
    let rigident = || {
        let mut cargo = process::cargo(places::root());
        cargo.args(["run", "--quiet", "--release", "--"]);
        cargo
    };
    process::run(rigident().args(["demo", "--out"]).arg(&folder))?;
    take(browser, &folder.join("report.html"), "report.png", "1100,870")?;
    let text = rigident().args(["monitor", "demo.mcap", "--once"]).current_dir(&folder).output()?;
    anyhow::ensure!(text.status.success(), "{}", String::from_utf8_lossy(&text.stderr));
    let text = String::from_utf8_lossy(&text.stdout);
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    let page = folder.join("monitor.html");
    std::fs::write(&page, format!("{MONITOR}{text}</pre>"))?;
    take(browser, &page, "monitor.png", "880,560")
}

/// Takes a picture of a page.
fn take(browser: &str, page: &Path, name: &str, size: &str) -> Result<()> {
    let picture = places::root().join("docs/images").join(name);
    let mut take = process::command(browser, places::root());
    take.args(["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"]);
    take.arg(format!("--window-size={size}")).arg(format!("--screenshot={}", picture.display()));
    process::run(take.arg(format!("file://{}", page.display())))?;
    println!("{}", picture.display());
    Ok(())
}

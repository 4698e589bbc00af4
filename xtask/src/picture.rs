//! The verb `picture`: makes README's picture anew, the report of the demonstration as a browser shows it.

use anyhow::{Context, Result};

use crate::places;
use crate::process;
use crate::setup;

/// Runs the demonstration and takes a picture of the upper part of its report.
///
/// # Errors
/// Fails without a browser, or if the demonstration does.
pub fn run() -> Result<()> {
    let browser = setup::browser().context("there is no Chromium or Chrome: cargo xtask setup")?;
    let folder = places::own().join("picture");
    if folder.exists() {
        std::fs::remove_dir_all(&folder).with_context(|| folder.display().to_string())?;
    }
    let mut demo = process::cargo(places::root());
    process::run(demo.args(["run", "--quiet", "--release", "--", "demo", "--out"]).arg(&folder))?;
    let picture = places::root().join("docs/images/report.png");
    let mut take = process::command(browser, places::root());
    take.args(["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--window-size=1100,870"]);
    take.arg(format!("--screenshot={}", picture.display()));
    process::run(take.arg(format!("file://{}", folder.join("report.html").display())))?;
    println!("{}", picture.display());
    Ok(())
}

//! The device's worst sample, counted in the emulator.

use anyhow::{Context, Result};
use serde_json::Value;

use super::{Figure, Setting};
use crate::places;
use crate::process;

/// Parameters of one body.
const N: u64 = 10;

/// Instructions of the worst sample of one body.
pub fn figures(setting: &Setting) -> Result<Vec<Figure>> {
    let mut command = process::command(std::env::current_exe()?, places::root());
    command.args(["bench-target", "--json"]);
    command.args(setting.core.iter().flat_map(|core| ["--core", core.name()]));
    let entries: Vec<Value> = serde_json::from_str(&process::output(&mut command)?)?;
    let one = entries.iter().find(|entry| entry["n"] == N).context("no entry for one body")?;
    let number = |key: &str| one[key].as_f64().with_context(|| format!("{key} is no number"));
    Ok(vec![Figure {
        name: "device: worst sample at N = 10, instructions".to_owned(),
        value: number("path_worst_instructions")?,
        limit: 6000.0,
        note: format!("whole path {:.0} a sample in the mean", number("path_instructions_per_sample")?),
    }])
}

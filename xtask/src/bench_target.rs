//! The verb `bench-target`.
use crate::toolchain::Core;
#[derive(clap::Args, Clone, Default)]
pub struct Options {}
pub fn run(_o: &Options, _c: Option<Core>) -> anyhow::Result<()> {
    Ok(())
}

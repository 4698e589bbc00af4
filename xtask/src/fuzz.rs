//! The verb `fuzz`.
#[derive(clap::Args, Clone, Default)]
pub struct Options {}
pub fn run(_o: &Options) -> anyhow::Result<()> {
    Ok(())
}

use std::path::PathBuf;

use clap::Args;

/// `rigident ui`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Examples:\n  rigident ui\n  rigident ui --no-open --port 9000\n  rigident ui --site \
                  target/web/site"
)]
pub struct Ui {
    /// The port on this computer; what the page keeps is kept for it
    #[arg(long, default_value_t = 8766)]
    pub port: u16,
    /// Open no browser
    #[arg(long)]
    pub no_open: bool,
    /// A folder with the page as `cargo xtask web` makes it, in place of that in the program
    #[arg(long, value_name = "FOLDER")]
    pub site: Option<PathBuf>,
}

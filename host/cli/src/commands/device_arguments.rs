//! Options of the commands around a device, and of those around the command line itself.

use std::path::PathBuf;

use clap::Args;

/// Which port the device is on.
#[derive(Args, Debug, Clone, Default)]
pub struct PortOption {
    /// The device's port; without it the only device is found
    #[arg(long, value_name = "PORT")]
    pub port: Option<String>,
}

/// `rigident ports`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Opening a port restarts some boards: Arduinos, for one.\n\nExamples:\n  rigident ports\n  \
                  rigident ports --no-hello --json"
)]
pub struct Ports {
    /// Only list: open no port, and ask nobody who is there
    #[arg(long)]
    pub no_hello: bool,
    /// Print a JSON array
    #[arg(long)]
    pub json: bool,
}

/// `rigident info`
#[derive(Args, Debug, Clone)]
#[command(after_help = "Examples:\n  rigident info\n  rigident info --port /dev/ttyACM0\n  rigident info \
                  --restart\n  rigident info --port ./rigident-rig --json")]
pub struct Info {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub device: PortOption,
    /// Have the device start anew first, as after power-on; what its flash keeps stays
    #[arg(long)]
    pub restart: bool,
    /// Print a JSON object
    #[arg(long)]
    pub json: bool,
}

/// `rigident configure`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Examples:\n  rigident configure                                   # prints the settings in \
                  force\n  rigident configure --write bracket.settings.toml\n  rigident configure --rig \
                  bracket.rig.toml --dry-run\n  rigident configure --from bracket.settings.toml --port \
                  /dev/ttyACM0"
)]
pub struct Configure {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub device: PortOption,
    /// Send what this rig file makes of the settings
    #[arg(long, value_name = "FILE", conflicts_with = "from")]
    pub rig: Option<PathBuf>,
    /// Send the settings of this file, .toml or .json
    #[arg(long, value_name = "FILE")]
    pub from: Option<PathBuf>,
    /// Write the settings into a new file, .toml or .json
    #[arg(long, value_name = "FILE")]
    pub write: Option<PathBuf>,
    /// Show what would change and send nothing
    #[arg(long)]
    pub dry_run: bool,
    /// Print a JSON object
    #[arg(long)]
    pub json: bool,
}

/// `rigident doctor`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Exit status 1 if something is to be done. What is not here and not needed, such as a \
                  device or the emulator, is no fault.\n\n\
                  Examples:\n  rigident doctor\n  rigident doctor --port /dev/ttyACM0 --json\n  rigident \
                  doctor --udev-rule | sudo tee /etc/udev/rules.d/60-rigident.rules"
)]
pub struct Doctor {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub device: PortOption,
    /// Print the udev rule, and nothing else
    #[arg(long)]
    pub udev_rule: bool,
    /// Print a JSON object
    #[arg(long)]
    pub json: bool,
}

/// `rigident completions`
#[derive(Args, Debug, Clone)]
#[command(after_help = "Examples:\n  rigident completions bash > \
                  ~/.local/share/bash-completion/completions/rigident\n  rigident completions zsh > \
                  ~/.zfunc/_rigident\n  rigident completions fish > \
                  ~/.config/fish/completions/rigident.fish")]
pub struct Completions {
    /// The shell
    #[arg(value_enum)]
    pub shell: clap_complete::Shell,
}

/// `rigident man`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Examples:\n  rigident man --out man && man -l man/rigident-identify.1\n  rigident man | \
                  man -l -"
)]
pub struct Man {
    /// Folder for a page of each command; must be new or empty. Default: the first page, on standard output
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// `rigident monitor`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Keys: q or Ctrl-C quits, up and down choose a parameter. Without colours: NO_COLOR=1.\n\nA \
                  device that another program runs, such as `rigident run`, is watched by following that \
                  program's recording.\n\nExamples:\n  rigident monitor --demo\n  rigident monitor \
                  rigident-run-001/run.mcap\n  rigident monitor --port /dev/ttyACM0\n  rigident monitor \
                  --rig bracket.rig.toml --start       # moved by hand\n  rigident monitor --demo \
                  --foxglove\n  rigident monitor run.mcap --once"
)]
pub struct Monitor {
    /// A recording, CSV or MCAP, that is finished or being written. Default: the device on a port
    #[arg(conflicts_with_all = ["port", "demo"])]
    pub recording: Option<PathBuf>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub device: PortOption,
    /// Watch the demonstration, in this process and in real time
    #[arg(long, conflicts_with_all = ["port", "rig", "start"])]
    pub demo: bool,
    /// Rig file. Default: NAME.rig.toml beside the recording, or the device's settings
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// Configure the device by the rig file and start it; nothing is recorded
    #[arg(long, requires = "rig", conflicts_with = "recording")]
    pub start: bool,
    /// Send the same to Foxglove; PORT may be ADDRESS:PORT, and is one of this machine alone without
    #[arg(long, value_name = "PORT", num_args = 0..=1, require_equals = true, default_missing_value = "8765")]
    pub foxglove: Option<String>,
    /// Print the last picture as text and end: of a recording or the demonstration as a whole, of a device
    /// after its first answer
    #[arg(long)]
    pub once: bool,
    /// Print a JSON object for every new answer, one a line, and nothing else
    #[arg(long)]
    pub json: bool,
}

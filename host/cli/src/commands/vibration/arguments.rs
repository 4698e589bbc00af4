use std::path::PathBuf;

use clap::{Args, Subcommand};

#[cfg(feature = "simulator")]
use crate::options::test_body::DemoBody;

/// `rigident vibration`
#[derive(Args, Debug, Clone)]
pub struct Vibration {
    /// What to do
    #[command(subcommand)]
    pub command: VibrationCommand,
}

/// What to do with a platform on springs.
#[derive(Subcommand, Debug, Clone)]
pub enum VibrationCommand {
    /// Identify a body by its modes and by its motion, beside each other
    Identify(IdentifyVibration),
    /// Identify what locked postures tell of a tree, and propose the next
    Postures(Postures),
    /// Find the stiffness of the springs from a body of known inertia
    Stiffness(Stiffness),
    /// Simulate the experiment of the vibration paper, and identify it
    #[cfg(feature = "simulator")]
    Demo(DemoVibration),
}

/// `rigident vibration identify`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "The recording has the poses of the platform (x_m, y_m, z_m, qw, qx, qy, qz), or the \
                  readings of an IMU on it, from the release on; the rig file says what the springs are, in \
                  [suspension]. Of an IMU alone only the modes are identified.\n\nExit status 0 if the body \
                  is identified, 1 if not, 2 if a file cannot be used.\n\nExamples:\n  rigident vibration \
                  identify swing.csv\n  rigident vibration identify swing.csv --modes 5 --out swing\n  \
                  rigident vibration identify imu.csv --rig springs.rig.toml --json"
)]
pub struct IdentifyVibration {
    /// The recording, CSV or MCAP
    pub recording: PathBuf,
    /// Rig file. Default: NAME.rig.toml beside the recording
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// How many modes there are. Default: one for each coordinate that is free
    #[arg(long, value_name = "N")]
    pub modes: Option<usize>,
    /// Folder for result.json, factors, the spectrum and a page of the modes; new or empty
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print a JSON object
    #[arg(long)]
    pub json: bool,
}

/// `rigident vibration stiffness`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "The recording is of the free vibration of a reference body on the platform; the rig file's \
                  [suspension] says where it is, what the bare platform weighs, and about how stiff the \
                  springs are. What is printed goes into [suspension] in place of that.\n\nExit status 0 if \
                  the stiffness is found, 1 if what is left contradicts it, 2 if a file cannot be \
                  used.\n\nExamples:\n  rigident vibration stiffness steel.csv --body steel-cylinder.toml\n  \
                  rigident vibration stiffness steel.csv --body steel-cylinder.toml --mounting lying \
                  --json"
)]
pub struct Stiffness {
    /// The recording, CSV or MCAP
    pub recording: PathBuf,
    /// The reference body, TOML
    #[arg(long, value_name = "FILE")]
    pub body: PathBuf,
    /// How it was mounted: a name from its file
    #[arg(long, value_name = "NAME", default_value = "")]
    pub mounting: String,
    /// Rig file. Default: NAME.rig.toml beside the recording
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// How many modes there are. Default: one for each coordinate that is free
    #[arg(long, value_name = "N")]
    pub modes: Option<usize>,
    /// Print a JSON object
    #[arg(long)]
    pub json: bool,
}

/// `rigident vibration postures`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "The file has the links in [[link]] tables, as a rig file, and in each [[posture]] mass, \
                  centre of mass and tensor of everything with the joints locked as [posture.joint] says. \
                  Recordings have the poses of the platform and the attitudes or coordinates of the joints, \
                  as for `rigident identify`. The factor merges with that of the motion of the same links on \
                  springs (rigident merge).\n\nExamples:\n  rigident vibration postures \
                  docs/examples/two-link-postures.toml\n  rigident vibration postures posture1.csv \
                  posture2.csv posture3.csv --factor postures.factor\n  rigident vibration postures \
                  postures.toml --factor postures.factor --plot sets.svg --json"
)]
pub struct Postures {
    /// The file of postures, TOML; or the recordings of their free vibration, one for each posture
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
    /// Rig file of all recordings. Default: that of the first, NAME.rig.toml beside it
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// Write the factor of all postures
    #[arg(long, value_name = "FILE")]
    pub factor: Option<PathBuf>,
    /// Draw rank and condition of every set of postures, SVG
    #[arg(long, value_name = "FILE")]
    pub plot: Option<PathBuf>,
    /// Print a JSON object
    #[arg(long)]
    pub json: bool,
}

/// `rigident vibration demo`
#[cfg(feature = "simulator")]
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Three locked postures are struck and vibrate freely; then link 1 is released and swings. \
                  Cameras see markers; everything is identified from their recordings, which are written \
                  with their rig files into the folder.\n\nExamples:\n  rigident vibration demo\n  rigident \
                  vibration demo --seed 7 --out paper --json\n  rigident vibration demo --body horizontal \
                  --out springs"
)]
pub struct DemoVibration {
    /// Seed of the noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// One body on the springs instead: a test body of `rigident demo`, so that two rigs can be merged
    #[arg(long, value_enum, value_name = "BODY")]
    pub body: Option<DemoBody>,
    /// Standard deviation of a marker's noise along each axis, mm
    #[arg(long, value_name = "MM", default_value_t = 0.2)]
    pub marker_noise_mm: f64,
    /// Folder for the recordings; new or empty. Default: a new one
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print a JSON object
    #[arg(long)]
    pub json: bool,
}

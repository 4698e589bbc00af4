use std::path::PathBuf;

use clap::Args;

use crate::commands::device_arguments::PortOption;
use crate::commands::run::adaptive::Adaptive;
use crate::commands::run::programme::Programme;
use crate::options::calibration::CalibrationOption;
use crate::options::forgetting::Forgetting;
use crate::options::known_values::KnownQuantities;
use crate::options::load::LoadOptions;
use crate::options::output::Output;
use crate::options::stop_criterion::StopCriterion;

/// `rigident run`
#[derive(Args, Debug, Clone)]
#[command(after_help = "Examples:\n  rigident run --port /dev/ttyACM0 --rig bracket.rig.toml --platform \
                        tcp://192.168.1.20:7447\n  rigident run --port ./rigident-rig --rig rig.rig.toml \
                        --platform tcp://127.0.0.1:7447 --duration-s 30 --yes\n  rigident run --port \
                        /dev/ttyACM0 --rig bracket.rig.toml --platform \
                        'gcs://192.168.0.1:50000?rate_hz=100'\n  rigident run --port /dev/ttyACM0 --rig \
                        arm.rig.toml --platform ur://192.168.1.40 --plan motion.json\n  rigident run --port \
                        /dev/ttyACM0 --rig \
                        bracket.rig.toml --platform tcp://192.168.1.20:7447 --adaptive\n  rigident run \
                        --port /dev/ttyACM0 --rig bracket.rig.toml --platform 'pose+udp://192.168.1.30:5000' \
                        --plan motion.json\n  rigident run --port /dev/ttyACM0 --rig bracket.rig.toml \
                        --platform none --until m=0.02\n\n\
                        A rig file of two [[link]] with an [[imu]] each makes it a run of two links: \
                        initial_wxyz of the second says how it hangs at the start. `rigident-sim serve \
                        --body two-links --write-rig rig.rig.toml` is such a rig.\n\n\
                        Ctrl-C stops the platform, sees it at rest, and keeps what was recorded.")]
pub struct Run {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub device: PortOption,
    /// The platform's controller
    ///
    /// tcp://HOST:PORT: as `rigident-sim serve` offers it. gcs://HOST:PORT or gcs:///dev/ttyUSB0: a PI
    /// hexapod (GCS 2.0). ur://HOST: an arm of Universal Robots (RTDE and URScript), that platform.arm in the
    /// rig file describes. pose+tcp://HOST:PORT, pose+udp://…, pose+serial:///dev/…, legs+…: CSV lines of
    /// poses or leg lengths; the plate must be at home when it begins, and is led back there after the
    /// experiment. none: the body is moved by hand, or by anything else; the next move is shown, and Ctrl-C
    /// ends. Behind it ?rate_hz=100, &lead_s=0.2 (set points are sent this long before their time) and
    /// &baud=115200 where they apply
    #[arg(long, value_name = "ADDRESS")]
    pub platform: String,
    /// Move without asking: the limits were checked, and nobody is in the platform's way
    #[arg(long)]
    pub yes: bool,
    /// Do everything but the motion: connect, weigh, warm up, zero, check, and show what would be asked
    #[arg(long, conflicts_with = "yes")]
    pub dry_run: bool,
    /// Drive the program at a share of its speed, as 0.1 for a first look at a new set-up
    #[arg(long, value_name = "SHARE", conflicts_with = "adaptive")]
    pub slow: Option<f64>,
    /// Rig file
    #[arg(long, value_name = "FILE")]
    pub rig: PathBuf,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub calibration: CalibrationOption,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub load: LoadOptions,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub programme: Programme,
    /// Longest wait for the load cell to settle, s; 0 skips the warm-up
    #[arg(long, default_value_t = 120.0, value_name = "S")]
    pub warm_up_s: f64,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub adaptive: Adaptive,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub stop: StopCriterion,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub forgetting: Forgetting,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub known: KnownQuantities,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub output: Output,
}

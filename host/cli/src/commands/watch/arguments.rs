use std::path::PathBuf;

use clap::Args;

use crate::options::trees::TreeModel;

/// `rigident watch`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "The recording is streamed to the firmware over its serial link, in real time to a device \
                  on a port; it knows the robot's inertial parameters by --model and looks for changes of \
                  one link: joints' angles or lengths, the base's IMU, and the wrenches of all feet \
                  ([[foot]] in the rig file) or of the base. Joints turn or slide about one axis each, up to \
                  32 links. A change is reported when it is found, and again when it has been measured, 1.5 \
                  s later. The model may be off by a few per cent: what that leaves is learnt while the \
                  watch settles, and makes it less sensitive. Numbers that rows do not tell are not \
                  given.\n\nExit status 0 if the firmware has watched, whether or not something changed, 1 \
                  if it never settled or errors of the model leave next to nothing that it could find, 2 bad \
                  input, 3 the device or the link to it.\n\nExamples:\n  rigident watch walk.csv --model \
                  identified.urdf --link right_hand\n  rigident watch arm.csv --model arm.urdf --link tool0 \
                  --mcu qemu --json\n  rigident watch arm.csv --model arm.urdf --link tool0 --mcu \
                  /dev/ttyUSB0"
)]
pub struct Watch {
    /// The recording, CSV or MCAP
    pub recording: PathBuf,
    /// The link that may change
    #[arg(long, value_name = "NAME")]
    pub link: String,
    /// inproc, qemu, or the port of a device
    #[arg(long, default_value = "inproc", value_name = "inproc|qemu|PORT")]
    pub mcu: String,
    /// Rate of the line to a device on a port while it watches, up to 3000000, baud. Default: 921600
    #[arg(long, value_name = "BAUD", value_parser = clap::value_parser!(u32).range(115_200..=3_000_000))]
    pub baud: Option<u32>,
    /// Rig file. Default: NAME.rig.toml beside the recording
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// False alarms per hour at most, of noise alone
    #[arg(long, default_value_t = 0.1, value_name = "NUMBER")]
    pub false_alarms_per_hour: f64,
    /// Nothing is reported in the first seconds, s
    #[arg(long, default_value_t = 20.0, value_name = "SECONDS")]
    pub settle_s: f64,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub tree: TreeModel,
}

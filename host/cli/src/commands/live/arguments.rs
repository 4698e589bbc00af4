use std::path::PathBuf;

use clap::Args;

use crate::options::calibration::CalibrationOption;
use crate::options::known_values::KnownQuantities;
use crate::options::output::Output;
use crate::options::stop_criterion::StopCriterion;

/// `rigident live`
#[derive(Args, Debug, Clone)]
#[command(after_help = "Sources:\n  ati+udp://HOST[?cpf=…&cpt=…]   ATI Net F/T, Axia, Schunk: wrench\n  \
                  rtde://HOST                    Universal Robots e-Series: wrench, and with it as --imu \
                  accelerometer and turns\n  ws://HOST[:8765]?topic=/…      a ROS 2 topic by \
                  foxglove_bridge: WrenchStamped, Imu, PoseStamped\n  xsens://DEVICE[?baud=…]        Xsens \
                  MTi: IMU\n  serial:DEVICE, udp://HOST:PORT, -   lines of CSV with a header, or \
                  ?columns=t_s,fx_n,…\n\n\
                  Examples:\n  rigident live --wrench ati+udp://192.168.1.1 --imu xsens:///dev/ttyUSB0 --rig \
                  hand.rig.toml\n  rigident live --wrench rtde://192.168.0.9 --imu rtde://192.168.0.9 --rig \
                  ur5e.rig.toml --until m=0.02\n  rigident live --wrench 'ws://robot?topic=/ft/wrench' --imu \
                  'ws://robot?topic=/imu/data'\n  ./logger | rigident live --wrench - --imu -\n\n\
                  Ctrl-C ends it and keeps everything; docs/live.md says what each device is to \
                  be set to.")]
pub struct Live {
    /// Where the wrench comes from
    #[arg(long, value_name = "URL")]
    pub wrench: String,
    /// Where accelerometer and gyro come from; the same address as --wrench if they come together
    #[arg(long, value_name = "URL")]
    pub imu: Option<String>,
    /// Where the pose of what carries the load cell comes from, in place of a gyro
    #[arg(long, value_name = "URL")]
    pub pose: Option<String>,
    /// Rig file: places, signs, names of columns. Default: the IMU at the load cell's origin, parallel to it
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub calibration: CalibrationOption,
    /// Who estimates while it comes: inproc, qemu, or the port of a device
    #[arg(long, default_value = "inproc", value_name = "inproc|qemu|PORT")]
    pub mcu: String,
    /// End after so long, s; without it Ctrl-C ends
    #[arg(long, value_name = "S")]
    pub at_most_s: Option<f64>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub stop: StopCriterion,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub known: KnownQuantities,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub output: Output,
}

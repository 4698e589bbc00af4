use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

pub use super::adaptive::Adaptive;
pub use super::body_arguments::Body;
pub use super::calibration_arguments::{Calibrate, Verify};
pub use super::device_arguments::{Completions, Configure, Doctor, Info, Man, Monitor, PortOption, Ports};
pub use super::factor_arguments::{MakeFactor, Merge, Solve, TareFiles};
pub use super::import_arguments::{Convert, Decimal, Import, Sign};
pub use super::montecarlo_arguments::{
    Estimating, Montecarlo, MontecarloMotions, MontecarloPoses, NoiseReading, Repeated,
};
pub use super::options::calibration::CalibrationOption;
pub use super::options::forgetting::Forgetting;
pub use super::options::known_values::KnownQuantities;
pub use super::options::load::LoadOptions;
pub use super::options::microcontroller::Mcu;
#[cfg(feature = "simulator")]
pub use super::options::own_body::OwnBody;
pub use super::options::payload::PayloadOptions;
pub use super::options::stop_criterion::StopCriterion;
pub use super::options::test_body::DemoBody;
pub use super::options::trees::{BenchCommand, ModelCommand, TreeModel, TreeOptions};
pub use super::plan_arguments::{Plan, Statics, Workspace};
pub use super::predict_arguments::{Predict, Summary, Validate};
pub use super::programme::Programme;
use super::vibration_arguments::Vibration;
use super::watch_arguments::Watch;

/// Tells the inertial parameters of a body from its wrench and motion: mass, centre of mass, inertia tensor,
/// each with a 95 % uncertainty, or that the data do not identify it.
#[derive(Parser, Debug)]
#[command(
    name = "rigident",
    version,
    after_help = "Without a command: `rigident demo`.\n\nExit status: 0 every asked-for parameter is identified, 1 partly or \
                  not identified, 2 bad input or usage, 3 link or hardware failure, 130 ended \
                  by a second Ctrl-C; the first ends with 1.\n\nExamples:\n  rigident demo\n  \
                  rigident identify bracket.csv --estimate m,mc\n  rigident run --port /dev/ttyACM0 --rig bracket.rig.toml \
                  --platform tcp://192.168.1.20:7447"
)]
pub struct Arguments {
    /// What to do
    #[command(subcommand)]
    pub command: Option<Command>,
}

/// The commands.
#[derive(Subcommand, Debug)]
pub enum Command {
    /// Identify a simulated body on a simulated platform, firmware included
    Demo(Demo),
    /// Take a recording through the firmware: in-process, emulated, or on a board
    Replay(Replay),
    /// Have the firmware watch a link of a robot in motion: what was picked up or lost, when, and how much
    Watch(Watch),
    /// Identify the body of a recording, in batch, with the same pipeline in double precision
    Identify(Identify),
    /// Compare estimators of the centre of mass on a recording's still poses
    Statics(Statics),
    /// Predict wrench or efforts of a recording's motion by a result or a model
    Predict(Predict),
    /// Compare what results and models predict of a recording with what was measured
    Validate(Validate),
    /// Sum up several runs of one body: mean, scatter, and whether the runs' uncertainties explain it
    Summary(Summary),
    /// Calibrate what measures with a body of known properties
    Calibrate(Calibrate),
    /// Compare what a rig measures of a reference body with what is known of it: pass or fail
    Verify(Verify),
    /// Reduce recordings to an information factor: all they say of the body, in a few hundred numbers
    Factor(MakeFactor),
    /// Merge factors of several runs of one body, in any order
    Merge(Merge),
    /// Identify the body of a factor
    Solve(Solve),
    /// List the serial ports, and which of them a device answers on
    Ports(Ports),
    /// Tell what a device is, its firmware, its state and what it has counted
    Info(Info),
    /// Read a device's settings, or send those of a rig or a file, the differences shown
    Configure(Configure),
    /// Look whether what a device needs is here: ports, permissions, emulator, firmware, clocks
    Doctor(Doctor),
    /// Run an experiment on a rig: warm-up, zero, still poses, motion, drift check
    Run(Run),
    /// Identify a body live from sensors that are on the network or on a line, moved by hand or by anything
    Live(Live),
    /// Watch an experiment as it runs: parameters with their intervals, the weakest direction, sensors, link
    Monitor(Monitor),
    /// Serve the page to this computer and open it: a recording is chosen, looked at and identified in the browser
    Ui(Ui),
    /// Convert a recording between CSV and MCAP without loss
    Convert(Convert),
    /// Show how files of other programs are understood, and write a rig file that says so
    Import(Import),
    /// Repeat a simulated experiment with fresh noise: bias, spread and coverage, against the Cramér–Rao bound
    Montecarlo(Montecarlo),
    /// Map where the platform can be tilted to
    Workspace(Workspace),
    /// Plan what to do with the platform before it moves
    Plan(Plan),
    /// Identify a person from motion capture and force plates
    Body(Body),
    /// Identify what swings on a platform that springs carry
    Vibration(Vibration),
    /// Look at a tree of links: robot description, rig file or person
    Model(ModelCommand),
    /// Print the JSON Schema of a file that this program reads or writes
    Schema(SchemaOf),
    /// Time what is computed, beside other libraries
    Bench(BenchCommand),
    /// Print the completions of a shell
    Completions(Completions),
    /// Write the manual's pages
    Man(Man),
}

/// `rigident ui`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Examples:\n  rigident ui\n  rigident ui --no-open --port 9000\n  rigident ui --site target/web/site"
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

/// `rigident schema`
#[derive(Args, Debug, Clone)]
#[command(after_help = "Examples:\n  rigident schema result\n  rigident schema rig > rig.schema.json")]
pub struct SchemaOf {
    /// Which file: a rig file, `result.json`, or a plan
    #[arg(value_name = "FILE", value_parser = clap::builder::PossibleValuesParser::new(rigident::schema::NAMES))]
    pub file: String,
}

/// Options of every command that gives an answer.
#[derive(Args, Debug, Clone, Default)]
pub struct Output {
    /// Print the result object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
    /// Folder for the files; must be new or empty. Default: a new folder here
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// What must be identified for exit status 0: any of m, mc, I, offset, or single names as Ixx; of several links their
    /// names, or single parameters as arm.MSx
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub estimate: Vec<String>,
    /// Write a certificate to print (A4) to this new file: part, equipment, results with k = 2, what they rest on. What [certificate]
    /// of the rig file does not state is listed, or asked for
    #[arg(long, value_name = "FILE.html")]
    pub certificate: Option<PathBuf>,
    /// State a key of [certificate], as number=2026-117; may be given several times
    #[arg(long, value_name = "KEY=VALUE", requires = "certificate")]
    pub certify: Vec<String>,
    /// The files that the answer rests on; those of the folder of its own where there are none.
    #[arg(skip)]
    pub evidence: Vec<PathBuf>,
}

/// `rigident demo`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Examples:\n  rigident demo\n  rigident demo --mcu qemu --json\n  rigident demo --body vertical --seed 7 --out \
                        answers/demo7\n  rigident demo --until m=0.05,Ixx=0.01 --estimate m,Ixx\n  rigident demo --adaptive --until-relative 0.01\n  rigident demo --forget 20\n  \
                        rigident demo --plan motion.json\n  rigident demo --mass 3 --com 0,10,50mm --noise 2 --explain\n\nSeveral links:\n  rigident demo --body two-links\n  rigident demo --body human34 \
                        --mcu qemu --duration-s 20"
)]
pub struct Demo {
    /// Where the firmware runs
    #[arg(long, value_enum, default_value_t)]
    pub mcu: Mcu,
    /// What is identified
    #[arg(long, value_enum, default_value_t)]
    pub body: Demonstrated,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub programme: Programme,
    /// Seed of noise and biases
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Noise, bias and bandwidth off; the converters still quantise
    #[arg(long)]
    pub ideal: bool,
    #[cfg(feature = "simulator")]
    #[command(flatten)]
    #[allow(missing_docs)]
    pub own: OwnBody,
    /// Say in ten steps how the readings become the answer, with the numbers of this run
    #[arg(long, conflicts_with = "json")]
    pub explain: bool,
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

/// What a demonstration identifies.
#[derive(clap::ValueEnum, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Demonstrated {
    /// The thesis' test body with plates, lying: centre of mass at 53 mm
    #[default]
    Horizontal,
    /// The same standing: centre of mass at 247 mm
    Vertical,
    /// An arm on a ball joint on that body, an IMU on each: 19 base parameters and the offset, 1 kHz
    TwoLinks,
    /// A person of 15 links and 34 degrees of freedom from frames, 100 a second: 128 base parameters
    #[value(name = "human34")]
    Human34,
}

/// `rigident replay`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Examples:\n  rigident replay bracket.mcap --mcu inproc\n  rigident replay poses.csv --rig poses.rig.toml --mcu qemu\n  \
                        rigident replay bracket.csv --mcu /dev/ttyACM0\n\nSeveral links:\n  rigident replay two_links.mcap --mcu qemu\n  rigident \
                        replay walk.csv --model human34 --height-m 1.65 --mass-kg 60"
)]
pub struct Replay {
    /// The recording, CSV or MCAP
    pub recording: PathBuf,
    /// inproc, qemu, or the port of a device
    #[arg(long, default_value = "inproc", value_name = "inproc|qemu|PORT")]
    pub mcu: String,
    /// Rig file. Default: NAME.rig.toml beside the recording
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub calibration: CalibrationOption,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub stop: StopCriterion,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub forgetting: Forgetting,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub tare: TareFiles,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub known: KnownQuantities,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub output: Output,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub tree: TreeModel,
}

/// `rigident identify`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Examples:\n  rigident identify bracket.csv\n  rigident identify poses.csv --rig poses.rig.toml --estimate m,mc,offset \
                        --json\n  rigident identify bracket.csv --tare fixture.csv\n  rigident identify \
                        bracket.csv --known mass_kg=20.013±0.005 --symmetry y±0.002\n  rigident identify turn.rig.toml\n  rigident identify \
                        recordings/ --rig turn.rig.toml\n  rigident identify tank.mcap --forget 30\n\nTrees of links:\n  rigident identify two_links.csv\n  rigident identify \
                        arm.csv --model arm.urdf --friction viscous,coulomb,offset --write-model identified.urdf\n  rigident identify \
                        walk.csv --model human34 --height-m 1.65 --mass-kg 60 --symmetric-sides"
)]
pub struct Identify {
    /// The recording, CSV or MCAP; of several files with clocks of their own the rig file that lists them, or their
    /// folder
    pub recording: PathBuf,
    /// Rig file. Default: NAME.rig.toml beside the recording
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub calibration: CalibrationOption,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub forgetting: Forgetting,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub tare: TareFiles,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub known: KnownQuantities,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub output: Output,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub tree: TreeOptions,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub payload: PayloadOptions,
}

/// `rigident run`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Examples:\n  rigident run --port /dev/ttyACM0 --rig bracket.rig.toml --platform tcp://192.168.1.20:7447\n  \
                        rigident run --port ./rigident-rig --rig rig.rig.toml --platform tcp://127.0.0.1:7447 --duration-s 30 --yes\n  \
                        rigident run --port /dev/ttyACM0 --rig bracket.rig.toml --platform 'gcs://192.168.0.1:50000?rate_hz=100'\n  \
                        rigident run --port /dev/ttyACM0 --rig bracket.rig.toml --platform tcp://192.168.1.20:7447 --adaptive\n  \
                        rigident run --port /dev/ttyACM0 --rig bracket.rig.toml --platform 'pose+udp://192.168.1.30:5000' --plan motion.json\n  \
                        rigident run --port /dev/ttyACM0 --rig bracket.rig.toml --platform none --until m=0.02\n\n\
                        A rig file of two [[link]] with an [[imu]] each makes it a run of two links: initial_wxyz of the second says how \
                        it hangs at the start. `rigident-sim serve --body two-links --write-rig rig.rig.toml` is such a rig.\n\n\
                        Ctrl-C stops the platform, sees it at rest, and keeps what was recorded."
)]
pub struct Run {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub device: PortOption,
    /// The platform's controller
    ///
    /// tcp://HOST:PORT: as `rigident-sim serve` offers it. gcs://HOST:PORT or gcs:///dev/ttyUSB0: a PI hexapod (GCS 2.0).
    /// pose+tcp://HOST:PORT, pose+udp://…, pose+serial:///dev/…, legs+…: CSV lines of poses or leg lengths; the plate must
    /// stand at home when it begins, and is led back there after the experiment. none: the body is moved by hand, or by anything
    /// else; the next move is told, and Ctrl-C ends. Behind it
    /// ?rate_hz=100, &lead_s=0.2 (set points are sent so long before their time) and &baud=115200 where they apply
    #[arg(long, value_name = "ADDRESS")]
    pub platform: String,
    /// Move without asking: the limits were checked, and nobody stands in the platform's way
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

/// `rigident live`
#[derive(Args, Debug, Clone)]
#[command(after_help = "Sources:\n  \
                  ati+udp://HOST[?cpf=…&cpt=…]   ATI Net F/T, Axia, Schunk: wrench\n  \
                  rtde://HOST                    Universal Robots e-Series: wrench, and with it as --imu accelerometer and turns\n  \
                  ws://HOST[:8765]?topic=/…      a ROS 2 topic by foxglove_bridge: WrenchStamped, Imu, PoseStamped\n  \
                  xsens://DEVICE[?baud=…]        Xsens MTi: IMU\n  \
                  serial:DEVICE, udp://HOST:PORT, -   lines of CSV with a header, or ?columns=t_s,fx_n,…\n\n\
                  Examples:\n  \
                  rigident live --wrench ati+udp://192.168.1.1 --imu xsens:///dev/ttyUSB0 --rig hand.rig.toml\n  \
                  rigident live --wrench rtde://192.168.0.9 --imu rtde://192.168.0.9 --rig ur5e.rig.toml --until m=0.02\n  \
                  rigident live --wrench 'ws://robot?topic=/ft/wrench' --imu 'ws://robot?topic=/imu/data'\n  \
                  ./logger | rigident live --wrench - --imu -\n\n\
                  Ctrl-C ends it and keeps everything; what each device is to be set to stands in docs/live.md.")]
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

impl Arguments {
    /// Returns what a bare `rigident` does.
    #[cfg(feature = "simulator")]
    pub(super) fn default_demo() -> Demo {
        match Self::parse_from(["rigident", "demo"]).command {
            Some(Command::Demo(demo)) => demo,
            _ => unreachable!("the words above are the demonstration"),
        }
    }
}

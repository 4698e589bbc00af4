use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use crate::commands::factor::arguments::TareFiles;
use crate::commands::run::programme::Programme;
use crate::options::calibration::CalibrationOption;
use crate::options::known_values::KnownQuantities;
use crate::options::trees::ModelChanges;
use rigident::joint_offsets::search::Method;

/// `rigident calibrate`
#[derive(Args, Debug, Clone)]
pub struct Calibrate {
    /// What is calibrated
    #[command(subcommand)]
    pub what: CalibrateWhat,
}

/// What can be calibrated.
#[derive(Subcommand, Debug, Clone)]
pub enum CalibrateWhat {
    /// Find the errors of a rig's sensors and of their mounting from runs with a body of known properties
    Rig(CalibrateRig),
    /// Find scales, misalignments and biases of the IMU from the motion that the platform was driven through
    Imu(CalibrateImu),
    /// Find the 6 x 6 matrix of a load cell with bridge outputs from known weights at known places
    LoadCell(CalibrateLoadCell),
    /// Find offsets of a robot's joint angles from poses with flat soles on a level floor
    Joints(CalibrateJoints),
    /// Find the gains of a robot's drives from recordings of motor currents, with and without a load that is
    /// known
    Drives(CalibrateDrives),
    /// Find masses and centres of mass of a robot's links, relative to its model, from motions that excite
    /// them poorly
    Masses(CalibrateMasses),
}

/// `rigident calibrate drives`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Efforts are currents, or anything proportional to the torque: columns JOINT_a, or what \
                  [[joint]] effort of the rig file names. Efforts alone tell the ratios of gains; \
                  how large they are is given by a load that is known (--loaded, --payload, --known), or by \
                  the model's masses as far as they are trusted (--nominal-sigma). A wrist sensor weighs the \
                  load: what it says goes to --known.\n\nExit status 0 if every gain is identified, 1 if \
                  not, 2 if a file cannot be used.\n\nExamples:\n  rigident calibrate drives arm.urdf \
                  bare.csv --loaded loaded.csv --payload tool0 --known mass_kg=3.002±0.001 -o \
                  gains.rig.toml\n  rigident calibrate drives arm.urdf bare.csv --nominal-sigma 0.1\n  \
                  rigident identify part.csv --model arm.urdf --rig gains.rig.toml --tare bare.csv --payload \
                  tool0"
)]
pub struct CalibrateDrives {
    /// The robot with its nominal masses: URDF, MJCF or SDF
    #[arg(value_name = "MODEL")]
    pub model: String,
    /// Recordings without a load, CSV or MCAP
    #[arg(required = true, value_name = "REC")]
    pub recordings: Vec<PathBuf>,
    /// A recording with a load that is known
    #[arg(long, value_name = "REC", requires = "payload")]
    pub loaded: Option<PathBuf>,
    /// The link that carries it; its frame in the link's in m and degrees
    #[arg(
        long,
        value_name = "LINK[@x,y,z[,roll,pitch,yaw]]",
        allow_hyphen_values = true,
        requires = "loaded"
    )]
    pub payload: Option<String>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub known: KnownQuantities,
    /// 1 σ that the nominal model's links are trusted with, relative, where there is no load
    #[arg(long, value_name = "SHARE", conflicts_with = "loaded")]
    pub nominal_sigma: Option<f64>,
    /// Rig file of all recordings. Default: NAME.rig.toml beside each
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// Friction columns of every joint, or of one, as in `rigident identify`. Repeatable
    #[arg(long, value_name = "[JOINT=]LIST", default_value = "viscous,coulomb,offset,rotor")]
    pub friction: Vec<String>,
    /// A drive that turns with several joints, as in `rigident identify`. Repeatable
    #[arg(long, value_name = "NAME=JOINT+JOINT")]
    pub drive: Vec<String>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub changes: ModelChanges,
    /// Write a rig file with the gains that are identified; must not exist
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// How `rigident calibrate masses` solves.
#[derive(ValueEnum, Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum MassMethod {
    /// The one that predicts best what it has not seen, of those whose bodies all can be
    #[default]
    Best,
    /// Singular values above a share of the largest
    Truncated,
    /// Conjugate gradients with masses above their bound, stopped early
    Gradient,
    /// Least squares with masses above their bound
    Bounded,
    /// Least squares beside the nominal model
    Ridge,
    /// Bodies that can be, nearest to the nominal model, all ten parameters free
    Consistent,
}

/// Whether something that nothing measures pulls at the base.
#[derive(ValueEnum, Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum ExternalWrench {
    /// It is looked for, and eliminated where it is found
    #[default]
    Auto,
    /// It is eliminated
    Unknown,
    /// There is none
    None,
}

/// `rigident calibrate masses`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "The robot stands, walks, falls: the rig file's [[foot]] tables say where its feet measure \
                  the ground's wrench. Joint torques and                   feet that are not measured are \
                  eliminated. Without [[foot]] tables its base is held still, or its wrench is \
                  measured.\n\nRows                   tell combinations of masses; every way takes what they \
                  leave open from the model. One recording is split in parts, of several \
                  each                   is one: the settings are those that predict best what was left \
                  out.\n\nGains of torques, friction, rotors, pulls and feet without a sensor are \
                  looked for and eliminated.\n\nExit status 0, 1 if the nominal masses stay or a torque \
                  contradicts the model, 2 if a file cannot be used.\n\nExamples:\n  rigident calibrate \
                  masses robot.urdf walk.csv\n  rigident calibrate masses robot.urdf walk.csv squat.csv \
                  --symmetric-sides --write-model identified.urdf\n  rigident validate identified.urdf \
                  other.csv --model robot.urdf"
)]
pub struct CalibrateMasses {
    /// The robot with its nominal masses: URDF, MJCF or SDF
    #[arg(value_name = "MODEL")]
    pub model: String,
    /// Recordings of joints, base and feet, CSV or MCAP
    #[arg(required = true, value_name = "REC")]
    pub recordings: Vec<PathBuf>,
    /// Rig file of all recordings. Default: NAME.rig.toml beside each
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// Parts of a single recording, each left out once
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u8).range(1..=64))]
    pub parts: u8,
    /// All ten parameters of each link are unknown, instead of mass and centre of mass with the tensor about
    /// its origin as in the model
    #[arg(long)]
    pub all_parameters: bool,
    /// Links of the right side change as those of the left do, mirrored about y = 0 of the base's frame
    #[arg(long)]
    pub symmetric_sides: bool,
    /// No mass goes below this share of the nominal one
    #[arg(long, value_name = "SHARE", default_value_t = 0.1)]
    pub least_mass: f64,
    /// How the parameters that are written are found
    #[arg(long, value_enum, value_name = "METHOD", default_value_t)]
    pub method: MassMethod,
    /// Condition number of --method truncated. Default: the one that predicts best what it has not seen
    #[arg(long, value_name = "NUMBER")]
    pub condition: Option<f64>,
    /// Steps of --method gradient. Default: as above
    #[arg(long, value_name = "N")]
    pub steps: Option<u32>,
    /// Weight of the nominal model in --method ridge. Default: as above
    #[arg(long, value_name = "NUMBER")]
    pub weight: Option<f64>,
    /// 1 σ that the nominal model is trusted with in --method consistent, relative. Default: as above
    #[arg(long, value_name = "SHARE")]
    pub nominal_sigma: Option<f64>,
    /// Friction columns of every joint, or of one, as in `rigident identify`. Repeatable
    #[arg(long, value_name = "[JOINT=]LIST")]
    pub friction: Vec<String>,
    /// A constant wrench on the base beside the ground's: a hose, a cable, a rope
    #[arg(long, value_enum, value_name = "WHETHER", default_value_t)]
    pub external_wrench: ExternalWrench,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub changes: ModelChanges,
    /// Write the model with what was found: .urdf, .xml (MJCF) or .sdf
    #[arg(long, value_name = "FILE")]
    pub write_model: Option<PathBuf>,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// How `rigident calibrate joints` searches.
#[derive(ValueEnum, Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum SearchMethod {
    /// Steps of Gauss and Newton, the base of each pose eliminated
    #[default]
    GaussNewton,
    /// Nonlinear conjugate gradient
    ConjugateGradient,
}

impl From<SearchMethod> for Method {
    fn from(method: SearchMethod) -> Self {
        match method {
            SearchMethod::GaussNewton => Self::GaussNewton,
            SearchMethod::ConjugateGradient => Self::ConjugateGradient,
        }
    }
}

/// `rigident calibrate joints`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "The robot stands still with flat soles on a level floor, again and again in another pose. \
                  Each row of POSES has the joints' positions as measured (left_knee_rad) and the attitude \
                  of at least one link by an IMU (pelvis_qw, pelvis_qx, pelvis_qy, pelvis_qz); a column \
                  contact names the contacts that are made, if not all are. Hands may touch walls, and links \
                  may be held: [[plane]] and [[fixed]] in the file of contacts. True position = measured + \
                  offset.\n\nExit status 0 if every offset asked for is identified, 1 if not, 2 if a file \
                  cannot be used.\n\nExamples:\n  rigident calibrate joints robot.urdf poses.csv --contacts \
                  soles.toml\n  rigident calibrate joints robot.urdf poses.csv --contacts soles.toml \
                  --joints left_knee,right_knee -o joints.rig.toml --write-model calibrated.urdf\n  rigident \
                  calibrate joints robot.urdf poses.csv --contacts soles.toml --yaw-noise-deg 180 --report \
                  joints.html"
)]
pub struct CalibrateJoints {
    /// The robot: URDF, MJCF or SDF
    #[arg(value_name = "MODEL")]
    pub model: String,
    /// The poses, CSV
    #[arg(value_name = "POSES")]
    pub poses: PathBuf,
    /// The soles and their corners, planes and held links, TOML
    #[arg(long, value_name = "FILE")]
    pub contacts: PathBuf,
    /// Joints whose offsets are found. Default: all between the base and the contacts
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub joints: Vec<String>,
    /// 1 sigma of a measured attitude about any level axis, degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.2)]
    pub attitude_noise_deg: f64,
    /// 1 sigma of its heading, degrees; from 30 on headings say nothing, as without a magnetometer. Default:
    /// as of the others
    #[arg(long, value_name = "DEG")]
    pub yaw_noise_deg: Option<f64>,
    /// 1 sigma of a corner's distance from its plane, and of a held point's from its place, mm
    #[arg(long, value_name = "MM", default_value_t = 1.0)]
    pub height_noise_mm: f64,
    /// 1 sigma of the floor's slope about any level axis, degrees; 0 if it is level
    #[arg(long, value_name = "DEG", default_value_t = 0.1)]
    pub floor_noise_deg: f64,
    /// 1 sigma of a measured joint angle in each pose, degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.05)]
    pub encoder_noise_deg: f64,
    /// 1 sigma of the measured position of a joint that slides, in each pose, mm
    #[arg(long, value_name = "MM", default_value_t = 0.5)]
    pub encoder_noise_mm: f64,
    /// 1 sigma of the constant error of each IMU's mounting about any axis, degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.0)]
    pub mounting_noise_deg: f64,
    /// An offset with a larger U95 counts as not identified, degrees
    #[arg(long, value_name = "DEG", default_value_t = 2.0)]
    pub coarsest_u95_deg: f64,
    /// The same of a joint that slides, mm
    #[arg(long, value_name = "MM", default_value_t = 10.0)]
    pub coarsest_u95_mm: f64,
    /// How the offsets are searched for
    #[arg(long, value_enum, value_name = "METHOD", default_value_t)]
    pub method: SearchMethod,
    /// Write the offsets as [[joint]] tables of a rig file; must not exist
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Write a page with the offsets and with poses before and after; must not exist
    #[arg(long, value_name = "FILE.html")]
    pub report: Option<PathBuf>,
    /// Write the model with the zeros of its joints corrected: .urdf, .xml (MJCF) or .sdf
    #[arg(long, value_name = "FILE")]
    pub write_model: Option<PathBuf>,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// `rigident calibrate imu`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "The platform is the measure: what it was driven through is compared with what the IMU \
                  read. Turns about all axes calibrate the gyro, turns and tilts the accelerometer. The \
                  options of the programme are those of the run.\n\nExamples:\n  rigident run --port \
                  /dev/ttyACM0 --rig lab.rig.toml --platform gcs://10.0.0.5:50000 --plan motion.json --out \
                  turns\n  rigident calibrate imu turns/run.mcap --plan motion.json"
)]
pub struct CalibrateImu {
    /// The recording of the run
    #[arg(value_name = "REC")]
    pub recording: PathBuf,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub programme: Programme,
    /// Rig file. Default: NAME.rig.toml beside the recording
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// `rigident calibrate load-cell`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Each row of LOADS is a loading: mass_kg at x_m, y_m, z_m in the cell's frame S (0 for a \
                  zero), down_x, down_y, down_z where gravity points (0, 0, -1 if not there), and the mean \
                  voltages g1_v to g6_v, or from_s and to_s of a recording. fx_n to mz_nm instead of a mass: \
                  a machine's wrench on the body. weight names a weight whose error several loadings share, \
                  run loadings that share their zero. Cell upright: fz, mx, my. On its side, twice: fx, fy, \
                  mz.\n\nExit status 0 if the matrix is known to 10 % of full scale, 1 if not, 2 if a table \
                  cannot be used or a loading contradicts the others.\n\nExamples:\n  rigident calibrate \
                  load-cell weights.csv -o load-cell.rig.toml\n  rigident calibrate load-cell weights.csv \
                  --recording bench.csv --mass-noise-percent 0.01 --place-noise-mm 0.1"
)]
pub struct CalibrateLoadCell {
    /// The loadings, CSV
    #[arg(value_name = "LOADS")]
    pub loads: PathBuf,
    /// The recording that from_s and to_s are of
    #[arg(long, value_name = "REC")]
    pub recording: Option<PathBuf>,
    /// 1 sigma of each weight, percent
    #[arg(long, value_name = "PERCENT", default_value_t = 0.05)]
    pub mass_noise_percent: f64,
    /// 1 sigma of each place along each axis, mm
    #[arg(long, value_name = "MM", default_value_t = 0.3)]
    pub place_noise_mm: f64,
    /// 1 sigma of the direction of gravity each time that the cell is turned, degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.2)]
    pub level_noise_deg: f64,
    /// 1 sigma of a mean reading, V. Default: as the loadings scatter
    #[arg(long, value_name = "V")]
    pub reading_noise_v: Option<f64>,
    /// Gravity where the weights hang, m/s2
    #[arg(long, value_name = "G", default_value_t = 9.80665)]
    pub gravity_mps2: f64,
    /// Number of the board that read the gauges, unique_id of `rigident info`: the rig file keeps it, and
    /// another board is warned of
    #[arg(long, value_name = "ID")]
    pub board_id: Option<String>,
    /// Write the keys of the rig file; must not exist
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// Recordings of a reference body.
#[derive(Args, Debug, Clone)]
pub struct ReferenceRuns {
    /// Recordings of the reference body, CSV or MCAP
    #[arg(required = true, value_name = "REC")]
    pub recordings: Vec<PathBuf>,
    /// File of the reference body
    #[arg(long, value_name = "FILE")]
    pub reference: PathBuf,
    /// How the body was mounted in each recording, in their order: names of its [[mounting]] tables, or
    /// place. One name is for all of them. Default: its [place]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub mounting: Vec<String>,
    /// Rig file of all recordings. Default: NAME.rig.toml beside each
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub tare: TareFiles,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// `rigident calibrate rig`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "The body, its uncertainties and the data-sheet errors of the rig are one joint solution \
                  over all recordings; offsets, drift and biases are each recording's own. A recording that \
                  is not one of the reference is refused, and nothing is saved.\n\nThe rig file takes the \
                  result by\n  [calibration]\n  file = \"lab.calibration.toml\"\n\nExamples:\n  rigident \
                  calibrate rig cylinder.mcap --reference cylinder.toml --rig lab.rig.toml -o \
                  lab.calibration.toml\n  rigident calibrate rig upright.mcap lying.mcap --reference \
                  cylinder.toml --mounting place,lying -o lab.calibration.toml"
)]
pub struct CalibrateRig {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub runs: ReferenceRuns,
    /// The calibration to write; must not exist
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Days that it is valid for
    #[arg(long, value_name = "DAYS", default_value_t = rigident_io::rig::calibration::VALID_DAYS)]
    pub valid_days: u32,
}

/// `rigident verify`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "E_n = (measured - reference) / sqrt(U95^2 + U95 of the reference^2); a quantity by itself \
                  passes where |E_n| is at most 1 (ISO/IEC 17043). The recording passes where the largest of \
                  ten is at most 1.68, as it is in 99 % of those of the reference itself. Exit status 0 if \
                  every quantity of every recording passes, 1 if not.\n\nExamples:\n  rigident verify \
                  cylinder.mcap --reference cylinder.toml --rig lab.rig.toml\n  rigident verify lying.mcap \
                  --reference cylinder.toml --mounting lying --calibration lab.calibration.toml --json"
)]
pub struct Verify {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub runs: ReferenceRuns,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub calibration: CalibrationOption,
}

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use crate::options::test_body::DemoBody;
use crate::options::trees::{ModelOptions, RowsWord};
use rigident::plan::machine::RESERVE;

/// `rigident plan`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Examples:\n  rigident plan poses --n 5 --out poses.json\n  rigident plan motion --out \
                        motion.json\n  rigident plan compare\n  rigident plan excitation robot.urdf -o \
                        trajectory.csv\n  rigident demo --plan motion.json"
)]
pub struct Plan {
    /// What is planned
    #[command(subcommand)]
    pub what: Planned,
}

/// What can be planned.
#[derive(Subcommand, Debug, Clone)]
pub enum Planned {
    /// Still poses that tell the centre of mass best
    Poses(PlanPoses),
    /// A motion that tells the most, inside all limits at every instant
    Motion(PlanMotion),
    /// The motions of every objective side by side, for the thesis' test body in both mountings
    Compare(PlanCompare),
    /// A trajectory for the joints of an arm or a humanoid that tells most of its links
    Excitation(Box<PlanExcitation>),
}

/// `rigident plan poses`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "The condition number is the 2-norm one: of the stacked [F] in the thesis' equation M = [F] \
                        r, and of the normal matrix [F]ᵀ[F], its square.\n\nExamples:\n  rigident plan poses \
                        --n 5\n  rigident plan poses --n 4 --stroke-m 0.20 --json\n  rigident plan poses \
                        --rig bracket.rig.toml --n 6 --objective worst-uncertainty --out poses.json\n  \
                        rigident plan poses --angles \"28.9,16; -29.1,15.5; 1.7,-31.9\" --stroke-m 0.20"
)]
pub struct PlanPoses {
    /// Number of poses
    #[arg(long, value_name = "K", required_unless_present = "angles")]
    pub n: Option<usize>,
    /// Judge these poses instead of looking for the best: roll and pitch, degrees, by semicolons
    #[arg(
        long,
        value_name = "R,P;R,P;…",
        value_parser = angles,
        allow_hyphen_values = true,
        conflicts_with_all = ["n", "objective", "margin"]
    )]
    pub angles: Option<Angles>,
    /// Rig file with a [platform]. Default: the built-in platform of the thesis
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// Use only so much of the legs' stroke, about its middle, m
    #[arg(long, value_name = "S")]
    pub stroke_m: Option<f64>,
    /// How far the poses stay away from every limit: a share of half the stroke, of cond_max, joint angles
    /// and forces
    #[arg(long, value_name = "SHARE", default_value_t = 0.01)]
    pub margin: f64,
    /// What is made best
    #[arg(long, value_enum, default_value_t)]
    pub objective: PoseObjective,
    /// Write a plan for `rigident demo --plan` and `rigident run --plan` here, JSON; must not exist
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// How long the plan that --out writes holds each pose, s
    #[arg(long, value_name = "S", default_value_t = 3.0)]
    pub hold_s: f64,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// Rolls and pitches, degrees.
#[derive(Debug, Clone, PartialEq)]
pub struct Angles(pub Vec<[f64; 2]>);

fn angles(text: &str) -> Result<Angles, String> {
    let pair = |pair: &str| {
        let numbers: Vec<f64> = pair.split(',').filter_map(|number| number.trim().parse().ok()).collect();
        <[f64; 2]>::try_from(numbers)
            .map_err(|_| format!("`{}` is no roll and pitch, as in `28.5,-14.5; -29.1,15.5`", pair.trim()))
    };
    text.split(';').filter(|pair| !pair.trim().is_empty()).map(pair).collect::<Result<_, _>>().map(Angles)
}

/// What still poses can be best at.
#[derive(ValueEnum, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PoseObjective {
    /// The least condition number of the normal matrix
    #[default]
    Condition,
    /// The largest determinant of the normal matrix (D-optimality)
    Determinant,
    /// The least worst uncertainty of the first moment, offsets unknown, with the rig's noise; 3 poses at
    /// least
    WorstUncertainty,
}

/// `rigident statics`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Beside each other: the platform thesis' estimator from measured forces, the same relative \
                        to a reference pose, and gravity from the attitude with six offsets, which is what \
                        `rigident identify` does; then the wrench of each pose less that of the \
                        body.\n\nExamples:\n  rigident plan poses --n 5 --out poses.json\n  rigident demo \
                        --plan poses.json --estimate m,mc --out day1\n  rigident statics day1/demo.mcap"
)]
pub struct Statics {
    /// Recording with still poses: CSV or MCAP
    #[arg(value_name = "RECORDING")]
    pub recording: PathBuf,
    /// Rig file. Default: NAME.rig.toml beside the recording
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// Pose that the relative estimator takes the others from
    #[arg(long, value_name = "K", default_value_t = 1)]
    pub reference: usize,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// `rigident workspace`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "For every roll and pitch: is there a position of the plate with all legs and joints inside \
                        their limits, and one where cond(H), metres, is below the guard too, no singular \
                        pose lying between it and home? With --json nothing is written unless --out is \
                        given.\n\nExamples:\n  rigident workspace\n  rigident workspace --stroke-m 0.20 \
                        --yaw-deg 30\n  rigident workspace --rig bracket.rig.toml --json"
)]
pub struct Workspace {
    /// Rig file with a [platform]. Default: the built-in platform of the thesis
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// Use only so much of the legs' stroke, about its middle, m
    #[arg(long, value_name = "S")]
    pub stroke_m: Option<f64>,
    /// Yaw of every orientation, °
    #[arg(long, value_name = "Y", default_value_t = 0.0, allow_negative_numbers = true)]
    pub yaw_deg: f64,
    /// Between neighbouring orientations, °
    #[arg(long, value_name = "D", default_value_t = 1.0)]
    pub step_deg: f64,
    /// Roll and pitch from minus this to this, °
    #[arg(long, value_name = "D", default_value_t = 90.0)]
    pub range_deg: f64,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
    /// Draw the still poses of this plan on the map, as `rigident plan poses --out` wrote it for this rig
    #[arg(long, value_name = "FILE")]
    pub plan: Option<PathBuf>,
    /// Folder for picture and object; must be new or empty. Default: a new folder here
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// `rigident plan motion`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Limits are those of the rig's [platform], and 0.9 of the gyro's range; they are kept at \
                        every instant, not only at samples. Ctrl-C keeps the best motion so \
                        far.\n\nExamples:\n  rigident plan motion\n  rigident plan motion --objective \
                        spheres --body vertical --json\n  rigident plan motion --duration-s 40 --stroke-m \
                        0.20 --out motion.json\n  rigident demo --plan motion.json"
)]
pub struct PlanMotion {
    /// Rig file with a [platform]. Default: the built-in platform of the thesis
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// What the motion is made for
    #[arg(long, value_enum, default_value_t)]
    pub objective: MotionObjective,
    /// Length of the whole experiment, s
    #[arg(long, default_value_t = 60.0, value_name = "S")]
    pub duration_s: f64,
    /// The thesis' test body with plates, in either of its mountings: what the legs carry and what is
    /// predicted. Default: any body of the rig file's load_max_kg and load_within_m, else horizontal
    #[arg(long, value_enum)]
    pub body: Option<DemoBody>,
    /// The motion alone, without the static step
    #[arg(long)]
    pub no_poses: bool,
    /// Highest frequency of a D-optimal motion, Hz. Default: 2.35
    #[arg(long, value_name = "HZ")]
    pub highest_hz: Option<f64>,
    /// Leave this share of the legs' stroke, or of the plate's travel, unused, half of it at either end:
    /// joints are known to half a millimetre, and controllers overshoot. Without effect beside --stroke-m
    #[arg(long, value_name = "SHARE", default_value_t = RESERVE)]
    pub reserve: f64,
    /// Use only so much of the legs' stroke, about its middle, m
    #[arg(long, value_name = "S")]
    pub stroke_m: Option<f64>,
    /// Write a plan for `rigident demo --plan` and `rigident run --plan` here, JSON; must not exist
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Draw the directions of angular rate and acceleration on their spheres here, SVG; must not exist
    #[arg(long, value_name = "FILE")]
    pub plot: Option<PathBuf>,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// What a motion can be made for.
#[derive(ValueEnum, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MotionObjective {
    /// The largest determinant of the information on all ten parameters, offsets unknown
    #[default]
    DOptimal,
    /// The thesis' spheres: turns about every axis while the centre of mass stays still
    Spheres,
    /// Roll, pitch and yaw, one frequency each
    Rpy,
    /// The default experiment's multisine
    Multisine,
}

/// `rigident plan compare`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Predicted 95 % uncertainties from the factor that the pipeline makes of each experiment, \
                        static step included, offsets unknown.\n\nExamples:\n  rigident plan compare\n  \
                        rigident plan compare --stroke-m 0.20 --duration-s 40 --json"
)]
pub struct PlanCompare {
    /// Rig file with a [platform]. Default: the built-in platform of the thesis
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// Length of each experiment, s
    #[arg(long, default_value_t = 60.0, value_name = "S")]
    pub duration_s: f64,
    /// Use only so much of the legs' stroke, about its middle, m
    #[arg(long, value_name = "S")]
    pub stroke_m: Option<f64>,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// `rigident plan excitation`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "The base is held still, with gravity along -z of its frame; of a humanoid that hangs, make \
                        the link that is held the base. Limits are those of the model; what it does not \
                        state is asked for. Ctrl-C keeps the best trajectory so far.\n\nExamples:\n  \
                        rigident plan excitation ur5.urdf -o trajectory.csv -o trajectory.yaml\n  rigident \
                        plan excitation panda.urdf --lock panda_finger_joint1,panda_finger_joint2 --friction \
                        viscous,coulomb --floor-m 0\n  rigident plan excitation g1.urdf --joints \
                        left_shoulder_pitch_joint,left_elbow_joint --speed 5 --boxes boxes.toml --json\n  \
                        ros2 topic pub -1 /arm_controller/joint_trajectory \
                        trajectory_msgs/msg/JointTrajectory \"$(cat trajectory.yaml)\"\n  rigident identify \
                        recorded.csv --model ur5.urdf"
)]
pub struct PlanExcitation {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub model: ModelOptions,
    /// Only these joints move; the others are held at their start
    #[arg(long, value_name = "JOINT", value_delimiter = ',')]
    pub joints: Vec<String>,
    /// Where a joint starts and ends, rad or m. Default: zero, or the nearest that is a fifth of its range
    /// from its ends
    #[arg(long, value_name = "JOINT=VALUE", value_delimiter = ',')]
    pub start: Vec<String>,
    /// Length, s; the fundamental is one over it
    #[arg(long, default_value_t = 10.0, value_name = "S")]
    pub duration_s: f64,
    /// Highest harmonic, Hz
    #[arg(long, default_value_t = 1.0, value_name = "HZ")]
    pub bandwidth_hz: f64,
    /// Rate of the CSV, and of the readings that are predicted for, 1/s
    #[arg(long, default_value_t = 200.0, value_name = "HZ")]
    pub rate_hz: f64,
    /// Rate of the points of a JointTrajectory, 1/s. Default: 20 in the shortest period
    #[arg(long, value_name = "HZ")]
    pub points_hz: Option<f64>,
    /// Which rows will be measured. Default: joint
    #[arg(long, value_enum)]
    pub rows: Option<RowsWord>,
    /// Friction columns of every joint, or of one, as `identify` has them. Repeatable
    #[arg(long, value_name = "[JOINT=]LIST")]
    pub friction: Vec<String>,
    /// 1 σ of a reading of a joint's effort, N m or N. Default: a hundredth of its largest effort. Repeatable
    #[arg(long, value_name = "[JOINT=]SIGMA")]
    pub effort_noise: Vec<String>,
    /// 1 σ of a reading of the base's force, N, and moment, N m
    #[arg(long, default_value = "1,0.1", value_name = "N,NM")]
    pub wrench_noise: String,
    /// Positions of a joint, rad or m, instead of the model's; without JOINT= of every joint, no wider than
    /// the model's. Repeatable
    #[arg(long, value_name = "[JOINT=]LOW,HIGH", allow_hyphen_values = true)]
    pub range: Vec<String>,
    /// Largest rate, rad/s or m/s, likewise. Repeatable
    #[arg(long, value_name = "[JOINT=]MOST")]
    pub speed: Vec<String>,
    /// Largest effort, N m or N, likewise. Repeatable
    #[arg(long, value_name = "[JOINT=]MOST")]
    pub effort: Vec<String>,
    /// Largest acceleration, rad/s² or m/s², likewise, of which the share of rates is used; without it as
    /// efforts allow. Repeatable
    #[arg(long, value_name = "[JOINT=]MOST")]
    pub acceleration: Vec<String>,
    /// Rotor inertia as a joint feels it, kg m² or kg, instead of the model's: efforts need it. Repeatable
    #[arg(long, value_name = "[JOINT=]INERTIA")]
    pub rotor: Vec<String>,
    /// Viscous friction of a joint, N m s or N s/m, likewise. Repeatable
    #[arg(long, value_name = "[JOINT=]FRICTION")]
    pub viscous: Vec<String>,
    /// Dry friction of a joint, N m or N, likewise. Repeatable
    #[arg(long, value_name = "[JOINT=]FRICTION")]
    pub coulomb: Vec<String>,
    /// Joints of --lock that the controller holds: they are in the JointTrajectory, too
    #[arg(long, value_name = "JOINT", value_delimiter = ',')]
    pub hold: Vec<String>,
    /// Share of each range, about its middle, that is used
    #[arg(long, default_value_t = 0.95, value_name = "SHARE")]
    pub range_share: f64,
    /// Share of each largest rate that is used
    #[arg(long, default_value_t = 0.9, value_name = "SHARE")]
    pub speed_share: f64,
    /// Share of each largest effort that the nominal model may need; the rest is for what it does not know
    #[arg(long, default_value_t = 0.8, value_name = "SHARE")]
    pub effort_share: f64,
    /// Boxes round links, TOML. Default: those of the model's shapes, else about its joints
    #[arg(long, value_name = "FILE")]
    pub boxes: Option<PathBuf>,
    /// Half the thickness of boxes about joints, m. Default: a twentieth of the robot's reach
    #[arg(long, value_name = "M")]
    pub box_radius_m: Option<f64>,
    /// Least distance between boxes, and from the floor, m
    #[arg(long, default_value_t = 0.01, value_name = "M")]
    pub clearance_m: f64,
    /// Height of a floor along z of the base's frame, m. Default: none
    #[arg(long, value_name = "M")]
    pub floor_m: Option<f64>,
    /// Do not look at collisions
    #[arg(long, conflicts_with_all = ["boxes", "box_radius_m", "floor_m"])]
    pub no_collisions: bool,
    /// Seed of the random beginnings
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub seed: u64,
    /// Random beginnings of the search
    #[arg(long, default_value_t = 4, value_name = "N")]
    pub restarts: usize,
    /// File to write, by its ending: .csv or .yaml (trajectory_msgs/msg/JointTrajectory). Repeatable; must
    /// not exist
    #[arg(long, short = 'o', value_name = "FILE")]
    pub out: Vec<PathBuf>,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

use clap::{Args, Subcommand};

use crate::Failure;
use rigident::application::{Changes, Tree};
use rigident_model::human::{Person, Sex};

/// `rigident model`
#[derive(Args, Debug, Clone)]
pub struct ModelCommand {
    /// What to do
    #[command(subcommand)]
    pub verb: ModelVerb,
}

/// What can be asked of a model.
#[derive(Subcommand, Debug, Clone)]
pub enum ModelVerb {
    /// Count and name the base parameters, and say what each is made of
    BaseParams(BaseParams),
    /// Look for inertias that no body has, and for ones that are in another frame, unit or place than they
    /// should be
    Check(ModelCheck),
    /// Write a model in which inertias that no body has are the nearest ones that a body can have
    Repair(ModelRepair),
}

/// `rigident model repair`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Mass and centre of mass stay as they are. A file of the same kind is kept but for these \
                        inertias. Exit status 0 if all are possible now, 1 if one cannot be repaired (no \
                        mass, or a negative one), 2 if the model cannot be read.\n\nExamples:\n  rigident \
                        model repair robot.urdf --write repaired.urdf\n  rigident model repair robot.xml \
                        --write repaired.urdf --json"
)]
pub struct ModelRepair {
    /// The tree: a URDF, MJCF (.xml, .mjcf) or SDF
    pub model: std::path::PathBuf,
    /// The file to write: .urdf, .xml (MJCF) or .sdf; must not exist. Not written if nothing is to be
    /// repaired
    #[arg(long, value_name = "FILE")]
    pub write: std::path::PathBuf,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// `rigident model check`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Exit status 0 if nothing was found, 1 if something was, 2 if the model cannot be read as a \
                        tree.\n\nExamples:\n  rigident model check robot.urdf\n  rigident model check \
                        robot.xml --json\n  rigident model check robot.sdf"
)]
pub struct ModelCheck {
    /// The tree: human34, human58, a rig file (.toml), a URDF, MJCF (.xml, .mjcf) or SDF
    pub model: String,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// Which tree a recording is of.
#[derive(Args, Debug, Clone)]
#[command(next_help_heading = "Trees of links")]
pub struct TreeModel {
    /// The tree: human34, human58, a URDF, MJCF or SDF. Default: the [[link]] tables of the rig file, if
    /// there are several
    #[arg(long, value_name = "MODEL")]
    pub model: Option<String>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub changes: ModelChanges,
}

impl TreeModel {
    /// Returns the tree as the application takes it.
    ///
    /// # Errors
    /// Bad input: a list of joints or a length is none.
    pub(crate) fn typed(&self) -> Result<Tree, Failure> {
        Ok(Tree { model: self.model.clone(), changes: self.changes.typed()? })
    }
}

/// Options of `rigident identify` for trees of links.
#[derive(Args, Debug, Clone)]
#[command(next_help_heading = "Trees of links")]
pub struct TreeOptions {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub of: TreeModel,
    /// Friction columns of every joint, or of one: any of viscous, coulomb, stribeck, load, offset, rotor,
    /// spring, or none. What the model states of its joints has columns beside these; none takes them out.
    /// Geared arms need rotor. coulomb turns over at the speed that the recording shows, coulomb:SPEED at
    /// that one, coulomb:0 at once; stribeck:RATE says how fast it falls (0.1 rad/s, 0.01 m/s); load is
    /// proportional to the measured effort. Repeatable
    #[arg(long, value_name = "[JOINT=]LIST")]
    pub friction: Vec<String>,
    /// A drive that turns with several joints, with the same columns: m6=joint_5+joint_6, or by any gear
    /// m6=0.5*joint_5-joint_6. Repeatable
    #[arg(long, value_name = "NAME=JOINT+JOINT")]
    pub drive: Vec<String>,
    /// How well the nominal model is trusted where the data leave something open: 1 σ, relative
    #[arg(long, default_value_t = 1.0, value_name = "SHARE")]
    pub nominal_sigma: f64,
    /// In the full parameters the links of the right side mirror those of the left, about y = 0 of the base's
    /// frame
    #[arg(long)]
    pub symmetric_sides: bool,
    /// Write the model with the full parameters: .urdf, .xml (MJCF) or .sdf; must not exist. A file of the
    /// same kind given by --model is kept but for its inertias
    #[arg(long, value_name = "FILE")]
    pub write_model: Option<std::path::PathBuf>,
}

/// `rigident model base-params`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "A file has a fixed base, held still, and joint rows unless --floating is given, then base \
                        rows; people have no fixed base. Links on fixed joints are one with what they hang \
                        on.\n\nExamples:\n  rigident model base-params robot.urdf\n  rigident model \
                        base-params robot.urdf --floating --json\n  rigident model base-params panda.urdf \
                        --lock panda_finger_joint1,panda_finger_joint2\n  rigident model base-params human34 \
                        --height-m 1.65 --tool r_hand@0,0,-0.08\n  rigident model base-params \
                        two_links.rig.toml --floating"
)]
pub struct BaseParams {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub model: ModelOptions,
    /// The base moves
    #[arg(long)]
    pub floating: bool,
    /// Which rows are measured. Default: base with --floating, joint without
    #[arg(long, value_enum)]
    pub rows: Option<RowsWord>,
    /// Mimic joints follow their leaders; otherwise each counts as a joint of its own
    #[arg(long)]
    pub mimic: bool,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// Which model, and what is changed about it.
#[derive(Args, Debug, Clone)]
pub struct ModelOptions {
    /// human34, human58, a URDF, MJCF or SDF, or a rig file with [[link]] tables
    pub model: String,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub changes: ModelChanges,
}

/// What is changed about a model, and whose body a person's is.
#[derive(Args, Debug, Clone)]
pub struct ModelChanges {
    /// Joints that do not move, at an angle (rad) or a length (m); without it where the recording has them,
    /// else at zero
    #[arg(long, value_name = "JOINT[=VALUE]", value_delimiter = ',')]
    pub lock: Vec<String>,
    /// Three revolute joints in a row, nearest to the base first, that are one spherical joint, links without
    /// mass between them
    #[arg(long, value_name = "J1,J2,J3")]
    pub spherical: Vec<String>,
    /// A body held rigidly by a link; its frame in the link's in m and degrees
    #[arg(long, value_name = "LINK[@x,y,z[,roll,pitch,yaw]]", allow_hyphen_values = true)]
    pub tool: Vec<String>,
    /// Stature of the person, m
    #[arg(long, default_value_t = 1.741, value_name = "M", allow_negative_numbers = true)]
    pub height_m: f64,
    /// Mass of the person, kg
    #[arg(long, default_value_t = 73.0, value_name = "KG", allow_negative_numbers = true)]
    pub mass_kg: f64,
    /// Whose means the nominal guess is scaled from
    #[arg(long, value_enum, default_value_t)]
    pub sex: SexWord,
    /// A length of the person's that is known, as thigh=0.44 (m)
    #[arg(long, value_name = "SEGMENT=M")]
    pub segment: Vec<String>,
}

impl ModelChanges {
    /// Returns the changes as the application takes them.
    ///
    /// # Errors
    /// Bad input: a list of joints or a length is none.
    pub(crate) fn typed(&self) -> Result<Changes, Failure> {
        let lengths_m = self.segment.iter().map(|words| {
            let (name, value) = words.split_once('=')?;
            Some((name.to_owned(), value.trim().parse().ok()?))
        });
        let lengths_m = lengths_m
            .collect::<Option<Vec<_>>>()
            .ok_or_else(|| Failure::input("--segment is written NAME=METRES, for example thigh=0.44"))?;
        let sex = match self.sex {
            SexWord::Female => Sex::Female,
            SexWord::Male => Sex::Male,
        };
        Ok(Changes {
            lock: self.lock.clone(),
            spherical: self.spherical.iter().map(|words| three(words)).collect::<Result<_, _>>()?,
            tool: self.tool.clone(),
            person: Person { height_m: self.height_m, mass_kg: self.mass_kg, sex, lengths_m },
        })
    }
}

/// Returns the joints of `--spherical J1,J2,J3`.
fn three(words: &str) -> Result<[String; 3], Failure> {
    let joints: Vec<String> = words.split(',').map(|j| j.trim().to_owned()).collect();
    joints
        .try_into()
        .map_err(|_| Failure::input(format!("--spherical {words}: names three joints, J1,J2,J3")))
}

/// Which rows are measured.
#[derive(clap::ValueEnum, Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowsWord {
    /// The wrench on the base link
    Base,
    /// Joint torques and forces
    Joint,
    /// Both
    Both,
}

/// Whose means.
#[derive(clap::ValueEnum, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SexWord {
    /// Women's
    Female,
    /// Men's
    #[default]
    Male,
}

/// `rigident bench`
#[derive(Args, Debug, Clone)]
pub struct BenchCommand {
    /// What to time
    #[command(subcommand)]
    pub verb: BenchVerb,
}

/// What can be timed.
#[derive(Subcommand, Debug, Clone)]
pub enum BenchVerb {
    /// Time rows of trees of links, and those of Pinocchio through Python
    Regressors(BenchRegressors),
}

/// `rigident bench regressors`
#[derive(Args, Debug, Clone)]
#[command(after_help = "Examples:\n  rigident bench regressors\n  rigident bench regressors ur5_robot.urdf \
                        jvrc1.urdf:floating --python .venv/bin/python")]
pub struct BenchRegressors {
    /// URDFs; :floating after one gives it a moving base. Default: an arm of six and one of seven axes, a
    /// quadruped of 18 and a humanoid of 38 degrees of freedom
    #[arg(value_name = "URDF[:floating]")]
    pub models: Vec<String>,
    /// The Python that has the wheel `pin`
    #[arg(long, env = "RIGIDENT_PYTHON", value_name = "PYTHON")]
    pub python: Option<String>,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

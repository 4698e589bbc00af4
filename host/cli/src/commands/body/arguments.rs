use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use crate::options::microcontroller::Mcu;
use rigident::people::body_segments::Parts;
use rigident::people::body_segments::choice::Way;
use rigident::people::inverse_kinematics::subject::HumanModel;
use rigident::people::person::anthropometry::GivenMass;
use rigident_fit::COVERAGE_95;
use rigident_model::human::Sex;

/// `rigident body`
#[derive(Args, Debug, Clone)]
pub struct Body {
    /// What to do
    #[command(subcommand)]
    pub command: BodyCommand,
}

/// What to do with recordings of a person.
#[derive(Subcommand, Debug, Clone)]
pub enum BodyCommand {
    /// Identify the segments of a person from markers and force plates
    Identify(Box<IdentifyBody>),
    /// Show which markers of trials are known by their names, where they are taken to be, and what is missing
    Markers(BodyMarkers),
}

/// `rigident body markers`
#[derive(Args, Debug, Clone)]
#[command(after_help = "Sets that are recognised by their names: Plug-in Gait, CGM2, CGM2.3, Qualisys \
                  Sports, IOR, Visual3D, BTS Davis, OpenCap's anatomical markers, and keypoints of OpenPose, \
                  Theia and OpenCap, which are joint centres. What is not known is named in a file for --markers of body \
                  identify.\n\nExit status 0 if every segment has its markers, 1 if one has not, 2 if a file \
                  cannot be read.\n\nExamples:\n  rigident body markers walk.c3d --page walk.html\n  \
                  rigident body markers walk.trc --json")]
pub struct BodyMarkers {
    /// A trial: C3D, TRC, or CSV of Motive
    #[arg(value_name = "TRIAL")]
    pub trial: PathBuf,
    /// Forces of the ground for a TRC or CSV trial: MOT or STO. Default: NAME_grf.mot or NAME_grf.sto beside
    /// it
    #[arg(long, value_name = "FILE")]
    pub ground: Option<PathBuf>,
    /// Write a page that plays the markers and the forces over time to this new file
    #[arg(long, value_name = "FILE.html")]
    pub page: Option<PathBuf>,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// Which model of people.
#[derive(ValueEnum, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Model {
    /// 15 links, 34 degrees of freedom
    #[default]
    Human34,
    /// 23 links, 58 degrees of freedom
    Human58,
}

impl From<Model> for HumanModel {
    fn from(model: Model) -> Self {
        match model {
            Model::Human34 => Self::Human34,
            Model::Human58 => Self::Human58,
        }
    }
}

/// How motions are chosen.
#[derive(ValueEnum, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Select {
    /// Most information, by its determinant
    #[default]
    DOptimal,
    /// The best least eigenvalue of the information
    EOptimal,
    /// By conditions of parts of the body, near-duplicates taken away
    Published,
    /// By chance
    Random,
}

impl From<Select> for Way {
    fn from(select: Select) -> Self {
        match select {
            Select::DOptimal => Self::DOptimal,
            Select::EOptimal => Self::EOptimal,
            Select::Published => Self::Published,
            Select::Random => Self::Random,
        }
    }
}

/// Whose means the table has.
#[derive(ValueEnum, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TableOf {
    /// Women's
    Female,
    /// Men's
    Male,
    /// The mean of both, known less well
    #[default]
    Unknown,
}

impl From<TableOf> for Sex {
    fn from(of: TableOf) -> Self {
        match of {
            TableOf::Female => Self::Female,
            TableOf::Male => Self::Male,
            TableOf::Unknown => Self::Unknown,
        }
    }
}

/// `rigident body identify`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "A trial is a C3D file with force plates, or a TRC file or a CSV of OptiTrack's Motive with \
                  the ground's forces beside it: walk_grf.mot to walk.trc, or --ground FILE. Markers are known by \
                  their names (Plug-in Gait, OpenSim's examples and the like); joint centres come from all \
                  trials together. Frames in which a foot is off the plates are dropped, and counted.\n\nEach trial is a \
                  motion with a factor of its own; a single one is cut into parts. Every motion is predicted \
                  by the others, beside the table of average people scaled to the person.\n\nExit status 0 \
                  if the whole mass is identified, 1 if not, 2 if a file cannot be used.\n\nExamples:\n  \
                  rigident body identify walk.c3d --static standing.c3d --height-m 1.68\n  rigident body \
                  identify walk.trc --ground walk_forces.mot --static standing.trc\n  rigident body identify \
                  walk1.c3d walk2.c3d squat.c3d --static standing.c3d --mass-kg 72.6 --write-model \
                  subject.urdf\n  rigident body identify walk.trc --static standing.trc --osim scaled.osim \
                  --write-model identified.osim\n  rigident body identify serve.c3d --tool racket --tare \
                  walk.c3d --tare squat.c3d"
)]
pub struct IdentifyBody {
    /// Trials: C3D, or TRC or Motive's CSV with a MOT or STO file beside it
    #[arg(required = true, value_name = "TRIAL")]
    pub trials: Vec<PathBuf>,
    /// A trial in which the person stands upright
    #[arg(long = "static", value_name = "TRIAL")]
    pub standing: Option<PathBuf>,
    /// Forces of the ground for each TRC or CSV trial, in their order: MOT or STO
    #[arg(long, value_name = "FILE")]
    pub ground: Vec<PathBuf>,
    /// Which segment markers are on whose names say nothing: a TOML file
    #[arg(long, value_name = "FILE")]
    pub markers: Option<PathBuf>,
    /// The model of the person
    #[arg(long, value_enum, default_value_t)]
    pub model: Model,
    /// Mass of the person, kg, if it is known (to 0.5 %, 1 σ); by default from the plates
    #[arg(long, value_name = "M")]
    pub mass_kg: Option<f64>,
    /// Stature of the person, m; by default from the markers
    #[arg(long, value_name = "H")]
    pub height_m: Option<f64>,
    /// Whose means the table has
    #[arg(long, value_enum, default_value_t)]
    pub table: TableOf,
    /// A segment's mass that is known otherwise, with its U95, kg: a prosthesis, a limb with a load that is
    /// worn in all trials; may be repeated
    #[arg(long, value_name = "NAME=KG±KG", value_parser = segment_mass)]
    pub segment_mass: Vec<GivenMass>,
    /// How well the scales of the plates are known, per cent (1 σ): a part that all share, and as much of
    /// each plate's own; 0.5 of plates whose calibration was checked
    #[arg(long, value_name = "PERCENT", default_value_t = 1.0)]
    pub plate_scale_percent: f64,
    /// Cut-off of the smoothing of markers and plates, Hz; by default from the data
    #[arg(long, value_name = "HZ")]
    pub cut_off_hz: Option<f64>,
    /// How late the plates are against the cameras, s; by default from the data
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub delay_s: Option<f64>,
    /// Plates that are always loaded were reset right before each trial: their zero is exact, not known to 5
    /// N (1 σ)
    #[arg(long)]
    pub plates_zeroed: bool,
    /// Parts of a single trial, each a motion; or strides, of every trial
    #[arg(long, value_name = "N|strides", default_value = "4", value_parser = parts)]
    pub parts: Parts,
    /// Identify from this number of motions; by default from all
    #[arg(long, value_name = "K")]
    pub motions: Option<usize>,
    /// How they are chosen
    #[arg(long, value_enum, default_value_t, requires = "motions")]
    pub select: Select,
    /// Relative standard deviation that the table's segments are trusted with
    #[arg(long, value_name = "S", default_value_t = 0.3)]
    pub nominal_sigma: f64,
    /// Make right segments mirror images of left ones
    #[arg(long)]
    pub symmetric_sides: bool,
    /// An OpenSim model that is scaled to the person: its lengths are known to 15 mm (1 σ), and --write-model
    /// FILE.osim writes the segments into it
    #[arg(long, value_name = "FILE")]
    pub osim: Option<PathBuf>,
    /// Write the segments into a model: FILE.urdf, FILE.xml (MJCF), or FILE.osim, which is that of --osim
    /// with other inertias
    #[arg(long, value_name = "FILE")]
    pub write_model: Option<PathBuf>,
    /// The person holds something in the trials, of this name: its own parameters come from these and the
    /// trials of --tare
    #[arg(long, value_name = "NAME", requires = "tare")]
    pub tool: Option<String>,
    /// The link that holds it
    #[arg(long, value_name = "LINK", default_value = "r_hand", requires = "tool")]
    pub tool_link: String,
    /// A trial without the tool; may be repeated
    #[arg(long, value_name = "TRIAL", requires = "tool")]
    pub tare: Vec<PathBuf>,
    /// Stream the motions to the firmware on this microcontroller as well, and compare what it makes of them
    #[arg(long, value_enum, value_name = "MCU")]
    pub mcu: Option<Mcu>,
    /// Print the result object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
    /// Folder for the files; must be new or empty. Default: a new folder here
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Reads `--parts`.
fn parts(text: &str) -> Result<Parts, String> {
    match text.parse() {
        Ok(count @ 1..=100) => Ok(Parts::Equal(count)),
        _ if text == "strides" => Ok(Parts::Strides),
        _ => Err("give 1 to 100, or strides".to_owned()),
    }
}

/// Reads `--segment-mass`.
fn segment_mass(text: &str) -> Result<GivenMass, String> {
    let read = || {
        let (link, mass) = text.split_once('=')?;
        let (kg, u95) = mass.split_once('±').or_else(|| mass.split_once("+-"))?;
        let [kg, u95] = [kg, u95].map(|v| v.trim().parse::<f64>().ok().filter(|v| v.is_finite() && *v > 0.0));
        Some(GivenMass { link: link.trim().to_owned(), kg: kg?, sigma_kg: u95? / COVERAGE_95 })
    };
    read()
        .ok_or_else(|| "give NAME=KG±KG, as l_shank=1.5±0.1 (or 1.5+-0.1), both greater than zero".to_owned())
}

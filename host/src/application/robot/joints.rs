//! Offsets of a robot's joint angles, from poses with flat soles.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::super::calibrate_error::CalibrateError;
use super::super::{Caller, Error};
use rigident_fit::Progress;
use rigident_identify::joint_offsets::faults::contradiction;
use rigident_identify::joint_offsets::poses_file::PosesTable;
use rigident_identify::joint_offsets::result::{Answer, COARSEST, Coarsest, OverPoses, identify};
use rigident_identify::joint_offsets::search::Method;
use rigident_identify::joint_offsets::{JointTree, Noise, Pose, Setup, contacts_file};
use rigident_model::human::Person;
use rigident_model::xml::Language;
use rigident_model::{Model, remarks, sites, write};
use rigident_present::joint_offsets::{OffsetsPage, page, text};
use rigident_rows::named_model;

/// Options of the search for joint offsets.
#[derive(Clone, Debug)]
pub struct JointOptions {
    /// Joints whose offsets are found; none: all between the base and the contacts.
    pub joints: Vec<String>,
    /// Standard deviations of what is measured.
    pub noise: Noise,
    /// An offset with a larger U95 is not identified.
    pub coarsest: Coarsest,
    /// The search.
    pub method: Method,
}

impl Default for JointOptions {
    fn default() -> Self {
        Self { joints: Vec::new(), noise: Noise::default(), coarsest: COARSEST, method: Method::default() }
    }
}

/// The offsets of a robot's joints; true position is measured position plus offset.
#[derive(Clone, Debug, Serialize)]
pub struct JointOffsets {
    /// Name of this object.
    pub schema: &'static str,
    /// Name of the model.
    pub model: String,
    /// Number of poses.
    pub poses: usize,
    /// The offsets, in the order in which they were asked for.
    pub offsets: Vec<JointOffset>,
    /// Covariance of those that are identified, in their order, rad² (m and rad m where a joint slides).
    pub covariance: Vec<Vec<f64>>,
    /// The combination that the poses know worst.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weakest: Option<Combination>,
    /// The results of the first poses.
    pub over_poses: Vec<OverPoses>,
    /// Poses that were left out.
    pub bad_poses: Vec<LeftOutPose>,
    /// Parameters that were estimated along with the offsets: the floor's slope, planes, held links,
    /// mountings.
    pub along: Vec<AlongOffset>,
    /// The residuals over what the stated noise explains, a ratio of variances.
    pub variance_ratio: f64,
    /// Degrees of freedom of what is left.
    pub degrees_of_freedom: f64,
    /// Root mean square of the attitudes' residuals, degrees.
    pub attitude_rms_deg: f64,
    /// Root mean square of the contacts' residuals, mm.
    pub height_rms_mm: f64,
    /// Steps of the search.
    pub steps: usize,
    /// Warnings that the user should act on.
    pub warnings: Vec<String>,
    /// The answer that all this is of.
    #[serde(skip)]
    pub answer: Answer,
    #[serde(skip)]
    posed: Posed,
}

/// The offset of a joint.
#[derive(Clone, Debug, Serialize)]
pub struct JointOffset {
    /// The joint.
    pub joint: String,
    /// `rad`, or `m` of a joint that slides.
    pub unit: &'static str,
    /// The offset, if the poses identify it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// The 95 % expanded uncertainty of the offset.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub u95: Option<f64>,
    /// The distance that the joint moves over the poses.
    pub moves_by: f64,
    /// Why it is not identified; empty if it is.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub why_not: String,
}

/// A combination of offsets.
#[derive(Clone, Debug, Serialize)]
pub struct Combination {
    /// The standard deviation of the combination, rad or m; `None` if it is not known at all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma: Option<f64>,
    /// Joints with their shares.
    pub shares: Vec<(String, f64)>,
}

/// A pose that the others contradict.
#[derive(Clone, Debug, Serialize)]
pub struct LeftOutPose {
    /// The name of the pose.
    pub pose: String,
    /// The sum of squares of the pose's residuals, divided by the sum that the noise explains.
    pub ratio: f64,
    /// The link whose attitude is farthest off.
    pub attitude_of: String,
    /// By how much, degrees.
    pub attitude_off_deg: f64,
    /// The contact that is farthest off.
    pub sole: String,
    /// By how much, mm.
    pub height_off_mm: f64,
}

/// A parameter that was estimated along.
#[derive(Clone, Debug, Serialize)]
pub struct AlongOffset {
    /// The meaning of the parameter, in words.
    pub name: String,
    /// `m` or `rad`.
    pub unit: &'static str,
    /// The estimated value.
    pub value: f64,
    /// The 95 % expanded uncertainty of the value.
    pub u95: f64,
}

/// The poses that were read, with their model.
#[derive(Clone, Debug)]
struct Posed {
    file: PathBuf,
    model: Model,
    source: String,
    setup: Setup,
    poses: Vec<Pose>,
    coarsest: Coarsest,
}

impl JointOffsets {
    /// Returns the table.
    pub fn text(&self) -> String {
        text::text(&self.answer, self.poses, self.posed.coarsest)
    }

    /// Returns the page with the offsets and with poses before and after, HTML.
    pub fn page(&self) -> String {
        let Posed { model, source, setup, poses, coarsest, .. } = &self.posed;
        let names = (model.name.as_str(), source.as_str());
        page(&OffsetsPage::new(setup, poses, &self.answer, names, *coarsest, &self.warnings))
    }

    /// Writes the model with the zeros of its joints where they were found, and adds what is to be known of
    /// the file to the warnings.
    ///
    /// # Errors
    /// [`Error::Model`] if the file cannot be written.
    pub fn write_model(&mut self, path: &Path) -> Result<(), Error> {
        let mut moved = self.posed.model.clone();
        for offset in &self.answer.offsets {
            if let Some((i, measured)) = moved.joint(&offset.joint).zip(offset.measured) {
                moved.move_zero(i, measured.value);
            }
        }
        // Places of joints are put into a URDF that is retained; other languages are written anew.
        let source = Some(self.posed.file.as_path());
        let source = source.filter(|_| Language::of_path(path) == Some(Language::Urdf));
        write::write(&moved, source, path)?;
        self.warnings.extend(remarks::remarks(&moved, source, path, &[]));
        Ok(())
    }
}

/// Finds the offsets of a robot's joints from a table of poses and a file of contacts. `model` is the path of
/// its description.
///
/// # Errors
/// A file cannot be read, the poses tell no offset, or they contradict each other; the caller stops the job.
///
/// ```
/// use rigident::application::{Caller, JointOptions, joint_offsets};
/// # #[cfg(feature = "simulator")]
/// # {
/// use rigident::joint_offsets::Noise;
/// use rigident::laboratory::standing::{Reading, contacts, csv, humanoid, setup};
/// use rigident::laboratory::standing::{random_offsets, random_poses};
/// use rigident::model::{write::generated, xml::Language};
///
/// let folder = tempfile::tempdir().unwrap();
/// let at = |name: &str| folder.path().join(name);
/// let truth = random_offsets(0.05, 21);
/// let reading = Reading { encoder_rad: 1e-3, attitude_rad: 3e-3 };
/// let poses = random_poses(40, &truth, reading, 22);
/// std::fs::write(at("robot.urdf"), generated(&humanoid(), Language::Urdf).unwrap()).unwrap();
/// std::fs::write(at("soles.toml"), contacts()).unwrap();
/// std::fs::write(at("poses.csv"), csv(&setup(Noise::default()), &poses)).unwrap();
/// let model = at("robot.urdf").display().to_string();
/// let options = JointOptions::default();
/// let found = joint_offsets(&model, &at("poses.csv"), &at("soles.toml"), &options, &Caller::default())?;
/// let first = &found.offsets[0];
/// assert!((first.value.unwrap() - truth[0]).abs() < 2.0 * first.u95.unwrap());
/// # }
/// # Ok::<(), rigident::application::Error>(())
/// ```
pub fn joint_offsets(
    model: &str,
    poses: &Path,
    contacts: &Path,
    options: &JointOptions,
    caller: &Caller<'_>,
) -> Result<JointOffsets, Error> {
    caller.stoppable(|| found(model, poses, contacts, options, caller))
}

fn found(
    name: &str,
    poses: &Path,
    contacts: &Path,
    options: &JointOptions,
    caller: &Caller<'_>,
) -> Result<JointOffsets, Error> {
    let refused = CalibrateError::Poses;
    let (model, _) = named_model::open(name, &Person::default())?;
    let tree = JointTree::new(&model);
    let text = Error::text_of(contacts)?;
    let site = |link: &str| sites::site(Path::new(name), link);
    let contacts = contacts_file::parse(&text, &contacts.display().to_string(), &tree, &site);
    let contacts = contacts.map_err(refused)?;
    let source = poses.display().to_string();
    let table = PosesTable::parse(&Error::text_of(poses)?, &source).map_err(refused)?;
    let measured = table.measured_links(&tree).map_err(refused)?;
    let setup = Setup::new(tree, contacts, measured, &options.joints, options.noise).map_err(refused)?;
    let poses = table.poses(&setup).map_err(refused)?;
    caller.stage("offsets of joints", 0.0);
    let answer = identify(&setup, &poses, options.method, options.coarsest)
        .map_err(|why| refused(format!("{source}: {why}")))?;
    if let Some(why) = contradiction(&setup, &poses, &answer).map_err(refused)? {
        return Err(CalibrateError::PosesContradict(why).into());
    }
    let warnings = answer.warnings(&setup);
    let file = PathBuf::from(name);
    let posed = Posed { file, model, source, setup, poses, coarsest: options.coarsest };
    Ok(object(posed, answer, warnings))
}

fn object(posed: Posed, answer: Answer, warnings: Vec<String>) -> JointOffsets {
    let unit = |is_length: bool| if is_length { "m" } else { "rad" };
    let offsets = answer.offsets.iter().map(|offset| JointOffset {
        joint: offset.joint.clone(),
        unit: unit(offset.slides),
        value: offset.measured.map(|own| own.value),
        u95: offset.measured.map(|own| own.u95),
        moves_by: offset.moves_by,
        why_not: offset.why_not(posed.coarsest),
    });
    let bad = answer.bad.iter().map(|bad| LeftOutPose {
        pose: bad.name.clone(),
        ratio: bad.ratio,
        attitude_of: bad.attitude_off.0.clone(),
        attitude_off_deg: bad.attitude_off.1.to_degrees(),
        sole: bad.height_off.0.clone(),
        height_off_mm: 1e3 * bad.height_off.1,
    });
    let along = answer.along.iter().map(|own| AlongOffset {
        name: own.name.clone(),
        unit: unit(own.length),
        value: own.measured.value,
        u95: own.measured.u95,
    });
    JointOffsets {
        schema: "rigident/joint-offsets/1",
        model: posed.model.name.clone(),
        poses: posed.poses.len(),
        offsets: offsets.collect(),
        covariance: answer.covariance.row_iter().map(|row| row.iter().copied().collect()).collect(),
        weakest: answer.weakest.as_ref().map(|(sigma, shares)| Combination {
            sigma: Some(*sigma).filter(|sigma| sigma.is_finite()),
            shares: shares.clone(),
        }),
        over_poses: answer.over_poses.clone(),
        bad_poses: bad.collect(),
        along: along.collect(),
        variance_ratio: answer.variance_ratio,
        degrees_of_freedom: answer.degrees_of_freedom,
        attitude_rms_deg: answer.attitude_rms.to_degrees(),
        height_rms_mm: 1e3 * answer.height_rms,
        steps: answer.steps,
        warnings,
        answer,
        posed,
    }
}

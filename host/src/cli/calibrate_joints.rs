//! `rigident calibrate joints`: offsets of joint angles from poses with flat soles.

use std::fmt::Write as _;
use std::path::Path;
use std::process::ExitCode;

use serde::Serialize;

use super::calibration_arguments::CalibrateJoints;
use super::outcome::say;
use super::{ExitStatus, Failure, factor};
use crate::fit::{COVERAGE_95, Measured};
use crate::joint_offsets::poses_file::PosesTable;
use crate::joint_offsets::result::{Answer, Offset, identify};
use crate::joint_offsets::search::Method;
use crate::joint_offsets::{JointTree, Noise, Setup, contacts_file};
use crate::model::human::Person;
use crate::model::xml::Language;
use crate::model::{self, Model, remarks, write};
use crate::present::text::{NOT_IDENTIFIED, counted, significant, with_u95};
use crate::recording::new_file::write_new_text;

/// What is left may be so much more than the stated noise explains before it is said, a ratio of variances.
const NOISIER: f64 = 1.5;

/// The object of `--json`.
#[derive(Serialize)]
struct Object {
    schema: &'static str,
    model: String,
    poses: usize,
    offsets: Vec<Value>,
    /// Of those that are identified, in their order.
    covariance: Vec<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    weakest: Option<Combination>,
    over_poses: Vec<Over>,
    bad_poses: Vec<Bad>,
    variance_ratio: f64,
    degrees_of_freedom: f64,
    attitude_rms_deg: f64,
    height_rms_mm: f64,
    steps: usize,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct Value {
    joint: String,
    unit: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    value: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    u95: Option<f64>,
}

#[derive(Serialize)]
struct Combination {
    #[serde(skip_serializing_if = "Option::is_none")]
    sigma: Option<f64>,
    shares: Vec<(String, f64)>,
}

#[derive(Serialize)]
struct Over {
    poses: usize,
    identified: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    worst_u95: Option<f64>,
}

#[derive(Serialize)]
struct Bad {
    pose: String,
    ratio: f64,
    attitude_of: String,
    attitude_off_deg: f64,
    sole: String,
    height_off_mm: f64,
}

/// `rigident calibrate joints`
pub(super) fn run(arguments: &CalibrateJoints) -> Result<ExitCode, Failure> {
    if let Some(path) = &arguments.output {
        factor::absent(path)?;
    }
    if let Some(path) = &arguments.write_model {
        write::check_target(path).map_err(Failure::input)?;
    }
    let noise = noise(arguments)?;
    let coarsest = positive("--coarsest-u95-deg", arguments.coarsest_u95_deg)?.to_radians();
    let (model, _) = model::open(&arguments.model, &Person::default()).map_err(Failure::input)?;
    let tree = JointTree::new(&model);
    let contacts = text_of(&arguments.contacts)?;
    let soles = contacts_file::parse(&contacts, &arguments.contacts.display().to_string(), &tree)
        .map_err(Failure::input)?;
    let table = PosesTable::parse(&text_of(&arguments.poses)?, &arguments.poses.display().to_string())
        .map_err(Failure::input)?;
    let measured = table.measured_links(&tree).map_err(Failure::input)?;
    let setup = Setup::new(tree, soles, measured, &arguments.joints, noise).map_err(Failure::input)?;
    let poses = table.poses(&setup).map_err(Failure::input)?;
    let answer = identify(&setup, &poses, Method::from(arguments.method), coarsest)
        .map_err(|why| Failure::input(format!("{}: {why}", arguments.poses.display())))?;
    let mut warnings = warnings(&setup, &answer);
    if let Some(path) = &arguments.output {
        write_new_text(path, &rig_tables(&answer)).map_err(Failure::input)?;
    }
    if let Some(path) = &arguments.write_model {
        warnings.extend(write_model(&model, Path::new(&arguments.model), &answer, path)?);
    }
    let object = object(&model, poses.len(), &answer, warnings);
    if arguments.json {
        say(serde_json::to_string_pretty(&object).map_err(Failure::input)?);
    } else {
        say(words(&object, &answer).trim_end());
        object.warnings.iter().for_each(|warning| tell!("rigident: {warning}"));
    }
    Ok(ExitStatus::of(answer.offsets.iter().all(|offset| offset.measured.is_some())).into())
}

fn text_of(path: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(path)
        .map_err(|e| Failure::input(format!("{}: cannot be read: {e}", path.display())))
}

fn positive(option: &str, value: f64) -> Result<f64, Failure> {
    if value.is_finite() && value > 0.0 {
        return Ok(value);
    }
    Err(Failure::input(format!("{option} {value}: must be finite and greater than zero")))
}

fn noise(arguments: &CalibrateJoints) -> Result<Noise, Failure> {
    let from_zero = |option: &str, value: f64| {
        if value == 0.0 { Ok(0.0) } else { positive(option, value) }
    };
    Ok(Noise {
        attitude_rad: positive("--attitude-noise-deg", arguments.attitude_noise_deg)?.to_radians(),
        height_m: 1e-3 * positive("--height-noise-mm", arguments.height_noise_mm)?,
        encoder_rad: from_zero("--encoder-noise-deg", arguments.encoder_noise_deg)?.to_radians(),
        mounting_rad: from_zero("--mounting-noise-deg", arguments.mounting_noise_deg)?.to_radians(),
    })
}

/// Writes the model with the zeros of the joints where they were found, and returns what is to be known of the file.
fn write_model(model: &Model, source: &Path, answer: &Answer, path: &Path) -> Result<Vec<String>, Failure> {
    let mut moved = model.clone();
    for offset in &answer.offsets {
        if let Some((i, measured)) = moved.joint(&offset.joint).zip(offset.measured) {
            moved.move_zero(i, measured.value);
        }
    }
    // Places of joints are put into a URDF that is kept; other languages are written anew.
    let source = Some(source).filter(|_| Language::of_path(path) == Some(Language::Urdf));
    write::write(&moved, source, path).map_err(Failure::input)?;
    Ok(remarks::remarks(&moved, source, path, &[]))
}

fn warnings(setup: &Setup, answer: &Answer) -> Vec<String> {
    let mut warnings = Vec::new();
    for bad in &answer.bad {
        let (link, turn) = &bad.attitude_off;
        let (sole, height) = &bad.height_off;
        warnings.push(format!(
            "{} is left out: the others contradict it ({} times what the noise explains; attitude of {link} off by {}°, a corner of \
             sole {sole} by {} mm)",
            bad.name,
            significant(bad.ratio, 2),
            significant(turn.to_degrees(), 2),
            significant(1e3 * height, 2)
        ));
    }
    let open: Vec<&str> =
        answer.offsets.iter().filter(|o| o.measured.is_none()).map(|o| o.joint.as_str()).collect();
    if !open.is_empty() {
        warnings.push(format!(
            "not told by these poses: {}; take poses with one knee bent more than the other, feet turned and apart, pelvis tilted",
            open.join(", ")
        ));
    }
    if answer.variance_ratio > NOISIER {
        warnings.push(format!(
            "what is left is {} times the variance that the stated noise explains; the intervals are widened by its root: is the \
             floor level, are the corners where the file has them, is the noise as stated?",
            significant(answer.variance_ratio, 2)
        ));
    }
    if setup.noise.mounting_rad == 0.0 {
        warnings.push(
            "the IMU is taken as mounted exactly: an error of its roll or pitch goes into the hips; say by --mounting-noise-deg how far it may be off"
                .to_owned(),
        );
    }
    if !answer.converged {
        warnings.push("the search did not settle: do not use these numbers".to_owned());
    }
    warnings
}

fn object(model: &Model, poses: usize, answer: &Answer, warnings: Vec<String>) -> Object {
    let rows = answer.covariance.row_iter();
    Object {
        schema: "rigident/joint-offsets/1",
        model: model.name.clone(),
        poses,
        offsets: answer
            .offsets
            .iter()
            .map(|offset| Value {
                joint: offset.joint.clone(),
                unit: unit(offset),
                value: offset.measured.map(|own| own.value),
                u95: offset.measured.map(|own| own.u95),
            })
            .collect(),
        covariance: rows.map(|row| row.iter().copied().collect()).collect(),
        weakest: answer.weakest.as_ref().map(|(sigma, shares)| Combination {
            sigma: Some(*sigma).filter(|sigma| sigma.is_finite()),
            shares: shares.clone(),
        }),
        over_poses: answer
            .over_poses
            .iter()
            .map(|own| Over { poses: own.poses, identified: own.identified, worst_u95: own.worst_u95 })
            .collect(),
        bad_poses: answer
            .bad
            .iter()
            .map(|bad| Bad {
                pose: bad.name.clone(),
                ratio: bad.ratio,
                attitude_of: bad.attitude_off.0.clone(),
                attitude_off_deg: bad.attitude_off.1.to_degrees(),
                sole: bad.height_off.0.clone(),
                height_off_mm: 1e3 * bad.height_off.1,
            })
            .collect(),
        variance_ratio: answer.variance_ratio,
        degrees_of_freedom: answer.degrees_of_freedom,
        attitude_rms_deg: answer.attitude_rms.to_degrees(),
        height_rms_mm: 1e3 * answer.height_rms,
        steps: answer.steps,
        warnings,
    }
}

fn unit(offset: &Offset) -> &'static str {
    if offset.slides { "m" } else { "rad" }
}

/// Returns the offsets as `[[joint]]` tables of a rig file.
fn rig_tables(answer: &Answer) -> String {
    let mut out =
        "# Offsets of joints found by `rigident calibrate joints`: [[joint]] tables of a rig file.\n\
                   # The true position is the measured one plus the offset; zero_std is 1 sigma of it. SI.\n"
            .to_owned();
    for offset in &answer.offsets {
        let joint = &offset.joint;
        let Some(Measured { value, u95 }) = offset.measured else {
            let _ = writeln!(out, "\n# {joint}: {NOT_IDENTIFIED}");
            continue;
        };
        let name = toml::Value::String(joint.clone());
        let column = toml::Value::String(format!("{joint}_{}", unit(offset)));
        let _ = writeln!(
            out,
            "\n[[joint]]\nname = {name}\nposition = {{ name = {column}, offset = {value:?} }}\nzero_std = {:?}",
            u95 / COVERAGE_95
        );
    }
    out
}

fn words(object: &Object, answer: &Answer) -> String {
    let told = answer.offsets.iter().filter(|offset| offset.measured.is_some()).count();
    let mut out = format!(
        "{told} of {} from {}; attitudes are left with {}°, heights with {} mm\n\n",
        counted(answer.offsets.len(), "offset", "offsets"),
        counted(object.poses - object.bad_poses.len(), "pose", "poses"),
        significant(object.attitude_rms_deg, 2),
        significant(object.height_rms_mm, 2)
    );
    let width = answer.offsets.iter().map(|offset| offset.joint.chars().count()).max().unwrap_or(0);
    for offset in &answer.offsets {
        let cell = match offset.measured {
            None => NOT_IDENTIFIED.to_owned(),
            Some(own) if offset.slides => with_u95(1e3 * own.value, 1e3 * own.u95, "mm"),
            Some(own) => format!("{}°", with_u95(own.value.to_degrees(), own.u95.to_degrees(), "")),
        };
        let _ = writeln!(out, "  {:<width$}  {cell:>20}", offset.joint);
    }
    if let Some(weakest) = &object.weakest {
        let shares: Vec<String> =
            weakest.shares.iter().map(|(joint, share)| format!("{share:+.2} {joint}")).collect();
        let known = weakest.sigma.map_or_else(
            || "not known at all".to_owned(),
            |sigma| format!("known to ± {}° (95 %)", significant(COVERAGE_95 * sigma.to_degrees(), 2)),
        );
        let _ = writeln!(out, "\nKnown worst, {known}: {}", shares.join(" "));
    }
    out.push_str("\n  poses  identified  largest U95\n");
    for own in &object.over_poses {
        let worst =
            own.worst_u95.map_or_else(|| "–".to_owned(), |u| format!("{}°", significant(u.to_degrees(), 2)));
        let _ = writeln!(out, "  {:>5}  {:>10}  {worst:>11}", own.poses, own.identified);
    }
    out
}

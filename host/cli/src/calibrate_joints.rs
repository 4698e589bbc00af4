//! `rigident calibrate joints`: offsets of joint angles from poses with flat soles.

use std::fmt::Write as _;
use std::path::Path;
use std::process::ExitCode;

use serde::Serialize;

use super::calibrate_joints_page::html;
use super::calibrate_joints_words::{believed, warnings, why, words};
use super::calibration_arguments::CalibrateJoints;
use super::outcome::say;
use super::terms::in_own_terms;
use super::{ExitStatus, Failure, factor};
use rigident::fit::figures::NOT_IDENTIFIED;
use rigident::joint_offsets::poses_file::PosesTable;
use rigident::joint_offsets::result::{Answer, Coarsest, Offset, identify};
use rigident::joint_offsets::search::Method;
use rigident::joint_offsets::{JointTree, Noise, Setup, contacts_file};
use rigident_fit::{COVERAGE_95, Measured};
use rigident_io::recording::new_file::write_new_text;
use rigident_model::human::Person;
use rigident_model::xml::Language;
use rigident_model::{Model, remarks, sites, write};

/// The heading's largest σ, degrees.
const LARGEST_YAW_DEG: f64 = 180.0;

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
    along: Vec<Along>,
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
    moves_by: f64,
    #[serde(skip_serializing_if = "String::is_empty")]
    why_not: String,
}

#[derive(Serialize)]
struct Along {
    name: String,
    unit: &'static str,
    value: f64,
    u95: f64,
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
    #[serde(skip_serializing_if = "Option::is_none")]
    worst_u95_m: Option<f64>,
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
    for path in [&arguments.output, &arguments.report].into_iter().flatten() {
        factor::absent(path)?;
    }
    if let Some(path) = &arguments.write_model {
        write::check_target(path).map_err(Failure::input)?;
    }
    let noise = noise(arguments)?;
    let coarsest = Coarsest {
        rad: positive("--coarsest-u95-deg", arguments.coarsest_u95_deg)?.to_radians(),
        m: 1e-3 * positive("--coarsest-u95-mm", arguments.coarsest_u95_mm)?,
    };
    let (model, _) =
        rigident::rows::named_model::open(&arguments.model, &Person::default()).map_err(Failure::input)?;
    let tree = JointTree::new(&model);
    let contacts = text_of(&arguments.contacts)?;
    let site = |name: &str| sites::site(Path::new(&arguments.model), name);
    let contacts = contacts_file::parse(&contacts, &arguments.contacts.display().to_string(), &tree, &site)
        .map_err(Failure::input)?;
    let source = arguments.poses.display().to_string();
    let table = PosesTable::parse(&text_of(&arguments.poses)?, &source).map_err(Failure::input)?;
    let measured = table.measured_links(&tree).map_err(Failure::input)?;
    let setup = Setup::new(tree, contacts, measured, &arguments.joints, noise).map_err(Failure::input)?;
    let poses = table.poses(&setup).map_err(Failure::input)?;
    let answer = identify(&setup, &poses, Method::from(arguments.method), coarsest)
        .map_err(|why| Failure::input(format!("{source}: {why}")))?;
    believed(&setup, &poses, &answer)?;
    let mut warnings = warnings(&setup, &answer);
    if let Some(path) = &arguments.output {
        write_new_text(path, &rig_tables(&answer)).map_err(Failure::input)?;
    }
    if let Some(path) = &arguments.write_model {
        warnings.extend(write_model(&model, Path::new(&arguments.model), &answer, path)?);
    }
    if let Some(path) = &arguments.report {
        let page = html(&setup, &poses, &answer, (&model.name, &source), coarsest, &warnings);
        write_new_text(path, &in_own_terms(&page)).map_err(Failure::input)?;
    }
    if arguments.json {
        let object = object(&model, poses.len(), &answer, coarsest, warnings);
        say(serde_json::to_string_pretty(&object).map_err(Failure::input)?);
    } else {
        say(words(&answer, poses.len(), coarsest));
        warnings.iter().for_each(|warning| tell!("rigident: {warning}"));
    }
    Ok(ExitStatus::of(answer.offsets.iter().all(|offset| offset.measured.is_some())).into())
}

/// Returns the text of a file.
///
/// # Errors
/// Bad input: it cannot be read.
pub(super) fn text_of(path: &Path) -> Result<String, Failure> {
    rigident_files::read_text(path)
        .map_err(|e| Failure::input(format!("{}: cannot be read: {e}", path.display())))
}

/// Returns the value of an option that must be greater than zero.
///
/// # Errors
/// Bad input: it is not.
pub(super) fn positive(option: &str, value: f64) -> Result<f64, Failure> {
    if value.is_finite() && value > 0.0 {
        return Ok(value);
    }
    Err(Failure::input(format!("{option} {value}: must be finite and greater than zero")))
}

fn noise(arguments: &CalibrateJoints) -> Result<Noise, Failure> {
    let from_zero = |option: &str, value: f64| {
        if value == 0.0 { Ok(0.0) } else { positive(option, value) }
    };
    let attitude = positive("--attitude-noise-deg", arguments.attitude_noise_deg)?;
    let yaw = arguments.yaw_noise_deg.map_or(Ok(attitude), |yaw| positive("--yaw-noise-deg", yaw))?;
    if yaw > LARGEST_YAW_DEG {
        return Err(Failure::input(format!(
            "--yaw-noise-deg {yaw}: must be at most {LARGEST_YAW_DEG}, which says that headings tell nothing"
        )));
    }
    Ok(Noise {
        attitude_rad: attitude.to_radians(),
        yaw_rad: yaw.to_radians(),
        height_m: 1e-3 * positive("--height-noise-mm", arguments.height_noise_mm)?,
        floor_rad: from_zero("--floor-noise-deg", arguments.floor_noise_deg)?.to_radians(),
        encoder_rad: from_zero("--encoder-noise-deg", arguments.encoder_noise_deg)?.to_radians(),
        slide_m: 1e-3 * from_zero("--encoder-noise-mm", arguments.encoder_noise_mm)?,
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
    // Places of joints are put into a URDF that is retained; other languages are written anew.
    let source = Some(source).filter(|_| Language::of_path(path) == Some(Language::Urdf));
    write::write(&moved, source, path).map_err(Failure::input)?;
    Ok(remarks::remarks(&moved, source, path, &[]))
}

fn object(model: &Model, poses: usize, answer: &Answer, coarsest: Coarsest, warnings: Vec<String>) -> Object {
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
                moves_by: offset.moves_by,
                why_not: why(offset, coarsest),
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
            .map(|own| Over {
                poses: own.poses,
                identified: own.identified,
                worst_u95: own.worst_u95,
                worst_u95_m: own.worst_u95_m,
            })
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
        along: answer
            .along
            .iter()
            .map(|own| Along {
                name: own.name.clone(),
                unit: if own.length { "m" } else { "rad" },
                value: own.measured.value,
                u95: own.measured.u95,
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

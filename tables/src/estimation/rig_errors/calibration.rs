//! A rig calibrated by a steel cylinder: what it then tells of another body, and how often the truth is in
//! its intervals.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rigident::fit::Silent;
use rigident::problem::{Problem, ProblemOptions, Subject};
use rigident::recording::Recording;
use rigident::reference::{ReferenceBody, Run as ReferenceRun, calibrate};
use rigident::rig::calibration::CalibratedRig;
use rigident::rig::{RigCalibration, RigFile};

use super::super::problem::Normal;
use super::errors::{Errors, Group};
use super::mechanics::{Body, Motion};
use super::recording::{Rig, rig_file};
use super::study::{CENTRE, MASS, MOMENT, Runs, TENSOR, run, runs};
use rigident::answer::Status;

const RIGS: u64 = 200;
/// Nominal dimensions of the cylinder, m; where its bottom is, m; its mass, kg.
const DIAMETER: f64 = 0.07;
const LENGTH: f64 = 0.11;
const BOTTOM: f64 = 0.012;
const MASS_KG: f64 = 3.32;
/// The knowledge of it: 1 σ of the mass, kg; limits of diameter and length, m, of the place, m, and of the
/// attitude, degrees.
const MASS_STD: f64 = 3.3e-4;
const SIZE_LIMIT: f64 = 2e-5;
const PLACE_LIMIT: f64 = 3.5e-5;
const TILT_LIMIT: f64 = 0.05;

/// Returns the file of the cylinder.
fn reference() -> ReferenceBody {
    let text = format!(
        "name = \"steel cylinder\"\nmass_kg = {MASS_KG}\nmass_std_kg = {MASS_STD}\n\n[cylinder]\ndiameter_m \
         = {DIAMETER}\n\
         diameter_tolerance_m = {SIZE_LIMIT}\nlength_m = {LENGTH}\nlength_tolerance_m = \
         {SIZE_LIMIT}\n\n[place]\n\
         position_m = [0, 0, {BOTTOM}]\nposition_tolerance_m = [{PLACE_LIMIT}, {PLACE_LIMIT}, \
         {PLACE_LIMIT}]\n\
         rotation_tolerance_deg = [{TILT_LIMIT}, {TILT_LIMIT}, {TILT_LIMIT}]\n\n[[mounting]]\nname \
         = \"lying\"\n\
         rotation_rpy_deg = [90, 0, 0]\nposition_m = [0, {}, {}]\n",
        0.5 * LENGTH,
        BOTTOM + 0.5 * DIAMETER,
    );
    ReferenceBody::parse(&text, "cylinder.toml").unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// A cylinder as it was turned.
struct Made {
    mass: f64,
    diameter: f64,
    length: f64,
}

impl Made {
    fn draw(normal: &mut Normal) -> Self {
        let limit = |a: f64| a / 3.0_f64.sqrt();
        Self {
            mass: MASS_KG + MASS_STD * normal.draw(),
            diameter: DIAMETER + limit(SIZE_LIMIT) * normal.draw(),
            length: LENGTH + limit(SIZE_LIMIT) * normal.draw(),
        }
    }

    /// Returns the cylinder on the load cell, upright or lying along y, a little off and tilted.
    fn mounted(&self, lying: bool, normal: &mut Normal) -> Body {
        let limit = |a: f64| a / 3.0_f64.sqrt();
        let mut draw = |sd: f64| Vector3::new(sd * normal.draw(), sd * normal.draw(), sd * normal.draw());
        let (off, tilt) = (draw(limit(PLACE_LIMIT)), draw(limit(TILT_LIMIT.to_radians())));
        let (place, turned) = if lying {
            let place = Vector3::new(0.0, 0.5 * LENGTH, BOTTOM + 0.5 * DIAMETER);
            // x stays, y goes to z, z to −y.
            (place, Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0))
        } else {
            (Vector3::new(0.0, 0.0, BOTTOM), Matrix3::identity())
        };
        let attitude = Rotation3::new(tilt).matrix() * turned;
        let radius = 0.5 * self.diameter;
        let across = self.mass * (0.25 * radius * radius + self.length * self.length / 12.0);
        let along = 0.5 * self.mass * radius * radius;
        let own = Matrix3::from_diagonal(&Vector3::new(across, across, along));
        Body {
            mass: self.mass,
            com: place + off + attitude * Vector3::new(0.0, 0.0, 0.5 * self.length),
            inertia: attitude * own * attitude.transpose(),
        }
    }
}

/// Returns the rig's errors in another recording: what is the rig's stays, what is the recording's is drawn
/// anew.
fn again(rig: &Errors, known: &Errors, normal: &mut Normal) -> Errors {
    let mut errors = known.draw(1.0, normal);
    let mut kept = *rig;
    for group in Group::ALL {
        if !matches!(group, Group::Skew | Group::GyroBias | Group::AccelBias | Group::Drift) {
            for (to, from) in group.of(&mut errors).into_iter().zip(group.of(&mut kept)) {
                *to = *from;
            }
        }
    }
    errors
}

/// Calibrates a rig by recordings of the cylinder, upright first.
fn calibrated(recordings: &[Recording], file: &RigFile) -> Option<RigFile> {
    let body = reference();
    let problems: Vec<Problem> = recordings
        .iter()
        .map(|recording| Problem::from_recording(recording, None, &ProblemOptions::default()).ok())
        .collect::<Option<_>>()?;
    let mut all = Vec::new();
    for (problem, mounting) in problems.iter().zip(["", "lying"]) {
        let Subject::Body { source, .. } = &problem.subject else { return None };
        let mounted = body.mounted(body.mounting(mounting).ok()?);
        all.push(ReferenceRun { name: problem.name.clone(), source, mounted });
    }
    let found = match calibrate(&all, &Silent) {
        Ok(found) => found,
        Err(error) => {
            eprintln!("    {error}");
            return None;
        }
    };
    let units: Vec<String> = found.before.iter().map(|k| k.unit.clone()).collect();
    let mut file = file.clone();
    let of = CalibratedRig::of(&file).ok()?;
    file.calibrate(RigCalibration {
        name: "cylinder".to_owned(),
        ..RigCalibration::of(&found.known, &units, of)
    })
    .ok()?;
    Some(file)
}

/// Rigs drawn from what is known of them that are calibrated by the given number of recordings, each with
/// another body then.
fn drawn(name: &str, known: Errors, motion: &Motion, recordings: usize) -> Runs {
    let nominal = Rig::lab();
    let file = rig_file(&known, &nominal.noise);
    runs(name, RIGS, |seed| {
        let mut normal = Normal::new(2_000_000 + seed);
        let errors = known.draw(1.0, &mut normal);
        let made = Made::draw(&mut normal);
        let of_cylinder: Vec<Recording> = (0..recordings)
            .map(|k| {
                let body = made.mounted(k == 1, &mut normal);
                let errors = again(&errors, &known, &mut normal);
                Rig { body, errors, ..nominal }.record(motion, &file, 10_000 * (1 + k as u64) + seed)
            })
            .collect();
        let file = if recordings == 0 { Some(file.clone()) } else { calibrated(&of_cylinder, &file) };
        let errors = again(&errors, &known, &mut normal);
        run(&Rig { errors, ..nominal }, motion, &file?, seed)
    })
}

/// Returns the table.
pub fn table() -> String {
    let mut text = "| rig | rigs | U95 of m | of c | of I_c | coverage of m | of mc, least–largest | of c | \
                    of I_c | implausible |\n\
                    |---|---|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    let body = Rig::lab().body;
    let (sheet, classes) = (Errors::data_sheet(), Errors::default_classes());
    let (lab, brisk) = (Motion::lab(), Motion::brisk());
    for (name, known, motion, recordings) in [
        ("by its data sheets", sheet, &lab, 0),
        ("calibrated, cylinder upright", sheet, &lab, 1),
        ("calibrated, upright and lying", sheet, &lab, 2),
        ("load cell of 1 %, ±1 rad", classes, &brisk, 0),
        ("load cell of 1 %, ±1 rad, calibrated, upright and lying", classes, &brisk, 2),
    ] {
        let all = drawn(name, known, motion, recordings);
        let range = |group| format!("{:.1}–{:.1} %", all.worst(group), all.best(group));
        let typical = |k: usize| all.median(|run| run.u95[k]);
        let mean =
            |group: std::ops::Range<usize>| group.clone().map(typical).sum::<f64>() / group.len() as f64;
        let moment = |k: usize| typical(TENSOR.start + k) / body.inertia[(k, k)];
        text += &format!(
            "| {name} | {} | {:.3} % | {:.3} mm | {:.2} % | {} | {} | {} | {} | {:.1} % |\n",
            all.runs.len(),
            100.0 * mean(MASS) / body.mass,
            1e3 * mean(CENTRE),
            100.0 * (0..3).map(moment).sum::<f64>() / 3.0,
            range(&MASS),
            range(&MOMENT),
            range(&CENTRE),
            range(&TENSOR),
            all.share(|run| run.status == Status::Implausible),
        );
    }
    text
}

//! `rigident vibration stiffness`: the springs by a body that is known.

use std::process::ExitCode;

use nalgebra::{DMatrix, DVector, Matrix6};
use serde::Serialize;

use super::outcome::say;
use super::vibration_arguments::Stiffness;
use super::{ExitStatus, Failure, Stages};
use rigident::fit::figures::significant;
use rigident::reference::ReferenceBody;
use rigident::vibration::suspension::bare::bare_parameters;
use rigident::vibration::suspension::free_decay::vibration;
use rigident::vibration::suspension::springs::COORDINATES;
use rigident::vibration::suspension::stiffness::{FoundStiffness, stiffness};
use rigident::vibration::suspension::support::Support;
use rigident_io::recording::Recording;

/// The ratio of the residuals to those by chance from which on body, springs or modes contradict each other.
const CONTRADICTED: f64 = 4.0;

/// The object of `--json`.
#[derive(Serialize)]
struct Object {
    schema: &'static str,
    recording: String,
    modes_hz: Vec<f64>,
    at_m: [f64; 3],
    anchor_height_m: f64,
    stiffness: [[f64; 6]; 6],
    stiffness_element_std: [[f64; 6]; 6],
    variance_ratio: f64,
    degrees_of_freedom: f64,
    findings: Vec<String>,
    warnings: Vec<String>,
}

/// `rigident vibration stiffness`
pub(super) fn run(arguments: &Stiffness) -> Result<ExitCode, Failure> {
    let stages = Stages::new(&format!("reading {}", arguments.recording.display()));
    let body = ReferenceBody::load(&arguments.body).map_err(Failure::input)?;
    let mounting = body.mounting(&arguments.mounting).map_err(Failure::input)?;
    let mut mounted = body.mounted(mounting);
    let recording =
        Recording::load(&arguments.recording, arguments.rig.as_deref()).map_err(Failure::input)?;
    let support = Support::of(&recording.rig, &recording.name).map_err(Failure::input)?;
    let table = recording.rig.suspension.clone().unwrap_or_default();
    let mut warnings = recording.warnings.clone();
    if let Some((mean, covariance)) = bare_parameters(&table) {
        let own: [f64; 10] = std::array::from_fn(|k| mean[k]);
        mounted = mounted.with_fixture(&own, &DMatrix::from_fn(10, 10, |i, j| covariance[(i, j)]));
    }
    if table.platform.is_none() {
        warnings.push(
            "[suspension.platform] is not stated: the platform is taken to weigh nothing, and the springs come out too soft for it"
                .to_owned(),
        );
    }
    stages.at("modes", 0.1);
    let found = vibration(&recording, &support, arguments.modes).map_err(Failure::input)?;
    if let Err(why) = found.judge(support.free.len()) {
        return Err(Failure::input(format!("{}: {why}", recording.name)));
    }
    let shapes = &found.modes.shapes;
    let known = (&DVector::from_column_slice(&mounted.parameters), &mounted.covariance());
    let springs = stiffness(&table, &support, shapes, known).ok_or_else(|| {
        Failure::input(format!(
            "{}: {} modes do not tell every element of the stiffness: strike the platform so that it moves in all directions",
            recording.name,
            shapes.modes.len()
        ))
    })?;
    drop(stages);
    let contradicted = springs.variance_ratio > CONTRADICTED;
    if contradicted {
        warnings.push(format!(
            "what is left is {:.1} times what chance gives: is the body the one on the platform, mounted so, and anchor_height_m right?",
            springs.variance_ratio.sqrt()
        ));
    }
    let others = springs.other_than(&support.springs);
    if let Some((k, [stated, found, off])) = others.iter().max_by(|a, b| a.1[2].total_cmp(&b.1[2])) {
        warnings.push(format!(
            "[suspension] states {} along {}, this body says {}: {off:.0} times what both are uncertain; is it the body of {}, mounted so? Springs that are \
             a guess have a stiffness_std of their own",
            significant(*stated, 4),
            COORDINATES[*k],
            significant(*found, 4),
            arguments.body.display()
        ));
    }
    let object = Object {
        schema: "rigident/stiffness/1",
        recording: recording.name.clone(),
        modes_hz: shapes.modes.iter().map(|mode| mode.hz()).collect(),
        at_m: table.at_m,
        anchor_height_m: support.preload.height_m(),
        stiffness: rows(&springs.stiffness),
        stiffness_element_std: rows(&springs.std),
        variance_ratio: springs.variance_ratio,
        degrees_of_freedom: springs.degrees_of_freedom,
        findings: found.modes.findings.iter().map(ToString::to_string).collect(),
        warnings,
    };
    if arguments.json {
        let json = serde_json::to_string_pretty(&object)
            .map_err(|e| Failure::input(format!("the result cannot be put into JSON: {e}")))?;
        say(json);
    } else {
        let keeps_springs = support.preload.is_more_than_a_height();
        say(words(&object, &springs, keeps_springs).trim_end());
        object.findings.iter().chain(&object.warnings).for_each(|warning| tell!("rigident: {warning}"));
    }
    Ok(ExitStatus::of(!contradicted && others.is_empty()).into())
}

fn rows(matrix: &Matrix6<f64>) -> [[f64; 6]; 6] {
    std::array::from_fn(|i| std::array::from_fn(|j| matrix[(i, j)]))
}

/// The keys as a rig file has them.
fn words(object: &Object, found: &FoundStiffness, keeps_springs: bool) -> String {
    let matrix = |name: &str, matrix: &Matrix6<f64>| {
        let row = |i: usize| {
            let cells: Vec<String> = (0..6).map(|j| format!("{:.3}", matrix[(i, j)])).collect();
            format!("  [{}],\n", cells.join(", "))
        };
        format!("{name} = [\n{}]\n", (0..6).map(row).collect::<String>())
    };
    let springs = if keeps_springs {
        "# keep the [[suspension.spring]] tables: they lean, or have a length, and say what the weight does\n"
    } else {
        ""
    };
    format!(
        "# {}: {} modes; what is left is {:.2} times what chance gives ({:.0} degrees of freedom)\n{springs}[suspension]\nat_m = {:?}\n\
         anchor_height_m = {:.6}\n{}{}",
        object.recording,
        object.modes_hz.len(),
        found.variance_ratio.sqrt(),
        found.degrees_of_freedom,
        object.at_m,
        object.anchor_height_m,
        matrix("stiffness", &found.stiffness),
        matrix("stiffness_element_std", &found.std)
    )
}

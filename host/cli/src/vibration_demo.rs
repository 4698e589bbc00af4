//! `rigident vibration demo`: the vibration paper's experiment, simulated and identified.

use std::process::ExitCode;

use hexapod::BodyParameters;
use nalgebra::DVector;
use serde::Serialize;

use super::arguments::DemoBody;
use super::outcome::say;
use super::vibration_arguments::DemoVibration;
use super::{ExitStatus, Failure, Folder, Stages, vibration_identify};
use rigident::application::bare_platform::take_platform_off;
use rigident::fit::figures::{NOT_IDENTIFIED, with_u95};
use rigident::laboratory::suspended::{Experiment, truth};
use rigident::problem::{Problem, ProblemOptions};
use rigident::rows::named_model::rig_links;
use rigident::vibration::suspension::free_decay::vibration;
use rigident::vibration::suspension::posture_modes::{PostureModes, posture_rows};
use rigident::vibration::suspension::posture_sets::{OpenBounds, RANK, Subset};
use rigident::vibration::suspension::support::Support;
use rigident_fit::pool::PooledFactor;
use rigident_fit::{Fit, FitOptions, Measured, Silent, fit};
use rigident_io::recording::Recording;
use rigident_io::rig::RigFile;
use rigident_model::Model;

/// Names of Table 4: M, MS and J of both links.
const NAMES: [&str; 19] = [
    "base.M", "base.MSx", "base.MSy", "base.MSz", "base.Jxx", "base.Jyy", "base.Jzz", "base.Jyz", "base.Jzx",
    "base.Jxy", "arm.MSx", "arm.MSy", "arm.MSz", "arm.Jxx", "arm.Jyy", "arm.Jzz", "arm.Jyz", "arm.Jzx",
    "arm.Jxy",
];
/// The values that the paper identified: its Table 4, row ID; mass was weighed.
const PAPER: [f64; 19] = [
    80.817, 0.0599, -20.2678, -7.6113, 8.9788, 2.3708, 7.6291, -2.5027, 0.0121, 0.0192, -0.0177, 0.3212,
    -2.6268, 0.5369, 0.5607, 0.0543, 0.0519, -0.0087, -0.0052,
];
/// Errors of the paper, Table 5: E_MS / M_0 in m and E_J / I_m of both links.
const PAPER_ERRORS: [[f64; 2]; 2] = [[0.0007, 0.0003], [0.003_657, 0.001_006]];
/// Largest moment that Table 5 divides by, kg m².
const LARGEST_MOMENT: f64 = 8.946;
/// Steps of the bounded search.
const STEPS: usize = 200;

/// The object of `--json`.
#[derive(Serialize)]
struct Object {
    schema: &'static str,
    seed: u64,
    marker_noise_mm: f64,
    table_3: Vec<Row>,
    table_4: Vec<Row>,
    table_5: Vec<ErrorRow>,
    jyy: Jyy,
}

#[derive(Serialize)]
struct Row {
    name: String,
    unit: String,
    truth: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    value: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    u95: Option<f64>,
    paper: f64,
}

#[derive(Serialize)]
struct ErrorRow {
    link: &'static str,
    first_moment_by_mass_m: f64,
    paper_first_moment_by_mass_m: f64,
    tensor_by_largest: f64,
    paper_tensor_by_largest: f64,
}

/// Jyy of the base by three ways, kg m².
#[derive(Serialize)]
struct Jyy {
    bounded_search: f64,
    least_squares: f64,
    merged: f64,
    merged_u95: f64,
    least: f64,
    most: f64,
    truth: f64,
    paper: f64,
}

/// `rigident vibration demo`
pub(super) fn run(arguments: &DemoVibration) -> Result<ExitCode, Failure> {
    if !(arguments.marker_noise_mm.is_finite() && (0.0..=10.0).contains(&arguments.marker_noise_mm)) {
        return Err(Failure::input(format!(
            "--marker-noise-mm {}: must be 0 to 10",
            arguments.marker_noise_mm
        )));
    }
    if let Some(out) = &arguments.out {
        Folder::check(out)?;
    }
    if let Some(body) = arguments.body {
        return of_body(arguments, body);
    }
    let experiment = Experiment::new([0.0; 3], 1e-3 * arguments.marker_noise_mm, arguments.seed);
    let rig = experiment.rig_file();
    let stages = Stages::new("simulating the postures");
    let postures: Vec<(Recording, [f64; 4])> = Experiment::postures()
        .into_iter()
        .enumerate()
        .map(|(k, wxyz)| Ok((experiment.posture(k, wxyz).map_err(Failure::input)?, wxyz)))
        .collect::<Result<_, Failure>>()?;
    stages.at("simulating the release", 0.2);
    let release = experiment.release().map_err(Failure::input)?;
    stages.at("modes of the postures", 0.4);
    let model = rig_links::from_tables(&rig.link, "the demonstration").map_err(Failure::input)?;
    let by_postures = by_postures(&postures, &rig, &model.welded())?;
    stages.at("the motion", 0.8);
    let problem = Problem::from_recording(&release, Some(&model), &ProblemOptions::default())
        .map_err(Failure::input)?;
    let by_motion = fit(problem.source(), &FitOptions::default(), &Silent).map_err(Failure::input)?;
    let object = object(arguments, &rig, &model.welded(), &by_postures, &by_motion)?;
    drop(stages);
    let folder = Folder::new(arguments.out.as_deref(), "vibration")?;
    for recording in postures.iter().map(|(recording, _)| recording).chain([&release]) {
        folder.write(&format!("{}.csv", recording.name), recording.to_csv().as_bytes())?;
        folder.write(&format!("{}.rig.toml", recording.name), rig.to_toml().as_bytes())?;
    }
    for (name, found) in [("postures", &by_postures), ("release", &by_motion)] {
        folder.write(&format!("{name}.factor"), &PooledFactor::of(found, name).to_bytes())?;
    }
    let json = serde_json::to_string_pretty(&object)
        .map_err(|e| Failure::input(format!("the result cannot be put into JSON: {e}")))?;
    folder.write_text("result.json", &json)?;
    if arguments.json {
        say(json);
    } else {
        say(words(&object).trim_end());
        say(format_args!("\nFiles in {}", folder.path().display()));
    }
    Ok(ExitStatus::of(object.table_4.iter().all(|row| row.value.is_some())).into())
}

/// One body on the springs, identified as `rigident vibration identify` does.
fn of_body(arguments: &DemoVibration, body: DemoBody) -> Result<ExitCode, Failure> {
    let body = match body {
        DemoBody::Horizontal => BodyParameters::thesis_horizontal(),
        DemoBody::Vertical => BodyParameters::thesis_vertical(),
    };
    let experiment = Experiment::of_body(body, 1e-3 * arguments.marker_noise_mm, arguments.seed);
    let stages = Stages::new("simulating the vibration");
    let recording = experiment.swing().map_err(Failure::input)?;
    drop(stages);
    let folder = Folder::new(arguments.out.as_deref(), "vibration")?;
    folder.write("swing.csv", recording.to_csv().as_bytes())?;
    folder.write("swing.rig.toml", recording.rig.to_toml().as_bytes())?;
    vibration_identify::identify(recording, None, Some(&folder), arguments.json)
}

/// All postures as rows of the base parameters, the platform among them.
fn by_postures(postures: &[(Recording, [f64; 4])], rig: &RigFile, model: &Model) -> Result<Fit, Failure> {
    let support = Support::of(rig, "the demonstration").map_err(Failure::input)?;
    let mut all = Vec::new();
    for (recording, wxyz) in postures {
        let found = vibration(recording, &support, None).map_err(Failure::input)?;
        if let Err(why) = found.judge(support.free.len()) {
            return Err(Failure::input(format!("{}: {why}", recording.name)));
        }
        all.push(PostureModes {
            name: recording.name.clone(),
            positions: wxyz.to_vec(),
            shapes: found.modes.shapes,
        });
    }
    let source = posture_rows(model, &support, &all).map_err(Failure::input)?;
    fit(&source, &FitOptions::default(), &Silent).map_err(Failure::input)
}

fn object(
    arguments: &DemoVibration,
    rig: &RigFile,
    model: &Model,
    by_postures: &Fit,
    by_motion: &Fit,
) -> Result<Object, Failure> {
    let factors =
        [(by_postures, "postures"), (by_motion, "release")].map(|(fit, name)| PooledFactor::of(fit, name));
    let [postures, motion] = factors;
    let without_offsets = PooledFactor::merged(vec![motion.clone()], false).map_err(Failure::input)?;
    let mut merged =
        PooledFactor::merged(vec![postures.clone(), motion], false).map_err(Failure::input)?.fit();
    let (mut alone, mut moving) = (postures.fit(), without_offsets.only(|p| p.kind.is_inertial()).fit());
    if let Some(table) = &rig.suspension {
        for found in [&mut merged, &mut alone, &mut moving] {
            take_platform_off(table, found).map_err(Failure::input)?;
        }
    }
    let subset = Subset::new(&merged.parameters, model);
    let truth = truth();
    let truth_of = |name: &str| truth_of(&truth, name);
    let table_3 = subset
        .values(&alone)
        .into_iter()
        .map(|v| Row {
            truth: truth_of(&v.name),
            value: v.measured.map(|m| m.value),
            u95: v.measured.map(|m| m.u95),
            paper: self::truth_of(&PAPER, &v.name),
            name: v.name,
            unit: v.unit,
        })
        .collect();
    let value = |name: &str| -> Option<Measured> {
        merged.estimate.measured(merged.parameters.iter().position(|p| p.name == name)?)
    };
    let table_4: Vec<Row> = NAMES
        .iter()
        .enumerate()
        .map(|(k, name)| Row {
            name: (*name).to_owned(),
            unit: merged
                .parameters
                .iter()
                .find(|p| p.name == *name)
                .map_or_else(String::new, |p| p.unit.clone()),
            truth: truth[k],
            value: value(name).map(|m| m.value),
            u95: value(name).map(|m| m.u95),
            paper: PAPER[k],
        })
        .collect();
    let bounds = subset.bounds(&alone, None);
    let jyy = value("base.Jyy")
        .zip(bounds)
        .and_then(|(found, bounds)| jyy(&subset, [&alone, &moving], &bounds, found));
    let jyy = jyy.ok_or_else(|| {
        Failure::input("the postures do not tell all that they should: more noise than the paper's")
    })?;
    Ok(Object {
        schema: "rigident/vibration-demo/1",
        seed: arguments.seed,
        marker_noise_mm: arguments.marker_noise_mm,
        table_5: table_5(&table_4),
        table_3,
        table_4,
        jyy,
    })
}

/// A quantity of Φ_s or of Table 4, of the numbers of Table 4.
fn truth_of(all: &[f64; 19], name: &str) -> f64 {
    let of = |name: &str| NAMES.iter().position(|own| *own == name).map_or(f64::NAN, |k| all[k]);
    if name == "sum of Jyy" {
        return of("base.Jyy") + of("arm.Jyy");
    }
    match name.strip_suffix("-Jyy") {
        Some(first) => of(first) - of(&format!("{}.Jyy", first.split('.').next().unwrap_or_default())),
        None => of(name),
    }
}

/// Largest errors of each link's first moments by the whole mass, and of its tensor by the largest moment.
fn table_5(table_4: &[Row]) -> Vec<ErrorRow> {
    let error = |range: std::ops::Range<usize>| {
        table_4[range].iter().map(|row| (row.value.unwrap_or(f64::NAN) - row.truth).abs()).fold(0.0, f64::max)
    };
    let of = |link: &'static str, k: usize, from: usize| ErrorRow {
        link,
        first_moment_by_mass_m: error(from..from + 3) / truth()[0],
        paper_first_moment_by_mass_m: PAPER_ERRORS[0][k],
        tensor_by_largest: error(from + 3..from + 9) / LARGEST_MOMENT,
        paper_tensor_by_largest: PAPER_ERRORS[1][k],
    };
    vec![of("base", 0, 1), of("arm", 1, 10)]
}

/// Jyy of the base with Φ_s as the postures have it: by a search within the bounds, and in closed form; beside the merged solve.
fn jyy(subset: &Subset, [alone, moving]: [&Fit; 2], bounds: &OpenBounds, merged: Measured) -> Option<Jyy> {
    let told = subset.factor(&alone.scaled_factor()).solve(RANK);
    let there = subset.factor(&moving.scaled_factor());
    let (r, z) = (there.r(), DVector::from_column_slice(there.z()));
    let [arm] = *subset.open() else { return None };
    // The open column is Jyy of the arm: Σ Jyy less that of the base.
    let sum = alone.parameters.iter().position(|p| p.name == "base.Jyy")?;
    let mut psi = DVector::from_vec(told.estimate);
    let total = psi[sum];
    psi[arm] = 0.0;
    let left = &z - &r * &psi;
    let column = r.column(arm);
    let residual = |base: f64| (&left - column * (total - base)).norm_squared();
    let (mut low, mut high) = (bounds.least, bounds.most);
    for _ in 0..STEPS {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if residual(a) < residual(b) { high = b } else { low = a }
    }
    let closed = total - column.dot(&left) / column.norm_squared();
    Some(Jyy {
        bounded_search: 0.5 * (low + high),
        least_squares: closed,
        merged: merged.value,
        merged_u95: merged.u95,
        least: bounds.least,
        most: bounds.most,
        truth: truth()[5],
        paper: PAPER[5],
    })
}

fn words(object: &Object) -> String {
    let mut out = String::new();
    let tables = [
        ("Table 3: what three locked postures tell", &object.table_3),
        ("Table 4: with the motion of link 1", &object.table_4),
    ];
    for (title, rows) in tables {
        out.push_str(&format!(
            "{title}\n  {:<14} {:>10} {:>24} {:>10} {:>10} {:>10}\n",
            "", "truth", "ours ± U95", "error", "paper", "its error"
        ));
        for row in rows {
            let cell = row.value.zip(row.u95);
            let cell = cell.map_or_else(|| NOT_IDENTIFIED.to_owned(), |(v, u)| with_u95(v, u, ""));
            let error = row.value.map_or_else(String::new, |v| format!("{:.4}", v - row.truth));
            out.push_str(&format!(
                "  {:<14} {:>10.4} {cell:>24} {error:>10} {:>10.4} {:>10.4}\n",
                row.name,
                row.truth,
                row.paper,
                row.paper - row.truth
            ));
        }
        out.push('\n');
    }
    out.push_str("Table 5: largest errors\n                       E_MS / M_0 (mm)       paper     E_J / I_m (%)       paper\n");
    for row in &object.table_5 {
        out.push_str(&format!(
            "  {:<14} {:>21.3} {:>11.1} {:>17.3} {:>11.3}\n",
            row.link,
            1e3 * row.first_moment_by_mass_m,
            1e3 * row.paper_first_moment_by_mass_m,
            100.0 * row.tensor_by_largest,
            100.0 * row.paper_tensor_by_largest
        ));
    }
    let j = &object.jyy;
    out.push_str(&format!(
        "\nJyy of the base, kg m²: {:.4} < {:.4} < {:.4} (Eq. 19)\n  bounded search, as the paper  {:.4}\n  least squares                 {:.4}\n  \
         all rows merged               {:.4} ± {:.4}\n  truth {:.4}, paper {:.4}\n",
        j.least, j.truth, j.most, j.bounded_search, j.least_squares, j.merged, j.merged_u95, j.truth, j.paper
    ));
    out
}

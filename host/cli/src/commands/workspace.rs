use std::path::Path;
use std::process::ExitCode;

use hexapod::{Geometry, Segment};
use serde::Serialize;

use crate::commands::plan::arguments::Workspace;
use crate::commands::run::programme::tell_collisions;
use crate::screen::outcome::say;
use crate::{Failure, Folder, Progress};
use rigident::device::session::INTERRUPTED;
use rigident::plan::machine;
use rigident::plan::plan_file::PlanFile;
use rigident::plan::workspace::{Map, MapError, Reach, Span};
use rigident::present::workspace as figure;
use rigident_io::rig::RigFile;

/// Directions of lean in the summary.
const AZIMUTHS: usize = 24;

/// The object of `--json`. Rows of the maps are rolls, columns pitches.
#[derive(Serialize)]
struct Object<'a> {
    roll_deg: &'a [f64],
    pitch_deg: &'a [f64],
    reachable: &'a [Vec<bool>],
    singularity_free: &'a [Vec<bool>],
    yaw_deg: f64,
    leg_length_m: [f64; 2],
    cond_max: f64,
    tilt: Vec<Tilt>,
}

/// The angle by which the plate leans in one direction.
#[derive(Serialize)]
struct Tilt {
    azimuth_deg: f64,
    reachable_deg: f64,
    singularity_free_deg: f64,
}

/// Runs `rigident workspace`.
pub(crate) fn run(arguments: &Workspace) -> Result<ExitCode, Failure> {
    let geometry = platform(arguments.rig.as_deref(), arguments.stroke_m)?;
    let span =
        Span { most_deg: arguments.range_deg, step_deg: arguments.step_deg, yaw_deg: arguments.yaw_deg };
    let poses = arguments.plan.as_deref().map(|path| still_poses(path, &geometry)).transpose()?;
    // One that cannot be written to is reported before anything is computed.
    let asked_for = arguments.out.as_deref().map(|out| Folder::new(Some(out), "workspace")).transpose()?;
    let mut progress = Progress::new();
    let map = Map::make(&geometry, &span, &INTERRUPTED, |share| {
        progress.show(|| format!("orientations: {:.0} %", 100.0 * share));
    })
    .map_err(|error| match error {
        MapError::Interrupted => Failure::interrupted(error),
        error => Failure::input(error),
    })?;
    progress.show(|| "largest tilts".to_owned());
    let reach = Reach::around(&geometry, span.yaw_deg, AZIMUTHS);
    progress.finish();

    let object = Object {
        roll_deg: &map.roll_deg,
        pitch_deg: &map.pitch_deg,
        reachable: &map.reachable,
        singularity_free: &map.singularity_free,
        yaw_deg: span.yaw_deg,
        leg_length_m: geometry.leg_length_m,
        cond_max: geometry.limits.cond_max,
        tilt: reach
            .iter()
            .map(|r| Tilt {
                azimuth_deg: r.azimuth_deg,
                reachable_deg: hundredths(r.reachable_deg),
                singularity_free_deg: hundredths(r.singularity_free_deg),
            })
            .collect(),
    };
    let json = serde_json::to_string(&object).map_err(Failure::input)?;
    if arguments.json {
        say(&json);
    } else {
        say(summary(&geometry, &span, &map, &reach));
    }
    // Whoever reads the object has asked for no files.
    if arguments.json && arguments.out.is_none() {
        return Ok(ExitCode::SUCCESS);
    }
    let folder = asked_for.map_or_else(|| Folder::new(None, "workspace"), Ok)?;
    folder.write_text("workspace.json", &json)?;
    let file = folder
        .write("workspace.svg", picture(&geometry, &span, &map, &poses.unwrap_or_default()).as_bytes())?;
    if !arguments.json {
        say(format_args!("\nBoth maps over each other: open {} in a browser.", file.display()));
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns the platform of a rig file, or the thesis' one, with the middle of its stroke.
fn platform(rig: Option<&Path>, stroke_m: Option<f64>) -> Result<Geometry, Failure> {
    let geometry = match rig {
        None => Geometry::thesis(),
        Some(path) => {
            let file = RigFile::load(path).map_err(Failure::input)?;
            let named = |e: machine::MachineError| Failure::input(format!("{}: {e}", path.display()));
            let geometry = machine::with_joints(&file).map_err(named)?;
            tell_collisions(&geometry);
            geometry
        }
    };
    let Some(stroke) = stroke_m else { return Ok(geometry) };
    let geometry = geometry.with_stroke(stroke).map_err(|e| Failure::input(format!("--stroke-m: {e}")))?;
    machine::check(&geometry).map_err(Failure::input)?;
    Ok(geometry)
}

fn hundredths(degrees: f64) -> f64 {
    (degrees * 100.0).round() / 100.0
}

/// Returns the share of the map whose cells are true.
fn share(cells: &[Vec<bool>]) -> f64 {
    let all = cells.iter().map(Vec::len).sum::<usize>().max(1);
    cells.iter().flatten().filter(|c| **c).count() as f64 / all as f64
}

fn describe(geometry: &Geometry, span: &Span) -> String {
    let [lo, hi] = geometry.leg_length_m;
    format!("legs from {lo:.4} m to {hi:.4} m, yaw {}°", span.yaw_deg)
}

fn summary(geometry: &Geometry, span: &Span, map: &Map, reach: &[Reach]) -> String {
    let cond_max = geometry.limits.cond_max;
    let mut text = format!(
        "Workspace over roll and pitch, {}: {} orientations.\n  within the limits of legs and joints {:>5.1} \
         %\n  and cond(H) ≤ {cond_max:<18} {:>5.1} %\n\nLargest tilt, all smaller ones included:\n\n  \
         leaning to   legs and joints   and cond(H)\n           °                 °             °",
        describe(geometry, span),
        map.roll_deg.len() * map.pitch_deg.len(),
        100.0 * share(&map.reachable),
        100.0 * share(&map.singularity_free),
    );
    for r in reach {
        text += &format!(
            "\n  {:>10.0} {:>17.1} {:>13.1}",
            r.azimuth_deg, r.reachable_deg, r.singularity_free_deg
        );
    }
    let range = |value: fn(&Reach) -> f64| {
        reach.iter().map(value).fold((90.0_f64, 0.0_f64), |(lo, hi), v| (lo.min(v), hi.max(v)))
    };
    let (held, free) = (range(|r| r.reachable_deg), range(|r| r.singularity_free_deg));
    text += &format!("\n  {:>10} {:>17.1} {:>13.1}", "least", held.0, free.0);
    text += &format!("\n  {:>10} {:>17.1} {:>13.1}", "largest", held.1, free.1);
    text
}

/// Returns roll and pitch of the poses that a plan holds, degrees, each once.
fn still_poses(path: &Path, geometry: &Geometry) -> Result<Vec<[f64; 2]>, Failure> {
    let plan = PlanFile::read(path, geometry).map_err(Failure::input)?;
    let trajectory = plan.program.trajectory().map_err(Failure::input)?;
    let (mut poses, mut begun_s) = (Vec::<[f64; 2]>::new(), 0.0);
    for segment in &plan.program.segments {
        let [roll, pitch, _] = trajectory.state(begun_s).pose().rpy_rad.map(f64::to_degrees);
        let new = poses.iter().all(|[r, p]| (r - roll).abs().max((p - pitch).abs()) > 0.01);
        if matches!(segment, Segment::Hold { .. }) && new {
            poses.push([roll, pitch]);
        }
        begun_s += segment.duration_s();
    }
    Ok(poses)
}

fn picture(geometry: &Geometry, span: &Span, map: &Map, poses_deg: &[[f64; 2]]) -> String {
    figure::Workspace {
        title: "Where the plate can be tilted to",
        subtitle: &describe(geometry, span),
        roll_deg: &map.roll_deg,
        pitch_deg: &map.pitch_deg,
        reachable: &map.reachable,
        singularity_free: &map.singularity_free,
        cond_max: geometry.limits.cond_max,
        poses_deg,
    }
    .svg()
}

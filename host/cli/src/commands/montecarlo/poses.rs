use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::sync::mpsc;

use hexapod::Geometry;
use nalgebra::Vector3;
use serde::Serialize;

use crate::commands::factor::absent;
use crate::commands::montecarlo_arguments::MontecarloPoses;
use crate::screen::outcome::say;
use crate::{ExitStatus, Failure, Progress};
use rigident::device::session::INTERRUPTED;
use rigident::plan::poses::measure::up_in_plate;
use rigident::plan::poses::montecarlo::{
    Errors, Estimator, Experiment, Mounting, Row, Spread, reduction, section_6_3,
};
use rigident::plan::poses::plan::{Task, check_n, plan};
use rigident::plan::poses::{Objective, Reach, Region};
use rigident::present::over_n;
use rigident::present::probability::{Panel, Sample, straightness, svg};
use rigident_io::recording::new_file::write_new_text;

/// The object of `--json`.
#[derive(Serialize)]
struct Object {
    runs: u64,
    experiments: Vec<Cell>,
    reductions: Vec<Reduction>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    normality: Vec<Normality>,
}

#[derive(Serialize)]
struct Cell {
    n: usize,
    mounting: &'static str,
    errors: &'static str,
    estimators: Vec<Figures>,
}

/// Centre of mass, x, y, z, mm.
#[derive(Serialize)]
struct Figures {
    name: &'static str,
    bias_mm: [f64; 3],
    u997_mm: [f64; 3],
    predicted_u997_mm: [f64; 3],
}

/// The reduction of the worst axis' uncertainty when lying instead of standing, thesis' estimator.
#[derive(Serialize)]
struct Reduction {
    n: usize,
    errors: &'static str,
    share: f64,
}

/// Correlation with the normal quantiles.
#[derive(Serialize)]
struct Normality {
    n: usize,
    mounting: &'static str,
    correlation: [Option<f64>; 3],
}

/// Runs `rigident montecarlo poses`.
pub(crate) fn run(arguments: &MontecarloPoses) -> Result<ExitCode, Failure> {
    let MontecarloPoses { from, to, plot_n, .. } = *arguments;
    for n in [from, to] {
        check_n(n, &Objective::Condition).map_err(|e| Failure::input(e).context("--from and --to"))?;
    }
    if from > to {
        return Err(Failure::input(format!("--from {from} --to {to}: fewest first")));
    }
    if arguments.plot.is_some() && !(from..=to).contains(&plot_n) {
        return Err(Failure::input(format!("--plot-n {plot_n}: it must be within {from} to {to}")));
    }
    // Said now rather than after the work.
    for path in [&arguments.plot, &arguments.plot_over_n].into_iter().flatten() {
        absent(path)?;
    }
    let mut progress = Progress::new();
    let sets = sets(arguments, &mut progress)?;
    let (sender, counts) = mpsc::channel();
    let rows = std::thread::scope(|scope| {
        let work = scope.spawn(|| {
            let sender = std::sync::Mutex::new(sender);
            section_6_3(&sets, arguments.runs, arguments.seed, &INTERRUPTED, |done, all| {
                // Progress that nobody takes is no reason to stop the work.
                let _ = sender.lock().map(|s| s.send((done, all)));
            })
        });
        for (done, all) in counts {
            progress.show(|| format!("{done} of {all} experiments, {} runs each", arguments.runs));
        }
        work.join().unwrap_or_default()
    });
    progress.finish();
    let normality = match (&arguments.plot, sets.iter().find(|ups| ups.len() == plot_n)) {
        (Some(path), Some(ups)) => plot(arguments, path, ups)?,
        _ => Vec::new(),
    };
    if let Some(path) = &arguments.plot_over_n {
        let title = "Uncertainty of the centre of mass over the number of poses";
        write_new_text(path, &over_n::svg(title, &over_n(&rows))).map_err(Failure::input)?;
        tell!("{}", path.display());
    }
    let reductions = reductions(&rows);
    if arguments.json {
        let experiments = rows.iter().map(cell).collect();
        let object = Object { runs: arguments.runs, experiments, reductions, normality };
        say(serde_json::to_string(&object).map_err(Failure::input)?);
    } else {
        say(tables(&rows, &reductions));
        for Normality { n, mounting, correlation } in &normality {
            let r = correlation.map(|r| r.map_or("-".to_owned(), |r| format!("{r:.4}"))).join(", ");
            say(format_args!("{n} poses, {mounting}: correlation with the normal quantiles {r}"));
        }
    }
    if INTERRUPTED.load(Ordering::Relaxed) {
        tell!("rigident: stopped after {} experiments", rows.len());
        return Ok(ExitStatus::NotIdentified.into());
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns the planned poses, one set for each number of them.
fn sets(arguments: &MontecarloPoses, progress: &mut Progress) -> Result<Vec<Vec<Vector3<f64>>>, Failure> {
    let reach = Reach::new(Geometry::thesis(), arguments.stroke_m).map_err(Failure::input)?;
    let region = Region::of_platform(&reach);
    (arguments.from..=arguments.to)
        .map(|n| {
            let task = Task::thesis(n);
            progress.show(|| format!("planning {n} poses"));
            let made = plan(&reach, &region, &task, &INTERRUPTED, |_| ()).map_err(Failure::input)?;
            Ok(made.poses.iter().map(|p| up_in_plate([p.rpy_rad[0], p.rpy_rad[1]])).collect())
        })
        .collect()
}

fn plot(arguments: &MontecarloPoses, path: &Path, ups: &[Vector3<f64>]) -> Result<Vec<Normality>, Failure> {
    let mut normality = Vec::new();
    let panels: Vec<Panel> = Mounting::ALL
        .into_iter()
        .map(|mounting| {
            let experiment = Experiment::new(mounting, Errors::Both, ups);
            let errors = experiment.errors(Estimator::MeasuredForces, arguments.runs, arguments.seed);
            let along = |axis: usize| errors.iter().map(|e| 1e3 * e[axis]).collect::<Vec<_>>();
            normality.push(Normality {
                n: ups.len(),
                mounting: mounting.name(),
                correlation: std::array::from_fn(|axis| straightness(&along(axis))),
            });
            Panel {
                title: format!("{} poses, {}, {} runs", ups.len(), mounting.name(), arguments.runs),
                unit: "error of the centre of mass, mm".to_owned(),
                samples: ["b1", "b2", "b3"]
                    .into_iter()
                    .enumerate()
                    .map(|(axis, name)| Sample { name: name.to_owned(), values: along(axis) })
                    .collect(),
            }
        })
        .collect();
    write_new_text(path, &svg(&panels)).map_err(Failure::input)?;
    tell!("{}", path.display());
    Ok(normality)
}

/// Returns the worst axis of every estimator over the number of poses, noise and offset together, both
/// mountings.
fn over_n(rows: &[Row]) -> Vec<over_n::Panel> {
    let panel = |mounting: Mounting| {
        let of: Vec<&Row> =
            rows.iter().filter(|r| r.mounting == mounting && r.errors == Errors::Both).collect();
        let curve = |(k, estimator): (usize, Estimator)| {
            let points = |value: fn(&Spread) -> f64| {
                let point = |row: &&Row| row.spreads[k].as_ref().map(|s| (row.n as f64, 3e3 * value(s)));
                of.iter().filter_map(point).collect()
            };
            over_n::Curve {
                name: estimator.name().replace('_', " "),
                found: points(|s| s.sd.max()),
                predicted: points(|s| s.predicted_sd.max()),
            }
        };
        over_n::Panel {
            title: format!("{}, worst axis, 99.7 %", mounting.name()),
            unit: "mm".to_owned(),
            curves: Estimator::ALL.into_iter().enumerate().map(curve).collect(),
        }
    };
    Mounting::ALL.into_iter().map(panel).collect()
}

fn millimetres(v: Vector3<f64>) -> [f64; 3] {
    (v * 1e3).into()
}

fn cell(row: &Row) -> Cell {
    let figures = |(estimator, spread): (Estimator, &Option<Spread>)| {
        spread.as_ref().map(|s| Figures {
            name: estimator.name(),
            bias_mm: millimetres(s.bias),
            u997_mm: millimetres(s.sd * 3.0),
            predicted_u997_mm: millimetres(s.predicted_sd * 3.0),
        })
    };
    Cell {
        n: row.n,
        mounting: row.mounting.name(),
        errors: row.errors.name(),
        estimators: Estimator::ALL.into_iter().zip(&row.spreads).filter_map(figures).collect(),
    }
}

fn reductions(rows: &[Row]) -> Vec<Reduction> {
    let of = |mounting| rows.iter().filter(move |r| r.mounting == mounting);
    of(Mounting::Vertical)
        .filter_map(|vertical| {
            let horizontal =
                of(Mounting::Horizontal).find(|h| h.n == vertical.n && h.errors == vertical.errors)?;
            let ([Some(v), ..], [Some(h), ..]) = (&vertical.spreads, &horizontal.spreads) else {
                return None;
            };
            Some(Reduction { n: vertical.n, errors: vertical.errors.name(), share: reduction(v, h) })
        })
        .collect()
}

fn tables(rows: &[Row], reductions: &[Reduction]) -> String {
    let mut text = "Centre of mass, 99.7 % uncertainty, mm\n\n".to_owned();
    text += "Measured forces in the regressor (the thesis)          Worst axis by other estimators\n";
    text += "   n  mounting    errors        b1      b2      b3      relative  modelled  and weighed";
    for row in rows {
        let number = |v: f64| format!("{:.1}", 3e3 * v);
        let axes = |s: &Option<Spread>| match s {
            Some(s) => std::array::from_fn(|k| number(s.sd[k])),
            None => ["-"; 3].map(str::to_owned),
        };
        let worst = |s: &Option<Spread>| s.as_ref().map_or("-".to_owned(), |s| number(s.sd.max()));
        let [measured, relative, modelled, weighed] = &row.spreads;
        let [b1, b2, b3] = axes(measured);
        text += &format!(
            "\n{:>4}  {:<10}  {:<9} {b1:>6}  {b2:>6}  {b3:>6}        {:>6}    {:>6}       {:>6}",
            row.n,
            row.mounting.name(),
            row.errors.name(),
            worst(relative),
            worst(modelled),
            worst(weighed),
        );
    }
    text += "\n\nLying instead of standing, the thesis' estimator's worst axis is better by\n   n  \
             precision    bias    both";
    for group in reductions.chunk_by(|a, b| a.n == b.n) {
        let share = |errors: Errors| {
            let found = group.iter().find(|r| r.errors == errors.name());
            found.map_or("-".to_owned(), |r| format!("{:.0} %", 100.0 * r.share))
        };
        text += &format!(
            "\n{:>4}  {:>9}  {:>6}  {:>6}",
            group.first().map_or(0, |r| r.n),
            share(Errors::Precision),
            share(Errors::Bias),
            share(Errors::Both)
        );
    }
    text
}

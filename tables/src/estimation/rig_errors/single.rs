//! One error at a time.

use super::super::problem::Normal;
use super::errors::{Errors, Group};
use super::mechanics::Motion;
use super::recording::{Disturbance, Rig, rig_file};
use super::study::{MASS, MOMENT, Run, Runs, TENSOR, largest, median, run, runs};
use rigident::answer::Status;

const RUNS: u64 = 60;
/// An error that is to be named is this many of its standard deviations.
const LARGE: f64 = 5.0;

fn coverage(all: &Runs) -> String {
    let groups = [MASS, MOMENT, TENSOR];
    let texts = groups.map(|group| {
        if group.len() == 1 {
            format!("{:.0}", all.mean(&group))
        } else {
            format!("{:.0}/{:.0}", all.mean(&group), all.worst(&group))
        }
    });
    texts.join(" | ")
}

fn status(all: &Runs) -> String {
    format!(
        "{:.0} % | {:.0} %",
        all.share(|run| run.status == Status::Identified),
        all.share(|run| run.status == Status::Identified && run.warnings.is_empty())
    )
}

/// Returns errors of which one of a group is several standard deviations large; all others are none. The seed
/// determines the one, and its sign; its name comes with it.
fn large(group: Group, known: &Errors, seed: u64) -> (Errors, String, f64) {
    let mut errors = Errors::default();
    let sigma: Vec<f64> = group.of(&mut known.clone()).into_iter().map(|v| *v).collect();
    let some: Vec<usize> = (0..sigma.len()).filter(|k| sigma[*k] > 0.0).collect();
    let at = some[seed as usize % some.len()];
    let size = if (seed / some.len() as u64).is_multiple_of(2) { LARGE } else { -LARGE } * sigma[at];
    *group.of(&mut errors)[at] = size;
    let (name, unit) = group.nuisance(at);
    (errors, name, size * unit)
}

/// Returns rows of errors that the rig file states: each alone, drawn as stated with all others stated exact;
/// then large beside all others.
fn stated() -> String {
    let motion = Motion::lab();
    let known = Errors::data_sheet();
    let nominal = Rig::lab();
    let everything = rig_file(&known, &nominal.noise);
    let mut text = "| error | m | mc | I_c | error/U95 | 5 σ: named | found | m | mc | I_c | error/U95 | \
                    identified | silent |\n\
                    |---|---|---|---|---|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for group in Group::ALL {
        let own = known.only(group);
        let file = rig_file(&own, &nominal.noise);
        let one = runs(group.name(), RUNS, |seed| {
            let errors = own.draw(1.0, &mut Normal::new(1_000_000 + seed));
            run(&Rig { errors, ..nominal }, &motion, &file, seed)
        });
        let five = runs(&format!("{} 5 sigma", group.name()), RUNS, |seed| {
            let (errors, _, _) = large(group, &known, seed);
            run(&Rig { errors, ..nominal }, &motion, &everything, seed)
        });
        let named = five.share(|run| run.named.as_deref() == Some(group.name()));
        let found = |(seed, run): (usize, &Run)| {
            let (_, name, size) = large(group, &known, seed as u64);
            run.values.iter().find(|(own, _)| *own == name).map_or(f64::NAN, |(_, value)| value / size)
        };
        let found = median(five.runs.iter().enumerate().map(found).collect());
        text += &format!(
            "| {} | {} | {:.2} | {named:.0} % | {:.0} % | {} | {:.2} | {} |\n",
            group.name(),
            coverage(&one),
            one.median(largest),
            100.0 * found,
            coverage(&five),
            five.median(largest),
            status(&five),
        );
    }
    text
}

/// Returns rows of errors that no key of the rig file states, beside all errors of a data sheet.
fn disturbed() -> String {
    let none = Disturbance::default;
    let cases = [
        ("none", none()),
        ("stamps off by 0.5 ms rms", Disturbance { jitter_s: 5e-4, ..none() }),
        ("stamps off by 2 ms rms", Disturbance { jitter_s: 2e-3, ..none() }),
        ("load cell settles by 20 σ, 8 s", Disturbance { exponential: 20.0, ..none() }),
        ("flicker noise below 1 Hz", Disturbance { flicker_hz: 1.0, ..none() }),
        ("buoyancy of 4 litres", Disturbance { volume_m3: 4e-3, ..none() }),
        ("cable of 5 N/m", Disturbance { cable_npm: 5.0, ..none() }),
        ("cable of 30 N/m", Disturbance { cable_npm: 30.0, ..none() }),
        ("air drag, C_d A 0.05 m²", Disturbance { drag_m2: 0.05, ..none() }),
        ("air drag, C_d A 0.5 m²", Disturbance { drag_m2: 0.5, ..none() }),
        ("0.3 kg swing at 5 Hz", Disturbance { elastic: Some((0.3, 5.0)), ..none() }),
        ("0.3 kg swing at 10 Hz", Disturbance { elastic: Some((0.3, 10.0)), ..none() }),
        ("50 g lost at half time", Disturbance { lost_kg: 0.05, ..none() }),
        ("200 g moved by 5 mm", Disturbance { moved: Some((0.2, 5e-3)), ..none() }),
        ("accelerometer clipped at 9.6 m/s²", Disturbance { clip_mps2: Some(9.6), ..none() }),
    ];
    let motion = Motion::lab();
    let known = Errors::data_sheet();
    let file = rig_file(&known, &Rig::lab().noise);
    let mut text =
        "| not in the rig file | m | mc | I_c | error/U95 | residuals | identified | silent | named most |\n\
                    |---|---|---|---|---|---|---|---|---|\n"
            .to_owned();
    for (name, disturbance) in cases {
        let rig = Rig { disturbance, ..Rig::lab() };
        let all = runs(name, RUNS, |seed| run(&rig, &motion, &file, seed));
        let groups = Group::ALL
            .map(|group| (group.name(), all.share(|run| run.named.as_deref() == Some(group.name()))));
        let most = groups.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, share)| *share > 0.0);
        text += &format!(
            "| {name} | {} | {:.2} | {:.2} | {} | {} |\n",
            coverage(&all),
            all.median(largest),
            all.median(|run| run.residual),
            status(&all),
            most.map_or_else(|| "–".to_owned(), |(group, share)| format!("{group}, {share:.0} %")),
        );
    }
    text
}

/// Returns the table.
pub fn table() -> String {
    format!("{}\n{}", stated(), disturbed())
}

//! Simulated people of known parameters, from markers and a force plate to their base parameters: 34 and 58
//! degrees of freedom, and 34 with a racket.

use nalgebra::DVector;
use rigident::fit::{FitOptions, Measured, Silent};
use rigident::laboratory::laboratory::{Laboratory, Somebody};
use rigident::laboratory::person::somebody;
use rigident::model::Model;
use rigident::model::base::base_parameters;
use rigident::model::human::Person as Standard;
use rigident::motion_capture::trial::Trial;
use rigident::people::body_segments::left_out::left_out;
use rigident::people::body_segments::tool::{Compared, holding};
use rigident::people::body_segments::{Study, StudyOptions};
use rigident::people::inverse_kinematics::subject::HumanModel;
use rigident::people::person::{PeopleOptions, Person};

/// People of each kind.
const PEOPLE: u64 = 4;
/// Trials of each.
const TRIALS: u64 = 6;
/// A parameter below this is small, kg, kg m, kg m².
const SMALL: f64 = 0.05;
/// A racket in the hand's frame: 0.33 kg, its centre 0.33 m below the wrist.
pub const RACKET: [f64; 10] = [0.33, 0.0066, 0.0, -0.1089, 0.05, 0.0515, 0.0017, 0.0, 0.0022, 0.0];

/// A simulated person, and what is true of her.
pub struct Subject {
    pub model: Model,
    pub truth: Vec<f64>,
    pub somebody: Somebody,
}

/// Returns somebody of a kind, no two alike.
pub fn subject(kind: HumanModel, tool: Option<[f64; 10]>, seed: u64) -> Subject {
    let height_m = 1.6 + 0.07 * (seed % 4) as f64;
    let person = Standard { height_m, mass_kg: 22.0 * height_m * height_m, ..Standard::default() };
    let model = match kind {
        HumanModel::Human34 => person.human34(),
        HumanModel::Human58 => person.human58(),
    };
    let model = model.expect("a person");
    let mut truth = somebody(&model, seed);
    if let Some(tool) = tool {
        let hand = model.link("r_hand").expect("a hand");
        truth.iter_mut().skip(10 * hand).zip(tool).for_each(|(v, more)| *v += more);
    }
    let somebody = Somebody::new(&model, &truth, height_m, seed).expect("joints that turn");
    Subject { model, truth, somebody }
}

/// The result for a person.
struct Found {
    parameters: usize,
    counts: [usize; 4],
    inside: [usize; 2],
    inside_with_table: usize,
    condition: f64,
    mass: [f64; 2],
    left_out: [f64; 2],
    used: f64,
}

fn study(subject: &Subject, kind: HumanModel, seed: u64) -> Found {
    let laboratory = Laboratory::default();
    let trial = |k: u64| subject.somebody.trial(&format!("trial {}", k + 1), &laboratory, 100 * seed + k);
    let mut trials: Vec<Trial> = (0..TRIALS).map(trial).collect();
    let options = PeopleOptions {
        kind,
        own_markers: subject.somebody.clusters().clone(),
        plates_zeroed: true,
        ..PeopleOptions::default()
    };
    let standing = subject.somebody.standing(&laboratory, seed);
    let person = Person::new(&mut trials, Some(&standing), &options, &|_, _| {}).expect("a person");
    let all: Vec<usize> = (0..trials.len()).collect();
    let mut study = Study::new(&person, &all, &StudyOptions::default(), &FitOptions::default(), &Silent)
        .expect("motions");
    study.draw(&person, &trials, &Silent).expect("draws");
    let fit = study.with_calibration(study.together(&all).expect("a fit"), &all);
    let situation = study.situation;
    let base = base_parameters(&subject.model, &situation).expect("base parameters");
    let true_values = base.map() * DVector::from_column_slice(&subject.truth);
    let truth =
        |name: &str| base.parameters.iter().position(|p| p.name == name).map_or(f64::NAN, |k| true_values[k]);
    let alone = fit.data_alone();
    let mut found = Found {
        parameters: fit.parameters.len(),
        counts: [0; 4],
        inside: [0; 2],
        inside_with_table: 0,
        condition: alone.condition_number,
        mass: [0.0; 2],
        left_out: [0.0; 2],
        used: 0.0,
    };
    for (j, parameter) in fit.parameters.iter().enumerate() {
        let value = truth(&parameter.name);
        if let Some(own) = fit.estimate.measured(j) {
            found.inside_with_table += usize::from((own.value - value).abs() <= own.u95);
        }
        let Some(own) = alone.measured(j) else { continue };
        found.inside[0] += usize::from((own.value - value).abs() <= own.u95);
        found.inside[1] += 1;
        let share = own.u95 / 1.96 / value.abs();
        let class = if value.abs() < SMALL {
            3
        } else if share < 0.05 {
            0
        } else if share < 0.15 {
            1
        } else {
            2
        };
        found.counts[class] += 1;
        if j == 0 {
            found.mass = [own.value - value, own.u95];
        }
    }
    let channels = left_out(&study, &person, 0.0).expect("predictions").channels;
    let rms = |of: &dyn Fn(usize) -> f64| ((0..3).map(|c| of(c).powi(2)).sum::<f64>()).sqrt();
    found.left_out = [rms(&|c| channels[c].rms), rms(&|c| channels[c].table_rms)];
    let frames: usize = person.trials.iter().map(|t| t.report.frames).sum();
    found.used = person.trials.iter().map(|t| t.frames.len()).sum::<usize>() as f64 / frames as f64;
    found
}

/// Returns the table.
pub fn table() -> String {
    let kinds: [(&str, HumanModel, Option<[f64; 10]>); 3] = [
        ("34", HumanModel::Human34, None),
        ("58", HumanModel::Human58, None),
        ("34 and a racket", HumanModel::Human34, Some(RACKET)),
    ];
    let mut out = String::from(
        "| degrees of freedom | parameters | condition | < 5 % | 5–15 % | > 15 % | small | inside U95 | with \
         the table | whole mass off, kg | left out, N | table, N |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for (name, kind, tool) in kinds {
        let all: Vec<Found> =
            (1..=PEOPLE).map(|seed| study(&subject(kind, tool, seed), kind, seed)).collect();
        let n = all.len() as f64;
        let mean = |of: &dyn Fn(&Found) -> f64| all.iter().map(of).sum::<f64>() / n;
        let total = |of: &dyn Fn(&Found) -> usize| all.iter().map(of).sum::<usize>() as f64;
        let count = |k: usize| mean(&|f: &Found| f.counts[k] as f64);
        out.push_str(&format!(
            "| {name} | {} | {:.0} | {:.0} | {:.0} | {:.0} | {:.0} | {:.1} % of {:.0} | {:.1} % | {:.2} (U95 \
             {:.2}) | {:.1} | {:.1} |\n",
            all[0].parameters,
            mean(&|f| f.condition),
            count(0),
            count(1),
            count(2),
            count(3),
            100.0 * total(&|f| f.inside[0]) / total(&|f| f.inside[1]),
            total(&|f| f.inside[1]),
            100.0 * total(&|f| f.inside_with_table) / total(&|f| f.parameters),
            mean(&|f| f.mass[0].powi(2)).sqrt(),
            mean(&|f| f.mass[1]),
            mean(&|f| f.left_out[0]),
            mean(&|f| f.left_out[1]),
        ));
    }
    out
}

/// Returns the table of the racket alone, from the difference of two factors.
pub fn racket_table() -> String {
    let mut out = String::from(
        "| person | mass, kg | centre below the wrist, m | Ixx, kg m² | Iyy, kg m² | inside U95, of 10 \
         |\n|---|---|---|---|---|---|\n",
    );
    let centre = -RACKET[3] / RACKET[0];
    out.push_str(&format!("| true | {} | {centre:.3} | {} | {} | |\n", RACKET[0], RACKET[4], RACKET[5]));
    for seed in 1..=PEOPLE {
        let [with, without] = [Some(RACKET), None].map(|tool| subject(HumanModel::Human34, tool, seed));
        let laboratory = Laboratory::default();
        let of = |who: &Subject, from: u64| -> Vec<Trial> {
            let name = |k: u64| format!("trial {}", from + k + 1);
            (0..TRIALS).map(|k| who.somebody.trial(&name(k), &laboratory, 100 * seed + from + k)).collect()
        };
        let mut trials = of(&with, 0);
        trials.extend(of(&without, TRIALS));
        let standing = without.somebody.standing(&laboratory, seed);
        let options = PeopleOptions {
            own_markers: without.somebody.clusters().clone(),
            plates_zeroed: true,
            holding_first: trials.len() / 2,
            ..PeopleOptions::default()
        };
        let person = Person::new(&mut trials, Some(&standing), &options, &|_, _| {}).expect("a person");
        let count = trials.len() / 2;
        let link = holding(&person, "r_hand").expect("a hand");
        let [with, without] = [(0..count, Some(link)), (count..trials.len(), None)].map(|(which, link)| {
            let which: Vec<usize> = which.collect();
            let options = StudyOptions::default();
            Study::holding(&person, &which, &options, &FitOptions::default(), &Silent, link).expect("motions")
        });
        let both = Compared { person: &person, trials: &trials, with: &with, without: &without };
        let found = both.tool("r_hand", "racket", &|_| {}).expect("a tool");
        let all: Vec<Measured> =
            std::iter::once(found.mass_kg).chain(found.first_moment_kgm).chain(found.inertia_kgm2).collect();
        let inside = all.iter().zip(RACKET).filter(|(m, v)| (m.value - v).abs() <= m.u95).count();
        let centre = found
            .com_m
            .map_or("not determined".to_owned(), |c| format!("{:.3} ± {:.3}", -c[2].value, c[2].u95));
        out.push_str(&format!(
            "| {seed} | {:.3} ± {:.3} | {centre} | {:.4} ± {:.4} | {:.4} ± {:.4} | {inside} |\n",
            all[0].value, all[0].u95, all[4].value, all[4].u95, all[5].value, all[5].u95
        ));
    }
    out
}

//! Trees whose parameters are known, and full parameters from a nominal model that is off.

use rigident::answer::standard_parameters::{BaseEstimate, nearest};
use rigident::fit::{Fit, FitOptions, Silent};
use rigident::laboratory::trees::{
    Coverage, OFFSET, coverage, seven_axes, seven_axis_recording, truth, two_link_recording, two_links,
    with_remembered_noise, worst,
};
use rigident::model::Model;
use rigident::model::base::BaseParameters;
use rigident::model::inertial::in_parent;
use rigident::problem::{Problem, ProblemOptions};
use rigident::recording::Recording;
use rigident::rows::tree::drive::Term;

const RUNS: u64 = 200;

/// A fit with the base parameters that it is of.
struct Identified {
    base: BaseParameters,
    fit: Fit,
}

fn identified(recording: &Recording, model: &Model, options: &ProblemOptions) -> Identified {
    let problem = Problem::from_recording(recording, Some(model), options).expect("frames");
    let fit = problem.fit(&FitOptions::default(), &Silent).expect("a fit");
    Identified { base: problem.tree().expect("a tree").base().clone(), fit }
}

fn friction() -> ProblemOptions {
    ProblemOptions {
        friction: vec![Term::Viscous, Term::Coulomb(None), Term::Offset].into(),
        ..ProblemOptions::default()
    }
}

pub fn table() -> String {
    let (two, seven) = (two_links(), seven_axes());
    let plain = ProblemOptions::default();
    let exact = [
        identified(&two_link_recording(&two, 1000.0, 20.0, None), &two, &plain),
        identified(&seven_axis_recording(&seven, 1000.0, 20.0, true, None, 0.0), &seven, &plain),
        identified(&seven_axis_recording(&seven, 1000.0, 20.0, false, None, 0.0), &seven, &plain),
    ];
    let error = |model: &Model, found: &Identified| worst(&truth(model, &found.base), &found.fit);
    let worst = [error(&two, &exact[0]), error(&seven, &exact[1]), error(&seven, &exact[2])];
    let covered = [
        coverage(RUNS, |seed| {
            let recording = two_link_recording(&two, 200.0, 20.0, Some(seed));
            let found = identified(&recording, &two, &plain);
            let mut wanted = truth(&two, &found.base);
            wanted.extend(OFFSET);
            (wanted, found.fit)
        }),
        coverage(RUNS, |seed| {
            let recording = seven_axis_recording(&seven, 200.0, 20.0, true, Some(seed), 1.0);
            let found = identified(&recording, &seven, &friction());
            let mut wanted = truth(&seven, &found.base);
            wanted.extend([0.7, 1.5, 0.2].repeat(7));
            (wanted, found.fit)
        }),
    ];
    let row = |name: &str, found: &Identified, worst: f64, covered: Option<Coverage>| {
        format!(
            "| {name} | {} | {worst:.1e} | {:.1} | {} |\n",
            found.fit.parameters.len(),
            found.fit.estimate.condition_number,
            covered.map_or("–".to_owned(), |c| format!("{:.1} %", 100.0 * c.inside))
        )
    };
    "| tree and recording | parameters | largest error without noise | condition number | inside U95 with \
     noise, 200 runs |\n\
     |---|---|---|---|---|\n"
        .to_owned()
        + &row("two links, an IMU each, load cell at the base", &exact[0], worst[0], Some(covered[0]))
        + &row(
            "seven axes, angles, rates and torques (with noise: and friction)",
            &exact[1],
            worst[1],
            Some(covered[1]),
        )
        + &row("seven axes, angles and torques alone", &exact[2], worst[2], None)
}

/// Correlation times, s; zero is white.
const TIMES_S: [f64; 6] = [0.0, 0.01, 0.02, 0.05, 0.2, 1.0];

pub fn coloured_table() -> String {
    let (two, seven) = (two_links(), seven_axes());
    let bodies = [
        ("two links", two_link_recording(&two, 200.0, 20.0, None), two, ProblemOptions::default()),
        (
            "seven axes and friction",
            seven_axis_recording(&seven, 200.0, 20.0, true, None, 1.0),
            seven,
            friction(),
        ),
    ];
    let mut out = "| tree | correlation time, s | inside U95 | autocorrelation not counted | warned \
                   |\n|---|---|---|---|---|\n"
        .to_owned();
    for (name, exact, model, options) in &bodies {
        let lines = TIMES_S.map(|time_s| {
            let run = move |seed: u64| {
                let recording = with_remembered_noise(exact, time_s, seed);
                let found = identified(&recording, model, options);
                (truth(model, &found.base), found.fit)
            };
            move || coverage(RUNS, run)
        });
        let done: Vec<Coverage> = std::thread::scope(|scope| {
            let threads: Vec<_> = lines.into_iter().map(|line| scope.spawn(line)).collect();
            threads.into_iter().map(|t| t.join().expect("a study")).collect()
        });
        for (time_s, covered) in TIMES_S.into_iter().zip(done) {
            let [inside, as_white, warned] =
                [covered.inside, covered.inside_as_white, covered.warned].map(|share| 100.0 * share);
            let time = if time_s > 0.0 { time_s.to_string() } else { "0 (white)".to_owned() };
            out += &format!("| {name} | {time} | {inside:.1} % | {as_white:.1} % | {warned:.0} % |\n");
        }
    }
    out
}

/// Returns a nominal model that is off by some share.
fn guess(model: &Model, off: f64) -> Model {
    let mut guess = model.clone();
    for (i, link) in guess.links.iter_mut().enumerate() {
        if let Some(phi) = &mut link.nominal {
            let share = 1.0 + off * ((i * 7 + 3) as f64).sin();
            let turn = nalgebra::Rotation3::from_euler_angles(0.3 * off, -0.2 * off, 0.1 * off).into_inner();
            let shift = nalgebra::Vector3::new(0.05, -0.03, 0.04) * off;
            *phi = in_parent(&phi.map(|v| v * share), &turn, &shift);
        }
    }
    guess
}

pub fn nearest_table() -> String {
    let model = seven_axes();
    let recording = seven_axis_recording(&model, 200.0, 20.0, true, Some(1), 1.0);
    let found = identified(&recording, &model, &friction());
    let found = BaseEstimate::of(&found.fit, &found.base);
    let mut out = "| nominal model off by | from the identified base parameters, sd | largest of one, sd | \
                   worst error of a link's mass, nominal model | full parameters \
                   |\n|---|---|---|---|---|\n"
        .to_owned();
    for off in [0.0, 0.1, 0.2, 0.4] {
        let guess = guess(&model, off);
        let full = nearest(&guess, &found, 1.0, false).expect("full parameters");
        let error = |of: &dyn Fn(usize) -> f64| {
            let moving = full.links.iter().filter(|l| l.name != "base");
            moving
                .map(|l| {
                    let i = model.link(&l.name).expect("a link");
                    let truth = model.links[i].nominal.expect("a mass")[0];
                    (of(i) / truth - 1.0).abs()
                })
                .fold(0.0, f64::max)
        };
        let nominal = error(&|i| guess.links[i].nominal.expect("a mass")[0]);
        let got = error(&|i| {
            full.links.iter().find(|l| l.name == model.links[i].name).expect("a link").parameters[0]
        });
        out += &format!(
            "| {:.0} % | {:.2} | {:.2} | {:.1} % | {:.1} % |\n",
            100.0 * off,
            full.distance_sd,
            full.largest_sd,
            100.0 * nominal,
            100.0 * got
        );
    }
    out
}

//! The tables of `docs/diagnosis.md`: recordings with one fault each, and honest ones, through the program as
//! a user would run it.
//!
//! Faults are put into simulated recordings by code of their own, column by column; nothing of the search for
//! faults is used.

mod body;
mod noise;
mod published;
mod trees;

use rigident::answer::{Answer, Context, StandardRequest, Status};
use rigident::diagnosis::{Case, diagnose, judge};
use rigident::fit::{FitOptions, Silent, parallel};
use rigident::problem::Problem;

pub use body::table as body_table;
pub use noise::table as noise_table;
pub use published::table as published_table;
pub use trees::table as tree_table;

/// The program's verdict about a recording.
struct Verdict {
    status: Status,
    /// The first thing that it says: the cause, if it names one.
    said: String,
    /// Largest error of an identified parameter over its expanded uncertainty; zero if none is identified.
    worst: f64,
}

impl Verdict {
    /// Returns true if a wrong number is called identified.
    fn is_silent(&self) -> bool {
        matches!(self.status, Status::Identified | Status::PartlyIdentified) && self.worst > 2.0
    }

    /// Returns true if the fault did no harm: what is identified is right.
    fn is_harmless(&self) -> bool {
        matches!(self.status, Status::Identified | Status::PartlyIdentified) && self.worst <= 2.0
    }
}

/// Identifies a recording as `rigident identify` does; `truth` gives the true parameters of a problem.
fn verdict(case: &mut Case, truth: &dyn Fn(&Problem) -> Vec<Option<f64>>) -> Verdict {
    case.recording.leave_out_bad_readings();
    let refused = |said: String| Verdict { status: Status::Failed, said, worst: 0.0 };
    let problem = match Problem::from_recording(&case.recording, case.model.as_ref(), &case.options) {
        Ok(problem) => problem,
        Err(error) => return refused(error.to_string()),
    };
    let fit = match problem.fit(&FitOptions { convergence_points: 0, ..FitOptions::default() }, &Silent) {
        Ok(fit) => fit,
        Err(error) => {
            let cause = diagnose(case, None, &Silent).map(|cause| cause.what);
            return refused(cause.unwrap_or_else(|| error.to_string()));
        }
    };
    let context = Context {
        links: problem.links(case.model.as_ref().map(StandardRequest::of)),
        rate_sigma: problem.source().rate_sigma(),
        warnings: case.recording.warnings.clone(),
        ..Context::default()
    };
    let mut answer = Answer::new(&fit, context).expect("an answer");
    let links = problem.links(case.model.as_ref().map(StandardRequest::of));
    let cause = judge(case, (&fit, links.as_ref()), &mut answer, &Silent);
    answer.explain(cause, case.recording.warnings.len());
    let errors = answer.parameters.iter().zip(truth(&problem)).filter_map(|(parameter, truth)| {
        let measured = parameter.state.measured()?;
        Some((measured.value - truth?).abs() / measured.u95)
    });
    let worst = errors.fold(0.0, f64::max);
    Verdict { status: answer.status, said: answer.warnings.into_iter().next().unwrap_or_default(), worst }
}

/// A fault: its name, what must be said of it, and how it comes into a recording.
struct Planted {
    name: &'static str,
    named: &'static str,
    plant: fn(&mut Case),
}

/// Returns a table of faults and its sums.
fn table_of(faults: &[Planted], seeds: u64, run: impl Fn(&Planted, u64) -> Verdict + Sync) -> String {
    let count = faults.len() * seeds as usize;
    let verdicts = parallel::map(parallel::threads(), count, |k| {
        let begun = std::time::Instant::now();
        let verdict = run(&faults[k % faults.len()], (k / faults.len()) as u64);
        let fault = &faults[k % faults.len()];
        let right = verdict.said.contains(fault.named);
        eprintln!(
            "  {}: {:?}, worst {:.1}, {right}, {:.1} s: {}",
            fault.name,
            verdict.status,
            verdict.worst,
            begun.elapsed().as_secs_f64(),
            verdict.said
        );
        verdict
    });
    let mut text =
        "| fault | recordings | wrong and identified | right and identified | refused or implausible | its \
         cause named |\n|---|---|---|---|---|---|\n"
            .to_owned();
    let mut all = [0; 5];
    for (k, fault) in faults.iter().enumerate() {
        let own: Vec<&Verdict> = verdicts.iter().skip(k).step_by(faults.len()).collect();
        let number = |holds: &dyn Fn(&Verdict) -> bool| own.iter().filter(|verdict| holds(verdict)).count();
        let harmless = number(&Verdict::is_harmless);
        let silent = number(&Verdict::is_silent);
        let named = number(&|verdict| !verdict.is_harmless() && verdict.said.contains(fault.named));
        let row = [own.len(), silent, harmless, own.len() - silent - harmless, named];
        all.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
        text += &format!("| {} | {} |\n", fault.name, row.map(|v| v.to_string()).join(" | "));
    }
    text + &format!("| **all** | {} |\n", all.map(|v| v.to_string()).join(" | "))
}

/// Returns the table of recordings without a fault.
pub fn honest_table() -> String {
    let mut text = "| recordings | number | refused or implausible |\n|---|---|---|\n".to_owned();
    let (mut all, mut wrong) = (0, 0);
    for (name, verdicts) in body::honest().into_iter().chain(trees::honest()) {
        let refused = |v: &&Verdict| matches!(v.status, Status::Implausible | Status::Failed);
        let refused = verdicts.iter().filter(refused).inspect(|v| eprintln!("  {name}: {}", v.said)).count();
        text += &format!("| {name} | {} | {refused} |\n", verdicts.len());
        all += verdicts.len();
        wrong += refused;
    }
    text + &format!("| **all** | {all} | {wrong} |\n")
}

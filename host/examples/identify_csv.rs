//! Identifies the body of a recording: `cargo run --release -p rigident --example identify_csv -- FILE.csv`
//!
//! This is `rigident identify FILE.csv` as a library: a recording with its rig file, the problem it poses, a fit, an answer.

use std::error::Error;
use std::path::Path;

use rigident::answer::{Answer, Context};
use rigident::fit::{FitOptions, Silent};
use rigident::problem::{Problem, ProblemOptions};
use rigident::recording::Recording;

/// Identifies one rigid body from a CSV or MCAP file and the rig file beside it.
pub fn identify(path: &Path) -> Result<Answer, Box<dyn Error>> {
    let recording = Recording::load(path, None)?;
    let problem = Problem::from_recording(&recording, None, &ProblemOptions::default())?;
    let fit = problem.fit(&FitOptions::default(), &Silent)?;
    Ok(Answer::new(&fit, Context { body: problem.rig.body.as_ref(), ..Context::default() })?)
}

/// Prints every parameter with its 95 % interval, or that it is not identified.
#[cfg(not(test))]
fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("give a recording")?;
    let answer = identify(Path::new(&path))?;
    for parameter in &answer.parameters {
        match parameter.state.measured() {
            Some(found) => {
                println!("{:10} {:12.6} ± {:.6} {}", parameter.name, found.value, found.u95, parameter.unit);
            }
            None => println!("{:10} not identified", parameter.name),
        }
    }
    answer.advice.iter().for_each(|advice| println!("{advice}"));
    Ok(())
}

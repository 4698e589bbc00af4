//! Identifies the body of a recording: `cargo run --release -p rigident --example identify_csv -- FILE.csv`
//!
//! This is `rigident identify FILE.csv` as a library: the same function, so that every number is the same to
//! the last bit.

#[cfg(not(test))]
use std::error::Error;
use std::path::Path;

use rigident::answer::Answer;
use rigident::application::{self, Caller, IdentifyOptions};

/// Identifies one rigid body, or the links of its rig file, from a recording and the rig file beside it.
pub fn identify(path: &Path) -> Result<Answer, application::Error> {
    let found = application::identify(path.into(), &IdentifyOptions::default(), &Caller::default())?;
    Ok(found.answer)
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
    answer.warnings.iter().for_each(|warning| println!("{warning}"));
    answer.advice.iter().for_each(|advice| println!("{advice}"));
    Ok(())
}

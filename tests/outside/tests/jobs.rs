//! The jobs of the command line, called as functions.

use std::path::PathBuf;

use rigident::answer::result::Measured;
use rigident::answer::{Answer, Status};
use rigident::application::{
    BodyOptions, Caller, Error, FactorOptions, IdentifyOptions, SolveOptions, body, factor, identify, merge,
    solve,
};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn example(name: &str) -> PathBuf {
    root().join("docs/examples").join(name)
}

fn measured(answer: &Answer, name: &str) -> Measured {
    let parameter = answer.parameters.iter().find(|parameter| parameter.name == name).expect(name);
    parameter.state.measured().expect(name)
}

/// docs/examples/bracket.py made the recording: 3.2 kg with its centre of mass at (0, 10, 53) mm.
#[test]
fn a_body_is_identified() -> Result<(), Error> {
    let found = identify(example("bracket.csv").into(), &IdentifyOptions::default(), &Caller::default())?;
    for (name, truth) in [("m", 3.2), ("mcx", 0.0), ("mcy", 0.032), ("mcz", 0.1696)] {
        let number = measured(&found.answer, name);
        assert!((number.value - truth).abs() < number.u95, "{name}: {number:?}, in truth {truth}");
    }
    Ok(())
}

/// Its factor says the same, alone and as the only one of a merge.
#[test]
fn a_factor_says_the_same_as_its_recording() -> Result<(), Error> {
    let caller = Caller::default();
    let whole = identify(example("bracket.csv").into(), &IdentifyOptions::default(), &caller)?;
    let reduced = factor(example("bracket.csv").into(), &FactorOptions::default(), &caller)?;
    let merged = merge(vec![reduced.factor], false, false)?;
    let solved = solve(&merged.factor, &SolveOptions::default(), &caller)?;
    for name in ["m", "mcz", "Ixx", "Iyz"] {
        let [one, other] = [&whole.answer, &solved.answer].map(|answer| measured(answer, name));
        assert!((one.value - other.value).abs() < 1e-6 * one.u95, "{name}: {one:?}, {other:?}");
        assert!((one.u95 / other.u95 - 1.0).abs() < 1e-6, "{name}: {one:?}, {other:?}");
    }
    Ok(())
}

/// In truth the base has 2 kg and the arm 1.4 kg, so that base.M, which is both, is 3.4 kg.
#[test]
fn two_links_are_identified() -> Result<(), Error> {
    let found = identify(example("two-links.csv").into(), &IdentifyOptions::default(), &Caller::default())?;
    let both = measured(&found.answer, "base.M");
    assert!((both.value - 3.4).abs() < both.u95, "{both:?}");
    Ok(())
}

/// The subject has 85.27 kg by the weight on the plates.
#[test]
#[ignore = "needs the recordings in ../shared/data"]
fn a_person_is_identified_from_shared_data() -> Result<(), Error> {
    let trial = root().join("../shared/data/human_rajagopal2016_walk");
    let options = BodyOptions { ground: vec![trial.join("grf_walk.mot")], ..BodyOptions::default() };
    let found = body(&[trial.join("markers_walk.trc")], &options, None, &Caller::default())?;
    let whole = measured(&found.answer, "pelvis.M");
    assert!((whole.value - 85.27).abs() < whole.u95, "{whole:?}");
    Ok(())
}

/// A recording with moments in N mm has no result, and the kind of error of a missing file can be matched.
#[test]
fn nothing_is_identified_of_an_impossible_recording() -> Result<(), Error> {
    let folder = std::env::temp_dir().join(format!("outside-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for a recording");
    let wrong = folder.join("bracket.csv");
    let text = std::fs::read_to_string(example("bracket.csv")).expect("the example");
    std::fs::write(&wrong, in_millimetres(&text)).expect("the recording");
    std::fs::copy(example("bracket.rig.toml"), folder.join("bracket.rig.toml")).expect("the rig file");
    let found = identify(wrong.into(), &IdentifyOptions::default(), &Caller::default())?;
    assert_eq!(found.answer.status, Status::Implausible);
    assert!(found.answer.parameters.iter().all(|parameter| parameter.state.measured().is_none()));
    let missing = identify(folder.join("none.csv").into(), &IdentifyOptions::default(), &Caller::default());
    assert!(missing.is_err_and(|error| error.to_string().contains("none.csv")));
    std::fs::remove_dir_all(&folder).expect("removed");
    Ok(())
}

/// Returns a recording with its moments, columns 4 to 6, in N mm.
fn in_millimetres(text: &str) -> String {
    let mut lines = text.lines();
    let mut changed = lines.next().expect("a header").to_owned() + "\n";
    for line in lines {
        let cells = line.split(',').enumerate().map(|(column, cell)| match column {
            4..=6 => (1000.0 * cell.parse::<f64>().expect("a number")).to_string(),
            _ => cell.to_owned(),
        });
        changed += &(cells.collect::<Vec<_>>().join(",") + "\n");
    }
    changed
}

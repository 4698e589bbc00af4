//! Robots on their feet, simulated in MuJoCo: the rows, the states of contact, `rigident identify` and
//! `rigident watch`; masses of their links in `masses`.
//!
//! The recordings and what is true of them are in `mujoco/`, whose README says how they were made.

mod masses;
mod robot;

use rigident::fit::{Prediction, RowSource};

use robot::{Feet, Robot, object, rigident};

/// Returns by channels the median of what the truth leaves, over the standard deviation of what is measured;
/// landings, where forces change within a sample, are few.
fn left_of_truth(robot: &Robot, feet: Feet) -> Vec<(String, f64)> {
    let folder = tempfile::tempdir().unwrap();
    let source = robot.source(folder.path(), feet);
    let phi = source.base().map() * robot.parameters(&source.input().model);
    let found = Prediction::of(&source, phi.as_slice(), &[]).unwrap();
    let of = |(c, channel): (usize, &rigident::fit::Channel)| {
        let determined = found.blocks.iter().filter(|block| block.determined.get(c) != Some(&false));
        let mut left: Vec<f64> =
            determined.map(|block| (block.measured[c] - block.predicted[c]).abs()).collect();
        left.sort_by(f64::total_cmp);
        let median = left.get(left.len() / 2).copied()?;
        (left.len() > 50).then(|| (channel.name.clone(), median / found.measured_sd[c]))
    };
    source.channels().iter().enumerate().filter_map(of).collect()
}

#[test]
#[ignore = "needs ../shared/data"]
fn rows_hold_for_measurements_by_an_independent_engine_of_shared_data_robots() {
    for (name, feet, limit, least) in [
        ("solo12", Feet::All, 1e-4, 18),
        ("solo12", Feet::WithoutHorizontal, 1e-4, 10),
        ("solo12", Feet::WithoutForces, 1e-4, 6),
        ("g1", Feet::All, 1e-3, 35),
        ("g1", Feet::WithoutHorizontal, 1e-3, 31),
        ("jvrc1", Feet::All, 5e-3, 38),
        ("jvrc1", Feet::WithoutHorizontal, 5e-3, 34),
    ] {
        let left = left_of_truth(&Robot::read(name), feet);
        assert!(left.len() >= least, "{name}: {} channels", left.len());
        let worst = left.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert!(worst.1 < limit, "{name}, {feet:?}: {worst:?} of {left:?}");
    }
}

#[test]
#[ignore = "needs ../shared/data"]
fn flight_single_and_double_support_of_shared_data_robots_are_distinguished() {
    for name in ["solo12", "g1", "jvrc1"] {
        let (robot, folder) = (Robot::read(name), tempfile::tempdir().unwrap());
        let source = robot.source(folder.path(), Feet::All);
        let input = source.input();
        let contact = input.contact.as_ref().unwrap();
        let (mut agreed, mut frames) = (0, 0);
        let mut kinds = std::collections::BTreeSet::new();
        for frame in &input.frames {
            let t = frame.time_ns as f64 * 1e-9;
            // Where a foot comes or goes it bears less than what counts as standing.
            let inside = |(start, end, _): &&(f64, f64, Vec<String>)| t > start + 0.05 && t < end - 0.05;
            let phases = robot.phases();
            let Some((_, _, feet)) = phases.iter().find(inside) else { continue };
            let standing = contact.feet.iter().zip(&contact.states[frame.ground.state].touching);
            frames += 1;
            let mut standing: Vec<&String> = standing.filter(|(_, on)| **on).map(|(f, _)| &f.name).collect();
            let mut feet: Vec<&String> = feet.iter().collect();
            standing.sort();
            feet.sort();
            agreed += u32::from(standing == feet);
            // A foot that bears next to nothing does not stand.
            assert!(
                standing.iter().all(|foot| feet.contains(foot)),
                "{name} at {t} s: {standing:?}, {feet:?}"
            );
            kinds.insert(standing.len());
        }
        assert!(frames > 500 && 10 * agreed > 9 * frames, "{name}: {agreed} of {frames}");
        let wanted = if name == "solo12" { vec![0, 3, 4] } else { vec![0, 1, 2] };
        assert_eq!(kinds.into_iter().collect::<Vec<_>>(), wanted, "{name}");
    }
}

#[test]
#[ignore = "needs ../shared/data"]
fn intervals_hold_the_truth_of_a_shared_data_quadruped_with_noise() {
    let robot = Robot::read("solo12");
    let (mut inside, mut all) = (0, 0);
    for seed in 1..=3 {
        let folder = tempfile::tempdir().unwrap();
        robot.write(folder.path(), Feet::All, Some(seed));
        let model = robot.model_file();
        let output = rigident(
            folder.path(),
            &["identify", "solo12.csv", "--model", model.to_str().unwrap(), "--json", "--out", "out"],
        );
        let answer = object(&output);
        let nominal = robot.nominal();
        let base = robot.source(folder.path(), Feet::All).base().clone();
        let truth = base.map() * robot.parameters(&nominal);
        for (own, truth) in base.parameters.iter().zip(truth.iter()) {
            let found =
                answer["parameters"].as_array().unwrap().iter().find(|p| p["name"] == own.name.as_str());
            let found = found.unwrap_or_else(|| panic!("{}", own.name));
            let (Some(value), Some(u95)) = (found["value"].as_f64(), found["u95"].as_f64()) else { continue };
            all += 1;
            inside += u32::from((value - truth).abs() <= u95);
            if own.name == "base_link.M" {
                assert!((value - truth).abs() < 2.0 * u95 && u95 < 2e-3, "{value} {u95} for {truth}");
            }
        }
    }
    println!("{inside} of {all}");
    // 95 % of some 190, of which those of a seed have their noise in common.
    assert!(all > 140 && f64::from(inside) > 0.9 * f64::from(all), "{inside} of {all}");
}

/// The command with a robot of another program's: nothing changes and nothing is reported, and what it lacks
/// is named.
#[test]
fn a_robot_is_watched_from_the_command_line_and_missing_inputs_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let robot = Robot::read("solo12");
    let path = robot.write(folder.path(), Feet::All, Some(11));
    let model = robot.model_file();
    let model = model.to_str().unwrap();
    let link = "FR_LOWER_LEG";
    let watch = |more: &[&str]| {
        let output = rigident(folder.path(), &[&["watch", "solo12.csv"], more].concat());
        let words =
            |bytes: &[u8]| String::from_utf8_lossy(bytes).split_whitespace().collect::<Vec<_>>().join(" ");
        (output.status.code(), words(&output.stdout), words(&output.stderr))
    };
    let (code, said, _) = watch(&["--model", model, "--link", link, "--settle-s", "2"]);
    assert!(code == Some(0) && said.starts_with("FR_LOWER_LEG: 0 changes"), "{code:?} {said}");
    let (code, said, _) = watch(&["--model", model, "--link", link]);
    assert!(code == Some(1) && said.contains("--settle-s"), "{code:?} {said}");
    let (text, rig) = (std::fs::read_to_string(&path).unwrap(), robot.rig(Feet::All));
    let no_imu = ["x", "y", "z"].iter().fold(text.clone(), |text, axis| {
        text.replacen(&format!("imu_a{axis}_mps2"), &format!("old_a{axis}"), 1)
    });
    let cases = [
        (&text, rig.clone(), vec!["--model", model, "--link", "tail"], "no link tail; its links are"),
        (&text, rig.clone(), vec!["--link", link], "--model"),
        (&no_imu, rig.clone(), vec!["--model", model, "--link", link], "imu_ax_mps2"),
        (&text, robot.rig(Feet::WithoutHorizontal), vec!["--model", model, "--link", link], "fx of foot"),
        (&text, rig.clone(), vec!["--model", model, "--link", link, "--settle-s", "0"], "--settle-s 0"),
    ];
    for (text, rig, line, word) in cases {
        std::fs::write(&path, text).unwrap();
        std::fs::write(folder.path().join("solo12.rig.toml"), rig).unwrap();
        let (code, _, said) = watch(&line);
        assert!(code == Some(2) && said.contains(word), "{word}: {code:?} {said}");
    }
}

//! Gain errors of the load cell, as a user states them in the rig file.

use super::simulated::{body, json, noise, values, write};

/// 1 σ of every channel's gain.
const GAIN: f64 = 0.01;

#[test]
fn a_gain_uncertainty_in_the_rig_file_widens_every_interval_that_it_reaches() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let gains = format!("gain_uncertainty = {:?}", [GAIN; 6]);
    let none = format!("gain_uncertainty = {:?}", [0.0; 6]);
    for (name, cell) in [
        ("plain", noise()),
        ("zero", format!("{}\n{none}", noise())),
        ("stated", format!("{}\n{gains}", noise())),
        ("residuals", gains),
    ] {
        write(at, name, body(), 1, &cell);
    }
    let answer = |command: &[&str], name: &str| {
        let file = format!("{name}.csv");
        let out = format!("{name}-{}", command[0]);
        let arguments = [command, &[&file, "--estimate", "m,mc", "--json", "--out", &out]].concat();
        values(&json(at, &arguments))
    };
    let plain = answer(&["identify"], "plain");
    assert_eq!(plain, answer(&["identify"], "zero"), "no gain errors: the same bits");
    let stated = answer(&["identify"], "stated");
    // Six independent gains average at best, and are all one at worst: mass and mcz are known no better than
    // to a share of σ/√6, no worse than to σ, besides the noise.
    for (j, scale) in [(0, 20.0), (3, 1.06)] {
        let added = (stated[j].1.powi(2) - plain[j].1.powi(2)).sqrt() / (1.96 * scale);
        assert!((GAIN / 6_f64.sqrt()..GAIN).contains(&added), "{j}: {added}");
    }
    // A true zero, multiplied by whatever gain, stays one.
    assert!(stated[1].1 < 1.2 * plain[1].1 && stated[1].1 >= plain[1].1, "{} {}", stated[1].1, plain[1].1);
    // The firmware's factor does not hold the gains: its readings do, to single precision.
    let replayed = answer(&["replay"], "stated");
    // σ from 1 000 independent residuals a channel: 2 %, four times, and Student's t.
    let estimated = answer(&["identify"], "residuals");
    for (j, (value, u95)) in stated.iter().enumerate() {
        assert!((replayed[j].0 - value).abs() < 1e-3 * u95, "{j}");
        assert!((replayed[j].1 / u95 - 1.0).abs() < 1e-3, "{j}: {} {u95}", replayed[j].1);
        assert!((estimated[j].1 / u95 - 1.0).abs() < 0.09, "{j}: {} {u95}", estimated[j].1);
    }
}

//! The verb `support`: README's table of features by kind of body, made from the tests that are behind each
//! cell.
//!
//! [`MATRIX`] is the one list. A cell that says yes names a test; `cargo xtask test` fails if a test named
//! here did not run and pass, or if README differs.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use anyhow::{Context, Result, bail};

use crate::places;

/// The marks around the table in README.
const MARKS: [&str; 2] = ["<!-- table: support -->\n", "<!-- end -->"];

/// The support of a feature for one kind of body, on the host or where a device runs.
enum Cell {
    /// The feature works: the test that shows it, as the test program names it.
    Yes(&'static str),
    /// The feature is not there yet.
    NotYet,
    /// Mathematics or the device's memory forbid it, with the reason.
    No(&'static str),
    /// The feature means nothing there.
    Nothing,
}

use Cell::{No, NotYet, Nothing, Yes};

/// A feature with its cells: one body, two links, tree, each from a recording and on the device.
struct Row {
    feature: &'static str,
    cells: [Cell; 6],
}

const COLUMNS: [&str; 6] =
    ["one body, recording", "device", "two links, recording", "device", "tree, recording", "device"];

const UNTIL: &str =
    "device_tree_commands::the_device_decides_when_two_links_and_a_person_are_known_well_enough";
const GAINS_ON_DEVICE: &str =
    "device_tree_commands::gain_errors_of_several_links_are_counted_from_readings_of_the_device";
const LINKS_LIVE: &str =
    "device_tree_commands::two_links_are_identified_live_recorded_replayed_to_the_bit_and_identified_again";
const PERSON_LIVE: &str =
    "device_tree_commands::a_person_comes_off_the_device_level_by_level_and_identify_finds_the_same";
const BODY_LIVE: &str =
    "commands::the_demonstration_finds_the_body_and_its_recording_replays_to_the_same_bits";
const MASSES_IN_SUMS: &str = "a plane needs the mass of a link by itself, and rows tell it in sums";
const NO_TORQUES: &str =
    "a device measures no joint torques, and the base's wrench does not contain friction";
const ONE_TRIANGLE: &str = "64 KiB hold one triangle of 128";

const MATRIX: [Row; 18] = [
    Row {
        feature: "identified; CSV and MCAP",
        cells: [
            Yes("support::one_body::recordings"),
            Yes(BODY_LIVE),
            Yes("support::two_links::recordings"),
            Yes(LINKS_LIVE),
            Yes("support::tree::recordings"),
            Yes(PERSON_LIVE),
        ],
    },
    Row {
        feature: "live from the device's own sensors",
        cells: [Nothing, Yes(BODY_LIVE), Nothing, Yes(LINKS_LIVE), Nothing, NotYet],
    },
    Row {
        feature: "wrench offsets",
        cells: [
            Yes("support::one_body::offsets"),
            Yes("support::device::one_body::offsets"),
            Yes("support::two_links::offsets"),
            Yes(LINKS_LIVE),
            Yes("support::tree::offsets"),
            Yes(PERSON_LIVE),
        ],
    },
    Row {
        feature: "autocorrelated noise",
        cells: [
            Yes("support::one_body::autocorrelation"),
            Yes("support::device::one_body::autocorrelation"),
            Yes("support::two_links::autocorrelation"),
            Yes("support::device::two_links::autocorrelation"),
            Yes("support::tree::autocorrelation"),
            Yes("support::device::tree::autocorrelation"),
        ],
    },
    Row {
        feature: "noise of the IMU's own signals",
        cells: [
            Yes("support::one_body::imu_noise"),
            Yes("support::device::one_body::imu_noise"),
            Yes("support::two_links::imu_noise"),
            Yes(LINKS_LIVE),
            Yes("support::tree::imu_noise"),
            Yes(PERSON_LIVE),
        ],
    },
    Row {
        feature: "outliers weighted down",
        cells: [
            Yes("support::one_body::outliers"),
            Yes("support::device::one_body::outliers"),
            Yes("support::two_links::outliers"),
            Yes("device_tree_commands::wrenches_far_off_count_less_on_a_device_of_two_links"),
            Yes("support::tree::outliers"),
            NotYet,
        ],
    },
    Row {
        feature: "gain errors",
        cells: [
            Yes("support::one_body::gain_errors"),
            Yes("support::device::one_body::gain_errors"),
            Yes("support::two_links::gain_errors"),
            Yes(GAINS_ON_DEVICE),
            Yes("support::tree::gain_errors"),
            Yes(GAINS_ON_DEVICE),
        ],
    },
    Row {
        feature: "errors of mounting, scale, delay and drift",
        cells: [
            Yes("support::errors::one_body::rig_errors"),
            Yes("support::errors::one_body_on_device::rig_errors"),
            Yes("support::errors::two_links::rig_errors"),
            NotYet,
            Yes("support::errors::tree::rig_errors"),
            NotYet,
        ],
    },
    Row {
        feature: "calibration by a reference body",
        cells: [
            Yes("calibration::a_cylinder_calibrates_a_rig_and_verifies_it"),
            Yes("calibration::a_cylinder_calibrates_a_rig_and_verifies_it"),
            NotYet,
            NotYet,
            NotYet,
            NotYet,
        ],
    },
    Row {
        feature: "`--known`",
        cells: [
            Yes("support::one_body::known_values"),
            Yes("support::device::one_body::known_values"),
            Yes("support::two_links::known_values"),
            Yes("support::device::two_links::known_values"),
            Yes("support::tree::known_values"),
            Yes("support::device::tree::known_values"),
        ],
    },
    Row {
        feature: "`--symmetry`",
        cells: [
            Yes("support::one_body::symmetry"),
            Yes("support::device::one_body::symmetry"),
            No(MASSES_IN_SUMS),
            No(MASSES_IN_SUMS),
            No(MASSES_IN_SUMS),
            No(MASSES_IN_SUMS),
        ],
    },
    Row {
        feature: "`--tare`",
        cells: [
            Yes("support::one_body::tare"),
            Yes("support::device::one_body::tare"),
            Yes("support::two_links::tare"),
            Yes("support::device::two_links::tare"),
            Yes("support::tree::tare"),
            Yes("support::device::tree::tare"),
        ],
    },
    Row {
        feature: "factor files: `factor`, `merge`, `solve`",
        cells: [
            Yes("support::one_body::factor_files"),
            Yes("support::device::one_body::factor_files"),
            Yes("support::two_links::factor_files"),
            Yes("support::device::two_links::factor_files"),
            Yes("support::tree::factor_files"),
            Yes("support::device::tree::factor_files"),
        ],
    },
    Row {
        feature: "`--forget`, `--window`",
        cells: [
            Yes("support::one_body::forgetting"),
            Yes("support::device::one_body::forgetting"),
            Yes("support::two_links::forgetting"),
            NotYet,
            Yes("support::tree::forgetting"),
            No(ONE_TRIANGLE),
        ],
    },
    Row {
        feature: "`--until`, which the device decides",
        cells: [
            Nothing,
            Yes("commands::a_demonstration_ends_when_the_uncertainties_asked_for_are_reached"),
            Nothing,
            Yes(UNTIL),
            Nothing,
            Yes(UNTIL),
        ],
    },
    Row {
        feature: "several files with their own clocks",
        cells: [
            Yes("streams::simulated::skews_are_recovered_within_their_uncertainty_and_so_is_the_body"),
            Nothing,
            Yes("support::clocks::two_links::several_clocks"),
            Nothing,
            Yes("support::clocks::tree::several_clocks"),
            Nothing,
        ],
    },
    Row {
        feature: "`montecarlo`",
        cells: [
            Yes("montecarlo::white_noise_is_averaged_as_far_as_possible_and_the_intervals_say_how_far"),
            Yes("montecarlo::the_firmware_keeps_the_same_promises_with_another_seed"),
            Yes("montecarlo::two_links_keep_the_promises_against_a_bound_of_their_own"),
            NotYet,
            Yes("montecarlo::a_chain_on_a_moving_base_keeps_the_promises"),
            NotYet,
        ],
    },
    Row {
        feature: "friction, rotors, written models",
        cells: [
            Nothing,
            Nothing,
            Yes(
                "tree_commands::an_arm_is_identified_from_positions_and_torques_and_written_in_three_languages",
            ),
            No(NO_TORQUES),
            Yes(
                "tree_commands::an_arm_is_identified_from_positions_and_torques_and_written_in_three_languages",
            ),
            No(NO_TORQUES),
        ],
    },
];

/// Options of the verb.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// Write README's table instead of comparing it.
    #[arg(long)]
    pub write: bool,
}

/// Compares README's table with the list, or writes it.
///
/// # Errors
/// Fails if README has no marks for the table, or another table.
pub fn run(options: &Options) -> Result<()> {
    let path = places::root().join("README.md");
    let readme = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    let made = replaced(&readme, &table())?;
    if options.write {
        return std::fs::write(&path, made).with_context(|| path.display().to_string());
    }
    if made != readme {
        bail!("README's support matrix is not that of xtask/src/support.rs: cargo xtask support --write");
    }
    println!("README's support matrix is that of its tests: {} of them", tests().len());
    Ok(())
}

/// Checks that every test behind a cell passed.
///
/// # Errors
/// Names those that did not run, or failed.
pub fn check(passed: &BTreeSet<String>) -> Result<()> {
    let missing: Vec<&str> = tests().into_iter().filter(|test| !passed.contains(*test)).collect();
    if !missing.is_empty() {
        bail!("cells of README's support matrix name tests that did not pass: {}", missing.join(", "));
    }
    Ok(())
}

/// Returns every test that a cell names.
fn tests() -> BTreeSet<&'static str> {
    let cells = MATRIX.iter().flat_map(|row| &row.cells);
    cells.filter_map(|cell| if let Yes(test) = cell { Some(*test) } else { None }).collect()
}

/// Returns the table in Markdown, with the reasons below it.
fn table() -> String {
    let mut reasons: Vec<&str> = Vec::new();
    let mut text = format!("| | {} |\n|---|{}\n", COLUMNS.join(" | "), "---|".repeat(COLUMNS.len()));
    for Row { feature, cells } in &MATRIX {
        let _ = write!(text, "| {feature} |");
        for cell in cells {
            let _ = match cell {
                Yes(_) => write!(text, " yes |"),
                NotYet => write!(text, " not yet |"),
                Nothing => write!(text, " – |"),
                No(reason) => {
                    let at = reasons.iter().position(|known| known == reason).unwrap_or(reasons.len());
                    if at == reasons.len() {
                        reasons.push(reason);
                    }
                    write!(text, " no ({}) |", at + 1)
                }
            };
        }
        text.push('\n');
    }
    let reasons = reasons.iter().enumerate().map(|(n, reason)| format!("({}) {reason}.", n + 1));
    let _ = writeln!(text, "\n{}", reasons.collect::<Vec<_>>().join(" "));
    text
}

/// Returns README with the table between the marks replaced.
fn replaced(readme: &str, table: &str) -> Result<String> {
    let [from, to] = MARKS;
    let (before, rest) = readme.split_once(from).context("README has no mark of the support matrix")?;
    let (_, after) = rest.split_once(to).context("README's support matrix has no end")?;
    Ok(format!("{before}{from}{table}{to}{after}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readme_has_the_matrix_of_the_list() {
        run(&Options::default()).unwrap();
    }

    #[test]
    fn a_test_that_did_not_run_is_missed() {
        let all: BTreeSet<String> = tests().into_iter().map(str::to_owned).collect();
        assert!(all.len() > 40);
        check(&all).unwrap();
        let mut fewer = all.clone();
        let first = fewer.pop_first().unwrap();
        assert!(check(&fewer).unwrap_err().to_string().contains(&first));
    }

    #[test]
    fn only_the_text_between_the_marks_is_replaced() {
        let [from, to] = MARKS;
        let made = replaced(&format!("a\n{from}old\n{to}\nb"), "new\n").unwrap();
        assert_eq!(made, format!("a\n{from}new\n{to}\nb"));
        assert!(replaced("a", "new").is_err() && replaced(from, "new").is_err());
    }
}

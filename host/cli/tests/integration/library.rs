//! The library is the program: what a command prints of a recording its function of `rigident::application`
//! returns, to the last bit.

use std::fs;
use std::path::{Path, PathBuf};

use rigident::application::{
    self, Caller, DeviceError, Error, FactorOptions, Fixture, IdentifyOptions, PredictOptions, ReplayOptions,
    SolveOptions, Tree,
};
use rigident::device::microcontroller::Microcontroller;
use rigident::device::session::Nobody;
use rigident::device::stop_criterion::{StopCriterion, StopError};
use rigident::fit::pool::PooledFactor;
use rigident::fit::prior::KnownValues;
use rigident_shared::forgetting::Span;

use crate::program::{rigident, said, status};

/// Returns a file of `docs/examples`.
pub fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples").join(name)
}

/// A recording as text: the names of its columns, and its rows.
pub struct Table {
    names: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    fn of(name: &str) -> Self {
        let text = fs::read_to_string(example(name)).unwrap();
        let mut lines = text.lines().filter(|line| !line.starts_with('#'));
        let cells = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
        Self { names: cells(lines.next().unwrap()), rows: lines.map(cells).collect() }
    }

    /// Multiplies a column, and adds to it from a row on to another.
    fn changed(mut self, name: &str, by: f64, (from, to, add): (usize, usize, f64)) -> Self {
        let column = self.names.iter().position(|own| own == name).unwrap();
        for (row, cells) in self.rows.iter_mut().enumerate() {
            let value = by * cells[column].parse::<f64>().unwrap();
            cells[column] = format!("{:e}", if (from..to).contains(&row) { value + add } else { value });
        }
        self
    }

    fn scaled(self, names: &[&str], by: f64) -> Self {
        names.iter().fold(self, |table, name| table.changed(name, by, (0, 0, 0.0)))
    }

    /// Two readings of a gyro that no body makes.
    fn spiked(self) -> Self {
        self.changed("imu_gy_radps", 1.0, (300, 301, 40.0)).changed("imu_gz_radps", 1.0, (700, 701, -60.0))
    }

    fn only(mut self, keep: impl Fn(&str) -> bool) -> Self {
        let kept: Vec<usize> = (0..self.names.len()).filter(|k| keep(&self.names[*k])).collect();
        self.names = kept.iter().map(|k| self.names[*k].clone()).collect();
        for row in &mut self.rows {
            *row = kept.iter().map(|k| row[*k].clone()).collect();
        }
        self
    }

    fn first(mut self, rows: usize) -> Self {
        self.rows.truncate(rows);
        self
    }

    /// Writes it, and its rig file if there is one.
    pub fn write(&self, at: &Path, name: &str, rig: &str) {
        let rows: Vec<String> = self.rows.iter().map(|cells| cells.join(",")).collect();
        fs::write(at.join(format!("{name}.csv")), format!("{}\n{}\n", self.names.join(","), rows.join("\n")))
            .unwrap();
        if !rig.is_empty() {
            fs::write(at.join(format!("{name}.rig.toml")), rig).unwrap();
        }
    }
}

const WRENCH: [&str; 6] = ["fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"];

/// Twelve poses of a body at rest: 2 kg at (0.1, -0.2, 0.3) m.
pub fn still_poses() -> Table {
    let names = [
        "t_s",
        "fx_n",
        "fy_n",
        "fz_n",
        "mx_nm",
        "my_nm",
        "mz_nm",
        "imu_ax_mps2",
        "imu_ay_mps2",
        "imu_az_mps2",
    ];
    let (mass, [x, y, z]) = (2.0, [0.1, -0.2, 0.3]);
    let rows = (0..12).map(|k| {
        let turn = f64::from(k);
        let (tilt, heading) = (0.5 + 0.4 * (1.7 * turn).sin(), 2.4 * turn);
        let [a, b, c] =
            [tilt.sin() * heading.cos(), tilt.sin() * heading.sin(), tilt.cos()].map(|v| 9.806_65 * v);
        let [fx, fy, fz] = [a, b, c].map(|v| mass * v + 0.02 * (37.0 * v).sin());
        let moment = [y * fz - z * fy, z * fx - x * fz, x * fy - y * fx];
        let all = [turn, fx, fy, fz, moment[0], moment[1], moment[2], a, b, c];
        all.map(|v| v.to_string()).to_vec()
    });
    Table { names: names.map(str::to_owned).to_vec(), rows: rows.collect() }
}

/// Writes the recordings that are compared.
fn recordings(at: &Path) {
    let [bracket, links] =
        ["bracket.rig.toml", "two-links.rig.toml"].map(|name| fs::read_to_string(example(name)).unwrap());
    let table = || Table::of("bracket.csv");
    for (name, table) in [
        ("bracket", table()),
        ("spikes", table().spiked()),
        ("knocked", table().changed("fx_n", 1.0, (500, 504, 200.0))),
        ("reversed", table().scaled(&["imu_gx_radps"], -1.0)),
        ("mm", table().scaled(&WRENCH[3..], 1e3)),
        ("in-g", table().scaled(&["imu_ax_mps2", "imu_ay_mps2", "imu_az_mps2"], 1.0 / 9.806_65)),
        ("short", table().first(300)),
        ("fixture", table().scaled(&WRENCH, 0.2)),
        ("spiked-fixture", table().scaled(&WRENCH, 0.2).spiked()),
    ] {
        table.write(at, name, &bracket);
    }
    let no_offset = bracket.replace("\"estimate\"", "\"zero\"");
    table().write(at, "no-offset", &no_offset);
    table().write(at, "no-rig", "");
    let two = || Table::of("two-links.csv");
    two().write(at, "two-links", &links);
    two().spiked().write(at, "two-spikes", &links);
    two().scaled(&WRENCH, -1.0).write(at, "two-reversed", &links);
    two().write(at, "two-as-one", "[recording]\nrate_hz = 100.0\n");
    still_poses().write(at, "poses", "[recording]\nstatic = true\n[load_cell]\nclass = \"exact\"\n");
    let is_wrench = |name: &str| name == "t_s" || WRENCH.contains(&name);
    table().only(is_wrench).write(at, "cell", "");
    table().only(|name| !WRENCH.contains(&name)).write(at, "imu", "");
    let rate = bracket.lines().filter(|line| !line.starts_with("rate_hz")).collect::<Vec<_>>().join("\n");
    let listed = "\n[[stream]]\nfile = \"cell.csv\"\n[[stream]]\nfile = \"imu.csv\"\n";
    fs::write(at.join("streams.rig.toml"), rate + listed).unwrap();
    for name in ["picks-up.csv", "picks-up.rig.toml", "picks-up.urdf"] {
        fs::copy(example(name), at.join(name)).unwrap();
    }
    for words in
        [&["convert", "bracket.csv", "packed.mcap"][..], &["factor", "fixture.csv", "-o", "fixture.factor"]]
    {
        let made = rigident(at, words);
        assert_eq!(status(&made), 0, "{}", said(&made));
    }
}

/// Compares an object that a command printed with that of the library, line by line, but for the time of the
/// run and how long it took. Words of a remedy may differ where the command names an option of its own.
#[track_caller]
fn assert_same(at: &Path, name: &str, printed: &str, found: &impl serde::Serialize) {
    let folder = format!("{}/", at.display());
    let found = serde_json::to_string_pretty(found).unwrap().replace(&folder, "");
    let printed = &printed.replace(&folder, "");
    let lines = |text: &str| -> Vec<String> {
        let is_of_the_run = |line: &&str| {
            let line = line.trim_start();
            line.starts_with("\"date\":") || line.starts_with("\"elapsed_s\":")
        };
        text.trim().lines().filter(|line| !is_of_the_run(line)).map(str::to_owned).collect()
    };
    let (printed, found) = (lines(printed), lines(&found));
    assert!(printed.len() > 20, "{name}: {printed:?}");
    assert_eq!(printed.len(), found.len(), "{name}\n{}\n{}", printed.join("\n"), found.join("\n"));
    for (command, library) in printed.iter().zip(&found) {
        let names_an_option = command.contains("--") || command.contains("`rigident");
        assert!(command == library || names_an_option, "{name}\n{command}\n{library}");
        assert!(!library.contains(" --") || command == library, "{name}\n{library}");
    }
}

/// A recording, the words of the command beside it, and the options of the library that mean the same.
type Case = (&'static str, &'static [&'static str], IdentifyOptions);

fn with(change: impl FnOnce(&mut IdentifyOptions)) -> IdentifyOptions {
    let mut options = IdentifyOptions::default();
    change(&mut options);
    options
}

fn known(values: &[&str], planes: &[&str]) -> KnownValues {
    let all = |words: &[&str]| words.iter().map(|&word| word.to_owned()).collect::<Vec<_>>();
    KnownValues::parse(&all(values), &all(planes)).unwrap()
}

fn tree_of(at: &Path) -> Tree {
    Tree { model: Some(at.join("picks-up.urdf").display().to_string()), ..Tree::default() }
}

fn cases(at: &Path) -> Vec<Case> {
    let plain = IdentifyOptions::default;
    let file = |name: &str| vec![Fixture::File(at.join(name))];
    let memory = PooledFactor::read(&at.join("fixture.factor")).unwrap();
    let mut all: Vec<Case> = [
        "bracket.csv",
        "spikes.csv",
        "knocked.csv",
        "reversed.csv",
        "mm.csv",
        "in-g.csv",
        "short.csv",
        "no-offset.csv",
        "no-rig.csv",
        "packed.mcap",
        "streams.rig.toml",
        "poses.csv",
        "two-links.csv",
        "two-spikes.csv",
        "two-reversed.csv",
        "two-as-one.csv",
    ]
    .into_iter()
    .map(|name| (name, &[][..], plain()))
    .collect();
    let more: Vec<Case> = vec![
        ("bracket.csv", &["--forget", "3"], with(|o| o.span = Some(Span::TimeConstant(3.0)))),
        ("spikes.csv", &["--window", "5"], with(|o| o.span = Some(Span::Window(5.0)))),
        (
            "bracket.csv",
            &["--known", "mass_kg=3.2±0.01"],
            with(|o| o.known = known(&["mass_kg=3.2±0.01"], &[])),
        ),
        ("bracket.csv", &["--symmetry", "x±0.05"], with(|o| o.known = known(&[], &["x±0.05"]))),
        ("short.csv", &["--estimate", "m,mc"], with(|o| o.asked = vec!["m".into(), "mc".into()])),
        ("bracket.csv", &["--tare", "fixture.csv"], with(|o| o.tare = file("fixture.csv"))),
        ("spikes.csv", &["--tare", "spiked-fixture.csv"], with(|o| o.tare = file("spiked-fixture.csv"))),
        ("bracket.csv", &["--tare", "mm.csv"], with(|o| o.tare = file("mm.csv"))),
        (
            "spikes.csv",
            &["--tare", "fixture.factor"],
            with(|o| o.tare = vec![Fixture::Factor(Box::new(memory))]),
        ),
        ("two-links.csv", &["--nominal-sigma", "0.2"], with(|o| o.nominal_sigma = 0.2)),
        ("picks-up.csv", &["--model", "picks-up.urdf"], with(|o| o.tree = tree_of(at))),
    ];
    all.extend(more);
    all
}

#[test]
fn identify_is_the_command_to_the_last_bit() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    recordings(at);
    let cases = cases(at);
    assert!(cases.len() >= 20);
    for (n, (name, words, options)) in cases.iter().enumerate() {
        let found = application::identify(at.join(name).into(), options, &Caller::default());
        let found = found.unwrap_or_else(|error| panic!("{name} {words:?}: {error}"));
        let out = format!("out-{n}");
        // What is noticed of a file names it as it was given, and so does the factor.
        let path = at.join(name).display().to_string();
        let printed = rigident(at, &[&["identify", &path, "--json", "--out", &out], *words].concat());
        assert!(status(&printed) < 2, "{name} {words:?}: {}", said(&printed));
        assert_eq!(found.is_whole(), status(&printed) == 0, "{name} {words:?}");
        let of = format!("{name} {words:?}");
        assert_same(at, &of, &String::from_utf8(printed.stdout).unwrap(), &found.answer);
        let kept = fs::read(at.join(&out).join(found.factor_name())).unwrap();
        // Its rows; the words of its checks are the caller's.
        let (own, kept) = (found.factor.unwrap(), PooledFactor::from_bytes(&kept, "kept").unwrap());
        assert!(own.factor().r() == kept.factor().r() && own.factor().z() == kept.factor().z(), "{of}");
    }
}

#[cfg(feature = "simulator")]
#[test]
fn replays_are_those_of_the_command_to_the_last_bit() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    recordings(at);
    let two = rigident(at, &["demo", "--body", "two-links", "--duration-s", "20", "--out", "two"]);
    assert!(status(&two) < 2, "{}", said(&two));
    let plain = ReplayOptions::default;
    let tare = vec![Fixture::File(at.join("fixture.csv"))];
    let until = StopCriterion { until: vec!["m=0.05".to_owned()], keep_going: false };
    for (n, (name, words, options)) in [
        ("spikes.csv", &[][..], plain()),
        ("short.csv", &["--until", "m=0.05"], ReplayOptions { stop: until, ..plain() }),
        (
            "bracket.csv",
            &["--tare", "fixture.csv", "--estimate", "m"],
            ReplayOptions { tare, asked: vec!["m".to_owned()], ..plain() },
        ),
        ("bracket.csv", &["--forget", "3"], ReplayOptions { span: Some(Span::TimeConstant(3.0)), ..plain() }),
        ("two/demo.mcap", &[], plain()),
    ]
    .into_iter()
    .enumerate()
    {
        let replayed = application::replay(&at.join(name), &options, &mut Nobody, &Caller::default());
        let replayed = replayed.unwrap_or_else(|error| panic!("{name} {words:?}: {error}"));
        let out = format!("out-{n}");
        let path = at.join(name).display().to_string();
        let printed = rigident(at, &[&["replay", &path, "--json", "--out", &out], words].concat());
        assert!(status(&printed) < 2, "{name} {words:?}: {}", said(&printed));
        let is_whole = replayed.identified.is_whole() && !replayed.is_short;
        assert_eq!(is_whole, status(&printed) == 0, "{name} {words:?}");
        let of = format!("{name} {words:?}");
        assert_same(at, &of, &String::from_utf8(printed.stdout).unwrap(), &replayed.identified.answer);
    }
}

#[test]
fn factors_solutions_and_predictions_are_those_of_the_commands() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    recordings(at);
    let caller = Caller::default();
    let mut factors = Vec::new();
    for name in ["bracket", "spikes", "reversed", "two-links"] {
        let file = format!("{name}.factor");
        let made = rigident(at, &["factor", &format!("{name}.csv"), "-o", &file]);
        assert_eq!(status(&made), 0, "{}", said(&made));
        let path = at.join(format!("{name}.csv"));
        let own = application::factor(path.into(), &FactorOptions::default(), &caller).unwrap();
        assert!(own.factor.to_bytes() == fs::read(at.join(&file)).unwrap(), "{name}");
        for warning in own.warnings() {
            assert!(said(&made).contains(warning.as_str()), "{name}: {warning}");
        }
        let printed = rigident(at, &["solve", &file, "--json"]);
        let solved = application::solve(&own.factor, &SolveOptions::default(), &caller).unwrap();
        assert_same(at, name, &String::from_utf8(printed.stdout).unwrap(), &solved.answer);
        factors.push(own.factor);
    }
    let merged =
        rigident(at, &["merge", "bracket.factor", "spikes.factor", "bracket.factor", "-o", "all.factor"]);
    assert_eq!(status(&merged), 0, "{}", said(&merged));
    let again = vec![factors[0].clone(), factors[1].clone(), factors[0].clone()];
    let all = application::merge(again, false, false).unwrap();
    assert_eq!((all.repeated, all.given), (1, 3));
    assert!(all.factor.to_bytes() == fs::read(at.join("all.factor")).unwrap());
    let other = application::merge(vec![factors[0].clone(), factors[3].clone()], false, false);
    assert!(matches!(other, Err(Error::Factors(_))), "{other:?}");

    let identified = rigident(at, &["identify", "bracket.csv", "--out", "of-bracket"]);
    assert_eq!(status(&identified), 0);
    let models = [at.join("of-bracket/result.json")];
    let options =
        PredictOptions { needs_measured: true, train: Some(at.join("bracket.csv")), ..Default::default() };
    let predicted = application::predict(&models, &at.join("spikes.csv"), &options, &caller).unwrap();
    let words = [
        "validate",
        "of-bracket/result.json",
        "spikes.csv",
        "--train",
        "bracket.csv",
        "--json",
        "--out",
        "p",
    ];
    let printed = rigident(at, &words);
    assert_eq!(status(&printed), 0, "{}", said(&printed));
    assert_same(at, "validate", &String::from_utf8(printed.stdout).unwrap(), &predicted.found);
    assert_eq!(predicted.csv(), fs::read_to_string(at.join("p/prediction.csv")).unwrap());
}

/// The library refuses what the command refuses, by its kind, and knows no words of the command line.
#[test]
fn refusals_of_the_command_are_refusals_of_the_library_by_their_kind() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    recordings(at);
    let lock = |joint: &str| {
        let mut tree = tree_of(at);
        tree.changes.lock = vec![joint.to_owned()];
        tree
    };
    let joint =
        Table::of("picks-up.csv").names.iter().find_map(|name| Some(name.strip_suffix("_rad")?.to_owned()));
    let joint: &'static str = Box::leak(joint.unwrap().into_boxed_str());
    type Kind = fn(&Error) -> bool;
    let refused: Vec<(&str, Vec<&str>, IdentifyOptions, Kind)> = vec![
        ("none.csv", vec![], with(|_| ()), |e| matches!(e, Error::Recording(_))),
        ("bracket.csv", vec!["--symmetric-sides"], with(|o| o.symmetric_sides = true), |e| {
            matches!(e, Error::OnlyForTrees(application::TreeOption::SymmetricSides))
        }),
        ("bracket.csv", vec!["--nominal-sigma", "0"], with(|o| o.nominal_sigma = 0.0), |e| {
            matches!(e, Error::NominalSigma(0.0))
        }),
        ("poses.csv", vec!["--forget", "3"], with(|o| o.span = Some(Span::TimeConstant(3.0))), |e| {
            matches!(e, Error::Span { .. })
        }),
        ("streams.rig.toml", vec!["--window", "5"], with(|o| o.span = Some(Span::Window(5.0))), |e| {
            matches!(e, Error::SpanOfStreams)
        }),
        (
            "bracket.csv",
            vec!["--tare", "none.csv"],
            with(|o| o.tare = vec![Fixture::File(at.join("none.csv"))]),
            |e| matches!(e, Error::Recording(_)),
        ),
        (
            "bracket.csv",
            vec!["--tare", "two-links.csv"],
            with(|o| o.tare = vec![Fixture::File(at.join("two-links.csv"))]),
            |e| matches!(e, Error::Tare(_)),
        ),
        (
            "bracket.csv",
            vec!["--known", "mass_kg=9±0.01"],
            with(|o| o.known = known(&["mass_kg=9±0.01"], &[])),
            |e| matches!(e, Error::Known(_)),
        ),
        ("bracket.csv", vec!["--estimate", "arm"], with(|o| o.asked = vec!["arm".into()]), |e| {
            matches!(e, Error::Answer(_))
        }),
        (
            "picks-up.csv",
            vec!["--model", "picks-up.urdf", "--lock", joint],
            with(|o| o.tree = lock(joint)),
            |e| matches!(e, Error::LockedMoves { .. }),
        ),
        ("picks-up.csv", vec![], with(|_| ()), |e| matches!(e, Error::Problem(_))),
    ];
    for (name, words, options, is_kind) in refused {
        let error = application::identify(at.join(name).into(), &options, &Caller::default()).unwrap_err();
        assert!(is_kind(&error), "{name} {words:?}: {error:?}");
        let printed = rigident(at, &[&["identify", name, "--out", "never"], words.as_slice()].concat());
        assert_eq!(status(&printed), 2, "{name} {words:?}: {}", said(&printed));
        assert!(!at.join("never").exists(), "{name} {words:?}");
    }
}

/// If the token is set, the work ends at its next stage, and the caller goes on.
#[cfg(feature = "simulator")]
#[test]
fn a_watch_is_that_of_the_command_to_the_last_bit() {
    let place = tempfile::tempdir().unwrap();
    let [recording, model] =
        ["picks-up.csv", "picks-up.urdf"].map(|name| example(name).display().to_string());
    let words = ["watch", &recording, "--model", &model, "--link", "hand", "--settle-s", "6", "--json"];
    let printed = rigident(place.path(), &words);
    assert_eq!(status(&printed), 0, "{}", said(&printed));
    let tree = Tree { model: Some(model.clone()), ..Tree::default() };
    let options = application::WatchOptions { tree, settle_s: 6.0, ..application::WatchOptions::of("hand") };
    let (mut noted, mut reported) = (Vec::new(), 0);
    let watched = application::watch(
        Path::new(&recording),
        &options,
        &mut |note| noted.push(note.to_owned()),
        &mut |_| reported += 1,
        &Caller::default(),
    );
    let watched = watched.unwrap();
    assert_eq!(String::from_utf8_lossy(&printed.stdout).trim(), serde_json::json!(watched).to_string());
    // Each change is reported when it is found, and when it has been measured.
    assert!(watched.is_whole && reported == 2 * watched.changes.len() && reported > 0, "{watched:?}");
    for note in noted.iter().chain(&watched.warnings) {
        assert!(note.contains('`') || said(&printed).contains(note.as_str()), "{note}");
    }
}

/// The library refuses by kind the tasks that a device cannot do, before there is one.
#[test]
fn tasks_beyond_every_device_are_refused_by_their_kind() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    recordings(at);
    let refused = |name: &str, options: ReplayOptions| {
        application::replay(&at.join(name), &options, &mut Nobody, &Caller::default()).unwrap_err()
    };
    let of_device = |error: Error| match error {
        Error::Device(own) => *own,
        other => panic!("{other:?}"),
    };
    let plain = ReplayOptions::default;
    let until = StopCriterion { until: vec!["m".to_owned()], keep_going: false };
    let found = of_device(refused("bracket.csv", ReplayOptions { stop: until, ..plain() }));
    assert!(matches!(found, DeviceError::Stop(StopError::NoPair(_))), "{found:?}");
    let none = Microcontroller::Port(at.join("none").display().to_string());
    let found = of_device(refused("bracket.csv", ReplayOptions { mcu: none, ..plain() }));
    assert!(found.is_of_the_link(), "{found:?}");
    let span = Some(Span::Window(3.0));
    let found = refused("two-links.csv", ReplayOptions { span, ..plain() });
    assert!(matches!(found, Error::SpanOfTree(_)), "{found:?}");
    let found = refused("two-links.csv", ReplayOptions { calibration: Some(at.join("c.toml")), ..plain() });
    assert!(matches!(found, Error::CalibrationOfTree), "{found:?}");
    assert!(matches!(refused("none.csv", plain()), Error::Recording(_)));
}

#[test]
fn a_job_that_is_stopped_ends_with_that_error() {
    let stop = std::sync::atomic::AtomicBool::new(true);
    let seen = std::sync::Mutex::new(Vec::new());
    let progress = |stage: &str, _: f64| seen.lock().unwrap().push(stage.to_owned());
    let caller = Caller::new(&progress);
    let path = example("bracket.csv");
    let stopped =
        application::identify(path.as_path().into(), &IdentifyOptions::default(), &caller.stopped_by(&stop));
    assert!(matches!(stopped, Err(Error::Stopped)), "{stopped:?}");
    assert_eq!(seen.lock().unwrap().len(), 1);
    assert!(application::identify(path.as_path().into(), &IdentifyOptions::default(), &caller).is_ok());
    assert!(seen.lock().unwrap().iter().any(|stage| stage == "answer"));
}

//! The library names parameters and jobs; users of the command line read options and commands, in every text.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use crate::documents::command_line::known;
use crate::program::{json, rigident, said, status};

/// Refused command lines, and the words that must be in their message.
const REFUSED: [(&str, &str); 32] = [
    ("identify a.csv --known mass_kg=3", "example --known mass_kg=20.013±0.005; `+-` and `+/-` do as well"),
    ("identify a.csv --known arm.mass_kg=3±0.1", "--known arm.mass_kg: there is one body without a name"),
    ("identify a.csv --symmetry q", "--symmetry q: write the normal"),
    ("identify a.csv --estimate colour", "--estimate colour: no parameter"),
    ("identify p.csv --model p.urdf --lock j", "--lock: p has no joint j"),
    ("identify p.csv --model p.urdf --lock elbow=x", "--lock elbow=x: x is no number"),
    ("identify p.csv --model p.urdf --spherical a,b,c", "--spherical: p has no joint a"),
    ("identify p.csv --model p.urdf --tool claw", "--tool claw: there is no link claw"),
    ("identify p.csv --model p.urdf --payload claw --tare p.csv", "--payload claw: there is no link claw"),
    ("identify p.csv --model p.urdf --friction x", "--friction x: there are viscous"),
    ("identify p.csv --model p.urdf --friction viscous", "leave --friction and --drive out"),
    ("identify p.csv --model p.urdf --symmetric-sides", "--symmetric-sides: p: no two links"),
    ("identify p.csv --model p.urdf --write-model a.pdf", "--write-model a.pdf: its name"),
    ("identify p.csv --model human34 --height-m 165 --mass-kg 60", "the height (--height-m) is 165 m"),
    ("identify p.csv --model human34 --height-m 1.65 --mass-kg 60 --segment shank=40", "--segment shank=40:"),
    ("solve damaged.factor", "write it anew from the recording with `rigident factor`"),
    ("plan poses --n 5 --margin 1.5", "--margin 1.5: a share"),
    ("plan poses --n 5 --stroke-m 5", "--stroke-m 5:"),
    ("plan poses --n 4 --rig a.rig.toml", "leave --rig out"),
    ("plan motion --duration-s 5", "give --duration-s 13 or more"),
    ("plan motion --duration-s 5", "without it (`rigident plan motion --no-poses`)"),
    ("plan motion --highest-hz 9", "--highest-hz 9: more than 0"),
    ("plan excitation p.urdf", "--range shoulder=-3.1,3.1 --speed shoulder=1 --effort shoulder=50"),
    ("plan excitation p.urdf", "are held with --lock"),
    ("plan excitation p.urdf --speed x=3", "--speed x=3: there is no joint x"),
    ("plan excitation p.urdf --speed 1 --effort 50 --range -3,3 --restarts 0", "--restarts 0: 1 to 1000"),
    (
        "plan excitation p.urdf --speed 1 --effort 50 --range -3,3 --bandwidth-hz 0.01",
        "a higher --bandwidth-hz",
    ),
    ("statics a.csv", "as of `rigident plan poses --n 5`, each"),
    ("configure --port none --from none.toml", "`rigident configure --write FILE` writes"),
    ("info --port /dev/no-such-port", "`rigident ports` lists those there are"),
    ("live --wrench serial:///dev/no-such-port", "`rigident ports` lists those that are here"),
    ("live --wrench x", "--wrench x: it begins with none"),
];

/// Returns names of the library in a text: backticked ones that are options here, and backticked calls.
fn names_of_the_library(text: &str, options: &BTreeSet<String>) -> Vec<String> {
    let is_one = |word: &&str| {
        let is_plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        let is_option =
            word.chars().all(is_plain) && options.contains(&format!("--{}", word.replace('_', "-")));
        is_option || word.ends_with(')')
    };
    text.split('`').filter(is_one).map(str::to_owned).collect()
}

fn examples(at: &Path) {
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples");
    for (name, short) in [
        ("bracket.csv", "a.csv"),
        ("bracket.rig.toml", "a.rig.toml"),
        ("picks-up.csv", "p.csv"),
        ("picks-up.rig.toml", "p.rig.toml"),
        ("picks-up.urdf", "p.urdf"),
    ] {
        fs::copy(from.join(name), at.join(short)).unwrap();
    }
    let urdf = fs::read_to_string(at.join("p.urdf")).unwrap().replacen("name=\"picks-up\"", "name=\"p\"", 1);
    fs::write(at.join("p.urdf"), urdf).unwrap();
    fs::write(at.join("damaged.factor"), b"RIGIDFAC and no more").unwrap();
}

#[test]
fn refusals_name_options_and_commands() {
    let place = tempfile::tempdir().unwrap();
    examples(place.path());
    let (_, options) = known();
    for (line, words) in REFUSED {
        let output = rigident(place.path(), &line.split(' ').collect::<Vec<_>>());
        let said = said(&output);
        assert!(status(&output) > 1, "{line}: {said}");
        assert!(said.contains(words), "{line}: {said}");
        let left = names_of_the_library(&said, &options);
        assert!(left.is_empty(), "{line}: {left:?} in {said}");
    }
}

/// The text, the object, the files and a failure's object.
#[test]
fn answers_name_options_and_commands() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    examples(at);
    let (_, options) = known();
    let forgetting = "(--forget 5)";
    let text = rigident(at, &["identify", "a.csv", "--forget", "5", "--out", "text"]);
    let object = rigident(at, &["identify", "a.csv", "--forget", "5", "--out", "object", "--json"]);
    let read = |name: &str| fs::read_to_string(at.join(name)).unwrap();
    let printed = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    let advice = "known properties with `rigident calibrate rig`";
    assert!(printed(&text.stdout).contains(advice));
    for text in [
        printed(&text.stdout),
        printed(&object.stdout),
        read("text/result.json"),
        read("text/report.html"),
        read("object/result.json"),
    ] {
        assert!(text.contains(forgetting), "{text}");
        let left = names_of_the_library(&text, &options);
        assert!(left.is_empty(), "{left:?}");
    }
    assert_eq!(
        json(&object),
        serde_json::from_str::<serde_json::Value>(&read("object/result.json")).unwrap()
    );
    let failed = json(&rigident(at, &["plan", "poses", "--n", "5", "--margin", "1.5", "--json"]));
    assert!(failed["error"].as_str().unwrap().starts_with("--margin 1.5"), "{failed}");
}

/// Keys of a file that are called like options stay keys; so do those of a schema.
#[test]
fn keys_of_files_stay_as_they_are() {
    let place = tempfile::tempdir().unwrap();
    fs::write(place.path().join("s.toml"), "seed = 1\n").unwrap();
    let refused = said(&rigident(place.path(), &["configure", "--port", "none", "--from", "s.toml"]));
    assert!(refused.contains("missing field `rate_hz`"), "{refused}");
    let schema = rigident(place.path(), &["schema", "rig"]);
    let schema = String::from_utf8(schema.stdout).unwrap();
    assert!(schema.contains("`rigident merge --by`") && schema.contains("`rig`"), "{schema}");
}

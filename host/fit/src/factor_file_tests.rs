use super::*;
use crate::RigRows;
use crate::examples::{Run, body, tree, truth};
use crate::pool::PoolError;

fn file(parameters: &[Parameter]) -> PooledFactor {
    Run::new(parameters, &truth(parameters.len()), 2 * parameters.len(), 3.0, 7).pooled
}

fn read(bytes: &[u8]) -> Result<PooledFactor, FactorFileError> {
    PooledFactor::from_bytes(bytes, "run 7").map_err(|error| match error {
        PoolError::File { error, .. } => error,
        other => panic!("{other}"),
    })
}

/// Magic and check sum about a body.
fn sealed(body: &[u8]) -> Vec<u8> {
    [MAGIC.as_slice(), body, &CRC.checksum(body).to_le_bytes()].concat()
}

#[test]
fn files_of_any_model_are_read_as_they_were_written() {
    for parameters in [body(), tree(1), tree(6)] {
        let file = file(&parameters).recorded_at(1_763_784_000);
        assert_eq!(read(&file.to_bytes()), Ok(file.clone()));
        let warnings = vec!["something came loose".to_owned(), "residuals are too large".to_owned()];
        let file = file.checked(&Checks { contradicted: true, warnings });
        assert_eq!(read(&file.to_bytes()), Ok(file));
    }
    let single = Parameter::new("J", crate::Owner::Other("pendulum".into()), crate::Kind::Other, "kg m2");
    let file = file(&[single]);
    assert_eq!(read(&file.to_bytes()), Ok(file));
}

#[test]
fn a_file_is_written_once_and_read_from_its_path() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("run.factor");
    let file = file(&tree(1));
    file.write(&path).unwrap();
    let read = PooledFactor::read(&path).unwrap();
    assert_eq!((read.rigs, read.name), (file.rigs.clone(), path.display().to_string()));
    assert!(matches!(file.write(&path), Err(PoolError::Access { .. })));
    assert!(matches!(PooledFactor::read(&place.path().join("none")), Err(PoolError::Access { .. })));
}

#[test]
fn every_damaged_byte_is_noticed() {
    let bytes = file(&tree(1)).to_bytes();
    for position in (0..bytes.len()).step_by(3) {
        let mut damaged = bytes.clone();
        damaged[position] ^= 0x10;
        assert!(read(&damaged).is_err(), "byte {position}");
        assert!(read(&bytes[..position]).is_err(), "cut at {position}");
    }
    assert_eq!(read(&bytes[..bytes.len() - 1]), Err(FactorFileError::Damaged));
}

#[test]
fn other_versions_and_other_files_are_named_by_kind() {
    for version in [0_u16, 1, 2] {
        let body = postcard::to_allocvec(&(version, 99_u64)).unwrap();
        let error = read(&sealed(&body)).unwrap_err();
        assert_eq!(error, FactorFileError::Old(version));
        assert!(error.to_string().contains("`factor()`"));
    }
    let body = postcard::to_allocvec(&(VERSION + 1, 99_u64)).unwrap();
    assert_eq!(read(&sealed(&body)), Err(FactorFileError::New(VERSION + 1)));
    for json in ["{\n  \"schema\": \"rigident/result/1\"", "\u{feff} {\"schema\":\"rigident/result/2\"}"] {
        assert_eq!(read(json.as_bytes()), Err(FactorFileError::Result));
    }
    assert_eq!(read(b"{\"schema\": \"other\"}"), Err(FactorFileError::NotAFactor));
    assert_eq!(read(b""), Err(FactorFileError::NotAFactor));
    assert_eq!(read(MAGIC), Err(FactorFileError::Damaged));
}

#[test]
fn hostile_sizes_are_refused_before_room_is_made() {
    let with = |parameters: u64, sources: u64| {
        let mut body = postcard::to_allocvec(&(VERSION, parameters, sources)).unwrap();
        body.extend([0xff; 16]);
        read(&sealed(&body)).unwrap_err()
    };
    assert!(matches!(with(u64::MAX, 1), FactorFileError::TooLarge { what: "parameters", .. }));
    assert!(matches!(with(2049, 1), FactorFileError::TooLarge { got: 2049, most: 2048, .. }));
    assert!(matches!(with(10, 1 << 40), FactorFileError::TooLarge { what: "runs", .. }));
    // Counts that lie: the lists themselves are bounded.
    assert_eq!(with(10, 1), FactorFileError::Damaged);
    let many: Vec<Parameter> = (0..2049)
        .map(|k| Parameter::new(format!("p{k}"), crate::Owner::Other(String::new()), crate::Kind::Other, ""))
        .collect();
    let good = file(&body());
    let bytes = PooledFactor { parameters: many, ..good }.to_bytes();
    assert!(matches!(read(&bytes), Err(FactorFileError::TooLarge { .. })));
}

#[test]
fn impossible_contents_are_named() {
    let good = file(&tree(1));
    let with = |change: &dyn Fn(&mut PooledFactor)| {
        let mut file = good.clone();
        change(&mut file);
        read(&file.to_bytes()).unwrap_err()
    };
    let header = |change: &dyn Fn(&mut PooledFactor)| matches!(with(change), FactorFileError::Header(_));
    assert!(header(&|f| f.parameters[1].name = "base.M".into()));
    assert!(header(&|f| f.parameters[1].name.clear()));
    assert!(header(&|f| f.parameters[0].made_of[0].1 = f64::NAN));
    assert!(header(&|f| f.rounding = 0.5));
    assert!(header(&|f| f.disagreement = f64::NAN));
    assert!(header(&|f| f.comparisons = u64::MAX));
    assert!(header(&|f| f.eliminated = u64::MAX));
    assert!(header(&|f| f.sources[0].channels.clear()));
    assert!(header(&|f| f.sources[0].channels[5].sigma = 0.0));
    assert!(header(&|f| f.sources[0].channels[5].gain_sigma = -1.0));
    assert!(header(&|f| f.sources[0].noise_gain = f64::INFINITY));
    assert!(header(&|f| f.sources[0].spurious_information = f64::NAN));
    assert!(header(&|f| f.sources[0].readings = vec![2, 1]));
    assert_eq!(with(&|f| f.sources.clear()), FactorFileError::Empty);
    assert_eq!(with(&|f| f.sources[0].rows = 0), FactorFileError::Empty);
    assert_eq!(with(&|f| f.rigs = vec![RigRows::plain(Factor::new(25))]), FactorFileError::Empty);
    let numbers =
        |change: &dyn Fn(&mut PooledFactor)| matches!(with(change), FactorFileError::Numbers { .. });
    assert!(numbers(&|f| _ = f.parameters.pop()));
    let bytes = good.to_bytes();
    let body = &bytes[8..bytes.len() - 4];
    let first = body.len() - 8 * good.factor().entries().len();
    for bad in [f64::NAN, f64::INFINITY, 1e200, -1e61] {
        for place in [0, 24, 325, 350] {
            let mut body = body.to_vec();
            body[first + 8 * place..first + 8 * (place + 1)].copy_from_slice(&bad.to_le_bytes());
            let refused = read(&sealed(&body));
            // A residual sum may be large.
            let large = place == 350 && bad > 0.0 && bad < 1e120;
            assert_eq!(
                matches!(refused, Err(FactorFileError::Numbers { got: 351, .. })),
                !large,
                "{bad} {place}"
            );
        }
    }
}

/// A name goes into a comment of a robot's program, onto a terminal, into a table: nothing of it may steer
/// these.
#[test]
fn names_that_steer_are_refused_wherever_they_are() {
    type Place = fn(&mut PooledFactor) -> &mut String;
    let places: [(&str, Place); 10] = [
        ("recording", |f| &mut f.sources[0].recording),
        ("parameter", |f| &mut f.parameters[0].name),
        ("unit", |f| &mut f.parameters[0].unit),
        ("frame", |f| &mut f.parameters[0].frame),
        ("made of", |f| &mut f.parameters[0].made_of[0].0),
        ("channel", |f| &mut f.sources[0].channels[0].name),
        ("channel's unit", |f| &mut f.sources[0].channels[0].unit),
        ("label", |f| f.sources[0].labels.entry("body".to_owned()).or_default()),
        ("error", |f| {
            f.differing.push(String::new());
            &mut f.differing[0]
        }),
        ("pair of runs", |f| {
            f.overlapping.push(String::new());
            &mut f.overlapping[0]
        }),
    ];
    let good = file(&tree(1));
    let long = "x".repeat(1025);
    for (what, place) in places {
        for bad in ["x\nmovej([0])\n#", "\u{1b}[2J", "\u{9b}8m", "a\u{202e}b", "a\0", long.as_str()] {
            let mut file = good.clone();
            bad.clone_into(place(&mut file));
            assert_eq!(read(&file.to_bytes()), Err(FactorFileError::Header(UNFIT_NAME)), "{what} {bad:?}");
        }
    }
    let owner =
        |name: &str| Parameter { owner: crate::Owner::Other(name.to_owned()), ..good.parameters[0].clone() };
    let mut file = good.clone();
    file.parameters[0] = owner("\u{7}");
    assert_eq!(read(&file.to_bytes()), Err(FactorFileError::Header(UNFIT_NAME)));
    let warned = |text: &str| {
        read(
            &good.clone().checked(&Checks { contradicted: true, warnings: vec![text.to_owned()] }).to_bytes(),
        )
    };
    assert!(warned("two\nlines").is_ok() && warned("\u{1b}]0;x").is_err());
}

/// The files of the fuzzer's corpus are of the present version.
#[test]
fn the_committed_files_are_read() {
    let corpus = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/factor_file");
    for (name, parameters) in [("body", body()), ("tree", tree(1)), ("rig", body())] {
        let bytes = std::fs::read(corpus.join(name)).unwrap();
        let file = read(&bytes).unwrap();
        assert_eq!(file.parameters, parameters);
        assert_eq!(file.to_bytes(), bytes);
        // What the fuzzer puts magic and check sum about.
        let bare = std::fs::read(corpus.join(format!("{name}-bare"))).unwrap();
        assert_eq!(sealed(&bare), bytes);
    }
}

/// A covariance that is larger than its standard deviations allow is none.
#[test]
fn impossible_correlations_of_errors_are_refused() {
    let corpus = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/factor_file");
    let bytes = std::fs::read(corpus.join("rig")).unwrap();
    let body = &bytes[8..bytes.len() - 4];
    // The lower triangle of two: the second number of the last three.
    let at = body.len() - 16;
    for bad in [1e-3, 1e300, f64::NAN] {
        let mut body = body.to_vec();
        body[at..at + 8].copy_from_slice(&f64::to_le_bytes(bad));
        assert!(matches!(read(&sealed(&body)), Err(FactorFileError::Numbers { .. })), "{bad}");
    }
}

/// Files of version 6 are read, and know no readings.
#[test]
fn a_file_without_readings_is_read() {
    let corpus = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/factor_file");
    let [old, new] = ["body-version-6", "body"].map(|name| std::fs::read(corpus.join(name)).unwrap());
    assert_ne!(old, new);
    assert_eq!(read(&old), read(&new));
    let mut own = read(&old).unwrap();
    own.sources[0].readings = vec![1, 7, 9];
    own.overlapping = vec!["a and b".to_owned()];
    assert_eq!(read(&own.to_bytes()), Ok(own));
}

/// Files of version 5 are read, and say that what was known of errors is in their rows.
#[test]
fn a_file_with_errors_in_its_rows_is_read_and_says_so() {
    let corpus = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/factor_file");
    let old = read(&std::fs::read(corpus.join("body-version-5")).unwrap()).unwrap();
    let new = read(&std::fs::read(corpus.join("body")).unwrap()).unwrap();
    assert!(old.errors_inside && !new.errors_inside);
    assert_eq!(old.factor(), new.factor());
    assert_eq!(old.fit().estimate, new.fit().estimate);
}

/// Files of version 3 are read, and carry no checks.
#[test]
fn a_file_without_checks_is_read_and_says_so() {
    let corpus = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/factor_file");
    let old = read(&std::fs::read(corpus.join("body-version-3")).unwrap()).unwrap();
    let new = read(&std::fs::read(corpus.join("body")).unwrap()).unwrap();
    assert_eq!(old.sources[0].checks, None);
    assert!(new.sources[0].checks.as_ref().is_some_and(|checks| checks.contradicted));
    assert_eq!((&old.factor(), &old.parameters), (&new.factor(), &new.parameters));
    assert!(old.fit().runs[0].checks.is_none() && new.fit().runs[0].is_contradicted());
}

/// Changed bytes under a check sum that fits: whatever is read can be solved, merged, taken off and
/// conditioned.
#[test]
fn hostile_bytes_end_in_an_error_or_a_fit() {
    use crate::prior::KnownValues;
    use crate::tare::Tare;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    let mut random = ChaCha8Rng::seed_from_u64(1);
    let known = ["mass_kg=20±0.1", "com_x_m=0.1±0.01", "ixx_com_kgm2=1±0.1"].map(str::to_owned);
    let known = KnownValues::parse(&known, &["y".to_owned()]).unwrap();
    let bytes = file(&body()).to_bytes();
    let mut kept = 0;
    for round in 0..3000 {
        let mut body = bytes[8..bytes.len() - 4].to_vec();
        for _ in 0..=round % 4 {
            let place = random.next_u32() as usize % body.len();
            body[place] = random.next_u32() as u8;
        }
        let Ok(pooled) = read(&sealed(&body)) else { continue };
        kept += 1;
        let bare = PooledFactor { sources: Vec::new(), ..pooled.clone() };
        for shared in [true, false] {
            let _ = PooledFactor::merged(vec![pooled.clone(), bare.clone()], shared).map(|f| f.fit());
        }
        let mut fit = pooled.fit();
        if let Ok(tare) = Tare::new(bare) {
            let _ = tare.take_off(&mut fit);
        }
        let _ = known.apply(&mut fit);
    }
    // Most changes fall on the digits of numbers.
    assert!((500..3000).contains(&kept), "{kept}");
}

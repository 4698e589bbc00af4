use super::*;

/// A file as each processor would write it, made of the format's description.
struct Writer {
    processor: u8,
    floating: bool,
    bytes: Vec<u8>,
}

impl Writer {
    fn word(&mut self, value: u16) {
        let bytes = if self.processor == 86 { value.to_be_bytes() } else { value.to_le_bytes() };
        self.bytes.extend(bytes);
    }

    fn number(&mut self, value: f32) {
        match self.processor {
            84 => self.bytes.extend(value.to_le_bytes()),
            86 => self.bytes.extend(value.to_be_bytes()),
            _ => {
                let [a, b, c, d] = (4.0 * value).to_le_bytes();
                self.bytes.extend([c, d, a, b]);
            }
        }
    }

    fn named(&mut self, group: i8, name: &str, body: impl FnOnce(&mut Self)) {
        self.bytes.extend([name.len() as u8, group as u8]);
        self.bytes.extend(name.bytes());
        let link = self.bytes.len();
        self.word(0);
        body(self);
        // No description.
        self.bytes.push(0);
        let length = (self.bytes.len() - link) as u16;
        let bytes = if self.processor == 86 { length.to_be_bytes() } else { length.to_le_bytes() };
        self.bytes[link..link + 2].copy_from_slice(&bytes);
    }

    fn numbers(&mut self, group: i8, name: &str, dimensions: &[u8], values: &[f32]) {
        self.named(group, name, |w| {
            w.bytes.extend([4, dimensions.len() as u8]);
            w.bytes.extend(dimensions);
            values.iter().for_each(|value| w.number(*value));
        });
    }

    fn words(&mut self, group: i8, name: &str, dimensions: &[u8], values: &[i16]) {
        self.named(group, name, |w| {
            w.bytes.extend([2, dimensions.len() as u8]);
            w.bytes.extend(dimensions);
            values.iter().for_each(|value| w.word(*value as u16));
        });
    }

    fn texts(&mut self, group: i8, name: &str, width: u8, texts: &[&str]) {
        self.named(group, name, |w| {
            w.bytes.extend([0xff, 2, width, texts.len() as u8]);
            for text in texts {
                w.bytes.extend(text.bytes().chain(std::iter::repeat(b' ')).take(usize::from(width)));
            }
        });
    }

    fn fill(&mut self, block: usize) {
        self.bytes.resize(block * BLOCK, 0);
    }
}

const MATRIX: fn(usize, usize) -> f32 = |row, column| (10 * row + column) as f32;

/// Makes a file: two points, seven channels sampled twice a frame, a plate; three frames, the second without
/// the first point.
fn file(processor: u8, floating: bool, kind: i16) -> Vec<u8> {
    let mut w = Writer { processor, floating, bytes: vec![2, KEY] };
    for word in [2, 14, 5, 7, 0] {
        w.word(word);
    }
    w.number(if floating { -0.1 } else { 0.1 });
    w.word(6);
    w.word(2);
    w.number(50.0);
    w.fill(1);
    w.bytes.extend([1, KEY, 4, processor]);
    w.words(1, "USED", &[], &[2]);
    w.named(-1, "POINT", |_| ());
    w.numbers(1, "SCALE", &[], &[if floating { -0.1 } else { 0.1 }]);
    w.numbers(1, "RATE", &[], &[50.0]);
    w.words(1, "DATA_START", &[], &[6]);
    w.words(1, "FRAMES", &[], &[3]);
    w.texts(1, "LABELS", 12, &["A Person:LFHD", "RFHD"].map(|t| &t[t.len().saturating_sub(12)..]));
    w.texts(1, "UNITS", 2, &["mm"]);
    w.named(-2, "analog", |_| ());
    w.words(2, "USED", &[], &[7]);
    w.numbers(2, "RATE", &[], &[100.0]);
    w.numbers(2, "GEN_SCALE", &[], &[0.5]);
    w.texts(2, "FORMAT", 8, &["SIGNED"]);
    w.numbers(2, "SCALE", &[7], &[2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 4.0]);
    w.words(2, "OFFSET", &[7], &[0, 0, 0, 0, 0, 0, 10]);
    w.texts(2, "LABELS", 3, &["Fx", "Fy", "Fz", "Mx", "My", "Mz", "EMG"]);
    w.named(-3, "FORCE_PLATFORM", |_| ());
    w.words(3, "USED", &[], &[1]);
    w.words(3, "TYPE", &[1], &[kind]);
    // More plates are described than are used.
    w.words(3, "CHANNEL", &[6, 2], &[1, 2, 3, 4, 5, 6, 2, 3, 4, 5, 6, 7]);
    w.numbers(
        3,
        "CORNERS",
        &[3, 4, 1],
        &[600.0, 400.0, 0.0, 0.0, 400.0, 0.0, 0.0, 0.0, 0.0, 600.0, 0.0, 0.0],
    );
    w.numbers(3, "ORIGIN", &[3, 1], &[0.0, 0.0, -40.0]);
    let matrix: Vec<f32> = (0..36).map(|k| MATRIX(k % 6, k / 6)).collect();
    w.numbers(3, "CAL_MATRIX", &[6, 6, 1], &matrix);
    w.bytes.extend([0, 0]);
    w.fill(5);
    for frame in 0..3_i16 {
        for point in 0..2_i16 {
            let seen = !(frame == 1 && point == 0);
            for value in [1000 + frame, 200 * point, -300, if seen { 1 } else { -1 }] {
                if w.floating {
                    // Floating points are written as they are, not in steps.
                    w.number(f32::from(value) * if value == 1 || value == -1 { 1.0 } else { 0.1 });
                } else {
                    w.word(value as u16);
                }
            }
        }
        for sample in 0..2 {
            for channel in 0..7 {
                let value = 100 * channel + 10 * sample + frame;
                if w.floating { w.number(f32::from(value)) } else { w.word(value as u16) }
            }
        }
    }
    w.bytes
}

#[test]
fn three_processors_write_the_same_recording_in_two_ways() {
    let first = C3d::parse(&file(84, true, 2)).unwrap();
    assert_eq!((first.rate_hz, first.frames, first.samples_per_frame), (50.0, 3, 2));
    // A name of a person is not part of a label.
    assert_eq!(first.labels, ["LFHD", "RFHD"]);
    assert_eq!(first.channels, ["Fx", "Fy", "Fz", "Mx", "My", "Mz", "EMG"]);
    let near = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
    assert!(near(first.point(0, 1).unwrap(), [0.1, 0.02, -0.03]), "{:?}", first.point(0, 1));
    assert_eq!((first.point(1, 0), first.point(3, 0), first.point(0, 2)), (None, None, None));
    // Scales: 2 · 0.5, the last one 4 · 0.5 less its offset.
    assert_eq!(first.analog[7..14], [10.0, 110.0, 210.0, 310.0, 410.0, 510.0, 1200.0]);
    assert_eq!(first.analog[14], 1.0);
    let plate = &first.plates[0];
    assert_eq!((plate.kind.clone(), plate.channels.as_slice()), (PlateKind::Wrench, &[0, 1, 2, 3, 4, 5][..]));
    assert!((plate.corners_m[0][0] - 0.6).abs() < 1e-7 && (plate.origin_m[2] + 0.04).abs() < 1e-7);
    for processor in [84, 85, 86] {
        for floating in [true, false] {
            let read = C3d::parse(&file(processor, floating, 2)).unwrap();
            assert_eq!(read.analog, first.analog);
            for (a, b) in read.points_m.iter().zip(&first.points_m) {
                assert!(near(*a, *b) || a[0].is_nan() && b[0].is_nan(), "{processor} {floating} {a:?} {b:?}");
            }
            assert_eq!((read.labels, read.plates), (first.labels.clone(), first.plates.clone()));
        }
    }
    let calibrated = C3d::parse(&file(84, true, 4)).unwrap();
    let PlateKind::Calibrated(matrix) = &calibrated.plates[0].kind else { panic!("{:?}", calibrated.plates) };
    assert_eq!((matrix[1][2], matrix[5][0]), (12.0, 50.0));
}

#[test]
fn faults_of_a_file_are_named() {
    let good = file(84, true, 2);
    let mut other = good.clone();
    other[1] = 0;
    assert_eq!(C3d::parse(&other), Err(C3dError::NotC3d));
    let mut other = good.clone();
    other[BLOCK + 3] = 7;
    assert_eq!(C3d::parse(&other), Err(C3dError::Processor(7)));
    for cut in [0, 1, 100, BLOCK + 2, BLOCK + 50, good.len() - 1] {
        let said = C3d::parse(&good[..cut]).unwrap_err();
        assert!(matches!(said, C3dError::Truncated { .. } | C3dError::NotC3d), "{cut}: {said}");
    }
    let said = C3d::parse(&file(84, true, 9)).unwrap_err().to_string();
    assert!(said.contains("FORCE_PLATFORM:TYPE") && said.contains("type 9"), "{said}");
    // Columns of eight channels are not there.
    let said = C3d::parse(&file(84, true, 3)).unwrap_err().to_string();
    assert!(said.contains("FORCE_PLATFORM:CHANNEL"), "{said}");
}

/// The zero of an unsigned converter is a word whose sign means nothing.
#[test]
fn offsets_of_an_unsigned_converter_are_unsigned() {
    let mut bytes = file(84, false, 2);
    let place = |bytes: &[u8], name: &[u8]| bytes.windows(name.len()).position(|w| w == name).unwrap();
    let format = place(&bytes, b"SIGNED  ");
    bytes[format..format + 8].copy_from_slice(b"UNSIGNED");
    // Behind a name come the link, the type, the rank and one dimension.
    let offset = place(&bytes, b"OFFSET") + 6 + 5;
    bytes[offset..offset + 2].copy_from_slice(&0x8000_u16.to_le_bytes());
    // The first sample follows two points of four words.
    let sample = 5 * BLOCK + 16;
    bytes[sample..sample + 2].copy_from_slice(&0x8005_u16.to_le_bytes());
    assert_eq!(C3d::parse(&bytes).unwrap().analog[0], 5.0);
}

/// Returns where a name's bytes are.
fn place(bytes: &[u8], name: &str) -> usize {
    bytes.windows(name.len()).position(|w| w == name.as_bytes()).unwrap()
}

#[test]
fn files_as_other_programs_write_them_are_read() {
    for processor in [84, 85, 86] {
        let good = file(processor, true, 2);
        let wanted = C3d::parse(&good).unwrap();
        assert!(wanted.notes.is_empty(), "{:?}", wanted.notes);
        // The block of the data: in the header alone, or nowhere.
        let mut other = good.clone();
        let start = place(&other, "DATA_START") + 10 + 4;
        other[start..start + 2].fill(0);
        let same = |other: &[u8]| C3d::parse(other).unwrap().analog == wanted.analog;
        assert!(same(&other));
        // Four blocks of parameters follow that of the header.
        other[16..18].fill(0);
        assert!(same(&other));
        // Processors counted from one, or none named, or another one.
        for code in [processor - 83, 0, if processor == 86 { 84 } else { 86 }] {
            let mut other = good.clone();
            other[BLOCK + 3] = code;
            let read = C3d::parse(&other).unwrap();
            assert_eq!(read.analog, wanted.analog, "{processor} as {code}");
            assert_eq!(read.notes.is_empty(), code == processor - 83, "{:?}", read.notes);
        }
    }
    let good = file(84, true, 2);
    let with = |from: &str, to: &str| {
        let mut other = good.clone();
        let at = place(&other, from);
        other[at..at + to.len()].copy_from_slice(to.as_bytes());
        other
    };
    let equal = C3d::parse(&with("RFHD        ", "LFHD        ")).unwrap();
    assert_eq!(equal.labels, ["LFHD", "LFHD (2)"]);
    assert!(equal.notes[0].contains("several points are called LFHD"), "{:?}", equal.notes);
    assert!(C3d::parse(&with("mm", "MM")).is_ok());
    let said = C3d::parse(&with("mm", "xy")).unwrap_err().to_string();
    assert!(said.contains("POINT:UNITS"), "{said}");
    // A plate without channels, and one without corners.
    for (name, bytes, why) in [("CHANNEL", 2 * 6, "no channels"), ("CORNERS", 4 * 12, "no corners")] {
        let mut other = good.clone();
        let at = place(&other, name) + name.len();
        let data = at + 4 + usize::from(other[at + 3]);
        other[data..data + bytes].fill(0);
        let read = C3d::parse(&other).unwrap();
        assert!(read.plates.is_empty());
        assert!(
            read.notes.iter().any(|note| note.contains(&format!("plate 1 has {why}"))),
            "{:?}",
            read.notes
        );
    }
}

#[test]
fn rotations_without_markers_are_named() {
    let mut w = Writer { processor: 84, floating: true, bytes: vec![2, KEY] };
    for word in [0, 0, 1, 3, 0] {
        w.word(word);
    }
    w.number(-1.0);
    w.word(4);
    w.word(0);
    w.number(50.0);
    w.fill(1);
    w.bytes.extend([1, KEY, 2, 84]);
    w.named(-1, "POINT", |_| ());
    w.words(1, "USED", &[], &[0]);
    w.numbers(1, "SCALE", &[], &[-1.0]);
    w.named(-2, "ROTATION", |_| ());
    w.words(2, "USED", &[], &[12]);
    w.bytes.extend([0, 0]);
    w.fill(4);
    let said = C3d::parse(&w.bytes).unwrap_err().to_string();
    assert!(said.contains("rotations of segments and no markers"), "{said}");
}

#[test]
#[ignore = "needs ../shared/cases"]
fn shared_cases_state_where_their_data_start_in_the_header() {
    let file =
        concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/cases/c3d-datastart-zero/walk_datastart0.c3d");
    let walk = C3d::parse(&std::fs::read(file).unwrap()).unwrap();
    let seen = (0..walk.frames).filter(|k| walk.point(*k, 0).is_some()).count();
    assert!(
        walk.plates.len() == 3 && seen > 0,
        "{} plates, {seen} of {} frames",
        walk.plates.len(),
        walk.frames
    );
    // A person is between the floor and two metres above it.
    let heights: Vec<f32> = walk.points_m.iter().map(|p| p[2]).filter(|z| z.is_finite()).collect();
    let inside = heights.iter().filter(|z| (-0.1..2.2).contains(*z)).count();
    assert!(inside * 100 > heights.len() * 99, "{inside} of {}", heights.len());
}

#[test]
fn broken_files_never_panic() {
    let good = file(84, false, 4);
    let mut state = 88_172_645_463_325_252_u64;
    for k in 0..20_000 {
        let mut bytes = good.clone();
        if k % 3 == 0 {
            bytes.truncate(k % bytes.len() + 1);
        }
        for _ in 0..4 {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            let at = (state as usize) % bytes.len().min(1100);
            bytes[at] = (state >> 32) as u8;
        }
        let _ = C3d::parse(&bytes);
    }
}

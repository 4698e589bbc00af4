use super::*;

/// The items of a message that an MTi-300 sent, with what the vendor's MT Manager made of them: packet
/// counter 42581, sample time 5719854, acceleration −0.07915300 −0.16655955 9.82217598, rate of turn
/// −0.00541657 −0.00458360 0.00792891.
const RECORDED: [u8; 139] = [
    0x10, 0x20, 0x02, 0xA6, 0x55, 0x10, 0x60, 0x04, 0x00, 0x57, 0x47, 0x2E, 0x20, 0x10, 0x10, 0x3F, 0x7F,
    0x7D, 0xC4, 0xBC, 0x10, 0x10, 0x7D, 0x3B, 0xA1, 0x57, 0x70, 0xBD, 0x7E, 0xC6, 0x56, 0x40, 0x20, 0x0C,
    0xBD, 0xA2, 0x1A, 0xF8, 0xBE, 0x2A, 0x8E, 0x96, 0x41, 0x1D, 0x27, 0xA2, 0x40, 0x10, 0x0C, 0xB9, 0x4F,
    0xC8, 0x00, 0xB9, 0xDA, 0x24, 0x00, 0x3C, 0xC9, 0x28, 0x80, 0x40, 0x30, 0x0C, 0x3C, 0x02, 0xC8, 0x9C,
    0x3C, 0x35, 0xF6, 0xC8, 0x3C, 0xDB, 0x0C, 0x00, 0x80, 0x20, 0x0C, 0xBB, 0xB1, 0x7D, 0x81, 0xBB, 0x96,
    0x32, 0x00, 0x3C, 0x01, 0xE8, 0x41, 0x80, 0x30, 0x10, 0x3F, 0x80, 0x00, 0x00, 0xB6, 0xE3, 0x30, 0x01,
    0xB6, 0xC0, 0x40, 0x00, 0x37, 0x26, 0x48, 0x00, 0xC0, 0x20, 0x0C, 0xBE, 0x99, 0x9C, 0x24, 0x3F, 0xB6,
    0x1B, 0x56, 0x3F, 0x16, 0x6A, 0xEB, 0x30, 0x10, 0x04, 0x00, 0x01, 0x86, 0xDE, 0xE0, 0x20, 0x04, 0x00,
    0x40, 0x00, 0x03,
];

fn framed(data: &[u8]) -> Vec<u8> {
    let mut bytes = vec![PREAMBLE, BUS, DATA];
    match u8::try_from(data.len()) {
        Ok(length) if length != EXTENDED => bytes.push(length),
        _ => {
            bytes.push(EXTENDED);
            bytes.extend((data.len() as u16).to_be_bytes());
        }
    }
    bytes.extend(data);
    let sum = bytes[1..].iter().fold(0_u8, |sum, b| sum.wrapping_add(*b));
    bytes.push(0_u8.wrapping_sub(sum));
    bytes
}

#[test]
fn a_recorded_message_is_read_as_the_vendor_reads_it() {
    let found = items(&RECORDED).unwrap();
    assert_eq!((found.counter, found.ticks), (Some(42_581), Some(5_719_854)));
    let near =
        |a: Option<[f64; 3]>, b: [f64; 3]| a.unwrap().iter().zip(b).all(|(a, b)| (a - b).abs() < 5.1e-9);
    assert!(near(found.accel, [-0.079_153_00, -0.166_559_55, 9.822_175_98]));
    assert!(near(found.gyro, [-0.005_416_57, -0.004_583_60, 0.007_928_91]));
    assert!(found.free_accel);
    // Configuration messages of the same device, with the check sums that the vendor's tool sent.
    for bytes in
        [[0xFA, 0xFF, 0x30, 0x00, 0xD1], [0xFA, 0xFF, 0x10, 0x00, 0xF1], [0xFA, 0xFF, 0x31, 0x00, 0xD0]]
    {
        assert!(matches!(message(&bytes), Piece::Whole { .. }));
    }
}

fn numbered(counter: u16) -> Vec<u8> {
    let mut data = RECORDED;
    data[3..5].copy_from_slice(&counter.to_be_bytes());
    framed(&data)
}

#[test]
fn messages_are_found_between_anything_and_counted() {
    let mut decoder = Decoder::default();
    let mut bytes = vec![1, 2, PREAMBLE, 3];
    bytes.extend(numbered(65_535));
    bytes.extend([PREAMBLE]);
    bytes.extend(numbered(2));
    let mut flipped = numbered(3);
    flipped[20] ^= 1;
    bytes.extend(flipped);
    bytes.extend(numbered(4));
    let mut rows = Vec::new();
    bytes.iter().for_each(|byte| decoder.feed(&[*byte], &mut rows));
    assert_eq!(rows.len(), 3);
    assert_eq!(rows[0].time_ns, Some(571_985_400_000));
    let losses = decoder.losses;
    // 0 and 1 between the first two, and the damaged one.
    assert_eq!((losses.lost, losses.late), (3, 0));
    assert!(losses.damaged >= 1);
}

#[test]
fn every_format_of_numbers_is_read() {
    let fixed = |v: f64| ((v * f64::from(1 << 20)).round() as i32).to_be_bytes();
    let bytes: Vec<u8> = [1.5, -2.25, 0.125].into_iter().flat_map(fixed).collect();
    assert_eq!(three(0x4021, &bytes), Some([1.5, -2.25, 0.125]));
    // −2.25 as 16.32: whole part −3, fraction 0.75, the fraction first.
    let wide =
        |whole: i16, fraction: u32| [fraction.to_be_bytes().to_vec(), whole.to_be_bytes().to_vec()].concat();
    let bytes = [wide(1, 1 << 31), wide(-3, 3 << 30), wide(0, 1 << 29)].concat();
    assert_eq!(three(0x4022, &bytes), Some([1.5, -2.25, 0.125]));
    let bytes: Vec<u8> = [1.5, -2.25, 0.125].into_iter().flat_map(f64::to_be_bytes).collect();
    assert_eq!(three(0x4023, &bytes), Some([1.5, -2.25, 0.125]));
    assert_eq!(three(0x4020, &bytes), None);
    // A long message, of several items.
    let long = [RECORDED.as_slice(), &RECORDED].concat();
    let mut rows = Vec::new();
    Decoder::default().feed(&framed(&long), &mut rows);
    assert_eq!(rows.len(), 1);
}

#[test]
fn outputs_that_are_missing_are_named() {
    let mut decoder = Decoder::default();
    let free = [0x10, 0x20, 2, 0, 0, 0x40, 0x30, 12, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    for k in 0..60 {
        let mut data = free;
        data[4] = k;
        decoder.feed(&framed(&data), &mut Vec::new());
    }
    let said = decoder.lacks().unwrap();
    assert!(
        said.contains("no Acceleration (0x4020) and no Rate of Turn (0x8020); Free Acceleration"),
        "{said}"
    );
    let mut noise = Decoder::default();
    noise.feed(&[0; 30_000], &mut Vec::new());
    assert!(noise.lacks().unwrap().contains("baud"));
}

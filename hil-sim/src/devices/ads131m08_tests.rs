//! The model against its data sheet.

use super::*;

/// Returns a frame of 24-bit words with the given 16-bit words first.
fn frame(words: &[u16]) -> Vec<u8> {
    let mut out = Vec::new();
    for w in words {
        out.extend_from_slice(&w.to_be_bytes());
        out.push(0);
    }
    out.resize(out.len().max(30), 0);
    out
}

fn exchange(adc: &mut Ads131m08, words: &[u16]) -> Vec<u8> {
    let mut bytes = frame(words);
    adc.transfer(&mut bytes);
    bytes
}

fn word(bytes: &[u8], i: usize) -> u16 {
    u16::from_be_bytes([bytes[3 * i], bytes[3 * i + 1]])
}

fn sample(bytes: &[u8], channel: usize) -> i32 {
    let b = &bytes[3 * (channel + 1)..];
    i32::from_be_bytes([b[0], b[1], b[2], 0]) >> 8
}

#[test]
fn crc_matches_the_catalogue_check_value() {
    // CRC-16/IBM-3740 (CCITT, seed FFFF) of "123456789".
    assert_eq!(crc16(0x1021, b"123456789"), 0x29B1);
    // CRC-16/CMS (8005, seed FFFF, not reflected).
    assert_eq!(crc16(0x8005, b"123456789"), 0xAEE7);
}

#[test]
fn first_frame_after_power_on_says_reset_and_registers_hold_their_defaults() {
    let mut adc = Ads131m08::new();
    assert_eq!(word(&exchange(&mut adc, &[0xA000]), 0), 0xFF28);
    let reads: Vec<u16> = [0x01u16, 0x02, 0x03, 0x06, 0x0C]
        .iter()
        .map(|a| word(&exchange(&mut adc, &[0xA000 | a << 7]), 0))
        .collect();
    // Each answer belongs to the command one frame earlier.
    assert_eq!(reads, [0x2800, 0x0500, 0x0510, 0xFF0E, 0x0600]);
    assert_eq!(word(&exchange(&mut adc, &[0]), 0), 0x8000);
    assert_eq!(adc.rate_hz(), Some(4000.0));
}

#[test]
fn output_crc_covers_all_words_before_it() {
    let mut adc = Ads131m08::new();
    adc.convert(&[0.1, -0.2, 0.3, -0.4, 0.5, -0.6, 0.7, -0.8]);
    let bytes = exchange(&mut adc, &[0]);
    assert_eq!(word(&bytes, 9), crc16(0x1021, &bytes[..27]));
}

#[test]
fn words_are_volts_times_gain_over_full_scale() {
    let mut adc = Ads131m08::new();
    exchange(&mut adc, &[0x6000 | 0x04 << 7 | 1, 0x0076, 0x0000]);
    let ack = exchange(&mut adc, &[0]);
    assert_eq!(word(&ack, 0), 0x4000 | 0x04 << 7 | 1);
    let volts = [0.004, 0.003, -1.3, 1.3, -1.2, 0.0, 1.0, -1.0];
    adc.convert(&volts);
    let bytes = exchange(&mut adc, &[0]);
    // Channels 0 and 1 have gains 64 and 128, the others 1.
    for (channel, gain) in [64.0, 128.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0].into_iter().enumerate() {
        let full = f64::from(1 << 23);
        let want = (volts[channel] * gain / 1.2 * full).clamp(-full, full - 1.0);
        assert!((f64::from(sample(&bytes, channel)) - want).abs() <= 0.5, "channel {channel}");
    }
}

#[test]
fn ready_bits_are_set_by_a_conversion_and_cleared_by_reading_it() {
    let mut adc = Ads131m08::new();
    exchange(&mut adc, &[0]);
    assert_eq!(word(&exchange(&mut adc, &[0]), 0), 0x0500);
    adc.convert(&[0.0; 8]);
    assert_eq!(word(&exchange(&mut adc, &[0]), 0), 0x05FF);
    assert_eq!(word(&exchange(&mut adc, &[0]), 0), 0x0500);
}

#[test]
fn clock_register_sets_rate_and_group_delay() {
    let mut adc = Ads131m08::new();
    // OSR 4096.
    exchange(&mut adc, &[0x6000 | 0x03 << 7, 0xFF16]);
    assert_eq!(adc.rate_hz(), Some(1000.0));
    // Impulse response of a sinc³ of 1024 and an average of 4, convolved in the open: its centroid.
    let boxcar = |n: usize, step: usize, input: &[f64]| {
        let mut out = vec![0.0; input.len() + (n - 1) * step];
        for (i, v) in input.iter().enumerate() {
            for k in 0..n {
                out[i + k * step] += v;
            }
        }
        out
    };
    let mut h = vec![1.0];
    for _ in 0..3 {
        h = boxcar(1024, 1, &h);
    }
    h = boxcar(4, 1024, &h);
    let (mass, moment) = h.iter().enumerate().fold((0.0, 0.0), |(m, s), (i, v)| (m + v, s + i as f64 * v));
    assert!((moment / mass / 4.096e6 - adc.group_delay_s()).abs() < 1e-9);
    assert_eq!(adc.group_delay_s(), Ads131m08::group_delay_at_s(1000.0));
}

#[test]
fn a_wrong_input_crc_raises_crc_err_once_and_stops_commands_but_not_writes() {
    let mut adc = Ads131m08::new();
    exchange(&mut adc, &[0x6000 | 0x02 << 7, 0x1110]);
    // Good check word: the read is carried out.
    let read = 0xA000 | 0x03 << 7;
    let good = crc16(0x1021, &frame(&[read])[..3]);
    exchange(&mut adc, &[read, good]);
    let null = [0, crc16(0x1021, &[0, 0, 0])];
    assert_eq!(word(&exchange(&mut adc, &null), 0), 0xFF0E);
    // Bad one: STATUS with CRC_ERR instead, and only once.
    exchange(&mut adc, &[read, good ^ 1]);
    assert_eq!(word(&exchange(&mut adc, &null), 0) & 0x1000, 0x1000);
    assert_eq!(word(&exchange(&mut adc, &null), 0) & 0x1000, 0);
    exchange(&mut adc, &[0x6000 | 0x03 << 7, 0xFF16, 0xBAD0]);
    assert_eq!(word(&exchange(&mut adc, &null), 0) & 0x1000, 0x1000);
    assert_eq!(adc.rate_hz(), Some(1000.0));
}

#[test]
fn several_registers_come_after_an_acknowledgement_and_instead_of_data() {
    let mut adc = Ads131m08::new();
    exchange(&mut adc, &[0xA000 | 0x02 << 7 | 2]);
    let bytes = exchange(&mut adc, &[0]);
    let words: Vec<u16> = (0..4).map(|i| word(&bytes, i)).collect();
    assert_eq!(words, [0xE000 | 0x02 << 7 | 2, 0x0510, 0xFF0E, 0x0000]);
    assert_eq!(word(&bytes, 4), crc16(0x1021, &bytes[..12]));
}

#[test]
fn a_flipped_bit_breaks_exactly_the_chosen_frame() {
    let mut adc = Ads131m08::new();
    adc.flip_bit(1, 30);
    let intact = |bytes: &[u8]| word(bytes, 9) == crc16(0x1021, &bytes[..27]);
    let seen: Vec<bool> = (0..3).map(|_| intact(&exchange(&mut adc, &[0]))).collect();
    assert_eq!(seen, [true, false, true]);
}

#[test]
fn reset_needs_a_whole_frame_and_brings_the_defaults_back() {
    let mut adc = Ads131m08::new();
    exchange(&mut adc, &[0x6000 | 0x03 << 7, 0xFF16]);
    let mut short = vec![0x00, 0x11, 0x00];
    adc.transfer(&mut short);
    assert_eq!(adc.rate_hz(), Some(1000.0));
    assert_eq!(word(&exchange(&mut adc, &[0x0011]), 0), 0x0011);
    assert_eq!(word(&exchange(&mut adc, &[0]), 0), 0xFF28);
    assert_eq!(adc.rate_hz(), Some(4000.0));
}

#[test]
fn frames_of_any_length_are_survived() {
    for length in 0..40 {
        let mut adc = Ads131m08::new();
        let mut bytes = vec![0x60; length];
        adc.transfer(&mut bytes);
        adc.transfer(&mut vec![0xFF; length]);
    }
}

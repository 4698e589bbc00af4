//! A line full of noise: what is understood was sent, and what was sent whole is understood.

use crate::samples::{self, Message};
use rigident_shared::wire::frame::{MAX_FRAME, MAX_PAYLOAD};
use rigident_shared::wire::{Command, Decoder, InjectBatch, Kind, WatchFrame, encode};

/// Marsaglia's xorshift, so that every run is the same.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }
    fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }
}

fn batch(sequence: u16, length: u64) -> ([u8; MAX_FRAME], usize) {
    let readings = (0..length).map(|k| samples::reading(k as u32)).collect();
    let command = Command::Inject(InjectBatch { first_index: u32::from(sequence), readings });
    let mut bytes = [0; MAX_FRAME];
    let used = encode(Kind::Command, sequence, &command, &mut bytes).unwrap();
    (bytes, used)
}

#[test]
fn whole_frames_between_noise_are_all_understood_and_nothing_else_is() {
    let mut noise = Noise(0x9e37_79b9_7f4a_7c15);
    let mut decoder = Decoder::new();
    let (mut sent, mut understood) = (Vec::new(), Vec::new());
    for sequence in 0..3000_u16 {
        let mut line = Vec::new();
        // Noise of any length, longer than a frame too, then the zero that ends it.
        let length = noise.below(if sequence % 50 == 0 { 3 * MAX_FRAME as u64 } else { 40 });
        line.extend((0..length).map(|_| noise.next() as u8));
        line.push(0);
        let (mut bytes, used) = {
            let n = noise.below(17);
            batch(sequence, n)
        };
        if noise.below(3) == 0 {
            let at = noise.below(used as u64 - 1) as usize;
            match noise.below(3) {
                0 => bytes[at] ^= 1 << noise.below(8),
                1 => bytes[at] = 0,
                _ => bytes[..used].rotate_left(1),
            }
        } else {
            sent.push(sequence);
        }
        line.extend_from_slice(&bytes[..used]);
        line.push(0);
        for byte in line {
            if let Some(Ok(frame)) = decoder.push(byte) {
                assert!(frame.payload.len() <= MAX_PAYLOAD);
                let Ok(Command::Inject(batch)) = frame.message() else { panic!("nobody sent {frame:?}") };
                assert_eq!(batch.first_index, u32::from(frame.sequence));
                understood.push(frame.sequence);
            }
        }
    }
    assert_eq!(understood, sent);
}

#[test]
fn every_message_cut_short_or_changed_is_refused_or_read_never_a_panic() {
    let mut noise = Noise(7);
    for (name, message) in samples::samples() {
        let payload = match &message {
            Message::Command(m) => postcard(m),
            Message::Answer(m) => postcard(m),
            Message::Telemetry(m) => postcard(m),
            Message::Stream(m) => m.clone(),
        };
        let read = |payload: &[u8]| {
            let frame = rigident_shared::wire::Frame { kind: Kind::Command, sequence: 0, payload };
            match &message {
                Message::Command(_) => frame.message::<Command>().is_ok(),
                Message::Answer(_) => frame.message::<rigident_shared::wire::Answer>().is_ok(),
                Message::Telemetry(_) => frame.message::<rigident_shared::wire::Telemetry>().is_ok(),
                Message::Stream(_) => WatchFrame::decode(payload, 3, 1).is_ok(),
            }
        };
        assert!(read(&payload), "{name}");
        for length in 0..payload.len() {
            assert!(!read(&payload[..length]), "{name} cut to {length}");
        }
        for _ in 0..2000 {
            let mut changed = payload.clone();
            for _ in 0..=noise.below(3) {
                let at = noise.below(changed.len() as u64) as usize;
                changed[at] = noise.next() as u8;
            }
            read(&changed);
        }
    }
}

/// Returns the payload of a message, taken out of its frame.
fn postcard<M: serde::Serialize>(message: &M) -> Vec<u8> {
    let mut bytes = [0; MAX_FRAME];
    let used = encode(Kind::Command, 0, message, &mut bytes).unwrap();
    let mut decoder = Decoder::new();
    bytes[..used]
        .iter()
        .find_map(|byte| decoder.push(*byte).map(|frame| frame.unwrap().payload.to_vec()))
        .unwrap()
}

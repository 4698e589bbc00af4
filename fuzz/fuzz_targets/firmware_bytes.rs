//! Any host at the other end of the firmware's serial line, with any samples and any clock.
//!
//! The input is read as steps. Random bytes would hardly ever carry a right check, so one kind of step puts
//! its bytes as a payload into a frame that does: of a command, or one of a robot that is watched.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigident_firmware::drivers::frames::{AnyFrame, FrameKind};
use rigident_firmware::{App, BringUpError, Path, Sensor};
use rigident_shared::wire::{Answer, Decoder, Kind, SensorFault, SettingName, Telemetry, encode_payload};

fuzz_target!(|bytes: &[u8]| {
    let mut app = App::new("fuzz", Box::<Path>::default());
    let mut host = Decoder::new();
    let mut rest = bytes;
    let mut now_ns = 0_u64;
    while let [step, low, high, after @ ..] = rest {
        let length = u16::from_le_bytes([*low, *high]) % 1024;
        let (taken, after) = after.split_at(after.len().min(usize::from(length)));
        rest = after;
        match step % 6 {
            0 => receive(&mut app, taken, now_ns, true),
            1 | 2 => {
                let mut line = [0; 1100];
                let sequence = u16::from(step / 6);
                let kind = if step & 128 == 0 { Kind::Command } else { Kind::Stream };
                let used = encode_payload(kind, sequence, taken, &mut line).expect("it is short");
                receive(&mut app, &line[..used], now_ns, step & 64 == 0);
            }
            3 if step & 128 != 0 => {
                let (links, kind) = app.frame_links().unwrap_or((1, FrameKind::Imu));
                match AnyFrame::decode(taken, links, kind) {
                    Ok(frame) => app.on_frame(now_ns, &frame),
                    Err(_) => app.on_frame_of_links(now_ns, *low),
                }
            }
            3 => {
                let mut values = floats(taken);
                let volts = core::array::from_fn(|_| values());
                app.on_gauges(now_ns, volts, values());
            }
            4 => {
                let mut values = floats(taken);
                let words = [core::array::from_fn(|_| values()), core::array::from_fn(|_| values())];
                if step & 128 == 0 {
                    app.on_imu(now_ns, words[0], words[1]);
                } else {
                    app.on_second_imu(now_ns, words[0], words[1]);
                }
            }
            _ => {
                now_ns = now_ns.saturating_add(u64::from(length) << (step / 6));
                if length == 0 {
                    app.on_sensor_error(Sensor::LoadCell, SensorFault::Check);
                    app.on_overruns(u32::from(*step));
                }
                app.tick(now_ns);
            }
        }
        app.work();
        drain(&mut app, &mut host, usize::from(length));
    }
    drain(&mut app, &mut host, usize::MAX);
});

fn receive(app: &mut App<Box<Path>>, bytes: &[u8], now_ns: u64, sensors_come_up: bool) {
    for &byte in bytes {
        if app.on_byte(byte, now_ns).is_some() {
            let fault = BringUpError::Setting(SettingName::Rate);
            app.sensors_up(if sensors_come_up { Ok(()) } else { Err(fault) });
        }
    }
}

fn floats(bytes: &[u8]) -> impl FnMut() -> f32 {
    let mut words = bytes.chunks_exact(4);
    move || words.next().map_or(1.0, |word| f32::from_le_bytes([word[0], word[1], word[2], word[3]]))
}

/// Whatever the firmware says is whole and well-formed.
fn drain(app: &mut App<Box<Path>>, host: &mut Decoder, at_most: usize) {
    let mut chunk = [0; 64];
    let mut taken = 0;
    while taken < at_most && app.tx_pending() > 0 {
        let used = app.poll_tx(&mut chunk);
        assert!(used > 0, "bytes are waiting, yet none are given");
        taken += used;
        for &byte in &chunk[..used] {
            let Some(frame) = host.push(byte) else { continue };
            let frame = frame.expect("the line between them loses nothing");
            match frame.kind {
                Kind::Answer => assert!(frame.message::<Answer>().is_ok()),
                Kind::Telemetry => assert!(frame.message::<Telemetry>().is_ok()),
                Kind::Command | Kind::Stream => panic!("the firmware commands the host"),
            }
        }
    }
}

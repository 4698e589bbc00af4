//! Any bytes on the line: no panic, and a command that was understood survives being sent again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigident_shared::wire::frame::{Decoder, MAX_FRAME, encode};
use rigident_shared::wire::messages::{Answer, Command};
use rigident_shared::wire::watch_frame::WatchFrame;

fuzz_target!(|bytes: &[u8]| {
    let mut decoder = Decoder::new();
    for &byte in bytes {
        let Some(Ok(frame)) = decoder.push(byte) else { continue };
        let _ = frame.message::<Answer>();
        if let [links, feet, ..] = frame.payload
            && let Ok(watched) = WatchFrame::decode(frame.payload, usize::from(*links), usize::from(*feet))
        {
            assert_eq!(
                (watched.feet().count(), watched.joints().count()),
                (usize::from(*feet), usize::from(*links).saturating_sub(1))
            );
        }
        let Ok(command) = frame.message::<Command>() else { continue };
        let mut line = [0; MAX_FRAME];
        let length = encode(frame.kind, frame.sequence, &command, &mut line).expect("it came in one frame");
        let mut again = Decoder::new();
        let second = line[..length].iter().find_map(|&byte| again.push(byte).map(|r| r.is_ok()));
        assert_eq!(second, Some(true));
    }
    // However the line was left, two zeros later a good frame is understood.
    let mut line = [0; MAX_FRAME];
    let kind = rigident_shared::wire::frame::Kind::Command;
    let length = encode(kind, 7, &Command::ReadCounters, &mut line).expect("it is short");
    decoder.push(0);
    let understood = line[..length]
        .iter()
        .find_map(|&byte| decoder.push(byte).map(|frame| frame.is_ok_and(|frame| frame.sequence == 7)));
    assert_eq!(understood, Some(true));
});

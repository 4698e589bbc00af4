//! Any MCAP file: no panic, and what was read survives being written and read again.
#![no_main]

use std::io::Cursor;

use libfuzzer_sys::fuzz_target;
use rigident::recording::Recording;

fuzz_target!(|bytes: &[u8]| {
    let Ok(first) = Recording::from_mcap_bytes("fuzz.mcap", bytes, None) else { return };
    if first.groups().is_empty() && first.extra.is_empty() {
        return;
    }
    let Ok(file) = first.write_mcap(Cursor::new(Vec::new())) else { return };
    let second = Recording::from_mcap_bytes("fuzz.mcap", file.get_ref(), None).expect("we wrote it");
    assert_eq!(first.time_ns, second.time_ns);
    assert_eq!(first.wrench, second.wrench);
    assert_eq!(first.gravity, second.gravity);
    assert_eq!(first.gauges, second.gauges);
    assert_eq!(first.platform, second.platform);
});

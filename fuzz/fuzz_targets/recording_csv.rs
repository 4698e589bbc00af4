//! Any CSV file, with any rig file before it: no panic, and what was read survives being written and read again.
//!
//! A zero byte ends the rig file; without one there is none.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigident::recording::Recording;
use rigident::rig::RigFile;

fuzz_target!(|bytes: &[u8]| {
    let (rig, csv) = match bytes.iter().position(|&byte| byte == 0) {
        Some(end) => (std::str::from_utf8(&bytes[..end]).unwrap_or_default(), &bytes[end + 1..]),
        None => ("", bytes),
    };
    let Ok(rig) = RigFile::parse(rig) else { return };
    let Ok(first) = Recording::from_csv_bytes("fuzz.csv", csv, &rig) else { return };
    let (rig, _) = first.rig_in_notation();
    let again = first.to_csv();
    let second = Recording::from_csv_bytes("fuzz.csv", again.as_bytes(), &rig).expect("we wrote it");
    assert_eq!(first.time_ns, second.time_ns);
    assert_eq!(first.wrench, second.wrench);
    assert_eq!(first.imus, second.imus);
    assert_eq!(first.gravity, second.gravity);
    assert_eq!(first.gauges, second.gauges);
    assert_eq!(first.platform, second.platform);
    assert_eq!(first.attitudes, second.attitudes);
});

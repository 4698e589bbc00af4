//! Any rig file: no panic, and what was understood survives being written and read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigident::rig::RigFile;

fuzz_target!(|text: &str| {
    let Ok(first) = RigFile::parse(text) else { return };
    let second = RigFile::parse(&first.to_toml()).expect("we wrote it");
    assert_eq!(first, second);
});

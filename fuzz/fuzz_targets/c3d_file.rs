//! Any bytes as a C3D file: no panic, and as many points and samples as it says.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigident::motion_capture::c3d::C3d;

fuzz_target!(|bytes: &[u8]| {
    let Ok(file) = C3d::parse(bytes) else { return };
    assert_eq!(file.points_m.len(), file.frames * file.labels.len());
    assert_eq!(file.analog.len(), file.frames * file.samples_per_frame * file.channels.len());
    for plate in &file.plates {
        assert!(plate.channels.iter().all(|channel| *channel < file.channels.len()));
    }
});

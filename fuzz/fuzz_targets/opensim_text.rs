//! Any text as OpenSim's files: no panic, tables as large as they say, and a model that is written with other bodies and read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigident::motion_capture::opensim::model::OsimModel;
use rigident::motion_capture::opensim::storage::Storage;
use rigident::motion_capture::opensim::trc::Trc;

fuzz_target!(|text: &str| {
    if let Ok(markers) = Trc::parse(text) {
        assert_eq!(markers.points_m.len() % markers.labels.len().max(1), 0);
    }
    if let Ok(table) = Storage::parse(text) {
        assert_eq!(table.values.len(), table.times_s.len() * table.columns.len());
    }
    let Ok(model) = OsimModel::parse(text) else { return };
    assert_eq!(model.places().len(), model.bodies.len());
    assert!(model.lengths().iter().all(|(_, length)| length.is_finite()));
    let mut bodies = model.bodies.clone();
    bodies.iter_mut().for_each(|body| body.com_m = [1.0, 2.0, 3.0]);
    let Ok(written) = model.written(text, &bodies) else { return };
    let again = OsimModel::parse(&written).expect("what was written is read again");
    assert!(again.bodies.iter().all(|body| body.com_m == [1.0, 2.0, 3.0]));
});

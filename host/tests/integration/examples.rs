//! The examples run and say what they should.

use std::path::Path;

use rigident::rig::RigFile;

#[path = "../../examples/identify_csv.rs"]
mod identify_csv;
#[path = "../../examples/talk_to_device.rs"]
mod talk_to_device;

#[test]
fn the_device_weighs_its_body() {
    talk_to_device::main().unwrap();
    // 20 kg and an offset of 3.7 N that an experiment finds.
    let force = talk_to_device::weigh().unwrap();
    assert!((force - 20.0 * 9.80665 - 3.7).abs() < 1.0, "{force} N");
}

/// 16 true values within four standard deviations: by chance one misses in a thousand.
#[test]
fn a_csv_is_identified() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/examples");
    let answer = identify_csv::identify(&folder.join("bracket.csv")).unwrap();
    let truth = RigFile::load(&folder.join("bracket.rig.toml")).unwrap().truth.unwrap();
    let ([x, y, z], m) = (truth.com_m, truth.mass_kg);
    // Steiner, about the load cell's origin.
    let moved = [y * y + z * z, z * z + x * x, x * x + y * y, -y * z, -z * x, -x * y];
    let tensor = truth.inertia_com_kgm2.iter().zip(moved).map(|(about_com, by)| about_com + m * by);
    let ten = [m, m * x, m * y, m * z].into_iter().chain(tensor);
    let sixteen = ten.chain(truth.apparent_offset_n_nm.unwrap());
    assert_eq!(answer.parameters.len(), 16);
    for (parameter, truth) in answer.parameters.iter().zip(sixteen) {
        let found = parameter.state.measured().unwrap();
        assert!(
            (found.value - truth).abs() < 4.0 / 1.96 * found.u95,
            "{}: {found:?} {truth}",
            parameter.name
        );
    }
}

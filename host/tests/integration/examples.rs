//! The examples run and say what they should.

#[path = "../../examples/talk_to_device.rs"]
mod talk_to_device;

#[test]
fn the_device_weighs_its_body() {
    talk_to_device::main().unwrap();
    // 20 kg and an offset of 3.7 N that an experiment finds.
    let force = talk_to_device::weigh().unwrap();
    assert!((force - 20.0 * 9.80665 - 3.7).abs() < 1.0, "{force} N");
}

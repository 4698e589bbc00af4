//! The factor's kernels give the same bits on the host and on a Cortex-M33, the core of an RP2350.

use std::path::Path;
use std::process::{Command, Stdio};

#[path = "../../../firmware/boards/cortex-m/src/kernel_bits.rs"]
mod on_the_host;

/// The path where `cargo xtask firmware --board rp2350` leaves it.
const IMAGE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../firmware/boards/rp2350/target/thumbv8m.main-none-eabihf/release/kernel-bits"
);

#[test]
#[ignore = "needs the kernels for a Cortex-M33"]
fn a_second_core_gives_the_bits_of_the_host() {
    assert!(Path::new(IMAGE).is_file(), "no image: cargo xtask firmware --board rp2350");
    let output = Command::new("qemu-system-arm")
        .args(["-M", "mps2-an505", "-display", "none", "-monitor", "none", "-serial", "null"])
        .args(["-semihosting-config", "enable=on,target=native", "-kernel", IMAGE])
        .stdin(Stdio::null())
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    let text = String::from_utf8(output.stdout).unwrap();
    let there: Vec<&str> = text.lines().collect();
    let here = on_the_host::digests().map(|digest| format!("{digest:08x}"));
    assert_eq!(there, here);
    // Four different ones, of numbers that are none of them nothing.
    assert!(here.iter().collect::<std::collections::BTreeSet<_>>().len() == 4, "{here:?}");
}

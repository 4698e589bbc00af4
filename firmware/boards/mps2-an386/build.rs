//! Puts the memory map where the linker searches; with the feature `c-baseline`, compiles the bench's C code.
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

/// The baseline of the bench binary.
const BASELINE: &str = "src/bin/bench/householder.c";
/// Flags for the fastest code: products and sums may be fused.
const FLAGS: [&str; 9] = [
    "-O3",
    "-mcpu=cortex-m4",
    "-mthumb",
    "-mfpu=fpv4-sp-d16",
    "-mfloat-abi=hard",
    "-ffp-contract=fast",
    "-fno-math-errno",
    "-ffreestanding",
    "-c",
];

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::copy("memory.x", out.join("memory.x")).expect("memory.x is readable and OUT_DIR writable");
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rustc-link-arg-bins=-Tdefmt.x");
    println!("cargo:rerun-if-changed=memory.x");
    println!("cargo:rerun-if-changed=build.rs");
    if env::var_os("CARGO_FEATURE_C_BASELINE").is_some() {
        baseline(&out.join("householder.o"));
    }
}

fn baseline(object: &Path) {
    println!("cargo:rerun-if-changed={BASELINE}");
    let status = Command::new("arm-none-eabi-gcc").args(FLAGS).arg(BASELINE).arg("-o").arg(object).status();
    assert!(
        status.expect("the feature c-baseline needs arm-none-eabi-gcc").success(),
        "{BASELINE} does not compile"
    );
    println!("cargo:rustc-link-arg-bin=bench={}", object.display());
}

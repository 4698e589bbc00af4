//! Writes the chip's memory map where the linker searches.
use std::path::PathBuf;
use std::{env, fs};

fn main() {
    let has = |feature: &str| env::var_os(format!("CARGO_FEATURE_{feature}")).is_some();
    // The F405's second 64 kB of RAM are left alone: they cannot be reached by DMA, and the emulator lacks
    // them.
    let flash_kb = match (has("F446"), has("F411")) {
        (true, true) => panic!("one chip at a time: either f446 or f411"),
        // Of an F405's 1 MB the upper half is for stored data.
        _ => 512,
    };
    assert!(
        !(has("STORAGE") && (has("F446") || has("F411"))),
        "feature storage: an F446 or F411 has no room for it"
    );
    let map = format!(
        "MEMORY\n{{\n  FLASH : ORIGIN = 0x08000000, LENGTH = {flash_kb}K\n  RAM : ORIGIN = 0x20000000, LENGTH = 128K\n}}\n"
    );
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::write(out.join("memory.x"), map).expect("OUT_DIR is writable");
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rerun-if-changed=build.rs");
    if has("RTT") {
        println!("cargo:rustc-link-arg-bins=-Tdefmt.x");
    }
}

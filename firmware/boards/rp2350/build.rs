//! Writes the memory map where the linker searches.
use std::path::PathBuf;
use std::{env, fs};

/// Behind the vectors the boot ROM searches for the kind of image it is.
const PICO: &str = "
MEMORY
{
  FLASH : ORIGIN = 0x10000000, LENGTH = 4M
  RAM : ORIGIN = 0x20000000, LENGTH = 512K
}
SECTIONS
{
  .start_block : ALIGN(4) { KEEP(*(.start_block)); } > FLASH
} INSERT AFTER .vector_table;
_stext = ADDR(.start_block) + SIZEOF(.start_block);
";

/// Code and data in the secure aliases of the emulated board's memories.
const AN505: &str = "
MEMORY
{
  FLASH : ORIGIN = 0x10000000, LENGTH = 4M
  RAM : ORIGIN = 0x38000000, LENGTH = 4M
}
";

fn main() {
    let map = if env::var_os("CARGO_FEATURE_AN505").is_some() { AN505 } else { PICO };
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::write(out.join("memory.x"), map).expect("OUT_DIR is writable");
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rerun-if-changed=build.rs");
}

//! Hashes the firmware's own sources, those of its boards and the versions of its drivers, so that a
//! recording can say what estimated it.

use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() {
    let here = PathBuf::from(env::var("CARGO_MANIFEST_DIR").unwrap_or_default());
    let mut files = Vec::new();
    let boards = ["cortex-m", "mps2-an386", "rp2350", "stm32f405"].map(|board| format!("boards/{board}/src"));
    for folder in ["src", "../shared/src"].into_iter().chain(boards.iter().map(String::as_str)) {
        println!("cargo::rerun-if-changed={folder}");
        collect(&here.join(folder), &mut files);
    }
    for lock in ["boards/mps2-an386/Cargo.lock", "boards/stm32f405/Cargo.lock", "boards/rp2350/Cargo.lock"] {
        println!("cargo::rerun-if-changed={lock}");
        files.push(here.join(lock));
    }
    files.sort();
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
    let mut digest = crc.digest();
    for file in files {
        digest.update(&fs::read(&file).unwrap_or_default());
    }
    println!("cargo::rustc-env=RIGIDENT_FIRMWARE_HASH={:08x}", digest.finalize());
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|e| e == "rs") {
            files.push(path);
        }
    }
}

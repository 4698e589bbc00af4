//! Hashes the firmware's own sources, so that a recording can say what estimated it.

use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() {
    let here = PathBuf::from(env::var("CARGO_MANIFEST_DIR").unwrap_or_default());
    let mut files = Vec::new();
    for folder in ["src", "../shared/src"] {
        println!("cargo::rerun-if-changed={folder}");
        collect(&here.join(folder), &mut files);
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

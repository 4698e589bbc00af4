//! Any factor file, as it is and with a check sum that fits.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigident::fit::factor_file::FactorFile;
use rigident::identification::pooled::PooledFactor;

fuzz_target!(|bytes: &[u8]| {
    read(bytes);
    let sum = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(bytes);
    read(&[b"RIGIDFAC".as_slice(), bytes, &sum.to_le_bytes()].concat());
});

fn read(bytes: &[u8]) {
    let Ok(file) = FactorFile::from_bytes(bytes) else { return };
    let _ = file.factor::<10>().map(|factor| factor.solve());
    let _ = file.factor::<16>().map(|factor| factor.solve());
    let Ok(pooled) = PooledFactor::from_bytes(bytes, "fuzz") else { return };
    let _ = pooled.identification();
    let _ = PooledFactor::merged(vec![pooled.clone(), PooledFactor { sources: Vec::new(), ..pooled }], false);
}

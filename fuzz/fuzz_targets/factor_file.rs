//! Any factor file, as it is and with a check sum that fits; then all that can be done with what was read.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigident::fit::pool::PooledFactor;
use rigident::fit::prior::KnownValues;
use rigident::fit::tare::Tare;

fuzz_target!(|bytes: &[u8]| {
    read(bytes);
    let sum = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(bytes);
    read(&[b"RIGIDFAC".as_slice(), bytes, &sum.to_le_bytes()].concat());
});

fn read(bytes: &[u8]) {
    let Ok(pooled) = PooledFactor::from_bytes(bytes, "fuzz") else { return };
    // Singular values of a large triangle take longer than an input may.
    if pooled.parameters.len() > 32 {
        return;
    }
    let written = pooled.to_bytes();
    assert_eq!(PooledFactor::from_bytes(&written, "fuzz").as_ref(), Ok(&pooled));
    let mut fit = pooled.fit();
    let _ = pooled.recordings();
    let bare = PooledFactor { sources: Vec::new(), ..pooled.clone() };
    let _ = PooledFactor::merged(vec![pooled.clone(), bare.clone()], true);
    let _ = PooledFactor::merged(vec![pooled.clone(), bare.clone()], false);
    if let Ok(tare) = Tare::new(bare) {
        let _ = tare.take_off(&mut fit);
    }
    let known = ["mass_kg=20±0.1", "com_x_m=0.1±0.01", "ixx_com_kgm2=1±0.1"].map(str::to_owned);
    if let Ok(known) = KnownValues::parse(&known, &["y".to_owned()]) {
        let _ = known.apply(&mut fit);
    }
}

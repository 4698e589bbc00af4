//! The identity of the build.

/// CRC-32 of the sources of `firmware` and `shared`.
pub const FIRMWARE_HASH: u32 = match u32::from_str_radix(env!("RIGIDENT_FIRMWARE_HASH"), 16) {
    Ok(hash) => hash,
    Err(_) => 0,
};

//! Chooses how many runs a study has when it is a test.

/// Returns how many runs a study has: all at night, where `RIGIDENT_NIGHTLY` is set, otherwise few. Seeds are
/// fixed, so that few runs show a gross fault after a change as many would.
pub fn runs(at_night: u64, after_a_change: u64) -> u64 {
    if std::env::var_os("RIGIDENT_NIGHTLY").is_some() { at_night } else { after_a_change }
}

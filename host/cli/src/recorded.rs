//! Commands that take one recording of one clock.

use std::path::Path;

use super::Failure;
use rigident::application::recorded::listing_of;

/// Refuses several files with clocks of their own where one recording is needed.
///
/// # Errors
/// Bad input.
pub(super) fn refuse_streams(path: &Path, rig: Option<&Path>, command: &str) -> Result<(), Failure> {
    let Some(listing) = listing_of(path, rig) else { return Ok(()) };
    Err(Failure::input(format!(
        "{} is no single recording: `rigident {command}` takes one CSV or MCAP file of one clock; several files with clocks \
         of their own, which a rig file lists as [[stream]], are for `rigident identify`, `factor` and `--tare`: `rigident \
         identify {}`",
        path.display(),
        if listing.is_dir() {
            format!("{} --rig RIG", path.display())
        } else {
            listing.display().to_string()
        }
    )))
}

//! The bare platform on springs taken off what was found on them.

use rigident_fit::Fit;
use rigident_fit::tare::{Tare, TareError};
use rigident_io::rig::SuspensionTable;
use rigident_vibration::suspension::bare::fixture;

/// Takes the bare platform off what was found on the springs, if the rig file states it.
///
/// # Errors
/// [`TareError`] if the platform cannot be taken off.
pub fn take_platform_off(table: &SuspensionTable, found: &mut Fit) -> Result<(), TareError> {
    let Some(platform) = of_platform(table)? else { return Ok(()) };
    platform.take_off(found)
}

/// Returns the bare platform, if the rig file states it.
///
/// # Errors
/// [`TareError`] if it is none that could be taken off.
pub fn of_platform(table: &SuspensionTable) -> Result<Option<Tare>, TareError> {
    fixture(table)
}

//! The bare platform on springs taken off what was found on them.

use super::Failure;
use rigident::problem::suspension::bare::fixture;
use rigident_fit::Fit;
use rigident_fit::tare::Tare;
use rigident_io::rig::SuspensionTable;

/// Takes the bare platform off what was found on the springs, if the rig file states it.
///
/// # Errors
/// Bad input: the platform cannot be taken off.
pub(super) fn take_platform_off(table: &SuspensionTable, found: &mut Fit) -> Result<(), Failure> {
    let Some(platform) = of_platform(table)? else { return Ok(()) };
    platform.take_off(found).map_err(Failure::input)
}

/// Returns the bare platform, if the rig file states it.
///
/// # Errors
/// Bad input: it is none that could be taken off.
pub(super) fn of_platform(table: &SuspensionTable) -> Result<Option<Tare>, Failure> {
    fixture(table).map_err(Failure::input)
}

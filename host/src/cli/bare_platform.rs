//! The bare platform on springs taken off what was found on them.

use super::Failure;
use crate::fit::Fit;
use crate::fit::tare::Tare;
use crate::problem::suspension::bare::bare_platform;
use crate::rig::SuspensionTable;

/// Takes the bare platform off what was found on the springs, if the rig file states it.
///
/// # Errors
/// Bad input: the platform cannot be taken off.
pub(super) fn take_platform_off(table: &SuspensionTable, found: &mut Fit) -> Result<(), Failure> {
    let Some(platform) = bare_platform(table) else { return Ok(()) };
    Tare::new(platform).and_then(|tare| tare.take_off(found)).map_err(Failure::input)
}

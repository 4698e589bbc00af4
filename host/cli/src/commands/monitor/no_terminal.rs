//! Replaces the terminal where there is none: in a browser.

use crate::Failure;
use rigident::application::monitor::GrowingView;
use rigident::present::monitor::View;

/// Refuses: nothing can be drawn.
///
/// # Errors
/// Always: bad usage.
pub(crate) fn check() -> Result<(), Failure> {
    Err(Failure::input("there is no terminal in a browser: --json prints one object after the other"))
}

/// Refuses likewise.
///
/// # Errors
/// Always: bad usage.
pub(crate) fn show(_: &GrowingView, _: &mut dyn FnMut(&View)) -> Result<(), Failure> {
    check()
}

/// Refuses likewise.
///
/// # Errors
/// Always: bad usage.
pub(crate) fn text(_: &View) -> Result<String, Failure> {
    check().map(|()| String::new())
}

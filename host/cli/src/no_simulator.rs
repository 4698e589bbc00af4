//! Replaces the simulated rig in a build without the feature `simulator`: every use of it is refused by name.

use std::path::PathBuf;

use rigident_shared::wire::Identity;

use super::Failure;
use super::arguments::Mcu;
use super::options::microcontroller::Image;
use rigident::device::link::{LinkError, Transport};
use rigident::device::session::tree::FrameSource;

/// Why `what` cannot be done.
pub(super) fn refused(what: &str) -> Failure {
    Failure::input(format!(
        "{what} needs the simulated rig, and this program was built without it: build it with the feature `simulator`"
    ))
}

/// See the same function of the simulated rig.
pub(super) fn named(mcu: &str, _: Image) -> Result<Option<super::link::NamedTransport>, Failure> {
    match mcu {
        "inproc" | "qemu" => {
            Err(refused(&format!("--mcu {mcu}")).context("give the port of a device instead, as --mcu PORT"))
        }
        _ => Ok(None),
    }
}

/// An image with who answers in it, and who does in this process; there is none.
pub(super) type Greeted = (PathBuf, Result<[Identity; 2], LinkError>);

/// See the same function of the simulated rig.
pub(super) fn greeted_image() -> Result<Greeted, String> {
    Err("this program was built without the simulated rig (feature `simulator`)".to_owned())
}

/// See the same function of the simulated rig.
pub(super) fn frames(mcu: Mcu, _: Vec<Vec<u8>>, _: f64) -> Result<(Box<dyn Transport>, Gate), Failure> {
    Err(refused(&format!("--mcu {}", name(mcu))))
}

/// Lets frames go; there is none.
pub(super) enum Gate {}

impl FrameSource for Gate {
    fn set_open(&self, _: bool) {
        match *self {}
    }

    fn is_done(&self) -> bool {
        match *self {}
    }
}

/// Returns what the command line calls it.
pub(super) fn name(mcu: Mcu) -> &'static str {
    match mcu {
        Mcu::Inproc => "inproc",
        Mcu::Qemu => "qemu",
    }
}

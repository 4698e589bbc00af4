//! The microcontroller that runs the firmware: behind a port, in this process, or emulated.

use std::path::PathBuf;

use rigident_shared::wire::Identity;

use crate::link::{Client, LinkError, PortError, SerialTransport, Transport};
use crate::session::Session;
use crate::session::tree::FrameSource;

/// The microcontroller that readings or frames are sent to.
///
/// ```
/// use rigident_device::microcontroller::Microcontroller;
///
/// assert_eq!(Microcontroller::named("inproc"), Microcontroller::InProcess);
/// assert_eq!(Microcontroller::named("/dev/ttyACM0").name(), "port");
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub enum Microcontroller {
    /// The firmware compiled into this program, with a virtual clock.
    #[default]
    InProcess,
    /// The firmware's release binary on an emulated board.
    Emulated,
    /// A device on this port.
    Port(String),
}

/// The images of the firmware for the emulated board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Image {
    /// The image for bodies and trees.
    Standard,
    /// The image that watches robots, too.
    Watch,
}

/// The reason why a microcontroller cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum MicrocontrollerError {
    /// The port cannot be opened.
    #[error(transparent)]
    Port(#[from] PortError),
    /// This build has no simulated rig.
    #[error(
        "{}`mcu` {name} needs the simulated rig, and this program was built without it: build it with the \
         feature `simulator`",
        if *takes_port { "give the port of a device instead, as `mcu` PORT: " } else { "" }
    )]
    NoSimulator {
        /// The microcontroller.
        name: &'static str,
        /// A device on a port would do as well.
        takes_port: bool,
    },
    /// This build has no emulated board.
    #[error(
        "`mcu` qemu: this program was built without the emulated board (feature `emulator`, Unix only); say \
         `mcu` inproc"
    )]
    NoEmulator,
    /// The emulator does not start, in its words.
    #[error("{0}")]
    Emulator(String),
    /// Frames come over the sensor bus, which only simulated microcontrollers have here; holds the port.
    #[error(
        "`mcu` {0}: frames come over the device's sensor bus, which is simulated here: say inproc or qemu"
    )]
    FramesOverPort(String),
}

impl MicrocontrollerError {
    /// Returns true if the hardware failed, false if something was asked for that cannot be.
    pub fn is_of_the_link(&self) -> bool {
        matches!(self, Self::Port(_) | Self::Emulator(_))
    }
}

/// A line to the firmware that is fed with frames, and what lets them go.
pub type FrameLine = (Box<dyn Transport>, Box<dyn FrameSource>);

impl Microcontroller {
    /// Returns the one of a name: `inproc`, `qemu`, or the port of a device.
    pub fn named(name: &str) -> Self {
        match name {
            "inproc" => Self::InProcess,
            "qemu" => Self::Emulated,
            port => Self::Port(port.to_owned()),
        }
    }

    /// Returns its name in an answer: `inproc`, `qemu` or `port`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::InProcess => "inproc",
            Self::Emulated => "qemu",
            Self::Port(_) => "port",
        }
    }

    /// Opens the line to a device that readings are sent to; one that is simulated runs this image.
    ///
    /// # Errors
    /// [`MicrocontrollerError`]: the port cannot be opened, or this build cannot simulate it.
    pub fn open(&self, image: Image) -> Result<Box<dyn Transport>, MicrocontrollerError> {
        match self {
            Self::Port(port) => Ok(Box::new(SerialTransport::open(port)?)),
            #[cfg(feature = "simulator")]
            simulated => simulated.on_rig(image, &simulator::idle_rig()?),
            #[cfg(not(feature = "simulator"))]
            simulated => {
                let _ = image;
                Err(MicrocontrollerError::NoSimulator { name: simulated.name(), takes_port: true })
            }
        }
    }

    /// Opens the line to the firmware on a simulated microcontroller that frames are sent to, `rate_hz` a
    /// second; and what lets them go.
    ///
    /// # Errors
    /// [`MicrocontrollerError`]: a port, or this build cannot simulate it.
    pub fn frames(&self, frames: Vec<Vec<u8>>, rate_hz: f64) -> Result<FrameLine, MicrocontrollerError> {
        match self {
            Self::Port(port) => Err(MicrocontrollerError::FramesOverPort(port.clone())),
            #[cfg(feature = "simulator")]
            simulated => simulator::frames(simulated, frames, rate_hz),
            #[cfg(not(feature = "simulator"))]
            simulated => {
                let _ = (frames, rate_hz);
                Err(MicrocontrollerError::NoSimulator { name: simulated.name(), takes_port: false })
            }
        }
    }
}

/// Opens a session over a line.
///
/// # Errors
/// [`LinkError`]: nobody answers, or not in this program's messages.
pub fn session(line: Box<dyn Transport>) -> Result<Session, LinkError> {
    Session::open(Client::new(line))
}

/// An image of the emulated board, with who answers in it and who does in this process; or why nobody does.
pub type Greeted = (PathBuf, Result<[Identity; 2], LinkError>);

#[cfg(feature = "simulator")]
pub use simulator::greeted_image;

/// Starts no image: this program was built without.
///
/// # Errors
/// Always.
#[cfg(not(feature = "simulator"))]
pub fn greeted_image() -> Result<Greeted, String> {
    Err("this program was built without the simulated rig (feature `simulator`)".to_owned())
}

#[cfg(feature = "simulator")]
mod simulator {
    use std::io;
    use std::time::Duration;

    use rigident_sim::rig::{Rig, RigConfig, SharedRig};
    use rigident_sim::runner::{FrameBus, FrameGate, InProcess, Mcu, PacedRig, Pacing, SensorBus};

    use super::{FrameLine, Greeted, Image, Microcontroller, MicrocontrollerError};
    use crate::link::{SerialTransport, Transport};
    use crate::session::tree::FrameSource;

    /// A simulated microcontroller at the end of a line.
    struct Simulated(Box<dyn Mcu>);

    impl Transport for Simulated {
        fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
            self.0.write(bytes)
        }

        fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
            self.0.read(buffer, timeout)
        }
    }

    impl FrameSource for FrameGate {
        fn set_open(&self, open: bool) {
            Self::set_open(self, open);
        }

        fn is_done(&self) -> bool {
            Self::is_done(self)
        }
    }

    impl Microcontroller {
        /// Opens the line to the firmware in lock-step with a simulated rig, whose sensors it reads; a port
        /// stays a port.
        ///
        /// # Errors
        /// [`MicrocontrollerError`]: this build cannot simulate it, or the port cannot be opened.
        pub fn on_rig(
            &self,
            image: Image,
            rig: &SharedRig,
        ) -> Result<Box<dyn Transport>, MicrocontrollerError> {
            let mcu: Box<dyn Mcu> = match self {
                Self::InProcess => Box::new(InProcess::new(rig.clone(), Pacing::LockStep)),
                Self::Emulated => emulated(image, Box::new(PacedRig::new(rig.clone(), Pacing::LockStep)))?,
                Self::Port(port) => return Ok(Box::new(SerialTransport::open(port)?)),
            };
            Ok(Box::new(Simulated(mcu)))
        }
    }

    pub(super) fn frames(
        mcu: &Microcontroller,
        frames: Vec<Vec<u8>>,
        rate_hz: f64,
    ) -> Result<FrameLine, MicrocontrollerError> {
        let (bus, gate) = FrameBus::new(frames, rate_hz);
        let mcu: Box<dyn Mcu> = match mcu {
            Microcontroller::Emulated => emulated(Image::Standard, Box::new(bus))?,
            _ => Box::new(InProcess::on(Box::new(bus))),
        };
        Ok((Box::new(Simulated(mcu)), Box::new(gate)))
    }

    /// Returns a rig that nothing is asked of: for a firmware that is fed a recording.
    pub(super) fn idle_rig() -> Result<SharedRig, MicrocontrollerError> {
        let rig = Rig::new(RigConfig::thesis_horizontal());
        rig.map(Rig::shared).map_err(|error| MicrocontrollerError::Emulator(error.to_string()))
    }

    /// Returns the release firmware on the emulated board with this bus behind its drivers.
    #[cfg(feature = "emulator")]
    fn emulated(image: Image, bus: Box<dyn SensorBus>) -> Result<Box<dyn Mcu>, MicrocontrollerError> {
        use rigident_sim::runner::{Qemu, QemuOptions, firmware_elf, watch_elf};
        let elf = if image == Image::Watch { watch_elf() } else { firmware_elf() };
        let spawned = Qemu::spawn_on(&QemuOptions { elf, ..QemuOptions::default() }, bus);
        Ok(Box::new(spawned.map_err(|error| MicrocontrollerError::Emulator(error.to_string()))?))
    }

    #[cfg(not(feature = "emulator"))]
    fn emulated(_: Image, _: Box<dyn SensorBus>) -> Result<Box<dyn Mcu>, MicrocontrollerError> {
        Err(MicrocontrollerError::NoEmulator)
    }

    /// Starts the image of the emulated board, and the firmware in this process; returns who answers.
    ///
    /// # Errors
    /// In words: there is no image, or no emulator to start it in.
    #[cfg(feature = "emulator")]
    pub fn greeted_image() -> Result<Greeted, String> {
        use crate::link::{Client, LinkError};
        use rigident_shared::wire::Identity;
        let path = rigident_sim::runner::firmware_elf();
        if !path.exists() {
            return Err(format!("no image {}", path.display()));
        }
        let greeted = |mcu: Microcontroller| -> Result<Result<Identity, LinkError>, String> {
            let line = mcu.open(Image::Standard).map_err(|e| e.to_string())?;
            Ok(Client::new(line).hello())
        };
        let answers = greeted(Microcontroller::Emulated)?.and_then(|image| {
            let own = greeted(Microcontroller::InProcess).map_err(|_| LinkError::Silent("hello"))??;
            Ok([image, own])
        });
        Ok((path, answers))
    }

    /// Starts no image: this program was built without.
    ///
    /// # Errors
    /// Always.
    #[cfg(not(feature = "emulator"))]
    pub fn greeted_image() -> Result<Greeted, String> {
        Err("this program was built without the emulated board (feature `emulator`, Unix only)".to_owned())
    }
}

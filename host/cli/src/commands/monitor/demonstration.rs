//! The demonstration as a monitor watches it: the simulated rig, the firmware in this process.

use rigident_sim::rig::{Rig, RigConfig};

use crate::Failure;
use crate::commands::demo::{RATE_HZ, device, simulated_sensors};
use crate::commands::demo_arguments::Demo;
use crate::device::link::configured;
use crate::options::microcontroller::Mcu;
use rigident::application::monitor::{GrowingView, Listener, trouble};
use rigident::device::platform::{LocalPlatform, Platform as _};
use rigident::device::session::{Session, settings};
use rigident::laboratory::rig_file;
use rigident_io::rig::RigFile;

/// The demonstration, ready to move.
pub(crate) struct Demonstration {
    session: Session,
    platform: LocalPlatform,
    program: hexapod::MotionProgram,
    pub(crate) rig: RigFile,
}

/// Makes the rig of `rigident demo`, its program loaded.
pub(crate) fn prepare() -> Result<Demonstration, Failure> {
    let arguments = Demo::bare();
    let config = RigConfig::thesis_horizontal().with_seed(arguments.seed).with_rates(RATE_HZ, RATE_HZ);
    let program = arguments.programme.program(&config.geometry)?;
    let rig = Rig::new(config).map_err(Failure::input)?;
    let file = rig_file(&rig, "test body with plates, horizontal");
    let rig = rig.shared();
    let mut session = device(Mcu::Inproc, &rig)?;
    let settings = settings(&file, &simulated_sensors(), None, None).map_err(Failure::input)?;
    configured(&mut session, &settings)?;
    let mut platform = LocalPlatform(rig);
    platform.load(&program).map_err(Failure::link)?;
    Ok(Demonstration { session, platform, program, rig: file })
}

/// Follows the program, in real time or as fast as it goes.
pub(crate) fn follow(demonstration: Demonstration, is_paced: bool, watch: &GrowingView) {
    let Demonstration { mut session, mut platform, program, .. } = demonstration;
    watch.change(|view| "running".clone_into(&mut view.phase));
    let followed = session.follow_unchecked(&mut platform, &program, &mut Listener::new(watch, is_paced));
    watch.change(|view| match followed {
        Ok(take) => {
            view.sensors.trouble = trouble(&take.counters);
            (view.phase, view.trouble) = ("the programme has ended".to_owned(), take.broken);
        }
        Err(why) => view.trouble = Some(why.to_string()),
    });
    watch.end();
}

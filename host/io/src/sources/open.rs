//! From an address to a source.

use super::ati::Ati;
use super::foxglove::Bridge;
use super::lines::Lines;
use super::rtde::Rtde;
use super::source::{Role, Source, SourceError};
use super::url::{Scheme, SourceUrl};
use super::xsens::Xsens;
use crate::recording::columns::Group;
use crate::rig::RigFile;

/// Opens a source for everything that it is asked for, and waits until it streams. `rig` names the columns of
/// lines.
///
/// # Errors
/// [`SourceError`] says what is wrong and what to do.
pub fn open(url: &SourceUrl, roles: &[Role], rig: &RigFile) -> Result<Box<dyn Source>, SourceError> {
    let only = |role: Role, what: &str| match roles {
        [one] if *one == role => Ok(()),
        _ => Err(url.wrong(format!("{what}: it is for `{role}` alone"))),
    };
    let source: Box<dyn Source> = match url.scheme {
        Scheme::Ati => {
            only(Role::Wrench, "an ATI sensor measures a wrench")?;
            Box::new(Ati::open(url)?)
        }
        Scheme::Xsens => {
            only(Role::Imu, "an MTi is an IMU")?;
            Box::new(Xsens::open(url)?)
        }
        Scheme::Rtde => Box::new(Rtde::open(url, roles)?),
        Scheme::WebSocket => match roles {
            [role] => Box::new(Bridge::open(url, *role)?),
            _ => {
                return Err(url.wrong(
                    "a topic has one type of message: give the address once for each, with ?topic= of its \
                     own",
                ));
            }
        },
        Scheme::SerialLines | Scheme::UdpLines | Scheme::StandardInput => Box::new(Lines::open(url, rig)?),
    };
    for role in roles {
        let groups = source.groups();
        let brings = match role {
            Role::Wrench => groups.iter().any(|g| matches!(g, Group::Wrench | Group::Gauges)),
            Role::Imu => groups.contains(&Group::Accel(0)),
            Role::Pose => groups.contains(&Group::Platform),
        };
        if !brings {
            let columns: Vec<String> = groups.iter().flat_map(|group| group.names()).collect();
            return Err(url.wrong(format!(
                "{} is to come from here, and it brings {}",
                match role {
                    Role::Wrench => "the wrench",
                    Role::Imu => "the IMU",
                    Role::Pose => "the pose",
                },
                columns.join(", ")
            )));
        }
    }
    Ok(source)
}

//! An arm of Universal Robots that carries the rig's plate: a UR5 with a CB3 controller.
//!
//! Lives here: the arm's kinematics and joints (`joints`), the state that its interfaces share (`state`), the
//! language of its programs (`language`, `interpreter`, `task`), the controller's cycles ([`UrServer`]), its
//! ports (`server`). May not live here: how bodies and sensors react ([`crate::rig`]).
//!
//! Written by the maker's "Real-Time Data Exchange (RTDE) Guide", script manual and table of Denavit and
//! Hartenberg's parameters, not by the client. Simplified: the law of `servoj` and how fast the arm brakes by
//! itself are not published; the port for programs sends no state; programs are of the words in `language`
//! and of the functions in `task`.

mod controller;
mod interpreter;
mod joints;
mod language;
mod server;
mod state;
mod task;
#[cfg(test)]
mod tests;

use std::io;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};

use hexapod::{BodyParameters, Geometry, Mounting, Travel};

use crate::rig::{RigConfig, SharedRig};
use crate::sensors::{LoadCellModel, PerExperiment, SensorModels};
use controller::Loop;
use server::{Rtde, Scripts};
use state::Shared;
use task::lock;

pub use joints::{FASTEST, HOME, urdf};
pub use state::Tell;

/// An incident of the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Incident {
    /// A protective stop.
    Protective,
    /// The arm's emergency stop is pressed.
    Emergency,
    /// The network is cut: nothing arrives, nothing is said.
    Cut,
    /// The arm's panel stops the program.
    Stopped,
    /// The arm's panel is put to local mode.
    Local,
}

/// A controller on the network. Dropping it closes every connection.
pub struct UrServer {
    rtde: Rtde,
    scripts: Scripts,
    shared: Arc<Mutex<Shared>>,
    _loop: Loop,
}

impl UrServer {
    /// Listens for RTDE at the first address and for programs at the second (port 0 takes a free one); `tell`
    /// receives faults of programs.
    ///
    /// # Errors
    /// If an address is taken or cannot be had.
    pub fn listen(
        addresses: [&str; 2],
        rig: SharedRig,
        tell: impl Fn(&str) + Send + Sync + 'static,
    ) -> io::Result<Self> {
        let tell: Tell = Arc::new(tell);
        let shared = Arc::new(Mutex::new(Shared::new(controller::CYCLE_S)));
        let [rtde, scripts] = addresses;
        Ok(Self {
            rtde: Rtde::listen(rtde, Arc::clone(&shared))?,
            scripts: Scripts::listen(scripts, Arc::clone(&shared), Arc::clone(&tell))?,
            _loop: Loop::begin(rig, Arc::clone(&shared), tell),
            shared,
        })
    }

    /// Returns where it listens for RTDE and for programs.
    #[must_use]
    pub fn addresses(&self) -> [SocketAddr; 2] {
        [self.rtde.address(), self.scripts.address()]
    }

    /// Returns the address as a client is given it.
    #[must_use]
    pub fn url(&self) -> String {
        let [rtde, scripts] = self.addresses();
        format!("ur://{rtde}?script={}", scripts.port())
    }

    /// Lets something happen to the arm.
    pub fn happens(&self, incident: Incident) {
        let mut shared = lock(&self.shared);
        match incident {
            Incident::Protective => shared.protective_stop(),
            Incident::Emergency => shared.emergency_stop(),
            Incident::Cut => shared.cut = true,
            Incident::Stopped => {
                shared.runtime_state = state::STOPPED;
                shared.joints.brake();
            }
            Incident::Local => shared.remote = false,
        }
    }

    /// Returns positions (rad) and rates (rad/s) of the joints.
    #[must_use]
    pub fn joints(&self) -> [[f64; 6]; 2] {
        let shared = lock(&self.shared);
        [shared.joints.q, shared.joints.qd]
    }

    /// Returns whether no joint moves.
    #[must_use]
    pub fn rests(&self) -> bool {
        lock(&self.shared).joints.rest()
    }
}

/// File name of the arm's model, beside the rig file.
pub const MODEL: &str = "ur5.urdf";
/// Accelerations that the owner allows, rad/s².
pub const ACCELERATION_RADPS2: f64 = 12.0;
/// Rates that the owner allows, rad/s.
pub const RATE_RADPS: f64 = 2.5;
/// Mass at the flange that the maker allows, kg.
pub const PAYLOAD_KG: f64 = 5.0;

/// Returns the travel that the owner allows the flange to either side.
#[must_use]
pub fn travel() -> Travel {
    Travel {
        shift_m: [0.12; 3],
        turn_rad: [0.7, 0.7, 1.0],
        together: false,
        speed_mps: Some(0.6),
        rate_radps: None,
    }
}

/// Returns the rig on the arm's flange: a force sensor for the wrist, an IMU on it, and a body of some
/// kilograms that hangs there.
#[must_use]
pub fn rig() -> RigConfig {
    let thesis = RigConfig::thesis_horizontal();
    let noise = [0.05, 0.05, 0.05, 0.002, 0.002, 0.002];
    let load_cell = LoadCellModel {
        noise_n_nm: noise,
        offset_n_nm: PerExperiment::spread(noise.map(|sigma| 5.0 * sigma)),
        range_n_nm: [500.0, 500.0, 900.0, 20.0, 20.0, 20.0],
        ..thesis.sensors.load_cell.clone()
    };
    let sensors = SensorModels { load_cell, ..thesis.sensors.clone() };
    // Nothing of the arm's reach binds here: the arm itself does.
    let free = Travel {
        shift_m: [3.0; 3],
        turn_rad: [9.0, 1.55, 9.0],
        together: true,
        speed_mps: None,
        rate_radps: None,
    };
    RigConfig {
        // The sensor's z points away from the flange, which looks down.
        load_cell: Mounting { position_m: [0.0, 0.0, -0.04], rotation_wxyz: [0.0, 1.0, 0.0, 0.0] },
        body: BodyParameters {
            mass_kg: 2.4,
            com_m: [0.015, -0.022, 0.061],
            inertia_com_kgm2: [9.1e-3, 7.4e-3, 6.2e-3, -4e-4, 3e-4, 6e-4],
        },
        geometry: Geometry::of_travel(free),
        sensors,
        ..thesis
    }
}

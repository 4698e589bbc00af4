//! Platforms driven over a network or a line, as the simulator offers them in real time: a program of its
//! own, so that no other test takes the processor from the simulated clock.
#![cfg(feature = "emulator")]

mod arm;
mod arm_incidents;
mod device_commands;
mod drivers;
mod library;
mod live;
mod runs;
mod streams;
mod vendors_client;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use hexapod::{Pose, Trajectory};
use nalgebra::SVector;
use rigident_sim::rig::{Rig, RigConfig, SharedRig};
use rigident_sim::runner::{InProcess, Pacing};
use rigident_sim::serve::gcs::GcsServer;
use rigident_sim::serve::{Firmware, Port, carry, rig_file};
use tempfile::TempDir;

const PATIENCE: Duration = Duration::from_secs(20);

/// A rig in real time: firmware on a port, a hexapod's controller on the network.
struct Served {
    folder: TempDir,
    rig: SharedRig,
    hexapod: Option<GcsServer>,
    leave: Arc<AtomicBool>,
    carrying: Option<JoinHandle<()>>,
}

impl Served {
    fn new() -> Self {
        Self::of(RigConfig::thesis_horizontal())
    }

    fn of(config: RigConfig) -> Self {
        let mut served = Self::bare(config);
        served.hexapod = Some(GcsServer::listen("127.0.0.1:0", Arc::clone(&served.rig)).unwrap());
        served
    }

    /// Without a controller.
    fn bare(config: RigConfig) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let rig = Rig::new(config.with_seed(3)).unwrap();
        std::fs::write(folder.path().join("rig.toml"), rig_file(&rig)).unwrap();
        let rig = rig.shared();
        let mut port = Port::open(Some(&folder.path().join("port"))).unwrap();
        let leave = Arc::new(AtomicBool::new(false));
        let (leaving, shared) = (Arc::clone(&leave), Arc::clone(&rig));
        let carrying = std::thread::spawn(move || {
            let mut firmware = Firmware(Box::new(InProcess::new(shared, Pacing::RealTime)));
            carry(&mut port, &mut firmware, &leaving).unwrap();
        });
        Self { folder, rig, hexapod: None, leave, carrying: Some(carrying) }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn address(&self) -> String {
        format!("gcs://{}", self.hexapod.as_ref().unwrap().address())
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.leave.store(true, Ordering::Release);
        if let Some(thread) = self.carrying.take() {
            let _ = thread.join();
        }
    }
}

/// Root mean square of how far poses are from the path of a trajectory, m; an angle counts by what it moves
/// the joints of the plate, 0.2 m from its centre.
///
/// The time at which a pose was reached does not count. On a busy machine the host asks and the simulated
/// controller answers late, by as much as the system pleases; the path stays the same.
fn rms_off_path(trajectory: &Trajectory, poses: &[Pose]) -> f64 {
    const LEVER_M: f64 = 0.2;
    let point = |pose: &Pose| {
        let ([x, y, z], [roll, pitch, yaw]) = (pose.position_m, pose.rpy_rad.map(|angle| LEVER_M * angle));
        SVector::from([x, y, z, roll, pitch, yaw])
    };
    let steps = (trajectory.duration_s() / 2e-3) as usize;
    let path: Vec<SVector<f64, 6>> = (0..=steps)
        .map(|k| {
            let state = trajectory.state(k as f64 * 2e-3);
            point(&Pose { position_m: state.position.into(), rpy_rad: state.rpy.into() })
        })
        .collect();
    let nearest = |pose: &Pose| {
        let here = point(pose);
        path.iter().map(|there| (there - here).norm_squared()).fold(f64::INFINITY, f64::min)
    };
    (poses.iter().map(nearest).sum::<f64>() / poses.len() as f64).sqrt()
}

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Returns the interpreter of Python with what tests compare with.
fn python() -> String {
    std::env::var("RIGIDENT_PYTHON").unwrap_or_else(|_| "python3".to_owned())
}

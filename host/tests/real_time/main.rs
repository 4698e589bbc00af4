//! Platforms driven over a network or a line, as the simulator offers them in real time: a program of its own, so that no
//! other test takes the processor from the simulated clock.
#![cfg(feature = "simulator")]

mod drivers;
mod runs;
mod streams;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

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
        let folder = tempfile::tempdir().unwrap();
        let rig = Rig::new(config.with_seed(3)).unwrap();
        std::fs::write(folder.path().join("rig.toml"), rig_file(&rig)).unwrap();
        let rig = rig.shared();
        let hexapod = GcsServer::listen("127.0.0.1:0", Arc::clone(&rig)).unwrap();
        let mut port = Port::open(Some(&folder.path().join("port"))).unwrap();
        let leave = Arc::new(AtomicBool::new(false));
        let (told, shared) = (Arc::clone(&leave), Arc::clone(&rig));
        let carrying = std::thread::spawn(move || {
            let mut firmware = Firmware(Box::new(InProcess::new(shared, Pacing::RealTime)));
            carry(&mut port, &mut firmware, &told).unwrap();
        });
        Self { folder, rig, hexapod: Some(hexapod), leave, carrying: Some(carrying) }
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

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

//! The simulated rig as a PI hexapod.

mod protocol;
mod vendors_client;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rigident_sim::rig::{BusEvent, Rig, RigConfig, SharedRig};
use rigident_sim::serve::gcs::GcsServer;

/// A rig whose clock goes with the wall's, and its controller.
struct Served {
    rig: SharedRig,
    server: GcsServer,
    leave: Arc<AtomicBool>,
    clock: Option<JoinHandle<()>>,
}

impl Served {
    fn new() -> Self {
        let rig = Rig::new(RigConfig::thesis_horizontal()).unwrap().shared();
        let leave = Arc::new(AtomicBool::new(false));
        let (stop, running) = (Arc::clone(&leave), Arc::clone(&rig));
        let clock = std::thread::spawn(move || {
            let began = Instant::now();
            while !stop.load(Ordering::Acquire) {
                let now = began.elapsed().as_nanos() as u64;
                let mut rig = running.lock().unwrap();
                while rig.next_event_before(now) != BusEvent::Idle {}
                drop(rig);
                std::thread::sleep(Duration::from_millis(1));
            }
        });
        let server = GcsServer::listen("127.0.0.1:0", Arc::clone(&rig)).unwrap();
        Self { rig, server, leave, clock: Some(clock) }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.leave.store(true, Ordering::Release);
        if let Some(clock) = self.clock.take() {
            let _ = clock.join();
        }
    }
}

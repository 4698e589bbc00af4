//! Listening on a network port, with as many clients as come.

use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// The time between two checks of a wait whether to end.
pub(super) const LOOK_AGAIN: Duration = Duration::from_millis(50);

/// A port at work. Dropping it closes every connection.
pub(super) struct Listener {
    address: SocketAddr,
    leave: Arc<AtomicBool>,
    listening: Option<JoinHandle<()>>,
}

impl Listener {
    /// Listens at `address` (port 0 takes a free one) and lets `attend` have each client, with the flag that
    /// says when to leave.
    pub(super) fn listen(
        address: impl ToSocketAddrs,
        attend: impl Fn(TcpStream, &AtomicBool) + Send + Sync + 'static,
    ) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        let address = listener.local_addr()?;
        // Accepting without waiting, so that it can be asked to end.
        listener.set_nonblocking(true)?;
        let leave = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&leave);
        let listening = thread::spawn(move || accept(&listener, &attend, &stop));
        Ok(Self { address, leave, listening: Some(listening) })
    }

    pub(super) fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        self.leave.store(true, Ordering::Release);
        if let Some(thread) = self.listening.take() {
            // A panic there has printed itself.
            let _ = thread.join();
        }
    }
}

fn accept(listener: &TcpListener, attend: &(impl Fn(TcpStream, &AtomicBool) + Sync), leave: &AtomicBool) {
    thread::scope(|scope| {
        while !leave.load(Ordering::Acquire) {
            match listener.accept() {
                Ok((stream, _)) => {
                    // A client that breaks off has nobody left to be informed.
                    scope.spawn(move || attend(stream, leave));
                }
                // Nobody there, or a client that gave up again: check once more in a while.
                Err(_) => thread::sleep(LOOK_AGAIN),
            }
        }
    });
}

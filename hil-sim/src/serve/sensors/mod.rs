//! Sensors of other makes on the moving body, each as its maker's device speaks: what `rigident live` listens
//! to.
//!
//! Lives here: the body's motion as it is sampled by each device's own clock ([`Played`]), and the servers.
//! May not live here: the host's decoders; what is written is taken from the makers' documents.

mod ati;
mod foxglove;
mod lines;
mod played;
mod rtde;
mod xsens;

pub use ati::AtiServer;
pub use foxglove::{BridgeServer, Topic, TopicKind};
pub use lines::{LinesServer, Quantity};
pub use played::{Delivery, Played, Sample, body_moved, sensors_rig_file};
pub use rtde::RtdeServer;
pub use xsens::XsensServer;

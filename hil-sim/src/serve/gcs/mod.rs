//! The platform's controller as PI hexapods speak: General Command Set 2.0, in ASCII over TCP or a serial line.
//!
//! Lives here: the commands' syntax (`syntax`), the controller that obeys them ([`Hexapod`]), and the servers. May
//! not live here: how the plate moves ([`crate::rig`]).
//!
//! What it knows is what a C-887 hexapod controller needs to be driven; `HLP?` lists it. Facts are from the vendor's manual of
//! the C-887 (MS204E), from the hexapods' manuals (H-850: MS202E, H-845: MS222E) and from what the vendor's Python client
//! `pipython` sends and expects:
//! - a command ends with LF; a single byte 4, 5, 7, 11 or 24 is a command by itself. Of an answer's lines all but the last
//!   end with a space before LF;
//! - an error is not answered: its number is kept until `ERR?` fetches it;
//! - X, Y, Z are mm and U, V, W degrees from the reference pose. The rotations follow each other in the order U, V, W about
//!   axes that go with the plate (MS202E 3.7, MS222E 3.7): `R = Rx(U) Ry(V) Rz(W)`, not the roll, pitch, yaw about fixed
//!   axes of [`hexapod`];
//! - `SPA X 0x19001900 1` makes the path one of consecutive `MOV`, `SPA X 0x19001901 1` buffers their points until
//!   there are as many as parameter `0x19001903`, and `SCT T` sets their interval in ms.
//!
//! Differences from the vendor's: a stream whose points cease brakes and sets error 220; a client that goes away stops what
//! it had started.

mod axes;
mod controller;
mod server;
mod syntax;
mod tables;

pub use axes::{GcsPosition, limits};
pub use controller::Hexapod;
pub use server::{GcsPort, GcsServer};

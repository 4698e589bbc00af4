//! One firmware, two runners.

pub mod device;
mod emulated_board;
mod in_process;
mod tree;
mod two_links;

//! One firmware, two runners.

pub mod device;
mod emulated_board;
mod in_process;
mod suspended_tree;
mod tracked_tree;
mod tree;
mod trust;
mod two_links;

//! One firmware, two runners.

mod device;
mod emulated_board;
mod in_process;

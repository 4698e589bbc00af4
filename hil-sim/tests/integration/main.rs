//! The simulated rig from outside: `cargo test -p rigident-sim --test integration NAME`.

mod board_timing;
mod drivers;
mod hexapod;
mod independence;
mod instrument;
mod kernel_bits;
mod power_cuts;
mod runner;
mod serve;
mod served_program;
mod suspension;

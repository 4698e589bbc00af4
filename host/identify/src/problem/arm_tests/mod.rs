//! Arms made by the simulated laboratory, from recording to fit.

mod effort_lowpass;
mod friction_speed;
mod rotors;
mod standstill;

//! Arms made by the simulated laboratory, from recording to fit.

mod effort_lowpass;
mod filtered_rates;
mod friction_speed;
mod friction_terms;
mod rotors;
mod standstill;

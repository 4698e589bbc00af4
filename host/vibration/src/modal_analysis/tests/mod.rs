mod bad_input;
mod exact;
mod imu;
mod nonlinear;
mod statistics;
mod support;
mod undamped;

mod bad_input;
mod exact;
mod nonlinear;
mod statistics;
mod support;

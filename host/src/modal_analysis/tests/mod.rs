mod bad_input;
mod exact;
mod statistics;
mod support;

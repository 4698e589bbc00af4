mod exact;
mod statistics;
mod support;

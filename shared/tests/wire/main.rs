//! The wire from outside: golden bytes, a noisy line, and what it may not depend on.

mod golden;
mod independence;
mod noise;
mod samples;
mod ten_parameters;

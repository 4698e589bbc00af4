//! Groups of options that several commands share. They import nothing of the commands.

pub(in crate::cli) mod calibration;
pub(in crate::cli) mod forgetting;
pub(in crate::cli) mod known_values;
pub(in crate::cli) mod load;
pub(in crate::cli) mod microcontroller;
pub(in crate::cli) mod payload;
pub(in crate::cli) mod stop_criterion;
pub(in crate::cli) mod test_body;
pub(in crate::cli) mod trees;

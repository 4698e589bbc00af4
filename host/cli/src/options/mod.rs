//! Groups of options that several commands share. They import nothing of the commands.

pub(crate) mod calibration;
pub(crate) mod forgetting;
pub(crate) mod known_values;
pub(crate) mod load;
pub(crate) mod microcontroller;
pub(crate) mod output;
#[cfg(feature = "simulator")]
pub(crate) mod own_body;
pub(crate) mod payload;
pub(crate) mod stop_criterion;
pub(crate) mod test_body;
pub(crate) mod trees;

//! `rigident plan`

pub(crate) mod arguments;
pub(crate) mod excitation;
pub(crate) mod motion;
pub(crate) mod poses;

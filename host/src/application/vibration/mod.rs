//! Platforms on springs: a body by its modes and by its motion ([`identify`]), the springs by a body that is
//! known ([`stiffness`]), a
//! tree by locked postures ([`postures`]), and the vibration paper's experiment, simulated.

pub mod identify;
#[cfg(feature = "simulator")]
pub mod paper;
#[cfg(feature = "simulator")]
mod paper_text;
pub mod postures;
mod postures_text;
pub mod stiffness;

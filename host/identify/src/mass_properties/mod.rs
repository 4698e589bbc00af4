//! Masses and first moments of a robot's links relative to a nominal model, from rows that excite them
//! poorly.
//!
//! Base parameters are what rows tell. A controller wants standard parameters of every link, of which there
//! are more: what rows leave open is taken from a nominal model, in one of several ways that can be compared
//! on data that none has seen. Lives here: the unknowns ([`unknowns`]), the ways to solve ([`methods`]), the
//! comparison ([`comparison`]), torques that contradict the model ([`efforts`]), what acts beside the model
//! ([`beside`]), the mass of the whole ([`whole_mass`]), weights ([`weights`]). May not live here: rows and
//! factors ([`rigident_fit`]), which this room is handed. Next: [`unknowns`], then [`methods`].
//!
//! Source: K. Yamane, *Practical kinematic and dynamic calibration methods for force-controlled humanoid
//! robots*, IEEE-RAS Humanoids, 2011, section IV.

pub mod beside;
pub mod comparison;
pub mod efforts;
pub mod methods;
#[cfg(test)]
mod tests;
pub mod unknowns;
pub mod weights;
pub mod whole_mass;

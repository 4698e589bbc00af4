//! Library of the host command line.
//!
//! Lives here: everything `rigident` does, one room a module. Recordings and rig files come in by [`formats`], several
//! clocks onto one time base by [`streams`];
//! [`identification`] makes the factor in batch, [`session`] has the device make it over [`link`] while
//! [`platform`] moves, in what [`planning`] found best; [`answer`] reads it; [`report`] shows it; [`montecarlo`] tries what its intervals are
//! worth; [`models`] are trees of links, which [`trees`] identifies; [`cli`] joins them into commands. May not live
//! here: the pipeline itself (that is `rigident_shared`), physics (that is `rigident_sim`).

pub mod answer;
#[cfg(feature = "simulator")]
pub mod cli;
pub mod formats;
pub mod identification;
pub mod link;
pub mod models;
#[cfg(feature = "simulator")]
pub mod montecarlo;
#[cfg(feature = "simulator")]
pub mod planning;
#[cfg(feature = "simulator")]
pub mod platform;
pub mod report;
#[cfg(feature = "simulator")]
pub mod session;
#[cfg(feature = "simulator")]
pub mod simulated;
pub mod streams;
pub mod trees;

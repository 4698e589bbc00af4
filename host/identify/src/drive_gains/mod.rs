//! Gains of drives whose efforts are motor currents, or anything else that is proportional to the torque.
//!
//! `i_k = τ_k / c_k` with one gain c_k, N m per unit of the column, for each joint. Rows are linear in `c_k
//! φ` alone, so that efforts tell the ratios of gains, by links that several joints carry, and a load that is
//! known tells their size; so does a nominal model, as far as it is trusted (M. Gautier, S. Briot, *Global
//! identification of joint drive gains and dynamic parameters of robots*, J. Dyn. Sys. Meas. Control 136 (5),
//! 2014). Gains are errors of the rig that little is known of ([`WIDE`]): efforts are scaled by a first guess
//! ([`start`]), fitted, and scaled anew by the errors found ([`scales`]) until nothing moves; so every other
//! error, noise and friction counts as in any fit.
//!
//! Lives here: columns and scales of a recording ([`columns`]), the first guess, what the nominal model is
//! worth ([`nominal`]), and the gains of joint rows ([`scales`]). May not live here: reading files, and the
//! order of the steps ([`crate::application`]).

pub mod columns;
pub mod nominal;
pub mod scales;
pub mod start;

/// 1 σ of a gain about what it is scaled by, relative, before it is identified.
pub const WIDE: f64 = 1.0;
/// Gains are identified where their U95 is at most this share of them, and ratios where theirs is.
pub const COARSEST: f64 = 0.1;
/// What all gains have in common is determined by nothing if its standard deviation, relative, is larger:
/// then it stays as it was guessed.
pub const UNDETERMINED: f64 = 0.2;
/// Rounds of scaling at most.
pub const MOST_ROUNDS: usize = 8;
/// Gains that move by less than this share of their standard deviations have settled.
pub const SETTLED: f64 = 0.05;

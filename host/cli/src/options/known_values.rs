use clap::Args;

use crate::Failure;
use rigident_fit::prior::KnownValues;

/// The options `--known` and `--symmetry`.
#[derive(Args, Debug, Clone, Default)]
pub struct KnownQuantities {
    /// A quantity known beforehand, in S, with its standard uncertainty (1 σ, not U95): mass_kg=20.013±0.005.
    /// Any of mass_kg, com_x_m, mcx_kgm, ixx_kgm2 (about the origin of S), ixx_com_kgm2 (about the centre of
    /// mass), offset_fx_n, offset_mx_nm, and so on for y and z; `+-` and `+/-` do for ±. Repeatable
    #[arg(long, value_name = "NAME=VALUE±SIGMA")]
    pub known: Vec<String>,
    /// The body's mass is symmetric about the plane through S's origin with this normal; it may be out by so
    /// much, 1 σ in m (default 0.001): y±0.002. Repeatable
    #[arg(long, value_name = "x|y|z[±SIGMA]")]
    pub symmetry: Vec<String>,
}

impl KnownQuantities {
    /// Returns what they state.
    ///
    /// # Errors
    /// Bad input: what cannot be used.
    pub(crate) fn parse(&self) -> Result<KnownValues, Failure> {
        KnownValues::parse(&self.known, &self.symmetry).map_err(Failure::input)
    }
}

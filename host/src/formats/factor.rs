//! The factor file, `*.factor`: what a recording said, without the recording.
//!
//! Eight bytes of magic, then one postcard object, then its CRC-32 (little-endian). The object starts with a
//! version; parameter names and units are part of it, so a factor of another model is told apart.

use rigident_shared::factor::InformationFactor;
use rigident_shared::inertia::{PARAMETER_NAMES, PARAMETER_UNITS};
use serde::{Deserialize, Serialize};

const MAGIC: &[u8; 8] = b"RIGIDFAC";
const VERSION: u16 = 1;
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// Why bytes are not a usable factor file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FactorFileError {
    /// The file does not start as a factor file does.
    #[error("not a factor file: it does not start with RIGIDFAC")]
    NotAFactor,
    /// The check sum does not fit, or the file is cut off.
    #[error(
        "the factor file is damaged or cut off (its check sum does not fit): write it anew from the recording"
    )]
    Damaged,
    /// The version is not known here.
    #[error(
        "the factor file has version {0}, this program reads version {VERSION}: use the program that wrote it"
    )]
    Version(u16),
    /// The numbers are not a factor.
    #[error("the factor file holds {got} numbers, not finite or not a triangle of {parameters} parameters")]
    Numbers {
        /// Numbers found.
        got: usize,
        /// Parameters named.
        parameters: usize,
    },
}

/// A factor with what is needed to use it elsewhere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FactorFile {
    version: u16,
    /// Hash of names and units: equal for factors that may be merged.
    pub model_hash: u64,
    /// Name and SI unit of each parameter, in the order of the columns.
    pub parameters: Vec<(String, String)>,
    /// Factor by which each column was divided before absorption; ones so far.
    pub column_scale: Vec<f64>,
    /// Scalar rows absorbed.
    pub rows: u32,
    /// Variance of the whitened, filtered noise per row (1 without filter).
    pub noise_gain: f64,
    /// 1 σ by which the wrench channels were whitened: N, N m.
    pub channel_sigma: [f64; 6],
    /// Where the rows came from.
    pub source: String,
    /// Upper triangle row by row, z, residual sum of squares.
    pub entries: Vec<f64>,
}

/// FNV-1a over names and units.
fn model_hash(parameters: &[(String, String)]) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for (name, unit) in parameters {
        for byte in name.bytes().chain([0]).chain(unit.bytes()).chain([0]) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
    hash
}

impl FactorFile {
    /// A factor of a body's ten parameters, or of sixteen with the offset.
    pub fn new<const N: usize>(
        factor: &InformationFactor<f64, N>,
        noise_gain: f64,
        channel_sigma: [f64; 6],
        source: impl Into<String>,
    ) -> Self {
        let parameters: Vec<_> = PARAMETER_NAMES
            .iter()
            .zip(PARAMETER_UNITS)
            .take(N)
            .map(|(name, unit)| ((*name).to_owned(), unit.to_owned()))
            .collect();
        Self {
            version: VERSION,
            model_hash: model_hash(&parameters),
            parameters,
            column_scale: vec![1.0; N],
            rows: factor.rows(),
            noise_gain,
            channel_sigma,
            source: source.into(),
            entries: factor.entries().collect(),
        }
    }

    /// The factor itself.
    ///
    /// # Errors
    /// [`FactorFileError::Numbers`] if this is not a factor of `N` parameters.
    pub fn factor<const N: usize>(&self) -> Result<InformationFactor<f64, N>, FactorFileError> {
        let error = FactorFileError::Numbers { got: self.entries.len(), parameters: N };
        if self.parameters.len() != N {
            return Err(error);
        }
        InformationFactor::from_entries(self.entries.iter().copied(), self.rows).ok_or(error)
    }

    /// The bytes of the file.
    pub fn to_bytes(&self) -> Vec<u8> {
        // Serialising plain vectors and numbers into a growing buffer has no way to fail.
        let body = postcard::to_allocvec(self).unwrap_or_default();
        [MAGIC.as_slice(), &body, &CRC.checksum(&body).to_le_bytes()].concat()
    }

    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// [`FactorFileError`] says what is wrong.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FactorFileError> {
        let rest = bytes.strip_prefix(MAGIC).ok_or(FactorFileError::NotAFactor)?;
        let (body, check) = rest.split_last_chunk::<4>().ok_or(FactorFileError::Damaged)?;
        if CRC.checksum(body) != u32::from_le_bytes(*check) {
            return Err(FactorFileError::Damaged);
        }
        let (version, _) = postcard::take_from_bytes::<u16>(body).map_err(|_| FactorFileError::Damaged)?;
        if version != VERSION {
            return Err(FactorFileError::Version(version));
        }
        postcard::from_bytes(body).map_err(|_| FactorFileError::Damaged)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file() -> FactorFile {
        let mut factor = InformationFactor::<f64, 16>::new();
        for k in 0..20 {
            let mut columns = std::array::from_fn(|j| [((k * 16 + j) % 7) as f64 - 3.1]);
            factor.absorb(&mut columns, &mut [f64::from(k as u8)]);
        }
        FactorFile::new(&factor, 0.3, [1.0; 6], "bracket 17")
    }

    #[test]
    fn what_is_written_is_read() {
        let file = file();
        let read = FactorFile::from_bytes(&file.to_bytes()).unwrap();
        assert_eq!(read, file);
        assert_eq!(read.factor::<16>().unwrap().rows(), 20);
        assert!(matches!(read.factor::<10>(), Err(FactorFileError::Numbers { .. })));
    }

    #[test]
    fn every_damaged_byte_is_noticed() {
        let bytes = file().to_bytes();
        for position in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[position] ^= 0x10;
            assert!(FactorFile::from_bytes(&damaged).is_err(), "byte {position}");
            assert!(FactorFile::from_bytes(&bytes[..position]).is_err(), "cut at {position}");
        }
    }
}

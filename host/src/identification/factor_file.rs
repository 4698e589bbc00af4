//! The factor file, `*.factor`: what a recording said, without the recording.
//!
//! Eight bytes of magic, then one postcard object, then its CRC-32 (little-endian). The object starts with a
//! version; parameter names and units are part of it, so a factor of another model is told apart.

use rigident_shared::calibration::Reading;
use rigident_shared::factor::InformationFactor;
use rigident_shared::inertia::{PARAMETER_NAMES, PARAMETER_UNITS};
use serde::{Deserialize, Serialize};

const MAGIC: &[u8; 8] = b"RIGIDFAC";
/// Version 2 brought [`FactorSource`]: version 1 did not say whether σ was given.
const VERSION: u16 = 2;
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
        "the factor file has version {0}, this program reads version {VERSION}: write it anew from the recording \
         with `rigident factor`, or use the program that wrote it"
    )]
    Version(u16),
    /// Names or units are not those of the model that the hash stands for.
    #[error(
        "the factor file is of another model: its parameters are {0}, here they are those of one body \
         (m in kg, mcx … mcz in kg m, Ixx … Ixy in kg m2), with or without the wrench offset"
    )]
    Model(String),
    /// Numbers of the header that no recording can give.
    #[error(
        "the factor file's header holds numbers that no recording gives: write it anew from the recording"
    )]
    Header,
    /// No rows are in it.
    #[error(
        "the factor file is empty: no row was absorbed into it; write it anew from a recording with rows"
    )]
    Empty,
    /// The numbers are not a factor.
    #[error("the factor file holds {got} numbers, not finite or not a triangle of {parameters} parameters")]
    Numbers {
        /// Numbers found.
        got: usize,
        /// Parameters named.
        parameters: usize,
    },
}

/// What one recording brought to a factor: enough to judge the residuals of a merged one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FactorSource {
    /// Name of the recording.
    pub recording: String,
    /// [`fingerprint`] of its readings: a recording counts once.
    pub fingerprint: u64,
    /// Readings in it.
    pub readings: u32,
    /// Of these not used.
    pub rejected: u32,
    /// Scalar rows absorbed.
    pub rows: u32,
    /// Variance of the whitened, filtered noise per row (1 without filter).
    pub noise_gain: f64,
    /// 1 σ by which the wrench channels were whitened: N, N m.
    pub channel_sigma: [f64; 6],
    /// That σ was given; else it is from the residuals.
    pub sigma_given: bool,
    /// 1 σ of the relative gain errors of the load cell, already eliminated from the factor; zero: none.
    pub gain_sigma: [f64; 6],
    /// What the noise of the gyro alone brings to a tensor element: 1/(kg m²)².
    pub tensor_information: f64,
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
    /// Where the rows came from.
    pub sources: Vec<FactorSource>,
    /// Parameters that the rows determined and that were eliminated: six offsets for each recording, usually.
    pub eliminated: u32,
    /// χ² of the disagreement of what was merged, whitened.
    pub disagreement: f64,
    /// Its degrees of freedom.
    pub comparisons: u32,
    /// Upper triangle row by row, z, residual sum of squares.
    pub entries: Vec<f64>,
}

/// FNV-1a over names and units.
fn model_hash(parameters: &[(String, String)]) -> u64 {
    let mut hash = FNV_OFFSET;
    for (name, unit) in parameters {
        for byte in name.bytes().chain([0]).chain(unit.bytes()).chain([0]) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(FNV_PRIME);
        }
    }
    hash
}

const FNV_OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
const FNV_PRIME: u64 = 0x0000_0100_0000_01b3;

/// FNV-1a over the words of the readings: the same for the same numbers, whatever file they stand in and
/// whatever the rig file says of them.
pub fn fingerprint(readings: &[Reading<f64>]) -> u64 {
    let mut hash = FNV_OFFSET;
    let mut add = |word: u64| {
        // The high half is folded in: the product alone carries bits upwards only.
        hash = (hash ^ word).wrapping_mul(FNV_PRIME);
        hash ^= hash >> 32;
    };
    for reading in readings {
        add(reading.time_ns);
        reading.wrench.array().iter().for_each(|v| add(v.to_bits()));
        reading.specific_force.array().iter().for_each(|v| add(v.to_bits()));
        reading.angular_rate.array().iter().for_each(|v| add(v.to_bits()));
    }
    hash
}

/// The first `count` of the sixteen names and units.
fn model(count: usize) -> Vec<(String, String)> {
    PARAMETER_NAMES
        .iter()
        .zip(PARAMETER_UNITS)
        .take(count)
        .map(|(name, unit)| ((*name).to_owned(), unit.to_owned()))
        .collect()
}

impl FactorFile {
    /// A factor of a body's ten parameters, or of sixteen with the offset.
    pub fn new<const N: usize>(factor: &InformationFactor<f64, N>, sources: Vec<FactorSource>) -> Self {
        let parameters = model(N);
        Self {
            version: VERSION,
            model_hash: model_hash(&parameters),
            parameters,
            column_scale: vec![1.0; N],
            rows: factor.rows(),
            sources,
            eliminated: 0,
            disagreement: 0.0,
            comparisons: 0,
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

    /// That this is a factor of one body's parameters, of at least one row, whose header can be reckoned with.
    ///
    /// # Errors
    /// [`FactorFileError`] says what is wrong.
    pub fn check(&self) -> Result<(), FactorFileError> {
        let count = self.parameters.len();
        let known = matches!(count, 10 | 16) && self.parameters == model(count);
        if !known || self.model_hash != model_hash(&self.parameters) {
            let names: Vec<_> =
                self.parameters.iter().map(|(name, unit)| format!("{name} in {unit}")).collect();
            return Err(FactorFileError::Model(names.join(", ")));
        }
        if self.rows == 0 || self.sources.iter().all(|s| s.rows == 0) {
            return Err(FactorFileError::Empty);
        }
        let positive = |v: f64| v.is_finite() && v > 0.0;
        let sound = self.disagreement.is_finite()
            && self.column_scale.len() == count
            && self.column_scale.iter().all(|v| *v == 1.0)
            && self.sources.iter().all(|s| {
                positive(s.noise_gain)
                    && s.channel_sigma.iter().all(|v| positive(*v))
                    && s.gain_sigma.iter().all(|v| v.is_finite() && *v >= 0.0)
                    && s.tensor_information.is_finite()
            });
        if sound { Ok(()) } else { Err(FactorFileError::Header) }
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
            let columns = std::array::from_fn(|j| [((k * 16 + j) % 7) as f64 - 3.1]);
            factor.absorb(&columns, &[f64::from(k as u8)]);
        }
        let source = FactorSource {
            recording: "bracket 17".into(),
            fingerprint: 7,
            readings: 21,
            rejected: 1,
            rows: 20,
            noise_gain: 0.3,
            channel_sigma: [1.0; 6],
            sigma_given: true,
            gain_sigma: [0.0; 6],
            tensor_information: 0.1,
        };
        FactorFile::new(&factor, vec![source])
    }

    #[test]
    fn what_cannot_be_reckoned_with_is_named() {
        let good = file();
        assert_eq!(good.check(), Ok(()));
        let with = |change: &dyn Fn(&mut FactorFile)| {
            let mut file = good.clone();
            change(&mut file);
            FactorFile::from_bytes(&file.to_bytes()).unwrap().check().unwrap_err()
        };
        assert!(matches!(with(&|f| f.parameters[0].1 = "lb".into()), FactorFileError::Model(_)));
        assert!(matches!(with(&|f| f.model_hash ^= 1), FactorFileError::Model(_)));
        assert!(matches!(with(&|f| f.parameters.truncate(4)), FactorFileError::Model(_)));
        assert_eq!(with(&|f| f.rows = 0), FactorFileError::Empty);
        assert_eq!(with(&|f| f.sources.clear()), FactorFileError::Empty);
        assert_eq!(with(&|f| f.sources[0].channel_sigma[5] = 0.0), FactorFileError::Header);
        assert_eq!(with(&|f| f.column_scale[3] = 2.0), FactorFileError::Header);
        assert_eq!(with(&|f| f.disagreement = f64::NAN), FactorFileError::Header);
    }

    #[test]
    fn a_fingerprint_tells_readings_apart() {
        let readings: Vec<Reading<f64>> =
            (0..50).map(|n| Reading { time_ns: n, ..Reading::default() }).collect();
        let mut seen = std::collections::HashSet::from([fingerprint(&readings), fingerprint(&readings[1..])]);
        for n in 0..50 {
            let mut other = readings.clone();
            let mut wrench = other[n].wrench.array();
            wrench[n % 6] = f64::from_bits(1 << (63 - n));
            other[n].wrench = rigident_shared::spatial::Wrench::from_array(wrench);
            seen.insert(fingerprint(&other));
        }
        assert_eq!(seen.len(), 52);
        assert_eq!(fingerprint(&readings), fingerprint(&readings.clone()));
    }

    #[test]
    fn another_version_is_told_as_one() {
        let body = postcard::to_allocvec(&(1_u16, 99_u64)).unwrap();
        let bytes = [MAGIC.as_slice(), &body, &CRC.checksum(&body).to_le_bytes()].concat();
        assert_eq!(FactorFile::from_bytes(&bytes), Err(FactorFileError::Version(1)));
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

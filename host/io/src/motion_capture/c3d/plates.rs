//! Force plates as the group FORCE_PLATFORM describes them.

use super::error::{C3dError, parameter};
use super::parameters::Parameters;

/// The meaning of a plate's channels.
#[derive(Clone, Debug, PartialEq)]
pub enum PlateKind {
    /// Type 1: three forces, the centre of pressure's x and y, the free moment.
    Pressure,
    /// Type 2: three forces and three moments about the plate's origin.
    Wrench,
    /// Type 3: eight forces of four pillars, of which pairs of horizontal ones are added: fx12, fx34, fy14,
    /// fy23, fz1 to fz4.
    Pillars,
    /// Type 4: type 2 through a matrix, rows by the wrench's components.
    Calibrated(Box<[[f64; 6]; 6]>),
}

/// A force plate.
#[derive(Clone, Debug, PartialEq)]
pub struct Plate {
    /// The meaning of its channels.
    pub kind: PlateKind,
    /// The plate's analog channels, from zero.
    pub channels: Vec<usize>,
    /// Corners in the laboratory's frame, m: in the plate's axes those of (+x, +y), (−x, +y), (−x, −y), (+x,
    /// −y).
    pub corners_m: [[f64; 3]; 4],
    /// From its origin to the middle of its surface, or the other way round, as its type has it, in its own
    /// axes, m.
    pub origin_m: [f64; 3],
    /// The plate's number in the file, from 1.
    pub number: usize,
    /// The unit of the plate's moments in N m, and of its lengths in m.
    pub moment_m: f64,
}

const GROUP: &str = "FORCE_PLATFORM";

/// Returns the plates of a recording with this many channels; those that are not wired or have no corners are
/// left out, and named.
pub(super) fn of(
    parameters: &Parameters,
    channels: usize,
    notes: &mut Vec<String>,
) -> Result<Vec<Plate>, C3dError> {
    let arrays = Arrays::of(parameters)?;
    let described = (0..arrays.used).filter(|k| match arrays.empty(*k) {
        None => true,
        Some(why) => {
            notes.push(format!("plate {} has {why} in FORCE_PLATFORM: it is left out", k + 1));
            false
        }
    });
    let described: Vec<usize> = described.collect();
    described.into_iter().map(|k| arrays.plate(k, channels)).collect()
}

/// The arrays of the group, of which every plate has its part.
struct Arrays {
    /// The number of plates that are used; the arrays may describe more.
    used: usize,
    kinds: Vec<f64>,
    wired: Vec<f64>,
    /// Length of a column of `wired`: types 3 have eight channels, and all columns are as long as the
    /// longest.
    width: usize,
    corners: Vec<f64>,
    origins: Vec<f64>,
    matrices: Vec<f64>,
    /// The points' unit, m.
    metre: f64,
    /// Units of the analog channels.
    units: Vec<String>,
}

impl Arrays {
    fn of(parameters: &Parameters) -> Result<Self, C3dError> {
        let used = parameters.count(GROUP, "USED")?.unwrap_or(0);
        let get = |name: &'static str| -> Result<Vec<f64>, C3dError> {
            let values = parameters.numbers(GROUP, name)?.unwrap_or_default();
            if values.iter().any(|value| !value.is_finite()) {
                return Err(parameter(GROUP, name, "a value is no number".to_owned()));
            }
            Ok(values)
        };
        let (kinds, wired, corners, origins, matrices) =
            (get("TYPE")?, get("CHANNEL")?, get("CORNERS")?, get("ORIGIN")?, get("CAL_MATRIX")?);
        let metre = parameters.unit_m()?;
        let units = parameters.texts("ANALOG", "UNITS");
        let width = parameters
            .column_length(GROUP, "CHANNEL")
            .unwrap_or_else(|| wired.len().checked_div(used).unwrap_or(0));
        Ok(Self { used, kinds, wired, width, corners, origins, matrices, metre, units })
    }

    /// Returns the error of an array that is too short.
    fn short(&self, name: &'static str) -> C3dError {
        parameter(GROUP, name, format!("it does not describe all {} plates", self.used))
    }

    /// Returns what plate `k` lacks, if it is not wired or has no corners.
    fn empty(&self, k: usize) -> Option<&'static str> {
        let is_zero = |values: Option<&[f64]>| values.is_none_or(|own| own.iter().all(|value| *value == 0.0));
        if is_zero(self.wired.get(self.width * k..self.width * (k + 1))) || self.width == 0 {
            return Some("no channels");
        }
        is_zero(self.corners.get(12 * k..12 * (k + 1))).then_some("no corners")
    }

    fn kind(&self, k: usize) -> Result<PlateKind, C3dError> {
        let number = self.kinds.get(k).copied().ok_or_else(|| self.short("TYPE"))?;
        match number as i64 {
            1 => Ok(PlateKind::Pressure),
            2 => Ok(PlateKind::Wrench),
            3 => Ok(PlateKind::Pillars),
            4 => {
                let of = self.matrices.get(36 * k..36 * (k + 1)).ok_or_else(|| self.short("CAL_MATRIX"))?;
                // Columns come first in the file.
                let matrix = std::array::from_fn(|row| std::array::from_fn(|column| of[6 * column + row]));
                Ok(PlateKind::Calibrated(Box::new(matrix)))
            }
            _ => {
                let reason = format!("plate {} is of type {number}; read are types 1 to 4", k + 1);
                Err(parameter(GROUP, "TYPE", reason))
            }
        }
    }

    /// Returns the channels of a plate, of all that there are.
    fn channels(&self, k: usize, kind: &PlateKind, channels: usize) -> Result<Vec<usize>, C3dError> {
        let count = if *kind == PlateKind::Pillars { 8 } else { 6 };
        let its = self
            .wired
            .get(self.width * k..self.width * k + count)
            .filter(|_| self.width >= count)
            .ok_or_else(|| self.short("CHANNEL"))?;
        let its: Option<Vec<usize>> = its
            .iter()
            .map(|channel| {
                (*channel as i64 as usize).checked_sub(1).filter(|c| *channel >= 1.0 && *c < channels)
            })
            .collect();
        its.ok_or_else(|| {
            parameter(GROUP, "CHANNEL", format!("plate {} has a channel that there is not", k + 1))
        })
    }

    /// Returns the unit of a plate's moments over N m: newtons times the points' unit, unless their channel
    /// says otherwise.
    fn moment_m(&self, kind: &PlateKind, its: &[usize]) -> f64 {
        let unit = its.get(3).and_then(|channel| self.units.get(*channel)).map(|unit| plain(unit));
        match unit.as_deref() {
            Some("nm") if *kind != PlateKind::Pressure => 1.0,
            Some("nmm") if *kind != PlateKind::Pressure => 1e-3,
            _ => self.metre,
        }
    }

    fn plate(&self, k: usize, channels: usize) -> Result<Plate, C3dError> {
        let kind = self.kind(k)?;
        let its = self.channels(k, &kind, channels)?;
        let moment_m = self.moment_m(&kind, &its);
        let metre = self.metre;
        let corner = self.corners.get(12 * k..12 * (k + 1)).ok_or_else(|| self.short("CORNERS"))?;
        let origin = self.origins.get(3 * k..3 * (k + 1)).ok_or_else(|| self.short("ORIGIN"))?;
        Ok(Plate {
            kind,
            channels: its,
            corners_m: std::array::from_fn(|c| std::array::from_fn(|axis| metre * corner[3 * c + axis])),
            origin_m: std::array::from_fn(|axis| metre * origin[axis]),
            moment_m,
            number: k + 1,
        })
    }
}

/// Returns a unit in small letters, without blanks and dots.
fn plain(unit: &str) -> String {
    unit.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_lowercase()).collect()
}

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
    /// Its analog channels, from zero.
    pub channels: Vec<usize>,
    /// Corners in the laboratory's frame, m: in the plate's axes those of (+x, +y), (−x, +y), (−x, −y), (+x,
    /// −y).
    pub corners_m: [[f64; 3]; 4],
    /// From its origin to the middle of its surface, or the other way round, as its type has it, in its own
    /// axes, m.
    pub origin_m: [f64; 3],
    /// Its number in the file, from 1.
    pub number: usize,
    /// Its moments' unit over N m, and its lengths' over m.
    pub moment_m: f64,
}

/// Returns the plates of a recording with this many channels; those that are not wired or have no corners are
/// left out, and named.
pub(super) fn of(
    parameters: &Parameters,
    channels: usize,
    notes: &mut Vec<String>,
) -> Result<Vec<Plate>, C3dError> {
    const GROUP: &str = "FORCE_PLATFORM";
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
    let short = |name| parameter(GROUP, name, format!("it does not describe all {used} plates"));
    // Types 3 have eight channels, and all columns are as long as the longest.
    // The arrays may describe more plates than are used.
    let width = parameters
        .column_length(GROUP, "CHANNEL")
        .unwrap_or_else(|| wired.len().checked_div(used).unwrap_or(0));
    let is_zero = |values: Option<&[f64]>| values.is_none_or(|own| own.iter().all(|value| *value == 0.0));
    let empty = |k: usize| {
        if is_zero(wired.get(width * k..width * (k + 1))) || width == 0 {
            return Some("no channels");
        }
        is_zero(corners.get(12 * k..12 * (k + 1))).then_some("no corners")
    };
    let described = (0..used).filter(|k| match empty(*k) {
        None => true,
        Some(why) => {
            notes.push(format!("plate {} has {why} in FORCE_PLATFORM: it is left out", k + 1));
            false
        }
    });
    let described: Vec<usize> = described.collect();
    described
        .into_iter()
        .map(|k| {
            let number = kinds.get(k).copied().ok_or_else(|| short("TYPE"))?;
            let kind = match number as i64 {
                1 => PlateKind::Pressure,
                2 => PlateKind::Wrench,
                3 => PlateKind::Pillars,
                4 => {
                    let of = matrices.get(36 * k..36 * (k + 1)).ok_or_else(|| short("CAL_MATRIX"))?;
                    // Columns come first in the file.
                    let matrix =
                        std::array::from_fn(|row| std::array::from_fn(|column| of[6 * column + row]));
                    PlateKind::Calibrated(Box::new(matrix))
                }
                _ => {
                    let reason = format!("plate {} is of type {number}; read are types 1 to 4", k + 1);
                    return Err(parameter(GROUP, "TYPE", reason));
                }
            };
            let count = if kind == PlateKind::Pillars { 8 } else { 6 };
            let its = wired
                .get(width * k..width * k + count)
                .filter(|_| width >= count)
                .ok_or_else(|| short("CHANNEL"))?;
            let its: Option<Vec<usize>> = its
                .iter()
                .map(|channel| {
                    (*channel as i64 as usize).checked_sub(1).filter(|c| *channel >= 1.0 && *c < channels)
                })
                .collect();
            let its = its.ok_or_else(|| {
                parameter(GROUP, "CHANNEL", format!("plate {} has a channel that there is not", k + 1))
            })?;
            // Moments are in newtons times the points' unit, unless their channel says otherwise.
            let unit = its.get(3).and_then(|channel| units.get(*channel)).map(|unit| plain(unit));
            let moment_m = match unit.as_deref() {
                Some("nm") if kind != PlateKind::Pressure => 1.0,
                Some("nmm") if kind != PlateKind::Pressure => 1e-3,
                _ => metre,
            };
            let corner = corners.get(12 * k..12 * (k + 1)).ok_or_else(|| short("CORNERS"))?;
            let origin = origins.get(3 * k..3 * (k + 1)).ok_or_else(|| short("ORIGIN"))?;
            Ok(Plate {
                kind,
                channels: its,
                corners_m: std::array::from_fn(|c| std::array::from_fn(|axis| metre * corner[3 * c + axis])),
                origin_m: std::array::from_fn(|axis| metre * origin[axis]),
                moment_m,
                number: k + 1,
            })
        })
        .collect()
}

/// A unit in small letters, without blanks and dots.
fn plain(unit: &str) -> String {
    unit.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_lowercase()).collect()
}

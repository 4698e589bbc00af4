//! The table of loadings: CSV, a row each.
//!
//! A loading is a weight (`mass_kg`) whose centre, or the point that it hangs from, is at `x_m`, `y_m`, `z_m`
//! in the cell's frame S, where gravity points along `down_x`, `down_y`, `down_z` (0, 0, −1 if these columns
//! are not there); or a wrench (`fx_n` to `mz_nm`) that a machine exerts on the cell's body. `g1_v` to `g6_v`
//! are the mean voltages of the bridges, or `from_s` and `to_s` the stretch of a recording that has them.
//! `weight` names a weight whose error several loadings share, `run` loadings that share their zero, `note`
//! is for people.

use super::LoadCellError;
use crate::named_table::NamedTable;

/// A place is no farther from the cell, m.
const FARTHEST_M: f64 = 10.0;
/// A direction's length differs from one by no more: three digits were written.
const UNIT_WITHIN: f64 = 0.02;
/// The most loadings of a table.
const MOST: usize = 300;

/// A weight, or a known wrench.
#[derive(Clone, Debug, PartialEq)]
pub enum Load {
    /// A weight hangs.
    Weight {
        /// kg.
        mass_kg: f64,
        /// The place where it acts, in S, m.
        place_m: [f64; 3],
        /// Unit vector of gravity in S.
        down: [f64; 3],
    },
    /// A machine pulls: the wrench that the cell exerts on its body, N and N m.
    Wrench([f64; 6]),
}

/// One loading.
#[derive(Clone, Debug, PartialEq)]
pub struct Loading {
    /// Line of the table, from 1.
    pub line: u64,
    /// The zero of it: the name in column `run`, empty without.
    pub run: String,
    /// The weight that hangs: the name in column `weight`, or its mass as written.
    pub weight: String,
    /// The load.
    pub load: Load,
    /// Gravity, m/s².
    pub gravity_mps2: f64,
    /// Mean voltages of the bridges, V.
    pub gauges_v: [f64; 6],
}

impl Loading {
    /// Returns the wrench that the cell exerts on its body, S, N and N m: a weight is carried by an equal
    /// force upwards.
    pub fn wrench(&self) -> [f64; 6] {
        match &self.load {
            Load::Wrench(wrench) => *wrench,
            Load::Weight { mass_kg, place_m: [x, y, z], down } => {
                let [fx, fy, fz] = down.map(|d| -mass_kg * self.gravity_mps2 * d);
                [fx, fy, fz, y * fz - z * fy, z * fx - x * fz, x * fy - y * fx]
            }
        }
    }
}

/// Returns the mean voltages of a stretch of a recording, from its first to its second time, s.
pub type Stretch<'a> = &'a dyn Fn(f64, f64) -> Result<[f64; 6], String>;

/// Columns that a table may have.
const KNOWN: [&str; 24] = [
    "mass_kg", "x_m", "y_m", "z_m", "down_x", "down_y", "down_z", "fx_n", "fy_n", "fz_n", "mx_nm", "my_nm",
    "mz_nm", "g1_v", "g2_v", "g3_v", "g4_v", "g5_v", "g6_v", "from_s", "to_s", "weight", "run", "note",
];

/// Reads the text of a table; `what` names it in complaints, `stretch` gives the readings of a recording.
///
/// # Errors
/// [`LoadCellError::Table`] says which line and column cannot be read.
pub fn parse(
    text: &str,
    what: &str,
    gravity_mps2: f64,
    stretch: Option<Stretch<'_>>,
) -> Result<Vec<Loading>, LoadCellError> {
    Table { gravity_mps2, stretch }.read(text).map_err(|why| LoadCellError::Table(format!("{what}: {why}")))
}

struct Table<'a> {
    gravity_mps2: f64,
    stretch: Option<Stretch<'a>>,
}

/// The cells of one row by the names of their columns.
struct Cells<'a> {
    table: &'a NamedTable,
    cells: &'a [String],
    line: u64,
}

impl Cells<'_> {
    fn text(&self, name: &str) -> Option<&str> {
        let cell = self.cells.get(self.table.column(name)?)?;
        Some(cell.as_str()).filter(|text| !text.is_empty())
    }

    fn number(&self, name: &str) -> Result<Option<f64>, String> {
        let Some(text) = self.text(name) else { return Ok(None) };
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(Some(number)),
            _ => Err(format!(
                "line {}, column {name}: {text:?} is no number; a decimal point and a comma between columns \
                 are expected",
                self.line
            )),
        }
    }

    fn all<const N: usize>(&self, names: [&str; N]) -> Result<Option<[f64; N]>, String> {
        let mut numbers = [0.0; N];
        let mut missing = Vec::new();
        for (number, name) in numbers.iter_mut().zip(names) {
            match self.number(name)? {
                Some(value) => *number = value,
                None => missing.push(name),
            }
        }
        if missing.len() == N {
            Ok(None)
        } else if let Some(first) = missing.first() {
            Err(format!("line {}: {first} is missing beside the others", self.line))
        } else {
            Ok(Some(numbers))
        }
    }
}

impl Table<'_> {
    fn read(&self, text: &str) -> Result<Vec<Loading>, String> {
        let table = NamedTable::parse(text)?;
        if let Some(name) = table.header.iter().find(|name| !KNOWN.contains(&name.as_str())) {
            return Err(format!("column {name} is none of a table of loadings: {}", KNOWN.join(", ")));
        }
        if table.rows.is_empty() {
            return Err("there is no loading in it".to_owned());
        }
        if table.rows.len() > MOST {
            return Err(format!("it has more than {MOST} loadings"));
        }
        let loading =
            |(line, cells): &(u64, Vec<String>)| self.loading(&Cells { table: &table, cells, line: *line });
        table.rows.iter().map(loading).collect()
    }

    fn loading(&self, cells: &Cells<'_>) -> Result<Loading, String> {
        let line = cells.line;
        let gauges = cells.all(["g1_v", "g2_v", "g3_v", "g4_v", "g5_v", "g6_v"])?;
        let span = cells.all(["from_s", "to_s"])?;
        let gauges_v = match (gauges, span, self.stretch) {
            (Some(gauges), None, _) => gauges,
            (None, Some([from, to]), Some(stretch)) => {
                stretch(from, to).map_err(|why| format!("line {line}: {why}"))?
            }
            (None, Some(_), None) => {
                return Err(format!("line {line} has times, and no recording is given that they are of"));
            }
            (Some(_), Some(_), _) => {
                return Err(format!("line {line} has readings and times: one of the two is enough"));
            }
            (None, None, _) => {
                return Err(format!(
                    "line {line} has no readings: columns g1_v to g6_v (V), or from_s and to_s of a recording"
                ));
            }
        };
        let load = self.load(cells)?;
        let own = match &load {
            Load::Weight { mass_kg, .. } => format!("{mass_kg} kg"),
            Load::Wrench(_) => "the machine".to_owned(),
        };
        Ok(Loading {
            line,
            run: cells.text("run").unwrap_or_default().to_owned(),
            weight: cells.text("weight").map_or(own, str::to_owned),
            load,
            gravity_mps2: self.gravity_mps2,
            gauges_v,
        })
    }

    fn load(&self, cells: &Cells<'_>) -> Result<Load, String> {
        let line = cells.line;
        let wrench = cells.all(["fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"])?;
        match (cells.number("mass_kg")?, wrench) {
            (None, Some(wrench)) => Ok(Load::Wrench(wrench)),
            (Some(_), Some(_)) => {
                Err(format!("line {line} has a mass and a wrench: one of the two is enough"))
            }
            (None, None) => Err(format!(
                "line {line} has no load: mass_kg with x_m, y_m, z_m, or {}",
                "fx_n, fy_n, fz_n, mx_nm, my_nm, mz_nm"
            )),
            (Some(mass_kg), None) if mass_kg < 0.0 => {
                Err(format!("line {line}, column mass_kg: {mass_kg} kg is no weight"))
            }
            (Some(mass_kg), None) => {
                let place_m = match cells.all(["x_m", "y_m", "z_m"])? {
                    Some(place) => place,
                    None if mass_kg == 0.0 => [0.0; 3],
                    None => return Err(format!("line {line}: {mass_kg} kg hang at no place: x_m, y_m, z_m")),
                };
                if let Some(far) = place_m.iter().find(|v| v.abs() > FARTHEST_M) {
                    return Err(format!("line {line}: {far} m from the cell: are places in mm?"));
                }
                let down = cells.all(["down_x", "down_y", "down_z"])?.unwrap_or([0.0, 0.0, -1.0]);
                let length = down.iter().map(|v| v * v).sum::<f64>().sqrt();
                if (length - 1.0).abs() > UNIT_WITHIN {
                    return Err(format!(
                        "line {line}: down_x, down_y, down_z have the length {length}, not 1"
                    ));
                }
                Ok(Load::Weight { mass_kg, place_m, down: down.map(|v| v / length) })
            }
        }
    }
}

//! Columns of joints of one freedom: how they are named, and their numbers.

use rigident_shared::tree::Joint;

use super::TreePrepareError;
use rigident_io::recording::Recording;
use rigident_io::rig::{ColumnSource, JointTable, RigFile};

/// The quantities of a joint that have a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Angle or length of the joint.
    Position,
    /// Rate of the joint.
    Rate,
    /// Torque or force of its drive.
    Effort,
}

impl Quantity {
    fn of(self, table: &JointTable) -> Option<&ColumnSource> {
        match self {
            Self::Position => table.position.as_ref(),
            Self::Rate => table.rate.as_ref(),
            Self::Effort => table.effort.as_ref(),
        }
    }
}

/// Units of position, rate and effort, as columns end with; `None` of joints that have not one freedom.
pub fn units(joint: &Joint<f64>) -> Option<[&'static str; 3]> {
    match joint {
        Joint::Revolute(_) => Some(["rad", "radps", "nm"]),
        Joint::Prismatic(_) => Some(["m", "mps", "n"]),
        _ => None,
    }
}

/// The column in which a quantity of a joint is searched for.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name of the column.
    pub name: String,
    /// Factor to SI.
    pub scale: f64,
    /// Is added after that, SI.
    pub offset: f64,
    /// Other columns that are added, with their factors.
    pub plus: Vec<(String, f64)>,
    /// The rig file names it; otherwise its name is the joint's and the unit.
    pub is_named: bool,
}

impl Column {
    /// Returns the column under its own name, in SI.
    pub(super) fn plain(name: String) -> Self {
        Self { name, scale: 1.0, offset: 0.0, plus: Vec::new(), is_named: false }
    }

    /// Returns the column that a rig file names.
    pub(super) fn named(source: &ColumnSource) -> Self {
        let (name, scale) = source.parts();
        let plus = source.plus().map(|(name, factor)| (name.to_owned(), factor)).collect();
        Self { name: name.to_owned(), scale, offset: source.offset(), plus, is_named: true }
    }
}

/// Returns the column of a quantity of the joint `name`; `None` of joints that have not one freedom.
pub fn column(rig: &RigFile, name: &str, joint: &Joint<f64>, quantity: Quantity) -> Option<Column> {
    let unit = units(joint)?[quantity as usize];
    let table = rig.joint.iter().find(|table| table.name == name);
    Some(match table.and_then(|table| quantity.of(table)) {
        Some(source) => Column::named(source),
        None => Column::plain(format!("{name}_{unit}")),
    })
}

/// Numbers of a column that is not of the notation's; `None` if it is not there.
///
/// # Errors
/// [`TreePrepareError::Cell`]: one of them is no finite number.
pub fn numbers(recording: &Recording, column: &Column) -> Result<Option<Vec<f64>>, TreePrepareError> {
    let Some(mut sum) = scaled(recording, &column.name, column.scale)? else { return Ok(None) };
    if column.offset != 0.0 {
        sum.iter_mut().for_each(|v| *v += column.offset);
    }
    for (name, factor) in &column.plus {
        let Some(values) = scaled(recording, name, *factor)? else {
            return Err(TreePrepareError::Missing {
                name: recording.file(),
                missing: format!("column {name:?}, which the rig file adds to {:?}, is", column.name),
                advice: "correct the name in [[joint]] plus".to_owned(),
            });
        };
        sum.iter_mut().zip(values).for_each(|(to, v)| *to += v);
    }
    Ok(Some(sum))
}

/// Returns the numbers of one column times a factor; `None` if it is not there.
fn scaled(recording: &Recording, column: &str, factor: f64) -> Result<Option<Vec<f64>>, TreePrepareError> {
    let Some((_, cells)) = recording.extra.iter().find(|(name, _)| name == column) else { return Ok(None) };
    let values = cells.iter().enumerate().map(|(row, cell)| {
        let value = cell.trim().parse::<f64>().ok().map(|v| v * factor).filter(|v| v.is_finite());
        value.ok_or_else(|| TreePrepareError::Cell {
            name: recording.file(),
            column: column.to_owned(),
            row: recording.place(row),
            reason: format!("{cell:?} is not a finite number: correct it, or remove the row"),
        })
    });
    values.collect::<Result<Vec<f64>, _>>().map(Some)
}

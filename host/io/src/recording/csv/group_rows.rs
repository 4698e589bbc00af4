//! Rows of a group of columns as a recording keeps them, filled cell by cell or row by row: no column is held
//! a second time.

use crate::recording::Recording;
use crate::recording::columns::Group;

/// Rows of a group, by its number of columns.
pub(super) enum GroupRows {
    /// Of an accelerometer, a gyro, gravity.
    Three(Vec<[f64; 3]>),
    /// Of an attitude.
    Four(Vec<[f64; 4]>),
    /// Of a wrench, of gauges.
    Six(Vec<[f64; 6]>),
    /// Of a pose.
    Seven(Vec<[f64; 7]>),
}

/// Writes a number of a row; the row after the last is added first.
fn set<const K: usize>(rows: &mut Vec<[f64; K]>, row: usize, k: usize, value: f64) {
    if row == rows.len() {
        rows.push([0.0; K]);
    }
    if let Some(to) = rows.get_mut(row).and_then(|own| own.get_mut(k)) {
        *to = value;
    }
}

impl GroupRows {
    /// Returns no rows of a group.
    pub(super) fn new(group: Group) -> Self {
        match group {
            Group::Accel(_) | Group::Gyro(_) | Group::Gravity => Self::Three(Vec::new()),
            Group::Attitude(_) => Self::Four(Vec::new()),
            Group::Wrench | Group::Gauges => Self::Six(Vec::new()),
            Group::Platform | Group::Commanded => Self::Seven(Vec::new()),
        }
    }

    /// Writes the number of column `k` in a row that is there, or in the next one.
    pub(super) fn set(&mut self, row: usize, k: usize, value: f64) {
        match self {
            Self::Three(rows) => set(rows, row, k, value),
            Self::Four(rows) => set(rows, row, k, value),
            Self::Six(rows) => set(rows, row, k, value),
            Self::Seven(rows) => set(rows, row, k, value),
        }
    }

    /// Appends rows of numbers, `width` each; column k of the group is the number at `places[k]`.
    pub(super) fn extend(&mut self, numbers: &[f64], width: usize, places: &[usize]) {
        let rows = numbers.chunks_exact(width.max(1));
        let at = |row: &[f64], k: usize| places.get(k).and_then(|at| row.get(*at)).copied().unwrap_or(0.0);
        match self {
            Self::Three(own) => own.extend(rows.map(|row| std::array::from_fn(|k| at(row, k)))),
            Self::Four(own) => own.extend(rows.map(|row| std::array::from_fn(|k| at(row, k)))),
            Self::Six(own) => own.extend(rows.map(|row| std::array::from_fn(|k| at(row, k)))),
            Self::Seven(own) => own.extend(rows.map(|row| std::array::from_fn(|k| at(row, k)))),
        }
    }

    /// Puts the rows in their place.
    pub(super) fn put_into(self, group: Group, recording: &mut Recording) {
        match (self, group) {
            (Self::Three(rows), Group::Accel(j)) => recording.imu(j).accel = Some(rows),
            (Self::Three(rows), Group::Gyro(j)) => recording.imu(j).gyro = Some(rows),
            (Self::Three(rows), _) => recording.gravity = Some(rows),
            (Self::Four(rows), Group::Attitude(j)) => recording.attitudes.push((j, rows)),
            (Self::Six(rows), Group::Wrench) => recording.wrench = Some(rows),
            (Self::Six(rows), _) => recording.gauges = Some(rows),
            (Self::Seven(rows), Group::Platform) => recording.platform = Some(rows),
            (Self::Seven(rows), _) => recording.commanded = Some(rows),
            // Four numbers are an attitude's.
            (Self::Four(_), _) => {}
        }
    }
}

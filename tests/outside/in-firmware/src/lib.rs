//! Ten parameters in somebody's own firmware: without `std`, without a heap, with `rigident-shared` alone.
#![no_std]

use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::conditioning::{Conditioner, KernelError};
use rigident_shared::factor::{InformationFactor, Solution};
use rigident_shared::regressor::{SIGNALS, SMOOTHED, block};
use rigident_shared::spatial::Position;

/// The ten parameters, and the load cell's six offsets.
pub const COLUMNS: usize = 16;
/// Room for a filter of 0.1 s at 100 Hz.
const TAPS: usize = 10;

/// Takes readings at 100 Hz of an IMU at `position_m` in the load cell's frame, and returns the parameters.
///
/// # Errors
/// The filter does not fit.
pub fn ten_parameters(
    readings: impl Iterator<Item = Reading<f32>>,
    position_m: [f32; 3],
) -> Result<Solution<f32, COLUMNS>, KernelError> {
    let mounting = ImuMounting { position: Position::from_array(position_m), ..ImuMounting::PERFECT };
    let mut filter: Conditioner<f32, SIGNALS, { SIGNALS - SMOOTHED }, TAPS> =
        Conditioner::new(100.0, 0.1, 2)?;
    let mut factor = InformationFactor::<f32, COLUMNS>::EMPTY;
    for reading in readings {
        let Some(filtered) = filter.push(&mounting.signals(&reading)) else { continue };
        let rows = block(&mounting.mounted(&filtered), &mounting.position);
        let mut columns = [[0.0; 6]; COLUMNS];
        columns[..10].copy_from_slice(&rows.columns);
        for channel in 0..6 {
            columns[10 + channel][channel] = 1.0;
        }
        factor.absorb(&columns, &rows.wrench);
    }
    Ok(factor.solve())
}

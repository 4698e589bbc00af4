//! Ends a motion before the load cell is overloaded.

use super::SessionError;
use rigident_io::rig::WRENCH_CHANNELS;

/// A channel this near its range ends the motion: what is planned stays below, whatever body it is.
const NEAR: f64 = 0.97;
/// This many consecutive readings: one that is far off is none.
const IN_A_ROW: u32 = 3;

/// Watches the channels of a load cell.
#[derive(Clone, Debug)]
pub struct LoadGuard {
    range_n_nm: [f64; 6],
    in_a_row: [u32; 6],
}

impl LoadGuard {
    /// Watches a load cell with this range, N and N m.
    pub fn new(range_n_nm: [f64; 6]) -> Self {
        Self { range_n_nm, in_a_row: [0; 6] }
    }

    /// Takes in a reading, N and N m.
    ///
    /// # Errors
    /// The load cell is near its range.
    pub(super) fn reading(&mut self, wrench: &[f32; 6]) -> Result<(), SessionError> {
        for (k, (channel, unit)) in WRENCH_CHANNELS.into_iter().enumerate() {
            let (value, range) = (f64::from(wrench[k]), self.range_n_nm[k]);
            self.in_a_row[k] = if value.abs() >= NEAR * range { self.in_a_row[k] + 1 } else { 0 };
            if self.in_a_row[k] >= IN_A_ROW {
                return Err(SessionError::NearRange { channel, value, range, unit });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RANGE: [f64; 6] = [660.0, 660.0, 1980.0, 60.0, 60.0, 60.0];

    #[test]
    fn three_readings_near_the_range_end_it_and_one_spike_does_not() {
        let mut guard = LoadGuard::new(RANGE);
        let [calm, near] = [[0.0, 0.0, 200.0, 56.0, 0.0, 0.0], [0.0, 0.0, 200.0, -58.5, 0.0, 0.0]];
        for wrench in [near, near, calm, near, near, calm] {
            guard.reading(&wrench).unwrap();
        }
        assert!(guard.reading(&near).is_ok() && guard.reading(&near).is_ok());
        let said = guard.reading(&near).unwrap_err().to_string();
        assert!(said.contains("Mx came to -58.5 of 60.0 N m"), "{said}");
    }
}

//! Calibrations of sensors: an IMU by the motion it was driven through ([`imu`]), a load cell by known
//! weights ([`load_cell`]).

pub mod imu;
pub mod load_cell;

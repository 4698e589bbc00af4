//! What the application tells of itself.

use rigident_shared::calibration::Reading;
use rigident_shared::screening::Rejection;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};
use rigident_shared::wire::{
    CounterReport, EstimateReport, Identity, PROTOCOL_VERSION, ReadingMessage, SCHEMA_HASH,
};

use super::{App, FIRMWARE_HASH};
use crate::answer::{Solved, body};
use crate::sample_path::BodyFactor;

/// Version of the firmware.
const VERSION: [u8; 3] = [
    decimal(env!("CARGO_PKG_VERSION_MAJOR")),
    decimal(env!("CARGO_PKG_VERSION_MINOR")),
    decimal(env!("CARGO_PKG_VERSION_PATCH")),
];

const fn decimal(text: &str) -> u8 {
    match u8::from_str_radix(text, 10) {
        Ok(number) => number,
        Err(_) => 0,
    }
}

impl App {
    pub(super) fn identity(&self) -> Identity {
        Identity {
            protocol_version: PROTOCOL_VERSION,
            schema_hash: SCHEMA_HASH,
            firmware_version: VERSION,
            firmware_hash: FIRMWARE_HASH,
            board: self.board,
            state: self.state,
            reason: self.reason,
        }
    }

    pub(super) fn counters(&self) -> CounterReport {
        let mut report = CounterReport {
            load_cell_crc_errors: self.errors.load_cell_crc,
            load_cell_errors: self.errors.load_cell_other,
            load_cell_clipped: self.errors.load_cell_clipped,
            clipped_gauges: self.errors.clipped_gauges,
            imu_errors: self.errors.imu,
            bad_frames: self.bad_frames,
            telemetry_dropped: self.link.telemetry_dropped(),
            ..CounterReport::default()
        };
        if let Some(path) = &self.path {
            let counters = path.counters();
            report.readings = counters.readings;
            report.rejected = counters.rejected;
            report.rejected_by_channel = counters.rejected_by_channel;
            (report.last_rejection, report.last_rejected_channel) = match counters.last_rejection {
                None => (0, 0),
                Some(Rejection::NotFinite(channel)) => (1, channel),
                Some(Rejection::Saturated(channel)) => (2, channel),
                Some(Rejection::Frozen(channel)) => (3, channel),
            };
            report.gaps = counters.gaps;
            report.blocks = counters.blocks;
            report.knocks = counters.knocks;
            report.unaligned = path.unaligned().saturating_sub(self.errors.unaligned_before);
        }
        report
    }

    /// `solved` is the factor's.
    pub(super) fn report(&self, factor: &BodyFactor, solved: &Solved) -> Option<EstimateReport> {
        let path = self.path.as_ref()?;
        let body = body(factor, solved);
        Some(EstimateReport {
            readings: path.counters().readings,
            time_ns: self.last_reading.time_ns,
            blocks: path.counters().blocks,
            estimate: body.estimate,
            consistency: body.consistency,
            distance_sd: body.distance_sd,
            standard_deviation: solved.standard_deviation.clone(),
            determined: solved
                .determined
                .iter()
                .enumerate()
                .fold(0, |bits, (j, d)| bits | u16::from(*d) << j),
            condition_number: solved.condition_number,
            innovation_rms: path.statistics().rms().unwrap_or_default(),
            last: self.last_reading,
        })
    }
}

pub(super) fn message_of(reading: &Reading<f32>) -> ReadingMessage {
    ReadingMessage {
        time_ns: reading.time_ns,
        wrench: reading.wrench.array(),
        specific_force: reading.specific_force.array(),
        angular_rate: reading.angular_rate.array(),
    }
}

pub(super) fn reading_of(message: &ReadingMessage) -> Reading<f32> {
    Reading {
        time_ns: message.time_ns,
        wrench: Wrench::from_array(message.wrench),
        specific_force: SpecificForce::from_array(message.specific_force),
        angular_rate: AngularRate::from_array(message.angular_rate),
    }
}

//! The reports of the application about itself.

use core::ops::DerefMut;

use heapless::Vec;
use rigident_shared::calibration::Reading;
use rigident_shared::estimator::TwoLinkReading;
use rigident_shared::estimator::frames::FrameCounters;
use rigident_shared::screening::Rejection;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};
use rigident_shared::wire::{
    CounterReport, FactorRow, FrameReport, Identity, LinkReadingMessage, PROTOCOL_VERSION, ReadingMessage,
    SCHEMA_HASH, WatchReport,
};

use super::{App, HandOver};
use crate::Path;
use crate::version::FIRMWARE_HASH;

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

impl<P: DerefMut<Target = Path>> App<P> {
    pub(super) fn identity(&self) -> Identity {
        Identity {
            protocol_version: PROTOCOL_VERSION,
            schema_hash: SCHEMA_HASH,
            firmware_version: VERSION,
            firmware_hash: FIRMWARE_HASH,
            board: self.board,
            unique_id: self.facts.unique_id,
            reset: self.facts.reset,
            ended: self.facts.ended,
            clock: self.facts.clock,
            state: self.state,
            reason: self.reason,
            kept: self.keeping.kept(),
        }
    }

    pub(super) fn counters(&self) -> CounterReport {
        let mut report = CounterReport {
            load_cell_crc_errors: self.errors.load_cell_crc,
            load_cell_errors: self.errors.load_cell_other,
            load_cell_clipped: self.errors.load_cell_clipped,
            clipped_gauges: self.errors.clipped_gauges,
            load_cell_stale: self.errors.load_cell_stale,
            load_cell_resyncs: self.errors.load_cell_resyncs,
            without_excitation: self.errors.without_excitation,
            overdue_transfers: self.errors.overdue_transfers,
            failed_transfers: self.errors.failed_transfers,
            rate_error_ppm: self.meters.map(|meter| meter.error_ppm()),
            stack_bytes: self.facts.stack_bytes,
            imu_errors: self.errors.imu,
            second_imu_errors: self.errors.second_imu,
            lost: self.errors.lost,
            bad_frames: self.bad_frames,
            overruns: self.errors.overruns,
            telemetry_dropped: self.link.telemetry_dropped(),
            ..CounterReport::default()
        };
        if let Some(path) = self.path.samples() {
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
            report.unaligned = path.unaligned().wrapping_sub(self.errors.unaligned_before);
        }
        if let Some(path) = self.path.frames() {
            let counters = path.estimator().counters();
            report.frames = FrameReport {
                missing: self.errors.frames_missing,
                damaged: self.errors.frames_damaged,
                ..frame_report(counters)
            };
            (report.readings, report.blocks) = (counters.frames, counters.absorbed);
            report.rejected = counters.frames.saturating_sub(counters.absorbed);
        }
        if cfg!(feature = "watch") {
            report.watch.stream = self.errors.stream;
        }
        if let Some(path) = self.path.watch() {
            let watch = path.watch();
            let counters = watch.counters();
            report.frames = FrameReport {
                frames: counters.frames,
                absorbed: counters.absorbed,
                missing: self.errors.frames_missing,
                wrong_links: counters.wrong_links,
                not_finite: counters.not_finite,
                saturated: counters.saturated,
                last_link: self.errors.other_links,
                ..FrameReport::default()
            };
            report.watch = WatchReport {
                changes: watch.changes(),
                settled: watch.is_settled(),
                excess_percent: (100.0 * watch.excess()) as u32,
                last_saturated: counters.last_foot,
                ..report.watch
            };
            (report.readings, report.blocks) = (counters.frames, counters.blocks);
            report.rejected = counters.frames.saturating_sub(counters.absorbed);
        }
        report
    }

    /// Returns a row of the factor. `None` if there is no such row, or nothing is estimated. A tree's is
    /// taken out.
    pub(super) fn take_row(&mut self, row: u8) -> Option<FactorRow> {
        if let Some(path) = self.path.samples() {
            let row = path.row(row)?;
            let last = row.row + 1 >= row.parameters;
            self.run.hand_over = if last { HandOver::None } else { HandOver::Rows(self.now_ns) };
            return Some(row);
        }
        let estimator = self.path.frames_mut()?.estimator_mut();
        if usize::from(row) >= estimator.parameters() {
            return None;
        }
        let (residual_sum_of_squares, rows) = if row == 0 {
            estimator.begin_hand_over();
            estimator.factor_mut().take_residual()
        } else {
            (0.0, 0)
        };
        let entries = estimator.factor().row(usize::from(row)).collect();
        estimator.factor_mut().forget_row(usize::from(row));
        let parameters = estimator.parameters() as u8;
        // A tree's rows know no noise of the signals.
        let gram = Vec::new();
        Some(FactorRow { row, parameters, entries, gram, residual_sum_of_squares, rows })
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

fn frame_report(counters: &FrameCounters) -> FrameReport {
    FrameReport {
        frames: counters.frames,
        absorbed: counters.absorbed,
        missing: 0,
        damaged: 0,
        wrong_links: counters.wrong_links,
        not_finite: counters.not_finite,
        no_attitude: counters.no_attitude,
        saturated: counters.saturated,
        without_motion: counters.without_motion,
        full: counters.full,
        last_link: counters.last_link,
    }
}

pub(super) fn link_message_of(reading: &TwoLinkReading<f32>) -> LinkReadingMessage {
    LinkReadingMessage {
        base: message_of(&reading.base),
        specific_force: reading.specific_force.array(),
        angular_rate: reading.angular_rate.array(),
        attitude_wxyz: reading.attitude,
    }
}

pub(super) fn link_reading_of(message: &LinkReadingMessage) -> TwoLinkReading<f32> {
    TwoLinkReading {
        base: reading_of(&message.base),
        specific_force: SpecificForce::from_array(message.specific_force),
        angular_rate: AngularRate::from_array(message.angular_rate),
        attitude: message.attitude_wxyz,
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

//! A host that gives the application readings and keeps the estimates that it sends.

use hexapod::experiment::thesis_program;
use rigident_firmware::{App, Path};
use rigident_shared::factor::InformationFactor;
use rigident_shared::wire::{
    Answer, Command, CounterReport, Decoder, EstimateReport, InjectBatch, Kind, ReadingMessage, Reply,
    Settings, Source, Telemetry, TelemetrySettings, encode, frame,
};
use rigident_sim::rig::{ReadingRow, Readings, RigConfig};

use crate::runner::device;

/// Rate of the readings, 1/s.
pub const RATE_HZ: f64 = 500.0;

/// Returns everything perfect sensors read in a default experiment of `seconds`.
pub fn readings(config: &RigConfig, seconds: f64) -> Readings {
    Readings::new(config, &thesis_program(&config.geometry, seconds), RATE_HZ).unwrap()
}

/// Converts a row to a message on the line.
pub fn message(row: &ReadingRow) -> ReadingMessage {
    ReadingMessage {
        time_ns: row.time_ns,
        wrench: row.wrench.map(|v| v as f32),
        specific_force: row.specific_force.map(|v| v as f32),
        angular_rate: row.angular_rate.map(|v| v as f32),
    }
}

/// Returns the rig's settings for readings that come over the wire, with an estimate every 0.25 s.
pub fn settings(config: &RigConfig) -> Settings {
    Settings {
        rate_hz: RATE_HZ as f32,
        source: Source::Injected,
        model: rigident_shared::wire::ModelSettings::Body,
        row_every: 5,
        telemetry: TelemetrySettings { estimate_every_blocks: 25, stream_readings: false },
        ..device::settings(config)
    }
}

/// The application at the other end of a line that loses nothing.
pub struct Host {
    pub app: App<Box<Path>>,
    decoder: Decoder,
    sequence: u16,
    /// Estimates sent unasked.
    pub estimates: Vec<EstimateReport>,
}

impl Host {
    /// Configures and starts a device.
    pub fn start(settings: &Settings) -> Self {
        let mut host = Self {
            app: App::new("test", Box::default()),
            decoder: Decoder::new(),
            sequence: 0,
            estimates: Vec::new(),
        };
        host.ask(&Command::Configure(settings.clone())).unwrap();
        host.ask(&Command::Start).unwrap();
        host
    }

    pub fn ask(&mut self, command: &Command) -> Answer {
        let mut bytes = [0; frame::MAX_FRAME];
        self.sequence = self.sequence.wrapping_add(1);
        let length = encode(Kind::Command, self.sequence, command, &mut bytes).unwrap();
        for byte in &bytes[..length] {
            self.app.on_byte(*byte, 0);
        }
        let mut answer = None;
        loop {
            let count = self.app.poll_tx(&mut bytes);
            if count == 0 {
                return answer.unwrap();
            }
            for byte in &bytes[..count] {
                let Some(frame) = self.decoder.push(*byte) else { continue };
                let frame = frame.unwrap();
                if frame.kind == Kind::Answer {
                    answer = Some(frame.message().unwrap());
                } else if let Telemetry::Estimate(report) = frame.message().unwrap() {
                    self.estimates.push(report);
                }
            }
        }
    }

    /// Gives the readings, the first of which has number `first`. Returns the number of those that are taken
    /// in all.
    pub fn inject(&mut self, first: u32, readings: &[ReadingMessage]) -> u32 {
        let mut next = first;
        for part in readings.chunks(16) {
            let batch = InjectBatch { first_index: next, readings: part.iter().copied().collect() };
            match self.ask(&Command::Inject(batch)) {
                Ok(Reply::Injected { next_index }) if next_index == next + part.len() as u32 => {
                    next = next_index;
                }
                Ok(Reply::Injected { next_index }) => return next_index,
                other => panic!("{other:?}"),
            }
        }
        next
    }

    pub fn counters(&mut self) -> CounterReport {
        match self.ask(&Command::ReadCounters) {
            Ok(Reply::Counters(counters)) => counters,
            other => panic!("{other:?}"),
        }
    }

    pub fn estimate(&mut self) -> EstimateReport {
        match self.ask(&Command::ReadEstimate) {
            Ok(Reply::Estimate(report)) => report,
            other => panic!("{other:?}"),
        }
    }

    /// Returns the factor, in f64, exactly.
    pub fn factor<const N: usize>(&mut self) -> InformationFactor<f64, N> {
        let (mut rows, mut z, mut residual, mut count) = (Vec::new(), Vec::new(), 0.0, 0);
        for row in 0.. {
            let Ok(Reply::Row(mut taken)) = self.ask(&Command::TakeRow { row }) else {
                panic!("no row {row}")
            };
            if row == 0 {
                (residual, count) = (taken.residual_sum_of_squares, taken.rows);
            }
            z.extend(taken.entries.pop());
            rows.extend(taken.entries);
            if row + 1 == taken.parameters {
                break;
            }
        }
        let entries = rows.into_iter().chain(z).chain([residual]);
        InformationFactor::from_entries(entries.map(f64::from), count).unwrap()
    }
}

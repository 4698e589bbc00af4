use clap::Args;
use rigident_shared::forgetting::{ImuNoise, MemoryConfig, Span};
use rigident_shared::wire::{MemorySettings, Settings};

use crate::Failure;
use rigident::problem::body::Input;
use rigident_fit::{RowSource, Timing, filter_width_s, row_every};

/// Row blocks of which a window holds one at least in each of its parts.
const LEAST_BLOCKS: f64 = 5.0;

/// How long rows are remembered.
#[derive(Args, Debug, Clone, Default)]
pub struct Forgetting {
    /// For a body that changes: forget what the motion renews with this time constant, s; what it does not renew is kept.
    /// The answer is the one at the end, with the uncertainty of S seconds. With --until the run ends when what is
    /// remembered is that well known, which a short memory may never be
    #[arg(long, value_name = "S", conflicts_with = "window")]
    pub forget: Option<f64>,
    /// The answer of the last S seconds alone (of four fifths of it at least); where these did not move, nothing is
    /// identified. With --until as --forget
    #[arg(long, value_name = "S")]
    pub window: Option<f64>,
}

/// What rows are remembered of.
pub(crate) struct RowsOf {
    pub(crate) rate_hz: f64,
    pub(crate) is_static: bool,
}

impl RowsOf {
    pub(crate) fn input(input: &Input) -> Self {
        Self { rate_hz: input.rate_hz, is_static: input.is_static }
    }

    /// Returns what is forgotten of a source.
    pub(crate) fn source(source: &dyn RowSource) -> Self {
        let (rate_hz, is_static) = match source.timing() {
            Timing::Static => (1.0, true),
            Timing::Uniform { rate_hz } => (rate_hz, false),
        };
        Self { rate_hz, is_static }
    }

    /// Of a rig that moves.
    pub(crate) fn moving(rate_hz: f64) -> Self {
        Self { rate_hz, is_static: false }
    }
}

impl Forgetting {
    /// The span asked for; `None`: everything is kept, which an infinite one asks for too.
    ///
    /// # Errors
    /// Why it cannot be: bad input.
    pub(crate) fn span(&self, rows: &RowsOf) -> Result<Option<Span<f64>>, Failure> {
        let (option, seconds, span) = match (self.forget, self.window) {
            (Some(s), _) => ("--forget", s, Span::TimeConstant(s)),
            (None, Some(s)) => ("--window", s, Span::Window(s)),
            (None, None) => return Ok(None),
        };
        let refuse = |why: &str| Err(Failure::input(format!("{option} {seconds}: {why}")));
        if seconds.is_nan() || seconds <= 0.0 {
            return refuse("a positive number of seconds is wanted");
        }
        if rows.is_static {
            return refuse("still poses have no time that could be forgotten by; leave it out");
        }
        let block_s = f64::from(row_every(rows.rate_hz)) / rows.rate_hz;
        let width_s = filter_width_s(rows.rate_hz);
        let least_s = if self.forget.is_some() { width_s } else { width_s.max(LEAST_BLOCKS * block_s) };
        if seconds < least_s {
            return refuse(&format!("shorter than the filter and its rows; at least {least_s} s are wanted"));
        }
        // Beyond the f32 of the wire nothing is forgotten either.
        Ok((seconds < f64::from(f32::MAX)).then_some(span))
    }
}

/// Puts a memory into the device's settings.
pub(crate) fn put_into(settings: &mut Settings, memory: Option<&MemoryConfig<f64>>) {
    settings.memory = match memory {
        None => MemorySettings::Forever,
        Some(MemoryConfig { span: Span::TimeConstant(s), imu_noise: ImuNoise { accel, gyro } }) => {
            MemorySettings::Forgetting {
                time_constant_s: *s as f32,
                accel_noise_mps2: *accel as f32,
                gyro_noise_radps: *gyro as f32,
            }
        }
        Some(MemoryConfig { span: Span::Window(s), .. }) => MemorySettings::Window { length_s: *s as f32 },
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOVING: RowsOf = RowsOf { rate_hz: 1000.0, is_static: false };

    #[test]
    fn what_makes_no_sense_is_refused_with_its_reason() {
        let said = |remember: Forgetting, rows: RowsOf| remember.span(&rows).unwrap_err().to_string();
        let forget = |s| Forgetting { forget: Some(s), window: None };
        let window = |s| Forgetting { forget: None, window: Some(s) };
        for s in [0.0, -3.0, f64::NAN] {
            assert!(said(forget(s), MOVING).contains("positive"));
            assert!(said(window(s), MOVING).starts_with("--window"));
        }
        assert!(said(forget(0.05), MOVING).contains("shorter than the filter"));
        // At 20 readings a second a block is 50 ms long.
        assert!(said(window(0.2), RowsOf { rate_hz: 20.0, ..MOVING }).contains("at least 0.45 s"));
        assert!(said(forget(10.0), RowsOf { is_static: true, ..MOVING }).contains("still poses"));
        assert_eq!(forget(10.0).span(&MOVING).unwrap(), Some(Span::TimeConstant(10.0)));
        assert_eq!(window(10.0).span(&MOVING).unwrap(), Some(Span::Window(10.0)));
        for endless in [forget(f64::INFINITY), window(f64::INFINITY), Forgetting::default()] {
            assert_eq!(endless.span(&MOVING).unwrap(), None);
        }
    }
}

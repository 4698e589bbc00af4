//! What happens to every sample: calibration, alignment, estimator. No I/O, no panic, no heap, no f64.
//!
//! [`sample_path`] is the one entry; the release check looks for its symbol and walks what it can reach.

use rigident_shared::alignment::{Aligner, ImuReading};
use rigident_shared::calibration::{GaugeCalibration, Reading};
use rigident_shared::estimator::{ChannelStatistics, ConfigError, Counters, Estimator, Outcome};
use rigident_shared::factor::InformationFactor;
use rigident_shared::forgetting::MemoryConfig;

use crate::settings::Configuration;

/// Room for the filter: 0.1 s of averages at up to 640 Hz.
const TAPS: usize = 64;
/// Row blocks between two looks at the factor, for the stop rule and for what knocks are known by.
const LOOK_EVERY_BLOCKS: u16 = 50;

/// What a sensor said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Words {
    /// Six gauge voltages and their capture time.
    Gauges {
        /// Capture time, ns.
        time_ns: u64,
        /// Voltages.
        volts: [f32; 6],
    },
    /// An IMU reading.
    Imu(ImuReading<f32>),
    /// A reading that needs no alignment: of a recording.
    Aligned(Reading<f32>),
}

/// A factor of either model.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "no heap")]
pub enum BodyFactor {
    /// The offset is known.
    Ten(InformationFactor<f32, 10>),
    /// The offset is estimated along.
    Sixteen(InformationFactor<f32, 16>),
}

#[derive(Clone)]
#[allow(clippy::large_enum_variant, reason = "no heap")]
enum BodyEstimator {
    Ten(Estimator<f32, 10, TAPS>),
    Sixteen(Estimator<f32, 16, TAPS>),
}

/// Runs `$body` for the estimator of either model.
macro_rules! either {
    ($estimator:expr, $name:ident => $body:expr) => {
        match $estimator {
            BodyEstimator::Ten($name) => $body,
            BodyEstimator::Sixteen($name) => $body,
        }
    };
}

/// The state of the path.
#[derive(Clone)]
pub struct SamplePath {
    gauges: GaugeCalibration<f32>,
    aligner: Aligner<f32>,
    reading: Reading<f32>,
    estimator: BodyEstimator,
    /// Whether readings are absorbed; else they are only aligned.
    absorbing: bool,
    stop: Option<StopLimits>,
    knock_limit: f32,
    /// Row blocks until the next look.
    until_look: u16,
    /// There is something for [`SamplePath::catch_up`].
    behind: bool,
    stop_rule_met: bool,
}

/// The stop rule as standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StopLimits {
    /// Largest standard deviation of each parameter asked for.
    pub(crate) standard_deviation: [Option<f32>; 16],
    /// Not before so many row blocks.
    pub(crate) minimum_blocks: u32,
}

impl SamplePath {
    pub(crate) fn new(configuration: &Configuration) -> Result<Self, ConfigError> {
        let estimator = if configuration.estimates_offset {
            BodyEstimator::Sixteen(Estimator::new(&configuration.estimator)?)
        } else {
            BodyEstimator::Ten(Estimator::new(&configuration.estimator)?)
        };
        Ok(Self {
            gauges: configuration.gauges,
            aligner: Aligner::new(configuration.aligner),
            reading: Reading::default(),
            estimator,
            absorbing: false,
            stop: configuration.stop,
            knock_limit: configuration.knock_limit,
            until_look: LOOK_EVERY_BLOCKS,
            behind: false,
            stop_rule_met: false,
        })
    }

    /// Keeps what this memory keeps instead of everything, and starts anew. Done where the path stays: the fewer
    /// copies of it a stack has to hold the better.
    #[inline(never)]
    pub(crate) fn set_memory(&mut self, memory: &MemoryConfig<f32>) -> Result<(), ConfigError> {
        either!(&mut self.estimator, e => e.set_memory(memory))?;
        self.until_look = self.look_every();
        Ok(())
    }

    /// Row blocks between two looks: a memory is looked at with each of its segments.
    fn look_every(&self) -> u16 {
        either!(&self.estimator, e => e.segment_blocks()).unwrap_or(LOOK_EVERY_BLOCKS)
    }

    pub(crate) fn absorb_from_now_on(&mut self, absorbing: bool) {
        self.absorbing = absorbing;
    }

    pub(crate) fn restart(&mut self) {
        either!(&mut self.estimator, e => e.reset());
        self.aligner.reset();
        (self.until_look, self.behind, self.stop_rule_met) = (self.look_every(), false, false);
    }

    #[inline(never)]
    fn push_gauges(&mut self, time_ns: u64, volts: &[f32; 6]) {
        let wrench = self.gauges.wrench(volts);
        self.aligner.push_wrench(time_ns, wrench);
    }

    /// The reading that was taken last.
    #[inline]
    pub(crate) fn reading(&self) -> &Reading<f32> {
        &self.reading
    }

    /// Whether [`sample_path`] without words has something to do.
    #[inline]
    pub(crate) fn has_more(&self) -> bool {
        self.aligner.is_ready()
    }

    #[inline(never)]
    fn take_aligned(&mut self) -> Option<Outcome> {
        self.reading = self.aligner.pop()?;
        Some(self.absorb())
    }

    #[inline(always)]
    fn absorb(&mut self) -> Outcome {
        if !self.absorbing {
            return Outcome::Pending;
        }
        let outcome = either!(&mut self.estimator, e => e.absorb(&self.reading));
        self.look(outcome);
        outcome
    }

    /// Whether there is something for [`Self::catch_up`]. Asking forgets it.
    #[inline]
    pub(crate) fn take_behind(&mut self) -> bool {
        core::mem::take(&mut self.behind)
    }

    /// A row block is followed by readings that only wait in the filter: with each of these one step of a look at the
    /// factor.
    #[inline]
    fn look(&mut self, outcome: Outcome) {
        match outcome {
            Outcome::Absorbed if self.until_look > 0 => self.until_look -= 1,
            // Where every reading is a row block, none waits.
            Outcome::Absorbed | Outcome::Pending if self.until_look == 0 => self.step(),
            _ => {}
        }
    }

    #[inline(never)]
    fn step(&mut self) {
        if either!(&self.estimator, e => e.remembers()) {
            // A segment that the filter's gaps have delayed is waited for.
            self.behind = either!(&self.estimator, e => e.has_segment());
            self.until_look = if self.behind { self.look_every() } else { 1 };
            return;
        }
        let k = self.knock_limit;
        let met = match &mut self.estimator {
            BodyEstimator::Ten(e) => e.look(k).map(|sd| within(&self.stop, &sd)),
            BodyEstimator::Sixteen(e) => e.look(k).map(|sd| within(&self.stop, &sd)),
        };
        if let Some(met) = met {
            self.until_look = LOOK_EVERY_BLOCKS;
            self.stop_rule_met = met && self.may_stop();
            self.behind = self.stop_rule_met;
        }
    }

    fn may_stop(&self) -> bool {
        self.stop.is_some_and(|stop| self.counters().blocks >= stop.minimum_blocks)
    }

    /// Puts a complete segment into the memory, if not everything is kept: outside the path, for it takes as long as a
    /// solution. Whether every asked-for parameter had its asked-for uncertainty at the last look.
    pub(crate) fn catch_up(&mut self) -> bool {
        let k = self.knock_limit;
        let met = match &mut self.estimator {
            BodyEstimator::Ten(e) => e.remember(k).map(|sd| within(&self.stop, &sd)),
            BodyEstimator::Sixteen(e) => e.remember(k).map(|sd| within(&self.stop, &sd)),
        };
        core::mem::take(&mut self.stop_rule_met) || (met.unwrap_or_default() && self.may_stop())
    }

    pub(crate) fn counters(&self) -> &Counters {
        either!(&self.estimator, e => e.counters())
    }

    pub(crate) fn statistics(&self) -> &ChannelStatistics<f32> {
        either!(&self.estimator, e => e.channel_statistics())
    }

    pub(crate) fn unaligned(&self) -> u32 {
        self.aligner.dropped()
    }

    /// One factor of everything absorbed.
    pub(crate) fn factor(&self) -> BodyFactor {
        match &self.estimator {
            BodyEstimator::Ten(e) => BodyFactor::Ten(e.factor()),
            BodyEstimator::Sixteen(e) => BodyFactor::Sixteen(e.factor()),
        }
    }
}

/// Whether every asked-for parameter has its asked-for uncertainty.
fn within(stop: &Option<StopLimits>, deviations: &[f32]) -> bool {
    let limits = stop.iter().flat_map(|stop| &stop.standard_deviation);
    deviations.iter().zip(limits).all(|(sd, limit)| limit.is_none_or(|limit| *sd <= limit))
}

/// Takes a sensor's words, if any, and the next reading that they completed through the estimator, if any: it is then
/// `SamplePath::reading`. Call it without words while there is more.
// SAFETY: the name is this function's own; no other symbol of the program has it.
#[unsafe(export_name = "rigident_sample_path")]
#[inline(never)]
pub fn sample_path(path: &mut SamplePath, words: Option<&Words>) -> Option<Outcome> {
    match words {
        Some(Words::Gauges { time_ns, volts }) => {
            #[cfg(feature = "plant-double")]
            crate::planted::double(volts[0]);
            #[cfg(feature = "plant-panic")]
            crate::planted::panic(volts, *time_ns as usize);
            path.push_gauges(*time_ns, volts);
        }
        Some(Words::Imu(reading)) => path.aligner.push_imu(reading),
        Some(Words::Aligned(reading)) => {
            path.reading = *reading;
            return Some(path.absorb());
        }
        None => {}
    }
    if path.has_more() { path.take_aligned() } else { None }
}

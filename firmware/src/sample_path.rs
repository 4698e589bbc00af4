//! What happens to every sample: calibration, alignment, estimator. No I/O, no panic, no heap, no f64.
//!
//! [`sample_path`] is the one entry; the release check looks for its symbol and walks what it can reach.

use rigident_shared::alignment::{Aligner, ImuReading, WrenchReading};
use rigident_shared::calibration::{GaugeCalibration, Reading};
use rigident_shared::estimator::{ChannelStatistics, ConfigError, Counters, Estimator, Outcome, Reference};
use rigident_shared::factor::InformationFactor;

use crate::answer::Solved;
use crate::settings::Configuration;

/// Room for the filter: 0.1 s at 2.5 kHz.
const TAPS: usize = 256;

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
    aligned: Option<Reading<f32>>,
    estimator: BodyEstimator,
    /// Whether readings are absorbed; else they are only aligned.
    absorbing: bool,
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
            aligned: None,
            estimator,
            absorbing: false,
        })
    }

    pub(crate) fn absorb_from_now_on(&mut self, absorbing: bool) {
        self.absorbing = absorbing;
    }

    pub(crate) fn restart(&mut self) {
        either!(&mut self.estimator, e => e.reset());
        self.aligner.reset();
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

    /// Gives the solution that innovations are taken against, and that knocks beyond `knock_limit` standard deviations
    /// are known by.
    pub(crate) fn set_reference(&mut self, solved: &Solved, knock_limit: f32) {
        fn of<const N: usize>(solved: &Solved, knock_limit: f32) -> Option<Reference<f32, N>> {
            Some(Reference {
                parameters: *solved.estimate.first_chunk::<N>()?,
                standard_deviation: *solved.standard_deviation.first_chunk::<N>()?,
                noise_scale: 1.0,
                knock_limit,
            })
        }
        match &mut self.estimator {
            BodyEstimator::Ten(e) => of(solved, knock_limit).map(|r| e.set_reference(r)),
            BodyEstimator::Sixteen(e) => of(solved, knock_limit).map(|r| e.set_reference(r)),
        };
    }
}

/// Takes a sensor's words, if any, and the next reading that they completed through the estimator, if any.
/// Call it without words until there is none.
// SAFETY: the name is this function's own; no other symbol of the program has it.
#[unsafe(export_name = "rigident_sample_path")]
#[inline(never)]
pub fn sample_path(path: &mut SamplePath, words: Option<&Words>) -> Option<(Reading<f32>, Outcome)> {
    match words {
        Some(Words::Gauges { time_ns, volts }) => {
            #[cfg(feature = "plant-double")]
            crate::planted::double(volts[0]);
            #[cfg(feature = "plant-panic")]
            crate::planted::panic(volts, *time_ns as usize);
            let wrench = path.gauges.wrench(volts);
            path.aligner.push_wrench(WrenchReading { time_ns: *time_ns, wrench });
        }
        Some(Words::Imu(reading)) => path.aligner.push_imu(*reading),
        Some(Words::Aligned(reading)) => path.aligned = Some(*reading),
        None => {}
    }
    let reading = path.aligned.take().or_else(|| path.aligner.pop())?;
    let outcome =
        if path.absorbing { either!(&mut path.estimator, e => e.absorb(&reading)) } else { Outcome::Pending };
    Some((reading, outcome))
}

use clap::Args;

use crate::commands::run::adaptive::Adaptive;
use crate::commands::run::programme::Programme;
use crate::options::forgetting::Forgetting;
use crate::options::known_values::KnownQuantities;
use crate::options::microcontroller::Mcu;
use crate::options::output::Output;
#[cfg(feature = "simulator")]
use crate::options::own_body::OwnBody;
use crate::options::stop_criterion::StopCriterion;

/// `rigident demo`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Examples:\n  rigident demo\n  rigident demo --mcu qemu --json\n  rigident demo --body \
                        vertical --seed 7 --out answers/demo7\n  rigident demo --until m=0.05,Ixx=0.01 \
                        --estimate m,Ixx\n  rigident demo --adaptive --until-relative 0.01\n  rigident demo \
                        --forget 20\n  rigident demo --plan motion.json\n  rigident demo --mass 3 --com \
                        0,10,50mm --noise 2 --explain\n\nSeveral links:\n  rigident demo --body two-links\n  \
                        rigident demo --body human34 --mcu qemu --duration-s 20"
)]
pub struct Demo {
    /// Where the firmware runs
    #[arg(long, value_enum, default_value_t)]
    pub mcu: Mcu,
    /// What is identified
    #[arg(long, value_enum, default_value_t)]
    pub body: Demonstrated,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub programme: Programme,
    /// Seed of noise and biases
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Noise, bias and bandwidth off; the converters still quantise
    #[arg(long)]
    pub ideal: bool,
    #[cfg(feature = "simulator")]
    #[command(flatten)]
    #[allow(missing_docs)]
    pub own: OwnBody,
    /// Say in ten steps how the readings become the answer, with the numbers of this run
    #[arg(long, conflicts_with = "json")]
    pub explain: bool,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub adaptive: Adaptive,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub stop: StopCriterion,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub forgetting: Forgetting,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub known: KnownQuantities,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub output: Output,
}

/// What a demonstration identifies.
#[derive(clap::ValueEnum, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Demonstrated {
    /// The thesis' test body with plates, lying: centre of mass at 53 mm
    #[default]
    Horizontal,
    /// The same standing: centre of mass at 247 mm
    Vertical,
    /// An arm on a ball joint on that body, an IMU on each: 19 base parameters and the offset, 1 kHz
    TwoLinks,
    /// A person of 15 links and 34 degrees of freedom from frames, 100 a second: 128 base parameters
    #[value(name = "human34")]
    Human34,
}

impl Demo {
    /// Returns what a bare `rigident` does.
    #[cfg(feature = "simulator")]
    pub(crate) fn bare() -> Self {
        #[derive(clap::Parser)]
        struct Alone {
            #[command(flatten)]
            demo: Demo,
        }
        <Alone as clap::Parser>::parse_from(["demo"]).demo
    }
}

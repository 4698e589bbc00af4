use std::path::PathBuf;

use clap::{Args, Subcommand};

use crate::options::test_body::DemoBody;

/// `rigident montecarlo`
#[derive(Args, Debug, Clone)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "Exit status 1 if a parameter's efficiency is below 0.9 or its coverage outside 93-97 % \
                        (with fewer than 2000 runs the limits allow for chance).\n\nExamples:\n  rigident \
                        montecarlo\n  rigident montecarlo --noise gain --runs 500 --json\n  rigident \
                        montecarlo --rate-hz 1000 --mcu inproc --body vertical\n  rigident montecarlo \
                        --accel-noise 0.1 --gyro-noise 0.006 --not-stated\n  rigident montecarlo --model \
                        two-links --runs 200\n  rigident montecarlo --model seven-axes --torques \
                        --rate-noise 0.01"
)]
pub struct Montecarlo {
    /// Another experiment than the default one
    #[command(subcommand)]
    pub what: Option<Repeated>,
    /// Number of experiments
    #[arg(long, default_value_t = 2000, value_name = "R", value_parser = clap::value_parser!(u64).range(2..=1_000_000))]
    pub runs: u64,
    /// Seed of all of them; the figures follow from it on any number of cores
    #[arg(long, default_value_t = 1, value_name = "S", value_parser = clap::value_parser!(u64).range(..=u64::from(u32::MAX)))]
    pub seed: u64,
    /// Length of each experiment, s
    #[arg(long, default_value_t = 20.0, value_name = "S")]
    pub duration_s: f64,
    /// Do this instead of the default experiment: a plan that `rigident plan … --out` wrote for the built-in
    /// platform
    #[arg(long, value_name = "FILE", conflicts_with_all = ["duration_s", "model"])]
    pub plan: Option<PathBuf>,
    /// Rate of the readings, 1/s
    #[arg(long, default_value_t = 200.0, value_name = "HZ")]
    pub rate_hz: f64,
    /// A tree of links in place of the thesis' body: two-links, seven-axes, human34, human58, a URDF, MJCF or
    /// SDF, or a rig file with [[link]] tables. Every joint and the base swing; white noise, by the batch
    /// pipeline
    #[arg(long, value_name = "MODEL", conflicts_with_all = ["body", "noise", "mcu"])]
    pub model: Option<String>,
    /// The thesis' test body with plates, in either of its mountings
    #[arg(long, value_enum, default_value_t)]
    pub body: DemoBody,
    /// How the load cell's uncertainty in the thesis' Table 1 is read
    #[arg(long, value_enum, default_value_t)]
    pub noise: NoiseReading,
    /// Of a tree: torques of revolute joints on a base held still, in place of the wrench on a base that
    /// moves
    #[arg(long, requires = "model")]
    pub torques: bool,
    /// White noise of the accelerometer in place of the thesis', 1 σ a sample, m/s²
    #[arg(long, value_name = "SIGMA", value_parser = sigma, conflicts_with = "torques")]
    pub accel_noise: Option<f64>,
    /// White noise of the gyros in place of the thesis', or of a tree's 1e-4, 1 σ a sample, rad/s
    #[arg(long, value_name = "SIGMA", value_parser = sigma, conflicts_with = "torques")]
    pub gyro_noise: Option<f64>,
    /// White noise of the attitudes of a tree's links, none by default, 1 σ a sample, rad
    #[arg(long, value_name = "SIGMA", value_parser = sigma, requires = "model", conflicts_with = "torques")]
    pub attitude_noise: Option<f64>,
    /// White noise of the positions of joints, none by default, 1 σ a sample, rad
    #[arg(long, value_name = "SIGMA", value_parser = sigma, requires = "torques")]
    pub position_noise: Option<f64>,
    /// White noise of the rates of joints in place of 1e-3, 1 σ a sample, rad/s
    #[arg(long, value_name = "SIGMA", value_parser = sigma, requires = "torques")]
    pub rate_noise: Option<f64>,
    /// Rates of joints are not measured: they are slopes of the positions
    #[arg(long, requires = "torques", conflicts_with = "rate_noise")]
    pub no_rates: bool,
    /// Tell the estimator of no noise: it finds it in the readings
    #[arg(long, conflicts_with = "mcu")]
    pub not_stated: bool,
    /// Who makes the factor
    #[arg(long, value_enum, default_value_t)]
    pub mcu: Estimating,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// Reads a standard deviation.
fn sigma(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|s: &f64| s.is_finite() && *s >= 0.0)
        .ok_or_else(|| "a number, zero or more".to_owned())
}

/// What can be repeated instead.
#[derive(Subcommand, Debug, Clone)]
pub enum Repeated {
    /// Still poses only: the centre of mass by the thesis' estimators and ours, bias and precision errors
    /// apart
    Poses(MontecarloPoses),
    /// The planned motions in both mountings: what was predicted of each against what many experiments find
    Motions(MontecarloMotions),
    /// The tensor in two steps, mass and centre of mass from the poses first, beside one estimate of
    /// everything
    TwoSteps(MontecarloMotions),
}

/// What the 95 % figures of the thesis' Table 1 are taken for.
#[derive(clap::ValueEnum, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NoiseReading {
    /// White noise of each sample, 1.96 σ; the IMU with the thesis' noise and biases
    #[default]
    White,
    /// Gain errors, constant over an experiment, as the share of the range that they are; resolution/√12 as
    /// white noise; a perfect IMU
    Gain,
    /// Both at once, with the thesis' IMU
    Both,
}

/// Who makes the factor in a Monte Carlo.
#[derive(clap::ValueEnum, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Estimating {
    /// The batch pipeline of `rigident identify`, double precision
    #[default]
    Host,
    /// The firmware's estimator, single precision, and its own conclusions
    Inproc,
}

/// `rigident montecarlo motions` and `two-steps`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "The motions are those of `rigident plan compare`, each after its static step, with the \
                        sensors of the thesis.\n\nExamples:\n  rigident montecarlo motions\n  rigident \
                        montecarlo motions --runs 2000 --json\n  rigident montecarlo two-steps"
)]
pub struct MontecarloMotions {
    /// Number of experiments of each motion
    #[arg(long, default_value_t = 100, value_name = "R", value_parser = clap::value_parser!(u64).range(2..=1_000_000))]
    pub runs: u64,
    /// Seed of all of them; the figures follow from it on any number of cores
    #[arg(long, default_value_t = 1, value_name = "S", value_parser = clap::value_parser!(u64).range(..=u64::from(u32::MAX)))]
    pub seed: u64,
    /// Length of each experiment, s
    #[arg(long, default_value_t = 40.0, value_name = "S")]
    pub duration_s: f64,
    /// Rate of the readings, 1/s
    #[arg(long, default_value_t = 200.0, value_name = "HZ")]
    pub rate_hz: f64,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// `rigident montecarlo poses`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Each run draws the load cell's offset once and its noise for every reading (the thesis' \
                        Table 1 / 1.96 for both); both are also tried by themselves. Uncertainties are 99.7 \
                        % (3 standard deviations), in mm.\n\nExamples:\n  rigident montecarlo poses\n  \
                        rigident montecarlo poses --runs 10000 --json\n  rigident montecarlo poses --plot \
                        probability.svg --plot-n 5"
)]
pub struct MontecarloPoses {
    /// Number of experiments of each kind
    #[arg(long, default_value_t = 2500, value_name = "R", value_parser = clap::value_parser!(u64).range(2..=1_000_000))]
    pub runs: u64,
    /// Seed of all of them; the figures follow from it on any number of cores
    #[arg(long, default_value_t = 1, value_name = "S", value_parser = clap::value_parser!(u64).range(..=u64::from(u32::MAX)))]
    pub seed: u64,
    /// Fewest poses
    #[arg(long, default_value_t = 2, value_name = "K")]
    pub from: usize,
    /// Most poses
    #[arg(long, default_value_t = 10, value_name = "K")]
    pub to: usize,
    /// Use only so much of the legs' stroke, about its middle, m
    #[arg(long, value_name = "S")]
    pub stroke_m: Option<f64>,
    /// Write a normal probability plot of the thesis' estimator here, SVG; must not exist
    #[arg(long, value_name = "FILE")]
    pub plot: Option<PathBuf>,
    /// Draw the worst axis' uncertainty over the number of poses here, SVG; must not exist
    #[arg(long, value_name = "FILE")]
    pub plot_over_n: Option<PathBuf>,
    /// Number of poses in the plot
    #[arg(long, default_value_t = 5, value_name = "K", requires = "plot")]
    pub plot_n: usize,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

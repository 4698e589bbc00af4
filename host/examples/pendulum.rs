//! A row source of one's own: a driven pendulum with a load cell at its pivot, from an encoder's angle and
//! rate.
//!
//! With x forwards, z upwards and the angle q from the lower rest, the cell reads, beside its offsets,
//! `F_x = d/dt(ml cos q q̇)`, `F_z = d/dt(ml sin q q̇) + m g` and `M_y = d/dt(J q̇) + ml g sin q`.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rigident::fit::{Channel, Kind, Owner, Parameter, RowSource, SampleRows, Timing};
use rigident_shared::screening::Rejection;

/// Gravity, m/s².
pub const G: f64 = 9.81;

/// A recording: angle and rate (rad, rad/s) and what the cell reads (N, N, N m), at 200 samples a second.
pub struct Pendulum {
    parameters: Vec<Parameter>,
    channels: Vec<Channel>,
    samples: Vec<([f64; 2], [f64; 3])>,
}

impl Pendulum {
    /// Takes the samples of a recording.
    pub fn new(samples: Vec<([f64; 2], [f64; 3])>) -> Self {
        let of = |name: &str, kind, unit| Parameter::new(name, Owner::Link("pendulum".into()), kind, unit);
        // The cell's offset of F_z is known: still or swinging, it adds to the weight.
        let cell = [("fx", "N", 0, Some(3)), ("fz", "N", 0, None), ("my", "N m", 1, Some(4))];
        let mut parameters = vec![
            of("m", Kind::Mass, "kg"),
            of("ml", Kind::FirstMoment, "kg m"),
            of("J", Kind::Inertia, "kg m2"),
        ];
        for (name, unit, ..) in cell.iter().filter(|c| c.3.is_some()) {
            let owner = Owner::Channel((*name).into());
            parameters.push(Parameter::new(format!("offset_{name}"), owner, Kind::Offset, unit));
        }
        let channels = cell.map(|(name, unit, group, offset)| Channel {
            name: name.into(),
            unit: unit.into(),
            sigma: None,
            offset,
            group,
        });
        Self { parameters, channels: channels.to_vec(), samples }
    }
}

impl RowSource for Pendulum {
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }
    fn channels(&self) -> &[Channel] {
        &self.channels
    }
    fn timing(&self) -> Timing {
        Timing::Uniform { rate_hz: 200.0 }
    }
    fn samples(&self) -> usize {
        self.samples.len()
    }
    fn time_ns(&self, sample: usize) -> u64 {
        sample as u64 * 5_000_000
    }
    fn rows(&self, sample: usize, rows: &mut SampleRows) -> Result<(), Rejection> {
        let ([q, rate], measured) = self.samples[sample];
        rows.measured.copy_from_slice(&measured);
        // Columns m, ml, J, then the offsets; a row for each channel.
        rows.smoothed.copy_from_slice(
            &[[0.0, 0.0, 0.0, 1.0, 0.0], [G, 0.0, 0.0, 0.0, 0.0], [0.0, G * q.sin(), 0.0, 0.0, 1.0]].concat(),
        );
        for (at, momentum) in [(1, q.cos() * rate), (6, q.sin() * rate), (12, rate)] {
            rows.differentiated[at] = momentum;
        }
        Ok(())
    }
}

/// Simulates a swing of some seconds of m, ml, J = `body`, with noise of 0.3 N and 0.02 N m and offsets of 1
/// N and 0.3 N m; one sample in its middle is knocked by a force along x, N.
pub fn simulated(body: [f64; 3], seconds: usize, seed: u64, knock: f64) -> Pendulum {
    let [m, ml, j] = body;
    let mut noise = Distribution::<f64>::sample_iter(StandardNormal, ChaCha8Rng::seed_from_u64(seed));
    let samples = (0..200 * seconds).map(|k| {
        let t = k as f64 / 200.0;
        let wave = |w: f64, a: f64| [a * (w * t).sin(), a * w * (w * t).cos(), -a * w * w * (w * t).sin()];
        let (one, two) = (wave(3.1, 0.9), wave(7.3, 0.3));
        let [q, v, a]: [f64; 3] = std::array::from_fn(|i| one[i] + two[i]);
        let mut noisy = |value: f64, sigma: f64| value + sigma * noise.next().unwrap_or(0.0);
        let knocked = if k == 100 * seconds { knock } else { 0.0 };
        let fx = noisy(ml * (q.cos() * a - q.sin() * v * v) + 1.0 + knocked, 0.3);
        let fz = noisy(ml * (q.sin() * a + q.cos() * v * v) + m * G, 0.3);
        let my = noisy(j * a + ml * G * q.sin() + 0.3, 0.02);
        ([q, v], [fx, fz, my])
    });
    Pendulum::new(samples.collect())
}

/// Identifies a simulated pendulum of 2 kg and prints each parameter with its 95 % interval.
#[cfg(not(test))]
fn main() -> Result<(), rigident::fit::FitError> {
    use rigident::fit::{FitOptions, Silent, fit};
    let fit = fit(&simulated([2.0, 0.6, 0.25], 20, 1, 0.0), &FitOptions::default(), &Silent)?;
    for (j, parameter) in fit.parameters.iter().enumerate() {
        match fit.estimate.measured(j) {
            Some(found) => {
                println!("{:12} {:9.4} ± {:.4} {}", parameter.name, found.value, found.u95, parameter.unit)
            }
            None => println!("{:12} not determined by this motion", parameter.name),
        }
    }
    Ok(())
}

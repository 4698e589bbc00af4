use rigident_shared::calibration::ImuMounting;
use rigident_shared::regressor::RegressorBlock;
use rigident_shared::spatial::{AngularRate, Position, SpecificForce};

use super::*;
use crate::body::{BodySource, Input};
use rigident_fit::{FitOptions, Silent, fit};
use rigident_io::rig::ImuTable;

/// Numbers without a pattern in [0, 1).
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() * end as f64) as usize
    }
}

fn config(rate_hz: f64, width_s: f64, row_every: u16) -> EstimatorConfig<f64> {
    EstimatorConfig {
        rate_hz,
        filter_width_s: width_s,
        row_every,
        channel_sigma: [1.0, 1.0, 2.0, 0.1, 0.1, 0.2],
        known_offset: [0.0; 6],
        mounting: ImuMounting { position: Position::new(0.06, -0.04, 0.02), ..ImuMounting::default() },
        limits: Limits { wrench: [50.0; 6], frozen_after: 50, ..Limits::none() },
    }
}

/// Makes a wild motion with a wrench of some body, and the given number of faults of every kind, at any place
/// and of any length up to several times what anything reads back.
fn readings(chance: &mut Chance, count: usize, rate_hz: f64, faults: usize) -> Vec<Reading<f64>> {
    let mut readings: Vec<Reading<f64>> = (0..count)
        .map(|n| {
            let mut vector = |scale: f64| std::array::from_fn(|_| scale * (chance.next() - 0.5));
            Reading {
                time_ns: (n as f64 / rate_hz * 1e9) as u64,
                wrench: {
                    let ([a, b, c], [d, e, f]) = (vector(60.0), vector(6.0));
                    Wrench::from_array([a, b, c, d, e, f])
                },
                specific_force: SpecificForce::from_array(vector(20.0)),
                angular_rate: AngularRate::from_array(vector(4.0)),
            }
        })
        .collect();
    for _ in 0..faults {
        let at = chance.below(count);
        let end = (at + 1 + chance.below(200)).min(count);
        match chance.below(5) {
            0 => readings[at].wrench = Wrench::from_array([f64::NAN; 6]),
            1 => readings[at..end]
                .iter_mut()
                .for_each(|r| r.angular_rate = AngularRate::from_array([f64::INFINITY; 3])),
            2 => readings[at].wrench = Wrench::from_array([1.0, -60.0, 1.0, 1.0, 1.0, 1.0]),
            3 => {
                // One channel is constant.
                let stuck = readings[at].specific_force.array()[1];
                for r in &mut readings[at..end] {
                    let [x, _, z] = r.specific_force.array();
                    r.specific_force = SpecificForce::from_array([x, stuck, z]);
                }
            }
            _ => readings[at..].iter_mut().for_each(|r| r.time_ns += 30_000_000),
        }
    }
    readings
}

type Block = (u64, RegressorBlock<f64>);

/// Estimates in one pass of one estimator over everything.
fn serial(
    readings: &[Reading<f64>],
    config: &EstimatorConfig<f64>,
) -> (InformationFactor<f64, 16>, Counters, Vec<Block>) {
    let mut estimator = Box::new(Estimator::<f64, 16, TAPS>::new(config).unwrap());
    let mut blocks = Vec::new();
    for reading in readings {
        if estimator.absorb(reading) == Outcome::Absorbed {
            blocks.push((reading.time_ns, estimator.last_block().unwrap()));
        }
    }
    (estimator.factor(), *estimator.counters(), blocks)
}

/// Counters and every row block are the same, to the bit; the factor to rounding.
fn compare(readings: &[Reading<f64>], config: &EstimatorConfig<f64>, parts: usize) -> Counters {
    let (factor, counters, blocks) = serial(readings, config);
    let shares = Shares::new(readings, config, Split { parts, threads: 3 }).unwrap();
    let absorbed = shares
        .absorb::<16, Vec<Block>>(config.channel_sigma, Vec::new, |list, reading, estimator| {
            list.push((reading.time_ns, estimator.last_block().unwrap()));
        })
        .unwrap();
    assert_eq!(absorbed.parts.len(), parts);
    assert_eq!(absorbed.counters, counters);
    assert!(
        absorbed.parts.concat() == blocks,
        "{} blocks and {}",
        absorbed.parts.concat().len(),
        blocks.len()
    );
    assert_eq!(absorbed.factor.rows(), factor.rows());
    // RᵀR rather than R, whose rows are arbitrary where the rows leave a direction open.
    let product = |f: &InformationFactor<f64, 16>, i: usize, j: usize| {
        f.r().iter().map(|row| row[i] * row[j]).sum::<f64>()
    };
    for i in 0..16 {
        for j in i..16 {
            // A reflection a block, each a few ε of its column.
            let error = (product(&absorbed.factor, i, j) - product(&factor, i, j)).abs();
            let scale = (product(&factor, i, i) * product(&factor, j, j)).sqrt();
            assert!(error <= 4.0 * f64::EPSILON * (blocks.len() as f64 + 100.0) * scale, "{i} {j}: {error}");
        }
    }
    counters
}

#[test]
fn parts_give_the_blocks_and_counts_of_one_pass() {
    let mut chance = Chance(1);
    let mut seen = Counters::default();
    for round in 0..120 {
        let (rate_hz, width_s, row_every) =
            [(200.0, 0.1, 2), (200.0, 0.1, 3), (1000.0, 0.1, 10), (100.0, 0.1, 1), (500.0, 0.04, 7)]
                [round % 5];
        let faults = chance.below(8);
        let readings = readings(&mut chance, 1500, rate_hz, faults);
        let parts = 2 + chance.below(7);
        let counters = compare(&readings, &config(rate_hz, width_s, row_every), parts);
        add(&mut seen, &counters);
    }
    // All kinds of faults were among them: 0 not finite or saturated, 7 frozen, 9 infinite.
    assert!([0, 1, 7, 9].iter().all(|c| seen.rejected_by_channel[*c] > 0) && seen.gaps > 20, "{seen:?}");
}

#[test]
fn still_poses_are_shared_out_too() {
    let mut chance = Chance(2);
    let mut still = readings(&mut chance, 240, 1.0, 0);
    still.iter_mut().for_each(|r| r.time_ns = 0);
    let config = EstimatorConfig { filter_width_s: 0.0, row_every: 1, ..config(1.0, 0.0, 1) };
    assert!(compare(&still, &config, 7).blocks > 200);
}

#[test]
fn parts_shorter_than_the_filter_are_no_trouble() {
    let mut chance = Chance(3);
    for _ in 0..20 {
        let readings = readings(&mut chance, 400, 1000.0, 2);
        compare(&readings, &config(1000.0, 0.1, 10), 40);
    }
    let none = Shares::new(&[], &config(1000.0, 0.1, 10), Split { parts: 4, threads: 2 }).unwrap();
    assert_eq!(none.absorb::<16, ()>([1.0; 6], || (), |(), _, _| ()).unwrap().counters, Counters::default());
}

#[test]
fn an_impossible_sigma_is_named_whoever_finds_it() {
    let mut chance = Chance(4);
    let readings = readings(&mut chance, 100, 1000.0, 0);
    let mut bad = config(1000.0, 0.1, 10);
    let shares = Shares::new(&readings, &bad, Split { parts: 3, threads: 2 }).unwrap();
    let sigma = [1.0, 1.0, 0.0, 1.0, 1.0, 1.0];
    let refused = shares.absorb::<16, ()>(sigma, || (), |(), _, _| ()).unwrap_err();
    assert_eq!(refused, ConfigError::Sigma(2));
    bad.channel_sigma = sigma;
    assert_eq!(
        Shares::new(&readings, &bad, Split { parts: 3, threads: 2 }).unwrap_err(),
        ConfigError::Sigma(2)
    );
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let mut chance = Chance(5);
    let readings = readings(&mut chance, 3000, 1000.0, 3);
    let config = config(1000.0, 0.1, 10);
    let [one, many] = [1, 8].map(|threads| {
        let shares = Shares::new(&readings, &config, Split { parts: 6, threads }).unwrap();
        shares.absorb::<16, ()>(config.channel_sigma, || (), |(), _, _| ()).unwrap().factor
    });
    assert!(one == many && one.rows() > 0);
    // Parts by the readings alone.
    assert_eq!([10, 39_999, 40_000, 10_000_000].map(|n| Split::of(n).parts), [1, 1, 2, 64]);
}

/// A recording long enough to be cut: what is concluded from it is what one pass concludes.
#[test]
fn a_fit_by_parts_is_that_of_one_pass() {
    let mut chance = Chance(6);
    let config = EstimatorConfig { row_every: 10, ..config(1000.0, rigident_fit::FILTER_WIDTH_S, 10) };
    let input = Input {
        readings: readings(&mut chance, 60_000, 1000.0, 12),
        is_static: false,
        rate_hz: 1000.0,
        mounting: config.mounting,
        channel_sigma: Some(config.channel_sigma),
        gyro_sigma: Some(1e-3),
        known_offset: None,
        nuisances: Vec::new(),
        rests: Vec::new(),
        beforehand: None,
        limits: config.limits,
    };
    assert_eq!(Split::of(input.readings.len()).parts, 3);
    let (factor, counters, blocks) = serial(&input.readings, &config);
    let options = FitOptions { convergence_points: 200, ..FitOptions::default() };
    // Signals without noise: the weights are those of the channels alone, as the pipeline's.
    let exact = ImuTable { accel_noise_mps2: Some(0.0), gyro_noise_radps: Some(0.0), ..ImuTable::default() };
    let found = fit(&BodySource::new(input, Some(&exact)), &options, &Silent).unwrap();
    let counts = &found.counts;
    assert_eq!((counts.samples, counts.rejected), (counters.readings.into(), counters.rejected.into()));
    assert_eq!((counts.gaps, counts.blocks), (counters.gaps.into(), counters.blocks.into()));
    let solution = factor.solve();
    for j in 0..16 {
        let error = (found.estimate.unjudged().values[j] - solution.estimate[j]).abs();
        assert!(error < 1e-9 * solution.standard_deviation[j], "{j}: {error}");
    }
    let times: Vec<f64> = found.residuals.iter().map(|r| r.time_s).collect();
    assert_eq!(times, blocks.iter().map(|b| b.0 as f64 * 1e-9).collect::<Vec<_>>());
    for (residual, (_, block)) in found.residuals.iter().zip(&blocks) {
        let one_pass = rigident_shared::estimator::residual(block, &solution.estimate);
        assert!(residual.values.iter().zip(one_pass).all(|(a, b)| (a - b).abs() < 1e-9));
    }
    // The estimate converges to the answer; its last point before that lacks the blocks since.
    let way = &found.convergence;
    let whole = blocks.len() / 30;
    assert!((whole - 2..=whole + 1).contains(&way.len()), "{} of {whole}", way.len());
    assert!(way.is_sorted_by(|a, b| a.time_s < b.time_s));
    let [.., last, _] = way.as_slice() else { panic!("{}", way.len()) };
    for j in 0..16 {
        let error = (last.parameters[j].unwrap().value - solution.estimate[j]).abs();
        // At most one part in two hundred is missing; the wrench is no body's, so σ is what the residuals
        // say.
        let sd = solution.standard_deviation[j] * found.noise.variance_ratio.sqrt();
        assert!(error < 0.3 * sd, "{j}: {error} of {sd}");
    }
}

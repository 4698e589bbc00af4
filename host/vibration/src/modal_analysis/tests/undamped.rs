//! Dampers out of proportion: the undamped modes of a system are found from those that there are.

use nalgebra::DVector;

use super::support::{NAMES, Normal, System};
use crate::modal_analysis::{FreeDecay, Modes, Options, identify, shapes, undamped};

const RATE_HZ: f64 = 100.0;
const SAMPLES: usize = 4_000;

/// Returns a platform of which one coordinate alone has a damper.
fn system(damper: f64, seed: u64) -> System {
    let mut system = System::new(&[1.3, 1.9, 2.6, 3.5, 4.9, 6.4], &[0.002; 6], seed);
    system.damping[(1, 1)] += damper;
    system
}

/// Returns the modes of a decay with noise of this size, by that of the deflection.
fn modes(system: &System, noise: f64, random: &mut Normal) -> Modes {
    let deflection =
        DVector::from_fn(6, |k, _| 0.01 * (1.0 + 0.2 * k as f64) * if k % 2 == 0 { 1.0 } else { -1.0 });
    let mut samples = system.decay(&deflection, RATE_HZ, SAMPLES);
    samples.iter_mut().for_each(|v| *v += 0.01 * noise * random.next());
    let decay = FreeDecay { rate_hz: RATE_HZ, samples: &samples, names: &NAMES };
    identify(&decay, &Options { modes: Some(6), ..Options::default() }).unwrap()
}

/// Returns the largest errors of frequencies, relative, and of shapes, by their size.
fn off(angular: &[f64], shapes: &[DVector<f64>], system: &System) -> [f64; 2] {
    let (exact, own) = system.modes();
    let mut worst = [0.0_f64; 2];
    for (r, (angular, shape)) in angular.iter().zip(shapes).enumerate() {
        let wanted = own.column(r).normalize();
        let shape = shape.normalize();
        let turned = &wanted * wanted.dot(&shape) - &shape;
        worst = [worst[0].max((angular / exact[r] - 1.0).abs()), worst[1].max(turned.norm())];
    }
    worst
}

#[test]
fn dampers_out_of_proportion_move_no_undamped_mode() {
    for (damper, seed) in [(4.0, 1), (8.0, 2), (16.0, 3)] {
        let system = system(damper, seed);
        let found = modes(&system, 1e-12, &mut Normal::new(seed));
        let shapes_of = |shapes: &crate::modal_analysis::Shapes| -> (Vec<f64>, Vec<DVector<f64>>) {
            shapes.modes.iter().map(|mode| (mode.angular, mode.shape.clone())).unzip()
        };
        let (angular, own) = shapes_of(&found.shapes);
        let as_measured = off(&angular, &own, &system);
        let (angular, own) = shapes_of(&shapes(&undamped(&found.amplitudes).unwrap(), &[]).unwrap());
        let without = off(&angular, &own, &system);
        assert!(
            as_measured[0] > 1e-5 && as_measured[1] > 1e-4,
            "{as_measured:?}: the damper is in proportion"
        );
        assert!(without[0] < 1e-8 && without[1] < 1e-6, "{without:?}, {as_measured:?}");
    }
}

/// The intervals are those of the undamped modes, where a damper moves the measured ones by several standard
/// deviations.
#[test]
fn intervals_of_undamped_modes_hold() {
    let system = system(8.0, 4);
    let (exact, own) = system.modes();
    let (mut squares, mut count, mut before) = (0.0, 0.0, 0.0);
    for seed in 0..60 {
        let found = modes(&system, 3e-3, &mut Normal::new(100 + seed));
        let without = shapes(&undamped(&found.amplitudes).unwrap(), &[]).unwrap();
        for (r, mode) in without.modes.iter().enumerate() {
            let sd = without.covariance[(without.place(r), without.place(r))].sqrt();
            squares += ((mode.angular - exact[r]) / sd).powi(2);
            before += ((found.shapes.modes[r].angular - exact[r]) / found.shapes.modes[r].angular_sd).powi(2);
            count += 1.0;
            // The direction of the shape: what noise moves it by along each axis across it.
            let wanted = own.column(r) * (own.column(r).dot(&mode.shape) / own.column(r).norm_squared());
            let first = without.place(r) + 2;
            for c in 0..6 {
                let sd = without.covariance[(first + c, first + c)].sqrt();
                let scaled = &wanted / wanted.norm();
                squares += ((mode.shape[c] - scaled[c]) / sd).powi(2);
                count += 1.0;
            }
        }
    }
    let (rms, before) = ((squares / count).sqrt(), (before / (60.0 * 6.0)).sqrt());
    assert!(before > 3.0, "{before}: the damper is in proportion");
    assert!((0.85..1.15).contains(&rms), "{rms}");
}

use nalgebra::{Cholesky, SymmetricEigen};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution as _, StandardNormal};

use super::*;
use crate::modal_analysis::Mode;
use crate::suspension::stiffness::stiffness;
use rigident_fit::{Fit, FitOptions, Silent, fit};
use rigident_io::rig::RigFile;
use rigident_rows::body;

const RIG: &str = "[suspension]\nanchor_height_m = -0.05\nat_m = [0.0, 0.0, 0.02]\nbase_position_m = [0.0, \
    0.25, 0.4]\n\
    base_rotation_wxyz = [0.9950041652780258, 0.0, 0.09983341664682815, 0.0]\nstiffness_std = STD\nspring = \
    [{ at_m = [0.5, 0.45, 0.0], axial_npm = 8.5e3, lateral_npm = 1.2e3 }, \
    { at_m = [-0.5, 0.45, 0.0], axial_npm = 8.7e3, lateral_npm = 1.1e3 }, \
    { at_m = [-0.5, -0.45, 0.05], axial_npm = 8.4e3, lateral_npm = 1.0e3 }, \
    { at_m = [0.5, -0.45, 0.0], axis = [0.1, 0.0, 1.0], axial_npm = 8.5e3, lateral_npm = 1.3e3 }]\n";

/// A body of the paper's size about S.
const BODY: [f64; TEN] = [80.817, 0.016, -20.70, -10.22, 9.52, 3.15, 7.72, -2.62, 0.0016, 0.0024];

/// Returns the springs, known to a share; of exact ones everything else is exact, too.
fn support(std: f64) -> Support {
    let exact = "place_std_m = 0.0\naxis_std_rad = 0.0\nanchor_height_std_m = 0.0\nshare_std = 0.0\n";
    let geometry = if std == 0.0 { exact } else { "" };
    let text = RIG.replace("[suspension]\n", &format!("[suspension]\n{geometry}"));
    let rig = RigFile::parse(&text.replace("STD", &std.to_string())).unwrap();
    Support::of(&rig, "test").unwrap()
}

/// Returns the body about O.
fn about_o(support: &Support) -> [f64; TEN] {
    let ten = support.mount.map() * nalgebra::SVector::<f64, TEN>::from(BODY);
    std::array::from_fn(|k| ten[k])
}

/// Returns frequencies and shapes of a body on springs whose stiffness may differ from the stated.
fn modes(support: &Support, stiffness: &Matrix6<f64>, kept: usize) -> Vec<(f64, Vector6<f64>)> {
    let ten = about_o(support);
    let k = stiffness + support.preload.stiffness(&ten);
    // M = L Lᵀ: L⁻¹ K L⁻ᵀ has the squares of the frequencies.
    let l = Cholesky::new(mass_matrix(&ten)).unwrap().l();
    let inverse = l.try_inverse().unwrap();
    let eigen = SymmetricEigen::new(inverse * k * inverse.transpose());
    let mut all: Vec<(f64, Vector6<f64>)> = (0..6)
        .map(|r| {
            (eigen.eigenvalues[r].sqrt(), (inverse.transpose() * eigen.eigenvectors.column(r)).normalize())
        })
        .collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.truncate(kept);
    all
}

/// Returns shapes with noise of these relative sizes; its part along each shape is none.
fn measured(modes: &[(f64, Vector6<f64>)], shape_sd: f64, angular_sd: f64, rng: &mut ChaCha8Rng) -> Shapes {
    let mut covariance = DMatrix::zeros(8 * modes.len(), 8 * modes.len());
    let mut draw = || -> f64 { StandardNormal.sample(rng) };
    let all = modes.iter().enumerate().map(|(r, (angular, shape))| {
        let across = Matrix6::identity() - shape * shape.transpose();
        covariance[(8 * r, 8 * r)] = (angular_sd * angular).powi(2);
        covariance.view_mut((8 * r + 2, 8 * r + 2), (6, 6)).copy_from(&(across * (shape_sd * shape_sd)));
        let noise = across * Vector6::from_fn(|_, _| draw()) * shape_sd;
        Mode {
            angular: angular * (1.0 + angular_sd * draw()),
            angular_sd: angular_sd * angular,
            damping: 0.0,
            damping_sd: 0.0,
            shape: DVector::from_column_slice((shape + noise).normalize().as_slice()),
            amplitudes: DVector::zeros(6),
            imaginary_share: 0.0,
            collinearity: 1.0,
            signal_to_noise: 1.0,
        }
    });
    let modes = all.collect();
    Shapes { modes, covariance }
}

fn found(support: &Support, shapes: Shapes) -> Fit {
    let swing = Swing::of_body(&shapes, Vec::new());
    let source = ModalSource::new(&[swing], support, body::parameters(TEN), 0).unwrap();
    fit(&source, &FitOptions::default(), &Silent).unwrap()
}

fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

#[test]
fn three_exact_modes_give_all_ten_and_two_do_not() {
    let support = support(0.0);
    for kept in [6, 5, 3] {
        let exact = measured(&modes(&support, &support.springs.stiffness(), kept), 1e-9, 1e-9, &mut rng(0));
        let fit = found(&support, exact);
        assert!(fit.estimate.unjudged().determined.iter().all(|d| *d), "{kept}");
        for (own, wanted) in fit.estimate.unjudged().values.iter().zip(BODY) {
            assert!((own - wanted).abs() < 1e-6 * 80.0, "{kept}: {own} {wanted}");
        }
    }
    let two = measured(&modes(&support, &support.springs.stiffness(), 2), 1e-9, 1e-9, &mut rng(0));
    assert!(found(&support, two).estimate.unjudged().determined.iter().any(|d| !*d));
}

/// Returns root mean square of the normed errors, share outside 95 %, and mean of the normed errors, of each
/// parameter.
fn statistics(runs: u64, std: f64, noise: (f64, f64), kept: usize) -> Vec<[f64; 3]> {
    let support = support(std);
    let mut sums = vec![[0.0; 3]; TEN];
    for seed in 0..runs {
        let mut rng = rng(seed);
        let mut k = support.springs.stiffness();
        for (nuisance, by) in support.modal_nuisances().iter().zip(support.modal_changes(&about_o(&support)))
        {
            let drawn: f64 = StandardNormal.sample(&mut rng);
            k += by.stiffness * (nuisance.sigma * drawn);
        }
        let shapes = measured(&modes(&support, &k, kept), noise.0, noise.1, &mut rng);
        let fit = found(&support, shapes);
        let factor = fit.estimate.noise.coverage_factor();
        for (j, sum) in sums.iter_mut().enumerate() {
            let sd = fit.estimate.unjudged().covariance[(j, j)].sqrt();
            let off = (fit.estimate.unjudged().values[j] - BODY[j]) / sd;
            sum[0] += off * off / runs as f64;
            sum[1] += f64::from(u8::from(off.abs() > factor)) / runs as f64;
            sum[2] += off / runs as f64;
        }
    }
    sums
}

#[test]
fn intervals_hold_at_the_rate_they_state() {
    // 400 runs: 5 % outside have a standard deviation of 1.1 %, a mean of normed errors one of 0.05, their
    // variance one of 7 %.
    for (std, kept) in [(0.0, 6), (0.003, 6), (0.003, 5)] {
        for (j, [square, outside, mean]) in statistics(400, std, (1e-3, 1e-4), kept).into_iter().enumerate() {
            assert!((0.01..0.095).contains(&outside), "{std} {kept} {j}: {outside}");
            assert!((0.7..1.35).contains(&square), "{std} {kept} {j}: {square}");
            assert!(mean.abs() < 0.2, "{std} {kept} {j}: {mean}");
        }
    }
}

#[test]
fn weight_that_is_left_out_is_reported() {
    // Springs that carry the weight elsewhere: the modes contradict it, as tilting has another stiffness.
    let support = support(0.0);
    let shapes = measured(&modes(&support, &support.springs.stiffness(), 6), 1e-5, 1e-5, &mut rng(1));
    let higher = RIG.replace("anchor_height_m = -0.05", "anchor_height_m = 0.25").replace("STD", "0.0");
    let wrong = Support::of(&RigFile::parse(&higher).unwrap(), "test").unwrap();
    let fit = found(&wrong, shapes);
    let off = (fit.estimate.unjudged().values[4] - BODY[4]) / BODY[4];
    assert!(off.abs() > 0.02 || fit.noise.variance_ratio > 100.0, "{off} {}", fit.noise.variance_ratio);
}

#[test]
fn a_known_body_tells_the_stiffness_with_intervals_that_hold() {
    let support = support(0.01);
    let table = RigFile::parse(&RIG.replace("STD", "0.01")).unwrap().suspension.unwrap();
    let known = DVector::from_column_slice(&BODY);
    let sd = DMatrix::from_diagonal(&DVector::from_fn(TEN, |k, _| (2e-4 * BODY[k].abs().max(1.0)).powi(2)));
    let (mut outside, mut all) = (0, 0);
    for seed in 0..60 {
        let mut rng = rng(1000 + seed);
        let mut k = support.springs.stiffness();
        for (nuisance, by) in
            support.springs.stiffness_nuisances().iter().zip(support.springs.error_stiffnesses())
        {
            let drawn: f64 = StandardNormal.sample(&mut rng);
            k += by * (nuisance.sigma * drawn);
        }
        let shapes = measured(&modes(&support, &k, 6), 1e-3, 1e-4, &mut rng);
        // What is known of the body is off by its own standard deviation.
        let off = DVector::from_fn(TEN, |j, _| {
            let drawn: f64 = StandardNormal.sample(&mut rng);
            sd[(j, j)].sqrt() * drawn
        });
        let found = stiffness(&table, &support, &Swing::of_body(&shapes, Vec::new()), (&(&known + off), &sd))
            .unwrap();
        for i in 0..6 {
            for j in i..6 {
                all += 1;
                outside += u32::from((found.stiffness[(i, j)] - k[(i, j)]).abs() > 1.96 * found.std[(i, j)]);
            }
        }
    }
    // 5 % of 1260, of which those of a run are not independent.
    let share = f64::from(outside) / f64::from(all);
    assert!((0.02..0.09).contains(&share), "{share}");
    let two = measured(&modes(&support, &support.springs.stiffness(), 2), 1e-3, 1e-4, &mut rng(1));
    assert!(stiffness(&table, &support, &Swing::of_body(&two, Vec::new()), (&known, &sd)).is_none());
}

/// Returns the rests without the body, and with 4 kg, of springs of another stiffness.
fn rested(support: &Support, factor: f64) -> Vec<crate::suspension::rests::Rest> {
    let ten = about_o(support);
    support
        .rests
        .iter()
        .map(|stated| {
            let origin = (Vector3::zeros(), nalgebra::Matrix3::identity());
            let mut rest = stated.against(origin, &[0.0; 6], &support.at_m);
            // Forces carry the whole in both; what is missing or added moves it.
            let (stiffness, by_weight) =
                (support.springs.stiffness() * factor, support.preload.stiffnesses().0);
            let (rows, values) = rest.equations(
                &Vector6::zeros(),
                (support.gravity_mps2, &support.preload),
                (&stiffness, &by_weight),
            );
            let force = rows * SMatrix::<f64, TEN, 1>::from(ten) - values;
            let slope = |k: usize| {
                let (a, b) = rest.equations(
                    &Vector6::ith(k, 1.0),
                    (support.gravity_mps2, &support.preload),
                    (&stiffness, &by_weight),
                );
                b - values - (a - rows) * SMatrix::<f64, TEN, 1>::from(ten)
            };
            let all = Matrix6::from_fn(|i, j| slope(j)[i]);
            rest.change = all.lu().solve(&force).unwrap();
            rest
        })
        .collect()
}

#[test]
fn a_rest_without_the_body_gives_the_mass_that_soft_springs_hide() {
    let rests = "[[suspension.rest]]\nbody = false\nposition_m = [0.0, 0.0, 0.0]\nrotation_wxyz = [1, 0, 0, \
                 0]\n\
                 [[suspension.rest]]\nadded_kg = 4.0\nadded_at_m = [0.2, 0.1, 0.0]\n\
                 position_m = [0.0, 0.0, 0.0]\nrotation_wxyz = [1, 0, 0, 0]\n\
                 [suspension.platform]\nmass_kg = 20.0\ncom_m = [0, 0, 0]\n\
                 inertia_com_kgm2 = [1, 1, 1, 0, 0, 0]\n";
    let text = RIG.replace("STD", "0.03").replace("[suspension]\n", "[suspension]\nstatic_std = 0.001\n");
    let rig = RigFile::parse(&format!("{text}{rests}")).unwrap();
    let support = Support::of(&rig, "test").unwrap();
    let factor = 1.04;
    let stiff = support.springs.stiffness() * factor;
    let shapes = measured(&modes(&support, &stiff, 6), 1e-3, 1e-5, &mut rng(3));
    let of = |rests: Vec<crate::suspension::rests::Rest>| {
        let source =
            ModalSource::new(&[Swing::of_body(&shapes, rests)], &support, body::parameters(TEN), 0).unwrap();
        let found = fit(&source, &FitOptions::default(), &Silent).unwrap();
        let sd = found.estimate.unjudged().covariance[(0, 0)].sqrt();
        (found.estimate.unjudged().values[0] - BODY[0], sd)
    };
    let (rests, springs) = (rested(&support, factor), support.springs.stiffness()[(2, 2)] * factor);
    // 60.8 of 80.8 kg lift it, 4 kg lower it; some tilt with it.
    let lifted = (BODY[0] - 20.0) * 9.80665 / springs;
    assert!((rests[0].change[2] - lifted).abs() < 0.15 * lifted, "{} {lifted}", rests[0].change);
    assert!(rests[1].change[2] < 0.0 && rests[1].change[2] > -0.1 * lifted, "{}", rests[1].change);
    let ((without, sd_without), (with, sd_with)) = (of(Vec::new()), of(rests));
    assert!(without.abs() < 3.0 * sd_without && sd_without > 1.0, "{without} {sd_without}");
    // The body's weight is k d and the whole's k is M ω²: M = 20 kg / (1 − ω² d / g), so that 0.1 mm of d and
    // 0.1 % of what springs differ at rest count three times. Beside it the springs' own 3 %.
    let of_rest = BODY[0] * (1e-4 / lifted).hypot(1e-3) * (BODY[0] - 20.0) / 20.0;
    let both = (of_rest.powi(-2) + sd_without.powi(-2)).powf(-0.5);
    assert!(with.abs() < 3.0 * sd_with && (sd_with / both - 1.0).abs() < 0.1, "{with} {sd_with} {both}");
}

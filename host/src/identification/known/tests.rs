use nalgebra::{SMatrix, SVector};
use rigident_shared::factor::InformationFactor;
use rigident_shared::inertia::{InertialParameters, tensor_elements, tensor_from_elements};
use rigident_shared::spatial::{Position, Sensor};

use super::*;

const COM: [f64; 3] = [0.01, -0.02, 0.053];
const TENSOR: [f64; 6] = [0.38, 0.05, 0.36, 0.01, -0.02, 0.03];

fn truth() -> [f64; 10] {
    InertialParameters::<Sensor, f64>::from_centre_of_mass(
        20.0,
        Position::from_array(COM),
        tensor_from_elements(TENSOR),
    )
    .to_vector()
}

/// Rows of a well-conditioned matrix, exact for `phi`, of σ = `sigma`.
fn data(phi: &[f64; 10], sigma: f64) -> InformationFactor<f64, 10> {
    let mut factor = InformationFactor::new();
    for i in 0..40_u32 {
        let a: [f64; 10] = std::array::from_fn(|j| ((1.7 * f64::from(i) + 1.0) * (j as f64 + 0.6)).sin());
        let y: f64 = a.iter().zip(phi).map(|(a, p)| a * p).sum();
        factor.absorb::<1>(&a.map(|v| [v / sigma]), &[y / sigma]);
    }
    factor
}

fn known(text: &str) -> Known {
    Known::parse(text).unwrap()
}

#[test]
fn a_known_parameter_is_the_bayesian_update_of_the_covariance_form() {
    let factor = data(&truth(), 0.05);
    let mut joint = factor;
    absorb(&mut joint, &[known("mass_kg=20.02±0.01"), known("ixy_kgm2 = -0.0 +- 0.02")], Noise::Given)
        .unwrap();
    // x ← x + K (y − H x), C ← C − K H C: another form of the same update.
    let mut covariance = SMatrix::<f64, 10, 10>::from_fn(|i, j| factor.covariance()[i][j]);
    let mut phi = SVector::<f64, 10>::from(factor.solve().estimate);
    for (j, y, sigma) in [(0, 20.02, 0.01), (9, 0.0, 0.02)] {
        let gain = covariance.column(j) / (covariance[(j, j)] + sigma * sigma);
        phi += gain * (y - phi[j]);
        covariance -= gain * covariance.row(j);
    }
    let solution = joint.solve();
    for j in 0..10 {
        assert!((solution.estimate[j] - phi[j]).abs() < 1e-9 * (1.0 + phi[j].abs()), "{j}");
        let sd = covariance[(j, j)].sqrt();
        assert!((solution.standard_deviation[j] / sd - 1.0).abs() < 1e-9, "{j}");
    }
}

/// What is stated so tightly that the data cannot move it is what comes out, in its own terms.
#[test]
fn a_tight_statement_comes_out_as_it_went_in() {
    let stated = [
        "com_x_m=0.0101±1e-7".to_owned(),
        "com_z_m=0.0529±1e-7".to_owned(),
        "iyy_com_kgm2=0.0502±1e-7".to_owned(),
        "izx_com_kgm2=-0.0201+/-1e-7".to_owned(),
    ];
    let mut factor = data(&truth(), 0.01);
    absorb(&mut factor, &Known::parse_all(&stated, &[]).unwrap(), Noise::Given).unwrap();
    let body = InertialParameters::<Sensor, f64>::from_vector(factor.solve().estimate);
    let (com, tensor) = (body.centre_of_mass().array(), tensor_elements(&body.inertia_com()));
    // The data are 1e4 times less certain than the statements: they move them by a share of σ 1e-7.
    for (got, stated) in [(com[0], 0.0101), (com[2], 0.0529), (tensor[1], 0.0502), (tensor[4], -0.0201)] {
        assert!((got - stated).abs() < 1e-7, "{got} {stated}");
    }
}

#[test]
fn a_plane_of_symmetry_removes_what_crosses_it_and_nothing_else() {
    let mut phi = truth();
    for j in [2, 7, 9] {
        phi[j] = 0.0;
    }
    let loose = data(&phi, 0.05);
    let mut factor = loose;
    let plane = Known::parse_all(&[], &["y±1e-5".to_owned()]).unwrap();
    absorb(&mut factor, &plane, Noise::Given).unwrap();
    let gyration = ((phi[4] + phi[5] + phi[6]) / 40.0).sqrt();
    let sd = factor.solve().standard_deviation;
    for (j, sigma) in [(2, 20.0 * 1e-5), (7, 20.0 * gyration * 1e-5), (9, 20.0 * gyration * 1e-5)] {
        // In parallel with data two hundred times looser.
        assert!((sd[j] / sigma - 1.0).abs() < 1e-3, "{j}: {} {sigma}", sd[j]);
    }
    let before = loose.solve().standard_deviation;
    assert!([8, 1, 3].iter().all(|j| sd[*j] > 0.1 * before[*j]));
    let default = Known::parse_all(&[], &["z".to_owned()]).unwrap();
    assert_eq!(default[0].sigma(), SYMMETRY_SIGMA_M);
}

#[test]
fn the_order_of_statements_does_not_matter() {
    let stated = ["com_y_m=-0.02±0.001", "mass_kg=20±0.01", "ixx_com_kgm2=0.38±0.001"].map(known);
    let mut answers = [[0, 1, 2], [2, 1, 0], [1, 2, 0]].map(|order| {
        let mut factor = data(&truth(), 0.05);
        absorb(&mut factor, &order.map(|i: usize| stated[i]), Noise::Given).unwrap();
        factor.solve().estimate
    });
    let first = answers[0];
    assert!(answers.iter_mut().all(|a| a.iter().zip(first).all(|(a, b)| (a - b).abs() < 1e-12)));
}

/// Two in a million true statements are refused: those beyond 5 σ.
#[test]
fn five_sigma_of_the_joint_uncertainty_and_no_less_is_a_contradiction() {
    let factor = data(&truth(), 0.05);
    let sd = factor.solve().standard_deviation[0];
    let joint = sd.hypot(0.01);
    let state = |deviation: f64| {
        let known = Known { subject: Subject::Parameter(0), value: 20.0 + deviation * joint, sigma: 0.01 };
        absorb(&mut factor.clone(), &[known], Noise::Given)
    };
    assert_eq!((state(4.99), state(-4.99)), (Ok(()), Ok(())));
    for deviation in [5.01, -5.01] {
        let refused = state(deviation);
        let Err(KnownError::Contradiction { found, found_sigma, deviation, .. }) = refused else {
            panic!("{refused:?}")
        };
        assert!((found - 20.0).abs() < 1e-9 && (found_sigma / sd - 1.0).abs() < 1e-9);
        assert!((deviation - 5.01).abs() < 1e-6);
    }
    // Five residuals tell σ so badly that five of their σ are no contradiction.
    let known = Known { subject: Subject::Parameter(0), value: 20.0 + 8.0 * joint, sigma: 0.01 };
    let noise = Noise::Estimated { degrees_of_freedom: 5.0 };
    assert_eq!(absorb(&mut factor.clone(), &[known], noise), Ok(()));
}

#[test]
fn known_quantities_that_contradict_each_other_are_refused_and_nothing_is_absorbed() {
    // Data that say nothing of m, mcx.
    let mut factor = InformationFactor::<f64, 10>::new();
    factor.absorb::<1>(&std::array::from_fn(|j| [f64::from(u8::from(j == 3))]), &[1.0]);
    let before = factor;
    let stated = ["mass_kg=20±0.01", "mcx_kgm=0.2±0.001", "com_x_m=0.02±0.0001"].map(known);
    let refused = absorb(&mut factor, &stated, Noise::Given).unwrap_err();
    assert!(matches!(&refused, KnownError::Contradiction { name, .. } if name == "com_x_m"), "{refused}");
    assert!(refused.to_string().contains("they give 0.010000"), "{refused}");
    assert_eq!(factor, before);
}

#[test]
fn what_cannot_be_used_is_named() {
    let parse = |text: &str| Known::parse(text).unwrap_err();
    for text in ["mass_kg", "mass_kg=20", "mass_kg=x±1", "mass_kg=20±x", "=±", "mass_kg=±1", ""] {
        assert!(matches!(parse(text), KnownError::Form(_) | KnownError::Name { .. }), "{text}");
    }
    for text in ["mass_kg=20±0", "mass_kg=20±-1", "mass_kg=20±NaN", "mass_kg=20±inf"] {
        assert!(matches!(parse(text), KnownError::Sigma { .. }), "{text}");
    }
    for text in ["mass_kg=-1±1", "mass_kg=0±1", "ixx_kgm2=-1±1", "com_x_m=inf±1", "mcx_kgm=NaN±1"] {
        assert!(matches!(parse(text), KnownError::Value { .. }), "{text}");
    }
    for text in ["mass=20±1", "m=20±1", "Mass_kg=20±1", "offset_fx=1±1"] {
        assert!(matches!(parse(text), KnownError::Name { .. }), "{text}");
    }
    let all = |known: &[&str], planes: &[&str]| {
        let owned = |texts: &[&str]| texts.iter().map(|t| (*t).to_owned()).collect::<Vec<_>>();
        Known::parse_all(&owned(known), &owned(planes)).unwrap_err()
    };
    assert!(matches!(all(&["mass_kg=20±0.1", "mass_kg=21±0.1"], &[]), KnownError::Disagree { .. }));
    assert!(matches!(all(&["mass_kg=20±0.1", "mass_kg=20±0.1"], &[]), KnownError::Repeated { .. }));
    assert!(matches!(all(&[], &["y", "y±0.1"]), KnownError::Repeated { .. }));
    assert!(matches!(all(&[], &["w"]), KnownError::SymmetryForm(_)));
    assert!(matches!(all(&[], &["x±0"]), KnownError::Sigma { .. }));

    let mut empty = InformationFactor::<f64, 10>::new();
    let mut absorb = |text: &str| super::absorb(&mut empty, &[known(text)], Noise::Given).unwrap_err();
    assert!(matches!(absorb("offset_fx_n=1±0.1"), KnownError::NoOffset { .. }));
    assert!(matches!(absorb("com_x_m=0.1±0.1"), KnownError::Needs { needs: "the mass", .. }));
    assert!(matches!(check_model(&[known("offset_mz_nm=1±1")], false), Err(KnownError::NoOffset { .. })));
    assert_eq!(check_model(&[known("offset_mz_nm=1±1"), known("mass_kg=1±1")], true), Ok(()));
}

/// Until a row of a known quantity is refused, what it does to the others is exact: a row a thousand times as loose, itself
/// far tighter than the data, gives the same.
#[test]
fn a_sigma_too_small_to_be_held_is_refused_and_the_smallest_that_is_told_spoils_nothing() {
    let factor = data(&truth(), 0.05);
    let with = |text: String| {
        let mut joint = factor;
        absorb(&mut joint, &[known(&text)], Noise::Given).map(|()| joint.solve())
    };
    for (name, value) in [("mass_kg", 20.01), ("com_x_m", 0.0101), ("iyy_com_kgm2", 0.05), ("mcx_kgm", 0.2)] {
        for sigma in ["1e-16", "1e-30", "1e-300"] {
            let refused = with(format!("{name}={value}±{sigma}")).unwrap_err();
            let KnownError::TooTight { least, .. } = refused else { panic!("{refused}") };
            assert!(refused.to_string().contains(&format!("{least:.1e}")), "{refused}");
            let tight = with(format!("{name}={value}±{least:.1e}")).unwrap();
            let loose = with(format!("{name}={value}±{:e}", 1e3 * least)).unwrap();
            for j in 0..10 {
                let change = (tight.estimate[j] - loose.estimate[j]).abs();
                assert!(change < 2e-3 * loose.standard_deviation[j] + 4e3 * least, "{name} {j}: {change}");
                let ratio = tight.standard_deviation[j] / loose.standard_deviation[j];
                assert!(tight.determined[j] && (ratio < 1.0 + 1e-3), "{name} {j}: {ratio}");
            }
        }
    }
}

#[test]
fn numbers_in_refusals_have_the_digits_that_they_need() {
    let error = KnownError::Contradiction {
        name: "mass_kg".to_owned(),
        value: 25.0,
        sigma: 0.01,
        found: 0.936_098_4,
        found_sigma: 0.000_123,
        deviation: 551.84,
    };
    let words = error.to_string();
    assert!(words.contains("25 ± 0.01") && words.contains("0.93610 ± 0.00012 (1 σ), 551.8 σ"), "{words}");
    let error = with_value(1e300);
    assert!(error.len() < 200 && error.contains("1e300"), "{error}");
}

fn with_value(value: f64) -> String {
    Known::parse(&format!("mass_kg={value}±1")).unwrap().to_string()
}

use nalgebra::{DMatrix, DVector};
use rigident_shared::inertia::{InertialParameters, tensor_elements, tensor_from_elements};
use rigident_shared::spatial::{Position, Sensor};

use super::*;
use crate::examples::{Run, body, dense, tree, truth as numbers};
use crate::{Kind, Owner};

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

/// A fit to rows of a well-conditioned matrix, exact for `phi`, of σ = `sigma`.
fn data(phi: &[f64; 10], sigma: f64) -> Fit {
    let a = DMatrix::from_fn(40, 10, |i, j| ((1.7 * i as f64 + 1.0) * (j as f64 + 0.6)).sin() / sigma);
    let y = &a * DVector::from_column_slice(phi);
    let mut run = Run::of(&body()[..10], a, y, 1);
    run.pooled.rounding = 10.0 * f64::EPSILON;
    run.fit()
}

fn stated(known: &[&str], planes: &[&str]) -> Result<KnownValues, KnownError> {
    let owned = |texts: &[&str]| texts.iter().map(|t| (*t).to_owned()).collect::<Vec<_>>();
    KnownValues::parse(&owned(known), &owned(planes))
}

fn applied(fit: &Fit, known: &[&str], planes: &[&str]) -> Result<Fit, KnownError> {
    let mut fit = fit.clone();
    stated(known, planes)?.apply(&mut fit).map(|()| fit)
}

fn sd(fit: &Fit, j: usize) -> f64 {
    fit.estimate.covariance[(j, j)].sqrt()
}

/// x ← x + K (y − H x), C ← C − K H C: another form of the same update.
fn update(phi: &mut DVector<f64>, covariance: &mut DMatrix<f64>, (j, y, sigma): (usize, f64, f64)) {
    let gain = covariance.column(j) / (covariance[(j, j)] + sigma * sigma);
    *phi += &gain * (y - phi[j]);
    *covariance -= &gain * covariance.row(j);
}

#[test]
fn a_known_parameter_is_the_bayesian_update_of_the_covariance_form() {
    let fit = data(&truth(), 0.05);
    let joint = applied(&fit, &["mass_kg=20.02±0.01", "ixy_kgm2 = -0.0 +- 0.02"], &[]).unwrap();
    let mut covariance = fit.estimate.covariance.clone();
    let mut phi = DVector::from_column_slice(&fit.estimate.values);
    for known in [(0, 20.02, 0.01), (9, 0.0, 0.02)] {
        update(&mut phi, &mut covariance, known);
    }
    for j in 0..10 {
        assert!((joint.estimate.values[j] - phi[j]).abs() < 1e-9 * (1.0 + phi[j].abs()), "{j}");
        assert!((sd(&joint, j) / covariance[(j, j)].sqrt() - 1.0).abs() < 1e-9, "{j}");
    }
    let prior = joint.prior.as_ref().unwrap();
    assert_eq!(*prior.data_alone, fit.estimate);
    assert_eq!((prior.statements[1].parameter, prior.statements[0].name.as_str()), (9, "mass_kg"));
    assert_eq!(prior.statements[0].text, "mass_kg = 20.02 ± 0.01 (1 σ)");
    assert_eq!(joint.factor, fit.factor);
    // Once more is the same: the data alone are started from.
    let again = applied(&joint, &["mass_kg=20.02±0.01", "ixy_kgm2 = -0.0 +- 0.02"], &[]).unwrap();
    assert_eq!(again.estimate, joint.estimate);
}

#[test]
fn parameters_of_trees_are_known_by_their_names() {
    for (links, count) in [(1, 25), (6, 60)] {
        let run = Run::new(&tree(links), &numbers(count), 4 * count, 3.0, 1);
        let (mut phi, mut covariance, _) = dense(&run.a, &run.y);
        let truth = numbers(count);
        let place = |name: &str| run.parameters.iter().position(|p| p.name == name).unwrap();
        let known = [("link0.MSx", 0.1), ("base.M", 0.2), ("elbow.viscous", 0.05), ("offset_fx", 0.3)];
        let words: Vec<String> = known
            .iter()
            .map(|(name, sigma)| format!("{name}={}±{sigma}", truth[place(name)] + 0.5 * sigma))
            .collect();
        let mut fit = run.fit();
        KnownValues::parse(&words, &[]).unwrap().apply(&mut fit).unwrap();
        for (name, sigma) in known {
            let j = place(name);
            update(&mut phi, &mut covariance, (j, truth[j] + 0.5 * sigma, sigma));
        }
        let all: Vec<usize> = (0..count).collect();
        assert!(crate::examples::apart(&fit, &all, &phi, &covariance) < 1e-9);
    }
}

/// What is stated of a link whose parameters are separate is what it is of a body.
#[test]
fn a_link_s_centre_and_planes_are_those_of_a_body() {
    let fit = data(&truth(), 0.05);
    let mut arm = fit.clone();
    for parameter in &mut arm.parameters {
        parameter.made_of = vec![(format!("arm.{}", parameter.name), 1.0)];
        parameter.name = format!("arm.{}", parameter.name);
        parameter.owner = Owner::Link("arm".into());
    }
    // A second link in its own columns, so that the link must be named.
    arm.parameters[9].owner = Owner::Link("hand".into());
    arm.parameters[9].name = "hand.Ixy".into();
    arm.parameters[9].made_of.clear();
    let one =
        applied(&fit, &["com_x_m=0.0101±0.0001", "ixx_com_kgm2=0.38±0.001", "izz_kgm2=0.418±0.01"], &[])
            .unwrap();
    let link = ["arm.com_x_m=0.0101±0.0001", "arm.ixx_com_kgm2=0.38±0.001", "arm.izz_kgm2=0.418±0.01"];
    let other = applied(&arm, &link, &[]).unwrap();
    assert_eq!(one.estimate, other.estimate);
    let refused = applied(&arm, &["com_x_m=0.0101±0.0001"], &[]).unwrap_err();
    assert!(matches!(refused, KnownError::Link { links, .. } if links == ["arm", "hand"]));
    let refused = applied(&arm, &[], &["foot:y"]).unwrap_err();
    assert!(matches!(refused, KnownError::Link { name, .. } if name == "symmetry foot:y"));
    // One of the products is not the arm's by itself.
    let refused = applied(&arm, &[], &["arm:y"]).unwrap_err();
    assert!(matches!(refused, KnownError::NotEstimated { needed, .. } if needed == "arm.Ixy"));
    arm.parameters[9].owner = Owner::Link("arm".into());
    arm.parameters[9].made_of = vec![("arm.Ixy".into(), 1.0)];
    let body = applied(&fit, &[], &["z±0.1"]).unwrap();
    assert_eq!(applied(&arm, &[], &["arm:z±0.1"]).unwrap().estimate, body.estimate);
}

/// The rows tell M of the base with the links' masses: the statement on the base's own names the sum.
#[test]
fn a_part_of_a_sum_is_refused_with_the_sum() {
    let fit = Run::new(&tree(1), &numbers(25), 100, 3.0, 1).fit();
    let refused = applied(&fit, &["base.mass_kg=2±0.1"], &[]).unwrap_err();
    let KnownError::Combination { needed, parameter, terms, .. } = &refused else { panic!("{refused}") };
    assert_eq!(
        (needed.as_str(), parameter.as_str(), terms.as_str()),
        ("base.m", "base.M", "base.m + link0.m")
    );
    let refused = applied(&fit, &["link0.com_x_m=0.2±0.1"], &[]).unwrap_err();
    let KnownError::Combination { parameter, .. } = &refused else { panic!("{refused}") };
    assert_eq!(parameter, "base.M");
    let refused = applied(&fit, &["link0.ixx_kgm2=0.2±0.1"], &[]).unwrap_err();
    assert!(
        matches!(&refused, KnownError::Combination { terms, .. } if terms == "link0.Ixx + -1 link0.Iyy"),
        "{refused}"
    );
    let refused = applied(&fit, &["link0.mcz_kgm=0.2±0.1"], &[]).unwrap_err();
    assert!(matches!(refused, KnownError::NotEstimated { needed, .. } if needed == "link0.mcz"));
    let refused = applied(&fit, &[], &["base:y"]).unwrap_err();
    assert!(matches!(refused, KnownError::Combination { needed, .. } if needed == "base.m"));
}

/// What is stated so tightly that the data cannot move it is what comes out, in its own terms.
#[test]
fn a_tight_statement_comes_out_as_it_went_in() {
    let known = [
        "com_x_m=0.0101±1e-7",
        "com_z_m=0.0529±1e-7",
        "iyy_com_kgm2=0.0502±1e-7",
        "izx_com_kgm2=-0.0201+/-1e-7",
    ];
    let fit = applied(&data(&truth(), 0.01), &known, &[]).unwrap();
    let phi: [f64; 10] = fit.estimate.values.clone().try_into().unwrap();
    let body = InertialParameters::<Sensor, f64>::from_vector(phi);
    let (com, tensor) = (body.centre_of_mass().array(), tensor_elements(&body.inertia_com()));
    // The data are 1e4 times less certain than the statements: they move them by a share of σ 1e-7.
    for (got, stated) in [(com[0], 0.0101), (com[2], 0.0529), (tensor[1], 0.0502), (tensor[4], -0.0201)] {
        assert!((got - stated).abs() < 1e-7, "{got} {stated}");
    }
}

#[test]
fn a_plane_of_symmetry_removes_parameters_across_it_alone() {
    let mut phi = truth();
    for j in [2, 7, 9] {
        phi[j] = 0.0;
    }
    let loose = data(&phi, 0.05);
    let tight = applied(&loose, &[], &["y±1e-5"]).unwrap();
    let gyration = ((phi[4] + phi[5] + phi[6]) / 40.0).sqrt();
    for (j, sigma) in [(2, 20.0 * 1e-5), (7, 20.0 * gyration * 1e-5), (9, 20.0 * gyration * 1e-5)] {
        // In parallel with data two hundred times looser.
        assert!((sd(&tight, j) / sigma - 1.0).abs() < 1e-3, "{j}: {} {sigma}", sd(&tight, j));
    }
    assert!([8, 1, 3].iter().all(|j| sd(&tight, *j) > 0.1 * sd(&loose, *j)));
    let default = applied(&data(&truth(), 1.0), &[], &["z"]).unwrap().prior.unwrap();
    assert_eq!((default.statements[0].sigma, default.statements[0].is_symmetry), (SYMMETRY_SIGMA_M, true));
}

/// Without the moments of inertia there is no size, and the products stay free; the fit says which.
#[test]
fn a_plane_without_a_size_leaves_products_free_and_says_so() {
    let mut phi = truth();
    for j in [2, 7, 9] {
        phi[j] = 0.0;
    }
    let mut a = DMatrix::from_fn(40, 10, |i, j| ((1.7 * i as f64 + 1.0) * (j as f64 + 0.6)).sin() / 0.05);
    (4..10).for_each(|j| a.column_mut(j).fill(0.0));
    let y = &a * DVector::from_column_slice(&phi);
    let fit = Run::of(&body()[..10], a, y, 1).fit();
    let free = applied(&fit, &[], &["y"]).unwrap();
    assert_eq!(free.prior.as_ref().unwrap().statements[0].free, [7, 9]);
    assert!(!free.estimate.is_determined(7));
    let sized =
        applied(&fit, &["ixx_kgm2=0.4±0.01", "iyy_kgm2=0.1±0.01", "izz_kgm2=0.4±0.01"], &["y"]).unwrap();
    assert_eq!(sized.prior.as_ref().unwrap().statements[3].free, [0_usize; 0]);
    assert!(
        sized.estimate.is_determined(7)
            && sized.estimate.is_determined(9)
            && !sized.estimate.is_determined(8)
    );
}

#[test]
fn the_order_of_statements_does_not_matter() {
    let known = ["com_y_m=-0.02±0.001", "mass_kg=20±0.01", "ixx_com_kgm2=0.38±0.001"];
    let answers = [[0, 1, 2], [2, 1, 0], [1, 2, 0]].map(|order| {
        let known = order.map(|i: usize| known[i]);
        applied(&data(&truth(), 0.05), &known, &[]).unwrap().estimate.values
    });
    assert!(answers.iter().all(|a| a.iter().zip(&answers[0]).all(|(a, b)| (a - b).abs() < 1e-12)));
}

/// Two in a million true statements are refused: those beyond 5 σ.
#[test]
fn five_sigma_of_the_joint_uncertainty_and_no_less_is_a_contradiction() {
    let fit = data(&truth(), 0.05);
    let joint = sd(&fit, 0).hypot(0.01);
    let state = |fit: &Fit, deviation: f64| {
        applied(fit, &[&format!("mass_kg={:e}±0.01", 20.0 + deviation * joint)], &[])
    };
    assert!(state(&fit, 4.99).is_ok() && state(&fit, -4.99).is_ok());
    for deviation in [5.01, -5.01] {
        let refused = state(&fit, deviation).unwrap_err();
        let KnownError::Contradiction { found, found_sigma, deviation, .. } = refused else {
            panic!("{refused:?}")
        };
        assert!((found - 20.0).abs() < 1e-9 && (found_sigma / sd(&fit, 0) - 1.0).abs() < 1e-9);
        assert!((deviation - 5.01).abs() < 1e-6);
    }
    // Five residuals tell σ so badly that five of their σ are no contradiction.
    let mut few = fit;
    few.estimate.noise = Noise::Estimated { degrees_of_freedom: 5.0 };
    assert!(state(&few, 8.0).is_ok());
}

#[test]
fn known_values_that_contradict_each_other_are_refused_and_nothing_is_absorbed() {
    // Data that say nothing of m, mcx.
    let a = DMatrix::from_fn(1, 10, |_, j| f64::from(u8::from(j == 3)));
    let mut fit = Run::of(&body()[..10], a, DVector::from_element(1, 1.0), 1).fit();
    let before = fit.estimate.clone();
    let known = stated(&["mass_kg=20±0.01", "mcx_kgm=0.2±0.001", "com_x_m=0.02±0.0001"], &[]).unwrap();
    let refused = known.apply(&mut fit).unwrap_err();
    assert!(matches!(&refused, KnownError::Contradiction { name, .. } if name == "com_x_m"), "{refused}");
    assert!(refused.to_string().contains("they give 0.010000"), "{refused}");
    assert_eq!((fit.estimate, fit.prior), (before, None));
}

#[test]
fn unusable_statements_are_named() {
    let parameters = body();
    let one = |text: &str| stated(&[text], &[]).and_then(|known| known.check(&parameters)).unwrap_err();
    for text in ["mass_kg", "mass_kg=20", "mass_kg=x±1", "mass_kg=20±x", "=±", "mass_kg=±1", "", "=1±1"]
    {
        assert!(matches!(one(text), KnownError::Form(_)), "{text}");
    }
    for text in ["mass_kg=20±0", "mass_kg=20±-1", "mass_kg=20±NaN", "mass_kg=20±inf"] {
        assert!(matches!(one(text), KnownError::Sigma { .. }), "{text}");
    }
    for text in [
        "mass_kg=-1±1",
        "mass_kg=0±1",
        "ixx_kgm2=-1±1",
        "com_x_m=inf±1",
        "mcx_kgm=NaN±1",
        "m=-1±1",
        "iyy_com_kgm2=0±1",
    ] {
        assert!(matches!(one(text), KnownError::Value { .. }), "{text}");
    }
    for text in ["mass=20±1", "Mass_kg=20±1", "offset_f=1±1"] {
        assert!(matches!(one(text), KnownError::Name { .. }), "{text}");
    }
    assert!(matches!(one("arm.mass_kg=20±1"), KnownError::Link { .. }));
    let all = |known: &[&str], planes: &[&str]| {
        stated(known, planes).and_then(|k| k.check(&parameters)).unwrap_err()
    };
    assert!(matches!(all(&["mass_kg=20±0.1", "mass_kg=21±0.1"], &[]), KnownError::Disagree { .. }));
    // A parameter is itself by whatever name.
    assert!(matches!(all(&["mass_kg=20±0.1", "m=20±0.1"], &[]), KnownError::Repeated { .. }));
    assert!(matches!(all(&[], &["y", "y±0.1"]), KnownError::Repeated { .. }));
    assert!(matches!(all(&[], &["w"]), KnownError::SymmetryForm(_)));
    assert!(matches!(all(&[], &["x±0"]), KnownError::Sigma { .. }));
    assert_eq!(stated(&["offset_mz_nm=1±1", "mass_kg=1±1"], &["x"]).unwrap().check(&parameters), Ok(()));
    let without = stated(&["offset_mz_nm=1±1"], &[]).unwrap().check(&parameters[..10]);
    assert!(matches!(without, Err(KnownError::NoOffset { .. })));
    // A model without links.
    let pendulum = [Parameter::new("J", Owner::Other("pendulum".into()), Kind::Other, "kg m2")];
    let check = |known: &[&str]| stated(known, &[]).unwrap().check(&pendulum);
    assert_eq!(check(&["J=0.1±0.01"]), Ok(()));
    assert!(matches!(check(&["mass_kg=1±1"]), Err(KnownError::Link { .. })));
    assert!(matches!(check(&["K=1±1"]), Err(KnownError::Name { known, .. }) if known == ["J"]));

    let a = DMatrix::from_fn(1, 10, |_, j| f64::from(u8::from(j == 9)));
    let empty = Run::of(&body()[..10], a, DVector::from_element(1, 1.0), 1).fit();
    let needs = applied(&empty, &["com_x_m=0.1±0.1"], &[]).unwrap_err();
    assert!(matches!(needs, KnownError::Needs { needs: "the mass", .. }));
}

/// Until a row of a known value is refused, what it does to the others is exact: a row a thousand times as
/// loose, itself far tighter than the data, gives the same.
#[test]
fn a_sigma_too_small_to_be_held_is_refused_and_the_smallest_accepted_spoils_nothing() {
    let fit = data(&truth(), 0.05);
    let with = |text: String| applied(&fit, &[&text], &[]);
    for (name, value) in [("mass_kg", 20.01), ("com_x_m", 0.0101), ("iyy_com_kgm2", 0.05), ("mcx_kgm", 0.2)] {
        for sigma in ["1e-16", "1e-30", "1e-300"] {
            let refused = with(format!("{name}={value}±{sigma}")).unwrap_err();
            let KnownError::TooTight { least, .. } = refused else { panic!("{refused}") };
            assert!(refused.to_string().contains(&format!("{least:.1e}")), "{refused}");
            let tight = with(format!("{name}={value}±{least:.1e}")).unwrap();
            let loose = with(format!("{name}={value}±{:e}", 1e3 * least)).unwrap();
            for j in 0..10 {
                let change = (tight.estimate.values[j] - loose.estimate.values[j]).abs();
                assert!(change < 2e-3 * sd(&loose, j) + 4e3 * least, "{name} {j}: {change}");
                let ratio = sd(&tight, j) / sd(&loose, j);
                assert!(tight.estimate.determined[j] && (ratio < 1.0 + 1e-3), "{name} {j}: {ratio}");
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
    let error = KnownError::Value { name: "mass_kg".to_owned(), value: -1e300 }.to_string();
    assert!(error.len() < 200 && error.contains("-1e300"), "{error}");
}

use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use super::*;

const TEXT: &str = "name = \"cylinder\"\nmass_kg = 3.3\nmass_std_kg = 3e-4\n\n[cylinder]\ndiameter_m = 0.07\n\
                    diameter_tolerance_m = 2e-5\nlength_m = 0.11\nlength_tolerance_m = 4e-5\nbore_diameter_m \
                    = 0.01\n\
                    bore_diameter_tolerance_m = 1e-4\n\n[place]\nposition_m = [0.01, 0, 0.012]\n\
                    position_tolerance_m = [5e-5, 5e-5, 2e-5]\nrotation_tolerance_deg = [0.05, 0.05, \
                    0.5]\n\n[[mounting]]\n\
                    name = \"lying\"\nrotation_rpy_deg = [90, 0, 0]\nposition_m = [0, 0, 0.047]\n";

fn cylinder() -> ReferenceBody {
    ReferenceBody::parse(TEXT, "test").unwrap()
}

/// The ten parameters by summing small pieces of a tube that is turned and moved.
fn summed(body: &ReferenceBody, attitude: &Matrix3<f64>, place: &Vector3<f64>) -> [f64; 10] {
    let c = body.cylinder.unwrap();
    let (inner, outer) = (0.5 * c.bore_diameter_m, 0.5 * c.diameter_m);
    let (rings, turns, slices) = (200, 8, 200);
    let mut sum = [0.0; 10];
    let mut volume = 0.0;
    for ring in 0..rings {
        let r = inner + (outer - inner) * (f64::from(ring) + 0.5) / f64::from(rings);
        for step in 0..turns {
            let angle = std::f64::consts::TAU * f64::from(step) / f64::from(turns);
            for slice in 0..slices {
                let z = c.length_m * (f64::from(slice) + 0.5) / f64::from(slices);
                let x = place + attitude * Vector3::new(r * angle.cos(), r * angle.sin(), z);
                let [a, b, c] = [x.x, x.y, x.z];
                let own = [1.0, a, b, c, b * b + c * c, c * c + a * a, a * a + b * b, -b * c, -c * a, -a * b];
                sum.iter_mut().zip(own).for_each(|(sum, own)| *sum += r * own);
                volume += r;
            }
        }
    }
    sum.map(|v| v * body.mass_kg / volume)
}

#[test]
fn a_drawing_gives_the_parameters_of_the_sum_of_its_pieces() {
    let body = cylinder();
    let upright = summed(&body, &Matrix3::identity(), &Vector3::new(0.01, 0.0, 0.012));
    // x stays, y goes to z, z to −y.
    let turned = Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0);
    let lying = summed(&body, &turned, &Vector3::new(0.0, 0.0, 0.047));
    for (mounting, expected) in [("", upright), ("lying", lying)] {
        let mounted = body.mounted(body.mounting(mounting).unwrap());
        for (found, expected) in mounted.parameters.iter().zip(expected) {
            assert!(
                (found - expected).abs() < 2e-5 * expected.abs() + 1e-9,
                "{mounting}: {found} {expected}"
            );
        }
    }
    let Err(ReferenceError::Mounting { known, .. }) = body.mounting("standing") else { panic!() };
    assert_eq!(known, ["lying"]);
}

/// Draws of every dimension spread as the covariance says; a standard deviation of 20 000 draws is known to
/// 0.5 %.
#[test]
fn tolerances_are_propagated_as_draws_spread() {
    let body = cylinder();
    let mounted = body.mounted(None);
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    let mut draw = || -> f64 { StandardNormal.sample(&mut random) };
    let count = 20_000;
    let mut squares = [0.0; 10];
    for _ in 0..count {
        let by: Vec<f64> = mounted.causes.iter().map(|cause| cause.sd * draw()).collect();
        let found = body.parameters(None, &by);
        for ((sum, found), middle) in squares.iter_mut().zip(found).zip(mounted.parameters) {
            *sum += (found - middle).powi(2) / f64::from(count);
        }
    }
    for (j, variance) in squares.iter().enumerate() {
        let stated = mounted.covariance()[(j, j)];
        assert!((variance / stated).sqrt() - 1.0 < 0.025 && (stated / variance).sqrt() - 1.0 < 0.025, "{j}");
    }
    // The mass is weighed, its place along z has the limits of place and length.
    let limit = |a: f64| a / 3.0_f64.sqrt();
    assert!((mounted.covariance()[(0, 0)].sqrt() - 3e-4).abs() < 1e-12);
    let height = 0.012 + 0.055;
    let gyration = 1e-4 * (body.central(&[]).per_mass.trace() / 2.0).sqrt();
    let along = (3.3 * limit(2e-5)).hypot(3.3 * 0.5 * limit(4e-5)).hypot(height * 3e-4).hypot(3.3 * gyration);
    // Tilting moves it in the second order.
    assert!((mounted.covariance()[(3, 3)].sqrt() / along - 1.0).abs() < 1e-6);
}

#[test]
fn faults_of_a_reference_are_named() {
    let refused = |text: &str| ReferenceBody::parse(text, "test").unwrap_err();
    let key = |text: &str| match refused(text) {
        ReferenceError::Value { key, .. } => key,
        error => panic!("{error}"),
    };
    assert_eq!(key(&TEXT.replace("mass_std_kg = 3e-4", "mass_std_kg = -3e-4")), "mass_std_kg");
    assert_eq!(key(&TEXT.replace("mass_kg = 3.3", "mass_kg = nan")), "mass_kg");
    assert_eq!(
        key(&TEXT.replace("bore_diameter_m = 0.01", "bore_diameter_m = 0.08")),
        "cylinder.bore_diameter_m"
    );
    assert_eq!(
        key(&TEXT.replace("= [5e-5, 5e-5, 2e-5]", "= [5e-5, -5e-5, 2e-5]")),
        "place.position_tolerance_m"
    );
    assert_eq!(key(&TEXT.replace("name = \"lying\"", "name = \"\"")), "mounting[0].name");
    assert!(matches!(refused(&TEXT.replace("[cylinder]", "[cylindre]")), ReferenceError::Syntax { .. }));
    let bare = TEXT.split("\n[cylinder]").next().unwrap();
    assert!(matches!(refused(bare), ReferenceError::Shape { count: 0, .. }));
    let both = format!("{TEXT}\n[cuboid]\nsize_m = [0.1, 0.1, 0.1]\nsize_tolerance_m = [0, 0, 0]\n");
    assert!(matches!(refused(&both), ReferenceError::Shape { count: 2, .. }));
    let measured = format!(
        "{bare}\n[measured]\ncom_m = [0, 0, 0.05]\ncom_std_m = [0, 0, 0]\ninertia_com_kgm2 = [1, 1, 3, 0, 0, \
         0]\n\
         inertia_com_std_kgm2 = [0, 0, 0, 0, 0, 0]\n"
    );
    assert_eq!(key(&measured), "measured.inertia_com_kgm2");
}

/// A cuboid of the same numbers, as a drawing and as measured, is the same body.
#[test]
fn a_drawing_and_its_measurement_are_one_body() {
    let head = "name = \"b\"\nmass_kg = 12\nmass_std_kg = 1e-3\n";
    let drawn = format!("{head}[cuboid]\nsize_m = [0.1, 0.2, 0.3]\nsize_tolerance_m = [0, 0, 0]\n");
    let measured = format!(
        "{head}[measured]\ncom_m = [0, 0, 0.15]\ncom_std_m = [0, 0, 0]\ninertia_com_kgm2 = [0.13, 0.1, 0.05, \
         0, 0, 0]\n\
         inertia_com_std_kgm2 = [0, 0, 0, 0, 0, 0]\n"
    );
    let of = |text: &str| ReferenceBody::parse(text, "test").unwrap().mounted(None).parameters;
    for (drawn, measured) in of(&drawn).iter().zip(of(&measured)) {
        assert!((drawn - measured).abs() < 1e-12);
    }
}

/// A place without tolerances is no exact one: its limits are the default's, and that is said.
#[test]
fn a_place_without_tolerances_has_those_of_a_class() {
    let of = |from: &str| {
        let text = TEXT.replace("position_tolerance_m = [5e-5, 5e-5, 2e-5]\n", from);
        let body =
            ReferenceBody::parse(&text.replace("rotation_tolerance_deg = [0.05, 0.05, 0.5]\n", ""), "test");
        body.unwrap()
    };
    let open = of("");
    let sd = |body: &ReferenceBody, cause: &str| {
        body.mounted(None).causes.iter().find(|c| c.name == cause).unwrap().sd
    };
    assert!((sd(&open, "place x") - 3e-4 / 3.0_f64.sqrt()).abs() < 1e-12);
    assert!((sd(&open, "attitude z") - (1.0_f64 / 3.0).to_radians() / 3.0_f64.sqrt()).abs() < 1e-12);
    let said = open.place.assumed().unwrap();
    assert!(said.contains("position_tolerance_m") && said.contains("rotation_tolerance_deg"), "{said}");
    // Zeros that are stated are taken as stated.
    let exact = of("position_tolerance_m = [0, 0, 0]\n");
    assert_eq!(sd(&exact, "place x"), 0.0);
    assert!(!exact.place.assumed().unwrap().contains("position_tolerance_m"));
    assert_eq!(cylinder().place.assumed(), None);
}

//! Full parameters: what the data say is retained, the rest is the nominal model's, and every link is a body.

use nalgebra::Rotation3;
use nalgebra::Vector3;
use rigident_shared::tree::{BaseMotion, Joint, Link};

use super::*;
use crate::problem::{Problem, ProblemOptions};
use rigident_fit::{FitOptions, Silent, fit};
use rigident_laboratory::trees::{two_link_recording, two_links};
use rigident_model::ModelLink;
use rigident_model::base::{Rows, Situation};
use rigident_model::human::Person;
use rigident_model::inertial::in_parent;
use rigident_rows::tree::{BaseSensor, Frame, Input, TreeSource};

/// Another guess: masses, lengths and radii off by some ten per cent.
fn guess(model: &Model, off: f64) -> Model {
    let mut guess = model.clone();
    for (i, link) in guess.links.iter_mut().enumerate() {
        if let Some(phi) = &mut link.nominal {
            let share = 1.0 + off * ((i * 7 + 3) as f64).sin();
            *phi = in_parent(
                &phi.map(|v| v * share),
                &Rotation3::from_euler_angles(0.1 * off, -0.2 * off, 0.3 * off).into_inner(),
                &(Vector3::new(0.02, -0.01, 0.03) * off),
            );
        }
    }
    guess
}

/// Two links in motion: the model, and what of it is identified.
struct Identified {
    model: Model,
    base: BaseParameters,
    fit: Fit,
}

impl Identified {
    fn of(noise: Option<u64>) -> Self {
        let model = two_links();
        let recording = two_link_recording(&model, 200.0, 20.0, noise);
        let problem = Problem::from_recording(&recording, Some(&model), &ProblemOptions::default()).unwrap();
        let fit = problem.fit(&FitOptions::default(), &Silent).unwrap();
        Self { base: problem.tree().unwrap().base().clone(), model, fit }
    }

    /// Returns the full parameters nearest to a nominal model.
    fn nearest(&self, nominal: &Model) -> Full {
        nearest(nominal, &BaseEstimate::of(&self.fit, &self.base), 1.0, false).unwrap()
    }
}

fn all(full: &Full) -> DVector<f64> {
    DVector::from_iterator(10 * full.links.len(), full.links.iter().flat_map(|l| l.parameters))
}

#[test]
fn base_parameters_are_those_identified_and_every_link_is_a_body() {
    for noise in [None, Some(5)] {
        let found = Identified::of(noise);
        let full = found.nearest(&guess(&found.model, 0.4));
        assert!(full.converged);
        // What is identified at U95 u of a scale is drawn to the nominal by no more than some u² of it.
        assert!(full.largest_sd < 0.2 && full.distance_sd < 0.5, "{} {}", full.largest_sd, full.distance_sd);
        for link in &full.links {
            assert_eq!(impossibility(&link.parameters), None, "{}", link.name);
            assert!(link.distance > 0.0 && link.distance.is_finite());
        }
    }
}

#[test]
fn the_truth_as_nominal_model_is_its_own_answer() {
    let found = Identified::of(None);
    let full = found.nearest(&found.model);
    let wanted = DVector::from_vec(found.model.nominal());
    assert!((all(&full) - &wanted).abs().max() < 1e-5 * wanted.abs().max());
    assert!(full.links.iter().all(|l| l.distance < 1e-4));
}

/// An antenna of zero inertia, rounded brackets and a frame of moments without mass, fixed to what moves.
#[test]
fn fixed_links_that_are_no_bodies_by_themselves_block_nothing() {
    let found = Identified::of(None);
    let mut model = found.model.clone();
    let moments = [[0.0; 3], [1e-4, 1e-4, 2.001e-4], [1e-3; 3]];
    let origin = |name: &str| match name {
        "f0" => Vector3::new(0.0, 0.01, 0.05),
        "f1" => Vector3::new(0.02, 0.01, -0.05),
        _ => Vector3::zeros(),
    };
    for (k, (mass, moments)) in [0.1, 0.2, 0.0].into_iter().zip(moments).enumerate() {
        let [x, y, z] = moments;
        let phi = [mass, 0.0, 0.0, 0.0, x, y, z, 0.0, 0.0, 0.0];
        let place = Link {
            parent: 1,
            joint: Joint::Fixed,
            rotation: nalgebra::Matrix3::identity(),
            position: origin(&format!("f{k}")),
        };
        model.links.push(ModelLink::new(format!("f{k}"), format!("j{k}"), place, Some(phi)));
    }
    assert!(model.links[2..].iter().all(|link| impossibility(&link.nominal.unwrap()).is_some()));
    let full = found.nearest(&model);
    let names: Vec<&str> = full.links.iter().map(|link| link.name.as_str()).collect();
    assert_eq!(names[2..], ["f0", "f1"]);
    assert!(full.converged && full.largest_sd < 0.2, "{}", full.largest_sd);
    assert!(full.links.iter().all(|link| impossibility(&link.parameters).is_none()));
    // Where they hang makes no difference to what is identified: first moments of the whole are as without
    // them.
    let whole = |k: usize| -> f64 {
        let own = &full.links[1..];
        own.iter().map(|link| link.parameters[k] + link.parameters[0] * origin(&link.name)[k - 1]).sum()
    };
    let wanted = found.model.links[1].nominal.unwrap();
    for k in 1..4 {
        assert!((whole(k) - wanted[k]).abs() < 1e-3, "{k}: {} {}", whole(k), wanted[k]);
    }
    // Of a body that is none as a whole nothing is taken.
    model.links[1].nominal = Some([1.0, 0.0, 0.0, 0.0, -0.1, 0.1, 0.1, 0.0, 0.0, 0.0]);
    model.links.truncate(2);
    let refused = nearest(&model, &BaseEstimate::of(&found.fit, &found.base), 1.0, false);
    assert!(matches!(refused, Err(ModelError::Structure { .. })));
}

/// Stationary under changes that the data do not see: the projected gradient vanishes there, by differences.
#[test]
fn nothing_that_the_data_allow_is_nearer() {
    let found = Identified::of(Some(2));
    let model = guess(&found.model, 0.3);
    let full = found.nearest(&model);
    let phi = all(&full);
    let null = {
        let map = found.base.map();
        let svd = DMatrix::from_fn(20, 20, |i, j| if i < 19 { map[(i, j)] } else { 0.0 }).svd(false, true);
        let (at, least) = svd.singular_values.argmin();
        assert!(least < 1e-12);
        svd.v_t.unwrap().row(at).transpose()
    };
    let distance = |phi: &DVector<f64>| -> Option<f64> {
        let mut sum = 0.0;
        for (k, link) in model.links.iter().enumerate() {
            let own: Parameters = std::array::from_fn(|i| phi[10 * k + i]);
            sum += divergence(&own, &link.nominal.unwrap())?;
        }
        Some(sum)
    };
    let here = distance(&phi).unwrap();
    for step in [1e-4, -1e-4, 1e-2, -1e-2] {
        assert!(distance(&(&phi + &null * step)).is_none_or(|there| there > here), "{step}");
    }
}

#[test]
fn the_divergence_is_the_distance_s_half_square_and_knows_no_frame() {
    let phi = two_links().links[1].nominal.unwrap();
    let other = phi.map(|v| v * 1.01);
    let d = divergence(&other, &phi).unwrap();
    // J = 1.01 J⁰: four eigenvalues.
    assert!((d - 4.0 * (0.01 - 1.01_f64.ln())).abs() < 1e-15);
    assert!((2.0 * d - 4.0 * 1.01_f64.ln().powi(2)).abs() < 1e-2 * 2.0 * d);
    let (r, p) = (Rotation3::from_euler_angles(0.3, 0.2, 0.1).into_inner(), Vector3::new(0.5, -1.0, 2.0));
    let moved = divergence(&in_parent(&other, &r, &p), &in_parent(&phi, &r, &p)).unwrap();
    assert!((moved - d).abs() < 1e-9, "{moved} {d}");
    // Against its definition, with another root of the matrix.
    let j = |phi: &Parameters| InertialParameters::<Body, f64>::from_vector(*phi).pseudo_inertia();
    let one = two_links().links[0].nominal.unwrap();
    let product: Matrix4<f64> = j(&phi).try_inverse().unwrap() * j(&one);
    let wanted = product.trace() - product.determinant().ln() - 4.0;
    assert!((divergence(&one, &phi).unwrap() - wanted).abs() < 1e-9 * wanted);
    assert_eq!(divergence(&phi.map(|v| -v), &phi), None);
}

#[test]
fn symmetric_people_have_two_sides_alike_and_a_model_without_masses_is_refused() {
    let model = Person::default().human34().unwrap();
    // No motion at all: the weight alone. The rest is the nominal guess.
    let mut moving = rigident_model::rows::Moving::new(model.tree()).unwrap();
    let (coordinates, freedoms) = (moving.coordinates(), moving.freedoms());
    let mut q = vec![0.0; coordinates];
    let mut at = 0;
    for link in model.links.iter().skip(1) {
        if link.link.joint.coordinates() == 4 {
            q[at] = 1.0;
        }
        at += link.link.joint.coordinates();
    }
    let frame = |wrench: [f64; 6]| Frame {
        time_ns: 0,
        positions: q.clone(),
        rates: vec![0.0; freedoms],
        base: BaseMotion::still([0.0, 0.0, -9.80665]),
        wrench,
        efforts: Vec::new(),
        standing: Vec::new(),
        ground: Default::default(),
    };
    moving
        .set(&q, &vec![0.0; freedoms], &vec![0.0; freedoms], &BaseMotion::still([0.0, 0.0, -9.80665]))
        .unwrap();
    let rows = DMatrix::from_row_slice(6, 150, moving.base_rows().unwrap());
    let heavier = rows * DVector::from_vec(model.nominal()) * 1.1;
    let wrench = std::array::from_fn(|k| heavier[k]);
    let input = Input {
        frames: vec![frame(wrench)],
        model: model.clone(),
        is_static: true,
        rate_hz: 1.0,
        base: BaseSensor::Imu([0.0; 3]),
        situation: Situation { floating: true, rows: Rows::Base, mimic: false },
        channel_sigma: Some(vec![0.01; 6]),
        known_offset: Some([0.0; 6]),
        nuisances: Vec::new(),
        errors: Vec::new(),
        drives: Vec::new(),
        as_stated: Vec::new(),
        signals: Vec::new(),
        rate_sigma: 0.0,
        contact: None,
    };
    let source = TreeSource::new(input).unwrap();
    let found = fit(&source, &FitOptions::default(), &Silent).unwrap();
    let found = BaseEstimate::of(&found, source.base());
    let full = nearest(&model, &found, 1.0, true).unwrap();
    assert!(full.converged);
    let mass: f64 = full.links.iter().map(|l| l.parameters[0]).sum();
    assert!((mass - 1.1 * 73.0).abs() < 0.02, "{mass}");
    let of = |name: &str| full.links.iter().find(|l| l.name == name).unwrap().parameters;
    let (left, right) = (of("l_thigh"), of("r_thigh"));
    assert_eq!((left[0], left[1], left[2]), (right[0], right[1], -right[2]));
    assert!((left[7] + right[7]).abs() < 1e-15 && (left[8] - right[8]).abs() < 1e-15);
    let mut bare = model;
    bare.links[3].nominal = None;
    let said = nearest(&bare, &found, 1.0, false).unwrap_err().to_string();
    assert!(said.contains("has no nominal mass"), "{said}");
}

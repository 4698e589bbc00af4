use nalgebra::DMatrix;

use super::*;
use crate::examples::{Run, body, dense, tree, truth};
use crate::{Convergence, Kind, Owner};

fn bare(seed: u64) -> Run {
    Run::new(&body(), &truth(16), 120, 5.0, seed)
}

/// Weights of a body's ten parameters on the base of the tree: its ten.
fn on_base(count: usize) -> DMatrix<f64> {
    DMatrix::from_fn(count, 10, |j, f| f64::from(u8::from(j == f)))
}

/// Oracle: estimates subtract and covariances add.
fn check(total: &Run, fixture: &Run, map: &DMatrix<f64>, kept: &[usize], tared: &Fit) {
    let (estimate, covariance, _) = dense(&total.a, &total.y);
    let (own, own_covariance, _) = dense(&fixture.a, &fixture.y);
    let own = own.select_rows(kept);
    let own_covariance = own_covariance.select_rows(kept).select_columns(kept);
    let expected = estimate - map * own;
    let expected_covariance = covariance + map * own_covariance * map.transpose();
    let all: Vec<usize> = (0..total.parameters.len()).collect();
    assert!(crate::examples::apart(tared, &all, &expected, &expected_covariance) < 1e-9);
}

#[test]
fn a_body_s_fixture_is_taken_off_one_body_and_the_base_of_trees() {
    for parameters in [body(), tree(1), tree(6)] {
        let count = parameters.len();
        let total = Run::new(&parameters, &truth(count), 4 * count, 3.0, 1);
        let fixture = bare(2);
        let mut fit = total.fit();
        let before = fit.factor.clone();
        Tare::new(fixture.pooled.clone()).unwrap().take_off(&mut fit).unwrap();
        check(&total, &fixture, &on_base(count), &(0..10).collect::<Vec<_>>(), &fit);
        assert_eq!(fit.factor, before, "the factor stays that of both");
        assert_eq!(fit.estimate.rank(), count);
    }
}

#[test]
fn a_fixture_on_another_link_goes_where_the_model_s_sums_say() {
    let mut parameters = tree(1);
    // A link on a ball joint: only its mass has gone to the base, at a lever of 0.25 along z.
    parameters.retain(|p| p.owner != Owner::Link("link0".into()));
    for k in 1..10 {
        let base = &parameters[k];
        let name = base.name.replace("base", "link0");
        let made_of = vec![(base.made_of[0].0.replace("base", "link0"), 1.0)];
        let own = Parameter { name, made_of, owner: Owner::Link("link0".into()), ..base.clone() };
        parameters.insert(9 + k, own);
    }
    let count = parameters.len();
    let total = Run::new(&parameters, &truth(count), 4 * count, 3.0, 1);
    let fixture = bare(2);
    let map = DMatrix::from_fn(count, 10, |j, f| match (j, f) {
        (0, 0) => 1.0,
        (3, 0) => 0.25,
        _ => f64::from(u8::from(f > 0 && j == 9 + f)),
    });
    let mut fit = total.fit();
    Tare::new(fixture.pooled.clone()).unwrap().on_link("link0").take_off(&mut fit).unwrap();
    check(&total, &fixture, &map, &(0..10).collect::<Vec<_>>(), &fit);
}

/// A run of the bare tree: what adds is taken off parameter by parameter, frictions and offsets are the run's
/// own.
#[test]
fn a_fixture_of_the_same_tree_is_taken_off_parameter_by_parameter() {
    let parameters = tree(6);
    let [total, fixture] = [1, 2].map(|seed| Run::new(&parameters, &truth(60), 200, 3.0, seed));
    let mut fit = total.fit();
    let tare = Tare::new(fixture.pooled.clone()).unwrap();
    assert_eq!(tare.fit().parameters.len(), 52);
    tare.take_off(&mut fit).unwrap();
    let map = DMatrix::from_fn(60, 52, |j, f| f64::from(u8::from(j == f)));
    check(&total, &fixture, &map, &(0..52).collect::<Vec<_>>(), &fit);
}

#[test]
fn convergence_is_that_of_the_body_alone() {
    let total = Run::new(&body(), &truth(16), 100, 3.0, 1);
    let mut fit = total.fit();
    let both = Measured { value: 5.0, u95: 0.3 };
    fit.convergence = vec![Convergence { time_s: 1.0, parameters: vec![Some(both); 16] }];
    fit.convergence[0].parameters[4] = None;
    let tare = Tare::new(bare(2).pooled).unwrap();
    let fixture = tare.fit().estimate.measured(0).unwrap();
    tare.take_off(&mut fit).unwrap();
    let point = &fit.convergence[0].parameters;
    let mass = point[0].unwrap();
    assert!((mass.value - (5.0 - fixture.value)).abs() < 1e-12);
    assert!((mass.u95 - 0.3_f64.hypot(fixture.u95)).abs() < 1e-12);
    assert_eq!((point[4], point[12]), (None, Some(both)));
}

/// What the fixture's runs do not determine is not known of the body either.
#[test]
fn parameters_unknown_of_the_fixture_are_unknown_of_the_body() {
    let mut still = bare(2);
    // Still poses: no column of the tensor.
    (4..10).for_each(|j| still.a.column_mut(j).fill(0.0));
    let fixture = Run::of(&body(), still.a, still.y, 2);
    let mut fit = Run::new(&body(), &truth(16), 100, 3.0, 1).fit();
    Tare::new(fixture.pooled).unwrap().take_off(&mut fit).unwrap();
    for j in 0..16 {
        assert_eq!(fit.estimate.is_determined(j), !(4..10).contains(&j), "{j}");
    }
    assert!(fit.estimate.condition_number < 1e3);
}

#[test]
fn an_impossible_tare_is_refused_by_kind_and_changes_nothing() {
    let total = Run::new(&tree(1), &truth(25), 100, 3.0, 1);
    let refuse = |tare: Tare| {
        let mut fit = total.fit();
        let before = fit.estimate.clone();
        let error = tare.take_off(&mut fit).unwrap_err();
        assert_eq!(fit.estimate, before);
        error
    };
    let tare = Tare::new(bare(1).pooled).unwrap();
    assert!(matches!(refuse(tare), TareError::Repeated { .. }));
    let tare = Tare::new(bare(2).pooled).unwrap();
    assert!(
        matches!(refuse(tare.clone().on_link("leg")), TareError::Link { links, .. } if links == ["base", "link0"])
    );
    // The made-up tree says nothing of where mcz of its link goes.
    let TareError::Missing { missing, link, .. } = refuse(tare.on_link("link0")) else { panic!() };
    assert_eq!((missing, link), (vec!["link0.mcz".to_owned()], "link0".to_owned()));
    let other = Run::new(&tree(2), &truth(32), 100, 3.0, 3);
    let TareError::Model { difference, .. } = refuse(Tare::new(other.pooled).unwrap()) else { panic!() };
    assert!(
        difference.foreign.contains(&"link1.MSx".to_owned()) && difference.changed == ["base.M", "base.MSz"]
    );
    let friction = bare(2).pooled.only(|p| p.kind == Kind::Offset);
    assert!(matches!(Tare::new(friction), Err(TareError::NotInertial { .. })));
}

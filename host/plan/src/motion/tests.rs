use std::sync::atomic::AtomicBool;

use super::super::information::PARAMETERS;
use super::*;
use crate::study_length::runs;

fn task(objective: Objective) -> Task {
    Task { objective, duration_s: 24.0, starts: 2, rate_hz: 200.0, ..Task::new(Equipment::thesis_vertical()) }
}

fn made(task: &Task) -> MotionPlan {
    plan(task, &AtomicBool::new(false), |_| ()).unwrap()
}

/// Returns the coefficients of a lively motion.
fn some(problem: &Problem) -> Vec<f64> {
    (0..problem.family.len()).map(|k| 0.35 * (2.3 * k as f64 + 0.7).sin()).collect()
}

/// Central differences of fourth order; both parts of the cost by themselves.
#[test]
fn the_gradient_is_that_of_finite_differences() {
    let mut task = task(Objective::DOptimal);
    task.equipment.payload.load_cell.position_m = [0.02, -0.03, 0.05];
    task.equipment.payload.load_cell.rotation_wxyz = [0.9, 0.1, -0.3, 0.2];
    task.equipment.geometry.limits.leg_acceleration_mps2 = Some(30.0);
    task.equipment.geometry.leg_rate_mps = 3.0;
    task.rate_radps = 9.0;
    task.equipment.wrench_range_n_nm = [3000.0, 3000.0, 3000.0, 900.0, 900.0, 900.0];
    // The second repeats a period.
    for (duration_s, weight) in [(10.0, 0.0), (10.0, 10.0), (64.0, 0.0)] {
        let frame = Frame::bare(&task.equipment.geometry, duration_s).unwrap();
        let problem = problem(&task, &frame, 1.0);
        let z = some(&problem);
        let (_, gradient, log) = problem.cost(&z, weight).unwrap();
        assert!(log.is_finite());
        let largest = gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
        for k in (0..z.len()).step_by(5) {
            let at = |by: f64| {
                let mut z = z.clone();
                z[k] += by;
                problem.cost(&z, weight).unwrap().0
            };
            let h = 1e-3;
            let slope = (8.0 * (at(h) - at(-h)) - at(2.0 * h) + at(-2.0 * h)) / (12.0 * h);
            assert!((slope - gradient[k]).abs() < 1e-6 * largest, "{weight} {k}: {slope} {}", gradient[k]);
        }
    }
}

/// A machine without joints: the same, in steps that are small beside where a share changes its sign.
#[test]
fn the_gradient_of_a_travel_is_that_of_finite_differences() {
    for together in [false, true] {
        let mut task = task(Objective::DOptimal);
        task.equipment.geometry = hexapod::Geometry::of_travel(hexapod::Travel {
            shift_m: [0.9, 0.8, 0.7],
            turn_rad: [1.4, 1.5, 1.3],
            together,
            speed_mps: Some(3.0),
            rate_radps: Some(8.0),
        });
        task.rate_radps = 9.0;
        task.equipment.wrench_range_n_nm = [3000.0, 3000.0, 3000.0, 900.0, 900.0, 900.0];
        let frame = Frame::bare(&task.equipment.geometry, 10.0).unwrap();
        let problem = problem(&task, &frame, 1.0);
        let z: Vec<f64> = some(&problem).iter().map(|v| 0.4 * v).collect();
        let (_, gradient, _) = problem.cost(&z, 10.0).unwrap();
        let largest = gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
        for k in (0..z.len()).step_by(5) {
            let at = |by: f64| {
                let mut z = z.clone();
                z[k] += by;
                problem.cost(&z, 10.0).unwrap().0
            };
            let h = 2e-5;
            let slope = (8.0 * (at(h) - at(-h)) - at(2.0 * h) + at(-2.0 * h)) / (12.0 * h);
            assert!((slope - gradient[k]).abs() < 1e-5 * largest, "{together} {k}: {slope} {}", gradient[k]);
        }
    }
}

/// A plan for a machine without joints keeps its travel, and the checks of another program say so, too.
#[test]
fn a_motion_of_a_machine_without_joints_keeps_its_travel() {
    for together in [false, true] {
        let mut task = task(Objective::DOptimal);
        let ranges = [0.06, 0.05, 0.04, 0.25, 0.25, 0.4];
        let [x, y, z, roll, pitch, yaw] = ranges;
        let (shift_m, turn_rad) = ([x, y, z], [roll, pitch, yaw]);
        let travel =
            hexapod::Travel { shift_m, turn_rad, together, speed_mps: Some(0.2), rate_radps: Some(0.9) };
        task.equipment.geometry = hexapod::Geometry::of_travel(travel);
        let plan = made(&task);
        assert!(plan.guarantee.is_kept());
        let trajectory = plan.program.trajectory().unwrap();
        let mut most = [0.0_f64; 3];
        for k in 0..=(trajectory.duration_s() * 1000.0) as usize {
            let state = trajectory.state(k as f64 * 1e-3);
            let pose = state.pose();
            let shares = pose.coordinates().into_iter().zip(ranges).map(|(v, range)| v.abs() / range);
            let share = if together { shares.fold(0.0, f64::max) } else { shares.sum() };
            let used = [share, state.velocity.norm() / 0.2, state.angular_rate.norm() / 0.9];
            most.iter_mut().zip(used).for_each(|(most, used)| *most = most.max(used));
        }
        assert!(most.iter().all(|used| *used <= 1.0), "{most:?}");
        assert!(most.iter().any(|used| *used > 0.95), "{most:?}");
    }
}

/// Every instant of the long motion, one after the other, and what the platform does then.
#[test]
fn a_long_motion_tells_as_much_as_its_repeated_period() {
    let task = task(Objective::DOptimal);
    let step = step_s(task.highest_hz);
    let frame = Frame::bare(&task.equipment.geometry, 64.0).unwrap();
    let problem = problem(&task, &frame, 1.0);
    let z = some(&problem);
    let period_s = PERIODS[5] / task.highest_hz;
    let long = Family::new(&frame.home(), frame.motion_s, 1.0, &PERIODS.map(|n| n / period_s), step);
    let motion = frame.around(problem.family.segment(&z, 1.0)).trajectory().unwrap();
    assert!((motion.duration_s() - 64.0).abs() < 1e-9);
    let mut all = Information::zeros();
    for k in 0..long.instants() {
        let coordinates = long.coordinates(&z, k);
        let driven = motion.coordinates(frame.begin_s + k as f64 * step);
        assert!((0..6).all(|i| (coordinates.value[i] - driven.value[i]).abs() < 1e-9), "{k}");
        problem.instrument.add(&coordinates.plate_state(), 1.0, &mut all);
    }
    let mut once = Information::zeros();
    assert!(2 * problem.family.instants() < long.instants());
    for k in 0..problem.family.instants() {
        let state = problem.family.coordinates(&z, k).plate_state();
        problem.instrument.add(&state, problem.family.times(k), &mut once);
    }
    for i in 0..PARAMETERS {
        for j in i..PARAMETERS {
            let scale = (all[(i, i)] * all[(j, j)]).sqrt();
            assert!((all[(i, j)] - once[(i, j)]).abs() < 1e-9 * scale, "{i} {j}");
        }
    }
}

/// Another way to the information: wrenches of unit bodies by the simulator's mechanics, every reading.
#[cfg(feature = "simulator")]
#[test]
fn the_information_is_the_inverse_of_the_bound() {
    let task = task(Objective::Multisine);
    let frame = Frame::bare(&task.equipment.geometry, 12.0).unwrap();
    let problem = problem(&task, &frame, 1.0);
    let z: Vec<f64> = some(&problem).iter().map(|v| 0.3 * v).collect();
    let mut information = problem.beforehand;
    for k in 0..problem.family.instants() {
        let state = problem.family.coordinates(&z, k).plate_state();
        problem.instrument.add(&state, problem.family.times(k), &mut information);
    }
    let (_, covariance) = super::super::information::log_determinant(&information).unwrap();
    let program = frame.around(problem.family.segment(&z, 1.0));
    // A plan takes the motion as known.
    let mut config = rigident_sim::rig::RigConfig::thesis_vertical();
    config.sensors.imu = rigident_sim::sensors::SensorModels::ideal().imu;
    let bound = rigident_study::bound(&config, &program, 200.0).unwrap().unwrap();
    for j in 0..10 {
        // The grid and the readings differ by an instant at either end: 1 in 500.
        let ratio = covariance[(j, j)] / bound[(j, j)];
        assert!((ratio - 1.0).abs() < 0.01, "{j}: {ratio}");
    }
}

#[test]
fn every_objective_keeps_every_limit_and_the_search_beats_them_all() {
    let worst = |objective| {
        let plan = made(&task(objective));
        assert!(plan.guarantee.is_kept(), "{objective:?}: {:?}", plan.guarantee);
        let trajectory = plan.program.trajectory().unwrap();
        assert!((trajectory.duration_s() - 24.0).abs() < 1e-9);
        Equipment::thesis_vertical().geometry.check(&trajectory).unwrap();
        plan.prediction.inertia_com_kgm2.into_iter().fold(0.0, f64::max)
    };
    let best = worst(Objective::DOptimal);
    for other in [Objective::Spheres, Objective::RollPitchYaw, Objective::Multisine] {
        let other_worst = worst(other);
        assert!(best < 0.9 * other_worst, "{other:?}: {best} {other_worst}");
    }
}

#[test]
fn the_same_task_gives_the_same_plan() {
    let task = Task { starts: 2, duration_s: 10.0, poses: false, ..task(Objective::DOptimal) };
    assert_eq!(made(&task).program, made(&task).program);
}

/// The centre of mass of a sphere's load feels gravity and nothing else, so that the force on the cell is the
/// weight.
#[test]
fn spheres_keep_the_inertial_forces_off_the_load_cell() {
    let mut task = task(Objective::Spheres);
    task.poses = false;
    task.equipment.payload.load_cell.position_m = [0.02, -0.03, 0.05];
    let plan = made(&task);
    let trajectory = plan.program.trajectory().unwrap();
    let [from, to] = plan.motion_s;
    let weight = task.equipment.payload.body.mass_kg * task.equipment.payload.gravity_mps2;
    let body = task.equipment.load();
    for k in 0..200 {
        let state = trajectory.state(from + (to - from) * f64::from(k) / 200.0);
        let [x, y, z, ..] = body.wrench(&state);
        assert!(x.abs() < 1e-9 * weight && y.abs() < 1e-9 * weight, "{x} {y}");
        assert!((z / weight - 1.0).abs() < 1e-9, "{z}");
    }
    let [rate, acceleration] = super::super::coverage::of_motion(&trajectory, from, to);
    assert!(rate > 0.9 && acceleration > 0.7, "{rate} {acceleration}");
}

#[test]
fn impossible_plans_are_reported() {
    let error = |task: &Task| plan(task, &AtomicBool::new(false), |_| ()).unwrap_err();
    let short = Task { duration_s: 8.0, ..task(Objective::RollPitchYaw) };
    assert!(matches!(error(&short), PlanError::Frame(FrameError::TooShort { .. })));
    let mut slow = task(Objective::Multisine);
    slow.rate_radps = 0.2;
    assert!(matches!(error(&slow), PlanError::Rate(_)));
    let mut heavy = task(Objective::RollPitchYaw);
    heavy.equipment.payload.body.mass_kg = 2000.0;
    assert!(matches!(error(&heavy), PlanError::Sensors(_)));
    let mut weak = Task { poses: false, ..task(Objective::RollPitchYaw) };
    weak.equipment.geometry.limits.leg_force_n = Some(10.0);
    let text = error(&weak).to_string();
    assert!(text.contains("would carry") && text.contains("its limit is 10.0 N"), "{text}");
}

/// A speed gives the moves more time, a weight smaller tilts; with neither there is no plan.
#[test]
fn weak_and_slow_legs_get_a_static_step_that_suits_them() {
    let limited = |force: Option<f64>, rate: f64| {
        let objective = Objective::RollPitchYaw;
        let mut task = Task { duration_s: 600.0, objective, ..Task::new(Equipment::thesis_horizontal()) };
        task.equipment.geometry.limits.leg_force_n = force;
        task.equipment.geometry.leg_rate_mps = rate;
        plan(&task, &AtomicBool::new(false), |_| ())
    };
    let limits = [(Some(60.0), 0.8), (Some(90.0), 0.8), (None, 0.02), (None, 0.005), (Some(60.0), 0.01)];
    for (force, rate) in limits.into_iter().step_by(runs(1, 4) as usize) {
        let plan = limited(force, rate).unwrap_or_else(|e| panic!("{force:?} {rate}: {e}"));
        assert!(plan.guarantee.is_kept() && (plan.program.duration_s() - 600.0).abs() < 1e-6);
    }
    let error = limited(Some(10.0), 0.8).unwrap_err().to_string();
    assert!(error.contains("cannot stand level at home") && error.contains("37.6 N"), "{error}");
}

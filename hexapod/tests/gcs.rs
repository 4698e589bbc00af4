//! GCS 2.0 as the vendor publishes it: `vectors/gcs.py` says where, and makes `vectors/gcs.json` anew.

use std::collections::BTreeMap;

use hexapod::gcs::{self, GcsPosition, error};
use hexapod::{Geometry, Pose};
use serde::Deserialize;

#[derive(Deserialize)]
struct Recorded {
    base_joints_m: [[f64; 3]; 6],
    platform_joints_m: [[f64; 3]; 6],
    reference_m: [f64; 3],
    vectors: Vec<Vector>,
    lines: BTreeMap<String, String>,
    answers: Vec<Answer>,
    errors: BTreeMap<String, u16>,
}

/// A position of the H-811.I2: the vendor's line for it, and where the vendor's kinematic chain puts the
/// platform.
#[derive(Deserialize)]
struct Vector {
    position_mm_deg: [f64; 6],
    line: String,
    origin_m: [f64; 3],
    rotation: [[f64; 3]; 3],
    leg_length_m: [f64; 6],
}

#[derive(Deserialize)]
struct Answer {
    text: String,
    values: [f64; 6],
}

fn recorded() -> Recorded {
    serde_json::from_str(include_str!("vectors/gcs.json")).expect("recorded vectors")
}

fn arguments(line: &str) -> Vec<&str> {
    line.split_whitespace().skip(1).collect()
}

fn assert_near(got: f64, want: f64, tolerance: f64, what: &str) {
    assert!((got - want).abs() < tolerance, "{what}: {got} {want}");
}

#[test]
fn positions_are_where_the_vendors_kinematic_chain_puts_the_platform() {
    let all = recorded();
    let reference = Pose { position_m: all.reference_m, rpy_rad: [0.0; 3] };
    let machine = Geometry {
        base_joints_m: all.base_joints_m,
        plate_joints_m: all.platform_joints_m,
        ..Geometry::thesis()
    };
    assert!(all.vectors.len() > 20);
    for vector in all.vectors {
        let mut position = GcsPosition::default();
        for (axis, value) in gcs::read_pairs(&arguments(&vector.line)).unwrap() {
            position.0[gcs::axis_number(axis).unwrap()] = value;
        }
        // The client prints twelve digits, the positions have fewer.
        assert_eq!(position.0, vector.position_mm_deg);
        let pose = position.pose(&reference);
        for k in 0..3 {
            assert_near(pose.position_m[k], vector.origin_m[k], 1e-15, &vector.line);
            for l in 0..3 {
                // An angle read back from its arc sine at 50° to 65° loses a digit.
                assert_near(pose.rotation()[k][l], vector.rotation[k][l], 2e-15, &vector.line);
            }
        }
        for (got, want) in machine.leg_lengths(&pose).iter().zip(vector.leg_length_m) {
            assert_near(*got, want, 1e-15, &vector.line);
        }
        let chain = Pose { rpy_rad: rpy(&vector.rotation), position_m: vector.origin_m };
        for (got, want) in GcsPosition::of(&chain, &reference).0.iter().zip(vector.position_mm_deg) {
            // mm from metres, degrees from radians.
            assert_near(*got, want, 2e-13, &vector.line);
        }
    }
}

/// Returns roll, pitch, yaw of a matrix by nalgebra, whose convention is `Rz Ry Rx` too.
fn rpy(rows: &[[f64; 3]; 3]) -> [f64; 3] {
    let matrix = nalgebra::Matrix3::from_fn(|i, j| rows[i][j]);
    let (roll, pitch, yaw) = nalgebra::Rotation3::from_matrix_unchecked(matrix).euler_angles();
    [roll, pitch, yaw]
}

/// The order U, V, W about axes that go with the platform, as MS202E 3.7 says it, and no other one.
#[test]
fn no_other_order_of_the_rotations_has_the_vendors_attitudes() {
    let all = recorded();
    let about = |axis: usize, degrees: f64| {
        let axis = nalgebra::Vector3::ith_axis(axis);
        nalgebra::Rotation3::from_axis_angle(&axis, degrees.to_radians())
    };
    for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        let worst = all.vectors.iter().fold(0.0_f64, |worst, vector| {
            let [a, b, c] = order.map(|k| about(k, vector.position_mm_deg[3 + k]));
            let product = a * b * c;
            (0..9).fold(worst, |w, k| w.max((product[(k / 3, k % 3)] - vector.rotation[k / 3][k % 3]).abs()))
        });
        assert_eq!(worst < 1e-15, order == [0, 1, 2], "{order:?}: {worst}");
    }
}

#[test]
fn answers_are_read_as_the_vendors_client_reads_them() {
    for Answer { text, values } in recorded().answers {
        assert_eq!(GcsPosition::read_answer(&text), Some(GcsPosition(values)), "{text}");
        assert!(gcs::is_whole_answer(text.as_bytes()));
        let first = text.find('\n').unwrap() + 1;
        assert!(!gcs::is_whole_answer(&text.as_bytes()[..first]), "{text}");
    }
    let values = [1.5, -2.25, 3.125, -7.0, 9.5, -13.0];
    let lines = gcs::AXES.iter().zip(values).map(|(axis, value)| format!("{axis}={value:.6}"));
    assert_eq!(gcs::answer(lines), recorded().answers[0].text);
    assert_eq!(GcsPosition::read_answer("X=1 \nY=2 \nZ=3 \nU=4 \nV=5\n"), None);
    assert_eq!(GcsPosition::read_answer("X=1 \nY=2 \nZ=3 \nU=4 \nV=5 \nW=nan\n"), None);
}

#[test]
fn commands_are_those_of_the_vendors_client() {
    let lines = recorded().lines;
    let line = |name: &str| lines[name].clone();
    let byte = |value: u8| char::from(value).to_string();
    assert_eq!(line("stop"), byte(gcs::STOP));
    assert_eq!(line("moving"), byte(gcs::MOVING));
    assert_eq!(line("ready"), byte(gcs::IS_READY));
    assert_eq!(line("source"), format!("SPA X {} 1\n", gcs::PATH_SOURCE));
    assert_eq!(line("threshold"), format!("SPA X {} 20\n", gcs::PATH_THRESHOLD));
    assert_eq!(gcs::read_pairs(&arguments(&line("servo"))).unwrap().len(), 6);
    assert_eq!(gcs::read_pairs(&arguments(&line("reachable"))), Ok(vec![("X", 5.0), ("U", 2.0)]));
    // Ours has six digits behind the point, theirs as many as there are.
    let command = GcsPosition([1.5, -2.25, 3.125, -7.0, 9.5, -13.0]).command("MOV");
    assert_eq!(command, "MOV X 1.500000 Y -2.250000 Z 3.125000 U -7.000000 V 9.500000 W -13.000000");
    assert!(command.len() < gcs::LINE_BYTES);
    let theirs = &recorded().vectors.into_iter().find(|v| v.position_mm_deg[0] == 1.5).unwrap().line;
    assert_eq!(gcs::read_pairs(&arguments(theirs)), gcs::read_pairs(&arguments(&command)));
}

#[test]
fn words_that_are_no_pairs_are_refused() {
    assert_eq!(gcs::read_pairs(&[]), Err(error::PARAMETER_COUNT));
    assert_eq!(gcs::read_pairs(&["X", "1", "Y"]), Err(error::PARAMETER_COUNT));
    assert_eq!(gcs::read_pairs(&["X", "inf"]), Err(error::NUMBER));
}

#[test]
fn errors_have_the_vendors_numbers() {
    let ours = [
        ("PARAM_SYNTAX", error::SYNTAX),
        ("UNKNOWN_COMMAND", error::UNKNOWN_COMMAND),
        ("COMMAND_TOO_LONG", error::TOO_LONG),
        ("MOVE_WITHOUT_REF_OR_NO_SERVO", error::NOT_ALLOWED),
        ("POS_OUT_OF_LIMITS", error::POSITION),
        ("VEL_OUT_OF_LIMITS", error::VELOCITY),
        ("STOP", error::STOPPED),
        ("INVALID_AXIS_IDENTIFIER", error::AXIS),
        ("PARAM_OUT_OF_RANGE", error::RANGE),
        ("PARAM_NR", error::PARAMETER_COUNT),
        ("INVALID_REAL_NR", error::NUMBER),
        ("DYNAMIC_MOVE_IN_PROCESS", error::IN_MOTION),
        ("UNKNOWN_PARAMETER", error::UNKNOWN_PARAMETER),
        ("READ_ONLY_PARAMETER", error::READ_ONLY),
        ("INTERPOLATION_FIFO_UNDERRUN", error::UNDERRUN),
    ];
    let ours: BTreeMap<String, u16> = ours.map(|(name, number)| (name.to_owned(), number)).into();
    assert_eq!(ours, recorded().errors);
}

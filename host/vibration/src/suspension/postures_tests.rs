use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, Vector3};

use super::*;
use crate::suspension::posture_file::PosturesFile;
use crate::suspension::posture_sets::Subset;
use rigident_fit::Factor;

/// Table 1 of the vibration paper: mass, centre of mass, tensor about it (xx, yy, zz, yz, zx, xy).
const LINK_0: (f64, [f64; 3], [f64; 6]) =
    (65.921, [0.0, -0.3072, -0.1152], [1.8506, 1.4892, 1.4157, -0.1659, -0.0024, -0.0081]);
const LINK_1: (f64, [f64; 3], [f64; 6]) =
    (14.896, [0.0, 0.0217, -0.1747], [0.0774, 0.1020, 0.0458, 0.0041, 0.0, 0.0]);

/// Table 3: what the paper finds, in the order MS0, MS1, J0 yz zx xy, J1 yz zx xy, J0 xx−yy, zz−yy, J1 the
/// same, ΣJyy.
const TABLE_3: [f64; 17] = [
    0.0599, -20.2678, -7.6113, -0.0177, 0.3212, -2.6268, -2.5027, 0.0121, 0.0192, 0.0519, -0.0087, -0.0052,
    6.6079, 5.2583, -0.0238, -0.5064, 2.9315,
];

fn text() -> String {
    std::fs::read_to_string(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../docs/examples/two-link-postures.toml"
    ))
    .unwrap()
}

fn paper() -> PosturesFile {
    toml::from_str(&text()).unwrap()
}

/// Returns the 17 of Φ_s of base parameters M, MS0, J0 (xx yy zz yz zx xy), MS1, J1.
fn subset(phi: &[f64]) -> [f64; 17] {
    let (j0, ms1, j1) = (&phi[4..10], &phi[10..13], &phi[13..19]);
    [
        phi[1],
        phi[2],
        phi[3],
        ms1[0],
        ms1[1],
        ms1[2],
        j0[3],
        j0[4],
        j0[5],
        j1[3],
        j1[4],
        j1[5],
        j0[0] - j0[1],
        j0[2] - j0[1],
        j1[0] - j1[1],
        j1[2] - j1[1],
        j0[1] + j1[1],
    ]
}

/// First moment and tensor.
type Moments = (Vector3<f64>, Matrix3<f64>);

fn least_squares(rows: &DMatrix<f64>, values: &DVector<f64>) -> Vec<f64> {
    rows.clone().svd(true, true).solve(values, 1e-9).unwrap().iter().copied().collect()
}

#[test]
fn table_1_gives_the_reference_row_of_table_4() {
    // M0, J0 xx yy zz yz zx xy, MS0; J1 and MS1: the paper's Cal., which holds to what its centres of mass
    // were rounded to.
    let file = paper();
    let source = PostureSource::new(&file, "the paper").unwrap();
    let ten = |(m, c, i): (f64, [f64; 3], [f64; 6])| {
        InertialParameters::<Body, f64>::from_centre_of_mass(
            m,
            Position::from_array(c),
            tensor_from_elements(i),
        )
        .to_vector()
    };
    let standard: Vec<f64> = [ten(LINK_0), ten(LINK_1)].concat();
    let phi = source.base().map() * DVector::from_vec(standard);
    let cal = [
        80.817, 0.0031, -20.2502, -7.5935, 8.9460, 2.3639, 7.6364, -2.4986, -0.0020, -0.0072, 0.0013, 0.3234,
        -2.6017, 0.5388, 0.5564, 0.0528, 0.0606, 0.0003, 0.0,
    ];
    let limit = |k: usize| match k {
        0 => 1e-9,
        1..4 => 65.921 * 5e-5,
        10..13 => 14.896 * 1e-4,
        _ => 1e-3,
    };
    for (k, (own, printed)) in phi.iter().zip(cal).enumerate() {
        assert!((own - printed).abs() <= limit(k), "{k}: {own} {printed}");
    }
}

#[test]
fn table_2_gives_table_3() {
    let source = PostureSource::new(&paper(), "the paper").unwrap();
    let (mut rows, mut values) = (DMatrix::zeros(30, 19), DVector::zeros(30));
    for k in 0..3 {
        let (columns, own) = source.of_posture(k).unwrap();
        rows.view_mut((10 * k, 0), (10, 19)).copy_from(columns);
        values.rows_mut(10 * k, 10).copy_from_slice(own);
    }
    let found = subset(&least_squares(&rows, &values));
    let worst = found.iter().zip(TABLE_3).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst < 0.006, "{worst}");
}

/// The paper's own rows, written out as it does: `−M0 S(s)` on the left, the products with s on the right,
/// Eq. 10's combinations.
#[test]
fn the_paper_s_form_gives_its_golden_least_squares() {
    let file = paper();
    let columns = |tensor: &dyn Fn(&[f64; 18]) -> Moments| {
        let column = |k: usize| {
            let mut unit = [0.0; 18];
            unit[k] = 1.0;
            let (ms, i) = tensor(&unit);
            eq_10(&ms, &i)
        };
        DMatrix::from_fn(9, 18, |i, k| column(k)[i])
    };
    let (mut rows, mut values) = (DMatrix::zeros(27, 18), DVector::zeros(27));
    for (n, posture) in file.posture.iter().enumerate() {
        let JointStand::Matrix(r) = &posture.joint["arm"] else { panic!() };
        let r = Matrix3::from_fn(|i, j| r[i][j]);
        let (m, s) = (posture.mass_kg, Vector3::from(posture.com_m));
        let sx = s.cross_matrix();
        let right = |phi: &[f64; 18]| {
            let three = |at: usize| Vector3::new(phi[at], phi[at + 1], phi[at + 2]);
            let six = |at: usize| tensor_from_elements(std::array::from_fn(|k| phi[at + k]));
            let ms = three(0) + r * three(9);
            let crossed = sx.transpose() * ms.cross_matrix();
            (ms, six(3) + r * six(12) * r.transpose() - crossed - crossed.transpose())
        };
        let left = tensor_from_elements(posture.inertia_com_kgm2) - sx.transpose() * sx * m;
        rows.view_mut((9 * n, 0), (9, 18)).copy_from(&columns(&right));
        values.rows_mut(9 * n, 9).copy_from(&eq_10(&(s * m), &left));
    }
    // Rotations as printed are so little off orthonormal that the 18th direction is no more than rounding.
    let found = rows.svd(true, true).solve(&values, 1e-3).unwrap();
    let found = subset(&[&[80.817], found.as_slice()].concat());
    let golden = [
        0.0570, -20.2641, -7.6148, -0.0166, 0.3185, -2.6238, -2.5017, 0.0129, 0.0179, 0.0534, -0.0071,
        -0.0064, 6.5962, 5.2455, -0.0117, -0.4942, 2.9278,
    ];
    for (k, (own, golden)) in found.iter().zip(golden).enumerate() {
        assert!((own - golden).abs() < 1e-4, "{k}: {own} {golden}");
    }
}

fn eq_10(ms: &Vector3<f64>, i: &Matrix3<f64>) -> DVector<f64> {
    let (xx, yy, zz, xy, zx, yz) = (i.m11, i.m22, i.m33, i.m12, i.m13, i.m23);
    DVector::from_vec(vec![ms.x, ms.y, ms.z, yy, xx - yy, xx - zz, xy - zx, zx - yz, xy + zx])
}

#[test]
fn random_postures_have_the_rank_of_the_theory() {
    // n links on spherical joints, in a chain and in a star: 8 (n + 1) + 1 besides the mass.
    for (n, star) in [(1, false), (2, false), (2, true), (3, false), (4, true)] {
        let mut text = "[[link]]\nname = \"base\"\n".to_owned();
        for k in 1..=n {
            let parent = if k == 1 || star { "base".to_owned() } else { format!("link{}", k - 1) };
            text += &format!(
                "[[link]]\nname = \"link{k}\"\nparent = \"{parent}\"\njoint = \"spherical\"\nposition_m = \
                 [0.05, 0.3, 0.{k}]\n"
            );
        }
        let file: PosturesFile = toml::from_str(&text).unwrap();
        let model = rig_links::from_tables(&file.link, "test").unwrap();
        let tree = TreeSource::new(Input::tracked(model.clone(), Vec::new(), 1.0)).unwrap();
        let mut moving = Moving::new(model.tree()).unwrap();
        let mut ranks = Vec::new();
        let mut all = DMatrix::zeros(0, tree.parameters().len());
        for k in 0..7 {
            let turn = |j: usize| {
                Rotation3::from_euler_angles(
                    (1 + k + 7 * j) as f64,
                    (2 + 3 * k) as f64 * 0.7,
                    (k * k + j) as f64,
                )
            };
            let positions: Vec<f64> = (0..n).flat_map(|j| quaternion(&turn(j).into_inner())).collect();
            let rows = base_columns(tree.base(), &composite(&mut moving, &positions).unwrap());
            let at = all.nrows();
            all = all.insert_rows(at, TEN, 0.0);
            all.view_mut((at, 0), (TEN, rows.ncols())).copy_from(&rows);
            ranks.push(all.clone().svd(false, false).rank(1e-9));
        }
        // The mass is one more than the paper's count.
        assert_eq!(ranks[6], 8 * (n + 1) + 1 + 1, "{n} {star}: {ranks:?}");
        if n == 1 {
            assert_eq!(ranks[..4], [10, 16, 18, 18]);
        }
    }
}

#[test]
fn faults_of_a_posture_are_named() {
    let refuse = |text: &str| {
        let file: PosturesFile = toml::from_str(text).unwrap();
        match PostureSource::new(&file, "f.toml") {
            Err(SuspensionError::Posture { why, .. }) => why,
            Err(other) => other.to_string(),
            Ok(_) => panic!("accepted"),
        }
    };
    let good = text();
    assert!(
        refuse(&good.replacen("arm = [[0.9999, 0.0071", "arm = [[0.9999, 0.5071", 1)).contains("no rotation")
    );
    assert!(
        refuse(&good.replacen("inertia_com_kgm2 = [2.9221", "inertia_com_kgm2 = [22.9221", 1))
            .contains("no distribution")
    );
    assert!(refuse(&good.replacen("mass_kg = 80.817", "mass_kg = -80.817", 1)).contains("greater than zero"));
    assert!(refuse(&good.replacen("[posture.joint]\narm", "[posture.joint]\nleg", 1)).contains("leg"));
    assert!(refuse(&format!("mass_std_kg = 0.1\n{good}")).contains("together"));
}

#[test]
fn rounding_in_the_rows_leaves_the_postures_values() {
    let source = PostureSource::new(&paper(), "the paper").unwrap();
    let mut found = source.pooled().fit();
    let subset = Subset::new(source.parameters(), source.model());
    let before = subset.values(&found);
    let rows = found.scaled_factor();
    let rounded = rows.entries().into_iter().enumerate();
    let rounded: Vec<f64> =
        rounded.map(|(k, entry)| entry * (1.0 + 1e-12 * (k as f64 * 0.7).sin())).collect();
    found.solved = Factor::from_entries(rows.parameters(), &rounded, rows.rows());
    for (a, b) in before.iter().zip(subset.values(&found)) {
        let (a, b) = (a.measured.unwrap(), b.measured.unwrap());
        assert!(
            (a.value - b.value).abs() < 1e-6 * a.u95 && (a.u95 - b.u95).abs() < 1e-6 * a.u95,
            "{a:?} {b:?}"
        );
    }
}

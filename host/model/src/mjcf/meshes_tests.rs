//! Bodies whose inertias MuJoCo's compiler makes, against those of MuJoCo 4.0.0 (`body_mass`, `body_ipos`,
//! `body_inertia`).

use std::path::Path;

use crate::inertial::Parameters;
use crate::{Model, mjcf, read_file};

/// A wedge whose roof is bent, with faces of four corners, and a flap that encloses nothing.
const WEDGE: &str = "# wedge\nv 0 0 0\nv 0.3 0 0\nv 0.3 0.2 0\nv 0 0.2 0\nv 0.02 0.01 0.11\nv 0.28 0.02 \
                     0.17\n\
                     v 0.27 0.19 0.12\nv 0.01 0.18 0.19\nv 0.4 0.1 0.05\nf 4 3 2 1\nf 5/1 6/2 7/3 8/4\nf 1 2 \
                     6 5\n\
                     f -8 -7 -3 -4\nf 3 4 8 7\nf 4//1 1//1 5//1 8//1\nf 3 9 7\n";

/// Checks the parameters of a link: m, mc, then I about the origin: xx, yy, zz, yz, xz, xy.
#[track_caller]
fn check(model: &Model, link: &str, wanted: Parameters) {
    let own = model.links.iter().find(|own| own.name == link).unwrap();
    let found = own.nominal.unwrap_or_else(|| panic!("{:?}", model.findings));
    let size = wanted.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    for (own, mujoco) in found.iter().zip(wanted) {
        // Vertices have numbers of four bytes.
        assert!((own - mujoco).abs() < 1e-7 * size, "{found:?}\n{wanted:?}");
    }
}

fn one(folder: &Path, compiler: &str, before: &str, inside: &str) -> Model {
    let path = folder.join("model.xml");
    let text = format!(
        "<mujoco><compiler {compiler}/>{before}<worldbody><body name=\"b\" pos=\"0.3 0.1 \
         -0.2\"><joint/>{inside}</body></worldbody></mujoco>"
    );
    std::fs::write(&path, text).unwrap();
    read_file(&path).unwrap().0
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("parts")).unwrap();
    std::fs::write(folder.path().join("parts/w.obj"), WEDGE).unwrap();
    folder
}

#[test]
fn meshes_weigh_as_in_mujoco() {
    let folder = folder();
    let mesh = |attributes: &str| format!("<asset><mesh name=\"w\" {attributes}/></asset>");
    let plain = "<geom type=\"mesh\" mesh=\"w\"/>";
    for (asset, geom, wanted) in [
        (
            "file=\"w.obj\" scale=\"1 2 -1\" refpos=\"0.1 0 0\" refquat=\"0.8 0.6 0 0\"",
            "<geom type=\"mesh\" mesh=\"w\" pos=\"0.1 0.2 0.3\" euler=\"10 20 30\"/>",
            [
                15.135_348_597_2,
                1.297_479_803_35,
                5.577_826_396_56,
                6.409_238_062_02,
                4.927_453_391_05,
                2.989_059_933_17,
                2.367_546_292_23,
                -2.380_818_578_26,
                -0.522_063_490_347,
                -0.486_078_114_975,
            ],
        ),
        (
            "file=\"w.obj\"",
            "<geom type=\"mesh\" mesh=\"w\" mass=\"2\"/>",
            [
                2.0,
                0.309_580_909_91,
                0.208_945_804_388,
                0.131_457_709_074,
                0.039_620_890_469_1,
                0.074_548_136_828_9,
                0.090_439_181_527,
                -0.013_910_408_194_8,
                -0.019_934_243_798_2,
                -0.032_290_832_498_2,
            ],
        ),
        (
            "file=\"w.obj\" inertia=\"shell\"",
            plain,
            [
                256.192_313_158,
                39.171_370_383_8,
                26.683_061_341_5,
                17.316_000_739_5,
                5.985_441_906_32,
                10.599_041_982_7,
                12.624_953_769,
                -1.846_086_363_03,
                -2.562_414_540_03,
                -4.038_667_769_86,
            ],
        ),
        (
            "vertex=\"0 0 0  1 0 0  0 1 0  0 0 1\" face=\"0 2 1 0 1 3 1 2 3 0 3 2\" inertia=\"exact\"",
            plain,
            // 1000 kg/m³ in a corner of a cube: 1/6, 1/24, 1/30 and 1/120 of it, by hand.
            [
                1000.0 / 6.0,
                1000.0 / 24.0,
                1000.0 / 24.0,
                1000.0 / 24.0,
                1000.0 / 30.0,
                1000.0 / 30.0,
                1000.0 / 30.0,
                -1000.0 / 120.0,
                -1000.0 / 120.0,
                -1000.0 / 120.0,
            ],
        ),
    ] {
        let model = one(folder.path(), "meshdir=\"parts\"", &mesh(asset), geom);
        check(&model, "b", wanted);
        assert!(model.findings.is_empty(), "{:?}", model.findings);
    }
}

#[test]
fn meshes_in_mujocos_own_form_are_read() {
    let folder = folder();
    let corners: [[f32; 3]; 5] =
        [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.3, 0.2, 0.0], [0.0, 0.2, 0.1], [0.1, 0.1, 0.4]];
    let faces = [[0_i32, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
    let counts = [5_i32, 0, 0, 6];
    let mut bytes: Vec<u8> = counts.iter().flat_map(|n| n.to_le_bytes()).collect();
    bytes.extend(corners.iter().flatten().flat_map(|v| v.to_le_bytes()));
    bytes.extend(faces.iter().flatten().flat_map(|v| v.to_le_bytes()));
    let path = folder.path().join("p.msh");
    let geom = "<geom type=\"mesh\" mesh=\"p\"/>";
    let asset = "<asset><mesh file=\"p.msh\"/></asset>";
    let read = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        one(folder.path(), "", asset, geom)
    };
    let wanted = [
        7.833_333_869_78,
        1.083_333_446_02,
        0.779_166_731_425,
        0.879_166_739_869,
        0.237_666_690_124,
        0.330_333_373_822,
        0.279_000_035_27,
        -0.091_416_675_651_8,
        -0.110_000_012_807,
        -0.107_750_012_781,
    ];
    check(&read(&bytes), "b", wanted);
    // Every cut, and counts that no file has, are no mesh.
    for cut in 0..bytes.len() {
        assert_eq!(read(&bytes[..cut]).links[1].nominal, None);
    }
    for at in (0..16).step_by(4) {
        for value in [-1_i32, i32::MAX, 1 << 30] {
            let mut damaged = bytes.clone();
            damaged[at..at + 4].copy_from_slice(&value.to_le_bytes());
            assert_eq!(read(&damaged).links[1].nominal, None);
        }
    }
}

#[test]
fn a_mesh_that_is_not_there_is_named() {
    let folder = folder();
    for (asset, geom, wanted) in [
        (
            "<mesh name=\"w\" file=\"no.stl\"/>",
            "type=\"mesh\" mesh=\"w\"",
            "of a mesh (w: no.stl is not there)",
        ),
        ("", "type=\"mesh\" mesh=\"w\"", "of a mesh (w: no <mesh> has that name)"),
        (
            "<mesh file=\"w.obj\" inertia=\"convex\"/>",
            "type=\"mesh\" mesh=\"w\"",
            "its inertia is \"convex\"",
        ),
        ("<mesh file=\"w.obj\"/>", "type=\"box\" mesh=\"w\"", "of a box that is fitted to a mesh (w)"),
    ] {
        let asset = format!("<asset>{asset}</asset>");
        let model = one(folder.path(), "meshdir=\"parts\"", &asset, &format!("<geom {geom}/>"));
        assert_eq!(model.links[1].nominal, None);
        let said = format!("{:?}", model.findings);
        assert!(said.replace('\\', "").contains(wanted), "{said}");
    }
    // A text without a file has no folder.
    let text = "<mujoco><asset><mesh file=\"w.obj\"/></asset><worldbody><body name=\"b\"><joint/><geom \
                type=\"mesh\" mesh=\"w\"/></body></worldbody></mujoco>";
    assert_eq!(mjcf::parse(text, "x").unwrap().model.links[1].nominal, None);
}

#[test]
fn meshes_of_an_attached_model_are_in_its_own_folder() {
    let folder = folder();
    std::fs::create_dir(folder.path().join("hand")).unwrap();
    let child = "<mujoco><compiler meshdir=\"../parts\"/><default><mesh scale=\"2 2 \
                 2\"/></default><asset><mesh file=\"w.obj\"/></asset><worldbody><body \
                 name=\"palm\"><joint/><geom type=\"mesh\" mesh=\"w\"/></body></worldbody></mujoco>";
    std::fs::write(folder.path().join("hand/child.xml"), child).unwrap();
    let asset = "<asset><model name=\"g\" file=\"hand/child.xml\"/></asset>";
    let inside = "<geom size=\"0.1\"/><attach model=\"g\" body=\"palm\" prefix=\"l_\"/>";
    let wanted = [
        60.540_815_687_6,
        18.742_280_807_3,
        12.649_749_432_2,
        7.958_556_935_77,
        4.797_362_054_55,
        9.026_410_023_24,
        10.950_523_639_5,
        -1.684_294_917_32,
        -2.413_670_759_32,
        -3.909_826_677_35,
    ];
    check(&one(folder.path(), "", asset, inside), "l_palm", wanted);
}

/// Places and orientations of geoms may be those of their class.
#[test]
fn geoms_are_where_their_class_has_them() {
    let folder = folder();
    let class = "<default><default class=\"c\"><geom type=\"box\" size=\"0.1 0.02 0.03\" pos=\"0.2 0 0.1\" \
                 euler=\"0 30 0\"/></default></default>";
    let two = "<geom class=\"c\"/><geom class=\"c\" pos=\"0 0.1 0\"/>";
    let wanted = [0.96, 0.096, 0.048, 0.048, 0.010_744, 0.027_488, 0.0266, 0.0, -0.008_339_067_012_09, 0.0];
    check(&one(folder.path(), "", class, two), "b", wanted);
    // A quaternion of its own counts before the angles of its class.
    let turned = "<geom class=\"c\" quat=\"0.9 0.1 0.2 0.3\"/>";
    let wanted = [
        0.48,
        0.096,
        0.0,
        0.048,
        0.005_718_070_249_31,
        0.025_171_148_587_3,
        0.020_726_781_163_4,
        0.000_300_658_171_745,
        -0.009_279_344_044_32,
        -0.000_678_882_216_066,
    ];
    check(&one(folder.path(), "", class, turned), "b", wanted);
}

/// MuJoCo puts the least mass of a body without any where the body is in its parent.
#[test]
fn the_least_mass_of_an_empty_body_is_where_mujoco_has_it() {
    let folder = folder();
    let model = one(folder.path(), "boundmass=\"0.1\" boundinertia=\"0.002\"", "", "");
    check(&model, "b", [0.1, 0.03, 0.01, -0.02, 0.007, 0.015, 0.012, 0.002, 0.006, -0.003]);
}

//! Mistakes of convention are reported, and what is right is not; meshes of every kind are the same surface.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::{Body, Position};

use super::shapes::{Shape, shapes};
use super::{of_inertias, surface};
use crate::{Finding, Model, urdf};

/// Half the sides of a box, m, and its corners and triangles.
const HALF: [f64; 3] = [0.1, 0.15, 0.2];
const FACES: [[usize; 4]; 6] =
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];

fn corner(k: usize) -> [f64; 3] {
    std::array::from_fn(|axis| if k >> (2 - axis) & 1 == 1 { HALF[axis] } else { -HALF[axis] })
}

/// Returns the second moments of the box's shell over its area: its faces one by one.
fn shell() -> (f64, Matrix3<f64>) {
    let (mut area, mut sum) = (0.0, Vector3::zeros());
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let face = 4.0 * HALF[u] * HALF[v];
        area += 2.0 * face;
        sum[axis] += 2.0 * face * HALF[axis].powi(2);
        sum[u] += 2.0 * face * HALF[u].powi(2) / 3.0;
        sum[v] += 2.0 * face * HALF[v].powi(2) / 3.0;
    }
    (area, Matrix3::from_diagonal(&(sum / area)))
}

fn words(values: impl IntoIterator<Item = f64>) -> String {
    values.into_iter().map(|v| v.to_string()).collect::<Vec<_>>().join(" ")
}

fn obj() -> String {
    let corners: String = (0..8).map(|k| format!("v {}\n", words(corner(k)))).collect();
    let faces = FACES.map(|f| format!("f {} {} {} {}\n", f[0] + 1, f[1] + 1, f[2] + 1, f[3] + 1));
    corners + &faces.concat()
}

fn triangles() -> Vec<[[f64; 3]; 3]> {
    FACES.iter().flat_map(|f| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]).map(|t| t.map(corner)).collect()
}

fn stl_of_text() -> String {
    let facet = |t: [[f64; 3]; 3]| {
        let corners = t.map(|c| format!("vertex {}\n", words(c))).concat();
        format!("facet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\n")
    };
    format!("solid box\n{}endsolid box\n", triangles().into_iter().map(facet).collect::<String>())
}

fn stl_of_bytes() -> Vec<u8> {
    let mut out = vec![0; 80];
    out.extend(12_u32.to_le_bytes());
    for triangle in triangles() {
        out.extend([0; 12]);
        out.extend(triangle.iter().flatten().flat_map(|v| (*v as f32).to_le_bytes()));
        out.extend([0; 2]);
    }
    out
}

/// Returns the box in millimetres, y upwards, in a node that is turned, scaled and moved so that the box is
/// where the others are.
fn dae(primitive: &str) -> String {
    let turned: Vec<f64> = (0..8)
        .flat_map(|k| {
            let [x, y, z] = corner(k);
            // Upwards is y there: (x, z, −y); the node turns by 90° about its z, doubles and moves.
            let [x, y, z] = [x, z, -y].map(|v| v * 1e3);
            [y / 2.0 + 5.0, -x / 2.0, z / 2.0]
        })
        .collect();
    let (kind, body) = match primitive {
        "triangles" => {
            let corners = FACES.iter().flat_map(|f| [f[0], f[1], f[2], f[0], f[2], f[3]]);
            ("triangles", format!("<p>{}</p>", corners.map(|k| format!("{k} 0 ")).collect::<String>()))
        }
        "polylist" => {
            let corners: String = FACES.iter().flatten().map(|k| format!("{k} 0 ")).collect();
            ("polylist", format!("<vcount>4 4 4 4 4 4</vcount><p>{corners}</p>"))
        }
        _ => {
            let p = |f: &[usize; 4]| {
                format!("<p>{}</p>", f.iter().map(|k| format!("{k} 0 ")).collect::<String>())
            };
            ("polygons", FACES.iter().map(p).collect())
        }
    };
    format!(
        "<COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\"><asset><unit meter=\"0.001\"/><up_axis>Y_UP</up_axis></asset>
         <library_geometries><geometry id=\"g\"><mesh><source id=\"s\"><float_array id=\"f\" count=\"24\">{}</float_array>
         <technique_common><accessor source=\"#f\" count=\"8\" stride=\"3\"/></technique_common></source><vertices id=\"v\"><input
         semantic=\"POSITION\" source=\"#s\"/></vertices><{kind} count=\"6\"><input semantic=\"VERTEX\" source=\"#v\"
         offset=\"0\"/><input semantic=\"NORMAL\" source=\"#s\" offset=\"1\"/>{body}</{kind}></mesh></geometry></library_geometries>
         <library_visual_scenes><visual_scene id=\"w\"><node><scale>2 2 2</scale><node><rotate>0 0 1 90</rotate><node><translate>-5 0
         0</translate><instance_geometry url=\"#g\"/></node></node></node></visual_scene></library_visual_scenes>
         <scene><instance_visual_scene url=\"#w\"/></scene></COLLADA>",
        words(turned)
    )
}

#[test]
fn meshes_of_every_kind_have_the_moments_of_the_box_that_they_are() {
    let place = tempfile::tempdir().unwrap();
    let files: [(&str, Vec<u8>); 6] = [
        ("a.obj", obj().into()),
        ("a.stl", stl_of_text().into()),
        ("b.STL", stl_of_bytes()),
        ("a.dae", dae("triangles").into()),
        ("b.dae", dae("polylist").into()),
        ("c.dae", dae("polygons").into()),
    ];
    let (area, second) = shell();
    for (name, bytes) in files {
        let path = place.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let own = surface::read(&path, &Vector3::repeat(1.0)).unwrap_or_else(|| panic!("{name}"));
        // Single precision in the files.
        assert!((own.area - area).abs() < 1e-6 * area, "{name}: {} {area}", own.area);
        assert!(own.first.norm() < 1e-6 * area, "{name}: {}", own.first);
        assert!(
            (own.second / own.area - second).norm() < 1e-6 * second.norm(),
            "{name}: {}",
            own.second / own.area
        );
        assert!((own.high - Vector3::from(HALF)).norm() < 1e-6, "{name}: {}", own.high);
        let cut = std::fs::read(&path).unwrap();
        for length in (0..cut.len()).step_by(37) {
            std::fs::write(&path, &cut[..length]).unwrap();
            let _ = surface::read(&path, &Vector3::repeat(1.0));
        }
    }
}

#[test]
fn scenes_that_hold_themselves_and_indices_out_of_range_are_no_surface() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("x.dae");
    let good = dae("triangles");
    for (old, new) in [
        ("<instance_geometry url=\"#g\"/>", "<instance_node url=\"#w\"/>"),
        ("<p>0 0", "<p>99 0"),
        ("offset=\"1\"", "offset=\"18446744073709551615\""),
        ("<scale>2 2 2</scale>", "<scale>2 2</scale>"),
        ("0 0 1 90", "0 0 0 90"),
        ("stride=\"3\"", "stride=\"0\""),
        ("</COLLADA>", ""),
    ] {
        assert!(good.contains(old), "{old}");
        std::fs::write(&path, good.replace(old, new)).unwrap();
        assert_eq!(surface::read(&path, &Vector3::repeat(1.0)), None, "{old}");
    }
    // Twenty-five nodes, each of which holds the next twice.
    let twice = |k: usize| {
        format!(
            "<node id=\"n{k}\"><instance_node url=\"#n{0}\"/><instance_node url=\"#n{0}\"/></node>",
            k + 1
        )
    };
    let nodes = (0..25).map(twice).collect::<String>() + "<node id=\"n25\"/>";
    std::fs::write(
        &path,
        good.replace("<visual_scene id=\"w\">", &format!("<visual_scene id=\"w\">{nodes}")),
    )
    .unwrap();
    assert_eq!(surface::read(&path, &Vector3::repeat(1.0)), None);
    assert_eq!(surface::read(&place.path().join("none.stl"), &Vector3::repeat(1.0)), None);
}

/// Two boxes askew, far from the link's origin.
const LOPSIDED: &str = "<visual><origin xyz=\"0.2 0.05 0.1\"/><geometry><box size=\"0.1 0.1 \
                        0.1\"/></geometry></visual><visual><origin xyz=\"0.3 0.15 0.1\"/><geometry><box \
                        size=\"0.1 0.1 0.1\"/></geometry></visual>";

/// Returns the findings of a model of one such link, of the inertia of its shapes after a change.
fn findings_after(change: impl Fn(&mut Vector3<f64>, &mut Matrix3<f64>)) -> Vec<Finding> {
    let text = format!(
        "<robot name=\"r\"><link name=\"a\"/><link name=\"b\">{LOPSIDED}</link><joint name=\"j\" \
         type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/></joint></robot>"
    );
    let mut model = urdf::parse(&text, "r.urdf").unwrap();
    let shapes = shapes(&text, std::path::Path::new("r.urdf"));
    model.links[1].nominal = Some(inertia(&shapes["b"], change));
    of_inertias(&model, &shapes)
}

/// Returns φ of two kilograms spread as a shape is, some ten per cent off, after a change of centre and
/// tensor.
fn inertia(shape: &Shape, change: impl Fn(&mut Vector3<f64>, &mut Matrix3<f64>)) -> [f64; 10] {
    let turn = Rotation3::from_euler_angles(0.1, -0.05, 0.1).into_inner();
    let second = turn * shape.second * turn.transpose() * 0.9;
    let mut tensor = (Matrix3::identity() * second.trace() - second) * 2.0;
    let mut centre = shape.centre + Vector3::new(0.01, -0.005, 0.01);
    change(&mut centre, &mut tensor);
    let centre = Position::new(centre.x, centre.y, centre.z);
    InertialParameters::<Body, f64>::from_centre_of_mass(2.0, centre, tensor).to_vector()
}

#[test]
fn mistakes_of_convention_are_reported_and_nothing_else() {
    assert_eq!(findings_after(|_, _| ()), []);
    let origin =
        findings_after(|c, i| *i += (Matrix3::identity() * c.norm_squared() - *c * c.transpose()) * 2.0);
    assert!(origin.len() == 1 && origin[0].text.contains("about the link's origin"), "{origin:?}");
    let signs = findings_after(|_, i| *i = Matrix3::from_diagonal(&i.diagonal()) * 2.0 - *i);
    assert!(
        signs.len() == 1 && signs[0].text.contains("products of inertia have the sign opposite"),
        "{signs:?}"
    );
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let side = findings_after(|c, _| c[axis] = -c[axis]);
        // A box around simple shapes tells it first.
        assert!(side.len() == 1 && side[0].text.contains("outside of the box"), "{name}: {side:?}");
    }
}

/// Three links whose products all have the wrong sign, by a mesh of another file.
#[test]
fn a_whole_file_s_products_are_reported_as_its_convention() {
    let place = tempfile::tempdir().unwrap();
    let robots = place.path().join("askew/robots");
    std::fs::create_dir_all(&robots).unwrap();
    std::fs::write(place.path().join("askew/box.obj"), obj()).unwrap();
    let mesh = "<visual><origin xyz=\"0.3 0 0.1\" rpy=\"0 0 0.4\"/><geometry><mesh \
                filename=\"package://askew/box.obj\" scale=\"0.5 1 0.3\"/></geometry></visual>";
    let mut text = "<robot name=\"r\"><link name=\"l0\"/>".to_owned();
    for k in 1..4 {
        let held = k - 1;
        text += &format!(
            "<link name=\"l{k}\">{mesh}</link><joint name=\"j{k}\" type=\"continuous\"><parent \
             link=\"l{held}\"/><child link=\"l{k}\"/></joint>"
        );
    }
    text += "</robot>";
    let path = robots.join("r.urdf");
    let shapes = shapes(&text, &path);
    assert_eq!(shapes.len(), 3);
    let model = |wrong: bool| -> Model {
        let mut model = urdf::parse(&text, "r.urdf").unwrap();
        for link in model.links.iter_mut().skip(1) {
            link.nominal = Some(inertia(&shapes[&link.name], |_, i| {
                if wrong {
                    *i = Matrix3::from_diagonal(&i.diagonal()) * 2.0 - *i;
                }
            }));
        }
        model
    };
    assert_eq!(of_inertias(&model(false), &shapes), []);
    let found = of_inertias(&model(true), &shapes);
    assert!(
        found.len() == 4 && found[3].place == "model" && found[3].text.contains("in 3 of 3 links"),
        "{found:?}"
    );
    let mut mirrored = model(false);
    mirrored.links[1].nominal = Some(inertia(&shapes["l1"], |c, _| c.x = -c.x));
    let found = of_inertias(&mirrored, &shapes);
    assert!(found.len() == 1 && found[0].text.contains("if x had the other sign"), "{found:?}");
}

/// A left and a right link without shapes.
#[test]
fn a_side_that_is_the_other_s_image_but_for_one_thing_is_reported() {
    let text = "<robot name=\"r\"><link name=\"a\"/><link name=\"FL_leg\"/><link name=\"FR_leg\"/><joint \
                name=\"l\" type=\"continuous\"><origin xyz=\"0 0.2 0\"/><parent link=\"a\"/><child \
                link=\"FL_leg\"/></joint><joint name=\"r\" type=\"continuous\"><origin xyz=\"0 -0.2 \
                0\"/><parent link=\"a\"/><child link=\"FR_leg\"/></joint></robot>";
    let body = |side: f64, change: fn(&mut Vector3<f64>, &mut Matrix3<f64>)| {
        let mut centre = Vector3::new(0.02, 0.05 * side, -0.1);
        let (xy, yz, zx) = (0.002 * side, -0.003 * side, 0.001);
        let mut tensor = Matrix3::new(0.02, xy, zx, xy, 0.03, yz, zx, yz, 0.015);
        change(&mut centre, &mut tensor);
        let centre = Position::new(centre.x, centre.y, centre.z);
        Some(InertialParameters::<Body, f64>::from_centre_of_mass(2.0, centre, tensor).to_vector())
    };
    let findings_after = |change| -> Vec<Finding> {
        let mut model = urdf::parse(text, "r.urdf").unwrap();
        (model.links[1].nominal, model.links[2].nominal) = (body(1.0, |_, _| ()), body(-1.0, change));
        of_inertias(&model, &std::collections::BTreeMap::new())
    };
    assert_eq!(findings_after(|_, _| ()), []);
    type Change = fn(&mut Vector3<f64>, &mut Matrix3<f64>);
    let cases: [(Change, &str); 4] = [
        (|c, _| c.z = -c.z, "the sign of z of the centre of mass"),
        (
            |_, i| *i = Matrix3::from_diagonal(&i.diagonal()) * 2.0 - *i,
            "the signs of the products of inertia",
        ),
        (|_, i| (i.m12, i.m21) = (-i.m12, -i.m21), "the sign of the product of inertia xy"),
        (
            |c, i| *i += (Matrix3::identity() * c.norm_squared() - *c * c.transpose()) * 2.0,
            "about the link's origin",
        ),
    ];
    for (change, why) in cases {
        let found = findings_after(change);
        assert!(found.iter().any(|f| f.place == "link FR_leg" && f.text.contains(why)), "{why}: {found:?}");
    }
}

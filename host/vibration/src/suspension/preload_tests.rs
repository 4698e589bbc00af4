use nalgebra::{Rotation3, Vector3, Vector6};

use super::*;
use crate::suspension::springs::Springs;
use rigident_io::rig::RigFile;

const G: f64 = 9.80665;

/// A straight spring between the earth and the platform, which knows nothing but its length.
struct Straight {
    ground: Vector3<f64>,
    at: Vector3<f64>,
    npm: f64,
    free_m: f64,
}

/// A body on straight springs: energy of any pose.
struct World {
    springs: Vec<Straight>,
    mass: f64,
    com: Vector3<f64>,
}

impl World {
    /// Springs from places `at` to the earth by `length` along `axes`, tensioned so that the body rests.
    fn new(places: &[(Vector3<f64>, Vector3<f64>)], length: f64, tension: &[f64], com: Vector3<f64>) -> Self {
        let spring = |((at, axis), t): (&(Vector3<f64>, Vector3<f64>), &f64)| Straight {
            ground: at + axis.normalize() * length,
            at: *at,
            npm: 9e3,
            free_m: length - t / 9e3,
        };
        let springs = places.iter().zip(tension).map(spring).collect();
        let lift: f64 = places.iter().zip(tension).map(|((_, axis), t)| axis.normalize().z * t).sum();
        Self { springs, mass: lift / G, com }
    }

    fn energy(&self, q: &Vector6<f64>) -> f64 {
        let turn = Rotation3::from_scaled_axis(Vector3::new(q[3], q[4], q[5]));
        let place = |a: &Vector3<f64>| Vector3::new(q[0], q[1], q[2]) + turn * a;
        let stored = |s: &Straight| 0.5 * s.npm * ((s.ground - place(&s.at)).norm() - s.free_m).powi(2);
        self.springs.iter().map(stored).sum::<f64>() + self.mass * G * place(&self.com).z
    }

    /// Returns the gradient at rest, and the Hessian by central differences.
    fn hessian(&self) -> (Vector6<f64>, Matrix6<f64>) {
        let h = 2e-4;
        let at = |i: usize, a: f64, j: usize, b: f64| {
            let mut q = Vector6::zeros();
            q[i] += a * h;
            q[j] += b * h;
            self.energy(&q)
        };
        let slope = Vector6::from_fn(|i, _| (at(i, 1.0, i, 0.0) - at(i, -1.0, i, 0.0)) / (2.0 * h));
        let bend = Matrix6::from_fn(|i, j| {
            (at(i, 1.0, j, 1.0) - at(i, 1.0, j, -1.0) - at(i, -1.0, j, 1.0) + at(i, -1.0, j, -1.0))
                / (4.0 * h * h)
        });
        (slope, bend)
    }

    fn ten(&self) -> [f64; 10] {
        let ms = self.com * self.mass;
        [self.mass, ms.x, ms.y, ms.z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    }

    /// Returns the rig file of these springs, each with `more`.
    fn rig(&self, more: impl Fn(usize) -> String) -> RigFile {
        let spring = |(k, s): (usize, &Straight)| {
            let n = s.ground - s.at;
            format!(
                "[[suspension.spring]]\nat_m = [{}, {}, {}]\naxis = [{}, {}, {}]\naxial_npm = 9e3\n{}\n",
                s.at.x,
                s.at.y,
                s.at.z,
                n.x,
                n.y,
                n.z,
                more(k)
            )
        };
        let all: String = self.springs.iter().enumerate().map(spring).collect();
        RigFile::parse(&format!("[suspension]\nat_m = [0.02, -0.01, 0.03]\n{all}")).unwrap()
    }
}

/// Returns four springs at the corners that lean in by a slope, all alike.
fn leaning(slope: f64) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let corner = |(x, y): (f64, f64)| {
        let axis = Vector3::new(-x, -y, 0.0).normalize() * slope + Vector3::z();
        (Vector3::new(0.5 * x, 0.35 * y, 0.04), axis)
    };
    [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].map(corner).to_vec()
}

/// Returns the stiffness about O that a rig file and the body give, moved to P's origin.
fn given(rig: &RigFile, world: &World) -> Matrix6<f64> {
    let table = rig.suspension.as_ref().unwrap();
    let (o, [m, x, y, z, ..]) = (Vector3::from(table.at_m), world.ten());
    let ms = Vector3::new(x, y, z) - o * m;
    let about_o = Springs::new(table).stiffness()
        + Preload::new(table, G).stiffness(&[m, ms.x, ms.y, ms.z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    // What O does by the displacement of the origin: d_O = d + θ × o.
    let mut to = Matrix6::identity();
    to.fixed_view_mut::<3, 3>(0, 3).copy_from(&-o.cross_matrix());
    to.transpose() * about_o * to
}

fn close(own: &Matrix6<f64>, wanted: &Matrix6<f64>, share: f64) {
    for i in 0..6 {
        for j in 0..6 {
            let size = (wanted[(i, i)] * wanted[(j, j)]).abs().sqrt();
            let off = own[(i, j)] - wanted[(i, j)];
            assert!(
                off.abs() < share * size,
                "{i} {j}: {} {}\n{own:.3}{wanted:.3}",
                own[(i, j)],
                wanted[(i, j)]
            );
        }
    }
}

#[test]
fn leaning_springs_have_the_stiffness_that_their_energy_has() {
    // Stated across as it is under this load; and by the length of a spring that is hooked in.
    let world = World::new(&leaning(0.25), 0.4, &[80.0; 4], Vector3::new(0.0, 0.0, 0.15));
    let (slope, bend) = world.hessian();
    assert!(slope.amax() < 1e-3, "it rests: {slope}");
    let stated = world.rig(|_| format!("lateral_npm = {}", 80.0 / 0.4));
    close(&given(&stated, &world), &bend, 2e-3);
    let hooked = world.rig(|_| "length_m = 0.4".to_owned());
    close(&given(&hooked, &world), &bend, 1e-3);
    // Half the load, and the stiffness across follows.
    let light = World::new(&leaning(0.25), 0.4, &[40.0; 4], Vector3::new(0.0, 0.0, 0.15));
    close(&given(&hooked, &light), &light.hessian().1, 1e-3);
    // Without the preload yaw is too stiff by a tenth.
    let yaw = Springs::new(stated.suspension.as_ref().unwrap()).stiffness()[(5, 5)];
    assert!(yaw / bend[(5, 5)] > 1.05, "{yaw} {}", bend[(5, 5)]);
}

#[test]
fn a_centre_of_mass_off_the_middle_shifts_the_load_of_springs_of_unlike_heights() {
    let mut places = leaning(0.0);
    (places[0].0.z, places[1].0.z) = (0.24, 0.24);
    // Σ t a = m g c: more at the high ones.
    let tension = [120.0, 120.0, 60.0, 60.0];
    let com = Vector3::new(0.0, 0.35 * 120.0 / 360.0, -0.1);
    let world = World::new(&places, 0.5, &tension, com);
    let (slope, bend) = world.hessian();
    assert!(slope.amax() < 1e-3, "it rests: {slope}");
    close(&given(&world.rig(|_| "length_m = 0.5".to_owned()), &world), &bend, 1e-3);
}

#[test]
fn a_pull_of_springs_against_each_other_counts_too() {
    // Four above and four below that pull downward by 50 N each.
    let mut places = leaning(0.2);
    places.extend(
        leaning(0.2)
            .into_iter()
            .map(|(at, axis)| (at - Vector3::z() * 0.1, Vector3::new(axis.x, axis.y, -axis.z))),
    );
    let tension = [150.0, 150.0, 150.0, 150.0, 50.0, 50.0, 50.0, 50.0];
    let world = World::new(&places, 0.3, &tension, Vector3::new(0.0, 0.0, 0.1));
    let (slope, bend) = world.hessian();
    assert!(slope.amax() < 1e-3, "it rests: {slope}");
    // As they are under the load; the axis goes from the platform to the ground, so that both pull along it.
    let rig = world.rig(|k| format!("length_m = 0.3\npreload_n = {}", tension[k]));
    close(&given(&rig, &world), &bend, 1e-3);
}

#[test]
fn clamped_coils_are_beams_with_thrust() {
    // A beam of length L below the seat, E I and axial stiffness: its exact stiffness to first order in the
    // thrust (consistent geometric matrix, J. S. Przemieniecki, 1968): 12 EI/L³ − 6 P/5L, 6 EI/L² − P/10, 4
    // EI/L − 2 P L/15.
    let (ei, length, thrust) = (3.0, 0.15_f64, 78.0);
    let across = 12.0 * ei / length.powi(3) - 1.2 * thrust / length;
    let coupling = 6.0 * ei / length.powi(2) - 0.1 * thrust;
    let turns = 4.0 * ei / length - 2.0 * thrust * length / 15.0;
    let diameter = (ei / length / (0.28 * 9e3_f64)).sqrt();
    let spring = format!(
        "[[suspension.spring]]\nat_m = [0.0, 0.0, 0.0]\naxial_npm = 9e3\nlateral_npm = {across}\nclamped = \
         true\nlength_m = {length}\n\
         diameter_m = {diameter}\n"
    );
    let rig = RigFile::parse(&format!("[suspension]\nlocked = [\"yaw\"]\n{spring}")).unwrap();
    let table = rig.suspension.as_ref().unwrap();
    let mass = thrust / G;
    let own = Springs::new(table).stiffness()
        + Preload::new(table, G).stiffness(&[mass, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let near = |a: f64, b: f64, share: f64| assert!((a - b).abs() < share * b.abs(), "{a} {b}");
    near(own[(0, 0)], across, 1e-9);
    // The seat turns about y: the beam below it moves toward −x by −L/2 θ, and is pushed back.
    near(own[(0, 4)].abs(), coupling, 1e-9);
    near(own[(4, 4)], turns, 0.03);
    assert!(own[(0, 4)] < 0.0 && own[(1, 3)] > 0.0, "{own}");
}

#[test]
fn the_wrench_at_small_displacements_is_that_of_the_stiffness() {
    let world = World::new(&leaning(0.25), 0.4, &[80.0; 4], Vector3::new(0.0, 0.0, 0.15));
    let kinds = [
        "lateral_npm = 900.0",
        "length_m = 0.4",
        "lateral_npm = 900.0\nclamped = true\nlength_m = 0.2\ndiameter_m = 0.05",
    ];
    for more in kinds {
        let rig = world.rig(|_| format!("{more}\npreload_n = 7.0"));
        let preload = Preload::new(rig.suspension.as_ref().unwrap(), G);
        let (m, h) = (30.0, 1e-6);
        // The weight acts at O, and does nothing as it turns.
        let k = preload.stiffness(&[m, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let loads = [1.0, m * G, 0.0, 0.0];
        let at = |q: Vector6<f64>| {
            let turned = Rotation3::from_scaled_axis(Vector3::new(q[3], q[4], q[5])).into_inner();
            Displacement::new(Vector3::new(q[0], q[1], q[2]), Vector3::zeros(), turned, Vector3::zeros())
        };
        for j in 0..6 {
            let q = Vector6::ith(j, h);
            let slope = (preload.wrench(&at(-q), &loads) - preload.wrench(&at(q), &loads)) / (2.0 * h);
            assert!((slope - k.column(j)).amax() < 1e-4 * k.amax(), "{more} {j}: {slope} {}", k.column(j));
        }
    }
}

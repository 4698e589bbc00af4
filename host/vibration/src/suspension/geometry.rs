//! Errors of what is measured of the springs beside their stiffness: places, axes, heights, lengths, preload;
//! and air that moves with the platform.
//!
//! Each number of the rig file that is measured is moved by a step either way: half of the difference is
//! what its error changes in the stiffness and in the wrench, whatever the law of the springs is. What is
//! stated is not better than a tape measure and an eye, unless the rig file says more.

use nalgebra::{Matrix6, Vector3, Vector6};

use super::preload::Preload;
use super::springs::{Displacement, Springs, free};
use rigident_fit::{Basis, Effect, Nuisance, Scope};
use rigident_io::rig::{SpringTable, SuspensionTable};

/// 1 σ of a coordinate of a spring's place, of the height of all, and of a length, m, where nothing is
/// stated: a tape measure, and hooks of some millimetres.
const PLACE_STD_M: f64 = 1e-3;
const HEIGHT_STD_M: f64 = 1e-3;
const LENGTH_STD_M: f64 = 5e-3;
/// 1 σ of an axis about either direction across it, rad, where nothing is stated: half a degree by eye.
const AXIS_STD_RAD: f64 = 0.009;
/// 1 σ of a stated preload, relative, where nothing is stated.
const PRELOAD_STD: f64 = 0.1;
/// 1 σ of the share of the weight that a spring takes, relative: three millimetres of a sag of thirty.
const SHARE_STD: f64 = 0.1;
/// Steps of differences, m, rad and relative.
const STEP: f64 = 1e-4;
/// Density of air, kg/m³.
const AIR_KGPM3: f64 = 1.2;
/// A change of stiffness below this share of the stiffness is none.
const SAME: f64 = 1e-12;

/// A number that is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Number {
    /// A coordinate of a spring's place.
    Place(usize, usize),
    /// A turn of a spring's axis about one of the directions across it.
    Axis(usize, usize),
    /// The height of all springs.
    Height,
    Length(usize),
    Preload(usize),
    /// The share of the weight that a spring takes, by its stiffness.
    Share(usize),
}

/// The springs with another value of a number.
#[derive(Clone, Debug)]
struct Moved {
    springs: Springs,
    preload: Preload,
}

/// An error and what the springs are a step above and below.
#[derive(Clone, Debug)]
struct GeometryError {
    nuisance: Nuisance,
    above: Moved,
    below: Moved,
    /// The springs that differ, by their numbers; the load of all of them may.
    springs: Vec<usize>,
}

/// The errors of places, axes, heights, lengths and preload.
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    errors: Vec<GeometryError>,
}

impl Number {
    fn name(self) -> String {
        match self {
            Self::Place(n, k) => format!("spring{}_place_{}", n + 1, ["x", "y", "z"][k]),
            Self::Axis(n, k) => format!("spring{}_axis_{}", n + 1, k + 1),
            Self::Height => "anchor_height".to_owned(),
            Self::Length(n) => format!("spring{}_length", n + 1),
            Self::Preload(n) => format!("spring{}_preload", n + 1),
            Self::Share(n) => format!("spring{}_share", n + 1),
        }
    }

    /// Returns the group of its error, its unit, and the key, the value and the default of its σ.
    fn sigma(self, table: &SuspensionTable) -> (&'static str, &'static str, &'static str, Option<f64>, f64) {
        match self {
            Self::Place(..) => ("places of springs", "m", "place_std_m", table.place_std_m, PLACE_STD_M),
            Self::Axis(..) => ("axes of springs", "rad", "axis_std_rad", table.axis_std_rad, AXIS_STD_RAD),
            Self::Height => {
                ("anchor height", "m", "anchor_height_std_m", table.anchor_height_std_m, HEIGHT_STD_M)
            }
            Self::Length(_) => ("lengths of springs", "m", "length_std_m", table.length_std_m, LENGTH_STD_M),
            Self::Preload(_) => ("preload", "", "preload_std", table.preload_std, PRELOAD_STD),
            Self::Share(_) => ("shares of the weight", "", "share_std", table.share_std, SHARE_STD),
        }
    }

    /// Returns the table with the number larger by an amount.
    fn moved(self, table: &SuspensionTable, by: f64) -> SuspensionTable {
        let mut table = table.clone();
        match self {
            Self::Place(n, k) => table.spring[n].at_m[k] += by,
            Self::Axis(n, k) => {
                let axis = Vector3::from(table.spring[n].axis).normalize();
                table.spring[n].axis = (axis + across(&axis)[k] * by).into();
            }
            Self::Height => {
                table.anchor_height_m = table.anchor_height_m.map(|height| height + by);
                table.spring.iter_mut().for_each(|own| own.at_m[2] += by);
            }
            Self::Length(n) => table.spring[n].length_m = table.spring[n].length_m.map(|length| length + by),
            Self::Preload(n) => {
                let own = &mut table.spring[n];
                own.preload_n *= 1.0 + by;
                own.pull_n = own.pull_n.map(|pull| pull * (1.0 + by));
            }
            Self::Share(n) => table.spring[n].axial_npm *= 1.0 + by,
        }
        table
    }
}

/// Returns two directions across an axis.
fn across(axis: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let least = axis.iamin();
    let first = axis.cross(&Vector3::ith(least, 1.0)).normalize();
    [first, axis.cross(&first)]
}

/// Returns the numbers of a table that are measured.
fn numbers(table: &SuspensionTable) -> Vec<Number> {
    let mut all = Vec::new();
    for (n, own) in table.spring.iter().enumerate() {
        all.extend((0..3).map(|k| Number::Place(n, k)));
        all.extend((0..2).map(|k| Number::Axis(n, k)));
        all.extend(own.length_m.map(|_| Number::Length(n)));
        all.extend((own.pull_n.unwrap_or(own.preload_n) != 0.0).then_some(Number::Preload(n)));
        all.extend(own.pull_n.is_none().then_some(Number::Share(n)));
    }
    all.push(Number::Height);
    all
}

impl Moved {
    fn stiffness(&self, ten: &[f64; 10]) -> Matrix6<f64> {
        self.springs.stiffness() + self.preload.stiffness(ten)
    }

    /// Returns the wrench of some springs, and of the load of all.
    fn wrench(&self, numbers: &[usize], at: &Displacement, loads: &[f64; 4]) -> Vector6<f64> {
        self.springs.wrench_of(numbers, at) + self.preload.wrench(at, loads)
    }
}

impl Geometry {
    /// Returns what is not known of the springs of a rig file.
    pub fn new(table: &SuspensionTable, gravity_mps2: f64) -> Self {
        let of = |number: Number| {
            let (group, unit, key, stated, default) = number.sigma(table);
            let sigma = stated.unwrap_or(default);
            let nuisance = Nuisance {
                name: number.name(),
                group: group.to_owned(),
                unit: unit.to_owned(),
                sigma,
                basis: match stated {
                    Some(_) => Basis::Stated(format!("[suspension] {key}")),
                    None => Basis::Class("springs measured by tape and eye".to_owned()),
                },
                scope: Scope::Rig,
                effect: Effect::None,
            };
            let at = |by: f64| {
                let moved = number.moved(table, by);
                // Springs share by their stiffness; what they do in motion is another error.
                let springs = if matches!(number, Number::Share(_)) { table } else { &moved };
                Moved { springs: Springs::new(springs), preload: Preload::new(&moved, gravity_mps2) }
            };
            let (above, below) = (at(STEP), at(-STEP));
            let springs = above.springs.unlike(&below.springs);
            let own = GeometryError { nuisance, above, below, springs };
            (sigma > 0.0 && own.counts(table)).then_some(own)
        };
        Self { errors: numbers(table).into_iter().filter_map(of).collect() }
    }

    /// Returns the errors, numbered from `first`.
    pub fn nuisances(&self, first: usize) -> Vec<Nuisance> {
        let number = |(k, own): (usize, &GeometryError)| Nuisance {
            effect: Effect::Signal(first + k),
            ..own.nuisance.clone()
        };
        self.errors.iter().enumerate().map(number).collect()
    }

    /// Returns what a unit of each error changes in the stiffness about O, with that of the weight of ten
    /// parameters about O.
    pub fn stiffnesses(&self, ten: &[f64; 10]) -> Vec<Matrix6<f64>> {
        self.errors.iter().map(|own| own.stiffness(ten)).collect()
    }

    /// Returns 1 σ of what the errors change in the elements of the stiffness that the load of the springs
    /// has, under ten parameters about O.
    pub fn load_std(&self, ten: &[f64; 10]) -> Matrix6<f64> {
        let of = |own: &GeometryError| {
            let [above, below] = [&own.above, &own.below].map(|moved| moved.preload.stiffness(ten));
            (above - below) * (own.nuisance.sigma / (2.0 * STEP))
        };
        let squares: Matrix6<f64> = self.errors.iter().map(|own| of(own).map(|v| v * v)).sum();
        squares.map(f64::sqrt)
    }

    /// Returns what a unit of each error changes in the wrench under loads of the springs: stated preload, W
    /// (N), Mx and My (N m).
    pub fn wrenches<'a>(
        &'a self,
        at: &'a Displacement,
        loads: &'a [f64; 4],
    ) -> impl Iterator<Item = Vector6<f64>> + 'a {
        let of = move |own: &GeometryError| {
            let [above, below] = [&own.above, &own.below].map(|moved| moved.wrench(&own.springs, at, loads));
            (above - below) / (2.0 * STEP)
        };
        self.errors.iter().map(of)
    }
}

impl GeometryError {
    fn stiffness(&self, ten: &[f64; 10]) -> Matrix6<f64> {
        (self.above.stiffness(ten) - self.below.stiffness(ten)) / (2.0 * STEP)
    }

    /// Returns whether any body moves otherwise on free coordinates.
    fn counts(&self, table: &SuspensionTable) -> bool {
        let free = free(&table.locked);
        let units = [[0.0; 4], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        let size = self.above.springs.stiffness().amax();
        units.iter().any(|four| {
            let mut ten = [0.0; 10];
            ten[..4].copy_from_slice(four);
            let change = self.stiffness(&ten) * self.nuisance.sigma;
            free.iter().any(|i| free.iter().any(|j| change[(*i, *j)].abs() > SAME * size))
        })
    }
}

/// Returns the mass matrix about O of the air that moves with a plate, axes of P at rest; `None` if none is
/// stated.
///
/// A plate of the sides b ≤ l takes `π/4 ρ b² l / (1 + 0.73 b/l)` with it as it heaves (within 3 % of M.
/// Patton's measurements, 1965), and by its turns a twentieth of that by the square of the side, within a
/// third: between a long plate's 1/32 and a disc's 1/30 about its long side, and a strip's 1/12 about the
/// short one.
pub fn air(table: &SuspensionTable) -> Option<Matrix6<f64>> {
    let [x, y] = table.air_plate_m?;
    let (narrow, wide) = (x.min(y), x.max(y));
    let mass =
        std::f64::consts::FRAC_PI_4 * AIR_KGPM3 * narrow * narrow * wide / (1.0 + 0.73 * narrow / wide);
    let count = table.spring.len().max(1) as f64;
    let middle = |own: &SpringTable| (Vector3::from(own.at_m) - Vector3::from(table.at_m)) / count;
    let centre: Vector3<f64> = table.spring.iter().map(middle).sum();
    let heave = Vector6::new(0.0, 0.0, 1.0, centre.y, -centre.x, 0.0);
    let turns = Vector6::new(0.0, 0.0, 0.0, y * y, x * x, 0.0) * (mass / 20.0);
    Some(heave * heave.transpose() * mass + Matrix6::from_diagonal(&turns))
}

/// Returns the error that the air is, by that of a bare plate.
pub fn air_nuisance(first: usize) -> Nuisance {
    Nuisance {
        name: "air".to_owned(),
        group: "air".to_owned(),
        unit: String::new(),
        sigma: 1.0,
        basis: Basis::Stated("[suspension] air_plate_m".to_owned()),
        scope: Scope::Rig,
        effect: Effect::Signal(first),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rigident_io::rig::RigFile;

    /// Four wires of 0.5 m at the corners of 0.8 × 0.6 m, 0.1 m above O.
    const FOUR: &str = "[suspension]\nair_plate_m = [0.8, 0.6]\n\
        spring = [{ at_m = [0.4, 0.3, 0.1], axial_npm = 9e3, length_m = 0.5 }, \
                  { at_m = [-0.4, 0.3, 0.1], axial_npm = 9e3, length_m = 0.5 }, \
                  { at_m = [-0.4, -0.3, 0.1], axial_npm = 9e3, length_m = 0.5 }, \
                  { at_m = [0.4, -0.3, 0.1], axial_npm = 9e3, length_m = 0.5 }]\n";
    const G: f64 = 9.80665;

    fn table(more: &str) -> SuspensionTable {
        let text = FOUR.replacen("[suspension]\n", &format!("[suspension]\n{more}"), 1);
        RigFile::parse(&text).unwrap().suspension.unwrap()
    }

    /// Returns the change of the stiffness under 20 kg at O by an error.
    fn change(name: &str) -> Matrix6<f64> {
        let own = Geometry::new(&table(""), G);
        let k = own.nuisances(0).iter().position(|nuisance| nuisance.name == name).expect(name);
        let mut ten = [0.0; 10];
        ten[0] = 20.0;
        own.stiffnesses(&ten)[k]
    }

    #[test]
    fn errors_of_places_and_lengths_are_those_of_a_pendulum() {
        let (tension, across) = (20.0 * G / 4.0, 20.0 * G / 4.0 / 0.5);
        // Higher by δ: all four forces carry the weight there, and the wires' sway has a longer arm.
        let higher = change("anchor_height");
        let wanted = 4.0 * (tension + 2.0 * 0.1 * across);
        assert!((higher[(3, 3)] - wanted).abs() < 1e-3 * wanted, "{higher} {wanted}");
        // A longer wire is a slower pendulum.
        let longer = change("spring1_length");
        assert!((longer[(0, 0)] + across / 0.5).abs() < 1e-3 * across, "{longer}");
        // An axis that leans by a radian: a share of the stiffness along shows across.
        let leans = change("spring1_axis_1") + change("spring1_axis_2");
        assert!(leans[(0, 2)].abs() > 8.9e3 && leans[(0, 2)].abs() < 9.1e3, "{leans}");
        // Further out by δ: k (a + δ)² against tilting; the weight's share goes to the others.
        let further = change("spring1_place_y");
        let wanted = 2.0 * 9e3 * 0.3;
        assert!((further[(3, 3)] - wanted).abs() < 0.02 * wanted, "{further} {wanted}");
    }

    /// Only springs that differ are asked; the others cancel.
    #[test]
    fn errors_change_the_wrench_as_whole_springs_do() {
        let geometry = Geometry::new(&table(""), 9.81);
        let turned = nalgebra::Rotation3::from_scaled_axis(Vector3::new(0.02, -0.03, 0.05)).into_inner();
        let at = Displacement::new(Vector3::new(0.01, 0.02, -0.01), Vector3::zeros(), turned, Vector3::x());
        let loads = [1.0, 200.0, 3.0, -4.0];
        let whole = |moved: &Moved| moved.springs.wrench(&at) + moved.preload.wrench(&at, &loads);
        assert!(geometry.errors.iter().any(|own| own.springs.len() == 1));
        for (own, found) in geometry.errors.iter().zip(geometry.wrenches(&at, &loads)) {
            let wanted = (whole(&own.above) - whole(&own.below)) / (2.0 * STEP);
            assert!((found - wanted).norm() < 1e-7 * (1.0 + wanted.norm()), "{found} {wanted}");
        }
    }

    #[test]
    fn numbers_that_are_known_and_shares_that_balance_alone_are_no_errors() {
        let names = |more: &str| -> Vec<String> {
            Geometry::new(&table(more), G).nuisances(0).into_iter().map(|own| own.name).collect()
        };
        // Alike wires at the corners of a rectangle: whatever the shares, the whole moves the same.
        let shares = |table: &SuspensionTable| -> usize {
            let all = Geometry::new(table, G).nuisances(0);
            all.iter().filter(|own| own.name.ends_with("_share")).count()
        };
        let mut uneven = table("");
        assert_eq!(shares(&uneven), 0);
        uneven.spring[3].length_m = Some(0.3);
        assert_eq!(shares(&uneven), 4);
        let exact = "place_std_m = 0.0\naxis_std_rad = 0.0\nanchor_height_std_m = 0.0\nlength_std_m = 0.0\n\
                     share_std = 0.0\n";
        assert!(names(exact).is_empty());
        // Three wires balance the weight in one way.
        let mut three = table("");
        three.spring.pop();
        assert_eq!(shares(&three), 0);
        let air = air(&table("")).unwrap();
        assert!((0.1..0.25).contains(&air[(2, 2)]) && air[(0, 0)] == 0.0, "{air}");
    }
}

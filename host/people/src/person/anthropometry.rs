//! The knowledge of tables of people about one person: a normal distribution of her base parameters.
//!
//! Mass, centre and tensor of a segment differ from the table's by relative sizes that are stated. Left and
//! right are one person's: what they share is large, in what they differ is small. All segments together are
//! lighter or heavier, and larger or smaller where they are scaled by a stature that is not known. Published
//! tables differ by more than people do, as each draws the boundaries of segments elsewhere: the differences
//! of two others from this one, of half their squares each, are deviations of a part's mass on both sides,
//! and of its shape. Linear about the table: `δ(m c) = c δm + m δc`, `δI = δI_c + S(c) δm + m (S(c, δc) +
//! S(δc, c))`, with
//! `S(a, b) = (a·b) 1 − b aᵀ`.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use rigident_fit::Gaussian;
use rigident_model::Model;
use rigident_model::base::BaseParameters;
use rigident_model::human::{Ratio, Sex, link_by_other_tables};
use rigident_model::inertial::Parameters;
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::{Body, Position};

/// The deviation of one person's segments from the table's: 1 σ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Of a segment's mass, relative; of the pelvis', hands' and feet half as much again, whose boundaries
    /// each table draws elsewhere, of the head's less.
    pub mass: f64,
    /// Of the mass of either side from the mean of left and right, relative.
    pub side: f64,
    /// Of its centre of mass along each axis, over its radius of gyration.
    pub centre: f64,
    /// Of its tensor about that, over a third of its trace.
    pub inertia: f64,
    /// Of everybody's mass, relative to what the table was scaled to.
    pub whole: f64,
    /// The part of the variances of centre and tensor that left and right share.
    pub shared: f64,
    /// Of the stature that bodies are scaled by which no joints bound, relative.
    pub height: f64,
    /// Whose means the table has.
    pub sex: Sex,
    /// Of other tables' differences from this one: 1 as they are, 0 if this one is known to be right.
    pub tables: f64,
}

impl Default for Spread {
    /// Returns sizes as people vary (assumed): shares of mass by 8 to 12 % from person to person, left and
    /// right by 2 to 3 %; and as tables differ.
    fn default() -> Self {
        Self {
            mass: 0.12,
            side: 0.02,
            centre: 0.2,
            inertia: 0.3,
            whole: 0.1,
            shared: 0.8,
            height: 0.0,
            sex: Sex::Unknown,
            tables: 1.0,
        }
    }
}

/// Masses of pelvis, hands and feet, and of a head are known less and more than others', relative to these:
/// the pelvis is 11.2 and 14.2 % of men's mass by the two tables, a foot of women 1.3 and 1.0 %, a head 6.9
/// and 6.7 %.
const BOUNDARY: f64 = 1.5;
const HEAD: f64 = 0.6;
/// The difference between the means of women and men is this much of a segment's mass, relative: half of it
/// is added, in squares, where neither is said.
const BETWEEN_SEXES: f64 = 0.08;
/// The difference of a person who is practically symmetric, relative, and the part of the variances.
const SYMMETRIC: f64 = 1e-3;

impl Spread {
    /// Returns the sizes for somebody whose means are those of a table, the stature known so well, relative;
    /// `symmetric` if right segments are taken to mirror left ones.
    #[must_use]
    pub fn about(self, sex: Sex, height: f64, symmetric: bool) -> Self {
        let mass = if sex == Sex::Unknown { self.mass.hypot(BETWEEN_SEXES / 2.0) } else { self.mass };
        let own = Self { mass, height, sex, ..self };
        if symmetric { Self { side: SYMMETRIC, shared: 1.0 - SYMMETRIC, ..own } } else { own }
    }

    /// Returns the deviation of a link's mass that left and right share, and its own.
    fn masses(&self, link: &str) -> [f64; 2] {
        match link {
            "pelvis" => [BOUNDARY * self.mass, 0.0],
            _ if link.ends_with("hand") || link.ends_with("foot") => [BOUNDARY * self.mass, self.side],
            "head" | "cervical" => [HEAD * self.mass, 0.0],
            _ if other_side(link).is_some() => [self.mass, self.side],
            _ => [self.mass, 0.0],
        }
    }
}

/// A segment whose mass is known otherwise: a prosthesis, a limb with a load on it.
#[derive(Clone, Debug, PartialEq)]
pub struct GivenMass {
    /// The link of the model.
    pub link: String,
    /// The mass of the segment, kg.
    pub kg: f64,
    /// 1 σ of it, kg.
    pub sigma_kg: f64,
}

/// Returns the name of the same link on the other side.
fn other_side(link: &str) -> Option<String> {
    let right = link.strip_prefix("l_").map(|rest| format!("r_{rest}"));
    right.or_else(|| link.strip_prefix("r_").map(|rest| format!("l_{rest}")))
}

/// Returns whether joints bound a link on both sides, so that its length is the person's own.
fn is_bounded(link: &str) -> bool {
    ["thigh", "shank", "upper_arm", "forearm", "ulna", "radius"].iter().any(|part| link.ends_with(part))
}

/// Returns the distribution of base parameters, some masses given; `None` if a segment has no nominal body.
pub fn distribution(
    model: &Model,
    base: &BaseParameters,
    spread: &Spread,
    given: &[GivenMass],
) -> Option<Gaussian> {
    let map = base.map() * bodies(model);
    let nominal = DVector::from_vec(model.nominal());
    let covariance = standard(model, spread, given)?;
    let names = base.parameters.iter().map(|p| p.name.clone()).collect();
    Gaussian::new(names, &map * nominal, &map * covariance * map.transpose())
}

/// Returns the covariance of the standard parameters of all links, ten each, some masses given; `None` if a
/// segment has no nominal body.
pub fn standard(model: &Model, spread: &Spread, given: &[GivenMass]) -> Option<DMatrix<f64>> {
    let segments: Vec<Parameters> = model.links.iter().map(|l| l.nominal).collect::<Option<_>>()?;
    let nominal = DVector::from_vec(model.nominal());
    let mut covariance = DMatrix::zeros(nominal.len(), nominal.len());
    let names: Vec<&str> = model.links.iter().map(|link| link.name.as_str()).collect();
    let is_given = |name: &str| given.iter().find(|own| own.link == name);
    let masses = |name: &str| match is_given(name) {
        Some(own) => [0.0, own.sigma_kg / own.kg],
        None => spread.masses(name),
    };
    let found = segments.iter().zip(&names).map(|(own, name)| root(own, masses(name), spread));
    let roots: Vec<DMatrix<f64>> = found.collect::<Option<_>>()?;
    for (k, own) in roots.iter().enumerate() {
        covariance.view_mut((10 * k, 10 * k), (10, 10)).copy_from(&(own * own.transpose()));
        let twin = other_side(names[k]).and_then(|name| names.iter().position(|other| *other == name));
        let Some(twin) = twin else { continue };
        let [common, side] = spread.masses(names[k]).map(|size| size * size);
        let apart = is_given(names[k]).is_some() || is_given(names[twin]).is_some();
        let mut shared = own.clone();
        for (column, sign) in MIRRORED.into_iter().enumerate() {
            let part = match column {
                0 if apart => 0.0,
                0 => (common - side) / (common + side),
                _ => spread.shared,
            };
            shared.column_mut(column).scale_mut(sign * part);
        }
        covariance.view_mut((10 * k, 10 * twin), (10, 10)).copy_from(&(shared * roots[twin].transpose()));
    }
    let heavier =
        DVector::from_fn(
            nominal.len(),
            |row, _| {
                if is_given(names[row / 10]).is_some() { 0.0 } else { nominal[row] }
            },
        );
    covariance += &heavier * heavier.transpose() * spread.whole.powi(2);
    // At the same mass first moments grow with the stature, tensors with its square.
    let taller = DVector::from_fn(nominal.len(), |row, _| {
        let power =
            if is_bounded(names[row / 10]) { 0.0 } else { [0.0, 1.0, 2.0][(row % 10).div_ceil(3).min(2)] };
        power * nominal[row]
    });
    covariance += &taller * taller.transpose() * spread.height.powi(2);
    covariance += between_tables(&segments, &names, spread.sex, &is_given) * (spread.tables.powi(2) / 2.0);
    Some(covariance)
}

/// Returns the sum of the squares of other tables' differences from this one, of each part of the body by
/// itself: of its mass, and of its shape. Nothing is added to segments whose masses are given.
fn between_tables<'a>(
    segments: &[Parameters],
    names: &[&str],
    sex: Sex,
    is_given: &dyn Fn(&str) -> Option<&'a GivenMass>,
) -> DMatrix<f64> {
    let others: Vec<_> = names
        .iter()
        .map(|name| link_by_other_tables(name, sex).filter(|_| is_given(name).is_none()))
        .collect();
    let mut parts: Vec<&str> = others.iter().flatten().map(|(part, _)| *part).collect();
    parts.sort_unstable();
    parts.dedup();
    let mut sum = DMatrix::zeros(10 * segments.len(), 10 * segments.len());
    for part in parts {
        for table in 0..2 {
            for is_mass in [true, false] {
                let of = |(own, other): (&Parameters, &Option<(&str, [Ratio; 2])>)| match other {
                    Some((name, ratios)) if *name == part => {
                        let Ratio { mass, com, radius } = ratios[table];
                        let mass_only = Ratio { mass, com: 1.0, radius: 1.0 };
                        by_other_table(
                            own,
                            if is_mass { mass_only } else { Ratio { mass: 1.0, com, radius } },
                        )
                    }
                    _ => [0.0; 10],
                };
                let column = DVector::from_iterator(sum.nrows(), segments.iter().zip(&others).flat_map(of));
                sum.ger(1.0, &column, &column, 1.0);
            }
        }
    }
    sum
}

/// Returns the difference of a segment's ten parameters by another table from those by this one. Centre of
/// mass and radii count from the origin of the link, its proximal joint.
fn by_other_table(phi: &Parameters, ratio: Ratio) -> Parameters {
    let (mass, centre, about) = shape(phi);
    let com = centre * ratio.com;
    let other = InertialParameters::<Body, f64>::from_centre_of_mass(
        mass * ratio.mass,
        Position::new(com.x, com.y, com.z),
        about * (ratio.mass * ratio.radius.powi(2)),
    );
    let other = other.to_vector();
    std::array::from_fn(|k| other[k] - phi[k])
}

/// Returns `(a·b) 1 − b aᵀ`.
fn square(a: &Vector3<f64>, b: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::identity() * a.dot(b) - b * a.transpose()
}

/// Returns mass, centre of mass and the tensor about that.
fn shape(phi: &Parameters) -> (f64, Vector3<f64>, Matrix3<f64>) {
    let mass = phi[0];
    let centre = Vector3::new(phi[1], phi[2], phi[3]) / mass;
    let about = Matrix3::new(phi[4], phi[9], phi[8], phi[9], phi[5], phi[7], phi[8], phi[7], phi[6])
        - square(&centre, &centre) * mass;
    (mass, centre, about)
}

/// Signs of the deviations of [`root`] in a mirror: mass, centre along x, y and z, Ixx, Iyy, Izz, Iyz, Izx,
/// Ixy.
const MIRRORED: [f64; 10] = [1.0, 1.0, -1.0, 1.0, 1.0, 1.0, 1.0, -1.0, 1.0, -1.0];

/// Returns a covariance of standard parameters, ten of every link, beside a whole mass that is known, with 1
/// σ, kg.
pub fn with_whole_mass(known: &DMatrix<f64>, sigma_kg: f64) -> DMatrix<f64> {
    let masses = DVector::from_fn(known.nrows(), |row, _| f64::from(u8::from(row % 10 == 0)));
    let with = known * &masses;
    known - &with * with.transpose() / (masses.dot(&with) + sigma_kg * sigma_kg)
}

/// Returns the map from the links' parameters, ten each, to those of the bodies, where some links are fixed
/// to others.
pub fn bodies(model: &Model) -> DMatrix<f64> {
    let rows = 10 * model.welded().links.len();
    let mut map = DMatrix::zeros(rows, 10 * model.links.len());
    let mut unit = model.clone();
    unit.links.iter_mut().for_each(|l| l.nominal = Some([0.0; 10]));
    for column in 0..map.ncols() {
        let (link, k) = (column / 10, column % 10);
        let mut own = [0.0; 10];
        own[k] = 1.0;
        unit.links[link].nominal = Some(own);
        map.column_mut(column).copy_from_slice(&unit.welded().nominal());
        unit.links[link].nominal = Some([0.0; 10]);
    }
    map
}

/// Returns a root of the covariance of a segment's ten parameters: one column for each independent deviation.
fn root(phi: &Parameters, [common, side]: [f64; 2], spread: &Spread) -> Option<DMatrix<f64>> {
    let (mass, centre, about) = shape(phi);
    let third = about.trace() / 3.0;
    if !(mass > 0.0 && third > 0.0) {
        return None;
    }
    let mut root = DMatrix::zeros(10, 10);
    let mut put = |column: usize, mass: f64, moment: Vector3<f64>, inertia: Matrix3<f64>| {
        let six = [
            inertia[(0, 0)],
            inertia[(1, 1)],
            inertia[(2, 2)],
            inertia[(1, 2)],
            inertia[(2, 0)],
            inertia[(0, 1)],
        ];
        let all = std::iter::once(mass).chain(moment.iter().copied()).chain(six);
        all.enumerate().for_each(|(row, value)| root[(row, column)] = value);
    };
    // A heavier segment of the same shape.
    let heavier = common.hypot(side) * mass;
    put(0, heavier, centre * heavier, (square(&centre, &centre) + about / mass) * heavier);
    let gyration = (1.5 * third / mass).sqrt();
    for axis in 0..3 {
        let by = Vector3::ith(axis, spread.centre * gyration);
        put(1 + axis, 0.0, by * mass, (square(&centre, &by) + square(&by, &centre)) * mass);
    }
    let elements = [(0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1)];
    for (k, (i, j)) in elements.into_iter().enumerate() {
        let mut change = Matrix3::zeros();
        change[(i, j)] = spread.inertia * third;
        change[(j, i)] = change[(i, j)];
        put(4 + k, 0.0, Vector3::zeros(), change);
    }
    Some(root)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rigident_model::human::Person;

    #[test]
    fn left_and_right_vary_together_and_the_stature_moves_the_trunk() {
        let model = Person::default().human34().unwrap();
        let spread = Spread { whole: 0.0, tables: 0.0, ..Spread::default().about(Sex::Male, 0.03, false) };
        let found = standard(&model, &spread, &[]).unwrap();
        let at = |name: &str, k: usize| 10 * model.link(name).unwrap() + k;
        let (l, r) = (at("l_thigh", 0), at("r_thigh", 0));
        let mass = model.links[l / 10].nominal.unwrap()[0];
        // var(l − r) = 4 side², var((l + r) / 2) = common².
        let difference = found[(l, l)] + found[(r, r)] - 2.0 * found[(l, r)];
        let mean = (found[(l, l)] + found[(r, r)] + 2.0 * found[(l, r)]) / 4.0;
        assert!((difference.sqrt() / mass - 0.04).abs() < 1e-9 && (mean.sqrt() / mass - 0.12).abs() < 1e-9);
        // Sideways a mirror turns signs: centres of both go outwards together.
        let y = (at("l_foot", 2), at("r_foot", 2));
        assert!(found[y] < 0.0 && found[(at("l_foot", 1), at("r_foot", 1))] > 0.0);
        assert!(found.clone().cholesky().is_some());
        // A stature that is known to 3 % makes Izz of the head 6 % larger, at least.
        let head = at("head", 6);
        let without = standard(&model, &Spread { height: 0.0, ..spread }, &[]).unwrap();
        let izz = model.links[head / 10].nominal.unwrap()[6];
        assert!(((found[(head, head)] - without[(head, head)]).sqrt() / izz - 0.06).abs() < 1e-9);
        assert!((found[(l + 4, l + 4)] - without[(l + 4, l + 4)]).abs() < 1e-12);
    }
    #[test]
    fn a_given_mass_is_that_of_its_link_alone() {
        let model = Person::default().human34().unwrap();
        let given = GivenMass { link: "l_shank".to_owned(), kg: 3.16, sigma_kg: 0.1 };
        let spread = Spread { tables: 0.0, ..Spread::default() };
        let found = standard(&model, &spread, std::slice::from_ref(&given)).unwrap();
        let at = |name: &str| 10 * model.link(name).unwrap();
        let (l, r, thigh) = (at("l_shank"), at("r_shank"), at("l_thigh"));
        let kg = model.links[l / 10].nominal.unwrap()[0];
        assert!((found[(l, l)].sqrt() - 0.1 * kg / 3.16).abs() < 1e-9);
        assert_eq!((found[(l, r)], found[(l, thigh)]), (0.0, 0.0));
        assert!(found[(r, r)].sqrt() > 0.3 && found[(r, thigh)] > 0.0);
        // Other tables leave it alone, too.
        let beside = standard(&model, &Spread::default(), &[given]).unwrap();
        assert_eq!(beside[(l, l)], found[(l, l)]);
    }

    #[test]
    fn other_tables_move_the_parts_of_both_sides() {
        let model = Person { mass_kg: 100.0, ..Person::default() }.human34().unwrap();
        let with = |tables: f64| {
            let spread = Spread { whole: 0.0, tables, ..Spread::default().about(Sex::Male, 0.0, false) };
            standard(&model, &spread, &[]).unwrap()
        };
        let between = with(1.0) - with(0.0);
        let at = |name: &str, k: usize| 10 * model.link(name).unwrap() + k;
        let (l, r, torso) = (at("l_thigh", 0), at("r_thigh", 0), at("torso", 0));
        // Thighs of 10.0, 12.3 and 14.16 kg; a part tells nothing of another one.
        let expected = (4.16_f64.powi(2) + 1.86_f64.powi(2)) / 2.0;
        assert!((between[(l, l)] - expected).abs() < 1e-9 && (between[(l, r)] - expected).abs() < 1e-9);
        assert!(between[(l, torso)].abs() < 1e-12);
        // The upper arm's centre of mass is at 57.7, 43.6 or 45.2 % of its length.
        let arm = at("l_upper_arm", 3);
        assert!(between[(arm, arm)] > (0.1 * 0.2817 * 2.71_f64).powi(2));
    }
}

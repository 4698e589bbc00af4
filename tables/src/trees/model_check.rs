//! The findings of `rigident model check` in published descriptions, and in the same with mistakes put into
//! them.
//!
//! The descriptions are those of the wheel `example-robot-data`. Of links with the same numbers in several
//! files the first counts.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use nalgebra::{Matrix3, Vector3};
use rigident::model::check::of_inertias;
use rigident::model::check::shapes::{Shape, shapes};
use rigident::model::inertial::{Parameters, impossibility};
use rigident::model::{Finding, Model, symmetry, urdf};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::{Body, Position};

/// The change of a tensor, or twice the distance of a centre of mass from the plane over the radius of
/// gyration, from which a mistake is counted apart: it is as large as the body.
const LARGE: f64 = 1.0;
/// The change or distance from which a mistake is counted at all.
const SMALL: f64 = 0.1;

const LIST: &str = "from importlib.metadata import distribution as d
print(*(f.locate() for f in d('example-robot-data').files if f.suffix == '.urdf'), sep='\\n')";

fn files() -> Vec<PathBuf> {
    let python = std::env::var("RIGIDENT_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let output = Command::new(&python).args(["-c", LIST]).output().expect("a Python");
    assert!(output.status.success(), "{python} has no example-robot-data: cargo xtask setup installs it");
    let mut files: Vec<PathBuf> =
        String::from_utf8_lossy(&output.stdout).lines().map(PathBuf::from).collect();
    files.sort();
    files
}

struct Robot {
    name: String,
    model: Model,
    shapes: BTreeMap<String, Shape>,
    /// Indices of the links that no file before had, with an inertia that a body can have.
    links: Vec<usize>,
    /// Findings as published.
    findings: Vec<Finding>,
}

fn robots() -> Vec<Robot> {
    let mut seen = BTreeSet::new();
    let read = |path: PathBuf| {
        let model = urdf::read(&path).ok()?;
        let text = std::fs::read_to_string(&path).ok()?;
        let is_new = |i: &usize| {
            let Some(phi) = model.links[*i].nominal else { return false };
            let key: Vec<String> = phi.iter().map(|v| format!("{v:.5e}")).collect();
            seen.insert(key) && impossibility(&phi).is_none()
        };
        let links = (0..model.links.len()).filter(is_new).collect();
        let shapes = shapes(&text, Path::new(&path));
        let findings = of_inertias(&model, &shapes);
        let name = path.file_stem()?.to_string_lossy().into_owned();
        Some(Robot { name, model, shapes, links, findings })
    };
    files().into_iter().filter_map(read).collect()
}

/// A body: mass, centre of mass, tensor about it.
struct Parts {
    mass: f64,
    centre: Vector3<f64>,
    tensor: Matrix3<f64>,
}

impl Parts {
    fn of(phi: &Parameters) -> Self {
        let body = InertialParameters::<Body, f64>::from_vector(*phi);
        Self { mass: body.mass, centre: body.centre_of_mass().vector(), tensor: body.inertia_com() }
    }

    fn parameters(&self) -> Parameters {
        let [x, y, z] = self.centre.into();
        let centre = Position::new(x, y, z);
        InertialParameters::<Body, f64>::from_centre_of_mass(self.mass, centre, self.tensor).to_vector()
    }

    fn radius(&self) -> f64 {
        (0.5 * self.tensor.trace() / self.mass).sqrt()
    }
}

/// A mistake: what it makes of a body, and how large it is beside the body.
type Mistake = (&'static str, fn(&Parts) -> Vec<(Parts, f64)>);

const MISTAKES: [Mistake; 4] = [
    ("a moment larger than the others' sum", |own| {
        let eigen = nalgebra::SymmetricEigen::new(own.tensor);
        let mut moments = eigen.eigenvalues;
        let at = moments.imax();
        moments[at] = 1.2 * (moments.sum() - moments[at]);
        let tensor = eigen.eigenvectors * Matrix3::from_diagonal(&moments) * eigen.eigenvectors.transpose();
        vec![(Parts { tensor, ..*own }, LARGE)]
    }),
    ("tensor about the link's origin", |own| {
        let c = own.centre;
        let moved = (Matrix3::identity() * c.norm_squared() - c * c.transpose()) * own.mass;
        vec![(Parts { tensor: own.tensor + moved, ..*own }, moved.norm() / own.tensor.norm())]
    }),
    ("products of the wrong sign", |own| {
        let tensor = Matrix3::from_diagonal(&own.tensor.diagonal()) * 2.0 - own.tensor;
        let share = (tensor - own.tensor).norm() / own.tensor.norm();
        // Products are never as large as the moments.
        vec![(Parts { tensor, ..*own }, if share > SMALL { LARGE } else { 0.0 })]
    }),
    ("centre of mass on the other side", |own| {
        let across = |axis: usize| {
            let mut centre = own.centre;
            centre[axis] = -centre[axis];
            (Parts { centre, ..*own }, 2.0 * own.centre[axis].abs() / own.radius())
        };
        (0..3).map(across).collect()
    }),
];

/// Links, and those of which it is reported.
#[derive(Clone, Copy, Default)]
struct Count(usize, usize);

impl Count {
    fn add(&mut self, found: bool) {
        self.0 += 1;
        self.1 += usize::from(found);
    }

    fn join(&mut self, other: Self) {
        self.0 += other.0;
        self.1 += other.1;
    }

    fn words(self) -> String {
        format!("{} of {} ({:.0} %)", self.1, self.0, 100.0 * self.1 as f64 / self.0.max(1) as f64)
    }
}

fn is_reported(findings: &[Finding], name: &str) -> bool {
    findings.iter().any(|finding| finding.place == format!("link {name}"))
}

/// Returns the links of a pair by index.
fn twins(model: &Model) -> BTreeMap<usize, usize> {
    symmetry::images(model)
        .iter()
        .flat_map(|pair| [(pair.left, pair.right), (pair.right, pair.left)])
        .collect()
}

/// Returns the kinds of findings that were put in, by their words.
fn kind(finding: &Finding) -> Option<&'static str> {
    let kinds = [
        ("looks as if it was about the link's origin", "tensor about the link's origin"),
        ("products of inertia have the sign", "products of the wrong sign"),
        ("off the middle of its shapes", "centre of mass on the other side"),
        ("outside of the box", "outside of its shapes"),
        ("no point of its shapes", "outside of its shapes"),
        ("would be the image of", "not the other side's image"),
        ("has the very numbers", "not the other side's image"),
    ];
    kinds.iter().find(|(words, _)| finding.text.contains(words)).map(|(_, kind)| *kind)
}

/// Returns whether coordinates in a shape are correlated: else it does not tell the products' signs.
fn is_lopsided(shape: &Shape) -> bool {
    let of =
        |i: usize, j: usize| shape.second[(i, j)].powi(2) / (shape.second[(i, i)] * shape.second[(j, j)]);
    of(1, 2) + of(2, 0) + of(0, 1) > 0.1 * 0.1
}

/// The counts of one kind of mistake.
#[derive(Clone, Copy, Default)]
struct Reported {
    /// The count in all links.
    all: Count,
    /// The count in links with shapes or a twin.
    detectable: Count,
    /// Mistakes that are smaller than the body.
    small: Count,
    /// The count in links with a twin, or whose shapes have products of their own.
    lopsided: Count,
}

impl Reported {
    /// Puts a mistake into every link, one at a time.
    fn of(make: fn(&Parts) -> Vec<(Parts, f64)>, robots: &[Robot]) -> Self {
        let mut reported = Self::default();
        for robot in robots {
            let twins = twins(&robot.model);
            for &i in &robot.links {
                let twin = twins.get(&i).map(|k| robot.model.links[*k].name.as_str());
                reported.add_link(make, robot, i, twin);
            }
        }
        reported
    }

    /// Puts a mistake into one link; of one that is reported as published nothing is learned.
    fn add_link(
        &mut self,
        make: fn(&Parts) -> Vec<(Parts, f64)>,
        robot: &Robot,
        i: usize,
        twin: Option<&str>,
    ) {
        let link = &robot.model.links[i];
        let before =
            is_reported(&robot.findings, &link.name) || twin.is_some_and(|t| is_reported(&robot.findings, t));
        let Some(phi) = link.nominal.filter(|_| !before) else { return };
        for (wrong, share) in make(&Parts::of(&phi)).into_iter().filter(|(_, share)| *share >= SMALL) {
            let mut model = robot.model.clone();
            let wrong = wrong.parameters();
            model.links[i].nominal = Some(wrong);
            let findings = of_inertias(&model, &robot.shapes);
            let found = impossibility(&wrong).is_some()
                || is_reported(&findings, &link.name)
                || twin.is_some_and(|twin| is_reported(&findings, twin));
            if share < LARGE {
                self.small.add(found);
                continue;
            }
            self.all.add(found);
            let tells = robot.shapes.get(&link.name).is_some_and(is_lopsided);
            if tells || twin.is_some() {
                self.lopsided.add(found);
            }
            if twin.is_some() || robot.shapes.contains_key(&link.name) {
                self.detectable.add(found);
            }
        }
    }
}

/// Makes the tables.
pub fn table() -> String {
    let robots = robots();
    let distinct: usize = robots.iter().map(|robot| robot.links.len()).sum();
    let mut out = format!(
        "{} descriptions, {distinct} distinct links whose inertia a body can have.\n\n",
        robots.len()
    );
    out += &in_one_link(&robots);
    out += &in_whole_files(&robots);
    out += &as_published(&robots, distinct);
    out
}

/// Reports on mistakes in one link.
fn in_one_link(robots: &[Robot]) -> String {
    let mut out = "| mistake in one link | reported | of links with shapes or a twin | smaller mistakes \
                   |\n|---|---|---|---|\n"
        .to_owned();
    let mut lopsided = Count::default();
    let mut sums = [[Count::default(); 2]; 2];
    for (name, make) in MISTAKES {
        let reported = Reported::of(make, robots);
        if name == MISTAKES[2].0 {
            lopsided = reported.lopsided;
        }
        // Impossible tensors are separate: they need no judgement.
        for sum in &mut sums[usize::from(name == MISTAKES[0].0)..] {
            sum[0].join(reported.all);
            sum[1].join(reported.detectable);
        }
        let Reported { all, detectable, small, .. } = reported;
        let smaller = if small.0 > 0 { small.words() } else { "–".to_owned() };
        out += &format!("| {name} | {} | {} | {smaller} |\n", all.words(), detectable.words());
    }
    for (name, sum) in ["the last three", "all"].iter().zip(sums) {
        out += &format!("| {name} | {} | {} | |\n", sum[0].words(), sum[1].words());
    }
    out += &format!(
        "\nProducts of the wrong sign in links with a twin, or whose shapes have products of their own: {}.",
        lopsided.words()
    );
    out
}

/// Reports on whole files with the other convention.
fn in_whole_files(robots: &[Robot]) -> String {
    let is_file_reported = |findings: &[Finding]| findings.iter().any(|finding| finding.place == "model");
    let (_, negate) = MISTAKES[2];
    let mut whole = Count::default();
    for robot in robots {
        let mut model = robot.model.clone();
        let mut matter = 0;
        for link in &mut model.links {
            let Some(phi) = link.nominal.filter(|phi| impossibility(phi).is_none()) else { continue };
            for (wrong, share) in negate(&Parts::of(&phi)) {
                matter +=
                    usize::from(share >= LARGE && robot.shapes.get(&link.name).is_some_and(is_lopsided));
                link.nominal = Some(wrong.parameters());
            }
        }
        if matter >= 3 && !is_file_reported(&robot.findings) {
            whole.add(is_file_reported(&of_inertias(&model, &robot.shapes)));
        }
    }
    format!(
        " In all links of a file, three or more of which have such shapes, they are reported as its \
         convention: {}.\n",
        whole.words()
    )
}

const AS_PUBLISHED: [&str; 4] = [
    "tensor about the link's origin",
    "products of the wrong sign",
    "centre of mass on the other side",
    "not the other side's image",
];

/// Reports the files as they are. What is true of them nobody knows; a file of which three links or
/// more are reported is taken to have mistakes, and what is reported of others for false alarms.
fn as_published(robots: &[Robot], distinct: usize) -> String {
    let reported = |robot: &Robot, i: usize| -> Option<usize> {
        let place = format!("link {}", robot.model.links[i].name);
        let kinds = robot.findings.iter().filter(|finding| finding.place == place).filter_map(kind);
        kinds.filter_map(|kind| AS_PUBLISHED.iter().position(|known| *known == kind)).next()
    };
    let mut counts = [[0; 2]; AS_PUBLISHED.len()];
    let mut names: [Vec<String>; 2] = Default::default();
    for robot in robots {
        let all: Vec<usize> = robot.links.iter().filter_map(|i| reported(robot, *i)).collect();
        let few = usize::from(all.len() < 3);
        for kind in &all {
            counts[*kind][few] += 1;
        }
        if !all.is_empty() {
            names[few].push(format!("{} {}", robot.name, all.len()));
        }
    }
    let mut out =
        "\n| reported as published | links | of files with three or more | of others |\n|---|---|---|---|\n"
            .to_owned();
    for (name, [many, few]) in AS_PUBLISHED.iter().zip(counts) {
        out += &format!("| {name} | {} | {many} | {few} |\n", many + few);
    }
    let alone: usize = counts.iter().map(|[_, few]| few).sum();
    out += &format!(
        "\nThree links or more: {}. Others: {}; {alone} links, {:.1} % of all, of {} files of {}.\n",
        names[0].join(", "),
        names[1].join(", "),
        100.0 * alone as f64 / distinct as f64,
        names[1].len(),
        robots.len()
    );
    out
}

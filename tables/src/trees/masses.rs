//! A humanoid of 23 links on its feet, with a nominal model that is off: ways to masses side by side, as in
//! the paper's Table I.

use std::fmt::Write as _;

use nalgebra::{Matrix4, Vector3};
use rigident::fit::{Factor, Silent, plain_factor};
use rigident::laboratory::on_feet::OnFeet;
use rigident::mass_properties::comparison::{Comparison, Study, Way};
use rigident::mass_properties::methods::Method;
use rigident::mass_properties::unknowns::ParameterSet;
use rigident::model::Model;
use rigident::model::human::Person;
use rigident::rows::tree::TreeSource;
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::Body;

/// Nominal masses, places of centres and radii of gyration are off by this much, uniformly.
const OFF: f64 = 0.2;
const RATE_HZ: f64 = 100.0;
/// 1 σ of torques, N m, forces, N, and moments, N m.
const NOISE: [f64; 3] = [0.2, 2.0, 0.2];

/// The measured quantities and their quality.
struct Case {
    words: &'static str,
    seconds: f64,
    /// Factor of the noise.
    noise: f64,
    without_horizontal: bool,
}

const CASES: [Case; 2] = [
    Case { words: "6 s", seconds: 6.0, noise: 1.0, without_horizontal: true },
    Case { words: "1 s, ten times the noise", seconds: 1.0, noise: 10.0, without_horizontal: true },
];
/// Horizontal forces that read 0.7 times are believed.
const BELIEVED: Case = Case { words: "", seconds: 6.0, noise: 1.0, without_horizontal: false };

/// Returns a number from −1 to 1.
fn number(k: usize) -> f64 {
    ((k as f64 * 12.9898).sin() * 43_758.545_3).fract()
}

/// Returns a nominal model whose links are off, mirror images alike: mass, and the second moments of its mass
/// by a linear map of space.
fn nominal(truth: &Model) -> Model {
    let mut model = truth.clone();
    for link in &mut model.links {
        let side = if link.name.starts_with("r_") { -1.0 } else { 1.0 };
        let stem = link.name.trim_start_matches("l_").trim_start_matches("r_");
        let i = stem.bytes().fold(0, |sum, byte| (31 * sum + usize::from(byte)) % 997);
        let Some(phi) = &mut link.nominal else { continue };
        let own = |k: usize| OFF * number(20 * i + k + 1);
        let pseudo = InertialParameters::<Body, f64>::from_vector(*phi).pseudo_inertia();
        // J ↦ A J Aᵀ is a body again.
        let mut map = Matrix4::identity();
        (0..3).for_each(|k| map[(k, k)] += 0.5 * own(k));
        let centre = Vector3::new(phi[1], phi[2], phi[3]) / phi[0];
        (0..3).for_each(|k| map[(k, 3)] = centre.norm() * 0.5 * own(3 + k));
        map[(1, 3)] *= side;
        let moved = map * pseudo * map.transpose() * (1.0 + own(6));
        *phi = of_pseudo(&moved);
    }
    model
}

/// Returns the parameters of a pseudo-inertia `[Σ h; hᵀ m]`: the tensor is `tr Σ − Σ`.
fn of_pseudo(j: &Matrix4<f64>) -> [f64; 10] {
    let trace = j[(0, 0)] + j[(1, 1)] + j[(2, 2)];
    let at = |i: usize, k: usize| if i == k { trace - j[(i, i)] } else { -j[(i, k)] };
    let first = [j[(3, 3)], j[(0, 3)], j[(1, 3)], j[(2, 3)]];
    let tensor = [at(0, 0), at(1, 1), at(2, 2), at(1, 2), at(2, 0), at(0, 1)];
    std::array::from_fn(|k| if k < 4 { first[k] } else { tensor[k - 4] })
}

fn factors(truth: &Model, case: &Case) -> (TreeSource, Vec<Factor>) {
    let feet: Vec<usize> = ["l_foot", "r_foot"].iter().filter_map(|name| truth.link(name)).collect();
    let mut first = None;
    let mut factors = Vec::new();
    for motion in 0..3 {
        let run = OnFeet {
            feet: [feet[0], feet[1]],
            rate_hz: RATE_HZ,
            seconds: case.seconds,
            start_s: 100.0 * f64::from(motion),
            sizes: [0.05, 0.03, 0.5],
            noise: NOISE.map(|sigma| case.noise * sigma),
            horizontal_scale: 0.7,
            without_horizontal: case.without_horizontal,
            seed: motion as u64 + 1,
        };
        let input = run.input(truth).expect("a person");
        let source = match &first {
            None => TreeSource::new(input).expect("rows"),
            Some(first) => TreeSource::of_same_model(first, input).expect("rows"),
        };
        let sigma = source.input().channel_sigma.clone().expect("stated");
        factors.push(plain_factor(&source, &sigma, &Silent).expect("rows"));
        first.get_or_insert(source);
    }
    (first.expect("three motions"), factors)
}

fn study<'a>(nominal: &'a Model, source: &'a TreeSource, parts: &'a [Factor], symmetric: bool) -> Study<'a> {
    Study {
        model: nominal,
        base: source.base(),
        parts,
        set: ParameterSet::MassAndMoment,
        symmetric,
        least: 0.1,
    }
}

fn compared(nominal: &Model, source: &TreeSource, parts: &[Factor], symmetric: bool) -> Comparison {
    let truncated = |condition| Way::Relative(Method::Truncated { condition });
    let gradient = |steps| Way::Relative(Method::Gradient { steps });
    let fixed = [truncated(1e6), truncated(1e3), truncated(1e2), gradient(20), gradient(100), gradient(1000)];
    let chosen = [
        Way::Relative(Method::Bounded),
        Way::Relative(Method::Ridge { weight: 1.0 }),
        Way::Consistent { trust: 0.3 },
    ];
    study(nominal, source, parts, symmetric).compare(&chosen, &fixed, &|_| {}).expect("a study")
}

/// Returns the table.
pub fn table() -> String {
    let truth = Person::default().human58().expect("a person");
    let nominal = nominal(&truth);
    let mut out = String::new();
    let mut conditions = Vec::new();
    out.push_str(
        "| each of three motions | unknowns | way | setting | cost | left out | masses ≤ 0 | links \
                  that cannot be |\n|---|---|---|---|---|---|---|---|\n",
    );
    for case in &CASES {
        let (source, factors) = factors(&truth, case);
        for symmetric in [false, true] {
            let found = compared(&nominal, &source, &factors, symmetric);
            conditions.push((found.unknowns, found.rank, found.condition));
            let (n, words) = (found.unknowns, case.words);
            for own in &found.outcomes {
                let left = own.left_out.as_ref().map_or(f64::NAN, |left| left.squares / found.nominal);
                let _ = writeln!(
                    out,
                    "| {words} | {n} | {} | {} | {:.5} | {left:.5} | {} | {} |",
                    own.way.name().text(),
                    own.way.setting(),
                    own.direct / found.nominal,
                    own.negative,
                    own.impossible
                );
            }
        }
    }
    let conditions: Vec<String> = conditions
        .iter()
        .take(2)
        .map(|(n, rank, condition)| {
            format!("{condition:.1e} of {n} unknowns, of whose directions {rank} are determined")
        })
        .collect();
    let (source, factors) = factors(&truth, &BELIEVED);
    let found =
        study(&nominal, &source, &factors, false).compare(&[Way::Consistent { trust: 0.3 }], &[], &|_| {});
    let believed = found.map_or(f64::NAN, |found| found.outcomes[0].direct / found.nominal);
    let _ = write!(
        out,
        "\nCondition numbers of 6 s: {}. Were the horizontal forces used, which read 0.7 times their value, \
         the consistent bodies would leave {believed:.3} of 6 s.\n",
        conditions.join("; ")
    );
    out
}

//! Loadings of a cell of six struts, whose weights, holes, level and bridges are not as they should be.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use super::contradiction::Contradiction;
use super::{LoadCellError, Uncertainty, calibrate, table};

const GRAVITY: f64 = 9.81;
/// V at 100 N in a strut: 1 mV/V of a bridge at 2.5 V.
const VOLTS_AT_100_N: f64 = 2.5e-3;

/// Returns the forces in three upright struts and three tangential ones at 60 mm, by equilibrium of the
/// plate, strut by strut.
fn struts(w: [f64; 6]) -> [f64; 6] {
    let r = 0.06;
    let at = [0.0_f64, 120.0, 240.0].map(f64::to_radians);
    let up = at.map(|a| w[2] / 3.0 + 2.0 / (3.0 * r) * (w[3] * a.sin() - w[4] * a.cos()));
    let round = at.map(|a| w[5] / (3.0 * r) + 2.0 / 3.0 * (w[1] * a.cos() - w[0] * a.sin()));
    [up[0], up[1], up[2], round[0], round[1], round[2]]
}

struct World {
    random: ChaCha8Rng,
    /// Bends the bridges: share of full scale at full scale.
    bend: f64,
    noise_v: f64,
    truth: Uncertainty,
}

/// Directions of gravity in the cell's axes, and holes that weights hang from.
const WAYS: [([f64; 3], &[[f64; 3]]); 3] = [
    ([0.0, 0.0, -1.0], &[[0.08, 0.0, 0.02], [-0.08, 0.0, 0.02], [0.0, 0.08, 0.02], [0.0, -0.08, 0.02]]),
    ([1.0, 0.0, 0.0], &[[0.0, 0.08, 0.03], [0.0, -0.08, 0.03], [0.0, 0.0, 0.12]]),
    ([0.0, 1.0, 0.0], &[[0.08, 0.0, 0.03], [-0.08, 0.0, 0.03], [0.0, 0.0, 0.12]]),
];

impl World {
    fn new(seed: u64) -> Self {
        let truth = Uncertainty { reading_v: Some(2e-7), ..Uncertainty::default() };
        Self { random: ChaCha8Rng::seed_from_u64(seed), bend: 0.0, noise_v: 2e-7, truth }
    }

    fn draw(&mut self, sd: f64) -> f64 {
        let z: f64 = StandardNormal.sample(&mut self.random);
        sd * z
    }

    /// Returns a table as it is typed in, its cells by rows, and the voltages at a newton or newton metre of
    /// each component.
    fn table(&mut self, ways: usize) -> (Vec<[f64; 13]>, [[f64; 6]; 6]) {
        let gains: [f64; 6] = std::array::from_fn(|_| VOLTS_AT_100_N / 100.0 * (1.0 + self.draw(0.03)));
        let lean: [[f64; 6]; 6] = std::array::from_fn(|_| std::array::from_fn(|_| self.draw(0.01)));
        let bridge = |w: [f64; 6]| -> [f64; 6] {
            let pure = struts(w);
            std::array::from_fn(|j| gains[j] * (pure[j] + (0..6).map(|k| lean[j][k] * pure[k]).sum::<f64>()))
        };
        let unit = |k: usize| bridge(std::array::from_fn(|i| f64::from(u8::from(i == k))));
        let answers = std::array::from_fn(unit);
        let masses = [1.0, 2.0, 5.0].map(|m| (m, m * (1.0 + self.draw(self.truth.mass))));
        let zero: [f64; 6] = std::array::from_fn(|_| self.draw(1e-4));
        let mut rows = Vec::new();
        for (down, holes) in WAYS.into_iter().take(ways) {
            // The cell leans a little, another way each time that it is turned.
            let [a, b, c]: [f64; 3] = std::array::from_fn(|_| self.draw(self.truth.level_rad));
            let [x, y, z] = down;
            let leaning = [x + b * z - c * y, y + c * x - a * z, z + a * y - b * x];
            let mut loads = vec![((0.0, 0.0), [0.0; 3], [0.0; 3]); 2];
            for hole in holes {
                let bored = hole.map(|v| v + self.draw(self.truth.place_m));
                loads.extend(masses.map(|mass| (mass, *hole, bored)));
            }
            for (mass, hole, p) in loads {
                let f = leaning.map(|d| -mass.1 * GRAVITY * d);
                let cross = |i: usize, j: usize| p[i] * f[j] - p[j] * f[i];
                let read = bridge([f[0], f[1], f[2], cross(1, 2), cross(2, 0), cross(0, 1)]);
                let bent = |v: f64| v + self.bend * v * v / VOLTS_AT_100_N;
                let volts: Vec<f64> = (0..6).map(|j| zero[j] + bent(read[j])).collect();
                let mut row = [mass.0, hole[0], hole[1], hole[2], x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
                for (j, volts) in volts.into_iter().enumerate() {
                    row[7 + j] = volts + self.draw(self.noise_v);
                }
                rows.push(row);
            }
        }
        (rows, answers)
    }
}

fn typed(rows: &[[f64; 13]]) -> String {
    let head = "mass_kg,x_m,y_m,z_m,down_x,down_y,down_z,g1_v,g2_v,g3_v,g4_v,g5_v,g6_v\n";
    let line = |row: &[f64; 13]| row.map(|v| format!("{v:.9}")).join(",") + "\n";
    head.to_owned() + &rows.iter().map(line).collect::<String>()
}

fn solved(rows: &[[f64; 13]], uncertainty: &Uncertainty) -> Result<super::matrix::Matrix, LoadCellError> {
    calibrate(&table::parse(&typed(rows), "weights.csv", GRAVITY, None)?, uncertainty)
}

/// What a component at full scale is read as, `K B − 1` of the true answers, is inside its interval as often
/// as stated; noise of readings given, and found.
#[test]
fn gains_and_cross_talk_are_inside_their_intervals() {
    for given in [true, false] {
        let (mut outside, mut all, mut squares) = (0_usize, 0, 0.0);
        for seed in 0..24 {
            let mut world = World::new(seed);
            let (rows, answers) = world.table(3);
            let said = Uncertainty { reading_v: world.truth.reading_v.filter(|_| given), ..world.truth };
            let found = solved(&rows, &said).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
            for a in 0..6 {
                for b in 0..6 {
                    let scale = found.full_scale[b / 3] / found.full_scale[a / 3];
                    let read: f64 = (0..6).map(|j| found.matrix[a][j] * answers[b][j]).sum();
                    let error = (read - f64::from(u8::from(a == b))) * scale;
                    outside += usize::from(error.abs() > found.error_u95[a][b]);
                    squares += (error / found.error_u95[a][b]).powi(2);
                    all += 1;
                }
            }
            assert!(found.worst_u95() < 0.03, "{}", found.worst_u95());
            assert!(found.condition_number < 6.0, "{}", found.condition_number);
        }
        // 864 errors, about ten of which in a table are independent: 5 % within four of their standard
        // deviations.
        let share = outside as f64 / f64::from(all);
        assert!((0.01..0.11).contains(&share), "{outside} of {all} outside, noise given: {given}");
        let rms = (squares / f64::from(all)).sqrt() * 1.96;
        assert!((0.85..1.15).contains(&rms), "errors are {rms} of what was said, noise given: {given}");
    }
}

#[test]
fn a_component_that_nothing_loads_is_named() {
    let (rows, _) = World::new(1).table(1);
    let error = solved(&rows, &Uncertainty::default()).unwrap_err();
    assert!(matches!(error, LoadCellError::Lacks { component: "fx" | "fy" | "mz" }), "{error}");
    let (rows, _) = World::new(1).table(3);
    let on_axis: Vec<_> =
        rows.iter().filter(|row| row[6] != 0.0 || row[1] == 0.0 && row[2] == 0.0).copied().collect();
    let error = solved(&on_axis, &Uncertainty::default()).unwrap_err();
    assert_eq!(error, LoadCellError::Lacks { component: "mz" });
    let error = solved(&rows[..5], &Uncertainty::default()).unwrap_err();
    assert_eq!(error, LoadCellError::TooFew { given: 5 });
}

/// A weight typed wrongly, a place with two columns exchanged, a reading with a digit lost.
#[test]
fn a_loading_with_a_slip_is_named_by_its_line_and_honest_ones_are_not() {
    for seed in 0..12 {
        let (rows, _) = World::new(100 + seed).table(3);
        let at = 3 + 3 * (seed as usize) % (rows.len() - 4);
        type Slip = fn(&mut [f64; 13]);
        let slips: [(&str, Slip); 3] = [
            ("mass", |row| row[0] = if row[0] == 0.0 { 1.0 } else { 1.5 * row[0] }),
            ("place", |row| row.swap(1, 2)),
            ("reading", |row| row[8] += 2e-4),
        ];
        for (name, slip) in slips {
            let mut wrong = rows.clone();
            slip(&mut wrong[at]);
            if wrong[at] == rows[at] || name == "place" && rows[at][0] == 0.0 {
                continue;
            }
            let error = solved(&wrong, &Uncertainty::default()).unwrap_err();
            let line = at as u64 + 2;
            let named = matches!(&error, LoadCellError::Contradicts(Contradiction::Loading { line: own, .. }) if *own == line);
            assert!(named, "{name} in line {line}, seed {seed}: {error}");
        }
    }
}

/// A weight that is 3 % heavier than it says, in each of its loadings.
#[test]
fn a_weight_off_its_stated_mass_is_named() {
    let (mut rows, _) = World::new(7).table(3);
    rows.iter_mut().filter(|row| row[0] == 2.0).for_each(|row| row[0] = 2.06);
    let error = solved(&rows, &Uncertainty { reading_v: Some(2e-7), ..Uncertainty::default() }).unwrap_err();
    assert!(error.to_string().contains("weight 2.06 kg"), "{error}");
}

/// Bridges that bend by 1 % of full scale: what is left says so, and the intervals grow with it.
#[test]
fn bridges_that_bend_leave_residuals() {
    let straight = solved(&World::new(3).table(3).0, &Uncertainty::default()).unwrap();
    let bent = solved(&World { bend: 1e-2, ..World::new(3) }.table(3).0, &Uncertainty::default()).unwrap();
    assert!(bent.reading_v > 2.0 * straight.reading_v, "{} {}", bent.reading_v, straight.reading_v);
    assert!(bent.largest_residual > 2.0 * straight.largest_residual);
}

#[test]
fn unreadable_tables_name_the_place_and_the_remedy() {
    let head = "mass_kg,x_m,y_m,z_m,g1_v,g2_v,g3_v,g4_v,g5_v,g6_v\n";
    for (text, words) in [
        ("", "there is no loading"),
        (head, "there is no loading"),
        ("mass,x\n1,2\n", "column mass is none of a table of loadings"),
        (&format!("{head}1,0,0,0,1,2,3,4,5,6,7\n"), "field"),
        (&format!("{head}1,0,0,0,1,2,3,4,5,nan\n"), "line 2, column g6_v: \"nan\" is no number"),
        (&format!("{head}1,0,0,0,1,2,3,4,5,\n"), "line 2: g6_v is missing"),
        (&format!("{head}1,80,0,0,1,2,3,4,5,6\n"), "are places in mm?"),
        (&format!("{head}-1,0,0,0,1,2,3,4,5,6\n"), "is no weight"),
        (&format!("{head}1,,,,1,2,3,4,5,6\n"), "hang at no place"),
        (&format!("{head},,,,1,2,3,4,5,6\n"), "line 2 has no load"),
        (
            "mass_kg,x_m,y_m,z_m,down_x,down_y,down_z,from_s,to_s\n1,0,0,0,0,0,-9.81,1,2\n",
            "no recording is given",
        ),
        (
            &format!(
                "{}\n1,0,0,0,1,2,3,4,5,6,0,0,-9.81\n",
                head.trim_end().to_owned() + ",down_x,down_y,down_z"
            ),
            "have the length 9.81",
        ),
    ] {
        let message = match table::parse(text, "weights.csv", GRAVITY, None) {
            Err(error) => error.to_string(),
            Ok(_) => "it was read".to_owned(),
        };
        assert!(message.starts_with("weights.csv: ") && message.contains(words), "{text:?}: {message}");
    }
}

/// The arrangement of docs/wiring.md: condition number √2 with moments over 60 mm, and the loads at which a
/// bar of 10 kg is full.
#[test]
fn six_struts_have_the_condition_and_the_ranges_that_the_documents_say() {
    let unit =
        |k: usize| -> [f64; 6] { std::array::from_fn(|i| if i == k { [1.0, 0.06][k / 3] } else { 0.0 }) };
    let answers = nalgebra::Matrix6::from_fn(|j, k| struts(unit(k))[j]);
    let singular = answers.svd(false, false).singular_values;
    assert!((singular.max() / singular.min() - 2.0_f64.sqrt()).abs() < 1e-9);
    let bar_n = 10.0 * 9.80665;
    let range = |k: usize| {
        let largest = struts(unit(k)).into_iter().fold(0.0, |a: f64, f| a.max(f.abs()));
        bar_n / largest * [1.0, 0.06][k / 3]
    };
    for (k, said) in [170.0, 147.0, 294.0, 10.2, 8.8, 17.7].into_iter().enumerate() {
        assert!((range(k) / said - 1.0).abs() < 0.005, "{}: {} and {said}", super::COMPONENTS[k], range(k));
    }
}

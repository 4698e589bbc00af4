//! Segments of people: P. de Leva, "Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters",
//! Journal of Biomechanics 29 (9), 1996, table 4. Distances between joints that the table has not (shoulders,
//! hips, ankle's height) are fractions of the stature by R. Drillis and R. Contini, "Body segment
//! parameters", New York University, 1966, as D. Winter's textbook figure of segment lengths has them.
//!
//! Every figure of the table was checked against two independent transcriptions: masses, centres of mass and
//! radii against the files `BSPmale_ZdeLeva.txt` and `BSPfemale_ZdeLeva.txt` of the course
//! <https://github.com/BMClab/BMC> (segments `Head 2` and `Shank 2` for head and shank); these and all
//! lengths, statures and masses against R. Gurchiek's function `deleva` (2018).
//!
//! They are means of young adults: a nominal guess, no measurement of anybody.

/// The sex of the means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sex {
    /// Women's: mean stature 1.735 m, 61.9 kg.
    Female,
    /// Men's: mean stature 1.741 m, 73.0 kg.
    Male,
    /// The means of both.
    #[default]
    Unknown,
}

impl Sex {
    /// Returns whose means they are, in words: 15 women of 19 years and 100 men of 24 on average, students
    /// (V. Zatsiorsky et al. 1990).
    pub fn words(self) -> &'static str {
        match self {
            Self::Female => "young women (19 ± 0.3 years)",
            Self::Male => "young men (24 ± 6 years)",
            Self::Unknown => "young women and men (19 to 30 years), the mean of both",
        }
    }
}

/// A segment as the table has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Length over stature.
    pub length: f64,
    /// Mass over the body's.
    pub mass: f64,
    /// Centre of mass from the proximal end, over the length.
    pub com: f64,
    /// Radii of gyration about the sagittal (forward), transverse (sideways) and longitudinal axis through
    /// the centre of mass, over the length.
    pub radii: [f64; 3],
}

/// Index of a segment in the tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "segments by their names")]
pub enum Part {
    Head,
    UpperTrunk,
    MiddleTrunk,
    LowerTrunk,
    UpperArm,
    Forearm,
    Hand,
    Thigh,
    Shank,
    Foot,
}

/// Stature, then for every part length (mm), mass (%), centre of mass (%), radii (%).
type Table = (f64, [[f64; 6]; 10]);

/// Head from the cervical vertebra, trunk parts downwards, shank to the lateral malleolus, hand to the third
/// metacarpal, foot from heel to toes.
const FEMALE: Table = (
    1735.0,
    [
        [243.7, 6.68, 48.41, 27.1, 29.5, 26.1],
        [142.5, 15.45, 20.77, 74.6, 50.2, 71.8],
        [205.3, 14.65, 45.12, 43.3, 35.4, 41.5],
        [181.5, 12.47, 49.20, 43.3, 40.2, 44.4],
        [275.1, 2.55, 57.54, 27.8, 26.0, 14.8],
        [264.3, 1.38, 45.59, 26.1, 25.7, 9.4],
        [78.0, 0.56, 74.74, 53.1, 45.4, 33.5],
        [368.5, 14.78, 36.12, 36.9, 36.4, 16.2],
        [432.3, 4.81, 44.16, 27.1, 26.7, 9.3],
        [228.3, 1.29, 40.14, 29.9, 27.9, 13.9],
    ],
);

const MALE: Table = (
    1741.0,
    [
        [242.9, 6.94, 50.02, 30.3, 31.5, 26.1],
        [170.7, 15.96, 29.99, 71.6, 45.4, 65.9],
        [215.5, 16.33, 45.02, 48.2, 38.3, 46.8],
        [145.7, 11.17, 61.15, 61.5, 55.1, 58.7],
        [281.7, 2.71, 57.72, 28.5, 26.9, 15.8],
        [268.9, 1.62, 45.74, 27.6, 26.5, 12.1],
        [86.2, 0.61, 79.00, 62.8, 51.3, 40.1],
        [422.2, 14.16, 40.95, 32.9, 32.9, 14.9],
        [434.0, 4.33, 44.59, 25.5, 24.9, 10.3],
        [258.1, 1.37, 44.15, 25.7, 24.5, 12.4],
    ],
);

/// Half the distance between the shoulders over the stature.
pub const SHOULDER: f64 = 0.129;
/// Half the distance between the hips over the stature: half of the half breadth, where the joints' centres
/// are.
pub const HIP: f64 = 0.191 / 4.0;
/// Height of the ankle over the stature.
pub const ANKLE: f64 = 0.039;

/// Returns the row of a part.
pub fn segment(part: Part, sex: Sex) -> Segment {
    let (stature, rows) = match sex {
        Sex::Female => FEMALE,
        Sex::Male => MALE,
        Sex::Unknown => return between(segment(part, Sex::Female), segment(part, Sex::Male)),
    };
    let [length, mass, com, x, y, z] = rows[part as usize];
    let share = |v: f64| v / 100.0;
    Segment {
        length: length / stature,
        mass: share(mass),
        com: share(com),
        radii: [share(x), share(y), share(z)],
    }
}

/// Returns the mean of two segments.
fn between(a: Segment, b: Segment) -> Segment {
    let mean = |a: f64, b: f64| f64::midpoint(a, b);
    Segment {
        length: mean(a.length, b.length),
        mass: mean(a.mass, b.mass),
        com: mean(a.com, b.com),
        radii: std::array::from_fn(|k| mean(a.radii[k], b.radii[k])),
    }
}

/// A segment by another table over the same by this one: mass, centre of mass from the proximal end, radius
/// of gyration across the segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ratio {
    /// The ratio of the masses.
    pub mass: f64,
    /// The ratio of the distances of the centre of mass from the proximal end.
    pub com: f64,
    /// The ratio of the radii of gyration.
    pub radius: f64,
}

/// Mass (%), and centre of mass and radius of gyration across the segment over the distance between its
/// joints (%); 0 where ends or axes are other ones than here. Head and neck, trunk above the pelvis, pelvis,
/// upper arm, forearm, hand, thigh, shank, foot. The trunk's centre of mass is that above its lowest joint
/// over the stature (%).
type Other = [[f64; 3]; 9];

/// W. Dempster's cadavers of men (1955), as D. Winter's textbook has them (table 4.1): thorax and abdomen
/// have their centre of mass at 63 % of the way from C7 to L4, which is 26 % of the stature.
const DEMPSTER: Other = [
    [8.1, 0.0, 0.0],
    [35.5, 9.6, 0.0],
    [14.2, 0.0, 0.0],
    [2.8, 43.6, 32.2],
    [1.6, 43.0, 30.3],
    [0.6, 0.0, 0.0],
    [10.0, 43.3, 32.3],
    [4.65, 43.3, 30.2],
    [1.45, 0.0, 0.0],
];

/// R. Dumas et al. (2007) after J. McConville (men) and J. Young (women): women's, then men's; the torso is
/// 429 and 477 mm long at a stature of 1.61 and 1.77 m, its centre of mass at 43.6 and 42.0 % from above.
const DUMAS: [Other; 2] = [
    [
        [6.7, 0.0, 0.0],
        [30.4, 15.0, 0.0],
        [14.6, 0.0, 0.0],
        [2.2, 45.4, 33.0],
        [1.3, 41.1, 25.5],
        [0.5, 0.0, 0.0],
        [14.6, 37.7, 31.5],
        [4.5, 40.4, 28.0],
        [1.0, 0.0, 0.0],
    ],
    [
        [6.7, 0.0, 0.0],
        [33.3, 15.6, 0.0],
        [14.2, 0.0, 0.0],
        [2.4, 45.2, 31.5],
        [1.7, 41.7, 27.5],
        [0.6, 0.0, 0.0],
        [12.3, 42.9, 29.5],
        [4.8, 41.0, 28.0],
        [1.2, 0.0, 0.0],
    ],
];

/// Returns a segment by each of two other tables, W. Dempster's and that of R. Dumas et al., over this one's:
/// the parts of it are a segment of theirs.
pub fn other_tables(parts: &[Part], sex: Sex) -> [Ratio; 2] {
    [[DEMPSTER; 2], DUMAS].map(|[women, men]| {
        let at = match parts[0] {
            Part::Head => 0,
            Part::UpperTrunk | Part::MiddleTrunk => 1,
            Part::LowerTrunk => 2,
            limb => limb as usize - 1,
        };
        let other: [f64; 3] = std::array::from_fn(|k| match sex {
            Sex::Female => women[at][k],
            Sex::Male => men[at][k],
            Sex::Unknown => f64::midpoint(women[at][k], men[at][k]),
        });
        let own: Vec<Segment> = parts.iter().map(|part| segment(*part, sex)).collect();
        let over = |other: f64, own: f64| if other > 0.0 { other / 100.0 / own } else { 1.0 };
        let mass: f64 = own.iter().map(|own| own.mass).sum();
        let com = match own.as_slice() {
            // Both parts' centres above the lower one's end.
            [upper, middle] => {
                let above =
                    [middle.length + upper.length * (1.0 - upper.com), middle.length * (1.0 - middle.com)];
                (upper.mass * above[0] + middle.mass * above[1]) / mass
            }
            _ => own[0].com,
        };
        Ratio {
            mass: over(other[0], mass),
            com: over(other[1], com),
            radius: over(other[2], f64::midpoint(own[0].radii[0], own[0].radii[1])),
        }
    })
}

//! Names and units as other programs give them to columns, and the columns that they mean here.
//!
//! Nothing is taken by its name alone: its unit must be written somewhere and fit the quantity.

use std::collections::BTreeMap;

use super::columns::{Group, Known};
use super::text::vendors::is_catman_time;
use crate::rig::{ColumnSource, Quantity, ScaledColumn, Unit};

/// Words for a time.
const TIMES: &[&str] = &[
    "t",
    "time",
    "times",
    "zeit",
    "timestamp",
    "timestamps",
    "zeitstempel",
    "stamp",
    "xvalue",
    "elapsedtime",
    "elapsed",
    "timeaxis",
    "messzeit",
    "temps",
    "tiempo",
    "tempo",
    "tijd",
    "datetime",
    "datumzeit",
    "zeitachse",
    "abstime",
    "abszeit",
    "uhrzeit",
    "timeofday",
    "heure",
    "hora",
    "ora",
    "tid",
    "czas",
    "godzina",
    "čas",
    "idő",
];

/// Words before or after an axis, and the quantity.
const WORDS: &[(Quantity, &[&str])] = &[
    // German, French, Spanish, Italian, Dutch, Polish (as Windows-1250 reads as Windows-1252, too).
    (
        Quantity::Force,
        &["f", "force", "forces", "kraft", "frc", "effort", "fuerza", "forza", "kracht", "siła", "si³a"],
    ),
    (
        Quantity::Moment,
        &[
            "m",
            "t",
            "moment",
            "moments",
            "torque",
            "torques",
            "drehmoment",
            "mom",
            "trq",
            "couple",
            "momento",
            "coppia",
            "koppel",
        ],
    ),
    (
        Quantity::Acceleration,
        &[
            "a",
            "acc",
            "accel",
            "acceleration",
            "accelerometer",
            "beschleunigung",
            "accélération",
            "aceleración",
            "accelerazione",
            "versnelling",
            "przyspieszenie",
            "specificforce",
            "imua",
            "imuacc",
        ],
    ),
    (
        Quantity::AngularRate,
        &[
            "g",
            "w",
            "gyr",
            "gyro",
            "gyroscope",
            "omega",
            "angularvelocity",
            "angularrate",
            "angvel",
            "drehrate",
            "winkelgeschwindigkeit",
            "vitesseangulaire",
            "velocidadangular",
            "velocitàangolare",
            "hoeksnelheid",
            "prędkośćkątowa",
            "prêdkoœæk¹towa",
            "rate",
            "imug",
            "imugyr",
            "imugyro",
        ],
    ),
];

/// The meaning of a column of another program's file by its name.
#[derive(Clone, Debug, PartialEq)]
pub struct Meaning {
    /// Name of the column here: `fx_n`.
    pub known: String,
    /// The quantity in the column.
    pub quantity: Quantity,
    /// The unit as it is written; `None` if it is written nowhere.
    pub unit: Option<String>,
}

/// Returns the meaning of a column by its name; `stated` is its unit where a row of units or a line above the
/// table has it. `None` if nothing known is named so, or its unit is of another quantity.
pub fn meaning(name: &str, stated: Option<&str>) -> Option<Meaning> {
    let (base, own) = parted(name)?;
    let unit = own.or(stated.filter(|text| Unit::parse(text).is_some())).map(str::to_owned);
    let measured = unit.as_deref().and_then(Unit::parse).map(|unit| unit.quantity);
    // A unit that nobody knows says that the column is something else.
    if stated.is_some() && measured.is_none() {
        return None;
    }
    let plain = plain(base);
    if is_time(base) || is_catman_time(base.trim()) {
        let fits = measured.is_none_or(|quantity| quantity == Quantity::Time);
        return fits.then(|| Meaning { known: "t_s".to_owned(), quantity: Quantity::Time, unit });
    }
    let axis = |c: Option<char>| ['x', 'y', 'z'].iter().position(|axis| Some(*axis) == c);
    let mut letters = plain.chars();
    let (k, word) = match (axis(plain.chars().last()), axis(plain.chars().next())) {
        (Some(k), _) => {
            letters.next_back();
            (k, letters.as_str())
        }
        (None, Some(k)) => {
            letters.next();
            (k, letters.as_str())
        }
        (None, None) => return None,
    };
    // A word and then the letter: "Kraft Fx".
    let is_doubled = |words: &[&str]| {
        let letter = word.char_indices().last().filter(|(at, _)| *at > 2).map(|(at, _)| word.split_at(at));
        letter.is_some_and(|(rest, letter)| words.contains(&rest) && words.contains(&letter))
    };
    let (quantity, _) = *WORDS.iter().find(|(quantity, words)| {
        (words.contains(&word) || is_doubled(words)) && measured.is_none_or(|own| own == *quantity)
    })?;
    let (group, k) = match quantity {
        Quantity::Force => (Group::Wrench, k),
        Quantity::Moment => (Group::Wrench, k + 3),
        Quantity::Acceleration => (Group::Accel(0), k),
        _ => (Group::Gyro(0), k),
    };
    Some(Meaning { known: Known::Member(group, k).name(), quantity, unit })
}

/// Returns the letters and digits of a name, small.
fn plain(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// Returns true for a word for a time.
fn is_time(name: &str) -> bool {
    TIMES.contains(&plain(name).as_str())
}

/// Parts a unit off a name: `Fx [N]`, `Fx (N)`, `F_x/N`, `TimeStamp_ms`; `None` if it is in a unit that is
/// not known.
fn parted(name: &str) -> Option<(&str, Option<&str>)> {
    let name = name.trim();
    for (open, close) in [('[', ']'), ('(', ')'), ('{', '}')] {
        if let Some((base, rest)) = name.split_once(open)
            && let Some((unit, after)) = rest.split_once(close)
            && after.trim().is_empty()
        {
            let own = Some(unit.trim()).filter(|unit| Unit::parse(unit).is_some());
            // In round brackets there may be a remark.
            return (own.is_some() || open == '(').then_some((base, own));
        }
    }
    let by = |mark: char| {
        let (base, unit) = name.split_once(mark)?;
        (Unit::parse(unit).is_some() && !base.trim().is_empty()).then_some((base, Some(unit.trim())))
    };
    let by_last = |mark: char| {
        let (base, unit) = name.rsplit_once(mark)?;
        // x and z are axes; a letter alone may be one of a name, but not after a time or an axis: time_s,
        // Fx_N, acc_x_g.
        let is_unit = match unit {
            "s" => is_time(base),
            "N" | "g" => base.ends_with(['x', 'y', 'z', 'X', 'Y', 'Z']),
            _ => unit.len() > 1,
        };
        (is_unit && Unit::parse(unit).is_some() && !base.is_empty()).then_some((base, Some(unit)))
    };
    Some(by('/').or_else(|| by_last('_')).or_else(|| by_last(' ')).unwrap_or((name, None)))
}

/// Returns the unit that a name ends in; `None` if it ends in none that is known.
pub fn unit_of(name: &str) -> Option<&str> {
    parted(name)?.1
}

/// Returns the units of forces and moments that lines above a table state, as ATI's logs do:
/// `Force Units: N`.
pub fn units_above(lines: &[String]) -> Vec<(Quantity, String)> {
    let mut found = Vec::new();
    for (quantity, key) in [(Quantity::Force, "force unit"), (Quantity::Moment, "torque unit")] {
        for line in lines {
            let low = line.to_lowercase();
            // Lengths in bytes are those of the line where there is nothing but ASCII.
            let Some(at) = low.find(key).filter(|_| line.is_ascii()) else { continue };
            let rest = line.get(at + key.len()..).unwrap_or_default();
            let value = rest.trim_start_matches(['s', 'S', ':', ';', ',', '=', '"', '\t', ' ']);
            let value = value.split(['"', ';', ',', '\t']).next().unwrap_or_default().trim();
            if Unit::parse(value).is_some_and(|unit| unit.quantity == quantity) {
                found.push((quantity, value.to_owned()));
                break;
            }
        }
    }
    found
}

/// Returns the meaning of each column of a table, by names, its row of units and lines above it.
pub fn meanings(names: &[String], units: &[Option<String>], above: &[String]) -> Vec<Option<Meaning>> {
    let stated = units_above(above);
    let of = |(k, name): (usize, &String)| {
        let mut found = meaning(name, units.get(k).and_then(Option::as_deref))?;
        if found.unit.is_none() {
            let own = stated.iter().find(|(quantity, _)| *quantity == found.quantity);
            found.unit = own.map(|(_, unit)| unit.clone());
        }
        Some(found)
    };
    names.iter().enumerate().map(of).collect()
}

/// Returns where the columns of a table are by their names and units, as a rig file writes it. A group that
/// is not whole, or has two columns for one quantity, is left out; `is_clock` tells of a column that holds
/// times of day, which have no unit.
///
/// # Errors
/// Names of columns whose unit is written nowhere.
pub fn columns(
    names: &[String],
    meanings: &[Option<Meaning>],
    is_clock: impl Fn(usize) -> bool,
) -> Result<BTreeMap<String, ColumnSource>, Vec<String>> {
    let count = |known: &str| meanings.iter().flatten().filter(|meaning| meaning.known == known).count();
    let is_whole = |known: &str| match Known::parse(known) {
        Some(Known::Member(group, _)) => group.names().iter().all(|name| count(name) == 1),
        Some(Known::Time) => count(known) == 1,
        None => false,
    };
    let (mut found, mut without) = (BTreeMap::new(), Vec::new());
    for (k, (name, meaning)) in names.iter().zip(meanings).enumerate() {
        let Some(meaning) = meaning.as_ref().filter(|meaning| is_whole(&meaning.known)) else { continue };
        let unit = meaning.unit.clone().filter(|_| !(meaning.known == "t_s" && is_clock(k)));
        if unit.is_none() && !(meaning.known == "t_s" && is_clock(k)) {
            without.push(name.clone());
        }
        let is_si = unit.as_deref().and_then(Unit::parse).is_none_or(|unit| unit.scale == 1.0);
        let source = if is_si {
            ColumnSource::Name(name.clone())
        } else {
            let plus = BTreeMap::new();
            ColumnSource::Scaled(ScaledColumn { name: name.clone(), scale: 1.0, unit, offset: 0.0, plus })
        };
        found.insert(meaning.known.clone(), source);
    }
    if without.is_empty() { Ok(found) } else { Err(without) }
}

/// Returns a column here that several columns of a table mean, with their names; `None` if there is none.
pub fn repeated(names: &[String], meanings: &[Option<Meaning>]) -> Option<(String, Vec<String>)> {
    // Before a name there may be that of its group: FP1 - Force Fx, Run1/Fx.
    let inside = |name: &str| {
        let (_, own) = name.split_once(" - ").or_else(|| name.split_once('/'))?;
        meaning(own, None).map(|meaning| meaning.known)
    };
    let of = |(k, name): (usize, &String)| {
        let own = meanings.get(k).and_then(Option::as_ref).map(|meaning| meaning.known.clone());
        own.or_else(|| inside(name))
    };
    let all: Vec<Option<String>> = names.iter().enumerate().map(of).collect();
    let known = |k: usize| all.get(k)?.as_deref();
    let same = |of: &str| -> Vec<String> {
        let alike = names.iter().enumerate().filter(|(k, _)| known(*k) == Some(of));
        alike.map(|(_, name)| name.clone()).collect()
    };
    let mut all = (0..names.len()).filter_map(known).map(|of| (of.to_owned(), same(of)));
    all.find(|(known, same)| known != "t_s" && same.len() > 1)
}

/// Says that a time is in no form that is known.
pub fn unknown_time(column: &str, cell: &str) -> String {
    format!(
        "the form of the time in column {column} is not known: {cell:?}; write it in s, or as in 2026-12-31 \
         10:12:33.5"
    )
}

/// Returns names in quotes, with "and" between them.
pub fn either(names: &[String]) -> String {
    names.iter().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(" and ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_other_programs_keep_their_meaning() {
        for (name, stated, known, unit) in [
            ("Fx [N]", None, "fx_n", Some("N")),
            ("Fy (N)", None, "fy_n", Some("N")),
            ("Force Z (kN)", None, "fz_n", Some("kN")),
            ("F_x/N", None, "fx_n", Some("N")),
            ("Mx [Nm]", None, "mx_nm", Some("Nm")),
            ("M_z / (N mm)", None, "mz_nm", Some("N mm")),
            ("Tx", Some("Nm"), "mx_nm", Some("Nm")),
            ("Fx (Gesammelt)", Some("N"), "fx_n", Some("N")),
            ("Kraft X", Some("N"), "fx_n", Some("N")),
            ("AccX [m/s^2]", None, "imu_ax_mps2", Some("m/s^2")),
            ("Acc_X [g]", None, "imu_ax_mps2", Some("g")),
            ("Acc_Z[g]", None, "imu_az_mps2", Some("g")),
            ("GyrX [deg/s]", None, "imu_gx_radps", Some("deg/s")),
            ("Gyr_X (rad/s)", None, "imu_gx_radps", Some("rad/s")),
            ("Gy [dps]", None, "imu_gy_radps", Some("dps")),
            ("Zeit [s]", None, "t_s", Some("s")),
            ("Zeit", Some("s"), "t_s", Some("s")),
            ("TimeStamp_ms", None, "t_s", Some("ms")),
            ("Time", None, "t_s", None),
            ("Fx", None, "fx_n", None),
            ("time_s", None, "t_s", Some("s")),
            ("t_s", None, "t_s", Some("s")),
            ("Fx_N", None, "fx_n", Some("N")),
            ("acc_x_g", None, "imu_ax_mps2", Some("g")),
            ("Uhrzeit", None, "t_s", None),
            ("Kraft Fx [N]", None, "fx_n", Some("N")),
            ("Moment Mx [Nm]", None, "mx_nm", Some("Nm")),
            ("Torque Tz (Nm)", None, "mz_nm", Some("Nm")),
            ("Siła Fy [N]", None, "fy_n", Some("N")),
            ("Si³a Fy [N]", None, "fy_n", Some("N")),
            ("Prędkość kątowa Z [°/s]", None, "imu_gz_radps", Some("°/s")),
            ("Fuerza Z", Some("N"), "fz_n", Some("N")),
            ("Moment X", Some("Newton-Meters"), "mx_nm", Some("Newton-Meters")),
            ("Angular rate X", Some("degrees/s"), "imu_gx_radps", Some("degrees/s")),
        ] {
            let found = meaning(name, stated).unwrap_or_else(|| panic!("{name}"));
            assert_eq!((found.known.as_str(), found.unit.as_deref()), (known, unit), "{name}");
        }
        for none in [
            "Mag_X [mT]",
            "Mx [N]",
            "Temp [°C]",
            "PacketCounter",
            "FreeAcc_X [m/s^2]",
            "Fx1 [N]",
            "Index",
            "Max [N]",
            "Kraft Mx [N]",
            "Force Tx [N]",
            "Offset_N",
            "state_s",
            "x",
        ] {
            let found = meaning(none, None);
            assert_eq!(found.filter(|found| found.unit.is_some()), None, "{none}");
        }
        assert_eq!(meaning("Mag X", Some("mT")), None);
    }
}

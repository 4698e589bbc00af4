//! Units by name, as rig files and the headers of other programs' files write them: `N mm`, `deg/s`, `m/s²`.

/// The quantity of a unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Time, SI unit s.
    Time,
    /// Length, SI unit m.
    Length,
    /// Speed, SI unit m/s.
    Speed,
    /// Angle, SI unit rad.
    Angle,
    /// Angular rate, SI unit rad/s.
    AngularRate,
    /// Acceleration, SI unit m/s².
    Acceleration,
    /// Force, SI unit N.
    Force,
    /// Moment, SI unit N m.
    Moment,
    /// Voltage, SI unit V.
    Voltage,
}

/// A unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// The quantity measured.
    pub quantity: Quantity,
    /// Size of the unit in the SI unit.
    pub scale: f64,
}

/// Standard gravity, m/s²; of a kilogram-force, N.
const G: f64 = 9.80665;
/// Pound-force, N: 0.45359237 kg at standard gravity.
const LBF: f64 = 4.448_221_615_260_5;
const OZF: f64 = LBF / 16.0;
const INCH: f64 = 0.0254;
const FOOT: f64 = 0.3048;
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Quantity, scale, and every way of writing it once blanks, dots and stars are gone and roots are plain; the
/// first is the one that is shown.
const UNITS: &[(Quantity, f64, &[&str])] = &[
    (Quantity::Time, 1.0, &["s", "sec", "secs", "second", "seconds", "sek", "sekunden"]),
    (Quantity::Time, 1e-3, &["ms", "msec", "millisecond", "milliseconds"]),
    (Quantity::Time, 1e-6, &["us", "µs", "μs", "usec", "microsecond", "microseconds"]),
    (Quantity::Time, 1e-9, &["ns", "nsec", "nanosecond", "nanoseconds"]),
    (Quantity::Time, 60.0, &["min"]),
    (Quantity::Time, 3600.0, &["h"]),
    (Quantity::Time, 86_400.0, &["d", "days"]),
    (Quantity::Length, 1.0, &["m"]),
    (Quantity::Length, 1e-2, &["cm"]),
    (Quantity::Length, 1e-3, &["mm"]),
    (Quantity::Length, INCH, &["in", "inch"]),
    (Quantity::Length, FOOT, &["ft"]),
    (Quantity::Speed, 1.0, &["m/s"]),
    (Quantity::Speed, 1e-3, &["mm/s"]),
    (Quantity::Angle, 1.0, &["rad"]),
    (Quantity::Angle, 1e-3, &["mrad"]),
    (Quantity::Angle, DEGREE, &["deg", "°", "degree", "degrees", "grad"]),
    (
        Quantity::AngularRate,
        1.0,
        &["rad/s", "rad/sec", "rads-1", "rads^-1", "radians/s", "radian/s", "radians/second", "rad/second"],
    ),
    (Quantity::AngularRate, 1e-3, &["mrad/s"]),
    (
        Quantity::AngularRate,
        DEGREE,
        &[
            "deg/s",
            "dps",
            "°/s",
            "deg/sec",
            "°/sec",
            "degs-1",
            "grad/s",
            "degrees/s",
            "degree/s",
            "degrees/sec",
            "degrees/second",
        ],
    ),
    (Quantity::AngularRate, 1e-3 * DEGREE, &["mdeg/s", "mdps"]),
    (Quantity::AngularRate, 6.0 * DEGREE, &["rpm", "1/min", "u/min"]),
    (
        Quantity::Acceleration,
        1.0,
        &["m/s^2", "m/s²", "m/s2", "m/s**2", "m/s/s", "m/sec^2", "ms-2", "ms^-2", "mps2"],
    ),
    (Quantity::Acceleration, 1e-2, &["cm/s^2", "cm/s²", "cm/s2"]),
    (Quantity::Acceleration, 1e-3, &["mm/s^2", "mm/s²", "mm/s2"]),
    (Quantity::Acceleration, FOOT, &["ft/s^2", "ft/s²", "ft/s2"]),
    (Quantity::Acceleration, G, &["g", "gn", "g0", "G"]),
    (Quantity::Acceleration, 1e-3 * G, &["mg"]),
    (Quantity::Force, 1.0, &["N", "newton", "newtons"]),
    (Quantity::Force, 1e-3, &["mN"]),
    (Quantity::Force, 10.0, &["daN"]),
    (Quantity::Force, 1e3, &["kN"]),
    (Quantity::Force, G, &["kgf", "kp"]),
    (Quantity::Force, 1e-3 * G, &["gf"]),
    (Quantity::Force, LBF, &["lbf", "lbs", "lb"]),
    (Quantity::Force, OZF, &["ozf", "oz"]),
    (
        Quantity::Moment,
        1.0,
        &["Nm", "newtonmeter", "newtonmeters", "newtonmetre", "newtonmetres", "newtonsmeters"],
    ),
    (Quantity::Moment, 1e-3, &["Nmm", "mNm", "mmN"]),
    (Quantity::Moment, 1e-2, &["Ncm"]),
    (Quantity::Moment, 1e3, &["kNm"]),
    (Quantity::Moment, G, &["kgfm", "kpm"]),
    (Quantity::Moment, 1e-2 * G, &["kgfcm", "kpcm"]),
    (Quantity::Moment, 1e-3 * G, &["kgfmm", "gfm"]),
    (Quantity::Moment, LBF * INCH, &["lbfin", "inlbf", "lbin", "inlb", "inlbs"]),
    (Quantity::Moment, LBF * FOOT, &["lbfft", "ftlbf", "lbft", "ftlb", "ftlbs"]),
    (Quantity::Moment, OZF * INCH, &["ozfin", "inozf", "ozin", "inoz"]),
    (Quantity::Voltage, 1.0, &["V", "volt", "volts"]),
    (Quantity::Voltage, 1e-3, &["mV"]),
    (Quantity::Voltage, 1e-6, &["uV", "µV", "μV"]),
];

impl Unit {
    /// Returns the unit that a text names, with or without brackets; `None` if it is none of those known.
    pub fn parse(text: &str) -> Option<Self> {
        let bare = text.trim().trim_matches(['[', ']', '(', ')']);
        let is_kept = |c: &char| !c.is_whitespace() && !matches!(c, '·' | '⋅' | '.' | '_' | '*');
        let plain: String = bare.replace("**", "^").chars().filter(is_kept).collect();
        // N-m and lbf-in, but not s-2.
        let joined = match plain.split_once('-') {
            Some((left, right)) if right.starts_with(char::is_alphabetic) => format!("{left}{right}"),
            _ => plain,
        };
        let found = |same: &dyn Fn(&str) -> bool| {
            UNITS.iter().find(|(_, _, names)| names.iter().any(|name| same(name)))
        };
        let exact = found(&|name| name == joined);
        // mN and MN are not one unit: only what a prefix does not change is taken in any letters. M before
        // another letter than a metre's is mega.
        let is_mega = joined.starts_with('M') && !joined.starts_with("MM");
        let any = || {
            let alike = |name: &str| name.to_lowercase() == joined.to_lowercase();
            found(&alike).filter(|(_, scale, names)| {
                let is_milli = *scale < 1.0 && names.iter().any(|n| n.starts_with('m') && alike(n));
                (*scale == 1.0 || names.iter().all(|n| n.len() > 2)) && !(is_mega && is_milli)
            })
        };
        exact.or_else(any).map(|(quantity, scale, _)| Self { quantity: *quantity, scale: *scale })
    }
}

impl Quantity {
    /// Returns what the column or key measures whose name ends in its SI unit, `fx_n`; `None` if it ends in
    /// none.
    pub fn of_name(name: &str) -> Option<Self> {
        Some(match name.rsplit_once('_')?.1 {
            "s" => Self::Time,
            "m" => Self::Length,
            "mps" => Self::Speed,
            "rad" => Self::Angle,
            "radps" => Self::AngularRate,
            "mps2" => Self::Acceleration,
            "n" => Self::Force,
            "nm" => Self::Moment,
            "v" => Self::Voltage,
            _ => return None,
        })
    }

    /// Returns its units by name, for messages.
    pub fn names(self) -> Vec<&'static str> {
        let own = UNITS.iter().filter(|(quantity, _, _)| *quantity == self);
        own.filter_map(|(_, _, names)| names.first().copied()).collect()
    }

    /// Returns the name of its SI unit.
    pub fn si(self) -> &'static str {
        match self {
            Self::Time => "s",
            Self::Length => "m",
            Self::Speed => "m/s",
            Self::Angle => "rad",
            Self::AngularRate => "rad/s",
            Self::Acceleration => "m/s^2",
            Self::Force => "N",
            Self::Moment => "N m",
            Self::Voltage => "V",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_have_one_meaning_in_every_spelling() {
        for (texts, quantity, scale) in [
            (&["N", "[N]", "(N)", " n "][..], Quantity::Force, 1.0),
            (&["Nm", "N m", "N·m", "N*m", "N.m", "N-m", "[Nm]", "NM"], Quantity::Moment, 1.0),
            (&["N mm", "Nmm", "N.mm", "mNm", "N-mm"], Quantity::Moment, 1e-3),
            (&["mN"], Quantity::Force, 1e-3),
            (&["mm/s^2", "MM/S^2"], Quantity::Acceleration, 1e-3),
            (&["kgf"], Quantity::Force, 9.80665),
            (&["lbf-in", "lbf in", "in-lb", "in·lbf"], Quantity::Moment, 0.112_984_829_027_616_7),
            (&["deg/s", "°/s", "dps", "DEG/S"], Quantity::AngularRate, std::f64::consts::PI / 180.0),
            (&["m/s^2", "m/s²", "m/s**2", "m s^-2", "m/s2"], Quantity::Acceleration, 1.0),
            (&["g", "G"], Quantity::Acceleration, 9.80665),
            (&["ms", "msec"], Quantity::Time, 1e-3),
        ] {
            for text in texts {
                let unit = Unit::parse(text).unwrap_or_else(|| panic!("{text}"));
                assert_eq!(unit.quantity, quantity, "{text}");
                assert!((unit.scale / scale - 1.0).abs() < 1e-15, "{text}: {}", unit.scale);
            }
        }
        // A prefix in other letters is another unit, and mT is no moment.
        for none in [
            "MN", "MNm", "MN m", "MN·m", "Mdps", "Mdeg/s", "Mrad/s", "Kn", "mT", "%", "", "counts", "MS", "-",
        ] {
            assert_eq!(Unit::parse(none), None, "{none}");
        }
        // No spelling is written twice.
        let mut all: Vec<&str> = UNITS.iter().flat_map(|(_, _, names)| names.iter().copied()).collect();
        let count = all.len();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), count);
    }
}

//! The columns of a recording: their names and units.

use rigident_shared::printable;

use crate::rig::spelling::nearest;

/// More IMUs or attitudes than this are a slip of the pen.
pub const MOST_LINKS: usize = 64;

/// A column: its name and its cells as text, empty where there is no value.
pub type Cells = (String, Vec<String>);

/// Returns true if a column can have this name; a tab is a separator elsewhere, and steers nothing.
pub(super) fn is_printable(name: &str) -> bool {
    name.split('\t').all(printable::is_name) && name.len() <= printable::LONGEST_NAME
}

const WRENCH: [&str; 6] = ["fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"];
const ACCEL: [&str; 3] = ["ax_mps2", "ay_mps2", "az_mps2"];
const GYRO: [&str; 3] = ["gx_radps", "gy_radps", "gz_radps"];
const GRAVITY: [&str; 3] = ["gx_mps2", "gy_mps2", "gz_mps2"];
const GAUGES: [&str; 6] = ["g1_v", "g2_v", "g3_v", "g4_v", "g5_v", "g6_v"];
const POSE: [&str; 7] = ["x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"];
/// Columns with the place of the plate, the first of its pose.
pub(super) const PLACE: [&str; 3] = ["x_m", "y_m", "z_m"];
const ATTITUDE: [&str; 4] = ["w", "x", "y", "z"];
/// Name of the time's column.
pub const TIME: &str = "t_s";

/// Columns that are there together or not at all.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Group {
    /// Wrench.
    Wrench,
    /// Accelerometer of the IMU on a link.
    Accel(usize),
    /// Gyro of the IMU on a link.
    Gyro(usize),
    /// Gravity vector.
    Gravity,
    /// Raw gauges.
    Gauges,
    /// Measured pose of the plate.
    Platform,
    /// Commanded pose of the plate.
    Commanded,
    /// Attitude of a link relative to S.
    Attitude(usize),
}

impl Group {
    /// Returns one group of each kind; of those with a number, the one that is written most often.
    pub fn kinds() -> [Self; 8] {
        [
            Self::Wrench,
            Self::Accel(0),
            Self::Gyro(0),
            Self::Gravity,
            Self::Gauges,
            Self::Platform,
            Self::Commanded,
            Self::Attitude(1),
        ]
    }

    /// Returns the names of the group's columns, in order.
    pub fn names(self) -> Vec<String> {
        let with = |prefix: String, names: &[&str]| names.iter().map(|n| format!("{prefix}{n}")).collect();
        let imu = |j: usize| if j == 0 { "imu_".to_owned() } else { format!("imu{j}_") };
        match self {
            Self::Wrench => with(String::new(), &WRENCH),
            Self::Accel(j) => with(imu(j), &ACCEL),
            Self::Gyro(j) => with(imu(j), &GYRO),
            Self::Gravity => with(String::new(), &GRAVITY),
            Self::Gauges => with(String::new(), &GAUGES),
            Self::Platform => with(String::new(), &POSE),
            Self::Commanded => with("cmd_".to_owned(), &POSE),
            Self::Attitude(j) => with(format!("q{j}_"), &ATTITUDE),
        }
    }
}

/// A column that has a meaning here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Known {
    /// Time, s.
    Time,
    /// A member of a group, by its place in it.
    Member(Group, usize),
}

impl Known {
    /// Returns what a column of this name means.
    pub fn parse(name: &str) -> Option<Self> {
        if name == TIME {
            return Some(Self::Time);
        }
        let find = |group: Group, names: &[&str], name: &str| {
            names.iter().position(|n| *n == name).map(|k| Self::Member(group, k))
        };
        if let Some((j, rest)) = numbered(name, "imu") {
            let j = j.unwrap_or(0);
            return find(Group::Accel(j), &ACCEL, rest).or_else(|| find(Group::Gyro(j), &GYRO, rest));
        }
        if let Some(rest) = name.strip_prefix("cmd_") {
            return find(Group::Commanded, &POSE, rest);
        }
        if let Some((Some(j), rest)) = numbered(name, "q") {
            return find(Group::Attitude(j), &ATTITUDE, rest);
        }
        find(Group::Wrench, &WRENCH, name)
            .or_else(|| find(Group::Gravity, &GRAVITY, name))
            .or_else(|| find(Group::Gauges, &GAUGES, name))
            .or_else(|| find(Group::Platform, &POSE, name))
    }

    /// Returns the name of the column in a file in the notation.
    pub fn name(self) -> String {
        match self {
            Self::Time => TIME.to_owned(),
            Self::Member(group, k) => group.names().swap_remove(k),
        }
    }
}

/// Splits the name of a column: `imu3_ax` into 3 and `ax`, `imu_ax` into none and `ax`.
fn numbered<'a>(name: &'a str, prefix: &str) -> Option<(Option<usize>, &'a str)> {
    let (number, rest) = name.strip_prefix(prefix)?.split_once('_')?;
    if number.is_empty() {
        return Some((None, rest));
    }
    let j = number.parse::<usize>().ok().filter(|j| *j < MOST_LINKS && j.to_string() == number)?;
    Some((Some(j), rest))
}

/// Returns the known column that a name means in another unit: `fx_n` for `fx_lbf`. A name that begins with
/// the right unit (`fx_n_filtered`) is a column of its own. Gravity and the gyro share letters: `gx_radps` is
/// the gyro's.
pub fn other_unit(name: &str) -> Option<String> {
    let (prefix, rest) = if let Some((j, rest)) = numbered(name, "imu") {
        (j.map_or_else(|| "imu_".to_owned(), |j| format!("imu{j}_")), rest)
    } else if let Some(rest) = name.strip_prefix("cmd_") {
        ("cmd_".to_owned(), rest)
    } else {
        (String::new(), name)
    };
    let candidates: Vec<&str> = match prefix.as_str() {
        "" => [&[TIME][..], &WRENCH, &GRAVITY, &GAUGES, &POSE[..3]].concat(),
        "cmd_" => POSE[..3].to_vec(),
        _ => [ACCEL, GYRO].concat(),
    };
    candidates.into_iter().find_map(|known| {
        let (quantity, unit) = known.split_once('_')?;
        let suffix = rest.strip_prefix(quantity)?.strip_prefix('_')?;
        let own = suffix == unit || suffix.strip_prefix(unit).is_some_and(|more| more.starts_with('_'));
        let gyro = prefix.is_empty() && GYRO.contains(&name);
        let meant = || if gyro { format!("imu_{name}") } else { format!("{prefix}{known}") };
        (!own && !suffix.is_empty()).then(meant)
    })
}

/// Returns the known name that was probably meant.
pub fn nearest_known(name: &str) -> Option<String> {
    let mut names: Vec<String> = Group::kinds().into_iter().flat_map(Group::names).collect();
    names.push(TIME.to_owned());
    nearest(name, names.iter().map(String::as_str)).map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_means_itself() {
        for group in [
            Group::Wrench,
            Group::Accel(0),
            Group::Gyro(0),
            Group::Accel(12),
            Group::Gyro(3),
            Group::Gravity,
            Group::Gauges,
            Group::Platform,
            Group::Commanded,
            Group::Attitude(0),
            Group::Attitude(10),
        ] {
            for (k, name) in group.names().into_iter().enumerate() {
                assert_eq!(Known::parse(&name), Some(Known::Member(group, k)), "{name}");
                assert_eq!(Known::Member(group, k).name(), name);
                assert_eq!(other_unit(&name), None, "{name}");
            }
        }
        assert_eq!(Known::parse("t_s"), Some(Known::Time));
        assert_eq!(Known::parse("imu0_gz_radps"), Some(Known::Member(Group::Gyro(0), 2)));
        for strange in ["imu00_ax_mps2", "imu99_ax_mps2", "q_w", "fx", "cmd_fx_n", "imu1_fx_n", ""] {
            assert_eq!(Known::parse(strange), None, "{strange}");
        }
    }

    #[test]
    fn kinds_leave_none_out() {
        // A new kind does not compile here until it has its place.
        let place = |group: Group| match group {
            Group::Wrench => 0,
            Group::Accel(_) => 1,
            Group::Gyro(_) => 2,
            Group::Gravity => 3,
            Group::Gauges => 4,
            Group::Platform => 5,
            Group::Commanded => 6,
            Group::Attitude(_) => 7,
        };
        for (k, group) in Group::kinds().into_iter().enumerate() {
            assert_eq!(place(group), k);
        }
    }

    #[test]
    fn other_units_are_distinguished_from_other_columns() {
        for (name, meant) in [
            ("fx_lbf", "fx_n"),
            ("mx_lbf_in", "mx_nm"),
            ("t_ms", "t_s"),
            ("imu_ax_g", "imu_ax_mps2"),
            ("imu2_gz_dps", "imu2_gz_radps"),
            ("imu0_ax_g", "imu0_ax_mps2"),
            ("gx_dps", "gx_mps2"),
            ("g3_mv", "g3_v"),
            ("cmd_x_mm", "cmd_x_m"),
        ] {
            assert_eq!(other_unit(name).as_deref(), Some(meant));
        }
        for name in
            ["fx", "fx_n_filtered", "temperature_c", "r11", "gx", "cmd_speed", "imu_temperature_c", "fx_"]
        {
            assert_eq!(other_unit(name), None, "{name}");
        }
    }
}

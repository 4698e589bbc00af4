//! The file of poses: CSV, a row for each pose.

use nalgebra::{Quaternion, UnitQuaternion};

use super::{JointTree, Pose, Setup};
use crate::named_table::NamedTable;

/// Endings of the four columns of a link's attitude.
const QUATERNION: [&str; 4] = ["_qw", "_qx", "_qy", "_qz"];
/// A quaternion's length differs from one by no more: four digits were written.
const UNIT_WITHIN: f64 = 0.01;
/// A joint's angle is no larger, rad: beyond, it is in degrees or counts turns (two turns).
const LARGEST_RAD: f64 = 4.0 * std::f64::consts::PI;
/// A joint's length is no larger, m.
const LARGEST_M: f64 = 10.0;
/// Name of the column that names poses.
const POSE: &str = "pose";
/// Name of the column that says which contacts are made.
const CONTACT: &str = "contact";

/// The cells of a file of poses.
#[derive(Clone, Debug)]
pub struct PosesTable {
    what: String,
    table: NamedTable,
}

impl PosesTable {
    /// Reads the text of a file; `what` names it in complaints.
    ///
    /// # Errors
    /// Says which line cannot be read.
    pub fn parse(text: &str, what: &str) -> Result<Self, String> {
        let table = NamedTable::parse(text).map_err(|why| format!("{what}: {why}"))?;
        if table.rows.is_empty() {
            return Err(format!("{what}: there is no pose in it"));
        }
        Ok(Self { what: what.to_owned(), table })
    }

    fn column(&self, name: &str) -> Option<usize> {
        self.table.column(name)
    }

    /// Returns the links whose attitudes the file has, in the model's order.
    ///
    /// # Errors
    /// Says which column of an attitude is missing, or of which link that is not there.
    pub fn measured_links(&self, tree: &JointTree) -> Result<Vec<usize>, String> {
        let mut found = Vec::new();
        let stems = self
            .table
            .header
            .iter()
            .filter_map(|name| QUATERNION.iter().find_map(|ending| name.strip_suffix(ending)))
            .collect::<std::collections::BTreeSet<_>>();
        for stem in stems {
            for ending in QUATERNION {
                let name = format!("{stem}{ending}");
                if self.column(&name).is_none() {
                    return Err(format!(
                        "{}: column {name} is missing beside the others of {stem}",
                        self.what
                    ));
                }
            }
            found.push(tree.link(stem).map_err(|why| format!("{}: columns {stem}_qw …: {why}", self.what))?);
        }
        if found.is_empty() {
            return Err(format!(
                "{}: no link's attitude is measured; an IMU on the base has columns {1}_qw, {1}_qx, {1}_qy, \
                 {1}_qz",
                self.what,
                tree.link_name(0)
            ));
        }
        found.sort_unstable();
        Ok(found)
    }

    /// Returns the poses.
    ///
    /// # Errors
    /// Says which cell of which line cannot be used, and why.
    pub fn poses(&self, setup: &Setup) -> Result<Vec<Pose>, String> {
        let joints =
            setup.joints.iter().map(|link| self.joint_column(setup, *link)).collect::<Result<Vec<_>, _>>()?;
        let attitudes: Vec<[usize; 4]> = setup
            .measured_links
            .iter()
            .map(|link| {
                let stem = setup.tree.link_name(*link);
                QUATERNION.map(|ending| self.column(&format!("{stem}{ending}")).unwrap_or(usize::MAX))
            })
            .collect();
        if let Some(imu) = setup.contacts.imus.iter().find(|imu| !setup.measured_links.contains(&imu.link)) {
            let link = setup.tree.link_name(imu.link);
            return Err(format!(
                "{}: [[imu]] is of {link}, whose attitude has no columns {link}_qw …",
                self.what
            ));
        }
        let (named, contact) = (self.column(POSE), self.column(CONTACT));
        let mut poses: Vec<Pose> = Vec::with_capacity(self.table.rows.len());
        for (n, (line, cells)) in self.table.rows.iter().enumerate() {
            let place = |what: &str| format!("{}, line {line}: {what}", self.what);
            let cell = |column: usize| cells.get(column).map_or("", String::as_str);
            let number = |column: usize| self.number(column, cell(column)).map_err(|why| place(&why));
            let mut positions = Vec::with_capacity(joints.len());
            for ((column, most), link) in joints.iter().zip(&setup.joints) {
                let value = number(*column)?;
                if value.abs() > *most {
                    let name = setup.tree.joint_name(*link);
                    let hint = if setup.tree.slides(*link) { "mm" } else { "degrees" };
                    return Err(place(&format!("joint {name} is at {value}: is it in {hint}?")));
                }
                positions.push(value);
            }
            let mut turned = Vec::with_capacity(attitudes.len());
            for (columns, link) in attitudes.iter().zip(&setup.measured_links) {
                let [w, x, y, z] = columns.map(number);
                let read = unit([w?, x?, y?, z?]).map_err(|why| {
                    place(&format!("the attitude of {} {why}", setup.tree.link_name(*link)))
                })?;
                let imu = setup.contacts.imus.iter().find(|imu| imu.link == *link);
                turned.push(imu.map_or(read, |imu| read * imu.rotation.inverse()));
            }
            let stands = stands(setup, contact.map_or("", cell)).map_err(|why| place(&why))?;
            let own = named.map_or("", cell);
            let name = if own.is_empty() { format!("pose {}", n + 1) } else { own.to_owned() };
            poses.push(Pose { name, positions, attitudes: turned, stands });
        }
        Ok(poses)
    }

    /// Returns the column of a joint and its largest possible number.
    fn joint_column(&self, setup: &Setup, link: usize) -> Result<(usize, f64), String> {
        let name = setup.tree.joint_name(link);
        let (unit, most) = if setup.tree.slides(link) { ("m", LARGEST_M) } else { ("rad", LARGEST_RAD) };
        let wanted = format!("{name}_{unit}");
        self.column(&wanted).map(|column| (column, most)).ok_or_else(|| {
            let other = ["deg", "mm"].map(|other| format!("{name}_{other}"));
            match other.iter().find(|other| self.column(other).is_some()) {
                Some(other) => format!("{}: column {other} has another unit; give {wanted}", self.what),
                None => format!(
                    "{}: column {wanted} is missing: the joint is between the base and a contact or a \
                     measured link",
                    self.what
                ),
            }
        })
    }

    fn number(&self, column: usize, cell: &str) -> Result<f64, String> {
        cell.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(|| {
            let name = self.table.header.get(column).map_or("", String::as_str);
            format!("{name} is {cell:?} and not a finite number")
        })
    }
}

fn unit([w, x, y, z]: [f64; 4]) -> Result<UnitQuaternion<f64>, String> {
    let given = Quaternion::new(w, x, y, z);
    let length = given.norm();
    if (length - 1.0).abs() > UNIT_WITHIN {
        return Err(format!("is no unit quaternion w, x, y, z: its length is {length:.4}"));
    }
    Ok(UnitQuaternion::from_quaternion(given))
}

/// Returns which contacts are made: those that a cell names with + between them, all if it is empty.
fn stands(setup: &Setup, cell: &str) -> Result<Vec<bool>, String> {
    if cell.is_empty() {
        return Ok(vec![true; setup.contacts.count()]);
    }
    let mut stands = vec![false; setup.contacts.count()];
    for name in cell.split('+').map(str::trim) {
        match setup.contacts.names().position(|own| own == name) {
            Some(k) => stands[k] = true,
            None => {
                let names: Vec<&str> = setup.contacts.names().collect();
                return Err(format!(
                    "contact names {name}, which is no contact of the file; there are {}",
                    names.join(", ")
                ));
            }
        }
    }
    Ok(stands)
}

//! One body, two links and a chain of three from one generator, by Newton and Euler recursively: no rows, no
//! filter.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use nalgebra::{Unit, UnitQuaternion, Vector3};
use rigident::model::dynamics::inverse_dynamics;
use rigident::rows::named_model::rig_links;
use rigident_shared::tree::BaseMotion;

use crate::tree_commands::{noise, swing};

pub(super) const RATE_HZ: f64 = 200.0;
pub(super) const ROWS: usize = 4000;
pub(super) const FORCE_NOISE: f64 = 0.1;
const MOMENT_NOISE: f64 = 0.01;
/// Axes of the joints beyond the base.
const AXES: [[f64; 3]; 2] = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]];
const NAMES: [&str; 3] = ["base", "arm", "hand"];

/// A body of the given number of links.
#[derive(Clone, Copy)]
pub(super) struct Subject {
    pub(super) links: usize,
    /// The maker of the estimate: `identify` here, `replay` on the device.
    pub(super) command: &'static str,
}

/// A recording: names of the columns, and its rows.
#[derive(Clone)]
pub(super) struct Table {
    pub(super) names: Vec<String>,
    pub(super) rows: Vec<Vec<f64>>,
}

impl Subject {
    pub(super) fn rig(self, load_cell: &str, imu: &str, is_truth: bool) -> String {
        let mut text =
            format!("[recording]\nrate_hz = {RATE_HZ}\n[load_cell]\nclass = \"exact\"\n{load_cell}\n");
        for link in 0..self.links {
            let _ = writeln!(text, "[[imu]]\nlink = {link}\nclass = \"exact\"\n{imu}");
        }
        // A link alone is a body.
        for link in 0..if is_truth || self.links > 1 { self.links } else { 0 } {
            let _ = writeln!(text, "[[link]]\nname = \"{}\"", NAMES[link]);
            if let Some(above) = link.checked_sub(1) {
                let _ = writeln!(
                    text,
                    "parent = \"{}\"\njoint = \"revolute\"\naxis = {:?}\nposition_m = [0.03, 0.01, 0.065]",
                    NAMES[above], AXES[above]
                );
            }
            if is_truth {
                let k = 1.0 - 0.25 * link as f64;
                let _ = writeln!(
                    text,
                    "nominal_mass_kg = {}\nnominal_com_m = [0.02, {}, 0.05]\nnominal_inertia_com_kgm2 = \
                     [0.02, 0.025, 0.015, 0.001, 0.002, 0.003]",
                    2.0 * k,
                    0.03 * k
                );
            }
        }
        text
    }

    /// Returns what rounding may change of a value: a millionth of an sd in double precision, in single
    /// precision what docs/promises.md allows.
    pub(super) fn rounding(self, u95: f64) -> f64 {
        if self.command == "replay" { 0.05 * u95 / 1.96 } else { 1e-6 * u95 / 1.96 }
    }

    /// Mass of all links, kg.
    pub(super) fn mass(self) -> f64 {
        (0..self.links).map(|link| 2.0 * (1.0 - 0.25 * link as f64)).sum()
    }

    /// Name of the mass of all links, as a parameter and as a known quantity.
    pub(super) fn mass_name(self) -> [&'static str; 2] {
        if self.links == 1 { ["m", "mass_kg"] } else { ["base.M", "base.M"] }
    }

    pub(super) fn table(self, place: &Path) -> Table {
        self.sampled(place, RATE_HZ, ROWS)
    }

    pub(super) fn sampled(self, place: &Path, rate_hz: f64, rows: usize) -> Table {
        fs::write(place.join("truth.toml"), self.rig("", "", true)).unwrap();
        let model = rig_links::read(&place.join("truth.toml")).unwrap();
        let mut names: Vec<String> =
            ["t_s", "fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"].map(str::to_owned).into();
        for axis in ["x", "y", "z"] {
            names.push(format!("imu_a{axis}_mps2"));
        }
        for link in 0..self.links {
            let imu = if link == 0 { "imu".to_owned() } else { format!("imu{link}") };
            names.extend(["x", "y", "z"].map(|axis| format!("{imu}_g{axis}_radps")));
        }
        for link in 1..self.links {
            names.extend(["w", "x", "y", "z"].map(|part| format!("q{link}_{part}")));
        }
        let rows = (0..rows).map(|row| {
            let t = row as f64 / rate_hz;
            let base = base_motion(t);
            let joints: Vec<[f64; 3]> = (1..self.links).map(|k| swing(t, 3 + k, 0.8)).collect();
            let part = |n: usize| joints.iter().map(|q| q[n]).collect::<Vec<f64>>();
            let wrench = inverse_dynamics(&model, &base, &part(0), &part(1), &part(2)).unwrap();
            let mut cells = vec![t];
            cells.extend((0..6).map(|c| wrench[c] + sigma(c) * noise(6 * row + c)));
            cells.extend(base.specific_force.iter());
            let (mut attitude, mut rate): (UnitQuaternion<f64>, Vector3<f64>) =
                (UnitQuaternion::identity(), base.rate);
            let mut attitudes = Vec::new();
            cells.extend(rate.iter());
            for (q, axis) in joints.iter().zip(AXES) {
                let axis = Vector3::from(axis);
                let turn = UnitQuaternion::from_axis_angle(&Unit::new_normalize(axis), q[0]);
                rate = turn.inverse() * rate + axis * q[1];
                attitude *= turn;
                cells.extend(rate.iter());
                attitudes.extend([attitude.w, attitude.i, attitude.j, attitude.k]);
            }
            cells.extend(attitudes);
            cells
        });
        Table { names, rows: rows.collect() }
    }
}

pub(super) fn sigma(channel: usize) -> f64 {
    if channel < 3 { FORCE_NOISE } else { MOMENT_NOISE }
}

/// The base turns about its origin, by three swings one after the other.
fn base_motion(t: f64) -> BaseMotion<f64> {
    let turned = |t: f64| {
        let a = [0, 1, 2].map(|k| swing(t, k, 0.35));
        let turn = UnitQuaternion::from_euler_angles(a[0][0], a[1][0], a[2][0]);
        let rx = UnitQuaternion::from_euler_angles(a[0][0], 0.0, 0.0);
        let ry = UnitQuaternion::from_euler_angles(0.0, a[1][0], 0.0);
        let rate = rx.inverse() * (ry.inverse() * Vector3::z() * a[2][1] + Vector3::y() * a[1][1])
            + Vector3::x() * a[0][1];
        (turn, rate)
    };
    let (turn, rate) = turned(t);
    // Differences of the fourth order: 1e-9 rad/s² of some 20.
    let h = 1e-3;
    let apart = |by: f64| turned(t + by).1 - turned(t - by).1;
    let change = (apart(h) * 8.0 - apart(2.0 * h)) / (12.0 * h);
    BaseMotion {
        specific_force: turn.inverse() * (Vector3::z() * 9.80665),
        rate,
        angular_acceleration: change,
    }
}

impl Table {
    pub(super) fn write(&self, place: &Path, name: &str, rig: &str) {
        let mut text = self.names.join(",") + "\n";
        for row in &self.rows {
            let cells: Vec<String> = row.iter().map(ToString::to_string).collect();
            text += &(cells.join(",") + "\n");
        }
        fs::write(place.join(format!("{name}.csv")), text).unwrap();
        fs::write(place.join(format!("{name}.rig.toml")), rig).unwrap();
    }

    pub(super) fn changed(&self, change: impl Fn(usize, &mut [f64])) -> Self {
        let mut table = self.clone();
        for (row, cells) in table.rows.iter_mut().enumerate() {
            change(row, cells);
        }
        table
    }

    pub(super) fn part(&self, rows: std::ops::Range<usize>) -> Self {
        Self { names: self.names.clone(), rows: self.rows[rows].to_vec() }
    }
}

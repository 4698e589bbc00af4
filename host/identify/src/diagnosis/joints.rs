//! Faults of a robot's joint columns: units, signs, zeros, swapped joints, delays, and of what its base
//! stands on.

use rigident_shared::tree::Joint;

use super::sensors::{cut, delays, earlier, late};
use super::{Case, Fault};
use rigident_fit::CONTRADICTED;
use rigident_io::rig::classes::{TreeClass, rectangular};
use rigident_io::rig::{ColumnSource, JointTable, ScaledColumn};
use rigident_model::Model;
use rigident_rows::tree::columns::{Column, Quantity, column};
use rigident_rows::tree::drive::Term;

const ALL: [Quantity; 3] = [Quantity::Position, Quantity::Rate, Quantity::Effort];
const MOTION: [Quantity; 2] = [Quantity::Position, Quantity::Rate];
/// Joints that are examined one by one.
const MOST_JOINTS: usize = 12;
/// Units of efforts, with their factors to N m.
const UNITS: [(&str, f64); 6] = [
    ("N mm", 1e-3),
    ("N cm", 1e-2),
    ("kgf m", 9.80665),
    ("kgf cm", 9.80665e-2),
    ("lbf ft", 1.355_817_948),
    ("lbf in", 0.112_984_829),
];

/// A joint of one freedom.
#[derive(Clone)]
struct Named {
    name: String,
    joint: Joint<f64>,
}

impl Named {
    /// Returns its column of a quantity, if the recording has it.
    fn column(&self, case: &Case, quantity: Quantity) -> Option<Column> {
        let column = column(&case.recording.rig, &self.name, &self.joint, quantity)?;
        let is_there = case.recording.extra.iter().any(|(name, _)| *name == column.name);
        is_there.then_some(column)
    }

    /// Says where a quantity of it is.
    fn set(&self, case: &mut Case, quantity: Quantity, column: Column) {
        let source = ColumnSource::Scaled(ScaledColumn {
            name: column.name,
            scale: column.scale,
            unit: None,
            offset: column.offset,
            plus: column.plus.into_iter().collect(),
        });
        let tables = &mut case.recording.rig.joint;
        let at = tables.iter().position(|table| table.name == self.name).unwrap_or_else(|| {
            tables.push(JointTable { name: self.name.clone(), ..JointTable::default() });
            tables.len() - 1
        });
        let Some(table) = tables.get_mut(at) else { return };
        match quantity {
            Quantity::Position => table.position = Some(source),
            Quantity::Rate => table.rate = Some(source),
            Quantity::Effort => table.effort = Some(source),
        }
    }

    /// Multiplies some of its quantities; false if it has none of them.
    fn scale(&self, case: &mut Case, quantities: &[Quantity], factor: f64) -> bool {
        let mut changed = false;
        for quantity in quantities {
            let Some(mut column) = self.column(case, *quantity) else { continue };
            column.scale *= factor;
            column.offset *= factor;
            column.plus.iter_mut().for_each(|(_, own)| *own *= factor);
            self.set(case, *quantity, column);
            changed = true;
        }
        changed
    }
}

/// Multiplies some quantities of all joints; false if none has them.
fn scale_all(joints: &[Named], case: &mut Case, quantities: &[Quantity], factor: f64) -> bool {
    let changed = joints.iter().filter(|joint| joint.scale(case, quantities, factor));
    changed.count() > 0
}

/// Gives each joint the columns of another one.
fn rename(case: &mut Case, joints: &[Named], order: &[usize], quantities: &[Quantity]) -> bool {
    let mut changed = false;
    for quantity in quantities {
        let columns: Vec<Option<Column>> = joints.iter().map(|joint| joint.column(case, *quantity)).collect();
        for (joint, from) in joints.iter().zip(order) {
            if let Some(Some(column)) = columns.get(*from) {
                joint.set(case, *quantity, column.clone());
                changed = true;
            }
        }
    }
    changed
}

/// Returns the joints whose positions are recorded.
fn named(case: &Case, model: &Model) -> Vec<Named> {
    let welded = model.welded();
    let joints = welded
        .links
        .iter()
        .skip(1)
        .map(|link| Named { name: link.joint_name.clone(), joint: link.link.joint });
    joints.filter(|joint| joint.column(case, Quantity::Position).is_some()).collect()
}

/// Returns the faults that joints and base of a tree may have.
pub(super) fn faults(case: &Case, model: &Model) -> Vec<Fault> {
    let joints = named(case, model);
    if joints.is_empty() {
        return Vec::new();
    }
    let has_efforts = case_has(case, &joints, Quantity::Effort);
    let has_rates = case_has(case, &joints, Quantity::Rate);
    let mut all = of_units(&joints, has_rates, has_efforts);
    all.extend(of_friction(case, has_efforts));
    all.extend(of_rotors(case, has_efforts));
    all.extend(of_signs(&joints, has_efforts));
    all.extend(of_zeros(&joints));
    all.extend(of_order(&joints, has_efforts));
    all.extend(of_gravity(case));
    all.extend(of_delays(case, &joints, has_efforts));
    all
}

fn of_units(joints: &[Named], has_rates: bool, has_efforts: bool) -> Vec<Fault> {
    let degrees = std::f64::consts::PI / 180.0;
    let mut all = Vec::new();
    let remedy =
        "give each its scale in [[joint]] of the rig file: position = { name = \"…\", scale = 0.01745329 }";
    let what = if has_rates {
        "positions and rates of the joints are in degrees"
    } else {
        "positions of the joints are in degrees"
    };
    let own = joints.to_vec();
    all.push(Fault::new("unit of the joints", what, remedy, move |case| {
        case.options.friction.forget_speeds();
        scale_all(&own, case, &MOTION, degrees)
    }));
    for (unit, factor) in UNITS.into_iter().filter(|_| has_efforts) {
        let own = joints.to_vec();
        let what = format!("the efforts are in {unit}");
        let remedy = format!(
            "give each its scale in [[joint]] of the rig file: effort = \
             {{ name = \"…\", scale = {factor:.6} }}"
        );
        all.push(Fault::new(format!("efforts in {unit}"), what, remedy, move |case| {
            scale_all(&own, case, &[Quantity::Effort], factor)
        }));
    }
    let single = joints.iter().take(MOST_JOINTS).filter(|_| has_efforts);
    for (joint, (unit, factor)) in
        single.flat_map(|joint| UNITS.into_iter().take(3).map(move |unit| (joint, unit)))
    {
        let own = joint.clone();
        let what = format!("the effort of {} is in {unit}", joint.name);
        let remedy = format!(
            "give its scale in [[joint]] of the rig file: effort = {{ name = \"…\", scale = {factor:.6} }}"
        );
        all.push(Fault::new(format!("unit of {}", joint.name), what, remedy, move |case| {
            own.scale(case, &[Quantity::Effort], factor)
        }));
    }
    all
}

fn of_friction(case: &Case, has_efforts: bool) -> Option<Fault> {
    let what = "friction of the joints is left out";
    let remedy = "identify it: `friction` viscous,coulomb";
    (has_efforts && case.options.friction.is_empty()).then(|| {
        Fault::new("friction", what, remedy, |case| {
            case.options.friction = vec![Term::Viscous, Term::Coulomb(None)].into();
            true
        })
    })
}

fn of_rotors(case: &Case, has_efforts: bool) -> Option<Fault> {
    let what = "rotors of the drives are left out: behind a gear they count with the square of its ratio";
    let remedy = "identify them: `friction` viscous,coulomb,rotor";
    let friction = &case.options.friction;
    let has_rotors = friction.lists().any(|terms| terms.contains(&Term::Rotor));
    (has_efforts && !friction.is_empty() && !has_rotors).then(|| {
        Fault::new("rotors", what, remedy, |case| {
            case.options.friction.lists_mut().for_each(|terms| terms.push(Term::Rotor));
            true
        })
    })
}

fn of_signs(joints: &[Named], has_efforts: bool) -> Vec<Fault> {
    let mut all = Vec::new();
    let remedy = "give it scale = -1 in [[joint]] of the rig file";
    if has_efforts {
        let own = joints.to_vec();
        all.push(Fault::new("sign of the efforts", "all efforts are reversed", remedy, move |case| {
            scale_all(&own, case, &[Quantity::Effort], -1.0)
        }));
    }
    for joint in joints.iter().take(MOST_JOINTS) {
        let name = &joint.name;
        for (what, quantities, needs) in [
            (format!("the effort of {name} is reversed"), &ALL[2..], true),
            (format!("position and rate of {name} are reversed"), &MOTION[..], false),
            (
                format!("{name} turns the other way in the model: position, rate and effort are reversed"),
                &ALL[..],
                true,
            ),
        ] {
            if needs && !has_efforts {
                continue;
            }
            let own = joint.clone();
            // Of two joints either reversed sign explains as much: the other makes bodies of negative mass.
            all.push(Fault::new(what.clone(), what, remedy, move |case| own.scale(case, quantities, -1.0)));
        }
    }
    all
}

fn of_zeros(joints: &[Named]) -> Vec<Fault> {
    let mut all = Vec::new();
    let turning = |joint: &&Named| matches!(joint.joint, Joint::Revolute(_));
    for joint in joints.iter().take(MOST_JOINTS).filter(turning) {
        for degrees in [90.0, -90.0, 180.0_f64] {
            let own = joint.clone();
            let what = format!("the zero of {} is off by {degrees}°", joint.name);
            let remedy = format!(
                "give it offset = {:.6} in [[joint]] of the rig file: position = \
                 {{ name = \"…\", offset = … }}",
                -degrees.to_radians()
            );
            all.push(Fault::new(what.clone(), what, remedy, move |case| {
                let Some(mut column) = own.column(case, Quantity::Position) else { return false };
                column.offset -= degrees.to_radians();
                own.set(case, Quantity::Position, column);
                true
            }));
        }
    }
    all
}

fn of_order(joints: &[Named], has_efforts: bool) -> Vec<Fault> {
    let mut all = Vec::new();
    let count = joints.len();
    let most = count.min(MOST_JOINTS);
    let remedy = "name the columns in [[joint]] of the rig file";
    let mut orders: Vec<(String, String, Vec<usize>)> = Vec::new();
    for a in 0..most {
        for b in a + 1..most {
            let mut order: Vec<usize> = (0..count).collect();
            order.swap(a, b);
            let words = format!("{} and {} are swapped", joints[a].name, joints[b].name);
            orders.push((words.clone(), format!("the efforts of {words}"), order));
        }
    }
    if count > 2 {
        for by in [1, count - 1] {
            let order = (0..count).map(|k| (k + by) % count).collect();
            let words = format!("are those of the {} joint", if by == 1 { "previous" } else { "next" });
            orders.push((
                format!("all columns of each joint {words}"),
                format!("the efforts of each joint {words}"),
                order,
            ));
        }
    }
    for (joint_words, effort_words, order) in orders {
        for (what, quantities) in [(joint_words, &ALL[..]), (effort_words, &ALL[2..])] {
            if quantities.len() == 1 && !has_efforts {
                continue;
            }
            let (own, order) = (joints.to_vec(), order.clone());
            all.push(Fault::new("order of the joints", what, remedy, move |case| {
                rename(case, &own, &order, quantities)
            }));
        }
    }
    all
}

fn of_gravity(case: &Case) -> Vec<Fault> {
    let recording = &case.recording;
    let is_known = recording.imus.first().is_some_and(|imu| imu.accel.is_some() || imu.gyro.is_some())
        || recording.gravity.is_some()
        || recording.wrench.is_some();
    let own = recording.rig.recording.gravity_direction;
    let directions: [(&str, [f64; 3]); 6] = [
        ("upright", [0.0, 0.0, -1.0]),
        ("upside down", [0.0, 0.0, 1.0]),
        ("on a wall, x down", [1.0, 0.0, 0.0]),
        ("on a wall, x up", [-1.0, 0.0, 0.0]),
        ("on a wall, y down", [0.0, 1.0, 0.0]),
        ("on a wall, y up", [0.0, -1.0, 0.0]),
    ];
    let others = directions.into_iter().filter(|(_, down)| !is_known && *down != own);
    others
        .map(|(words, down)| {
            let what = format!("the base stands {words}");
            let remedy = format!("give gravity_direction = {down:?} in [recording] of the rig file");
            Fault::new("gravity", what, remedy, move |case| {
                case.recording.rig.recording.gravity_direction = down;
                true
            })
        })
        .collect()
}

/// Returns delays of efforts that nothing lets expect: what is known of them is estimated with the body.
/// Rates that are not those of their positions are not used.
fn of_delays(case: &Case, joints: &[Named], has_efforts: bool) -> Vec<Fault> {
    let known_s = known_delay_s(case);
    let delays = delays(case).into_iter().filter(|(_, s)| has_efforts && s.abs() > known_s);
    delays.map(|delay| of_delay(joints, delay)).collect()
}

/// Returns the delay of efforts by this many rows and seconds.
fn of_delay(joints: &[Named], (rows, s): (isize, f64)) -> Fault {
    let own = joints.to_vec();
    let remedy = "stamp readings where they are taken, or shift the columns";
    Fault::new("delay of the effort", late("the effort", s), remedy, move |case| {
        let columns: Vec<String> =
            own.iter().filter_map(|joint| Some(joint.column(case, Quantity::Effort)?.name)).collect();
        for (name, cells) in &mut case.recording.extra {
            if columns.contains(name) {
                earlier(cells, rows);
            }
        }
        cut(case, rows)
    })
}

/// Returns the delays of efforts that they may have by what is known of them.
pub(super) fn known_delays(case: &Case, model: &Model) -> Vec<Fault> {
    let joints = named(case, model);
    let known_s = known_delay_s(case);
    let known = delays(case).into_iter().filter(|(_, s)| s.abs() <= known_s);
    known.map(|delay| of_delay(&joints, delay)).collect()
}

/// Returns the delay of efforts that the rig file, or its class, lets expect, s.
fn known_delay_s(case: &Case) -> f64 {
    let tree = &case.recording.rig.tree;
    let class = || rectangular(tree.class.unwrap_or(TreeClass::DEFAULT).limits().effort_skew_s);
    CONTRADICTED * tree.skew_std_s.unwrap_or_else(class)
}

fn case_has(case: &Case, joints: &[Named], quantity: Quantity) -> bool {
    joints.iter().all(|joint| joint.column(case, quantity).is_some())
}

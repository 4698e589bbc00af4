//! Columns of efforts in units of their own, and their scales.

use rigident_io::recording::Recording;
use rigident_io::rig::{ColumnSource, JointTable, RigFile, ScaledColumn};
use rigident_model::Model;
use rigident_rows::tree::columns::{Quantity, column};

/// How columns of currents end: A.
const CURRENT: &str = "a";

/// The effort of a joint as a recording has it.
#[derive(Clone, Debug, PartialEq)]
pub struct EffortColumn {
    /// The joint.
    pub joint: String,
    /// The column with its scale as the rig file states it, where it states one.
    pub source: ScaledColumn,
    /// Its unit: `A`, else empty.
    pub unit: &'static str,
}

impl EffortColumn {
    /// Returns the column times a gain.
    fn times(&self, gain: f64) -> ScaledColumn {
        let mut source = self.source.clone();
        source.scale *= gain;
        source.offset *= gain;
        source.plus.values_mut().for_each(|factor| *factor *= gain);
        source
    }
}

/// Returns the effort columns of a recording's joints of one freedom, in the order of the model; of joints
/// without one nothing.
///
/// A rig file names them; otherwise they are `JOINT_nm` (`JOINT_n`) or, of currents, `JOINT_a`.
pub fn columns(recording: &Recording, model: &Model) -> Vec<EffortColumn> {
    let has = |name: &str| recording.extra.iter().any(|(own, _)| own == name);
    let mut all = Vec::new();
    for link in model.welded().links.iter().skip(1) {
        let joint = &link.joint_name;
        let Some(own) = column(&recording.rig, joint, &link.link.joint, Quantity::Effort) else { continue };
        let current = format!("{joint}_{CURRENT}");
        let name = if has(&own.name) { own.name } else { current.clone() };
        if !has(&name) {
            continue;
        }
        let unit = if name.to_lowercase().ends_with("_a") { "A" } else { "" };
        let plain = name == current;
        let plus = own.plus.into_iter().collect();
        let source = ScaledColumn {
            name,
            scale: if plain && !own.is_named { 1.0 } else { own.scale },
            unit: None,
            offset: own.offset,
            plus,
        };
        all.push(EffortColumn { joint: joint.clone(), source, unit });
    }
    all
}

/// Gives every effort of a rig file its gain, and the standard deviation of that, relative; noise that is
/// stated of columns is scaled too.
pub fn scale(rig: &mut RigFile, efforts: &[EffortColumn], gains: &[f64], std: &[f64]) {
    for ((effort, gain), std) in efforts.iter().zip(gains).zip(std) {
        let at = rig.joint.iter().position(|table| table.name == effort.joint).unwrap_or_else(|| {
            rig.joint.push(JointTable { name: effort.joint.clone(), ..JointTable::default() });
            rig.joint.len() - 1
        });
        let Some(table) = rig.joint.get_mut(at) else { continue };
        let before = table.effort.as_ref().map_or(effort.source.scale, |own| own.parts().1);
        let source = effort.times(*gain);
        if before != 0.0 {
            table.effort_noise = table.effort_noise.map(|noise| noise * (source.scale / before).abs());
        }
        table.effort = Some(ColumnSource::Scaled(source));
        table.effort_gain_std = Some(*std);
    }
}

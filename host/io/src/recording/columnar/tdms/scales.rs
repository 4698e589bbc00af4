//! Scales that a channel's properties state: raw numbers become those of its unit.

use super::segments::Object;

/// More scales than this one after the other are no calibration.
const MOST: usize = 32;
/// The source of a scale that takes the raw numbers.
const RAW: f64 = 4_294_967_295.0;

const COUNTS: &str =
    "its numbers are counts of the converter, and no scale makes values of them: save it scaled";

/// Scales one after the other; the last one's number counts.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Scales(Vec<Scale>);

/// One scale: a polynomial of the raw numbers, or of those of an earlier scale.
#[derive(Clone, Debug, PartialEq)]
struct Scale {
    source: Option<usize>,
    coefficients: Vec<f64>,
}

impl Scales {
    /// Returns the number of a raw one.
    pub(super) fn apply(&self, raw: f64) -> f64 {
        let mut found: Vec<f64> = Vec::with_capacity(self.0.len());
        for scale in &self.0 {
            let of = scale.source.and_then(|k| found.get(k).copied()).unwrap_or(raw);
            found.push(scale.coefficients.iter().rev().fold(0.0, |sum, c| sum * of + c));
        }
        found.last().copied().unwrap_or(raw)
    }
}

/// Returns the scales of a channel, by its own properties, its group's or the file's; `None` if its numbers
/// are scaled already.
///
/// # Errors
/// Names a kind of scale that is not read.
pub(super) fn of(channel: &Object, objects: &[Object]) -> Result<Option<Scales>, String> {
    let above = |count: usize| {
        objects.iter().find(|object| object.path.len() == count && channel.path.starts_with(&object.path))
    };
    let count = |object: &Object| object.number("NI_Number_Of_Scales").filter(|count| *count > 0.0);
    let owner = [Some(channel), above(1), above(0)].into_iter().flatten().find(|o| count(o).is_some());
    let is_counts = channel.layout.as_ref().is_some_and(|layout| layout.is_counts);
    let Some(owner) = owner else { return if is_counts { Err(COUNTS.to_owned()) } else { Ok(None) } };
    if owner.text("NI_Scaling_Status") == Some("scaled") && channel.layout.is_none() {
        return Ok(None);
    }
    let count = count(owner).unwrap_or(0.0) as usize;
    if count > MOST {
        return Err(format!("it has {count} scales one after the other, more than {MOST}"));
    }
    // A scale that is not stated leaves the numbers as they are, if another one follows, or it is the
    // converter's own: DAQmx begins so.
    let own_scale = channel.layout.as_ref().map(|layout| layout.scale);
    let has_type = |k: usize| owner.text(&format!("NI_Scale[{k}]_Scale_Type")).is_some();
    let is_stated = |k: usize| has_type(k) || (k + 1 == count && own_scale != Some(k));
    if is_counts && !(0..count).any(has_type) {
        return Err(COUNTS.to_owned());
    }
    let own = |k: usize| {
        if is_stated(k) { scale(owner, k) } else { Ok(Scale { source: None, coefficients: vec![0.0, 1.0] }) }
    };
    (0..count).map(own).collect::<Result<Vec<_>, _>>().map(|scales| Some(Scales(scales)))
}

fn scale(owner: &Object, k: usize) -> Result<Scale, String> {
    let key = |rest: &str| format!("NI_Scale[{k}]_{rest}");
    let number = |rest: &str| {
        owner.number(&key(rest)).ok_or_else(|| format!("its scale {k} lacks the property {}", key(rest)))
    };
    let kind = owner.text(&key("Scale_Type")).unwrap_or("none");
    let coefficients = match kind {
        "Linear" => vec![number("Linear_Y_Intercept")?, number("Linear_Slope")?],
        "Polynomial" => {
            let size = owner.number(&key("Polynomial_Coefficients_Size")).unwrap_or(4.0);
            let size = if (0.0..=64.0).contains(&size) { size as usize } else { 0 };
            (0..size)
                .map(|n| number(&format!("Polynomial_Coefficients[{n}]")))
                .collect::<Result<Vec<_>, _>>()?
        }
        other => {
            return Err(format!(
                "it is to be scaled by a scale of kind {other:?}, which is not read: save it scaled"
            ));
        }
    };
    let source = owner.number(&key(&format!("{kind}_Input_Source"))).filter(|source| *source < RAW);
    let source = source.map(|source| source as usize);
    if source.is_some_and(|source| source >= k) {
        return Err(format!("its scale {k} takes the numbers of a later one"));
    }
    Ok(Scale { source, coefficients })
}

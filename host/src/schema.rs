//! JSON Schemas of the files, made from their types: the documentation of a field is its description.

use serde_json::Value;

/// Names that [`schema`] knows.
pub const NAMES: [&str; 5] = ["rig", "result", "plan", "reference", "calibration"];

/// Returns the JSON Schema of a rig file (`rig`), of `result.json` (`result`), of a plan (`plan`), of a
/// reference body (`reference`) or of the calibration of a rig (`calibration`); `None` for another name.
///
/// ```
/// let schema = rigident::schema::schema("result").unwrap();
/// assert_eq!(schema["properties"]["mass_kg"]["description"], "Mass of the one body, kg.");
/// ```
pub fn schema(name: &str) -> Option<Value> {
    match name {
        "rig" => Some(schemars::schema_for!(rigident_io::rig::RigFile).to_value()),
        "result" => Some(schemars::schema_for!(rigident_identify::answer::Answer).to_value()),
        "plan" => Some(schemars::schema_for!(rigident_plan::plan_file::PlanFile).to_value()),
        "reference" => Some(schemars::schema_for!(rigident_identify::reference::ReferenceBody).to_value()),
        "calibration" => Some(schemars::schema_for!(rigident_io::rig::RigCalibration).to_value()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Collects the fields without a description, whatever type they belong to.
    fn undescribed(value: &Value, path: &str, found: &mut Vec<String>) {
        if let Some(fields) = value.get("properties").and_then(Value::as_object) {
            // The name of an enum's variant is described beside it.
            let is_variant = fields.len() == 1 && value.get("description").is_some();
            for (name, field) in fields.iter().filter(|_| !is_variant) {
                // The tag of an enum is described by its variants.
                let is_tag = field.get("const").is_some() && field.as_object().is_some_and(|o| o.len() <= 2);
                let described = field.get("description").is_some() || field.get("$ref").is_some() || is_tag;
                if !described {
                    found.push(format!("{path}.{name}"));
                }
            }
        }
        match value {
            Value::Object(object) => {
                object.iter().for_each(|(key, inner)| undescribed(inner, &format!("{path}/{key}"), found));
            }
            Value::Array(items) => items.iter().for_each(|inner| undescribed(inner, path, found)),
            _ => {}
        }
    }

    #[test]
    fn every_field_of_every_file_is_described() {
        for name in NAMES {
            let schema = schema(name).unwrap();
            let mut found = Vec::new();
            undescribed(&schema, name, &mut found);
            assert!(found.is_empty(), "{found:?}");
            assert!(schema["properties"].as_object().unwrap().len() > 4, "{name}");
        }
        assert_eq!(schema("recording"), None);
    }
}

//! The bill of materials, as CycloneDX 1.5 has it.

use serde_json::{Value, json};

use super::graph::Part;

/// Returns the bill of the program for a system.
pub fn bill(parts: &[Part], version: &str, target: &str) -> Value {
    let component = |part: &Part| {
        let address = format!("pkg:cargo/{}@{}", part.name, part.version);
        let mut own = json!({
            "type": "library",
            "bom-ref": address,
            "name": part.name,
            "version": part.version,
            "purl": address,
            "licenses": [{ "expression": part.licence.replace('/', " OR ") }],
        });
        if let Some(sum) = &part.sha256 {
            own["hashes"] = json!([{ "alg": "SHA-256", "content": sum }]);
        }
        if !part.repository.is_empty() {
            own["externalReferences"] = json!([{ "type": "vcs", "url": part.repository }]);
        }
        own
    };
    json!({
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": { "component": {
            "type": "application",
            "bom-ref": format!("pkg:cargo/rigident-cli@{version}"),
            "name": "rigident",
            "version": version,
            "licenses": [{ "expression": "MIT OR Apache-2.0" }],
            "properties": [{ "name": "target", "value": target }],
        } },
        "components": parts.iter().map(component).collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::package::graph;

    #[test]
    fn the_bill_has_the_linked_crates_and_none_that_only_build() {
        let parts = graph::parts("x86_64-unknown-linux-gnu").unwrap();
        let names: Vec<&str> = parts.iter().map(|part| part.name.as_str()).collect();
        for linked in ["nalgebra", "clap", "libsqlite3-sys", "zstd-sys"] {
            assert!(names.contains(&linked), "{linked}");
        }
        for other in ["rigident", "syn", "cc", "windows-sys"] {
            assert!(!names.contains(&other), "{other}");
        }
        let bill = bill(&parts, "1.2.3", "x");
        assert_eq!(bill["components"].as_array().unwrap().len(), parts.len());
        assert!(parts.iter().all(|part| part.sha256.as_ref().is_some_and(|sum| sum.len() == 64)));
        let notices = crate::package::notices::text(&parts).unwrap();
        assert!(notices.contains("SQLite") && notices.contains("Meta Platforms"));
    }
}

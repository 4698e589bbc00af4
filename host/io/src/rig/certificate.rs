//! `[certificate]`: what a certificate says beside the numbers. Modelled on what ISO/IEC 17025:2017, 7.8.2
//! and 7.8.4, asks for.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[certificate]`. Every text is as the laboratory writes it; dates are `2026-11-20`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CertificateTable {
    /// Number of the certificate, which no other one has.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub number: Option<String>,
    /// Name of the laboratory.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub laboratory: Option<String>,
    /// Address of the laboratory.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub laboratory_address: Option<String>,
    /// Where it was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub place: Option<String>,
    /// Name of the customer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub customer: Option<String>,
    /// Address of the customer, or how to reach them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub customer_address: Option<String>,
    /// Name of the measured part, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub part: Option<String>,
    /// Number of its drawing or type.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub part_number: Option<String>,
    /// Serial number, or another mark by which this one is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub part_serial: Option<String>,
    /// Condition in which it came, and how it was measured: tank full, cover off.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub condition: Option<String>,
    /// Where its axes are marked on it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axes: Option<String>,
    /// Date on which it came.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub received_on: Option<String>,
    /// Date on which it was measured; without it the recording's, where that states one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured_on: Option<String>,
    /// Procedure by which it was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub procedure: Option<String>,
    /// Additions to the procedure, deviations from it, what was left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deviations: Option<String>,
    /// Conditions that have an influence: temperature, draught.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub conditions: Option<String>,
    /// Statement of how the results are traceable to the SI.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub traceability: Option<String>,
    /// Results that others provided, and what the customer stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub external: Option<String>,
    /// Who measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub operator: Option<String>,
    /// Who authorises the certificate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub authorised_by: Option<String>,
    /// Further remarks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remarks: Option<String>,
    /// Unit of masses; `kg` without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_unit: Option<MassUnit>,
    /// Unit of lengths; `mm` without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub length_unit: Option<LengthUnit>,
    /// Unit of moments of inertia; `kg cm2` without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inertia_unit: Option<InertiaUnit>,
    /// Equipment beside the load cell and the IMU, whose serial numbers are in their own tables.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub equipment: Vec<EquipmentTable>,
}

/// `[[certificate.equipment]]`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EquipmentTable {
    /// Name of the equipment, with maker and type.
    pub name: String,
    /// Serial number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub serial: Option<String>,
    /// Date of its calibration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibrated_on: Option<String>,
    /// Certificate of the equipment, and the laboratory that gave it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub certificate: Option<String>,
}

/// Unit of masses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum MassUnit {
    /// Kilogram.
    #[default]
    #[serde(rename = "kg")]
    Kilogram,
    /// Gram.
    #[serde(rename = "g")]
    Gram,
    /// Pound, 0.45359237 kg.
    #[serde(rename = "lb")]
    Pound,
}

/// Unit of lengths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum LengthUnit {
    /// Millimetre.
    #[default]
    #[serde(rename = "mm")]
    Millimetre,
    /// Centimetre.
    #[serde(rename = "cm")]
    Centimetre,
    /// Metre.
    #[serde(rename = "m")]
    Metre,
    /// Inch, 25.4 mm.
    #[serde(rename = "in")]
    Inch,
}

/// Unit of moments of inertia.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum InertiaUnit {
    /// Kilogram times square centimetre.
    #[default]
    #[serde(rename = "kg cm2")]
    KilogramSquareCentimetre,
    /// Kilogram times square metre.
    #[serde(rename = "kg m2")]
    KilogramSquareMetre,
    /// Kilogram times square millimetre.
    #[serde(rename = "kg mm2")]
    KilogramSquareMillimetre,
    /// Gram times square centimetre.
    #[serde(rename = "g cm2")]
    GramSquareCentimetre,
    /// Pound times square inch.
    #[serde(rename = "lb in2")]
    PoundSquareInch,
}

impl MassUnit {
    /// Returns how many of it a kilogram is, and its symbol in ASCII.
    pub fn of_si(self) -> (f64, &'static str) {
        match self {
            Self::Kilogram => (1.0, "kg"),
            Self::Gram => (1e3, "g"),
            Self::Pound => (1.0 / 0.453_592_37, "lb"),
        }
    }
}

impl LengthUnit {
    /// Returns how many of it a metre is, and its symbol in ASCII.
    pub fn of_si(self) -> (f64, &'static str) {
        match self {
            Self::Millimetre => (1e3, "mm"),
            Self::Centimetre => (1e2, "cm"),
            Self::Metre => (1.0, "m"),
            Self::Inch => (1.0 / 0.0254, "in"),
        }
    }
}

impl InertiaUnit {
    /// Returns how many of it one kg m² is, and its symbol in ASCII.
    pub fn of_si(self) -> (f64, &'static str) {
        match self {
            Self::KilogramSquareCentimetre => (1e4, "kg cm2"),
            Self::KilogramSquareMetre => (1.0, "kg m2"),
            Self::KilogramSquareMillimetre => (1e6, "kg mm2"),
            Self::GramSquareCentimetre => (1e7, "g cm2"),
            Self::PoundSquareInch => (1.0 / (0.453_592_37 * 0.0254 * 0.0254), "lb in2"),
        }
    }
}

/// Why a key cannot be set.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{given:?}: {reason}")]
pub struct CertificateKeyError {
    /// The text that was given.
    pub given: String,
    /// The fault in it.
    pub reason: String,
}

impl CertificateTable {
    /// Sets a key of the table from the text of a command line.
    ///
    /// # Errors
    /// There is no such key, it is none of a text, or the text steers what shows it.
    pub fn set(&mut self, key: &str, text: &str) -> Result<(), CertificateKeyError> {
        let refuse = |reason: String| CertificateKeyError { given: format!("{key}={text}"), reason };
        if !rigident_shared::printable::is_name(text) {
            return Err(refuse("control characters, or more than 1024 bytes".to_owned()));
        }
        let mut table = toml::Table::try_from(&*self).map_err(|e| refuse(e.to_string()))?;
        table.insert(key.to_owned(), toml::Value::String(text.to_owned()));
        *self = table.try_into().map_err(|e: toml::de::Error| refuse(e.message().to_owned()))?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_set_by_name_and_unknown_ones_are_named() {
        let mut table = CertificateTable::default();
        table.set("number", "2026-117").unwrap();
        table.set("inertia_unit", "kg mm2").unwrap();
        assert_eq!(table.number.as_deref(), Some("2026-117"));
        assert_eq!(table.inertia_unit, Some(InertiaUnit::KilogramSquareMillimetre));
        for (key, text) in [("nummer", "1"), ("mass_unit", "stone"), ("equipment", "x"), ("part", "a\u{1b}b")]
        {
            let error = table.set(key, text).unwrap_err();
            assert!(error.to_string().contains(key), "{error}");
        }
        assert!(table.set("nummer", "1").unwrap_err().reason.contains("number"));
    }

    #[test]
    fn a_body_has_the_same_inertia_in_every_unit() {
        // 2 kg at 0.1 m: 0.02 kg m².
        let (pound, _) = MassUnit::Pound.of_si();
        let (inch, _) = LengthUnit::Inch.of_si();
        let (both, _) = InertiaUnit::PoundSquareInch.of_si();
        let apart = 2.0 * pound * (0.1 * inch).powi(2) - 0.02 * both;
        assert!(apart.abs() < 1e-12, "{apart}");
        assert_eq!(InertiaUnit::default().of_si().0 * 0.02, 200.0);
    }
}

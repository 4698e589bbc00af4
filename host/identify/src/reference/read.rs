//! Reading and checking the file of a reference body; every complaint names the key.

use std::path::Path;

use super::body::LEAST_DENSITY_STD;
use super::{ReferenceBody, ReferenceError};

const POSITIVE: &str = "must be finite and greater than zero";
const NOT_NEGATIVE: &str = "must be finite and not negative";
const FINITE: &str = "every number must be finite";
const LIMITS: &str = "±a must be finite and not negative";

/// Checks of one file.
struct Check<'a> {
    path: &'a str,
}

impl Check<'_> {
    fn all(
        &self,
        key: &str,
        values: &[f64],
        good: impl Fn(f64) -> bool,
        advice: &str,
    ) -> Result<(), ReferenceError> {
        if values.iter().all(|v| v.is_finite() && good(*v)) {
            return Ok(());
        }
        Err(ReferenceError::Value {
            path: self.path.to_owned(),
            key: key.to_owned(),
            value: match values {
                [value] => value.to_string(),
                values => format!("{values:?}"),
            },
            advice: advice.to_owned(),
        })
    }

    fn positive(&self, key: &str, values: &[f64]) -> Result<(), ReferenceError> {
        self.all(key, values, |v| v > 0.0, POSITIVE)
    }

    fn limits(&self, key: &str, values: &[f64]) -> Result<(), ReferenceError> {
        self.all(key, values, |v| v >= 0.0, LIMITS)
    }

    fn shape(&self, body: &ReferenceBody) -> Result<(), ReferenceError> {
        let count = [body.cylinder.is_some(), body.cuboid.is_some(), body.measured.is_some()];
        let count = count.iter().filter(|given| **given).count();
        if count != 1 {
            return Err(ReferenceError::Shape { path: self.path.to_owned(), count });
        }
        if let Some(c) = &body.cylinder {
            self.positive("cylinder.diameter_m", &[c.diameter_m])?;
            self.positive("cylinder.length_m", &[c.length_m])?;
            self.limits("cylinder.diameter_tolerance_m", &[c.diameter_tolerance_m])?;
            self.limits("cylinder.length_tolerance_m", &[c.length_tolerance_m])?;
            self.limits("cylinder.bore_diameter_tolerance_m", &[c.bore_diameter_tolerance_m])?;
            let inside = |v: f64| (0.0..c.diameter_m).contains(&v);
            self.all(
                "cylinder.bore_diameter_m",
                &[c.bore_diameter_m],
                inside,
                "must be less than the diameter",
            )?;
        }
        if let Some(c) = &body.cuboid {
            self.positive("cuboid.size_m", &c.size_m)?;
            self.limits("cuboid.size_tolerance_m", &c.size_tolerance_m)?;
        }
        if let Some(m) = &body.measured {
            self.all("measured.com_m", &m.com_m, |_| true, FINITE)?;
            self.all("measured.com_std_m", &m.com_std_m, |v| v >= 0.0, NOT_NEGATIVE)?;
            self.all("measured.inertia_com_kgm2", &m.inertia_com_kgm2, |_| true, FINITE)?;
            self.all("measured.inertia_com_std_kgm2", &m.inertia_com_std_kgm2, |v| v >= 0.0, NOT_NEGATIVE)?;
            let [a, b, c, ..] = m.inertia_com_kgm2;
            let most = a.max(b).max(c);
            let advice = "no body has such moments: each is positive, and at most the sum of the other two";
            self.all(
                "measured.inertia_com_kgm2",
                &[a, b, c],
                |v| v > 0.0 && most <= a + b + c - most,
                advice,
            )?;
        }
        Ok(())
    }
}

impl ReferenceBody {
    /// Reads the text of a reference body's file called `path`.
    ///
    /// # Errors
    /// [`ReferenceError`] names the key.
    pub fn parse(text: &str, path: &str) -> Result<Self, ReferenceError> {
        let body: Self = toml::from_str(text).map_err(|e| ReferenceError::Syntax {
            path: path.to_owned(),
            reason: e.to_string().trim().replace('\n', " "),
        })?;
        let check = Check { path };
        check.positive("mass_kg", &[body.mass_kg])?;
        check.positive("mass_std_kg", &[body.mass_std_kg])?;
        let known = format!("must be finite and at least {LEAST_DENSITY_STD:e}: no body is known better");
        check.all("density_std", &[body.density_std], |v| v >= LEAST_DENSITY_STD, &known)?;
        check.shape(&body)?;
        let place = &body.place;
        check.all("place.position_m", &place.position_m, |_| true, FINITE)?;
        check.all("place.rotation_rpy_deg", &place.rotation_rpy_deg, |_| true, FINITE)?;
        check.limits("place.position_tolerance_m", &place.position_limits_m())?;
        check.limits("place.rotation_tolerance_deg", &place.rotation_limits_deg())?;
        for (k, mounting) in body.mounting.iter().enumerate() {
            let twice = body.mounting.iter().take(k).any(|other| other.name == mounting.name);
            if mounting.name.is_empty() || twice {
                return Err(ReferenceError::Value {
                    path: path.to_owned(),
                    key: format!("mounting[{k}].name"),
                    value: format!("{:?}", mounting.name),
                    advice: "each mounting needs a name of its own".to_owned(),
                });
            }
            check.all(
                &format!("mounting[{k}].rotation_rpy_deg"),
                &mounting.rotation_rpy_deg,
                |_| true,
                FINITE,
            )?;
            let position = mounting.position_m.unwrap_or_default();
            check.all(&format!("mounting[{k}].position_m"), &position, |_| true, FINITE)?;
        }
        Ok(body)
    }

    /// Reads a reference body's file.
    ///
    /// # Errors
    /// [`ReferenceError`] says why there is none.
    pub fn load(path: &Path) -> Result<Self, ReferenceError> {
        let name = path.display().to_string();
        let text = rigident_files::read_text(path)
            .map_err(|e| ReferenceError::Unreadable { path: name.clone(), reason: e.to_string() })?;
        Self::parse(&text, &name)
    }
}

//! A plan on disk: a motion program and the machine that it was made for.

use std::path::Path;

use hexapod::{BodyParameters, Geometry, MotionError, MotionProgram, Trajectory};
use serde::{Deserialize, Serialize};

use rigident_io::recording::error::RecordingError;
use rigident_io::recording::new_file::write_new_text;
use rigident_shared::printable;

/// Name of the format's schema.
const SCHEMA: &str = "rigident/plan/1";
/// Joints that are closer than this are the same, m.
const SAME_JOINT_M: f64 = 1e-4;
/// Shortest and longest plan, s: from less than a second nothing is determined; an hour is what
/// `--duration-s` takes.
const DURATION_S: [f64; 2] = [1.0, 3600.0];

/// The file's object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlanFile {
    /// Name of this schema: `rigident/plan/1`.
    #[schemars(extend("const" = SCHEMA))]
    schema: String,
    /// What it is, for people.
    pub title: String,
    /// Joints of the machine on its base, m; absent where they are not published.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    base_joints_m: Option<[[f64; 3]; 6]>,
    /// Joints of the machine on its plate, m; absent where they are not published.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    plate_joints_m: Option<[[f64; 3]; 6]>,
    /// What the legs carry, in P, if the plan was made for that: their forces are known then.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    carries: Option<BodyParameters>,
    /// What to do.
    pub program: MotionProgram,
}

/// The reason why a plan cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PlanFileError {
    /// The file.
    #[error("plan {path}: {reason}")]
    Unreadable {
        /// Path of the plan.
        path: String,
        /// The reason, as the system or the parser says it.
        reason: String,
    },
    /// Another format, or a later one.
    #[error("plan {path}: {found}; this program reads {SCHEMA:?}: make the plan anew with `plan()`")]
    Schema {
        /// Path of the plan.
        path: String,
        /// The schema that the file names.
        found: String,
    },
    /// Nothing to do, or more than a day's work.
    #[error(
        "plan {path}: it takes {duration_s} s; from {least} s to {most} s make an experiment",
        least = DURATION_S[0], most = DURATION_S[1]
    )]
    Duration {
        /// Path of the plan.
        path: String,
        /// s.
        duration_s: f64,
    },
    /// Another machine.
    #[error(
        "plan {path} is for another rig: {joint} joint {number} is at {planned:.4?} m in the plan and at \
         {actual:.4?} m in the rig; make it anew with `plan(…, rig)`"
    )]
    AnotherRig {
        /// Path of the plan.
        path: String,
        /// Base or plate.
        joint: &'static str,
        /// The joint's number, from 1.
        number: usize,
        /// The joint's place in the plan, m.
        planned: [f64; 3],
        /// The joint's place in the rig, m.
        actual: [f64; 3],
    },
    /// A machine of another kind.
    #[error(
        "plan {path} is for another rig: it was made for a machine {} its joints, and the rig file describes \
         one {} them; make it anew with `plan_motion(rig)`",
        if *planned { "with" } else { "without" }, if *planned { "without" } else { "with" }
    )]
    OtherKnowledge {
        /// Path of the plan.
        path: String,
        /// The plan knows of joints.
        planned: bool,
    },
    /// The parameters that it carries are no body.
    #[error(
        "plan {path}: carries: no body has these parameters: the mass must be positive, and about any axis \
         the moment at most the sum of the other two"
    )]
    Carries {
        /// Path of the plan.
        path: String,
    },
    /// The machine cannot do it.
    #[error("plan {path}: {error}")]
    Motion {
        /// Path of the plan.
        path: String,
        /// Leg or limit, and when.
        error: MotionError,
    },
}

impl PlanFile {
    /// Makes the file of a program for a machine.
    pub fn new(title: String, geometry: &Geometry, program: MotionProgram) -> Self {
        Self {
            schema: SCHEMA.to_owned(),
            title,
            base_joints_m: geometry.has_joints().then_some(geometry.base_joints_m),
            plate_joints_m: geometry.has_joints().then_some(geometry.plate_joints_m),
            carries: None,
            program,
        }
    }

    /// Adds the body that the plan was made to carry, in P.
    #[must_use]
    pub fn carrying(mut self, body: BodyParameters) -> Self {
        self.carries = Some(body);
        self
    }

    /// Returns what the plan was made to carry, in P.
    pub fn carries(&self) -> Option<BodyParameters> {
        self.carries
    }

    /// Writes a new file.
    ///
    /// # Errors
    /// It is there already, or cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), RecordingError> {
        write_new_text(path, &self.text())
    }

    /// Returns the text of the file, JSON.
    pub fn text(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }

    /// Reads a plan for this machine and checks that it can do it, at every instant. What its legs can carry
    /// is
    /// [`rigident_device::platform::check`]'s concern.
    ///
    /// # Errors
    /// [`PlanFileError`].
    pub fn read(path: &Path, geometry: &Geometry) -> Result<Self, PlanFileError> {
        let name = || path.display().to_string();
        let unreadable = |reason: String| PlanFileError::Unreadable { path: name(), reason };
        let text = rigident_files::read_text(path).map_err(|e| unreadable(e.to_string()))?;
        let object: serde_json::Value = serde_json::from_str(&text).map_err(|e| unreadable(e.to_string()))?;
        match (&object, object.get("schema")) {
            (_, Some(serde_json::Value::String(schema))) if schema == SCHEMA => {}
            (_, Some(schema)) => {
                return Err(PlanFileError::Schema { path: name(), found: format!("its schema is {schema}") });
            }
            (serde_json::Value::Object(_), None) => {
                let found = "it is no plan, no key \"schema\" says of which format it is".to_owned();
                return Err(PlanFileError::Schema { path: name(), found });
            }
            _ => {
                let found = "it is no plan, which is a JSON object".to_owned();
                return Err(PlanFileError::Schema { path: name(), found });
            }
        }
        let mut plan: Self = serde_json::from_value(object).map_err(|e| unreadable(e.to_string()))?;
        // It is shown where somebody is asked whether the platform may move.
        plan.title = printable::name(&plan.title).to_string();
        let joints = [plan.base_joints_m, plan.plate_joints_m];
        if joints.iter().any(|planned| planned.is_some() != geometry.has_joints()) {
            return Err(PlanFileError::OtherKnowledge { path: name(), planned: !geometry.has_joints() });
        }
        let actual = [("base", &geometry.base_joints_m), ("plate", &geometry.plate_joints_m)];
        for (planned, (joint, actual)) in
            joints.iter().zip(actual).filter_map(|(p, a)| Some((p.as_ref()?, a)))
        {
            for (k, (planned, actual)) in planned.iter().zip(actual).enumerate() {
                let apart = planned.iter().zip(actual).map(|(p, a)| (p - a).abs()).fold(0.0, f64::max);
                if apart >= SAME_JOINT_M || apart.is_nan() {
                    let (planned, actual) = (*planned, *actual);
                    return Err(PlanFileError::AnotherRig {
                        path: name(),
                        joint,
                        number: k + 1,
                        planned,
                        actual,
                    });
                }
            }
        }
        if plan.carries.is_some_and(|body| !body.is_possible()) {
            return Err(PlanFileError::Carries { path: name() });
        }
        let motion = |error| PlanFileError::Motion { path: name(), error };
        let trajectory = Trajectory::new(&plan.program).map_err(motion)?;
        let duration_s = trajectory.duration_s();
        if !(DURATION_S[0]..=DURATION_S[1]).contains(&duration_s) {
            return Err(PlanFileError::Duration { path: name(), duration_s });
        }
        geometry.check(&trajectory).map_err(motion)?;
        Ok(plan)
    }
}

#[cfg(test)]
mod tests {
    use hexapod::Segment;

    use super::*;

    fn plan() -> PlanFile {
        let geometry = Geometry::thesis();
        let mut up = geometry.home();
        up.position_m[2] += 0.02;
        let segments = vec![Segment::Move { to: up, duration_s: 2.0 }];
        PlanFile::new("up".to_owned(), &geometry, MotionProgram { start: geometry.home(), segments })
    }

    #[test]
    fn a_plan_comes_back_as_it_was_and_takes_no_other_files_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.json");
        plan().write(&path).unwrap();
        assert_eq!(PlanFile::read(&path, &Geometry::thesis()).unwrap(), plan());
        assert!(plan().write(&path).is_err());
    }

    #[test]
    fn unusable_plans_are_reported() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.json");
        let complaint = |text: &str, geometry: &Geometry| {
            std::fs::write(&path, text).unwrap();
            PlanFile::read(&path, geometry).unwrap_err()
        };
        let thesis = Geometry::thesis();
        let good = serde_json::to_string(&plan()).unwrap();
        let mut other = thesis.clone();
        other.plate_joints_m[2][1] += 0.01;
        let error = complaint(&good, &other);
        assert!(matches!(error, PlanFileError::AnotherRig { joint: "plate", number: 3, .. }), "{error}");
        let short = Geometry { leg_length_m: [0.70, 0.705], ..thesis.clone() };
        let error = complaint(&good, &short);
        assert!(matches!(error, PlanFileError::Motion { .. }), "{error}");
        let mut thick = thesis.clone();
        thick.limits.bulk = Some(hexapod::Bulk {
            leg_radius_m: 0.025,
            joint_length_m: 0.08,
            plate_radius_m: Some(0.02),
            base_radius_m: Some(0.02),
            clearance_m: 0.0,
        });
        std::fs::write(&path, &good).unwrap();
        PlanFile::read(&path, &thick).unwrap();
        thick.limits.bulk.as_mut().unwrap().clearance_m = 0.05;
        let error = complaint(&good, &thick);
        assert!(error.to_string().contains("mm of each other, 50.0 mm must be left"), "{error}");
        for text in ["{\"schema\": \"rigident/plan/9\"}", "[]", "null", "{}", "{\"schema\": 3}"] {
            assert!(matches!(complaint(text, &thesis), PlanFileError::Schema { .. }), "{text}");
        }
        let without_title = good.replace("\"title\"", "\"name\"");
        for text in ["{", &without_title] {
            assert!(matches!(complaint(text, &thesis), PlanFileError::Unreadable { .. }), "{text}");
        }
        let of = |segments| {
            let program = MotionProgram { start: thesis.home(), segments };
            serde_json::to_string(&PlanFile::new(String::new(), &thesis, program)).unwrap()
        };
        assert!(matches!(complaint(&of(Vec::new()), &thesis), PlanFileError::Duration { .. }));
        for duration_s in [0.001, 4000.0] {
            let error = complaint(&of(vec![Segment::Hold { duration_s }]), &thesis);
            assert!(
                matches!(error, PlanFileError::Duration { duration_s: found, .. } if found == duration_s),
                "{error}"
            );
        }
        // Beyond what a trajectory can be.
        let error = complaint(&of(vec![Segment::Hold { duration_s: 1e300 }]), &thesis);
        assert!(matches!(error, PlanFileError::Motion { .. }), "{error}");
    }
}

//! The common part of the tables of still poses: the thesis' platform and its best poses.

use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

use hexapod::Geometry;
use nalgebra::Vector3;
use rigident::plan::poses::measure::up_in_plate;
use rigident::plan::poses::montecarlo::{Row, section_6_3};
use rigident::plan::poses::plan::{PosePlan, Task, plan};
use rigident::plan::poses::{Objective, Reach, Region};

/// Number of experiments, as in the thesis.
pub const RUNS: u64 = 2500;

/// The built-in platform with the whole stroke, or the middle of it, m.
pub struct Platform {
    pub reach: Reach,
    pub region: Region,
}

impl Platform {
    pub fn with_stroke(stroke_m: Option<f64>) -> Self {
        let reach = Reach::new(Geometry::thesis(), stroke_m).expect("the built-in platform can be level");
        let region = Region::of_platform(&reach);
        Self { reach, region }
    }

    pub fn plan(&self, n: usize, objective: Objective) -> PosePlan {
        let task = Task { objective, ..Task::thesis(n) };
        plan(&self.reach, &self.region, &task, &AtomicBool::new(false), |_| ()).expect("the platform tilts")
    }
}

/// Runs section 6.3 with the plans for two to ten poses.
pub fn campaign() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| {
        let platform = Platform::with_stroke(None);
        let ups = |plan: PosePlan| -> Vec<Vector3<f64>> {
            plan.poses.iter().map(|p| up_in_plate([p.rpy_rad[0], p.rpy_rad[1]])).collect()
        };
        let sets: Vec<_> = (2..=10).map(|n| ups(platform.plan(n, Objective::Condition))).collect();
        section_6_3(&sets, RUNS, 1, &AtomicBool::new(false), |_, _| ())
    })
}

/// Writes a difference as `+0.01`, and no sign before a zero.
pub fn difference(ours: f64, printed: f64, decimals: usize) -> String {
    let text = format!("{:+.decimals$}", ours - printed);
    if text.bytes().all(|b| b"+-0.".contains(&b)) { text[1..].to_owned() } else { text.replace('-', "−") }
}

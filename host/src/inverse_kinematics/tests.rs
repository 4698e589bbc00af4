//! Recorded people: joint centres against those that the laboratory's software wrote into the same file.

use std::path::PathBuf;

use nalgebra::Vector3;

use super::solve::Solver;
use super::subject::{HumanModel, Known, subject};
use crate::motion_capture::c3d::C3d;

fn recorded(folder: &str, file: &str) -> C3d {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data").join(folder).join(file);
    C3d::parse(&std::fs::read(path).unwrap()).unwrap()
}

fn frames(c3d: &C3d, every: usize) -> Vec<Vec<Option<Vector3<f64>>>> {
    let point = |frame: usize, label: usize| {
        let p = c3d.point(frame, label)?;
        (p != [0.0; 3]).then(|| Vector3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2])))
    };
    (0..c3d.frames).step_by(every).map(|f| (0..c3d.labels.len()).map(|l| point(f, l)).collect()).collect()
}

#[test]
fn probe() {
    for (folder, static_file, motion, h) in [
        (
            "human_btk_pig_47kg_fullbody",
            "PiG_Calibration-FlatFoot-Full.c3d",
            "PiG_Motion-FlatFoot-Full.c3d",
            1.505,
        ),
        ("human_btk_pig_60kg_functional", "FunctionalStatic.c3d", "FunctionalWalk.c3d", 1.68),
    ] {
        let (standing, moving) = (recorded(folder, static_file), recorded(folder, motion));
        let labels: Vec<String> = moving.labels.clone();
        let map = |c: &C3d, all: Vec<Vec<Option<Vector3<f64>>>>| -> Vec<Vec<Option<Vector3<f64>>>> {
            all.into_iter()
                .map(|f| {
                    labels.iter().map(|l| c.labels.iter().position(|k| k == l).and_then(|k| f[k])).collect()
                })
                .collect()
        };
        let mut all: Vec<_> = map(&standing, frames(&standing, standing.frames / 4));
        all.extend(map(&moving, frames(&moving, moving.frames / 60)));
        for kind in [HumanModel::Human34, HumanModel::Human58] {
            let started = std::time::Instant::now();
            let known = Known { height_m: None, mass_kg: 60.0, ..Known::default() };
            let found = subject(&labels, &all, kind, &known).unwrap();
            println!(
                "{kind:?} h {:.3} ({h}) rms {:.4} {:?} in {:?}",
                found.person.height_m,
                found.rms_m,
                found.person.lengths_m,
                started.elapsed()
            );
            let mut solver = Solver::new(&found.skeleton, &found.markers);
            let mut pose = found.skeleton.zero();
            let started = std::time::Instant::now();
            let mut sums = std::collections::BTreeMap::<String, (f64, usize)>::new();
            let mut worst = std::collections::BTreeMap::<String, (f64, usize)>::new();
            let seen_all = map(&moving, frames(&moving, 1));
            for f in &seen_all {
                let seen = found.markers.iter().map(|m| f[m.label]).collect();
                let Some(solved) = solver.solve(&seen, &pose) else {
                    println!("no pose");
                    continue;
                };
                pose = solved.pose;
                for (m, d) in found.markers.iter().zip(&solved.distances_m) {
                    if let Some(d) = d {
                        let s = worst.entry(m.name.clone()).or_default();
                        s.0 += d * d;
                        s.1 += 1;
                    }
                }
                let places = found.skeleton.places(&pose);
                for (point, link) in [
                    ("LFEP", "l_thigh"),
                    ("RFEP", "r_thigh"),
                    ("LFEO", "l_shank"),
                    ("RFEO", "r_shank"),
                    ("LTIO", "l_foot"),
                    ("RTIO", "r_foot"),
                    ("LHUO", "l_forearm"),
                    ("RHUO", "r_forearm"),
                    ("LHUP", "l_upper_arm"),
                    ("LRAO", "l_hand"),
                    ("RightHipCenterScore", "r_thigh"),
                    ("LeftHipCenterScore", "l_thigh"),
                    ("RightHipCenterNM", "r_thigh"),
                ] {
                    let (Some(label), Some(link)) =
                        (labels.iter().position(|l| l == point), found.model.link(link))
                    else {
                        continue;
                    };
                    if let Some(p) = f[label] {
                        let s = sums.entry(point.to_owned()).or_default();
                        s.0 += (p - places[link].1).norm_squared();
                        s.1 += 1;
                    }
                }
            }
            println!("{} frames in {:?}", seen_all.len(), started.elapsed());
            for (name, (s, n)) in &sums {
                print!("{name} {:.1} mm; ", 1e3 * (s / *n as f64).sqrt());
            }
            println!();
            for (name, (s, n)) in &worst {
                print!("{name} {:.1}; ", 1e3 * (s / *n as f64).sqrt());
            }
            println!();
        }
    }
}

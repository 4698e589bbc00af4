use std::path::PathBuf;

use super::*;
use crate::fit::{FitOptions, Prediction, Silent, fit};
use crate::inverse_kinematics::subject::HumanModel;
use crate::motion_capture::trial::Trial;
use crate::problem::tree::TreeSource;
use crate::answer::predictor::Predictor;
use crate::fit::RowSource;

fn trial(folder: &str, file: &str) -> Trial {
    let path =
        PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data").join(folder).join(file);
    Trial::read(&path, None).unwrap()
}

#[test]
fn probe() {
    for (folder, standing, moving, height) in [
        ("human_btk_pig_47kg_fullbody", "PiG_Calibration-FlatFoot-Full.c3d", "PiG_Motion-FlatFoot-Full.c3d", 1.505),
        ("human_gait2354_subject01_walk", "subject01_static.trc", "subject01_walk1.trc", 1.8),
        ("human_btk_pig_60kg_functional", "FunctionalStatic.c3d", "FunctionalWalk.c3d", 1.68),
    ] {
        let standing = trial(folder, standing);
        for cut in [None, Some(6.0)] {
        let mut trials = [trial(folder, moving)];
        let options = PeopleOptions { kind: HumanModel::Human34, height_m: Some(height), track: track::TrackOptions { cut_off_hz: cut, delay_s: None }, ..PeopleOptions::default() };
        let started = std::time::Instant::now();
        let person = Person::new(&mut trials, Some(&standing), &options, &|_, _| ()).unwrap();
        println!("{:?} mass {:.2} notes {:?} {:?}", started.elapsed(), person.subject.person.mass_kg, person.notes, person.fixed);
        let t = &person.trials[0];
        println!("{:?} used {} from {:?} to {:?}", (t.report.rms_m, &t.report.dropped, t.report.cut_off_hz, t.report.delay), t.frames.len(), t.frames.first().map(|f| f.number), t.frames.last().map(|f| f.number));
        let mut last = 0;
        for f in &t.frames { if f.number != last + 1 { print!("{}..", last); print!(" {}", f.number); } last = f.number; }
        println!("{last}");
        let started = std::time::Instant::now();
        let source = TreeSource::new(person.input(0).unwrap()).unwrap();
        println!("{} parameters, model {:?}", source.parameters().len(), started.elapsed());
        let nominal = Predictor::of_model(&person.subject.model.welded());
        let (values, without) = nominal.values(source.parameters());
        assert!(without.is_empty(), "{without:?}");
        let p = Prediction::of(&source, &values, &[]).unwrap();
        for b in p.blocks.iter().step_by(4) { println!("  t {:.3} meas {:.0?} nominal {:.0?}", b.time_s, b.measured, b.predicted); }
        println!("nominal rms {:?} of sd {:?}", p.residual_rms, p.measured_sd);

        let known = anthropometry::distribution(&person.subject.model, source.base(), &anthropometry::Spread::default()).unwrap();
        let sums = noise::RowSums::of(&source, trials[0].rate_hz, t.report.cut_off_hz).unwrap();
        let sigma = sums.sigma(&known).unwrap();
        println!("sigma {sigma:.2?}");
        let mut input = person.input(0).unwrap();
        input.channel_sigma = Some(sigma);
        let source = TreeSource::new(input).unwrap();
        let mut found = fit(&source, &FitOptions::default(), &Silent).unwrap();
        println!("fit in {:?}: mass {:.2} sd {:.2} cond {:.2e}", started.elapsed(), found.estimate.values[0], found.estimate.covariance[(0,0)].sqrt(), found.estimate.condition_number);
        let base = crate::answer::standard_parameters::BaseEstimate::of(&found, source.base());
        for trust in [0.1, 0.3, 1.0] {
            let full = crate::answer::standard_parameters::nearest(&person.subject.model, &base, trust, false).unwrap();
            let p = Prediction::of(&source, &full.base, &[]).unwrap();
            println!("trust {trust}: mass {:.2} rms {:.1?} {}", full.links.iter().map(|l| l.parameters[0]).sum::<f64>(), p.residual_rms, full.converged);
        }
        let mut factor = found.scaled_factor();
        let w = known.whitening();
        let rows: Vec<(Vec<f64>, f64)> = w.row_iter().map(|r| (r.iter().copied().collect(), (r * known.mean())[0])).collect();
        factor.absorb(rows.iter().map(|(r, v)| (r.as_slice(), *v)));
        found.estimate = crate::fit::Estimate::new(&factor, found.rounding, 1.0, crate::fit::Noise::Given);
        let p = Prediction::of(&source, &found.estimate.values, &[]).unwrap();
        println!("prior: mass {:.2} sd {:.2} rms {:.1?} ratio {:.2}", found.estimate.values[0], found.estimate.covariance[(0,0)].sqrt(), p.residual_rms, found.noise.variance_ratio);
        for c in &found.channels { println!("{} {:.2} {:.2} {:?}", c.channel.name, c.residual_rms, c.measured_sd, c.autocorrelation); } for (p,v) in found.parameters.iter().zip(&found.estimate.values).take(1) { println!("{} {v}", p.name); }
    }
    }
}

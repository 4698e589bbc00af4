//! Rig time to a tensor known to 1 %: programmes made beforehand, and segments decided one by one.

use std::sync::atomic::AtomicBool;

use hexapod::experiment::thesis_program;
use hexapod::{MotionProgram, Segment};
use rigident::plan::adaptive::Asked;
use rigident::plan::adaptive::rehearsal::{Outcome, Rehearsal};
use rigident::plan::equipment::Equipment;
use rigident::plan::motion::{Objective, Task, plan};
use rigident_sim::rig::RigConfig;

const ASKED: Asked = Asked::Tensor(0.01);
const SEEDS: u64 = 3;
/// The default length of an experiment, s.
const DEFAULT_S: f64 = 60.0;
/// The time that counts as never, s.
const LONGEST_S: f64 = 240.0;

/// Returns the table by mounting, readings per second and case, with the rig time of each way.
pub fn table() -> String {
    let mut text = String::from(
        "| mounting, rate | the rig | fixed, 60 s | fixed, shortest that does | its motion alone | D-optimal \
         plan | decided |\n\
         |---|---|---|---|---|---|---|\n",
    );
    for (mounting, config, rate_hz) in [
        ("horizontal, 200 Hz", RigConfig::thesis_horizontal(), 200.0),
        ("vertical, 200 Hz", RigConfig::thesis_vertical(), 200.0),
        ("horizontal, 1000 Hz", RigConfig::thesis_horizontal(), 1000.0),
        ("vertical, 1000 Hz", RigConfig::thesis_vertical(), 1000.0),
    ] {
        let nominal = Rehearsal::as_believed(config, rate_hz).expect("a rig");
        let programs = [
            thesis_program(&nominal.config.geometry, DEFAULT_S),
            shortest(&nominal, [20.0, 24.0, 28.0, 32.0, 36.0, 40.0].into_iter(), |s| {
                thesis_program(&nominal.config.geometry, s)
            }),
            motion_alone(&nominal),
            d_optimal(&nominal),
        ];
        for (words, rehearsal) in cases(&nominal) {
            let mut row = format!("| {mounting} | {words}");
            for program in &programs {
                let whole = repeated(program);
                row += &cell(|seed| rehearsal.fixed(&whole, &ASKED, seed));
            }
            row += &cell(|seed| rehearsal.adaptive(&ASKED, seed, LONGEST_S).ok());
            row += " |\n";
            eprint!("{row}");
            text += &row;
        }
    }
    text
}

fn cases(nominal: &Rehearsal) -> [(&'static str, Rehearsal); 5] {
    let yaw = [false, false, false, false, false, true];
    let (mut slow, mut noisy) = (nominal.clone(), nominal.clone());
    slow.config.geometry.leg_rate_mps = 0.16;
    for sigma in &mut noisy.config.sensors.load_cell.noise_n_nm {
        *sigma *= 2.0;
    }
    [
        ("as believed", nominal.clone()),
        ("yaw does not follow", Rehearsal { stuck: yaw, ..nominal.clone() }),
        ("yaw is refused", Rehearsal { refused: yaw, ..nominal.clone() }),
        ("legs at 0.16 m/s, not 0.8", slow),
        ("twice the noise", noisy),
    ]
}

/// Writes the median over the seeds, or that not all of them got there.
fn cell(run: impl Fn(u64) -> Option<Outcome> + Sync) -> String {
    let outcomes: Option<Vec<Outcome>> = std::thread::scope(|scope| {
        let run = &run;
        let running: Vec<_> = (1..=SEEDS).map(|seed| scope.spawn(move || run(seed))).collect();
        running.into_iter().map(|r| r.join().expect("a rehearsal that ends")).collect()
    });
    let Some(outcomes) = outcomes else { return " | refused".to_owned() };
    let mut seconds: Vec<f64> = outcomes.iter().filter_map(|o| o.seconds).collect();
    seconds.sort_by(f64::total_cmp);
    match (seconds.len() as u64 == SEEDS).then(|| seconds.get(seconds.len() / 2)).flatten() {
        Some(median) => format!(" | {median:.1}"),
        None => " | never".to_owned(),
    }
}

/// Repeats a program until it is over for good: with the way back to its start between.
fn repeated(program: &MotionProgram) -> MotionProgram {
    let back = Segment::Move { to: program.start, duration_s: 2.0 };
    let ends = program.trajectory().expect("a program that makes sense").end_pose();
    let mut segments = Vec::new();
    let mut spent_s = 0.0;
    while spent_s < LONGEST_S / 2.0 {
        segments.extend(program.segments.iter().cloned());
        if ends != program.start {
            segments.push(back.clone());
        }
        spent_s += program.duration_s();
    }
    MotionProgram { start: program.start, segments }
}

/// Returns, of several lengths, the programme that is over soonest with the goal reached in it.
fn shortest(
    nominal: &Rehearsal,
    lengths_s: impl Iterator<Item = f64>,
    make: impl Fn(f64) -> MotionProgram,
) -> MotionProgram {
    let mut best: Option<(f64, MotionProgram)> = None;
    for length_s in lengths_s {
        let program = make(length_s);
        let reached = nominal.fixed(&program, &ASKED, 1).and_then(|o| o.seconds);
        if let Some(seconds) = reached
            && best.as_ref().is_none_or(|(least, _)| seconds < *least)
        {
            best = Some((seconds, program));
        }
    }
    best.expect("one of the lengths is enough").1
}

/// Returns the fixed programme's multisine, from home, without the still poses.
fn motion_alone(nominal: &Rehearsal) -> MotionProgram {
    let whole = thesis_program(&nominal.config.geometry, DEFAULT_S);
    let segments = whole.segments.into_iter().filter(|s| matches!(s, Segment::Multisine { .. })).collect();
    MotionProgram { start: whole.start, segments }
}

fn d_optimal(nominal: &Rehearsal) -> MotionProgram {
    shortest(nominal, [8.0, 10.0, 12.0, 16.0].into_iter(), |duration_s| {
        let task = Task {
            duration_s,
            poses: false,
            objective: Objective::DOptimal,
            rate_hz: nominal.believed.rate_hz,
            ..Task::new(Equipment::from(&nominal.config))
        };
        plan(&task, &AtomicBool::new(false), |_| ()).expect("the built-in platform moves").program
    })
}

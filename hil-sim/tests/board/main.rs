//! The board's own drivers and main loop against a model of the chip's registers.
//!
//! The board's sources (`firmware/boards/stm32f405`) are compiled for the computer: where they read and write
//! registers there, they read and write those of the model here ([`chip`]). Sensors are the
//! simulator's, bit by bit over the model's SPI; the host is at the other end of the model's serial port.

mod chip;
mod faults;
mod host;
mod runs;
#[path = "../settings/mod.rs"]
mod settings;
mod world;

use chip::{Chip, MS};
use faults::{Drawn, Kind, What};
use rigident_shared::wire::{EventCode, Reason, ResetReason, SensorFault, number_of_reason, number_of_reset};
use runs::{End, Table};

#[test]
fn a_board_without_faults_answers_and_counts_every_sample() {
    let mut worst = Vec::new();
    for seed in 1..=3 {
        let life = runs::run(&mut Drawn::of(&[], seed), seed, 6);
        assert_eq!(runs::end(&life, &[]), End::Answered, "{life:#?}");
        worst.push(runs::worst_sd(&life).unwrap());
    }
    println!("{worst:?}");
}

/// Runs drawn at random: how many, how long, s, and the first seed.
fn drawn(count: u64, seconds: u64, first: u64) {
    let mut table = Table::default();
    let mut bad = Vec::new();
    for seed in first..first + count {
        let mut drawn = Drawn::new(seed);
        let life = runs::run(&mut drawn, seed, seconds);
        let end = runs::end(&life, &drawn.kinds);
        table.note(&drawn.kinds, end);
        if !end.is_good() {
            bad.push((seed, drawn.kinds, end, life));
        }
    }
    table.print();
    for (seed, kinds, end, life) in bad.iter().take(40) {
        let o = &life.outcome;
        println!(
            "{seed} {end:?} {kinds:?} words {:?} restarts {} resets {:?} alive {} sd {:?} missing {:?} \
             breaches {:?} {:?}",
            o.words,
            o.restarts,
            life.resets,
            o.alive,
            runs::worst_sd(life),
            runs::uncounted(life),
            life.breaches,
            life.panicked
        );
    }
    assert!(bad.is_empty(), "{} of {count} runs", bad.len());
}

fn number(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(otherwise)
}

/// A fixed set; `cargo xtask faults --board` draws ten thousand.
#[test]
fn runs_with_faults_drawn_at_random() {
    drawn(
        number("RIGIDENT_BOARD_RUNS", 60),
        number("RIGIDENT_BOARD_SECONDS", 4),
        number("RIGIDENT_BOARD_FIRST", 1),
    );
}

/// One fault at a time.
#[test]
fn each_fault_alone_ends_in_an_answer_or_a_word() {
    let mut bad = Vec::new();
    for kind in Kind::ALL {
        let life = runs::run(&mut Drawn::of(&[kind], 1), 1, 5);
        let end = runs::end(&life, &[kind]);
        println!(
            "{:44} {end:?} {:?} {:?} {:.1} s {:?}",
            kind.name(),
            life.outcome.words,
            life.resets,
            life.seconds,
            life.breaches
        );
        if !end.is_good() {
            bad.push((kind, end));
        }
    }
    assert!(bad.is_empty(), "{bad:?}");
}

/// The count of 32 bits wraps every 17.9 minutes: 241 times.
#[test]
fn time_is_right_across_every_wrap_of_72_hours() {
    let (rig, _) = world::rig(500.0, 1.0, 1);
    world::with_chip(rig, |chip| {
        let mut time = stm32f405::time::Time::new();
        let (from_ns, from) = (time.now_ns(), chip.with(|m| m.now));
        let mut last_ns = from_ns;
        for k in 0..=(72 * 60 / 17) {
            // An edge, and the longest that nobody looks at the time.
            let latched = chip.with(|m| m.timer.shown(m.now));
            let latched_at = chip.with(|m| m.now);
            chip.with(|m| m.skip(17 * 60_000 * MS));
            let edge_ns = time.of(latched);
            let now_ns = time.now_ns();
            let truth_ns = |at: u64| from_ns + (at - from) / 1_000;
            let now = chip.with(|m| m.now);
            assert!(
                now_ns > last_ns && now_ns.abs_diff(truth_ns(now)) < 1_000,
                "{k}: {now_ns} {}",
                truth_ns(now)
            );
            assert!(
                edge_ns.abs_diff(truth_ns(latched_at)) < 1_000,
                "{k}: {edge_ns} {}",
                truth_ns(latched_at)
            );
            last_ns = now_ns;
        }
        assert!(last_ns - from_ns >= 72 * 3_600_000_000_000);
    });
}

/// A bit of any setting of a sensor that changes while the board measures is a word, not another number.
#[test]
fn settings_of_sensors_that_change_while_it_measures_are_reported() {
    let change = |what: What| {
        let life = runs::run_with(1, 4, |chip| chip.with(|m| m.later.push((1_500 * MS, what))));
        (runs::end(&life, &[]), life.outcome.words)
    };
    for (register, bits) in
        [(0x4f, 0x02), (0x50, 0x80), (0x52, 0x10), (0x53, 0x08), (0x4c, 0x10), (0x5f, 0x10)]
    {
        let (end, words) = change(What::Imu(register, bits));
        assert_eq!((end, &words[..]), (End::Withheld, &["Imu(Verify)".to_owned()][..]), "{register:#x}");
    }
    for (register, bits) in [(0x02, 0x0800), (0x03, 0x0004), (0x04, 0x0040), (0x05, 0x0001), (0x06, 0x0100)] {
        let (end, words) = change(What::Converter(register, bits));
        assert_eq!(end, End::Withheld, "{register:#x} {words:?}");
        assert!(words.iter().any(|word| word.starts_with("LoadCell(")), "{register:#x} {words:?}");
    }
}

/// Events before a reset are reported after it, in order and with their times, and a program's start with its
/// reason.
#[test]
fn events_before_a_reset_are_reported_after_it() {
    let change = |chip: &Chip| chip.with(|m| m.later.push((1_500 * MS, What::Imu(0x4f, 0x02))));
    let life = runs::run_with(1, 4, change);
    let seen = &life.outcome.events;
    let last_start = seen.iter().rposition(|event| event.code == EventCode::Started as u8).unwrap();
    let start = seen[..last_start].iter().rposition(|event| event.code == EventCode::Started as u8).unwrap();
    let reported: Vec<_> = seen[start + 1..].iter().map(|event| (event.code, event.detail)).collect();
    let reason = |reason| number_of_reason(reason);
    let expected = [
        (EventCode::Configured, reason(Reason::Command)),
        (EventCode::Running, reason(Reason::Command)),
        (EventCode::Fault, reason(Reason::Imu(SensorFault::Verify))),
        (EventCode::Restart, 0),
        (EventCode::Started, number_of_reset(ResetReason::Software)),
        (EventCode::Configured, reason(Reason::Command)),
    ];
    assert_eq!(reported, expected.map(|(code, detail)| (code as u8, detail)), "{seen:?}");
    // Found within two seconds of the change, and times begin anew with the program.
    let fault_ms = seen[start + 3].time_ms;
    assert!((1_500..3_600).contains(&fault_ms), "{fault_ms}");
    assert!(seen[last_start].time_ms < 100, "{seen:?}");
    assert!(seen.len() <= 32);
}

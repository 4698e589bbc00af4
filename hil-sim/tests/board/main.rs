//! The board's own drivers and main loop against a model of the chip's registers.
//!
//! The same sources as on the board (`firmware/boards/stm32f405`), compiled for the computer: where they read and write
//! registers there, they read and write those of the model here ([`chip`]). Sensors are the simulator's, bit by bit over the
//! model's SPI; the host is at the other end of the model's serial port.

mod chip;
mod faults;
mod host;
mod runs;
#[path = "../settings/mod.rs"]
mod settings;
mod world;

use faults::{Drawn, Kind};
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
            "{seed} {end:?} {kinds:?} words {:?} restarts {} resets {:?} alive {} sd {:?} missing {:?} breaches {:?} {:?}",
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

#[test]
#[ignore = "needs minutes: cargo xtask faults --board"]
fn runs_with_faults_drawn_at_random() {
    drawn(
        number("RIGIDENT_BOARD_RUNS", 100),
        number("RIGIDENT_BOARD_SECONDS", 6),
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

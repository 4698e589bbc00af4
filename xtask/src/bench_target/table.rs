//! The output of the verb for people.

use super::cycles::{self, KINDS};
use super::{Case, Entry, histogram};

/// The clock for which a share of the processor is stated.
const CLOCK_HZ: f64 = 168e6;

/// Prints every table.
pub fn print(cases: &[Case], entries: &[Entry]) {
    means(cases);
    baseline(entries);
    worst(cases);
    histograms(cases);
    if let Some(e) = entries.first() {
        println!(
            "\nFirmware: {} bytes of flash, {} of RAM in variables, stack of at most {} bytes.",
            e.flash_bytes, e.ram_bytes, e.worst_stack_bytes
        );
    }
    for (n, path) in entries.iter().filter_map(|e| e.path.as_ref().map(|path| (e.n, path))) {
        let rate_hz = path.path_rate_hz;
        let share = path.path_estimated_cycles_m4 * rate_hz / CLOCK_HZ;
        let what = if rate_hz < 1000.0 { "frames" } else { "samples" };
        println!("N = {n}: {:.1} % of a processor at 168 MHz, for {rate_hz} {what} a second", 100.0 * share);
    }
    mix(cases);
    println!("\nCycles: {}", cycles::MODEL);
}

fn means(cases: &[Case]) {
    println!("| case | instructions per sample | cycles, estimated |");
    println!("|---|---|---|");
    for case in cases {
        println!("| {} | {:.0} | {:.0} |", case.name(), case.instructions(), case.cycles());
    }
}

/// Prints our kernel against the C Householder: from the raw sample, regressor included, where N is a body's.
fn baseline(entries: &[Entry]) {
    let pairs: Vec<_> = entries.iter().filter_map(|e| e.baseline.as_ref().map(|c| (e, c))).collect();
    if pairs.is_empty() {
        return;
    }
    println!("\nAgainst the dense Householder in C, which gets its rows given:\n");
    println!(
        "| N | C: instructions | cycles, estimated | ours: instructions | cycles, estimated | cycles, ours \
         to C |"
    );
    println!("|---|---|---|---|---|---|");
    for (e, c) in pairs {
        println!(
            "| {} | {:.0} | {:.0} | {:.0} | {:.0} | {:.2} |",
            e.n,
            c.baseline_instructions_per_sample,
            c.baseline_estimated_cycles_m4,
            e.instructions_per_sample,
            e.estimated_cycles_m4,
            e.estimated_cycles_m4 / c.baseline_estimated_cycles_m4
        );
    }
}

fn worst(cases: &[Case]) {
    println!("\nWorst sample:\n");
    println!(
        "| case | searched | instructions, ± 40 | of the mean | traced | instructions | cycles, estimated | \
         of the mean |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for case in cases.iter().filter(|case| case.reported.worst_of > 0) {
        // A case that goes through its samples by itself is not distinguished in the trace.
        let traced = match case.stretch.worst {
            (0, _) => "– | – | – | –".to_owned(),
            (instructions, cycles) => format!(
                "{} | {instructions} | {cycles} | {:.1}",
                case.reported.samples,
                cycles as f64 / case.cycles()
            ),
        };
        println!(
            "| {} | {} | {} | {:.1} | {traced} |",
            case.name(),
            case.reported.worst_of,
            case.reported.worst_instructions,
            case.reported.worst_instructions as f64 / case.instructions(),
        );
    }
}

fn histograms(cases: &[Case]) {
    println!("\nSamples of the search by their instructions:");
    for case in cases {
        histogram::print(&case.name(), &case.reported.histogram, case.reported.worst_instructions);
    }
}

fn mix(cases: &[Case]) {
    println!("\nInstructions per sample, by kind:\n");
    let heads: Vec<String> = cases.iter().map(Case::name).collect();
    println!("| | {} |", heads.join(" | "));
    println!("|---|{}", "---|".repeat(heads.len()));
    for kind in KINDS {
        let counts: Vec<String> = cases
            .iter()
            .map(|case| format!("{:.1}", case.stretch.cost.count(kind) as f64 / case.reported.samples as f64))
            .collect();
        println!("| {kind} | {} |", counts.join(" | "));
    }
}

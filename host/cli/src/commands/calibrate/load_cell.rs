//! `rigident calibrate load-cell`: the 6 × 6 matrix from known weights at known places.

use std::process::ExitCode;

use crate::commands::calibrate::arguments::CalibrateLoadCell;
use crate::commands::calibrate::joints::positive;
use crate::commands::factor;
use crate::screen::outcome::{say, say_answer};
use crate::{ExitStatus, Failure};
use rigident::application::{Caller, LoadCellOptions, load_cell};
use rigident::load_cell::Uncertainty;
use rigident_io::recording::new_file::write_new_text;

/// Runs `rigident calibrate load-cell`.
pub(crate) fn run(arguments: &CalibrateLoadCell) -> Result<ExitCode, Failure> {
    if let Some(path) = &arguments.output {
        factor::absent(path)?;
    }
    let options = LoadCellOptions {
        recording: arguments.recording.clone(),
        uncertainty: uncertainty(arguments)?,
        gravity_mps2: arguments.gravity_mps2,
        board_id: arguments.board_id.clone(),
    };
    let found = load_cell(&arguments.loads, &options, &Caller::default())?;
    found.warnings.iter().for_each(|warning| tell!("rigident: {warning}"));
    let table = found.rig_table();
    if let Some((path, table)) = arguments.output.as_ref().zip(table.as_ref()) {
        write_new_text(path, table).map_err(Failure::input)?;
    }
    say_answer(&found, arguments.json)?;
    if let Some(table) = table.filter(|_| !arguments.json) {
        say(format_args!("\nFor the rig file:\n\n{}", table.trim_end()));
    }
    Ok(ExitStatus::of(found.is_identified()).into())
}

fn uncertainty(arguments: &CalibrateLoadCell) -> Result<Uncertainty, Failure> {
    let from_zero = |option: &str, value: f64, most: f64| {
        if (0.0..=most).contains(&value) {
            Ok(value)
        } else {
            Err(Failure::input(format!("{option} {value}: must be from 0 to {most}")))
        }
    };
    let noise = arguments.reading_noise_v;
    let reading_v = noise.map(|noise| positive("--reading-noise-v", noise)).transpose()?;
    Ok(Uncertainty {
        mass: 1e-2 * from_zero("--mass-noise-percent", arguments.mass_noise_percent, 10.0)?,
        place_m: 1e-3 * from_zero("--place-noise-mm", arguments.place_noise_mm, 50.0)?,
        level_rad: from_zero("--level-noise-deg", arguments.level_noise_deg, 10.0)?.to_radians(),
        reading_v,
    })
}

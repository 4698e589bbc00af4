//! The input of Franka Robotics' controllers: libfranka's `setLoad` and the `endeffector-config.json` of an
//! end effector.
//!
//! `setLoad(load_mass, F_x_Cload, load_inertia)`: kg, m from the flange's frame, and the inertia matrix about
//! the centre of mass in kg m², nine numbers column by column (`RobotState::I_load`: "with respect to center
//! of mass"). The file has the same quantities as `mass`, `centerOfMass` and `inertia`, beside the end
//! effector's `transformation`, four by four, column by column (Franka RIDE documentation 1.1.1, *End
//! effector commissioning*).

use serde_json::{Value, json};

use super::numbers::{after, list, plain, symmetric};
use super::{Load, LoadError};

const CALL: &str = "setLoad(";

/// Returns the call of libfranka.
pub fn write_call(load: &Load) -> String {
    format!(
        "robot.{CALL}{}, {{{{{}}}}}, {{{{{}}}}});\n",
        plain(load.mass_kg),
        list(&load.com_m),
        list(load.rows().as_flattened())
    )
}

/// Returns the load of a call.
///
/// # Errors
/// [`LoadError::Read`] if there is none.
pub fn read_call(text: &str) -> Result<Load, LoadError> {
    let numbers = after(text, CALL, 13)?;
    of(&numbers)
}

/// Returns the file of an end effector called `link`, whose tool centre point is the flange.
pub fn write_file(load: &Load, link: &str) -> String {
    let identity: Vec<f64> = (0..16).map(|k| f64::from(u8::from(k % 5 == 0))).collect();
    let round = |v: &f64| (v * 1e9).round() / 1e9;
    let id: String =
        link.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect();
    let file = json!({
        "id": format!("payload-{id}"),
        "name": format!("payload of {link}"),
        "color": "#808080",
        "mass": round(&load.mass_kg),
        "centerOfMass": load.com_m.iter().map(round).collect::<Vec<f64>>(),
        "transformation": identity,
        "inertia": load.rows().as_flattened().iter().map(round).collect::<Vec<f64>>(),
    });
    format!("{file:#}\n")
}

/// Returns the load of a file.
///
/// # Errors
/// [`LoadError::Read`] if it says none.
pub fn read_file(text: &str) -> Result<Load, LoadError> {
    let file: Value = serde_json::from_str(text).map_err(|error| LoadError::Read(error.to_string()))?;
    let of_key = |key: &str, count: usize| -> Result<Vec<f64>, LoadError> {
        let found = match &file[key] {
            Value::Array(all) => all.iter().filter_map(Value::as_f64).collect(),
            one => one.as_f64().into_iter().collect::<Vec<f64>>(),
        };
        let refuse =
            || LoadError::Read(format!("{key} needs {count} numbers, and there are {}", found.len()));
        if found.len() == count { Ok(found) } else { Err(refuse()) }
    };
    of(&[of_key("mass", 1)?, of_key("centerOfMass", 3)?, of_key("inertia", 9)?].concat())
}

/// Returns the load of mass, centre of mass and nine numbers of the tensor.
fn of(numbers: &[f64]) -> Result<Load, LoadError> {
    match numbers {
        &[mass_kg, x, y, z, ref tensor @ ..] => {
            Ok(Load { mass_kg, com_m: [x, y, z], inertia_com_kgm2: symmetric(tensor)? })
        }
        _ => Err(LoadError::Read("a load needs mass, centre of mass and tensor".to_owned())),
    }
}

//! Loads as controllers take them: what is in a gripper, about the frame of the flange.
//!
//! Lives here: a load ([`Load`]), the languages that it is written in and read from again
//! ([`universal_robots`], [`franka`], [`kuka`],
//! [`urdf`]). May not live here: how a load is found. Every language says mass, centre of mass and the tensor
//! about it; `docs/payload.md` names axes, units and the vendor's page of each.

pub mod franka;
pub mod kuka;
pub mod numbers;
#[cfg(test)]
mod tests;
pub mod universal_robots;
pub mod urdf;

use std::path::Path;

use rigident_shared::inertia::{InertialParameters, tensor_elements, tensor_from_elements};
use rigident_shared::printable;
use rigident_shared::spatial::{Body, Position};

use super::inertial::Parameters;

/// The bound below which a value written and read again differs by rounding only, relative.
const ROUNDING: f64 = 1e-5;

/// The data that a controller needs of what its robot carries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the flange's frame, m.
    pub com_m: [f64; 3],
    /// Tensor about the centre of mass, axes of the flange: Ixx, Iyy, Izz, Iyz, Izx, Ixy, tensor elements, kg
    /// m². All zero of a point mass: the tensor is not known.
    pub inertia_com_kgm2: [f64; 6],
}

/// A language of loads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Language {
    /// `set_target_payload` of URScript (.script).
    UniversalRobots,
    /// `setLoad` of libfranka (.cpp).
    FrankaCall,
    /// `endeffector-config.json` of Franka (.json).
    FrankaFile,
    /// `LOAD_DATA` of KUKA's $config.dat (.dat).
    Kuka,
    /// A link of a URDF (.urdf).
    Urdf,
}

/// Why a load is not written or read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LoadError {
    /// The name's ending is of no language.
    #[error(
        "its name must end in .script (URScript), .cpp (libfranka), .json (Franka), .dat (KUKA) or .urdf"
    )]
    Ending,
    /// No body has this mass and tensor.
    #[error("{0}")]
    Impossible(String),
    /// The language needs a tensor.
    #[error(
        "a URDF link needs a tensor, and it is not known; .script, .cpp, .json and .dat take a point mass"
    )]
    NeedsTensor,
    /// The text holds no load.
    #[error("{0}")]
    Read(String),
}

impl Load {
    /// Returns the load of ten parameters about the flange's origin.
    pub fn of_parameters(phi: Parameters) -> Self {
        let body = InertialParameters::<Body, f64>::from_vector(phi);
        Self {
            mass_kg: body.mass,
            com_m: body.centre_of_mass().array(),
            inertia_com_kgm2: tensor_elements(&body.inertia_com()),
        }
    }

    /// Returns its ten parameters about the flange's origin.
    pub fn parameters(&self) -> Parameters {
        InertialParameters::<Body, f64>::from_centre_of_mass(
            self.mass_kg,
            Position::from_array(self.com_m),
            tensor_from_elements(self.inertia_com_kgm2),
        )
        .to_vector()
    }

    /// Returns true if its tensor is not known.
    pub fn is_point(&self) -> bool {
        self.inertia_com_kgm2 == [0.0; 6]
    }

    /// Returns the tensor about the centre of mass by rows, kg m².
    fn rows(&self) -> [[f64; 3]; 3] {
        let [xx, yy, zz, yz, zx, xy] = self.inertia_com_kgm2;
        [[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]
    }

    /// Returns why no body has them; `None` if one has, or it is a point mass.
    pub fn impossibility(&self) -> Option<String> {
        if self.is_point() {
            let usable = self.mass_kg.is_finite() && self.mass_kg > 0.0;
            return (!usable).then(|| format!("a mass of {} kg is none of a body", self.mass_kg));
        }
        super::inertial::impossibility(&self.parameters())
    }

    fn is_near(&self, other: &Self) -> bool {
        let near = |a: &[f64], b: &[f64], scale: f64| {
            a.iter().zip(b).all(|(a, b)| (a - b).abs() <= ROUNDING * scale + 1e-9)
        };
        let size = self.inertia_com_kgm2.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        let reach = self.com_m.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        near(&[self.mass_kg], &[other.mass_kg], self.mass_kg)
            && near(&self.com_m, &other.com_m, reach)
            && near(&self.inertia_com_kgm2, &other.inertia_com_kgm2, size)
    }
}

/// Returns a remark as a line of comment holds it. A backslash at the end would make the next line of C++ a
/// comment, too.
fn in_comment(remark: &str) -> String {
    printable::line(remark).to_string().trim_end_matches(['\\', '/', ' ']).to_owned()
}

impl Language {
    /// Returns the language of a file's ending; `None` if it has none of these.
    pub fn of_path(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        match ending.as_str() {
            "script" => Some(Self::UniversalRobots),
            "cpp" => Some(Self::FrankaCall),
            "json" => Some(Self::FrankaFile),
            "dat" => Some(Self::Kuka),
            "urdf" => Some(Self::Urdf),
            _ => None,
        }
    }

    /// Returns the text that says a load; `remarks` are lines of comment, where the language has comments,
    /// and `link` is the name of the frame that it is in.
    ///
    /// # Errors
    /// [`LoadError`] if no body is such a load, the language cannot say it, or the text is not read back as
    /// it was meant.
    pub fn write(self, load: &Load, link: &str, remarks: &[String]) -> Result<String, LoadError> {
        if let Some(why) = load.impossibility() {
            return Err(LoadError::Impossible(why));
        }
        let link = printable::name(link).to_string();
        let statement = match self {
            Self::UniversalRobots => universal_robots::write(load),
            Self::FrankaCall => franka::write_call(load),
            Self::FrankaFile => franka::write_file(load, &link),
            Self::Kuka => kuka::write(load),
            Self::Urdf => urdf::write(load, &link)?,
        };
        let remarks: String = match self.comment() {
            Some(mark) => remarks.iter().map(|remark| format!("{mark}{}\n", in_comment(remark))).collect(),
            None => String::new(),
        };
        let text = remarks + &statement;
        match self.read(&text) {
            Ok(again) if again.is_near(load) && self.says_only(&text, &statement) => Ok(text),
            _ => Err(LoadError::Read("what was written is not read back as it was meant".to_owned())),
        }
    }

    /// Returns what begins a line of comment; `None` where remarks have no place.
    fn comment(self) -> Option<&'static str> {
        match self {
            Self::UniversalRobots => Some("# "),
            Self::FrankaCall => Some("// "),
            Self::Kuka => Some("; "),
            Self::FrankaFile | Self::Urdf => None,
        }
    }

    /// Returns true if every line of a text is a comment or one of the statement: a robot runs whatever else
    /// is there.
    fn says_only(self, text: &str, statement: &str) -> bool {
        let Some(mark) = self.comment() else { return text == statement };
        let Some(remarks) = text.strip_suffix(statement) else { return false };
        statement.matches('\n').count() == 1
            && remarks.split_terminator('\n').all(|line| {
                line.starts_with(mark) && !line.ends_with('\\') && !line.chars().any(printable::steers)
            })
    }

    /// Returns the load that a text says.
    ///
    /// # Errors
    /// [`LoadError::Read`] if it says none.
    pub fn read(self, text: &str) -> Result<Load, LoadError> {
        match self {
            Self::UniversalRobots => universal_robots::read(text),
            Self::FrankaCall => franka::read_call(text),
            Self::FrankaFile => franka::read_file(text),
            Self::Kuka => kuka::read(text),
            Self::Urdf => urdf::read(text),
        }
    }
}

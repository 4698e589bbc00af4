use std::path::PathBuf;
use std::str::FromStr;

use hexapod::BodyParameters;
use nalgebra::Matrix3;

use super::ur;
use crate::link::LinkFaults;
use crate::links::SecondLink;
use crate::rig::RigConfig;
use crate::sensors::{Channel, Fault, SensorModels};

/// Where the firmware runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Where {
    /// In this process
    #[default]
    Inproc,
    /// In an emulated Cortex-M4F
    Qemu,
}

/// How the test body is mounted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Body {
    /// Lying across the platform
    #[default]
    Horizontal,
    /// Standing upright
    Vertical,
    /// Lying, with an arm on a ball joint that has an IMU of its own and swings while a program of the
    /// controller's (--platform) runs; both IMUs are calibrated
    TwoLinks,
}

/// How good the sensors are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Sensors {
    /// Noise, biases and delays of the platform thesis
    #[default]
    Thesis,
    /// Nothing but the converters' steps
    Ideal,
}

/// A sensor fault as it is written on the command line: `CHANNEL@START` or `CHANNEL@START+DURATION`, s.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorFault {
    /// The channel.
    pub channel: Channel,
    /// When, in rig time, s.
    pub during: std::ops::Range<f64>,
}

impl FromStr for SensorFault {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, when) =
            text.split_once('@').ok_or("a fault is written CHANNEL@START or CHANNEL@START+DURATION")?;
        let seconds = |s: &str| {
            s.parse().ok().filter(|t: &f64| t.is_finite() && *t >= 0.0).ok_or(format!("{s} is no time in s"))
        };
        let (start, duration) = match when.split_once('+') {
            Some((start, duration)) => (seconds(start)?, seconds(duration)?),
            None => (seconds(when)?, f64::INFINITY),
        };
        Ok(Self { channel: channel(name)?, during: start..start + duration })
    }
}

fn channel(name: &str) -> Result<Channel, String> {
    let axis = |names: [&str; 3]| names.iter().position(|n| *n == name);
    if let Some(i) = ["fx", "fy", "fz", "mx", "my", "mz"].iter().position(|n| *n == name) {
        return Ok(Channel::Wrench(i));
    }
    if let Some(i) = axis(["ax", "ay", "az"]) {
        return Ok(Channel::Accelerometer(i));
    }
    if let Some(i) = axis(["gx", "gy", "gz"]) {
        return Ok(Channel::Gyro(i));
    }
    match name {
        "load_cell" => Ok(Channel::LoadCell),
        "imu" => Ok(Channel::Imu),
        _ => Err(format!(
            "{name} is no channel; there are fx fy fz mx my mz, ax ay az, gx gy gz, load_cell and imu"
        )),
    }
}

fn probability(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|p| (0.0..=1.0).contains(p))
        .ok_or_else(|| format!("{text} is no probability from 0 to 1"))
}

fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let all: Result<Vec<f64>, _> = text.split(',').map(|cell| cell.trim().parse::<f64>()).collect();
    let all = all.ok().filter(|all| all.iter().all(|v| v.is_finite()));
    all.and_then(|all| all.try_into().ok())
        .ok_or_else(|| format!("{text} is not {N} numbers with commas between them"))
}

fn tensor(text: &str) -> Result<[f64; 6], String> {
    if text.split(',').count() == 3 {
        let [xx, yy, zz] = numbers::<3>(text)?;
        return possible([xx, yy, zz, 0.0, 0.0, 0.0]);
    }
    possible(numbers::<6>(text)?)
}

/// Returns the tensor if a body can have it: principal moments above zero, none larger than the others' sum.
fn possible(tensor: [f64; 6]) -> Result<[f64; 6], String> {
    let [xx, yy, zz, yz, zx, xy] = tensor;
    let principal = Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz).symmetric_eigenvalues();
    let is_possible = principal.iter().all(|own| *own > 0.0 && 2.0 * own <= principal.sum() * (1.0 + 1e-9));
    is_possible.then_some(tensor).ok_or_else(|| {
        "no body has this tensor: principal moments are above zero, none larger than the sum of the others"
            .to_owned()
    })
}

/// `rigident-sim serve`
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:\n  rigident-sim serve --write-rig rig.toml\n  rigident run --port \
    ./rigident-rig --rig rig.toml --platform tcp://127.0.0.1:7447     (in another terminal)\n  rigident-sim \
    serve --gcs 127.0.0.1:50000 --gcs-port-link ./hexapod\n  rigident-sim serve --ur \
    127.0.0.1:30004 --write-rig arm.toml\n  rigident-sim serve --mcu qemu --flip 1e-4 \
    --drop 0.01\n  rigident-sim serve --freeze gz@20+5 --saturate fz@40\n  rigident-sim serve --body \
    two-links --write-rig rig.toml\n  rigident-sim serve --mass 0.5 --com 0,0,0.02 --inertia 4e-4,4e-4,3e-4 \
    --write-rig rig.toml\n\n\
    Ctrl-C ends it and leaves nothing behind.")]
pub struct ServeOptions {
    /// Where the firmware runs
    #[arg(long, value_enum, default_value_t)]
    pub mcu: Where,
    /// Name given to the serial port
    #[arg(long, value_name = "PATH", default_value = "rigident-rig")]
    pub port_link: PathBuf,
    /// Address of the platform's controller; port 0 takes a free one
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:7447")]
    pub platform: String,
    /// Offer the platform as a PI hexapod too, GCS 2.0, at this address; port 0 takes a free one
    #[arg(long, value_name = "HOST:PORT")]
    pub gcs: Option<String>,
    /// The PI hexapod on a serial line too, of this name
    #[arg(long, value_name = "PATH", requires = "gcs")]
    pub gcs_port_link: Option<PathBuf>,
    /// Take lines of poses or leg lengths at this address, by TCP and UDP; port 0 takes a free one
    #[arg(long, value_name = "HOST:PORT")]
    pub stream: Option<String>,
    /// Take such lines from a serial line of this name too
    #[arg(long, value_name = "PATH", requires = "stream")]
    pub stream_port_link: Option<PathBuf>,
    /// The plate is the flange of an arm of Universal Robots instead of a hexapod's: its state and set points
    /// (RTDE) at this address; port 0 takes a free one. Lines typed here happen to it: protective, emergency,
    /// cut, stopped, local
    #[arg(long, value_name = "HOST:PORT", conflicts_with_all = ["platform", "gcs", "stream", "body"])]
    pub ur: Option<String>,
    /// Its port for programs, likewise
    #[arg(long, value_name = "HOST:PORT", requires = "ur", default_value = "127.0.0.1:30002")]
    pub ur_script: String,
    /// Write the rig file that describes this rig, and the model of an arm beside it; never over another file
    #[arg(long, value_name = "FILE")]
    pub write_rig: Option<PathBuf>,
    /// The body on the load cell
    #[arg(long, value_enum, default_value_t)]
    pub body: Body,
    /// A body of its own instead: its mass, kg
    #[arg(long, value_name = "KG", requires_all = ["com", "inertia"], conflicts_with = "body")]
    pub mass: Option<f64>,
    /// Its centre of mass in the frame of the body, m
    #[arg(long, value_name = "X,Y,Z", requires = "mass", allow_hyphen_values = true, value_parser = numbers::<3>)]
    pub com: Option<[f64; 3]>,
    /// Its tensor about the centre of mass, kg m²: Ixx,Iyy,Izz or Ixx,Iyy,Izz,Iyz,Izx,Ixy
    #[arg(long, value_name = "TENSOR", requires = "mass", allow_hyphen_values = true, value_parser = tensor)]
    pub inertia: Option<[f64; 6]>,
    /// The sensors
    #[arg(long, value_enum, default_value_t)]
    pub sensors: Sensors,
    /// Seed of noise, biases and link faults
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Show the firmware's log (emulated only)
    #[arg(long)]
    pub show_log: bool,
    /// Probability that a frame on the line vanishes
    #[arg(long, value_name = "P", default_value = "0", value_parser = probability)]
    pub drop: f64,
    /// Probability that a byte on the line has one bit inverted
    #[arg(long, value_name = "P", default_value = "0", value_parser = probability)]
    pub flip: f64,
    /// Probability that a frame on the line comes twice
    #[arg(long, value_name = "P", default_value = "0", value_parser = probability)]
    pub duplicate: f64,
    /// Probability that a frame on the line is overtaken by the next one
    #[arg(long, value_name = "P", default_value = "0", value_parser = probability)]
    pub delay: f64,
    /// A channel that repeats itself from START on (rig time, s); may be given several times
    #[arg(long, value_name = "CHANNEL@START[+DURATION]")]
    pub freeze: Vec<SensorFault>,
    /// A channel stuck at the upper end of its range from START on; may be given several times
    #[arg(long, value_name = "CHANNEL@START[+DURATION]")]
    pub saturate: Vec<SensorFault>,
}

/// `rigident-sim sensors`
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    rigident-sim sensors --ati 127.0.0.1:49152 --xsens-port-link ./mti --write-rig hand.rig.toml\n  \
    rigident-sim sensors --rtde 127.0.0.1:30004 --bridge 127.0.0.1:8765 --lines-to 127.0.0.1:5005\n\n\
    What is to be typed in another terminal is printed. Ctrl-C ends it and leaves nothing behind.")]
pub struct SensorsOptions {
    /// An ATI Net F/T at this address (UDP); port 0 takes a free one
    #[arg(long, value_name = "HOST:PORT")]
    pub ati: Option<String>,
    /// A Universal Robots controller (RTDE) at this address
    #[arg(long, value_name = "HOST:PORT")]
    pub rtde: Option<String>,
    /// A foxglove_bridge with the topics /ft/wrench, /imu/data and /pose at this address
    #[arg(long, value_name = "HOST:PORT")]
    pub bridge: Option<String>,
    /// An Xsens MTi on a serial line of this name
    #[arg(long, value_name = "PATH")]
    pub xsens_port_link: Option<PathBuf>,
    /// Lines of CSV, wrench and IMU, as datagrams to this address
    #[arg(long, value_name = "HOST:PORT")]
    pub lines_to: Option<String>,
    /// Lines of CSV, wrench and IMU, on a serial line of this name
    #[arg(long, value_name = "PATH")]
    pub lines_port_link: Option<PathBuf>,
    /// Write the rig file that describes these sensors; never over another file
    #[arg(long, value_name = "FILE")]
    pub write_rig: Option<PathBuf>,
    /// How long the body moves, s; then it rests
    #[arg(long, value_name = "S", default_value_t = 120.0)]
    pub duration_s: f64,
    /// Share of samples that are lost on the way
    #[arg(long, value_name = "P", default_value = "0", value_parser = probability)]
    pub lose: f64,
    /// Samples come up to so much late, s
    #[arg(long, value_name = "S", default_value_t = 0.002)]
    pub jitter_s: f64,
    /// Every sensor falls silent after so long, s
    #[arg(long, value_name = "S")]
    pub stop_after_s: Option<f64>,
    /// Seed of noise and biases
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

impl ServeOptions {
    /// Returns the rig asked for.
    #[must_use]
    pub fn rig(&self) -> RigConfig {
        let rig = match self.body {
            _ if self.ur.is_some() => ur::rig(),
            Body::Horizontal => RigConfig::thesis_horizontal(),
            Body::Vertical => RigConfig::thesis_vertical(),
            Body::TwoLinks => {
                let rig = RigConfig::two_links();
                let second = SecondLink { with_program: true, ..SecondLink::arm() };
                rig.with_second(second)
            }
        };
        let rig = match (self.mass, self.com, self.inertia) {
            (Some(mass_kg), Some(com_m), Some(inertia_com_kgm2)) => {
                rig.with_body(BodyParameters { mass_kg, com_m, inertia_com_kgm2 })
            }
            _ => rig,
        };
        let mut sensors = rig.sensors.clone();
        if self.sensors == Sensors::Ideal {
            let gyro_range_radps = sensors.imu.gyro_range_radps;
            sensors = SensorModels::ideal();
            sensors.imu.gyro_range_radps = gyro_range_radps;
        }
        let frozen =
            self.freeze.iter().cloned().map(|f| Fault::Frozen { channel: f.channel, during: f.during });
        let saturated =
            self.saturate.iter().cloned().map(|f| Fault::Saturated { channel: f.channel, during: f.during });
        sensors.faults.extend(frozen.chain(saturated));
        rig.with_sensors(sensors).with_seed(self.seed)
    }

    /// Returns the faults of the line asked for; `None` for a good one.
    #[must_use]
    pub fn link_faults(&self) -> Option<LinkFaults> {
        let faults = LinkFaults {
            drop_frame: self.drop,
            flip_bit: self.flip,
            duplicate_frame: self.duplicate,
            delay_frame: self.delay,
            ..LinkFaults::default()
        };
        (faults != LinkFaults::default()).then_some(faults)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_is_a_channel_a_start_and_perhaps_an_end() {
        let fault: SensorFault = "gz@20+5".parse().unwrap();
        assert_eq!(fault, SensorFault { channel: Channel::Gyro(2), during: 20.0..25.0 });
        let lasting: SensorFault = "fx@1.5".parse().unwrap();
        assert_eq!(lasting, SensorFault { channel: Channel::Wrench(0), during: 1.5..f64::INFINITY });
        for wrong in ["gz", "gz@", "gz@-1", "gw@1", "gz@1+nan"] {
            assert!(wrong.parse::<SensorFault>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn any_body_can_be_served_and_none_that_cannot_be() {
        #[derive(clap::Parser)]
        struct Line {
            #[command(flatten)]
            serve: ServeOptions,
        }
        use clap::Parser as _;
        let of = |words: &str| Line::try_parse_from(std::iter::once("serve").chain(words.split(' ')));
        let rig = of("--mass 40 --com -0.3,0,0.1 --inertia 2,2.5,1,0,0.1,0").unwrap().serve.rig();
        assert_eq!((rig.body.mass_kg, rig.body.com_m), (40.0, [-0.3, 0.0, 0.1]));
        assert_eq!(rig.body.inertia_com_kgm2, [2.0, 2.5, 1.0, 0.0, 0.1, 0.0]);
        assert!(crate::rig::Rig::new(rig).is_ok());
        for wrong in [
            "--mass 1 --com 0,0,0 --inertia 1,1,5",
            "--mass 1 --com 0,0,0 --inertia 1,1,1,0,0,2",
            "--mass 1",
            "--com 0,0,0",
            "--mass 1 --com 0,0 --inertia 1,1,1",
            "--mass 1 --com 0,0,x --inertia 1,1,1",
        ] {
            assert!(of(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_probability_lies_between_nothing_and_always() {
        assert_eq!(probability("0.5"), Ok(0.5));
        for wrong in ["-0.1", "1.1", "nan", "x"] {
            assert!(probability(wrong).is_err(), "{wrong}");
        }
    }
}

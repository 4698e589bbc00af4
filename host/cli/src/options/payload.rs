//! The load of a link, and the files that tell a controller.

use std::path::PathBuf;

use clap::Args;

/// The options `--payload` and `--write-load`.
#[derive(Args, Debug, Clone, Default)]
#[command(next_help_heading = "Payload")]
pub struct PayloadOptions {
    /// Identify what this link carries here and not in the runs of --tare: ten parameters in the link's
    /// frame, or in one that is placed in it in m and degrees
    #[arg(long, value_name = "LINK[@x,y,z[,roll,pitch,yaw]]", requires = "tare", allow_hyphen_values = true)]
    pub payload: Option<String>,
    /// Write the load as a controller takes it, about the frame of --payload: .script (URScript), .cpp
    /// (libfranka), .json (Franka), .dat (KUKA) or .urdf; must not exist. Repeatable
    #[arg(long, value_name = "FILE", requires = "payload")]
    pub write_load: Vec<PathBuf>,
}

impl PayloadOptions {
    /// Tells that none of the files is written.
    pub(crate) fn tell_refused(&self, why: &str) {
        for path in &self.write_load {
            tell!("rigident: --write-load {}: not written: {why}", path.display());
        }
    }
}

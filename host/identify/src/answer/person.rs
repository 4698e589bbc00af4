//! The findings about one person: segments beside the table, predictions of left-out motions, and what became
//! of the frames.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use rigident_fit::Measured;

/// A person.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PersonResult {
    /// The model: `human34` or `human58`.
    pub model: String,
    /// Whose means the table has, with its source and the ages that it is of.
    #[serde(default)]
    pub table: String,
    /// Stature that the table was scaled to, m; from the markers if it was not given.
    pub height_m: f64,
    /// Mass that the table was scaled to, kg; from the plates if it was not given.
    pub table_mass_kg: f64,
    /// The whole mass by the plates and the motion alone, kg; absent if they do not tell it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass_kg: Option<Measured>,
    /// The whole mass with what the table knows of the segments, kg.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass_with_table_kg: Option<Measured>,
    /// Standard deviations (1 σ) that the table is trusted with: of a segment's mass (relative; of pelvis,
    /// hands and feet half as large again, of the head less), of its centre over its radius of gyration, of
    /// its tensor (relative), of the whole mass (relative).
    pub table_sigma: [f64; 4],
    /// Centre of mass of the whole body of the person when she stands upright, x forward, y left, z up from
    /// midway between the hips, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub centre_of_mass_m: Option<[Measured; 3]>,
    /// The segments, physically consistent and nearest to the table; empty if the motions tell of none.
    pub segments: Vec<SegmentResult>,
    /// How motions that were left out are predicted by what the others say, channel by channel.
    pub left_out: Vec<LeftOut>,
    /// The number of motions of which one after the other was left out; 1 if there was only one, which is
    /// then predicted by itself.
    pub motions: u64,
    /// Ways to choose as many motions as were asked for, and what comes of each; absent if all were used.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub choices: Vec<ChoiceResult>,
    /// What became of each trial.
    pub trials: Vec<TrialResult>,
    /// What the person holds, from motions with it and without it; absent if nothing was named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool: Option<ToolResult>,
    /// What a microcontroller made of the same motions by itself; absent if none was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device: Option<DeviceResult>,
}

impl PersonResult {
    /// Takes out what must not be used because the trials cannot be true; what became of the trials stays.
    pub(super) fn withhold(&mut self) {
        (self.mass_kg, self.mass_with_table_kg, self.centre_of_mass_m) = (None, None, None);
        self.segments.clear();
        self.tool = None;
    }
}

/// What a person holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ToolResult {
    /// Its name.
    pub name: String,
    /// The link that holds it: its frame is the tool's.
    pub link: String,
    /// Mass, kg.
    pub mass_kg: Measured,
    /// First moments about the link's origin, kg m.
    pub first_moment_kgm: [Measured; 3],
    /// Centre of mass, m; absent if the mass is not determined.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub com_m: Option<[Measured; 3]>,
    /// Ixx, Iyy, Izz, Iyz, Izx, Ixy about the link's origin, kg m².
    pub inertia_kgm2: [Measured; 6],
}

/// What a microcontroller made of the same motions.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DeviceResult {
    /// Which: `inproc` or `qemu`.
    pub mcu: String,
    /// Frames that were streamed to it.
    pub frames: u64,
    /// Rows that it absorbed.
    pub rows: u64,
    /// Largest difference between its parameters and those of the same rows in double precision, in standard
    /// deviations.
    pub largest_difference_sd: f64,
    /// The parameter of which that is.
    pub parameter: String,
    /// Largest difference over what is allowed: 0.05 standard deviations, or 20 ε times condition and size of
    /// the parameters where that is more. At most 1.
    pub share_of_allowed: f64,
    /// Largest difference from the answer, in standard deviations: outliers have less weight in that.
    pub from_answer_sd: f64,
}

/// A choice of motions, and what comes of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ChoiceResult {
    /// How it was made: `D-optimal`, `E-optimal`, `published rule`, `random`; `all` are all motions.
    pub name: String,
    /// True of the choice that the answer rests on.
    pub used: bool,
    /// The motions.
    pub motions: Vec<String>,
    /// Parameters with a relative standard deviation below 5 %.
    pub good: u64,
    /// From 5 to 15 %.
    pub fair: u64,
    /// Above 15 %.
    pub poor: u64,
    /// Parameters below 0.05 kg, kg m or kg m², which are counted apart.
    pub small: u64,
    /// Condition number of the rows; absent if they do not determine everything.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition: Option<f64>,
    /// The same with columns of unit length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition_scaled: Option<f64>,
    /// log10 of the determinant of the information; absent if the rows do not determine everything.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log10_determinant: Option<f64>,
    /// Root mean square of what is left of the whitened rows of motions that were not chosen, with the table
    /// known beforehand; absent if all were.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_out: Option<f64>,
}

/// A segment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SegmentResult {
    /// The link of the model.
    pub name: String,
    /// Mass, kg.
    pub mass_kg: Measured,
    /// The table's mass, kg.
    pub table_mass_kg: f64,
    /// Centre of mass in the segment's axes (x forward, y left, z up when standing) from its proximal joint,
    /// m.
    pub com_m: [Measured; 3],
    /// The table's, m.
    pub table_com_m: [f64; 3],
    /// Radii of gyration about these axes through the centre of mass, m.
    pub radii_m: [f64; 3],
    /// The table's, m.
    pub table_radii_m: [f64; 3],
    /// How much of the variance of the mass among people of one table the rows took away: 0 if they say
    /// nothing of it, 1 if they say all.
    pub informed: f64,
    /// True if the motions tell of this segment's mass: else its values are the table's, near enough.
    #[serde(default)]
    pub identified: bool,
    /// U95 of the table's mass of one person, kg: of people, and of tables that differ.
    #[serde(default)]
    pub table_mass_u95_kg: f64,
}

/// How a channel of left-out motions is predicted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LeftOut {
    /// Its name: `fx`, `fy`, `fz` in the laboratory's axes, `mx`, `my`, `mz` about the pelvis.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Root mean square of what the person's own parameters leave.
    pub rms: f64,
    /// The same of the scaled table.
    pub table_rms: f64,
    /// Mean of what the person's own parameters leave: a constant error, as of a centre of mass that is off.
    #[serde(default)]
    pub mean: f64,
    /// The same of the scaled table.
    #[serde(default)]
    pub table_mean: f64,
    /// The first over the body's weight, of moments over weight times stature, %.
    pub percent_of_weight: f64,
    /// Standard deviation of what was measured.
    pub measured_sd: f64,
    /// Mean gain in squares against the table over its own standard deviation, as the value of a normal
    /// distribution that is exceeded as rarely: below −2 worse than the table beyond chance.
    pub gain_sd: f64,
    /// The same of the scatter, the means of both taken out: two constants of the centre of mass, as any
    /// standing trial shows them, are no gain.
    #[serde(default)]
    pub scatter_gain_sd: f64,
}

/// What became of a trial.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TrialResult {
    /// Its name.
    pub name: String,
    /// Frames of the recording.
    pub frames: u64,
    /// Frames that rows were made of.
    pub used: u64,
    /// Frames per second.
    pub rate_hz: f64,
    /// Frames that were dropped, by the reason.
    pub dropped: Vec<DroppedFrames>,
    /// Contacts that no plate measures; their frames are dropped.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unmeasured: Vec<UnmeasuredContact>,
    /// The largest force beside the plates in the other frames, a mean over 0.35 s, N: of segments that the
    /// table has not right, soft parts, and contacts too light to be named; absent if the trial is too short.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beside_plates_n: Option<f64>,
    /// How far the plates lean against the cameras' vertical by the mean horizontal force, along x and y with
    /// U95, degrees; absent if no stretch of time is long enough.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tilt_deg: Option<[Measured; 2]>,
    /// Places of markers that were filled in.
    pub filled: u64,
    /// Cut-off of the smoothing of markers and plates, Hz.
    pub cut_off_hz: f64,
    /// How late the plates are against the cameras, s, with its U95; absent if it was given or cannot be
    /// determined.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delay_s: Option<Measured>,
    /// True if that was taken out.
    pub delay_taken_out: bool,
    /// Root mean square of the distances of markers from the model, m.
    pub marker_rms_m: f64,
    /// The three markers that are farthest off, with their root mean square, m.
    pub farthest: Vec<FarMarker>,
}

/// A contact that no plate measures: a seat, a rail, a box, a partner.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct UnmeasuredContact {
    /// Its beginning and end, from the trial's first frame on, s.
    pub times_s: [f64; 2],
    /// Its mean force on the person, laboratory axes (z up), N.
    pub force_n: [f64; 3],
    /// Its largest force, N.
    pub most_n: f64,
    /// The link that it pushes at; absent if its line of action passes none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub near: Option<String>,
}

/// Frames dropped for one reason.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DroppedFrames {
    /// The reason.
    pub reason: String,
    /// How many.
    pub frames: u64,
}

/// A marker with its distance from the model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FarMarker {
    /// Its name.
    pub name: String,
    /// Root mean square of its distance, m.
    pub rms_m: f64,
}

//! Numbers and lists.

/// Numbers of errors, as the vendor's.
pub(super) mod error {
    pub(in crate::serve::gcs) const SYNTAX: u16 = 1;
    pub(in crate::serve::gcs) const UNKNOWN_COMMAND: u16 = 2;
    pub(in crate::serve::gcs) const TOO_LONG: u16 = 3;
    pub(in crate::serve::gcs) const NOT_ALLOWED: u16 = 5;
    pub(in crate::serve::gcs) const POSITION: u16 = 7;
    pub(in crate::serve::gcs) const VELOCITY: u16 = 8;
    pub(in crate::serve::gcs) const STOPPED: u16 = 10;
    pub(in crate::serve::gcs) const AXIS: u16 = 15;
    pub(in crate::serve::gcs) const RANGE: u16 = 17;
    pub(in crate::serve::gcs) const PARAMETER_COUNT: u16 = 24;
    pub(in crate::serve::gcs) const NUMBER: u16 = 25;
    pub(in crate::serve::gcs) const IN_MOTION: u16 = 53;
    pub(in crate::serve::gcs) const UNKNOWN_PARAMETER: u16 = 54;
    pub(in crate::serve::gcs) const READ_ONLY: u16 = 64;
    pub(in crate::serve::gcs) const UNDERRUN: u16 = 220;
}

/// Parameters: number, and words about it.
pub(super) const SOURCE: u32 = 0x1900_1900;
pub(super) const EXECUTION: u32 = 0x1900_1901;
pub(super) const THRESHOLD: u32 = 0x1900_1903;
pub(super) const BUFFERED: u32 = 0x1900_1904;
pub(super) const PARAMETERS: [(u32, &str); 4] = [
    (SOURCE, "Trajectory source: 0 profile, 1 consecutive MOV"),
    (EXECUTION, "Trajectory execution: 0 at once, 1 buffered"),
    (THRESHOLD, "Points that start the execution"),
    (BUFFERED, "Points in the buffer"),
];
/// The longest buffer.
pub(super) const MOST_POINTS: f64 = 10_000.0;

/// What is answered to `HLP?`: a command a line.
pub(super) const HELP: [(&str, &str); 34] = [
    ("#4", "status register"),
    ("#5", "motion status"),
    ("#7", "controller ready"),
    ("#11", "free places in the buffer"),
    ("#24", "stop all motion"),
    ("*IDN?", "who this is"),
    ("CSV?", "version of the command set"),
    ("ERR?", "number of the last error"),
    ("FRF", "[{<axis>}] reference move"),
    ("FRF?", "[{<axis>}] whether referenced"),
    ("HLP?", "this list"),
    ("HLT", "[{<axis>}] stop"),
    ("HPA?", "list of parameters"),
    ("MOV", "{<axis> <position>} go there"),
    ("MOV?", "[{<axis>}] commanded position"),
    ("MVR", "{<axis> <distance>} go so far"),
    ("ONT?", "[{<axis>}] whether on target"),
    ("POS?", "[{<axis>}] position"),
    ("PUN?", "[{<axis>}] units"),
    ("SAI?", "[ALL] names of the axes"),
    ("SCT", "T <milliseconds> interval of consecutive MOV"),
    ("SCT?", "interval of consecutive MOV"),
    ("SPA", "{<axis> <parameter> <value>} set"),
    ("SPA?", "[{<axis> <parameter>}] get"),
    ("STP", "stop all motion"),
    ("SVO", "{<axis> <0|1>} servo"),
    ("SVO?", "[{<axis>}] servo"),
    ("TMN?", "[{<axis>}] lowest position"),
    ("TMX?", "[{<axis>}] highest position"),
    ("TRS?", "[{<axis>}] whether there is a reference sensor"),
    ("VER?", "versions"),
    ("VLS", "<velocity> of the platform, mm/s"),
    ("VLS?", "velocity of the platform"),
    ("VMO?", "{<axis> <position>} whether that can be reached"),
];

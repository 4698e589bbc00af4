//! Lists that a controller answers with.

use hexapod::gcs::{PATH_BUFFERED, PATH_POINTS, PATH_SOURCE, PATH_THRESHOLD};

/// Parameters: number, and words about it.
pub(super) const PARAMETERS: [(u32, &str); 4] = [
    (PATH_SOURCE, "Trajectory source: 0 profile, 1 consecutive MOV"),
    (PATH_BUFFERED, "Trajectory execution: 0 at once, 1 buffered"),
    (PATH_THRESHOLD, "Points that start the execution"),
    (PATH_POINTS, "Points in the buffer"),
];
/// The longest buffer.
pub(super) const MOST_POINTS: f64 = 10_000.0;

/// The answer to `HLP?`: a command a line.
pub(super) const HELP: [(&str, &str); 41] = [
    ("#4", "status register"),
    ("#5", "motion status"),
    ("#7", "controller ready"),
    ("#8", "whether a macro runs"),
    ("#11", "free places in the buffer"),
    ("#24", "stop all motion abruptly"),
    ("*IDN?", "who this is"),
    ("CSV?", "version of the command set"),
    ("ERR?", "number of the last error"),
    ("FRF", "[{<axis>}] reference move"),
    ("FRF?", "[{<axis>}] whether referenced"),
    ("HLP?", "this list"),
    ("HLT", "[{<axis>}] stop smoothly"),
    ("HPA?", "list of parameters"),
    ("KEN", "<system> bring a coordinate system into force"),
    ("KEN?", "coordinate systems in force"),
    ("KSD", "<system> {<axis> <offset>} define a coordinate system"),
    ("MAC", "START <name> | STOP: macros; what they do is not simulated"),
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
    ("SPI", "{<R|S|T> <mm>} pivot point"),
    ("SPI?", "pivot point"),
    ("STP", "stop all motion abruptly"),
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

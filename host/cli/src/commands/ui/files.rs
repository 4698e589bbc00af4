//! The files of the page, as `cargo xtask web` leaves them in the folder that RIGIDENT_SITE names while this
//! is compiled.

macro_rules! files {
    ($($name:literal),* $(,)?) => {
        /// The files by their names.
        pub(crate) const FILES: &[(&str, &[u8])] =
            &[$(($name, include_bytes!(concat!(env!("RIGIDENT_SITE"), "/", $name)))),*];
    };
}

files!(
    "index.html",
    "page.css",
    "answer.js",
    "app.js",
    "certificate.js",
    "clocks.js",
    "columns.js",
    "dom.js",
    "person.js",
    "poses.js",
    "program.js",
    "rig.js",
    "sketch.js",
    "store.js",
    "sw.js",
    "tells.js",
    "wasi.js",
    "worker.js",
    "rigident.wasm.gz",
    "example/bracket.csv",
    "example/bracket.rig.toml",
);

//! Recordings read, written, simulated and imported. One test program; a module for each subject.

mod common;

mod faults;
mod findings;
#[cfg(feature = "import")]
mod import_clocks;
#[cfg(feature = "import")]
mod import_containers;
#[cfg(feature = "import")]
mod import_forms;
mod reader;
mod round_trip;
mod segment;
mod simulate;
mod streaming;

/// A file that is not named above would not be compiled.
#[test]
fn every_file_is_a_module() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    for entry in std::fs::read_dir(folder).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if let Some(module) = name.strip_suffix(".rs") {
            assert!(module == "main" || include_str!("main.rs").contains(&format!("mod {module};")), "{name}");
        }
    }
}

//! The program as a whole: what it prints, writes and exits with. One test program, which is linked once and shares what was
//! calibrated; a module for each subject.

mod common;

mod bad_input;
mod batch;
mod browser;
mod calibration_input;
mod closing;
mod estimates;
mod estimators;
mod evaluate_split;
mod explain;
mod export;
mod export_budget;
mod figures;
mod fit_law;
mod fleet;
mod guide;
mod hand;
mod hostile_readings;
mod import_property;
mod lab_files;
mod live;
mod manners;
mod outputs;
mod pipeline;
mod refine;
mod rows_out;
mod sensor_numbers;
mod serial_check;
mod streaming;
mod suits;
mod validity;

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

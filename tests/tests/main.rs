//! What needs more than one crate. One test program; a module for each subject.

mod adskalman_bridge;
mod adskalman_vectors;
mod bank;
mod capacity;
mod consistency;
mod cramer_rao;
mod direction;
mod faults;
mod guards;
mod linear_oracles;
mod long_run;
mod mixture_smoother;
mod mixtures;
mod naive_mixtures;
mod one_kalman_filter;
mod particle_oracles;
mod particles;
mod phase_calibration;
mod properties;
mod published_numbers;
mod representative;
mod running_filter;
mod sparse;
mod stored;

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

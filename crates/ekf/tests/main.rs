//! Estimation through the public interface. One test program; a module for each subject.

mod correction;
mod estimate;
mod hostile;
mod step;

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

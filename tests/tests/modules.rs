//! Every crate's test program: a file that its `main.rs` does not name would not be compiled.

use std::fs;
use std::path::{Path, PathBuf};

/// Returns the folders with a test program: this crate's and those beside it.
fn test_folders() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let crates = fs::read_dir(root.join("../crates")).unwrap().map(|folder| folder.unwrap().path());
    crates
        .chain([root.to_path_buf()])
        .map(|folder| folder.join("tests"))
        .filter(|tests| tests.join("main.rs").exists())
        .collect()
}

#[test]
fn every_file_is_a_module() {
    assert!(test_folders().len() > 5);
    for folder in test_folders() {
        let main = fs::read_to_string(folder.join("main.rs")).unwrap();
        for entry in fs::read_dir(&folder).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            if let Some(module) = name.strip_suffix(".rs") {
                assert!(module == "main" || main.contains(&format!("mod {module};")), "{}: {name}", folder.display());
            }
        }
    }
}

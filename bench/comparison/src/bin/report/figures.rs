//! Measurements of one build.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

use serde_json::Value;

/// Measurements of one build, by name.
pub struct Build {
    /// The processor it was built for.
    pub level: String,
    /// Median time of a step, a row or a pass, ns; named `group/function`.
    nanoseconds: BTreeMap<String, f64>,
    /// Peak heap per sample, bytes.
    bytes: BTreeMap<String, f64>,
}

impl Build {
    /// Reads the results below a build's target directory.
    pub fn read(directory: &Path) -> Result<Self, Box<dyn Error>> {
        let level = directory.file_name().ok_or("a target directory has a name")?.to_string_lossy().into_owned();
        let mut nanoseconds = BTreeMap::new();
        for group in ["step", "recording", "pass"] {
            // A group that was not run appears as "not measured" in the table.
            let Ok(functions) = std::fs::read_dir(directory.join("criterion").join(group)) else { continue };
            for function in functions {
                let (path, name) = function.map(|entry| (entry.path().join("new"), entry.file_name()))?;
                if path.is_dir() {
                    nanoseconds.insert(format!("{group}/{}", name.to_string_lossy()), median_ns(&path)?);
                }
            }
        }
        let mut bytes = BTreeMap::new();
        for line in std::fs::read_to_string(directory.join("memory.txt"))?.lines() {
            let (name, value) = line.split_once(' ').ok_or("expected a name and bytes")?;
            bytes.insert(name.to_owned(), value.parse()?);
        }
        Ok(Self { level, nanoseconds, bytes })
    }

    /// Returns the median time, ns.
    pub fn ns(&self, name: &str) -> Option<f64> {
        self.nanoseconds.get(name).copied()
    }

    /// Returns the peak heap per sample, bytes.
    pub fn bytes(&self, name: &str) -> Option<f64> {
        self.bytes.get(name).copied()
    }
}

/// Returns the median time per element of a benchmark, ns.
fn median_ns(directory: &Path) -> Result<f64, Box<dyn Error>> {
    let json = |file: &str| -> Result<Value, Box<dyn Error>> {
        Ok(serde_json::from_str(&std::fs::read_to_string(directory.join(file))?)?)
    };
    let median = json("estimates.json")?["median"]["point_estimate"].as_f64().ok_or("no median")?;
    let elements = json("benchmark.json")?["throughput"]["Elements"].as_f64().ok_or("no number of elements")?;
    Ok(median / elements)
}
